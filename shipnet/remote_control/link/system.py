"""The link as it is built: line, packets, supervision."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar, check_whole
from shipnet.remote_control.link.supervision import PRINTED, Supervision
from shipnet.remote_control.packet import Format, Markers

__all__ = ["BIT_RATES", "System"]

#: Bit rates that section 5 of chung1998 tries [bit/s].
BIT_RATES = (9600, 4800, 2400, 1200, 600)


@dataclass(frozen=True, slots=True)
class System:
    """Three stations: RCS asks BCS and SS in turn, over a line to each.

    Parameters
    ----------
    packet_format : Format, default ``Markers("A", 10)``
        Form of the packets; its ``n_numbers`` is the number of items, the same on all hops.
    bit_rate : float, default 9600
        1..10e6 [bit/s].
    character_bits : int, default 10
        Bits on the line for a byte, 10 without and 11 with a parity bit (or a second stop bit);
        chung1998 does not say which.
    repeat : int, default 0
        How many values go with each packet in turn, though they have not changed: 0..n_items. 0
        is the rule as printed, n_items sends everything every time.
    processing : float, default 0
        Work on a packet, from its last byte to the first byte of the answer, 0..10 [s]. Longer
        than 0 by Fig. 2, which prints no number.
    master, slave : Supervision, default PRINTED
        Rules of RCS, and of BCS and SS.
    turn_timeout : float, optional
        How long RCS waits for an answer before it goes on to the next partner, 1e-3..3600 [s].
        As printed, there is none: it waits until it takes the partner as failed.
    skip_turns : int, default 0
        How many turns RCS leaves out a partner that it takes as failed, 0..1e6, unless both are.
        Not in the paper.
    ring_size : int, default 128
        Bytes of the receive ring, 2..4096.
    ring_rule : {"meant", "mended"}, default "meant"
        How its reader decides; see `shipnet.remote_control.ring_buffer.Ring`.

    Raises
    ------
    ArgumentError
        If a field is out of its range.

    Examples
    --------
    >>> system = System(bit_rate=600)
    >>> system.n_items, round(system.character_time * 1e3, 2)
    (10, 16.67)
    """

    packet_format: Format = field(default_factory=Markers)
    bit_rate: float = 9600.0
    character_bits: int = 10
    repeat: int = 0
    processing: float = 0.0
    master: Supervision = PRINTED
    slave: Supervision = PRINTED
    turn_timeout: float | None = None
    skip_turns: int = 0
    ring_size: int = 128
    ring_rule: Literal["meant", "mended"] = "meant"

    def __post_init__(self) -> None:
        """Check every field."""
        put = object.__setattr__
        if not hasattr(self.packet_format, "n_numbers"):
            raise ArgumentError(
                f"packet_format is {self.packet_format!r}; it must be a format such as Markers()"
            )
        for name in ("master", "slave"):
            if not isinstance(getattr(self, name), Supervision):
                raise ArgumentError(f"{name} is {getattr(self, name)!r}; it must be a Supervision")
        put(self, "bit_rate", check_scalar("bit_rate", self.bit_rate, "bit/s", 1, 10e6))
        check_whole("character_bits", self.character_bits, 10, 11)
        check_whole("repeat", self.repeat, 0, self.n_items)
        put(self, "processing", check_scalar("processing", self.processing, "s", 0, 10))
        if self.turn_timeout is not None:
            timeout = check_scalar("turn_timeout", self.turn_timeout, "s", 1e-3, 3600)
            put(self, "turn_timeout", timeout)
        check_whole("skip_turns", self.skip_turns, 0, 10**6)
        check_whole("ring_size", self.ring_size, 2, 4096)
        if self.ring_rule not in ("meant", "mended"):
            raise ArgumentError(f"ring_rule is {self.ring_rule!r}; it must be 'meant' or 'mended'")

    @property
    def n_items(self) -> int:
        """Most items of a packet."""
        return self.packet_format.n_numbers

    @property
    def character_time(self) -> float:
        """How long a byte takes [s]."""
        return self.character_bits / self.bit_rate

    def rule(self, station: str) -> Supervision:
        """Return the supervision of a station.

        Parameters
        ----------
        station : str
            RCS, BCS or SS.
        """
        return self.master if station == "RCS" else self.slave

    def signs_of_life(self, n_items: int) -> tuple[int, ...]:
        """Return which bytes of a packet show its receiver that the sender lives.

        Parameters
        ----------
        n_items : int
            How many items it has.

        Returns
        -------
        tuple of int
            Their places, from 0 on: the markers 0xDD; where the format has none, the last byte.
            A value byte 0xDD works as a marker does, but cannot be relied on.
        """
        size = self.packet_format.size(n_items)
        if not isinstance(self.packet_format, Markers):
            return (size - 1,)
        if self.packet_format.reading == "A":
            return (1,)
        return tuple(range(1, 1 + 4 * n_items, 4))
