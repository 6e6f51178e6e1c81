"""The tools of notebooks/explore/ as web pages, moved by a browser."""

import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request
from pathlib import Path

import pytest

EXPLORE = Path(__file__).resolve().parents[2] / "notebooks" / "explore"
LONG = 120_000  # ms; a kernel may start slowly on a busy machine


@pytest.fixture(scope="module")
def app(tmp_path_factory):
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    log = tmp_path_factory.mktemp("voila") / "log"
    address = f"http://127.0.0.1:{port}"
    command = [sys.executable, "-m", "voila", "--no-browser", f"--port={port}", str(EXPLORE)]
    with log.open("wb") as out, subprocess.Popen(command, stdout=out, stderr=out) as server:
        try:
            for _ in range(240):
                assert server.poll() is None, log.read_text()
                try:
                    urllib.request.urlopen(f"{address}/voila/tree", timeout=5).close()
                    break
                except (urllib.error.URLError, ConnectionError):
                    time.sleep(0.25)
            else:
                pytest.fail(f"Voila does not answer: {log.read_text()}")
            yield address
        finally:
            server.terminate()
            print(log.read_text())


def opened(browser, app, tool):
    """Open a tool; return its page, and where it writes its verdict."""
    page = browser.new_page()
    page.goto(f"{app}/voila/render/{tool}.ipynb", timeout=LONG)
    return page, page.locator(".widget-html-content b")


def test_the_line_explorer_follows_its_sliders(browser, app):
    page, verdict = opened(browser, app, "asi_line")
    verdict.filter(has_text="read 0011001").wait_for(timeout=LONG)
    length = page.locator(".noUi-handle").first
    length.focus()
    for _ in range(20):
        length.press("ArrowRight")
    verdict.filter(has_text="InformationError").wait_for(timeout=LONG)
    page.get_by_label("100 ohm at the end").check()
    verdict.filter(has_text="read 0011001").wait_for(timeout=LONG)
    page.close()


def test_the_network_explorer_names_a_broken_rule(browser, app):
    page, verdict = opened(browser, app, "asi_network")
    verdict.filter(has_text="all rules kept").wait_for(timeout=LONG)
    length = page.locator(".noUi-handle").nth(2)
    length.focus()
    for _ in range(10):
        length.press("ArrowRight")
    verdict.filter(has_text="cable length").wait_for(timeout=LONG)
    page.close()


def test_the_can_explorer_follows_its_editor(browser, app):
    page, verdict = opened(browser, app, "can_load")
    verdict.filter(has_text="meet their deadlines").wait_for(timeout=LONG)
    editor = page.locator("textarea")
    editor.fill("name,arbitration_id,dlc,period_ms\noil,1,9,10\n")
    editor.blur()
    verdict.filter(has_text="row 2").wait_for(timeout=LONG)
    page.close()


def test_the_scan_explorer_waits_for_a_dead_slave(browser, app):
    page, verdict = opened(browser, app, "modbus_scan")
    verdict.filter(has_text="in time: 1.576 s").wait_for(timeout=LONG)
    dead = page.locator(".noUi-handle").nth(3)
    dead.focus()
    dead.press("ArrowRight")
    verdict.filter(has_text="too slow: 2.543 s").wait_for(timeout=LONG)
    page.close()


def test_the_engine_explorer_marks_a_dead_box_late(browser, app):
    page, verdict = opened(browser, app, "engine_faults")
    verdict.filter(has_text="18 old values shown as good").wait_for(timeout=LONG)
    page.locator("select").nth(1).select_option("mended, CAN as a line")
    verdict.filter(has_text="0 old values").wait_for(timeout=LONG)
    page.close()


def test_the_ring_explorer_is_stepped_by_its_buttons(browser, app):
    page, verdict = opened(browser, app, "ring_buffer")
    verdict.filter(has_text="nothing done yet").wait_for(timeout=LONG)
    page.get_by_role("button", name="store a packet").click()
    page.locator(".widget-html-content").filter(has_text="unread: 6 bytes").wait_for(timeout=LONG)
    page.get_by_role("button", name="one back").click()
    verdict.filter(has_text="nothing done yet").wait_for(timeout=LONG)
    page.close()


def test_the_diagnosis_explorer_names_a_fault(browser, app):
    page, verdict = opened(browser, app, "valve_diagnosis")
    verdict.filter(has_text="normal").wait_for(timeout=LONG)
    page.locator("select").first.select_option("V1")
    verdict.filter(has_text="V1").wait_for(timeout=LONG)
    page.close()


def test_the_valve_client_opens_a_valve_of_the_server_that_it_starts(browser, app):
    page, verdict = opened(browser, app, "valve_client")
    verdict.filter(has_text="valve 1: closed").wait_for(timeout=LONG)
    page.get_by_role("button", name="open", exact=True).click()
    verdict.filter(has_text="valve 1: moving").wait_for(timeout=LONG)
    page.close()
