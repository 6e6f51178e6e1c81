"""Find the telegrams in a recorded voltage: resample it, follow its baseline, group its pulses.

A burst is a row of pulses with silence before and after it. From the peak of its first pulse to
that of its last one it takes 78 us if it is a request, and 36 us if it is a response.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from typing import Any, Literal, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from shipnet.arrays import Bools, Floats, Indices, Integers
from shipnet.asi.batch import NONE
from shipnet.asi.modulation import HALF_BIT
from shipnet.asi.receiver import filtered, receive
from shipnet.asi.telegram import REQUEST_BITS, RESPONSE_BITS

Singles = npt.NDArray[np.float32]

#: Silence that ends a telegram [s]. Two half-bits in a row are never empty, so pulses are 6 us
#: apart at most, and 9 us where one is lost; from a telegram's last pulse to the first of the next
#: one it takes 6 us more than the pause, which is 1 bit time or more: 12 us.
SILENCE = 3.5 * HALF_BIT

#: Samples a second to work with: the pulses end at 0.7 MHz, twelve samples a half-bit are ample.
_RATE = 4e6

#: Length of the pieces in which a record is worked through [samples], of what overlaps, and of a
#: stretch whose mean is its baseline [s]: the pulses of a telegram add up to 0.
_PIECE, _OVERLAP, _STRETCH = 2**20, 240e-6, 250e-6

#: Pulses smaller than this part of their neighbours are ringing. The largest signal allowed is 2.7
#: times the smallest, so no telegram is that small beside another one.
_RINGING = 0.2

#: Peak of the first pulse to peak of the last one [s].
_SPANS = {bits: (2 * bits - 2) * HALF_BIT for bits in (RESPONSE_BITS, REQUEST_BITS)}


class Sampling(NamedTuple):
    """How a record is resampled: mean of so many samples, then so many up, so many down."""

    dt: float
    mean: int
    up: int
    down: int

    @classmethod
    def of(cls, dt: float) -> Sampling:
        """Choose for records of any rate: 4 to 8 million samples a second."""
        # The mean of neighbours has its zeros where it folds: a cheap first step from high rates.
        mean = max(1, int(1 / (dt * 5 * _RATE) + 1e-9))
        rate = 1 / (dt * mean)
        return cls(dt, mean, max(1, int(np.ceil(_RATE / rate - 1e-9))), max(1, int(rate / _RATE)))

    @property
    def step(self) -> float:
        """Time between two samples afterwards [s]."""
        return self.dt * self.mean * self.down / self.up


class Piece(NamedTuple):
    """A stretch of the record, resampled, its baseline at 0."""

    x: Singles
    y: Singles
    start: float
    step: float
    begin: float
    end: float


class Bursts(NamedTuple):
    """The bursts of a piece."""

    first: Indices
    last: Indices
    height: Floats
    bits: Integers
    fits: Bools
    pulses: Integers

    def where(self, chosen: Bools) -> Bursts:
        """Return some of the bursts."""
        return Bursts._make(part[chosen] for part in self)


def pieces(
    u: Floats, dt: float, *, length: int = _PIECE, only: Indices | None = None
) -> Iterator[Piece]:
    """Work through a record in overlapping pieces, so that memory stays bounded."""
    sampling = Sampling.of(dt)
    group = sampling.mean * sampling.down
    length = -(-length // group) * group
    overlap = -(-int(_OVERLAP / dt) // group) * group
    count = -(-len(u) // length)
    for number in range(count) if only is None else only:
        core = int(number) * length
        low, high = max(0, core - overlap), min(len(u), core + length + overlap)
        x = _flatten(resample(u[low:high], sampling), sampling.step)
        yield Piece(
            x,
            _matched(x, sampling.step),
            low * dt + (sampling.mean - 1) / 2 * dt,
            sampling.step,
            core * dt,
            (core + length) * dt,
        )


def resample(u: Floats, sampling: Sampling) -> Singles:
    """Return the voltage less a constant at the rate that `sampling` says."""
    # Single precision resolves 2 uV on 30 V, but only if a filter need not swallow the 30 V.
    some = u[:: max(1, len(u) // 4096)]
    some = some[~np.isnan(some)]
    offset = float(np.median(some)) if some.size else 0.0
    _, mean, up, down = sampling
    taps = _lowpass(mean, up, down)
    front = (len(taps) // mean // 2) // up * mean
    used = len(u) // mean * mean
    v = np.empty(front + used + 4 * max(len(taps), 16 * mean * down), np.float32)
    own = v[front : front + used]
    np.subtract(u[:used], offset, out=own, casting="same_kind")
    # A sum of squares sees any sample that is not a number, and is the fastest look at them all.
    if np.isnan(own @ own):
        np.nan_to_num(own, copy=False)
    # Beyond its ends the record goes on as it is there on average: a step would look like a pulse.
    around = max(1, round(30e-6 / (sampling.dt * mean))) * mean
    for end, beyond in ((own[:around], v[:front]), (own[-around:], v[front + used :])):
        beyond[:] = np.median(end.reshape(-1, mean).mean(axis=1)) if used else 0.0
    return filtered(taps, v, used // mean * up // down, up, mean * down)


@cache
def _lowpass(mean: int, up: int, down: int) -> Singles:
    """Return an anti-alias filter: 60 dB where something could fold into the pulses' 0.7 MHz."""
    # From 4 MS/s on, all above rate - 0.7 MHz may fold; below, the recorder has folded already.
    half = 8 * up if up > 1 else 3 * down if down > 1 else 0
    k = np.arange(-half, half + 1)
    taps = np.sinc(k / max(up, down)) * np.kaiser(len(k), 5.65)
    return np.repeat((up / mean * taps / taps.sum()).astype(np.float32), mean)


def _flatten(x: Singles, step: float) -> Singles:
    """Take off the baseline: the mean, or its course if the record is long enough to have one."""
    stretch = round(_STRETCH / step)
    count = len(x) // stretch
    if count < 3:
        return x - x.mean(dtype=np.float64).astype(np.float32) if len(x) else x
    means = x[: count * stretch].reshape(count, stretch).mean(axis=1)
    # Linear from the middle of a stretch to that of the next one, and on to both ends.
    means = np.concatenate([2 * means[:1] - means[1:2], means, 2 * means[-1:] - means[-2:-1]])
    ramp = (np.arange(stretch, dtype=np.float32) + 0.5) / stretch
    course = (means[:-1, np.newaxis] + np.diff(means)[:, np.newaxis] * ramp).ravel()
    course = course[stretch // 2 :]
    rest = np.full(max(0, len(x) - len(course)), course[-1])
    return np.asarray(x - np.concatenate([course, rest])[: len(x)], np.float32)


def _matched(x: Singles, step: float) -> Singles:
    """Filter with the shape of a pulse, as `shipnet.asi.receiver.matched_filter` does, but fast."""
    half = int(HALF_BIT / step / 2)
    shape = np.cos(np.pi * np.arange(-half, half + 1) * step / HALF_BIT) ** 2
    kernel = (shape / (shape**2).sum()).astype(np.float32)
    edge = np.zeros(half, np.float32)
    return filtered(kernel, np.concatenate([edge, x]), len(x))


def smallest_pulses(sample: list[Piece]) -> list[float]:
    """Estimate from a few pieces below which voltage nothing is a pulse."""
    blocks = [
        np.abs(piece.y[: len(piece.y) // 100 * 100]).reshape(-1, 100).max(axis=1)
        for piece in sample
    ]
    largest = np.sort(np.concatenate(blocks)) if blocks else np.zeros(0)
    if not largest.size:
        return []
    # Not the largest of all: that may be an impulse.
    few = largest[-min(4, 1 + largest.size // 2)]
    typical = [float(few), *np.quantile(largest, [0.9, 0.75, 0.5]).tolist()]
    return [max(0.1 * size, min(5 * _noise(sample, size), 0.4 * size)) for size in typical]


def _noise(sample: list[Piece], typical: float) -> float:
    """Return the standard deviation of the filtered voltage where no pulse is near."""
    from scipy.ndimage import binary_dilation

    idle = []
    for piece in sample:
        reach = round(2 * HALF_BIT / piece.step)
        loud = np.abs(piece.y) > 0.35 * typical
        idle.append(piece.y[~binary_dilation(loud, np.ones(2 * reach + 1, bool))])
    quiet = np.concatenate(idle)
    return 1.4826 * float(np.median(np.abs(quiet - np.median(quiet)))) if quiet.size else 0.0


def find_bursts(piece: Piece, minimum: float) -> Bursts:
    """Group the pulses of a piece into bursts."""
    at, height = _pulses(piece.y, minimum)
    if at.size:
        from scipy.ndimage import maximum_filter1d

        keep = np.abs(height) >= _RINGING * maximum_filter1d(np.abs(height), 17)
        at, height = at[keep], height[keep]
    start = np.flatnonzero(np.diff(at, prepend=-(2**40)) * piece.step > SILENCE)
    first, last = at[start], at[np.append(start[1:], len(at)) - 1] if len(at) else at
    start, first, last = _rejoin(start, first, last, piece.step)
    span = (last - first) * piece.step
    middle = sum(_SPANS.values()) / 2
    bits = np.where(span > middle, REQUEST_BITS, RESPONSE_BITS)
    pulses = np.diff(np.append(start, len(at)))
    return Bursts(first, last, height[start], bits, _fits(span), pulses)


def _fits(span: npt.NDArray[np.floating]) -> Bools:
    fits = np.zeros(span.shape, dtype=bool)
    for length in _SPANS.values():
        fits |= np.abs(span - length) < HALF_BIT / 2
    return fits


def _pulses(y: Singles, minimum: float) -> tuple[Indices, Floats]:
    """Return where the voltage peaks between two crossings of the minimum, and the peaks."""
    size = np.abs(y)
    loud = np.flatnonzero(size > minimum)
    if not loud.size:
        return loud, np.zeros(0)
    size = size[loud]
    positive = y[loud] > 0
    new = np.ones(loud.size, dtype=bool)
    new[1:] = (np.diff(loud) > 1) | (positive[1:] != positive[:-1])
    start = np.flatnonzero(new)
    peak = np.maximum.reduceat(size, start)
    run = np.cumsum(new) - 1
    tops = np.flatnonzero(size == peak[run])
    tops = tops[np.diff(run[tops], prepend=-1) > 0]
    return loud[tops], y[loud[tops]].astype(np.float64)


def _rejoin(
    start: Indices, first: Indices, last: Indices, step: float
) -> tuple[Indices, Indices, Indices]:
    """Join two bursts that are the halves of one telegram with a hole of four half-bits."""
    if len(first) < 2:
        return start, first, last
    whole = _fits((last - first) * step)
    gap = (first[1:] - last[:-1]) * step
    join = (gap < 4.5 * HALF_BIT) & ~whole[1:] & ~whole[:-1]
    join &= _fits((last[1:] - first[:-1]) * step)
    keep = np.append(True, ~join)
    return start[keep], first[keep], last[np.append(~join, True)]


# Bursts received ------------------------------------------------------------------------------

#: Length of a piece by which the record is measured [s], and how many there are.
_SAMPLE, _SAMPLES = 2e-3, 8

#: Samples from before the first peak and after the last slot that the receiver gets [s].
_BEFORE, _BEHIND = 5e-6, 1e-6

#: The first pulse is looked for from this part of its own height on; ringing stays below.
_FIRST_PULSE = 0.4

#: Recording that begins or ends so near to a telegram may have missed a pulse of it [s]: pulses
#: are two half-bits apart at most.
_NEAR = 2.5 * HALF_BIT

#: Fewest pulses that are reported as a broken telegram; with fewer it is a disturbance.
_FEWEST_PULSES = 5


#: A telegram of a record: its start, its first and its last pulse [s], its length [bit], its word
#: and which bits of it are known, its error code, its first pulse [V], its weakest pulse and its
#: ringing as in `Reception`, whether the burst fits a telegram, and the edge of the record that it
#: touches: 1 the front, 2 the back, 0 none.
_TELEGRAM = np.dtype(
    [
        *((name, np.float64) for name in ("start", "first", "last")),
        *((name, np.int64) for name in ("length", "word", "known", "error")),
        *((name, np.float64) for name in ("amplitude", "weakest", "ringing")),
        ("fits", np.bool_), ("edge", np.int64),
    ]
)  # fmt: skip

Telegrams: TypeAlias = "np.recarray[Any, Any]"


def _joined(parts: list[Telegrams]) -> Telegrams:
    """Put batches together, in the order of time."""
    whole = np.concatenate(parts).view(np.recarray)
    order = np.argsort(whole.first, kind="stable")
    return whole[order].view(np.recarray)


class Found(NamedTuple):
    """What is in a record."""

    telegrams: Telegrams
    #: When recording ends, at the end and before what is missing [s].
    ends: Floats
    inverted: bool
    #: Voltage below which nothing counted as a pulse [V].
    minimum: float
    #: Bursts of too few pulses for a telegram.
    disturbances: int


def find_telegrams(u: Floats, dt: float, threshold: float, minimum: float | None) -> Found:
    """Find and receive the telegrams of a record; `decode` says how."""
    sample = list(pieces(u, dt, length=round(_SAMPLE / dt), only=_liveliest(u, dt)))
    limits = smallest_pulses(sample) if minimum is None else [minimum]
    minimum, sign = _measure(sample, limits, threshold)
    begins, ends = _edges(u, dt)
    parts: list[Telegrams] = []
    disturbances = 0
    for piece in pieces(u, dt):
        bursts = find_bursts(piece, minimum)
        first = piece.start + bursts.first * piece.step
        last = piece.start + bursts.last * piece.step
        own = (first >= piece.begin) & (first < piece.end)
        # What is cut off may be short.
        cut_front = _distance(first, begins, "right") < _NEAR
        cut_back = -_distance(last, ends, "left") < _NEAR
        whole = bursts.pulses >= np.where(cut_front | cut_back, 2, _FEWEST_PULSES)
        disturbances += int((own & ~whole).sum())
        kept = bursts.where(own & whole)
        edge = np.where(cut_front, 1, np.where(cut_back, 2, 0))[own & whole]
        parts.append(_receive(piece, kept, edge, sign, threshold))
    return Found(_joined(parts), ends, sign < 0, minimum, disturbances)


def _liveliest(u: Floats, dt: float) -> Indices:
    """Choose up to 8 short pieces with much going on, to take the measure of the record."""
    length = round(_SAMPLE / dt)
    count = -(-len(u) // length)
    if count <= _SAMPLES:
        return np.arange(count)
    # A look at every 2 us or so finds the pieces with telegrams.
    stride = max(1, round(2e-6 / dt))
    whole = len(u) // length
    looks = u[: whole * length].reshape(whole, length)[:, ::stride]
    swing = np.nan_to_num(np.fmax.reduce(looks, axis=1) - np.fmin.reduce(looks, axis=1))
    lively = np.flatnonzero(swing >= np.quantile(swing, 0.75))
    return np.unique(lively[np.linspace(0, len(lively) - 1, _SAMPLES).astype(np.intp)])


def _edges(u: Floats, dt: float) -> tuple[Floats, Floats]:
    """Return when recording begins and when it ends, at the ends and around what is missing [s]."""
    if u.dtype.kind != "f" or np.isfinite(u @ u):
        return np.zeros(1), np.array([len(u) * dt])
    nothing = np.isnan(u)
    change = np.diff(nothing.view(np.int8), prepend=0, append=0)
    since, until = np.flatnonzero(change > 0), np.flatnonzero(change < 0)
    # A few samples that are missing break nothing.
    long = (until - since) * dt > HALF_BIT
    return np.append(0, until[long]) * dt, np.append(since[long], len(u)) * dt


def _distance(
    times: npt.NDArray[np.floating], edges: Floats, side: Literal["left", "right"]
) -> npt.NDArray[np.floating]:
    """Return the time since the last edge ("right"), or since the next one, which is negative."""
    place = np.searchsorted(edges, times, side) - (side == "right")
    return times - edges[np.clip(place, 0, len(edges) - 1)]


def _measure(sample: list[Piece], limits: list[float], threshold: float) -> tuple[float, int]:
    """Return the limit and the polarity with which most telegrams of a sample are right."""
    best, most = (limits[0] if limits else 0.0, 1), -1.0
    for minimum in limits:
        right, heights, count = {1: 0, -1: 0}, 0, 0
        for piece in sample:
            bursts = find_bursts(piece, minimum)
            few = bursts.where(bursts.fits & (np.cumsum(bursts.fits) <= 64))
            edge = np.zeros(few.first.shape, dtype=np.int64)
            for sign in right:
                received = _receive(piece, few, edge, sign, threshold)
                right[sign] += int((received.error == 0).sum())
            count += int((bursts.pulses >= _FEWEST_PULSES).sum())
            heights += int(np.sign(bursts.height).sum())
        # The first pulse is negative: if no telegram is right, this is the next best evidence.
        sign = -1 if (right[-1], heights) > (right[1], 0) else 1
        if right[sign] > most:
            best, most = (minimum, sign), right[sign]
        if 2 * right[sign] > count:
            break
    return best


def _receive(
    piece: Piece, bursts: Bursts, edge: Integers, sign: int, threshold: float
) -> Telegrams:
    """Decode the bursts of a piece, requests and responses each in one go."""
    parts = []
    before, behind = round(_BEFORE / piece.step), round(_BEHIND / piece.step)
    for n_bits in (REQUEST_BITS, RESPONSE_BITS):
        chosen = bursts.bits == n_bits
        begin = bursts.first[chosen] - before
        length = before + round(2 * n_bits * HALF_BIT / piece.step) + behind
        # Beyond the ends of the record nothing was heard.
        around = np.pad(piece.x, (before, length))
        # Measured in its own first pulse, a telegram needs no common limit for what is a pulse.
        unit = np.abs(bursts.height[chosen])
        rows = np.lib.stride_tricks.sliding_window_view(around, length)[begin + before]
        rows *= (sign / unit).astype(np.float32)[:, np.newaxis]
        received = receive(
            rows, piece.step, n_bits, threshold=threshold, minimum=min(_FIRST_PULSE, threshold)
        )
        bits = received.bits.astype(np.int64)
        weights = 1 << np.arange(n_bits)[::-1]
        fields = [
            piece.start + begin * piece.step + received.start,
            piece.start + bursts.first[chosen] * piece.step,
            piece.start + bursts.last[chosen] * piece.step,
            np.full(len(bits), n_bits),
            np.maximum(bits, 0) @ weights,
            (bits != NONE) @ weights,
            received.error.astype(np.int64),
            received.amplitude * unit,
            received.weakest,
            received.ringing,
            bursts.fits[chosen],
            edge[chosen],
        ]
        parts.append(np.rec.fromarrays(fields, dtype=_TELEGRAM))
    return _joined(parts)
