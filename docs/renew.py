"""Update what is derived from the data: checksums and the counts of claims.

    python docs/renew.py

This script rewrites the checksums in data/SOURCES.md, the counts in README.md and, for each paper,
the number of judged claims in tests/papers/expected_ledger.json. This number may only grow. The
script prints the names of the files that it changed.
"""

from __future__ import annotations

import hashlib
import json
import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
COUNTS = (
    "Of {claims} claims, {measurement} are judged by a measurement, {independent} by another"
    " program, a published table or a second derivation, {own_simulator} by our own simulators and"
    " {definition} by definition, and none is open"
)


def check_sums(text: str, data: Path) -> str:
    """Return the table of sources with up-to-date checksums."""

    def renewed(row: re.Match[str]) -> str:
        file = data / row[1]
        digest = hashlib.sha256(file.read_bytes()).hexdigest() if file.is_file() else row[3]
        return f"| `{row[1]}`{row[2]}{digest} |"

    return re.sub(r"^\| `([^`]+)`(.*\| )([0-9a-f]{64}) \|$", renewed, text, flags=re.MULTILINE)


def counts(text: str, totals: dict[str, int]) -> str:
    """Return the text with up-to-date counts of claims; line breaks stay where they are."""
    pattern = r"\s+".join(re.sub(r"{\w+}", r"(\\d+)", word) for word in COUNTS.split())
    names = re.findall(r"{(\w+)}", COUNTS)

    def renewed(said: re.Match[str]) -> str:
        numbers = iter(str(totals[name.replace("_", " ")]) for name in names)
        return re.sub(r"\d+", lambda _: next(numbers), said[0])

    return re.sub(pattern, renewed, text)


def main(root: Path = ROOT) -> int:
    """Update the files of a checkout and return the exit code."""
    sys.path.insert(0, str(root))
    from shipnet.papers import ledger
    from shipnet.papers.judging import GRADES

    table = ledger().counts()
    recorded = root / "tests" / "papers" / "expected_ledger.json"
    before = json.loads(recorded.read_text(encoding="utf-8"))
    judged = table[list(GRADES)].sum(axis=1)
    now = {paper: int(number) for paper, number in judged.items()}
    if fallen := [paper for paper in now if now[paper] < before.get(paper, 0)]:
        print(f"fewer claims are judged than before: {', '.join(fallen)}")
        return 1
    sources, readme = root / "data" / "SOURCES.md", root / "README.md"
    totals = {name: int(number) for name, number in table.sum().items()}
    new = {
        sources: check_sums(sources.read_text(encoding="utf-8"), root / "data"),
        readme: counts(readme.read_text(encoding="utf-8"), totals),
        recorded: json.dumps(now, indent=2) + "\n",
    }
    for file, text in new.items():
        if file.read_text(encoding="utf-8") != text:
            file.write_text(text, encoding="utf-8", newline="\n")
            print(f"updated: {file.relative_to(root)}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
