"""Recorded CAN frames, the bus load they cause, and the messages they contain."""

from __future__ import annotations

import math
import os
from collections import Counter
from collections.abc import Collection
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.arrays import Bools, Floats, Integers
from shipnet.can.frame import check_bit_rate, hexadecimal, highest_id
from shipnet.can.j1939 import Assembled, assemble, id_columns
from shipnet.can.lengths import measure_frames
from shipnet.can.messages import Message, MessageSet
from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar
from shipnet.html import as_html
from shipnet.lazy import pd
from shipnet.tables import save_suffix

#: Legal kinds of numpy dtype for each column of a log.
_KINDS = {
    "time": "fiu",
    "channel": "U",
    "arbitration_id": "iu",
    "extended": "b",
    "remote": "b",
    "dlc": "iu",
    "data": "iu",
}


_SHORTEST = 47e-6  #: Duration of the shortest frame at 1 Mbit/s [s].

#: Largest relative error of a clock on a CAN bus: Bosch, CAN specification 2.0, part B, section 9.
CLOCK_TOLERANCE = 0.0158

_FEW = 4  #: Number of frames below which a log does not show whether a message is periodic.
_FRAMES = 300  #: Largest number of frames from which a period is estimated.
_NEIGHBOURS = 17  #: Number of frames whose median delay is the delay that jitter deviates from.


def impossible(
    time: float, number: int, extended: bool, dlc: int, remote: bool = False, size: int = -1
) -> str:
    """Return why a frame with `size` data bytes (-1: unknown) is illegal, or "" if it is legal."""
    highest = highest_id(extended)
    if not 0 <= number <= highest:
        return f"the identifier is {number:#x}; it must be 0..{highest:#x}"
    if not 0 <= dlc <= 15:
        return f"the data length code is {dlc}; it must be 0..15"
    if size > 8:
        return f"it has {size} bytes of data; it must have 0..8"
    if size >= 0 and size != (0 if remote else min(dlc, 8)):
        return f"it has {size} bytes of data, but its data length code is {dlc}"
    return "" if math.isfinite(time) else f"the time is {time}"


@dataclass(frozen=True, eq=False, repr=False)
class Log:
    """Recorded frames as columns, in the order of the file.

    `time` contains the time stamps [s], all NaN if there are none, and `channel` the bus of each
    frame. `arbitration_id` has 29 bits where `extended` is True; `remote` marks remote frames.
    `dlc` contains the data length codes, and `data`, shape (n, 8), the bytes, padded with 0.
    `faults` describes records that were left out. `skipped` lists valid records other than frames
    of classic CAN: time [s], channel and kind, ``"CAN FD frame"`` or ``"error frame"``.

    Examples
    --------
    >>> from shipnet import can
    >>> can.simulate(can.example(), 125e3, until=1.0).log()
    Log(295 frames in 0.991 s)
    """

    time: Floats
    channel: npt.NDArray[np.str_]
    arbitration_id: Integers
    extended: Bools
    remote: Bools
    dlc: npt.NDArray[np.uint8]
    data: npt.NDArray[np.uint8]
    faults: tuple[str, ...] = ()
    skipped: tuple[tuple[float, str, str], ...] = ()

    def __post_init__(self) -> None:
        for name, kinds in _KINDS.items():
            column = np.asarray(getattr(self, name))
            if column.ndim != (2 if name == "data" else 1) or (
                column.size and column.dtype.kind not in kinds
            ):
                raise ArgumentError(f"{name} is {column!r}; it must be a column of a log")
            object.__setattr__(self, name, column)
        sizes = {name: len(getattr(self, name)) for name in _KINDS}
        if len({*sizes.values()}) != 1 or self.data.shape[1] != 8:
            raise ArgumentError(f"numbers of rows {sizes} must agree; data must have 8 columns")
        time, ids, dlc = self.time, self.arbitration_id, self.dlc
        highest = np.where(self.extended, highest_id(True), highest_id(False))
        wrong = (ids < 0) | (ids > highest) | (dlc > 15)
        wrong |= ~np.isfinite(time) & ~np.isnan(time).all()
        if wrong.any():
            at = int(np.argmax(wrong))
            why = impossible(time[at], ids[at], self.extended[at], dlc[at])
            raise ArgumentError(f"frame {at + 1} of the log: {why}")

    @property
    def columns(self) -> tuple[Any, ...]:
        """The columns from `time` to `data`."""
        return tuple(getattr(self, name) for name in _KINDS)

    @property
    def keys(self) -> Integers:
        """Key of each frame's message: twice the identifier, plus 1 if extended."""
        return np.asarray(self.arbitration_id << 1 | self.extended)

    @property
    def sizes(self) -> Integers:
        """Number of data bytes of each frame."""
        return np.where(self.remote, 0, np.minimum(self.dlc, 8))

    def __len__(self) -> int:
        return len(self.time)

    def __repr__(self) -> str:
        span = float(np.ptp(self.time)) if len(self) else 0.0
        parts = [f"{len(self)} frames " + (f"in {span:.3g} s" if span >= 0 else "without times")]
        kinds = Counter(kind for _, _, kind in self.skipped)
        parts += [f"{count} {kind}s skipped" for kind, count in kinds.items()]
        parts += [f"{len(self.faults)} faults"] if self.faults else []
        return f"Log({', '.join([*parts, *coarse(self.step)])})"

    @cached_property
    def step(self) -> float:
        """Largest step of which all time stamps are multiples [s]; at least 1 us.

        In coarse steps some frames share a time stamp. If none do although at least one pair
        should, the frames themselves are regular, and the step is 1 us.
        """
        gaps = np.rint(np.diff(np.sort(self.time[np.isfinite(self.time)])) * 1e6).astype(np.int64)
        step = int(np.gcd.reduce(gaps))
        rounded = step * len(gaps) ** 2 < gaps.sum() or not gaps.all()
        return max(step * rounded, 1) / 1e6

    def _check_times(self, what: str) -> None:
        """Raise an error if the log has no time stamps."""
        if np.isnan(self.time).any() and np.isnan(self.time).all():
            raise ArgumentError(f"the log has no time stamps; {what} requires them")

    def table(self) -> pd.DataFrame:
        """Return one row per frame; 29-bit identifiers are also shown in parts, as in J1939."""
        text = self.data.tobytes().hex(" ", 8).split() if len(self) else []
        columns = {"time_s": self.time, "channel": self.channel}
        columns |= id_columns(self.arbitration_id, self.extended)
        columns |= {"extended": self.extended, "remote": self.remote, "dlc": self.dlc}
        data = [octets[: 2 * n] for octets, n in zip(text, self.sizes, strict=True)]
        return pd.DataFrame(columns | {"data": data})

    def assemble(self, fast: Collection[int] = ()) -> Assembled:
        """Return the messages of a J1939 or NMEA 2000 bus, with all their bytes.

        Fast packets and sessions (BAM, RTS/CTS) are put together; other frames with 29-bit
        identifiers are messages of their own. Fast packets are those listed in
        ``nmea2000_pgns.csv``, all proprietary ones, and the PGNs in `fast`.
        """
        rows = self.extended & ~self.remote
        columns = (self.time, self.channel, self.arbitration_id, self.sizes, self.data)
        time, channel, numbers, sizes, data = (column[rows] for column in columns)
        return assemble(time, channel, numbers, sizes, data, fast)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write a ``.log`` file in the format of ``candump -l``."""
        save_suffix(path, ".log")
        self._check_times("a candump file")
        text = self.data.astype(np.uint8).tobytes().hex().upper()
        columns = (column.tolist() for column in self.columns[:6])
        with open(path, "w", encoding="utf-8", newline="\n") as file:
            for row, (time, channel, number, extended, remote, dlc) in enumerate(
                zip(*columns, strict=True)
            ):
                name = f"{number:0{8 if extended else 3}X}"
                size = min(dlc, 8)
                body = f"R{size or ''}" if remote else text[16 * row : 16 * row + 2 * size]
                raw = f"_{dlc:X}" if dlc > 8 else ""
                file.write(f"({time:017.6f}) {channel} {name}#{body}{raw}\n")

    def load(self, bit_rate: float, *, window: float = 1.0) -> LogLoad:
        """Return the load of each bus in a sliding window, and the load per identifier.

        `bit_rate` is 5e3..1e6 [bit/s], and `window` is the length of the window [s]. A time stamp
        marks the end of its frame. The bus counts as idle before the record begins, so the first
        loads are too low. Faults and skipped records are left out.
        """
        rate = check_bit_rate(bit_rate, 5e3)
        window = check_scalar("window", window, "s", 1e-6, 1e9)
        self._check_times("the load")
        order = np.lexsort((self.time, self.channel))
        time, channel, ids, extended, remote, dlc, data = (c[order] for c in self.columns)
        bits = measure_frames(ids, data, dlc, extended=extended, remote=remote).astype(float)
        keys, loads = self.keys[order], np.zeros(len(order))
        totals, messages = [], []

        def share(chosen: Bools) -> Floats:
            return _sliding(time[chosen], bits[chosen], window) / (rate * window)

        for name in np.unique(channel).tolist():
            here = channel == name
            loads[here] = share(here)
            span = np.ptp(time[here]) + bits[here][0] / rate
            load = bits[here].sum() / rate / span
            totals.append((name, here.sum(), span, load, loads[here].max()))
            for key in np.unique(keys[here]).tolist():
                one = here & (keys == key)
                sent, load = bits[one].sum(), bits[one].sum() / rate / span
                identifier = hexadecimal(key >> 1, key & 1), bool(key & 1)
                messages.append((name, *identifier, one.sum(), sent, load, share(one).max()))
        columns = ["channel", "frames", "duration_s", "load", "peak_load"]
        each = ["channel", "arbitration_id", "extended", "frames", "bits", "load", "peak_load"]
        return LogLoad(
            pd.DataFrame({"channel": channel, "time_s": time, "load": loads}),
            pd.DataFrame(messages, columns=each),
            pd.DataFrame(totals, columns=columns).set_index("channel"),
            len(self.faults) + len(self.skipped),
        )

    def messages(self, *, period: float | None = None) -> MessageSet:
        """Return the messages found in the log, as described in the notes of `read_messages`."""
        self._check_times("a message set")
        if period is not None:
            check_scalar("period", period, "s", 1e-6, 1e5)
        if len(buses := np.unique(self.channel).tolist()) > 1:
            raise ArgumentError(
                f"the log has the buses {', '.join(buses)}; a message set has one; select it with "
                f"Log(*(column[log.channel == {buses[0]!r}] for column in log.columns))"
            )
        number, span = len(self), float(np.ptp(self.time)) if len(self) else 0.0
        if not span or (number - 1) * _SHORTEST > span:
            raise ArgumentError(
                f"the log has {number} {'frame' if number == 1 else 'frames'} in {span:.3g} s; a "
                "message set requires at least two, whose time stamps are 47 us apart or more on "
                "average"
            )
        keys, size = self.keys, self.sizes
        times = {key: np.sort(self.time[keys == key]) for key in np.unique(keys).tolist()}
        patterns = {key: _pattern(when, span, self.step) for key, when in times.items()}
        if period:
            alone = (key for key, when in times.items() if len(when) == 1)
            patterns |= {key: patterns[key]._replace(mean=period) for key in alone}
        shortest_mean = min(pattern.mean for pattern in patterns.values())
        messages, rows = [], []
        for key, when in times.items():
            pattern, name = patterns[key], hexadecimal(key >> 1, key & 1)
            burst = pattern.burst
            if math.isnan(pattern.period):
                burst = int(_sliding(when, np.ones(len(when)), shortest_mean).max())
            queued = (burst - 1) * (pattern.mean - pattern.shortest) - self.step if burst > 1 else 0
            mean = round(min(pattern.mean, 1e5), 9)
            jitter = round(min(max(queued, 0.0), 1e5 - mean), 9)
            silence = float(np.diff(when, prepend=self.time.min(), append=self.time.max()).max())
            wander = max(lateness(when, mean)) if pattern.mean == pattern.period else math.nan
            spans = (pattern.period, pattern.jitter, pattern.shortest, silence, wander, self.step)
            rows.append((name, pattern.kind, len(when), burst, *(1e3 * span for span in spans)))
            dlc, extended = int(size[keys == key].max()), bool(key & 1)
            messages.append(
                Message(name, key >> 1, dlc, mean, mean + jitter, jitter, extended=extended)
            )
        columns = ["name", "kind", "frames", "burst", "period_ms", "jitter_ms", "shortest_ms"]
        columns += ["longest_ms", "wander_ms", "step_ms"]
        observed = pd.DataFrame(rows, columns=columns).set_index("name").round(6)
        return MessageSet(messages, observed=observed)


@dataclass(frozen=True, eq=False, repr=False)
class LogLoad:
    """Load of recorded buses, as returned by `Log.load`.

    `left_out` counts faults, CAN FD frames and error frames; if there are any, the load is too low.

    Examples
    --------
    >>> from shipnet import can
    >>> load = can.simulate(can.example(), 125e3, until=1.0).log().load(125e3)
    >>> load
    LogLoad(can0: load 20.5 %, peak 20.3 %; 295 frames)
    >>> load.total().round(3)["load"].to_dict()
    {'can0': 0.205}
    """

    _windows: pd.DataFrame
    _messages: pd.DataFrame
    _total: pd.DataFrame
    left_out: int = 0

    def total(self) -> pd.DataFrame:
        """Return one row per bus, with ``frames``, ``duration_s``, ``load`` and ``peak_load``."""
        return self._total.copy()

    def table(self) -> pd.DataFrame:
        """Return one row per bus and identifier, with its frames, bits, load and peak load."""
        return self._messages.copy()

    def windows(self) -> pd.DataFrame:
        """Return one row per frame, with the load in the window that ends with the frame."""
        return self._windows.copy()

    def __repr__(self) -> str:
        parts = [
            f"{channel}: load {row.load:.1%}, peak {row.peak_load:.1%}".replace("%", " %")
            for channel, row in zip(self._total.index, self._total.itertuples(), strict=True)
        ]
        parts += [f"{len(self._windows) or 'no'} frames"]
        parts += [f"{self.left_out} left out"] if self.left_out else []
        return f"LogLoad({'; '.join(parts)})"

    _repr_html_ = as_html


class _Pattern(NamedTuple):
    """How the frames of a message follow each other in a log; times in s.

    `mean` is the time per frame, and `period` that from one frame or burst to the next.
    """

    kind: str
    mean: float
    period: float
    jitter: float
    burst: int
    shortest: float


def _pattern(times: Floats, span: float, step: float) -> _Pattern:
    """Return the pattern of frames in a log of length `span` whose time stamps have this `step`."""
    gaps, number = np.diff(times), len(times)
    shortest = float(gaps.min(initial=math.inf)) if number > 1 else math.nan
    clear = number >= _FEW
    period, jitter = _period(times, span, step)
    if period > 0:
        kind = "periodic" if clear else "unclear"
        return _Pattern(kind, period, period, jitter, 1, shortest)
    mean = span / number
    if clear:
        first = np.concatenate([[True], gaps > gaps.mean()])
        period, jitter = _period(times[first], span, step)
        clear = int(first.sum()) >= _FEW
        if clear and period > 0:
            most = int(np.diff([*np.flatnonzero(first), number]).max())
            return _Pattern("burst", mean, period, jitter, most, shortest)
    return _Pattern("event" if clear else "unclear", mean, math.nan, math.nan, 1, shortest)


def _period(times: Floats, span: float, step: float) -> tuple[float, float]:
    """Return the period and the local jitter of frames; NaN unless they are sent regularly.

    The period is the median of the time per frame between any two of up to 300 frames, as in the
    Theil-Sen estimator. Lost frames are counted if the time stamps are fine enough.
    """
    from scipy.ndimage import median_filter

    gaps, number = np.diff(times), np.arange(len(times), dtype=float)
    if not len(gaps):
        return math.nan, math.nan
    pairs = gaps[1:] + gaps[:-1]
    if (usual := float(np.median(pairs if len(pairs) else 2 * gaps)) / 2) >= 4 * step:
        # After a lost frame, the two gaps to the neighbours are long; after a late one, one is.
        pairs = np.concatenate([[math.inf], pairs, [math.inf]]) / usual
        steps = np.minimum(np.rint(gaps / usual), np.rint(np.minimum(pairs[1:], pairs[:-1])) - 1)
        number[1:] = np.maximum(1, steps).cumsum()
    some = np.unique(np.linspace(0, len(times) - 1, _FRAMES).astype(int))
    first, second = np.triu_indices(len(some), 1)
    lags = number[some[second]] - number[some[first]]
    period = float(np.median((times[some[second]] - times[some[first]]) / lags))
    regular = np.abs(gaps - period) <= period / 2 + step
    if regular.mean() < 0.75 or 0.75 * span > (len(times) + 1) * period:
        return math.nan, math.nan
    delay = times - number * period
    local = delay - median_filter(delay, _NEIGHBOURS, mode="nearest")
    return period, max(float(np.ptp(local)) - step, 0.0)


def lateness(times: Floats, period: float) -> tuple[float, float]:
    """Return how late and how early a frame is at most, relative to any frame before it [s]."""
    number = np.arange(len(times))
    slow, fast = (period * (1 + sign * CLOCK_TOLERANCE) for sign in (1, -1))
    late, early = times - number * slow, number * fast - times
    rises = (float((rise - np.minimum.accumulate(rise)).max()) for rise in (late, early))
    return next(rises), next(rises)


def coarse(step: float) -> list[str]:
    """Return words that name the step of time stamps, if it is longer than the shortest frame."""
    return [f"time stamps in steps of {step * 1e3:g} ms"] if step > _SHORTEST else []


def _sliding(time: Floats, bits: Floats, window: float) -> Floats:
    """Return, for each frame, the number of bits in the window that ends with that frame."""
    summed = np.concatenate([[0.0], np.cumsum(bits)])
    # Time stamps are often rounded to 1 us; the margin excludes a frame exactly one window earlier.
    first = np.searchsorted(time, time - window + 1e-7, side="left")
    last = np.searchsorted(time, time, side="right")
    return np.asarray(summed[last] - summed[first])
