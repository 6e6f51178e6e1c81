"""Sections 3.3 to 3.6: strands, addresses, times, and what AS-i is too slow for."""

from __future__ import annotations

from dataclasses import replace

from shipnet import datasets
from shipnet.asi.commands import ChangeAddress, ReadCodes
from shipnet.asi.profile import IO_CONFIGURATIONS, Profile
from shipnet.asi.simulation import simulate
from shipnet.asi.slave import Slave
from shipnet.asi.telegram import REQUEST_BITS, Call
from shipnet.asi.timing import BIT_TIME, Cycle, Transaction, transfer_cycles
from shipnet.design.costs import conductors_at_cabinet
from shipnet.design.plant import Plant, lines_needed
from shipnet.papers.registry import check, numeric

# Sections 3.3, 3.5 and 3.6: how many slaves, strands and points.


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


# Section 3.4, commands (c) to (e): addresses and ID codes of slaves, on a simulated line.


@check("kim2023-091", counter={"target": "3"})
def moves(*, target: str = "9") -> bool:
    """Whether a slave in operation moves to another address, and answers there."""
    slaves = [Slave(label) for label in "123"]
    run = simulate(slaves, until=0.3, commands=[(0.05, ChangeAddress("2", target))])
    calls = run.events().query("slave in ['0', '2']")["call"].tolist()
    in_order = "DELETE_ADDRESS" in calls and calls.index("DELETE_ADDRESS") < calls.index(
        "ASSIGN_ADDRESS"
    )
    later = run.events().query("time_s > 0.25 and call == 'DATA_EXCHANGE' and outcome == 'ok'")
    return in_order and target in set(later["slave"])


@check("kim2023-097", counter={"addresses": (1, 2)})
def codes_tell_apart(*, addresses: tuple[int, int] = (1, 1)) -> bool:
    """Whether reading ID code 1 of two slaves of one kind at these addresses gives both codes."""
    slaves = [Slave(f"{address}", id1=k) for address, k in zip(addresses, (1, 2), strict=True)]
    asked = [(0.05, ReadCodes(str(address))) for address in sorted(set(addresses))]
    run = simulate(slaves, until=0.2, commands=asked)
    answers = run.events().query("time_s > 0.05 and call == 'READ_ID1' and outcome == 'ok'")
    return set(answers["response_data"]) == {1, 2}


# Section 3.4: bits, pauses and cycles in time.


_PUBLISHED = datasets.read("asi_published_timing.csv").set_index("quantity")["value_us"]

#: Delays between request and response that a chip maker prints [s]: synchronous least and most,
#: then asynchronous least and most.
CHIP_EDGES = tuple(
    1e-6 * float(_PUBLISHED[f"edge to edge, {state}, {end}"])
    for state in ("synchronous", "asynchronous")
    for end in ("least", "most")
)

#: How long a master may wait before its next request [s].
LONGEST_PAUSE = 1e-6 * float(_PUBLISHED["longest pause before the next request"])


@numeric("kim2023-020")
def bit_time_from_rate(*, rate: float = 167e3) -> float:
    """Microseconds a bit, from the rate that the paper prints."""
    return 1e6 / rate


@numeric("kim2023-021", "icn2007-006")
def gross_rate(*, bit_time: float = BIT_TIME) -> float:
    """Kilobits a second, from the bit time."""
    return 1e-3 / bit_time


@numeric("kim2023-022")
def half_bit(*, bit_time: float = BIT_TIME) -> float:
    """Microseconds of a Manchester half-bit."""
    return 1e6 * bit_time / 2


def master_pause_of_chip(*, edge: float, bit_time: float = BIT_TIME) -> float:
    """Pause between request and response, from a chip's delay between two edges."""
    return edge / bit_time - 1


@check("kim2023-028", "icn2007-014", counter={"edges": (10e-6, 33.5e-6)})
def master_pause_in_range(*, edges: tuple[float, ...] = CHIP_EDGES) -> bool:
    """Whether the delays of a chip are pauses of 2 to 10 bit times."""
    return all(2 <= master_pause_of_chip(edge=edge) <= 10 for edge in edges)


@check("kim2023-030", "icn2007-016", counter={"longest": 12e-6})
def slave_pause_at_most_2(*, longest: float = LONGEST_PAUSE) -> bool:
    """Whether the pause after a response never exceeds 2 bit times."""
    return longest <= 2 * BIT_TIME


@numeric("kim2023-031", master_pause=2, slave_pause=1.5)
@numeric("kim2023-032", "icn2007-030", master_pause=3, slave_pause=2)
def transaction(*, master_pause: float, slave_pause: float) -> float:
    """Bit times with the shortest pauses that are printed, or with those of vendors' 156 us."""
    return Transaction(master_pause, slave_pause).bits


@numeric("kim2023-033")
def unanswered_transaction(*, request: int = REQUEST_BITS, timeout: float = 10) -> float:
    """Bit times until a master that hears nothing may send again."""
    return request + timeout


@numeric("kim2023-034")
def cycle_standard(
    *, slaves: int = 31, transaction: float = 26, bit_time: float = BIT_TIME
) -> float:
    """Milliseconds to poll all slaves once, with one more request for inclusion."""
    return 1e3 * (slaves + 1) * transaction * bit_time


@numeric("kim2023-035")
def cycle_extended(
    *, pairs: int = 31, transaction: float = 26, bit_time: float = BIT_TIME
) -> float:
    """Milliseconds until every A and every B slave was polled: two cycles."""
    return 2 * cycle_standard(slaves=pairs, transaction=transaction, bit_time=bit_time)


# Section 3.3: messages of more than four bits, and what they are too slow for.


#: Values that a period of a control loop's bandwidth needs; 10 to 30 are usual: K. J. Astrom,
#: B. Wittenmark, "Computer-Controlled Systems", 3rd ed., 1997, section 2.9.
SAMPLES = 20.0


def least_cycles(bits: int, *, bits_per_cycle: int = 4) -> int:
    """Return in how many cycles a message passes if every bit of every cycle carries it."""
    return -(-bits // bits_per_cycle)


@check("kim2023-009", counter={"bits": 4})
def several_cycles(*, bits: int = 5) -> bool:
    """Whether this many bits, and a value of profile S-7.3, take several cycles."""
    return least_cycles(bits) > 1 and transfer_cycles("S-7.3") > 1


@check("kim2023-090", counter={"loop": 0.1})
def too_slow_for_loops(*, process: float = 1 / 60, loop: float = 10.0) -> bool:
    """Whether a value of 16 bits serves a process, but not a loop, of these bandwidths [Hz].

    A slow process is one a minute; ten a second is what a drive's speed loop needs at least.
    """
    fastest = 1 / (SAMPLES * float(Cycle(31).transfer_time("S-7.3")))
    return bool(process < fastest < loop)
