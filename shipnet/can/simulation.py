"""A simulated CAN bus: periodic messages, arbitration, errors and response times."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet import style
from shipnet.answers import Utilisation
from shipnet.arrays import Floats, Integers
from shipnet.can.bus import BUS_OFF, PASSIVE, Failure, releases, send, send_disturbed, send_sets
from shipnet.can.faults import BitErrors, ErrorAt, Simulated
from shipnet.can.frame import check_bit_rate
from shipnet.can.j1939 import packets
from shipnet.can.log import Log
from shipnet.can.messages import MessageSet, counted
from shipnet.clock import NEVER, as_faults, nanoseconds
from shipnet.errors import ArgumentError
from shipnet.fields import check_choice, check_rng, check_scalar
from shipnet.html import as_html
from shipnet.lazy import Axes, pd

#: Maximum number of frames that a run may release; such a run takes several gigabytes of memory.
MOST_FRAMES = 20_000_000


@dataclass(frozen=True, eq=False, repr=False)
class Run:
    """The events on a simulated bus, as returned by `simulate`.

    `system`, `bit_rate` [bit/s], `until` [s] and `faults` are the arguments of `simulate`. `load`
    is the fraction of the time that the bus was busy, including error frames and intermission.

    Examples
    --------
    >>> from shipnet import can
    >>> run = can.simulate(can.example(), 125e3, until=0.1)
    >>> run
    Run(10 messages, 33 frames in 0.1 s, load 26 %)
    >>> run.table().loc["speed", ["sent", "max_ms", "missed"]].to_dict()
    {'sent': 10.0, 'max_ms': 1.28, 'missed': 0.0}
    """

    system: MessageSet
    bit_rate: float
    until: float
    faults: tuple[Simulated, ...]
    _columns: _Columns
    #: Arrival, release and start of each frame [ns], and its message, as in `shipnet.can.bus`.
    _arrival: Integers
    _release: Integers
    _start: Integers
    _first: Integers
    #: One row per destroyed frame, and TEC and REC of each node.
    _failures: Integers
    _counters: tuple[Integers, Integers]

    @cached_property
    def load(self) -> float:
        """Fraction of the time that the bus was busy."""
        length = np.repeat(self._columns.length, np.diff(self._first))
        sent = self._start >= 0
        _, start, free, *_ = self._failures.T
        # The last frame may end after the horizon.
        end = int((self._start + length).max(initial=0, where=sent))
        busy = int(length.sum(where=sent) + (free - start).sum())
        return busy / max(nanoseconds(self.until), end)

    @cached_property
    def _events(self) -> pd.DataFrame:
        message = np.repeat(np.arange(len(self.system)), np.diff(self._first))
        retries = np.bincount(self._failures[:, 0], minlength=len(message))
        order = np.argsort(self._release, kind="stable")
        order = order[self._arrival[order] < nanoseconds(self.until)]
        message, arrival, start = message[order], self._arrival[order], self._start[order]
        sent = start >= 0
        end = start + self._columns.length[message]
        return pd.DataFrame(
            {
                "message": pd.Categorical.from_codes(message, pd.Index(self.system.names)),
                "arrival_ms": arrival / 1e6,
                "release_ms": self._release[order] / 1e6,
                "start_ms": np.where(sent, start / 1e6, np.nan),
                "end_ms": np.where(sent, end / 1e6, np.nan),
                "response_ms": np.where(sent, (end - arrival) / 1e6, np.nan),
                "retries": retries[order],
                "outcome": pd.Categorical.from_codes(
                    np.where(sent, 0, 1), pd.Index(["sent", "waiting"])
                ),
            }
        )

    def events(self) -> pd.DataFrame:
        """Return one row per frame, in order of release.

        ``arrival_ms`` is the time of the event, ``release_ms`` includes the jitter, and
        ``response_ms`` is the time from event to end of frame. ``outcome`` is sent or waiting; a
        waiting frame was not sent, so its start, end and response are NaN.
        """
        return self._events.copy()

    def table(self) -> pd.DataFrame:
        """Return one row per message, highest priority first, indexed by name.

        ``released``, ``sent`` and ``waiting`` count messages; ``min_ms``, ``mean_ms`` and
        ``max_ms`` are response times of their last frames; ``missed`` counts missed deadlines.
        """
        retries = np.bincount(self._failures[:, 0], minlength=len(self._start))
        rows = []
        for rank, (begin, end) in enumerate(pairwise(self._first)):
            # One row per message; the last one is never sent.
            shape = -1, self.system[rank].frames
            columns = (each[begin:end].reshape(shape) for each in (self._arrival, self._start))
            arrival, start = (each[:-1, -1] for each in columns)
            sent = np.count_nonzero(start >= 0)  # the first frames
            response = start[:sent] + self._columns.length[rank] - arrival[:sent]
            waited = np.r_[response, nanoseconds(self.until) - arrival[sent:]]
            rows.append(
                {
                    "arbitration_id": self.system[rank].hex_id,
                    "extended": self.system[rank].extended,
                    "released": len(start),
                    "sent": sent,
                    "waiting": len(start) - sent,
                    "min_ms": response.min() / 1e6 if sent else np.nan,
                    "mean_ms": response.mean() / 1e6 if sent else np.nan,
                    "max_ms": response.max() / 1e6 if sent else np.nan,
                    "missed": np.count_nonzero(waited > self._columns.deadline[rank]),
                    "retries": retries[begin:end].sum(),
                }
            )
        return pd.DataFrame(rows, pd.Index(self.system.names, name="message", dtype=object))

    def utilisation(self) -> Utilisation:
        """Return the bus load, and the longest time from a change until the new value is sent."""
        sent = self._events[self._events["outcome"] == "sent"].sort_values("end_ms")
        sent = sent.drop_duplicates(["message", "arrival_ms"], keep="last")
        before = sent.groupby("message", observed=True)["arrival_ms"].shift()
        return Utilisation(self.load, self.load, float((sent["end_ms"] - before).max()) / 1e3)

    def errors(self) -> pd.DataFrame:
        """Return one row per destroyed frame.

        ``free_ms`` is when the bus was free again, and ``bit`` the disturbed bit, counted from 0;
        ``tec`` and ``state`` are the sender's transmit error counter and state afterwards.
        """
        frame, start, free, bit, tec, rec = self._failures.T
        rank = np.searchsorted(self._first, frame, side="right") - 1
        return pd.DataFrame(
            {
                "message": np.array(self.system.names, dtype=object)[rank],
                "sender": np.array(self._columns.senders, dtype=object)[self._columns.owner[rank]],
                "start_ms": start / 1e6,
                "free_ms": free / 1e6,
                "bit": bit,
                "tec": tec,
                "state": _state(tec, rec),
            }
        )

    def nodes(self) -> pd.DataFrame:
        """Return each sender's final error counters and state, and how often it went bus off."""
        tec, rec = self._counters
        gone = self.errors().query("state == 'bus off'")["sender"].value_counts()
        times = gone.reindex(self._columns.senders, fill_value=0).to_numpy()
        return pd.DataFrame(
            {"tec": tec, "rec": rec, "state": _state(tec, rec), "bus_off": times},
            index=pd.Index(self._columns.senders, name="sender", dtype=object),
        )

    @style.applied
    def plot(self, start: float = 0.0, stop: float | None = None, ax: Axes | None = None) -> Axes:
        """Draw the frames on the bus from `start` to `stop` [s], with one lane per message."""
        frames, errors = self._events, self.errors()
        last = np.nanmax([0.0, *frames["end_ms"], *errors["free_ms"]])
        low, high = 1e3 * start, last if stop is None else 1e3 * stop
        if not low < high:
            raise ArgumentError(f"start is {start} s; it must be before stop, {high / 1e3:g} s")
        ax = style.axes(ax, figsize=style.size(len(self.system.names)))
        lane = {name: row for row, name in enumerate(self.system.names)}

        def rows(table: pd.DataFrame) -> pd.Series:
            return table["message"].astype(object).map(lane)

        def bars(table: pd.DataFrame, end: str, colour: str, label: str) -> None:
            y, begin = rows(table), table["start_ms"]
            width = table[end] - begin
            ax.barh(y, width, 0.6, begin, color=colour, ec="white", lw=0.5, label=label)

        shown = frames[(frames["release_ms"] < high) & (frames["end_ms"].fillna(high) > low)]
        failed = errors[(errors["start_ms"] < high) & (errors["free_ms"] > low)]
        begin = shown["start_ms"].fillna(high)
        ax.hlines(rows(shown), shown["release_ms"], begin, color="0.45", lw=1, zorder=0.5)
        bars(shown[shown["outcome"] == "sent"], "end_ms", "C0", "frame")
        if len(failed):
            bars(failed, "free_ms", style.LIMIT["color"], "error")
        ax.plot([], [], color="0.45", lw=1, label="waiting")
        ax.set(xlabel="time [ms]", xlim=(low, high), ylim=(len(lane) - 0.4, -0.6))
        ax.set_yticks(range(len(lane)), [*map(style.literal, lane)])
        ax.grid(axis="y", visible=False)
        style.legend(ax)
        return ax

    @style.applied
    def plot_errors(self, sender: str, ax: Axes | None = None) -> Axes:
        """Draw a sender's transmit error counter (TEC) over time, with the limits of its states.

        It grows by 8 with each destroyed frame and falls by 1 with each frame sent. A sender that
        was bus off begins at 0 again.
        """
        check_choice("sender", sender, self._columns.senders)
        names = [one.name for one in self.system if (one.sender or one.name) == sender]
        of_sender = self._events["message"].isin(names)
        failed = self.errors().query("sender == @sender")[["start_ms", "free_ms", "tec"]]
        sent = self._events[of_sender & (self._events["outcome"] == "sent")][["start_ms", "end_ms"]]
        frames = [*failed.to_numpy().tolist(), *sent.to_numpy().tolist()]
        times, counts = [0.0], [0]
        for start, end, *tec in sorted(frames):
            if counts[-1] >= BUS_OFF:
                times, counts = [*times, start], [*counts, 0]
            times, counts = [*times, end], [*counts, int(tec[0]) if tec else max(0, counts[-1] - 1)]
        ax = style.axes(ax)
        ax.plot(times, counts, drawstyle="steps-post")
        style.limit(ax, PASSIVE, "error\npassive")
        style.limit(ax, BUS_OFF, "bus off")
        name = f"transmit error counter\nof {style.literal(sender)}"
        ax.set(xlabel="time [ms]", ylabel=name, ylim=(0, 280))
        ax.set_yticks(range(0, 257, 64))
        return ax

    def log(self) -> Log:
        """Return a log of all frames sent on the bus; the data of messages are zeros."""
        sent = self._events[self._events["outcome"] == "sent"].sort_values("end_ms")
        rank = sent["message"].cat.codes.to_numpy()
        frames = [
            [number, one.extended, 8 if one.transport else one.dlc, *data.ljust(8, b"\0")]
            for one in self.system
            for number, data in packets(one.arbitration_id, one.dlc, one.transport)
        ]
        each = self._columns.frames
        row = (np.cumsum(each) - each)[rank] + sent.groupby(rank).cumcount() % each[rank]
        ids, extended, dlc, *data = np.array(frames)[row].T
        time, no = sent["end_ms"].to_numpy() / 1e3, np.zeros(len(sent), dtype=bool)
        octets = dlc.astype(np.uint8), np.array(data, np.uint8).T
        return Log(time, np.full(len(sent), "can0"), ids, extended.astype(bool), no, *octets)

    def __repr__(self) -> str:
        return (
            f"Run({len(self.system)} messages, {len(self._events)} frames in {self.until:g} s, "
            f"load {self.load:.0%})"
        ).replace("%)", " %)")

    def _repr_html_(self) -> str:
        rows = self.table()[["missed", "waiting", "max_ms"]]
        rows["deadline_ms"] = [1e3 * message.deadline for message in self.system]
        rows["slack_ms"] = rows["deadline_ms"] - rows["max_ms"]
        plot = partial(self.plot, stop=self._events["end_ms"].head(25).max() / 1e3)
        return as_html(self, rows.sort_values("slack_ms"), ok=not rows["missed"].any(), plot=plot)


def simulate(
    messages: MessageSet,
    bit_rate: float,
    *,
    until: float,
    faults: Simulated | Iterable[Simulated] = (),
    rng: Any = None,
) -> Run:
    """Simulate the arbitration of periodic messages on a CAN bus.

    Parameters
    ----------
    messages : MessageSet
        The messages. Each message without a sender has its own node.
    bit_rate : float
        Bit rate, 5e3..1e6 [bit/s]; a bit must last a whole number of nanoseconds.
    until : float
        Simulated time, 1e-9..1e6 [s], with at most 20 million frames; the last frame is completed.
    faults : BitErrors, ErrorAt or iterable of them, optional
        Bit errors on the bus; none by default.
    rng : int, numpy.random.Generator or None, optional
        Random generator or seed for jitter and `BitErrors`, as in `numpy.random.default_rng`.

    Returns
    -------
    Run
        Tables of frames, messages, errors and nodes, and the bus load.

    Notes
    -----
    A frame ends with its 3 bits of intermission, as in response-time analysis. Jitter delays each
    release by a uniformly random time, but frames of one message stay in order. All nodes detect an
    error at the same time; the error destroys the frame, which is sent again. An error-passive node
    waits for 8 more bits after its own frames. A node whose transmit error counter reaches 256 is
    bus off until it has received 128 sequences of 11 recessive bits (Bosch, "CAN specification
    2.0", 1991, part B, sections 3.2.5 and 8). Errors in error frames, overload frames and missing
    acknowledgements are not modelled.

    The frames of a message with a transport are released together, or 50 ms apart in a session.

    A simulation need not contain the worst case; `response_times` returns a bound on it.

    Examples
    --------
    Three messages of 7 bytes, each at most 1 ms long at 125 kbit/s, are released together. The
    longest response at the lowest priority is 3.5 ms, which exceeds the deadline of 3.25 ms.

    >>> from shipnet.can import Message
    >>> messages = MessageSet(
    ...     [
    ...         Message("A", 1, 7, period=2.5e-3),
    ...         Message("B", 2, 7, period=3.5e-3, deadline=3.25e-3),
    ...         Message("C", 3, 7, period=3.5e-3, deadline=3.25e-3),
    ...     ]
    ... )
    >>> run = simulate(messages, 125e3, until=1.0)
    >>> run.table()[["sent", "max_ms", "missed"]].values.tolist()
    [[400.0, 1.5, 0.0], [286.0, 2.0, 0.0], [286.0, 3.5, 57.0]]
    """
    columns = _Columns.of(messages, bit_rate)
    horizon = nanoseconds(check_scalar("until", until, "s", 1e-9, 1e6))
    several = as_faults(faults, BitErrors, ErrorAt)
    generator = check_rng(rng)
    frames = _frames(columns.offset, columns.period, horizon, columns.frames)
    arrival, first = releases.run(frames, columns.offset, columns.period, horizon)
    release = arrival
    message = np.repeat(np.arange(len(messages)), np.diff(first))
    if columns.jitter.any():
        real = arrival < horizon
        delay = generator.integers(0, columns.jitter[message[real]], endpoint=True)
        release = arrival.copy()
        release[real] += delay
    if columns.frames.max() > 1:
        each = columns.frames[message]
        packet = np.arange(each.sum()) - np.repeat(np.cumsum(each) - each, each)
        arrival, release, message = (np.repeat(c, each) for c in (arrival, release, message))
        release += packet * columns.gap[message]
        first = np.r_[0, np.cumsum(np.bincount(message))]
    if release is not arrival:
        for begin, end in pairwise(first):
            np.maximum.accumulate(release[begin:end], out=release[begin:end])
    failures: list[Failure] = []
    steps = frames * len(messages) / 2  # half of the messages are asked before one is found
    if several:
        instants = sorted(nanoseconds(one.time) for one in several if isinstance(one, ErrorAt))
        # The longest run has 1e12 bits, none of which is disturbed at lower rates.
        random = [one for one in several if isinstance(one, BitErrors) and one.rate >= 1e-18]
        rate = np.array([fault.rate for fault in random])
        span = np.array([fault.span for fault in random], dtype=np.int64).reshape(-1, 2)
        disturbances = np.array([*instants, NEVER]), rate, span, generator
        start, failures, *counters = send_disturbed.run(
            2 * steps,
            *(release, first, columns.length, horizon, columns.owner, columns.bit),
            *(PASSIVE, BUS_OFF, *disturbances),
        )
    else:
        start = send.run(steps, release, first, columns.length, horizon)
        counters = list(np.zeros((2, len(columns.senders)), dtype=np.int64))
    rows = np.array(failures, dtype=np.int64).reshape(-1, 6)
    system = messages, float(bit_rate), float(until), several, columns
    return Run(*system, arrival, release, start, first, rows, (counters[0], counters[1]))


@dataclass(frozen=True, eq=False, repr=False)
class BatchRun:
    """Response times for many sets of offsets, as returned by `simulate_batch`.

    `max_response` and `mean_response` [s] and `sent`, the number of frames, have one row per set
    and one column per message, in order of priority. The times of messages not sent are NaN.

    Examples
    --------
    >>> from shipnet import can
    >>> run = can.simulate_batch(can.example(), 125e3, offsets=[[0] * 10], until=1.0)
    >>> run
    BatchRun(1 set of offsets, 10 messages: shutdown, speed, fuel index, ...)
    >>> run.table().loc["alarm", "max_ms"]
    np.float64(3.72)
    """

    system: MessageSet
    max_response: Floats
    mean_response: Floats
    sent: Integers

    def table(self) -> pd.DataFrame:
        """Return one row per message over all sets: ``sent``, ``mean_ms`` and ``max_ms``."""
        total = self.sent.sum(axis=0)
        summed = np.nansum(self.mean_response * self.sent, axis=0)
        longest = np.where(self.sent > 0, self.max_response, -np.inf).max(axis=0, initial=-np.inf)
        none = total == 0
        return pd.DataFrame(
            {
                "sent": total,
                "mean_ms": np.where(none, np.nan, 1e3 * summed / np.maximum(total, 1)),
                "max_ms": np.where(none, np.nan, 1e3 * longest),
            },
            index=pd.Index(self.system.names, name="message", dtype=object),
        )

    def __repr__(self) -> str:
        sets = len(self.sent)
        plural = "s" if sets != 1 else ""
        return f"BatchRun({sets} set{plural} of offsets, {counted(self.system.names)})"

    _repr_html_ = as_html


def simulate_batch(
    messages: MessageSet, bit_rate: float, *, offsets: npt.ArrayLike, until: float
) -> BatchRun:
    """Simulate the same messages with many sets of offsets at once, without jitter or errors.

    Parameters
    ----------
    messages : MessageSet
        The messages, without jitter; their own offsets are ignored.
    bit_rate : float
        Bit rate, 5e3..1e6 [bit/s]; a bit must last a whole number of nanoseconds.
    offsets : array_like of float, shape (n_sets, n_messages)
        Time of the first event of each message, in order of priority, 0..1e5 [s].
    until : float
        Simulated time, 1e-9..1e6 [s].

    Returns
    -------
    BatchRun
        Longest and mean response times per set, equal to the results of `simulate`.

    Examples
    --------
    >>> from shipnet.can import Message
    >>> messages = MessageSet([Message("A", 1, 8, 5e-3), Message("B", 2, 8, 5e-3)])
    >>> run = simulate_batch(messages, 125e3, offsets=[[0, 0], [5e-4, 0]], until=1.0)
    >>> (1e3 * run.max_response).round(2).tolist()
    [[1.08, 2.16], [1.66, 1.08]]
    """
    if any(message.transport for message in messages):
        raise ArgumentError("messages have a transport; simulate_batch requires single frames")
    columns = _Columns.of(messages, bit_rate)
    if columns.jitter.any():
        raise ArgumentError("messages have jitter; in a batch they must have none")
    horizon = nanoseconds(check_scalar("until", until, "s", 1e-9, 1e6))
    number = len(messages)
    begin = np.asarray(offsets)
    if begin.dtype.kind not in "iuf" or begin.ndim != 2 or begin.shape[1] != number:
        raise ArgumentError(
            f"offsets have the shape {begin.shape} and dtype {begin.dtype}; they must be numbers, "
            f"one row per set, one column for each of the {number} messages"
        )
    if not np.all((begin >= 0) & (begin <= 1e5)):
        raise ArgumentError("offsets contain a time outside 0..1e5 s")
    first = np.ascontiguousarray(np.rint(begin * 1e9), dtype=np.int64)
    steps = first.size / 2 * _frames(np.zeros_like(columns.period), columns.period, horizon)
    longest, total, sent = send_sets.run(steps, first, columns.period, columns.length, horizon)
    none = sent == 0
    return BatchRun(
        messages,
        np.where(none, np.nan, longest / 1e9),
        np.where(none, np.nan, total / 1e9 / np.maximum(sent, 1)),
        sent,
    )


class _Columns(NamedTuple):
    """Messages in order of priority, with times in whole nanoseconds, and the senders' names."""

    senders: list[str]
    owner: Integers
    bit: int
    frames: Integers
    gap: Integers  #: Time between the frames of a message.
    length: Integers
    period: Integers
    deadline: Integers
    jitter: Integers
    offset: Integers

    @classmethod
    def of(cls, messages: MessageSet, bit_rate: float) -> _Columns:
        """Return a message set as columns; `owner` is the index of each message's sender."""
        if not len(messages):
            raise ArgumentError("messages are empty; there must be at least one")
        exact = 1e9 / check_bit_rate(bit_rate, 5e3)
        bit = round(exact)
        if abs(exact - bit) > 1e-6 * exact:
            raise ArgumentError(
                f"bit_rate is {bit_rate} bit/s, so a bit lasts {exact:.6g} ns; it must last a "
                f"whole number of nanoseconds, as at {1e9 / bit:.9g} bit/s"
            )
        senders = [message.sender or message.name for message in messages]
        nodes = list(dict.fromkeys(senders))
        owner = np.array([nodes.index(sender) for sender in senders], dtype=np.int64)
        frames = np.array([message.frames for message in messages])
        gap = 50_000_000 * np.array([message.session for message in messages])
        length = messages.lengths().astype(np.int64) // frames * bit
        # Kernels are compiled for arrays that can be written.
        return cls(nodes, owner, bit, frames, gap, length, *messages.times.copy())


def _frames(offset: Integers, period: Integers, horizon: int, each: Integers | int = 1) -> int:
    """Return the number of frames that the messages release before the horizon."""
    frames = int((each * np.maximum(-((offset - horizon) // period), 0)).sum())
    if frames > MOST_FRAMES:
        raise ArgumentError(
            f"until is {horizon / 1e9} s; {frames} frames would be released by then, at "
            f"most {MOST_FRAMES} are allowed"
        )
    return frames


def _state(tec: Integers, rec: Integers) -> npt.NDArray[np.object_]:
    """Return the state of nodes with these error counters."""
    passive = np.where(np.maximum(tec, rec) >= PASSIVE, "error passive", "error active")
    return np.where(tec >= BUS_OFF, "bus off", passive).astype(object)
