"""What strict nbval passes over in silence."""

import ast
import importlib
import re
from base64 import b64decode, b64encode
from functools import partial
from itertools import pairwise
from pathlib import Path
from types import ModuleType

import nbformat
import pytest

import shipnet
from shipnet import datasets
from shipnet.papers import PAPERS

ROOT = Path(__file__).resolve().parents[1]
NOTEBOOKS = sorted(
    path for path in (ROOT / "notebooks").rglob("*.ipynb") if ".ipynb_checkpoints" not in path.parts
)
PROBLEM, END = "The problem on the ship", ["What we learned", "References"]
HEADINGS = {
    "papers": [PROBLEM, "What the paper says, and what we compute", *END],
    "lessons": [PROBLEM, *END],
    "real": [PROBLEM, *END],
    "course": [PROBLEM, "Explore", "Exercises", "Words", *END],
    "solutions": ["Exercises"],
    "explore": ["What to try", "What it assumes"],
    "01_three_buses.ipynb": [PROBLEM, *END],
    "notebooks": [PROBLEM, "The map", "Units and figures", *END],
}


#: Most pixels across a stored figure: 6.6 inches at 200 pixels per inch, and the margin around it.
WIDEST = 1344

read = partial(nbformat.read, as_version=4)


def code(notebook):
    return [cell for cell in notebook.cells if cell.cell_type == "code"]


def prose(notebook):
    return "\n".join(cell.source for cell in notebook.cells if cell.cell_type == "markdown")


def tags(cell):
    return set(cell.metadata.get("tags", []))


def faults(notebook, kind):
    """Return what is wrong with a notebook's form, one sentence a fault."""
    found = []
    ids = [cell.get("id") for cell in notebook.cells]
    if None in ids or len(set(ids)) != len(ids):
        found.append("cell ids are missing or not unique")
    kernel = notebook.metadata.get("kernelspec", {}).get("name")
    if kernel != "python3":
        found.append(f"kernel is {kernel}, not python3")
    if not notebook.cells or not notebook.cells[0].source.startswith("# "):
        found.append("the first cell is no heading of level 1")
    text = prose(notebook)
    if len(re.findall(r"^# ", text, re.M)) != 1:
        found.append("there is not exactly one heading of level 1")
    if kind != "solutions" and "**You will be able to**" not in text:
        found.append("it does not say what you will be able to do")
    places = [text.find(f"\n## {heading}") for heading in HEADINGS.get(kind, [])]
    if -1 in places or places != sorted(places):
        found.append(f"headings are not, in this order, {HEADINGS[kind]}")
    for name in set(re.findall(r"`([\w.]+\.csv)`", text)) - set(datasets.names()):
        found.append(f"data file {name} does not exist")
    number = 0
    for place, cell in enumerate(notebook.cells, start=1):
        if cell.cell_type != "code":
            continue
        number += 1
        found += [f"cell {place}: {fault}" for fault in cell_faults(cell, number)]
    # Statements that a beginner can read, one step each, take more lines than clever ones.
    most = 120 if kind == "course" else 180
    if (lines := sum(len(cell.source.splitlines()) for cell in code(notebook))) > most:
        found.append(f"{lines} lines of code, more than {most}; they belong in the package")
    # A cell of text has one idea; the minutes of class limit the length of a lesson.
    if kind == "course" and not 25 <= len(notebook.cells) <= 80:
        found.append(f"{len(notebook.cells)} cells, not 25 to 80")
    return found


#: Packages with a public API; notebooks use no other names of them or of their namespaces.
FRONTS = {path.parent.name for path in (ROOT / "shipnet").glob("*/__init__.pyi")}
#: Modules that an expression may begin with: the packages, and the papers by their own names.
ROOTS = {name: importlib.import_module(f"shipnet.{name}") for name in FRONTS}
ROOTS |= {name: getattr(ROOTS["papers"], name) for name in PAPERS}


def is_public(module, name):
    """Return whether `from module import name` uses the public API of the package."""
    first, *parts = module.split(".")
    if first != "shipnet":
        return True
    if not parts:
        return name in dir(shipnet)
    return parts[0] not in FRONTS or not hidden(ROOTS[parts[0]], [*parts[1:], name])


def hidden(value, names):
    """Return the first of the names that its module does not export, looked up one by one."""
    for name in names:
        if not isinstance(value, ModuleType):
            break
        # A paper's drawings are a module beside its names: importing them loads matplotlib.
        if name == "plot" and value in [ROOTS[paper] for paper in PAPERS]:
            break
        if name not in value.__all__:
            return f"{value.__name__}.{name}"
        value = getattr(value, name)
    return ""


def chain(node):
    """Return the names of ``a.b.c``; empty for what does not begin with a name."""
    names = []
    while isinstance(node, ast.Attribute):
        names.insert(0, node.attr)
        node = node.value
    return [node.id, *names] if isinstance(node, ast.Name) else []


def import_faults(source):
    """Yield the names in a cell that are not public, and the names of packages that it hides."""
    for node in ast.walk(ast.parse(source)):
        first, *names = chain(node) or [""]
        if names and (name := hidden(ROOTS.get(first), names)):
            yield f"uses {name}, which is not public"
        if isinstance(node, ast.ImportFrom):
            for alias in node.names:
                if not is_public(node.module, alias.name):
                    yield f"imports {alias.name} of {node.module}, which is not public"
        elif isinstance(node, ast.Import):
            for alias in node.names:
                if alias.name.startswith("shipnet."):
                    yield f"imports {alias.name}; write `from shipnet import ...`"
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store) and node.id in FRONTS:
            yield f"assigns to {node.id}, the name of a package"


def cell_faults(cell, number):
    widget = "widget" in tags(cell)
    if not re.search(r"^\s*[%!]", cell.source, re.M):
        yield from import_faults(cell.source)
    if not cell.source.strip():
        yield "is empty"
    if widget and (cell.outputs or cell.execution_count is not None):
        yield "a widget cell is stored with output"
    if not widget and cell.execution_count != number:
        yield f"was not run in order (In [{cell.execution_count}], expected {number})"
    if re.search(r"^\s*[%!]", cell.source, re.M) or "get_ipython" in cell.source:
        yield "has a magic or a shell line"
    if re.search(r"NBVAL_|nbval-(ignore|skip)", cell.source + " ".join(tags(cell)), re.I):
        yield "its output is not compared"
    if re.search(r"https?:|\b(urllib|http\.client|socket)\b|import requests", cell.source):
        yield "asks the network"
    if typed := re.search(
        r"\bax(?:es\[\d\])?\.ax[hv]line\(-?[\d.]+[,)]|style\.limit\(\w+, -?[\d.]+[,)]", cell.source
    ):
        yield f"draws a limit from a typed number, {typed[0]}; name it, or take it from its model"
    label = re.search(r"\[(us|degC|k?ohm|-|1)\]['\"]", cell.source)
    if label and "plt.show()" in cell.source:
        yield f"labels a figure {label[1]}; write µs, °C, Ω, and nothing for no unit"
    if len(cell.source.splitlines()) > 15:
        yield "has more than 15 lines; they belong in the package"
    for output in cell.outputs:
        if output.output_type == "error" and "raises-exception" not in tags(cell):
            yield "is stored with an error"
        if output.get("name") == "stderr":
            yield "writes to standard error"
        if "plt.show()" in cell.source and "image/png" not in output.get("data", {}):
            yield "shows a figure but also other output"
        png = b64decode(output.get("data", {}).get("image/png", "")[:32])
        if (width := int.from_bytes(png[16:20], "big")) > WIDEST:
            yield f"shows a figure {width / 200:.1f} inches wide; 6.4 fit beside 10-point text"
    if "plt.show()" in cell.source and not cell.outputs and not widget:
        yield "shows no figure"
    if "plt.subplots" in cell.source and not cell.source.rstrip().endswith("plt.show()"):
        yield "does not end with plt.show()"


def kind_of(path):
    """Return which headings a notebook has to have."""
    if path.parent.name == "solutions":
        return "solutions"
    if path.parent.name == "lessons" and re.match(r"\d\d_", path.name):
        return "course"
    kind = path.relative_to(ROOT / "notebooks").parts[0]
    return kind if kind in HEADINGS else "notebooks"


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: f"{path.parent.name}-{path.stem}")
def test_form(path):
    notebook = read(path)
    assert faults(notebook, kind_of(path)) == []
    for target in re.findall(r"\]\(([^)#]+)\)", prose(notebook)):
        assert (path.parent / target).resolve().is_file(), target
    for cell, below in pairwise([*notebook.cells, nbformat.v4.new_raw_cell()]):
        if cell.cell_type == "code" and "plt.show()" in cell.source:
            assert below.source.startswith("*"), f"no caption below {cell.source}"


def test_every_tool_has_a_notebook_that_shows_it():
    notebooks = {path.stem: path for path in NOTEBOOKS if path.parent.name == "explore"}
    assert {path.stem for path in (ROOT / "shipnet" / "tools").glob("[a-z]*.py")} == {*notebooks}
    for path in notebooks.values():
        (widget,) = (cell for cell in code(read(path)) if "widget" in tags(cell))
        assert re.search(r"\.explore\(story=True\)$", widget.source)


def sample(**changes):
    cell = nbformat.v4.new_code_cell("1 + 1", execution_count=1)
    cell.outputs = [
        nbformat.v4.new_output("execute_result", {"text/plain": "2"}, execution_count=1)
    ]
    cell.update(changes)
    title = nbformat.v4.new_markdown_cell("# Title\n\n**You will be able to** add.")
    return nbformat.from_dict(
        {"cells": [title, cell], "metadata": {"kernelspec": {"name": "python3"}}}
    )


def figure(width):
    """Return an output with the start of a PNG file of this width, its signature and size."""
    png = b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR" + width.to_bytes(4, "big") + bytes(4)
    return nbformat.v4.new_output("display_data", {"image/png": b64encode(png).decode()})


@pytest.mark.parametrize(
    ("changes", "fault"),
    [
        ({"execution_count": 7}, "not run in order"),
        ({"source": "  !ls"}, "magic"),
        ({"source": "# NBVAL_IGNORE_OUTPUT\n1"}, "not compared"),
        ({"metadata": {"tags": ["widget"]}}, "widget cell is stored with output"),
        ({"source": "import urllib.request"}, "network"),
        ({"source": "style.limit(ax, -2.5)"}, "limit from a typed number"),
        ({"source": 'ax.set_xlabel("time [us]")\nplt.show()'}, "labels a figure us"),
        ({"source": "x = 1\n" * 16}, "more than 15 lines"),
        ({"source": ""}, "empty"),
        ({"source": "from shipnet import nothing"}, "not public"),
        ({"source": "can.faults.BitErrors(1).x + asi.receiver.receive"}, "asi.receiver, which"),
        ({"source": "import shipnet.errors"}, "write `from shipnet import"),
        (
            {"outputs": [nbformat.v4.new_output("stream", name="stderr", text="!")]},
            "standard error",
        ),
        ({"outputs": [nbformat.v4.new_output("error", ename="E")]}, "stored with an error"),
        ({"source": "fig, ax = plt.subplots()"}, "does not end with plt.show"),
        ({"source": "plt.show()", "outputs": []}, "shows no figure"),
        ({"id": None}, "cell ids"),
        ({"outputs": [figure(WIDEST + 1)]}, "a figure 6.7 inches wide"),
    ],
)
def test_each_fault_is_found(changes, fault):
    assert faults(sample(), "other") == []
    assert any(fault in found for found in faults(sample(**changes), "other"))
