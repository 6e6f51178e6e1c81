"""Faults of the cable sections, slaves and master ports of a redundant line."""

from __future__ import annotations

from typing import Literal

from shipnet.clock import Fault
from shipnet.fields import choice, record, whole

__all__ = ["Break", "DeadPort", "DeadSlave", "Short"]
__dir__ = __all__.copy

Port = Literal["A", "B"]


@record
class Break(Fault):
    """A section of the cable is interrupted.

    Section k lies between slaves k and k + 1; section 0 is at port A and the last one at port B.

    Examples
    --------
    >>> print(Break(2, start=10))
    break 2
    """

    section: int = whole(0, 247, help="Section of the cable")

    def __str__(self) -> str:
        return f"break {self.section}"


@record
class Short(Fault):
    """A section's conductors touch; without isolators, slaves and ports connected to it are silent.

    Sections are numbered as for `Break`.

    Examples
    --------
    >>> print(Short(2))
    short 2
    """

    section: int = whole(0, 247, help="Section of the cable")

    def __str__(self) -> str:
        return f"short {self.section}"


@record
class DeadSlave(Fault):
    """A slave does not respond, but its cable is intact; slaves are counted from port A.

    Examples
    --------
    >>> print(DeadSlave(3, start=1, stop=2))
    slave 3
    """

    slave: int = whole(1, 247, help="Number of the slave on the cable")

    def __str__(self) -> str:
        return f"slave {self.slave}"


@record
class DeadPort(Fault):
    """A port of the master neither sends nor receives, and does not load the line.

    Examples
    --------
    >>> print(DeadPort("B"))
    port B
    """

    port: Port = choice(("A", "B"), "Port of the master")

    def __str__(self) -> str:
        return f"port {self.port}"
