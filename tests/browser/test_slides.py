"""The slides of all lessons on a screen: nothing is cut off, too small, or lost."""

import re
import shutil

import pytest

from docs import editions, slides

SCREENS = [(1024, 768), (1280, 720)]
LESSONS = pytest.mark.parametrize("source", editions.sources(), ids=lambda path: path.stem[:2])
#: Of 768: about 1.9 % of the height, which is 38 mm on a screen 2 m high.
SMALLEST_TEXT = 14.0
#: Below this share of its stored size the letters of a figure cannot be read.
SMALLEST_FIGURE = 0.6

# Lines of text and pictures of each slide, with all answers open, in pixels of the screen.
MEASURE = """() => Reveal.getSlides().map((slide) => {
  const {h, v} = Reveal.getIndices(slide);
  Reveal.slide(h, v);
  slide.querySelectorAll("details").forEach((answer) => { answer.open = true; });
  Reveal.layout();
  const rectangles = [], sizes = [], figures = [];
  const add = (what) => rectangles.push(...[...what.getClientRects()].filter((r) => r.width)
    .map((r) => [r.left, r.top, r.right, r.bottom]));
  const walk = document.createTreeWalker(slide, NodeFilter.SHOW_TEXT);
  for (let text = walk.nextNode(); text; text = walk.nextNode()) {
    const range = document.createRange();
    range.selectNodeContents(text);
    if (!text.data.trim() || !range.getClientRects().length) continue;
    add(range);
    if (!text.parentElement.closest("math")) {
      sizes.push(parseFloat(getComputedStyle(text.parentElement).fontSize));
    }
  }
  slide.querySelectorAll("img, pre, td, th").forEach(add);
  slide.querySelectorAll("img").forEach((image) =>
    figures.push(image.offsetWidth / image.getAttribute("width")));
  const marks = [...document.querySelectorAll(".controls, .slide-number")].map((mark) => {
    const r = mark.getBoundingClientRect();
    return [r.left, r.top, r.right, r.bottom];
  });
  return {name: `${h + 1}.${(v || 0) + 1}`, rectangles, marks, sizes, figures};
})"""
# What the page shows and what was written, without notes and the space between words.
WORDS = """(html) => [document, new DOMParser().parseFromString(html, "text/html")].map((page) => {
  page.querySelectorAll("aside.notes").forEach((notes) => notes.remove());
  return page.querySelector(".slides").textContent.replace(/\\s+/g, "");
})"""
NOTES = "() => Reveal.getSlides().map((slide) => slide.dataset.notes)"


def show(page, root, source, leave_out=""):
    """Write the slides of a lesson below a folder and open them; return what was written."""
    path = slides.write(root, source)
    html = path.read_text("utf-8")
    path.write_text(html.replace(leave_out, ""), "utf-8")
    page.goto(path.as_uri())
    page.wait_for_function("Reveal.isReady()")
    return html


def overlap(one, other):
    return one[0] < other[2] and other[0] < one[2] and one[1] < other[3] and other[1] < one[3]


def faults(slide, width, height):
    """Return what is wrong with a slide that was measured."""
    found = set()
    for one in slide["rectangles"]:
        if one[0] < 0 or one[1] < 0 or one[2] > width or one[3] > height:
            found.add("leaves the screen")
        if any(overlap(one, mark) for mark in slide["marks"]):
            found.add("lies under the arrows or the number")
    if min(slide["sizes"], default=SMALLEST_TEXT) < SMALLEST_TEXT:
        found.add("small text")
    if min(slide["figures"], default=1) < SMALLEST_FIGURE:
        found.add("small figure")
    return {f"slide {slide['name']}, {width} x {height}: {fault}" for fault in found}


def all_faults(page):
    found = set()
    for width, height in SCREENS:
        page.set_viewport_size({"width": width, "height": height})
        for slide in page.evaluate(MEASURE):
            found |= faults(slide, width, height)
    return sorted(found)


@pytest.fixture
def root(tmp_path):
    (tmp_path / editions.LESSONS).mkdir(parents=True)
    return tmp_path


@LESSONS
def test_every_slide_fits_and_no_word_is_lost(page, root, source):
    shutil.copy(editions.ROOT / editions.LESSONS / f"{source.stem}.ipynb", root / editions.LESSONS)
    html = show(page, root, source)
    notes = page.evaluate(NOTES)
    now, written = page.evaluate(WORDS, html)
    assert now == written
    assert all_faults(page) == []
    assert all(notes)


def test_the_speaker_view_shows_the_notes(page, root):
    source = editions.sources(numbers=["04"])[0]
    shutil.copy(editions.ROOT / editions.LESSONS / f"{source.stem}.ipynb", root / editions.LESSONS)
    show(page, root, source)
    notes = page.evaluate(NOTES)
    exercise = next(k for k, text in enumerate(notes) if "exchange_us" in text)
    minutes = re.search(r"Minutes \d+ to \d+\.", notes[exercise])[0]
    place = page.evaluate("(k) => Reveal.getIndices(Reveal.getSlides()[k])", exercise)
    page.evaluate("({h, v}) => Reveal.slide(h, v)", place)
    with page.expect_popup() as opened:
        page.keyboard.press("s")
    shown = opened.value.locator(".speaker-controls-notes .value")
    shown.get_by_text(minutes).wait_for()
    assert "exchange_us = (14 +" in shown.inner_text()
