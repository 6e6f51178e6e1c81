"""Every table and figure of the papers: its cell, its label and its drawing."""

import re
from functools import cache
from html import unescape
from pathlib import Path

import matplotlib.pyplot as plt
import nbformat
import pytest

from shipnet import datasets
from shipnet.errors import ArgumentError
from shipnet.papers import PAPERS, contents, figure
from shipnet.papers.registry import FIGURES
from tests.support import figure_faults

ROOT = Path(__file__).resolve().parents[2]
ITEMS = datasets.read("figures_tables.csv")
SECTIONS = datasets.read("paper_sections.csv")
CLAIMS = datasets.read("claims.csv")
PRINTED = [(row.paper, row.item) for row in ITEMS[ITEMS["printed"] != ""].itertuples()]
SHOWN = [(row.paper, row.item) for row in ITEMS[ITEMS["cell"] != ""].itertuples()]


@cache
def cells(paper, notebook):
    """Return the cells of a notebook by their ids."""
    read = nbformat.read(ROOT / f"notebooks/papers/{paper}/{notebook}.ipynb", as_version=4)
    return {cell.id: cell for cell in read.cells}


def cell_of(paper, place):
    """Return a cell that is named as in ``1_telegrams#1-telegrams-07``."""
    notebook, _, id = place.partition("#")
    return cells(paper, notebook)[id]


def outputs(paper, place, kind):
    """Return the outputs of one kind, such as ``"text/html"``, of a cell."""
    shown = cell_of(paper, place).get("outputs", [])
    return [output.data[kind] for output in shown if kind in output.get("data", {})]


def words(text):
    """Return text without tags and repeated spaces."""
    return " ".join(unescape(re.sub(r"<[^>]+>", " ", text)).split())


def test_items_have_a_label_a_reason_and_a_cell():
    assert len(ITEMS) == 72
    assert not ITEMS.duplicated(["paper", "item"]).any()
    assert set(ITEMS["paper"]) == set(PAPERS)
    labels = {"reproduced", "modelled", "redrawn", "not reproducible"}
    assert set(ITEMS["treatment"]) == labels
    assert (ITEMS["reason"] != "").all()
    assert ((ITEMS["cell"] == "") == (ITEMS["treatment"] == "not reproducible")).all()


@pytest.mark.parametrize(("paper", "item"), SHOWN)
def test_the_label_of_an_item_is_what_its_cell_shows(paper, item):
    row = ITEMS[(ITEMS["paper"] == paper) & (ITEMS["item"] == item)].iloc[0]
    pictures = outputs(paper, row["cell"], "image/png")
    if row["printed"]:
        table = words("\n".join(outputs(paper, row["cell"], "text/html")))
        place = 0
        rows = datasets.read(row["printed"])
        columns = [name for name in rows if name.endswith("_printed")] or list(rows)
        for printed in rows[columns].to_numpy().tolist():
            for text in filter(None, map(words, printed)):
                assert text in table, f"{text} is missing"
            # The rows are in the printed order.
            place = table.index(words(printed[0]), place)
        assert row["treatment"] == "reproduced"
    else:
        assert pictures, f"{item} is called {row['treatment']}, but its cell shows no picture"


@pytest.mark.parametrize("paper", PAPERS)
def test_every_picture_can_be_drawn_by_name(paper):
    mine = ITEMS[ITEMS["paper"] == paper]
    drawn = mine[(mine["printed"] == "") & (mine["cell"] != "")]["item"].tolist()
    with pytest.raises(ArgumentError, match="item is 'Fig 99'; it must be one of '") as error:
        figure(paper, "Fig 99")
    assert re.findall(r"'([^']+)'", str(error.value))[1:] == drawn
    assert {item for key, item in FIGURES if key == paper} == set(drawn)


@pytest.mark.parametrize(("paper", "item"), [pair for pair in SHOWN if pair not in PRINTED])
def test_a_drawing_draws(paper, item):
    drawn = figure(paper, item).figure
    assert any(ax.lines or ax.patches or ax.collections or ax.images for ax in drawn.axes)
    assert figure_faults(drawn) == []
    plt.close(drawn)


def test_a_figure_of_no_paper_is_refused():
    with pytest.raises(ArgumentError, match="paper is 'kim'; it must be one of 'kim2023'"):
        figure("kim", "Fig 1")


@pytest.mark.parametrize("paper", PAPERS)
def test_every_item_and_claim_is_in_one_section(paper):
    mine = SECTIONS[SECTIONS["paper"] == paper]
    items = "; ".join(filter(None, mine["items"])).split("; ")
    assert sorted(items) == sorted(ITEMS[ITEMS["paper"] == paper]["item"])
    numbers = " ".join(mine["claims"]).split()
    assert sorted(f"{paper}-{n}" for n in numbers) == sorted(CLAIMS[CLAIMS["paper"] == paper]["id"])


@pytest.mark.parametrize("paper", PAPERS)
def test_the_links_of_a_section_lead_to_cells(paper):
    table = contents(paper)
    links = re.findall(r'href="(\w+)\.ipynb#cell-id=([\w-]+)"', table._repr_html_())
    assert len(links) >= len(table.table())
    for notebook, id in links:
        assert id in cells(paper, notebook), id
    assert table.table()["says"].str.endswith(".").all()
    with pytest.raises(ArgumentError, match="paper is 'kim'"):
        contents("kim")


@pytest.mark.parametrize("paper", PAPERS)
def test_the_first_notebook_shows_the_sections_first(paper):
    first = min((ROOT / f"notebooks/papers/{paper}").glob("1_*.ipynb"))
    code = [cell for cell in nbformat.read(first, as_version=4).cells if cell.cell_type == "code"]
    shows = [f'papers.contents("{paper}")' in cell.source for cell in code]
    assert shows.index(True) <= 2, "only imports come before it"
    stored = outputs(paper, f"{first.stem}#{code[shows.index(True)].id}", "text/html")
    assert stored == [contents(paper)._repr_html_()], "run the notebook again"
