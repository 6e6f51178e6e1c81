"""Change a constant of a model and see whether the ledger notices: `make mutants`, weekly.

    python tests/mutants/ledger.py [words ...]
    python tests/mutants/ledger.py --draw 40 [--seed 1]

Each row of `constants.csv` is a constant of a model: its file, its text, another value, and the
papers that rest on it. Every such paper must have a claim that comes to something else with the
other value. The run fails if one has none. With words, only rows that hold one of them run.

`--draw` draws constants at random from all that a call of a claim reaches, and doubles or halves
each; the seed is printed. At least seven eighths must move a claim; for the others `elsewhere.csv`
must name a test that fails instead.
"""

from __future__ import annotations

import argparse
import ast
import csv
import json
import os
import random
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[2]

#: Packages that model something, and modules that do.
MODELS = ("asi", "ballast", "can", "design", "engine", "fuzzy", "line", "modbus", "remote_control")

#: What the claims with these ids or of these papers come to, as JSON; an error is a result too.
PROGRAM = """
import json, sys
from shipnet.papers.registry import REGISTRY, load
load({word.partition("-")[0] for word in sys.argv[1:]})
results = {}
for claim in sorted(REGISTRY):
    if {claim, claim.partition("-")[0]} & set(sys.argv[1:]):
        try:
            results[claim] = repr(REGISTRY[claim]())
        except Exception as error:
            results[claim] = repr(error)
print(json.dumps(results))
"""

#: What claims reach, as JSON: for each function, its file, the names that it loads and the claims
#: that call it; for each field that an object leaves at its default, class, field and claims.
REACH = """
import dataclasses, json, sys
from shipnet.papers.registry import REGISTRY, load
load()
calls, fields = {}, {}
def watch(frame, event, _):
    code = frame.f_code
    if event != "call":
        return
    if "/shipnet/" in code.co_filename:
        calls.setdefault(code, set()).add(claim)
    elif code.co_name == "__init__" and code.co_filename == "<string>":
        made = type(frame.f_locals["self"])
        for field in dataclasses.fields(made) if dataclasses.is_dataclass(made) else ():
            if frame.f_locals.get(field.name) is field.default:
                key = made.__module__, made.__name__, field.name
                fields.setdefault(key, set()).add(claim)
for claim in sorted(REGISTRY):
    sys.setprofile(watch)
    try:
        REGISTRY[claim]()
    except Exception:
        pass
    sys.setprofile(None)
print(json.dumps([
    [[code.co_filename.rpartition("/shipnet/")[2], code.co_names, sorted(claims)]
     for code, claims in calls.items()],
    [[*key, sorted(claims)] for key, claims in fields.items()],
]))
"""


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


def results(package: Path, papers: list[str]) -> dict[str, str]:
    """Return what the claims of some papers come to, by the package in this folder."""
    command = [sys.executable, "-c", PROGRAM, *papers]
    environment = os.environ | {"PYTHONPATH": str(package)}
    printed = subprocess.check_output(command, text=True, cwd=package, env=environment)
    claims: dict[str, str] = json.loads(printed)
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
            found = results(package, constant.papers.split())
            file.write_text(text, encoding="utf-8")
            for paper in constant.papers.split():
                own = [claim for claim in found if claim.startswith(paper)]
                yield constant, paper, [one for one in own if found[one] != original[one]]


class Literal(NamedTuple):
    """A number in the source: its file, name and place, and the class whose field it defaults."""

    file: str
    name: str
    owner: str
    line: int
    start: int
    end: int

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
    """Return the constants that a call of a claim reaches, each with these claims."""
    environment = os.environ | {"SHIPNET_COMPILED": "0"}
    output = subprocess.run(
        [sys.executable, "-c", REACH],
        check=True,
        capture_output=True,
        text=True,
        cwd=ROOT,
        env=environment,
    ).stdout
    calls, fields = json.loads(output)
    found = {}
    for one in literals():
        module = "shipnet." + one.file.removesuffix(".py").replace("/", ".")
        if one.owner:
            reaching = {
                claim
                for of, owner, name, claims in fields
                for claim in claims
                if (of, owner, name) == (module, one.owner, one.name)
            }
        else:
            reaching = {
                claim
                for file, loads, claims in calls
                for claim in claims
                if one.name in loads and (file == one.file or one.name in imported(file, module))
            }
        if reaching:
            found[one] = sorted(reaching)
    return found


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
        original = results(package, sorted({c for claims in constants.values() for c in claims}))
        for constant in random.Random(seed).sample(list(constants), number):
            claims = constants[constant]
            file = package / "shipnet" / constant.file
            text = file.read_text(encoding="utf-8")
            seen: list[str] = []
            for factor in (2, 0.5):
                file.write_text(constant.changed(text, factor), encoding="utf-8")
                try:
                    found = results(package, claims)
                    seen = seen or [claim for claim in claims if found[claim] != original[claim]]
                except subprocess.CalledProcessError:
                    seen = seen or ["the package cannot be imported"]
                if seen:
                    break
            owner = f"{constant.owner}." if constant.owner else ""
            test = elsewhere.get((constant.file, owner + constant.name), "")
            if not seen and test:
                command = [sys.executable, "-m", "pytest", "-q", "-x", test]
                run = subprocess.run(command, cwd=package, capture_output=True, check=False)
                test = test if run.returncode == 1 else ""
            file.write_text(text, encoding="utf-8")
            moving += bool(seen)
            unexplained += not seen and not test
            result = f"{len(seen):3} claims, such as {seen[0]}" if seen else test or "NOT SEEN"
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
