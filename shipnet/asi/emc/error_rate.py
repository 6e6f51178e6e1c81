"""How many telegrams a disturbance costs, by Monte Carlo over telegrams, disturbed and received."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import pandas as pd

from shipnet.asi.apm import HALF_BIT
from shipnet.asi.batch import bits_of
from shipnet.asi.emc.disturbance import Disturbance, time_step
from shipnet.asi.frame import RESPONSE_BITS
from shipnet.asi.receiver import MINIMUM, matched_filter, receive
from shipnet.asi.segment import Segment
from shipnet.asi.slots import CLASSES, check_bit_count, violations
from shipnet.asi.timing import BIT_TIME
from shipnet.errors import ArgumentError, SilenceError
from shipnet.fields import check_scalar, check_whole
from shipnet.intervals import share_interval

__all__ = ["Telegrams", "all_telegrams", "monte_carlo", "telegram_error_rate"]

Floats = npt.NDArray[np.floating]

#: Samples worked on at a time: an array of them is 2 MB.
_SAMPLES = 2**18

#: When a telegram begins in its record, and how long the record goes on behind it [s].
_BEFORE, _BEHIND = 6.5e-6, 18.5e-6


@dataclass(frozen=True, eq=False)
class Telegrams:
    """Undisturbed telegrams, one of which is drawn for every trial.

    Parameters
    ----------
    bits : ndarray of int, shape (n_words, n_bits)
        What is sent; 7 or 14 bits.
    t : ndarray of float, shape (n_t,)
        Times, evenly spaced [s].
    u : ndarray of float, shape (n_words, n_t)
        What the receiver hears of it [V].
    span : tuple of float
        Begin and end of the telegram as it is sent [s].

    Raises
    ------
    ArgumentError
        If the shapes do not fit each other, there is no word, or `t` is not evenly spaced.
    """

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
    """Return the 16 responses, or all 2048 requests, as they are heard over a segment.

    Parameters
    ----------
    segment : Segment
        Cable, supply, master and slaves.
    n_bits : int, default 7
        `RESPONSE_BITS` or `REQUEST_BITS`: what the master hears of a slave, or the slave of the
        master.
    slave : str, optional
        Node of the slave; the first of the segment if omitted.
    dt : float, default 250e-9
        Time step, a whole fraction of the half-bit of 3 us [s].

    Returns
    -------
    Telegrams
        The record begins 6.5 us before the telegram and goes on 18.5 us behind it.

    Raises
    ------
    ArgumentError
        If the segment has no such slave, or another argument is not as said above.

    Examples
    --------
    >>> from shipnet.asi.topology import straight_line
    >>> telegrams = all_telegrams(straight_line(100, slaves=(5, 100)))
    >>> telegrams.u.shape, telegrams.span
    ((16, 268), (6.5e-06, 4.85e-05))
    """
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
    """Yield one row of `telegram_error_rate` after the other: for a loop that shows its progress.

    Parameters
    ----------
    telegrams, disturbance, amplitudes, n_telegrams, rng, threshold, window, matched, minimum
        As for `telegram_error_rate`.

    Returns
    -------
    iterator of dict
        One dict an amplitude, in their order; the keys are the columns of the table. All
        arguments but those of the receiver are checked before the first row is asked for.

    Raises
    ------
    ArgumentError
        As `telegram_error_rate`.

    Examples
    --------
    >>> from shipnet.asi.emc.disturbance import noise
    >>> from shipnet.asi.topology import straight_line
    >>> telegrams = all_telegrams(straight_line(100, slaves=(5,)))
    >>> rng = np.random.default_rng(2024)
    >>> for row in monte_carlo(telegrams, noise, [0.3, 0.9], 1000, rng, minimum=0.9):
    ...     print(f"{row['amplitude_V']} V: {row['rate']:.0%}")
    0.3 V: 0%
    0.9 V: 31%
    """
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
    """Return how many telegrams are lost, and by which check, at each amplitude of a disturbance.

    Parameters
    ----------
    telegrams : Telegrams
        What is sent: for each trial one of them is drawn, all as likely.
    disturbance : Disturbance
        What is added, such as `noise`, or `impulses` with ``functools.partial``.
    amplitudes : float or array_like of float, shape (n_amplitudes,)
        Its amplitudes, 0..1e9 [V].
    n_telegrams : int
        Trials at each amplitude, 1 or more.
    rng : numpy.random.Generator
        Source of the random numbers.
    threshold, window, matched, minimum
        The receiver, as for `receive`. `minimum` should be four times the standard deviation of
        a noise behind the filter; else the noise ahead of a telegram is taken for its first pulse.

    Returns
    -------
    pandas.DataFrame
        One row an amplitude: ``amplitude_V``; ``telegrams``; ``failed``, those that were not
        received as they were sent; ``undetected``, those of them that no check found; ``rate``,
        failed over telegrams, with ``rate_low`` and ``rate_high``, its 95 % interval after
        Clopper and Pearson, and ``undetected_high``, the upper end of the interval of the
        undetected; the share of the failed in which each check of `CLASSES` fails, and
        ``silence``, in which nothing was heard. Most failures break several checks, so the shares
        add up to more than 1; they are NaN where none failed.

    Raises
    ------
    ArgumentError
        If an argument is not as said above, or the disturbance returns another shape than
        ``(size, n_t)``.

    Notes
    -----
    The disturbance is added behind the cable, at the receiver. Telegrams start on a sample. With
    `matched` the first and last 1.5 us of the record are there for the filter alone: the line was
    as disturbed before.

    References
    ----------
    .. [1] C. J. Clopper, E. S. Pearson, "The use of confidence or fiducial limits illustrated in
       the case of the binomial", Biometrika 26, 1934.

    Examples
    --------
    >>> from functools import partial
    >>> from shipnet.asi.emc.disturbance import impulses
    >>> from shipnet.asi.topology import straight_line
    >>> telegrams = all_telegrams(straight_line(100, slaves=(5,)))
    >>> four = partial(impulses, count=4, between=telegrams.span)
    >>> table = telegram_error_rate(telegrams, four, [0, 2], 2000, np.random.default_rng(2024))
    >>> table[["amplitude_V", "failed", "undetected"]].to_numpy().tolist()
    [[0.0, 0.0, 0.0], [2.0, 1200.0, 0.0]]
    """
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
