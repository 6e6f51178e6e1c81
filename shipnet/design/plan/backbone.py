"""The trunk of a segment whose stations sit along one cable: its order, its second line, its ends.

CAN and Modbus RTU share it.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.design.catalogue import cables
from shipnet.design.plan.boxes import Box
from shipnet.design.plan.draft import Draft, Laid
from shipnet.design.plan.trunks import chain

__all__ = ["PAIR", "Backbone", "lay", "route_past"]

#: Conductors of the bus itself; a screen is none.
PAIR = 2


class Backbone(NamedTuple):
    """The way of a trunk past its stations.

    Attributes
    ----------
    order : list of int
        Places of the stations in what was given, the first one behind the cabinet first.
    hops : ndarray, shape (n,)
        Cable to each of them from the one before [m]; of the longer line if there are two.
    avoid : frozenset of str
        Trays of the first line, which the second keeps away from where it can.
    """

    order: list[int]
    hops: npt.NDArray[np.float64]
    avoid: frozenset[str]

    @property
    def length(self) -> float:
        """All of its cable [m]."""
        return float(self.hops.sum())


def route_past(draft: Draft, stations: Sequence[Box]) -> Backbone:
    r"""Find the way of a trunk from the cabinet past all stations.

    Parameters
    ----------
    draft : Draft
        With the site; its settings say whether there are two lines.
    stations : sequence of Box
        Stations, one or more.

    Returns
    -------
    Backbone
        Both lines go past the stations in the same order.

    Examples
    --------
    >>> from shipnet.design.iolist import parse_iolist
    >>> from shipnet.design.plan.settings import Settings
    >>> from shipnet.design.site import Site
    >>> iolist = parse_iolist("tag,signal,x,y,z\nA,contact,1,0,0")
    >>> draft = Draft(iolist, Site((0, 0, 0)), Settings())
    >>> stations = [Box(str(x), (x, 0, 0), np.array([0]), np.array([np.nan])) for x in (30.0, 10.0)]
    >>> trunk = route_past(draft, stations)
    >>> trunk.order, trunk.hops.tolist()
    ([1, 0], [16.5, 28.0])
    """
    places = np.array([draft.middle, *(station.place for station in stations)])
    order = chain(draft.site.route(places[:, None], places[None, :]))
    along = places[order]
    routes = draft.site.route(along[:-1], along[1:])
    avoid: frozenset[str] = frozenset()
    if draft.settings.redundant:
        ways = draft.site.ways(along[:-1], along[1:])
        avoid = frozenset(tray for way in ways for tray in way)
        routes = np.maximum(routes, draft.site.route(along[:-1], along[1:], avoid=avoid))
    return Backbone([place - 1 for place in order[1:]], draft.site.length(routes), avoid)


def lay(
    draft: Draft,
    segment: str,
    bus: str,
    stations: Sequence[Box],
    trunk: Backbone,
    cable: str,
    repeaters: Sequence[int] = (),
) -> list[str]:
    r"""Put down masters, stations, trunk cables, feeders, terminators and repeaters of a segment.

    Parameters
    ----------
    draft : Draft
        Where they are put down.
    segment, bus : str
        Names; the devices are called after them.
    stations : sequence of Box
        Stations in the order of the trunk.
    trunk : Backbone
        Its way.
    cable : str
        Its cable, a key of the catalogue.
    repeaters : sequence of int, optional
        Stations behind which a repeater stands, in their housing, by their places.

    Returns
    -------
    list of str
        Names of the stations, in the same order.

    Examples
    --------
    >>> from shipnet.design.iolist import parse_iolist
    >>> from shipnet.design.plan.settings import Settings
    >>> from shipnet.design.site import Site
    >>> iolist = parse_iolist("tag,signal,x,y,z\nA,contact,1,0,0")
    >>> draft = Draft(iolist, Site((0, 0, 0)), Settings())
    >>> station = Box("J1", (30.0, 0.0, 0.0), np.array([0]), np.array([np.nan]))
    >>> lay(draft, "CAN 1", "CAN", [station], route_past(draft, [station]), "CAN_5_0p75")
    ['CAN J1']
    """
    names = [draft.device(f"{bus} {box.name}", "station", segment, box.place) for box in stations]
    places = [draft.middle, *(box.place for box in stations)]
    for line in ("A", "B") if draft.settings.redundant else ("",):
        of_line = f" {line}" if line else ""
        avoid = trunk.avoid if line == "B" else frozenset[str]()
        housing = draft.cabinet
        master = draft.device(
            f"{segment} master{of_line}", "master", segment, draft.middle, housing
        )
        ends = [master, *names]
        # A cable leaves a station through its repeater if it has one.
        leaving = {
            place + 1: draft.device(
                f"{names[place]} repeater{of_line}",
                "repeater",
                segment,
                places[place + 1],
                names[place],
            )
            for place in repeaters
        }
        for hop, (near, far) in enumerate(pairwise(places)):
            laid = Laid(near, far, avoid=avoid)
            run = leaving.get(hop, ends[hop]), ends[hop + 1]
            draft.run("trunk", run, laid, cables()[cable], PAIR, segment, line)
        _end(draft, segment, of_line, master, names[-1], places)
        if draft.settings.fed:
            _feed(draft, segment, line, names, places, avoid)
    return names


def _end(
    draft: Draft,
    segment: str,
    of_line: str,
    master: str,
    last: str,
    places: Sequence[tuple[float, float, float]],
) -> None:
    for number, (at, place) in enumerate([(master, places[0]), (last, places[-1])], 1):
        draft.device(f"{segment} terminator {number}{of_line}", "terminator", segment, place, at)


def _feed(
    draft: Draft,
    segment: str,
    line: str,
    names: Sequence[str],
    places: Sequence[tuple[float, float, float]],
    avoid: frozenset[str],
) -> None:
    of_line = f" {line}" if line else ""
    supply = draft.device(f"{segment} supply{of_line}", "supply", segment, places[0], draft.cabinet)
    feeder = cables()[draft.settings.feeder]
    for (near, far), run in zip(pairwise(places), pairwise([supply, *names]), strict=True):
        draft.run("feeder", run, Laid(near, far, avoid=avoid), feeder, PAIR, segment, line)
