"""The result of a command: as text, as JSON, and in files."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping, Sequence
from math import isfinite
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree

from shipnet.answers import Findings
from shipnet.errors import ArgumentError, load_extra
from shipnet.lazy import Axes, pd
from shipnet.tables import as_csv, as_workbook

#: Suffixes of the formats in which every result can be saved; no suffix means a folder.
FORMS = (".csv", ".xlsx", ".json", ".png", ".svg")


class Answer(NamedTuple):
    """The result of a command as text, as data and as a figure.

    A ``.csv`` file contains only the first of the `tables`; a workbook or folder contains all.
    `forms` maps other suffixes to the functions that write such files. Each of the `cases` for
    JUnit is a name, the failure ("" for none), and whether it was not verified; each finding is a
    further one. Without any, the whole answer is one.
    """

    ok: bool | None
    verdict: str
    text: str
    numbers: Mapping[str, tuple[float, str]]
    tables: Mapping[str, pd.DataFrame]
    draw: Callable[[Axes], object]
    findings: Findings | None = None
    forms: Mapping[str, Callable[[str], object]] = {}
    cases: Sequence[tuple[str, str, bool]] = ()

    def json(self, command: str) -> str:
        """Return the result as JSON, `numbers` with their units; NaN and infinity become null."""
        from shipnet import __version__

        data = {
            "command": command,
            "version": __version__,
            "ok": self.ok,
            "verdict": self.verdict,
            "numbers": {
                name: {"value": value if isfinite(value) else None, "unit": unit}
                for name, (value, unit) in self.numbers.items()
            },
            "findings": [] if self.findings is None else _rows(self.findings.table()),
            "tables": {name: _rows(table) for name, table in self.tables.items()},
        }
        return printable(json.dumps(data, indent=1, ensure_ascii=False)) + "\n"

    def junit(self, command: str, file: str) -> str:
        """Return the result as a test suite of JUnit XML, with one test per case."""
        cases = self.cases or [(command, "" if self.ok else self.verdict, False)]
        if self.findings is not None:
            cases = [*self.cases] + [
                (f"{row.rule}: {row.object}", _failure(row), bool(row.verdict == "not verified"))
                for row in self.findings.table().itertuples()
            ]
        suite = ElementTree.Element(
            "testsuite",
            name=printable(file or command),
            tests=str(len(cases)),
            failures=str(sum(failure != "" for _, failure, _ in cases)),
            skipped=str(sum(skipped for *_, skipped in cases)),
        )
        for name, failure, skipped in cases:
            case = ElementTree.SubElement(
                suite, "testcase", name=printable(name), classname=command
            )
            if failure:
                ElementTree.SubElement(case, "failure", message=printable(failure))
            elif skipped:
                ElementTree.SubElement(case, "skipped")
        ElementTree.indent(suite)
        return ElementTree.tostring(suite, encoding="unicode")

    def save(self, file: str, command: str) -> None:
        """Save the result in the format given by the file's suffix."""
        suffix = Path(file).suffix.lower()
        if suffix in self.forms:
            self.forms[suffix](file)
        elif suffix == ".json":
            Path(file).write_text(self.json(command), encoding="utf-8")
        elif suffix == ".csv":
            Path(file).write_bytes(as_csv(next(iter(self.tables.values()))))
        elif suffix == ".xlsx":
            Path(file).write_bytes(as_workbook(self.tables))
        elif suffix:
            from shipnet import style

            style.save(self.draw, file)
        else:
            Path(file).mkdir(exist_ok=True)
            for name, table in self.tables.items():
                (Path(file) / f"{name}.csv").write_bytes(as_csv(table))


def _failure(row: Any) -> str:
    """Return what a violated finding says, or ""."""
    if row.verdict != "violated":
        return ""
    bounds = [("at least", row.low), ("at most", row.high)]
    limits = [f"{word} {bound:g}" for word, bound in bounds if isfinite(bound)]
    if not limits or not isfinite(row.value):
        return str(row.why)
    return f"{row.value:.4g} {row.unit}; it must be {' and '.join(limits)}"


def _rows(table: pd.DataFrame) -> Any:
    table = encodable(table)
    return json.loads(table.to_json(orient="records", double_precision=15))


#: Control characters except tab and newline, marks that reverse the order of text, and halves of
#: pairs of surrogates.
_CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069\ud800-\udfff]")


def printable(text: str) -> str:
    r"""Return text that cannot command a terminal, with each control character as ``\uXXXX``.

    JSON keeps its meaning, because its strings have the same escapes.
    """
    return _CONTROL.sub(lambda found: f"\\u{ord(found[0]):04x}", text)


def encodable(table: pd.DataFrame) -> pd.DataFrame:
    """Return a table whose text UTF-8 can encode: half a pair of surrogates becomes an escape."""

    def text(cell: object) -> object:
        if not isinstance(cell, str):
            return cell
        return cell.encode("utf-8", "backslashreplace").decode("utf-8")

    return table.map(text).rename(columns=text)


def check_output(file: str, forms: Sequence[str]) -> None:
    """Raise if `file` has a suffix not in `forms`, its folder is missing, or openpyxl is needed."""
    if (suffix := Path(file).suffix.lower()) not in ("", *forms):
        raise ArgumentError(
            f"-o is {file!r}; its suffix must be one of {', '.join(forms)}, or none for a folder"
        )
    if not (folder := Path(file).absolute().parent).is_dir():
        raise ArgumentError(f"-o is {file!r}; there is no folder {folder}")
    if suffix == ".xlsx":
        load_extra("openpyxl", "openpyxl")
