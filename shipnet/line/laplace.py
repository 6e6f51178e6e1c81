r"""From a Laplace transform back to a waveform, along a line beside the imaginary axis.

An inverse FFT repeats itself: what still rings at the end of the window falls into its beginning.
On :math:`s = (d + j \omega T) / T` it does so reduced by :math:`e^{-d}`, about a thousandth by
default, even for a mode without any loss; and the bin at :math:`\omega = 0` stays finite where an
inductor would make it a pole.
"""

from __future__ import annotations

from math import ceil

import numpy as np
import numpy.typing as npt

from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar, check_whole

__all__ = ["laplace_grid", "synthesize"]


def laplace_grid(duration: float, f_max: float, damping: float = 7.0) -> npt.NDArray[np.complex128]:
    r"""Return the complex frequencies from which `synthesize` makes a waveform.

    .. math:: s_k = \frac{d + 2 \pi j k}{T}, \qquad k = 0 \ldots \lceil f_{max} T \rceil

    Parameters
    ----------
    duration : float
        Length T of the waveform, 1e-12 to 1e6 [s].
    f_max : float
        Highest frequency, 1e-6 to 1e15 [Hz]. The error is what the signal has above it: for pulses
        of AS-i 3 MHz gives 5e-5 of the peak, 6 MHz 6e-6, 10 MHz 1.4e-6.
    damping : float, default 7
        Damping d over the whole length, 0.1 to 20 [neper]. Less lets more of the ringing wrap
        around, more lets rounding errors grow at the end: by e**20 they reach 1e-7.

    Returns
    -------
    ndarray of complex, shape (n_s,)
        Complex frequency [rad/s].

    Raises
    ------
    ArgumentError
        If an argument is out of range.

    Examples
    --------
    >>> laplace_grid(1e-3, 2e3).round(1).tolist()
    [(7000+0j), (7000+6283.2j), (7000+12566.4j)]
    """
    length = check_scalar("duration", duration, "s", 1e-12, 1e6)
    highest = check_scalar("f_max", f_max, "Hz", 1e-6, 1e15)
    d = check_scalar("damping", damping, "nepers", 0.1, 20.0)
    # A product such as 64e-6 * 3e6 must not gain a bin by rounding.
    last = ceil(highest * length - 1e-9)
    return np.asarray((d + 2j * np.pi * np.arange(last + 1)) / length)


def synthesize(
    spectrum: npt.ArrayLike, n_samples: int, duration: float, damping: float = 7.0
) -> npt.NDArray[np.float64]:
    """Return the waveforms of Laplace transforms that were sampled on `laplace_grid`.

    Parameters
    ----------
    spectrum : array_like of complex, shape (..., n_s)
        Transforms on the whole of ``laplace_grid(duration, f_max, damping)`` [V s for volts].
    n_samples : int
        Samples of the result, 1 or more, at ``np.arange(n_samples) * duration / n_samples``.
    duration, damping : float
        As given to `laplace_grid`.

    Returns
    -------
    ndarray of float, shape (..., n_samples)
        Waveforms, in the unit of the transform per second. They hold all the frequencies of the
        grid: a coarse one shows samples of the same curve, not a smoother curve.

    Raises
    ------
    ArgumentError
        If an argument is out of range.

    Examples
    --------
    A rise and a decay of 1 us, t exp(-t) with t in us:

    >>> s = laplace_grid(8e-6, 1e9)
    >>> synthesize(1e6 / (s + 1e6) ** 2, 4, 8e-6).round(3).tolist()
    [0.0, 0.271, 0.073, 0.015]
    """
    check_whole("n_samples", n_samples, 1, 2**40)
    length = check_scalar("duration", duration, "s", 1e-12, 1e6)
    d = check_scalar("damping", damping, "nepers", 0.1, 20.0)
    bins = np.asarray(spectrum, dtype=complex)
    if bins.ndim == 0 or bins.shape[-1] == 0:
        raise ArgumentError("spectrum must hold at least one frequency")
    # Below twice the highest frequency, irfft would cut bins off: sample finer, keep every n-th.
    finer = ceil((2 * bins.shape[-1] - 1) / n_samples)
    total = finer * n_samples
    waves = np.fft.irfft(bins, total, axis=-1)[..., ::finer]
    growth = np.exp(d * np.arange(n_samples) / n_samples) * (total / length)
    return np.asarray(waves * growth)
