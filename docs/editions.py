"""Derive the editions of a lesson from its source, notebooks/lessons/source/NN_name.md.

    python docs/editions.py derive [NN ...]     write and execute the committed editions
    python docs/editions.py check               list the editions that differ from their source
    python docs/editions.py slides [NN ...]     build/slides/NN_name.html, needs no network
    python docs/editions.py nbgrader [NN ...]   build/nbgrader/source/NN_name/NN_name.ipynb
    python docs/editions.py otter [NN ...]      build/otter/NN_name.ipynb, for `otter assign`
    python docs/editions.py handout             build/handout.zip, for students

A source is a MyST notebook: Markdown with code cells. The students' edition leaves out the
solutions; the edition with solutions contains only the title, the setup and the solved exercises.
"""

from __future__ import annotations

import argparse
import re
import shutil
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

import nbformat
from myst_nb.core.read import read_myst_markdown_notebook
from nbformat import NotebookNode
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook

import notebooks
from shipnet.__main__ import main as command

ROOT = Path(__file__).resolve().parent.parent
LESSONS = Path("notebooks/lessons")
#: A stub line, and the region that contains the solution, as nbgrader marks it.
SOLUTION = re.compile(
    r"^(?P<stub>[^\n]*\n)[ ]*### BEGIN SOLUTION\n(?P<body>.*?)"
    r"[ ]*### END SOLUTION$\n?",
    re.DOTALL | re.MULTILINE,
)
EXERCISE = re.compile(r"ex-\d\d-\d+")
#: Where a Markdown cell begins anew: at headings of level 2 or 3, and at the questions.
PART = re.compile(r"^(?=###? |\*\*Questions\*\*)", re.MULTILINE)

#: Pace of a class that reads in a second language, including figures and discussion: words and
#: lines of code per minute; minutes per prediction, per function to write in class, and per
#: exercise with its text. These values are close to estimates by reviewers of the lessons; no
#: class was timed.
WORDS, LINES, PREDICTION, FUNCTION, TASK = 50, 10, 1, 5, 6
#: The parts that are homework, and those whose duration is not counted.
HOME, QUESTIONS, UNREAD = "At home", "**Questions**", ("Words", "References")
HEADING = re.compile("^## (.+)$", re.MULTILINE)
#: Placeholder for the duration in the source of a lesson.
TIME = "{time}"


def sources(root: Path = ROOT, numbers: list[str] | None = None) -> list[Path]:
    """Return the sources of the lessons with these numbers, or of all lessons."""
    found = sorted((root / LESSONS / "source").glob("[0-9][0-9]_*.md"))
    return [path for path in found if not numbers or path.name[:2] in numbers]


def tags(cell: NotebookNode) -> set[str]:
    return set(cell.metadata.get("tags", []))


def keys(cell: NotebookNode) -> list[str]:
    """Return the keys of the exercises that a cell belongs to."""
    return sorted(filter(EXERCISE.fullmatch, tags(cell)))


def read(path: Path) -> NotebookNode:
    """Read a source, with solutions and stubs."""
    notebook = read_myst_markdown_notebook(path.read_text("utf-8"))
    for number, cell in enumerate(notebook.cells, start=1):
        marked = "### BEGIN SOLUTION" in cell.source
        if marked and not SOLUTION.search(cell.source + "\n"):
            raise ValueError(f"{path.name}, cell {number}: no stub line above the solution")
        if marked != ("exercise" in tags(cell) and cell.cell_type == "code"):
            raise ValueError(
                f"{path.name}, cell {number}: a solution and an `exercise` tag must go together"
            )
    parts = measure(notebook)
    in_class, home = minutes_of(parts)
    for cell in notebook.cells:
        if cell.cell_type == "markdown":
            text = cell.source.replace(TIME, f"{in_class} minutes in class, {home} at home")
            cell.source = HEADING.sub(lambda found: _timed(found[0], parts[found[1]]), text)
    notebook.cells = list(_split(notebook.cells))
    return notebook


def _split(cells: list[NotebookNode]) -> Iterator[NotebookNode]:
    """Yield the cells, beginning a new one at each heading."""
    for cell in cells:
        if cell.cell_type == "markdown":
            for text in filter(str.strip, PART.split(cell.source)):
                yield nbformat.from_dict({**cell, "source": text.rstrip("\n")})
        else:
            yield cell


def stub(source: str) -> str:
    """Return an exercise cell as students get it."""
    return SOLUTION.sub(lambda found: found["stub"], source + "\n").rstrip("\n")


def solved(source: str) -> str:
    """Return an exercise cell with its solution."""
    return SOLUTION.sub(lambda found: found["body"], source + "\n").rstrip("\n")


def student_edition(lesson: NotebookNode) -> NotebookNode:
    """Return the lesson without solutions."""
    kept = (cell for cell in lesson.cells if "solution" not in tags(cell))
    return notebook_of(copy_of(cell, stub(cell.source)) for cell in kept)


@dataclass
class Part:
    """A part of a lesson: how much there is to read and to do."""

    words: int = 0
    lines: int = 0
    tasks: int = 0
    homework: int = 0
    predictions: int = 0
    functions: int = 0

    @property
    def minutes(self) -> float:
        """Duration [min], without the exercises that are marked as homework."""
        if self.tasks:
            return self.tasks * TASK
        reading = self.words / WORDS + self.lines / LINES
        return reading + self.predictions * PREDICTION + self.functions * FUNCTION


def measure(lesson: NotebookNode) -> dict[str, Part]:
    """Return what students read and do under each heading, or under "" before the first one."""
    parts = {"": Part()}
    for cell in lesson.cells:
        for line in stub(cell.source).splitlines() if "solution" not in tags(cell) else ():
            if cell.cell_type == "markdown" and line.startswith("## "):
                parts[line.removeprefix("## ")] = Part()
            if line == QUESTIONS:
                parts[QUESTIONS] = Part()
            part = parts[next(reversed(parts))]
            if cell.cell_type == "code":
                part.lines += bool(line.strip())
                continue
            part.words += sum(any(map(str.isalnum, word)) for word in line.split())
            part.predictions += line.count("**Predict") + line.count("**Try it")
            part.functions += line.count("**Write it")
            if re.match(r"\*\*\d", line):
                part.homework += "at home" in line
                part.tasks += "at home" not in line
    return parts


def minutes_of(parts: dict[str, Part]) -> tuple[int, int]:
    """Return the minutes that a lesson takes in class and at home, rounded to multiples of 5."""
    home = TASK * sum(part.homework for part in parts.values())
    home += sum(part.minutes for name, part in parts.items() if name in (HOME, QUESTIONS))
    away = (HOME, QUESTIONS, *UNREAD)
    in_class = sum(part.minutes for name, part in parts.items() if name not in away)
    return 5 * round(in_class / 5), 5 * round(home / 5)


def _timed(heading: str, part: Part) -> str:
    minutes = round(part.minutes)
    if heading.removeprefix("## ") in UNREAD or not minutes:
        return heading
    return f"{heading}\n\n*{minutes} minute{'s' if minutes > 1 else ''}.*"


def table(root: Path) -> str:
    """Return the table of the length and duration of each lesson, for the README of the lessons."""
    columns = ("words in class", "words at home", "lines of code", "minutes in class")
    rows = [f"| lesson | {' | '.join(columns)} | minutes at home |", "|---" * 6 + "|"]
    for source in sources(root):
        parts = measure(read_myst_markdown_notebook(source.read_text("utf-8")))
        home = sum(parts[name].words for name in (HOME, QUESTIONS) if name in parts)
        words, lines = sum(p.words for p in parts.values()), sum(p.lines for p in parts.values())
        minutes = " | ".join(map(str, minutes_of(parts)))
        rows.append(f"| {source.stem[:2]} | {words - home} | {home} | {lines} | {minutes} |")
    return "\n".join(rows)


def readme(root: Path) -> str:
    """Return the README of the lessons with an up-to-date table."""
    text = (root / LESSONS / "README.md").read_text("utf-8")
    return re.sub(
        r"^\| lesson \| words .*?\n(?!\|)", lambda _: table(root) + "\n", text, flags=re.M | re.S
    )


def solutions_edition(lesson: NotebookNode) -> NotebookNode:
    """Return the title, the cells tagged `setup`, and the section with the solved exercises."""
    title = lesson.cells[0].source.partition("\n")[0].removeprefix("# ")
    about = f"# Solutions: {title}\n\nFor the teacher: the solved exercises of the lesson."

    def cells() -> Iterator[NotebookNode]:
        yield new_markdown_cell(about)
        inside = False
        for cell in lesson.cells:
            if cell.cell_type == "markdown" and cell.source.startswith("## "):
                inside = cell.source.startswith("## Exercises")
            if inside or "setup" in tags(cell):
                # The solutions are one folder deeper, so relative links need another `../`.
                text = re.sub(r"\]\((?!#|\w+:)", "](../", cell.source)
                yield copy_of(cell, text if cell.cell_type == "markdown" else solved(cell.source))

    return notebook_of(cells())


def copy_of(cell: NotebookNode, source: str) -> NotebookNode:
    new = new_code_cell if cell.cell_type == "code" else new_markdown_cell
    marks = cell.metadata.get("tags", [])
    return new(source, metadata={"tags": marks} if marks else {})


def notebook_of(cells: Iterator[NotebookNode]) -> NotebookNode:
    """Return a notebook whose cell ids are digests of the cells, so that diffs stay small."""
    notebook = new_notebook(cells=list(cells), metadata=nbformat.from_dict(notebooks.METADATA))
    seen: dict[str, int] = {}
    for cell in notebook.cells:
        name = sha256(f"{cell.cell_type}\n{cell.source}".encode()).hexdigest()[:10]
        seen[name] = seen.get(name, 0) + 1
        cell.id = name if seen[name] == 1 else f"{name}-{seen[name]}"
    return notebook


def editions(root: Path, source: Path) -> dict[Path, NotebookNode]:
    """Return path -> notebook for the committed editions of a lesson, without outputs."""
    lesson, name = read(source), f"{source.stem}.ipynb"
    folder = root / LESSONS
    return {
        folder / name: student_edition(lesson),
        folder / "solutions" / name: solutions_edition(lesson),
    }


def same(one: NotebookNode, other: NotebookNode) -> bool:
    """Return whether two notebooks have the same cells, whatever their outputs."""

    def parts(notebook: NotebookNode) -> list[tuple[str, str, str, frozenset[str]]]:
        return [(c.id, c.cell_type, c.source, frozenset(tags(c))) for c in notebook.cells]

    return parts(one) == parts(other)


def executed(notebook: NotebookNode) -> bool:
    """Return whether every code cell was executed, except those tagged `widget`."""
    return all(
        cell.execution_count or "widget" in tags(cell)
        for cell in notebook.cells
        if cell.cell_type == "code"
    )


def stale(root: Path, numbers: list[str] | None = None) -> dict[Path, NotebookNode]:
    """Return path -> notebook for each committed edition that differs from its source."""
    return {
        path: notebook
        for source in sources(root, numbers)
        for path, notebook in editions(root, source).items()
        if not (path.is_file() and same(nbformat.read(path, as_version=4), notebook))
    }


def orphans(root: Path) -> list[Path]:
    """Return the notebooks of lessons and of solutions that have no source."""
    known = {source.stem for source in sources(root)}
    folder = root / LESSONS
    found = [*folder.glob("[0-9][0-9]_*.ipynb"), *folder.glob("solutions/*.ipynb")]
    return sorted(path for path in found if path.stem not in known)


def derive(root: Path, numbers: list[str] | None = None) -> int:
    """Write and execute the changed editions; return the number of notebooks that failed."""
    todo = stale(root, numbers)
    for source in sources(root, numbers):
        for path in editions(root, source):
            if path not in todo and not executed(stored := nbformat.read(path, as_version=4)):
                todo[path] = stored
    for path, notebook in todo.items():
        path.parent.mkdir(parents=True, exist_ok=True)
        nbformat.write(notebook, path)
    failed = 0
    for done in notebooks.execute_all(root, list(todo)):
        failed += bool(done.failure)
        if not done.failure:
            done.path.write_text(done.text, encoding="utf-8", newline="\n")
    if (page := root / LESSONS / "README.md").is_file():
        page.write_text(readme(root), encoding="utf-8", newline="\n")
    return failed


def unspoiled(notebook: NotebookNode) -> NotebookNode:
    """Remove the outputs between a question that students answer first and the next heading."""
    asked = False
    for cell in notebook.cells:
        if cell.cell_type == "markdown":
            questions = re.search(r"\*\*(Predict|Try it|Write it)", cell.source)
            asked = bool(questions) or (asked and not PART.search(cell.source))
        elif cell.cell_type == "code" and asked:
            cell.outputs, cell.execution_count = [], None
    return notebook


def handout(root: Path) -> Path:
    """Write the ZIP file for students: notebooks without solutions and spoilers, and the data."""
    folder = root / "build" / "handout"
    shutil.rmtree(folder, ignore_errors=True)
    command(["copy", str(folder / "shipnet")])
    for path in folder.rglob("*.ipynb"):
        nbformat.write(unspoiled(nbformat.read(path, as_version=4)), path)
    return Path(shutil.make_archive(str(folder), "zip", folder))


def main(argv: list[str] | None = None, root: Path = ROOT) -> int:
    """Run the command line and return the exit code."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    commands = ["derive", "check", "slides", "nbgrader", "otter", "handout"]
    parser.add_argument("command", choices=commands)
    parser.add_argument("numbers", nargs="*", metavar="NN", help="numbers of lessons; default: all")
    given = parser.parse_args(argv)
    if given.command == "derive":
        return 1 if derive(root, given.numbers) else 0
    if given.command == "check":
        wrong = [*stale(root, given.numbers), *orphans(root)]
        page = root / LESSONS / "README.md"
        wrong += [page] if page.is_file() and page.read_text("utf-8") != readme(root) else []
        for path in wrong:
            print(f"not derived: {path.relative_to(root).as_posix()}")
        return 1 if wrong else 0
    if given.command == "handout":
        print(handout(root).relative_to(root).as_posix())
        return 0
    write: Callable[[Path, Path], Path]
    if given.command == "slides":
        from slides import write
    elif given.command == "nbgrader":
        from graders import write_nbgrader as write
    else:
        from graders import write_otter as write
    for source in sources(root, given.numbers):
        print(write(root, source).relative_to(root).as_posix())
    return 0


if __name__ == "__main__":
    sys.exit(main())
