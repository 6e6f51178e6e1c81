"""The ship design tool: an I/O list connected in several ways, side by side, and its report."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

from matplotlib.axes import Axes

from shipnet.arguments import checked
from shipnet.design.comparison import RESPONSE, Comparison
from shipnet.design.iolist import read_iolist
from shipnet.design.report import BANNER
from shipnet.design.rules import RULE_SETS
from shipnet.design.settings import Settings
from shipnet.design.tables import zipped
from shipnet.errors import ArgumentError, InputError
from shipnet.fields import choice, number, record, switch, text
from shipnet.tables import text_of
from shipnet.tools._design import EXAMPLES, MIXES, compared, numbers, points, settings_of
from shipnet.tools._tool import Tool
from shipnet.tools._view import Button, Upload, View

if TYPE_CHECKING:
    from shipnet.tools._page import Page

#: What the figure can show; against cost, the column of the comparison that it is.
PICTURES = {
    "cost": "cost of each option, with its range",
    "conductors_at_cabinet": "conductors against cost",
    RESPONSE: "worst response against cost",
    "lost_by_failure": "points lost by one failure against cost",
    "assumptions": "the assumptions that matter most",
}

#: The cabinet of the example ship.
_CABINET = "26, 6, 14"

#: Controls that are folded away: a page opens on the answer.
_FOLDS = {
    "I/O list and cabinet": ("points", "name", "cabinet"),
    "limits and prices": (
        "rules", "update_ms", "list_lengths", "detour", "spare", "labour", "parts", "own",
    ),
}  # fmt: skip

#: Characters of a list, for a state that holds it must not exceed 2 MB.
_LONGEST = 1_000_000
_STATE = 1_900_000

_MIND = (
    f"{BANNER} Prices, hours and masses are assumptions until a supplier's are put in; a cost is "
    "given from all low to all high, around its nominal."
)


@checked
@record
class ShipDesign(Tool):
    """Ways to connect the points of a ship's I/O list, side by side.

    `result` is the comparison of the designs, a `design.Comparison`.

    Raises
    ------
    ArgumentError
        If a value is out of its range.
    InputError
        From `result`, if the list or the settings are faulty.

    Examples
    --------
    >>> ShipDesign().ok
    True
    """

    #: The example lists, by name.
    EXAMPLES: ClassVar[Mapping[str, str]] = EXAMPLES

    points: str = text(
        default=EXAMPLES["main engine"], most=_LONGEST, rows=6, label="I/O list",
        help="A row a point, pasted from a spreadsheet or as CSV: tag, type or signal, and x, y, z "
        "or the length of its home run. It is read when you leave the editor.",
    )  # fmt: skip
    name: str = text(
        default="main engine (synthetic)", most=80, label="name of the list",
        help="What the report calls it.",
    )  # fmt: skip
    cabinet: str = text(
        default=_CABINET, most=60, hint="found from the list", label="cabinet x, y, z [m]",
        help="Where the cables end. Left empty, it is found from the lengths that the list gives.",
    )  # fmt: skip
    home_runs: bool = switch(
        default=True, label="home runs", help="A cable from each point to the cabinet."
    )
    junction_boxes: bool = switch(
        default=True, label="junction boxes",
        help="A cable from each point to a box, and one of many pairs from there to the cabinet.",
    )  # fmt: skip
    asi: bool = switch(
        default=True, label="AS-i", help="Modules on a line of two conductors with supply."
    )
    can: bool = switch(default=True, label="CAN", help="Stations on a trunk.")
    modbus: bool = switch(default=True, label="Modbus RTU", help="Stations polled on RS-485.")
    mixed: str = choice(
        {name: name for name in ("none", *MIXES)}, default="none", label="a mix",
        help="One option more: some points in one way, the others in another. Where boxes and "
        "stations are few, a mix may cost more than either.",
    )  # fmt: skip
    redundant: bool = switch(
        default=False,
        label="two lines",
        help="The trunks of CAN and Modbus twice, on ways of their own.",
    )
    rules: str = choice(
        {name: name for name in RULE_SETS}, default="DNV", label="rules",
        help="Whose rules are checked. What a plan cannot show, or nobody has read, is not "
        "verified; it never counts as met.",
    )  # fmt: skip
    update_ms: int = choice(
        {0: "as listed", 1000: "1000", 500: "500", 200: "200", 100: "100", 50: "50", 20: "20"},
        default=0,
        unit="ms", slider=True, label="update, at most",
        help="No point waits longer than this; tighten it to see which bus gives out first.",
    )  # fmt: skip
    list_lengths: bool = switch(
        default=True, label="lengths of the list",
        help="A cable keeps the length that the list gives it. Switched off, all lengths are "
        "reckoned from places, and options are weighed alike.",
    )  # fmt: skip
    detour: float = number(
        1, 2, default=1.15, step=0.05, label="detour",
        help="Laid length of a cable as a multiple of its way square to the ship. Assumed.",
    )  # fmt: skip
    spare: float = number(
        0, 1, default=0.2, step=0.05, label="spare pairs",
        help="Of cables of many pairs, as a share of the pairs in use. Assumed.",
    )  # fmt: skip
    labour: float = number(
        10, 200, default=55.0, step=5, unit="EUR/h", label="labour rate",
        help="An hour of an electrician with overhead; its range goes with it. Assumed.",
    )  # fmt: skip
    parts: float = number(
        0.25, 4, default=1.0, step=0.05, label="price of bus parts",
        help="Modules, stations, masters and supplies, as a multiple of what is assumed.",
    )  # fmt: skip
    own: str = text(
        default="", most=20_000, rows=4,
        hint="[asi]\nlength = 200", label="other limits and prices",
        help="Lines of a settings file: bit rates, lengths, currents, load, prices, the time of "
        "the host. They win over the controls. settings.toml, at the foot of the page, has all.",
    )  # fmt: skip
    picture: str = choice(
        PICTURES, default="cost", label="figure",
        help="Filled dots are Pareto-optimal in both axes; assumptions are those that decide "
        "between the first and the cheapest option.",
    )  # fmt: skip

    def __post_init__(self) -> None:
        # JSON writes a character beyond ASCII as six, a line's end as two.
        beyond = len(self.points.encode("ascii", errors="ignore"))
        size = 6 * (len(self.points) - beyond) + beyond + self.points.count("\n")
        if size > _STATE:
            raise ArgumentError(f"the list takes {size} bytes; a state holds {_STATE} at most")

    @property
    def options(self) -> tuple[str, ...]:
        """What is compared."""
        chosen = {
            "home runs": self.home_runs, "junction boxes": self.junction_boxes, "AS-i": self.asi,
            "CAN": self.can, "Modbus RTU": self.modbus, self.mixed: self.mixed != "none",
        }  # fmt: skip
        return tuple(option for option, wanted in chosen.items() if wanted)

    @cached_property
    def result(self) -> Comparison:
        """Plan the options and compare them; what is not changed is not planned anew."""
        if not self.options:
            raise ArgumentError("no option is on; switch on one or more of home runs to Modbus RTU")
        printed = "".join(one if one.isprintable() else " " for one in self.name)
        settings = settings_of(
            self.spare, self.redundant, self.list_lengths, self.detour, self.labour,
            self.parts, self.own,
        )  # fmt: skip
        name = " ".join(printed.split()) or "list"
        iolist = points(self.points, name, self.update_ms, settings.reading)
        return compared(iolist, self.cabinet, settings, self.options, self.rules)

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw what `ShipDesign.picture` asks for."""
        if self.picture == "cost":
            return self.result.plot(ax=ax)
        if self.picture == "assumptions":
            return self.result.tornado().plot(ax)
        return self.result.plot("total_cost_eur", self.picture, ax=ax)

    def _view(self, report: bool = False) -> View:
        """Return what the page shows; with `report`, a file to download."""
        found = self.result
        heights = {"cost": 1.2 + 0.4 * len(found.designs), "assumptions": 3.4}
        files: dict[str, str | bytes] = {"settings.toml": found.settings.text()}
        ready = {}
        if report:
            files |= {"report.html": found.html(), "tables.zip": zipped(found.files())}
            ready = {"report": "made; the button to download it is at the foot of the page"}
        return View(
            verdict=f"{len(found.iolist)} points: {found.verdict}",
            ok=found.ok,
            table=found.short(),
            caption=_MIND,
            numbers=ready | numbers(found),
            plot=self.plot,
            height=heights.get(self.picture, 3.6),
            about=PICTURES[self.picture],
            files=files,
        )

    def explore(self, story: bool = False) -> Page:
        """Return the page with controls, examples, uploads, and a report to download."""
        from shipnet.tools._page import Page

        # The inputs that the report is asked for; it goes when they change.
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
                f"example: {name}", said,
                lambda inputs: replace(
                    inputs, points=points, name=f"{name} (synthetic)", cabinet=cabinet
                ),
            )  # fmt: skip

        return Page(
            self,
            see,
            story=story,
            folds=_FOLDS,
            buttons=[
                example("main engine", _CABINET),
                example("ship", ""),
                Button("make the report", "One file to read offline and print: tables, figures, "
                       "rules and every assumption; in tables.zip the cables, terminals, points "
                       "and drawing of each option. Buttons to download them appear at the "
                       "foot of the page.", ask),
            ],
            uploads=[Upload("load a list", "CSV or Excel; it replaces the list above.",
                            ".csv,.txt,.xlsx", from_file),
                     Upload("load settings", "Limits and prices, as TOML; they replace those "
                            "above.", ".toml,.txt", settings_from_file)],
        )  # fmt: skip


def from_file(inputs: ShipDesign, name: str, content: bytes) -> ShipDesign:
    """Return inputs with the I/O list of a file, whose cabinet is to be found."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "list"
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
    """Return inputs with the lines of a file of settings."""
    lines = text_of(content)
    Settings.parse(lines, name)
    return replace(inputs, own=lines)
