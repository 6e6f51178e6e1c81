"""What objects show in a notebook."""

import re
from base64 import b64decode
from html import escape, unescape
from io import BytesIO
from xml.etree import ElementTree

import matplotlib.pyplot as plt
import numpy as np
import pytest
from PIL import Image

from shipnet import asi, ballast, can, design
from shipnet.answers import COLUMNS, Findings
from shipnet.errors import ArgumentError
from shipnet.html import as_html
from shipnet.lazy import pd
from tests.objects import OBJECTS, made

PICTURE = re.compile(r'<img style="[^"]*" alt="([^"]*)" src="data:image/([a-z+]*);base64,([^"]*)">')
#: Objects whose form has no figure.
PLAIN = """
    Findings asi.Quality can.Capture can.LogComparison can.LogLoad can.MessageSet design.IoList
    engine.Screen fuzzy.Decision rc.SerialCapture
""".split()
HOSTILE = "<script>alert(1)</script> $x^2$ \" ' & \udcff \u202e"


@pytest.mark.parametrize("name", OBJECTS)
def test_every_main_object_shows_itself(name):
    shown = made(name)
    form = shown._repr_html_()
    verdict = re.search("<strong>(.*?)</strong>", form, re.S)[1]
    assert unescape(verdict) == getattr(shown, "verdict", repr(shown).strip("<>"))
    assert len(form.encode()) < 60_000
    assert form == shown._repr_html_()
    pictures = PICTURE.findall(form)
    assert len(pictures) == (name not in PLAIN)
    for alt, kind, data in pictures:
        assert alt == verdict
        picture = b64decode(data)
        assert 2000 < len(picture) < 30_000
        if kind == "png":
            assert Image.open(BytesIO(picture)).size[0] == 768
        else:
            assert kind == "svg+xml" and ElementTree.fromstring(picture).tag.endswith("svg")
    assert "No figure" not in form
    assert plt.get_fignums() == []
    ElementTree.fromstring(PICTURE.sub("", form))  # every tag is closed


@pytest.mark.parametrize(
    ("name", "sign"),
    [
        ("PlanFindings", "\N{BALLOT X}"),
        ("Findings", ">?<"),
        ("asi.Capture", "\N{BALLOT X}"),
        ("ballast.Diagnosis", "\N{BALLOT X}"),
        ("can.Analysis", "\N{CHECK MARK}"),
        ("can.Capture", "\N{CHECK MARK}"),
        ("can.ResponseTimes", "\N{BALLOT X}"),
        ("design.Design", "\N{CHECK MARK}"),
        ("asi.Plan", None),
        ("engine.Run", None),
    ],
)
def test_a_sign_shows_whether_the_result_is_good(name, sign):
    before = made(name)._repr_html_().partition("<strong>")[0]
    assert (sign in before) if sign else ("span" not in before)


@pytest.mark.parametrize(
    ("name", "worst", "column"),
    [
        ("PlanFindings", ["cable_length", "slave_voltage", "ringing"], "margin"),
        ("asi.Quality", ["1", "2", "3"], "margin"),
        ("can.ResponseTimes", ["speed", "shutdown", "fuel index"], "slack_ms"),
        ("can.Run", ["speed", "shutdown", "fuel index"], "slack_ms"),
        ("can.LogComparison", ["speed", "shutdown", "fuel index"], "verdict"),
        ("engine.Run", ["ME-JB2-044", "ME-JB2-045", "ME-JB2-046"], "margin_s"),
        ("modbus.Run", ["1", "2", "3"], "longest_gap_s"),
        ("modbus.Scan", ["19200", "9600", "38400"], "margin_s"),
    ],
)
def test_the_worst_rows_come_first_with_limit_and_margin(name, worst, column):
    head, body = made(name)._repr_html_().split("</table>")[0].split("<tbody>")
    assert re.findall(r"<tr>\s*<th>(.*?)</th>", body) == worst
    assert f"<th>{column}</th>" in head


class Shown:
    ok = True

    def __init__(self, table, plot=None, verdict="fine"):
        self._table, self.verdict = table, verdict
        if plot:
            self.plot = plot

    def table(self):
        return self._table


def test_text_of_a_file_is_shown_as_text():
    messages = can.MessageSet([can.Message(HOSTILE[:-4], 1, 8, 2e-3), can.Message("b", 2, 8, 3e-3)])
    shown = Shown(pd.DataFrame({HOSTILE: [HOSTILE]}, index=[HOSTILE]), verdict=HOSTILE)
    for one in (messages, can.response_times(messages, 125e3), shown):
        form = as_html(one)
        assert "<script" not in form and "&lt;script&gt;alert(1)" in form
        form.encode()
    for data in PICTURE.findall(as_html(can.response_times(messages, 125e3))):
        texts = ElementTree.fromstring(b64decode(data[2])).itertext()
        assert any("<script>alert(1)</script> $x^2$" in text for text in texts)


def test_no_part_is_read_as_a_formula():
    """A notebook typesets text between dollar signs, except in elements of these classes."""
    assert as_html(made("can.MessageSet")).startswith(
        '<div class="shipnet-form tex2jax_ignore mathjax_ignore">'
    )


def test_a_large_table_and_long_text_are_cut_short():
    table = pd.DataFrame({f"{k}{'x' * 5000}": ["y" * 10_000] * 5000 for k in range(15)})
    form = as_html(Shown(table.set_index(table.columns[0]), verdict="z" * 1_000_000))
    assert len(form.encode()) < 60_000
    assert "Table of the first 12 of 5000 rows" in form
    assert form.count("<tr>") == 3 + 12 and "\N{HORIZONTAL ELLIPSIS}" in form


def test_numbers_have_few_digits_and_empty_columns_are_left_out():
    numbers = [1234567.8, 345.1234567, 99.9949, -0.00012346, np.inf, np.nan]
    texts = ["1,234,568", "345.123", "99.99", "-0.0001235", "inf", ""]
    for number, text in zip(numbers, texts, strict=True):
        table = pd.DataFrame({"a": [number], "b": np.nan, "c": "", "d": [None], "e": pd.NA, "f": 7})
        form = as_html(Shown(table))
        assert re.findall("<td>(.*?)</td>", form) == [*filter(None, [text]), "7"]
        assert "details" not in form


def test_a_figure_that_cannot_be_drawn_is_replaced_by_the_reason():
    def nothing(ax):
        raise ArgumentError("start is <0>; it must select a request")

    form = as_html(Shown(pd.DataFrame({"a": [1]}), nothing))
    assert "<p>No figure: start is &lt;0&gt;; it must select a request</p>" in form
    noise = np.random.default_rng(2024).random((400, 800, 3))
    assert "bytes need a larger figure" in as_html(
        Shown(pd.DataFrame(), lambda ax: ax.imshow(noise))
    )


def test_another_error_of_a_plot_is_not_hidden():
    with pytest.raises(ZeroDivisionError):
        as_html(Shown(pd.DataFrame(), lambda ax: 1 / 0))


EMPTY = {
    "findings": lambda: Findings(pd.DataFrame(columns=COLUMNS)),
    "responses": lambda: can.ResponseTimes([], 125e3),
    "can run": lambda: can.simulate(can.example(), 125e3, until=1e-9),
    "asi run": lambda: asi.simulate([asi.Slave("1")], cycles=1),
    "no samples": lambda: ballast.rule_base().decide({"FP": []}),
    "no movement": lambda: ballast.simulate(1, [], until=2),
    "no alarm": lambda: ballast.simulate(1, [], until=2).diagnose(),
    "cube": lambda: ballast.rule_base().decide({"FP": np.full((2, 3, 4), 125.0), "MC": 4}),
    "left out": lambda: design.IoList.parse("tag,signal\nA,contact").plan("CAN", (0, 0, 0)),
    "hardwired": lambda: design.IoList.parse("tag,signal,x,y,z\nA,contact,1,2,3").plan(
        "home runs", (0, 0, 0)
    ),
}


@pytest.mark.parametrize("make", EMPTY.values(), ids=EMPTY)
def test_an_empty_or_unusual_object_shows_itself(make):
    shown = make()
    assert escape(getattr(shown, "verdict", repr(shown).strip("<>"))) in shown._repr_html_()


def test_a_plan_shows_itself_without_computing_its_signals(monkeypatch):
    plan = asi.line(100, 62)
    for name in ("quality", "waveform", "check", "record"):
        monkeypatch.setattr(type(plan), name, None)
    assert "62 slaves" in plan._repr_html_()


def test_the_text_form_is_one_line():
    many = {"ballast.FleetReport"}  # its text is its report
    assert {name for name in OBJECTS if "\n" in repr(made(name))} == many
