"""Disturbances as a receiver sees them: voltages between the wires, to be added to telegrams.

The user gives the amplitude: how much of a test level arrives between the wires is not modelled.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from shipnet.arguments import checked
from shipnet.arrays import Floats
from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar, check_whole, number, record, whole

#: Begin and end of a telegram in its record [s].
Span = tuple[float, float]

#: Largest legal amplitude [V]; the receiver takes no voltage whose square overflows.
_MOST = 1e9


def _checked(t: npt.ArrayLike, amplitude: float, size: int) -> tuple[Floats, float, float, int]:
    """Return evenly spaced times and their step, the amplitude, and the number of rows."""
    times = np.asarray(t)
    if times.dtype.kind not in "iuf" or times.ndim != 1 or times.size < 2:
        raise ArgumentError(
            f"t has the shape {times.shape} and dtype {times.dtype}; it must be a row of two "
            "times or more"
        )
    times = times.astype(np.float64, copy=False)
    dt = float(times[-1] - times[0]) / (times.size - 1)
    if not (dt > 0 and np.abs(np.diff(times) - dt).max() <= 1e-6 * dt):
        raise ArgumentError("t must be finite, rise and be evenly spaced")
    volts, rows = (
        check_scalar("amplitude", amplitude, "V", 0, _MOST),
        check_whole("size", size, 0, 2**31),
    )
    return times, dt, volts, rows


def add_events(
    u: Floats,
    t: Floats,
    begin: Floats,
    length: float,
    shape: Callable[..., Floats],
    *parameters: Floats,
) -> None:
    """Add ``shape(time since its begin, *parameters)`` to each row of `u`, for `length` at most.

    `begin` and each parameter have one number per row. What falls outside the record is lost.
    """
    dt = (t[-1] - t[0]) / (t.size - 1)
    first = np.ceil((begin - t[0]) / dt).astype(np.intp)
    column = first[:, np.newaxis] + np.arange(int(length / dt) + 1)
    row, place = np.nonzero((column >= 0) & (column < t.size))
    column = column[row, place]
    since = np.maximum(t[column] - begin[row], 0.0)
    u[row, column] += shape(since, *(parameter[row] for parameter in parameters))


def _raised_cosine(since: Floats, width: Floats, height: Floats) -> Floats:
    return np.where(since < width, height * np.sin(np.pi * since / width) ** 2, 0.0)


#: Time constants of decay and rise [s]: a pulse rises from 10 % to 90 % in 5 ns and stays above
#: half for 50 ns, the nominal values of IEC 61000-4-4.
_DECAY, _RISE = 55.61e-9, 3.291e-9

#: Pulses a second inside a packet [1/s]; IEC 61000-4-4 also has 100 kHz.
PULSE_RATE = 5e3

#: Length of a packet and time from one to the next [s]: IEC 61000-4-4, at 5 kHz 75 pulses each.
PACKET_LENGTH, PACKET_PERIOD = 15e-3, 300e-3

#: Corner of the low-pass that stands for a receiver's input [Hz]: assumed, a little above the
#: 667 kHz at which the spectrum of an AS-i pulse has its first zero.
INPUT_CORNER = 1e6

#: An exponential is dropped after this many time constants, where 2e-9 of it is left.
_ENOUGH = 20.0

# At the top of the pulse both exponentials fall equally fast.
_TOP_AT = np.log(_DECAY / _RISE) * _DECAY * _RISE / (_DECAY - _RISE)

#: Area of a pulse of height 1 [s].
AREA = (_DECAY - _RISE) / float(np.exp(-_TOP_AT / _DECAY) - np.exp(-_TOP_AT / _RISE))


def _mean(since: Floats, dt: float, constants: Floats) -> Floats:
    """Return the area that leaves three low-passes in a row between `since` - `dt` and `since`."""
    return _passed(since, constants) - _passed(np.maximum(since - dt, 0.0), constants)


def _passed(since: Floats, constants: Floats) -> Floats:
    apart = constants[:, np.newaxis] - constants
    np.fill_diagonal(apart, 1.0)
    share = constants**2 / apart.prod(axis=1)
    return np.asarray(1 - np.exp(-since[..., np.newaxis] / constants) @ share)


# Objects ---------------------------------------------------------------------------------------


@checked
@record
class Noise:
    r"""White noise; its amplitude is the standard deviation of samples `reference` apart.

    Samples :math:`\Delta t` apart have a bandwidth of :math:`1 / 2 \Delta t`, 2 MHz by default,
    and a one-sided density of :math:`2 \sigma^2 \Delta t`, 0.71 mV per root hertz for 1 V. A
    waveform with another step gets noise of the same density, so its step changes no error rate.

    Examples
    --------
    >>> from shipnet.asi.topologies import line
    >>> from shipnet.asi.emc.error_rates import count_errors
    >>> from shipnet.asi.receiver import RECEIVERS
    >>> answers = line(100, slaves=(5,)).waveform()
    >>> count_errors(answers, Noise(), 0.7, 1000, 2024, receiver=RECEIVERS["noise-proof"])
    <ErrorRates: 0.7 V, 6.5 % of 1000 telegrams lost, 0 undetected>
    """

    reference: float = number(
        1e-9, 1e-6, "s", "Spacing of the samples that have the amplitude", default=250e-9
    )

    def density(self, amplitude: npt.ArrayLike) -> Floats:
        """Return the one-sided density of a standard deviation [V per root hertz]."""
        return np.asarray(np.multiply(amplitude, (2 * self.reference) ** 0.5))

    @property
    def quantity(self) -> str:
        """What its amplitude is."""
        return f"noise in {0.5e-6 / self.reference:g} MHz, standard deviation"

    def voltage(
        self, t: Floats, amplitude: float, rng: np.random.Generator, size: int, *, span: Span
    ) -> Floats:
        """Return the noise on each of some telegrams."""
        t, dt, amplitude, size = _checked(t, amplitude, size)
        # A step that is the reference must not change the noise by a rounding.
        if abs(dt / self.reference - 1) >= 1e-9:
            amplitude *= (self.reference / dt) ** 0.5
        return amplitude * rng.standard_normal((size, t.size))


@checked
@record
class Impulses:
    r"""Impulses of random place, sign, height and width, each a raised cosine, on every telegram.

    .. math:: u(t) = \pm \frac{a}{2} \left(1 + \cos \frac{2 \pi (t - t_0)}{w}\right),
              \qquad |t - t_0| < \frac{w}{2}

    The amplitude is the mean height. Heights and full widths are uniformly distributed: over the
    amplitude times 1 - `spread` to 1 + `spread`, and over the two ends of `width` [s]. All are
    assumptions: what coils and converters leave on a line differs from ship to ship.

    Examples
    --------
    >>> t = np.arange(256) * 250e-9
    >>> rng = np.random.default_rng(2024)
    >>> u = Impulses(width=(3e-6, 3e-6)).voltage(t, 2.0, rng, 1000, span=(0, 42e-6))
    >>> print(f"{abs(u).max(axis=1).mean():.1f} V")
    2.0 V
    """

    #: What its amplitude is.
    quantity: ClassVar[str] = "mean height of the impulses"

    count: int = whole(0, 1000, "", "Impulses per telegram", default=1)
    width: tuple[float, float] = (0.5e-6, 4e-6)
    spread: float = number(0, 1, "", "Spread of the heights", default=0.5)

    def voltage(
        self, t: Floats, amplitude: float, rng: np.random.Generator, size: int, *, span: Span
    ) -> Floats:
        """Return the impulses on each of some telegrams."""
        t, _, amplitude, size = _checked(t, amplitude, size)
        longest = float(t[-1] - t[0])
        if not (np.shape(self.width) == (2,) and 0 < self.width[0] <= self.width[1] <= longest):
            raise ArgumentError(
                f"width is {self.width!r}; it must be two times, the smaller one first, above 0 "
                f"and up to {longest:g} s"
            )
        (narrow, wide), (first, last) = self.width, span
        u = np.zeros((size, t.size))
        for _ in range(self.count):
            w = rng.uniform(narrow, wide, size)
            height = amplitude * rng.uniform(1 - self.spread, 1 + self.spread, size)
            height *= rng.choice([-1.0, 1.0], size)
            begin = rng.uniform(first, last, size) - w / 2
            add_events(u, t, begin, wide, _raised_cosine, w, height)
        return u


@record
class ConductedRF:
    r"""A modulated carrier, as the test with conducted radio frequency couples it in.

    .. math:: u(t) = a \bigl(1 + m \sin(2 \pi f_m t + \psi)\bigr) \sin(2 \pi f t + \varphi)

    The amplitude is the peak of the carrier without modulation; a test level of IEC 61000-4-6 is
    its effective value. Carrier and sideband must lie below half the sampling rate: 80 MHz needs
    a waveform with a step of 5 ns.

    Examples
    --------
    >>> t = np.arange(2000) * 1e-6
    >>> rng = np.random.default_rng(2024)
    >>> u = ConductedRF(200e3).voltage(t, 1.0, rng, 1, span=(0, 42e-6))
    >>> round(float(abs(u).max()), 1)
    1.8
    """

    #: What its amplitude is.
    quantity: ClassVar[str] = "peak of the carrier without modulation"

    frequency: float = number(1e-3, 1e12, "Hz", "Frequency of the carrier; 150 kHz to 80 MHz")
    modulation: float = number(0, 1, "", "Depth of the amplitude modulation", default=0.8)
    f_mod: float = number(0, 1e12, "Hz", "Frequency of the modulation", default=1e3)

    def __post_init__(self) -> None:
        check_scalar("f_mod", self.f_mod, "Hz", 0, self.frequency)

    def voltage(
        self, t: Floats, amplitude: float, rng: np.random.Generator, size: int, *, span: Span
    ) -> Floats:
        """Return the carrier on each of some telegrams, at a random phase of its modulation."""
        t, dt, amplitude, size = _checked(t, amplitude, size)
        f, f_mod = self.frequency, self.f_mod
        if f + f_mod >= 0.5 / dt:
            raise ArgumentError(
                f"frequency is {f:g} Hz; with its sideband it must lie below {0.5 / dt:.6g} Hz, "
                "half the sampling rate"
            )
        carrier, slow = rng.uniform(0, 2 * np.pi, (2, size))
        # Carrier and sidebands, the same for all telegrams but for a complex factor each.
        lines = np.exp(2j * np.pi * np.outer([f, f + f_mod, f - f_mod], t))
        side = self.modulation / 2j * np.exp(1j * carrier)
        factors = [np.exp(1j * carrier), side * np.exp(1j * slow), -side * np.exp(-1j * slow)]
        return amplitude * (np.stack(factors, axis=-1) @ lines).imag


@record
class Burst:
    """Electrical fast transients, 5/50 ns after IEC 61000-4-4, behind a receiver's input.

    The amplitude is the peak of a pulse between the wires, ahead of the input. Pulses come at an
    even rate; sign and phase of the train are random on each telegram. Each passes a first-order
    low-pass, and a sample is the mean over its interval: both keep the area, and both are
    assumptions about a receiver. At 5 kHz one response in five is hit. Packets of 15 ms come every
    300 ms: `burst_failures` lays them over time.

    Examples
    --------
    >>> t = np.arange(256) * 250e-9
    >>> u = Burst().voltage(t, 50.0, np.random.default_rng(2024), 10_000, span=(0, 42e-6))
    >>> print(f"{(abs(u).max(axis=1) > 0.1).mean():.0%} of the records are hit")
    33% of the records are hit
    """

    #: What its amplitude is.
    quantity: ClassVar[str] = "peak of a pulse ahead of the receiver's input"

    rate: float = number(1, 1e6, "1/s", "Pulses per second", default=PULSE_RATE)
    corner: float = number(
        1e3, 1e9, "Hz", "Corner of the low-pass that stands for the input", default=INPUT_CORNER
    )

    def voltage(
        self, t: Floats, amplitude: float, rng: np.random.Generator, size: int, *, span: Span
    ) -> Floats:
        """Return the train of pulses on each of some telegrams."""
        t, dt, amplitude, size = _checked(t, amplitude, size)
        slowest = 1 / (2 * np.pi * self.corner)
        # The formula divides by differences of time constants; a millionth apart is apart.
        if min(abs(slowest / _DECAY - 1), abs(slowest / _RISE - 1)) < 1e-6:
            slowest *= 1 + 2e-6
        constants = np.array([_DECAY, _RISE, slowest])
        length = dt + _ENOUGH * float(constants.max())
        sign = amplitude * AREA / dt * rng.choice([-1.0, 1.0], size)
        begin = t[0] - length + rng.uniform(0, 1 / self.rate, size)
        u = np.zeros((size, t.size))
        for _ in range(int((t[-1] - t[0] + length) * self.rate) + 1):
            add_events(
                u, t, begin, length, lambda since, sign: sign * _mean(since, dt, constants), sign
            )
            begin = begin + 1 / self.rate
        return u
