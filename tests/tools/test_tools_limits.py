"""Every tool at the limits of each of its controls."""

import importlib
import re
from dataclasses import replace
from html import unescape
from math import inf, nan
from pathlib import Path

import ipywidgets as widgets
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shipnet.errors import ArgumentError, InputError
from shipnet.fields import Choice, Number, Part, Switch, Text, Whole, declared
from shipnet.tools import engine_faults, valve_client
from shipnet.tools._page import Controls
from shipnet.tools._tool import Tool
from shipnet.tools._view import Sheet
from shipnet.tools.ring_buffer import ACTIONS

FOLDER = Path(__file__).resolve().parents[2] / "shipnet" / "tools"
TOOLS = sorted(path.stem for path in FOLDER.glob("[a-z]*.py"))
CSV = "name,arbitration_id,dlc,period_ms\n"
#: A small example for each tool whose own example is large.
SMALL = {
    "ship_design": {
        "points": "tag,signal,x,y,z\n"
        + "".join(
            f"LS-{n},contact,{9 * n},2,3\nTT-{n},Pt100 3-wire,{7 * n},1,5\n" for n in range(6)
        ),
        "cabinet": "20, 0, 9",
        **dict.fromkeys(("junction_boxes", "asi", "modbus"), False),
    }
}
TEXTS = ["", "\0", "oil", CSV, CSV + "oil,1,8,10\n", CSV + "oil,1,9,10\n", CSV + "oil,1,8,1e-9\n"]


def kind_of(tool):
    """Return the class of a tool, by the name of its module."""
    module = importlib.import_module(f"shipnet.tools.{tool}")
    (kind,) = (value for value in vars(module).values() if is_tool(value, module))
    return kind


def is_tool(value, module):
    return (
        isinstance(value, type) and issubclass(value, Tool) and value.__module__ == module.__name__
    )


def limits(kind):
    """Return the limits of the legal values and a value between them."""
    if isinstance(kind, Number):
        return [kind.low, kind.high, (kind.low + kind.high) / 2, *([nan] if kind.missing else [])]
    if isinstance(kind, Whole):
        return [kind.low, kind.high, (kind.low + kind.high) // 2]
    if isinstance(kind, Choice):
        return list(kind.options)
    if isinstance(kind, Switch):
        return [False, True]
    if isinstance(kind, Text):
        return TEXTS
    assert kind.of is tuple, "a new kind of field"
    return [(), *((one,) for one in ACTIONS), 3 * tuple(ACTIONS)]


def computes(tool, values, figure=False):
    """Return True if the tool computes; otherwise it must raise an error that a page can show."""
    try:
        view = kind_of(tool)(**(SMALL.get(tool, {}) | values))._view()
        assert view.verdict
        if figure:
            assert "data:image/png" in view.figure()
    except (ArgumentError, InputError) as error:
        assert str(error) and "\n" not in str(error)
        return False
    return True


@pytest.mark.parametrize("tool", TOOLS)
def test_each_control_at_each_limit(tool):
    kinds = declared(kind_of(tool))
    assert kinds
    done = [computes(tool, {name: value}) for name, kind in kinds.items() for value in limits(kind)]
    assert sum(done) > len(done) / 3


@settings(max_examples=10)
@pytest.mark.parametrize("tool", TOOLS)
@given(data=st.data())
def test_any_limits_are_computed_together(tool, data):
    kinds = declared(kind_of(tool))
    values = {name: data.draw(st.sampled_from(limits(kind))) for name, kind in kinds.items()}
    computes(tool, values)


@pytest.mark.parametrize("tool", TOOLS)
def test_the_figure_at_the_lowest_and_the_highest_of_all(tool):
    for end in (0, 1):
        kinds = declared(kind_of(tool)).items()
        numbers = {n: limits(kind)[end] for n, kind in kinds if isinstance(kind, Number | Whole)}
        computes(tool, numbers, figure=True)


@pytest.mark.parametrize("tool", TOOLS)
def test_reused_axes_show_nothing_of_the_last_plot(tool):
    kinds = declared(kind_of(tool)).items()
    inputs = [{n: x} for n, kind in kinds if not isinstance(kind, Text) for x in limits(kind)]
    sheet, again = Sheet(), 0
    for values in [{}, *inputs[:: len(inputs) // 4 + 1], {}]:
        try:
            view = kind_of(tool)(**(SMALL.get(tool, {}) | values))._view()
        except (ArgumentError, InputError):
            continue
        axes, words, new = sheet.axes, sheet._words, Sheet()
        sheet.fit()
        shown, fresh = (one.png(view.plot, 5, 4) for one in (sheet, new))
        if sheet._words == words:
            # The layout is unchanged.
            new.axes.set_position(sheet.axes.get_position(original=True))
            fresh = new._drawn(new.axes)
        assert shown == fresh, values
        again += sheet.axes is axes
    assert again >= 3


@pytest.mark.parametrize("tool", TOOLS)
def test_values_that_are_not_legal_are_named(tool):
    for name, kind in declared(kind_of(tool)).items():
        wrong = [None, [], object(), {}]
        if isinstance(kind, Number | Whole):
            wrong += [kind.low - 1, kind.high + 1, inf, -inf, "1", True, 1j]
        for value in wrong:
            with pytest.raises(ArgumentError, match=name):
                kind_of(tool)(**{name: value})


@pytest.mark.parametrize("tool", TOOLS)
def test_sliders_stay_within_legal_values_and_start_at_the_inputs(tool):
    start = kind_of(tool)()
    controls = Controls(start)
    for name, kind in declared(type(start)).items():
        assert kind.label and kind.help.endswith("."), name
        if isinstance(kind, Part):
            continue
        control = controls.widgets[name]
        assert control.value == getattr(start, name)
        if isinstance(control, widgets.FloatSlider | widgets.IntSlider | widgets.BoundedIntText):
            assert kind.low <= control.min < control.max <= kind.high
            # Each end of the slider is legal with all other values at their defaults.
            for end in (control.min, control.max):
                replace(start, **{name: end})
    assert controls.inputs == start


@pytest.mark.parametrize("tool", TOOLS)
def test_every_story_is_shown_after_any_other_and_a_page_can_open_on_the_first(tool):
    page = kind_of(tool)().explore(story=True)
    try:
        opened, first = page.text, next(iter(page.stories))
        assert len(page.stories) >= 3 and page._look.value.endswith("?")
        shown = {}
        for story, button in page.stories.items():
            button.click()
            assert page.note == "" and page._look.value.endswith("?"), story
            assert page.figure.value or page.drawing
            shown[page._look.value] = page.text
        assert len(shown) == len(set(shown.values())) == len(page.stories)
        # Each number in a story is shown on the page or is the value of a control.
        told = re.findall(r"\d+\.\d+|\d\d+", unescape(" ".join(shown)))
        values = [{**story, "look": ""} for story in page._stories.values()]
        text = " ".join([*shown.values(), str(kind_of(tool)()), str(values)])
        assert [number for number in told if number not in text] == []
        page.stories[first].click()
        # The valves of a server keep moving.
        assert page.text == opened or tool == "valve_client"
    finally:
        page.close()


def test_numbers_in_the_words_of_a_page_are_those_of_the_tool():
    helps = declared(kind_of("engine_faults"))
    assert f"begins {engine_faults.START:g} s after" in helps["fault"].help
    assert f"begins at {engine_faults.START:g} s" in helps["time"].help
    assert f"has {valve_client._OWN}." in declared(kind_of("valve_client"))["valves"].help
