"""Junction boxes: those that the list names, and clusters of the points that it gives none."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.design.plan.clusters import zones
from shipnet.design.plan.draft import Draft, Place

__all__ = ["Box", "boxes", "too_far", "without_place"]


class Box(NamedTuple):
    """A place where the cables of some points end.

    Attributes
    ----------
    name : str
        As the list has it, or ``"box 1"`` and so on.
    place : Place
        Where it is [m].
    rows : ndarray of int, shape (n,)
        Its points.
    lengths : ndarray, shape (n,)
        Lengths of their cables, where the list gives them [m], else NaN.
    """

    name: str
    place: Place
    rows: npt.NDArray[np.intp]
    lengths: npt.NDArray[np.float64]

    def part(self, chosen: npt.NDArray[np.intp]) -> Box:
        """Return the same box with some of its points, by their places in `rows`."""
        return self._replace(rows=self.rows[chosen], lengths=self.lengths[chosen])

    def halved(self, need: npt.NDArray[np.float64]) -> list[Box]:
        """Return two boxes here, the urgent points apart; none if there is one point.

        Parameters
        ----------
        need : ndarray of float, shape (n_points,)
            Update need of every point of the list [s].
        """
        if len(self.rows) < 2:
            return []
        order = np.argsort(need[self.rows], kind="stable")
        return [self.part(np.sort(part)) for part in np.array_split(order, 2)]


def boxes(draft: Draft, rows: npt.NDArray[np.intp]) -> list[Box]:
    r"""Return the boxes of some points; those that no box can be found for are given a reason.

    Parameters
    ----------
    draft : Draft
        With the list and its settings.
    rows : ndarray of int
        Points.

    Returns
    -------
    list of Box
        The boxes of the list in the order in which they appear, then the clusters.

    Notes
    -----
    A box whose place the list does not give stands in the middle of its points. A cable whose
    length the list gives keeps it, wherever the box is, unless the settings say that lengths are
    reckoned.

    Examples
    --------
    >>> from shipnet.design.iolist import parse_iolist
    >>> from shipnet.design.plan.settings import Settings
    >>> from shipnet.design.site import Site
    >>> text = "tag,signal,x,y,z,box\nA,contact,1,0,0,J1\nB,contact,3,0,0,\nC,rtd_3wire,5,0,0,"
    >>> draft = Draft(parse_iolist(text, "list"), Site((0, 0, 0)), Settings())
    >>> [(box.name, box.place, box.rows.tolist()) for box in boxes(draft, np.arange(3))]
    [('J1', (1.0, 0.0, 0.0), [0]), ('box 1', (4.0, 0.0, 0.0), [1, 2])]
    """
    table = draft.iolist.points
    names = table["box"].to_numpy(object)
    at_box = draft.iolist.box_places
    given = draft.given_lengths("to_box_m")
    located = draft.iolist.located
    limits = draft.settings.boxes
    found: list[Box] = []
    for name in dict.fromkeys(names[rows]):
        mine = rows[names[rows] == name]
        if name == "":
            continue
        places = at_box[mine][np.isfinite(at_box[mine]).all(axis=1)]
        if not len(places):
            places = draft.places[mine][located[mine]]
        reached = (np.isfinite(given[mine]) | located[mine]) if len(places) else False
        reached = np.broadcast_to(reached, len(mine))
        without_place(draft, mine[~reached])
        if reached.any():
            found.append(_box(str(name), places, mine[reached], given[mine[reached]]))
    loose = rows[names[rows] == ""]
    without_place(draft, loose[~located[loose]])
    loose = loose[located[loose]]
    labels = zones(draft.places[loose], reach=limits.reach, most=limits.points)
    for number in range(labels.max(initial=-1) + 1):
        mine = loose[labels == number]
        nothing = np.full(len(mine), np.nan)
        found.append(_box(f"box {number + 1}", draft.places[mine], mine, nothing))
    return found


def without_place(draft: Draft, rows: npt.NDArray[np.intp]) -> None:
    r"""Give points the reason that their place is not known.

    Parameters
    ----------
    draft : Draft
        Where the reasons are put down.
    rows : ndarray of int
        Points.

    Examples
    --------
    >>> from shipnet.design.iolist import parse_iolist
    >>> from shipnet.design.plan.settings import Settings
    >>> from shipnet.design.site import Site
    >>> iolist = parse_iolist("tag,signal,home_run_m\nA,contact,30", "list")
    >>> draft = Draft(iolist, Site((0, 0, 0)), Settings())
    >>> without_place(draft, np.array([0]))
    >>> draft.network("empty").reasons["text"].tolist()
    ['the list gives no place for A, so that nothing can be put near it']
    """
    for row in rows:
        tag = draft.tags[row]
        text = f"the list gives no place for {tag}, so that nothing can be put near it"
        draft.reason(tag, "place", np.nan, np.nan, "m", text)


def too_far(draft: Draft, box: Box, away: float, longest: float, most: str) -> None:
    r"""Give the points of a box the reason that no trunk reaches it.

    Parameters
    ----------
    draft : Draft
        Where the reasons are put down.
    box : Box
        Its points.
    away, longest : float
        Trunk to it, and the longest that the bus has [m].
    most : str
        What the bus has, with a place for `longest`.

    Examples
    --------
    >>> from shipnet.design.iolist import parse_iolist
    >>> from shipnet.design.plan.settings import Settings
    >>> from shipnet.design.site import Site
    >>> iolist = parse_iolist("tag,signal,x,y,z\nA,contact,900,0,0", "list")
    >>> draft = Draft(iolist, Site((0, 0, 0)), Settings())
    >>> too_far(draft, boxes(draft, np.array([0]))[0], 1043, 1000, "a bus has at most {:g} m")
    >>> draft.network("empty").reasons["text"].tolist()
    ['A is 1043 m of trunk away; a bus has at most 1000 m']
    """
    for row in box.rows:
        tag = draft.tags[row]
        text = f"{tag} is {away:.0f} m of trunk away; {most.format(longest)}"
        draft.reason(tag, "length", away, longest, "m", text)


def _box(
    name: str,
    places: npt.NDArray[np.float64],
    rows: npt.NDArray[np.intp],
    lengths: npt.NDArray[np.float64],
) -> Box:
    x, y, z = (float(value) for value in np.median(places, axis=0))
    return Box(name, (x, y, z), rows, lengths)
