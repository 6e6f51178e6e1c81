"""What came of a simulation: who was asked when, and how long data stayed away."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from shipnet.modbus.ring.bounds import System
from shipnet.modbus.ring.faults import Fault
from shipnet.modbus.ring.master import KINDS, A, Try, until_answer

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["Run"]

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]

_NEVER = float("inf")
_SWITCH = KINDS.index("switch")


@dataclass(frozen=True)
class Run:
    """What came of a simulation.

    Parameters
    ----------
    system : Loop or Channels
        What was simulated.
    faults : tuple of Fault
        What failed.
    duration : float
        How long [s].
    tries : list of tuple
        Start [s], slave from 0 on, port, kind and outcome of each try; `polls` shows them.
    """

    system: System
    faults: tuple[Fault, ...]
    duration: float
    tries: list[Try]

    @cached_property
    def polls(self) -> pd.DataFrame:
        """One row a try: ``start_s``, ``end_s`` when the next may begin, ``slave``, ``port``.

        ``kind`` is poll, switch (the other port is asked at once) or probe (what was given up is
        tried again), and ``answered`` says whether the whole response came.
        """
        import pandas as pd

        start, slave, port, kind, answered = self._columns
        poll = self.system.poll
        return pd.DataFrame(
            {
                "start_s": start,
                "end_s": start + np.where(answered, poll.answered, poll.unanswered),
                "slave": slave + 1,
                "port": np.array(["A", "B"])[port],
                "kind": np.array(KINDS)[kind],
                "answered": answered,
            }
        )

    @cached_property
    def _columns(self) -> tuple[Floats, Ints, Ints, Ints, npt.NDArray[np.bool_]]:
        columns = list(zip(*self.tries, strict=True)) if self.tries else [()] * 5
        slave, port, kind = (np.array(column, dtype=np.int64) for column in columns[1:4])
        return (
            np.array(columns[0], dtype=float),
            slave,
            port,
            kind,
            np.array(columns[4], dtype=bool),
        )

    @cached_property
    def _answers(self) -> tuple[Floats, Ints, Ints]:
        """Return end, slave and port of the responses, slave by slave."""
        start, slave, port, _, answered = self._columns
        order = np.flatnonzero(answered)
        order = order[np.argsort(slave[order], kind="stable")]
        return start[order] + until_answer(self.system), slave[order], port[order]

    @property
    def answer_times(self) -> Floats:
        """Ends of all responses, in order [s]."""
        return np.sort(self._answers[0])

    @cached_property
    def gaps(self) -> Floats:
        """Longest time between two answers of each slave, or from the last to the end [s].

        It is the whole duration for a slave that never answered.
        """
        time, slave, _ = self._answers
        last = np.flatnonzero(np.diff(slave, append=-1))
        longest = np.full(self.system.n_slaves, self.duration)
        longest[slave[last]] = self.duration - time[last]
        # The end of the simulation may lie within the last response.
        np.maximum(longest, 0.0, out=longest)
        within = np.flatnonzero(slave[1:] == slave[:-1])
        np.maximum.at(longest, slave[within], time[within + 1] - time[within])
        return longest

    @property
    def table(self) -> pd.DataFrame:
        """One row a slave: what it was served by at the end, and how long it was without.

        Indexed by ``slave``: ``port`` at the end, ``"-"`` if lost; ``answers``; ``longest_gap_s``
        as `gaps`; ``switch_s``, from the first fault to the first answer through another port
        than before; ``recovery_s``, from the last repair to the first answer through port A of a
        slave that was not served from there. NaN where there was none.
        """
        import pandas as pd

        time, slave, port = self._answers
        begin = min((fault.start for fault in self.faults), default=_NEVER)
        mended = max((fault.stop for fault in self.faults if fault.stop < _NEVER), default=_NEVER)
        n = self.system.n_slaves
        served, switch, recovery = np.full(n, "-"), np.full(n, np.nan), np.full(n, np.nan)
        lost, lost_before = self._lost_at(_NEVER), self._lost_at(mended)
        for own in range(n):
            mine = slice(*np.searchsorted(slave, [own, own + 1]))
            when, through = time[mine], port[mine]
            if when.size and own not in lost:
                served[own] = "AB"[through[-1]]
            changed = 1 + np.flatnonzero(np.diff(through))
            after = when[changed[when[changed] >= begin]]
            if after.size:
                switch[own] = after[0] - begin
            before = through[when < mended]
            late = when[(when >= mended) & (through == A)]
            away = (before.size and before[-1] != A) or own in lost_before
            if away and late.size:
                recovery[own] = late[0] - mended
        return pd.DataFrame(
            {
                "port": served,
                "answers": np.bincount(slave, minlength=n),
                "longest_gap_s": self.gaps,
                "switch_s": switch,
                "recovery_s": recovery,
            },
            index=pd.RangeIndex(1, n + 1, name="slave"),
        )

    def _lost_at(self, moment: float) -> set[int]:
        """Return the slaves whose last try before a moment was in vain, through both ports."""
        lost: set[int] = set()
        for start, slave, _, kind, answered in self.tries:
            if start >= moment:
                break
            if answered:
                lost.discard(slave)
            elif kind == _SWITCH:
                lost.add(slave)
        return lost
