"""Change a constant of a model and see whether the ledger notices: `make mutants`, weekly.

    python tests/mutants/ledger.py [words ...]

Each row of `constants.csv` is a constant of a model: its file, its text, another value, and the
papers that rest on it. Every such paper must have a claim that comes to something else with the
other value. The run fails if one has none. With words, only rows that hold one of them run.
"""

from __future__ import annotations

import csv
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[2]

#: What every claim of some papers comes to, as JSON; an error counts as a result too.
PROGRAM = """
import json, sys
from shipnet.papers.registry import REGISTRY, load
load(sys.argv[1:])
results = {}
for claim in sorted(REGISTRY):
    if claim.partition("-")[0] in sys.argv[1:]:
        try:
            results[claim] = repr(REGISTRY[claim]())
        except Exception as error:
            results[claim] = repr(error)
print(json.dumps(results))
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
    sys.exit(main(sys.argv[1:]))
