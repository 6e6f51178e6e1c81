"""docs/app.py: a card for each tool, and Voila's template, which loads nothing from outside."""

import asyncio
import re
from base64 import b64decode
from html import unescape

import nbformat
import pytest
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook, new_output

from docs import app, pool

EXPLORE = app.ROOT / "notebooks" / "explore"


@pytest.mark.parametrize("path", sorted(EXPLORE.glob("*.ipynb")), ids=lambda path: path.stem)
def test_every_tool_has_a_card_with_a_picture(path):
    card = app.card(path)
    assert card.name == path.stem
    assert card.title and "#" not in card.title
    assert card.lead.endswith((".", "?")) and "`" not in card.lead and "](" not in card.lead
    assert b64decode(card.picture).startswith(b"\x89PNG")


def write(folder, name, *cells):
    nbformat.write(new_notebook(cells=list(cells)), folder / name)


def test_the_index_lists_all_tools_and_escapes_their_text(tmp_path):
    png = new_output("display_data", {"image/png": "QUJD\nREVG\n"})
    title = new_markdown_cell("# A <b> & {{ x }}\n\nLead {% y %}.\n\nMore.")
    write(tmp_path, "b.ipynb", title, new_code_cell("1", outputs=[png]))
    write(tmp_path, "a.ipynb", new_markdown_cell("# Only a title"))
    assert [card.name for card in app.cards(tmp_path)] == ["a", "b"]
    template = app.build(tmp_path, tmp_path / "data")
    from jinja2 import Environment, FileSystemLoader

    environment = Environment(loader=FileSystemLoader(template))
    page = environment.get_template("tree-lab.html").render(base_url="/")
    assert 'href="/voila/render/a.ipynb"' in page and "Only a title" in page
    assert 'src="data:image/png;base64,QUJDREVG"' in page
    assert "A <b> & {{ x }}" in unescape(page) and "Lead {% y %}." in unescape(page)
    assert "<b>" not in page
    assert environment.get_template("tree.html").render(base_url="/") == page
    app.build(tmp_path, tmp_path / "data")


def test_a_card_shows_the_emphasis_of_markdown():
    card = app.html(app.Card("a", "A *b*", "Move the *time* slider: 2 * 3.", ""))
    assert "<p>Move the <em>time</em> slider: 2 * 3.</p>" in card
    assert "<h2>A <em>b</em></h2>" in card


def test_the_template_loads_nothing_from_outside(tmp_path):
    template = app.build(EXPLORE, tmp_path)
    for path in template.iterdir():
        loads = re.findall(r"""(?:src|href)=["']?(?:https?:)?//|url\(|@import""", path.read_text())
        assert loads == [], path.name


def test_messages_to_a_page_are_sent_at_once(monkeypatch):
    done = []

    async def opened(self, kernel_id):
        done.append(kernel_id)

    monkeypatch.setattr(pool.app.VoilaKernelWebsocketHandler, "open", opened)
    monkeypatch.setattr(pool.Channel, "set_nodelay", lambda self, on: done.append(on))
    asyncio.run(pool.Channel.open(pool.Channel.__new__(pool.Channel), "kernel"))
    assert done == [True, "kernel"]
