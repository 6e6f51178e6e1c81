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


def laplace_grid(duration: float, f_max: float, damping: float = 7.0) -> npt.NDArray[np.complex128]:
    r"""Return the complex frequencies from which `synthesize` makes a waveform.

    .. math:: s_k = \frac{d + 2 \pi j k}{T}, \qquad k = 0 \ldots \lceil f_{max} T \rceil
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
    """Return the waveforms of Laplace transforms that were sampled on `laplace_grid`."""
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
