"""Convert the sources of lessons to the formats of nbgrader and otter, using the cells' tags.

Check cells become assertions, because both graders count an exception as a wrong answer.
"""

from __future__ import annotations

import re
from pathlib import Path

import editions
import nbformat
from nbformat import NotebookNode
from nbformat.v4 import new_raw_cell

#: Points for a solved exercise.
POINTS = 1


def write_nbgrader(root: Path, source: Path) -> Path:
    """Write a lesson as a source notebook for nbgrader, with solutions and graded checks."""
    lesson = editions.read(source)
    notebook = editions.notebook_of(
        editions.copy_of(cell, _without_raise(cell.source))
        for cell in lesson.cells
        if "solution" not in editions.tags(cell)
    )
    for cell in notebook.cells:
        tags, keys = editions.tags(cell), editions.keys(cell)
        if not keys:
            continue
        about = {"schema_version": 3, "locked": "check" in tags, "task": False}
        if "exercise" in tags:
            about |= {"grade": False, "solution": True, "grade_id": keys[0]}
        else:
            cell.source = _asserted(cell.source)
            about |= {"grade": True, "solution": False, "grade_id": f"{keys[0]}-check"}
            about["points"] = POINTS
        cell.metadata["nbgrader"] = about
    return _write(root / "build/nbgrader/source" / source.stem / f"{source.stem}.ipynb", notebook)


def write_otter(root: Path, source: Path) -> Path:
    """Write a lesson as a source notebook for `otter assign`."""
    lesson, cells = editions.read(source), []
    files = f"# ASSIGNMENT CONFIG\nname: lesson {source.stem}\nexport_cell: false\nfiles: []"
    cells.append(new_raw_cell(files))
    for cell in lesson.cells:
        tags, keys = editions.tags(cell), editions.keys(cell)
        if "solution" in tags:
            continue
        if "exercise" in tags:
            cells.append(_raw(f"# BEGIN QUESTION\nname: {keys[0]}\npoints: {POINTS}"))
            cells.append(_raw("# BEGIN SOLUTION"))
            text = _without_raise(cell.source)
            for word in ("BEGIN", "END"):
                text = text.replace(f"### {word} SOLUTION", f"# {word} SOLUTION")
            cells += [editions.copy_of(cell, text), _raw("# END SOLUTION")]
        elif "check" in tags:
            cells += [_raw("# BEGIN TESTS"), editions.copy_of(cell, _asserted(cell.source))]
            cells += [_raw("# END TESTS"), _raw("# END QUESTION")]
        else:
            cells.append(editions.copy_of(cell, cell.source))
    return _write(root / "build/otter" / f"{source.stem}.ipynb", editions.notebook_of(cells))


def _raw(text: str) -> NotebookNode:
    return new_raw_cell(text)


def _without_raise(source: str) -> str:
    """Return the cell without stub lines that raise an error; graders insert their own lines."""

    def region(found: re.Match[str]) -> str:
        raises = "raise NotImplementedError" in found["stub"]
        return found[0].removeprefix(found["stub"]) if raises else found[0]

    return editions.SOLUTION.sub(region, source + "\n").rstrip("\n")


def _asserted(source: str) -> str:
    return f"verdict = {source}\nassert verdict, verdict"


def _write(path: Path, notebook: NotebookNode) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    nbformat.write(notebook, path)
    return path
