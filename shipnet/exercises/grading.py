"""Grading of notebooks that students handed in, for the command `shipnet grade`.

Each notebook is graded in a process of its own, the judge, so that a notebook that ends the judge
loses only its own grades. The judge starts another process for the student's cells, in which no
notebook can change the checks; it returns values of variables and results of functions. The cells
run in an empty folder and have no input; their time, memory and file size are limited. No read
waits longer than a time limit, whoever keeps a pipe open. These measures do not protect the
computer against an attack.
"""

from __future__ import annotations

import ast
import json
import os
import pickle
import re
import signal
import subprocess
import sys
from collections import defaultdict
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from hashlib import sha256
from io import StringIO
from pathlib import Path
from queue import SimpleQueue
from tempfile import TemporaryDirectory, TemporaryFile
from threading import Thread
from time import monotonic
from tokenize import COMMENT, generate_tokens
from typing import Any

import numpy as np

from shipnet.errors import ArgumentError, InputError
from shipnet.exercises.exercise import Exercise, check, exercises, student
from shipnet.lazy import pd

#: The name in a notebook before a student changes it.
EXAMPLE = "Kim"

#: Time limits for a cell, which is also that for all requests about one exercise, and for a
#: notebook [s].
LIMIT, WHOLE = 8.0, 300.0

#: Limits on memory, on each file that cells write, on a notebook and on an answer [byte].
MEMORY, FILE, NOTEBOOK, ANSWER = 4 << 30, 10 << 20, 16 << 20, 1 << 20

#: Maximum number of cells; maximum lengths of a name, a verdict and a shown path [characters].
CELLS, NAME, VERDICT, PATH = 500, 100, 1000, 200

#: Shortest solution whose copies are flagged [characters], not counting comments and spaces.
_LONG = 80


class _Ended(RuntimeError):
    """A student's process has ended; the message gives the reason."""


def _python(call: str, **streams: Any) -> subprocess.Popen[bytes]:
    """Start a process that calls a function of this module."""
    code = f"from shipnet.exercises import grading; grading.{call}"
    return subprocess.Popen([sys.executable, "-P", "-c", code], start_new_session=True, **streams)


class _Session:
    """The process that runs a student's cells; if a cell ends it, a new one runs the others."""

    def __init__(self, cells: list[str], limit: float, whole: float) -> None:
        #: By cell number: the error that the cell raised, or why the process ended in it.
        self.faults: dict[int, str] = {}
        self._cells, self._limit, self._whole = cells, limit, whole
        self._deadline = self._end = monotonic() + whole
        self._process: subprocess.Popen[bytes] | None = None

    def allow(self) -> None:
        """Allow the next requests the time of one exercise."""
        self._deadline = min(monotonic() + self._limit, self._end)

    def ask(self, *task: object) -> Any:
        """Return the result; raise RuntimeError if the task fails, _Ended if the process ends."""
        while self._process is None:
            self._start()
        return self._told(*task)

    def close(self) -> None:
        """End the process and those that it started, unless they left its process group."""
        if self._process is not None:
            if hasattr(os, "killpg"):
                with suppress(ProcessLookupError, PermissionError):
                    os.killpg(self._process.pid, signal.SIGKILL)
            self._process.kill()
            self._process.wait()
            self._process = None

    def _start(self) -> None:
        pipe, nothing = subprocess.PIPE, subprocess.DEVNULL
        self._process = _python("answer()", stdin=pipe, stdout=pipe, stderr=nothing)
        self._deadline = self._end
        self._told("run", "pass")  # wait until it is ready
        for number, cell in enumerate(self._cells):
            if self._process is not None:
                self.allow()
                try:
                    self._told("run", cell)
                except RuntimeError as error:  # the next cells run anyway
                    self.faults[number] = str(error)
                    if self._process is None:
                        self._cells[number] = "pass"
        self.allow()

    def _told(self, *task: object) -> Any:
        process, replies = self._process, SimpleQueue[bytes]()
        assert process and process.stdin and process.stdout
        questions, answers = process.stdin, process.stdout

        def exchange() -> None:
            line = b""
            with suppress(OSError):
                pickle.dump(task, questions)
                questions.flush()
                line = answers.readline(ANSWER)
            replies.put(line)

        # Only a thread can be left behind if another process keeps the pipes open.
        Thread(target=exchange, daemon=True).start()
        line = None
        try:
            line = replies.get(timeout=max(self._deadline - monotonic(), 0.01))
            reply = json.loads(line)
            value = _decoded(reply.get("value"), self)
        except Exception:  # the student's code can write to this pipe
            self.close()
            slow = self._whole if self._deadline == self._end else self._limit
            why = {None: f"it took over {slow:g} s", b"": "Python ended"}
            raise _Ended(f"stopped: {why.get(line, 'unexpected answer')}") from None
        if "error" in reply:
            raise RuntimeError(str(reply["error"]))
        return value


class _Remote:
    """A student's function, which runs in the student's process."""

    def __init__(self, session: _Session, expression: str, name: str) -> None:
        self.__name__, self._session, self._expression = name, session, expression
        self._ended: _Ended | None = None

    def __call__(self, *arguments: object) -> Any:
        if self._ended is not None:
            raise self._ended
        try:
            return self._session.ask("call", self._expression, arguments)
        except _Ended as why:
            self._ended = why
            raise
        except RuntimeError as error:
            if str(error).startswith("NotImplementedError"):
                raise NotImplementedError from None
            raise


def _decoded(value: Any, session: _Session) -> Any:
    """Return the value that `_encoded` encoded; an array becomes a list."""
    if isinstance(value, list):
        return [_decoded(part, session) for part in value]
    if not isinstance(value, dict):
        return value
    kind, inside = next(iter(value.items()))
    if kind == "dict":
        return {_decoded(key, session): _decoded(part, session) for key, part in inside}
    if kind == "tuple":
        return tuple(_decoded(part, session) for part in inside)
    if kind == "set":
        return {_decoded(part, session) for part in inside}
    if kind == "bytes":
        return bytes.fromhex(inside)
    if kind == "function":
        return _Remote(session, *inside)
    return ... if kind == "blank" else type(str(inside), (), {})()


def _encoded(value: Any, expression: str = "", depth: int = 0) -> Any:
    """Convert a value for JSON; a value without a JSON equivalent becomes a one-key dict."""
    if value is ...:
        return {"blank": 1}
    if isinstance(value, np.generic | np.ndarray):
        value = value.tolist()
    if hasattr(value, "to_dict") and hasattr(value, "columns"):
        value = value.to_dict("records")
    for kind in (bool, int, float, str):
        if value is None or type(value) is kind:
            return value
        if isinstance(value, kind):
            return kind(value)
    if depth < 5 and isinstance(value, list | tuple | set | frozenset):
        parts = [_encoded(part, "", depth + 1) for part in value]
        if isinstance(value, list):
            return parts
        return {"tuple" if isinstance(value, tuple) else "set": parts}
    if depth < 5 and isinstance(value, dict):
        pairs = value.items()
        return {"dict": [[_encoded(part, "", depth + 1) for part in pair] for pair in pairs]}
    if isinstance(value, bytes | bytearray):
        return {"bytes": value.hex()}
    if callable(value) and expression:
        return {"function": [expression, str(getattr(value, "__name__", expression))]}
    return {"other": type(value).__name__}


def answer() -> None:
    """Respond to the requests that a `_Session` writes to standard input, until the input ends."""
    questions, answers = (os.fdopen(os.dup(pipe), mode) for pipe, mode in ((0, "rb"), (1, "wb")))
    nothing = os.open(os.devnull, os.O_RDWR)
    for pipe in range(3):
        os.dup2(nothing, pipe)
    space: dict[str, Any] = {"__name__": "__main__"}
    while True:
        try:
            what, text, *arguments = pickle.load(questions)
        except EOFError:
            return
        try:
            value = None
            if what == "run":
                exec(text, space)
            else:
                result = eval(text, space)
                value = _encoded(result(*arguments[0]) if what == "call" else result, text)
            line = json.dumps({"value": value})
            if len(line) >= ANSWER:
                raise ValueError(f"the answer is longer than {ANSWER >> 20} MB")
        except BaseException as error:  # including SystemExit
            line = json.dumps({"error": f"{type(error).__name__}: {error}"[:300]})
        answers.write(line.encode() + b"\n")
        answers.flush()


def judge(limit: float, whole: float) -> None:
    """Grade the notebook that standard input contains, and print the result as JSON."""
    with suppress(ImportError):
        import resource

        for kind, most in (("AS", MEMORY), ("FSIZE", FILE), ("CPU", int(whole) + 1)):
            with suppress(OSError, ValueError):  # not every system has this limit
                resource.setrlimit(getattr(resource, f"RLIMIT_{kind}"), (most, most))
    one = _HandIn("")
    one.grade(sys.stdin.buffer.read(), limit, whole)
    print(json.dumps(vars(one)), flush=True)
    os._exit(0)  # do not wait for a student's process


def _parsed(cell: str) -> tuple[list[ast.AST], str]:
    """Return a cell's syntax nodes, and a digest of its code; both are empty if it cannot run.

    The digest does not depend on comments and spaces; it is also empty if the code is short.
    """
    try:
        nodes = list(ast.walk(ast.parse(cell)))
        tokens = generate_tokens(StringIO(cell).readline)
        words = [token.string for token in tokens if token.type != COMMENT]
    except Exception:  # such as a MemoryError if the code is nested too deeply
        return [], ""
    code = " ".join(" ".join(words).split())
    short = len(code.replace(" ", "")) < _LONG
    return nodes, "" if short else sha256(code.encode()).hexdigest()


def _plain(value: object) -> str:
    """Return a text that can be written as UTF-8: a lone surrogate becomes an escape sequence."""
    return str(value).encode("utf-8", "backslashreplace").decode()


@dataclass
class _HandIn:
    """A notebook that a student handed in, and its verdicts."""

    file: str
    name: str = ""
    verdicts: dict[str, str] = field(default_factory=dict)
    flags: list[str] = field(default_factory=list)
    #: By exercise: a digest of the cell that assigns the answer.
    digests: dict[str, str] = field(default_factory=dict)

    @contextmanager
    def flagging(self) -> Iterator[None]:
        """Turn any error into a flag of this notebook, so that the others are graded."""
        try:
            yield
        except Exception as error:
            self.flags.append(_plain(f"not graded: {str(error) or type(error).__name__}"[:300]))

    def run(self, notebook: bytes) -> None:
        """Grade the notebook in a process of its own."""
        with self.flagging():
            kept = ("PATH", "HOME", "LANG", "MPLCONFIGDIR", "SYSTEMROOT", "TEMP", "USERPROFILE")
            environment = {name: os.environ[name] for name in kept if name in os.environ}
            paths = (str(Path(__file__).parents[2]), os.environ.get("PYTHONPATH", ""))
            environment |= {"MPLBACKEND": "agg", "PYTHONPATH": os.pathsep.join(filter(None, paths))}
            with (
                TemporaryDirectory(ignore_cleanup_errors=True) as folder,
                TemporaryFile() as notebook_file,
                TemporaryFile() as report,  # no process can keep its end from being read
            ):
                notebook_file.write(notebook)
                notebook_file.seek(0)
                streams: dict[str, Any] = {"stdin": notebook_file, "stdout": report}
                streams |= {"stderr": report, "cwd": folder, "env": environment}
                process = _python(f"judge({LIMIT}, {WHOLE})", **streams)
                with suppress(subprocess.TimeoutExpired):
                    process.wait(1.2 * WHOLE)
                process.kill()
                process.wait()
                report.seek(0)
                lines = report.read(ANSWER).decode(errors="replace").splitlines()
            line = lines[-1] if lines else "its process ended or did not end in time"
            if not line.startswith("{"):  # it is the error that ended the judge
                raise ValueError(line)
            result = json.loads(line)
            self.name, self.flags = _plain(result["name"]), [*map(_plain, result["flags"])]
            self.verdicts, self.digests = (
                {_plain(key): _plain(value) for key, value in result[part].items()}
                for part in ("verdicts", "digests")
            )

    def grade(self, notebook: bytes, limit: float, whole: float) -> None:
        """Run the cells and grade every exercise of the notebook's lessons."""
        try:
            cells = json.loads(notebook)["cells"]
            texts = ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]
            codes = [re.sub("(?m)^[%!].*", "pass", text) for text in texts]
        except (ValueError, KeyError, TypeError, RecursionError):
            self.flags.append("not a readable notebook")
            return
        if len(cells) > CELLS:
            self.flags.append(f"more than {CELLS} cells")
            return
        parsed = [_parsed(code) for code in codes]
        lessons: set[int] = set()
        unchanged: set[tuple[object, str]] = set()
        #: The last cell that assigns a name.
        solving: dict[str, int] = {}
        for number, (nodes, _) in enumerate(parsed):
            for node in nodes:
                match node:
                    case ast.Module([ast.Expr(ast.Call(ast.Name("check")))]):
                        codes[number] = "pass"  # the judge checks the answer
                    case ast.Call(ast.Name("check"), [ast.Constant(key), ast.Name(name), *_]):
                        unchanged.add((key, name))
                    case ast.Constant(str(text)) if text[:3] == "ex-" and text[3:5].isdecimal():
                        lessons.add(int(text[3:5]))
                    case ast.Name(name, ast.Store()) | ast.FunctionDef(name) | ast.ClassDef(name):
                        solving[name] = number
                    case ast.ImportFrom(str(name)) | ast.alias(name):
                        if name.startswith("shipnet.exercises."):
                            self.flags.append("imports the code that checks answers")
        tasks: list[Exercise] = []
        for lesson in sorted(lessons):
            with suppress(ArgumentError):  # there is no such lesson
                tasks += exercises(lesson)
        if not tasks:
            self.flags.append("no exercise found")
            return
        for one in tasks:
            if (one.key, one.variable) not in unchanged:
                self.flags.append(f"check of {one.key} edited")
            if (cell := solving.get(one.variable)) is not None and parsed[cell][1]:
                self.digests[one.key] = parsed[cell][1]
        session = _Session(codes, limit, whole)
        try:
            self._judge(tasks, session, solving)
        finally:
            session.close()

    def _judge(self, tasks: list[Exercise], session: _Session, solving: dict[str, int]) -> None:
        try:
            name = str(session.ask("get", "me.name"))
            self.name = name[:NAME]
            if len(name) > NAME:
                self.flags.append(f"name longer than {NAME} characters")
            me = student(name)
        except (RuntimeError, ArgumentError):
            self.flags.append("no name")
            me = student(EXAMPLE)
        if me == student(EXAMPLE):
            self.flags.append("name unchanged")
        for one in tasks:
            cell = solving.get(one.variable, -1)
            session.allow()
            try:
                text = check(one.key, session.ask("get", one.variable), me).text
            except RuntimeError as error:
                text = session.faults.get(cell, str(error))
            self.verdicts[one.key] = text[:VERDICT]


def _search(root: Path) -> list[Path]:
    """Return the notebooks in a folder and its subfolders, and the subfolders that are unreadable.

    Links to folders are not followed, and folders may be nested to any depth.
    """
    folders, paths = [root], []
    for folder in folders:
        try:
            for path in folder.iterdir():
                if path.is_dir() and not path.is_symlink():
                    folders += [] if path.name == ".ipynb_checkpoints" else [path]
                elif path.suffix == ".ipynb":
                    paths.append(path)
        except OSError:
            paths.append(folder)
    return sorted(paths)


def _read(path: Path, root: Path) -> bytes:
    if not path.is_file() or not path.resolve().is_relative_to(root.resolve()):
        raise ValueError("not a regular file in this folder")
    with path.open("rb") as file:
        notebook = file.read(NOTEBOOK + 1)
    if len(notebook) > NOTEBOOK:
        raise ValueError(f"larger than {NOTEBOOK >> 20} MB")
    return notebook


def grade(folder: str) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Grade the notebooks in a folder and its subfolders; return tables of grades and verdicts.

    The grades have one row per notebook, with 1 or 0 for each exercise, the sum, and flags. The
    verdicts have one row per notebook and exercise.
    """
    root = Path(folder)
    if not folder or not root.is_dir():  # Path("") is the current folder
        raise InputError(folder, "there is no such folder")
    paths = _search(root)
    if not paths:
        raise InputError(folder, "there is no notebook in it")
    handed = [_HandIn(_plain(path.relative_to(root).as_posix())[-PATH:]) for path in paths]
    read: list[tuple[_HandIn, bytes]] = []
    for one, path in zip(handed, paths, strict=True):  # read all before the first one is run
        with one.flagging():
            read.append((one, _read(path, root)))
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        list(pool.map(lambda pair: pair[0].run(pair[1]), read))
    same: defaultdict[tuple[str, str], list[_HandIn]] = defaultdict(list)
    for one in handed:
        if one.name and "name unchanged" not in one.flags:
            same["name", f"{one.name} {sorted(one.verdicts)}"].append(one)
        for key, digest in one.digests.items():
            same[f"lines for {key}", digest].append(one)
    for (what, _), those in same.items():
        for one in those if len(those) > 1 else ():
            others = ", ".join(other.file for other in those if other is not one)
            one.flags.append(f"same {what} as {others}")
    keys = sorted({key for one in handed for key in one.verdicts})
    rows = []
    for one in handed:
        points = {key: int(text == "correct") for key, text in one.verdicts.items()}
        marks = {key: points.get(key) for key in keys}
        row = {"name": one.name, "file": one.file, **marks, "points": sum(points.values())}
        rows.append({**row, "flags": "; ".join(dict.fromkeys(one.flags))})
    verdicts = [
        {"name": one.name, "file": one.file, "exercise": key, "verdict": text}
        for one in handed
        for key, text in one.verdicts.items()
    ]
    grades = pd.DataFrame(rows).astype(dict.fromkeys(keys, "Int64"))
    return grades, pd.DataFrame(verdicts, columns=["name", "file", "exercise", "verdict"])


def as_html(file: str, grades: pd.DataFrame, verdicts: pd.DataFrame) -> None:
    """Save the grades as an HTML page, with the verdicts on incorrect answers."""
    wrong = verdicts[verdicts["verdict"] != "correct"]
    parts = [
        '<!doctype html><html lang="en"><meta charset="utf-8"><title>Grades</title>',
        "<style>body{font-family:sans-serif}table{border-collapse:collapse}"
        "td,th{padding:.3em .6em;border-bottom:1px solid #ccc;text-align:left}</style>",
        "<h1>Grades</h1>",
        grades.astype(object).fillna("").to_html(index=False, border=0),
        "<h2>Incorrect answers</h2>",
        wrong.to_html(index=False, border=0),
        "</html>",
    ]
    Path(file).write_text("\n".join(parts), encoding="utf-8")
