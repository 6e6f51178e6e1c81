"""Plants small enough to be laid out by hand: contacts in groups along a way from the cabinet.

The papers name such plants by their counts alone. Here they become networks, hardwired and on
AS-i, which the same code counts and prices as any other.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import ceil

import numpy as np
import pandas as pd

from shipnet.design.cabling import asi_conductors, hardwired_conductors
from shipnet.design.iolist import IoList
from shipnet.design.network import Network, frame
from shipnet.design.site import Site
from shipnet.errors import ArgumentError
from shipnet.fields import check_whole

__all__ = ["Plant"]

#: One pair of 0.75 mm2 to a contact, and a shipboard cable for AS-i.
_PAIR, _ASI = "MI1P075", "ASI_MARINE"

#: Cable of a line without a repeater [m]; a repeater adds as much (kim2023, section 3.3).
_SEGMENT = 100.0


@dataclass(frozen=True)
class Plant:
    """Modules with contacts, one behind the other along each of a number of lines.

    Parameters
    ----------
    modules : int
        Modules, or groups of contacts where there is no module, 1..10000.
    contacts : int
        Contacts at each, 1..16; the usual AS-i module has four inputs.
    lines : int, default 1
        AS-i lines, that is masters, 1..modules.
    distance : float, default 300.0
        Way from the cabinet to the first module [m], 0..10000.
    spacing : float, default 1.0
        Way from a module to the next on its line [m], 0..1000.
    drop : float, default 1.0
        Way from a module to its contacts [m], 0..1000.
    site : Site, optional
        What a way becomes as cable; the cabinet stands at the origin. The usual detour and tails
        if omitted.

    Raises
    ------
    ArgumentError
        If an argument is out of its range.

    Notes
    -----
    The limits of AS-i are not checked here: `shipnet.design.plan` does that. A line gets as many
    repeaters as its cable needs, one every 100 m.

    Examples
    --------
    The submarine of kim2023, section 3.5, with one contact a slave:

    >>> submarine = Plant(modules=190, contacts=1, lines=14, distance=30)
    >>> submarine.hardwired
    <Network 'hardwired': 190 of 190 points fit, 190 cables, 9099 m>
    >>> submarine.on_asi
    <Network 'AS-i': 190 of 190 points fit, 380 cables, 2804 m>
    """

    modules: int
    contacts: int
    lines: int = 1
    distance: float = 300.0
    spacing: float = 1.0
    drop: float = 1.0
    site: Site | None = None

    def __post_init__(self) -> None:
        """Check every argument."""
        check_whole("modules", self.modules, 1, 10_000)
        check_whole("contacts", self.contacts, 1, 16)
        check_whole("lines", self.lines, 1, self.modules, " of the modules")
        for name, high in (("distance", 1e4), ("spacing", 1e3), ("drop", 1e3)):
            if not 0 <= getattr(self, name) <= high:
                raise ArgumentError(f"{name} is {getattr(self, name)} m; it must be 0..{high:g} m")

    @cached_property
    def _rows(self) -> pd.DataFrame:
        """One row a module: line, place on it, name, and the segment's name."""
        number = np.arange(self.modules)
        line, place = number % self.lines, number // self.lines
        return pd.DataFrame(
            {
                "line": line,
                "place": place,
                "device": [f"module {n}" for n in number + 1],
                "segment": [f"line {n}" for n in line + 1],
                "x_m": self.distance + self.spacing * place,
            }
        )

    @cached_property
    def iolist(self) -> IoList:
        """The contacts, as a list of points."""
        rows = self._rows.loc[self._rows.index.repeat(self.contacts)].reset_index(drop=True)
        nothing = np.full(len(rows), np.nan)
        port = np.tile(np.arange(1, self.contacts + 1), self.modules)
        points = pd.DataFrame(
            {
                "tag": [f"{d} contact {n}" for d, n in zip(rows["device"], port, strict=True)],
                "system": "plant", "type": "DI", "signal": "contact",
                "conductors": hardwired_conductors({"contact": 1}),
                "x_m": rows["x_m"], "y_m": self.drop, "z_m": 0.0, "box": "",
                "box_x_m": nothing, "box_y_m": nothing, "box_z_m": nothing,
                "to_box_m": nothing, "home_run_m": nothing, "update_ms": 1000.0,
                "category": "", "note": "",
            }
        )  # fmt: skip
        return IoList(points, "counts of a plant")

    @cached_property
    def hardwired(self) -> Network:
        """Every contact with a cable of its own to the cabinet."""
        points = self.iolist.points
        return self._network(
            "hardwired",
            points=_points(points["tag"], "hardwired", device="cabinet"),
            devices=[_device("cabinet", "cabinet")],
            runs=self._runs(
                "home run", a="cabinet", b=points["tag"], cable=_PAIR, segment="",
                route=points["x_m"] + points["y_m"], at_cabinet=True, used=points["conductors"],
            ),
            segments=(),
        )  # fmt: skip

    @cached_property
    def on_asi(self) -> Network:
        """The contacts on modules, and the modules on AS-i lines from masters in the cabinet."""
        rows, points = self._rows, self.iolist.points
        first = (rows["place"] == 0).to_numpy()
        masters = rows["segment"].str.replace("line", "master")
        before = rows["device"].shift(self.lines)
        trunk = self._runs(
            "trunk", a=before.where(~first, masters), b=rows["device"], cable=_ASI,
            segment=rows["segment"], route=np.where(first, self.distance, self.spacing),
            at_cabinet=first, used=asi_conductors(1),
        )  # fmt: skip
        own = rows.loc[rows.index.repeat(self.contacts)]
        drops = self._runs(
            "drop", a=own["device"].to_numpy(), b=points["tag"], cable=_PAIR,
            segment=own["segment"].to_numpy(), route=self.drop, at_cabinet=False,
            used=points["conductors"],
        )  # fmt: skip
        lengths = trunk.groupby("segment", sort=False)["length_m"].sum()
        devices = [_device("cabinet", "cabinet")]
        for line, (segment, length) in enumerate(lengths.items(), 1):
            devices += [
                _device(f"{kind} {line}", kind, segment, at="cabinet")
                for kind in ("master", "supply")
            ]
            devices += [
                _device(f"repeater {line}.{n}", "repeater", segment, x=n * _SEGMENT)
                for n in range(1, ceil(length / _SEGMENT))
            ]
        devices += [
            _device(device, "module", segment, x=x)
            for device, segment, x in zip(rows["device"], rows["segment"], rows["x_m"], strict=True)
        ]
        count = rows["segment"].value_counts(sort=False)
        nan = float("nan")
        return self._network(
            "AS-i",
            points=_points(
                points["tag"], "AS-i", segment=own["segment"], device=own["device"],
                response_ms=nan,
            ),
            devices=devices,
            runs=pd.concat([trunk, drops]),
            segments=[
                {"segment": segment, "bus": "AS-i", "points": self.contacts * n, "devices": n,
                 "length_m": length, "load": nan, "response_ms": nan,
                 "slowest_update_ms": 1000.0}
                for (segment, length), n in zip(lengths.items(), count, strict=True)
            ],
        )  # fmt: skip

    def _runs(self, kind: str, *, route: object, used: object, **columns: object) -> pd.DataFrame:
        table = pd.DataFrame({**columns, "route_m": route, "used": used, "kind": kind, "line": ""})
        table["length_m"] = self._site.length(table["route_m"].to_numpy(dtype=float))
        table["conductors"] = table["used"]
        table["run"] = [f"{kind} {a} - {b}" for a, b in zip(table["a"], table["b"], strict=True)]
        table["way"] = pd.Series([()] * len(table), dtype=object)
        return table

    @cached_property
    def _site(self) -> Site:
        return Site((0.0, 0.0, 0.0)) if self.site is None else self.site

    def _network(self, name: str, **tables: object) -> Network:
        made = {table: frame(table, rows) for table, rows in tables.items()}
        return Network(name, self.iolist, self._site, **made, reasons=frame("reasons"))


def _points(tags: pd.Series, bus: str, **columns: object) -> pd.DataFrame:
    given = {"segment": "", "response_ms": 0.0, "address": "", "fits": True, **columns}
    arrays = {
        name: value.to_numpy() if isinstance(value, pd.Series) else value
        for name, value in given.items()
    }
    return pd.DataFrame({"tag": tags.to_numpy(), "bus": bus, **arrays})


def _device(
    name: str, kind: str, segment: object = "", *, x: float = 0.0, at: str = ""
) -> dict[str, object]:
    place = {"x_m": x, "y_m": 0.0, "z_m": 0.0}
    return {"device": name, "kind": kind, "segment": segment, "at": at, **place}
