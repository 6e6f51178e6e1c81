"""Imports go down only, and the architecture page and its picture follow the code."""

import re
from pathlib import Path

import grimp
import networkx

from docs import floors

ROOT = Path(__file__).resolve().parents[1]
PAGE = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")


def test_the_picture_shows_the_imports_of_the_code():
    drawn = floors.PICTURE.read_text(encoding="utf-8")
    (pairs,) = re.findall(r"<dc:description>(.*?)</dc:description>", drawn, re.S)
    found = {tuple(pair.replace("&gt;", ">").split(">")) for pair in pairs.split()}
    assert found == floors.imports(), "run `python docs/floors.py`"


def test_no_import_goes_up_a_floor():
    level = {name: k for k, row in enumerate(floors.floors()) for name in row}
    assert [pair for pair in floors.imports() if level[pair[0]] > level[pair[1]]] == []


def test_every_file_that_the_page_names_exists():
    package = ROOT / "shipnet"
    for name in re.findall(r"`((?:[a-z_]+/)?[a-z_*]+\.py)`", PAGE):
        places = (package.glob(name), package.glob(f"*/{name}"), ROOT.glob(name))
        assert any(map(list, places)), name
    for name in re.findall(r"`([a-z_]+)`, `", PAGE.partition("## A telegram")[0]):
        assert (package / name).exists() or (package / f"{name}.py").exists() or name in (
            "decode", "design", "ledger",
        ), name  # fmt: skip


def test_no_files_import_each_other_in_a_circle():
    """Imports for types and inside functions count: a circle hides which file comes first."""
    graph = grimp.build_graph("shipnet", exclude_type_checking_imports=False, cache_dir=None)
    imports = networkx.DiGraph(
        (name, other)
        for name in graph.modules
        for other in graph.find_modules_directly_imported_by(name)
    )
    circles = [c for c in networkx.strongly_connected_components(imports) if len(c) > 1]
    assert circles == [], [sorted(circle) for circle in circles]
