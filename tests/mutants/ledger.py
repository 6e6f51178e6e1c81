"""Change a constant of a model and see whether the ledger notices: `make mutants`, weekly.

    python tests/mutants/ledger.py [words ...]
    python tests/mutants/ledger.py --draw 40 [--seed 1]

Each row of `constants.csv` is a constant of a model: its file, its text, another value, and the
papers that rest on it. Every such paper must have a claim that comes to something else with the
other value. The run fails if one has none. With words, only rows that hold one of them run.

`--draw` draws constants at random from all that a call of a claim reads, other than in a check that
refuses arguments, and doubles or halves each; the seed is printed. At least seven eighths must move
a claim; for the others `elsewhere.csv` must name a test that fails instead.
"""

from __future__ import annotations

import argparse
import ast
import csv
import dis
import gc
import inspect
import os
import random
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from functools import cache, partial
from importlib import import_module
from multiprocessing import get_context
from pathlib import Path
from types import CodeType, FrameType
from typing import Any, NamedTuple

ROOT = Path(__file__).resolve().parents[2]

#: Packages that model something, and modules that do.
MODELS = ("asi", "ballast", "can", "design", "engine", "fuzzy", "line", "modbus", "remote_control")

#: Libraries that the package imports; loaded once, before a process is forked for each constant.
LIBRARIES = ("numpy", "pandas", "scipy.optimize", "scipy.stats", "numba", "skfuzzy", "matplotlib")


class Constant(NamedTuple):
    """A constant of a model and the papers that rest on it."""

    file: str
    before: str
    after: str
    papers: str

    @property
    def path(self) -> Path:
        """The file in the checkout."""
        return ROOT / "shipnet" / self.file


def constants() -> list[Constant]:
    """Return the constants of the list."""
    with (Path(__file__).parent / "constants.csv").open(newline="", encoding="utf-8") as file:
        return [Constant(*row) for row in list(csv.reader(file))[1:]]


def results(
    package: Path, words: list[str], before: dict[str, str] | None = None
) -> dict[str, str] | str:
    """Return what claims come to in a process of its own, or why the package cannot be imported.

    The words are papers or ids of claims. An error is a result too. With earlier results, the last
    claim is the first that comes to something else.
    """
    for library in LIBRARIES:
        import_module(library)
    with get_context("fork").Pool(1) as pool:
        return pool.apply(_results, (package, words, before))


def _results(
    package: Path, words: list[str], before: dict[str, str] | None
) -> dict[str, str] | str:
    sys.path.insert(0, str(package))
    sys.dont_write_bytecode = True  # a file of bytecode would hide a change within the same second
    os.chdir(package)
    try:
        registry = import_module("shipnet.papers.registry")
        registry.load({word.partition("-")[0] for word in words})
    except Exception as error:
        return f"the package cannot be imported: {error!r}"
    claims: dict[str, str] = {}
    for claim in sorted(registry.REGISTRY):
        if {claim, claim.partition("-")[0]} & set(words):
            try:
                claims[claim] = repr(registry.REGISTRY[claim]())
            except Exception as error:
                claims[claim] = repr(error)
            if before and claims[claim] != before[claim]:
                break
    return claims


def moved(chosen: list[Constant]) -> Iterator[tuple[Constant, str, list[str]]]:
    """Yield constant, paper and the claims that its other value moves."""
    with tempfile.TemporaryDirectory() as name:
        package = Path(name)
        shutil.copytree(ROOT / "shipnet", package / "shipnet")
        shutil.copytree(ROOT / "data", package / "data")
        papers = sorted({paper for one in chosen for paper in one.papers.split()})
        original = results(package, papers)
        for constant in chosen:
            file = package / "shipnet" / constant.file
            text = file.read_text(encoding="utf-8")
            file.write_text(text.replace(constant.before, constant.after), encoding="utf-8")
            changed = results(package, constant.papers.split())
            file.write_text(text, encoding="utf-8")
            for paper in constant.papers.split():
                yield constant, paper, _different(paper, original, changed)


def _different(
    paper: str, original: dict[str, str] | str, changed: dict[str, str] | str
) -> list[str]:
    """Return the claims of a paper that come to something else; none if the import fails."""
    if isinstance(original, str) or isinstance(changed, str):
        raise RuntimeError(original if isinstance(original, str) else changed)
    return [
        claim
        for claim, result in changed.items()
        if claim.startswith(paper) and result != original[claim]
    ]


class Literal(NamedTuple):
    """A number in the source: its file, name and place, and the class whose field it defaults."""

    file: str
    name: str
    owner: str
    line: int
    start: int
    end: int

    @property
    def module(self) -> str:
        """The module that defines it."""
        return "shipnet." + self.file.removesuffix(".py").replace("/", ".")

    def changed(self, text: str, factor: float) -> str:
        """Return the source with a multiple of the number, or 1 for 0."""
        lines = text.splitlines(keepends=True)
        row = lines[self.line - 1].encode()
        number = ast.literal_eval(row[self.start : self.end].decode())
        new = repr(type(number)(factor * number) or 1).encode()
        lines[self.line - 1] = (row[: self.start] + new + row[self.end :]).decode()
        return "".join(lines)


def literals() -> Iterator[Literal]:
    """Yield the public constants and the defaults of fields in the models.

    A private constant is a detail of the program, such as the size of a block, and the settings of
    a design are an engineer's choice.
    """
    for file in sorted((ROOT / "shipnet").rglob("*.py")):
        name = file.relative_to(ROOT / "shipnet").as_posix()
        if name.split("/")[0] not in MODELS and name not in ("crc.py", "clock.py"):
            continue
        if "plot" in name or name == "design/settings.py":
            continue
        for node in ast.parse(file.read_text(encoding="utf-8")).body:
            for target, value, owner in _numbers(node):
                if target.startswith("_"):
                    continue
                yield Literal(
                    name, target, owner, value.lineno, value.col_offset, value.end_col_offset or 0
                )


def _numbers(node: ast.stmt) -> Iterator[tuple[str, ast.expr, str]]:
    """Yield name, number and class of the constants that a statement of a module defines."""
    targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
    for target in targets:
        if isinstance(target, ast.Name) and _is_number(getattr(node, "value", None)):
            yield target.id, node.value, ""
    for field in node.body if isinstance(node, ast.ClassDef) else []:
        call = getattr(field, "value", None)
        for keyword in call.keywords if isinstance(call, ast.Call) else []:
            if keyword.arg == "default" and _is_number(keyword.value):
                yield field.target.id, keyword.value, node.name


def _is_number(node: object) -> bool:
    return isinstance(node, ast.Constant) and type(node.value) in (int, float)


def reached() -> dict[Literal, list[str]]:
    """Return the constants whose value a call of a claim reads, each with these claims.

    A default counts if an object has it because the caller named no other value. What only a check
    of arguments reads does not count: it decides what is refused, not what an answer is.
    """
    with get_context("fork").Pool(1) as pool:
        reading: dict[Literal, list[str]] = pool.apply(_reached, (list(literals()),))
    return reading


def _reached(constants: list[Literal]) -> dict[Literal, list[str]]:
    os.environ["SHIPNET_COMPILED"] = "0"
    sys.path.insert(0, str(ROOT))
    registry = import_module("shipnet.papers.registry")
    registry.load()
    readers: dict[Literal, set[str]] = {constant: set() for constant in constants}
    running = ""

    def read(constant: Literal) -> None:
        if running:
            readers[constant].add(running)

    for constant in constants:
        if constant.owner:
            Default.watch(getattr(import_module(constant.module), constant.owner), constant, read)
    loads = partial(_loads, constants=[constant for constant in constants if not constant.owner])
    for claim in sorted(registry.REGISTRY):
        running = claim
        sys.settrace(partial(_trace, loads=cache(loads), read=read, seen=set()))
        registry.REGISTRY[claim]()
        sys.settrace(None)
    return {constant: sorted(claims) for constant, claims in readers.items() if claims}


class Default:
    """A field of a class that reports each use of its default."""

    def __init__(self, stored: Any, constant: Literal, default: Any, read: Callable[..., None]):
        self.stored, self.constant, self.default, self.read = stored, constant, default, read

    @classmethod
    def watch(cls, owner: type, constant: Literal, read: Callable[[Literal], None]) -> None:
        """Replace a field, and its default by an equal number that no caller can have named."""
        stored = vars(owner).get(constant.name)
        parameters = inspect.signature(owner).parameters
        if constant.name not in parameters:
            return
        value = parameters[constant.name].default
        default = type("Left", (type(value),), {})(value)
        for constructor in [kind.__init__ for kind in [owner, *_derived(owner)]]:  # type: ignore[misc]
            positional = [
                name
                for name, parameter in inspect.signature(constructor).parameters.items()
                if parameter.kind is not parameter.KEYWORD_ONLY
                and parameter.default is not parameter.empty
            ]
            defaults = dict(zip(positional, constructor.__defaults__ or (), strict=True))
            if defaults.get(constant.name) is value:
                defaults[constant.name] = default
            constructor.__defaults__ = tuple(defaults.values())
            named = constructor.__kwdefaults__ or {}
            if named.get(constant.name) is value:
                named[constant.name] = default
        watcher = cls(stored, constant, default, read)
        for made in gc.get_objects():  # those that were made at import
            if type(made) in {owner, *_derived(owner)} and watcher._value(made) is value:
                watcher._store(made, default)
        setattr(owner, constant.name, watcher)

    def __get__(self, made: Any, kind: type) -> Any:
        """Return the value; report it if it is the default and no check asks for it."""
        value = self.default if made is None else self._value(made)
        code = sys._getframe(1).f_code
        checks = code.co_filename == "<string>" or code.co_filename.endswith("shipnet/fields.py")
        if (
            value is self.default
            and not checks
            and code.co_name not in {"__post_init__", "replace"}
        ):
            self.read(self.constant)
        return value

    def _store(self, made: Any, value: Any) -> None:
        if hasattr(self.stored, "__set__"):
            self.stored.__set__(made, value)
        else:
            vars(made)[self.constant.name] = value

    def _value(self, made: Any) -> Any:
        if hasattr(self.stored, "__set__"):
            return self.stored.__get__(made, type(made))
        return vars(made)[self.constant.name]

    def __set__(self, made: Any, value: Any) -> None:
        """Store the value as the class did; the check of a default stores an equal number."""
        checks = sys._getframe(1).f_code.co_filename.endswith("shipnet/fields.py")
        if checks and self._value(made) is self.default:
            return
        self._store(made, value)


def _derived(owner: type) -> list[type]:
    """Return all classes below a class."""
    return [kind for child in owner.__subclasses__() for kind in [child, *_derived(child)]]


def _loads(code: CodeType, constants: list[Literal]) -> dict[int, Literal]:
    """Return the constants of modules that a function loads, by the place of the instruction."""
    file = code.co_filename.rpartition("/shipnet/")[2]
    if "/shipnet/" not in code.co_filename or code.co_name == "__post_init__":
        return {}
    refused = refusals(file)
    visible = {
        constant.name: constant
        for constant in constants
        if constant.name in code.co_names
        and (constant.file == file or constant.name in imported(file, constant.module))
    }
    return {
        step.offset: visible[step.argval]
        for step in (dis.get_instructions(code) if visible else ())
        if step.opname in {"LOAD_GLOBAL", "IMPORT_FROM"}
        and step.argval in visible
        and step.positions is not None
        and (step.positions.lineno, step.positions.col_offset) not in refused
    }


def _trace(
    frame: FrameType,
    event: str,
    _: object,
    *,
    loads: Callable[[CodeType], dict[int, Literal]],
    read: Callable[[Literal], None],
    seen: set[tuple[CodeType, int]],
) -> Any:
    """Follow the instructions of functions that load a constant until each load has run."""
    places = loads(frame.f_code)
    if all((frame.f_code, place) in seen for place in places):
        return None
    frame.f_trace_opcodes, frame.f_trace_lines = True, False
    if event == "opcode" and frame.f_lasti in places:
        seen.add((frame.f_code, frame.f_lasti))
        read(places[frame.f_lasti])
    return partial(_trace, loads=loads, read=read, seen=seen)


@cache
def refusals(file: str) -> set[tuple[int, int]]:
    """Return line and column of each name in a file that only decides whether to refuse arguments.

    Such names stand in an `if` that does nothing but raise an ArgumentError, among the arguments of
    a check of `shipnet.fields`, or in a function `check_...` that returns nothing.
    """
    checks: list[ast.AST] = []
    for node in ast.walk(ast.parse((ROOT / "shipnet" / file).read_text(encoding="utf-8"))):
        match node:
            case ast.If(body=[ast.Raise(exc=ast.Call(func=ast.Name(id="ArgumentError")))]):
                checks.append(node)
            case ast.Call(func=ast.Name(id="check_scalar" | "check_whole"), args=arguments):
                checks += arguments
            case ast.FunctionDef(name=name, returns=ast.Constant(value=None)):
                checks += [node] * name.startswith("check_")
    return {
        (name.lineno, name.col_offset)
        for check in checks
        for name in ast.walk(check)
        if isinstance(name, ast.Name)
    }


@cache
def imported(file: str, module: str) -> set[str]:
    """Return the names that a file of the package imports from a module."""
    tree = ast.parse((ROOT / "shipnet" / file).read_text(encoding="utf-8"))
    return {
        alias.name
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and node.module == module
        for alias in node.names
    }


def _first_moved(package: Path, claims: list[str], original: dict[str, str]) -> str:
    """Return the first of the claims that comes to something else; "" if none does."""
    changed = results(package, claims, original)
    if isinstance(changed, str):
        return ""  # the package refuses the value at import
    return next((claim for claim in changed if changed[claim] != original[claim]), "")


def draw(number: int, seed: int) -> int:
    """Double or halve this many constants, one at a time; return 1 if too few move a claim."""
    constants = reached()
    print(f"seed {seed}: {number} of {len(constants)} constants that a claim reaches", flush=True)
    with (Path(__file__).parent / "elsewhere.csv").open(newline="", encoding="utf-8") as file:
        elsewhere = {(row["file"], row["name"]): row["test"] for row in csv.DictReader(file)}
    moving, unexplained = 0, 0
    with tempfile.TemporaryDirectory() as name:
        package = Path(name)
        for folder in ("shipnet", "data", "tests", "docs"):
            shutil.copytree(ROOT / folder, package / folder)
        shutil.copy2(ROOT / "pyproject.toml", package)
        drawn = random.Random(seed).sample(list(constants), number)
        papers = sorted(
            {claim.partition("-")[0] for readers in constants.values() for claim in readers}
        )
        original = results(package, papers)
        if isinstance(original, str):
            raise RuntimeError(original)
        for constant in drawn:
            file = package / "shipnet" / constant.file
            text = file.read_text(encoding="utf-8")
            owner = f"{constant.owner}." if constant.owner else ""
            test = elsewhere.get((constant.file, owner + constant.name), "")
            seen, fails = "", False
            for factor in (2, 0.5):
                file.write_text(constant.changed(text, factor), encoding="utf-8")
                # A claim that gets a value from a cache is not among those that read the constant.
                seen = _first_moved(package, constants[constant], original)
                seen = seen or _first_moved(package, papers, original)
                if seen:
                    break
                if test and not fails:
                    command = [sys.executable, "-Bm", "pytest", "-qx", "--doctest-modules", test]
                    run = subprocess.run(command, cwd=package, capture_output=True, check=False)
                    fails = run.returncode == 1
            test = test if fails else ""
            file.write_text(text, encoding="utf-8")
            moving += bool(seen)
            unexplained += not seen and not test
            result = seen or test or "NOT SEEN"
            print(f"{constant.file:27} {owner + constant.name:32} {result}", flush=True)
    print(f"{moving} of {number} move a claim; {unexplained} are seen by nothing")
    return int(moving < number * 7 / 8 or unexplained > 0)


def main(words: list[str]) -> int:
    """Print how many claims each constant moves; return 1 if one moves none of a paper's."""
    chosen = [one for one in constants() if not words or any(w in " ".join(one) for w in words)]
    unseen = 0
    for constant, paper, claims in moved(chosen):
        unseen += not claims
        seen = f"{len(claims):3} claims, such as {claims[0]}" if claims else "NOT SEEN"
        print(f"{constant.file:27} {constant.before[:40]:40} {paper:9} {seen}", flush=True)
    return int(unseen > 0)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("words", nargs="*", help="run only rows that hold one of these words")
    parser.add_argument("--draw", type=int, default=0, help="number of constants to draw")
    parser.add_argument("--seed", type=int, default=random.SystemRandom().randrange(10_000))
    given = parser.parse_args()
    sys.exit(draw(given.draw, given.seed) if given.draw else main(given.words))
