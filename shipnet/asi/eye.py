"""All half-bits of many telegrams laid over each other: how even, how still between the pulses."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.ndimage import map_coordinates

from shipnet.asi.apm import HALF_BIT, pulses_of
from shipnet.asi.receiver import receive
from shipnet.errors import ArgumentError

__all__ = ["Eye", "eye"]

Floats = npt.NDArray[np.float64]


class Eye(NamedTuple):
    """Half-bits laid over each other.

    Attributes
    ----------
    t : ndarray of float, shape (n,)
        Time from the middle of a half-bit [s].
    pulses : ndarray of float, shape (n_pulses, n)
        Half-bits with a pulse, all turned positive, over the largest sample of their telegram.
    gaps : ndarray of float, shape (n_gaps, n)
        Half-bits without one after the first pulse, the two behind the telegram among them.
    """

    t: Floats
    pulses: Floats
    gaps: Floats


def eye(
    u: npt.ArrayLike, dt: float, bits: str | Sequence[str] | npt.ArrayLike, *, points: int = 61
) -> Eye:
    """Lay the half-bits of telegrams over each other.

    Parameters
    ----------
    u : array_like of float, shape (..., n_t)
        Line voltage, a telegram a row, as `receive` takes it [V].
    dt : float
        Sampling interval, 1e-9..1e-6 [s].
    bits : str, sequence of str, or array_like of int, shape (..., n_bits)
        What was sent: 7 or 14 bits; its leading axes are broadcast to those of `u`.
    points : int, default 61
        Points of a half-bit, 2 or more.

    Returns
    -------
    Eye
        Pulses and gaps in the order of the telegrams.

    Raises
    ------
    ArgumentError
        If the shapes do not fit, `points` is too small, a telegram holds no pulse, or one ends
        after the record; otherwise as `receive`.

    Examples
    --------
    >>> from shipnet.asi.topology import straight_line
    >>> t, u = straight_line(100, slaves=(5,)).signals("0011001", dt=250e-9)
    >>> opened = eye(u, 250e-9, "0011001")
    >>> len(opened.pulses), len(opened.gaps)
    (10, 5)
    >>> middle = opened.pulses[:, len(opened.t) // 2]
    >>> print(f"the smallest pulse has {middle.min() / middle.max():.0%} of the largest")
    the smallest pulse has 95% of the largest
    """
    if points < 2:
        raise ArgumentError(f"points is {points}; it must be 2 or more")
    u = np.asarray(u)
    sent = pulses_of(bits)
    heard = receive(u, dt, sent.shape[-1] // 2, matched=False)
    try:
        signs = np.broadcast_to(sent, (*u.shape[:-1], sent.shape[-1]))
    except ValueError:
        raise ArgumentError(
            f"bits have the shape {sent.shape[:-1]}, which does not fit the telegrams' "
            f"{u.shape[:-1]}"
        ) from None
    if not np.isfinite(heard.start).all():
        raise ArgumentError("a telegram in u holds no pulse above the receiver's minimum")
    signs = np.pad(signs.reshape(-1, signs.shape[-1]), ((0, 0), (0, 2)))[:, 1:]
    rows = u.reshape(len(signs), -1)
    t = np.linspace(-HALF_BIT / 2, HALF_BIT / 2, points)
    middles = heard.start.reshape(-1, 1) + HALF_BIT * (np.arange(signs.shape[1]) + 1.5)
    place = (middles[..., np.newaxis] + t) / dt
    if place.max() > rows.shape[1] - 1:
        raise ArgumentError(
            f"u ends after {rows.shape[1] * dt:.3g} s; a telegram and its silence last until "
            f"{place.max() * dt:.3g} s"
        )
    # A row off by one would blend two telegrams, so the row coordinate is a whole number.
    row = np.broadcast_to(np.arange(len(rows))[:, np.newaxis, np.newaxis], place.shape)
    folded = map_coordinates(rows - rows.mean(axis=1, keepdims=True), [row, place], order=1)
    folded /= np.abs(folded).max(axis=(1, 2), keepdims=True)
    filled = signs != 0
    return Eye(t, folded[filled] * signs[filled][:, np.newaxis], folded[~filled])
