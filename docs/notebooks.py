"""Execute the notebooks: copies for the book, or the stored notebooks themselves.

    python docs/notebooks.py run                       execute the stale copies in build/notebooks
    python docs/notebooks.py store [--accept] [paths]  show what would change, or store it
    python docs/notebooks.py affected FILES            list the notebooks that these files affect

A copy is stale if its notebook, the package, the data or the lock file has changed. Executing a
notebook twice stores the same bytes, so every difference is a changed result.
"""

from __future__ import annotations

import argparse
import ast
import difflib
import hashlib
import os
import re
import shutil
import sys
import time
from base64 import b64decode, b64encode
from collections.abc import Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from functools import cache, partial
from io import BytesIO
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import kernels
import nbformat
from nbclient import NotebookClient
from nbclient.exceptions import CellExecutionError
from nbformat import NotebookNode
from PIL import Image

ROOT = Path(__file__).resolve().parent.parent
INPUTS = ("shipnet", "data", "requirements.lock")
INPUTS += ("docs/kernels.py", "docs/narrow.py", "docs/notebooks.py")
#: What a kernel runs first to show narrow forms of figures too; it leaves the notebook no name.
NARROW = f"__import__('runpy').run_path({str(ROOT / 'docs' / 'narrow.py')!r})"
DERIVED = {"__pycache__", ".ipynb_checkpoints"}
METADATA = {
    "kernelspec": {"name": "python3", "display_name": "Python 3", "language": "python"},
    "language_info": {"name": "python"},
}
#: A figure in the HTML form of an object; tests/nbval_sanitize.cfg has the same pattern.
FIGURE = re.compile(r"<figure[^>]*><img [^>]*></figure>")
NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")


@dataclass(frozen=True)
class Executed:
    """Result of executing one notebook: its new text, or why it failed."""

    path: Path
    seconds: float
    text: str = ""
    failure: str = ""


def find(root: Path) -> list[Path]:
    """Return the paths of all notebooks, sorted."""
    found = (root / "notebooks").rglob("*.ipynb")
    return sorted(path for path in found if not DERIVED & set(path.parts))


def fingerprint(root: Path, inputs: Iterable[str | Path]) -> str:
    """Return a digest of the names, sizes and times of the files in `inputs` (files or folders)."""
    files: set[Path] = set()
    for path in (root / name for name in inputs):
        files.update(path.rglob("*") if path.is_dir() else [path])
    digest = hashlib.sha256()
    for file in sorted(files):
        if file.is_file() and not DERIVED & set(file.parts):
            about = file.stat()
            name = file.relative_to(root).as_posix()
            digest.update(f"{name}\0{about.st_size}\0{about.st_mtime_ns}\n".encode())
    return digest.hexdigest()


def stable(notebook: NotebookNode) -> str:
    """Return the notebook as text without anything that differs from one execution to the next."""
    notebook.metadata = nbformat.from_dict(METADATA)
    for cell in notebook.cells:
        cell.metadata = {key: value for key, value in cell.metadata.items() if key == "tags"}
        if cell.cell_type != "code":
            continue
        if "widget" in cell.metadata.get("tags", []):
            cell.outputs, cell.execution_count = [], None
        merged: list[NotebookNode] = []
        for output in cell.outputs:
            # The kernel flushes its streams at arbitrary times, so where one output ends is random.
            if merged and _stream(output) and _stream(output) == _stream(merged[-1]):
                merged[-1].text += output.text
            else:
                merged.append(output)
            if picture := output.get("data", {}).get("image/png"):
                output.data["image/png"] = small(picture)
        cell.outputs = merged
    return nbformat.writes(notebook).rstrip("\n") + "\n"


def small(picture: str) -> str:
    """Reduce a base64 PNG file to 256 colours, so that it looks the same at a third of the size."""
    image = Image.open(BytesIO(b64decode(picture))).convert("RGB")
    file = BytesIO()
    for method in (Image.Quantize.FASTOCTREE, Image.Quantize.MAXCOVERAGE):
        colours = image.quantize(method=method, dither=Image.Dither.NONE)
        # The first method makes smaller files, but can map white and pale areas to one colour.
        if min(colours.convert("RGB").getpixel((0, 0))) >= 254:
            break
    colours.save(file, "png", optimize=True)
    return b64encode(file.getvalue()).decode()


def _stream(output: NotebookNode) -> str | None:
    return output.get("name") if output.output_type == "stream" else None


def execute(path: Path, tries: int = 3, *, narrow: bool = False) -> Executed:
    """Execute one notebook in memory, in its own folder; with narrow forms of figures if wanted."""
    begin = time.perf_counter()
    started: list[tuple[int, NotebookNode]] = []
    try:
        notebook = nbformat.read(path, as_version=4)
        client = NotebookClient(
            notebook,
            timeout=120,
            startup_timeout=120,  # a busy machine starts a kernel slowly
            kernel_name="python3",
            record_timing=False,
            resources={"metadata": {"path": str(path.parent)}},
            # Otherwise every kernel warns that TCP is not encrypted, even on the loopback.
            extra_arguments=["--log-level=ERROR", *[f"--IPKernelApp.exec_lines={NARROW}"] * narrow],
            on_cell_execute=lambda cell, cell_index: started.append((cell_index, cell)),
        )
        # If another backend is set, no figure reaches the notebook; a progress bar must not.
        env = {k: v for k, v in os.environ.items() if k != "MPLBACKEND"}
        client.execute(env=env | {"TQDM_DISABLE": "1"})
    except Exception as error:  # any error is reported for this notebook; the others are still run
        # A port that was free when the client chose it can be in use when the kernel opens it.
        if isinstance(error, RuntimeError) and not started and tries > 1:
            return execute(path, tries - 1, narrow=narrow)
        lines = []
        if started:
            index, cell = started[-1]
            source = cell.source.strip().splitlines()[0]
            lines.append(f"cell {index + 1}, In [{len(started)}]: {source}")
        if isinstance(error, CellExecutionError):
            lines += f"{error.ename}: {error.evalue}".splitlines()
        else:
            lines += f"{type(error).__name__}: {error}".splitlines()
        return Executed(path, time.perf_counter() - begin, failure="\n".join(lines))
    return Executed(path, time.perf_counter() - begin, text=stable(notebook))


def execute_all(root: Path, paths: list[Path], *, narrow: bool = False) -> Iterator[Executed]:
    """Execute notebooks on all cores, and print a line as each one finishes."""
    for count, done in enumerate(_executed(paths, narrow), start=1):
        name = done.path.relative_to(root).as_posix()
        place = f"[{count:{len(str(len(paths)))}}/{len(paths)}]"
        print(f"{place} {done.seconds:5.1f} s  {name}", flush=True)
        if done.failure:
            block = done.failure.replace("\n", "\n    ")
            print(f"FAILED {name}\n    {block}", flush=True)
        yield done


def _executed(paths: list[Path], narrow: bool) -> Iterator[Executed]:
    job = partial(execute, narrow=narrow)
    if len(paths) < 2:
        yield from map(job, paths)
        return
    # Spawned workers behave alike on every platform; forked ones would copy pytest's threads.
    workers = min(len(paths), os.cpu_count() or 1)
    spawn = get_context("spawn")
    with ProcessPoolExecutor(workers, spawn, initializer=kernels.fork) as pool:
        jobs = [pool.submit(job, path) for path in paths]
        yield from (job.result() for job in as_completed(jobs))


def run(root: Path, *, stored: bool = False) -> int:
    """Bring build/notebooks up to date; return the number of notebooks that failed.

    Each figure that is legible on a phone in a narrow form is preceded by that form.

    If `stored`, no notebook is executed: the copies have the stored outputs, which the tests check.
    """
    copies = root / "build" / "notebooks"
    marks: dict[Path, str] = {}
    kept: set[Path] = set()
    for path in find(root):
        copy = copies / path.relative_to(root / "notebooks")
        mark = copy.with_suffix(".sha256")
        kept |= {copy, mark}
        now = fingerprint(root, [*INPUTS, path.relative_to(root)])
        if copy.is_file() and mark.is_file() and mark.read_text() == now:
            continue
        if stored:
            # Without a mark, the next run executes the notebook.
            mark.unlink(missing_ok=True)
            copy.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(path, copy)
        else:
            marks[path] = now
    for file in copies.rglob("*"):
        if file.is_file() and file not in kept:
            file.unlink()
    print(f"notebooks: {len(kept) // 2}, to execute: {len(marks)}", flush=True)
    failed = 0
    for done in execute_all(root, list(marks), narrow=True):
        copy = copies / done.path.relative_to(root / "notebooks")
        mark = copy.with_suffix(".sha256")
        mark.unlink(missing_ok=True)
        if done.failure:
            failed += 1
            continue
        copy.parent.mkdir(parents=True, exist_ok=True)
        copy.write_text(done.text, encoding="utf-8", newline="\n")
        mark.write_text(marks[done.path])
    return failed


def store(root: Path, paths: list[Path], *, accept: bool) -> int:
    """Execute notebooks and print the changes; if `accept`, store them. Return the exit code.

    The small figures within HTML are not stored: the tests compare HTML, but not pictures.
    """
    code = 0
    for done in sorted(execute_all(root, paths or find(root)), key=lambda done: done.path):
        name = done.path.relative_to(root).as_posix()
        if done.failure:
            code = 1
            continue
        text = FIGURE.sub("<figure></figure>", done.text)
        new = nbformat.reads(text, as_version=4)
        if noisy := _cells_with_stderr(new):
            # A warning names a temporary file, so its text differs each time.
            print("\n".join(f"{name} cell {n}: writes to stderr: not stored" for n in noisy))
            code = 1
            continue
        before = done.path.read_bytes()
        after = text.encode()
        if before == after:
            continue
        found = list(changes(nbformat.reads(before.decode(), as_version=4), new))
        for number, change in found:
            print(f"{name} cell {number}: {change}")
        if not found:
            print(f"{name}: only its metadata, cell numbers or layout change")
        if accept:
            done.path.write_bytes(after)
        else:
            code = 1
    return code


def _cells_with_stderr(notebook: NotebookNode) -> list[int]:
    return [
        number
        for number, cell in enumerate(notebook.cells, start=1)
        if any(_stream(output) == "stderr" for output in cell.get("outputs", []))
    ]


def changes(old: NotebookNode, new: NotebookNode) -> Iterator[tuple[int, str]]:
    """Yield (cell number, what changed) for the outputs of two versions of a notebook."""
    for number, (before, after) in enumerate(zip(old.cells, new.cells, strict=True), start=1):
        was, now = before.get("outputs", []), after.get("outputs", [])
        if now and not was:
            yield number, "new output"
            continue
        (was_text, was_images, was_rest), (now_text, now_images, now_rest) = map(_parts, (was, now))
        if was_text != now_text:
            yield from ((number, change) for change in _text_changes(was_text, now_text))
        if was_images != now_images:
            yield number, "figure changed"
        if was_text == now_text and was_rest != now_rest:
            yield number, "its rich form (HTML, LaTeX, ...) changed"


def _parts(outputs: list[NotebookNode]) -> tuple[str, list[str], list[str]]:
    """Split outputs into plain text, images and the rest."""
    text, images, rest = "", [], []
    for output in outputs:
        text += output.get("text", "") + "\n".join(output.get("traceback", []))
        for kind, content in sorted(output.get("data", {}).items()):
            if kind == "text/plain":
                text += content + "\n"
            else:
                (images if kind.startswith("image/") else rest).append(str(content))
    return text, images, rest


def _text_changes(old: str, new: str) -> list[str]:
    # A number with one more digit can also change the spacing, so compare the words.
    if NUMBER.sub("#", old).split() == NUMBER.sub("#", new).split():
        pairs = zip(NUMBER.findall(old), NUMBER.findall(new), strict=True)
        moved = [f"{was} -> {now}" for was, now in pairs if was != now]
        return moved or ["spacing changed"]
    diff = list(difflib.unified_diff(old.splitlines(), new.splitlines(), n=0, lineterm=""))[2:]
    return ["output changed\n" + "\n".join(f"    {line}" for line in diff[:20])]


def affected(root: Path, files: Iterable[str]) -> list[Path]:
    """Return the notebooks that these files can affect, judged by imports and data file names."""
    named = [Path(file) for file in files]
    modules = {_module(file) for file in named if file.parts[0] == "shipnet"}
    # Code gives a data file's full name, or only the part that follows the paper's key.
    data = [file.name for file in named if file.parts[0] == "data"]
    data += [f"_{rest}" for name in data if (rest := name.partition("_")[2])]
    graph = _graph()
    for module in graph.modules if data else ():
        source = root.joinpath(*module.split("."))
        source = source / "__init__.py" if source.is_dir() else source.with_suffix(".py")
        text = source.read_text(encoding="utf-8")
        if any(name in text and name in _strings(text) for name in data):
            modules.add(module)
    below = set(modules)
    for module in graph.modules:
        if _within(module, modules):
            below |= {module, *graph.find_downstream_modules(module)}
    found = []
    for path, (text, used) in _needs(root).items():
        by_import = any(_within(one, used) for one in below)
        if path.relative_to(root) in named or by_import or any(name in text for name in data):
            found.append(path)
    return found


@cache
def _graph() -> Any:
    """Return the import graph of the package."""
    import grimp  # only one command needs it

    return grimp.build_graph("shipnet", cache_dir=None)


@cache
def _needs(root: Path) -> dict[Path, tuple[str, set[str]]]:
    """Return the text of each notebook and the modules it uses, including those loaded by name.

    The modules loaded by name judge the claims of a paper or the exercises of a lesson.
    """
    needs = {}
    for path in find(root):
        text = path.read_text(encoding="utf-8")
        used = _used(root, nbformat.reads(text, as_version=4))
        if _within("shipnet.papers.judging", used) or "shipnet.papers" in used:
            folders = (root / "shipnet" / "papers").glob("*/")
            keys = [one.name for one in folders if one.name in text]
            used |= {f"shipnet.papers.{key}" for key in keys} or {"shipnet.papers"}
        if any(_within(one, {"shipnet.exercises"}) for one in used):
            used.add(f"shipnet.exercises.lesson_{path.name[:2]}")
        needs[path] = text, used
    return needs


def _strings(source: str) -> str:
    """Return the strings of a module, except multi-line strings, which are documentation."""
    nodes = (node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.Constant))
    texts = (node.value for node in nodes if isinstance(node.value, str))
    return "\n".join(text for text in texts if "\n" not in text)


def _module(file: Path) -> str:
    """Return the module of a Python file of the package; for other files, that of their folder."""
    parts = file.with_suffix("").parts if file.suffix == ".py" else file.parts[:-1]
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def _within(module: str, packages: Iterable[str]) -> bool:
    return any(module == one or module.startswith(f"{one}.") for one in packages)


def _used(root: Path, notebook: NotebookNode) -> set[str]:
    """Return the modules that define what a notebook uses, or the package if that is unclear."""
    cells = [cell.source for cell in notebook.cells if cell.cell_type == "code"]
    lines = "\n".join(cells).splitlines()
    tree = ast.parse("\n".join("" if line.lstrip()[:1] in "%!" else line for line in lines))
    names = {"shipnet": "shipnet"}
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "shipnet":
            names |= {one.asname or one.name: f"{node.module}.{one.name}" for one in node.names}
    reached = {full for name, full in names.items() if name != "shipnet"}
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and (full := _dotted(node, names)):
            reached.add(full)
    longest = {one for one in reached if not any(other.startswith(f"{one}.") for other in reached)}
    return {_defining(root, one) for one in longest}


def _dotted(node: ast.expr, names: dict[str, str]) -> str:
    """Return ``shipnet.asi.cycle_time`` for ``asi.cycle_time``, "" for other expressions."""
    if isinstance(node, ast.Name):
        return names.get(node.id, "")
    if isinstance(node, ast.Attribute) and (before := _dotted(node.value, names)):
        return f"{before}.{node.attr}"
    return ""


def _defining(root: Path, full: str) -> str:
    """Return the module that defines a public name, according to the stub of its package."""
    at = "shipnet"
    for name in full.split(".")[1:]:
        folder = root.joinpath(*at.split("."))
        stub = folder / "__init__.pyi"
        text = stub.read_text(encoding="utf-8") if stub.is_file() else ""
        if (folder / name).is_dir():
            at = f"{at}.{name}"
        elif found := re.search(rf"^from \.(\S+) import {name} as", text, re.MULTILINE):
            at = f"{at}.{found[1]}"
        elif (folder / f"{name}.py").is_file():
            at = f"{at}.{name}"
        else:
            break
    return at


def main(argv: list[str] | None = None, root: Path = ROOT) -> int:
    """Run the command line and return the exit code."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    commands = parser.add_subparsers(dest="command", required=True)
    commands.add_parser("run", help="execute the stale copies in build/notebooks")
    storing = commands.add_parser("store", help="show what would change in the stored outputs")
    storing.add_argument("--accept", action="store_true", help="store the changes")
    storing.add_argument("paths", nargs="*", type=Path, help="notebooks; default: all")
    asking = commands.add_parser("affected", help="list the notebooks affected by changed files")
    asking.add_argument("files", nargs="*", help="files of the repository, such as data/claims.csv")
    given = parser.parse_args(argv)
    if given.command == "run":
        return 1 if run(root) else 0
    if given.command == "affected":
        print("\n".join(path.relative_to(root).as_posix() for path in affected(root, given.files)))
        return 0
    return store(root, [path.resolve() for path in given.paths], accept=given.accept)


if __name__ == "__main__":
    sys.exit(main())
