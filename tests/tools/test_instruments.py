"""What all tools offer to compare answers: pins, steady axes, sweeps, files, links to others."""

import importlib
import re
from base64 import b64decode
from dataclasses import dataclass, replace
from html import unescape
from io import BytesIO, StringIO
from itertools import pairwise
from xml.etree import ElementTree

import pandas as pd
import pytest
from matplotlib.figure import Figure

from shipnet import tools
from shipnet.errors import ArgumentError
from shipnet.fields import Part, Text, Words, check_fields, choice, declared, number, switch, whole
from shipnet.tools._page import Page
from shipnet.tools._sweep import _grid, sweep
from shipnet.tools._view import (
    MOST_PINS,
    Answer,
    Measure,
    Preset,
    Sheet,
    View,
    compared,
    read_link,
)
from tests.tools.test_tools_limits import SMALL, TOOLS, kind_of

#: Tools whose drawing has instruments of its own.
OTHERS = {"asi_bench"}
TOOLS = [tool for tool in TOOLS if tool not in OTHERS]
SWEPT = [tool for tool in TOOLS if tool not in ("ship_design", "valve_client")]


@dataclass(frozen=True)
class Toy:
    slaves: int = whole(1, 200, help=Words("slaves", "How many."), default=5)
    dead: int = whole(0, 200, help=Words("dead", "Of them."), default=0, at_most="slaves")
    length: float = number(0, 9, "m", Words("cable", "Its length."), (0, 2), default=1.0, step=0.1)
    bus: str = choice(["CAN", "AS-i", "Modbus"], Words("bus", "Which."), default="CAN")
    ring: bool = switch(Words("ring", "Closed."), default=False)

    def __post_init__(self):
        check_fields(self)
        if self.bus == "AS-i" and self.slaves > 62:
            raise ArgumentError(f"slaves is {self.slaves}; AS-i has at most 62")


def see(toy):
    load = toy.slaves + 10 * toy.ring
    names = pd.Series([load, 1.0], ["load", "one"])
    return View(
        verdict=f"load {load}",
        ok=load <= 100,
        numbers={"load": f"{load} %"},
        plot=lambda ax: ax.set(xlim=(0, load), xlabel="load [%]", yticks=[0, 1]),
        height=1,
        curve=lambda: names,
        data=names.rename("load").to_frame,
        short="met" if load <= 100 else "exceeded",
        measure=Measure("load_percent", "load [%]", load, 100),
        idle={"ring": "a <ring> has no ends"} if toy.ring else {},
    )


@pytest.fixture
def page():
    return Page(Toy(), see)


def png(html):
    return b64decode(re.search('base64,([^"]*)"', html)[1])


# Pins --------------------------------------------------------------------------------------------


def test_pins_show_the_settings_that_differ_beside_verdict_and_numbers():
    answers = [Answer(toy, see(toy)) for toy in (Toy(), Toy(slaves=150), Toy(ring=True))]
    assert compared(answers[0], answers[1:]) == [
        ["slaves", "5", "150", "5"],
        ["ring", "off", "off", "on"],
        ["verdict", "load 5", "load 150", "load 15"],
        ["load", "5 %", "150 %", "15 %"],
    ]
    assert compared(answers[0], []) == [["load", "5 %"]]


def test_a_pin_stays_while_controls_move_until_pins_are_removed(page):
    pin, remove = page.buttons["pin"], page.buttons["remove pins"]
    plain = page.figure.value
    assert remove.disabled and "pin 1" not in page._details.value
    pin.click()
    assert page.figure.value != plain
    page.controls["slaves"].value = 150
    assert "<td>load 150</td><td>load 5</td>" in page._details.value
    for _ in range(MOST_PINS - 1):
        assert not pin.disabled
        pin.click()
    assert pin.disabled and f"pin {MOST_PINS}" in page._details.value
    remove.click()
    assert "pin 1" not in page._details.value and not pin.disabled and remove.disabled


def test_an_answer_that_is_an_error_is_not_pinned(page):
    page.controls["bus"].value = "AS-i"
    page.controls["slaves"].value = 90
    page.buttons["pin"].click()
    assert "at most 62" in page.note
    page.controls["slaves"].value = 9
    assert "pin 1" not in page._details.value and page.note == ""


@pytest.mark.parametrize("by_name", [True, False])
def test_a_pinned_curve_is_drawn_by_number_or_in_the_row_of_its_name(by_name):
    index = ["a", "b"] if by_name else [10.0, 20.0]
    other = ["c", "b"] if by_name else [10.0, 30.0]
    now, pinned = pd.Series([1.0, 2.0], index), pd.Series([float("inf"), 7.0], other)
    axes = Figure().subplots()
    axes.set(xlim=(0, 5), ylim=(5, 0))
    shown, pin = (
        View(verdict="", ok=True, plot=lambda ax: None, curve=lambda c=c: c) for c in (now, pinned)
    )
    shown._draw(axes, pins=[pin, View(verdict="", ok=True)])
    (line,) = axes.lines
    assert line.get_marker() == "$1$"
    if by_name:
        assert (line.get_xdata().tolist(), line.get_ydata().tolist()) == ([7.0], [1])
        assert axes.get_xlim() == (0, 7) and axes.get_ylim() == (5, 0)
    else:
        assert (line.get_xdata().tolist(), line.get_ydata().tolist()) == ([30.0], [7.0])
        assert axes.get_ylim() == (7, 0)  # an inverted axis stays inverted


def test_pins_are_carried_by_link_and_state_unless_the_page_is_live(page):
    page.controls["slaves"].value = 7
    page.buttons["pin"].click()
    page.controls["ring"].value = True
    query = unescape(re.search(r'href="\?([^"]*)"', page.links.value)[1])
    other = Page(Toy(), see)
    other.query.value = query
    assert other.inputs == page.inputs == Toy(slaves=7, ring=True)
    assert other._details.value == page._details.value and "pin 1" in other._details.value
    assert query in unescape(other.links.value)
    live = Page(Toy(), see, live=True)
    live.buttons["pin"].click()
    assert 'href="?"' in live.links.value and "pin 1" in live._details.value


# Axes --------------------------------------------------------------------------------------------


def test_axes_only_grow_until_they_are_fitted():
    sheet, seen = Sheet(), []
    for load, label in [(10, "a"), (50, "a"), (20, "a"), (5, "b"), (20, "a")]:
        sheet.png(lambda ax, x=load, name=label: ax.set(xlim=(x, 0), xlabel=name), 4, 3)
        seen.append(sheet.axes.get_xlim())
    assert seen == [(10, 0), (50, 0), (50, 0), (5, 0), (50, 0)]
    sheet.fit()
    sheet.png(lambda ax: ax.set(xlim=(20, 0), xlabel="a"), 4, 3)
    assert sheet.axes.get_xlim() == (20, 0)
    # A drawing without a quantity on its axis, and another size, fit themselves.
    sheet.png(lambda ax: ax.set(xlim=(9, 0)), 4, 3)
    sheet.png(lambda ax: ax.set(xlim=(3, 0)), 4, 3)
    assert sheet.axes.get_xlim() == (3, 0)
    sheet.png(lambda ax: ax.set(xlim=(10, 0), xlabel="a"), 3, 3)
    assert sheet.axes.get_xlim() == (10, 0)


def test_the_axes_of_a_page_are_kept_while_a_slider_moves_and_fitted_by_a_button(page):
    def range_of():
        return page._sheet.axes.get_xlim()

    for slaves, high in [(50, 50), (150, 150), (20, 150)]:
        page.controls["slaves"].value = slaves
        assert range_of() == (0, high)
    page.buttons["pin"].click()
    assert range_of() == (0, 150)
    page.buttons["fit axes"].click()
    assert range_of() == (0, 20)


# Sweeps ------------------------------------------------------------------------------------------


def test_a_sweep_finds_where_the_answer_changes():
    found = sweep(Toy(), "slaves", see)
    assert found.verdict == "slaves: met up to 100; exceeded from 101" and not found.ok
    assert len(found.views) < 60 and {100, 101} <= set(found.views)
    assert found.table()["ok"].loc[[1, 100, 101, 200]].tolist() == [True, True, False, False]
    assert sweep(Toy(slaves=30), "dead", see).table().index.tolist() == [*range(31)]
    assert sweep(Toy(), "length", see).table().index.tolist()[1:3] == [0.1, 0.2]
    assert sweep(Toy(), "length", see).verdict == "cable: met at all values"


def test_a_value_that_is_not_possible_is_not_good_and_has_no_number():
    found = sweep(Toy(bus="AS-i"), "slaves", see, [10, 62, 63])
    assert found.verdict == "slaves: met up to 62; not possible from 63"
    assert found.table()["load_percent"].isna().tolist() == [False, False, True]
    assert "AS-i has at most 62" in found.views[63].verdict
    nothing = sweep(Toy(slaves=90), "bus", see, ["AS-i"])
    assert nothing.verdict == "bus: not possible at all values"
    assert nothing.plot(Figure().subplots()).texts[0].get_text() == "not possible"


def test_choices_are_named_by_answer():
    found = sweep(Toy(slaves=95), "ring", see)
    assert found.verdict == "ring: met with off; exceeded with on"
    assert found.plot(Figure().subplots()).get_xlabel() == "load [%]"
    three = sweep(Toy(slaves=63), "bus", see)
    assert three.verdict == "bus: met with CAN, Modbus; not possible with AS-i"


@pytest.mark.parametrize(
    ("field", "over", "message"),
    [
        ("weight", None, "field is 'weight'; it must be one of 'slaves', 'dead', 'length'"),
        ("slaves", [], "over is empty"),
    ],
)
def test_a_sweep_of_nothing_is_refused(field, over, message):
    with pytest.raises(ArgumentError, match=message):
        sweep(Toy(), field, see, over)


def test_a_text_cannot_be_swept():
    with pytest.raises(ArgumentError, match="field is 'text'"):
        tools.CanLoad().sweep("text")


def test_the_figure_of_a_sweep_shades_what_fails_and_names_the_last_good_value():
    axes = sweep(Toy(), "slaves", see).plot(Figure().subplots(), now=5)
    (shaded,) = axes.patches
    assert shaded.get_extents().transformed(axes.transData.inverted()).x0 == pytest.approx(100.5)
    words = [text.get_text().strip() for text in axes.texts]
    assert sorted(words) == ["100", "exceeded", "limit", "met"]
    assert axes.lines[2].get_xydata().tolist() == [[5, 5]]
    assert axes.get_xlabel() == "slaves" and axes.get_ylabel() == "load [%]"


@pytest.mark.parametrize(
    ("tool", "field", "most"),
    [
        (tools.ModbusScan(), "slaves", lambda tool: tool.result.max_slaves),
        (tools.ModbusScan(), "processing_ms", lambda tool: 1e3 * tool.result.max_processing // 1),
    ],
)
def test_a_sweep_ends_where_the_model_says(tool, field, most):
    good = [value for value, view in tool.sweep(field).views.items() if view.ok]
    assert max(good) == most(tool)


@pytest.mark.parametrize("tool", SWEPT)
def test_the_ranges_of_a_sweep_are_those_of_all_values(tool):
    start = kind_of(tool)(**SMALL.get(tool, {}))
    for name, kind in declared(type(start)).items():
        if isinstance(kind, Part | Text):
            continue
        found = start.sweep(name)
        grid = _grid(kind, start)
        assert list(found.views) == [value for value in grid if value in found.views]
        if len(grid) < 150:
            whole = start.sweep(name, grid)
            assert found.verdict == whole.verdict, name
        assert found.plot(Figure().subplots()).get_xlabel()


def test_a_page_shows_the_sweep_of_a_control_and_follows_the_others(page):
    calls = []
    page = Page(Toy(), lambda toy: calls.append(toy) or see(toy))
    assert [name for _, name in page.over.options] == ["", *declared(Toy)]
    page.over.value = "slaves"
    assert "slaves: met up to 100; exceeded from 101" in page.sweep.value
    before, shown = len(calls), page.sweep.value
    page.controls["slaves"].value = 60
    # Only the present answer is computed, and its mark moves.
    assert len(calls) == before + 1 and page.sweep.value != shown
    page.controls["ring"].value = True
    assert "slaves: met up to 90; exceeded from 91" in page.sweep.value
    shown = page.sweep.value
    page.buttons["pin"].click()
    assert page.sweep.value != shown
    page.over.value = ""
    assert page.sweep.value == ""


def test_the_controls_of_a_preset_are_swept_too():
    preset = Preset(Toy(bus="Modbus"), lambda two, toy: replace(toy, slaves=2 * two.slaves))
    page = Page(Toy(), see, preset=preset)
    page.presets["slaves"].value = 20
    page.over.value = "slaves"
    assert "slaves: met up to 50; exceeded from 51" in page.sweep.value
    diagnosis = tools.ValveDiagnosis().explore(story=True)
    diagnosis.over.value = "severity"
    assert "its severity: normal up to 0.95; V1 from 0.96" in diagnosis.sweep.value


# Files, links to other tools, controls without effect -------------------------------------------


def opened(tool, **values):
    page = kind_of(tool)(**(SMALL.get(tool, {}) | values)).explore()
    if tool == "ring_buffer":
        page.buttons["store a packet"].click()
    return page


def files(page):
    """Return the files of the page's links, by name."""
    pattern = r'download="([^"]*)" href="data:[^,]*,([^"]*)"'
    return {name: b64decode(content) for name, content in re.findall(pattern, page.links.value)}


@pytest.mark.parametrize("tool", TOOLS)
def test_figure_and_data_of_every_tool_are_prepared_until_something_changes(tool):
    page = opened(tool)
    try:
        if tool in SWEPT:
            page.over.value = page.over.options[-1][1]
        before = set(files(page))
        page.prepare.click()
        made = {name: made for name, made in files(page).items() if name not in before}
        names = [f"shipnet_{tool}{which}" for which in ["", *(["_sweep"] if tool in SWEPT else [])]]
        assert set(made) == {f"{name}.{kind}" for name in names for kind in ("svg", "csv")}
        for name, content in made.items():
            if name.endswith(".svg"):
                assert ElementTree.fromstring(content).tag.endswith("}svg")
            else:
                table = pd.read_csv(BytesIO(content))
                assert len(table) and not table.columns.str.startswith("Unnamed").any()
        page.refresh()
        assert set(files(page)) == before
    finally:
        page.close()


@pytest.mark.parametrize(
    ("tool", "values", "expected"),
    [
        ("can_load", {"bit_rate": 500_000}, {"can.bit_rates": (500_000,)}),
        (
            "modbus_scan",
            {"bit_rate": 38_400, "processing_ms": 20.0},
            {"modbus.bit_rates": (38_400,), "modbus.processing": 0.02},
        ),
    ],
)
def test_a_bus_is_used_in_a_ship_design(tool, values, expected):
    page = opened(tool, **values)
    query = unescape(re.search(r'href="ship_design\.ipynb\?([^"]*)"', page.links.value)[1])
    (design,) = read_link(query, tools.ShipDesign)
    assert {name: design._settings()[name] for name in expected} == expected


def test_readings_of_a_valve_are_used_in_its_diagnosis_while_its_motor_is_off():
    page = opened("valve_client")
    try:
        href = re.search(r'href="valve_diagnosis\.ipynb\?([^"]*)"', page.links.value)[1]
        (diagnosis,) = read_link(unescape(href), tools.ValveDiagnosis)
        assert not diagnosis.commanded and diagnosis.verdict == "normal"
        numbers = pd.read_csv(StringIO(page.text), sep=": ", engine="python", names=["n", "v"])
        assert numbers.set_index("n").loc["motor temperature", "v"] == f"{diagnosis.OT:.0f} degC"
        page.buttons["open"].click()
        assert "moving" in page.text and "valve_diagnosis" not in page.links.value
    finally:
        page.close()


def test_a_control_without_effect_says_why_until_it_has_one(page):
    def help_of(name):
        return page._controls._rows[name].children[1].value

    assert "No effect" not in help_of("ring")
    page.controls["ring"].value = True
    assert "No effect now: a &lt;ring&gt; has no ends." in help_of("ring")
    assert "shipnet-idle" in page._controls._rows["ring"]._dom_classes
    assert "shipnet-idle" not in page._controls._rows["bus"]._dom_classes
    page.controls["ring"].value = False
    assert "No effect" not in help_of("ring")


def answer(inputs, picture=False):
    """Return what a page shows: text, and the figure if needed."""
    try:
        view = inputs._view()
    except ArgumentError as problem:
        return str(problem)
    return str(view), view.figure() if picture else ""


@pytest.mark.parametrize("tool", TOOLS)
def test_every_control_changes_the_answer_or_says_why_not(tool):
    starts = [kind_of(tool)(**SMALL.get(tool, {}))]
    if tool in SWEPT:  # the others take long
        page = starts[0].explore()
        for button in page.stories.values():
            button.click()
            starts.append(page.inputs)
    for start in starts:
        idle = start._view().idle
        for name, kind in declared(type(start)).items():
            if not isinstance(kind, Part | Text):
                assert has_effect(start, name, kind) != (name in idle), (start, name)


def has_effect(start, name, kind):
    """Return whether some value of a control changes the text or the figure."""
    grid = [value for value in _grid(kind, start) if value != getattr(start, name)]
    others = []
    for value in grid[:: max(1, len(grid) // 4)] + grid[-1:]:
        try:
            others.append(replace(start, **{name: value}))
        except ArgumentError:
            continue
    return any(
        answer(start, picture) != answer(other, picture)
        for picture in (False, True)
        for other in others
    )


def test_the_severity_of_no_fault_has_no_effect():
    page = tools.ValveDiagnosis().explore()
    severity = page._setters._rows["severity"].children[1]
    assert "No effect now: no fault is chosen." in severity.value
    page.presets["fault"].value = "P2"
    assert "No effect" not in severity.value


# Phones ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("tool", TOOLS)
def test_on_a_phone_the_text_of_a_figure_does_not_overlap(tool):
    view, sheet = kind_of(tool)(**SMALL.get(tool, {}))._view(), Sheet()
    view.figure(sheet, narrow=True)
    renderer = sheet.axes.figure.canvas.get_renderer()
    for axis in (sheet.axes.xaxis, sheet.axes.yaxis):
        shown = [label for label in axis.get_ticklabels() if label.get_text()]
        boxes = [label.get_window_extent(renderer) for label in shown]
        for one, after in pairwise(boxes):
            assert not one.overlaps(after), (tool, axis.axis_name)


def test_on_a_phone_the_tiles_of_the_engine_are_wide_enough_for_their_text():
    sheet = Sheet()
    tools.EngineFaults()._view().figure(sheet, narrow=True)
    _, words = sheet.axes.collections[-2:]
    tile = sheet.axes.transData.transform([[0, 0], [0.94, 0]])
    widths = [path.get_extents().width * sheet.axes.figure.dpi / 72 for path in words.get_paths()]
    assert len(widths) == 99 and max(widths) <= tile[1, 0] - tile[0, 0]


def test_fronts_name_the_sweep():
    module = importlib.import_module("shipnet.tools")
    assert isinstance(module.ModbusScan().sweep("dead"), module.Sweep)
