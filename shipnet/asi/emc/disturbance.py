"""Disturbances as a receiver sees them: a voltage between both wires, to be added to telegrams.

Every function here and in `fast_transient` has the form `Disturbance`: it takes times, amplitude,
a random generator and the number of telegrams, and returns one row a telegram, each
disturbed in another way; `functools.partial` binds its other arguments. How much of a test level
in kV or V/m arrives between the wires depends on cable, screen and symmetry, and is not modelled:
the amplitude is the user's.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar, check_whole

__all__ = ["Disturbance", "conducted_rf", "impulses", "noise"]

Floats = npt.NDArray[np.float64]

#: ``disturbance(t, amplitude, rng, size)`` -> voltages [V], shape (size, n_t).
Disturbance = Callable[[Floats, float, np.random.Generator, int], Floats]

#: Largest legal amplitude [V]; the receiver takes no voltage whose square overflows.
_MOST = 1e9


def time_step(t: npt.ArrayLike) -> tuple[Floats, float]:
    """Return times as an array with their spacing, or raise unless they are evenly spaced."""
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
    return times, dt


def check_batch(amplitude: float, size: int) -> tuple[float, int]:
    """Return amplitude and number of rows, or raise if one is out of range."""
    return check_scalar("amplitude", amplitude, "V", 0, _MOST), check_whole("size", size, 0, 2**31)


def add_events(
    u: Floats,
    t: Floats,
    begin: Floats,
    length: float,
    shape: Callable[..., Floats],
    *parameters: Floats,
) -> None:
    """Add one event to each row of `u`, in place.

    It begins at `begin`, one time a row, and lasts `length` at most; its voltage is
    ``shape(time since its begin, *parameters)``, each parameter one number a row. What falls
    outside the record is lost.
    """
    dt = (t[-1] - t[0]) / (t.size - 1)
    first = np.ceil((begin - t[0]) / dt).astype(np.intp)
    column = first[:, np.newaxis] + np.arange(int(length / dt) + 1)
    row, place = np.nonzero((column >= 0) & (column < t.size))
    column = column[row, place]
    since = np.maximum(t[column] - begin[row], 0.0)
    u[row, column] += shape(since, *(parameter[row] for parameter in parameters))


def noise(t: npt.ArrayLike, amplitude: float, rng: np.random.Generator, size: int = 1) -> Floats:
    r"""Return white noise.

    Parameters
    ----------
    t : array_like of float, shape (n_t,)
        Times, evenly spaced [s].
    amplitude : float
        Standard deviation of a sample, 0..1e9 [V].
    rng : numpy.random.Generator
        Source of the random numbers.
    size : int, default 1
        Number of telegrams, 0 or more.

    Returns
    -------
    ndarray of float, shape (size, n_t)
        Voltage [V]; all samples are independent and normally distributed.

    Raises
    ------
    ArgumentError
        If an argument is not as said above.

    Notes
    -----
    A standard deviation :math:`\sigma` of samples that are :math:`\Delta t` apart stands for a
    one-sided density of :math:`2 \sigma^2 \Delta t`: halving the step at the same density raises
    `amplitude` by the square root of 2.

    Examples
    --------
    >>> u = noise(np.arange(1000) * 250e-9, 0.5, np.random.default_rng(2024), 20)
    >>> u.shape, round(float(u.std()), 2)
    ((20, 1000), 0.5)
    """
    t, _ = time_step(t)
    amplitude, size = check_batch(amplitude, size)
    return amplitude * rng.standard_normal((size, t.size))


def impulses(
    t: npt.ArrayLike,
    amplitude: float,
    rng: np.random.Generator,
    size: int = 1,
    *,
    count: int = 1,
    width: tuple[float, float] = (0.5e-6, 4e-6),
    spread: float = 0.5,
    between: tuple[float, float] | None = None,
) -> Floats:
    r"""Return impulses of random place, sign, height and width, each a raised cosine.

    .. math:: u(t) = \pm \frac{a}{2} \left(1 + \cos \frac{2 \pi (t - t_0)}{w}\right),
              \qquad |t - t_0| < \frac{w}{2}

    Parameters
    ----------
    t : array_like of float, shape (n_t,)
        Times, evenly spaced [s].
    amplitude : float
        Mean height, 0..1e9 [V].
    rng : numpy.random.Generator
        Source of the random numbers.
    size : int, default 1
        Number of telegrams, 0 or more.
    count : int, default 1
        Impulses a telegram, 0..1000.
    width : tuple of float, default (0.5e-6, 4e-6)
        Smallest and largest full width; in between all are as likely. More than 0, up to the
        length of `t` [s].
    spread : float, default 0.5
        Heights are equally distributed over `amplitude` times 1 - `spread` to 1 + `spread`, 0..1.
    between : tuple of float, optional
        First and last time of a middle, such as `Telegrams.span` [s]; all of `t` if omitted.

    Returns
    -------
    ndarray of float, shape (size, n_t)
        Voltage [V].

    Raises
    ------
    ArgumentError
        If an argument is not as said above.

    Notes
    -----
    Width and spread are assumptions: what coils and converters leave on a line differs from ship
    to ship. Impulses shorter than a step of `t` may fall between two samples.

    Examples
    --------
    >>> t = np.arange(256) * 250e-9
    >>> u = impulses(t, 2.0, np.random.default_rng(2024), 1000, count=1, width=(3e-6, 3e-6))
    >>> heights = abs(u).max(axis=1)
    >>> u.shape, round(float(heights.mean()), 1)
    ((1000, 256), 2.0)
    """
    t, _ = time_step(t)
    amplitude, size = check_batch(amplitude, size)
    count = check_whole("count", count, 0, 1000)
    spread = check_scalar("spread", spread, "of the amplitude", 0, 1)
    record = float(t[-1] - t[0])
    narrow, wide = _pair("width", width, 0, record)
    if narrow == 0:
        raise ArgumentError("width begins with 0 s; an impulse must be wider than that")
    first, last = _pair("between", (t[0], t[-1]) if between is None else between, -1e6, 1e6)
    u = np.zeros((size, t.size))
    for _ in range(count):
        w = rng.uniform(narrow, wide, size)
        height = amplitude * rng.uniform(1 - spread, 1 + spread, size)
        height *= rng.choice([-1.0, 1.0], size)
        begin = rng.uniform(first, last, size) - w / 2
        add_events(u, t, begin, wide, _raised_cosine, w, height)
    return u


def _raised_cosine(since: Floats, width: Floats, height: Floats) -> Floats:
    return np.where(since < width, height * np.sin(np.pi * since / width) ** 2, 0.0)


def conducted_rf(
    t: npt.ArrayLike,
    amplitude: float,
    rng: np.random.Generator,
    size: int = 1,
    *,
    frequency: float,
    modulation: float = 0.8,
    f_mod: float = 1e3,
    phase: float | None = None,
) -> Floats:
    r"""Return a modulated carrier, as the test with conducted radio frequency couples it in.

    .. math:: u(t) = a \bigl(1 + m \sin(2 \pi f_m t + \psi)\bigr) \sin(2 \pi f t + \varphi)

    Parameters
    ----------
    t : array_like of float, shape (n_t,)
        Times, evenly spaced [s].
    amplitude : float
        Peak of the carrier without modulation, 0..1e9 [V]. A test level is its effective value:
        with 80 % the largest peak is 1.8 times the square root of 2 times the level.
    rng : numpy.random.Generator
        Source of the random numbers.
    size : int, default 1
        Number of telegrams, 0 or more.
    frequency : float
        Frequency of the carrier [Hz]; 150 kHz to 80 MHz in the test.
    modulation : float, default 0.8
        Depth of the amplitude modulation, 0..1.
    f_mod : float, default 1e3
        Frequency of the modulation, 0 up to that of the carrier [Hz].
    phase : float, optional
        Phase of the carrier at t = 0 [rad]; random if omitted. That of the modulation always is.

    Returns
    -------
    ndarray of float, shape (size, n_t)
        Voltage [V]. The modulation is slow beside a telegram, so each one meets the carrier at
        another strength.

    Raises
    ------
    ArgumentError
        If an argument is not as said above, or `frequency` with its upper sideband is not below
        half the sampling rate. A sampled receiver would see it at another frequency; a smaller
        step of `t` helps, 5 ns at 80 MHz.

    References
    ----------
    .. [1] IEC 61000-4-6, "Immunity to conducted disturbances, induced by radio-frequency fields".

    Examples
    --------
    >>> t = np.arange(2000) * 1e-6
    >>> u = conducted_rf(t, 1.0, np.random.default_rng(2024), frequency=200e3)
    >>> u.shape, round(float(abs(u).max()), 1)
    ((1, 2000), 1.8)
    >>> conducted_rf(t, 1.0, np.random.default_rng(2024), frequency=1e6)
    Traceback (most recent call last):
        ...
    shipnet.errors.ArgumentError: frequency is 1e+06 Hz; with its sideband it must lie below 500000 Hz, half the sampling rate
    """  # noqa: E501 - the message is one line
    t, dt = time_step(t)
    amplitude, size = check_batch(amplitude, size)
    frequency = check_scalar("frequency", frequency, "Hz", 1e-3, 1e12)
    modulation = check_scalar("modulation", modulation, "of the carrier", 0, 1)
    f_mod = check_scalar("f_mod", f_mod, "Hz", 0, frequency)
    if frequency + f_mod >= 0.5 / dt:
        raise ArgumentError(
            f"frequency is {frequency:g} Hz; with its sideband it must lie below "
            f"{0.5 / dt:.6g} Hz, half the sampling rate"
        )
    carrier, slow = rng.uniform(0, 2 * np.pi, (2, size))
    if phase is not None:
        carrier = np.full(size, check_scalar("phase", phase, "rad", -1e6, 1e6))
    # Carrier and sidebands, the same for all telegrams but for a complex factor each.
    lines = np.exp(2j * np.pi * np.outer([frequency, frequency + f_mod, frequency - f_mod], t))
    side = modulation / 2j * np.exp(1j * carrier)
    factors = [np.exp(1j * carrier), side * np.exp(1j * slow), -side * np.exp(-1j * slow)]
    return amplitude * (np.stack(factors, axis=-1) @ lines).imag


def _pair(what: str, pair: tuple[float, float], low: float, high: float) -> tuple[float, float]:
    try:
        a, b = pair
    except (TypeError, ValueError):
        raise ArgumentError(f"{what} is {pair!r}; it must be two times") from None
    a, b = (check_scalar(what, end, "s", low, high) for end in (a, b))
    if a > b:
        raise ArgumentError(f"{what} is {a:g}..{b:g} s; its end must not lie before its begin")
    return a, b
