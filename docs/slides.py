"""Write the slides of a lesson as one self-contained file that needs no network.

A heading of level 2 begins a column of slides; other text and the questions begin slides below it.
The result of a prediction is on the next slide, and each exercise has its own slide. Figures, the
glossary and the output of more than eight lines of code are shown without the code; widgets and
listings that are taller than a screen are left out. The speaker view (key S) shows the minutes of
each slide and the solutions. In the browser, slides_template/fit.js fits figures to the remaining
space and splits slides that are too tall.
"""

from __future__ import annotations

import html
import re
from pathlib import Path
from typing import Any

import editions
import nbformat
from docutils.utils.math.latex2mathml import tex2mathml
from jinja2 import pass_context
from nbconvert.exporters import SlidesExporter
from nbformat import NotebookNode
from nbformat.v4 import new_markdown_cell, new_notebook

TEMPLATE = Path(__file__).parent / "slides_template"
REVEAL = TEMPLATE / "vendor" / "reveal-5.2.1"
#: Tags of cells that are not shown to a class.
HIDDEN = {"setup", "widget", "exercise", "check"}
#: Largest number of lines of code that a class can read on a slide.
MOST_LINES = 8
#: Largest number of lines of a listing that fits on a slide.
TALLEST = 30
#: The line with the minutes of a section, shown in the speaker view but not on the slide.
MINUTES = re.compile(r"^\*\d+ minutes?\.\*\n*", re.MULTILINE)
#: Formulas in rendered Markdown, except in code.
FORMULA = re.compile(r"(<code>.*?</code>|<pre.*?</pre>)|\$\$(.+?)\$\$|\$(.+?)\$", re.DOTALL)


class Slides(SlidesExporter):
    """nbconvert's slides with formulas as MathML."""

    @pass_context
    def markdown2html(self, context: Any, source: str) -> str:
        return FORMULA.sub(_formula, super().markdown2html(context, source))


def _formula(found: re.Match[str]) -> str:
    if found[1]:
        return found[1]
    latex = html.unescape(found[2] or found[3]).strip()
    return tex2mathml(latex, as_block=bool(found[2]))


def untimed(notebook: NotebookNode) -> None:
    """Remove the minutes of the sections."""
    for cell in notebook.cells:
        if cell.cell_type == "markdown":
            cell.source = MINUTES.sub("", cell.source)


def mark(notebook: NotebookNode) -> None:
    """Set the slide type of every cell."""
    asked = False
    for cell in notebook.cells:
        shows = any("image/png" in output.get("data", {}) for output in cell.get("outputs", []))
        kind = "-"
        if cell.cell_type == "markdown":
            asked = "Predict" in cell.source
            if cell.source.startswith(("# ", "## ")):
                kind = "slide"
            # A figure's caption and the text on what to notice stay on its slide if there is room.
            elif not re.match(r"\*[^*]|\*\*What to notice", cell.source):
                kind = "subslide"
        elif (
            HIDDEN & editions.tags(cell)
            or (re.match(r"(import|from) ", cell.source) and not cell.get("outputs"))
            or (cell.source.startswith("Code(") and _lines(cell) > TALLEST)
        ):
            kind = "skip"
        else:
            # The class predicts before it sees the result.
            kind = "subslide" if asked else "-"
            asked = False
            long = len(cell.source.splitlines()) > MOST_LINES
            if shows or long or cell.source.startswith("glossary("):
                cell.metadata["transient"] = {"remove_source": True}
        cell.metadata["slideshow"] = {"slide_type": kind}


def _lines(cell: NotebookNode) -> int:
    """Return the number of lines of a cell's outputs as text."""
    texts = [output.get("data", {}).get("text/plain", "") for output in cell.outputs]
    return "\n".join(texts).count("\n") + 1


def solutions(lesson: NotebookNode) -> dict[str, str]:
    """Return the solution of each exercise and its explanation, for the lecturer."""
    found: dict[str, str] = {}
    for cell in lesson.cells:
        if cell.cell_type == "code" and "exercise" in editions.tags(cell):
            found[editions.keys(cell)[0]] = f"```python\n{editions.solved(cell.source)}\n```"
        elif "solution" in editions.tags(cell) and found:
            found[next(reversed(found))] += f"\n\n{cell.source}"
    return found


def add_notes(notebook: NotebookNode, lesson: NotebookNode) -> None:
    """Append to each slide the speaker's notes: its minutes, and the solution of its exercise."""
    answers = solutions(lesson)
    groups: list[list[NotebookNode]] = []
    for cell in notebook.cells:
        if cell.metadata["slideshow"]["slide_type"] in ("slide", "subslide") or not groups:
            groups.append([])
        groups[-1].append(cell)
    begin, heading = 0.0, ""
    for group in groups:
        parts = editions.measure(new_notebook(cells=group))
        heading = next(reversed(parts)) or heading
        if heading in (editions.HOME, editions.QUESTIONS) or any(
            p.homework for p in parts.values()
        ):
            notes = ["At home."]
        elif heading in editions.UNREAD:
            notes = ["For reference; not read in class."]
        else:
            end = begin + sum(part.minutes for part in parts.values())
            notes = [f"Minutes {begin:.0f} to {end:.0f}."]
            begin = end
        if any("**Predict" in cell.source for cell in group):
            notes.append("Let the class predict before you show the next slide.")
        asked = [cell for cell in group if "exercise" in editions.tags(cell)]
        notes += [answers[key] for cell in asked for key in editions.keys(cell)]
        marks = {"slideshow": {"slide_type": "notes"}}
        group.append(new_markdown_cell("\n\n".join(notes), metadata=marks))
    notebook.cells = [cell for group in groups for cell in group]


def write(root: Path, source: Path) -> Path:
    """Write the slides of a lesson from its students' edition, which contains the outputs."""
    notebook = nbformat.read(root / editions.LESSONS / f"{source.stem}.ipynb", as_version=4)
    untimed(notebook)
    mark(notebook)
    add_notes(notebook, editions.read(source))
    notebook.metadata["title"] = notebook.cells[0].source.partition("\n")[0].removeprefix("# ")
    exporter = Slides(
        template_name="shipnet",
        extra_template_basedirs=[str(TEMPLATE)],
        exclude_input_prompt=True,
        exclude_output_prompt=True,
        exclude_anchor_links=True,
    )
    scripts = [(REVEAL / name).read_text("utf-8") for name in ("reveal.js", "notes.js")]
    script = "\n".join(text.partition("//# sourceMappingURL")[0] for text in scripts)
    resources = {
        "reveal_js": script.replace("</script", r"<\/script"),
        "fit_js": (TEMPLATE / "fit.js").read_text("utf-8"),
        "reveal_css": (REVEAL / "reveal.css").read_text("utf-8"),
        "slides_css": (TEMPLATE / "slides.css").read_text("utf-8"),
    }
    page, _ = exporter.from_notebook_node(notebook, resources)
    path = root / "build" / "slides" / f"{source.stem}.html"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(page, encoding="utf-8", newline="\n")
    return path
