"""The page that all tools share, tested with a tool of three fields."""

import json
import re
import subprocess
import sys
from base64 import b64decode
from dataclasses import dataclass, replace
from html import unescape

import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.figure import Figure

from shipnet.errors import ArgumentError, InputError
from shipnet.fields import (
    Words,
    check_choice,
    check_fields,
    choice,
    number,
    part,
    switch,
    text,
    whole,
)
from shipnet.tools._page import Page, draw_steps, stepper
from shipnet.tools._view import (
    Answer,
    Button,
    Preset,
    Upload,
    View,
    details,
    read_link,
    read_state,
    write_link,
    write_state,
)
from tests.support import load

WITHOUT_WIDGETS = """
import sys
sys.modules["ipywidgets"] = None
from shipnet import tools
print(tools.AsiBench().verdict)
for use in (lambda: tools.AsiBench().explore(), lambda: tools.ValveClient, lambda: tools.stepper):
    try:
        use()
    except ImportError as problem:
        print(problem)
"""

#: Name of the tool in a saved state, which is that of its record's module.
TOOL = "test_tools_page"


@dataclass(frozen=True)
class Toy:
    slaves: int = whole(1, 30, help=Words("slaves", "How <many>."), default=5)
    dead: int = whole(0, 30, help=Words("dead", "Of them."), default=0, at_most="slaves")
    length: float = number(0, 500, "m", Words("length", "Cable."), (0, 100), default=10.0)
    bus: str = choice(["CAN", "AS-i"], Words("bus", "Which."), default="CAN")
    ring: bool = switch(Words("ring", "Closed."), default=False)
    name: str = text(Words("name", "Any."), default="", most=9)
    done: tuple[str, ...] = part(tuple, Words("done", "So far."), default=())

    def __post_init__(self):
        check_fields(self)
        if len(self.done) > 3:
            raise ArgumentError(f"there are {len(self.done)} done; the limit is 3")
        for done in self.done:
            check_choice("one of done", done, "ab")
        if self.ring and self.bus == "AS-i":
            raise ArgumentError("ring is True; AS-i has none")


class Seen(list):
    def __call__(self, toy):
        self.append(toy)
        if toy.name == "crash":
            raise ZeroDivisionError("<b>1/0</b>")
        if toy.name == "file":
            raise InputError("a.csv", "row 1 is empty")
        return View(
            verdict=f"{toy.slaves} slaves <on> {toy.bus}",
            ok=not toy.dead,
            numbers={"dead": str(toy.dead)},
            plot=lambda ax: ax.plot([0, toy.slaves]),
            height=1,
            about="A line",
            files={"report.html": "<p>fine</p>"},
        )


@pytest.fixture
def seen():
    return Seen()


@pytest.fixture
def page(seen):
    return Page(Toy(), seen)


def test_every_control_shows_its_value_within_its_limits_and_has_its_help(page):
    assert list(page.controls) == ["slaves", "dead", "length", "bus", "ring", "name"]
    length = page.controls["length"]
    assert (length.value, length.min, length.max) == (10, 0, 100)
    assert (length.description, length.tooltip) == ("length [m]", "Cable.")
    helps = re.findall('shipnet-help">(.*?)</div>', repr(page._controls.box.children))
    assert helps == ["How &lt;many&gt;.", "Of them.", "Cable.", "Which.", "Closed.", "Any."]


def test_text_is_escaped_and_the_picture_has_alternative_text(page):
    assert page.text == "5 slaves <on> CAN\ndead: 0"
    assert "5 slaves &lt;on&gt; CAN" in page._shown.value
    assert 'alt="A line: 5 slaves &lt;on&gt; CAN"' in page.figure.value


def test_a_fault_shows_a_message_and_the_old_picture_fades(page):
    page.controls["bus"].value = "AS-i"
    old = page.figure.value
    assert "A line: 5 slaves" in old and "shipnet-stale" not in page._dom_classes
    page.controls["ring"].value = True
    assert page.text == "ring is True; AS-i has none"
    assert page.figure.value == old and "shipnet-stale" in page._dom_classes
    assert 'aria-disabled="true">save state' in page.links.value
    page.controls["ring"].value = False
    assert "shipnet-stale" not in page._dom_classes
    page.controls["name"].value = "file"
    assert page.text == "a.csv: row 1 is empty"
    page.controls["name"].value = "crash"
    assert page.text.startswith(
        "This should not happen: ZeroDivisionError: <b>1/0</b>. Please report"
    )
    assert "&lt;b&gt;1/0" in page._shown.value
    assert "shipnet_test_tools_page.json" in page.links.value
    assert "shipnet-busy" not in page._dom_classes


def test_the_faults_of_a_file_are_listed_one_per_line(seen):
    faults = [f"row {n} is <empty>" for n in range(60)]

    def take(toy, name, content):
        raise InputError(name, *faults, more=5)

    def see(toy):
        raise InputError("a.csv", *faults[:2])

    page = Page(Toy(), seen, uploads=[Upload("own", "Yours.", ".txt", take)])
    load(page.uploads["own"], b"x", "x.txt")
    assert page.note.startswith("x.txt: row 0 is <empty>; row 1") and "\n" not in page.note
    assert page._noted.value.count("<br>") == 52 and "and 15 more" in page._noted.value
    assert "<empty>" not in page._noted.value
    assert Page(Toy(), see).text == "a.csv:\nrow 0 is <empty>\nrow 1 is <empty>"


def test_a_table_is_shown_between_verdict_and_numbers():
    table = pd.DataFrame({"cost <EUR>": ["<1", "2"]}, index=["a & b", "c"])
    view = View(verdict="two", ok=True, numbers={"n": "2"}, table=table, caption="made <up>")
    assert str(view).splitlines()[-2:] == ["made <up>", "n: 2"] and "cost <EUR>" in str(view)
    html = view.answer + details(Answer(Toy(), view))
    order = ["two", "cost &lt;EUR&gt;", "a &amp; b", "<td>&lt;1</td>", "made &lt;up&gt;", ">n</th>"]
    assert sorted(map(html.index, order)) == [html.index(part) for part in order]


def test_a_preset_sets_all_controls_and_is_computed_once(seen):
    preset = Preset(Toy(name="all"), lambda two, toy: replace(toy, slaves=2 * two.slaves))
    page = Page(Toy(), seen, preset=preset)
    page.presets["slaves"].value = 7
    assert [toy.slaves for toy in seen] == [5, 14]
    page.presets["slaves"].value = 30
    assert page.note == "slaves is 60; it must be a whole number 1..30"
    assert page.controls["slaves"].value == 14


def test_a_button_changes_fields_without_controls_and_reports_failure(seen):
    buttons = [
        Button("a", "Adds a.", lambda toy: replace(toy, done=(*toy.done, "a"))),
        Button("crash", "Fails.", lambda toy: 1 / 0),
        Button("again", "Once more.", lambda toy: None),
    ]
    page = Page(Toy(), seen, buttons=buttons)
    for _ in range(4):
        page.buttons["a"].click()
    assert page.inputs.done == ("a", "a", "a")
    assert page.note == "there are 4 done; the limit is 3"
    page.buttons["again"].click()
    assert page.note == "" and len(seen) == 5
    page.buttons["crash"].click()
    assert "This should not happen: ZeroDivisionError" in page.note


def test_an_upload_changes_inputs_or_says_why_not_and_works_twice_for_a_file(seen):
    def take(toy, name, content):
        if not content:
            raise InputError(name, "it is empty")
        return replace(toy, name=content.decode())

    page = Page(Toy(), seen, uploads=[Upload("own", "Yours.", ".txt", take)])
    # The upload is emptied before the page responds, because a browser may then load the next file.
    kept = []
    page._noted.observe(lambda _: kept.append(page.uploads["own"].value), "value")
    load(page.uploads["own"], b"", "x.txt")
    assert kept == [()]
    assert page.note == "x.txt: it is empty" and page.inputs == Toy()
    assert "have not changed" in page._noted.value and "shipnet-before" in page._dom_classes
    load(page.uploads["own"], b"mine", "x.txt")
    assert page.note == "" and page.inputs == Toy(name="mine")
    assert "x.txt is loaded" in page._noted.value and "shipnet-before" not in page._dom_classes
    page.controls["name"].value = ""
    load(page.uploads["own"], b"mine", "x.txt")
    assert page.inputs == Toy(name="mine")


TOYS = st.builds(
    Toy,
    slaves=st.just(30),
    dead=st.integers(0, 30),
    length=st.floats(0, 100),
    bus=st.just("CAN"),
    ring=st.booleans(),
    name=st.text(max_size=9),
    done=st.lists(st.sampled_from("ab"), max_size=3).map(tuple),
)


@given(toy=TOYS)
def test_a_saved_state_is_loaded_unchanged(toy):
    assert read_state(write_state(TOOL, toy).encode(), TOOL, Toy) == [toy]
    pinned = write_state(TOOL, toy, [Toy(), toy]).encode()
    assert read_state(pinned, TOOL, Toy) == [toy, Toy(), toy]


def state(**changes):
    whole = json.loads(write_state(TOOL, Toy(dead=3, done=("b",))))
    inputs = whole["inputs"] | changes.pop("inputs", {})
    return json.dumps({**whole, "inputs": inputs, **changes}).encode()


def test_load_reads_back_what_the_link_saves(page):
    page.controls["slaves"].value = 9
    page.controls["name"].value = "caf\xe9"
    kept = b64decode(
        re.search('shipnet_test_tools_page.json" href="data:[^,]*,([^"]*)"', page.links.value)[1]
    )
    other = Page(Toy(), Seen())
    load(other.uploads["load state"], kept, "kept.json")
    assert other.inputs == Toy(slaves=9, name="caf\xe9") and other.text.startswith("9 slaves")
    report = re.search('report.html" href="data:[^,]*,([^"]*)"', page.links.value)[1]
    assert b64decode(report) == b"<p>fine</p>"


def test_a_state_that_is_saved_when_the_verdict_changes_is_the_new_one(page):
    links = []
    page._shown.observe(lambda _: links.append(page.links.value), "value")
    page.controls["slaves"].value = 9
    assert links == [page.links.value] and "?slaves=9" in links[0]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "it is not JSON"),
        (b"[" * 100_000, "it is not JSON"),
        (b'{"tool": "test_tools_page"}', "lacks the format"),
        (state(tool="other"), "its tool is 'other'; this page reads 'test_tools_page'"),
        (state(version=2), "its version is 2; this page reads 1"),
        (state(inputs={"more": 1}), "unknown input 'more'"),
        (state().replace(b'"bus": "CAN", ', b""), "input 'bus' is missing"),
        (state(inputs={"slaves": 31, "bus": "LIN"}), "slaves is 31.*; bus is 'LIN'"),
        (state(inputs={"slaves": 2}), "dead is 3; .*0..2, because slaves is 2"),
        (state(inputs={"length": 400}), "length is 400 m; its slider shows 0..100 m"),
        (state(inputs={"length": 10**400}), r"length is 10+ \.\.\. 0+; it must"),
        (state(inputs={"bus": ["CAN"]}), r"bus is \('CAN',\)"),
        (state(inputs={"done": [["a"]]}), r"one of done is \['a'\]"),
        (state(inputs={"ring": True, "bus": "AS-i"}), "AS-i has none"),
        (state(pins={"slaves": 9}), "its pins are not a list of inputs"),
        (state(pins=[{"slaves": 9}]), "input 'dead' is missing"),
        (b" " * 2_000_001, "it has 2000001 bytes"),
    ],
    ids=range(17),
)
def test_an_illegal_state_is_refused_and_nothing_changes(page, content, message):
    page.controls["length"].value = 77.0
    before, calls = page.inputs, len(page._see)
    load(page.uploads["load state"], content, "bad.json")
    assert re.search("^bad.json: .*" + message, page.note), page.note
    assert "Traceback" not in page._noted.value and "should not happen" not in page.note
    assert page.inputs == before and len(page._see) == calls
    assert page.text.startswith("5 slaves")


def query(toy, *pins):
    return unescape(re.search(r'href="\?([^"]*)"', write_link(toy, pins))[1])


@given(toy=TOYS)
def test_a_link_is_read_back_unchanged_and_names_only_changed_inputs(toy):
    assert read_link(query(toy), Toy) == [toy]
    assert read_link(query(toy, Toy(), toy), Toy) == [toy, Toy(), toy]
    assert query(replace(Toy(), dead=3)) == "dead=3" and query(Toy()) == ""


def test_a_link_opens_the_page_at_its_values_and_the_page_has_the_same_link(page, seen):
    page.query.value = "slaves=9&ring=True&done=a b&name="
    assert page.inputs == Toy(slaves=9, ring=True, done=("a", "b")) and page.note == ""
    assert len(seen) == 2 and "?slaves=9&amp;ring=True&amp;done=a+b" in page.links.value


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ("slaves=31&bus=LIN", "slaves is 31.*; bus is 'LIN'"),
        ("slaves=2.5", r"slaves is '2\.5'"),
        ("slaves=%00%ff&ring=yes", "slaves is .*; ring is 'yes'"),
        ("more=1", "unknown input 'more'"),
        ("slaves=9&pin=slaves%3D31", "slaves is 31"),
        ("pin=pin%3Dslaves%253D9", "unknown input 'pin'"),
    ],
)
def test_an_illegal_link_is_refused_and_the_page_stays(page, seen, wrong, message):
    page.query.value = wrong
    assert re.search("^the link: " + message, page.note), page.note
    assert "have not changed" in page._noted.value and len(seen) == 1
    assert page.inputs == Toy()


def test_a_narrow_page_gets_a_narrow_figure_and_may_draw_it_in_another_way(page):
    assert 'width="750" height="100"' in page.figure.value
    page.narrow.value = "yes"
    assert 'width="460" height="80"' in page.figure.value
    drawn = []
    view = View(verdict="", ok=True, plot=lambda ax: drawn.append("wide"))
    for narrow in (lambda ax: drawn.append("narrow")), None:
        replace(view, narrow=narrow).figure(narrow=True)
    assert drawn == ["narrow", "wide"]


def test_a_slider_shows_the_nearest_step_and_a_browsers_echo_is_not_a_change(page, seen):
    page._controls.put(Toy(length=10.4))
    assert page.inputs.length == 10.0
    page.note = "kept"
    page.controls["length"].value = 10.000000000000002
    assert (page.inputs.length, len(seen), page.note) == (10.0, 1, "kept")
    page.controls["length"].value = 11.0
    assert len(seen) == 2


def test_the_stepper_draws_a_frame_once_when_shown_and_stops_at_both_ends():
    drawn = []
    view = stepper(lambda k, ax: drawn.append(k), ["first", "second", "third"])
    controls, caption, image = view.children
    back, _, on = controls.children
    seen = [(caption.value, back.disabled, on.disabled)]
    for button in (on, on, back, back):
        button.click()
        seen.append((caption.value, back.disabled, on.disabled))
    middle = ("second", False, False)
    assert seen == [("first", True, False), middle, ("third", False, True), middle, seen[0]]
    assert drawn == [0, 1, 2] and image.value[1:4] == b"PNG"


def test_faults_are_named():
    with pytest.raises(ArgumentError, match="number of captions is 0"):
        stepper(lambda k, ax: None, [])
    with pytest.raises(ArgumentError, match="there are 1 axes for 2 steps"):
        draw_steps(lambda k, ax: None, [0, 1], [Figure().subplots()])


def test_without_widgets_a_tool_has_a_verdict_and_its_page_names_the_package():
    printed = subprocess.check_output([sys.executable, "-c", WITHOUT_WIDGETS], text=True)
    verdict, *errors = printed.splitlines()
    assert verdict
    message = "ipywidgets is not installed; install it with: python -m pip install ipywidgets"
    assert errors == [message] * 3
