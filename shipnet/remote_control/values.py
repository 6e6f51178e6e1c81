"""What the three stations send each other: bridge, engine room and safety system.

The names are those of chung1998, sections 2 and 5. The numbers, and that these are all values, are
our assumption: the drawing of its Fig. 1 is not in the text that we have.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

from shipnet.errors import ArgumentError

Hop = tuple[str, str]

#: Remote control system in the engine room (the master), bridge control system, safety system.
STATIONS = ("RCS", "BCS", "SS")

#: Senders and receivers, in the order of a cycle: chung1998, section 4.
HOPS: tuple[Hop, ...] = (("RCS", "BCS"), ("BCS", "RCS"), ("RCS", "SS"), ("SS", "RCS"))


@dataclass(frozen=True, slots=True)
class Value:
    """A value of 16 bits that crosses the link, the stations that set it and those that read it.

    `where` is the section of chung1998 that names it; the number is ours.
    """

    number: int
    name: str
    kind: Literal["switch", "command", "measurement", "state"]
    sources: tuple[str, ...]
    readers: tuple[str, ...]
    where: str

    @property
    def mirrored(self) -> bool:
        """Whether two stations have the same switch."""
        return len(self.sources) > 1

    @property
    def routes(self) -> tuple[tuple[str, ...], ...]:
        """The stations that it passes, one tuple per source and other station that uses it."""
        # BCS and SS have no line between them: what one sends the other goes through RCS.
        users = (*self.sources, *self.readers)
        pairs = [(a, b) for a in self.sources for b in users if a != b]
        return tuple((a, b) if "RCS" in (a, b) else (a, "RCS", b) for a, b in pairs)

    @property
    def hops(self) -> tuple[Hop, ...]:
        """The lines on which the value is sent, in the order of a cycle."""
        crossed = {hop for route in self.routes for hop in pairwise(route)}
        return tuple(hop for hop in HOPS if hop in crossed)


#: Switches come first, so that a link of few items has them.
VALUES = (
    Value(0, "control_position", "switch", ("BCS", "RCS"), (), "2; 5"),
    Value(1, "shutdown_cancel", "switch", ("BCS", "SS"), ("RCS",), "5"),
    Value(2, "slowdown_cancel", "switch", ("BCS", "SS"), ("RCS",), "5"),
    Value(3, "speed_command", "command", ("BCS",), ("RCS",), "2"),
    Value(4, "speed", "measurement", ("RCS",), ("BCS", "SS"), "2"),
    Value(5, "engine_state", "state", ("RCS",), ("BCS", "SS"), "2"),
    Value(6, "alarm", "state", ("RCS",), ("BCS", "SS"), "2"),
    Value(7, "safety_speed", "measurement", ("SS",), ("RCS", "BCS"), "2"),
    Value(8, "overspeed", "state", ("SS",), ("RCS", "BCS"), "2"),
    # Shutdown and slowdown fit into one value of 16 bits: the paper sends ten values.
    Value(9, "shutdown_slowdown", "state", ("SS",), ("RCS", "BCS"), "2"),
)


def values_on(source: str, target: str) -> tuple[Value, ...]:
    """Return the values that one station sends to another, by number."""
    if (source, target) not in HOPS:
        lines = ", ".join(f"{a} to {b}" for a, b in HOPS)
        raise ArgumentError(f"source and target are {source!r}, {target!r}; the lines are {lines}")
    return tuple(value for value in VALUES if (source, target) in value.hops)


def forwarded(source: str, target: str) -> frozenset[int]:
    """Return the numbers of the values that RCS forwards from one slave to the other."""
    if {source, target} != {"BCS", "SS"}:
        raise ArgumentError(f"source and target are {source!r}, {target!r}; they must be BCS, SS")
    route = (source, "RCS", target)
    return frozenset(value.number for value in VALUES if route in value.routes)
