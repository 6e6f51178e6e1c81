"""Alternating pulse modulation: bits -> Manchester levels -> send current -> pulses, and back.

A bit is two half-bits of 3 us. Manchester coding makes a 0 fall and a 1 rise in its middle; the
sender draws more current at the low level, and the inductors of the power supply turn every change
of current into a voltage pulse: a rising current gives a negative one. So a telegram is a row of
*slots*, one a half-bit, each with a pulse -1, +1 or none: the odd slots always hold one (the
middle of a bit), the even ones only between two equal bits, and the signs alternate.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from shipnet.asi.timing import BIT_TIME
from shipnet.errors import ArgumentError

__all__ = [
    "HALF_BIT",
    "SEND_CURRENT",
    "as_bits",
    "levels_of",
    "pulses_of",
    "ramp",
    "ramp_spectrum",
    "send_current",
    "send_spectrum",
    "steps_of",
]

#: Length of a half-bit [s].
HALF_BIT = BIT_TIME / 2

#: Swing of the send current [A]; 55 to 68 mA in ASI4U data sheets, 60 mA assumed.
SEND_CURRENT = 60e-3

Floats = npt.NDArray[np.float64]
Signs = npt.NDArray[np.int8]


def as_bits(bits: str | Sequence[str] | npt.ArrayLike) -> Signs:
    """Return telegrams as an array of bits.

    Parameters
    ----------
    bits : str, sequence of str, or array_like of int, shape (..., n)
        Zeros and ones, the first on the line first: one telegram, or several of one length.

    Returns
    -------
    ndarray of int8, shape (..., n)
        The bits.

    Raises
    ------
    ArgumentError
        If something other than 0 and 1 is among the bits, if there is none, or if the telegrams
        differ in length.

    Examples
    --------
    >>> as_bits(["0011001", "0000001"]).tolist()
    [[0, 0, 1, 1, 0, 0, 1], [0, 0, 0, 0, 0, 0, 1]]
    """
    try:
        array = np.asarray(bits)
    except ValueError:
        raise ArgumentError("bits must be telegrams of one length") from None
    if array.dtype.kind == "U" and array.size:
        lengths = np.char.str_len(array)
        if lengths.min() != lengths.max():
            raise ArgumentError(
                f"bits must be telegrams of one length, but have {lengths.min()} to {lengths.max()}"
            )
        array = np.ascontiguousarray(array).view("U1").reshape(*array.shape, -1)
        array = np.where(np.isin(array, ("0", "1")), array == "1", 2)
    if array.ndim == 0 or array.shape[-1] == 0:
        raise ArgumentError("bits must hold at least one bit")
    if not np.isin(array, (0, 1)).all():
        raise ArgumentError(f"bits must be 0 or 1, but are {bits!r}")
    return array.astype(np.int8)


def levels_of(bits: str | Sequence[str] | npt.ArrayLike) -> Signs:
    """Return the Manchester levels of bits: step 2 of kim2023's Table 3.

    Parameters
    ----------
    bits : str, sequence of str, or array_like of int, shape (..., n)
        As for `as_bits`.

    Returns
    -------
    ndarray of int8, shape (..., 2 n)
        Level of each half-bit, 1 for high: a 0 is high then low, a 1 low then high.

    Raises
    ------
    ArgumentError
        As `as_bits`.

    Examples
    --------
    >>> levels_of("01").tolist()
    [1, 0, 0, 1]
    """
    bits = as_bits(bits)
    return np.stack([1 - bits, bits], axis=-1).reshape(*bits.shape[:-1], -1)


def steps_of(bits: str | Sequence[str] | npt.ArrayLike) -> Signs:
    """Return the changes of the send current at each half-bit: step 3 of kim2023's Table 3.

    Parameters
    ----------
    bits : str, sequence of str, or array_like of int, shape (..., n)
        As for `as_bits`.

    Returns
    -------
    ndarray of int8, shape (..., 2 n)
        +1 where the current rises, -1 where it falls, 0 where it stays. The line is idle at the
        high level, without current; the steps of a telegram add up to 0.

    Raises
    ------
    ArgumentError
        As `as_bits`.

    Examples
    --------
    >>> steps_of("0011001").tolist()
    [0, 1, -1, 1, 0, -1, 1, -1, 0, 1, -1, 1, 0, -1]
    """
    drawn = 1 - levels_of(bits)
    return np.diff(drawn, axis=-1, prepend=np.zeros_like(drawn[..., :1]))


def pulses_of(bits: str | Sequence[str] | npt.ArrayLike) -> Signs:
    """Return the sign of the voltage pulse in each slot: step 4 of kim2023's Table 3.

    Parameters
    ----------
    bits : str, sequence of str, or array_like of int, shape (..., n)
        As for `as_bits`.

    Returns
    -------
    ndarray of int8, shape (..., 2 n)
        -1, 0 or +1. Slot j belongs to the change of current at j half-bits after the start of
        the telegram; slot 1 holds the start bit's pulse.

    Raises
    ------
    ArgumentError
        As `as_bits`.

    Examples
    --------
    >>> "".join("0+-"[pulse] for pulse in pulses_of("0011001"))
    '0-+-0+-+0-+-0+'
    """
    return -steps_of(bits)


def ramp(x: npt.ArrayLike) -> Floats:
    r"""Return the shape of one change of current: the integral of a sin^2 pulse.

    .. math:: \rho(x) = x - \frac{\sin 2 \pi x}{2 \pi}

    Parameters
    ----------
    x : array_like of float
        Time since the change began, over its length [1].

    Returns
    -------
    ndarray of float
        0 before the change, 1 after it.

    Examples
    --------
    >>> ramp([-1, 0.5, 2]).tolist()
    [0.0, 0.5, 1.0]
    """
    x = np.clip(x, 0.0, 1.0)
    return x - np.sin(2 * np.pi * x) / (2 * np.pi)


def send_current(
    t: npt.ArrayLike,
    bits: str | Sequence[str] | npt.ArrayLike,
    *,
    start: float = 0.0,
    swing: float = SEND_CURRENT,
    half_bit: float = HALF_BIT,
) -> Floats:
    r"""Return the current that a sender draws, in closed form.

    .. math:: i(t) = I_0 \sum_j d_j \, \rho\left(\frac{t - t_0}{T_h} - j\right)

    Parameters
    ----------
    t : array_like of float, shape (n_t,)
        Times [s].
    bits : str or array_like of int, shape (..., n)
        One telegram, or a batch.
    start : float, default 0
        When the telegram begins [s].
    swing : float, default 0.06
        Difference between both levels of current [A].
    half_bit : float, default 3e-6
        Length of a half-bit, and of each change [s].

    Returns
    -------
    ndarray of float, shape (..., n_t)
        Current [A].

    Raises
    ------
    ArgumentError
        As `as_bits`, or if `half_bit` is not positive.

    References
    ----------
    .. [1] ZMD AG, "ASI4U Universal AS-Interface IC", data sheet rev. 1.4, 2006, p. 21.

    Examples
    --------
    >>> send_current([0, 4.5e-6, 6e-6, 9e-6], "0011001").round(3).tolist()
    [0.0, 0.03, 0.06, 0.0]
    """
    if not half_bit > 0:
        raise ArgumentError(f"half_bit is {half_bit} s; it must be positive")
    steps = steps_of(bits)
    since = (np.asarray(t, dtype=float) - start) / half_bit
    shapes = ramp(since - np.arange(steps.shape[-1])[:, np.newaxis])
    return swing * (steps @ shapes)


def ramp_spectrum(s: npt.ArrayLike, *, half_bit: float = HALF_BIT) -> npt.NDArray[np.complex128]:
    r"""Return the Laplace transform of the slope of one change of current, area 1.

    .. math:: P(s) = e^{-x} \, \frac{\sinh x}{x} \, \frac{1}{1 + (x / \pi)^2},
              \qquad x = \frac{s T_h}{2}

    Parameters
    ----------
    s : array_like of complex
        Complex frequency [rad/s].
    half_bit : float, default 3e-6
        Length of the change [s].

    Returns
    -------
    ndarray of complex
        The transform; 1 at s = 0. The first zero of its spectrum is at 2 / half_bit: 667 kHz.

    Examples
    --------
    >>> abs(ramp_spectrum([0, 2j * np.pi * 2 / 3e-6])).round(6).tolist()
    [1.0, 0.0]
    """
    x = np.asarray(s, dtype=complex) * half_bit / 2
    small = np.abs(x) < 1e-6
    pole = np.abs(1 + (x / np.pi) ** 2) < 1e-9
    safe = np.where(small | pole, 1.0, x)
    # e^-x sinh x, written so that it does not overflow for a large real part.
    value = -np.expm1(-2 * safe) / (2 * safe) / (1 + (safe / np.pi) ** 2)
    return np.where(small, np.exp(-x), np.where(pole, 0.5 * np.exp(-x), value))


def send_spectrum(
    s: npt.ArrayLike,
    bits: str | Sequence[str] | npt.ArrayLike,
    *,
    start: float = 0.0,
    swing: float = SEND_CURRENT,
    half_bit: float = HALF_BIT,
) -> npt.NDArray[np.complex128]:
    r"""Return the Laplace transform of `send_current`, in closed form.

    .. math:: I(s) = \frac{I_0}{s} P(s) \sum_j d_j \, e^{-s (t_0 + j T_h)}

    Parameters
    ----------
    s : array_like of complex, shape (n_s,)
        Complex frequency, not 0 [rad/s].
    bits, start, swing, half_bit
        As for `send_current`.

    Returns
    -------
    ndarray of complex, shape (..., n_s)
        Transform of the current [A s].

    Raises
    ------
    ArgumentError
        As `send_current`, or if an `s` is 0.

    Examples
    --------
    Half the energy of the slope of the current lies below 136 kHz for this response:

    >>> f = np.arange(0.5e3, 3e6, 1e3)
    >>> energy = np.abs(f * send_spectrum(2j * np.pi * f, "0011001")) ** 2
    >>> round(f[np.searchsorted(np.cumsum(energy), energy.sum() / 2)] / 1e3)
    136
    """
    if not half_bit > 0:
        raise ArgumentError(f"half_bit is {half_bit} s; it must be positive")
    s = np.asarray(s, dtype=complex)
    if np.any(s == 0):
        raise ArgumentError("s is 0, where the transform of a current has no value of its own")
    steps = steps_of(bits)
    at = start + half_bit * np.arange(steps.shape[-1])
    code = steps @ np.exp(-np.outer(at, s))
    return np.asarray(swing * ramp_spectrum(s, half_bit=half_bit) / s * code)
