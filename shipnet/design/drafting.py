"""Parts that all planners share: drafts of designs, boxes, clusters of places, and trunks."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import count, pairwise
from math import ceil, inf
from typing import Any, NamedTuple, TypeVar

import numpy as np
import numpy.typing as npt
from scipy.cluster.hierarchy import fcluster, linkage
from scipy.sparse.csgraph import depth_first_order, minimum_spanning_tree
from scipy.spatial.distance import cdist

from shipnet.arrays import Bools, Floats, Indices
from shipnet.design.catalogue import Cable, cables, smallest
from shipnet.design.designs import Design
from shipnet.design.layout import COLUMNS, Layout, Site, Strip, frame
from shipnet.design.points import PointTable
from shipnet.design.revision import Kept, joined, with_names
from shipnet.design.settings import Settings
from shipnet.design.supply import Feeders, sized
from shipnet.lazy import pd
from shipnet.signals import SIGNALS

# Clusters of places: within reach, of equal size, or within limits -----------------------------

#: Maximum number of places clustered at once; the distances between more need too much memory.
_MOST = 3000

#: Maximum number of items divided into equal groups at once; more would take too long.
_MANY = 1000

#: Maximum number of times that the centres are moved; the assignments soon converge.
_ROUNDS = 20

Item = TypeVar("Item")
Result = TypeVar("Result")


def zones(xyz: Floats, *, reach: float, most: int) -> Indices:
    """Return the cluster of each place (n, 3): up to `most` places, none over `reach` [m] apart."""
    return _zones(np.asarray(xyz, float).tobytes(), reach, most).copy()


@lru_cache(maxsize=32)  # every option with boxes needs the same zones
def _zones(places: bytes, reach: float, most: int) -> Indices:
    xyz = np.frombuffer(places).reshape(-1, 3)
    if len(xyz) > _MOST:
        upper = _halves(xyz)
        labels = np.empty(len(xyz), dtype=np.intp)
        low, high = (zones(xyz[side], reach=reach, most=most) for side in (~upper, upper))
        labels[~upper], labels[upper] = low, high + low.max() + 1
        return _renumbered(labels)
    if len(xyz) < 2:
        return np.zeros(len(xyz), dtype=np.intp)
    tree = linkage(xyz, "complete", "cityblock")
    # The excess never decreases towards the root, so the tree is cut where it becomes positive.
    excess = np.maximum(tree[:, 2] - reach, (tree[:, 3] > most).astype(float))
    return _renumbered(fcluster(tree, 1e-9, "monocrit", monocrit=excess).astype(np.intp))


def balanced(
    xyz: Floats, groups: int, *, kinds: npt.ArrayLike = 0, most: Sequence[int] = ()
) -> Indices:
    """Divide places into compact groups, nearly equal or with up to `most[k]` of each kind k."""
    from scipy.optimize import linear_sum_assignment  # slow to load, and few plans need it

    if groups == 1 or len(xyz) < 2:
        return np.zeros(len(xyz), dtype=np.intp)
    kind = np.broadcast_to(np.asarray(kinds, dtype=np.intp), len(xyz))
    room = most or [ceil(count / groups) for count in np.bincount(kind)]
    # The first centres divide the places equally along the longest axis through them.
    middle = xyz - xyz.mean(axis=0)
    extent = np.linalg.svd(middle, full_matrices=False)[2][0]
    order = np.argsort(middle @ extent, kind="stable")
    centres = np.tile(xyz[order[-1]], (groups, 1))
    sizes = [len(chunk) for chunk in np.array_split(order, groups)]
    used, at = medians(xyz[order], np.repeat(np.arange(groups), sizes))
    centres[used] = at
    labels = np.full(len(xyz), -1, dtype=np.intp)
    for _ in range(_ROUNDS):
        away = cdist(xyz, centres, "cityblock")
        moved = np.empty_like(labels)
        for number, seats in enumerate(room):
            of_kind = np.flatnonzero(kind == number)
            at, seat = linear_sum_assignment(np.repeat(away[of_kind], seats, axis=1))
            moved[of_kind[at]] = seat // max(seats, 1)
        if (moved == labels).all():
            break
        labels = moved
        used, centres_of = medians(xyz, labels)
        centres[used] = centres_of
    return _renumbered(labels)


def medians(xyz: Floats, labels: Indices) -> tuple[Indices, Floats]:
    """Return the labels in use, and the median position (n, 3) of the places with each label."""
    used, count = np.unique(labels, return_counts=True)
    end = np.cumsum(count)
    low, high = end - count + (count - 1) // 2, end - count + count // 2
    middle = np.empty((len(used), xyz.shape[1]))
    for axis, along in enumerate(xyz.T):
        ordered = along[np.lexsort((along, labels))]
        middle[:, axis] = (ordered[low] + ordered[high]) / 2
    return used, middle


def divided(
    items: Sequence[Item],
    position: Callable[[Item], Sequence[float]],
    judge: Callable[[Sequence[Item]], tuple[Result, float]],
    halve: Callable[[Item], Sequence[Item]] | None = None,
    segment: Callable[[Item], str] = lambda item: "",
) -> list[tuple[list[Item], Result]]:
    """Divide items into groups until each meets its limits or cannot be divided further.

    The first groups are those of items that keep a `segment` of an earlier design.
    """
    waiting = joined(items, segment, position)
    done = []
    while waiting:
        group = waiting.pop(0)
        result, parts = judge(group)
        pieces: list[list[Item]] = []
        if parts > 1 and len(group) > 1:
            xyz = np.array([position(item) for item in group], dtype=float)
            if len(group) > _MANY:
                labels = _halves(xyz).astype(np.intp)
            elif parts < inf:
                labels = balanced(xyz, min(ceil(parts), len(group)))
            else:
                tree = linkage(xyz, "complete", "cityblock")
                labels = fcluster(tree, 2, "maxclust").astype(np.intp)
                if labels.min() == labels.max():  # all in one place: in two groups alternately
                    labels = np.arange(len(group)) % 2
            pieces = [
                [item for item, label in zip(group, labels, strict=True) if label == number]
                for number in dict.fromkeys(labels.tolist())
            ]
        elif parts > 1 and halve is not None:
            pieces = [[piece] for piece in halve(group[0])]
        if not pieces:
            done.append((group, result))
        waiting = pieces + waiting
    return done


def _halves(xyz: Floats) -> Bools:
    along = xyz[:, np.ptp(xyz, axis=0).argmax()]
    upper = np.zeros(len(xyz), dtype=np.bool_)
    upper[np.argsort(along, kind="stable")[len(xyz) // 2 :]] = True
    return upper


def _renumbered(labels: Indices) -> Indices:
    _, first, inverse = np.unique(labels, return_index=True, return_inverse=True)
    return np.asarray(np.argsort(np.argsort(first))[inverse], dtype=np.intp)


# The route of a trunk past its devices: a tree, or a chain --------------------------------------

#: Length added to distances [m], because scipy treats a distance below 1e-8 as no edge.
_APART = 1e-6


def tree(away: Floats) -> list[tuple[int, int]]:
    """Return the edges of the shortest branching trunk, the minimum spanning tree."""
    if len(away) < 2:
        return []
    spanning = minimum_spanning_tree(away + _APART)
    order, before = depth_first_order(spanning, 0, directed=False)
    return [(int(before[node]), int(node)) for node in order[1:]]


def chain(away: Floats) -> list[int]:
    """Return an order of the devices in which a trunk past all of them is short."""
    n = len(away)
    if n < 3:
        return list(range(n))
    onward: list[list[int]] = [[] for _ in range(n)]
    below = np.ones(n, dtype=np.intp)
    edges = tree(away)
    for near, far in edges:
        onward[near].append(far)
    for near, far in reversed(edges):
        below[near] += below[far]
    walk, waiting = list[int](), [0]
    while waiting:
        walk.append(waiting.pop())
        # The largest branch comes last, because the route does not return from the last branch.
        waiting += sorted(onward[walk[-1]], key=lambda other: -below[other])
    # An extra place at zero distance from all others lets the chain end anywhere.
    order = np.append(walk, n)
    padded = np.zeros((n + 1, n + 1))
    padded[:n, :n] = away
    first, last = (1 + ends for ends in np.triu_indices(n - 1, 0))
    while True:
        before, a, b, behind = order[first - 1], order[first], order[last], order[last + 1]
        change = padded[before, b] + padded[a, behind] - padded[before, a] - padded[b, behind]
        best = int(change.argmin())
        if change[best] > -1e-6:
            return [int(node) for node in order[:-1]]
        start, end = first[best], last[best] + 1
        order[start:end] = order[start:end][::-1].copy()


# A draft: planners add devices and cables; routes and feeders follow at the end -----------------

Place = tuple[float, float, float]


class Laid(NamedTuple):
    """Ends of a route, and the cable's length [m], or NaN and the fraction the cable covers."""

    start: Place
    end: Place
    share: float = 1.0
    length: float = np.nan


@dataclass(eq=False)
class Draft:
    """A design under construction."""

    iolist: PointTable
    site: Site
    settings: Settings
    #: Longest response that the rules allow for each point [s].
    longest: Floats | float = inf
    #: Earlier design whose boxes, channels and cables are kept.
    previous: Layout | None = None

    def __post_init__(self) -> None:
        points = self.iolist.points
        self.kept = Kept(self.iolist, self.previous)
        #: Points on each trunk of a box; see `Layout.strips`.
        self.strips: dict[str, Strip] = {}
        n = len(points)
        self.places: Floats = self.iolist.places
        #: Positions of the points as tuples.
        self.spots: list[Place] = list(map(tuple, self.places.tolist()))
        need = points["update_ms"].fillna(1e3 * self.settings.update).to_numpy(float) / 1e3
        self.need: Floats = np.minimum(need, self.longest)
        self.signals = points["signal"].to_numpy(object)
        self.common = np.array([SIGNALS[signal].common for signal in self.signals], dtype=np.int64)
        self.wires = points["conductors"].to_numpy(np.int64) + self.common
        self.types: list[str] = points["type"].tolist()
        self.tags: list[str] = points["tag"].tolist()
        texts = ("bus", "segment", "device", "address")
        self._point: dict[str, npt.NDArray[Any]] = {name: np.full(n, "", object) for name in texts}
        self._point["response_ms"] = np.full(n, np.nan)
        self._taken = set(self.tags)
        self._numbers: Counter[tuple[str, str]] = Counter()
        self.in_cabinet: set[str] = set()
        self._rows: dict[str, list[dict[str, Any]]] = {name: [] for name in COLUMNS}
        self.middle: Place = tuple(float(x) for x in self.site.cabinet)  # type: ignore[assignment]
        self.cabinet = self.device("cabinet", "cabinet", "", self.middle)
        self.in_cabinet.add(self.cabinet)

    def device(
        self, name: str, kind: str, segment: str, place: Place, at: str = "", line: str = ""
    ) -> str:
        """Add a device, and return its name, with a number if the name is taken."""
        free = self._free(name)
        if at and at in self.in_cabinet:
            self.in_cabinet.add(free)
        x, y, z = place
        row = {"device": free, "kind": kind, "segment": segment, "at": at, "line": line}
        self._rows["devices"].append({**row, "x_m": x, "y_m": y, "z_m": z})
        return free

    def _free(self, name: str) -> str:
        """Reserve a name, with a number if it is taken already, and return it."""
        free, number = name, 1
        while free in self._taken:
            number += 1
            free = f"{name} ({number})"
        self._taken.add(free)
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
    ) -> str:
        """Add a cable, named after its point, or numbered within its segment or box."""
        a, b = ends
        suffix = f" {line}" if line else ""
        name = f"{kind} {b}{suffix}"
        if kind in ("trunk", "feeder"):
            of = f"{segment or b} {kind}"
            self._numbers[of, line] += 1
            name = f"{of} {self._numbers[of, line]}{suffix}"
        row: dict[str, Any] = {"run": self._free(name), "cable": cable.id, "a": a, "b": b}
        row |= {"segment": segment, "kind": kind, "line": line}
        row |= {"used": used, "conductors": cable.conductors}
        row["at_cabinet"] = not self.in_cabinet.isdisjoint(ends)
        self._rows["cables"].append({**row, **laid._asdict()})
        return str(row["run"])

    def given_lengths(self, column: str) -> Floats:
        """Return the lengths given in a column of the list [m]; NaN where they must be computed."""
        lengths = self.iolist.points[column].to_numpy(np.float64, copy=True)
        if not self.settings.list_lengths:
            lengths[self.iolist.located] = np.nan
        return lengths

    def drop(
        self, row: int, device: str, place: Place, segment: str, length: float, line: str = ""
    ) -> None:
        """Add the cable from a device to a point."""
        wires = int(self.wires[row])
        laid = Laid(place, self.spots[row], length=length)
        cable = smallest(wires, spare=0)
        self.run("drop", (device, self.tags[row]), laid, cable, wires, segment, line)

    def connect(
        self, row: int, bus: str, segment: str, device: str, address: str, response: float
    ) -> None:
        """Record how a point is connected, with its response time [s]."""
        values = bus, segment, device, address, 1e3 * response
        for column, value in zip(self._point.values(), values, strict=True):
            column[row] = value

    def segments(self, bus: str) -> int:
        """Return the number of segments of a bus so far."""
        return sum(row["bus"] == bus for row in self._rows["segments"])

    def segment(self, rows: Indices, **columns: Any) -> None:
        """Add a segment, with the response and update time of the point nearest to its limit."""
        late = self._point["response_ms"][rows]
        near = (late / self.need[rows]).argmax()
        row = {"points": len(rows), "response_ms": late[near]}
        row["slowest_update_ms"] = 1e3 * self.need[rows[near]]
        self._rows["segments"].append({**row, **columns})

    def reason(
        self, subject: str, limit: str, value: float, bound: float, unit: str, text: str
    ) -> None:
        """Record why a point or a cable does not fit."""
        row = {"subject": subject, "limit": limit, "value": value, "bound": bound, "unit": unit}
        self._rows["reasons"].append({**row, "text": text})

    def too_slow(self, row: int, least: float, words: str) -> None:
        """Record that a point needs an update time below `least` [s], the shortest possible."""
        tag, needed = self.tags[row], 1e3 * float(self.need[row])
        text = f"{tag} needs an update every {needed:g} ms; {words} {1e3 * least:.3g} ms"
        self.reason(tag, "update", 1e3 * least, needed, "ms", text)

    def made(self, name: str) -> Design:
        """Return the design, with all routes and lengths."""
        on_bus = ~np.isin(self._point["bus"], ["", "hardwired"])
        columns = {"tag": self.tags, **self._point, "fits": self._point["bus"] != ""}
        # Rounded to a nanosecond, because a rule's limit is reduced by less.
        columns["planned_update_ms"] = np.where(on_bus, (1e3 * self.need).round(6), np.nan)
        points = frame("points", columns)
        runs = self._runs(self._rows["cables"])
        devices, segments, reasons = (
            frame(t, self._rows[t]) for t in ("devices", "segments", "reasons")
        )
        tables = points, devices, runs, segments, reasons, self.settings
        laid = Design(name, self.iolist, self.site, *tables, previous=self.previous)
        feeders = sized(laid)
        if feeders.cable:
            runs = self._feed(runs, feeders)
            points["fits"] &= ~points["device"].isin([weak[0] for weak in feeders.weak])
            devices, reasons = (frame(t, self._rows[t]) for t in ("devices", "reasons"))
            laid = replace(laid, points=points, devices=devices, cables=runs, reasons=reasons)
        runs = with_names(laid.cables, self.previous)
        names = dict(zip(laid.cables["run"], runs["run"], strict=True))
        strips = {names[name]: strip for name, strip in self.strips.items()}
        return replace(laid, cables=runs, strips=strips)

    def _feed(self, runs: pd.DataFrame, feeders: Feeders) -> pd.DataFrame:
        """Return the cables with sized feeders, and add the required supplies."""
        rows, types = self._rows["cables"], cables()
        idle, old = set(feeders.idle), len(rows)
        for number, cable in feeders.cable.items():
            rows[number] |= {"cable": cable, "conductors": types[cable].conductors}
        for number, supply in feeders.own.items():
            row, entry = rows[number], self._rows["devices"][supply]
            name, (x, y, z) = entry["device"], row["end"]
            if supply in idle:  # the idle supply moves to the device
                idle.remove(supply)
                entry |= {"x_m": x, "y_m": y, "z_m": z, "at": ""}
                self.in_cabinet.discard(name)
            else:
                kind, segment, line = entry["kind"], row["segment"], row["line"]
                name = self.device(name, kind, segment, row["end"], line=line)
            row |= {"a": name, "start": row["end"], "at_cabinet": False}
            if self.settings.fed:
                laid = Laid(self.middle, row["end"])
                ends, mains = (self.cabinet, name), types[self.settings.feeder]
                self.run("feeder", ends, laid, mains, PAIR, row["segment"], row["line"])
        for device, value, bound, unit in feeders.weak:
            verb = "draws" if unit == "A" else "gets"
            text = f"{device} {verb} {value:.3g} {unit} from a supply beside it; the limit is "
            self.reason(device, "supply", value, bound, unit, f"{text}{bound:.3g} {unit}")
        for column in ("cable", "conductors"):
            runs[column] = [row[column] for row in rows[:old]]
        near = list(feeders.own)
        fresh = self._runs([*(rows[number] for number in near), *rows[old:]])
        return pd.concat([runs.drop(index=near), fresh], ignore_index=True) if near else runs

    def _runs(self, rows: Sequence[dict[str, Any]]) -> pd.DataFrame:
        if not rows:
            return frame("cables")
        start, end, share, listed = (
            np.array([row[name] for row in rows], dtype=float) for name in Laid._fields
        )
        route = np.where(np.isnan(listed), self.site.route(start, end) * share, np.nan)
        computed = self.site.detour * route + self.site.tails * share
        lengths = {"route_m": route, "length_m": np.where(np.isnan(listed), computed, listed)}
        named = [name for name in COLUMNS["cables"] if name not in lengths]
        return frame("cables", {name: [row[name] for row in rows] for name in named} | lengths)


# Junction boxes: boxes named in the list, and clusters of all other points ----------------------


class Box(NamedTuple):
    """A junction box or station, where the cables of some points end."""

    name: str
    place: Place
    rows: Indices
    lengths: Floats
    #: Segment that the box keeps, or "".
    segment: str = ""

    @classmethod
    def at(cls, name: str, places: Floats, rows: Indices, lengths: Floats) -> Box:
        """Return a box at the median of some places."""
        x, y, z = np.median(places, axis=0).tolist()
        return cls(name, (x, y, z), rows, lengths)

    def part(self, chosen: Indices) -> Box:
        """Return the box with only some of its points, given by their indices in `rows`."""
        return self._replace(rows=self.rows[chosen], lengths=self.lengths[chosen])

    def halved(self, need: Floats) -> list[Box]:
        """Return two boxes, one with the more urgent points; none if the box has a single point."""
        if len(self.rows) < 2:
            return []
        order = np.argsort(need[self.rows], kind="stable")
        return [self.part(np.sort(part)) for part in np.array_split(order, 2)]


def boxes(draft: Draft, rows: Indices, prefix: str = "") -> list[Box]:
    """Return the boxes of some points, and record a reason for each point without a box.

    The names of kept devices begin with the `prefix`, which is not part of a box's name.
    """
    table = draft.iolist.points
    names = table["box"].to_numpy(object)
    at_box = draft.iolist.box_places
    listed = draft.given_lengths("to_box_m")
    located = draft.iolist.located
    limits = draft.settings.boxes
    made: list[Box] = []
    for name in filter(None, dict.fromkeys(names[rows])):
        inside = rows[names[rows] == name]
        places = at_box[inside][np.isfinite(at_box[inside]).all(axis=1)]
        if not len(places):
            places = draft.places[inside][located[inside]]
        reached = (np.isfinite(listed[inside]) | located[inside]) & (len(places) > 0)
        without_place(draft, inside[~reached])
        if reached.any():
            made.append(Box.at(str(name), places, inside[reached], listed[inside[reached]]))
    loose = rows[names[rows] == ""]
    without_place(draft, loose[~located[loose]])
    loose = loose[located[loose]]
    groups = draft.kept.groups(loose.tolist(), "station" if prefix else "box", prefix)
    for row in sorted({*loose.tolist()}.difference(*groups.values())):
        near = [
            (float(away[-1]), number)
            for number, inside in enumerate(groups.values())
            for away in [np.sort(draft.site.route(draft.places[inside], draft.places[row]))]
            if len(inside) < limits.points and away[-1] <= limits.reach
        ]
        if near:
            [*groups.values()][min(near)[1]].append(row)
    for device in sorted(groups, key=lambda device: (len(device.name), device.name)):
        members = groups[device]
        name = device.name.removeprefix(prefix)
        lengths = np.full(len(members), np.nan)
        made.append(Box(name, device.place, np.array(members), lengths, device.segment))
    loose = loose[~np.isin(loose, [row for members in groups.values() for row in members])]
    labels = zones(draft.places[loose], reach=limits.reach, most=limits.points)
    free = (name for n in count(1) if prefix + (name := f"box {n}") not in draft.kept.devices)
    for number in range(labels.max(initial=-1) + 1):
        inside = loose[labels == number]
        lengths = np.full(len(inside), np.nan)
        made.append(Box.at(next(free), draft.places[inside], inside, lengths))
    return made


def without_place(draft: Draft, rows: Indices) -> None:
    """Record that the positions of points are unknown."""
    for row in rows:
        tag = draft.tags[row]
        text = f"the list gives no position for {tag}, so no device can be placed near it"
        draft.reason(tag, "place", np.nan, np.nan, "m", text)


# The trunk of a segment: the order of its stations, its second line, and its ends ---------------

#: Number of conductors of a bus or a feeder, without the screen.
PAIR = 2


class Backbone(NamedTuple):
    """The route of a trunk past its stations: their order, and the length of each hop [m]."""

    order: list[int]
    hops: Floats

    @property
    def length(self) -> float:
        """Length of the trunk cable [m]."""
        return float(self.hops.sum())


def route_past(draft: Draft, stations: Sequence[Box]) -> Backbone:
    """Return the route of a trunk from the cabinet past all stations."""
    places = np.array([draft.middle, *(station.place for station in stations)])
    order = chain(draft.site.route(places[:, None], places[None, :]))
    along = places[order]
    hops = draft.site.length(draft.site.route(along[:-1], along[1:]))
    return Backbone([index - 1 for index in order[1:]], hops)


def lay(
    draft: Draft,
    segment: str,
    bus: str,
    stations: Sequence[Box],
    trunk: Backbone,
    cable: str,
    repeaters: Sequence[int],
    doubled: bool,
) -> list[str]:
    """Add the devices, trunks and feeders of a segment, and return the names of the stations.

    If `doubled`, there are two lines, each with a trunk, a master and a supply of its own.
    """
    names = [draft.device(f"{bus} {box.name}", "station", segment, box.place) for box in stations]
    places = [draft.middle, *(box.place for box in stations)]
    hops, feeder = list(pairwise(places)), cables()[draft.settings.feeder]

    def add(kind: str, line: str, here: int, at: str, name: str = segment) -> str:
        device = f"{name} {kind} {line}".rstrip()
        return draft.device(device, kind.split()[0], segment, places[here], at, line)

    for line in ("A", "B") if doubled else ("",):
        master = add("master", line, 0, draft.cabinet)
        # If a station has a repeater, the trunk cable to the next station starts at the repeater.
        leaving = [master, *names]
        for index in repeaters:
            leaving[index + 1] = add("repeater", line, index + 1, names[index], names[index])
        for (near, far), run in zip(hops, zip(leaving, names, strict=False), strict=True):
            draft.run("trunk", run, Laid(near, far), cables()[cable], PAIR, segment, line)
        add("terminator 1", line, 0, master)
        add("terminator 2", line, -1, names[-1])
        if draft.settings.fed:
            supply = add("supply", line, 0, draft.cabinet)
            for (near, far), run in zip(hops, pairwise([supply, *names]), strict=True):
                draft.run("feeder", run, Laid(near, far), feeder, PAIR, segment, line)
    return names
