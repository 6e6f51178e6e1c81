"""A network in the making: what planners put down, and the ways that follow when all is there."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.design.catalogue import smallest
from shipnet.design.network import COLUMNS, Network, frame
from shipnet.design.plan.settings import Settings
from shipnet.design.signals import SIGNALS

if TYPE_CHECKING:
    import pandas as pd

    from shipnet.design.catalogue import Cable
    from shipnet.design.iolist import IoList
    from shipnet.design.site import Site

__all__ = ["Draft", "Laid", "Place"]

Place = tuple[float, float, float]
Floats = npt.NDArray[np.float64]


class Laid(NamedTuple):
    """How a cable gets its length, beside its ends.

    Attributes
    ----------
    start, end : Place
        Where it begins and ends [m].
    length : float
        Its length where the list gives it [m], else NaN.
    slack : float
        What is added to the way [m]; NaN for the tails of the site.
    share : float
        Share of the way between both ends that is this cable's, where a repeater cuts it.
    avoid : frozenset of str
        Trays that it uses only where there is no other way.
    """

    start: Place
    end: Place
    length: float = np.nan
    slack: float = np.nan
    share: float = 1.0
    avoid: frozenset[str] = frozenset()


@dataclass(eq=False)
class Draft:
    """A network in the making.

    Parameters
    ----------
    iolist : IoList
        The points.
    site : Site
        Cabinet and ways.
    settings : Settings
        Limits.

    Attributes
    ----------
    places : ndarray, shape (n_points, 3)
        Where each point is [m]; NaN if the list does not say.
    need : ndarray, shape (n_points,)
        Update need of each point [s]; that of the settings where the list names none.
    wires : ndarray of int, shape (n_points,)
        Conductors of a cable of each point's own, its common return included.
    common : ndarray of int, shape (n_points,)
        Conductors of them that points of the same kind can share.
    types, tags : list of str
        Columns of the list.
    middle : Place
        Where the cabinet is [m].
    cabinet : str
        Its name among the devices.
    """

    iolist: IoList
    site: Site
    settings: Settings

    def __post_init__(self) -> None:
        """Take what every planner asks for from the list, and put the cabinet down."""
        points = self.iolist.points
        n = len(points)
        self.places: Floats = self.iolist.places
        self.need: Floats = points["update_ms"].to_numpy(np.float64) / 1e3
        self.need = np.where(np.isnan(self.need), self.settings.update, self.need)
        self.common = np.array([SIGNALS[str(s)].common for s in points["signal"]], dtype=np.int64)
        self.wires = points["conductors"].to_numpy(np.int64) + self.common
        self.types: list[str] = points["type"].tolist()
        self.tags: list[str] = points["tag"].tolist()
        self._point: dict[str, npt.NDArray[Any]] = {
            name: np.full(n, "", dtype=object) for name in ("bus", "segment", "device", "address")
        }
        self._response = np.full(n, np.nan)
        self._taken = set(self.tags)
        self._in_cabinet: set[str] = set()
        self._rows: dict[str, list[dict[str, Any]]] = {name: [] for name in COLUMNS}
        self.middle: Place = tuple(float(x) for x in self.site.cabinet)  # type: ignore[assignment]
        self.cabinet = self.device("cabinet", "cabinet", "", self.middle)
        self._in_cabinet.add(self.cabinet)

    def device(self, name: str, kind: str, segment: str, place: Place, at: str = "") -> str:
        """Put down a device, and return its name, which gets a number if it is taken."""
        free, number = name, 1
        while free in self._taken:
            number += 1
            free = f"{name} ({number})"
        self._taken.add(free)
        if at and at in self._in_cabinet:
            self._in_cabinet.add(free)
        x, y, z = place
        self._rows["devices"].append(
            {"device": free, "kind": kind, "segment": segment, "x_m": x, "y_m": y, "z_m": z,
             "at": at}
        )  # fmt: skip
        return free

    def run(
        self,
        kind: str,
        ends: tuple[str, str],
        laid: Laid,
        cable: Cable,
        used: int,
        segment: str = "",
        line: str = "",
    ) -> None:
        """Put down a cable."""
        a, b = ends
        self._rows["runs"].append(
            {"run": f"{kind} {len(self._rows['runs']) + 1}", "cable": cable.id, "a": a, "b": b,
             "segment": segment, "kind": kind, "used": used, "conductors": cable.conductors,
             "at_cabinet": a in self._in_cabinet or b in self._in_cabinet, "line": line,
             **laid._asdict()}
        )  # fmt: skip

    def given_lengths(self, column: str) -> Floats:
        """Return the lengths that the list gives in a column [m]; NaN where they are reckoned."""
        lengths = self.iolist.points[column].to_numpy(np.float64, copy=True)
        if not self.settings.list_lengths:
            lengths[self.iolist.located] = np.nan
        return lengths

    def drop(self, row: int, device: str, place: Place, segment: str, length: float) -> None:
        """Put down the cable of a point to its device."""
        wires = int(self.wires[row])
        laid = Laid(place, _place(self.places[row]), length)
        cable = smallest(wires, spare=0)
        self.run("drop", (device, self.tags[row]), laid, cable, wires, segment)

    def connect(
        self, row: int, bus: str, segment: str, device: str, address: str, response: float
    ) -> None:
        """Say how a point is connected, and how late the host knows of it [s]."""
        values = zip(
            ("bus", "segment", "device", "address"), (bus, segment, device, address), strict=True
        )
        for name, value in values:
            self._point[name][row] = value
        self._response[row] = response

    def segment(self, **columns: Any) -> None:
        """Put down a segment."""
        self._rows["segments"].append(columns)

    def reason(
        self, subject: str, limit: str, value: float, bound: float, unit: str, text: str
    ) -> None:
        """Say why something does not fit."""
        self._rows["reasons"].append(
            {"subject": subject, "limit": limit, "value": value, "bound": bound, "unit": unit,
             "text": text}
        )  # fmt: skip

    def network(self, name: str) -> Network:
        """Return the network, with all ways and lengths worked out."""
        points = frame(
            "points",
            {"tag": self.tags, **self._point, "response_ms": self._response * 1e3,
             "fits": self._point["bus"] != ""},
        )  # fmt: skip
        tables = {t: frame(t, self._rows[t]) for t in ("devices", "segments", "reasons")}
        return Network(name, self.iolist, self.site, points, runs=self._runs(), **tables)

    def _runs(self) -> pd.DataFrame:
        import pandas as pd

        rows = self._rows["runs"]
        if not rows:
            return frame("runs")
        runs = pd.DataFrame(rows).drop(columns=["start", "end"])
        start, end = (
            np.array([row[at] for row in rows], dtype=np.float64) for at in ("start", "end")
        )
        known = np.isfinite(start).all(axis=1) & np.isfinite(end).all(axis=1)
        route = np.full(len(rows), np.nan)
        length = runs["length"].to_numpy(np.float64, copy=True)
        ways: list[tuple[str, ...]] = [()] * len(rows)
        share = runs["share"].to_numpy(np.float64)
        for avoid in dict.fromkeys(row["avoid"] for row in rows):
            mine = np.flatnonzero(known & np.array([row["avoid"] == avoid for row in rows]))
            for row, way in zip(
                mine, self.site.ways(start[mine], end[mine], avoid=avoid), strict=True
            ):
                ways[row] = way
            asked = mine[np.isnan(length[mine])]
            route[asked] = self.site.route(start[asked], end[asked], avoid=avoid) * share[asked]
        slack = runs["slack"].to_numpy(np.float64)
        open_ = np.isnan(length)
        length[open_] = np.where(
            np.isnan(slack[open_]),
            self.site.length(route[open_]),
            self.site.detour * route[open_] + np.nan_to_num(slack[open_]),
        )
        return frame(
            "runs",
            runs.assign(route_m=route, length_m=length, way=pd.Series(ways, dtype=object))[
                list(COLUMNS["runs"])
            ],
        )


def _place(xyz: Floats) -> Place:
    x, y, z = (float(value) for value in xyz)
    return x, y, z
