"""The architecture page and its picture match the code, and no modules import in a circle."""

import ast
import re
from pathlib import Path

import grimp
import networkx

from docs import layers

ROOT = Path(__file__).resolve().parents[1]
PAGE = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")


def test_the_picture_shows_the_imports_of_the_code():
    drawn = layers.PICTURE.read_text(encoding="utf-8")
    (pairs,) = re.findall(r"<dc:description>(.*?)</dc:description>", drawn, re.S)
    found = {tuple(pair.replace("&gt;", ">").split(">")) for pair in pairs.split()}
    assert found == layers.imports(), "run `python docs/layers.py`"


def test_every_file_that_the_page_names_exists():
    package = ROOT / "shipnet"
    for name in re.findall(r"`((?:[a-z_]+/)?[a-z_*]+\.py)`", PAGE):
        places = (package.glob(name), package.glob(f"*/{name}"), ROOT.glob(name))
        assert any(map(list, places)), name
    for name in re.findall(r"`([a-z_]+)`, `", PAGE.partition("## A telegram")[0]):
        places = (package / name, package / f"{name}.py")
        assert any(map(Path.exists, places)) or name in ("decode", "design", "ledger"), name


def test_arguments_of_a_plot_are_checked_before_it_makes_axes():
    """Otherwise an error would leave an empty figure in a notebook."""
    late = []
    for file in (ROOT / "shipnet").rglob("*.py"):
        for function in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(function, ast.FunctionDef):
                parts = list(ast.walk(function))
                calls = [(ast.unparse(p.func), p.lineno) for p in parts if isinstance(p, ast.Call)]
                made = [line for name, line in calls if name == "style.axes"]
                checks = [p.lineno for p in parts if isinstance(p, ast.Raise)]
                checks += [line for name, line in calls if name.startswith("check_")]
                if made and any(line > min(made) for line in checks):
                    late.append((file.name, function.name))
    assert late == []


def test_every_plot_that_makes_axes_applies_the_style():
    plain = []
    for file in (ROOT / "shipnet").rglob("*.py"):
        for function in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(function, ast.FunctionDef) and "style.axes(" in ast.unparse(function):
                applied = "@style.applied" in ast.unparse(function)
                if not (applied or "with house():" in ast.unparse(function)):
                    plain.append((file.name, function.name))
    assert plain == []


def test_there_are_no_import_cycles():
    """Type-only imports and imports inside functions count: a cycle hides what to read first."""
    graph = grimp.build_graph("shipnet", exclude_type_checking_imports=False, cache_dir=None)
    imports = networkx.DiGraph(
        (name, other)
        for name in graph.modules
        for other in graph.find_modules_directly_imported_by(name)
    )
    circles = [c for c in networkx.strongly_connected_components(imports) if len(c) > 1]
    assert circles == [], [sorted(circle) for circle in circles]
