"""Rates of telegrams lost to disturbances, simulated or calculated, and their effect on a network.

An analyser counts *series* of 1 to 6 consecutive failed exchanges; a slave is dropped after six.
"""

from __future__ import annotations

from dataclasses import asdict

import numpy as np
import numpy.typing as npt

from shipnet.arrays import Bools, Floats
from shipnet.asi.emc.disturbances import PACKET_LENGTH, PACKET_PERIOD
from shipnet.asi.modulation import CLASSES, HALF_BIT, Pulses
from shipnet.asi.receiver import Disturbance, Receiver, RNGLike, Waveform, matched_filter, receive
from shipnet.asi.timing import Cycle, Transaction
from shipnet.errors import ArgumentError, SilenceError
from shipnet.fields import check_rng, check_scalar, check_whole
from shipnet.intervals import share_interval
from shipnet.lazy import pd
from shipnet.parallel import track

#: Number of samples processed at a time; an array of them takes 2 MB.
_SAMPLES = 2**18


def decided_on(u: Floats, dt: float, matched: bool) -> Floats:
    """Return the samples that a receiver uses: `u`, filtered and without its ends if `matched`."""
    # The filter lacks samples at the ends of a record, so a carrier would seem to begin there.
    half = int(HALF_BIT / dt / 2)
    return matched_filter(u, dt)[:, half:-half] if matched else u


def checked_densities(noise_density: npt.ArrayLike) -> Floats:
    """Return noise densities as a 1-D array; raise ArgumentError if one is out of range."""
    densities = np.atleast_1d(np.asarray(noise_density))
    numbers = densities.ndim == 1 and densities.dtype.kind in "iuf"
    if not numbers or not ((densities > 0) & (densities <= 1e6)).all():
        raise ArgumentError(
            f"noise_density is {noise_density!r}; it must be above 0 and up to 1e6 V per root hertz"
        )
    return np.asarray(densities, float)


def _row(
    wave: Waveform,
    disturbance: Disturbance,
    amplitude: float,
    count: int,
    rng: np.random.Generator,
    receiver: Receiver,
) -> dict[str, float]:
    """Count the telegrams lost at one amplitude."""
    bits, u = wave.records
    n_words, n_bits = bits.shape
    chunk = max(1, _SAMPLES // u.shape[1])
    settings = {**asdict(receiver), "matched": False}
    failed = undetected = 0
    broken = np.zeros(len(CLASSES) + 1, dtype=np.int64)
    for begin in track(range(0, count, chunk), f"telegrams at {amplitude:g} V"):
        size = min(chunk, count - begin)
        sent = rng.integers(0, n_words, size)
        added = wave.disturbance(disturbance, amplitude, rng, size)
        seen = decided_on(u[sent] + added, wave.dt, receiver.matched)
        received = receive(seen, wave.dt, n_bits, **settings)
        bad = received.error != 0
        silent = received.error == SilenceError.code
        wrong = ~bad & (received.bits != bits[sent]).any(axis=1)
        failed += int(np.count_nonzero(bad | wrong))
        undetected += int(np.count_nonzero(wrong))
        broken[:-1] += Pulses(received.slots[bad & ~silent]).violations.sum(axis=0)
        broken[-1] += np.count_nonzero(silent)
    low, high = share_interval([failed, undetected], count)
    share = broken / failed if failed else np.full(broken.shape, np.nan)
    return {
        "amplitude_V": amplitude,
        "silence_s": -wave.start,
        "telegrams": count,
        "failed": failed,
        "undetected": undetected,
        "rate": failed / count,
        "rate_low": float(low[0]),
        "rate_high": float(high[0]),
        "undetected_high": float(high[1]),
        **dict(zip([*CLASSES, "silence"], share.tolist(), strict=True)),
    }


#: Noise within this many half-bits before the first peak counts as part of the first pulse.
_REACH = 1.25

#: Largest ratio of `minimum` to the first pulse for which the closed form holds after a matched
#: filter. Above it, the peak of a weakened first pulse may shift by some samples, which the formula
#: ignores: for a ratio of 0.45, simulated rates are twice a computed 1e-4, and 26 times 1e-8.
_HIGHEST_MINIMUM = 0.35

#: Number of standard deviations beyond which noise is ignored.
_FAR = 9.0

#: Nodes and weights of an integral from -1 to 1.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(64)

#: Upper limit for probabilities p, so that log(1 - p) is finite.
_ALMOST_ONE = 1 - 1e-15


def _slots(wave: Waveform, receiver: Receiver) -> tuple[Floats, Bools, Floats, int]:
    """Return the heights of the slots, starting at the first pulse, and which of them have pulses.

    The last two values are the numbers of samples before each telegram and in a record.
    """
    (bits, u), dt = wave.records, wave.dt
    n_bits = bits.shape[1]
    y = decided_on(u, dt, receiver.matched)
    y = y - y.mean(axis=1, keepdims=True)
    received = receive(y, dt, n_bits, **{**asdict(receiver), "matched": False, "window": 0.0})
    if received.error.any() or (received.bits != bits).any():
        raise ArgumentError("telegrams must be received without an error when there is no noise")
    peak = (received.start + 1.5 * HALF_BIT) / dt
    middle = np.rint(peak[:, np.newaxis] + HALF_BIT / dt * np.arange(2 * n_bits + 1)).astype(int)
    seen = np.take_along_axis(y, np.minimum(middle, y.shape[1] - 1), axis=1)
    height = np.abs(np.where(middle < y.shape[1], seen, 0.0))
    ahead = np.ceil(peak - int(_REACH * HALF_BIT / dt) - 1e-6)
    return height, received.slots[:, 1:] != 0, np.maximum(ahead, 0.0), y.shape[1]


def _false_start(level: float, correlation: float, samples: Floats) -> Floats:
    """Return the probability of |noise| above `level` standard deviations in a run of `samples`."""
    from scipy.special import ndtr

    x, weight = _normal(-level, level)
    exceeds = ndtr((correlation * x - level) / np.sqrt(1 - correlation**2))
    exceeds += ndtr((-correlation * x - level) / np.sqrt(1 - correlation**2))
    first = min(2 * ndtr(-level), _ALMOST_ONE)
    # Probability that a sample exceeds the level if the previous one does not.
    later = min(float(exceeds @ weight) / (1 - first), _ALMOST_ONE)
    none = np.log1p(-first) + (samples - 1) * np.log1p(-later)
    return -np.expm1(np.where(samples > 0, none, 0.0))


def _normal(low: npt.ArrayLike, high: npt.ArrayLike) -> tuple[Floats, Floats]:
    """Return nodes and weights, along a new axis, to integrate over the normal distribution."""
    bounds = np.clip(np.stack(np.broadcast_arrays(low, high), axis=-1), -_FAR, _FAR)
    middle, half = bounds.mean(axis=-1)[..., np.newaxis], np.diff(bounds) / 2
    x = middle + half * _NODES
    return x, half * _WEIGHTS * np.exp(-(x**2) / 2) / np.sqrt(2 * np.pi)


def _missed(
    height: Floats, filled: Bools, sigma: float, threshold: float, minimum: float
) -> Floats:
    """Return the probability, for each word, that at least one slot is decided wrongly."""
    from scipy.special import ndtr

    lowest = (minimum - height[:, 0]) / sigma
    # For noise x above `bend`, the level is a fraction of the first pulse; below it, the minimum.
    bend = (minimum / threshold - height[:, 0]) / sigma
    missed = ndtr(lowest)
    for low, high in ((lowest, bend), (bend, np.full_like(bend, _FAR))):
        x, weight = _normal(low, high)
        level = np.maximum(threshold * (height[:, :1] + sigma * x), minimum)[..., np.newaxis]
        other = height[:, np.newaxis, 1:]
        below = ndtr((level - other) / sigma)
        outside = ndtr((other - level) / sigma) + ndtr((-level - other) / sigma)
        wrong = np.where(filled[:, np.newaxis, 1:], below, outside)
        lost = -np.expm1(np.log1p(-np.minimum(wrong, _ALMOST_ONE)).sum(axis=-1))
        missed = missed + (lost * weight).sum(axis=-1)
    return np.asarray(missed)


def count_errors(
    wave: Waveform,
    disturbance: Disturbance,
    amplitudes: npt.ArrayLike,
    n_telegrams: int,
    rng: RNGLike | None = None,
    *,
    receiver: Receiver | None = None,
) -> pd.DataFrame:
    """Count the telegrams lost to a disturbance, by Monte Carlo simulation.

    Parameters
    ----------
    wave : Waveform
        Voltage without disturbance; each trial draws one of its telegrams.
    disturbance : Noise, Impulses, ConductedRF or Burst
        Disturbance at the receiver.
    amplitudes : float or array_like of float, shape (n_amplitudes,)
        Amplitudes of the disturbance, 0..1e9 [V].
    n_telegrams : int
        Number of trials at each amplitude, 1 or more.
    rng : numpy.random.Generator or int, optional
        Source of the random numbers.
    receiver : Receiver, optional
        The receiver. Its `minimum` should be four times the standard deviation of the noise after
        any filter; if it is lower, noise before a telegram may be mistaken for the first pulse.

    Returns
    -------
    pandas.DataFrame
        One row per amplitude, ``amplitude_V``: ``silence_s``, the silence before each telegram, in
        which noise may cause a false start; number of ``telegrams`` sent; ``failed``, those not
        received as sent; ``undetected``, failures that no check found; ``rate`` of failures with
        its 95 % Clopper-Pearson interval, ``rate_low`` and ``rate_high``; ``undetected_high``,
        upper limit of the rate of undetected failures; and the fractions of the failed telegrams
        that violate each check, or whose first pulse was missed (``silence``).

    Examples
    --------
    >>> from shipnet.asi.emc.disturbances import Impulses
    >>> from shipnet.asi.topologies import line
    >>> answers = line(100, slaves=(5,)).waveform()
    >>> counted = count_errors(answers, Impulses(count=4), [0, 2], 2000, 2024)
    >>> counted[["amplitude_V", "failed", "undetected"]].astype(int).values.tolist()
    [[0, 0, 0], [2, 1222, 0]]
    """
    volts = np.atleast_1d(np.asarray(amplitudes))
    if volts.ndim != 1 or volts.dtype.kind not in "iuf":
        raise ArgumentError(f"amplitudes are {amplitudes!r}; they must be a number or a 1-D array")
    checked = [check_scalar("amplitude", float(volt), "V", 0, 1e9) for volt in volts]
    count = check_whole("n_telegrams", n_telegrams, 1, 2**31)
    source, receiver = check_rng(rng), receiver or Receiver()
    rows = (_row(wave, disturbance, volt, count, source, receiver) for volt in checked)
    return pd.DataFrame(rows)


def error_rate(
    wave: Waveform, noise_density: npt.ArrayLike, *, receiver: Receiver | None = None
) -> Floats:
    r"""Return the probability that white noise corrupts a telegram, in closed form.

    .. math:: P = 1 - (1 - P_0) \int_{u_{min}}^\infty \varphi\left(\frac{r - h_1}{\sigma}\right)
              \prod_j \left(1 - p_j(r)\right) \frac{dr}{\sigma}, \qquad
              p_j = \begin{cases}
              Q\left((h_j - \theta r) / \sigma\right) & \text{a pulse} \\
              Q\left((\theta r - h_j) / \sigma\right) + Q\left((\theta r + h_j) / \sigma\right)
              & \text{none} \end{cases}

    Parameters
    ----------
    wave : Waveform
        Voltage without noise; all its telegrams are equally likely. False starts are counted in
        its silence, from ``wave.start`` to 0.
    noise_density : float or array_like of float, shape (n,)
        One-sided density at the receiver, above 0 and up to 1e6 [V per root hertz]; see
        `Noise.density`. A density of 0.5 mV per root hertz is 0.71 V in a bandwidth of 2 MHz.
    receiver : Receiver, optional
        The receiver; its `window` is ignored.

    Returns
    -------
    ndarray of float, shape (n,)
        Probability that a telegram is not received as sent.

    Raises
    ------
    ArgumentError
        If a telegram is not received correctly even without noise, or if the receiver has a matched
        filter and a `minimum` above 0.35 of the first pulse: the result would then be too low.

    Notes
    -----
    :math:`p_j` is the probability that slot j is decided wrongly, :math:`h_1` and :math:`r` are the
    undisturbed and the disturbed height of the first pulse, and :math:`P_0` is the probability that
    noise before the telegram is mistaken for a first pulse. The formula assumes an ideally timed
    receiver that uses one sample per slot. With a matched filter, it agrees with `count_errors`
    within a third at rates above 1e-4, and with `rare_error_rates` within a tenth down to 1e-10.
    Without the filter, the rate from `count_errors` may be a few times higher or lower.

    Examples
    --------
    >>> from shipnet import asi
    >>> answers, proof = asi.line(100, slaves=(5,)).waveform(), asi.RECEIVERS["noise-proof"]
    >>> error_rate(answers, [0.283e-3, 0.495e-3], receiver=proof).round(6).tolist()
    [5.6e-05, 0.148445]
    """
    receiver = receiver or Receiver()
    threshold, minimum = receiver.threshold, receiver.minimum
    sigma = checked_densities(noise_density) / (2 * wave.dt) ** 0.5
    height, filled, ahead, samples = _slots(wave, receiver)
    # Noise gain of filter and mean removal, and correlation of adjacent samples.
    half = int(HALF_BIT / wave.dt / 2) if receiver.matched else 0
    shape = np.cos(np.pi * np.arange(-half, half + 1) * wave.dt / HALF_BIT) ** 2
    power = float(shape @ shape)
    lost = min(float(shape.sum()) ** 2 / power / samples, 0.5)
    gain = 8 / 3 * wave.dt / HALF_BIT if receiver.matched else 1.0
    correlation = (float(shape[1:] @ shape[:-1]) / power - lost) / (1 - lost)
    sigma = sigma * gain * np.sqrt(power * (1 - lost))
    highest = _HIGHEST_MINIMUM * float(height[:, 0].min())
    if receiver.matched and minimum > highest:
        raise ArgumentError(
            f"minimum is {minimum:g} V; with a matched filter the formula holds up to "
            f"{highest:.3g} V, {_HIGHEST_MINIMUM:g} of the first pulse; use emc.rare_error_rates"
        )
    rates = []
    for one in sigma:
        false = _false_start(minimum / one, correlation, ahead)
        missed = _missed(height, filled, one, threshold, minimum)
        rates.append(np.mean(false + missed - false * missed))
    return np.array(rates)


def noise_margin(wave: Waveform, receiver: Receiver) -> float:
    """Return the largest voltage of noise, after any filter, that changes no decision [V].

    In the worst case, noise raises the first pulse, and with it the level of the receiver (a
    fraction of the first pulse: ZMD, SAP5S/SAP51 data sheet, 2012, p. 31), and lowers another
    pulse; or the reverse, between pulses. A false start needs the receiver's `minimum`.
    """
    threshold, minimum = receiver.threshold, receiver.minimum
    height, filled, _, _ = _slots(wave, receiver)
    first, other = height[:, :1], height[:, 1:]
    above = (other - threshold * first) / (1 + threshold)
    pulses, gaps = np.minimum(above, other - minimum), np.maximum(-above, minimum - other)
    slots = np.where(filled[:, 1:], pulses, gaps)
    return float(min(minimum, (first - minimum).min(), slots.min()))


#: Tries per slave and cycle, and the number of consecutive failed cycles after which a slave is
#: dropped. Beckhoff, EL6201: three data exchange phases in a row; Siemens, AS-i analyser: six
#: exchanges.
TRIES, CYCLES = 2, 3

#: Requests per cycle besides data exchange: management and inclusion, according to OMRON W357.
_EXTRA = 2


def independent_failures(p: npt.ArrayLike, cycle: Cycle | None = None) -> pd.DataFrame:
    r"""Return how exchanges that fail independently of each other affect a network.

    .. math:: q = p^2, \qquad T = T_c \left(\frac{1}{q} + \frac{1}{q^2} + \frac{1}{q^3}\right)

    Parameters
    ----------
    p : float or array_like of float, shape (n,)
        Probability that an exchange fails, 0..1.
    cycle : Cycle, default ``Cycle(31)``
        Cycle of 1 to 31 addresses; two slaves that share an address count as one.

    Returns
    -------
    pandas.DataFrame
        One row per probability: ``rate``; ``repetitions_per_s``; ``cycle_failure`` q, the
        probability that both tries fail; ``three_cycles``, the same for three cycles in a row;
        ``between_drops_s`` T, mean time until a slave is dropped; ``drops_per_h`` of all slaves.

    Examples
    --------
    >>> effect = independent_failures(1 / 60).iloc[0]
    >>> f"{1 / effect['drops_per_h'] / 24:.0f} days"
    '90 days'
    """
    rate = np.atleast_1d(np.asarray(p))
    if rate.ndim != 1 or rate.dtype.kind not in "iuf" or not ((rate >= 0) & (rate <= 1)).all():
        raise ArgumentError(f"p is {p!r}; it must be one probability or a 1-D array of them, 0..1")
    cycle = cycle or Cycle(31)
    slaves = check_whole("addresses", cycle.addresses, 1, 31)
    table = pd.DataFrame({"rate": rate.astype(float)})
    table["repetitions_per_s"] = slaves * table["rate"] / cycle.time
    failure = table["cycle_failure"] = table["rate"] ** TRIES
    table["three_cycles"] = failure**CYCLES
    with np.errstate(divide="ignore", over="ignore"):
        cycles = sum(failure**-k for k in range(1, CYCLES + 1))
        table["between_drops_s"] = cycle.time * cycles
        return table.assign(drops_per_h=slaves * 3600 / table["between_drops_s"])


def burst_failures(
    inside: float, rng: RNGLike | None = None, packets: int = 1000, *, slaves: int = 31
) -> pd.DataFrame:
    """Count runs of consecutive failures when bursts disturb the polling cycles of a network.

    A burst is a packet of pulses that lasts 15 ms; one comes every 300 ms, as in IEC 61000-4-4.

    Parameters
    ----------
    inside : float
        Probability that an exchange fails during a packet, 0..1; outside packets, none fails.
    rng : numpy.random.Generator or int, optional
        Source of the random numbers.
    packets : int, default 1000
        Number of packets, 1 or more; each begins at a random moment of a cycle.
    slaves : int, default 31
        Number of slaves polled per cycle, 1..31.

    Returns
    -------
    pandas.DataFrame
        One row per length of a run, ``failures`` 1..6: the number of such runs, ``series``, also
        ``per_packet`` and ``per_h``. After the sixth failure in a row the slave is dropped.

    Notes
    -----
    Exchanges in a packet are assumed to fail independently, although its pulses are periodic. A
    dropped slave is assumed to return in the next cycle.

    Examples
    --------
    A third of the exchanges in a packet fail, which is one in 60 over the whole test. At this rate,
    independent failures would drop a slave every 90 days; the packets drop 1.7 slaves per minute:

    >>> table = burst_failures(1 / 3, 2024, 40_000).set_index("failures")
    >>> f"{table.loc[6, 'per_h'] / 60:.1f} a minute"
    '1.7 a minute'
    """
    inside = check_scalar("inside", inside, "of the exchanges", 0, 1)
    packets = check_whole("packets", packets, 1, 2**31)
    generator, slaves = check_rng(rng), check_whole("slaves", slaves, 1, 31)
    slot, most = Transaction().duration, TRIES * CYCLES
    counts = np.zeros(most + 1, dtype=np.int64)
    in_a_row = np.zeros((slaves, packets), dtype=np.intp)
    # Each packet begins at time 0, at a random moment of a cycle that is already running.
    t = -generator.uniform(0, (slaves + _EXTRA) * slot, packets)
    while (t < PACKET_LENGTH).any():
        for series in in_a_row:
            trying = np.full(packets, True)
            for _ in range(TRIES):
                hit = (t < PACKET_LENGTH) & (t + slot > 0)
                failed = trying & hit & (generator.random(packets) < inside)
                t += slot * trying
                over = trying & ~failed
                counts += np.bincount(series[over], minlength=most + 1)
                series[over] = 0
                series += failed
                trying = failed
            dropped = series == most
            counts[most] += np.count_nonzero(dropped)
            series[dropped] = 0
        t += _EXTRA * slot
    # After the packet the next exchange succeeds, which ends every open series.
    counts += np.bincount(in_a_row.ravel(), minlength=most + 1)
    table = pd.DataFrame({"failures": np.arange(1, most + 1), "series": counts[1:]})
    table["per_packet"] = table["series"] / packets
    return table.assign(per_h=table["per_packet"] * 3600 / PACKET_PERIOD)
