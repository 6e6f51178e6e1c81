r"""Voltages over time, recorded by a scope or computed from a Laplace transform.

The result of an inverse FFT is periodic: ringing beyond the end of the window wraps around to its
start. On the line :math:`s = (d + j \omega T) / T` this error shrinks by :math:`e^{-d}`; the bin at
:math:`\omega = 0` remains finite, where an inductor would otherwise cause a pole.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import ceil
from os import PathLike

import numpy as np
import numpy.typing as npt

from shipnet.arrays import Complexes, Floats
from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar
from shipnet.tables import csv_text, save_suffix

#: Highest relevant frequency of a current step that lasts 3 us [Hz].
F_MAX = 12e6

#: Length of the inverse transform's window relative to the record, and its damping. Ringing beyond
#: the window wraps around, multiplied by exp(-10.5); the error due to the limited bandwidth is
#: multiplied by at most exp(7), because the record ends at two thirds of the window.
_WINDOW, _DAMPING = 1.5, 10.5


@dataclass(frozen=True, eq=False, repr=False)
class Waveform:
    """Voltages at evenly spaced times.

    Parameters
    ----------
    u : ndarray of float, shape (n_t,) or (n_names, ..., n_t)
        Voltage [V]; NaN where nothing was recorded.
    dt : float
        Time between two samples, positive [s].
    start : float, default 0
        Time of the first sample [s].
    names : tuple of str, optional
        Nodes or channels, one per row of `u`.
    description : str, optional
        Origin of the voltages, in one line.

    Examples
    --------
    >>> wave = Waveform([0.0, 1.0, 0.5], dt=1e-6, names=("far",))
    >>> wave, wave.t.tolist()
    (<Waveform: far; 3 samples every 1 us>, [0.0, 1e-06, 2e-06])
    """

    u: Floats
    dt: float
    start: float = 0.0
    names: tuple[str, ...] = ()
    description: str = ""

    def __post_init__(self) -> None:
        u = np.asarray(self.u)
        if u.dtype.kind not in "iuf" or u.ndim == 0:
            raise ArgumentError(
                f"u has shape {u.shape} and type {u.dtype}; it must be rows of real numbers"
            )
        object.__setattr__(self, "u", u)
        if not 0 < self.dt < np.inf:
            raise ArgumentError(f"dt is {self.dt} s; it must be positive")
        check_scalar("start", self.start, "s", -1e12, 1e12)
        object.__setattr__(self, "names", tuple(self.names))
        rows = 1 if u.ndim == 1 else len(u)
        if self.names and len(self.names) != rows:
            raise ArgumentError(f"there are {len(self.names)} names; u has {rows} rows")

    @property
    def t(self) -> Floats:
        """Times [s]."""
        return self.start + self.dt * np.arange(self.u.shape[-1], dtype=np.float64)

    @classmethod
    def read(
        cls,
        path: str | PathLike[str],
        *,
        channel: str | None = None,
        sample_interval: float | None = None,
    ) -> Waveform:
        """Read a channel from a scope's text file or a ``.npy``, ``.npz`` or sigrok ``.sr`` file.

        `channel` is its title, ignoring case, or the number of its column, counted from 1; the
        default is the first voltage. `sample_interval` [s] overrides that of the file. A ``.npy``
        file of more than 2**26 bytes is not copied into memory: do not change it while its
        samples are in use. All channels and times of an
        ``.npz`` file, or one channel of an ``.sr`` file, may unpack to at most 2**22 numbers, or 4
        per byte of the file if that is more. Raise InputError if the file cannot be read, has a
        cell that is not a number, uneven times, under 1e6 samples per second, or no such channel.
        """
        from shipnet.line.scope_file import read_scope_file

        read = read_scope_file(path, channel=channel, sample_interval=sample_interval)
        return cls(read.u, read.dt, names=(read.channel,), description=read.description)

    def save(self, path: str | PathLike[str]) -> None:
        """Write an ``.npz`` file or, as ``.csv`` or ``.txt``, text with a column per node."""
        rows = np.atleast_2d(self.u)
        names = self.names or tuple(f"u{k}" for k in range(1, len(rows) + 1))
        if rows.ndim != 2:
            raise ArgumentError(f"u has shape {self.u.shape}; it must have one row per node")
        if save_suffix(path, ".csv", ".txt", ".npz") == ".npz":
            np.savez(path, u=rows.T, dt=self.dt, probes=np.array(names))
            return
        titles = csv_text([["time (s)", *(f"{name} (V)" for name in names)]]).rstrip("\n")
        columns = np.column_stack([self.t, *rows])
        np.savetxt(
            path, columns, delimiter=",", header=titles, comments="", fmt="%.9g", encoding="utf-8"
        )

    def __repr__(self) -> str:
        if self.description:
            return f"<Waveform: {self.description}>"
        shown = ", ".join(self.names[:4]) + (" ..." if len(self.names) > 4 else "")
        what = shown or f"{' x '.join(map(str, self.u.shape[:-1])) or 1} rows"
        return f"<Waveform: {what}; {self.u.shape[-1]} samples every {self.dt * 1e6:g} us>"


def laplace_grid(duration: float, f_max: float, damping: float = 7.0) -> Complexes:
    r"""Return the complex frequencies [rad/s] at which `synthesize` needs a transform.

    .. math:: s_k = \frac{d + 2 \pi j k}{T}, \qquad k = 0 \ldots \lceil f_{max} T \rceil
    """
    # The rounding of a product such as 66e-6 * 3e6 must not add a bin.
    last = ceil(f_max * duration - 1e-9)
    return np.asarray((damping + 2j * np.pi * np.arange(last + 1)) / duration)


def synthesize(
    spectrum: npt.ArrayLike, n_samples: int, duration: float, damping: float = 7.0
) -> Floats:
    """Return the waveforms of Laplace transforms sampled on `laplace_grid`."""
    bins = np.asarray(spectrum, dtype=complex)
    # If the sampling rate is below twice the highest frequency, bins alias: add any that coincide.
    folded = np.zeros((*bins.shape[:-1], n_samples), dtype=complex)
    for first in range(0, bins.shape[-1], n_samples):
        part = bins[..., first : first + n_samples]
        folded[..., : part.shape[-1]] += part
    folded[..., 0] -= bins[..., 0] / 2
    growth = np.exp(damping * np.arange(n_samples) / n_samples) * (2 * n_samples / duration)
    return np.asarray(np.fft.ifft(folded, axis=-1).real * growth)


def record_of(
    spectrum: Callable[[Complexes], Complexes], n_samples: int, dt: float, f_max: float
) -> Floats:
    """Return the waveforms of a Laplace transform from t = 0, without wrap-around."""
    window = ceil(_WINDOW * n_samples)
    transform = spectrum(laplace_grid(window * dt, f_max, _DAMPING))
    return synthesize(transform, window, window * dt, _DAMPING)[..., :n_samples]
