"""What came of a simulation: ages, marks, alarms, answers, loads."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.clock import nanoseconds
from shipnet.engine.ams import OUTCOMES, Attempts
from shipnet.engine.exchange import Frames, Rounds
from shipnet.engine.faults import Fault, StuckSensor, outages
from shipnet.engine.firmware import Cpu
from shipnet.engine.system import System
from shipnet.errors import ArgumentError

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["Run", "Shown", "Views"]

Bools = npt.NDArray[np.bool_]
Integers = npt.NDArray[np.int64]


class Views(NamedTuple):
    """What the AMS knows after each answer.

    Attributes
    ----------
    seen : ndarray of int64, shape (n_views,)
        When the answer was complete [ns].
    number : ndarray of int64, shape (n_views, n_messages)
        Round of the sender's loop that the values of each message are from; -1 if they are
        missing or marked.
    known : ndarray of int64, shape (n_views, n_messages)
        No value of the message was sampled earlier, as far as the reader can tell [ns].
    """

    seen: Integers
    number: Integers
    known: Integers


class Shown(NamedTuple):
    """What the AMS shows of a point, one entry a view.

    Attributes
    ----------
    seen, until : ndarray of int64, shape (n_views,)
        From when to when [ns].
    good : ndarray of bool, shape (n_views,)
        Whether it is shown as good at first.
    good_until : ndarray of int64, shape (n_views,)
        Until when it is shown as good [ns]; `seen` if it is marked from the start.
    sampled : ndarray of int64, shape (n_views,)
        When the value was true [ns]; of no meaning where it is marked.
    """

    seen: Integers
    until: Integers
    good: Bools
    good_until: Integers
    sampled: Integers


@dataclass(frozen=True)
class Run:
    """A finished simulation.

    Parameters
    ----------
    system : System
        The system.
    end : int
        When it ended [ns].
    faults : tuple of Fault
        What went wrong.
    attempts : Attempts
        Requests of the AMS.
    cpus : tuple of Cpu
        The Modbus interrupts of each box.
    loops : tuple of Rounds
        The loop of each box.
    sent : Frames
        What went over the CAN bus.
    views : Views
        What the AMS knew.
    paths : tuple of Views
        In the mended coding, what it knew by each channel that it always polls.
    """

    system: System
    end: int
    faults: tuple[Fault, ...]
    attempts: Attempts
    cpus: tuple[Cpu, ...]
    loops: tuple[Rounds, ...]
    sent: Frames
    views: Views
    paths: tuple[Views, ...] = ()

    def shown(self, tag: str) -> Shown:
        """Return what the AMS shows of a point.

        Parameters
        ----------
        tag : str
            The point.

        Raises
        ------
        ArgumentError
            If there is no such point.
        """
        return self._shown(self._place(tag))

    def _place(self, tag: str) -> int:
        tags = [point.tag for point in self.system.points]
        if tag not in tags:
            raise ArgumentError(f"tag is {tag!r}; it must be one of {tags[0]} .. {tags[-1]}")
        return tags.index(tag)

    def _shown(self, place: int) -> Shown:
        system, message = self.system, self.system.message_of[place]
        box = int(system.sender[message])
        number = self.views.number[:, message]
        begun = self.loops[box].work[number] + system.offset_ns[place]
        sampled = self.cpus[box].at(begun)
        for begin, stop in outages(self.faults, system.points[place].tag, StuckSensor):
            sampled = np.where((sampled > begin) & (sampled < stop), begin, sampled)
        until, good, good_until = self._good
        return Shown(self.views.seen, until, good[:, message], good_until[:, message], sampled)

    @cached_property
    def _good(self) -> tuple[Integers, Bools, Integers]:
        """Until when each view holds, which messages are shown as good, and until when [ns]."""
        seen = self.views.seen
        until = np.append(seen[1:], max(self.end, int(seen.max(initial=0))))
        good = self.views.number >= 0
        good_until = np.broadcast_to(until[:, None], good.shape)
        if self.system.coding == "mended":
            limit = self.views.known + nanoseconds(self.system.age_limit)
            good, good_until = good & (limit > seen[:, None]), np.minimum(good_until, limit)
        return until, good, np.where(good, good_until, seen[:, None])

    def ages(self, tag: str) -> pd.DataFrame:
        """Return the age of a point over time.

        Parameters
        ----------
        tag : str
            The point.

        Returns
        -------
        pandas.DataFrame
            One row an answer of a box: ``seen_s``, ``until_s`` (the next answer), ``good_until_s``
            (until when it is shown as good), ``sampled_s``, ``age_s`` when it is seen and
            ``last_age_s`` when it is last shown as good; ages are NaN where it is marked at once.
        """
        import pandas as pd

        shown = self.shown(tag)
        good = shown.good
        columns = {
            "seen_s": shown.seen,
            "until_s": shown.until,
            "good_until_s": shown.good_until,
            "sampled_s": np.where(good, shown.sampled, np.nan),
            "age_s": np.where(good, shown.seen - shown.sampled, np.nan),
            "last_age_s": np.where(good, shown.good_until - shown.sampled, np.nan),
        }
        return pd.DataFrame({name: values / 1e9 for name, values in columns.items()})

    @cached_property
    def table(self) -> pd.DataFrame:
        """One row a point.

        ``tag``, ``box``, ``worst_s`` (greatest age shown as good), ``mean_s`` (mean age over the
        time in which it is shown as good), ``marked_s`` (how long it is marked), ``sampled_s``
        (when the value that is shown as good at last was true, NaN without any) and
        ``good_until_s`` (when it was last shown as good).
        """
        import pandas as pd

        rows = []
        for place, point in enumerate(self.system.points):
            shown = self._shown(place)
            length = shown.good_until - shown.seen
            good = np.flatnonzero(shown.good)
            marked = int((shown.until - shown.good_until).sum()) / 1e9
            row = [point.tag, point.box, np.nan, np.nan, marked, np.nan, np.nan]
            if good.size:
                length = length[good]
                last = shown.good_until[good] - shown.sampled[good]
                middle = last - length / 2
                mean = float(np.average(middle, weights=np.maximum(length, 1)))
                sampled = int(shown.sampled[good].max())
                until = int(shown.good_until[good].max())
                row[2:4] = [int(last.max()) / 1e9, mean / 1e9]
                row[5:] = [sampled / 1e9, until / 1e9]
            rows.append(row)
        columns = ["tag", "box", "worst_s", "mean_s", "marked_s", "sampled_s", "good_until_s"]
        return pd.DataFrame(rows, columns=columns)

    @cached_property
    def requests(self) -> pd.DataFrame:
        """One row a request: ``poll``, ``channel``, ``time_s``, ``outcome``."""
        import pandas as pd

        return pd.DataFrame(
            {
                "poll": self.attempts.poll,
                "channel": self.attempts.channel + 1,
                "time_s": self.attempts.start / 1e9,
                "outcome": pd.Categorical.from_codes(self.attempts.outcome, pd.Index(OUTCOMES)),
            }
        )

    @cached_property
    def answers(self) -> pd.DataFrame:
        """One row a poll: ``poll``, ``time_s``, ``answer_s`` (how long; infinite without one)."""
        import pandas as pd

        rows = pd.DataFrame(self.attempts._asdict())
        took = np.where(rows["outcome"] == 0, nanoseconds(self.system.poll.time), np.inf)
        rows["end"] = rows["start"] + took
        by = rows.groupby("poll").agg(start=("start", "min"), end=("end", "min")).reset_index()
        return pd.DataFrame(
            {
                "poll": by["poll"],
                "time_s": by["start"] / 1e9,
                "answer_s": (by["end"] - by["start"]) / 1e9,
            }
        )

    @cached_property
    def alarms(self) -> pd.DataFrame:
        """What the AMS raises: ``time_s``, ``source`` (a tag or a channel), ``kind``.

        Kinds are ``no answer`` and ``answers again`` of a channel; ``0xFF`` (or ``too old`` in the
        mended coding) and ``good again`` of a point; ``path lost`` and ``path back`` of a box as
        one of two polled channels shows it.
        """
        import pandas as pd

        rows = self._link_alarms() + self._path_alarms()
        until, good, good_until = self._good
        bad = "0xFF" if self.system.coding == "printed" else "too old"
        tags: dict[int, list[str]] = {}
        for point, message in zip(self.system.points, self.system.message_of.tolist(), strict=True):
            tags.setdefault(message, []).append(point.tag)
        for message, own in tags.items():
            # Good from each answer on, bad from where that ends before the next.
            fine, end = good[:, message], good_until[:, message]
            time = np.stack([self.views.seen, end], axis=1)
            state = np.stack([fine, fine & (end == until)], axis=1)
            for when, back in _changes(time.ravel(), state.ravel()):
                rows += [(when / 1e9, tag, "good again" if back else bad) for tag in own]
        rows.sort(key=lambda row: row[0])
        return pd.DataFrame(rows, columns=["time_s", "source", "kind"])

    def _link_alarms(self) -> list[tuple[float, str, str]]:
        rows = []
        tries = 1 + self.system.retries
        silent = nanoseconds(self.system.poll.line.frame_time(8) + self.system.timeout)
        for channel in (0, 1):
            own = self.attempts.channel == channel
            columns = (self.attempts.poll, self.attempts.start, self.attempts.outcome)
            poll, start, outcome = (column[own] for column in columns)
            fine = outcome == 0
            _, count = np.unique(poll, return_counts=True)
            final = np.repeat(count, count) == tries
            ends = np.append(poll[1:] != poll[:-1], True) if poll.size else fine
            told = ends & (fine | final)
            wait = np.where(outcome == 1, silent, nanoseconds(self.system.poll.time))
            for when, good in _changes((start + wait)[told], fine[told]):
                word = "answers again" if good else "no answer"
                rows.append((when / 1e9, f"channel {channel + 1}", word))
        return rows

    def _path_alarms(self) -> list[tuple[float, str, str]]:
        rows = []
        limit = nanoseconds(self.system.age_limit)
        for channel, path in enumerate(self.paths, start=1):
            fresh = path.known + limit > path.seen[:, None]
            for box, name in enumerate(self.system.boxes):
                fine = np.asarray(fresh[:, self.system.sender == box].all(axis=1))
                for when, good in _changes(path.seen, fine):
                    word = "path back" if good else "path lost"
                    rows.append((when / 1e9, f"{name} on channel {channel}", word))
        return rows

    @cached_property
    def loads(self) -> pd.Series[float]:
        """Share of the time in which the CAN bus and both Modbus lines are busy."""
        import pandas as pd

        inside = self.sent.start >= 0
        bits = self.system.frame_ns[self.sent.message[inside]]
        busy = {"CAN": int(bits.sum())}
        line = self.system.serial
        request = nanoseconds(line.frame_time(8))
        response = nanoseconds(line.frame_time(5 + 2 * self.system.registers))
        for channel in (0, 1):
            outcome = self.attempts.outcome[self.attempts.channel == channel]
            heard = int((outcome != 1).sum())
            busy[f"channel {channel + 1}"] = outcome.size * request + heard * response
        return pd.Series(busy) / self.end


def _changes(time: Integers, good: Bools) -> Sequence[tuple[int, bool]]:
    """Return when a state, good at first, changes, and to what."""
    before = np.append(True, good[:-1]) if good.size else good
    places = np.flatnonzero(good != before)
    return list(zip(time[places].tolist(), good[places].tolist(), strict=True))
