"""Measure how long a tool's page takes in a browser to show its first picture and later ones.

After a click on a card, the page shows the picture stored in the notebook, then the tool's own
picture. Three cases are measured: the tool's kernel is ready before the click; the click starts the
kernel; and the click comes right after the start of the server. In the second case, keys are then
pressed on the first slider that changes the picture, or on the first button if no slider does, and
the time from key press to new picture is measured. The CPU time of browser, server and kernel is
printed too, because it depends little on how busy the machine is.

On the AS-i bench, a slave is dragged for two seconds. Printed are the time from the input event of
each movement to its picture, the time from its request to the picture, the parts of the latter that
the kernel and the page take, and the time from the release to the rules, with the machine's load.
"""

import os
import shutil
import sys
import tempfile
import time
from contextlib import contextmanager, redirect_stdout
from io import StringIO
from pathlib import Path
from statistics import median, quantiles

import psutil

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from docs import app
from tests.browser.conftest import ARGUMENTS, BROWSERS, served

EXPLORE = app.ROOT / "notebooks" / "explore"
TOOLS = sorted(path.stem for path in EXPLORE.glob("*.ipynb"))
DEVICE = ".shipnet-cable [role=slider]"
STORED, LIVE = ".shipnet-stored img", f"img.shipnet-picture, {DEVICE}"
BENCH = "asi_bench"
# Text that Voila logs for each kernel that it keeps ready.
FILLED = "is filled with"
CHANGES = 9
LONG = 120_000

# Record when a key is pressed and when a new picture is ready to be painted.
WATCH = """() => {
  window.ready = [];
  addEventListener("keydown", () => { window.pressed = performance.now(); }, true);
  new MutationObserver(async () => {
    await document.querySelector("img.shipnet-picture")?.decode();
    window.ready.push(performance.now() - window.pressed);
  }).observe(document.querySelector(".shipnet-figure"), {childList: true, subtree: true});
}"""


def processor():
    """Return the CPU time of this process and its child processes [s]."""
    total = 0.0
    for process in [me := psutil.Process(), *me.children(recursive=True)]:
        try:
            total += sum(process.cpu_times()[:2])
        except psutil.NoSuchProcess:
            continue
    return total


def opened(page, address, tool):
    """Click on a card; return the times to the stored and live pictures, and the CPU time [s]."""
    page.goto(address)
    before, clicked = processor(), time.perf_counter()
    page.locator(f"a[href$='/{tool}.ipynb']").click(no_wait_after=True)
    page.locator(f"{STORED}, {LIVE}").first.wait_for(timeout=LONG)
    first = time.perf_counter() - clicked
    page.locator(LIVE).first.wait_for(timeout=LONG)
    return first, time.perf_counter() - clicked, processor() - before


def changed(page):
    """Press keys; return the median time to a new picture, and the CPU time per key press [ms]."""
    page.evaluate(WATCH)
    for fold in page.locator(".jupyter-widget-Collapse-header").all():
        fold.click()
    sliders = page.locator(".shipnet-panel").get_by_role("slider").all()
    moving = [(slider, ("PageUp", "PageDown")) for slider in sliders]
    moving += [(page.locator(".shipnet-buttons button").first, ("Enter",))]
    for control, keys in moving:
        control.press(keys[0])
        page.wait_for_timeout(3000)
        if page.evaluate("window.ready.length"):
            break
    times, begin = [], processor()
    for k in range(CHANGES):
        page.evaluate("window.ready = []")
        page.keyboard.press(keys[(k + 1) % len(keys)])
        page.wait_for_function("window.ready.length", timeout=LONG)
        time.sleep(0.3)
        times.append(page.evaluate("window.ready.at(-1)"))
    return median(times), 1e3 * (processor() - begin) / CHANGES


def dragged(page, address, slaves):
    """Drag a slave for two seconds; return the line to be printed."""
    devices = f"master@0+supply@50+scope@0+{slaves}*slave@100"
    page.goto(f"{address}/voila/render/{BENCH}.ipynb?devices={devices}", timeout=LONG)
    expected = f"document.querySelectorAll('{DEVICE}').length === {slaves + 3}"
    page.wait_for_function(expected, timeout=LONG)
    page.wait_for_timeout(3000)
    page.evaluate("performance.clearMeasures()")
    spot = "group => { const m = group.getScreenCTM(); return [m.e, m.f]; }"
    x, y = page.locator(DEVICE).nth(3 + slaves // 2).evaluate(spot)
    page.mouse.move(x, y)
    page.mouse.down()
    for k in range(120):
        page.mouse.move(x + 1.5 * min(k, 120 - k), y)
        page.wait_for_timeout(16)
    parts = "({startTime, duration, detail}) => [duration, startTime + duration - detail.sent, "
    parts += "1e3 * detail.kernel]"
    read = f"performance.getEntriesByName('shipnet-bench').map({parts})"
    event, request, kernel = zip(*page.evaluate(read), strict=True)
    page.mouse.up()
    page.wait_for_timeout(2000)
    released = page.evaluate(read)[-1][0]
    rest = [whole - part for whole, part in zip(request, kernel, strict=True)]
    return (
        f"{slaves:>3} slaves: {len(event):>3} pictures, event to picture {spread(event)}, "
        f"request to picture {spread(request)}: kernel {spread(kernel)}, page {spread(rest)}; "
        f"release to rules {released:.0f} ms (load {os.getloadavg()[0]:.1f})"
    )


def spread(times):
    """Return the median and the 95th percentile [ms] as text."""
    return f"{median(times):.0f} ({quantiles(times, n=20)[-1]:.0f}) ms"


@contextmanager
def server(*options):
    """Start the server of the tools; yield its address and the path of its log."""
    with (
        tempfile.TemporaryDirectory() as root,
        redirect_stdout(StringIO()),
        served(EXPLORE, Path(root), *options) as address,
        redirect_stdout(sys.__stdout__),
    ):
        yield address, Path(root) / "log"


def line(tool, first, live, used):
    """Return the line to be printed for a tool."""
    return f"{tool:<20} {first:12.2f} s {live:8.2f} s (cpu {used:4.1f} s)"


def main():
    program = next(filter(None, map(shutil.which, BROWSERS)), None)
    if program is None:
        print("Chromium is not installed, so the pages of the tools are not measured")
        return
    from playwright.sync_api import sync_playwright

    tools = sys.argv[1:] or TOOLS
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=program, args=ARGUMENTS)
        for kernel, options in [("ready", ()), ("started by the click", (f"{app.PREHEAT}=False",))]:
            print(f"\nkernel {kernel:<14} stored picture   tool's picture     key to new picture")
            with server(*options) as (address, log):
                while not options and log.read_text().count(FILLED) < len(TOOLS):
                    time.sleep(0.5)
                time.sleep(5)
                for tool in tools:
                    page = browser.new_page(viewport={"width": 1280, "height": 1000})
                    said = line(tool, *opened(page, address, tool))
                    # If kernels are kept ready, Voila now starts another, so no keys are timed.
                    if options:
                        said += " {:6.0f} ms (cpu {:4.0f} ms)".format(*changed(page))
                    page.close()
                    print(said, flush=True)
                    time.sleep(0 if options else 8)
        if BENCH in tools:
            print("\na slave dragged on the bench: median (95th percentile)")
            with server(f"{app.PREHEAT}=False") as (address, _):
                for slaves in (5, 31, 62):
                    page = browser.new_page(viewport={"width": 1280, "height": 1000})
                    print(dragged(page, address, slaves), flush=True)
                    page.close()
        print("\nright after the start  stored picture   tool's picture")
        for tool in tools:
            with server() as (address, _):
                page = browser.new_page(viewport={"width": 1280, "height": 1000})
                print(line(tool, *opened(page, address, tool)), flush=True)
                page.close()
        browser.close()


if __name__ == "__main__":
    main()
