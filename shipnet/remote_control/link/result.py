"""What came of a simulation of the link."""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.errors import ArgumentError
from shipnet.remote_control.items import Items
from shipnet.remote_control.link.states import State
from shipnet.remote_control.link.system import System
from shipnet.remote_control.signals import HOPS

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["Change", "LinkRun", "Packet", "Update"]


class Change(NamedTuple):
    """A station's own value, by its number, changes at a time [s]."""

    time: float
    station: str
    number: int
    value: int


class Update(NamedTuple):
    """A station has got a value from another at a time [s]."""

    time: float
    station: str
    source: str
    number: int
    value: int


@dataclass(slots=True)
class Packet:
    """A packet on the line.

    Parameters
    ----------
    start, end : float
        First and last bit [s].
    source, target : str
        From whom to whom.

    Attributes
    ----------
    items : Items
        What was sent.
    received : Items or None
        What the receiver took, None if nothing.
    read : float
        When its task found the packet [s]; NaN if never.
    disturbed : bool
        Whether a bit was inverted, or the packet lost.
    """

    start: float
    end: float
    source: str
    target: str
    items: Items = ()
    received: Items | None = None
    read: float = float("nan")
    disturbed: bool = False

    @property
    def outcome(self) -> str:
        """What became of it: "ok", "wrong" values taken, or "lost"."""
        if self.received is None:
            return "lost"
        return "ok" if self.received == self.items else "wrong"


@dataclass
class LinkRun:
    """A finished simulation.

    Parameters
    ----------
    system : System
        The link.
    duration : float
        How long it was simulated [s].

    Attributes
    ----------
    packets : list of Packet
        All packets that were begun.
    changes : list of Change
        What was changed.
    updates : list of Update
        What was heard of it.
    signs : list of (float, str, str, int)
        Time [s], receiver and sender of each sign of life, and how many ticks had been counted.
    most_unread : int
        Most bytes that waited in a ring when its task looked.
    """

    system: System
    duration: float
    packets: list[Packet] = field(default_factory=list)
    changes: list[Change] = field(default_factory=list)
    updates: list[Update] = field(default_factory=list)
    signs: list[tuple[float, str, str, int]] = field(default_factory=list)
    most_unread: int = 0
    _events: list[tuple[float, str, str, str, str]] = field(default_factory=list)
    _states: list[tuple[float, str, State]] = field(default_factory=list)

    def note(self, time: float, station: str, event: str, partner: str, detail: str) -> None:
        """Add an event."""
        self._events.append((time, station, event, partner, detail))

    def note_state(self, time: float, station: str, state: State) -> None:
        """Add a change of state."""
        self._states.append((time, station, state))

    @cached_property
    def table(self) -> pd.DataFrame:
        """What is out of the ordinary.

        A row an event: ``time_s``, ``station``, ``event``, ``partner``, ``detail``. Events are
        "failed" and "answered" (a partner), "given up" (a turn), "ring repaired", "ring stopped",
        "ring overrun unseen", "task stalls", "station stops" and "station starts".
        """
        import pandas as pd

        columns = ["time_s", "station", "event", "partner", "detail"]
        return pd.DataFrame(self._events, columns=columns)

    @cached_property
    def traffic(self) -> pd.DataFrame:
        """All packets.

        A row a packet: ``start_s``, ``end_s``, ``source``, ``target``, ``n_items``, ``read_s``
        (NaN if never), ``disturbed``, ``outcome`` (ok, wrong, lost).
        """
        import pandas as pd

        rows = [
            (p.start, p.end, p.source, p.target, len(p.items), p.read, p.disturbed, p.outcome)
            for p in self.packets
        ]
        columns = ["start_s", "end_s", "source", "target", "n_items", "read_s", "disturbed"]
        return pd.DataFrame(rows, columns=[*columns, "outcome"])

    @cached_property
    def states(self) -> pd.DataFrame:
        """A row a change of state: ``time_s``, ``station``, ``state``, ``comm_f``."""
        import pandas as pd

        rows = [(time, name, state.value, state.comm_f) for time, name, state in self._states]
        table = pd.DataFrame(rows, columns=["time_s", "station", "state", "comm_f"])
        return table.astype({"comm_f": "Int64"})

    @property
    def alarms(self) -> pd.DataFrame:
        """The rows of `table` in which a station takes a partner as failed."""
        return self.table[self.table["event"] == "failed"].reset_index(drop=True)

    @property
    def cycle_times(self) -> npt.NDArray[np.float64]:
        """Times from one packet of RCS to BCS to the next, shape (n_cycles,) [s]."""
        starts = [p.start for p in self.packets if (p.source, p.target) == HOPS[0]]
        return np.diff(np.array(starts, dtype=float))

    def ticks(self, station: str) -> int:
        """Return how many ticks a station had counted at most when a sign of life came.

        Parameters
        ----------
        station : str
            RCS, BCS or SS.
        """
        return max((ticks for _, name, _, ticks in self.signs if name == station), default=0)

    def silences(self, station: str) -> npt.NDArray[np.float64]:
        """Return how long a slave heard nothing after each of its own packets.

        Parameters
        ----------
        station : {"BCS", "SS"}
            The slave.

        Returns
        -------
        ndarray of float, shape (n_packets,)
            Time from its last bit to the next sign of life [s]; without those that had not come
            when the simulation ended.

        Raises
        ------
        ArgumentError
            If it is no slave.
        """
        if station not in ("BCS", "SS"):
            raise ArgumentError(f"station is {station!r}; it must be 'BCS' or 'SS'")
        signs = np.array([time for time, name, _, _ in self.signs if name == station])
        ends = np.array([p.end for p in self.packets if p.source == station])
        place = np.searchsorted(signs, ends, side="right")
        heard = place < signs.size
        return np.asarray(signs[place[heard]] - ends[heard], dtype=float)

    def delays(self, reader: str) -> pd.DataFrame:
        """Return when a station learnt of each change at the others.

        Parameters
        ----------
        reader : str
            RCS, BCS or SS.

        Returns
        -------
        pandas.DataFrame
            A row a change: ``time_s``, ``station``, ``number``, ``value``, ``delay_s``: 0 where
            the reader still had the value from before; NaN where the value had changed again, or
            the simulation ended, before the reader had it.
        """
        import pandas as pd

        rows = []
        for change in self.changes:
            if change.station == reader:
                continue
            later = (c.time for c in self.changes if c[1:3] == change[1:3] and c.time > change.time)
            until = min(later, default=float("inf"))
            own = (u for u in self.updates if (u.station, u.number) == (reader, change.number))
            history = [(0.0, 0), *((update.time, update.value) for update in own)]
            shown = bisect_left(history, (change.time, -1)) - 1
            heard = (
                max(time - change.time, 0.0)
                for time, value in history[max(shown, 0) :]
                if value == change.value and time < until
            )
            delay = next(heard, float("nan"))
            rows.append((*change, delay))
        return pd.DataFrame(rows, columns=["time_s", "station", "number", "value", "delay_s"])
