"""Find telegrams in a recorded voltage: resample it, subtract its baseline and group its pulses.

A burst is a sequence of pulses with silence before and after it. The first and last peaks are
78 us apart in a request and 36 us apart in a response.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from itertools import product
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt
from scipy.ndimage import binary_dilation, correlate1d, maximum_filter1d

from shipnet.arrays import Bools, Floats, Indices, Integers, parts_of, release
from shipnet.asi.batch import NONE
from shipnet.asi.modulation import HALF_BIT
from shipnet.asi.receiver import receive
from shipnet.asi.telegram import REQUEST_BITS, RESPONSE_BITS
from shipnet.errors import ArgumentError

Singles = npt.NDArray[np.float32]

#: Shortest silence that ends a telegram [s]. Pulses of one telegram are at most 6 us apart (9 or
#: 12 us if one is lost; see `_rejoin`); pulses of different telegrams are at least 12 us apart.
SILENCE = 3.5 * HALF_BIT

#: Lowest sampling rate after resampling [Hz]; the spectrum of the pulses extends to 0.7 MHz.
_RATE = 4e6

#: Length of a piece [samples], its extension at each end [s], and length of the intervals whose
#: means form the baseline [s]. Telegrams hardly change a mean: their pulses add up to 0.
_PIECE, _OVERLAP, _STRETCH = 2**20, 240e-6, 250e-6

#: Length [s] of the zeros added to each end of a piece, because telegrams may be cut off there.
_MARGIN = 110e-6

#: Smallest height of a pulse, relative to the largest pulse nearby; lower peaks are ringing. The
#: largest legal signal is 2.7 times the smallest, so all pulses of a telegram exceed this limit.
_RINGING = 0.2

#: Time from the first to the last peak of a telegram [s], by its number of bits.
_SPANS = {bits: (2 * bits - 2) * HALF_BIT for bits in (RESPONSE_BITS, REQUEST_BITS)}


class Sampling(NamedTuple):
    """Two steps of resampling: average `mean` samples, then multiply the rate by `up` / `down`."""

    dt: float
    mean: int
    up: int
    down: int

    @classmethod
    def of(cls, dt: float) -> Sampling:
        """Return the steps that resample a record with sampling interval `dt` to 4..8 MS/s."""
        # Averaging is a cheap first step: it rejects the frequencies that would alias to 0 Hz.
        mean = max(1, int(1 / (dt * 5 * _RATE) + 1e-9))
        rate = 1 / (dt * mean)
        return cls(dt, mean, max(1, int(np.ceil(_RATE / rate - 1e-9))), max(1, int(rate / _RATE)))

    @property
    def step(self) -> float:
        """Sampling interval after resampling [s]."""
        return self.dt * self.mean * self.down / self.up


class Piece(NamedTuple):
    """A piece of a record, resampled and with its baseline subtracted."""

    #: Voltage [V] with `margin` zeros at each end, and voltage after the matched filter [V].
    around: Singles
    y: Singles
    margin: int
    start: float
    step: float
    begin: float
    end: float


class Bursts(NamedTuple):
    """The bursts in one piece of a record."""

    first: Indices
    last: Indices
    height: Floats
    bits: Integers
    fits: Bools
    pulses: Integers

    def where(self, chosen: Bools) -> Bursts:
        """Return the bursts for which `chosen` is True."""
        return Bursts._make(part[chosen] for part in self)


def pieces(
    u: Floats, dt: float, *, length: int = _PIECE, only: Indices | None = None
) -> Iterator[Piece]:
    """Yield a record in overlapping pieces, to limit the memory needed."""
    sampling = Sampling.of(dt)
    group = sampling.mean * sampling.down
    length = -(-length // group) * group
    overlap = -(-int(_OVERLAP / dt) // group) * group
    step, margin = sampling.step, round(_MARGIN / sampling.step)
    for number in range(-(-len(u) // length)) if only is None else only:
        core = int(number) * length
        low, high = max(0, core - overlap), min(len(u), core + length + overlap)
        x = resample(u[low:high], sampling)
        release(u)
        _flatten(x, step)
        y = correlate1d(x, _pulse(step), mode="constant") if len(x) else x
        start = (low + (sampling.mean - 1) / 2) * dt
        yield Piece(np.pad(x, margin), y, margin, start, step, core * dt, (core + length) * dt)


def resample(u: Floats, sampling: Sampling) -> Singles:
    """Resample a voltage after subtracting its median."""
    # Filtering 30 V in single precision would lose small signals, so subtract the offset first.
    offset = _middle(u, 512)
    _, mean, up, down = sampling
    v = np.subtract(u[: len(u) // mean * mean], offset, dtype=np.float32, casting="same_kind")
    if np.isnan(v).any():
        np.nan_to_num(v, copy=False, nan=_middle(u, 4096) - offset)
    v = np.asarray(v.reshape(-1, mean).mean(axis=1))
    if not len(v):
        return v
    # Pad each end with the median of the samples near it, because a step would look like a pulse.
    taps = _lowpass(up, down)
    reach, near = len(taps) // 2 // up, max(1, round(30e-6 / (sampling.dt * mean)))
    ends = (reach, reach + down)
    padded = np.pad(v, ends, constant_values=(np.median(v[:near]), np.median(v[-near:])))
    # Insert zeros to raise the rate, filter, and keep every sample that the lower rate needs.
    spread = np.zeros(len(padded) * up, np.float32)
    spread[::up] = padded
    around = np.lib.stride_tricks.sliding_window_view(spread, len(taps))
    resampled: Singles = around[::down][: len(v) * up // down] @ taps
    return resampled


def _middle(u: npt.NDArray[Any], looks: int) -> float:
    """Return the median of about `looks` samples of `u`, ignoring NaN; 0 if none remain."""
    some = u[:: max(1, len(u) // looks)]
    some = some[~np.isnan(some)]
    return float(np.median(some)) if some.size else 0.0


@cache
def _lowpass(up: int, down: int) -> Singles:
    """Return the taps of a filter that limits the bandwidth."""
    # In a record sampled below 4 MS/s, noise is already aliased, and the filter only interpolates.
    # Otherwise it attenuates by about 60 dB what decimation by `down` would alias to below 0.7 MHz.
    half = 8 * up if up > 1 else 3 * down if down > 1 else 0
    k = np.arange(-half, half + 1)
    taps = np.sinc(k / max(up, down)) * np.kaiser(len(k), 5.65)
    return np.asarray(up * taps / taps.sum(), np.float32)


def _flatten(x: Singles, step: float) -> None:
    """Subtract the baseline: the interpolated means of intervals, or the mean of a short `x`."""
    stretch = round(_STRETCH / step)
    count = len(x) // stretch
    if count < 3:
        x -= x.mean(dtype=np.float64) if len(x) else 0
        return
    means = x[: count * stretch].reshape(count, stretch).mean(axis=1)
    # Interpolate linearly between the centres of the intervals, and extrapolate to both ends.
    means = np.concatenate([2 * means[:1] - means[1:2], means, 2 * means[-1:] - means[-2:-1]])
    ramp = (np.arange(stretch, dtype=np.float32) + 0.5) / stretch
    lines = np.stack([means[:-1], np.diff(means)], axis=1)
    course = (lines @ np.stack([np.ones_like(ramp), ramp])).ravel()[stretch // 2 :]
    x[: len(course)] -= course[: len(x)]
    x[len(course) :] -= course[-1]


@cache
def _pulse(step: float) -> Singles:
    """Return the matched filter's taps, as in `shipnet.asi.receiver.matched_filter`."""
    half = int(HALF_BIT / step / 2)
    shape = np.cos(np.pi * np.arange(-half, half + 1) * step / HALF_BIT) ** 2
    return np.asarray(shape / (shape**2).sum(), np.float32)


def smallest_pulses(sample: list[Piece]) -> Iterator[float]:
    """Yield candidates for the height of the smallest pulse [V], the most likely one first."""
    blocks = [piece.y[: len(piece.y) // 100 * 100].reshape(-1, 100) for piece in sample]
    if not any(block.size for block in blocks):
        return
    largest = np.sort(np.concatenate([np.abs(block).max(axis=1) for block in blocks]))
    # Skip up to three of the largest values, which may be impulses.
    few = largest[-min(4, 1 + largest.size // 2)]
    for size in [float(few), *np.quantile(largest, [0.9, 0.75, 0.5]).tolist()]:
        # The standard deviation of the voltage between pulses.
        idle = []
        for piece in sample:
            around = np.ones(2 * round(2 * HALF_BIT / piece.step) + 1, bool)
            idle.append(piece.y[~binary_dilation(np.abs(piece.y) > 0.35 * size, around)])
        quiet = np.concatenate(idle)
        noise = 1.4826 * float(np.median(np.abs(quiet - np.median(quiet)))) if quiet.size else 0.0
        yield max(0.1 * size, min(5 * noise, 0.4 * size))


def find_bursts(piece: Piece, minimum: float) -> Bursts:
    """Group the pulses of a piece into bursts."""
    at, height = _pulses(piece.y, minimum)
    if at.size:
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
    """Return the indices and heights [V] of peaks larger than `minimum`, one peak per pulse."""
    rises, falls = np.ones((2, len(y) + 1), dtype=bool)
    np.greater(y[1:], y[:-1], out=rises[1:-1])
    np.less(y[1:], y[:-1], out=falls[1:-1])
    rises[-1:] = falls[-1:] = False
    high, low = y > minimum, y < -minimum
    at = np.flatnonzero((high & rises[:-1] & ~rises[1:]) | (low & falls[:-1] & ~falls[1:]))
    height = y[at].astype(np.float64)
    # If the voltage stays above the minimum between two peaks of one sign, keep the larger peak.
    again = np.flatnonzero((height[1:] > 0) == (height[:-1] > 0))
    if again.size:
        new = np.ones(at.size, dtype=bool)
        ends = np.stack([at[again], at[again + 1]], axis=1).ravel()
        new[again + 1] = ~np.logical_and.reduceat(high | low, ends)[::2]
        size, run = np.abs(height), np.cumsum(new) - 1
        best = np.flatnonzero(size == np.maximum.reduceat(size, np.flatnonzero(new))[run])
        best = best[np.diff(run[best], prepend=-1) > 0]
        at, height = at[best], height[best]
    return at, height


def _rejoin(
    start: Indices, first: Indices, last: Indices, step: float
) -> tuple[Indices, Indices, Indices]:
    """Join adjacent bursts, up to four half-bits apart, that are two parts of one telegram."""
    if len(first) < 2:
        return start, first, last
    whole = _fits((last - first) * step)
    gap = (first[1:] - last[:-1]) * step
    join = (gap < 4.5 * HALF_BIT) & ~whole[1:] & ~whole[:-1]
    join &= _fits((last[1:] - first[:-1]) * step)
    keep = np.append(True, ~join)
    return start[keep], first[keep], last[np.append(~join, True)]


#: Length [s] and number of the pieces that determine the smallest pulse and the polarity.
_SAMPLE, _SAMPLES = 2e-3, 8

#: Maximum number of pieces that `_liveliest` compares, and of batches of telegrams to merge: the
#: operating system can reclaim large blocks of memory, but not small ones.
_LOOKS, _PARTS = 512, 40

#: Largest voltage that a record may contain [V].
LARGEST = 1e9

#: Time before the first peak, and time after the last slot, that the receiver processes [s].
_BEFORE, _BEHIND = 5e-6, 1e-6

#: Detection threshold for the first pulse, relative to its height; ringing is smaller.
_FIRST_PULSE = 0.4

#: Largest distance from an edge of the record at which a telegram may be cut off [s].
_NEAR = 2.5 * HALF_BIT

#: Smallest number of pulses in a faulty telegram; a burst with fewer counts as a disturbance.
_FEWEST_PULSES = 5

#: Fields of a telegram: its start, first and last peak [s]; its length [bit]; its word and a mask
#: of the known bits; its error code; the height of its first pulse [V]; `weakest` and `ringing` as
#: in `Reception`; True if the burst is as long as a telegram; and whether the telegram is near
#: an edge of the recording: 1 for the start, 2 for the end, 0 for neither.
_TELEGRAM = np.dtype(
    [
        *((name, np.float64) for name in ("start", "first", "last")),
        *(("length", np.int8), ("word", np.int16), ("known", np.int16), ("error", np.uint8)),
        *((name, np.float64) for name in ("amplitude", "weakest", "ringing")),
        *(("fits", np.bool_), ("edge", np.int8)),
    ]
)

Telegrams: TypeAlias = "np.recarray[Any, Any]"


def _joined(parts: list[Telegrams]) -> Telegrams:
    """Merge batches of telegrams and sort them by time."""
    whole: Telegrams = np.concatenate(parts).view(np.recarray)
    if (np.diff(whole["first"]) < 0).any():
        whole = whole[np.argsort(whole["first"], kind="stable")].view(np.recarray)
    return whole


class Found(NamedTuple):
    """The telegrams found in a record, with its polarity and disturbances."""

    telegrams: Telegrams
    #: Times at which the recording stops: the start of each gap and the end of the record [s].
    ends: Floats
    inverted: bool
    #: Smallest voltage that counts as a pulse [V].
    minimum: float
    #: Number of bursts with too few pulses for a telegram.
    disturbances: int


def find_telegrams(u: Floats, dt: float, threshold: float) -> Found:
    """Find and receive the telegrams of a record, as described in `decode`."""
    begins, ends = _edges(u, dt)
    sample = list(pieces(u, dt, length=round(_SAMPLE / dt), only=_liveliest(u, dt)))
    minimum, sign = _measure(sample, threshold)
    parts: list[Telegrams] = []
    disturbances = 0
    for piece in pieces(u, dt):
        bursts = find_bursts(piece, minimum)
        first = piece.start + bursts.first * piece.step
        last = piece.start + bursts.last * piece.step
        inside = (first >= piece.begin) & (first < piece.end)
        cut_front = first - begins[np.searchsorted(begins, first, "right") - 1] < _NEAR
        cut_back = ends[np.minimum(np.searchsorted(ends, last), len(ends) - 1)] - last < _NEAR
        whole = bursts.pulses >= np.where(cut_front | cut_back, 2, _FEWEST_PULSES)
        disturbances += int((inside & ~whole).sum())
        edge = np.where(cut_front, 1, np.where(cut_back, 2, 0))[inside & whole]
        parts.append(_received(piece, bursts.where(inside & whole), edge, sign, threshold))
        if len(parts) == _PARTS:
            parts = [_joined(parts)]
    return Found(_joined(parts), ends, sign < 0, minimum, disturbances)


def _liveliest(u: Floats, dt: float) -> Indices:
    """Return the indices of up to 8 short pieces among those in which the voltage varies most."""
    length = round(_SAMPLE / dt)
    count = -(-len(u) // length)
    if count <= _SAMPLES:
        return np.arange(count)
    # One sample per 2 us or so is enough to find telegrams; reading all samples would be slow.
    stride = max(1, round(2e-6 / dt))
    some = np.unique(np.linspace(0, len(u) // length - 1, _LOOKS).astype(np.intp))
    swing = np.zeros(len(some))
    for row, k in enumerate(some):
        looks = u[k * length : (k + 1) * length : stride]
        swing[row] = np.nan_to_num(float(np.fmax.reduce(looks)) - float(np.fmin.reduce(looks)))
        release(u)
    lively = some[swing >= np.quantile(swing, 0.75)]
    return np.unique(lively[np.linspace(0, len(lively) - 1, _SAMPLES).astype(np.intp)])


def _edges(u: Floats, dt: float) -> tuple[Floats, Floats]:
    """Return the start times and the end times [s] of the parts of a record between its gaps."""
    changes: list[Indices] = []
    missing = False
    for low, part in parts_of(u):
        nothing = np.zeros(1, dtype=bool)
        # The sum of squares is the fastest check that no sample is NaN or too large.
        with np.errstate(over="ignore", invalid="ignore"):
            fine = part.dtype.kind == "f" and part @ part <= LARGEST**2
        if not fine:
            for extreme in (np.fmax.reduce(part), np.fmin.reduce(part)):
                if abs(float(extreme)) > LARGEST:
                    raise ArgumentError(
                        f"u contains {extreme} V; the magnitude must be at most {LARGEST:g} V"
                    )
            nothing = np.isnan(part)
        changes.append(low + np.flatnonzero(np.diff(nothing.view(np.int8), prepend=missing)))
        missing = bool(nothing[-1])
    change = np.concatenate([*changes, [len(u)] * missing]).astype(np.intp)
    since, until = change[::2], change[1::2]
    # Gaps of up to a half-bit do not interrupt the recording.
    long = (until - since) * dt > HALF_BIT
    return np.append(0, until[long]) * dt, np.append(since[long], len(u)) * dt


def _measure(sample: list[Piece], threshold: float) -> tuple[float, int]:
    """Return the smallest pulse [V] and polarity (1, -1) that yield the most correct telegrams."""
    best, most = (0.0, 1), -1
    for minimum in smallest_pulses(sample):
        each = [(piece, find_bursts(piece, minimum)) for piece in sample]
        right = dict.fromkeys((1, -1), 0)
        for sign, (piece, bursts) in product(right, each):
            some = bursts.where(bursts.fits & (np.cumsum(bursts.fits) <= 64))
            received = _received(piece, some, some.bits, sign, threshold)
            right[sign] += int((received.error == 0).sum())
        # In a tie, the first pulses decide: they are negative unless the record is inverted.
        heights = sum(int(np.sign(bursts.height).sum()) for _, bursts in each)
        sign = -1 if (right[-1], heights) > (right[1], 0) else 1
        if right[sign] > most:
            best, most = (minimum, sign), right[sign]
        if 2 * right[sign] > sum(int((few.pulses >= _FEWEST_PULSES).sum()) for _, few in each):
            break
    return best


def _received(
    piece: Piece, bursts: Bursts, edge: Integers, sign: int, threshold: float
) -> Telegrams:
    """Receive the bursts of a piece as requests or responses; a `sign` of -1 inverts them."""
    telegrams = [np.recarray(0, dtype=_TELEGRAM)]
    before, behind = round(_BEFORE / piece.step), round(_BEHIND / piece.step)
    around = piece.around[piece.margin - before :]
    for n_bits in _SPANS:
        which = bursts.bits == n_bits
        some, at_edge = bursts.where(which), edge[which]
        if not len(at_edge):
            continue
        length = before + round(2 * n_bits * HALF_BIT / piece.step) + behind
        rows = np.lib.stride_tricks.sliding_window_view(around, length)[some.first]
        unit = np.abs(some.height)
        rows /= sign * unit.astype(np.float32)[:, np.newaxis]
        minimum = min(_FIRST_PULSE, threshold)
        received = receive(rows, piece.step, n_bits, threshold=threshold, minimum=minimum)
        bits, weights = received.bits.astype(np.int64), 1 << np.arange(n_bits)[::-1]
        indices: tuple[Any, ...] = (some.first - before, some.first, some.last)
        begin, first, last = (piece.start + at * piece.step for at in indices)
        words = np.full(len(bits), n_bits), np.maximum(bits, 0) @ weights, (bits != NONE) @ weights
        heights = received.amplitude * unit, received.weakest, received.ringing
        fields = (
            begin + received.start,
            first,
            last,
            *words,
            received.error,
            *heights,
            some.fits,
            at_edge,
        )
        telegrams.append(np.rec.fromarrays(fields, dtype=_TELEGRAM))
    return _joined(telegrams)
