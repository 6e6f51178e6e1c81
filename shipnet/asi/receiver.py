"""Line voltage -> pulses -> bits: the receiver of a master or a slave, for many telegrams at once.

A receiver waits for the first pulse and then samples the line once every half-bit. A sample larger
than half of the first pulse counts as a pulse. The receiver then makes the seven checks of
`shipnet.asi.modulation`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from functools import lru_cache
from math import ceil
from types import MappingProxyType
from typing import Any, NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from shipnet import style
from shipnet.arguments import checked
from shipnet.arrays import Bools, Floats, Indices
from shipnet.asi.modulation import HALF_BIT, Modulation, Pulses, check_columns
from shipnet.asi.telegram import REQUEST_BITS, RESPONSE_BITS
from shipnet.errors import ArgumentError, SilenceError
from shipnet.fields import check_rng, check_scalar, number, record, switch
from shipnet.lazy import Axes
from shipnet.line import waveform as line_waveform

#: Arguments that `numpy.random.default_rng` accepts.
RNGLike = np.random.Generator | np.random.BitGenerator | np.random.SeedSequence | int

#: Smallest voltage of a pulse [V]: 30 % of 1.5 V, which is half of the smallest legal signal.
MINIMUM = 0.45

#: Legal sampling intervals [s]: the longest gives three samples per half-bit, the shortest
#: 3000; more would only cost time.
_DT = (1e-9, 1e-6)

#: Number of samples processed at a time, so that they and the results stay in a core's own cache.
_SAMPLES = 2**18

#: Number of taps above which an FFT filters faster than matrix products.
_LONG = 64

#: Number of blocks multiplied at a time, so that all stay in a core's own cache.
_BLOCKS = 2**10

#: The first pulse peaks within this many half-bits of the first sample above the minimum: one for
#: the filtered pulse, which is two half-bits long, plus the delay of the supply's 78 ohm || 100 uH.
_REACH = 1.25

#: Time by which the first pulse of most telegrams has occurred [s].
_EARLY = 16e-6

#: Relative difference below which two heights count as equal, and voltage below which a sample
#: counts as zero [V], so that no decision depends on rounding.
_EVEN, _LEAST = 1e-9, 1e-9


class Disturbance(Protocol):
    """A disturbance of `shipnet.asi.emc`, such as `Noise`."""

    def voltage(
        self,
        t: Floats,
        amplitude: float,
        rng: np.random.Generator,
        size: int,
        *,
        span: tuple[float, float],
    ) -> Floats:
        """Return voltages of shape (size, n_t); `span` is the start and end of telegrams [s]."""


@checked
class Reception(NamedTuple):
    """The telegrams that a receiver read; the leading axes are those of the voltage.

    Where nothing was received, the error is that of `SilenceError`, bits are -1, slots are 0, and
    the other fields are NaN.

    Attributes
    ----------
    bits : ndarray of int8, shape (..., n_bits)
        The bits, -1 where none was received; valid only where `error` is 0.
    error : ndarray of uint8, shape (...)
        0 if correct; otherwise an error code of `shipnet.errors`.
    start : ndarray of float, shape (...)
        Start of the telegram relative to the first sample [s]: 1.5 half-bits before the peak of its
        first pulse. On a line it is about 1 us late, because the supply delays the pulses.
    amplitude : ndarray of float, shape (...)
        Largest sample of the first pulse on the line, before any filter [V].
    weakest : ndarray of float, shape (...)
        Smallest pulse divided by largest pulse, after the filter if the receiver has one.
    ringing : ndarray of float, shape (...)
        Largest voltage in the slots without a pulse, from the first pulse to two slots after the
        telegram, divided by largest pulse; like `weakest`, after the filter if there is one.
    slots : ndarray of int8, shape (..., 2 n_bits + 2)
        Signs of the pulses: -1, 0 or +1.

    Examples
    --------
    >>> from shipnet.asi.topologies import line
    >>> heard = line(100, slaves=(5,)).waveform("0011001", "5 m").receive()
    >>> heard.pulses.decode(), bool(heard.within_tolerance)
    ('0011001', True)
    """

    bits: npt.NDArray[np.int8]
    error: npt.NDArray[np.uint8]
    start: Floats
    amplitude: Floats
    weakest: Floats
    ringing: Floats
    slots: npt.NDArray[np.int8]

    @property
    def pulses(self) -> Pulses:
        """The pulses, including the silence after the telegram."""
        return Pulses(self.slots)

    @property
    def within_tolerance(self) -> Bools:
        """True for each telegram that has no error and is within `TOLERANCE`."""
        even = (self.weakest >= TOLERANCE.evenness) & (self.ringing <= TOLERANCE.ringing)
        return np.asarray((self.error == 0) & even)

    def plot(
        self, wave: Waveform, ax: Axes | None = None, *, receiver: Receiver | None = None
    ) -> Axes:
        """Draw one telegram as its receiver sees it: voltage, filtered voltage and slots."""
        ax = style.axes(ax)
        receiver = receiver or Receiver()
        if wave.u.ndim != 1:
            raise ArgumentError(f"wave has {wave.u.shape[:-1]} telegrams; it must have one")
        t = wave.t * 1e6
        seen = matched_filter(wave.u, wave.dt) if receiver.matched else wave.u
        ax.plot(t, wave.u, color="0.6", linewidth=1, label="on the line")
        if receiver.matched:
            ax.plot(t, seen, color="C0", label="after the filter")
        end = wave.span[1] * 1e6 + 21
        if np.isfinite(self.start):
            middles = wave.start + self.start + HALF_BIT * (np.arange(self.slots.size) + 0.5)
            heights = np.interp(middles, wave.t, seen)
            filled = self.slots != 0
            ax.plot(middles[filled] * 1e6, heights[filled], "o", color="C1", label="pulse")
            ax.plot(middles[~filled][1:] * 1e6, heights[~filled][1:], "x", color="C1", label="none")
            threshold = abs(heights[1]) * receiver.threshold
            for level in (threshold, -threshold):
                style.limit(ax, level, "threshold")
        ax.set(xlim=(-5, end), xlabel="time [us]", ylabel="voltage at the master [V]")
        style.legend(ax)
        return ax


class Tolerance(NamedTuple):
    """Smallest pulse and largest voltage outside pulses, each divided by the largest pulse."""

    evenness: float
    ringing: float


#: What a receiver tolerates. kim2023, section 3.4, allows an amplitude error of "35 %" and 30 % of
#: overshoot. If the former means pulses down to 65 % of the largest, both follow from a comparator
#: at 45 % to 55 % of the first pulse (SAP5S/SAP51 data sheet, 2012, p. 31): the smallest pulse must
#: be above the highest threshold, 0.55 < 0.65, and ringing below the lowest, 0.45 x 0.65 = 0.29.
TOLERANCE = Tolerance(evenness=0.65, ringing=0.30)


@checked
@record
class Receiver:
    """The receiver of a master or a slave, with four settings.

    As in [1]_, the threshold is relative to the first pulse, not to the largest so far. A wide
    `window` includes edges of neighbouring pulses: on a 150 m line, a window of 0.25 loses some
    telegrams that are received with 0.1. In noise, `minimum` should be four times the noise's
    standard deviation after the filter; if it is lower, noise may be mistaken for a first pulse.
    `RECEIVERS` contains some receivers by name, with the `source` of their values.

    References
    ----------
    .. [1] ZMD AG, "SAP5S/SAP51 Universal AS-Interface IC", data sheet rev. 3.1, 2012, p. 31:
       comparator at 45 % to 55 % of the first negative pulse.

    Examples
    --------
    >>> from shipnet.asi.topologies import line
    >>> wave = line(100, slaves=(5,)).waveform("0011001", "5 m")
    >>> heard = Receiver(minimum=0.9).receive(wave)
    >>> heard.bits.tolist(), f"{heard.amplitude:.2f} V"
    ([0, 0, 1, 1, 0, 0, 1], '2.33 V')
    """

    threshold: float = number(
        0, 1, "", "Smallest pulse, relative to the first; above 0 and below 1", default=0.5
    )
    window: float = number(
        0, 0.5, "half-bits", "The largest sample within this distance of a slot's middle counts",
        default=0.1,
    )  # fmt: skip
    matched: bool = switch("True to apply the matched filter first", default=True)
    minimum: float = number(0, 1e9, "V", "Smallest voltage of a pulse", default=MINIMUM)
    source: str = field(default="", kw_only=True, repr=False, compare=False)

    def __post_init__(self) -> None:
        if not 0 < self.threshold < 1:
            raise ArgumentError(f"threshold is {self.threshold}; it must be between 0 and 1")

    def receive(self, wave: Waveform) -> Reception:
        """Receive telegrams of known length; their errors are returned in `error`, not raised."""
        return receive(wave.u, wave.dt, wave.bits.shape[-1], **asdict(self))


#: Receivers by name: a sensitive one may mistake noise for telegrams; the others may lose weak
#: signals. None of the data sheets that we read states the threshold voltage of a chip.
RECEIVERS: Mapping[str, Receiver] = MappingProxyType(
    {
        "sensitive": Receiver(
            source="30 % of 1.5 V, half of the smallest legal signal of 3 V peak to peak (ZMD "
            "data sheets); signals below 30 % must be ignored (AS-International FAQ)"
        ),
        "noise-proof": Receiver(
            minimum=0.9,
            source="ours: four times the rms noise, 0.48 V in 2 MHz (0.34 mV per root hertz), of "
            "which the filter leaves 47 %",
        ),
        "unfiltered": Receiver(
            matched=False,
            minimum=1.2,
            source="ours: four times the rms noise, 0.3 V in 2 MHz (0.21 mV per root hertz)",
        ),
    }
)


@checked
@dataclass(frozen=True, eq=False, repr=False)
class Waveform(line_waveform.Waveform):
    """Voltages of telegrams at a receiver; the telegrams begin at t = 0.

    Parameters
    ----------
    u : ndarray of float, shape (n_t,), (n_telegrams, n_t) or (n_slaves, n_telegrams, n_t)
        Voltage [V].
    dt, start, names, description
        As for `shipnet.line.Waveform`; `names` are the nodes of the slaves.
    bits : ndarray of int, shape (n_bits,) or (n_telegrams, n_bits)
        The 7 or 14 bits that were sent.

    Examples
    --------
    >>> from shipnet.asi.topologies import line
    >>> wave = line(100, slaves=(5, 100)).waveform()
    >>> wave.u.shape, wave.names, wave.receive().within_tolerance.all().item()
    ((2, 16, 268), ('5 m', '100 m'), True)
    """

    bits: npt.NDArray[np.integer] = field(kw_only=True)

    def __post_init__(self) -> None:
        super().__post_init__()
        bits = np.asarray(self.bits)
        _check_bit_count(bits.shape[-1])
        if bits.ndim > 2 or (bits.ndim == 2 and bits.shape[0] != self.u.shape[-2]):
            raise ArgumentError(f"bits have shape {bits.shape}, but u has shape {self.u.shape}")
        object.__setattr__(self, "bits", bits)

    @property
    def span(self) -> tuple[float, float]:
        """Start and end of the telegrams [s]."""
        return 0.0, self.bits.shape[-1] * 2 * HALF_BIT

    @property
    def records(self) -> tuple[npt.NDArray[np.integer], Floats]:
        """Bits and voltages with one row per telegram of each slave."""
        u = self.u.reshape(-1, self.u.shape[-1])
        bits = np.broadcast_to(self.bits, (*self.u.shape[:-1], self.bits.shape[-1]))
        return bits.reshape(len(u), -1), u

    def receive(self, receiver: Receiver | None = None) -> Reception:
        """Receive the telegrams."""
        return (receiver or Receiver()).receive(self)

    def eye(self) -> Eye:
        """Return all half-bits of the telegrams, each with 61 samples, for an eye diagram."""
        from scipy.ndimage import map_coordinates

        bits, rows = self.records
        heard = receive(rows, self.dt, bits.shape[-1], matched=False)
        if not np.isfinite(heard.start).all():
            raise ArgumentError("a telegram in u has no pulse above the receiver's minimum")
        signs = np.pad(Modulation(bits).pulses.signs, ((0, 0), (0, 2)))[:, 1:]
        t = np.linspace(-HALF_BIT / 2, HALF_BIT / 2, 61)
        middles = heard.start[:, np.newaxis] + HALF_BIT * (np.arange(signs.shape[1]) + 1.5)
        place = (middles[..., np.newaxis] + t) / self.dt
        if place.max() > rows.shape[1] - 1:
            raise ArgumentError(
                f"u ends after {rows.shape[1] * self.dt:.3g} s; a telegram with its silence lasts "
                f"until {place.max() * self.dt:.3g} s"
            )
        # The row coordinate must be a whole number, or two telegrams would blend.
        row = np.broadcast_to(np.arange(len(rows))[:, np.newaxis, np.newaxis], place.shape)
        folded = map_coordinates(rows - rows.mean(axis=1, keepdims=True), [row, place], order=1)
        folded /= np.abs(folded).max(axis=(1, 2), keepdims=True)
        filled = signs != 0
        return Eye(t, folded[filled] * signs[filled][:, np.newaxis], folded[~filled])

    def disturbed(
        self, disturbance: Disturbance, amplitude: float, rng: RNGLike | None = None
    ) -> Waveform:
        """Return the waveform with a disturbance such as ``emc.Noise()`` added to each telegram."""
        amplitude = check_scalar("amplitude", amplitude, "V", 0, 1e9)
        rows = self.u.reshape(-1, self.u.shape[-1])
        added = self.disturbance(disturbance, amplitude, check_rng(rng), len(rows))
        return replace(self, u=(rows + added).reshape(self.u.shape))

    def disturbance(
        self, disturbance: Disturbance, amplitude: float, rng: np.random.Generator, size: int
    ) -> Floats:
        """Return the voltages of a disturbance for `size` records at the times of this waveform."""
        begin, end = self.span
        span = -self.start + begin, round(end - self.start, 12)
        return disturbance.voltage(self.t - self.start, amplitude, rng, size, span=span)


def matched_filter(u: npt.ArrayLike, dt: float) -> Floats:
    r"""Filter the line voltage, less its mean, with the pulse shape, which is best in white noise.

    .. math:: y(t) = \frac{8}{3 T_h} \int_{-T_h/2}^{T_h/2}
              \cos^2 \frac{\pi \tau}{T_h} \; u(t + \tau) \, d\tau
    """
    u = _checked(u, dt)
    n_t = u.shape[-1]
    rows = u.reshape(-1, n_t).astype(np.float64, copy=False)
    return _columns(rows, _means(rows, n_t), _pulse_shape(n_t, dt), n_t)[:, :n_t].reshape(u.shape)


def receive(u: npt.ArrayLike, dt: float, n_bits: int, **settings: Any) -> Reception:
    """Receive telegrams of known length, one per row; `settings` are those of a receiver."""
    receiver = Receiver(**settings)
    u = _checked(u, dt)
    _check_bit_count(n_bits)
    n_t = u.shape[-1]
    rows = u.reshape(-1, n_t)
    # Rows that are not in double precision are copied.
    chunk = max(1, _SAMPLES // (n_t if u.dtype == np.float64 else 2 * n_t))
    parts = [
        # `_decide` accesses samples by their position in memory.
        _decide(np.ascontiguousarray(rows[begin : begin + chunk]), dt, n_bits, receiver)
        for begin in range(0, max(1, len(rows)), chunk)
    ]
    *numbers, slots = (np.concatenate(field, axis=-1) for field in zip(*parts, strict=True))
    bits, error = check_columns(slots)
    error[np.isnan(numbers[0])] = SilenceError.code
    fields = (np.ascontiguousarray(bits.T), error, *numbers, np.ascontiguousarray(slots.T))
    return Reception(*(field.reshape(u.shape[:-1] + field.shape[1:]) for field in fields))


def _check_bit_count(n_bits: int) -> None:
    if n_bits not in (RESPONSE_BITS, REQUEST_BITS):
        raise ArgumentError(
            f"n_bits is {n_bits!r}; it must be {RESPONSE_BITS} (a response) "
            f"or {REQUEST_BITS} (a request)"
        )


def _checked(u: npt.ArrayLike, dt: float) -> npt.NDArray[np.floating]:
    if not _DT[0] <= dt <= _DT[1]:
        raise ArgumentError(
            f"dt is {dt} s; it must be {_DT[0]}..{_DT[1]} s, three samples or more per half-bit"
        )
    array = np.asarray(u)
    if array.dtype.kind not in "iuf":
        raise ArgumentError(f"u must be real voltages, but its dtype is {array.dtype}")
    if array.ndim == 0 or array.shape[-1] == 0:
        raise ArgumentError(f"u has shape {array.shape}; its last axis must not be empty")
    return array


@lru_cache(maxsize=64)
def _pulse_shape(n_t: int, dt: float) -> Floats:
    """Return the taps of the matched filter."""
    # The filter extends half a half-bit to each side; for a short record, its middle is enough.
    half = min(ceil(HALF_BIT / dt / 2 - 1e-9) - 1, n_t - 1)
    q = np.arange(-half, half + 1)
    return np.asarray(np.cos(np.pi * q * dt / HALF_BIT) ** 2 * (8 / 3 * dt / HALF_BIT))


def _means(u: Floats, n_t: int) -> Floats:
    """Return the mean of the first `n_t` samples of each row; all samples must be finite."""
    # The sum of squares is the fastest check of all samples: it is finite only if they all are, and
    # none is so large that a later sum or product could overflow.
    flat = u.ravel()
    with np.errstate(all="ignore"):
        fine = np.isfinite(flat @ flat)
    if not fine:
        size = np.abs(flat)
        worst = int(np.argmax(np.where(np.isnan(size), np.inf, size)))
        raise ArgumentError(
            f"u has {flat[worst]} at sample {worst % u.shape[1]} of a row; voltages must be "
            "finite and below 1e150 V"
        )
    return np.asarray(u[:, :n_t] @ np.ones(n_t) / n_t)


def _wider(u: npt.NDArray[np.floating], more: int) -> Floats:
    """Return a copy of the rows, each followed by `more` zeros."""
    wide = np.zeros((len(u), u.shape[1] + more))
    wide[:, : u.shape[1]] = u
    return wide


def _columns(u: Floats, mean: Floats, taps: Floats, end: int, after: int = 0) -> Floats:
    """Subtract the mean from each row, filter the first `end` samples, and add `after` zeros."""
    count, half = len(u), len(taps) // 2
    x = np.zeros((count, half + end + max(half, after)))
    stop = min(u.shape[1], end + half)
    np.subtract(u[:, :stop], mean[:, np.newaxis], out=x[:, half : half + stop])
    if len(taps) == 1:
        return x if taps[0] == 1 else taps * x
    y = np.zeros((count, end + after))
    if len(taps) > _LONG:
        length = 1 << (x.shape[1] - 1).bit_length()
        z = np.fft.irfft(np.fft.rfft(x, length) * np.fft.rfft(taps, length), length)
        y[:, :end] = z[:, 2 * half : 2 * half + end]
        return y
    matrix = _band(taps.tobytes(), taps.dtype.str, max(16, len(taps)))
    for low in range(0, end, matrix.shape[1]):
        part = y[:, low : min(end, low + matrix.shape[1])]
        length = part.shape[1] + 2 * half
        np.matmul(x[:, low : low + length], matrix[:length, : part.shape[1]], out=part)
    return y


def filtered(
    taps: npt.NDArray[Any],
    x: npt.NDArray[Any],
    size: int,
    up: int = 1,
    down: int = 1,
    out: npt.NDArray[Any] | None = None,
) -> npt.NDArray[Any]:
    r"""Filter a row by block-wise matrix products; beyond its end, the row is taken to be 0.

    .. math:: y_i = \sum_k h_{u k - d i} \, x_k, \qquad i = 0 \ldots size - 1
    """
    times = max(-(-16 // up), -(-len(taps) // (up * down)))
    block, outputs = times * down, times * up
    matrix = _band(taps.astype(x.dtype).tobytes(), x.dtype.str, outputs, up, down)
    need = (-(-size // outputs) + 1) * block
    if len(x) < need:
        x = np.concatenate([x, np.zeros(need - len(x), x.dtype)])
    blocks = x[:need].reshape(-1, block)
    whole = (len(blocks) - 1) * outputs
    y = (np.empty(whole, x.dtype) if out is None else out[:whole]).reshape(-1, outputs)
    for k in range(0, len(y), _BLOCKS):
        part = y[k : k + _BLOCKS]
        np.matmul(blocks[k : k + len(part)], matrix[:block], out=part)
        part += blocks[k + 1 : k + 1 + len(part), : len(matrix) - block] @ matrix[block:]
    return y.ravel()[:size]


@lru_cache(maxsize=64)
def _band(taps: bytes, kind: str, outputs: int, up: int = 1, down: int = 1) -> npt.NDArray[Any]:
    """Return the matrix that filters a run of samples."""
    h = np.frombuffer(taps, kind)
    samples = max(outputs * down, len(h) - 1 + (outputs - 1) * down + up) // up
    tap = up * np.arange(samples)[:, np.newaxis] - down * np.arange(outputs)
    return np.where((tap >= 0) & (tap < len(h)), h[np.clip(tap, 0, len(h) - 1)], 0).astype(kind)


def _windows(rows: Floats, length: int, begin: Indices) -> Floats:
    """Return runs of `length` samples that start at the flat indices `begin` of contiguous rows."""
    shape = max(0, rows.size - length + 1), length
    step = rows.strides[1:] * 2
    return np.lib.stride_tricks.as_strided(rows, shape, step, writeable=False)[begin]


def _near(u: Floats, places: Indices, reach: int, taps: Floats) -> Floats:
    """Return filtered samples within `reach` of `places` (slot, row), along a new first axis."""
    before, n_t = reach + len(taps) // 2, u.shape[1]
    index = places + np.arange(-before, u.size - before, n_t)
    if before == reach:
        flat = u.ravel()
        return np.stack([flat[k:].take(index, mode="clip") for k in range(2 * reach + 1)])
    comb = _band(taps.tobytes(), taps.dtype.str, 2 * reach + 1)
    # Row by row, because the samples of a row are close together in memory.
    runs = _windows(u, len(comb), index.T.ravel())
    return (comb.T @ runs.T).reshape(2 * reach + 1, *index.T.shape).swapaxes(1, 2)


def _decide(
    u: npt.NDArray[Any], dt: float, n_bits: int, receiver: Receiver
) -> tuple[npt.NDArray[Any], ...]:
    """Return start, amplitude, weakest, ringing and slots by row; slots have shape (slot, row)."""
    # Only what is needed is filtered: the first columns, and samples near the middles of slots.
    (count, n_t), samples = u.shape, HALF_BIT / dt
    taps = _pulse_shape(n_t, dt) if receiver.matched else np.ones(1)
    half, reach = len(taps) // 2, int(receiver.window * samples + 1e-9)
    u = u if u.dtype == np.float64 else _wider(u, half + reach)
    mean = _means(u, n_t)
    minimum = max(receiver.minimum, _LEAST) * (1 + _EVEN)
    last, near = n_t - 1, int(_REACH * samples) + 1
    # Most telegrams begin early, so try the first samples before the whole record.
    for end in (n_t if len(taps) > _LONG else min(n_t, int(_EARLY / dt)), n_t):
        y = _columns(u[:, :n_t], mean, taps, end, near)
        loud = np.abs(y[:, :end]) > minimum
        start = loud.argmax(axis=-1)
        silent = ~loud.ravel().take(start + np.arange(0, loud.size, end))
        if not silent.any() and start.max(initial=0) + near < end:
            break
    flat, at = y.ravel(), start + np.arange(0, y.size, y.shape[1])
    sign = np.sign(flat.take(at))
    # Compare only samples of the same sign, because the next pulse may be larger.
    top = (_windows(y, near, at) * sign[:, np.newaxis]).argmax(axis=-1)
    start += top
    at += top
    first = flat.take(at)

    # The top of a parabola through the largest sample and its neighbours.
    left, right = ((first - flat.take(at + beside)) * sign for beside in (-1, 1))
    inner = (start > 0) & (start < last) & (left >= 0) & (right >= 0) & (left + right > 0)
    peak = start + np.divide(0.5 * (left - right), left + right, out=np.zeros(count), where=inner)

    # Round, so that the last digits of a peak halfway between two samples do not matter.
    even = np.rint(peak * 2**30) / 2**30
    middle = np.rint(even + samples * np.arange(2 * n_bits + 1)[:, np.newaxis]).astype(np.intp)
    farthest, inside = middle.max(initial=0) + reach, np.minimum(middle, last)
    if end == n_t:
        heard, level = _near(y, inside, reach, np.ones(1)), np.zeros(count)
    else:
        if farthest + half > last:
            u = u if u.shape[1] > n_t else _wider(u, half + reach)
            u[:, n_t:] = mean[:, np.newaxis]
        heard, level = _near(u, inside, reach, taps), taps.sum() * mean
    if farthest > last:
        # Nothing is received after the end of the record.
        offset = np.arange(-reach, reach + 1)[:, np.newaxis, np.newaxis]
        np.copyto(heard, level, where=np.maximum(middle, middle + offset) > last)
    # Use the sign with the larger magnitude. Slot 0, before the first pulse, does not count.
    high, low = (np.ascontiguousarray(f(heard, axis=0)) for f in (np.max, np.min))
    high -= level
    np.subtract(level, low, out=low)
    absolute, positive = np.maximum(high, low), high > low * (1 + _EVEN)
    absolute[0], positive[0] = np.abs(first), first > 0
    filled = absolute > np.maximum((1 + _EVEN) * receiver.threshold * absolute[0], minimum)
    filled &= ~silent
    slots = np.zeros((2 * n_bits + 2, count), dtype=np.int8)
    np.multiply(2 * positive.view(np.int8) - 1, filled, out=slots[1:])

    # The largest sample is a pulse, unless nothing was received.
    largest = np.where(silent, np.nan, absolute.max(axis=0))
    empty = ~filled
    smallest = (absolute + 1e300 * empty).min(axis=0)
    absolute *= empty
    # On the line, the pulse peaks a little later than after the symmetric filter.
    reach = int(samples / 4)
    places = np.minimum(np.maximum(start + np.arange(-reach, reach + 1)[:, np.newaxis], 0), last)
    around = u.ravel().take(places + np.arange(0, u.size, u.shape[1]))
    amplitude = ((around - mean) * np.sign(first)).max(axis=0)
    return (
        np.where(silent, np.nan, peak * dt - 1.5 * HALF_BIT),
        np.where(silent, np.nan, amplitude),
        smallest / largest,
        absolute.max(axis=0) / largest,
        slots,
    )


class Eye(NamedTuple):
    """Superimposed half-bits, relative to the largest sample of their telegram."""

    t: Floats  # time from the middle of a half-bit [s]
    pulses: Floats  # half-bits with a pulse, all made positive, shape (n_pulses, n)
    gaps: Floats  # half-bits without a pulse after the first pulse, shape (n_gaps, n)

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw all half-bits superimposed, with the tolerances, as in icn2007's Fig 8."""
        ax = style.axes(ax)
        t = self.t * 1e6
        for rows, colour, label in [(self.pulses, "C0", "pulse"), (self.gaps, "C1", "no pulse")]:
            lines = ax.plot(t, rows.T, color=colour, alpha=0.15, linewidth=0.8)
            if lines:
                ax.plot([], [], color=colour, label=label)
        style.limit(ax, TOLERANCE.evenness, "pulse")
        for level in (TOLERANCE.ringing, -TOLERANCE.ringing):
            style.limit(ax, level, "ringing")
        ax.set(xlim=(t[0], t[-1]), ylim=(-1.05, 1.05))
        ax.set(xlabel="time from the middle [us]", ylabel="voltage / largest [1]")
        style.legend(ax)
        return ax
