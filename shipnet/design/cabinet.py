"""Where the cabinet stands, found from the lengths that a list gives for cables to it."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.errors import ArgumentError

if TYPE_CHECKING:
    from shipnet.design.iolist import IoList

__all__ = ["Found", "find_cabinet"]

#: Points with place and length that are needed for three coordinates and a look at what is left.
_FEWEST = 4

#: Places along each axis in the first look and in the others, and how many are kept of a look.
_FIRST, _NEXT, _KEPT = 15, 5, 25

#: Reach of the last look [m], and how far a length may be rounded [m].
_CLOSE, _ROUNDED = 0.02, 0.2


class Found(NamedTuple):
    """A cabinet that lengths speak for.

    Attributes
    ----------
    place : (float, float, float)
        Where it is [m], to 0.1 m.
    misfit : float
        Median of what the lengths are off by [m].
    points : int
        Points that it was found from.
    settled : bool
        Whether the lengths leave no other place.
    """

    place: tuple[float, float, float]
    misfit: float
    points: int
    settled: bool

    def __str__(self) -> str:
        """Say it in a sentence."""
        x, y, z = self.place
        said = (
            f"the cabinet is taken to stand at {x:g}, {y:g}, {z:g} m, where the cable lengths of "
            f"{self.points} points put it, within {max(self.misfit, 0.1):.1f} m for half of them"
        )
        other = "; other places fit as well as this one: give the right one if you know it"
        return said if self.settled else said + other


def find_cabinet(iolist: IoList, *, detour: float = 1.15, tails: float = 5.0) -> Found:
    """Find where the cabinet stands from home runs of known length.

    Parameters
    ----------
    iolist : IoList
        Four points or more with both a position and the length of their cable to the cabinet.
    detour, tails : float
        What was added to the square way when the lengths were made, as `Site` adds it; assumed.

    Returns
    -------
    Found
        The place, and how well the lengths agree with it.

    Raises
    ------
    ArgumentError
        If fewer than four points have both.

    Notes
    -----
    The place that most lengths agree on, by a logarithmic loss: the lengths of points that go
    another way do not move it. Points in one plane leave its mirror image open; if two coordinates
    of the cabinet lie beside all points, only their sum is known.

    Examples
    --------
    The ship of the example list:

    >>> from shipnet import datasets
    >>> from shipnet.design.iolist import load_iolist
    >>> find_cabinet(load_iolist(datasets.path("synthetic_iolist_ship.csv"))).place
    (26.0, 6.0, 14.0)
    """
    length = iolist.points["home_run_m"].to_numpy(float)
    known = np.isfinite(length) & iolist.located
    if known.sum() < _FEWEST:
        raise ArgumentError(
            f"{known.sum()} points of {iolist.source} have a position and a length to the cabinet; "
            f"it takes {_FEWEST} to find the cabinet"
        )
    places, wanted = iolist.places[known], length[known]

    def off(cabinets: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        way = np.abs(places - cabinets[..., None, :]).sum(axis=-1)
        return np.asarray(np.abs(detour * way + tails - wanted))

    # There are many low places: the best of a look all over the ship, each looked at more closely.
    centres = places.mean(axis=0, keepdims=True)
    reach, count = float(np.ptp(places, axis=0).max()) / 2 + 1.0, _FIRST
    while reach > _CLOSE:
        steps = np.stack(np.meshgrid(*3 * [np.linspace(-reach, reach, count)]), axis=-1)
        tried = (centres[:, None] + steps.reshape(-1, 3)).reshape(-1, 3)
        scale = max(reach / count, _ROUNDED)
        loss = np.log1p((off(tried) / scale) ** 2).sum(axis=-1)
        centres = tried[loss.argsort(kind="stable")[:_KEPT]]
        reach, count = reach * (2 / count), _NEXT
    centre = centres[0]
    x, y, z = (round(float(value), 1) + 0.0 for value in centre)
    place = np.array([x, y, z])
    misfits = off(place)
    # A length that goes up on one side of the cabinet and down on the other holds its coordinate.
    side = places[misfits <= max(float(np.median(misfits)), _ROUNDED)] - place
    held = ((side < -_ROUNDED).any(axis=0)) & ((side > _ROUNDED).any(axis=0))
    flat = np.ptp(places, axis=0) < _ROUNDED
    settled = bool((~held).sum() <= 1 and not (flat & ~held).any())
    return Found((x, y, z), float(np.median(misfits)), int(known.sum()), settled)
