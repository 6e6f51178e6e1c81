"""The tools of notebooks/explore/ as web pages, moved by a browser."""

import json
import re
import shutil
from base64 import b64encode
from contextlib import closing, suppress
from http.client import HTTPConnection
from urllib.error import HTTPError
from urllib.request import urlopen

import nbformat
import pytest
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook, new_output
from playwright.sync_api import expect

from docs import app as launcher
from shipnet import datasets
from shipnet.tools._view import Sheet
from tests.browser.conftest import served

EXPLORE = launcher.ROOT / "notebooks" / "explore"
TOOLS = sorted(path.stem for path in EXPLORE.glob("*.ipynb"))
LONG = 120_000  # ms; a kernel may start slowly on a busy machine
SCREENSHOTS = launcher.ROOT / "build" / "screenshots"

# How high the whole page is, which scrolls in a box of its own.
HEIGHT = """() => Math.max(...[...document.querySelectorAll("body, body *")]
  .filter(box => box.querySelector(".shipnet-page")).map(box => box.scrollHeight))"""
# Controls and values that reach beyond their panel, and labels that are cut.
OUTSIDE = """() => [...document.querySelectorAll(".shipnet-panel")].flatMap(panel =>
  [...panel.querySelectorAll("input, select, textarea, button, label, .widget-readout")]
    .filter(one => one.getBoundingClientRect().right > panel.getBoundingClientRect().right
      || one.matches("label, .widget-readout") && one.scrollWidth > one.clientWidth)
    .map(one => one.className + " " + one.innerText))"""

# A tool that takes as long as its slider says, and fails where there is nothing to divide by.
SLOW = """
import time
from dataclasses import dataclass
from shipnet.fields import Words, number
from shipnet.tools._page import Page
from shipnet.tools._view import View

@dataclass(frozen=True)
class Inputs:
    wait: float = number(0, 1, "s", Words("wait", "How long."), default=0.1, step=0.1)

def see(inputs):
    time.sleep(inputs.wait)
    return View(verdict=f"waited {1 / inputs.wait:.0f}", ok=True)

Page(Inputs(), see)
"""


@pytest.fixture(scope="module")
def app(tmp_path_factory):
    root = tmp_path_factory.mktemp("app")
    folder = shutil.copytree(EXPLORE, root / "explore")
    write(folder / "slow.ipynb", SLOW)
    # A kernel for each tool, of which a worker opens a few, would keep the others waiting.
    with served(folder, root, f"{launcher.PREHEAT}=False") as address:
        yield address


def write(path, tool, *examples):
    cells = [new_markdown_cell("# Slow\n\nIt waits."), *examples, new_code_cell(tool)]
    cells[-1].metadata["tags"] = ["widget"]
    nbformat.write(new_notebook(cells=cells), path)


class Tool:
    """A tool's page: where it says its verdict, its figure, its sliders by name."""

    def __init__(self, page):
        self.page = page
        self.verdict = page.locator(".shipnet-verdict")
        self.figure = page.locator(".shipnet-answer img")

    @classmethod
    def opened(cls, page, app, name):
        # Only the index gives what a page needs to end its kernel when it is left.
        page.goto(app, timeout=LONG)
        page.locator(f"a[href$='/{name}.ipynb']").click(timeout=LONG)
        tool = cls(page)
        tool.verdict.wait_for(timeout=LONG)
        # Not a line of code is shown, and no error of Python's.
        expect(page.locator(".jp-InputArea-editor, .highlight")).to_have_count(0)
        expect(page.get_by_text("Traceback")).to_have_count(0)
        return tool

    def says(self, text):
        expect(self.verdict).to_contain_text(text, timeout=LONG)

    def slider(self, label):
        return self.page.get_by_role("slider", name=label, exact=True)

    def press(self, label, times=1, key="ArrowRight"):
        for _ in range(times):
            self.slider(label).press(key)

    def choose(self, label, option):
        self.page.get_by_label(label, exact=True).select_option(option)

    def button(self, label):
        return self.page.get_by_role("button", name=label, exact=True)

    def unfold(self, title):
        self.page.locator(".jupyter-widget-Collapse-header").get_by_text(title).click()

    def load(self, place, name, content):
        file = {"name": name, "mimeType": "text/plain", "buffer": content}
        with self.page.expect_file_chooser() as chooser:
            self.page.locator(f".shipnet-upload[title='{place}']").click()
        chooser.value.set_files(file)

    def moves(self, act, before, after):
        """Act, and see number and figure change; save this, change back, load it."""
        self.says(before)
        picture = self.figure.get_attribute("src")
        assert re.fullmatch(".+: .+", self.figure.get_attribute("alt"), re.S)
        act()
        self.says(after)
        expect(self.figure).not_to_have_attribute("src", picture, timeout=LONG)

    def is_pictured(self, name):
        """Save what the page looks like, on a desk and on a phone; nothing sticks out."""
        SCREENSHOTS.mkdir(parents=True, exist_ok=True)
        for width, path in [(390, f"{name}_phone.png"), (1280, f"{name}.png")]:
            self.page.set_viewport_size({"width": width, "height": 1000})
            height = self.page.evaluate(HEIGHT)
            self.page.set_viewport_size({"width": width, "height": height})
            self.page.screenshot(path=SCREENSHOTS / path)
            assert self.page.evaluate(OUTSIDE) == [], f"{name} at {width} px"
        self.page.set_viewport_size({"width": 1400, "height": 1000})

    def is_compared(self, name, sweep=None):
        """Pin the answer, sweep a control and download a file, on a desk and on a phone."""
        pin = self.page.get_by_role("columnheader", name="pin 1")
        for size, drawn in (((1280, 800), "750"), ((390, 844), "460")):
            self.page.set_viewport_size({"width": size[0], "height": size[1]})
            expect(self.figure).to_have_attribute("width", drawn, timeout=LONG)
            self.button("pin").click()
            expect(pin).to_be_visible(timeout=LONG)
            names = [f"shipnet_{name}"]
            if sweep:
                names.append(f"shipnet_{name}_sweep")
                field, words = sweep
                self.choose("sweep", field)
                expect(self.page.get_by_text(words)).to_be_visible(timeout=LONG)
                swept = self.page.locator(".shipnet-page > .shipnet-figure img")
                expect(swept).to_have_attribute("width", drawn, timeout=LONG)
            self.button("figure and data").click()
            for file in names:
                for kind, start in (("svg", b"<?xml"), ("csv", b"\xef\xbb\xbf")):
                    with self.page.expect_download() as download:
                        self.page.get_by_text(f"download {file}.{kind}").click(timeout=LONG)
                    assert download.value.path().read_bytes().startswith(start)
            self.button("remove pins").click()
            expect(pin).to_have_count(0, timeout=LONG)
        self.page.set_viewport_size({"width": 1400, "height": 1000})

    def saved(self):
        with self.page.expect_download() as download:
            self.page.get_by_text("save state").click()
        return download.value.suggested_filename, download.value.path().read_bytes()

    def comes_back(self, undo, before, after):
        """Save the state, undo what was done, and load the state."""
        name, state = self.saved()
        assert name == f"shipnet_{json.loads(state)['tool']}.json"
        undo()
        self.says(before)
        self.load("load state", name, state)
        self.says(after)
        expect(self.page.locator(".shipnet-note")).to_have_text(f"{name} is loaded")


def test_the_index_leads_to_a_tool_which_keys_alone_move_and_which_tells_its_help(page, app):
    page.goto(app, timeout=LONG)
    links = page.locator(".shipnet-index li a")
    names = links.evaluate_all("all => all.map(a => a.pathname.split('/').pop())")
    expect(page.get_by_text("*")).to_have_count(0)
    expect(page.locator("li em", has_text="time")).to_have_count(1)
    assert names == [f"{name}.ipynb" for name in sorted([*TOOLS, "slow"])]
    widths = page.locator("li img").evaluate_all("all => all.map(image => image.naturalWidth)")
    assert len(widths) == len(TOOLS) and min(widths) > 100
    links.nth(names.index("modbus_scan.ipynb")).click()
    expect(page.locator("h1")).to_contain_text("Modbus scan", timeout=LONG)
    assert page.get_by_role("link", name="All tools").evaluate("a => a.pathname") == "/"

    tool = Tool(page)
    tool.says("too slow: 2.543 s")
    registers = tool.slider("registers per slave")
    for _ in range(20):
        if registers.evaluate("handle => handle === document.activeElement"):
            break
        page.keyboard.press("Tab")
    else:
        pytest.fail("Tab does not come to the second slider")
    shown = page.locator(".shipnet-help").filter(visible=True)
    expect(shown).to_have_text(re.compile("Holding registers to read"))
    assert shown.bounding_box()["y"] > registers.bounding_box()["y"]
    page.keyboard.press("ArrowRight")
    expect(registers).to_have_attribute("aria-valuenow", "11.0")


SIZES = [(1280, 800), (390, 844)]


@pytest.mark.parametrize("size", SIZES)
def test_the_bench_opens_a_plan_and_is_used_in_ship_design(page, app, size):
    tool = Tool.opened(page, app, "asi_bench")
    tool.says("1. slave voltage: 24.47 V")
    devices = page.locator(".shipnet-cable").get_by_role("slider")
    devices.first.wait_for(timeout=LONG)
    tool.is_pictured("asi_bench")
    page.set_viewport_size(dict(zip(("width", "height"), size, strict=True)))
    plan = datasets.path("synthetic_asi_plan_ballast.csv").read_bytes()
    tool.load("open a plan", "ballast.csv", plan)
    tool.says("all rules met: 63 checks")
    expect(devices).to_have_count(9, timeout=LONG)
    note = page.locator(".shipnet-note")
    expect(note).to_contain_text("ballast.csv is loaded", timeout=LONG)
    expect(note).to_contain_text("master (1), supply (1), slave (6)")
    tool.load(
        "open a plan", "bad.csv", plan.replace(b"cable,frame 85,BV-03,3", b"cable,frame 85,,3")
    )
    expect(note).to_contain_text("bad.csv: row 9, column to (C): is empty", timeout=LONG)
    tool.says("all rules met: 63 checks")
    page.get_by_role("link", name="use in ship design").click()
    tool.says("99 points: ")
    tool.unfold("limits and prices")
    expect(page.locator("textarea").last).to_have_value("[asi]\ncurrent = 0.12\nlength = 81\n")


@pytest.mark.parametrize("size", SIZES)
def test_the_log_of_a_valve_is_diagnosed_over_time(page, app, size):
    page.set_viewport_size(dict(zip(("width", "height"), size, strict=True)))
    tool = Tool.opened(page, app, "valve_diagnosis")
    rows = "".join(f"{t},{127 if 3 < t < 15 else 90},10,1.2,50,50\n" for t in range(20))
    log = b"time_s,FP,OP,MC,OT,VPos\n" + rows.encode()
    tool.moves(lambda: tool.load("open a log", "log.csv", log), "V1: valve stuck", "of 20 samples")
    expect(page.get_by_text("No effect now: the log has the readings.")).to_have_count(7)
    expect(page.locator(".shipnet-note")).to_contain_text("DVPos computed from VPos")
    assert page.evaluate(OUTSIDE) == []
    tool.choose("fault", "P1")
    tool.says("P1: pump overload")


@pytest.mark.parametrize("size", SIZES)
def test_the_ship_is_drawn_above_the_cost_and_fits_the_screen(page, app, size):
    page.set_viewport_size(dict(zip(("width", "height"), size, strict=True)))
    tool = Tool.opened(page, app, "ship_design")
    ship = page.locator(".shipnet-ship")
    ship.wait_for(timeout=LONG)
    expect(tool.figure).to_be_visible(timeout=LONG)
    boxes = [one.bounding_box() for one in (*ship.locator("figure").all(), tool.figure)]
    assert len(boxes) == 9
    assert max(box["y"] + box["height"] for box in boxes[:-1]) <= boxes[-1]["y"]
    assert max(box["x"] + box["width"] for box in boxes) <= size[0]
    if size[0] > 1000:  # the controls stay in view beside it
        tool.figure.scroll_into_view_if_needed()
        expect(page.get_by_label("home runs", exact=True)).to_be_in_viewport()


def test_on_a_phone_the_figure_stays_in_view_and_a_link_carries_the_values(page, app):
    page.set_viewport_size({"width": 390, "height": 844})
    tool = Tool.opened(page, app, "modbus_scan")
    expect(tool.figure).to_have_attribute("width", "460", timeout=LONG)
    for label in ("bit rate [bit/s]", "longest scan [s]"):
        page.get_by_label(label, exact=True).last.scroll_into_view_if_needed()
        expect(tool.figure).to_be_in_viewport(ratio=1)
        expect(tool.verdict).to_be_in_viewport(ratio=1)
    tool.button("one slave too many").click()
    tool.says("too slow: 2.033 s")
    expect(page.locator(".shipnet-tries")).to_contain_text("takes 2.033 s")
    tool.press("slaves", key="ArrowLeft")
    tool.says("in time: 1.983 s")
    link = page.get_by_role("link", name="link to this state")
    expect(link).to_have_attribute("href", "?slaves=39")
    link.click()
    tool.says("in time: 1.983 s")
    expect(tool.slider("slaves")).to_have_attribute("aria-valuenow", "39.0")
    page.goto(page.url.replace("slaves=39", "slaves=900"))
    expect(page.locator(".shipnet-note")).to_contain_text(
        "the link: slaves is 900; it must be a whole number 1..247", timeout=LONG
    )
    tool.says("too slow: 2.543 s")


def test_a_state_that_is_not_one_is_refused_in_a_sentence(page, app):
    tool = Tool.opened(page, app, "modbus_scan")
    tool.moves(tool.button("one slave too many").click, "too slow: 2.543 s", "too slow: 2.033 s")
    tool.press("slaves", key="ArrowLeft")
    tool.says("in time: 1.983 s")
    link = page.get_by_role("link", name="link to this state")
    expect(link).to_have_attribute("href", "?slaves=39", timeout=LONG)
    name, state = tool.saved()
    note = page.locator(".shipnet-note")
    for wrong, why in [
        (state.replace(b"modbus_scan", b"can_load"), "its tool is 'can_load'"),
        (state.replace(b'"slaves": 39', b'"slaves": 248'), "slaves is 248"),
        (b"\x89PNG", "this is not a saved state"),
    ]:
        assert wrong != state
        tool.load("load state", name, wrong)
        expect(note).to_contain_text(f"{name}: {why}", timeout=LONG)
        expect(tool.slider("slaves")).to_have_attribute("aria-valuenow", "39.0")
        tool.says("in time: 1.983 s")
    tool.press("slaves")
    tool.says("too slow: 2.033 s")
    expect(note).to_have_count(0)
    tool.load("load state", name, state)
    tool.says("in time: 1.983 s")


def test_the_can_explorer_follows_its_editor_and_takes_files(page, app):
    tool = Tool.opened(page, app, "can_load")
    rate, back = "bit rate [kbit/s]", "ArrowLeft"
    tool.moves(lambda: tool.press(rate), "speed", "all 10 messages meet their deadlines")
    tool.comes_back(lambda: tool.press(rate, key=back), "speed", "all 10 messages")
    tool.is_compared("can_load", ("bit rate", "late up to 50 kbit/s; in time from 125 kbit/s"))
    tool.is_pictured("can_load")
    tool.unfold("message set")
    editor = page.locator("textarea")
    editor.fill("name,arbitration_id,dlc,period_ms\noil,1,9,10\n")
    editor.blur()
    tool.says("row 2")
    expect(page.locator(".shipnet-page.shipnet-stale")).to_have_count(1)
    tool.load("load a message set", "own.csv", b"name,arbitration_id,dlc,period_ms\noil,1,8,10\n")
    tool.says("all 1 messages meet")


@pytest.mark.parametrize(
    ("name", "act", "undo", "before", "after", "sweep"),
    [
        (
            "modbus_scan",
            lambda tool: tool.press("dead slaves", key="ArrowLeft"),
            lambda tool: tool.press("dead slaves"),
            "too slow: 2.543 s",
            "in time: 1.576 s",
            ("slaves", "slaves: in time up to 39; too slow from 40"),
        ),
        (
            "engine_faults",
            lambda tool: tool.choose("design", "corrected, CAN as a line"),
            lambda tool: tool.choose("design", "as printed, CAN as a line"),
            "18 old values",
            "0 old values",
            ("time", "time: no old values at all values"),
        ),
        (
            "ring_buffer",
            lambda tool: tool.button("store a packet").click(),
            lambda tool: tool.button("undo").click(),
            "byte 3 of packet 3",
            "3 bytes stored",
            ("places", "places: bytes lost or in error up to 16; no byte lost from 32"),
        ),
        (
            "valve_diagnosis",
            lambda tool: tool.choose("fault", "normal"),
            lambda tool: tool.choose("fault", "V1"),
            "V1: valve stuck",
            "normal",
            ("pump pressure FP", "pump pressure FP: P2 up to 2.5 bar; normal from 2.55 bar"),
        ),
    ],
)
def test_a_tool_is_moved_saved_loaded_and_compared(
    page, app, name, act, undo, before, after, sweep
):
    tool = Tool.opened(page, app, name)
    tool.moves(lambda: act(tool), before, after)
    tool.comes_back(lambda: undo(tool), before, after)
    tool.is_compared(name, sweep)
    tool.is_pictured(name)


def test_the_valve_client_opens_a_valve_of_the_server_that_it_starts(page, app):
    tool = Tool.opened(page, app, "valve_client")
    tool.press("valve", 2)
    tool.moves(tool.button("open").click, "valve 5: closed", "valve 5: moving")
    tool.press("valve")
    tool.says("valve 6: closed")
    tool.comes_back(lambda: tool.press("valve", key="ArrowRight"), "valve 7", "valve 6")
    expect(page.get_by_label("sweep")).to_be_hidden()
    tool.is_compared("valve_client")
    tool.is_pictured("valve_client")


GOOD = b"tag,type,x,y,z,home run\n" + b"".join(
    b"P%d,%s,%d,%d,%d,%d\n" % (n, b"DO" if n % 3 else b"DI", 30 + n, n % 3, n % 4, 40 + n)
    for n in range(9)
)


def test_the_ship_design_compares_a_list_of_ones_own_and_gives_its_report(page, app, tmp_path):
    tool = Tool.opened(page, app, "ship_design")
    modbus = page.get_by_label("Modbus RTU", exact=True)
    options = page.locator(".shipnet-table thead th")
    tool.says("353 points: ")
    tool.button("one engine").click()
    tool.says("99 points: ")
    expect(options).to_have_count(8)
    expect(page.locator(".shipnet-caption")).to_contain_text("design aid, not class approval.")
    tool.moves(lambda: modbus.set_checked(False), "points: Modbus RTU", "points: CAN, ")
    expect(options).to_have_count(6)  # without Modbus, single and doubled
    tool.comes_back(lambda: modbus.set_checked(True), "points: Modbus RTU", "points: CAN, ")
    tool.is_compared("ship_design")
    tool.is_pictured("ship_design")
    total = page.get_by_role("rowheader", name="total cost [EUR]", exact=True)
    # The notebook shows the same table of another list above the page.
    cost = page.locator(".shipnet-table tr").filter(has=total).locator("td").first
    before = cost.inner_text()
    tool.unfold("limits and prices")
    tool.press("labour rate [EUR/h]", 4)
    expect(cost).not_to_have_text(before, timeout=LONG)

    tool.load("load a list", "bad.csv", b"tag,type,x,y,z\nA,DI,1,2,3\nA,DI,1,2,x\nB,XX,1,2,3\n")
    note = page.locator(".shipnet-note")
    for fault in ("row 3, column tag (A): 'A'", "row 4, column type (B): 'XX'"):
        expect(note).to_contain_text(fault, timeout=LONG)
    # It is seen although the foot of the page is not.
    assert note.bounding_box()["y"] + note.bounding_box()["height"] <= 1000
    tool.says("99 points: ")
    expect(note).to_contain_text("have not changed")
    expect(tool.verdict).to_have_css("filter", "grayscale(1)")
    tool.load("load a list", "own.csv", GOOD)
    tool.says("9 points: ")
    expect(tool.verdict).to_have_css("filter", "none")
    expect(note).to_have_text("own.csv is loaded")
    picture = tool.figure.get_attribute("src")
    tool.choose("figure", "conductors against cost")
    expect(tool.figure).not_to_have_attribute("src", picture, timeout=LONG)

    tool.button("make the report").click()
    link = page.get_by_text("download report.html")
    link.wait_for(timeout=LONG)
    with page.expect_download() as download:
        link.click()
    report = tmp_path / "report.html"
    download.value.save_as(report)
    text = report.read_text(encoding="utf-8")
    assert "own.csv" in text and "design aid, not class approval." in text
    assert re.findall(r"""(?:src|href)=["']?(?:https?:)?//|url\(|@import|<script""", text) == []
    page.goto(report.as_uri())  # it asks nobody for anything, which `page` checks
    expect(page.locator("p.banner")).to_be_visible()
    assert page.locator("img").evaluate_all("all => all.every(image => image.naturalWidth > 100)")


def test_what_is_slow_shows_that_it_computes_and_what_fails_says_so(page, app):
    tool = Tool.opened(page, app, "slow")
    spinner = page.locator(".shipnet-spinner")
    tool.says("waited 10")
    expect(spinner).to_be_hidden()
    tool.press("wait [s]", 1)
    tool.says("waited 5")
    tool.slider("wait [s]").press("End")
    expect(spinner).to_be_visible()
    tool.says("waited 1")
    expect(spinner).to_be_hidden()
    tool.slider("wait [s]").press("Home")
    tool.says("This should not happen: ZeroDivisionError")
    tool.says("Please report it")
    tool.press("wait [s]", 1)
    tool.says("waited 10")


def test_a_tool_is_ready_and_examples_are_shown_as_stored_not_run(page, browser, tmp_path):
    (folder := tmp_path / "tools").mkdir()
    png = b64encode(Sheet().png(lambda ax: ax.plot([1, 2]), 2, 2)).decode()
    stored = [new_output("stream", text="kept"), new_output("display_data", {"image/png": png})]
    write(folder / "slow.ipynb", SLOW, new_code_cell("1 / 0", outputs=stored))
    with served(folder, tmp_path) as address:
        for _ in range(2):
            tool = Tool.opened(page, address, "slow")
            tool.says("waited 10")
            expect(page.locator(".shipnet-example")).to_contain_text("kept")
            expect(page.locator(".shipnet-example img")).to_be_visible()
            expect(page.locator(".shipnet-stored")).to_be_hidden()
            tool.press("wait [s]", 1)
            tool.says("waited 5")
        page.goto("about:blank")
        # Until programs run in it, a page shows its title, its lead and its first figure.
        with browser.new_context(java_script_enabled=False) as still:
            early = still.new_page()
            early.goto(f"{address}/voila/render/slow.ipynb", timeout=LONG)
            expect(early.locator(".shipnet-title")).to_contain_text("It waits.")
            expect(early.locator(".shipnet-stored img")).to_be_visible()
            expect(early.get_by_role("status")).to_contain_text("is starting")


def test_a_page_opened_by_its_link_asks_once_for_its_widgets_and_ends_its_kernel(page, tmp_path):
    (folder := tmp_path / "tools").mkdir()
    write(folder / "slow.ipynb", SLOW)
    sent: list[str] = []
    page.on("websocket", lambda socket: socket.on("framesent", lambda text: sent.append(str(text))))
    limit = (f"{launcher.PREHEAT}=False", "--Tools.most_kernels=1")
    with served(folder, tmp_path, *limit) as address:
        link = f"{address}/voila/render/slow.ipynb"
        page.goto(link, timeout=LONG)
        tool = Tool(page)
        tool.says("waited 10")
        assert sum("request_states" in text for text in sent) == 1
        assert not any(re.search(r"request_state\b", text) for text in sent)
        with pytest.raises(HTTPError) as refused:
            urlopen(link, timeout=60)
        assert refused.value.code == 503
        assert "1 tools are open" in refused.value.read().decode()
        page.goto(address)
        # A kernel whose page is closed does not wait for Voila's 120 s.
        for _ in range(60):
            with suppress(HTTPError), urlopen(link, timeout=60) as answer:
                assert answer.status == 200
                break
            page.wait_for_timeout(500)
        else:
            pytest.fail("the kernel of the closed page still runs")


def test_a_page_whose_tool_does_not_come_offers_to_start_it_again(page, tmp_path):
    (folder := tmp_path / "tools").mkdir()
    write(folder / "slow.ipynb", "import time; time.sleep(600)")
    page.clock.install()
    with served(folder, tmp_path, f"{launcher.PREHEAT}=False") as address:
        link = f"{address}/voila/render/slow.ipynb?wait=1"
        page.goto(link, wait_until="commit", timeout=LONG)
        expect(page.get_by_role("status")).to_contain_text("is starting")
        page.clock.fast_forward(31_000)
        expect(page.get_by_role("status")).to_contain_text("has not started yet")
        with page.expect_request(link):
            page.get_by_role("link", name="Start it again").click()
        page.goto("about:blank")


def test_foreign_host_names_are_refused(app):
    with closing(HTTPConnection(app.removeprefix("http://"))) as connection:
        connection.request("GET", "/", headers={"Host": "foreign.example"})
        assert connection.getresponse().status == 403
