"""The ship design tool: a comparison of ways to connect an I/O list, with a report."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property, lru_cache
from pathlib import Path
from types import MappingProxyType
from typing import Any, ClassVar

import numpy as np
from matplotlib.axes import Axes

from shipnet import datasets
from shipnet.design.catalogue import Assumptions, Range
from shipnet.design.comparison import Comparison, compare
from shipnet.design.designs import Design
from shipnet.design.failures import worst
from shipnet.design.iolist import IoList, read_iolist
from shipnet.design.layout import Site, site_of
from shipnet.design.planning import OPTIONS, plan
from shipnet.design.report import BANNER
from shipnet.design.rules import RULE_SETS, RuleSet
from shipnet.design.settings import Settings, names
from shipnet.design.tables import zipped
from shipnet.design.words import Reading
from shipnet.errors import ArgumentError, InputError
from shipnet.fields import check_fields, choice, number, record, switch, text
from shipnet.tables import text_of
from shipnet.tools._tool import Tool
from shipnet.tools._view import Button, Upload, View

#: Figures to choose from; the key of a figure against cost is its column in the comparison.
PICTURES = {
    "cost": "cost of each option, with its range",
    "conductors_at_cabinet": "conductors against cost",
    "worst_response_ms": "worst response against cost",
    "lost_by_failure": "points lost in the worst failure, against cost",
    "assumptions": "the assumptions that matter most",
}

#: The cabinet of the example ship.
_CABINET = "26, 6, 14"

#: Controls that are folded away, so that a page opens with the result.
_FOLDS = {
    "I/O list and cabinet": ("points", "name", "cabinet"),
    "limits and prices": (
        "rules",
        "update_ms",
        "list_lengths",
        "detour",
        "spare",
        "labour",
        "parts",
        "own",
    ),
}

#: Maximum length of a list in characters, and in bytes as JSON; a saved state has at most 2 MB.
_LONGEST = 1_000_000
_STATE = 1_900_000

_MIND = (
    f"{BANNER} Prices, hours and masses are assumptions until you enter a supplier's values. "
    "Each cost is nominal; its range is from all assumptions low to all assumptions high."
)

#: Mixes, by name: the options for some types or categories, and the option for all other points.
MIXES: Mapping[str, tuple[Mapping[str, str], str]] = MappingProxyType(
    {
        "digital AS-i + analogue CAN": ({"DI": "AS-i", "DO": "AS-i"}, "CAN"),
        "digital AS-i + analogue Modbus RTU": ({"DI": "AS-i", "DO": "AS-i"}, "Modbus RTU"),
        "digital AS-i + analogue home runs": ({"DI": "AS-i", "DO": "AS-i"}, "home runs"),
        "category III home runs + rest CAN": ({"III": "home runs"}, "CAN"),
        "category III home runs + rest Modbus RTU": ({"III": "home runs"}, "Modbus RTU"),
    }
)

#: Seed for drawing the assumptions at random, the same as in `shipnet design`.
_SEED = 2024

#: Prefixes of the names of assumptions about the parts of a bus, without its cable.
_BUS_PARTS = (
    "asi_",
    "can_",
    "modbus_",
    "station_",
    "second_interface",
    "supply",
    "repeater",
    "terminator",
    "gateway",
)


def _examples() -> Mapping[str, str]:
    ship = datasets.path("synthetic_iolist_ship.csv").read_text(encoding="utf-8")
    titles, *rows = ship.splitlines(keepends=True)
    engine = [row for row in rows if row.split(",")[1] == "Main engine"]
    return MappingProxyType({"main engine": titles + "".join(engine), "ship": ship})


#: Example lists, both synthetic: the 99 points of an engine, and the 353 points of a ship.
EXAMPLES = _examples()


@record
class ShipDesign(Tool):
    """Comparison of ways to connect the points of a ship's I/O list.

    `result` is the comparison of the designs, a `design.Comparison`.

    Raises
    ------
    ArgumentError
        If a value is out of its range.
    InputError
        Raised by `result` if the I/O list or the settings are invalid.

    Examples
    --------
    >>> ShipDesign().ok
    True
    """

    #: The example lists, by name.
    EXAMPLES: ClassVar[Mapping[str, str]] = EXAMPLES

    points: str = text(
        default=EXAMPLES["main engine"],
        most=_LONGEST,
        rows=6,
        label="I/O list",
        help="One row per point, pasted from a spreadsheet or as CSV: tag, type or signal, and x, "
        "y, z or the length of its home run. The list is read when you leave the editor.",
    )
    name: str = text(
        default="main engine (synthetic)",
        most=80,
        label="name of the list",
        help="Title in the report.",
    )
    cabinet: str = text(
        default=_CABINET,
        most=60,
        hint="inferred from the list",
        label="cabinet x, y, z [m]",
        help="Position at which the cables end; if empty, it is inferred from the list's lengths.",
    )
    home_runs: bool = switch(
        default=True, label="home runs", help="A cable from each point to the cabinet."
    )
    junction_boxes: bool = switch(
        default=True,
        label="junction boxes",
        help="A cable from each point to a box, and a multi-pair cable from there to the cabinet.",
    )
    asi: bool = switch(
        default=True, label="AS-i", help="Modules on a two-wire line that also carries the supply."
    )
    can: bool = switch(default=True, label="CAN", help="Stations on a trunk.")
    modbus: bool = switch(default=True, label="Modbus RTU", help="Stations polled over RS-485.")
    mixed: str = choice(
        {name: name for name in ("none", *MIXES)},
        default="none",
        label="a mix",
        help="One more option, which connects some points by one method and the others by another. "
        "With few boxes and stations, a mix may cost more than either method alone.",
    )
    doubled: bool = switch(
        default=True, label="two lines", help="Also compare each bus with two lines."
    )
    rules: str = choice(
        {name: name for name in RULE_SETS},
        default="DNV",
        label="rules",
        help="The rules to check. A rule counts as not verified, never as met, if the "
        "plan cannot show that it is met or if none of us has read the rule.",
    )
    update_ms: int = choice(
        {0: "as listed", 1000: "1000", 500: "500", 200: "200", 100: "100", 50: "50", 20: "20"},
        default=0,
        unit="ms",
        slider=True,
        label="update, at most",
        help="Limit for the update time of every point; reduce it to see which bus fails first.",
    )
    list_lengths: bool = switch(
        default=True,
        label="lengths of the list",
        help="Use the cable lengths in the list. If off, all lengths are "
        "computed from positions, so that all options are compared on the same basis.",
    )
    detour: float = number(
        1,
        2,
        default=1.15,
        step=0.05,
        label="detour",
        help="Laid length of a cable as a multiple of its route parallel to the axes. Assumed.",
    )
    spare: float = number(
        0,
        1,
        default=0.2,
        step=0.05,
        label="spare pairs",
        help="Spare pairs of a multi-pair cable, as a fraction of the pairs in use. Assumed.",
    )
    labour: float = number(
        10,
        200,
        default=55.0,
        step=5,
        unit="EUR/h",
        label="labour rate",
        help="Hourly cost of an electrician, with overhead; low and high scale with it. Assumed.",
    )
    parts: float = number(
        0.25,
        4,
        default=1.0,
        step=0.05,
        label="price of bus parts",
        help="Modules, stations, masters and supplies, as a multiple of the assumed prices.",
    )
    own: str = text(
        default="",
        most=20_000,
        rows=4,
        hint="[asi]\nlength = 200",
        label="other limits and prices",
        help="Lines of a settings file: bit rates, lengths, currents, load, prices, time in "
        "the host. They override the controls. All settings are in settings.toml, below.",
    )
    picture: str = choice(
        PICTURES,
        default="cost",
        label="figure",
        help="Filled dots are Pareto-optimal with respect to both axes. The assumptions shown "
        "matter most to the cost difference between the first option and the cheapest other one.",
    )

    def __post_init__(self) -> None:
        check_fields(self)
        # JSON writes most non-ASCII characters as six characters, and a line break as two.
        beyond = len(self.points.encode("ascii", errors="ignore"))
        size = 6 * (len(self.points) - beyond) + beyond + self.points.count("\n")
        if size > _STATE:
            raise ArgumentError(f"the list takes {size} bytes as JSON; the limit is {_STATE}")

    @property
    def options(self) -> tuple[str, ...]:
        """The options to compare."""
        chosen = {
            "home runs": self.home_runs,
            "junction boxes": self.junction_boxes,
            "AS-i": self.asi,
            "AS-i doubled": self.asi and self.doubled,
            "CAN": self.can,
            "CAN doubled": self.can and self.doubled,
            "Modbus RTU": self.modbus,
            "Modbus RTU doubled": self.modbus and self.doubled,
            self.mixed: self.mixed != "none",
        }
        return tuple(option for option, wanted in chosen.items() if wanted)

    @cached_property
    def result(self) -> Comparison:
        """The comparison of the options; unchanged options are not planned again."""
        if not self.options:
            raise ArgumentError("no option is on; switch on at least one")
        printed = "".join(one if one.isprintable() else " " for one in self.name)
        name, settings = " ".join(printed.split()) or "list", self._settings()
        iolist = _points(self.points, name, self.update_ms, settings.reading)
        return _compared(iolist, self.cabinet, settings, self.options, self.rules)

    def _settings(self) -> Settings:
        """Return the values of the controls, overridden by the user's own settings."""
        values: dict[str, object] = {
            "spare": self.spare,
            "list_lengths": self.list_lengths,
            "detour": self.detour,
            **_prices(self.labour, self.parts),
        }
        given = Settings.parse(self.own, "limits and prices")
        words = {table: dict(pairs) for table, pairs in given.reading._asdict().items()}
        return Settings(values | dict(given.changes()["value"]) | words)

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the chosen figure."""
        if self.picture == "cost":
            return self.result.plot(ax=ax)
        if self.picture == "assumptions":
            return self.result.tornado().plot(ax)
        return self.result.plot("total_cost_eur", self.picture, ax=ax)

    def _view(self, report: bool = False) -> View:
        """Return the view that the page shows; with `report`, it offers the report's files."""
        found = self.result
        heights = {"cost": 1.2 + 0.4 * len(found.designs), "assumptions": 3.4}
        files: dict[str, str | bytes] = {"settings.toml": found.settings.text()}
        ready = {}
        if report:
            files |= {"report.html": found.html(), "tables.zip": zipped(found.files())}
            ready = {"report": "ready; the button to download it is at the foot of the page"}
        return View(
            verdict=f"{len(found.iolist)} points: {found.verdict}",
            ok=found.ok,
            table=found.short(),
            caption=_MIND,
            numbers=ready | _numbers(found),
            plot=self.plot,
            height=heights.get(self.picture, 3.6),
            about=PICTURES[self.picture],
            files=files,
        )

    def _options(self) -> dict[str, Any]:
        # The inputs for which a report was requested; the report is dropped when the inputs change.
        asked: list[ShipDesign] = []

        def see(inputs: ShipDesign) -> View:
            if asked != [inputs]:
                asked.clear()
            return inputs._view(report=bool(asked))

        def ask(inputs: ShipDesign) -> None:
            asked[:] = [inputs]

        def example(name: str, cabinet: str) -> Button:
            points = EXAMPLES[name]
            said = f"{points.count(chr(10)) - 1} points, synthetic; they replace the list above."
            return Button(
                f"example: {name}",
                said,
                lambda inputs: replace(
                    inputs, points=points, name=f"{name} (synthetic)", cabinet=cabinet
                ),
            )

        report = Button(
            "make the report",
            "One file to read offline and print: tables, figures, rules and all "
            "assumptions. tables.zip has the cables, terminals, points and drawing of each "
            "option. Buttons to download both files appear at the foot of the page.",
            ask,
        )
        uploads = [
            Upload(
                "load a list",
                "A CSV or Excel file to replace the list above.",
                ".csv,.txt,.xlsx",
                from_file,
            ),
            Upload(
                "load settings",
                "Limits and prices, as TOML; they replace those above.",
                ".toml,.txt",
                settings_from_file,
            ),
        ]
        buttons = [example("main engine", _CABINET), example("ship", ""), report]
        return {"see": see, "folds": _FOLDS, "buttons": buttons, "uploads": uploads}


def from_file(inputs: ShipDesign, name: str, content: bytes) -> ShipDesign:
    """Return the inputs with the I/O list of a file; the cabinet is left empty, to be inferred."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "list.csv"
        path.write_bytes(content)
        try:
            iolist = read_iolist(path, settings=Settings.parse(inputs.own))
        except InputError as problem:
            raise InputError(name, *problem.faults, more=problem.more) from None
        if content.startswith(b"PK"):
            iolist.save(path)
            content = path.read_bytes()
    return replace(inputs, points=text_of(content), name=name[-80:], cabinet="")


def settings_from_file(inputs: ShipDesign, name: str, content: bytes) -> ShipDesign:
    """Return the inputs with the text of a settings file as the user's own settings."""
    lines = text_of(content)
    Settings.parse(lines, name)
    return replace(inputs, own=lines)


@lru_cache(maxsize=8)
def _points(text: str, name: str, update_ms: int, reading: Reading) -> IoList:
    """Return the I/O list in `text`; a nonzero `update_ms` limits the update time of each point."""
    iolist = IoList.parse(text, name, reading=reading)
    if not update_ms:
        return iolist
    # A point without an update time has NaN, which fmin ignores.
    needed = np.fmin(iolist.points["update_ms"], float(update_ms))
    return replace(iolist, points=iolist.points.assign(update_ms=needed))


@lru_cache(maxsize=8)
def _site(iolist: IoList, cabinet: str, settings: Settings) -> tuple[Site, str]:
    """Return the site of a list, and a remark if `cabinet` is blank, otherwise ""."""
    return site_of(iolist, cabinet.strip() or None, settings)


@lru_cache(maxsize=48)
def _planned(iolist: IoList, site: Site, settings: Settings, option: str, rules: str) -> Design:
    asked = RuleSet.of(rules)
    if option in OPTIONS:
        return plan(iolist, site, option, settings=settings, rules=asked)
    choose, default = MIXES[option]
    there = {*iolist.points["type"], *iolist.points["category"]}
    named = {key: value for key, value in choose.items() if key in there}
    return plan(iolist, site, default, settings=settings, mix=named, name=option, rules=asked)


def _prices(labour: float, parts: float) -> dict[str, Range]:
    """Return the assumptions changed by a labour rate [EUR/h] and a price factor for bus parts."""
    assumed = Assumptions()
    times = {"labour_rate": labour / assumed["labour_rate"].nominal}
    times |= {
        name: parts
        for name in assumed
        if name.startswith(_BUS_PARTS) and assumed.entry(name).unit == "EUR"
    }
    return {
        f"assumptions.{name}": Range(*(factor * value for value in assumed[name]))
        for name, factor in times.items()
        if factor != 1
    }


@lru_cache(maxsize=4)
def _compared(
    iolist: IoList, cabinet: str, settings: Settings, options: tuple[str, ...], rules: str
) -> Comparison:
    """Plan the options and compare them; plans are reused if only prices change."""
    default = Settings()
    unpriced = settings.replace(
        {name: default[name] for name in names() if name.startswith("assumptions.")}
    )
    at, said = _site(iolist, cabinet, unpriced)
    designs = [_planned(iolist, at, unpriced, option, rules).priced(settings) for option in options]
    found = compare(designs, rules=rules, rng=_SEED)
    return replace(found, remarks=(said,) if said else ())


#: Maximum number of violated rules shown per design.
_SHOWN = 3

_FAILED = {"cut": "is cut", "short": "is shorted", "device": "fails"}


def _numbers(comparison: Comparison) -> dict[str, str]:
    """Return, in words, the results that the table of a comparison omits."""
    x, y, z = comparison.site.cabinet
    said = {
        "list": "; ".join([str(comparison.iolist), *comparison.iolist.remarks]),
        "cabinet": "; ".join(comparison.remarks) or f"the cabinet is at {x:g}, {y:g}, {z:g} m",
        "conclusions": " ".join(comparison.conclusions()),
    }
    for option, rows in comparison.findings().violated().groupby("design", sort=False):
        violated = [
            f"{row.rule} ({row.asks}; {row.value:.4g} {row.unit} at {row.object})"
            for row in rows.itertuples()
        ]
        more = f"; and {len(rows) - _SHOWN} more" if len(rows) > _SHOWN else ""
        said[f"{option} violates"] = "; ".join(violated[:_SHOWN]) + more
    for option, design in comparison.designs.items():
        failures = worst(design.failures())
        for row in failures[failures["points_lost"] > 0].itertuples():
            lost = f"{row.points_lost} point{'' if row.points_lost == 1 else 's'}"
            said[f"{option} at worst"] = (
                f"{lost} lost when {row.failed} {_FAILED[str(row.failure)]}"
            )
    return said
