"""Tables of a design for a yard: cable schedule, devices, terminals and points."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from io import BytesIO
from os import PathLike
from pathlib import Path
from typing import TypeAlias
from zipfile import ZIP_DEFLATED, ZipFile, ZipInfo

import numpy as np
import pandas as pd

from shipnet.design.catalogue import cables as catalogue
from shipnet.design.costs import bill_table
from shipnet.design.layout import Layout
from shipnet.design.supply import supply_tables
from shipnet.errors import ArgumentError
from shipnet.signals import SIGNALS

#: Names of the two conductors of a trunk, by bus, and of a feeder.
_WIRES = {"AS-i": ("AS-i +", "AS-i -"), "CAN": ("CAN_H", "CAN_L"), "Modbus RTU": ("D1", "D0")}
_FEED = ("L+", "L-")

#: Kinds of cables that end at a point.
_TO_POINT = ("drop", "home run")


def file_name(name: str) -> str:
    """Return a name for a file or folder that is legal on every operating system."""
    return re.sub(r"[^\w.,+() -]", "-", name).strip(" .") or "design"


def save_files(folder: str | PathLike[str], named: Iterable[tuple[str, bytes]]) -> None:
    """Write files into a folder and its subfolders, which are created if missing."""
    if Path(folder).suffix.lower() in (".csv", ".html", ".json", ".svg", ".xlsx", ".zip"):
        raise ArgumentError(f"folder is {str(folder)!r}; it must be a folder, not a file")
    for name, content in named:
        path = Path(folder, name)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)


def zipped(named: Iterable[tuple[str, bytes]]) -> bytes:
    """Return files as one ZIP archive."""
    stream = BytesIO()
    with ZipFile(stream, "w") as archive:
        for name, content in named:
            archive.writestr(ZipInfo(name), content, ZIP_DEFLATED)
    return stream.getvalue()


def tables(design: Layout) -> dict[str, pd.DataFrame]:
    """Return the tables of a design by file name."""
    supplies, voltages = supply_tables(design)
    return {
        "cables": schedule(design),
        "terminals": terminals(design),
        "devices": devices(design),
        "points": points(design),
        "supplies": supplies,
        "voltages": voltages,
        "segments": design.segments.copy(),
        "bill": bill_table(design),
        "reasons": design.reasons.copy(),
    }


def schedule(design: Layout) -> pd.DataFrame:
    """Return the cable schedule: one row per cable, for ordering and installation."""
    runs, types = design.cables, catalogue()
    at = design.devices.set_index("device")["at"]
    names = {"run": "cable", "a": "from", "b": "to", "cable": "type"}
    names |= {"conductors": "cores", "used": "cores_used"}
    table = runs.rename(columns=names).assign(
        from_in=[at[name] for name in runs["a"]],
        to_in=[at.get(name, "") for name in runs["b"]],
        description=runs["cable"].map(lambda name: types[name].description),
        tails_m=runs["length_m"] - design.site.detour * runs["route_m"],
    )
    return table[_SCHEDULE]


_SCHEDULE = (
    "cable from from_in to to_in type description cores cores_used length_m tails_m route_m kind "
    "segment line"
).split()


def devices(design: Layout) -> pd.DataFrame:
    """Return all devices with position, housing, bus address and number of points."""
    wired = design.cables.loc[design.cables["kind"].isin(_TO_POINT), ["a", "b"]]
    # An address begins with the device's address: a slave, a unit, or one of several messages.
    first = design.points.set_index("tag")["address"].str.split().str[0]
    addressed = wired.assign(address=first.loc[wired["b"]].array).dropna(subset="address")
    of_device = addressed.drop_duplicates(["a", "address"]).groupby("a")["address"].agg(", ".join)
    name = design.devices["device"]
    count = name.map(wired["a"].value_counts()).fillna(0).astype(int)
    columns = ["device", "kind", "segment", "at", "x_m", "y_m", "z_m"]
    address = [of_device.get(addressed, "") for addressed in name]
    return design.devices[columns].assign(address=address, points=count)


def points(design: Layout) -> pd.DataFrame:
    """Return all points of the list, including those that do not fit, with their channels."""
    columns = ["tag", "system", "type", "signal", "x_m", "y_m", "z_m", "update_ms"]
    connected = design.points.drop(columns=["tag", "planned_update_ms"], errors="ignore")
    used = design.points.get("planned_update_ms", np.nan)
    listed = design.iolist.points[columns].assign(planned_update_ms=used)
    # A hardwired point ends on a card in the cabinet, even if its cable passes through a box.
    reader = connected["device"].where(connected["bus"] != "hardwired", design.cabinet)
    number = listed.groupby([reader, listed["type"]]).cumcount() + 1
    channel = (listed["type"] + " " + number.astype(str)).where(connected["bus"] != "", "")
    # A point on doubled AS-i lines has a cable to each; the address is that of both modules.
    ends = dict(zip(design.cables["b"][::-1], design.cables["run"][::-1], strict=True))
    return pd.concat([listed, connected.drop(columns="fits")], axis=1).assign(
        channel=channel, cable=[ends.get(tag, "") for tag in listed["tag"]]
    )


def terminals(design: Layout) -> pd.DataFrame:
    """Return the terminal plan: one row per core with its signal and its terminal at each end.

    The terminals of each device are numbered from 1 in the order of the cables. Cores that meet in
    a junction box share a terminal, as do the returns that share a core of its trunk. Spare cores
    have no terminal.
    """
    runs = design.cables
    size = runs["conductors"].to_numpy(np.intp)
    first = np.cumsum(size) - size
    row = np.repeat(np.arange(len(runs)), size)
    core = np.arange(len(row)) - first[row] + 1
    used = core <= runs["used"].to_numpy(np.intp)[row]
    of_point = runs["kind"].isin(_TO_POINT)
    carries = runs["b"].where(of_point, runs["segment"]).to_numpy(object)[row]
    wire = np.array(list(_wires(design)), dtype=object)
    # Ends that share a terminal have the same key; every other end has its own key.
    near, far = np.arange(2 * len(row)).reshape(2, -1)
    for trunk, joints in _boxed(design):
        used[first[trunk] : first[trunk] + size[trunk]] = False
        for number, (joined, common) in enumerate(joints[: size[trunk]]):
            if not joined:
                continue
            here = first[trunk] + number
            there = [first[drop] + conductor for drop, conductor in joined]
            near[there] = far[here] = near[there[0]]
            used[here] = True
            carries[here] = f"return of {common}" if common else carries[there[0]]
            wire[here] = wire[there[0]]
    a, b = (runs[end].to_numpy(object)[row] for end in ("a", "b"))
    both = {"device": [a, b], "key": [near, far]}
    ends = pd.DataFrame({name: np.stack(pair, axis=1).ravel() for name, pair in both.items()})
    strips = ends[np.repeat(used, 2)].drop_duplicates()
    terminal = strips.groupby("device").cumcount().add(1).set_axis(strips["key"]).astype("Int64")
    return pd.DataFrame(
        {
            "cable": runs["run"].to_numpy(object)[row],
            "core": core,
            "carries": np.where(used, carries, "spare"),
            "wire": np.where(used, wire, ""),
            "from": a,
            "from_terminal": terminal.reindex(np.where(used, near, -1)).array,
            "to": b,
            "to_terminal": terminal.reindex(np.where(used, far, -1)).array,
        }
    )


def _wires(design: Layout) -> Iterator[str]:
    """Yield the name of each core, such as CAN_H or L+, or its number if it has no name."""
    bus = dict(zip(design.segments["segment"], design.segments["bus"], strict=True))
    runs = design.cables
    for kind, segment, cores in zip(runs["kind"], runs["segment"], runs["conductors"], strict=True):
        labels = _FEED if kind == "feeder" else _WIRES.get(bus.get(segment, ""), ())
        labels = () if kind in _TO_POINT else labels
        yield from (labels[n] if n < len(labels) else str(n + 1) for n in range(cores))


#: The wires joined to a core of a box's trunk, each as (row of its cable, number), and the signal
#: for which the core is the common return, or "".
_Joint: TypeAlias = tuple[list[tuple[int, int]], str]


def _boxed(design: Layout) -> Iterator[tuple[int, list[_Joint]]]:
    """Yield the row of each trunk of a box, and the wires joined to each core of the trunk.

    The planner divides the points of a box among its trunks in order, so the number of
    conductors in use shows which points share a trunk. In a trunk, the pairs of points with their
    of_box return come first, then one conductor per point with a common return, then these returns.
    """
    runs = design.cables
    kinds = dict(zip(design.points["tag"], design.iolist.points["signal"], strict=True))
    signal, used = [kinds.get(tag, "") for tag in runs["b"]], runs["used"].tolist()
    box = runs["b"].where((runs["kind"] == "trunk") & (runs["segment"] == ""), "")
    near = runs["a"].where(runs["kind"] == "drop", "")
    trunks, drops = (
        {str(name): [int(row) for row in rows] for name, rows in runs.groupby(of).indices.items()}
        for of in (box, near)
    )
    trunks.pop("", None)
    for name, of_box in trunks.items():
        left = drops.get(name, [])[::-1]
        for trunk in of_box:
            inside, taken, seen = list[int](), 0, set[str]()
            while left:
                kind = signal[left[-1]]
                taken += used[left[-1]] - (SIGNALS[kind].common if kind in seen else 0)
                if taken > used[trunk] and trunk != of_box[-1]:
                    break
                seen.add(kind)
                inside.append(left.pop())
            yield trunk, _joints([(drop, signal[drop], used[drop]) for drop in inside])


def _joints(drops: Iterable[tuple[int, str, int]]) -> list[_Joint]:
    """Return the wires joined to each core of a trunk; a drop is (row, signal, number of wires)."""
    pairs, shared, returns = list[_Joint](), list[_Joint](), dict[str, list[tuple[int, int]]]()
    for drop, kind, wires in drops:
        common = SIGNALS[kind].common
        wires_of: list[_Joint] = [([(drop, wire)], "") for wire in range(wires - common)]
        if common:
            shared += wires_of
            returns.setdefault(kind, []).append((drop, wires - 1))
        else:
            pairs += wires_of if wires % 2 == 0 else [*wires_of, ([], "")]
    return [*pairs, *shared, *((ends, kind) for kind, ends in returns.items())]
