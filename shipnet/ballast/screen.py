"""What a master has seen of its valves: every status, every command, and its screen at a time."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.ballast.channels import CHANNELS
from shipnet.ballast.registers import RegisterMap
from shipnet.fields import check_scalar
from shipnet.modbus.pdu import ExceptionCode
from shipnet.modbus.redundancy import Loop
from shipnet.modbus.simulation import Try

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["LEAST_CURRENT", "STATES", "MasterRun", "Shown", "Write", "valve_states"]

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]

#: What a valve can be on the screen. The first that holds counts.
STATES = ("silent", "not seen", "fault", "moving", "open", "closed", "part open")

#: A valve within this of an end counts as open or closed [%]; the paper does not say.
_END = 1.0

#: A motor runs whose current is sent as two steps of its register or more; one may be noise [A].
LEAST_CURRENT = 0.15


class Shown(NamedTuple):
    """A status that came back.

    Attributes
    ----------
    unit : int
        Unit id of the valve.
    read, time : float
        When the slave took its readings, and when the master had them [s].
    registers : tuple of int
        Registers 0x4020 to 0x4023.
    """

    unit: int
    read: float
    time: float
    registers: tuple[int, ...]


class Write(NamedTuple):
    """A command that was sent.

    Attributes
    ----------
    time, end : float
        When its first bit went out, and when the next request could begin [s].
    unit : int
        Unit id of the valve.
    value : int
        What was written to the command register.
    response : bytes
        What came back in time, function code first; empty if nothing did.
    """

    time: float
    end: float
    unit: int
    value: int
    response: bytes

    @property
    def answered(self) -> bool:
        """Whether the command came back as it was sent."""
        return self.response[:1] == b"\x06"

    @property
    def outcome(self) -> str:
        """``done``, ``no answer``, or the name of the exception."""
        if not self.response:
            return "no answer"
        if self.answered:
            return "done"
        return ExceptionCode(self.response[1]).name.replace("_", " ").lower()


def valve_states(
    position: npt.ArrayLike, current: npt.ArrayLike, fault: npt.ArrayLike, *, silent: npt.ArrayLike
) -> npt.NDArray[np.str_]:
    """Return what valves are shown as.

    Parameters
    ----------
    position : array_like of float
        Position [%]; NaN before the first status.
    current : array_like of float
        Motor current [A]: while there is any, the valve moves.
    fault : array_like of int
        Fault that the slave reports, 0 for none.
    silent : array_like of bool
        Whether the valve did not answer.

    Returns
    -------
    ndarray of str
        One of `STATES` each.

    Examples
    --------
    >>> valve_states([0, 100, 40, 40], [0, 0, 1.2, 0], [0, 0, 0, 2], silent=False).tolist()
    ['closed', 'open', 'moving', 'fault']
    """
    place, amps, row = np.asarray(position), np.asarray(current), np.asarray(fault)
    conditions = [
        np.broadcast_to(silent, place.shape), np.isnan(place), row > 0, amps >= LEAST_CURRENT,
        place >= 100 - _END, place <= _END,
    ]  # fmt: skip
    return np.select(conditions, STATES[:-1], STATES[-1])


@dataclass(frozen=True, eq=False)
class MasterRun:
    """What a master has seen; unit ids count from 1 on.

    Parameters
    ----------
    system : Loop
        Its line.
    registers : RegisterMap
        How statuses are read.
    duration : float
        Up to when [s].
    shown : list of Shown
        Statuses in the order in which they came.
    writes : list of Write
        Commands in the order in which they were sent.
    tries : list of tuple
        Polls, as `shipnet.modbus.ring.Run` has them.
    write_time : float
        What a command costs that is answered at once [s].
    """

    system: Loop
    registers: RegisterMap
    duration: float
    shown: list[Shown]
    writes: list[Write]
    tries: list[Try]
    write_time: float

    @cached_property
    def answers(self) -> pd.DataFrame:
        """One row a status: ``unit``, ``read_s``, ``shown_s``, readings, flags, ``fault``.

        ``operating_s`` is how long the motor ran last.
        """
        import pandas as pd

        unit, read, time = self._columns
        words = np.array([s.registers for s in self.shown], np.int64).reshape(-1, 4)
        status = self.registers.unpack(words)
        columns: dict[str, object] = {"unit": unit, "read_s": read, "shown_s": time}
        columns |= {c.column: status.readings[k] for k, c in enumerate(CHANNELS)}
        columns |= {name: getattr(status, name) for name in ("auto", "close", "open", "fault")}
        return pd.DataFrame(columns | {"operating_s": status.operating_time})

    @cached_property
    def commands(self) -> pd.DataFrame:
        """One row a command: ``unit``, ``value``, ``sent_s``, ``free_s``, ``outcome``."""
        import pandas as pd

        rows = [(w.unit, f"0x{w.value:04X}", w.time, w.end, w.outcome) for w in self.writes]
        return pd.DataFrame(rows, columns=["unit", "value", "sent_s", "free_s", "outcome"])

    @cached_property
    def _columns(self) -> tuple[Ints, Floats, Floats]:
        unit = np.array([s.unit for s in self.shown], np.int64)
        times = np.array([(s.read, s.time) for s in self.shown], float).reshape(-1, 2)
        return unit, times[:, 0], times[:, 1]

    def age(self, times: npt.ArrayLike) -> Floats:
        """Return how old what the master shows of each valve is.

        Parameters
        ----------
        times : array_like of float, shape (n_times,)
            When somebody looks at the screen [s].

        Returns
        -------
        ndarray of float, shape (n_times, n_valves)
            Time since the slave took the reading shown [s]; inf before the first.
        """
        looked = np.atleast_1d(np.asarray(times, float))
        last = self._last(looked)
        read = np.append(self._columns[1], -np.inf)
        return np.asarray(looked[:, np.newaxis] - read[last])

    @property
    def longest_age(self) -> Floats:
        """Greatest age of what was shown of each valve, from its first status on, (n_valves,) [s].

        It grows until the next status takes its place, or until the end.
        """
        unit, read, time = self._columns
        longest = np.full(self.system.n_slaves, np.inf)
        for k in range(self.system.n_slaves):
            mine = unit == k + 1
            if mine.any():
                until = np.append(time[mine][1:], self.duration)
                longest[k] = np.max(until - read[mine])
        return longest

    @property
    def scan_gap(self) -> float:
        """Longest time between two statuses of any valve [s]; NaN if none came twice."""
        unit, _, time = self._columns
        gaps = [np.diff(time[unit == k]) for k in range(1, self.system.n_slaves + 1)]
        every = np.concatenate(gaps)
        return float(every.max()) if every.size else float("nan")

    def screen(self, time: float | None = None) -> pd.DataFrame:
        """Return what the master shows at a time.

        Parameters
        ----------
        time : float, optional
            When [s]; at the end if omitted.

        Returns
        -------
        pandas.DataFrame
            Indexed by ``unit``: ``position_percent`` and ``age_s`` (NaN and inf before the first
            status), ``fault`` as the slave reports it, and ``state``, one of `STATES`: a valve is
            silent whose last try before this time was in vain.
        """
        import pandas as pd

        at = self.duration if time is None else check_scalar("time", time, "s", 0, 1e9)
        n = self.system.n_slaves
        last = self._last(np.array([at]))[0]
        seen = last < len(self.shown)
        rows = self.answers.reindex(np.where(seen, last, -1))
        position = rows["VPos_percent"].to_numpy()
        fault = rows["fault"].fillna(0).to_numpy().astype(np.int64)
        state = valve_states(position, rows["MC_A"].to_numpy(), fault, silent=self._silent(at))
        return pd.DataFrame(
            {
                "position_percent": position,
                "age_s": self.age([at])[0],
                "fault": fault,
                "state": state,
            },
            index=pd.RangeIndex(1, n + 1, name="unit"),
        )

    def _last(self, times: Floats) -> Ints:
        """Return which status is shown of each valve, (n_times, n_valves); past the end if none."""
        unit, _, shown = self._columns
        found = np.full((times.size, self.system.n_slaves), len(self.shown))
        for k in range(self.system.n_slaves):
            mine = np.flatnonzero(unit == k + 1)
            place = np.searchsorted(shown[mine], times, side="right") - 1
            there = place >= 0
            found[there, k] = mine[place[there]]
        return found

    def _silent(self, time: float) -> npt.NDArray[np.bool_]:
        silent = np.zeros(self.system.n_slaves, bool)
        spent = (self.system.poll.unanswered_time, self.system.poll.time)
        ended = (t for t in reversed(self.tries) if t[0] + spent[t[4]] <= time + 1e-9)
        unknown = set(range(self.system.n_slaves))
        for _, slave, _, _, answered in ended:
            if slave in unknown:
                silent[slave] = not answered
                unknown.remove(slave)
                if not unknown:
                    break
        return silent
