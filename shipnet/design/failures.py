"""The points lost in each single failure of a design, that is, when one cable or device fails."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from itertools import chain

import numpy as np

from shipnet.arrays import Bools, Integers
from shipnet.design.layout import Layout
from shipnet.errors import ArgumentError
from shipnet.lazy import pd

# The parts of a design still reached when some cables are cut and some devices are dead ----------

#: Indices of the runs that are cut, and of the devices that are dead.
Failure = tuple[Collection[int], Collection[int]]
_NONE: Integers = np.empty(0, np.int64)
#: Nodes at both ends of each edge, and the index of its run; -1 if the edge is not a cable run.
Edges = tuple[Integers, Integers, Integers]

#: Kinds of devices that join lines A and B, and kinds that block all lines when dead.
_JOINS = ("cabinet", "master")
_BLOCKS = (*_JOINS, "repeater", "box")

#: Kinds of devices at which a pair of conductors ends, by the kind of its cables.
_PAIR_ENDS = {"trunk": ("repeater",), "feeder": ("cabinet",)}

#: Kinds of devices whose failure disables everything in their housing.
_SHELLS = ("box", "cabinet")

#: Maximum number of truth values in memory at once.
_CHUNK = 2**21


class Reach:
    """A planned design as arrays; runs and devices are identified by row number in its tables."""

    def __init__(self, design: Layout) -> None:
        self.design = design
        points, devices, runs = design.points, design.devices, design.cables
        index = {name: n for n, name in enumerate(devices["device"])}
        self.kinds = kinds = devices["kind"].to_numpy(str)
        self._cabinet = cabinet = index[design.cabinet]
        self.at_point = runs["kind"].isin(["drop", "home run"]).to_numpy()
        # Devices at the ends of every run, shape (n_runs, 2); -1 stands for a point.
        ends = [[index.get(name, -1) for name in runs["a"]]]
        ends += [[index.get(name, -1) for name in runs["b"].where(~self.at_point, "")]]
        self._ends = np.array(ends, np.int64).reshape(2, -1).T
        asi = design.segments.query("bus == 'AS-i'")["segment"]
        self._asi, of_asi = runs["segment"].isin(asi).to_numpy(), devices["segment"].isin(asi)
        trunk, feeder = ((runs["kind"] == kind).to_numpy() for kind in ("trunk", "feeder"))
        self._feeders = feeder

        # Point, device and run of each connection of a point; run -1 means no cable.
        row = {tag: n for n, tag in enumerate(points["tag"])}
        wired = np.flatnonzero(self.at_point)
        tags = runs["b"].to_numpy(object)[wired]
        bare = points[(points["device"] != "") & ~points["tag"].isin(tags)]
        self._wires = (
            np.array([row[tag] for tag in tags] + bare.index.tolist(), np.int64),
            np.array([*self._ends[wired, 0], *map(index.get, bare["device"])], np.int64),
            np.concatenate([wired, np.full(len(bare), -1)]),
        )

        # Each device in a housing, with the housing; then with the device it connects to, which
        # is its master for a repeater or a supply in the cabinet. Shape (n, 2).
        housing = np.array([index.get(at, -1) for at in devices["at"]], np.int64)
        inside = np.flatnonzero(housing >= 0)
        self._housings = np.stack([inside, housing[inside]], axis=1)
        lines = list(zip(devices["segment"], devices["line"], strict=True))
        master = {lines[n]: n for n in np.flatnonzero(kinds == "master")}
        self._joints = self._housings.copy()
        for joint, (n, at) in enumerate(self._joints):
            if at == cabinet and kinds[n] in ("repeater", "supply"):
                self._joints[joint, 1] = master.get(lines[n], at)

        # Edges that carry data; a cabinet or master is one node for both lines.
        u, v, run = self._by_line(np.flatnonzero(trunk), self._joints)
        count, joined = len(kinds), np.isin(kinds, _JOINS)
        u, v = (np.where(joined[node % count], node % count, node) for node in (u, v))
        self._data = u, v, run
        # For each data edge, the device that must be powered for the edge to work; -1 for none.
        near, far = self._ends.T
        end = np.where((kinds == "repeater")[far], near, far)
        along = np.append(np.where(self._asi & trunk, end, -1), -1)[run]
        # A repeater beside its master is connected to it without a cable.
        in_, at = u % count, v % count
        is_master = (kinds == "master") & of_asi.to_numpy(bool)
        beside = (run < 0) & (kinds == "repeater")[in_] & is_master[at]
        self._current_at = np.where(beside, at, along)

        # Edges that carry power: feeders of stations, and AS-i trunks. A supply in a housing feeds
        # its line there without a cable. Then the feeders of the outputs of AS-i modules.
        lines_of_asi = self._asi & ~feeder & ~self.at_point & (kinds != "repeater")[far]
        at_cabinet, at_supply = ((kinds == kind)[self._ends] for kind in ("cabinet", "supply"))
        to_host = at_cabinet.any(axis=1)
        number = np.flatnonzero(lines_of_asi | (feeder & ~self._asi & ~to_host))
        self._power = self._by_line(number, self._joints[kinds[self._joints[:, 0]] == "supply"])
        mains = (at_cabinet | at_supply).any(axis=1)
        number = np.flatnonzero(self._asi & feeder & ~mains)
        self._auxiliary = (*self._ends[number].T, number)
        # Supplies with a feeder from the cabinet, and the runs of these feeders.
        number = np.flatnonzero(feeder & (self._ends == cabinet).any(axis=1))
        other = self._ends[number].sum(axis=1) - cabinet
        fed = np.isin(kinds[other], ("supply", "auxiliary supply"))
        self._mains = other[fed], number[fed]

        # What a supply or an auxiliary supply reaches, and what works, when nothing has failed.
        masks = self._masks()
        self._needs_supply = self._supplied(*masks)[0]
        self._needs_auxiliary = self._has_auxiliary(*masks)[0]
        self._connected = self._works(*masks)[0]
        self._areas = self._separate()

    def _separate(self) -> tuple[Integers, Integers]:
        """Return the area of each device and run, and of each point; connected parts share one.

        A cabinet that connects areas for data only is in no area. If it passes on power, or is in a
        housing that may fail, everything is in one area.
        """
        count, (point, device, run) = len(self.kinds), self._wires
        wires = np.stack([count + point, device], axis=1)
        pairs = np.concatenate([self._ends[~self.at_point], self._housings, self._joints, wires])
        u, v = pairs[(pairs != self._cabinet).all(axis=1)].T
        label = _labels(np.ones((1, len(u)), bool), count + len(self.design.points), u, v)[0]
        label[self._cabinet] = -1
        powered = np.concatenate([*self._power[:2], *self._auxiliary[:2]]) % count
        if (self._housings[:, 0] == self._cabinet).any() or (powered == self._cabinet).any():
            label[:] = 0
        of_run = label[self._ends].max(axis=1, initial=-1)
        of_run[run[run >= 0]] = label[count + point[run >= 0]]
        return np.concatenate([label[:count], of_run]), label[count:]

    def shorts(self) -> list[tuple[list[int], list[int]]]:
        """Return for each pair of a bus or supply: its runs, and the masters that a short disables.

        A pair connects the runs of one segment and line, except past the devices in `_PAIR_ENDS`.
        """
        runs, segments = self.design.cables, self.design.segments
        buses = segments.loc[segments["bus"] != "hardwired", "segment"]
        trunk = (runs["segment"].isin(buses) & (runs["kind"] == "trunk")).to_numpy()
        shorts = []
        for kind, chosen in (("trunk", trunk), ("feeder", self._feeders)):
            number = np.flatnonzero(chosen)
            line = runs.iloc[number].groupby(["segment", "line"], sort=False).ngroup().to_numpy()
            order = np.argsort(line, kind="stable")
            number, line = number[order], line[order]
            # The nodes are the runs and the devices that connect them, one node per line.
            ends = self._ends[number]
            run, side = np.nonzero(~np.isin(self.kinds, _PAIR_ENDS[kind])[ends])
            device = line[run] * len(self.kinds) + ends[run, side]
            _, device = np.unique(device, return_inverse=True)
            count = len(number) + device.max(initial=-1) + 1
            keep = np.ones((1, len(run)), bool)
            label = _labels(keep, count, run, len(number) + device)[0, : len(number)]
            order = np.argsort(label, kind="stable")
            for pair in np.split(number[order], np.flatnonzero(np.diff(label[order])) + 1):
                ends = np.unique(self._ends[pair[self._asi[pair] & trunk[pair]]])
                masters = ends[self.kinds[ends] == "master"]
                if len(pair):
                    shorts.append((pair.tolist(), masters.tolist()))
        return shorts

    def alone(self) -> dict[int, int]:
        """Return the points that work over a single cable only, by the index of the cable's run."""
        point, _, run = self._wires
        good = self._good(*self._masks())[0]
        only = np.bincount(point[good], minlength=len(self._connected)) == 1
        single = good & only[point] & (run >= 0)
        return dict(zip(run[single].tolist(), point[single].tolist(), strict=True))

    def lost(self, failures: Sequence[Failure]) -> list[Integers]:
        """Return the indices of the points lost in each failure.

        A failure has no effect outside its area. Therefore failures in different areas are examined
        at the same time, and the area of a lost point shows which failure caused the loss.
        """
        of_item, of_point = self._areas
        size, n_points, connected = len(self.kinds), len(of_point), self._connected
        failing = [[*devices, *(size + run for run in runs)] for runs, devices in failures]
        number = np.repeat(np.arange(len(failing)), [len(items) for items in failing])
        item = np.fromiter(chain.from_iterable(failing), np.int64)
        # A failure in several areas is examined as one failure in each of them.
        key, each = np.unique(of_item[item] * len(failing) + number, return_inverse=True)
        area, failure = np.divmod(key, max(1, len(failing)))
        turn = np.where(area < 0, -1, np.arange(len(key)) - np.searchsorted(area, area))
        scenario = turn[each]
        # A failure of the cabinet disables all points, even if the cabinet is in no area.
        dead, all_points = number[item == self._cabinet], np.flatnonzero(connected)
        gone = [(dead[:, None] * n_points + all_points).ravel()]
        step = max(1, _CHUNK // (4 * size + 2 * len(self.design.cables) + n_points))
        turns = turn.max(initial=-1) + 1
        for start in range(0, turns, step):
            now = (start <= scenario) & (scenario < start + step)
            masks = self._masks(min(step, turns - start), scenario[now] - start, item[now])
            row, point = np.nonzero(connected & ~self._works(*masks))
            whose = np.searchsorted(area, of_point[point]) + start + row
            gone.append(failure[whose] * n_points + point)
        number, point = np.divmod(np.unique(np.concatenate(gone)), max(1, n_points))
        bounds = np.searchsorted(number, np.arange(1, len(failing)))
        return np.split(point, bounds)[: len(failing)]

    def _by_line(self, number: Integers, joints: Integers) -> Edges:
        """Return runs and joints as edges; device n is node n on line A and n + n_devices on B."""
        line, count = self.design.cables["line"].to_numpy(str)[number], len(self.kinds)
        first, second = number[line != "B"], number[line != "A"]
        ends = [self._ends[first], joints, self._ends[second] + count, joints + count]
        none = np.full(len(joints), -1)
        return (*np.concatenate(ends).T, np.concatenate([first, none, second, none]))

    def _masks(
        self, size: int = 1, row: Integers = _NONE, item: Integers = _NONE
    ) -> tuple[Bools, Bools]:
        """Return a mask of cut runs, whose last column stands for no run, and one of dead devices.

        An item is the index of a device, or the index of a run plus the number of devices.
        """
        gone = np.zeros((size, len(self.kinds) + len(self.design.cables) + 1), bool)
        gone[row, item] = True
        dead, cut = np.split(gone, [len(self.kinds)], axis=1)
        # A dead box or cabinet disables everything in it.
        inside, housing = self._housings[np.isin(self.kinds[self._housings[:, 1]], _SHELLS)].T
        while (more := dead[:, housing] & ~dead[:, inside]).any():
            dead[:, inside] |= more
        return cut, dead

    def _open(self, edges: Edges, cut: Bools, dead: Bools) -> Bools:
        """Return True for edges that still carry data or power, shape (n_failures, n_edges)."""
        (u, v, run), count = edges, len(self.kinds)
        blocked = dead & np.isin(self.kinds, _BLOCKS)
        return ~(cut[:, run] | blocked[:, u % count] | blocked[:, v % count])

    def _works(self, cut: Bools, dead: Bools) -> Bools:
        """Return True for points with a connection that works, shape (n_failures, n_points)."""
        works = np.zeros((len(cut), len(self.design.points)), bool)
        order = np.argsort(self._wires[0], kind="stable")
        point, start = np.unique(self._wires[0][order], return_index=True)
        good = self._good(cut, dead)[:, order]
        works[:, point] = np.logical_or.reduceat(good, start, axis=1)
        return works

    def _good(self, cut: Bools, dead: Bools) -> Bools:
        """Return True for points' connections that still work, shape (n_failures, n_wires)."""
        u, v, _ = self._data
        count = len(self.kinds)
        dark = self._needs_supply & ~self._supplied(cut, dead)
        # The last column is for edges that need no power.
        still = np.pad(~dark, ((0, 0), (0, 1)), constant_values=True)[:, self._current_at]
        labels = _labels(self._open(self._data, cut, dead) & still, 2 * count, u, v)
        reached = labels == labels[:, [self._cabinet]]
        alive = (reached[:, :count] | reached[:, count:]) & ~dead & ~dead[:, [self._cabinet]]
        alive &= ~dark
        point, device, run = self._wires
        unfed = self._needs_auxiliary & ~self._has_auxiliary(cut, dead)
        outputs = self.design.iolist.points["type"].isin(["DO", "AO"]).to_numpy()
        good = alive[:, device] & ~cut[:, run] & ~(unfed[:, device] & outputs[point])
        return np.asarray(good)

    def _has_auxiliary(self, cut: Bools, dead: Bools) -> Bools:
        """Return True for devices that a working auxiliary supply reaches."""
        u, v, _ = self._auxiliary
        labels = _labels(self._open(self._auxiliary, cut, dead), len(self.kinds), u, v)
        live = np.zeros_like(labels, dtype=bool)
        row, device = np.nonzero(self._feeding(cut, dead) & (self.kinds == "auxiliary supply"))
        live[row, labels[row, device]] = True
        return np.take_along_axis(live, labels, axis=1)

    def _supplied(self, cut: Bools, dead: Bools) -> Bools:
        """Return True for devices that a working supply reaches."""
        u, v, _ = self._power
        count = len(self.kinds)
        labels = _labels(self._open(self._power, cut, dead), 2 * count, u, v)
        live = np.zeros_like(labels, dtype=bool)
        row, device = np.nonzero(self._feeding(cut, dead) & (self.kinds == "supply"))
        live[row, labels[row, device]] = live[row, labels[row, device + count]] = True
        reached = np.take_along_axis(live, labels, axis=1)
        return np.asarray(reached[:, :count] | reached[:, count:])

    def _feeding(self, cut: Bools, dead: Bools) -> Bools:
        """Return True for devices that work and whose mains feeder, if any, is not cut."""
        fed, mains = self._mains
        feeding = ~dead
        row, column = np.nonzero(cut[:, mains])
        feeding[row, fed[column]] = False
        return feeding


def _labels(keep: Bools, count: int, u: Integers, v: Integers) -> Integers:
    """Return the connected-component label of each node in each graph, shape (n_graphs, count)."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    graph, edge = np.nonzero(keep)
    size = len(keep) * count
    ends = (graph * count + u[edge], graph * count + v[edge])
    adjacency = coo_array((np.ones(len(edge), bool), ends), (size, size))
    labels = connected_components(adjacency, directed=False)[1]
    labels = labels.reshape(len(keep), count).astype(np.int64)
    # scipy numbers components across all graphs, in the order of their first nodes.
    return np.asarray(labels - labels.min(axis=1, initial=size, keepdims=True))


# Single failures of a planned design: one cable, pair or device fails at a time ------------------

#: Kinds of failures: a cut cable; a short circuit between the conductors of a bus or supply pair,
#: which affects all cables of that pair; and a dead device.
FAILURES = ("cut", "short", "device")


def single_failures(design: Layout) -> pd.DataFrame:
    """Return the points and systems lost in each single failure of a planned design."""
    reach = Reach(design)
    shorts = reach.shorts()
    runs = design.cables[["run", "kind", "segment", "line"]].to_numpy(object).tolist()
    devices = design.devices[["device", "kind", "segment"]].to_numpy(object).tolist()
    rows = [["cut", *run] for run in runs]
    rows += [["short", *runs[pair[0]]] for pair, _ in shorts]
    rows += [["device", *device, ""] for device in devices]
    failures: list[Failure] = [((number,), ()) for number in range(len(runs))]
    failures += shorts
    failures += [((), (number,)) for number in range(len(devices))]
    table = pd.DataFrame(rows, columns=["failure", "failed", "kind", "segment", "line"])

    # A cut in a point's only cable disables only that point.
    gone = [np.array([], int)] * len(rows)
    for run_number, point in reach.alone().items():
        gone[run_number] = np.array([point])
    others = np.setdiff1d(np.arange(len(rows)), np.flatnonzero(reach.at_point))
    for row, points in zip(others, reach.lost([failures[row] for row in others]), strict=True):
        gone[row] = points
    tags = design.points["tag"].to_numpy(object)
    systems = design.iolist.points["system"].to_numpy(object)
    return table.assign(
        points_lost=[len(points) for points in gone],
        systems=pd.Series([tuple(sorted(set(systems[points]))) for points in gone], dtype=object),
        tags=pd.Series([tuple(tags[points]) for points in gone], dtype=object),
    )


def lost(
    design: Layout, *, cables: Collection[str] = (), devices: Collection[str] = ()
) -> tuple[str, ...]:
    """Return the tags of the points lost when the named cables and devices fail together."""
    failed: list[list[int]] = []
    unknown: list[str] = []
    for what, names, all_names in (
        ("cable", cables, design.cables["run"]),
        ("device", devices, design.devices["device"]),
    ):
        number = {name: n for n, name in enumerate(all_names)}
        unknown += [f"{what} {name!r}" for name in names if name not in number]
        failed.append([number[name] for name in names if name in number])
    if unknown:
        raise ArgumentError(f"design {design.name!r} has no {', no '.join(unknown)}")
    (points,) = Reach(design).lost([(failed[0], failed[1])])
    return tuple(design.points["tag"].to_numpy(object)[points])


def worst(failures: pd.DataFrame) -> pd.DataFrame:
    """Return the failure of each kind with the most points lost, excluding cabinet failure."""
    others = failures[failures["kind"] != "cabinet"]
    ranked = others.sort_values("points_lost", ascending=False, kind="stable")
    return ranked.drop_duplicates("failure").reset_index(drop=True)
