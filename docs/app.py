"""Serve the tools in a folder of notebooks as web pages on this machine.

    python docs/app.py [folder] [options of Voila]

The index has a card for each notebook, with the title, first sentences and first figure of the
stored notebook. The pages load nothing from the network: the templates in docs/voila/ leave out
what Voila would fetch.

A page shows the figure of its card until the tool is ready. Worked examples appear with their
stored outputs; only the tool and cells without stored outputs are run. Voila keeps a kernel ready
for each tool (about 100 MB each); `--preheat_kernel=False` starts kernels on demand.
"""

from __future__ import annotations

import os
import re
import shutil
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from html import escape
from pathlib import Path

import nbformat

ROOT = Path(__file__).resolve().parent.parent
SOURCE = ROOT / "docs" / "voila"
STYLE = ROOT / "shipnet" / "tools" / "page.css"

# Option that says whether Voila runs each notebook before its page is requested.
PREHEAT = "--preheat_kernel"
# Turns off an extension for JupyterLab that raises an error here.
NOT_NEEDED = "--VoilaConfiguration.extension_denylist=@jupyter-notebook/lab-extension"
# Kernels whose pages are closed end after 120 s.
CULL = ("--MappingKernelManager.cull_idle_timeout=120", "--MappingKernelManager.cull_interval=30")
# On a busy machine, a kernel may take longer than Voila's 4 s to send its output.
PATIENT = ("--VoilaExecutor.iopub_timeout=60", "--VoilaExecutor.startup_timeout=120")


@dataclass(frozen=True)
class Card:
    """Entry of a tool in the index; `picture` is a PNG file in base64, or empty."""

    name: str
    title: str
    lead: str
    picture: str


def cards(folder: Path) -> list[Card]:
    """Return a card for each notebook of a folder, sorted by name."""
    return [card(path) for path in sorted(folder.glob("*.ipynb"))]


def card(path: Path) -> Card:
    """Return the card of a notebook whose first cell has its title and a short description."""
    notebook = nbformat.read(path, as_version=4)
    title, lead, *_ = [*notebook.cells[0].source.split("\n\n"), ""]
    picture = next(_pictures(notebook), "")
    return Card(path.stem, title.removeprefix("# "), lead, picture)


def _pictures(notebook: nbformat.NotebookNode) -> Iterator[str]:
    for cell in notebook.cells:
        for output in cell.get("outputs", []):
            if "image/png" in output.get("data", {}):
                yield output["data"]["image/png"].replace("\n", "")


def html(one: Card) -> str:
    """Return a card as HTML."""
    image = f'<img alt="" src="data:image/png;base64,{one.picture}">' if one.picture else ""
    return (
        f'<li><a href="{{{{ base_url }}}}voila/render/{one.name}.ipynb">{image}'
        f"<h2>{_plain(one.title)}</h2></a><p>{_plain(one.lead)}</p></li>\n"
    )


def _plain(text: str) -> str:
    """Return text escaped for HTML and Jinja, with the emphasis of Markdown."""
    return re.sub(r"\*(\S.*?)\*", r"<em>\1</em>", escape(text).replace("{", "&#123;"))


def build(folder: Path, target: Path) -> Path:
    """Write Voila's template for a folder of notebooks into `target`, a Jupyter data folder."""
    template = target / "voila" / "templates" / "shipnet"
    shutil.rmtree(template, ignore_errors=True)
    shutil.copytree(SOURCE, template)
    shutil.copy(STYLE, template / "page.css")
    found = "".join(map(html, cards(folder)))
    (template / "cards.html").write_text(found, encoding="utf-8")
    return template


def voila(folder: Path, data: Path, *options: str) -> tuple[list[str], dict[str, str]]:
    """Return the command that runs Voila with the template in `data`, and its environment."""
    found = os.environ.get("JUPYTER_PATH")
    environment = os.environ | {"JUPYTER_PATH": os.pathsep.join(filter(None, [str(data), found]))}
    fixed = ("--no-browser", "--theme=light", "--template=shipnet", NOT_NEEDED, *CULL, *PATIENT)
    if not any(option.startswith(PREHEAT) for option in options):
        # The delay [s] lets a page load and do its first updates before the next kernel starts.
        fixed += (f"{PREHEAT}=True", "--VoilaKernelManager.fill_delay=5")
    pool = str(ROOT / "docs" / "pool.py")
    return [sys.executable, pool, *fixed, *options, str(folder)], environment


def main(argv: list[str]) -> None:
    """Build the template and replace this process with Voila."""
    folder = ROOT / "notebooks" / "explore"
    if argv and not argv[0].startswith("-"):
        folder = Path(argv.pop(0)).resolve()
    data = ROOT / "build" / "app"
    build(folder, data)
    command, environment = voila(folder, data, *argv)
    os.execve(command[0], command, environment)


if __name__ == "__main__":
    main(sys.argv[1:])
