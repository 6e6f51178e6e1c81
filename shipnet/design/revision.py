"""What the design of a revised list keeps of an earlier one: devices, numbers, and cables."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from itertools import count
from math import isnan
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import numpy as np

from shipnet.design.catalogue import cables as catalogue
from shipnet.lazy import pd

if TYPE_CHECKING:
    from shipnet.design.layout import Layout
    from shipnet.design.points import PointTable

Item = TypeVar("Item")

#: Columns of a point that a revision must not change if the point keeps its device.
_FIXED = ["signal", "x_m", "y_m", "z_m", "box", "box_x_m", "box_y_m", "box_z_m"]

#: What identifies a cable, apart from its name.
_ENDS = ["kind", "a", "b", "segment", "line"]


class Device(NamedTuple):
    """A box, station or module of the first design."""

    name: str
    kind: str
    segment: str
    place: tuple[float, float, float]


class Kept:
    """What the points of a list keep of an earlier design, or nothing if there is none."""

    def __init__(self, iolist: PointTable, previous: Layout | None) -> None:
        #: Device and address of each row that kept its device, and all devices by name.
        self.device: dict[int, Device] = {}
        self.address: dict[int, str] = {}
        self.devices: dict[str, Device] = {}
        if previous is None:
            return
        columns = ["device", "kind", "segment", "x_m", "y_m", "z_m"]
        rows = previous.devices[columns].itertuples(index=False, name=None)
        for name, kind, segment, x, y, z in rows:
            self.devices[name] = Device(name, kind, segment, (x, y, z))
        old, new = (
            one.points.set_index("tag")[_FIXED].astype(object).fillna("")
            for one in (previous.iolist, iolist)
        )
        is_same = (old.reindex(new.index) == new).all(axis=1)
        at = previous.points.set_index("tag").reindex(new.index)[["device", "address"]]
        for n, (device, address) in enumerate(at.itertuples(index=False, name=None)):
            if is_same.iloc[n] and device:
                self.device[n], self.address[n] = self.devices[device], address

    def groups(self, rows: Iterable[int], kind: str, prefix: str) -> dict[Device, list[int]]:
        """Return the rows that keep each device of a kind whose name begins with the prefix."""
        rows_of: dict[Device, list[int]] = {device: [] for device in self.devices.values()}
        for row in rows:
            if (device := self.device.get(row)) is not None:
                if device.kind == kind and device.name.startswith(prefix):
                    rows_of[device].append(row)
        return {device: members for device, members in rows_of.items() if members}


def joined(
    items: Sequence[Item],
    segment: Callable[[Item], str],
    position: Callable[[Item], Sequence[float]],
) -> list[list[Item]]:
    """Return items by the segment that they keep; each new one joins that of the nearest item."""
    kept = [item for item in items if segment(item)]
    groups: dict[str, list[Item]] = {segment(item): [] for item in kept}
    for item in items:
        nearest = item
        if kept and not segment(item):
            away = np.abs(np.subtract([position(one) for one in kept], position(item)))
            nearest = kept[int(away.sum(axis=1).argmin())]
        groups.setdefault(segment(nearest), []).append(item)
    return [groups[name] for name in sorted(groups, key=lambda name: (len(name), name))]


def numbered(groups: Iterable[Any], old: Iterable[float]) -> list[int]:
    """Return numbers from 1 within groups: the old ones, and otherwise the lowest free ones."""
    pairs = list(zip(groups, old, strict=True))
    taken, used = {pair for pair in pairs if not isnan(pair[1])}, set()
    free: dict[Any, Any] = {}
    numbers = []
    for group, was in pairs:
        if isnan(was) or (group, was) in used:
            was = next(n for n in free.setdefault(group, count(1)) if (group, n) not in taken)
        used.add((group, was))
        numbers.append(int(was))
    return numbers


def with_names(runs: pd.DataFrame, previous: Layout | None) -> pd.DataFrame:
    """Return cables with the names of the first design, and its types if they are large enough."""
    if previous is None:
        return runs
    types, (old, new) = catalogue(), (_by_ends(one) for one in (previous.cables, runs))
    taken = {old[ends][0] for ends in new.keys() & old.keys()}
    names, chosen = [], []
    for (ends, (name, cable)), used in zip(new.items(), runs["used"], strict=True):
        was = types[old[ends][1] if ends in old else cable]
        enough = was.conductors >= used and was.section >= types[cable].section
        chosen.append(was.id if enough and ends[0] in ("trunk", "feeder") else cable)
        free = (f"{name} ({number})" if number > 1 else name for number in count(1))
        names.append(old[ends][0] if ends in old else next(n for n in free if n not in taken))
        taken.add(names[-1])
    cores = [types[cable].conductors for cable in chosen]
    return runs.assign(run=names, cable=chosen, conductors=cores)


def _by_ends(runs: pd.DataFrame) -> dict[tuple[Any, ...], tuple[str, str]]:
    """Return the name and type of each cable by its kind, its ends, and its rank among alike."""
    keys = runs[_ENDS].assign(rank=runs.groupby(_ENDS).cumcount())
    named = zip(runs["run"], runs["cable"], strict=True)
    return dict(zip(keys.itertuples(index=False, name=None), named, strict=True))
