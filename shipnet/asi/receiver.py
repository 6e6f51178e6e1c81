"""Line voltage -> pulses -> bits: the receiver of a master or a slave, for many telegrams at once.

The receiver waits for the first pulse, takes its size as the measure of all others, looks at the
line once every half-bit after it, and calls a pulse what is larger than half of the first. What it
found, it hands to the seven checks of `shipnet.asi.slots`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.asi.apm import HALF_BIT
from shipnet.asi.slots import check_bit_count, check_columns
from shipnet.errors import ArgumentError, SilenceError

__all__ = [
    "AMPLITUDE_TOLERANCE",
    "MINIMUM",
    "RINGING_TOLERANCE",
    "Reception",
    "matched_filter",
    "receive",
    "within_tolerance",
]

#: Smallest pulse over largest pulse that is still in order; `within_tolerance` derives it.
AMPLITUDE_TOLERANCE = 0.65

#: Largest voltage where no pulse is, over largest pulse, that is still in order.
RINGING_TOLERANCE = 0.30

#: Voltage below which nothing counts [V]: 30 % of 1.5 V, the smallest signal of 3 V peak to peak.
MINIMUM = 0.45

#: Sampling intervals that are taken [s]: the longest leaves three samples a half-bit, the shortest
#: makes a pulse 3000 samples long, and anything finer only costs time.
_DT = (1e-9, 1e-6)

#: Samples worked on at a time: they and what is made of them stay in a core's own cache.
_SAMPLES = 2**16

#: From the first sample above the minimum the first pulse peaks within this many half-bits: one
#: for the filtered pulse, which is two long, and the delay of the supply's 78 ohm || 100 uH.
_REACH = 1.25

Floats = npt.NDArray[np.float64]
Indices = npt.NDArray[np.intp]


class Reception(NamedTuple):
    """What a receiver made of a batch of telegrams; the leading axes are those of the voltage.

    Attributes
    ----------
    bits : ndarray of int8, shape (..., n_bits)
        The bits, and -1 where there is none; to be trusted only where `error` is 0.
    error : ndarray of uint8, shape (...)
        0, or a code of `shipnet.errors`.
    start : ndarray of float, shape (...)
        When the telegram starts [s], 1.5 half-bits before the peak of its first pulse, which is
        found between the samples. Negative if the record begins inside the telegram. The supply
        delays the pulses: on a line it is about 1 us late.
    amplitude : ndarray of float, shape (...)
        Size of the first pulse on the line [V]: its largest sample, before any filter.
    weakest : ndarray of float, shape (...)
        Smallest pulse over largest pulse, 0..1.
    ringing : ndarray of float, shape (...)
        Largest voltage in a slot without a pulse over largest pulse; the slots after the first
        pulse count, the two behind the telegram too.
    slots : ndarray of int8, shape (..., 2 n_bits + 2)
        The pulses as `check_slots` takes them.

    Notes
    -----
    Where nothing was received, the code is that of `SilenceError`, the bits are -1, the slots 0
    and the other fields NaN. `weakest` and `ringing` are taken from the samples by which the
    receiver decides, so from filtered ones if it filters. `amplitude` never is: the filter raises
    what the supply made longer than a sin^2 pulse, by a fifth on a line of 100 m.
    """

    bits: npt.NDArray[np.int8]
    error: npt.NDArray[np.uint8]
    start: Floats
    amplitude: Floats
    weakest: Floats
    ringing: Floats
    slots: npt.NDArray[np.int8]


def matched_filter(u: npt.ArrayLike, dt: float) -> Floats:
    r"""Filter the line voltage with the shape of a pulse, which raises it most above white noise.

    .. math:: y(t) = \frac{8}{3 T_h} \int_{-T_h/2}^{T_h/2}
              \cos^2 \frac{\pi \tau}{T_h} \; u(t + \tau) \, d\tau

    Parameters
    ----------
    u : array_like of float, shape (..., n_t)
        Line voltage [V]; what it is before and after the record counts as its mean.
    dt : float
        Sampling interval, 1e-9..1e-6 [s].

    Returns
    -------
    ndarray of float, shape (..., n_t)
        Filtered voltage [V]: a sin^2 pulse keeps its height and its place, DC is gone.

    Raises
    ------
    ArgumentError
        If `u` is empty, not real or not finite, or `dt` is out of range.

    Notes
    -----
    The filter alone would raise a DC voltage by 4/3, so each row loses its mean first. That takes
    away the 30 V of the supply and nothing of a telegram: the pulses are the voltage of an
    inductor whose current comes back to where it was, and add up to 0.

    References
    ----------
    .. [1] G. L. Turin, "An introduction to matched filters", IRE Trans. Inf. Theory 6, 1960.

    Examples
    --------
    >>> t = np.arange(-4e-6, 4e-6, 0.25e-6)
    >>> pulse = np.where(abs(t) < 1.5e-6, np.cos(np.pi * t / 3e-6) ** 2, 0)
    >>> filtered = matched_filter([np.concatenate([pulse, -pulse]) + 30], 0.25e-6)
    >>> float(filtered.max().round(6)), float(filtered.min().round(6))
    (1.0, -1.0)
    """
    u = _checked(u, dt)
    length, gain = _filter_gain(u.shape[-1], dt)
    return _filtered(_centred(u), length, gain)


def receive(
    u: npt.ArrayLike,
    dt: float,
    n_bits: int,
    *,
    threshold: float = 0.5,
    window: float = 0.1,
    matched: bool = True,
    minimum: float = MINIMUM,
) -> Reception:
    """Receive telegrams of known length, one a row of samples.

    Parameters
    ----------
    u : array_like of float, shape (..., n_t)
        Line voltage [V]; a row begins with the line at rest and holds one telegram. Its mean is
        taken off, so it may stand on the 30 V of the supply. Behind its end the line counts as
        silent.
    dt : float
        Sampling interval, 1e-9..1e-6 [s].
    n_bits : int
        Bits of a telegram, `RESPONSE_BITS` or `REQUEST_BITS`.
    threshold : float, default 0.5
        What counts as a pulse, over the size of the first pulse, between 0 and 1.
    window : float, default 0.1
        The largest sample within this distance from the middle of a slot counts, in half-bits,
        0..0.5; the sample next to the middle always does.
    matched : bool, default True
        Whether to filter with `matched_filter` first, or to take the samples as they are.
    minimum : float, default 0.45
        Voltage below which nothing counts [V]. Four times the standard deviation of the noise
        in what is decided on keeps noise from being taken for a first pulse.

    Returns
    -------
    Reception
        One array a field; a bad telegram raises nothing, its `error` is its code.

    Raises
    ------
    ArgumentError
        If `u` is empty along its last axis, not real or not finite, or another argument is out
        of its range; the message names it and its value.

    Notes
    -----
    The first pulse decides, not the largest so far, as in [1]_. A wide `window` catches the flanks
    of the neighbours: on a line of 150 m, 0.25 costs telegrams that 0.1 receives.

    References
    ----------
    .. [1] ZMD AG, "SAP5S/SAP51 Universal AS-Interface IC", data sheet rev. 3.1, 2012, p. 31:
       comparator at 45 % to 55 % of the first negative pulse.

    Examples
    --------
    The response 6 on an ideal line of 40 uH, then the same with its third pulse lost:

    >>> from shipnet.asi.apm import send_current
    >>> dt = 250e-9
    >>> t = np.arange(256) * dt
    >>> u = -40e-6 * np.gradient(send_current(t, "0011001", start=5e-6), dt)
    >>> received = receive([u, np.where(abs(t - 15.5e-6) < 1.5e-6, 0, u)], dt, 7)
    >>> received.bits[0].tolist()
    [0, 0, 1, 1, 0, 0, 1]
    >>> from shipnet.errors import explain
    >>> [explain(code) for code in received.error]
    ['ok', 'AlternationError']
    >>> f"{received.start[0] * 1e6:.2f} us, {received.amplitude[0]:.2f} V"
    '5.00 us, 1.56 V'
    """
    u = _checked(u, dt)
    check_bit_count(n_bits)
    if not 0 < threshold < 1:
        raise ArgumentError(f"threshold is {threshold}; it must lie between 0 and 1")
    if not 0 <= window <= 0.5:
        raise ArgumentError(f"window is {window} half-bits; it must be 0..0.5")
    if not 0 <= minimum < np.inf:
        raise ArgumentError(f"minimum is {minimum} V; it must be 0 or more, and finite")
    n_t = u.shape[-1]
    rows = u.reshape(-1, n_t)
    length, gain = _filter_gain(n_t, dt)
    chunk = max(1, _SAMPLES // n_t)
    parts = []
    for begin in range(0, max(1, len(rows)), chunk):
        line = _centred(rows[begin : begin + chunk])
        y = _filtered(line, length, gain) if matched else line
        parts.append(_decide(line, y, dt, n_bits, threshold, window, minimum))
    joined = (np.concatenate(field) for field in zip(*parts, strict=True))
    return Reception(*(field.reshape(u.shape[:-1] + field.shape[1:]) for field in joined))


def within_tolerance(
    reception: Reception,
    *,
    amplitude: float = AMPLITUDE_TOLERANCE,
    ringing: float = RINGING_TOLERANCE,
) -> npt.NDArray[np.bool_]:
    """Return which telegrams came without an error and with pulses as even as they should be.

    Parameters
    ----------
    reception : Reception
        What `receive` returned.
    amplitude : float, default 0.65
        Smallest pulse over largest pulse, at least.
    ringing : float, default 0.30
        Largest voltage without a pulse over largest pulse, at most.

    Returns
    -------
    ndarray of bool, shape (...)
        True where both hold and `error` is 0.

    Notes
    -----
    kim2023, section 3.4, allows "35 %" of error in amplitude and 30 % of overshoot. Read as pulses
    down to 65 % of the largest, both numbers follow from a comparator at 45 % to 55 % of the first
    pulse [1]_. If the first pulse is the largest, the smallest must pass the highest threshold:
    0.55 < 0.65. If the first pulse is the smallest, ringing must stay under the lowest one:
    0.45 x 0.65 = 0.29, which is 0.30. Pulses down to 35 % would be lost: 0.35 < 0.45.

    References
    ----------
    .. [1] ZMD AG, "SAP5S/SAP51 Universal AS-Interface IC", data sheet rev. 3.1, 2012, p. 31.

    Examples
    --------
    >>> from shipnet.asi.apm import send_current
    >>> t = np.arange(256) * 250e-9
    >>> u = -40e-6 * np.gradient(send_current(t, "0011001", start=5e-6), 250e-9)
    >>> weak = np.where(abs(t - 15.5e-6) < 1.5e-6, 0.6 * u, u)
    >>> within_tolerance(receive([u, weak], 250e-9, 7)).tolist()
    [True, False]
    """
    return np.asarray(
        (reception.error == 0) & (reception.weakest >= amplitude) & (reception.ringing <= ringing)
    )


def _checked(u: npt.ArrayLike, dt: float) -> npt.NDArray[np.floating]:
    if not _DT[0] <= dt <= _DT[1]:
        raise ArgumentError(
            f"dt is {dt} s; it must be {_DT[0]}..{_DT[1]} s, three samples a half-bit or more"
        )
    array = np.asarray(u)
    if array.dtype.kind not in "iuf":
        raise ArgumentError(f"u must be real voltages, but its dtype is {array.dtype}")
    if array.ndim == 0 or array.shape[-1] == 0:
        raise ArgumentError(f"u has the shape {array.shape}; it needs a sample on its last axis")
    return array


def _centred(u: npt.NDArray[np.floating]) -> Floats:
    """Return the voltages without their mean; refuse what is not finite."""
    # The sum of squares is the fastest look at every sample. It is finite only if all of them are
    # and if none is so large that a sum or a product further on could overflow.
    with np.errstate(all="ignore"):
        u = u.astype(np.float64, copy=False)
        flat = u.ravel()
        fine = np.isfinite(flat @ flat)
    if not fine:
        worst = np.abs(u)
        place = np.unravel_index(int(np.argmax(np.where(np.isnan(worst), np.inf, worst))), u.shape)
        raise ArgumentError(
            f"u holds {u[place]} at sample {place[-1]} of a row; voltages must be finite, "
            "below 1e150 V"
        )
    return np.asarray(u - u.mean(axis=-1, keepdims=True), dtype=np.float64)


def _filter_gain(n_t: int, dt: float) -> tuple[int, Floats]:
    """Return a length of transform with room for the filter, and the filter's gain in it."""
    # A record shorter than the filter meets only the filter's middle.
    half = min(int(HALF_BIT / dt / 2), n_t - 1)
    # The transform is fast for lengths of small prime factors.
    need = n_t + half
    length = min(m << ((need - 1) // m).bit_length() for m in (8, 9, 10, 12, 15))
    q = np.arange(-half, half + 1)
    around_zero = np.zeros(length)
    around_zero[q] = np.cos(np.pi * q * dt / HALF_BIT) ** 2 * (8 / 3 * dt / HALF_BIT)
    # The filter is even, so its gain is real.
    return length, np.fft.rfft(around_zero).real


def _filtered(y: Floats, length: int, gain: Floats) -> Floats:
    return np.fft.irfft(gain * np.fft.rfft(y, length), length)[..., : y.shape[-1]]


def _first_pulse(
    y: Floats, samples: float, minimum: float
) -> tuple[npt.NDArray[np.bool_], Indices, Floats]:
    """Return which rows are silent, at which sample the first pulse peaks, and the true peak."""
    n_rows, n_t = y.shape
    row = np.arange(n_rows)
    loud = np.abs(y) > minimum
    first = loud.argmax(axis=-1)
    silent = ~loud[row, first]
    sign = np.sign(y[row, first])
    # Only samples of the first one's sign: the next pulse may already be the larger one.
    near = np.minimum(first + np.arange(int(_REACH * samples) + 1)[:, np.newaxis], n_t - 1)
    peak = near[(y[row, near] * sign).argmax(axis=0), row]

    # The top of a parabola through the largest sample and its neighbours.
    left = (y[row, peak] - y[row, np.maximum(peak - 1, 0)]) * sign
    right = (y[row, peak] - y[row, np.minimum(peak + 1, n_t - 1)]) * sign
    top = (peak > 0) & (peak < n_t - 1) & (left >= 0) & (right >= 0) & (left + right > 0)
    shift = np.divide(0.5 * (left - right), left + right, out=np.zeros(n_rows), where=top)
    return silent, peak, peak + shift


def _largest_near(y: Floats, middle: Indices, reach: int) -> Floats:
    """Return the largest sample of either sign around indices; 0 behind the end of the record."""
    n_rows, n_t = y.shape
    flat, begin = y.ravel(), np.arange(n_rows) * n_t
    high = np.full(middle.shape, -np.inf)
    low = np.full(middle.shape, np.inf)
    for offset in range(-reach, reach + 1):
        near = flat.take(begin + np.clip(middle + offset, 0, n_t - 1))
        np.maximum(high, near, out=high)
        np.minimum(low, near, out=low)
    return np.where(middle < n_t, np.where(high > -low, high, low), 0.0)


def _decide(
    line: Floats, y: Floats, dt: float, n_bits: int, threshold: float, window: float, minimum: float
) -> Reception:
    """Receive the rows of `y`, filtered from `line`; slots run along the first axis in here."""
    n_rows, n_t = y.shape
    row = np.arange(n_rows)
    samples = HALF_BIT / dt
    silent, at, peak = _first_pulse(y, samples, minimum)
    first = y[row, at]

    # Slot 0 lies before the first pulse, and there nothing counts: it stays empty.
    middle = np.rint(peak + samples * np.arange(2 * n_bits + 1)[:, np.newaxis]).astype(np.intp)
    height = _largest_near(y, middle, int(window * samples + 1e-9))
    height[0] = first
    absolute = np.abs(height)
    filled = (absolute > np.maximum(threshold * absolute[0], minimum)) & ~silent
    slots = np.zeros((2 * n_bits + 2, n_rows), dtype=np.int8)
    slots[1:] = np.where(filled, np.where(height < 0, -1, 1), 0)
    bits, error = check_columns(slots)
    error[silent] = SilenceError.code

    largest = np.where(filled, absolute, 0.0).max(axis=0)
    smallest = np.where(filled, absolute, np.inf).min(axis=0)
    between = np.where(filled, 0.0, absolute).max(axis=0)
    largest[silent] = np.nan
    # On the line the pulse peaks a little later than behind the symmetric filter.
    reach = np.arange(-int(samples / 4), int(samples / 4) + 1)[:, np.newaxis]
    near = line[row, np.clip(at + reach, 0, n_t - 1)] * np.sign(first)
    return Reception(
        bits.T,
        error,
        np.where(silent, np.nan, peak * dt - 1.5 * HALF_BIT),
        np.where(silent, np.nan, near.max(axis=0)),
        np.where(silent, np.nan, smallest) / largest,
        between / largest,
        slots.T,
    )
