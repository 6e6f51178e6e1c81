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
from shipnet.design.revision import numbered
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
    where = list(zip(reader, listed["type"], strict=True))
    old = {} if design.previous is None else _channels(design.previous)
    was = [old.get((tag, *at), np.nan) for tag, at in zip(listed["tag"], where, strict=True)]
    number = pd.Series(numbered(where, was), listed.index, dtype=object).astype(str)
    channel = (listed["type"] + " " + number).where(connected["bus"] != "", "")
    # A point on doubled AS-i lines has a cable to each; the address is that of both modules.
    ends = dict(zip(design.cables["b"][::-1], design.cables["run"][::-1], strict=True))
    return pd.concat([listed, connected.drop(columns="fits")], axis=1).assign(
        channel=channel, cable=[ends.get(tag, "") for tag in listed["tag"]]
    )


def _channels(design: Layout) -> dict[tuple[str, str, str], float]:
    """Return the channel of each connected point, by its tag, its reader and its type."""
    table = points(design)
    table = table[table["channel"] != ""]
    reader = table["device"].where(table["bus"] != "hardwired", design.cabinet)
    channel = table["channel"].str.split().str[-1].astype(float)
    return dict(zip(zip(table["tag"], reader, table["type"], strict=True), channel, strict=True))


def terminals(design: Layout) -> pd.DataFrame:
    """Return the terminal plan: one row per core with its signal and its terminal at each end.

    The terminals of each device are numbered from 1 in the order of the cables; those of an earlier
    design keep their numbers. Cores that meet in a junction box share a terminal, as do the returns
    that share a core of its trunk. Spare cores have no terminal.
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
    cable = runs["run"].to_numpy(object)[row]
    old = {} if design.previous is None else _terminals(design.previous)
    at = zip(np.repeat(cable, 2), np.repeat(core, 2), ends["device"], strict=True)
    ends["old"] = [old.get(end, np.nan) for end in at] if old else np.nan
    strips = ends[np.repeat(used, 2)].groupby(["device", "key"], sort=False)["old"].first()
    devices_of, keys = (strips.index.get_level_values(level) for level in ("device", "key"))
    numbers = np.array(numbered(devices_of, strips), dtype=np.int64)
    terminal = pd.Series(numbers, keys).astype("Int64")
    return pd.DataFrame(
        {
            "cable": cable,
            "core": core,
            "carries": np.where(used, carries, "spare"),
            "wire": np.where(used, wire, ""),
            "from": a,
            "from_terminal": terminal.reindex(np.where(used, near, -1)).array,
            "to": b,
            "to_terminal": terminal.reindex(np.where(used, far, -1)).array,
        }
    )


def _terminals(design: Layout) -> dict[tuple[str, int, str], float]:
    """Return the terminal of each core in use, by cable, core and device."""
    table = terminals(design)
    ends = (table[["cable", "core", end, f"{end}_terminal"]].dropna() for end in ("from", "to"))
    return {(c, n, at): float(t) for part in ends for c, n, at, t in part.itertuples(index=False)}


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

    Of the points that are added together, the pairs of points with their own return come first,
    then one conductor per point with a common return, then these returns.
    """
    runs = design.cables
    drops = {tag: row for row, tag in enumerate(runs["b"]) if runs["kind"][row] == "drop"}
    for row, run in enumerate(runs["run"]):
        parts = [
            _joints([(drops.get(tag, -1), kind, wires) for tag, kind, wires in part])
            for part in design.strips.get(run, ())
        ]
        if parts:
            # Each part begins with a pair.
            even = [[*part, *[([], "")] * (len(part) % 2)] for part in parts]
            yield row, [joint for part in even for joint in part]


def _joints(drops: Iterable[tuple[int, str, int]]) -> list[_Joint]:
    """Return the wires joined to each core of a trunk; a drop is (row, signal, number of wires)."""
    pairs, shared, returns = list[_Joint](), list[_Joint](), dict[str, list[tuple[int, int]]]()
    for drop, kind, wires in drops:
        common = SIGNALS[kind].common
        joined = range(wires - common)
        wires_of: list[_Joint] = [([(drop, wire)] if drop >= 0 else [], "") for wire in joined]
        if common:
            shared += wires_of
            returns.setdefault(kind, []).extend([(drop, wires - 1)] * (drop >= 0))
        else:
            pairs += wires_of if wires % 2 == 0 else [*wires_of, ([], "")]
    return [*pairs, *shared, *((ends, kind) for kind, ends in returns.items())]
