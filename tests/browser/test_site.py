"""The book in a browser, served on the loopback and opened from the disk."""

import re
import subprocess
import sys

import nbformat
import pytest
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook
from playwright.sync_api import expect

from docs import notebooks

LONG = 30_000
FIGURE = r"<img [^>]*_images/[0-9a-f]{64}[^>]*>"


def pages_with(site, mark, folders=("notebooks", "api")):
    """Return the addresses of pages whose HTML holds `mark`, notebooks first."""
    return [
        path.relative_to(site).as_posix()
        for folder in folders
        for path in sorted((site / folder).rglob("*.html"))
        if mark in path.read_text(encoding="utf-8")
    ]


def test_no_page_names_anything_outside_to_load(site):
    pages = list(site.rglob("*.html"))
    assert len(pages) > 10
    outside = re.compile(r"""<(script|link|img|iframe)[^>]*(src|href)=["']?(https?:)?//""")
    loaded = [page.name for page in pages if outside.search(page.read_text(encoding="utf-8"))]
    assert loaded == []


def test_every_figure_of_a_notebook_has_its_caption_as_alternative_text(site):
    pages = (site / "notebooks").rglob("*.html")
    figures = [img for page in pages for img in re.findall(FIGURE, page.read_text("utf-8"))]
    assert len(figures) > 100
    for figure in figures:
        assert re.search(r'alt="[^"]+ [^"]+"', figure), figure


def test_start_page_has_a_title_and_a_navigation(page, url):
    page.goto(f"{url}/index.html")
    expect(page).to_have_title("shipnet", timeout=LONG)
    navigation = page.locator(".sidebar-tree")
    expect(navigation.get_by_role("link", name="Ledger")).to_be_visible(timeout=LONG)
    navigation.get_by_role("link", name="The package shipnet").click()
    expect(page.locator("h1")).to_contain_text("The package shipnet", timeout=LONG)


def test_every_notebook_is_in_the_navigation(page, url, site):
    page.goto(f"{url}/index.html")
    links = page.locator(".sidebar-tree a").evaluate_all("links => links.map(a => a.pathname)")
    notebooks = {f"/{name}" for name in pages_with(site, "<h1", folders=["notebooks"])}
    assert notebooks <= set(links)


def test_formulas_are_drawn_without_a_script(page, url, site):
    page.goto(f"{url}/{pages_with(site, '<math')[0]}")
    formula = page.locator("math").first
    expect(formula).to_be_visible(timeout=LONG)
    box = formula.bounding_box()
    assert box["width"] > 0
    assert box["height"] > 0
    text = page.locator("article").inner_text()
    assert "$$" not in text
    assert r"\frac" not in text


@pytest.mark.parametrize(("word", "lesson"), [("parity", "03"), ("arbitration", "05")])
def test_search_finds_the_lesson_before_the_reference(page, url, word, lesson):
    page.goto(f"{url}/index.html")
    box = page.get_by_role("textbox", name="Search")
    box.fill(word)
    box.press("Enter")
    results = page.locator("#search-results ul.search li > a")
    expect(results.first).to_have_text(re.compile(f"^{lesson} "), timeout=LONG)


def test_the_navigation_goes_from_start_to_reference(page, url):
    page.goto(f"{url}/index.html")
    captions = page.locator(".sidebar-tree .caption").all_inner_texts()
    order = "start here, lessons, tools, papers, real lines, how to, guide, reference"
    assert ", ".join(captions).lower() == order


# Parts of a page that reach beyond the edge of their box, or of the page.
CUT = """selector => [...document.querySelectorAll(selector)]
  .filter(box => box.scrollWidth > box.clientWidth
    || box.getBoundingClientRect().right > innerWidth)
  .map(box => box.innerText.slice(0, 60))"""


@pytest.mark.parametrize("width", [390, 1280])
def test_no_line_of_code_is_cut(page, url, site, width):
    page.set_viewport_size({"width": width, "height": 800})
    for name in pages_with(site, "<pre", folders=["notebooks", "howto"]):
        page.goto(f"{url}/{name}")
        assert page.evaluate(CUT, "article pre") == [], name


def test_a_phone_shows_claims_and_glossary_without_scrolling_aside(page, url, site):
    page.set_viewport_size({"width": 390, "height": 844})
    page.goto(f"{url}/ledger.html#kim2023-004")
    for cell in page.locator("tr#kim2023-004 td").all():
        expect(cell).to_be_in_viewport(ratio=1, timeout=LONG)
    page.goto(f"{url}/glossary.html")
    assert page.evaluate(CUT, ".table-wrapper") == []
    claims = pages_with(site, 'class="dataframe shown"')
    assert len(claims) > 10
    for name in claims:
        page.goto(f"{url}/{name}")
        assert page.evaluate(CUT, ".text_html:has(.shown)") == [], name


# Of each figure that is shown: whether it is narrow, how its size compares with the one at which it
# has text of 13.9 pixels, and how much of it its box can scroll.
FIGURES = """() => [...document.querySelectorAll(".cell_output img")]
  .filter(image => image.checkVisibility())
  .map(image => [image.classList.contains("narrow"), image.width / image.getAttribute("width"),
    image.parentElement.scrollWidth - image.parentElement.clientWidth])"""
DRAWINGS = [
    "plt.plot([1, 2])",
    "plt.subplots(figsize=(8, 3))[1].set_title(100 * 'a')",
]


@pytest.fixture(scope="module")
def figures(tmp_path_factory):
    """Return the address of a page with two executed figures, of which one has a narrow form."""
    root = tmp_path_factory.mktemp("book")
    cells = [new_markdown_cell("# Figures")]
    for drawing in DRAWINGS:
        source = "import matplotlib.pyplot as plt\nfrom shipnet import style\nstyle.use()\n"
        cells += [new_code_cell(f"{source}{drawing}\nplt.show()"), new_markdown_cell("*See this.*")]
    (root / "notebooks").mkdir()
    nbformat.write(new_notebook(cells=cells), root / "notebooks" / "index.ipynb")
    assert notebooks.run(root) == 0
    site = root / "build" / "site"
    command = [sys.executable, "-m", "sphinx", "-q", "-W", "-c", notebooks.ROOT / "docs"]
    subprocess.run([*command, root / "build" / "notebooks", site], check=True)
    return (site / "index.html").as_uri()


def test_a_phone_shows_narrow_forms_and_scrolls_other_figures(page, figures):
    page.set_viewport_size({"width": 390, "height": 844})
    page.goto(figures)
    (narrow, size, scrolled), (other, natural, beyond) = page.evaluate(FIGURES)
    assert narrow
    assert 10 / 13.9 < size <= 1
    assert scrolled == 0
    assert not other
    assert natural > 0.98  # of the width, the padding is a part
    assert beyond > 300
    assert page.evaluate("document.documentElement.scrollWidth") == 390


def test_a_wide_screen_shows_figures_as_they_are_and_loads_no_other(page, figures):
    page.set_viewport_size({"width": 1280, "height": 800})
    page.goto(figures)
    shown = page.evaluate(FIGURES)
    assert [narrow for narrow, *_ in shown] == [False, False]
    assert [beyond for *_, beyond in shown] == [0, 0]
    loaded = "() => [...document.querySelectorAll('img.narrow')].map(image => image.naturalWidth)"
    assert page.evaluate(loaded) == [0]


def test_no_figure_of_the_book_is_too_small_to_read_on_a_phone(page, url, site):
    page.set_viewport_size({"width": 390, "height": 844})
    for name in pages_with(site, "image-reference", folders=["notebooks"]):
        page.goto(f"{url}/{name}")
        assert all(size > 10 / 13.9 for _, size, _ in page.evaluate(FIGURES)), name


def test_the_book_opens_from_the_disk_without_a_network(page, site):
    page.context.set_offline(True)
    page.goto((site / "index.html").as_uri())
    expect(page).to_have_title("shipnet", timeout=LONG)
    page.locator(".sidebar-tree").get_by_role("link", name="Ledger").click()
    expect(page.locator("tr#kim2023-004")).to_be_attached(timeout=LONG)


def test_every_public_object_has_a_page_with_its_source(site):
    import shipnet

    pages = {path.stem: path for path in (site / "api").glob("*.html")}
    for package in (shipnet.asi, shipnet.can, shipnet.modbus):
        overview = pages[package.__name__].read_text(encoding="utf-8")
        for name in package.__all__:
            if callable(getattr(package, name)):
                assert re.search(rf'\.html#shipnet\.[\w.]+\.{name}"', overview), name
    assert "_modules/shipnet/asi/timing.html" in pages["shipnet.asi.cycle_time"].read_text("utf-8")
    # The class and the function differ on file systems that ignore case, too.
    assert {"shipnet.modbus.Scan", "shipnet.modbus.scan_"} <= pages.keys()
    assert "6e-06" in pages["shipnet.asi"].read_text("utf-8")


def test_a_notebook_is_downloaded_without_its_outputs(page, url):
    page.goto(f"{url}/notebooks/papers/kim2023/1_telegrams.html")
    with page.expect_download() as download:
        page.get_by_role("link", name="Download this notebook").click(timeout=LONG)
    text = download.value.path().read_text(encoding="utf-8")
    assert download.value.suggested_filename == "1_telegrams.ipynb"
    assert '"outputs": []' in text
    assert "image/png" not in text


def test_the_ledger_is_filtered_by_words(page, url):
    page.goto(f"{url}/ledger.html")
    rows = page.locator("table.claims tbody tr:visible")
    everything = rows.count()
    page.get_by_label("Filter the claims").fill("kim2023 INCONSISTENT")
    assert 0 < rows.count() < everything / 10
    expect(page.locator("output")).to_have_text(re.compile(rf"^{rows.count()} of {everything} "))
    page.get_by_label("Filter the claims").fill("")
    assert rows.count() == everything


def test_code_is_copied_without_prompts(page, url):
    page.context.grant_permissions(["clipboard-read", "clipboard-write"])
    page.goto(f"{url}/api/shipnet.asi.cycle_time.html")
    page.locator("div.highlight").first.hover()
    page.get_by_role("button", name="Copy").first.click(timeout=LONG)
    expect(page.get_by_role("button", name="Copied")).to_be_visible(timeout=LONG)
    copied = page.evaluate("navigator.clipboard.readText()")
    assert copied.strip()
    assert ">>>" not in copied
