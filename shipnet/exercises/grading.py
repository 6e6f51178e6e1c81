"""Grading of notebooks that students handed in, for the command `shipnet grade`.

A student's cells run in a separate process, which returns values of variables and results of
functions. Answers are checked in this process, where no notebook can change the checks. The
student's process starts in an empty folder and has no input; its time, memory and file size are
limited. These measures do not protect the computer against an attack.
"""

from __future__ import annotations

import ast
import json
import os
import pickle
import signal
import subprocess
import sys
import tempfile
from collections import defaultdict
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from threading import Timer
from time import monotonic
from typing import Any

import numpy as np

from shipnet.errors import ArgumentError, InputError
from shipnet.exercises.exercise import check, exercises, student
from shipnet.lazy import pd

#: The name in a notebook before a student changes it.
EXAMPLE = "Kim"

#: Time limit for a cell, and for all requests about one exercise [s]; limits on memory, file size
#: and answer length [byte].
LIMIT, MEMORY, FILE, ANSWER = 8.0, 4 << 30, 10 << 20, 1 << 20

#: Shortest solution whose copies are flagged [characters], not counting comments and spaces.
_LONG = 80


class _Ended(Exception):
    """A student's process has ended; the message gives the reason."""


def _end(process: subprocess.Popen[bytes]) -> None:
    """End a process and the processes that it started."""
    if hasattr(os, "killpg"):
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
    process.kill()


class _Session:
    """The process that runs a student's cells; if a cell ends it, a new one runs the others."""

    def __init__(self, cells: list[str], folder: str) -> None:
        #: By cell number: why the process ended in the cell, and the error that the cell raised.
        self.ended: dict[int, str] = {}
        self.raised: dict[int, str] = {}
        self.deadline = 0.0
        self._cells, self._folder = cells, folder
        self._process: subprocess.Popen[bytes] | None = None

    def ask(self, *task: object) -> Any:
        """Return the result; raise _Ended if the process ends, RuntimeError if the task fails."""
        while self._process is None:
            self._start()
        return self._told(*task)

    def close(self) -> None:
        """End the process."""
        if self._process is not None:
            _end(self._process)
            self._process.communicate()
            self._process = None

    def _start(self) -> None:
        kept = ("PATH", "HOME", "LANG", "MPLCONFIGDIR", "SYSTEMROOT", "TEMP", "USERPROFILE")
        environment = {name: os.environ[name] for name in kept if name in os.environ}
        paths = (str(Path(__file__).parents[2]), os.environ.get("PYTHONPATH", ""))
        environment |= {"MPLBACKEND": "agg", "PYTHONPATH": os.pathsep.join(filter(None, paths))}
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-c", "from shipnet.exercises import grading; grading.answer()"],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
            cwd=self._folder, env=environment, start_new_session=True,
        )  # fmt: skip
        assert self._process.stdout is not None
        self._process.stdout.readline()  # wait until it is ready
        asked = self.deadline
        for number, cell in enumerate(self._cells):
            if self._process is not None and number not in self.ended:
                self.deadline = monotonic() + LIMIT
                try:
                    self._told("run", cell)
                except _Ended as why:
                    self.ended[number] = str(why)
                except RuntimeError as error:  # the next cells run anyway
                    self.raised[number] = str(error)
        self.deadline = max(asked, monotonic() + LIMIT)

    def _told(self, *task: object) -> Any:
        process = self._process
        assert process is not None and process.stdin is not None and process.stdout is not None
        late = Timer(max(self.deadline - monotonic(), 0.01), _end, (process,))
        late.start()
        try:
            pickle.dump(task, process.stdin)
            process.stdin.flush()
            line = process.stdout.readline(ANSWER)
        except OSError:
            line = b""
        finally:
            late.cancel()
        if not line:
            why = "Python ended" if monotonic() < self.deadline else f"it took over {LIMIT:g} s"
            self.close()
            raise _Ended(f"stopped: {why}")
        try:
            reply = json.loads(line)
            value = _decoded(reply.get("value"), self)
        except Exception:  # the student's code can write to this pipe
            self.close()
            raise _Ended("stopped: the answer is too large or has an unexpected type") from None
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
    try:
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
        resource.setrlimit(resource.RLIMIT_FSIZE, (FILE, FILE))
    except (ImportError, OSError, ValueError):  # not every system has these limits
        pass
    space: dict[str, Any] = {"__name__": "__main__"}
    answers.write(b"\n")
    answers.flush()
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
                found = eval(text, space)
                value = _encoded(found(*arguments[0]) if what == "call" else found, text)
            line = json.dumps({"value": value})
        except BaseException as error:  # including SystemExit
            line = json.dumps({"error": f"{type(error).__name__}: {error}"[:300]})
        answers.write(line.encode() + b"\n")
        answers.flush()


@dataclass
class _HandIn:
    """A notebook that a student handed in, and its verdicts."""

    file: str
    cells: list[str] = field(default_factory=list)
    #: By exercise: the checked name, and the number of the cell with the check.
    checks: dict[str, tuple[str, int]] = field(default_factory=dict)
    name: str = ""
    verdicts: dict[str, str] = field(default_factory=dict)
    flags: list[str] = field(default_factory=list)

    @classmethod
    def read(cls, path: Path, folder: Path) -> _HandIn:
        """Read a notebook; flag it if it cannot be read."""
        made = cls(path.relative_to(folder).as_posix())
        try:
            cells = json.loads(path.read_text("utf-8"))["cells"]
            texts = ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]
        except (OSError, ValueError, KeyError, TypeError, RecursionError):
            made.flags.append("not a readable notebook")
            return made
        for text in texts:
            lines = text.splitlines()
            made.cells.append("\n".join("pass" if line[:1] in "%!" else line for line in lines))
        made._find_checks()
        return made

    def _find_checks(self) -> None:
        edited = set()
        for number, cell in enumerate(self.cells):
            for node in _nodes(cell):
                module = getattr(node, "module", None) if isinstance(node, ast.ImportFrom) else ""
                names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
                if any(str(name).startswith("shipnet.exercises.") for name in [module, *names]):
                    self.flags.append("imports the code that checks answers")
                if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "check":
                    key, *rest = node.args or [ast.Constant("")]
                    if isinstance(key, ast.Constant) and rest and isinstance(rest[0], ast.Name):
                        self.checks[str(key.value)] = (rest[0].id, number)
                    elif isinstance(key, ast.Constant):
                        edited.add(str(key.value))
        self.flags += [f"check of {key} edited" for key in sorted(edited - self.checks.keys())]

    def solving(self, key: str) -> int:
        """Return the index of the cell that assigns the checked name, or -1 if there is none."""
        name, number = self.checks[key]
        for before in range(number, -1, -1):
            for node in _nodes(self.cells[before]):
                stored = isinstance(getattr(node, "ctx", None), ast.Store)
                if getattr(node, "id" if stored else "name", "") == name:
                    return before
        return -1

    def lines_of(self, key: str) -> str:
        """Return the code that solves an exercise, without comments; empty if it is short."""
        solving = self.solving(key)
        lines = ast.unparse(ast.parse(self.cells[solving])) if solving >= 0 else ""
        return lines if len("".join(lines.split())) >= _LONG else ""

    def grade(self) -> None:
        """Run the cells and grade every exercise of the notebook's lessons."""
        keys = []
        for lesson in sorted({int(key[3:5]) for key in self.checks if key[3:5].isdecimal()}):
            with suppress(ArgumentError):  # there is no such lesson
                keys += [one.key for one in exercises(lesson)]
        if not keys:
            self.flags += [] if self.flags else ["no exercise check found"]
            return
        checks = {number for _, number in self.checks.values()}
        cells = ["pass" if n in checks else cell for n, cell in enumerate(self.cells)]
        with tempfile.TemporaryDirectory() as folder:
            session = _Session(cells, folder)
            try:
                self._judge(keys, session)
            finally:
                session.close()

    def _judge(self, keys: list[str], session: _Session) -> None:
        try:
            self.name = str(session.ask("get", "me.name"))
            me = student(self.name)
        except (_Ended, RuntimeError, ArgumentError):
            self.flags.append("no name")
            me = student(EXAMPLE)
        if me == student(EXAMPLE):
            self.flags.append("name unchanged")
        for key in keys:
            if key not in self.checks:
                self.verdicts[key] = "no check"
                continue
            name, cell = self.checks[key][0], self.solving(key)
            session.deadline = monotonic() + LIMIT
            try:
                answered = session.ask("get", name)
                said = check(key, answered, me).text
            except (_Ended, RuntimeError) as why:
                said = session.ended.get(cell) or session.raised.get(cell) or str(why)
            self.verdicts[key] = said


def _nodes(cell: str) -> Iterator[ast.AST]:
    try:
        return ast.walk(ast.parse(cell))
    except (SyntaxError, ValueError, RecursionError):
        return iter(())


def grade(folder: str) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Grade the notebooks in a folder and its subfolders; return tables of grades and verdicts.

    The grades have one row per notebook, with 1 or 0 for each exercise, the sum, and flags. The
    verdicts have one row per notebook and exercise.
    """
    root = Path(folder)
    if not root.is_dir():
        raise InputError(folder, "there is no such folder")
    paths = sorted(path for path in root.rglob("*.ipynb") if ".ipynb_checkpoints" not in path.parts)
    if not paths:
        raise InputError(folder, "there is no notebook in it")
    handed = [_HandIn.read(path, root) for path in paths]
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        list(pool.map(_HandIn.grade, handed))
    _flag_copies(handed)
    keys = sorted({key for one in handed for key in one.verdicts})
    rows = []
    for one in handed:
        points = {key: int(text == "correct") for key, text in one.verdicts.items()}
        marks = {key: points.get(key) for key in keys}
        row = {"name": one.name, "file": one.file, **marks, "points": sum(points.values())}
        rows.append({**row, "flags": "; ".join(dict.fromkeys(one.flags))})
    said = [
        {"name": one.name, "file": one.file, "exercise": key, "verdict": text}
        for one in handed
        for key, text in one.verdicts.items()
    ]
    grades = pd.DataFrame(rows).astype(dict.fromkeys(keys, "Int64"))
    return grades, pd.DataFrame(said, columns=["name", "file", "exercise", "verdict"])


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


def _flag_copies(handed: list[_HandIn]) -> None:
    """Flag notebooks with the same name or the same long solution as another notebook."""
    same: defaultdict[tuple[str, str], list[_HandIn]] = defaultdict(list)
    for one in handed:
        if one.name and "name unchanged" not in one.flags:
            same["", f"{one.name} {sorted(one.verdicts)}"].append(one)
        for key in one.checks:
            if lines := one.lines_of(key):
                same[key, lines].append(one)
    for (key, _), those in same.items():
        for one in those if len(those) > 1 else ():
            others = ", ".join(other.file for other in those if other is not one)
            one.flags.append(f"same {f'lines for {key}' if key else 'name'} as {others}")
