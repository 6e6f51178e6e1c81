"""A second master that listens, and goes on where the first one falls silent."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shipnet.asi.calls import Call
from shipnet.asi.simulation.master import Master
from shipnet.asi.simulation.orders import KINDS
from shipnet.asi.simulation.record import EXECUTED, OUTCOME, Record
from shipnet.errors import ArgumentError

__all__ = ["Standby"]


@dataclass(frozen=True)
class Standby:
    """A standby master.

    Parameters
    ----------
    master : Master
        What it becomes. It must know the projected slaves: from the bits alone nobody tells four
        outputs of a standard slave from three of an A/B slave.
    silence : float, default 1e-3
        After this silence it takes over [s]; it must exceed the longest that a working master
        leaves, a time-out or a pause of up to 500 us. Our assumption: no source gives a value.

    Raises
    ------
    ArgumentError
        If no slave is projected, or the silence is not above 500 us.

    References
    ----------
    .. [1] "AS-Interface communication system for field networks (2)", ICN, July 2007,
       data link layer, section 1.

    Examples
    --------
    >>> Standby(Master({"5": "S-0.F"})).silence
    0.001
    """

    master: Master
    silence: float = 1e-3

    def __post_init__(self) -> None:
        """Check the silence, and that slaves are projected."""
        if not 500e-6 < self.silence < float("inf"):
            raise ArgumentError(f"silence is {self.silence} s; it must be above 500 us, and finite")
        if not self.master.lists.projected:
            raise ArgumentError("master has no projected slaves; a standby master must know them")

    def listen(self, record: Record) -> dict[str, int]:
        """Return what it knows from the traffic of the last three cycles.

        Parameters
        ----------
        record : Record
            What was on the line.

        Returns
        -------
        dict of str to int
            The projected slaves that took part in data exchange, with the outputs sent last.
        """
        begins = [row for row, number in record.cycles if number >= 0]
        first = begins[max(0, len(begins) - 3)] if begins else len(record.code)
        rows = np.array(record.code[first:], dtype=np.int64)
        fine = (rows >> OUTCOME & 15 == 0) & (rows >> EXECUTED & 1 == 1)
        known = {}
        for code in rows[fine & (rows & 15 == Call.DATA_EXCHANGE)].tolist():
            label = f"{code >> 4 & 31}{KINDS[code >> 9 & 3] or ''}"
            if label in self.master.lists.projected:
                known[label] = code >> 11 & 31
        return known
