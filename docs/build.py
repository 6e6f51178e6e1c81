"""Build the book: execute the stale notebooks, write the generated pages, run Sphinx.

    python docs/build.py [--stored]

With --stored, no notebook is executed; the book shows the stored outputs, which the tests check.
The Sphinx source is assembled in build/book, and the pages are in build/site. Any warning is an
error. Unchanged pages are not rebuilt.
"""

from __future__ import annotations

import argparse
import csv
import gc
import html
import importlib
import inspect
import json
import math
import re
import shutil
import sys
import types
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path, PurePosixPath
from typing import Any

from sphinx.cmd.build import build_main
from sphinx.pycode import ModuleAnalyzer

import notebooks
from shipnet.papers import PAPERS

ROOT = Path(__file__).resolve().parent.parent
INPUTS = (
    "notebooks", "shipnet", "data", "docs", "tests/reference", "requirements.lock", "CHANGELOG.md",
)  # fmt: skip
# Sphinx detects changed sources, but not changes in the code that turns them into pages.
MACHINERY = ("docs/_ext", "docs/_static", "docs/build.py", "docs/conf.py", "requirements.lock")
#: Caption of each folder of notebooks, in the order of the navigation.
CAPTIONS = {"": "Start here", "lessons": "Lessons", "explore": "Tools", "papers": "Papers"}
CAPTIONS |= {"real": "Real lines"}
REFERENCE = ("ledger.md", "errata.md", "data/SOURCES.md", "api/shipnet.rst", "CHANGELOG.md")
#: What the picture of each tool shows, in docs/_static/tools.
PICTURES = {
    "asi_bench": "The AS-i bench: a cable with its devices, and the signal at a place of it.",
    "can_load": "The CAN tool: the messages of an engine, and their response times.",
    "engine_faults": "The engine tool: the alarm screen after a fault.",
    "modbus_scan": "The Modbus tool: the time of a scan, compared with its limit.",
    "ring_buffer": "The receive ring, with its pointers and the bytes that it holds.",
    "ship_design": "The ship design tool: several designs for one I/O list, compared.",
    "valve_client": "The valve client: a command, and what the valves report.",
    "valve_diagnosis": "The valve diagnosis: readings, their terms, and the rule that fires.",
}
#: A link to a cell of a notebook, and to its anchor in the book.
CELL_LINK = (".ipynb#cell-id=", ".html#")
CLAIM_ID = re.compile(r"\b[a-z]+\d{4}-\d{3}\b")
COLUMNS = ["id", "where", "claim", "the paper says", "we compute", "verdict"]


def natural(name: str) -> list[tuple[float, str]]:
    """Return a sort key that puts `10_x` after `9_x`."""
    parts = re.findall(r"\d+|\D+", name)
    return [(int(part), "") if part.isdigit() else (math.inf, part) for part in parts]


def contents(names: set[str]) -> str:
    """Return the navigation: a toctree for each kind of notebook, then the other pages."""
    chapters: dict[str, list[str]] = {folder: [] for folder in CAPTIONS}
    # A folder's README comes first; papers come in the order of PAPERS.
    order = {f"papers/{paper}": f"papers/{n}" for n, paper in enumerate(PAPERS)}
    wanted = [name for name in names if re.search(r"^notebooks/.*(\.ipynb|/README\.md)$", name)]

    def place(name: str) -> tuple[bool, str, list[tuple[float, str]]]:
        folder = str(PurePosixPath(name).parent.relative_to("notebooks"))
        return not name.endswith("README.md"), order.get(folder, folder), natural(name)

    for name in sorted(wanted, key=place):
        folder = PurePosixPath(name).relative_to("notebooks").parts[0]
        chapters["" if folder.endswith(".ipynb") else folder].append(name)
    trees = [(CAPTIONS[folder], pages) for folder, pages in chapters.items()]
    trees.append(("How to", sorted(name for name in names if name.startswith("howto/"))))
    guide = sorted(name for name in names if re.fullmatch(r"[a-z_]+\.md", name))
    trees.append(("Guide", [name for name in guide if name not in ("index.md", *REFERENCE)]))
    trees.append(("Reference", [name for name in REFERENCE if name in names]))
    return "\n## Contents\n" + "".join(
        "\n".join(["", "```{toctree}", f":caption: {caption}", ":maxdepth: 1", "", *pages, "```\n"])
        for caption, pages in trees
        if pages
    )


def papers_table(names: Iterable[str]) -> str:
    """Return the table of the papers, each with links to its notebooks."""
    rows = ["| paper | notebooks |", "|---|---|"]
    for key, title in PAPERS.items():
        mine = sorted(name for name in names if name.startswith(f"notebooks/papers/{key}/"))
        links = [f"[{PurePosixPath(n).stem.partition('_')[2]}]({n})" for n in mine]
        rows.append(f"| {title} | {', '.join(links)} |")
    return "\n".join(rows)


def api_pages(root: Path) -> Iterator[tuple[str, str]]:
    """Yield (name, text) of each API page: shipnet, its public packages, their public objects."""
    package = importlib.import_module("shipnet")
    public = {name: getattr(package, name) for name in sorted(dir(package))}
    shown = [name for name, value in public.items() if isinstance(value, types.ModuleType)]
    title = "The package shipnet"
    lines = [title, "=" * len(title), "", ".. automodule:: shipnet", "   :ignore-module-all:", ""]
    for name in public.keys() - shown:
        lines += _directive(f"shipnet.{name}", public[name])
    lines += [".. list-table::", ""]
    for name in shown:
        module = importlib.import_module(f"shipnet.{name}")
        lines += [f"   * - :doc:`{name} <shipnet.{name}>`", f"     - {_first_sentence(module)}"]
    lines += ["", ".. toctree::", "   :hidden:", "", *(f"   shipnet.{name}" for name in shown)]
    yield "api/shipnet.rst", "\n".join(lines) + "\n"
    seen: set[int] = set()
    for name in shown:
        objects: dict[str, str] = {}
        page = "\n".join(_api_page(f"shipnet.{name}", seen, objects)) + "\n"
        yield f"api/shipnet.{name}.rst", page
        yield from objects.items()


def _api_page(
    name: str, seen: set[int], objects: dict[str, str], underline: str = "="
) -> Iterator[str]:
    """Yield the lines of a package's page: its docstring, constants, summary and namespaces.

    The pages of its functions and classes are added to `objects`. An object that several packages
    export has one page; `seen` has the ids of objects with a page.
    """
    module = importlib.import_module(name)
    yield from (name, underline * len(name), "", f".. automodule:: {name}")
    yield from ("   :ignore-module-all:", "")
    public = {one: getattr(module, one) for one in sorted(getattr(module, "__all__", []))}
    spaces = [one for one, value in public.items() if isinstance(value, types.ModuleType)]
    called = {one: value for one, value in public.items() if callable(value)}
    if called:
        yield from (".. list-table::", "   :class: summary", "")
    for one, value in called.items():
        yield f"   * - :py:obj:`{one} <{name}.{one}>`"
        yield f"     - {_first_sentence(value)}"
        # Some file systems do not distinguish the class Scan from the function scan.
        taken = f"api/{name}.{one}.rst".lower() in map(str.lower, objects)
        page = f"api/{name}.{one}{'_' * taken}.rst"
        if id(value) not in seen:
            seen.add(id(value))
            title = f"{name.partition('.')[2]}.{one}"
            lines = [":orphan:", "", title, "=" * len(title), "", f"In :mod:`{name}`.", ""]
            objects[page] = "\n".join([*lines, *_directive(f"{name}.{one}", value)])
    yield ""
    for one in sorted(public.keys() - called.keys() - set(spaces)):
        yield from _constant(f"{name}.{one}", public[one])
    for one in spaces:
        yield ""
        yield from _api_page(f"{name}.{one}", seen, objects, "-")


def _first_sentence(value: object) -> str:
    """Return the first sentence of a docstring, on one line."""
    text = inspect.cleandoc(value.__doc__ or "").partition("\n\n")[0].replace("\n", " ")
    return text.partition(". ")[0].rstrip(".") + "."


def _directive(name: str, value: object) -> list[str]:
    """Return the directive that documents a class or function."""
    if isinstance(value, type):
        return [f".. autoclass:: {name}", "   :members:", ""]
    return [f".. autofunction:: {name}", ""]


def _constant(name: str, value: object) -> Iterator[str]:
    """Yield the directive that documents a constant: its value, and the comment with its source."""
    text = repr(value)
    yield f".. py:data:: {name}"
    if len(text) < 200:
        yield f"   :value: {text}"
    yield ""
    package, _, one = name.rpartition(".")
    for module in [
        sys.modules[known] for known in sorted(sys.modules) if known.startswith(package)
    ]:
        if getattr(module, one, None) is value and getattr(module, "__file__", None):
            comments = ModuleAnalyzer.for_module(module.__name__).find_attr_docs()
            if comment := comments.get(("", one)):
                yield from (f"   {line}" for line in comment)
                break
    if len(text) >= 200 and isinstance(value, Mapping):
        yield f"   A mapping with the keys {', '.join(f'``{key!r}``' for key in value)}."
    yield ""


def glossary_page() -> str:
    """Return the glossary as a page."""
    from shipnet.exercises import glossary

    rows = (f"| {term} | {word.korean} | {word.meaning} |" for term, word in glossary().iterrows())
    about = "The field's terms, with the Korean terms that the papers print."
    table = ["| term | Korean | meaning |", "|---|---|---|", *rows]
    return "\n".join(["# Glossary", "", about, "", *table, ""])


def ledger_page() -> str:
    """Return the ledger as a page: counts, then a table per paper with an anchor for each claim."""
    from shipnet.papers import ledger

    everything = ledger()
    done = everything.counts()
    counts = (
        f"<tr><th>{key}</th>{''.join(f'<td>{number}</td>' for number in numbers)}</tr>"
        for key, *numbers in done.itertuples(name=None)
    )
    parts = [
        "# Ledger",
        "What the papers print, and what shipnet computes. Each claim is followed by a note and "
        "the evidence. Each computed value is followed by its deviation from the printed one. Each "
        "verdict is followed by its grade of evidence and by its condition, unless it holds as "
        "printed. The grades are, strongest first: *measurement*, recorded data; *independent*, "
        "another program, a published table or a second derivation; *own simulator*, a model of "
        "this package alone; *definition*, the way our code defines the thing. "
        f"{done['measurement'].sum()} verdicts rest on a measurement, {done['independent'].sum()} "
        "on independent evidence.",
        _table(["paper", *done.columns], counts),
    ]
    for key, claims in everything.table().reset_index().groupby("paper", sort=False):
        parts += [
            f"## {key}",
            _table(COLUMNS, map(_claim, claims.to_dict("records")), "ledger claims"),
        ]
    return "\n\n".join(parts) + "\n"


def papers_page() -> str:
    """Return the papers section by section, with links to the cells of the notebooks."""
    from shipnet.papers import contents

    parts = [
        "# The papers, section by section",
        "What each section of a paper says, and the cells, figures, tables and claims that follow "
        "it. The numbers of claims are those of the [ledger](ledger.md).",
    ]
    for key, title in PAPERS.items():
        table = contents(key).html(f"notebooks/papers/{key}/").replace(*CELL_LINK)
        table = f'```{{raw}} html\n<div class="wide">{table}</div>\n```'
        parts += [f"## {key}", title, table]
    return "\n\n".join(parts) + "\n"


def anchored(notebook: str) -> str:
    """Return a notebook with an anchor before each code cell and heading, for links to cells."""
    read = json.loads(notebook)
    cells: list[dict[str, Any]] = []
    for cell in read["cells"]:
        if cell["cell_type"] == "code" or "".join(cell["source"]).startswith("## "):
            anchor = f'<a id="{cell["id"]}"></a>'
            id = f"at-{cell['id']}"
            cells.append({"cell_type": "markdown", "id": id, "metadata": {}, "source": [anchor]})
        for output in cell.get("outputs", []):
            lines = output.get("data", {}).get("text/html", [])
            lines[:] = [line.replace(*CELL_LINK) for line in lines]
        cells.append(cell)
    return json.dumps({**read, "cells": cells})


def with_download(notebook: str, name: str, picture: str = "") -> str:
    """Return a notebook that has a download link, and a tool's picture, in its first part."""
    read = json.loads(notebook)
    parts = [f"{{download}}`Download this notebook </downloads/{name}>`"]
    if picture:
        parts.append(f"![{picture}](/_static/tools/{Path(name).stem}.png)\n\n*{picture}*")
    head, heading, rest = "".join(read["cells"][0]["source"]).partition("\n## ")
    read["cells"][0]["source"] = "\n\n".join([head, *parts, ""]) + heading + rest
    return json.dumps(read)


def without_outputs(notebook: str) -> str:
    """Return a notebook for a download, which its reader runs."""
    read = json.loads(notebook)
    for cell in read["cells"]:
        if cell["cell_type"] == "code":
            cell.update(outputs=[], execution_count=None)
    return json.dumps(read, indent=1, ensure_ascii=False)


def errata_page() -> str:
    """Return the errata as a page: what a reader of the papers should correct, and why."""
    from shipnet.papers import ledger

    everything = ledger()
    table, differing = everything.table(), everything.differing()
    errata = table.query("kind == 'erratum'")
    listed = table.loc[[*errata.index, *differing.index]].reset_index()
    parts = [
        "# Errata",
        f"{len(errata)} misprints, wrong terms and numbering errors in the five papers, and "
        f"{len(differing)} statements that need a correction or a qualification. We chose the "
        "reading that favours the paper; the reason is given below each correction. The "
        "[ledger](ledger.md) contains all claims, including those that agree.",
    ]
    for key in listed["paper"].unique():
        claims = listed[listed["paper"] == key].sort_values("id")
        rows = map(_erratum, claims.to_dict("records"))
        parts += [f"## {key}", _table(["where", "printed", "correction", "verdict"], rows)]
    return "\n\n".join(parts) + "\n"


def tested_page(root: Path) -> str:
    """Return the page on tests, with tables from the tests and from the data files."""
    from shipnet import datasets

    rows = csv.DictReader(
        (root / "tests" / "reference" / "tolerances.csv").read_text(encoding="utf-8").splitlines()
    )
    references = (
        _row([(row["part"], ""), (row["what"], ""), (row["compared with"], ""), (allowed, "")])
        for row in rows
        for allowed in [f"{row['tolerance']} {row['unit']}"]
    )
    names = datasets.names()
    counts = [
        (what, len(table), (table[column] != good).sum(), why)
        for what, name, column, good, why in UNREAD
        for table in [datasets.read(name)]
    ]
    for sign, why in (
        ("synthetic_", "synthetic, made by us"),
        ("_assumed_", "assumed in part by us, because kim2014 does not give every value"),
    ):
        counts.append(("data files", len(names), sum(sign in name for name in names), why))
    sources = (_row([(str(cell), "") for cell in row]) for row in counts)
    text = (root / "docs" / "tested_against.md").read_text(encoding="utf-8")
    return text.replace(
        "<!-- references -->",
        _table(["part", "what", "compared with", "tolerance"], references),
    ).replace("<!-- sources -->", _table(["table", "rows", "affected", "limitation"], sources))


#: Tables with unconfirmed rows: content, file, column, its value if confirmed, limitation.
UNREAD = [
    (
        "rules for designs",
        "design_rules.csv",
        "confirmed",
        "yes",
        "quoted from a paper, a summary or a manufacturer's document",
    ),
    ("EMC levels", "emc_levels.csv", "confirmed", "yes", "from memory; the standard was not read"),
    ("cables", "estimated_cables.csv", "status_price", "confirmed", "price assumed"),
    ("cables", "estimated_cables.csv", "status_mass", "confirmed", "mass estimated"),
]


def _values(claim: dict[str, Any]) -> tuple[str, str]:
    """Return the printed and the computed value of a claim, each with its unit."""
    from shipnet.papers.judging import computed_text

    computed = computed_text(claim)
    unit = "" if isinstance(claim["computed"], bool) or not computed else claim["unit"]
    printed = f"{claim['published']} {claim['unit']}" if claim["published"] else ""
    return printed.strip(), f"{computed} {unit}".strip()


def _condition(claim: dict[str, Any]) -> str:
    """Return the condition under which a verdict holds, or "" if that is "as printed"."""
    return "" if claim["holds_under"] == "as printed" else claim["holds_under"]


def _erratum(claim: dict[str, Any]) -> str:
    """Return the table row of one erratum, with a link to its claim."""
    printed, computed = _values(claim)
    # A wrong number is corrected by the computed one, a wrong statement by the note.
    computed = "" if isinstance(claim["computed"], bool) else computed
    instead, *rest = filter(None, [claim["corrected"] or computed, claim["note"]])
    where = f'<a href="ledger.html#{claim["id"]}">{claim["id"]}</a>'
    verdict = claim["verdict"] or claim["kind"]
    texts = (claim["where"], claim["claim"], printed, instead, "".join(rest), verdict)
    place, said, printed, instead, note, verdict = map(html.escape, texts)
    cells = [(where, place), (said, printed), (instead, note)]
    return _row([*cells, (verdict, html.escape(_condition(claim)))])


def _claim(claim: dict[str, Any]) -> str:
    """Return the table row of one claim."""
    printed, computed = _values(claim)
    difference = claim["relative_difference"]
    distance = [claim["match"]] if claim["match"].startswith(("factor", "differs")) else []
    if difference and not math.isnan(difference):
        distance.append(f"{100 * difference:+.2g} %")
    evidence = claim["evidence"].removeprefix("shipnet.papers.")
    instead = f"correct: {claim['corrected']}" if claim["corrected"] else ""
    cells = [
        (claim["id"], ""),
        (claim["where"], ""),
        (claim["claim"], "; ".join(filter(None, [instead, claim["note"], evidence]))),
        (printed, ""),
        (computed, ", ".join(distance)),
        (
            claim["verdict"] or claim["kind"],
            ". ".join(filter(None, [claim["grade"], _condition(claim)])),
        ),
    ]
    linked = [(_linked(text), _linked(small)) for text, small in cells]
    return _row(linked, f' id="{claim["id"]}"')


def _row(cells: Iterable[tuple[str, str]], attributes: str = "") -> str:
    """Return a table row; each cell contains text with small print below it."""
    smalls = ((text, f"<small>{small}</small>" if small else "") for text, small in cells)
    return f"<tr{attributes}>{''.join(f'<td>{text}{small}</td>' for text, small in smalls)}</tr>"


def _linked(text: str) -> str:
    return CLAIM_ID.sub(r'<a href="#\g<0>">\g<0></a>', html.escape(text))


def _table(titles: list[str], rows: Iterable[str], kind: str = "ledger") -> str:
    head = "".join(f"<th>{title}</th>" for title in titles)
    lines = ["```{raw} html", f'<div class="wide"><table class="{kind}">']
    lines += [f"<thead><tr>{head}</tr></thead>", "<tbody>", *rows, "</tbody></table></div>", "```"]
    return "\n".join(lines)


def sources(root: Path) -> dict[str, bytes]:
    """Return the whole Sphinx source: name -> content."""
    copies = root / "build" / "notebooks"
    docs = root / "docs"
    pages = [path for kind in ("md", "png", "svg") for path in docs.rglob(f"*.{kind}")]
    files = {path.relative_to(docs).as_posix(): path.read_bytes() for path in pages}
    for path in copies.rglob("*.ipynb"):
        if path.parent.name != "solutions":  # not in the book; teachers use the notebooks
            part = path.relative_to(copies).as_posix()
            text = path.read_text(encoding="utf-8")
            files[f"downloads/{part}"] = without_outputs(text).encode()
            text = anchored(text) if path.parent.parent.name == "papers" else text
            files[f"notebooks/{part}"] = with_download(
                text, part, PICTURES.get(path.stem, "")
            ).encode()
    for path in (root / "notebooks").rglob("README.md"):
        files[path.relative_to(root).as_posix()] = path.read_bytes()
    # The data files can be downloaded; relative links in the notebooks lead to these paths.
    others = [*(root / "data").rglob("*"), root / "CHANGELOG.md"]
    for path in (path for path in others if path.is_file()):
        files[path.relative_to(root).as_posix()] = path.read_bytes()
    # The book's root is the folder docs.
    files["CHANGELOG.md"] = files["CHANGELOG.md"].replace(b"](docs/", b"](")
    generated = {
        "errata.md": errata_page(),
        "glossary.md": glossary_page(),
        "ledger.md": ledger_page(),
        "papers.md": papers_page(),
        "tested_against.md": tested_page(root),
        **dict(api_pages(root)),
    }
    files |= {name: text.encode() for name, text in generated.items()}
    index = files["index.md"].decode().replace("<!-- papers -->", papers_table(files))
    files["index.md"] = (index + contents(set(files))).encode()
    return files


def assemble(folder: Path, files: dict[str, bytes]) -> bool:
    """Make `folder` contain exactly `files`; return whether a file was removed."""
    for name, content in files.items():
        path = folder / name
        # An unchanged file keeps its time stamp, so that Sphinx does not rebuild its page.
        if not (path.is_file() and path.read_bytes() == content):
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)
    gone = [
        path
        for path in folder.rglob("*")
        if path.is_file() and path.relative_to(folder).as_posix() not in files
    ]
    for path in gone:
        path.unlink()
    return bool(gone)


def main(root: Path = ROOT, *, stored: bool = False) -> int:
    """Build the book and return the exit code."""
    build = root / "build"
    book, site, stamp = build / "book", build / "site", build / "site.json"
    if failed := notebooks.run(root, stored=stored):
        print(f"the book is not built: {failed} notebook{'s' * (failed > 1)} failed")
        return 1
    now = {
        "inputs": notebooks.fingerprint(root, INPUTS),
        "machinery": notebooks.fingerprint(root, MACHINERY),
    }
    before = json.loads(stamp.read_text()) if stamp.is_file() else {}
    page = site / "index.html"
    if before != now or not page.is_file():
        print("building the book", flush=True)
        # Without a stamp, the next run rebuilds all pages and so repeats their warnings.
        stamp.unlink(missing_ok=True)
        vanished = assemble(book, sources(root))
        # A page is rebuilt if its notebook was executed again, even with the same outputs.
        for copied in (book / "notebooks").rglob("*.ipynb"):
            shutil.copystat(build / copied.relative_to(book), copied)
        if vanished or before.get("machinery") != now["machinery"]:
            for folder in (site, build / "doctrees", build / "jupyter_execute"):
                shutil.rmtree(folder, ignore_errors=True)
        options = ["-q", "-W", "-j", "auto", "-c", root / "docs", "-d", build / "doctrees"]
        if code := build_main([*map(str, options), "-b", "html", str(book), str(site)]):
            print("the book is not built: see the warnings above")
            return code
        stamp.write_text(json.dumps(now))
    print(f"the book: {page.relative_to(root).as_posix()}")
    return 0


if __name__ == "__main__":
    gc.disable()  # garbage collection takes two fifths of Sphinx's time and frees almost nothing
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--stored", action="store_true", help="do not execute notebooks")
    sys.exit(main(stored=parser.parse_args().stored))
