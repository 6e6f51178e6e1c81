"""A small plant from counts: its conductors and its cost, hardwired and on AS-i."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from math import ceil
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from shipnet.design.costs import conductors_at_cabinet, quantities
from shipnet.design.designs import Network, frame
from shipnet.design.iolist import IoList
from shipnet.design.site import Site
from shipnet.design.uncertainty import draw
from shipnet.errors import ArgumentError
from shipnet.fields import check_whole
from shipnet.signals import SIGNALS

if TYPE_CHECKING:
    from shipnet.design.catalogue import Cable
    from shipnet.design.settings import Assumptions


# How many conductors a set of points needs: one pair each, or one line for all ------------------


def hardwired_conductors(points: Mapping[str, int], *, groups: int = 1) -> int:
    """Count the conductors when every point has its own wires to the control panel."""
    groups = check_whole("groups", groups, 1, 10**9)
    total = 0
    for kind, number in points.items():
        if kind not in SIGNALS:
            raise ArgumentError(
                f"kind of point is {kind!r}; it must be one of {', '.join(SIGNALS)}"
            )
        number = check_whole(f"number of {kind}", number, 0, 10**9)
        signal = SIGNALS[kind]
        total += number * signal.conductors + signal.common * min(groups, number)
    return total


def asi_conductors(lines: int = 1, *, auxiliary: bool = False) -> int:
    """Count the conductors of AS-i lines: two each carry data and supply at once."""
    return check_whole("lines", lines, 0, 10**9) * (4 if auxiliary else 2)


def slaves_needed(
    inputs: int, outputs: int = 0, *, inputs_per_slave: int = 4, outputs_per_slave: int = 4
) -> int:
    """Count the modules that hold so many digital points."""
    inputs = check_whole("inputs", inputs, 0, 10**9)
    outputs = check_whole("outputs", outputs, 0, 10**9)
    inputs_per_slave = check_whole("inputs_per_slave", inputs_per_slave, int(inputs > 0), 10**9)
    outputs_per_slave = check_whole("outputs_per_slave", outputs_per_slave, int(outputs > 0), 10**9)
    return max(
        ceil(inputs / inputs_per_slave) if inputs else 0,
        ceil(outputs / outputs_per_slave) if outputs else 0,
    )


def lines_needed(slaves: int, *, slaves_per_line: int = 62) -> int:
    """Count the AS-i lines, and so the masters, that so many slaves need."""
    slaves = check_whole("slaves", slaves, 0, 10**9)
    return ceil(slaves / check_whole("slaves_per_line", slaves_per_line, 1, 62))


@dataclass(frozen=True, slots=True)
class Saving:
    """The same points, hardwired and on a bus."""

    hardwired: int
    bus: int

    def __post_init__(self) -> None:
        """Check both counts."""
        object.__setattr__(self, "hardwired", check_whole("hardwired", self.hardwired, 1, 10**12))
        object.__setattr__(self, "bus", check_whole("bus", self.bus, 0, 10**12))

    @property
    def left(self) -> float:
        """Conductors on the bus as a share of those hardwired."""
        return self.bus / self.hardwired

    @property
    def saved(self) -> float:
        """Share of the hardwired conductors that is no longer needed."""
        return 1 - self.left

    def __str__(self) -> str:
        """Say both shares."""
        return (
            f"{self.hardwired} -> {self.bus} conductors: "
            f"{self.left:.2%} left, {self.saved:.2%} saved".replace("%", " %")
        )


def saving(points: Mapping[str, int], *, lines: int = 1, groups: int = 1) -> Saving:
    """Count the same points twice, hardwired and on AS-i lines."""
    return Saving(hardwired_conductors(points, groups=groups), asi_conductors(lines))


def count_points(iolist: pd.DataFrame) -> dict[str, int]:
    """Count the points of an I/O list by kind."""
    missing = [column for column in ("tag", "signal") if column not in iolist.columns]
    if missing:
        raise ArgumentError(f"the I/O list has no column {' and no column '.join(missing)}")
    unknown = iolist[~iolist["signal"].isin(list(SIGNALS))]
    faults = [f"{row.tag}: unknown kind {row.signal!r}" for row in unknown.itertuples()]
    faults += [f"{tag}: stands twice" for tag in iolist["tag"][iolist["tag"].duplicated()]]
    if faults:
        raise ArgumentError(f"{'; '.join(faults)}; known kinds are {', '.join(SIGNALS)}")
    kinds = iolist["signal"].astype(str).value_counts()
    return {str(kind): int(number) for kind, number in kinds.items()}


# Plants small enough to be laid out by hand: contacts in groups along a way from the cabinet

#: One pair of 0.75 mm2 to a contact, and a shipboard cable for AS-i.
_PAIR, _ASI = "MI1P075", "ASI_MARINE"

#: Cable of a line without a repeater [m]; a repeater adds as much (kim2023, section 3.3).
_SEGMENT = 100.0


@dataclass(frozen=True)
class Plant:
    """Modules with contacts, one behind the other along each of a number of lines."""

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


# What AS-i saves on a plant of which a paper names the counts: conductors, and cost

#: What "wiring cost" may mean, and the figures that it then adds up.
COUNTED: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "cable": ("cable cost",),
        "cable and labour": ("cable cost", "labour cost"),
        "cable, labour and hardware": ("total cost",),
    }
)


def conductor_saving(plant: Plant) -> Saving:
    """Return the conductors at the cabinet of a plant, hardwired and on AS-i."""
    return Saving(conductors_at_cabinet(plant.hardwired), conductors_at_cabinet(plant.on_asi))


def cost_saving(
    plant: Plant,
    assumptions: Assumptions | None = None,
    *,
    rng: np.random.Generator,
    draws: int = 10_000,
    cables: Mapping[str, Cable] | None = None,
) -> pd.DataFrame:
    """Return the share of the wiring cost that AS-i saves on a plant, for each reading of it."""
    import pandas as pd

    options = {"hardwired": plant.hardwired, "AS-i": plant.on_asi}
    sample = draw(options, assumptions, rng=rng, draws=draws, cables=cables)
    nominal = {
        name: quantities(network, assumptions, cables=cables).table["nominal"]
        for name, network in options.items()
    }
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
