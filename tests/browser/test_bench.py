"""The AS-i bench in Voila and in JupyterLab, moved with a mouse, with keys and with a finger."""

import json
import os
import re
import sys

import nbformat
import pytest
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook
from playwright.sync_api import expect

from docs import app as launcher
from tests.browser.conftest import PATIENCE, answering, free_port, served

SIZES = [(1280, 800), (390, 844)]
DEVICES = '("master@0", "supply@0", "scope@0", "slave@20", "slave@60")'
SOURCE = f"from shipnet import tools\n\ntools.AsiBench(devices={DEVICES}).explore()"


def written(folder):
    folder.mkdir()
    cells = [new_markdown_cell("# Bench\n\nDrag."), new_code_cell(SOURCE)]
    cells[1].metadata["tags"] = ["widget"]
    kernel = {"name": "python3", "display_name": "Python 3", "language": "python"}
    nbformat.write(
        new_notebook(cells=cells, metadata={"kernelspec": kernel}), folder / "bench.ipynb"
    )
    return folder


@pytest.fixture(scope="module")
def voila(tmp_path_factory):
    root = tmp_path_factory.mktemp("voila")
    with served(written(root / "tools"), root, f"{launcher.PREHEAT}=False") as address:
        yield address


@pytest.fixture(scope="module")
def lab(tmp_path_factory):
    root = tmp_path_factory.mktemp("lab")
    settings = root / "settings" / "@jupyterlab" / "apputils-extension"
    settings.mkdir(parents=True)
    silent = {"fetchNews": "false", "checkForUpdates": False}
    (settings / "notification.jupyterlab-settings").write_text(json.dumps(silent))
    port = free_port()
    folders = {
        f"JUPYTERLAB_{name}_DIR": str(root / name.lower()) for name in ("SETTINGS", "WORKSPACES")
    }
    options = f"--no-browser --allow-root --ip=127.0.0.1 --port={port} --IdentityProvider.token="
    folder = written(root / "notebooks")
    command = [sys.executable, "-m", "jupyterlab", *options.split(), f"--notebook-dir={folder}"]
    environment = os.environ | folders | {"JUPYTER_CONFIG_DIR": str(root / "config")}
    with answering(command, environment, f"http://127.0.0.1:{port}", root / "log") as address:
        yield address


class Bench:
    """The drawing on a page."""

    def __init__(self, page, size):
        page.set_viewport_size(dict(zip(("width", "height"), size, strict=True)))
        self.page = page
        self.cable = page.locator(".shipnet-cable")
        self.verdict = page.locator(".shipnet-verdict")

    def in_voila(self, address):
        self.page.goto(address, timeout=PATIENCE)
        self.page.locator("a[href$='/bench.ipynb']").click()
        return self.ready()

    def in_lab(self, address):
        self.page.goto(f"{address}/doc/tree/bench.ipynb", timeout=PATIENCE)
        self.page.locator(".jp-CodeCell .cm-content").click()
        idle = self.page.locator(".jp-Notebook-ExecutionIndicator[data-status='idle']")
        expect(idle).to_be_attached()
        self.page.keyboard.press("Shift+Enter")
        return self.ready()

    def ready(self):
        self.cable.get_by_role("slider").first.wait_for(timeout=PATIENCE)
        # The page computes, and a narrow page once more.
        self.page.wait_for_timeout(1000)
        self.cable.scroll_into_view_if_needed()
        return self

    def part(self, label):
        return self.cable.get_by_role("slider", name=label)

    def at(self, label, text):
        expect(self.part(label)).to_have_attribute("aria-valuetext", text)

    def spot(self, label):
        """Return the middle of a device on the page."""
        matrix = "group => { const m = group.getScreenCTM(); return [m.e, m.f]; }"
        return self.part(label).evaluate(matrix)

    def drag(self, label, across, down=0, finger=False):
        """Drag a device by a number of pixels, in steps."""
        x, y = self.spot(label)
        if finger:
            self.touch("touchStart", x, y)
        else:
            self.page.mouse.move(x, y)
            self.page.mouse.down()
        for k in range(1, 6):
            spot = x + across * k / 5, y + down * k / 5
            if finger:
                self.touch("touchMove", *spot)
            else:
                self.page.mouse.move(*spot)
            self.page.wait_for_timeout(30)
        if finger:
            self.touch("touchEnd")
        else:
            self.page.mouse.up()

    def touch(self, kind, *spot):
        self.session = getattr(self, "session", None) or self.page.context.new_cdp_session(
            self.page
        )
        points = [dict(zip("xy", spot, strict=True))] if spot else []
        self.session.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})

    def button(self, label):
        return self.page.locator(".shipnet-bench").get_by_role("button", name=label, exact=True)

    def metres(self, label):
        return float(self.part(label).get_attribute("aria-valuenow"))


@pytest.mark.parametrize("size", SIZES, ids=["desk", "phone"])
@pytest.mark.parametrize("place", ["voila", "lab"])
def test_a_device_follows_mouse_and_keys_and_the_verdict_follows_it(page, request, place, size):
    address = request.getfixturevalue(place)
    bench = getattr(Bench(page, size), f"in_{place}")(address)
    expect(bench.verdict).to_contain_text("all rules met")
    wave = page.locator(".shipnet-bench > svg").last
    shown = wave.inner_html()

    bench.drag("slave 2", 0.3 * bench.cable.bounding_box()["width"])
    assert 85 < bench.metres("slave 2") <= 100
    expect(wave).not_to_have_attribute("aria-label", re.compile("slave 1"))
    assert wave.inner_html() != shown
    # The cable may have 100 m, and this spur is the 101st.
    bench.part("slave 2").press("ArrowDown")
    expect(bench.verdict).to_contain_text("1. cable length: 101 m")
    expect(bench.cable).to_contain_text("1. cable length")
    bench.part("slave 2").press("ArrowUp")
    expect(bench.verdict).to_contain_text("all rules met")

    bench.part("slave 1").press("Home")
    bench.at("slave 1", "0 m")
    for _ in range(3):
        bench.part("slave 1").press("ArrowRight")
    bench.part("slave 1").press("Shift+ArrowRight")
    bench.at("slave 1", "3.1 m")
    expect(wave).to_have_attribute("aria-label", re.compile("Response of slave 1 at the scope"))


def test_devices_are_added_removed_and_reached_with_tab(page, voila):
    bench = Bench(page, SIZES[0]).in_voila(voila)
    bench.button("+ repeater").click()
    expect(bench.verdict).to_contain_text("supplies: 0 at segment at 50 m, right")
    bench.button("+ supply").click()
    expect(bench.verdict).to_contain_text("all rules met")
    bench.button("+ slave").click()
    bench.at("slave 3", "80 m")
    bench.part("slave 3").focus()
    page.keyboard.press("Delete")
    expect(bench.part("slave 3")).to_have_count(0)
    bench.part("slave 2").focus()
    bench.button("remove").click()
    expect(bench.part("slave 2")).to_have_count(0)
    # The last slave stays.
    bench.part("slave 1").focus()
    expect(bench.button("remove")).to_be_disabled()

    bench.part("master").focus()
    reached = []
    for _ in range(6):
        name = "document.activeElement.getAttribute('aria-label')"
        reached.append(page.evaluate(name))
        page.keyboard.press("Tab")
    assert reached == ["master", "supply", "scope", "slave 1", "repeater", "supply"]
    # A ring has no repeater: the page says so, and the drawing stays.
    page.get_by_role("checkbox", name="ring").check()
    expect(bench.verdict).to_contain_text("a cable with a repeater cannot be a ring")
    page.get_by_role("checkbox", name="ring").uncheck()
    expect(bench.verdict).to_contain_text("all rules met")
    slaves = page.get_by_label("slaves", exact=True)
    slaves.fill("62")
    slaves.press("Enter")
    expect(bench.cable.get_by_role("slider")).to_have_count(67)
    bench.button("star").click()
    expect(bench.cable.get_by_role("slider", name="slave 31B")).to_have_attribute(
        "aria-valuetext", "100 m, spur 0.16 m"
    )


def test_states_are_pinned_saved_loaded_linked_and_drawn(page, voila):
    bench = Bench(page, SIZES[0]).in_voila(voila)
    bench.button("pin").click()
    lines = page.locator(".shipnet-bench > svg").last.locator("path[stroke-dasharray='8 3']")
    expect(lines).to_have_count(1)
    bench.drag("supply", 0.4 * bench.cable.bounding_box()["width"])
    away = bench.metres("supply")
    assert away > 30
    link = page.get_by_role("link", name="link to this state")
    expect(link).to_have_attribute("href", re.compile(f"supply%40{away:g}\\b"))
    with page.expect_download() as download:
        page.get_by_text("save state").click()
    name, state = download.value.suggested_filename, download.value.path().read_bytes()
    assert name == "shipnet_asi_bench.json" and f"supply@{away:g}" in state.decode()
    page.get_by_role("button", name="back to it").click()
    bench.at("supply", "0 m")
    page.get_by_role("button", name="unpin").click()
    expect(lines).to_have_count(0)
    with page.expect_file_chooser() as chooser:
        page.locator(".shipnet-upload[title='load state']").click()
    chooser.value.set_files({"name": name, "mimeType": "application/json", "buffer": state})
    bench.at("supply", f"{away:g} m")
    with page.expect_download() as download:
        bench.button("SVG").click()
    picture = download.value.path().read_text(encoding="utf-8")
    assert picture.count("<g transform") == 4 and "var(" not in picture and ">supply<" in picture
    with page.expect_download() as download:
        page.get_by_text("download slaves.csv").click()
    assert download.value.path().read_text(encoding="utf-8-sig").count("\n") == 3
    link.click()
    bench.ready()
    bench.at("supply", f"{away:g} m")


def test_a_finger_drags_a_device_and_does_not_scroll_the_page(browser, voila):
    context = browser.new_context(viewport={"width": 390, "height": 844}, has_touch=True)
    page = context.new_page()
    try:
        bench = Bench(page, SIZES[1]).in_voila(voila)
        before = bench.spot("slave 1")
        # 14 px beside the middle is near enough.
        bench.drag("slave 1", 60, 40, finger=True)
        expect(bench.part("slave 1")).to_have_attribute("aria-valuetext", re.compile("spur"))
        assert bench.metres("slave 1") > 30
        x, y = bench.spot("slave 1")
        assert x - before[0] == pytest.approx(60, abs=3) and 20 < y - before[1] < 45
    finally:
        context.close()
