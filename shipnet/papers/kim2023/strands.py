"""Sections 3.3, 3.5 and 3.6: how many slaves, strands and points."""

from __future__ import annotations

from dataclasses import replace

from shipnet.asi.calls import Call
from shipnet.asi.profile import IO_CONFIGURATIONS, Profile
from shipnet.design.costs import conductors_at_cabinet
from shipnet.design.plant import Plant, lines_needed
from shipnet.papers.registry import check, numeric

__all__: list[str] = []

#: Section 3.3: digital inputs 300 m away. Section 3.5: the submarine, with one contact a slave, the
#: basis on which the printed number comes out.
_FAR = Plant(modules=62, contacts=4)
_SUBMARINE = Plant(modules=190, contacts=1, lines=14)


@numeric("kim2023-001", "icn2007-010", "icn2007-019")
def slaves_per_master(
    *, layout: str = Call.DATA_EXCHANGE.rule.pattern, halves: tuple[str, ...] = ("A", "B")
) -> int:
    """Every address but 0, each for an A and a B slave."""
    return ((1 << layout.count("a")) - 1) * len(halves)


@numeric("kim2023-002")
def hardwired_strands(*, slaves: int = _FAR.modules, inputs: int = _FAR.contacts) -> int:
    """Two wires for each input contact of each module."""
    return conductors_at_cabinet(Plant(slaves, inputs).hardwired)


@numeric("kim2023-003")
def asi_strands(*, lines: int = _FAR.lines) -> int:
    """One line of two wires for all modules."""
    return conductors_at_cabinet(replace(_FAR, lines=lines).on_asi)


@numeric("kim2023-004")
def strands_left(
    *, slaves: int = _FAR.modules, inputs: int = _FAR.contacts, lines: int = _FAR.lines
) -> float:
    """Strands that AS-i leaves of the hardwired ones, in percent."""
    return 100 * asi_strands(lines=lines) / hardwired_strands(slaves=slaves, inputs=inputs)


@numeric("kim2023-005")
def reach(*, segment: float = 100, repeaters: int = 2) -> float:
    """Metres from the master through repeaters in series, one more segment each."""
    return segment * (repeaters + 1)


@numeric("kim2023-072")
def submarine_hardwired(*, slaves: int = _SUBMARINE.modules) -> int:
    """One contact of two wires a slave: the basis on which the printed number comes out."""
    return conductors_at_cabinet(Plant(slaves, contacts=1).hardwired)


@numeric("kim2023-073")
def submarine_asi(*, masters: int = _SUBMARINE.lines) -> int:
    """Two wires a master."""
    return conductors_at_cabinet(replace(_SUBMARINE, lines=masters).on_asi)


@numeric("kim2023-074")
def submarine_left(*, slaves: int = _SUBMARINE.modules, masters: int = _SUBMARINE.lines) -> float:
    """Strands that AS-i leaves on the submarine, in percent."""
    return 100 * submarine_asi(masters=masters) / submarine_hardwired(slaves=slaves)


@check("kim2023-083", counter={"inputs": 1})
def same_wires_per_slave(*, far: int = 62, inputs: int = 4, submarine: int = 190) -> bool:
    """Whether both savings count the same number of hardwired strands for a slave."""
    first = hardwired_strands(slaves=far, inputs=inputs) / far
    return first == submarine_hardwired(slaves=submarine) / submarine


@numeric("kim2023-075")
def points_per_master(*, slaves: int = 62, ports: tuple[str, ...] = IO_CONFIGURATIONS[0]) -> int:
    """Four ports on each of 62 slaves."""
    return slaves * len(ports)


@check("kim2023-076", counter={"profile": "S-7.F"})
def four_outputs_each(*, profile: str = "S-7.A.E") -> bool:
    """Whether a request to a slave that shares its address, as 62 must, has four output bits."""
    return Profile.parse(profile).output_bits == 4


@numeric("kim2023-062")
def lines_for_fermenter(*, valves: int = 400) -> int:
    """Lines for one slave a valve."""
    return lines_needed(valves)


@numeric("kim2023-069")
def slaves_per_submarine_master(*, slaves: int = 190, masters: int = 14) -> float:
    """Average load of a master."""
    return slaves / masters


@numeric("kim2023-070")
def submarine_cable(*, masters: int = 14, repeaters: int = 5, segment: float = 100) -> float:
    """Metres of cable if every segment is as long as it may be."""
    return (masters + repeaters) * segment


@numeric("kim2023-071")
def valves_per_slave(*, valves: int = 200, slaves: int = 190) -> float:
    """Valves for each slave, of which one has four inputs and three or four outputs."""
    return valves / slaves
