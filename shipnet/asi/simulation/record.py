"""The record of a simulation: one row a transaction, packed while it runs, unpacked afterwards.

A row is three numbers: when it began, how long the master waited for the response, and everything
else in the bits of one integer. Writing them costs a simulation little; the columns that people
read are made from them for all rows at once.
"""

from __future__ import annotations

from array import array
from collections.abc import Sequence
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from shipnet.asi.batch import encode_requests
from shipnet.asi.calls import Call
from shipnet.asi.simulation.master import Phase
from shipnet.asi.timing import Timing
from shipnet.errors import SilenceError, explain

if TYPE_CHECKING:
    import pandas as pd

__all__ = [
    "ATTEMPT",
    "EXECUTED",
    "NO_RESPONSE",
    "OUTCOME",
    "PHASE",
    "RESPONSE",
    "STANDBY",
    "Record",
]

#: Where each field stands above the 16 bits of `Order.code`.
ATTEMPT, PHASE, OUTCOME, RESPONSE, EXECUTED, STANDBY = 16, 19, 22, 26, 31, 32

#: Stands in the field of the response where there is none.
NO_RESPONSE = 16

_OUTCOMES = [explain(code) for code in range(SilenceError.code + 1)]

Integers = npt.NDArray[np.int64]


class Record:
    """Columns that grow with the simulation.

    Parameters
    ----------
    timing : Timing
        The pauses of the line.

    Attributes
    ----------
    start : array of float
        When each request began [bit].
    pause : array of float
        Pause before the response as the master hears it [bit]; NaN where it heard none.
    code : array of int
        The packed fields.
    cycles : list of (int, int)
        Row and number of the cycle of each begin of a cycle.

    Examples
    --------
    A simulation fills it; here one row is put in by hand:

    >>> from shipnet.asi.simulation.orders import order
    >>> record = Record(Timing())
    >>> sent = order(Call.DATA_EXCHANGE, 5, 3).code | Phase.DATA_EXCHANGE << PHASE
    >>> record.put(0.0, 3.0, sent | 6 << RESPONSE | 1 << EXECUTED)
    >>> row = record.table().iloc[0]
    >>> print(row["call"], row["slave"], row["request"], row["response_data"])
    DATA_EXCHANGE 5 00001010001101 6
    """

    def __init__(self, timing: Timing) -> None:
        self.timing = timing
        self.start = array("d")
        self.pause = array("d")
        self.code = array("q")
        self.cycles: list[tuple[int, int]] = []

    def put(self, start: float, pause: float, code: int) -> None:
        """Add a row."""
        self.start.append(start)
        self.pause.append(pause)
        self.code.append(code)

    def field(self, shift: int, bits: int) -> Integers:
        """Return one packed field of all rows."""
        return np.frombuffer(self.code, dtype=np.int64) >> shift & (1 << bits) - 1

    @cached_property
    def starts(self) -> npt.NDArray[np.float64]:
        """When each request began [bit]."""
        return np.frombuffer(self.start, dtype=np.float64)

    @cached_property
    def pauses(self) -> npt.NDArray[np.float64]:
        """Pause before each response [bit]; NaN where there was none."""
        return np.frombuffer(self.pause, dtype=np.float64)

    @cached_property
    def cycle(self) -> Integers:
        """Number of the cycle of each row; -1 before the first."""
        cycle = np.full(self.starts.size, -1, dtype=np.int64)
        for row, number in self.cycles[:1]:
            cycle[row:] = number
        if len(self.cycles) > 1:
            rows, numbers = np.array(self.cycles).T
            ends = np.append(rows[1:], self.starts.size)
            cycle[rows[0] :] = np.repeat(numbers, ends - rows)
        return cycle

    def table(self) -> pd.DataFrame:
        """Return all rows with the columns that people read.

        Returns
        -------
        pandas.DataFrame
            One row a transaction: ``time_s``, ``cycle``, ``phase``, ``call``, ``address``,
            ``half``, ``slave``, ``request`` (14 bits), ``request_data``, ``response_data`` (-1
            without one), ``master_pause_bit``, ``slave_pause_bit``, ``attempt`` (0 is the first),
            ``outcome`` (ok, or an error class of `shipnet.errors`; silence where an answer was
            due is ``SilenceError``), ``executed``, ``executed_but_lost``, ``standby``.
        """
        import pandas as pd

        call, address, half = self.field(0, 4), self.field(4, 5), self.field(9, 2)
        data, outcome, response = self.field(11, 5), self.field(OUTCOME, 4), self.field(RESPONSE, 5)
        executed = self.field(EXECUTED, 1).astype(bool)
        words, _ = encode_requests(call, address, data, half=half - 1)
        texts = np.array([f"{word:014b}" for word in range(1 << 14)])
        labels = np.array([[f"{a}{h}" for h in ("", "A", "B")] for a in range(32)])

        def named(codes: Integers, names: Sequence[str]) -> pd.Categorical[str]:
            whole = pd.Categorical.from_codes(codes, pd.Index(names))
            return whole.remove_unused_categories()

        return pd.DataFrame(
            {
                "time_s": self.starts * self.timing.bit_time,
                "cycle": self.cycle,
                "phase": named(self.field(PHASE, 3), [phase.name.lower() for phase in Phase]),
                "call": named(call, [call.name for call in Call]),
                "address": address,
                "half": named(half, ["", "A", "B"]),
                "slave": labels[address, half],
                "request": texts[words],
                "request_data": data,
                "response_data": np.where(response == NO_RESPONSE, -1, response),
                "master_pause_bit": self.pauses,
                "slave_pause_bit": np.where(np.isnan(self.pauses), np.nan, self.timing.slave_pause),
                "attempt": self.field(ATTEMPT, 3),
                "outcome": named(outcome, _OUTCOMES),
                "executed": executed,
                "executed_but_lost": executed & (outcome > 0),
                "standby": self.field(STANDBY, 1).astype(bool),
            }
        )
