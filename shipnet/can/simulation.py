"""A simulated CAN bus: periodic messages, arbitration, errors and response times."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet import style
from shipnet.answers import Utilisation
from shipnet.arguments import checked
from shipnet.arrays import Bools, Floats, Integers
from shipnet.can.bus import Failure, Nodes, Releases, send, send_batch
from shipnet.can.faults import BitErrors, ErrorAt, Simulated
from shipnet.can.frame import check_bit_rate
from shipnet.can.log import Log
from shipnet.can.messages import MessageSet, counted, message_lengths
from shipnet.clock import as_faults, nanoseconds
from shipnet.errors import ArgumentError
from shipnet.fields import check_rng, check_scalar
from shipnet.lazy import Axes, pd

#: Maximum number of frames that a run may release; such a run takes several gigabytes of memory.
MOST_FRAMES = 20_000_000


@checked
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
    load: float
    _events: pd.DataFrame
    _table: pd.DataFrame
    _errors: pd.DataFrame
    _nodes: pd.DataFrame

    def events(self) -> pd.DataFrame:
        """Return one row per frame, in order of release.

        ``arrival_ms`` is the time of the event, ``release_ms`` includes the jitter, and
        ``response_ms`` is the time from event to end of frame. ``outcome`` is sent or waiting; a
        waiting frame was not sent, so its start, end and response are NaN.
        """
        return self._events.copy()

    def table(self) -> pd.DataFrame:
        """Return one row per message, highest priority first, indexed by name.

        ``released``, ``sent`` and ``waiting`` count frames; ``min_ms``, ``mean_ms`` and ``max_ms``
        are response times; ``missed`` counts frames that missed the deadline.
        """
        return self._table.copy()

    def utilisation(self) -> Utilisation:
        """Return the bus load, and the longest time from a change until the new value is sent."""
        sent = self._events[self._events["outcome"] == "sent"].sort_values("arrival_ms")
        before = sent.groupby("message", observed=True)["arrival_ms"].shift()
        return Utilisation(self.load, self.load, float((sent["end_ms"] - before).max()) / 1e3)

    def errors(self) -> pd.DataFrame:
        """Return one row per destroyed frame.

        ``free_ms`` is when the bus was free again, and ``bit`` the disturbed bit, counted from 0;
        ``tec`` and ``state`` are the sender's transmit error counter and state afterwards.
        """
        return self._errors.copy()

    def nodes(self) -> pd.DataFrame:
        """Return each sender's final error counters and state, and how often it went bus off."""
        return self._nodes.copy()

    def plot(self, start: float = 0.0, stop: float | None = None, ax: Axes | None = None) -> Axes:
        """Draw the frames on the bus from `start` to `stop` [s], with one lane per message."""
        frames, errors = self._events, self._errors
        last = np.nanmax([0.0, *frames["end_ms"], *errors["free_ms"]])
        low, high = 1e3 * start, last if stop is None else 1e3 * stop
        if not low < high:
            raise ArgumentError(f"start is {start} s; it must be before stop, {high / 1e3:g} s")
        ax = style.axes(ax)
        lane = {name: row for row, name in enumerate(self.system.names)}

        def rows(table: pd.DataFrame) -> pd.Series:
            return table["message"].astype(object).map(lane)

        def bars(table: pd.DataFrame, end: str, colour: str, label: str) -> None:
            ax.barh(
                rows(table), table[end] - table["start_ms"], left=table["start_ms"], height=0.6,
                color=colour, edgecolor="white", linewidth=0.5, label=label,
            )  # fmt: skip

        shown = frames[(frames["release_ms"] < high) & (frames["end_ms"].fillna(high) > low)]
        failed = errors[(errors["start_ms"] < high) & (errors["free_ms"] > low)]
        begin = shown["start_ms"].fillna(high)
        ax.hlines(rows(shown), shown["release_ms"], begin, color="0.45", lw=1, zorder=0.5)
        bars(shown[shown["outcome"] == "sent"], "end_ms", "C0", "frame")
        if len(failed):
            bars(failed, "free_ms", style.LIMIT["color"], "error")
        ax.plot([], [], color="0.45", lw=1, label="waiting")
        ax.set(xlabel="time [ms]", xlim=(low, high), ylim=(len(lane) - 0.4, -0.6))
        ax.set_yticks(range(len(lane)), list(lane))
        ax.grid(axis="y", visible=False)
        style.legend(ax)
        return ax

    def log(self) -> Log:
        """Return a log of all frames sent on the bus, with zeros as data."""
        sent = self._events[self._events["outcome"] == "sent"].sort_values("end_ms")
        rank = sent["message"].cat.codes.to_numpy()
        ids, extended, dlc = (
            np.array([getattr(message, field) for message in self.system])[rank]
            for field in ("arbitration_id", "extended", "dlc")
        )
        data = np.zeros((len(sent), 8), dtype=np.uint8)
        no = np.zeros(len(sent), dtype=bool)
        time = sent["end_ms"].to_numpy() / 1e3
        return Log(time, np.full(len(sent), "can0"), ids, extended, no, dlc.astype(np.uint8), data)

    def __repr__(self) -> str:
        return (
            f"Run({len(self.system)} messages, {len(self._events)} frames in {self.until:g} s, "
            f"load {self.load:.0%})"
        ).replace("%)", " %)")


@checked
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
    columns = _columns(messages)
    bit = bit_time_ns(bit_rate)
    horizon = nanoseconds(check_scalar("until", until, "s", 1e-9, 1e6))
    several = as_faults(faults, BitErrors, ErrorAt)
    generator = check_rng(rng)
    arrival, releases = _releases(columns, horizon, bit, generator)
    start, failures, at_end = send(releases, horizon, columns.owner, several, bit, generator)
    failed = np.array([failure.release for failure in failures], dtype=int)
    retries = np.bincount(failed, minlength=len(start))
    duration = releases.length[releases.message]
    end = start + duration
    sent = start >= 0
    response = np.where(sent, end - arrival, 0)
    events = pd.DataFrame(
        {
            "message": pd.Categorical.from_codes(releases.message, pd.Index(messages.names)),
            "arrival_ms": arrival / 1e6,
            "release_ms": releases.time / 1e6,
            "start_ms": np.where(sent, start / 1e6, np.nan),
            "end_ms": np.where(sent, end / 1e6, np.nan),
            "response_ms": np.where(sent, response / 1e6, np.nan),
            "retries": retries,
            "outcome": pd.Categorical.from_codes(
                np.where(sent, 0, 1), pd.Index(["sent", "waiting"])
            ),
        }
    )
    waited = np.where(sent, response, horizon - arrival)
    table = _statistics(messages, events, waited > columns.deadline[releases.message])
    errors, nodes = _error_tables(messages, columns, releases, failures, at_end)
    busy = int(duration[sent].sum()) + sum(f.free - f.start for f in failures)
    # The last frame may end after the horizon.
    span = max(horizon, int(end.max(initial=0, where=sent)))
    return Run(
        messages, float(bit_rate), float(until), several, busy / span, events, table, errors, nodes
    )


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


@checked
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
    columns = _columns(messages)
    if columns.jitter.any():
        raise ArgumentError("messages have jitter; in a batch they must have none")
    bit = bit_time_ns(bit_rate)
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
    first = np.rint(begin.T * 1e9).astype(np.int64)
    largest, total, sent = send_batch(first, columns.period, columns.bits * bit, horizon)
    none = sent == 0
    return BatchRun(
        messages,
        np.where(none, np.nan, largest / 1e9).T,
        np.where(none, np.nan, total / 1e9 / np.maximum(sent, 1)).T,
        sent.T,
    )


class _Columns(NamedTuple):
    """Messages in order of priority, with times in whole nanoseconds."""

    senders: list[str]
    owner: Integers
    bits: Integers
    period: Integers
    offset: Integers
    jitter: Integers
    deadline: Integers


def _columns(messages: MessageSet) -> _Columns:
    """Return a message set as columns; `owner` is the index of each message's sender."""
    if not len(messages):
        raise ArgumentError("messages are empty; there must be at least one")
    times = (
        np.array([nanoseconds(getattr(m, time)) for m in messages], dtype=np.int64)
        for time in ("period", "offset", "jitter", "deadline")
    )
    senders = [message.sender or message.name for message in messages]
    nodes = list(dict.fromkeys(senders))
    return _Columns(
        nodes,
        np.array([nodes.index(sender) for sender in senders], dtype=np.int64),
        message_lengths(messages).astype(np.int64),
        *times,
    )


def bit_time_ns(bit_rate: float) -> int:
    """Return the bit time in whole nanoseconds."""
    exact = 1e9 / check_bit_rate(bit_rate, 5e3)
    if abs(exact - round(exact)) > 1e-6 * exact:
        raise ArgumentError(
            f"bit_rate is {bit_rate} bit/s, so a bit lasts {exact:.6g} ns; it must last a whole "
            f"number of nanoseconds, as at {1e9 / round(exact):.9g} bit/s"
        )
    return round(exact)


def _releases(
    columns: _Columns, horizon: int, bit: int, rng: np.random.Generator
) -> tuple[Integers, Releases]:
    """Return the times of the events, and the frames that they release, in order of release."""
    counts = np.maximum(-(-(horizon - columns.offset) // columns.period), 0)
    if counts.sum() > MOST_FRAMES:
        raise ArgumentError(
            f"until is {horizon / 1e9} s; {counts.sum()} frames would be released by then, at "
            f"most {MOST_FRAMES} are allowed"
        )
    message = np.repeat(np.arange(len(counts)), counts)
    place = np.arange(len(message)) - np.repeat(np.cumsum(counts) - counts, counts)
    arrival = columns.offset[message] + place * columns.period[message]
    time = arrival
    if columns.jitter.any():
        time = arrival + rng.integers(0, columns.jitter[message], endpoint=True)
        for block in np.split(time, np.cumsum(counts)[:-1]):
            np.maximum.accumulate(block, out=block)
    order = np.argsort(time, kind="stable")
    message = message[order]
    releases = Releases(time[order], message, columns.bits * bit)
    return arrival[order], releases


def _statistics(messages: MessageSet, events: pd.DataFrame, missed: Bools) -> pd.DataFrame:
    number, outcome = len(messages), events["outcome"].cat
    message = events["message"].cat.codes.to_numpy(dtype=np.intp)
    places = message + number * outcome.codes.to_numpy()
    counts = np.bincount(places, minlength=2 * number).reshape(2, number)
    times = events["response_ms"].groupby(message)
    ranges = {f"{how}_ms": times.agg(how).reindex(range(number)) for how in ("min", "mean", "max")}
    return pd.DataFrame(
        {
            "arbitration_id": [m.arbitration_id for m in messages],
            "extended": [m.extended for m in messages],
            "released": counts.sum(axis=0),
            **dict(zip(outcome.categories, counts, strict=True)),
            **{name: values.to_numpy() for name, values in ranges.items()},
            "missed": np.bincount(message[missed], minlength=number),
            "retries": np.bincount(message, events["retries"], number).astype(int),
        },
        index=pd.Index(messages.names, name="message", dtype=object),
    )


def _error_tables(
    messages: MessageSet,
    columns: _Columns,
    releases: Releases,
    failures: list[Failure],
    nodes: Nodes,
) -> tuple[pd.DataFrame, pd.DataFrame]:
    release, start, free, bit, tec, state = zip(*failures, strict=True) if failures else 6 * [()]
    ranks = releases.message[np.array(release, dtype=int)].tolist()
    errors = pd.DataFrame(
        {
            "message": [messages.names[rank] for rank in ranks],
            "sender": [columns.senders[columns.owner[rank]] for rank in ranks],
            "start_ms": np.array(start, dtype=float) / 1e6,
            "free_ms": np.array(free, dtype=float) / 1e6,
            "bit": np.array(bit, dtype=int),
            "tec": np.array(tec, dtype=int),
            "state": np.array(state, dtype=object),
        }
    )
    table = pd.DataFrame(
        {
            "tec": nodes.tec,
            "rec": nodes.rec,
            "state": [nodes.state(node) for node in range(len(columns.senders))],
            "bus_off": nodes.bus_off,
        },
        index=pd.Index(columns.senders, name="sender", dtype=object),
    )
    return errors, table
