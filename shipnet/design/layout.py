"""The tables of a design: devices, the cables between them, segments, and their checks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import numpy as np

from shipnet.design.points import PointTable
from shipnet.design.settings import Settings
from shipnet.design.site import Site
from shipnet.lazy import pd

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


_DTYPES: Mapping[str, Any] = {"float": float, "int": np.int64, "bool": bool}


def frame(table: str, rows: Any = ()) -> pd.DataFrame:
    """Return a table of a design with its columns in order and of their types."""
    types = {column: _DTYPES.get(kind, object) for column, kind in COLUMNS[table].items()}
    if not isinstance(rows, pd.DataFrame | Mapping):
        rows = list(rows)
    made = pd.DataFrame(rows) if len(rows) else pd.DataFrame(columns=list(types))
    more = made.columns.difference(list(types), sort=False)
    return made[[*types, *more]].reset_index(drop=True).astype(types)


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
