"""Conductors and cost, hardwired and on AS-i, of a small plant that is defined by counts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from math import ceil
from types import MappingProxyType
from typing import Any

import numpy as np
import pandas as pd

from shipnet.design.costs import Rng, draw, quantities
from shipnet.design.designs import Design
from shipnet.design.iolist import IoList
from shipnet.design.layout import COLUMNS, Site, frame
from shipnet.design.settings import Settings
from shipnet.fields import check_whole, choice, number, record, whole
from shipnet.signals import ASI_PAIR, SIGNALS
from shipnet.signals import Saving as Saving
from shipnet.signals import hardwired_conductors as hardwired_conductors

#: Cable to a contact (one pair of 0.75 mm2), and shipboard cable for AS-i.
_PAIR, _ASI = "MI1P075", "ASI_MARINE"

#: Longest line without a repeater [m]; each repeater adds the same length (kim2023, section 3.3).
_SEGMENT = 100.0

#: Columns of a segment that counts do not define.
_UNKNOWN = ("bus_time", "capacity_used", "response_ms")

#: The cabinet, from which distances are measured.
_SITE = Site((0.0, 0.0, 0.0))

#: Possible meanings of "wiring cost", and the figures that each includes.
COUNTED: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "cable": ("cable_cost_eur",),
        "cable and labour": ("cable_cost_eur", "labour_cost_eur"),
        "cable, labour and hardware": ("total_cost_eur",),
    }
)


def lines_needed(slaves: int, *, slaves_per_line: int = 62) -> int:
    """Return the number of AS-i lines, and thus of masters, needed for a number of slaves.

    Parameters
    ----------
    slaves : int
        Number of slaves, 0 or more.
    slaves_per_line : int, default 62
        Maximum number of slaves per line, 1..62: 62 with A/B slaves, 31 without.

    Returns
    -------
    int
        Number of lines.

    Raises
    ------
    ArgumentError
        If an argument is out of range.

    Examples
    --------
    >>> lines_needed(62), lines_needed(63), lines_needed(190)
    (1, 2, 4)
    """
    slaves = check_whole("slaves", slaves, 0, 10**9)
    return ceil(slaves / check_whole("slaves_per_line", slaves_per_line, 1, 62))


@record
class Plant:
    """A small plant defined by counts: modules with contacts, in a row along each line.

    The plant is laid out twice, with a cable to every contact and with AS-i, to check the saving
    that a paper or an offer claims. There are no spares.

    Examples
    --------
    >>> print(Plant(62, contacts=4).saving)
    496 -> 2 conductors: 0.40 % left, 99.60 % saved
    >>> doors = Plant(10, contacts=2, distance=20, spacing=4)
    >>> round(doors.hardwired.quantities()["total_cost_eur"])
    8454
    """

    modules: int = whole(1, 10_000, help="Number of modules")
    contacts: int = whole(1, 16, help="Contacts per module")
    lines: int = whole(1, 10_000, help="Number of AS-i lines", default=1, at_most="modules")
    distance: float = number(
        0, 1e4, "m", "Distance from the cabinet to the first module of a line", default=300.0
    )
    spacing: float = number(0, 1e3, "m", "Distance from a module to the next", default=1.0)
    drop: float = number(0, 1e3, "m", "Distance from a module to its contacts", default=1.0)
    signal: str = choice(
        ("contact", "contact_common"),
        "Contacts with two wires each, or with one common return per module",
        default="contact",
    )

    @property
    def saving(self) -> Saving:
        """Conductors at the cabinet, hardwired and on AS-i."""
        each = hardwired_conductors({self.signal: self.contacts})
        return Saving(self.modules * each, ASI_PAIR * self.lines)

    def cost_saving(self, *, rng: Rng = None, draws: int = 10_000) -> pd.DataFrame:
        """Return the fraction of the wiring cost that AS-i saves, for each meaning in `COUNTED`."""
        options = {"hardwired": self.hardwired, "AS-i": self.on_asi}
        sample = draw(options, rng=rng, draws=draws)
        nominal = {name: quantities(one).table()["nominal"] for name, one in options.items()}
        rows = {}
        for counted, figures in COUNTED.items():
            names = list(figures)
            wired, bus = (sample[option][names].to_numpy().sum(axis=1) for option in options)
            at_wired, at_bus = (figures_of[names].sum() for figures_of in nominal.values())
            rows[counted] = [
                1 - at_bus / at_wired,
                *np.quantile(1 - bus / wired, [0.05, 0.5, 0.95]),
            ]
        columns = ["nominal", "low", "median", "high"]
        return pd.DataFrame.from_dict(rows, "index", columns=columns).rename_axis("counted")

    @cached_property
    def _rows(self) -> pd.DataFrame:
        """One row per module: position on its line, x, module name and segment name."""
        number = np.arange(self.modules)
        line, along = number % self.lines, number // self.lines
        rows = pd.DataFrame({"place": along, "x_m": self.distance + self.spacing * along})
        rows["device"] = [f"module {n}" for n in number + 1]
        return rows.assign(segment=[f"line {n}" for n in line + 1])

    @cached_property
    def iolist(self) -> IoList:
        """The contacts as an I/O list."""
        rows = self._rows.loc[self._rows.index.repeat(self.contacts)].reset_index(drop=True)
        number = np.tile(np.arange(1, self.contacts + 1), self.modules)
        tags = [f"{d} contact {n}" for d, n in zip(rows["device"], number, strict=True)]
        points = rows[["x_m", "device"]].assign(tag=tags, signal=self.signal, system="plant")
        points = points.assign(y_m=self.drop, z_m=0.0, update_ms=1000.0)
        return IoList.from_table(points, "counts of a plant")

    @cached_property
    def hardwired(self) -> Design:
        """Design with a cable from every contact to the cabinet."""
        points = self.iolist.points
        # The common return of a module runs in the cable to its first contact.
        first = np.tile(np.arange(self.contacts) == 0, self.modules)
        used = points["conductors"] + first * SIGNALS[self.signal].common
        route = points["x_m"] + points["y_m"]
        cables = _runs("home run", "cabinet", points["tag"], _PAIR, "", route, used, True)
        return self._made("hardwired", cables, [_device("cabinet", "cabinet")])

    @cached_property
    def on_asi(self) -> Design:
        """Design with the contacts on AS-i modules, and the lines' masters in the cabinet."""
        rows, points = self._rows, self.iolist.points
        first, segments = (rows["place"] == 0).to_numpy(), rows["segment"]
        near = (
            rows["device"].shift(self.lines).where(~first, segments.str.replace("line", "master"))
        )
        route = np.where(first, self.distance, self.spacing)
        trunk = _runs("trunk", near, rows["device"], _ASI, segments, route, ASI_PAIR, first)
        at = rows.loc[rows.index.repeat(self.contacts)].reset_index(drop=True)
        used = points["conductors"]
        drops = _runs(
            "drop", at["device"], points["tag"], _PAIR, at["segment"], self.drop, used, False
        )
        devices, lines = [_device("cabinet", "cabinet")], []
        for line, (segment, runs) in enumerate(trunk.groupby("segment", sort=False), 1):
            length, count = runs["length_m"].sum(), len(runs)
            for kind in ("master", "supply"):
                devices.append(_device(f"{kind} {line}", kind, segment, at="cabinet"))
            for n in range(1, ceil(length / _SEGMENT)):
                devices.append(_device(f"repeater {line}.{n}", "repeater", segment, n * _SEGMENT))
            row: dict[str, Any] = dict.fromkeys(_UNKNOWN, np.nan)
            row |= {"segment": segment, "bus": "AS-i", "points": self.contacts * count}
            lines.append({**row, "devices": count, "length_m": length, "slowest_update_ms": 1000.0})
        for device, segment, x in zip(rows["device"], segments, rows["x_m"], strict=True):
            devices.append(_device(device, "module", segment, x))
        return self._made("AS-i", pd.concat([trunk, drops]), devices, at, lines)

    def _made(
        self,
        name: str,
        cables: pd.DataFrame,
        devices: list[dict[str, object]],
        at: pd.DataFrame | None = None,
        segments: Sequence[Mapping[str, object]] = (),
    ) -> Design:
        """Return a design; `at` has the module and the segment of each point, if it has one."""
        points = self.iolist.points[["tag"]].assign(address="", fits=True)
        if at is None:
            points = points.assign(bus="hardwired", segment="", device="cabinet", response_ms=0.0)
        else:
            points = points.assign(bus="AS-i", segment=at["segment"], device=at["device"])
            points = points.assign(response_ms=np.nan)
        tables = {"points": points, "devices": devices, "cables": cables, "segments": segments}
        frames: dict[str, Any] = {of: frame(of, tables.get(of, ())) for of in COLUMNS}
        return Design(name, self.iolist, _SITE, **frames, settings=Settings({"spare": 0}))


def _runs(
    kind: str,
    a: object,
    b: pd.Series,
    cable: str,
    segment: object,
    route: object,
    used: object,
    at_cabinet: Any,
) -> pd.DataFrame:
    table = pd.DataFrame({"a": a, "b": b, "segment": segment, "route_m": route, "used": used})
    table = table.assign(kind=kind, cable=cable, line="", at_cabinet=at_cabinet)
    table["length_m"] = _SITE.length(table["route_m"].to_numpy(dtype=float))
    table["conductors"] = table["used"]
    table["run"] = [f"{kind} {a} - {b}" for a, b in zip(table["a"], table["b"], strict=True)]
    return table


def _device(
    name: str, kind: str, segment: object = "", x: float = 0.0, at: str = ""
) -> dict[str, object]:
    xyz = {"x_m": x, "y_m": 0.0, "z_m": 0.0}
    return {"device": name, "kind": kind, "segment": segment, "at": at, **xyz}
