"""Voltages over time at named nodes, computed or recorded."""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from shipnet.errors import ArgumentError

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class Waveform:
    """Voltages over time, at even steps.

    Parameters
    ----------
    u : ndarray of float, shape (n_t,) or (n_names, ..., n_t)
        Voltage [V]; NaN where a recorder says that it recorded nothing.
    dt : float
        Time between two samples, positive [s].
    start : float, default 0
        Time of the first sample [s].
    names : tuple of str, optional
        Nodes or channels, one per row of `u`, or one for a single row.
    description : str, optional
        One line on where it comes from.

    Raises
    ------
    ArgumentError
        If `dt` is not positive or `names` do not fit `u`.

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
        """Check the step and the names."""
        u = np.asarray(self.u)
        if u.dtype.kind not in "iuf" or u.ndim == 0:
            raise ArgumentError(
                f"u has shape {u.shape} and type {u.dtype}; it must be rows of numbers"
            )
        object.__setattr__(self, "u", u)
        if not 0 < self.dt < np.inf:
            raise ArgumentError(f"dt is {self.dt} s; it must be positive")
        rows = 1 if u.ndim == 1 else len(u)
        if self.names and len(self.names) != rows:
            raise ArgumentError(f"there are {len(self.names)} names; u has {rows} rows")

    @property
    def t(self) -> npt.NDArray[np.float64]:
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
        """Read one channel of a scope's text file, of ``.npy``, ``.npz`` or sigrok's ``.sr``.

        `channel` is its title, upper or lower case, or the number of its column, 1 for the first;
        the first channel with a voltage if omitted. `sample_interval` [s] overrides what the file
        says. Raise InputError if the file cannot be read, is empty, has a cell that is not a
        number, uneven times, fewer than 1e6 samples per second, or no such channel.
        """
        from shipnet.line.scope_file import read_waveform

        return read_waveform(path, channel=channel, sample_interval=sample_interval)

    def save(self, path: str | PathLike[str]) -> None:
        """Write the waveform as ``.npz``, or else as text with one column per node."""
        rows = np.atleast_2d(self.u)
        names = self.names or tuple(f"u{k}" for k in range(1, len(rows) + 1))
        if rows.ndim != 2:
            raise ArgumentError(f"u has shape {self.u.shape}; a file holds one row per node")
        if Path(path).suffix == ".npz":
            np.savez(path, u=rows.T, dt=self.dt, probes=np.array(names))
            return
        titles = ",".join(["time (s)", *(f"{name} (V)" for name in names)])
        columns = np.column_stack([self.t, *rows])
        np.savetxt(path, columns, delimiter=",", header=titles, comments="", fmt="%.9g")

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw every voltage over time in microseconds, and name them if there are several."""
        from shipnet.line.plot import plot_waveform

        return plot_waveform(self, ax=ax)

    def __repr__(self) -> str:
        """Return the description, or count what it holds."""
        if self.description:
            return f"<Waveform: {self.description}>"
        shown = ", ".join(self.names[:4]) + (" ..." if len(self.names) > 4 else "")
        what = shown or f"{' x '.join(map(str, self.u.shape[:-1])) or 1} rows"
        return f"<Waveform: {what}; {self.u.shape[-1]} samples every {self.dt * 1e6:g} us>"
