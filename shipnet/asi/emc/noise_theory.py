"""What white noise costs a receiver in theory: the line through the points of a Monte Carlo."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy import special

from shipnet.asi.apm import HALF_BIT
from shipnet.asi.emc.disturbance import time_step
from shipnet.asi.emc.error_rate import Telegrams, decided_on
from shipnet.asi.receiver import MINIMUM, receive
from shipnet.errors import ArgumentError

__all__ = ["noise_error_rate"]

Bools = npt.NDArray[np.bool_]
Floats = npt.NDArray[np.float64]

#: What begins within this many half-bits ahead of the first pulse's peak is taken for the pulse.
_REACH = 1.25

#: Beyond so many standard deviations no noise is counted.
_FAR = 9.0

#: Nodes and weights of an integral from -1 to 1.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(64)

#: A chance whose complement still has a logarithm; logarithms keep small chances from rounding.
_ALMOST_ONE = 1 - 1e-15


def noise_error_rate(
    telegrams: Telegrams,
    amplitudes: npt.ArrayLike,
    *,
    threshold: float = 0.5,
    matched: bool = True,
    minimum: float = MINIMUM,
) -> Floats:
    r"""Return the error rate in white noise that theory expects.

    .. math:: P = 1 - (1 - P_0) \int_{u_{min}}^\infty \varphi\left(\frac{r - h_1}{\sigma}\right)
              \prod_j \left(1 - p_j(r)\right) \frac{dr}{\sigma}, \qquad
              p_j = \begin{cases}
              Q\left((h_j - \theta r) / \sigma\right) & \text{a pulse} \\
              Q\left((\theta r - h_j) / \sigma\right) + Q\left((\theta r + h_j) / \sigma\right)
              & \text{none} \end{cases}

    Parameters
    ----------
    telegrams : Telegrams
        What is sent, all words as likely.
    amplitudes : float or array_like of float, shape (n_amplitudes,)
        Standard deviation of a sample, above 0, as `noise` takes it [V].
    threshold : float, default 0.5
        What counts as a pulse, over the size of the first pulse, between 0 and 1.
    matched : bool, default True
        Whether the receiver filters with `matched_filter`.
    minimum : float, default 0.45
        Voltage below which nothing counts [V].

    Returns
    -------
    ndarray of float, shape (n_amplitudes,)
        Probability that a telegram is not received as it was sent.

    Raises
    ------
    ArgumentError
        If an argument is out of its range, or a telegram is not received in silence.

    Notes
    -----
    :math:`h_j` are the undisturbed heights in the middle of the slots, :math:`r` the disturbed
    height of the first pulse; :math:`\theta r` is `minimum` at least. The noise of the slots is
    independent, because samples are, and so are filtered ones a filter's length apart, which is a
    half-bit. The filter leaves :math:`\sqrt{8 \Delta t / 3 T_h}` of the noise.

    :math:`P_0` is the chance that the noise ahead of the telegram exceeds `minimum` and is taken
    for a first pulse. Each sample depends on the one before it alone: true of raw samples, an
    approximation for filtered ones.

    The receiver of the formula keeps time and looks at one sample a slot. `receive` finds the
    slots from the disturbed first pulse and takes the largest sample of a window. Behind its
    filter that changes little, and both agree within a third; without, up to a few times as many
    or as few telegrams are lost as the formula says.

    References
    ----------
    .. [1] J. G. Proakis, M. Salehi, "Digital Communications", 5th ed., 2008, section 4.2.

    Examples
    --------
    >>> from shipnet.asi.emc.error_rate import all_telegrams
    >>> from shipnet.asi.topology import straight_line
    >>> telegrams = all_telegrams(straight_line(100, slaves=(5,)))
    >>> [f"{rate:.2g}" for rate in noise_error_rate(telegrams, [0.4, 0.6, 0.8], minimum=0.9)]
    ['3e-05', '0.018', '0.17']
    """
    sigma = np.atleast_1d(np.asarray(amplitudes))
    if sigma.ndim != 1 or sigma.dtype.kind not in "iuf" or not ((sigma > 0) & (sigma <= 1e9)).all():
        raise ArgumentError(f"amplitudes are {amplitudes!r}; they must be above 0, up to 1e9 V")
    _, dt = time_step(telegrams.t)
    height, filled, ahead = _slots(telegrams, dt, matched, threshold, minimum)
    kept, correlation = _filtered_noise(dt) if matched else (1.0, 0.0)
    rates = []
    for one in sigma * kept:
        false = _false_start(minimum / one, correlation, ahead)
        missed = _missed(height, filled, one, threshold, minimum)
        rates.append(np.mean(false + missed - false * missed))
    return np.array(rates)


def _slots(
    telegrams: Telegrams, dt: float, matched: bool, threshold: float, minimum: float
) -> tuple[Floats, Bools, Floats]:
    """Return the heights of the slots, which hold pulses, and the samples ahead of each telegram.

    The slots count from that of the first pulse.
    """
    n_bits = telegrams.bits.shape[1]
    u = np.asarray(telegrams.u, dtype=float)
    y = decided_on(u, dt, matched)
    y = y - y.mean(axis=1, keepdims=True)
    received = receive(
        y, dt, n_bits, matched=False, window=0.0, threshold=threshold, minimum=minimum
    )
    if received.error.any() or (received.bits != telegrams.bits).any():
        raise ArgumentError("telegrams must be received without an error when there is no noise")
    peak = (received.start + 1.5 * HALF_BIT) / dt
    middle = np.rint(peak[:, np.newaxis] + HALF_BIT / dt * np.arange(2 * n_bits + 1)).astype(int)
    seen = np.take_along_axis(y, np.minimum(middle, y.shape[1] - 1), axis=1)
    height = np.abs(np.where(middle < y.shape[1], seen, 0.0))
    ahead = np.ceil(peak - int(_REACH * HALF_BIT / dt) - 1e-6)
    return height, received.slots[:, 1:] != 0, np.maximum(ahead, 0.0)


def _filtered_noise(dt: float) -> tuple[float, float]:
    """Return what the filter leaves of white noise, and the correlation of neighbour samples."""
    half = int(HALF_BIT / dt / 2)
    shape = np.cos(np.pi * np.arange(-half, half + 1) * dt / HALF_BIT) ** 2
    power = float(shape @ shape)
    return float(8 / 3 * dt / HALF_BIT * np.sqrt(power)), float(shape[1:] @ shape[:-1]) / power


def _false_start(level: float, correlation: float, samples: Floats) -> Floats:
    """Return the chance that one of some samples exceeds a level, in standard deviations."""
    x, weight = _normal(-level, level)
    exceeds = special.ndtr((correlation * x - level) / np.sqrt(1 - correlation**2))
    exceeds += special.ndtr((-correlation * x - level) / np.sqrt(1 - correlation**2))
    first = min(2 * special.ndtr(-level), _ALMOST_ONE)
    # Of the samples that follow one within the level.
    later = min(float(exceeds @ weight) / (1 - first), _ALMOST_ONE)
    none = np.log1p(-first) + (samples - 1) * np.log1p(-later)
    return -np.expm1(np.where(samples > 0, none, 0.0))


def _normal(low: npt.ArrayLike, high: npt.ArrayLike) -> tuple[Floats, Floats]:
    """Return where to sample the normal distribution between bounds, and what each sample counts.

    The samples lie along a new last axis.
    """
    bounds = np.clip(np.stack(np.broadcast_arrays(low, high), axis=-1), -_FAR, _FAR)
    middle, half = bounds.mean(axis=-1)[..., np.newaxis], np.diff(bounds) / 2
    x = middle + half * _NODES
    return x, half * _WEIGHTS * np.exp(-(x**2) / 2) / np.sqrt(2 * np.pi)


def _missed(
    height: Floats, filled: Bools, sigma: float, threshold: float, minimum: float
) -> Floats:
    """Return the chance of each word that one of its slots is decided wrongly."""
    lowest = (minimum - height[:, 0]) / sigma
    # The level stops being the minimum where half of the first pulse passes it.
    bend = (minimum / threshold - height[:, 0]) / sigma
    missed = special.ndtr(lowest)
    for low, high in ((lowest, bend), (bend, np.full_like(bend, _FAR))):
        x, weight = _normal(low, high)
        level = np.maximum(threshold * (height[:, :1] + sigma * x), minimum)[..., np.newaxis]
        other = height[:, np.newaxis, 1:]
        below = special.ndtr((level - other) / sigma)
        outside = special.ndtr((other - level) / sigma) + special.ndtr((-level - other) / sigma)
        wrong = np.where(filled[:, np.newaxis, 1:], below, outside)
        lost = -np.expm1(np.log1p(-np.minimum(wrong, _ALMOST_ONE)).sum(axis=-1))
        missed = missed + (lost * weight).sum(axis=-1)
    return np.asarray(missed)
