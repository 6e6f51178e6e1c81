"""The tables of a design: devices, the cables between them, segments, and their checks."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from math import inf
from types import MappingProxyType
from typing import Any

import numpy as np

from shipnet.design.points import PointTable
from shipnet.design.settings import Settings
from shipnet.design.site import Site
from shipnet.errors import ArgumentError
from shipnet.lazy import pd

#: What a point can be connected by; "" if it fits nowhere.
BUSES = ("hardwired", "AS-i", "CAN", "Modbus RTU", "")

#: Kinds of devices. An auxiliary supply feeds the outputs of an AS-i line; the line itself feeds
#: its modules.
DEVICE_KINDS = (
    "cabinet", "box", "module", "station", "master", "gateway", "repeater", "supply",
    "auxiliary supply", "terminator",
)  # fmt: skip

#: Kinds of cables: from a device to a point, between devices of a segment, from the cabinet to a
#: point, and from a supply to its segment or to a gateway.
RUN_KINDS = ("drop", "trunk", "home run", "feeder")

#: Lines of a trunk: a single one, and the two of a redundant pair.
LINES = ("", "A", "B")

#: The columns of each table with their types; a segment may have more.
COLUMNS: Mapping[str, Mapping[str, str]] = MappingProxyType(
    {
        "points": {
            "tag": "str", "bus": "str", "segment": "str", "device": "str", "address": "str",
            "response_ms": "float", "fits": "bool",
        },
        "devices": {
            "device": "str", "kind": "str", "segment": "str",
            "x_m": "float", "y_m": "float", "z_m": "float",
        },
        "cables": {
            "run": "str", "cable": "str", "a": "str", "b": "str", "segment": "str", "kind": "str",
            "route_m": "float", "length_m": "float", "used": "int", "conductors": "int",
            "at_cabinet": "bool", "line": "str",
        },
        "segments": {
            "segment": "str", "bus": "str", "points": "int", "devices": "int", "length_m": "float",
            "bus_time": "float", "capacity_used": "float", "response_ms": "float",
            "slowest_update_ms": "float",
        },
        "reasons": {
            "subject": "str", "limit": "str", "value": "float", "bound": "float", "unit": "str",
            "text": "str",
        },
    }
)  # fmt: skip


_DTYPES = {"float": float, "int": np.int64, "bool": bool}


def frame(table: str, rows: Any = ()) -> pd.DataFrame:
    """Return a table of a design with its columns in order and of their types."""
    types = COLUMNS[table]
    if not isinstance(rows, pd.DataFrame | Mapping):
        rows = list(rows)
    made = pd.DataFrame(rows) if len(rows) else pd.DataFrame(columns=list(types))
    if missing := [column for column in types if column not in made.columns]:
        raise ArgumentError(f"{table} has no column {' and no column '.join(missing)}")
    made = made[[*types, *made.columns.difference(list(types), sort=False)]].reset_index(drop=True)
    for (column, kind), found in zip(types.items(), made.dtypes, strict=False):
        dtype = np.dtype(_DTYPES.get(kind, object))
        if found == dtype:
            continue
        try:
            made[column] = made[column].astype(dtype)
        except (TypeError, ValueError) as error:
            raise ArgumentError(f"column {column} of {table} is not all {kind}: {error}") from None
    return made


@dataclass(frozen=True, eq=False)
class Layout:
    """The tables of a design; `Design` adds what is computed from them."""

    name: str
    iolist: PointTable
    site: Site
    points: pd.DataFrame
    devices: pd.DataFrame
    cables: pd.DataFrame
    segments: pd.DataFrame
    reasons: pd.DataFrame
    settings: Settings = field(default_factory=Settings)

    def __post_init__(self) -> None:
        for table in COLUMNS:
            object.__setattr__(self, table, frame(table, getattr(self, table)))
        if "at" not in self.devices.columns:
            inside = self.devices["kind"].isin(["master", "gateway"])
            self.devices["at"] = inside.map({True: self.cabinet, False: ""})
        faults = list(_faults(self))
        if faults:
            more = f"; and {len(faults) - 10} more" if len(faults) > 10 else ""
            raise ArgumentError(f"design {self.name!r}: {'; '.join(faults[:10])}{more}")

    def __repr__(self) -> str:
        fit, length = int(self.points["fits"].sum()), self.cables["length_m"].sum()
        return (
            f"<{type(self).__name__} {self.name!r}: {fit} of {len(self.points)} points fit, "
            f"{len(self.cables)} cables, {length:.0f} m>"
        )

    @property
    def fits(self) -> bool:
        """Whether every point is connected within the limits of its bus."""
        return bool(self.points["fits"].all())

    @property
    def worst_response_ms(self) -> float:
        """Longest response of the points that fit [ms]; NaN if none does."""
        return float(self.points.loc[self.points["fits"], "response_ms"].max())

    @property
    def cabinet(self) -> str:
        """Name of the cabinet among the devices, or "" if there is none."""
        names = self.devices.loc[self.devices["kind"] == "cabinet", "device"]
        return str(names.iloc[0]) if len(names) else ""


def _faults(design: Layout) -> Iterator[str]:
    points, devices, runs = design.points, design.devices, design.cables
    if points["tag"].tolist() != design.iolist.points["tag"].tolist():
        yield "the tags of points differ from those of the list, or are in another order"
    if (devices["kind"] == "cabinet").sum() != 1:
        yield f"there are {(devices['kind'] == 'cabinet').sum()} cabinets; it must be one"
    names = set(devices["device"])
    for what, column in (
        ("device", devices["device"]),
        ("run", runs["run"]),
        ("segment", design.segments["segment"]),
    ):
        yield from (f"{what} {name!r} appears twice" for name in column[column.duplicated()])
    to_point = runs["kind"].isin(["drop", "home run"])
    segments = {"", *design.segments["segment"]}
    for what, values, known in (
        ("bus", points["bus"], set(BUSES)),
        ("device of a point", points["device"], {"", *names}),
        ("segment of a point", points["segment"], segments),
        ("kind of device", devices["kind"], set(DEVICE_KINDS)),
        ("housing of a device", devices["at"], {"", *names}),
        ("segment of a device", devices["segment"], segments),
        ("kind of run", runs["kind"], set(RUN_KINDS)),
        ("line of a run", runs["line"], set(LINES)),
        ("segment of a run", runs["segment"], segments),
        ("end of a run", runs["a"], names),
        ("end of a run", runs.loc[~to_point, "b"], names),
        ("point of a run", runs.loc[to_point, "b"], set(points["tag"])),
    ):
        unknown = dict.fromkeys(value for value in values if value not in known)
        yield from (f"there is no {what} {value!r}" for value in unknown)
    for run, length, used, conductors in zip(
        runs["run"], runs["length_m"], runs["used"], runs["conductors"], strict=True
    ):
        if not 0 <= length < inf:
            yield f"length of {run} is {length} m; it must be 0 or more"
        if not 0 <= used <= conductors:
            yield f"{run} uses {used} of {conductors} conductors"
