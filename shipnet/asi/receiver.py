"""Line voltage -> pulses -> bits: the receiver of a master or a slave, for many telegrams at once.

A receiver waits for the first pulse and then samples the line once every half-bit. A sample larger
than half of the first pulse counts as a pulse. The receiver then makes the seven checks of
`shipnet.asi.modulation`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from math import ceil
from types import MappingProxyType
from typing import Any, NamedTuple, Protocol, TypeAlias

import numpy as np
import numpy.typing as npt

from shipnet import style
from shipnet.arrays import Bools, Floats
from shipnet.asi.modulation import HALF_BIT, Modulation, Pulses, Signs, decided, violated
from shipnet.asi.telegram import REQUEST_BITS, RESPONSE_BITS
from shipnet.compiled import compiled
from shipnet.errors import ArgumentError, SilenceError
from shipnet.fields import check_fields, check_rng, check_scalar, number, record, switch
from shipnet.lazy import Axes
from shipnet.line import waveform as line_waveform

#: Arguments that `numpy.random.default_rng` accepts.
RNGLike = np.random.Generator | np.random.BitGenerator | np.random.SeedSequence | int

#: Smallest voltage of a pulse [V]: 30 % of 1.5 V, which is half of the smallest legal signal.
MINIMUM = 0.45

#: Legal sampling intervals [s]: the longest gives three samples per half-bit, the shortest
#: 3000; more would only cost time.
_DT = (1e-9, 1e-6)

#: The first pulse peaks within this many half-bits of the first sample above the minimum: one for
#: the filtered pulse, which is two half-bits long, plus the delay of the supply's 78 ohm || 100 uH.
_REACH = 1.25

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
    >>> reception = line(100, slaves=(5,)).waveform("0011001", "5 m").receive()
    >>> reception.pulses.decode(), bool(reception.within_tolerance)
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

    def looks(self, wave: Waveform) -> Floats:
        """Return the times at which the receiver looked at one telegram [s], NaN if it did not."""
        return wave.start + self.start + HALF_BIT * (np.arange(self.slots.size) + 0.5)

    @style.applied
    def plot(
        self, wave: Waveform, ax: Axes | None = None, *, receiver: Receiver | None = None
    ) -> Axes:
        """Draw one telegram as its receiver sees it: voltage, filtered voltage and slots."""
        if wave.u.ndim != 1:
            raise ArgumentError(f"wave has {wave.u.shape[:-1]} telegrams; it must have one")
        ax, receiver = style.axes(ax), receiver or Receiver()
        t = wave.t * 1e6
        seen = matched_filter(wave.u, wave.dt) if receiver.matched else wave.u
        ax.plot(t, wave.u, color="0.6", linewidth=1, label="on the line")
        if receiver.matched:
            ax.plot(t, seen, color="C0", label="after the filter")
        end = wave.span[1] * 1e6 + 21
        if np.isfinite(self.start):
            middles = self.looks(wave)
            heights = np.interp(middles, wave.t, seen)
            filled = self.slots != 0
            ax.plot(middles[filled] * 1e6, heights[filled], "o", color="C1", label="pulse")
            ax.plot(middles[~filled][1:] * 1e6, heights[~filled][1:], "x", color="C1", label="none")
            threshold = abs(heights[1]) * receiver.threshold
            for level in (threshold, -threshold):
                style.limit(ax, level, "threshold")
        ax.set(xlim=(-5, end), xlabel="time [µs]", ylabel="voltage at the master [V]")
        style.legend(ax, 2)
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
    >>> reception = Receiver(minimum=0.9).receive(wave)
    >>> reception.bits.tolist(), f"{reception.amplitude:.2f} V"
    ([0, 0, 1, 1, 0, 0, 1], '2.33 V')
    """

    threshold: float = number(
        0, 1, "", "Smallest pulse, relative to the first; above 0 and below 1", default=0.5
    )
    window: float = number(
        0, 0.5, "half-bits", "The largest sample this close to a slot's middle counts", default=0.1
    )
    matched: bool = switch("True to apply the matched filter first", default=True)
    minimum: float = number(0, 1e9, "V", "Smallest voltage of a pulse", default=MINIMUM)
    source: str = field(default="", kw_only=True, repr=False, compare=False)

    def __post_init__(self) -> None:
        check_fields(self)
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
    ((2, 16, 314), ('5 m', '100 m'), True)
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
        received = receive(rows, self.dt, bits.shape[-1], matched=False)
        if not np.isfinite(received.start).all():
            raise ArgumentError("a telegram in u has no pulse above the receiver's minimum")
        signs = np.pad(Modulation(bits).pulses.signs, ((0, 0), (0, 2)))[:, 1:]
        t = np.linspace(-HALF_BIT / 2, HALF_BIT / 2, 61)
        middles = received.start[:, np.newaxis] + HALF_BIT * (np.arange(signs.shape[1]) + 1.5)
        samples = (middles[..., np.newaxis] + t) / self.dt
        if samples.max() > rows.shape[1] - 1:
            raise ArgumentError(
                f"u ends after {rows.shape[1] * self.dt:.3g} s; a telegram with its silence lasts "
                f"until {samples.max() * self.dt:.3g} s"
            )
        # The row coordinate must be a whole number, or two telegrams would blend.
        row = np.broadcast_to(np.arange(len(rows))[:, np.newaxis, np.newaxis], samples.shape)
        folded = map_coordinates(rows - rows.mean(axis=1, keepdims=True), [row, samples], order=1)
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


#: Length of a half-bit [samples] and number of bits; smallest pulse relative to the first, and in
#: volts; reach of a look and of the search for the first peak [samples]; ratio of equal heights.
Settings: TypeAlias = "tuple[float, int, float, float, int, int, float]"


@compiled
def line_filter(u: Floats, taps: Floats) -> Floats:
    """Return a voltage through a symmetric filter."""
    n, half = len(u), len(taps) // 2
    around = np.zeros(n + 2 * half)
    around[half : half + n] = u
    y, part = np.zeros(n), np.zeros(n)
    for k in range(len(taps)):
        np.multiply(taps[k], around[k : k + n], part)  # in place, which is faster
        y += part
    return y


@compiled
def listen(u: Floats, taps: Floats, settings: Settings) -> tuple[Signs, float, float, float, float]:
    """Return the pulses of a telegram; first peak [samples], amplitude, weakest pulse, ringing.

    The receiver filters the line voltage, whose mean is 0, waits for the first pulse and then looks
    once per half-bit (ZMD AG, SAP5S/SAP51 data sheet, 2012, p. 31).
    """
    half_bit, n_bits, threshold, minimum, window, near, even = settings
    slots = np.zeros(2 * n_bits + 2, np.int8)
    y, n = line_filter(u, taps), len(u)

    first = 0
    while first < n and abs(y[first]) <= minimum:  # wait for the first pulse ...
        first += 1
    if first == n:
        return slots, np.nan, np.nan, np.nan, np.nan
    sign = 1 if y[first] > 0 else -1
    for i in range(first + 1, min(first + near, n)):  # ... and for its peak
        if sign * y[i] > sign * y[first]:
            first = i
    height, peak = sign * y[first], float(first)
    if 0 < first < n - 1:  # the top of a parabola through three samples
        left, right = height - sign * y[first - 1], height - sign * y[first + 1]
        if left >= 0 and right >= 0 and left + right > 0:
            peak += 0.5 * (left - right) / (left + right)

    slots[1] = sign
    largest, weakest, ringing = height, height, 0.0
    smallest = max(threshold * height, minimum)
    begin = round(peak * 2**30) / 2**30  # without the last digits, which may round up or down
    for k in range(1, 2 * n_bits + 1):  # then look once per half-bit
        middle = round(begin + k * half_bit)
        high, low = 0.0, 0.0
        if middle < n:
            for i in range(middle - window, min(middle + window + 1, n)):
                high, low = max(high, y[i]), max(low, -y[i])
        height = max(high, low)
        if height > smallest:
            slots[k + 1] = 1 if high > low * even else -1
            weakest = min(weakest, height)
        else:
            ringing = max(ringing, height)
        largest = max(largest, height)

    # On the line, the pulse peaks a little later than after the symmetric filter.
    amplitude, around = -np.inf, int(half_bit / 4)
    for i in range(max(first - around, 0), min(first + around + 1, n)):
        amplitude = max(amplitude, sign * u[i])
    return slots, peak, amplitude, weakest / largest, ringing / largest


@compiled
def listen_to_rows(
    u: Floats, mean: Floats, taps: Floats, settings: Settings
) -> tuple[Signs, Signs, Floats]:
    """Return the pulses, the violated rules and the four numbers of each telegram."""
    n_bits = settings[1]
    slots, places = np.zeros((len(u), 2 * n_bits + 2), np.int8), np.zeros((len(u), 7), np.int8)
    numbers = np.zeros((4, len(u)))
    for row in range(len(u)):
        slots[row], numbers[0, row], numbers[1, row], numbers[2, row], numbers[3, row] = listen(
            u[row] - mean[row], taps, settings
        )
        places[row] = violated(slots[row])
    return slots, places, numbers


@compiled
def filter_rows(u: Floats, mean: Floats, taps: Floats) -> Floats:
    """Return each row, less its mean, through a symmetric filter."""
    y = np.zeros(u.shape)
    for row in range(len(u)):
        y[row] = line_filter(u[row] - mean[row], taps)
    return y


def matched_filter(u: npt.ArrayLike, dt: float) -> Floats:
    r"""Filter the line voltage, less its mean, with the pulse shape, which is best in white noise.

    .. math:: y(t) = \frac{8}{3 T_h} \int_{-T_h/2}^{T_h/2}
              \cos^2 \frac{\pi \tau}{T_h} \; u(t + \tau) \, d\tau
    """
    (rows, mean), taps = _rows(u, dt), _pulse_shape(dt)
    return filter_rows.run(len(rows) * 2 * len(taps), rows, mean, taps).reshape(np.shape(u))


def receive(u: npt.ArrayLike, dt: float, n_bits: int, **settings: Any) -> Reception:
    """Receive telegrams of known length, one per row; `settings` are those of a receiver."""
    receiver = Receiver(**settings)
    rows, mean = _rows(u, dt)
    _check_bit_count(n_bits)
    taps, half_bit = _pulse_shape(dt) if receiver.matched else np.ones(1), HALF_BIT / dt
    window, near = int(receiver.window * half_bit + 1e-9), int(_REACH * half_bit) + 1
    even = 1 + _EVEN
    threshold, minimum = receiver.threshold * even, max(receiver.minimum, _LEAST) * even
    values = half_bit, n_bits, threshold, minimum, window, near, even
    steps = len(rows) * (2 * near + (2 * n_bits + 2) * (2 * window + 2))
    slots, places, (peak, *heights) = listen_to_rows.run(steps, rows, mean, taps, values)
    bits, error = decided(slots, places)
    error[np.isnan(peak)] = SilenceError.code
    fields = (bits, error, peak * dt - 1.5 * HALF_BIT, *heights, slots)
    shape = np.shape(u)
    return Reception(*(field.reshape(shape[:-1] + field.shape[1:]) for field in fields))


def _check_bit_count(n_bits: int) -> None:
    if n_bits not in (RESPONSE_BITS, REQUEST_BITS):
        raise ArgumentError(
            f"n_bits is {n_bits!r}; it must be {RESPONSE_BITS} (a response) "
            f"or {REQUEST_BITS} (a request)"
        )


def _rows(u: npt.ArrayLike, dt: float) -> tuple[Floats, Floats]:
    """Return voltages as rows in double precision, and the mean of each row."""
    if not _DT[0] <= dt <= _DT[1]:
        raise ArgumentError(
            f"dt is {dt} s; it must be {_DT[0]}..{_DT[1]} s, three samples or more per half-bit"
        )
    array = np.asarray(u)
    if array.dtype.kind not in "iuf":
        raise ArgumentError(f"u must be real voltages, but its dtype is {array.dtype}")
    if array.ndim == 0 or array.shape[-1] == 0:
        raise ArgumentError(f"u has shape {array.shape}; its last axis must not be empty")
    rows = np.ascontiguousarray(array.reshape(-1, array.shape[-1]), dtype=np.float64)
    with np.errstate(over="ignore", invalid="ignore"):
        mean = rows.mean(axis=1)
    if not np.isfinite(mean).all():
        row = rows[np.isfinite(mean).argmin()]
        worst = int(np.where(np.isnan(row), np.inf, np.abs(row)).argmax())
        raise ArgumentError(
            f"u has {row[worst]} at sample {worst} of a row; voltages and their sum must be finite"
        )
    return rows, mean


def _pulse_shape(dt: float) -> Floats:
    """Return the taps of the matched filter, which extends half a half-bit to each side."""
    half = ceil(HALF_BIT / dt / 2 - 1e-9) - 1
    q = np.arange(-half, half + 1)
    return np.asarray(np.cos(np.pi * q * dt / HALF_BIT) ** 2 * (8 / 3 * dt / HALF_BIT))


class Eye(NamedTuple):
    """Superimposed half-bits, relative to the largest sample of their telegram."""

    t: Floats  # time from the middle of a half-bit [s]
    pulses: Floats  # half-bits with a pulse, all made positive, shape (n_pulses, n)
    gaps: Floats  # half-bits without a pulse after the first pulse, shape (n_gaps, n)

    @style.applied
    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw all half-bits superimposed, with the tolerances, as in icn2007's Fig 8."""
        ax = style.axes(ax)
        t = self.t * 1e6
        for rows, colour, label in [(self.pulses, "C0", "pulse"), (self.gaps, "C4", "no pulse")]:
            lines = ax.plot(t, rows.T, color=colour, alpha=0.15, linewidth=0.8)
            if lines:
                ax.plot([], [], color=colour, label=label)
        style.limit(ax, TOLERANCE.evenness, "pulse")
        for level in (TOLERANCE.ringing, -TOLERANCE.ringing):
            style.limit(ax, level, "ringing")
        ax.set(xlim=(t[0], t[-1]), ylim=(-1.05, 1.05))
        ax.set(xlabel="time from the middle [µs]", ylabel="voltage / largest")
        style.legend(ax)
        return ax
