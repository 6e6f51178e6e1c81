"""Conductors and cost, hardwired and on AS-i, of a small plant that is defined by counts."""

from __future__ import annotations

from collections.abc import Mapping
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
            low, median, high = np.quantile(1 - bus / wired, [0.05, 0.5, 0.95])
            rows[counted] = {
                "nominal": 1 - nominal["AS-i"][names].sum() / nominal["hardwired"][names].sum(),
                "low": low,
                "median": median,
                "high": high,
            }
        return pd.DataFrame.from_dict(rows, orient="index").rename_axis("counted")

    @cached_property
    def _rows(self) -> pd.DataFrame:
        """One row per module: line, position on the line, module name and segment name."""
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
        """The contacts as an I/O list."""
        rows = self._rows.loc[self._rows.index.repeat(self.contacts)].reset_index(drop=True)
        nothing = np.full(len(rows), np.nan)
        port = np.tile(np.arange(1, self.contacts + 1), self.modules)
        points = pd.DataFrame(
            {
                "tag": [f"{d} contact {n}" for d, n in zip(rows["device"], port, strict=True)],
                "system": "plant", "type": "DI", "signal": self.signal,
                "conductors": SIGNALS[self.signal].conductors,
                "x_m": rows["x_m"], "y_m": self.drop, "z_m": 0.0, "box": "",
                "box_x_m": nothing, "box_y_m": nothing, "box_z_m": nothing,
                "to_box_m": nothing, "home_run_m": nothing, "update_ms": 1000.0,
                "category": "", "note": "", "device": rows["device"], "ex": "",
            }
        )  # fmt: skip
        return IoList(points, "counts of a plant")

    @cached_property
    def hardwired(self) -> Design:
        """Design with a cable from every contact to the cabinet."""
        points = self.iolist.points
        # The common return of a module runs in the cable to its first contact.
        first = np.tile(np.arange(self.contacts) == 0, self.modules)
        used = points["conductors"] + first * SIGNALS[self.signal].common
        return self._made(
            "hardwired",
            points=_points(points["tag"], "hardwired", device="cabinet"),
            devices=[_device("cabinet", "cabinet")],
            cables=self._runs(
                "home run", a="cabinet", b=points["tag"], cable=_PAIR, segment="",
                route=points["x_m"] + points["y_m"], at_cabinet=True, used=used,
            ),
            segments=(),
        )  # fmt: skip

    @cached_property
    def on_asi(self) -> Design:
        """Design with the contacts on AS-i modules, and the lines' masters in the cabinet."""
        rows, points = self._rows, self.iolist.points
        first = (rows["place"] == 0).to_numpy()
        masters = rows["segment"].str.replace("line", "master")
        before = rows["device"].shift(self.lines)
        trunk = self._runs(
            "trunk", a=before.where(~first, masters), b=rows["device"], cable=_ASI,
            segment=rows["segment"], route=np.where(first, self.distance, self.spacing),
            at_cabinet=first, used=ASI_PAIR,
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
        return self._made(
            "AS-i",
            points=_points(
                points["tag"], "AS-i", segment=own["segment"], device=own["device"],
                response_ms=nan,
            ),
            devices=devices,
            cables=pd.concat([trunk, drops]),
            segments=[
                {"segment": segment, "bus": "AS-i", "points": self.contacts * n, "devices": n,
                 "length_m": length, "bus_time": nan, "capacity_used": nan, "response_ms": nan,
                 "slowest_update_ms": 1000.0}
                for (segment, length), n in zip(lengths.items(), count, strict=True)
            ],
        )  # fmt: skip

    def _runs(self, kind: str, *, route: object, used: object, **columns: object) -> pd.DataFrame:
        table = pd.DataFrame({**columns, "route_m": route, "used": used, "kind": kind, "line": ""})
        table["length_m"] = _SITE.length(table["route_m"].to_numpy(dtype=float))
        table["conductors"] = table["used"]
        table["run"] = [f"{kind} {a} - {b}" for a, b in zip(table["a"], table["b"], strict=True)]
        return table

    def _made(self, name: str, **tables: Any) -> Design:
        made: dict[str, Any] = {of: frame(of, tables.get(of, ())) for of in COLUMNS}
        return Design(name, self.iolist, _SITE, **made, settings=Settings({"spare": 0}))


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
