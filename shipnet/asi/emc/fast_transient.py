"""Electrical fast transients, called bursts: pulses of 5/50 ns, and what a receiver's input leaves.

The pulse is a hundred times shorter than one of the line's own, and shorter than a sampling
interval. So it is not its height that counts but its area, and that is what the model keeps: a
first-order low-pass stands for the receiver's input, and a sample is the mean over its interval.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from shipnet.asi.emc.disturbance import add_events, check_batch, time_step
from shipnet.fields import check_scalar

__all__ = [
    "INPUT_CORNER",
    "PACKET_LENGTH",
    "PACKET_PERIOD",
    "PULSE_RATE",
    "burst",
    "burst_area",
    "burst_pulse",
    "burst_spectrum",
]

#: Time constants of decay and rise [s]: with them the pulse of two exponentials rises from 10 %
#: to 90 % in 5 ns and stays above half for 50 ns, the nominal values of IEC 61000-4-4.
_DECAY, _RISE = 55.61e-9, 3.291e-9

#: Pulses a second inside a packet [1/s]; IEC 61000-4-4 also has 100 kHz.
PULSE_RATE = 5e3

#: Length of a packet and time from one to the next [s]: IEC 61000-4-4, at 5 kHz 75 pulses each.
PACKET_LENGTH, PACKET_PERIOD = 15e-3, 300e-3

#: Corner of the low-pass that stands for a receiver's input [Hz]: assumed, some above the 667 kHz
#: at which the spectrum of an AS-i pulse has its first zero.
INPUT_CORNER = 1e6

#: What is left of an exponential after so many time constants, 2e-9, is dropped.
_ENOUGH = 20.0

# At the top of the pulse both exponentials fall as fast.
_TOP_AT = np.log(_DECAY / _RISE) * _DECAY * _RISE / (_DECAY - _RISE)
_TOP = np.exp(-_TOP_AT / _DECAY) - np.exp(-_TOP_AT / _RISE)

Floats = npt.NDArray[np.float64]


def burst_pulse(t: npt.ArrayLike) -> Floats:
    r"""Return one pulse of a burst, of height 1.

    .. math:: p(t) = k \left(e^{-t / \tau_1} - e^{-t / \tau_2}\right), \qquad t \ge 0

    Parameters
    ----------
    t : array_like of float
        Time since the pulse began [s].

    Returns
    -------
    ndarray of float
        The pulse over its peak [1].

    Notes
    -----
    :math:`\tau_1` = 55.61 ns and :math:`\tau_2` = 3.291 ns are fitted to the nominal rise time of
    5 ns and width of 50 ns; the standard tolerates 30 % of both. The formula that the standard is
    said to print, with a power of time in place of the second exponential, has 3 % less area; its
    text was not read.

    References
    ----------
    .. [1] IEC 61000-4-4, "Electrical fast transient/burst immunity test", 2012.

    Examples
    --------
    >>> t = np.arange(0, 400e-9, 0.01e-9)
    >>> pulse = burst_pulse(t)
    >>> f"{pulse.max():.3f}, {np.count_nonzero(pulse > 0.5) * 0.01:.1f} ns wide"
    '1.000, 50.0 ns wide'
    """
    t = np.asarray(t, dtype=float)
    late = np.maximum(t, 0.0)
    return np.asarray((np.exp(-late / _DECAY) - np.exp(-late / _RISE)) / _TOP)


def burst_area() -> float:
    """Return the area of `burst_pulse` [s].

    Returns
    -------
    float
        Area over height: what a slow receiver feels of a pulse.

    Examples
    --------
    >>> f"{burst_area() * 1e9:.1f} ns"
    '66.4 ns'
    """
    return float((_DECAY - _RISE) / _TOP)


def burst_spectrum(f: npt.ArrayLike) -> npt.NDArray[np.complex128]:
    r"""Return the Fourier transform of `burst_pulse`.

    .. math:: P(f) = \frac{A}{(1 + j 2 \pi f \tau_1)(1 + j 2 \pi f \tau_2)}

    Parameters
    ----------
    f : array_like of float
        Frequency [Hz].

    Returns
    -------
    ndarray of complex
        Transform [V s] of a pulse of 1 V. Up to 2.9 MHz it is flat, so an AS-i receiver feels
        the area A alone; from 48 MHz on it falls with the square of the frequency.

    Examples
    --------
    >>> abs(burst_spectrum([0, 150e3, 80e6]) / burst_area()).round(3).tolist()
    [1.0, 0.999, 0.018]
    """
    s = 2j * np.pi * np.asarray(f, dtype=float)
    return np.asarray(burst_area() / ((1 + s * _DECAY) * (1 + s * _RISE)))


def burst(
    t: npt.ArrayLike,
    amplitude: float,
    rng: np.random.Generator,
    size: int = 1,
    *,
    rate: float = PULSE_RATE,
    corner: float = INPUT_CORNER,
) -> Floats:
    """Return what a receiver's input leaves of a burst, for telegrams inside a packet.

    Parameters
    ----------
    t : array_like of float, shape (n_t,)
        Times, evenly spaced [s].
    amplitude : float
        Peak of a pulse between both wires, ahead of the receiver's input, 0..1e9 [V].
    rng : numpy.random.Generator
        Source of the random numbers.
    size : int, default 1
        Number of telegrams, 0 or more.
    rate : float, default 5e3
        Pulses a second, 1..1e6 [1/s].
    corner : float, default 1e6
        Corner of the first-order low-pass that stands for the input, 1e3..1e9 [Hz].

    Returns
    -------
    ndarray of float, shape (size, n_t)
        Voltage [V]: a train of pulses, all of one sign, as a test applies them. Sign and phase
        of the train are random in each row.

    Raises
    ------
    ArgumentError
        If an argument is not as said above.

    Notes
    -----
    The model: each pulse passes the low-pass, and a sample is the mean over the interval around
    it. Both keep the area, so that the samples of a pulse times their spacing add up to
    `amplitude` times `burst_area` on any grid. Corner and mean are assumptions about a receiver,
    not facts of one. A receiver without a filter decides on single samples and so feels the
    grid; behind a matched filter a pulse is 6 % of `amplitude` high.

    At 5 kHz a pulse comes every 200 us: the 42 us of a response meet one in five times, the 64 us
    of a record in three. Packets of 15 ms come every 300 ms, so over a whole test a twentieth of
    the telegrams are inside one. `shipnet.asi.emc.repetition` lays packets over time.

    Examples
    --------
    >>> t = np.arange(256) * 250e-9
    >>> u = burst(t, 50.0, np.random.default_rng(2024), 10_000)
    >>> hit = abs(u).max(axis=1) > 0.1
    >>> f"{hit.mean():.0%} of the records are hit"
    '33% of the records are hit'
    """
    t, dt = time_step(t)
    amplitude, size = check_batch(amplitude, size)
    rate = check_scalar("rate", rate, "1/s", 1, 1e6)
    slowest = 1 / (2 * np.pi * check_scalar("corner", corner, "Hz", 1e3, 1e9))
    # The formula divides by differences of time constants; a millionth apart is apart.
    if min(abs(slowest / _DECAY - 1), abs(slowest / _RISE - 1)) < 1e-6:
        slowest *= 1 + 2e-6
    constants = np.array([_DECAY, _RISE, slowest])
    length = dt + _ENOUGH * float(constants.max())
    sign = amplitude * burst_area() / dt * rng.choice([-1.0, 1.0], size)
    begin = t[0] - length + rng.uniform(0, 1 / rate, size)
    u = np.zeros((size, t.size))
    for _ in range(int((t[-1] - t[0] + length) * rate) + 1):
        add_events(
            u, t, begin, length, lambda since, sign: sign * _mean(since, dt, constants), sign
        )
        begin = begin + 1 / rate
    return u


def _mean(since: Floats, dt: float, constants: Floats) -> Floats:
    """Return the area that passes three lags in a row between `since` - `dt` and `since`."""
    return _passed(since, constants) - _passed(np.maximum(since - dt, 0.0), constants)


def _passed(since: Floats, constants: Floats) -> Floats:
    apart = constants[:, np.newaxis] - constants
    np.fill_diagonal(apart, 1.0)
    share = constants**2 / apart.prod(axis=1)
    return np.asarray(1 - np.exp(-since[..., np.newaxis] / constants) @ share)
