"""Conductors, cable, hours and costs of designs, and their sensitivity to the assumptions."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import floor, isinf, isnan, log10, nan
from types import MappingProxyType
from typing import Any, TypeAlias

import numpy as np

from shipnet import style
from shipnet.arrays import Floats
from shipnet.design.catalogue import (
    CABLE_FIGURES,
    LEVELS,
    Level,
    read_assumptions,
    values_at,
    with_spare,
    words,
)
from shipnet.design.catalogue import cables as catalogue
from shipnet.design.layout import Layout
from shipnet.design.plot import in_thousands, plot_ranges
from shipnet.errors import ArgumentError
from shipnet.fields import check_choice, check_rng, check_whole
from shipnet.html import as_html
from shipnet.lazy import Axes, pd


def number(value: float) -> str:
    """Return a number as text, with three significant digits if it is not whole."""
    if isnan(value):
        return "-"
    if isinf(value):
        return "without limit"
    if value == int(value):
        return f"{value:,.0f}"
    places = 2 - floor(log10(abs(value)))
    return f"{round(float(value), places):,.{max(places, 0)}f}"


# Counts of the parts of a design: devices and channels -------------------------------------------

#: Arguments that `numpy.random.default_rng` accepts: a generator, a seed or None.
Rng: TypeAlias = np.random.Generator | int | None

#: Names of the price and time of each kind of device; some kinds are preceded by their bus.
_DEVICES: dict[str, tuple[str, ...]] = {
    "cabinet": (),
    "box": ("box", "box_time"),
    "module": ("asi_module", "module_time"),
    "CAN station": ("can_station", "station_time"),
    "station": ("modbus_station", "station_time"),
    "AS-i master": ("asi_master", "master_time"),
    "CAN master": ("can_master", "master_time"),
    "master": ("modbus_master", "master_time"),
    "repeater": ("repeater", "part_time"),
    "AS-i supply": ("asi_supply", "part_time"),
    "supply": ("supply", "part_time"),
    "auxiliary supply": ("supply", "part_time"),
    "terminator": ("terminator", "part_time"),
}


#: Buses whose stations read their points by channels.
_STATIONS = ("CAN", "Modbus RTU")


def conductors_at_cabinet(design: Layout) -> int:
    """Count the conductors in use in the cables that enter the cabinet."""
    runs = design.cables
    return int(runs["used"][runs["at_cabinet"]].sum())


def items_of(design: Layout) -> dict[str, int]:
    """Return the number of each part and task of a design, by the name of its price or time."""
    analogue = design.iolist.points["type"].isin(["AI", "AO"]).to_numpy()
    safe = design.points["fits"].to_numpy() & (design.iolist.points["ex"] != "").to_numpy()
    devices, items = design.devices, Counter[str]()
    segments = dict(zip(design.segments["segment"], design.segments["bus"], strict=True))
    for kind, segment in zip(devices["kind"], devices["segment"], strict=True):
        items.update(_DEVICES.get(f"{segments.get(segment, '')} {kind}", _DEVICES[kind]))
    modules = set(devices.loc[devices["kind"] == "module", "device"])
    drops = design.cables[design.cables["b"].isin(design.points["tag"].to_numpy()[analogue])]
    of_analogue = len(modules & {*design.points["device"][analogue], *drops["a"]})
    items.update({"asi_analogue_module": of_analogue, "asi_module": -of_analogue})
    bus, spare = design.points["bus"].to_numpy(), design.settings.spare
    for reader, read in (("plc", bus == "hardwired"), ("station", np.isin(bus, _STATIONS))):
        for kind, mask in (("digital", read & ~analogue), ("analogue", read & analogue)):
            items[f"{reader}_{kind}_channel"] = with_spare(int(mask.sum()), spare)
    # A station connected to both lines of a redundant pair has a second interface.
    trunk = design.cables[design.cables["kind"] == "trunk"]
    a, b = (trunk.loc[trunk["line"] == line, ["a", "b"]].to_numpy().ravel() for line in "AB")
    stations = devices["device"][devices["kind"] == "station"]
    items["second_interface"] = len({*a} & {*b} & {*stations})
    items["barrier"] = items["barrier_time"] = int(safe.sum())
    items["gland"] = items["gland_time"] = 2 * len(design.cables)
    return {name: number for name, number in items.items() if number}


# The figures of a design, each with a low, nominal and high value --------------------------------

#: Figures of a design, with a label and a unit for each.
FIGURES: Mapping[str, tuple[str, str]] = MappingProxyType(
    {
        "conductors_at_cabinet": ("conductors at the cabinet", ""),
        "conductors_laid": ("conductors laid", ""),
        "cables": ("cables", ""),
        "cable_length_km": ("cable length", "km"),
        "cable_mass_kg": ("cable mass", "kg"),
        "cable_volume_l": ("cable volume", "l"),
        "cross_section_cm2": ("cross-section", "cm2"),
        "terminations": ("terminations", ""),
        "labour_h": ("labour", "h"),
        "cable_cost_eur": ("cable cost", "EUR"),
        "hardware_cost_eur": ("hardware cost", "EUR"),
        "labour_cost_eur": ("labour cost", "EUR"),
        "total_cost_eur": ("total cost", "EUR"),
    }
)

#: Columns of a comparison, with a label and a unit for each.
LABELS: Mapping[str, tuple[str, str]] = {
    "points_left_out": ("points left out", ""),
    **FIGURES,
    "total_cost_low_eur": ("total cost, low", "EUR"),
    "total_cost_high_eur": ("total cost, high", "EUR"),
    "bus_time": ("bus time", ""),
    "capacity_used": ("capacity used", ""),
    "worst_response_ms": ("worst response", "ms"),
    "lost_by_cable": ("lost by one cable", ""),
    "lost_by_device": ("lost by one device", ""),
    "lost_by_failure": ("lost by one failure", ""),
    "rules_met": ("rules met", ""),
    "rules_violated": ("rules violated", ""),
    "rules_not_verified": ("rules not verified", ""),
    "pareto": ("Pareto-optimal", ""),
}

#: Columns that decide which designs are Pareto-optimal (lower is better), and their names.
CRITERIA = ("total_cost_eur", "worst_response_ms", "lost_by_failure")
WEIGHED = "{}, {} and points {}".format(*(LABELS[name][0] for name in CRITERIA))


def label(column: str) -> str:
    """Return the label of a column of a comparison, with its unit in brackets."""
    words, unit = LABELS.get(column, (column, ""))
    return f"{words} [{unit}]" if unit else words


def counted(table: pd.DataFrame) -> dict[str, str]:
    """Return the label of each design: its name, and the number of points left out if any."""
    left = table["points_left_out"].items()
    return {str(name): f"{name} ({n:.0f} left out)" if n else str(name) for name, n in left}


#: Assumptions that have a range for each cable, and the key in `CABLE_FIGURES`. One level applies
#: to all cables, so that all are expensive or all are cheap.
CABLE_RANGES = MappingProxyType({name: key for key, (_, _, name) in CABLE_FIGURES.items()})

#: Mass of 1 m of copper with a cross-section of 1 mm2 [kg]; its density is 8.96 g/cm3.
_COPPER = 8.96e-3

#: Costs that are not included.
EXCLUDED = (
    "sensors and actuators, and their hook-up and test, which are the same in every option",
    "engineering, documentation and software",
    "commissioning and training",
    "class approval and type approval",
    "spare parts",
    "what a point needs to be wired to two modules of doubled AS-i lines at once, which is assumed "
    "to be possible: a second contact, diodes, or two inputs in one current loop",
    "cable trays, penetrations and the cabinet itself",
    "cable offcuts, and the termination of spare conductors and screens",
    "operation, maintenance and the cost of a failure",
)


@dataclass(frozen=True, eq=False)
class Quantities:
    """The low, nominal and high figures of a design; `Design.quantities` returns them.

    Parameters
    ----------
    name : str
        Name of the design.
    figures : pandas.DataFrame
        One row per figure: low, nominal, high and unit.
    assumptions : pandas.DataFrame
        One row per assumption used: name, low, nominal, high, unit, status and source.
    by_cable : pandas.DataFrame
        One row per type of cable: runs, length_m, mass_kg and cost_eur, all nominal.
    unconnected : int
        Number of points that are not connected, and therefore not included in any figure.

    Examples
    --------
    >>> from shipnet.design import Plant
    >>> takes = Plant(10, contacts=2, distance=20, spacing=4).on_asi.quantities()
    >>> takes
    <Quantities of 'AS-i': 2 conductors, 0.24 km, 7 kEUR (3 to 17)>
    >>> round(takes["total_cost_eur"]), takes.table().loc["cable_length_km", "unit"]
    (7440, 'km')
    """

    name: str
    figures: pd.DataFrame
    assumptions: pd.DataFrame
    by_cable: pd.DataFrame
    unconnected: int

    def __getitem__(self, figure: str) -> float:
        """Return the nominal value of a figure."""
        return float(self.figures["nominal"][check_choice("figure", figure, FIGURES)])

    def table(self) -> pd.DataFrame:
        """Return one row per figure: low, nominal, high and unit."""
        return self.figures.copy()

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the costs of cable, hardware and labour, and their total, each with its range."""
        names = ["cable_cost_eur", "hardware_cost_eur", "labour_cost_eur", "total_cost_eur"]
        ends = self.figures.loc[names]
        ends = ends.set_axis([label(name).partition(" [")[0] for name in names])
        return plot_ranges(ends, f"cost of {self.name} [EUR]", ax=ax)

    def __repr__(self) -> str:
        if isnan(self["total_cost_eur"]):
            return f"<Quantities of {self.name!r}: no point is connected>"
        cost = self.figures.loc["total_cost_eur"]
        left_out = f"; {self.unconnected} points not connected" if self.unconnected else ""
        return (
            f"<Quantities of {self.name!r}: {self['conductors_at_cabinet']:.0f} conductors, "
            f"{self['cable_length_km']:.2f} km, {cost['nominal'] / 1e3:.0f} kEUR "
            f"({cost['low'] / 1e3:.0f} to {cost['high'] / 1e3:.0f}){left_out}>"
        )

    _repr_html_ = as_html


def ranges_of(quantities: Mapping[str, Quantities], figure: str) -> pd.DataFrame:
    """Return the low, nominal and high value of a figure for each of several designs."""
    ends = {name: one.figures.loc[figure, list(LEVELS)] for name, one in quantities.items()}
    return pd.DataFrame(ends).T.astype(float)


class Model:
    """The figures of one design as a function of the assumptions."""

    def __init__(self, design: Layout) -> None:
        self._connected = design.connected
        self.items = items_of(design)
        self.assumptions = design.settings.assumptions
        self._at_cabinet = conductors_at_cabinet(design)
        runs, types = design.cables, catalogue()
        summed = ["runs", "length_m", "ends", "conductors", "at_cabinet"]
        counted = runs.assign(runs=1, ends=2 * runs["used"])
        self.laid: pd.DataFrame = counted.groupby("cable")[summed].sum()
        self._sums = {name: column.to_numpy(dtype=float) for name, column in self.laid.items()}
        if unknown := sorted(set(self.laid.index) - set(types)):
            raise ArgumentError(f"the catalogue has no cable {', '.join(unknown)}")
        self.cables = {str(name): types[str(name)] for name in self.laid.index}
        self._section = 1e-6 * np.array([c.area_mm2 for c in self.cables.values()], dtype=float)
        self._ranges = {
            name: np.array([self.assumptions[f"{key}_{id}"] for id in self.cables]).reshape(-1, 3)
            for name, key in CABLE_RANGES.items()
        }
        dearer = np.subtract(
            self.assumptions["copper_price"], read_assumptions()["copper_price"].range
        )
        copper = [_COPPER * c.conductors * c.section for c in self.cables.values()]
        prices = self._ranges["cable_price"] + np.outer(copper, dearer)
        self._ranges["cable_price"] = np.maximum(prices, 0.0)

    def nominal(self, name: str) -> Floats:
        """Return the nominal value of one of `CABLE_RANGES` for each type of cable laid."""
        return values_at(self._ranges[name], "nominal")

    @property
    def names(self) -> list[str]:
        """Names of the assumptions that the figures depend on; cable assumptions come first."""
        factors = ["laid_length", "cable_diameter"] if self.cables else []
        if self.cables and self.assumptions.entry("copper_price").status == "given":
            factors.append("copper_price")
        used = [*factors, "labour_rate", *self.items]
        return [*(CABLE_RANGES if self.cables else ()), *(n for n in self.assumptions if n in used)]

    def figures(
        self, levels: Mapping[str, Level] | None = None, *, others: Level = "nominal"
    ) -> dict[str, Any]:
        """Return every figure with some assumptions at `levels`, and all others at `others`."""
        if not self._connected:  # the design has no figures
            return dict.fromkeys(FIGURES, nan)
        chosen, laid = {} if levels is None else levels, self._sums

        def at(name: str) -> Floats:
            ranges = self._ranges.get(name)
            ranges = np.array([self.assumptions[name]]) if ranges is None else ranges
            return values_at(ranges, chosen.get(name, others))

        def due(unit: str) -> Floats | float:
            entry, items = self.assumptions.entry, self.items.items()
            terms = (n * at(name)[..., 0] for name, n in items if entry(name).unit == unit)
            return sum(terms, start=0.0)

        length = laid["length_m"] * at("laid_length")
        section_m2 = self._section * at("cable_diameter") ** 2
        ends = laid["ends"] * at("termination_time")
        labour = (length * at("laying_time") + ends).sum(-1) + due("h")
        cable_cost = (length * at("cable_price")).sum(-1)
        hardware_cost = due("EUR")
        labour_cost = labour * at("labour_rate")[..., 0]
        figures = {
            "conductors_at_cabinet": self._at_cabinet,
            "conductors_laid": laid["conductors"].sum(),
            "cables": laid["runs"].sum(),
            "cable_length_km": length.sum(-1) / 1e3,
            "cable_mass_kg": (length * at("cable_mass")).sum(-1),
            "cable_volume_l": (length * section_m2).sum(-1) * 1e3,
            "cross_section_cm2": (laid["at_cabinet"] * section_m2).sum(-1) * 1e4,
            "terminations": laid["ends"].sum(),
            "labour_h": labour,
            "cable_cost_eur": cable_cost,
            "hardware_cost_eur": hardware_cost,
            "labour_cost_eur": labour_cost,
            "total_cost_eur": cable_cost + hardware_cost + labour_cost,
        }
        return {name: value if np.ndim(value) else float(value) for name, value in figures.items()}

    @property
    def used(self) -> pd.DataFrame:
        """Table of the assumptions in use: name, low, nominal, high, unit, status and source."""
        shown = {
            f"{words(name)} of {id}": f"{key}_{id}"
            for name, key in CABLE_RANGES.items()
            for id in self.cables
        }
        shown |= {name: name for name in self.names if name not in CABLE_RANGES}
        rows = []
        for name, key in shown.items():
            entry = self.assumptions.entry(key)
            rows.append((name, *entry.range, entry.unit, entry.status, entry.source))
        return pd.DataFrame(rows, columns=["name", *LEVELS, "unit", "status", "source"])


def quantities(design: Layout) -> Quantities:
    """Return the figures of a design under the assumptions of its settings."""
    model = Model(design)
    table = pd.DataFrame({level: model.figures(others=level) for level in LEVELS})
    units = {name: unit for name, (_, unit) in FIGURES.items()}
    return Quantities(
        name=design.name,
        figures=table.assign(unit=pd.Series(units)).rename_axis("figure"),
        assumptions=model.used,
        by_cable=_by_cable(model),
        unconnected=int((design.points["bus"] == "").sum()),
    )


def bill_table(design: Layout) -> pd.DataFrame:
    """Return the nominal costs of a design's cables, parts and work, which add up to the total."""
    model = Model(design)
    cables, assumed = _by_cable(model), model.assumptions
    rows = [
        ("cable", name, row["length_m"], "m", price)
        for (name, row), price in zip(cables.iterrows(), model.nominal("cable_price"), strict=True)
    ]
    rows += [
        ("part", words(name), count, "", assumed[name].nominal)
        for name, count in model.items.items()
        if assumed.entry(name).unit == "EUR"
    ]
    hours, rate = model.figures()["labour_h"], assumed["labour_rate"].nominal
    rows.append(("work", "labour", hours, "h", rate))
    table = pd.DataFrame(rows, columns=["kind", "item", "number", "unit", "price_eur"])
    return table.assign(cost_eur=table["number"] * table["price_eur"])


def _by_cable(model: Model) -> pd.DataFrame:
    length = model.laid["length_m"] * model.assumptions["laid_length"].nominal
    mass, cost = length * model.nominal("cable_mass"), length * model.nominal("cable_price")
    return model.laid[["runs"]].assign(length_m=length, mass_kg=mass, cost_eur=cost)


# The distribution of the figures when every assumption is drawn from its range -------------------


def draw(designs: Mapping[str, Layout], *, rng: Rng, draws: int = 10_000) -> pd.DataFrame:
    """Draw every assumption from its range `draws` times, and return the figures of each draw."""
    models = {name: Model(design) for name, design in designs.items()}
    rng = check_rng(rng)
    n = check_whole("draws", draws, 1, 1_000_000)
    # All assumptions are drawn, in use or not, so that adding an option does not change the draws.
    names = [*CABLE_RANGES, *next(iter(models.values())).assumptions]
    levels = dict(zip(names, rng.random((len(names), n)), strict=True))
    columns: dict[tuple[str, str], Floats] = {}
    for option, model in models.items():
        for figure, values in model.figures(levels).items():
            columns[option, figure] = np.broadcast_to(values, n)
    return pd.DataFrame(columns).rename_axis(columns=["option", "figure"])


def likely(sample: pd.DataFrame) -> pd.DataFrame:
    """Return the median and the central 90 % interval of each column of a sample."""
    table = sample.quantile([0.05, 0.5, 0.95]).T.set_axis(["low", "median", "high"], axis=1)
    units = [FIGURES[figure][1] for figure in table.index.get_level_values("figure")]
    return table.assign(unit=units)


# The effect of setting each assumption low and high, with all others nominal ---------------------


@dataclass(frozen=True, eq=False)
class Tornado:
    """Effect on a figure of setting each assumption low and high, with all others nominal.

    `Comparison.tornado` returns a tornado.

    Parameters
    ----------
    figure : str
        The figure, such as ``"total_cost_eur"``.
    between : tuple of str
        One design, or two whose difference is shown (the first minus the second).
    nominal : dict of str to float
        The figure of each design with every assumption nominal.
    every : pandas.DataFrame
        One row per assumption, the largest swing first: the figure of each design with the
        assumption low and high, the differences, whether the order changes, and the swing.

    Examples
    --------
    >>> from shipnet.design import Plant, compare
    >>> plant = Plant(10, contacts=2, distance=20, spacing=4)
    >>> found = compare([plant.hardwired, plant.on_asi]).tornado()
    >>> found.between, found.top(1)
    (('AS-i', 'hardwired'), ['laying_time'])
    """

    figure: str
    between: tuple[str, ...]
    nominal: dict[str, float]
    every: pd.DataFrame

    def table(self) -> pd.DataFrame:
        """Return, per assumption, the figure with the assumption low and high, and the swing."""
        return self.every.copy()

    @style.applied
    def plot(self, ax: Axes | None = None, *, rows: int = 8) -> Axes:
        """Draw the assumptions with the largest swing, the longest bar on top."""
        ax, names = style.axes(ax), self.top(rows)
        ends = self.ends.loc[names]
        y, base = np.arange(len(names)), self.at_nominal
        for level, colour in (("low", "C5"), ("high", "C1")):
            values = ends[level].to_numpy()
            ax.barh(y, values - base, left=base, height=0.7, color=colour, label=f"at its {level}")
        ax.axvline(base, color="0.25", linewidth=1, label="all nominal")
        ax.set_yticks(y, [words(name) for name in names])
        ax.set_ylim(max(len(names), 1) - 0.5, -0.9)
        ax.set_xlabel(f"{self.subject} [{style.sign(self.unit)}]" if self.unit else self.subject)
        in_thousands(ax)
        ax.locator_params(axis="x", nbins=6)
        ax.grid(visible=False, axis="y")
        low, high = ax.get_xlim()
        if len(self.between) == 2 and low <= 0 <= high:
            style.moment(ax, 0, "equal")
        ax.legend(loc="lower right", bbox_to_anchor=(1, 1), ncols=3)
        return ax

    @property
    def unit(self) -> str:
        """Unit of the figure."""
        return FIGURES[self.figure][1]

    @property
    def subject(self) -> str:
        """The figure and its designs in words."""
        return f"{FIGURES[self.figure][0]} of {' less that of '.join(self.between)}"

    @property
    def at_nominal(self) -> float:
        """The figure, or the difference of two designs, with every assumption nominal."""
        first, *second = (self.nominal[option] for option in self.between)
        return first - sum(second)

    @property
    def ends(self) -> pd.DataFrame:
        """The figure, or the difference, at the low and high value of each assumption."""
        of = "difference" if len(self.between) == 2 else self.between[0]
        table = self.every[[f"{of} at low", f"{of} at high"]]
        return table.set_axis(["low", "high"], axis=1)

    def top(self, n: int = 3) -> list[str]:
        """Return the names of up to `n` assumptions with a non-zero swing, largest swing first."""
        most = check_whole("n", n, 0, 1000)
        return [str(name) for name in self.every.index[self.every["swing"] > 0][:most]]

    def __repr__(self) -> str:
        return f"<Tornado: {self}>"

    _repr_html_ = as_html

    def __str__(self) -> str:
        unit = f" {self.unit}" if self.unit else ""
        low, high = self.ends["low"], self.ends["high"]
        swings = [f"{words(one)} ({number(low[one])} to {number(high[one])})" for one in self.top()]
        what = f"{self.subject} is {number(self.at_nominal)}{unit}"
        return f"{what}; what matters most: {', '.join(swings) or 'no assumption'}"


def tornado(designs: Mapping[str, Layout], figure: str = "total_cost_eur") -> Tornado:
    """Vary one assumption at a time; subtract the first design's figure from the lowest other."""
    check_choice("figure", figure, FIGURES)
    models = {name: Model(design) for name, design in designs.items()}
    nominal = {name: float(model.figures()[figure]) for name, model in models.items()}
    first, *others = nominal
    pair = (min(others, key=lambda name: nominal[name]), first) if others else (first,)
    names = list(dict.fromkeys(name for option in pair for name in models[option].names))
    columns = {
        f"{option} at {level}": [models[option].figures({name: level})[figure] for name in names]
        for option in pair
        for level in LEVELS[::2]
    }
    table = pd.DataFrame(columns, index=pd.Index(names, name="assumption"), dtype=float)
    result = Tornado(figure, pair, {option: nominal[option] for option in pair}, table)
    if len(pair) == 2:
        for level in ("low", "high"):
            a, b = (table[f"{option} at {level}"] for option in pair)
            table[f"difference at {level}"] = a - b
        table["order changes"] = (result.ends * result.at_nominal < 0).any(axis=1)
    table["swing"] = (result.ends["high"] - result.ends["low"]).abs()
    return replace(result, every=table.sort_values("swing", ascending=False, kind="stable"))
