"""The ship design tool: a comparison of ways to connect an I/O list, with a report."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property, lru_cache
from typing import Any, ClassVar

import numpy as np
from matplotlib.axes import Axes

from shipnet import datasets, style
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
from shipnet.errors import ArgumentError
from shipnet.fields import check_fields, choice, number, record, switch, text
from shipnet.files import as_file
from shipnet.tables import text_of
from shipnet.tools._tool import Tool
from shipnet.tools._view import Button, Upload, View, words

_WORDS = words("ship_design")

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
    "I/O list and cabinet": "points name cabinet".split(),
    "limits and prices": "rules update_ms list_lengths detour spare labour parts own".split(),
}

#: Update times to choose from [ms].
_UPDATES = {0: "as listed"} | {ms: f"{ms}" for ms in (1000, 500, 200, 100, 50, 20)}

#: Maximum length of a list in characters, and in bytes as JSON; a saved state has at most 2 MB.
_LONGEST = 1_000_000
_STATE = 1_900_000

_MIND = (
    f"{BANNER} Prices, hours and masses are assumptions until you enter a supplier's values. "
    "Each cost is nominal; its range is from all assumptions low to all assumptions high."
)

#: Mixes, by name: the options for some types or categories, and the option for all other points.
_DIGITAL, _ALARMS = {"DI": "AS-i", "DO": "AS-i"}, {"III": "home runs"}
MIXES: Mapping[str, tuple[Mapping[str, str], str]] = {
    "digital AS-i + analogue CAN": (_DIGITAL, "CAN"),
    "digital AS-i + analogue Modbus RTU": (_DIGITAL, "Modbus RTU"),
    "digital AS-i + analogue home runs": (_DIGITAL, "home runs"),
    "category III home runs + rest CAN": (_ALARMS, "CAN"),
    "category III home runs + rest Modbus RTU": (_ALARMS, "Modbus RTU"),
}

#: Seed for drawing the assumptions at random, the same as in `shipnet design`.
_SEED = 2024

#: Prefixes of the names of assumptions about the parts of a bus, without its cable.
_BUS_PARTS = tuple(
    "asi_ can_ modbus_ station_ second_interface supply repeater terminator gateway".split()
)

#: Example lists, both synthetic: the 99 points of an engine, and the 353 points of a ship.
_SHIP = datasets.path("synthetic_iolist_ship.csv").read_text(encoding="utf-8")
_TITLES, *_ROWS = _SHIP.splitlines(keepends=True)
_ENGINE = [row for row in _ROWS if row.split(",")[1] == "Main engine"]
EXAMPLES: Mapping[str, str] = {"main engine": "".join([_TITLES, *_ENGINE]), "ship": _SHIP}


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

    points: str = text(_WORDS["points"], default=EXAMPLES["main engine"], most=_LONGEST, rows=6)
    name: str = text(_WORDS["name"], default="main engine (synthetic)", most=80)
    cabinet: str = text(_WORDS["cabinet"], default=_CABINET, most=60, hint="inferred from the list")
    home_runs: bool = switch(_WORDS["home_runs"], default=True)
    junction_boxes: bool = switch(_WORDS["junction_boxes"], default=True)
    asi: bool = switch(_WORDS["asi"], default=True)
    can: bool = switch(_WORDS["can"], default=True)
    modbus: bool = switch(_WORDS["modbus"], default=True)
    mixed: str = choice(("none", *MIXES), _WORDS["mixed"], default="none")
    doubled: bool = switch(_WORDS["doubled"], default=True)
    rules: str = choice(RULE_SETS, _WORDS["rules"], default="DNV")
    update_ms: int = choice(_UPDATES, _WORDS["update_ms"], default=0, unit="ms", slider=True)
    list_lengths: bool = switch(_WORDS["list_lengths"], default=True)
    detour: float = number(1, 2, help=_WORDS["detour"], default=1.15, step=0.05)
    spare: float = number(0, 1, help=_WORDS["spare"], default=0.2, step=0.05)
    labour: float = number(10, 200, "EUR/h", _WORDS["labour"], default=55.0, step=5)
    parts: float = number(0.25, 4, help=_WORDS["parts"], default=1.0, step=0.05)
    own: str = text(_WORDS["own"], default="", most=20_000, rows=4, hint="[asi]\nlength = 200")
    picture: str = choice(PICTURES, _WORDS["picture"], default="cost")

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
        is_on = {
            "home runs": self.home_runs,
            "junction boxes": self.junction_boxes,
            "AS-i": self.asi,
            "CAN": self.can,
            "Modbus RTU": self.modbus,
        }
        chosen = [option for option in OPTIONS if is_on[option.removesuffix(" doubled")]]
        chosen = [option for option in chosen if self.doubled or not option.endswith(" doubled")]
        return (*chosen, *([] if self.mixed == "none" else [self.mixed]))

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
            name: getattr(self, name) for name in ("spare", "list_lengths", "detour")
        }
        assumed = Assumptions()
        times = {"labour_rate": self.labour / assumed["labour_rate"].nominal}
        for name in assumed:
            if name.startswith(_BUS_PARTS) and assumed.entry(name).unit == "EUR":
                times[name] = self.parts
        for name, factor in times.items():
            if factor != 1:
                price = Range(*(factor * value for value in assumed[name]))
                values[f"assumptions.{name}"] = price
        typed = Settings.parse(self.own, "limits and prices")
        words = {table: dict(pairs) for table, pairs in typed.reading._asdict().items()}
        return Settings(values | dict(typed.changes()["value"]) | words)

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the chosen figure."""
        if self.picture == "cost":
            return self.result.plot(ax=ax)
        if self.picture == "assumptions":
            return self.result.tornado().plot(ax)
        return self.result.plot("total_cost_eur", self.picture, ax=ax)

    def _plot_narrow(self, ax: Axes) -> None:
        self.plot(ax).locator_params(axis="x", nbins=4)
        if ax.get_legend():
            style.legend(ax, 2)

    def _view(self, report: bool = False) -> View:
        """Return the view that the page shows; with `report`, it offers the report's files."""
        result = self.result
        heights = {"cost": 1.2 + 0.4 * len(result.designs), "assumptions": 3.4}
        files: dict[str, str | bytes] = {"settings.toml": result.settings.text()}
        no_lengths = bool(result.iolist.points["home_run_m"].isna().all())
        ready = {}
        if report:
            files |= {"report.html": result.html(), "tables.zip": zipped(result.files())}
            ready = {"report": "ready; the button to download it is at the foot of the page"}
        return View(
            verdict=f"{len(result.iolist)} points: {result.verdict}",
            ok=result.ok,
            table=result.short(),
            caption=_MIND,
            drawing=result.drawing().html if result.iolist.located.any() else "",
            numbers=ready | _numbers(result),
            plot=self.plot,
            narrow=self._plot_narrow,
            height=heights.get(self.picture, 3.6),
            about=PICTURES[self.picture],
            curve=(lambda: result.table()["total_cost_eur"]) if self.picture == "cost" else None,
            data=result.table,
            files=files,
            idle={"list_lengths": "the list has no lengths"} if no_lengths else {},
        )

    def _options(self) -> dict[str, Any]:
        # The inputs for which a report was requested; the report is dropped when the inputs change.
        requested: list[ShipDesign] = []

        def see(inputs: ShipDesign) -> View:
            if requested != [inputs]:
                requested.clear()
            return inputs._view(report=bool(requested))

        def request(inputs: ShipDesign) -> None:
            requested[:] = [inputs]

        def example(name: str, cabinet: str) -> Button:
            points = EXAMPLES[name]
            new = {"points": points, "name": f"{name} (synthetic)", "cabinet": cabinet}
            help = f"{points.count(chr(10)) - 1} points, synthetic; they replace the list above."
            return Button(f"example: {name}", help, lambda inputs: replace(inputs, **new))

        def own_settings(inputs: ShipDesign, name: str, content: bytes) -> ShipDesign:
            lines = text_of(content)
            Settings.parse(lines, name)
            return replace(inputs, own=lines)

        help = (
            "One file to read offline and print: tables, figures, rules and all "
            "assumptions. tables.zip has the cables, terminals, points and drawing of each "
            "option. Buttons to download both files appear at the foot of the page."
        )
        report = Button("make the report", help, request)
        buttons = [example("main engine", _CABINET), example("ship", ""), report]
        help = "A CSV or Excel file to replace the list above."
        points = Upload("load a list", help, ".csv,.txt,.xlsx", from_file)
        help = "Limits and prices, as TOML; they replace those above."
        settings = Upload("load settings", help, ".toml,.txt", own_settings)
        uploads = [points, settings]
        return {"see": see, "folds": _FOLDS, "buttons": buttons, "uploads": uploads}


def from_file(inputs: ShipDesign, name: str, content: bytes) -> ShipDesign:
    """Return the inputs with the I/O list of a file; the cabinet is left empty, to be inferred."""
    with as_file(name, content) as path:
        iolist = read_iolist(path, settings=Settings.parse(inputs.own))
        if content.startswith(b"PK"):
            iolist.save(path)
        points = text_of(path.read_bytes())
    return replace(inputs, points=points, name=name[-80:], cabinet="")


@lru_cache(maxsize=8)
def _points(text: str, name: str, update_ms: int, reading: Reading) -> IoList:
    """Return the I/O list in `text`; a nonzero `update_ms` limits the update time of each point."""
    iolist = IoList.parse(text, name, reading=reading)
    if not update_ms:
        return iolist
    # A point without an update time has NaN, which fmin ignores.
    needed = np.fmin(iolist.points["update_ms"], float(update_ms))
    return replace(iolist, points=iolist.points.assign(update_ms=needed))


_site = lru_cache(maxsize=8)(site_of)


@lru_cache(maxsize=48)
def _planned(iolist: IoList, site: Site, settings: Settings, option: str, rules: str) -> Design:
    rule_set = RuleSet.of(rules)
    if option in OPTIONS:
        return plan(iolist, site, option, settings=settings, rules=rule_set)
    mix, default = MIXES[option]
    present = {*iolist.points["type"], *iolist.points["category"]}
    mix = {key: value for key, value in mix.items() if key in present}
    return plan(iolist, site, default, settings=settings, mix=mix, name=option, rules=rule_set)


@lru_cache(maxsize=4)
def _compared(
    iolist: IoList, cabinet: str, settings: Settings, options: tuple[str, ...], rules: str
) -> Comparison:
    """Plan the options and compare them; plans are reused if only prices change."""
    default = Settings()
    unpriced = settings.replace(
        {name: default[name] for name in names() if name.startswith("assumptions.")}
    )
    site, remark = _site(iolist, cabinet.strip() or None, unpriced)
    designs = [_planned(iolist, site, unpriced, name, rules).priced(settings) for name in options]
    comparison = compare(designs, rules=rules, rng=_SEED)
    return replace(comparison, remarks=(remark,) if remark else ())


#: Maximum number of violated rules shown per design.
_SHOWN = 3

_FAILED = {"cut": "is cut", "short": "is shorted", "device": "fails"}


def _numbers(comparison: Comparison) -> dict[str, str]:
    """Return, in words, the results that the table of a comparison omits."""
    x, y, z = comparison.site.cabinet
    numbers = {
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
        numbers[f"{option} violates"] = "; ".join(violated[:_SHOWN]) + more
    for option, design in comparison.designs.items():
        failures = worst(design.failures())
        for row in failures[failures["points_lost"] > 0].itertuples():
            lost = f"{row.points_lost} point{'' if row.points_lost == 1 else 's'}"
            failure = _FAILED[str(row.failure)]
            numbers[f"{option} at worst"] = f"{lost} lost when {row.failed} {failure}"
    return numbers
