"""How many telegrams a disturbance costs: by Monte Carlo, and for white noise in theory."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
import pandas as pd
from scipy import special

from shipnet.asi.batch import bits_of
from shipnet.asi.emc.disturbances import Disturbance, time_step
from shipnet.asi.modulation import CLASSES, HALF_BIT, check_bit_count, violations
from shipnet.asi.receiver import MINIMUM, Receiver, RNGLike, Waveform, matched_filter, receive
from shipnet.asi.receiver import Disturbance as WaveDisturbance
from shipnet.asi.segment import Segment
from shipnet.asi.telegram import RESPONSE_BITS
from shipnet.asi.timing import BIT_TIME
from shipnet.errors import ArgumentError, SilenceError
from shipnet.fields import check_scalar, check_whole
from shipnet.intervals import share_interval

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Floats = npt.NDArray[np.float64]

#: Samples worked on at a time: an array of them is 2 MB.
_SAMPLES = 2**18

#: When a telegram begins in its record, and how long the record goes on behind it [s].
_BEFORE, _BEHIND = 6.5e-6, 18.5e-6


@dataclass(frozen=True, eq=False)
class Telegrams:
    """Undisturbed telegrams, one of which is drawn for every trial."""

    bits: npt.NDArray[np.integer]
    t: Floats
    u: Floats
    span: tuple[float, float]

    def __post_init__(self) -> None:
        """Check that everything fits."""
        time_step(self.t)
        bits, u = np.shape(self.bits), np.shape(self.u)
        if len(bits) != 2 or bits[0] == 0 or u != (bits[0], np.size(self.t)):
            raise ArgumentError(
                f"bits, t and u have the shapes {bits}, {np.shape(self.t)} and {u}; they must be "
                "(n_words, n_bits), (n_t,) and (n_words, n_t), with a word at least"
            )
        check_bit_count(bits[1])


def all_telegrams(
    segment: Segment,
    n_bits: int = RESPONSE_BITS,
    *,
    slave: str | None = None,
    dt: float = 250e-9,
) -> Telegrams:
    """Return the 16 responses, or all 2048 requests, as they are heard over a segment."""
    check_bit_count(n_bits)
    if not segment.slaves:
        raise ArgumentError("segment has no slave; one must send or hear")
    slave = segment.slaves[0] if slave is None else slave
    if slave not in segment.slaves:
        raise ArgumentError(
            f"slave is {slave!r}, but the segment's slaves are {', '.join(segment.slaves)}"
        )
    dt = check_scalar("dt", dt, "s", 1e-9, 1e-6)
    information = np.arange(2 ** (n_bits - 3))
    words = information << 2 | (np.bitwise_count(information) & 1) << 1 | 1
    bits = bits_of(words, n_bits)
    end = _BEFORE + n_bits * BIT_TIME
    n_t = int(np.ceil(round((end + _BEHIND) / dt, 6)))
    one = Segment(segment.network, segment.master, (slave,))
    t, u = one.signals(bits, dt=dt, duration=n_t * dt, start=_BEFORE)
    return Telegrams(bits, t, u[0], (_BEFORE, round(end, 12)))


def decided_on(u: Floats, dt: float, matched: bool) -> Floats:
    """Return the samples by which a receiver decides that has always been listening.

    The filter lacks neighbours at the ends of a record, where a carrier would seem to begin and to
    end at once; these ends are left out.
    """
    if not matched:
        return u
    half = int(HALF_BIT / dt / 2)
    return matched_filter(u, dt)[:, half:-half]


def monte_carlo(
    telegrams: Telegrams,
    disturbance: Disturbance,
    amplitudes: npt.ArrayLike,
    n_telegrams: int,
    rng: np.random.Generator,
    *,
    threshold: float = 0.5,
    window: float = 0.1,
    matched: bool = True,
    minimum: float = MINIMUM,
) -> Iterator[dict[str, float]]:
    """Yield the rows of `telegram_error_rate` one by one, so that a loop can show progress."""
    volts = np.atleast_1d(np.asarray(amplitudes))
    if volts.ndim != 1 or volts.dtype.kind not in "iuf":
        raise ArgumentError(f"amplitudes are {amplitudes!r}; they must be one number, or a row")
    checked = [check_scalar("amplitude", float(volt), "V", 0, 1e9) for volt in volts]
    count = check_whole("n_telegrams", n_telegrams, 1, 2**31)
    receiver = {"threshold": threshold, "window": window, "minimum": minimum}

    def rows() -> Iterator[dict[str, float]]:
        for volt in checked:
            yield _row(telegrams, disturbance, volt, count, rng, matched, receiver)

    return rows()


def telegram_error_rate(
    telegrams: Telegrams,
    disturbance: Disturbance,
    amplitudes: npt.ArrayLike,
    n_telegrams: int,
    rng: np.random.Generator,
    *,
    threshold: float = 0.5,
    window: float = 0.1,
    matched: bool = True,
    minimum: float = MINIMUM,
) -> pd.DataFrame:
    """Return how many telegrams are lost, and by which check, at each amplitude."""
    return pd.DataFrame(
        monte_carlo(
            telegrams, disturbance, amplitudes, n_telegrams, rng,
            threshold=threshold, window=window, matched=matched, minimum=minimum,
        )
    )  # fmt: skip


def _row(
    telegrams: Telegrams,
    disturbance: Disturbance,
    amplitude: float,
    count: int,
    rng: np.random.Generator,
    matched: bool,
    receiver: dict[str, float],
) -> dict[str, float]:
    t, dt = time_step(telegrams.t)
    n_words, n_bits = telegrams.bits.shape
    chunk = max(1, _SAMPLES // t.size)
    failed = undetected = 0
    broken = np.zeros(len(CLASSES) + 1, dtype=np.int64)
    for begin in range(0, count, chunk):
        size = min(chunk, count - begin)
        sent = rng.integers(0, n_words, size)
        added = disturbance(t, amplitude, rng, size)
        if np.shape(added) != (size, t.size):
            raise ArgumentError(
                f"disturbance returned the shape {np.shape(added)}; it must be {(size, t.size)}"
            )
        seen = decided_on(telegrams.u[sent] + added, dt, matched)
        received = receive(seen, dt, n_bits, matched=False, **receiver)
        bad = received.error != 0
        silent = received.error == SilenceError.code
        wrong = ~bad & (received.bits != telegrams.bits[sent]).any(axis=1)
        failed += int(np.count_nonzero(bad | wrong))
        undetected += int(np.count_nonzero(wrong))
        broken[:-1] += violations(received.slots[bad & ~silent], n_bits).sum(axis=0)
        broken[-1] += np.count_nonzero(silent)
    low, high = share_interval([failed, undetected], count)
    share = broken / failed if failed else np.full(broken.shape, np.nan)
    return {
        "amplitude_V": amplitude,
        "telegrams": count,
        "failed": failed,
        "undetected": undetected,
        "rate": failed / count,
        "rate_low": float(low[0]),
        "rate_high": float(high[0]),
        "undetected_high": float(high[1]),
        **dict(zip([*CLASSES, "silence"], share.tolist(), strict=True)),
    }


Bools = npt.NDArray[np.bool_]

#: What begins within this many half-bits ahead of the first pulse's peak is taken for the pulse.
_REACH = 1.25

#: Beyond so many standard deviations no noise is counted.
_FAR = 9.0

#: Nodes and weights of an integral from -1 to 1.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(64)

#: A chance whose complement still has a logarithm; logarithms keep small chances from rounding.
_ALMOST_ONE = 1 - 1e-15


def noise_theory(
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


# Public ----------------------------------------------------------------------------------------


def telegrams_of(wave: Waveform) -> Telegrams:
    """Return the telegrams of a waveform, in the time of its record."""
    bits, u = wave.records
    begin, end = wave.span
    return Telegrams(
        bits, wave.t - wave.start, u, (begin - wave.start, round(end - wave.start, 12))
    )


class ErrorRates:
    """How many telegrams were lost at each amplitude of a disturbance."""

    def __init__(self, rows: Iterable[dict[str, float]]) -> None:
        self._table = pd.DataFrame(rows)

    def table(self) -> pd.DataFrame:
        """Return one row per amplitude: counts, rate with its 95 % interval, and causes.

        ``failed`` are those not received as they were sent, ``undetected`` those of them that no
        check found; ``rate_low`` and ``rate_high`` are the interval after Clopper and Pearson,
        ``undetected_high`` is the upper end of that of the undetected. The columns of the checks,
        and ``silence``, hold the share of the failed in which each fails; most failures break
        several checks. They are NaN where none failed.
        """
        return self._table.copy()

    def plot(self, ax: Axes | None = None, *, label: str | None = None, marker: str = "o") -> Axes:
        """Draw the rates over the amplitude, with their intervals as bars."""
        from shipnet.asi.emc.plot import plot_error_rate

        return plot_error_rate(self._table, ax=ax, label=label, marker=marker)

    def __repr__(self) -> str:
        """Return the rates in one line."""
        t = self._table
        volts = ", ".join(f"{volt:g}" for volt in t["amplitude_V"])
        share = ", ".join(f"{100 * rate:.3g}" for rate in t["rate"])
        count, missed = int(t["telegrams"].iloc[0]), int(t["undetected"].sum())
        return f"<ErrorRates: {volts} V, {share} % of {count} telegrams lost, {missed} undetected>"


def error_rate(
    wave: Waveform,
    disturbance: WaveDisturbance,
    amplitudes: npt.ArrayLike,
    n_telegrams: int,
    rng: RNGLike | None = None,
    *,
    receiver: Receiver | None = None,
) -> ErrorRates:
    """Count how many telegrams a disturbance costs, by Monte Carlo.

    Parameters
    ----------
    wave : Waveform
        What is heard without disturbance; for each trial one of its telegrams is drawn.
    disturbance : Noise, Impulses, ConductedRF or Burst
        What is added, at the receiver.
    amplitudes : float or array_like of float, shape (n_amplitudes,)
        Its amplitudes, 0..1e9 [V].
    n_telegrams : int
        Trials at each amplitude, 1 or more.
    rng : numpy.random.Generator or int, optional
        Source of the random numbers, as `numpy.random.default_rng` takes it.
    receiver : Receiver, optional
        The receiver. Its `minimum` should be four times the standard deviation of a noise behind
        its filter; else the noise ahead of a telegram is taken for its first pulse.

    Returns
    -------
    ErrorRates
        It has ``table()`` and ``plot(ax)``.

    Raises
    ------
    ArgumentError
        If an argument is out of its range.

    Examples
    --------
    >>> from shipnet.asi.emc.disturbances import Impulses
    >>> from shipnet.asi.topologies import line
    >>> answers = line(100, slaves=(5,)).waveform()
    >>> error_rate(answers, Impulses(count=4), [0, 2], 2000, 2024)
    <ErrorRates: 0, 2 V, 0, 60 % of 2000 telegrams lost, 0 undetected>
    """
    telegrams = telegrams_of(wave)

    def added(t: Floats, amplitude: float, rng: np.random.Generator, size: int) -> Floats:
        return disturbance.voltage(t, amplitude, rng, size, span=telegrams.span)

    settings = (receiver or Receiver()).settings
    source = np.random.default_rng(rng)
    return ErrorRates(monte_carlo(telegrams, added, amplitudes, n_telegrams, source, **settings))


def noise_error_rate(
    wave: Waveform, amplitudes: npt.ArrayLike, *, receiver: Receiver | None = None
) -> Floats:
    r"""Return the error rate in white noise that theory expects.

    .. math:: P = 1 - (1 - P_0) \int_{u_{min}}^\infty \varphi\left(\frac{r - h_1}{\sigma}\right)
              \prod_j \left(1 - p_j(r)\right) \frac{dr}{\sigma}

    Parameters
    ----------
    wave : Waveform
        What is heard without noise, all telegrams as likely.
    amplitudes : float or array_like of float, shape (n_amplitudes,)
        Standard deviation of a sample of the waveform, above 0 [V].
    receiver : Receiver, optional
        The receiver; its `window` does not count.

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
    :math:`p_j` is the chance that slot j is decided wrongly, :math:`h_1` and :math:`r` are the
    undisturbed and the disturbed height of the first pulse, and :math:`P_0` is the chance that
    the noise ahead of the telegram is taken for a first pulse. The receiver of the formula keeps
    perfect time and looks at one sample per slot. Behind a matched filter both agree within a
    third, from rates of 1e-3 up; without it, `error_rate` loses up to a few times as many or as
    few telegrams. Each record also loses its mean, 1.6 % of the noise, which the formula leaves
    out: at 1e-9 it is 1.8 times too high.

    Examples
    --------
    >>> from shipnet.asi.topologies import line
    >>> answers = line(100, slaves=(5,)).waveform()
    >>> noise_error_rate(answers, [0.4, 0.7], receiver=Receiver(minimum=0.9)).round(6).tolist()
    [3e-05, 0.069185]
    """
    settings = (receiver or Receiver()).settings
    del settings["window"]
    return noise_theory(telegrams_of(wave), amplitudes, **settings)
