"""Inputs of up to 1 MB that are slow or large for some readers, made from a good input.

    python tests/fuzz/large.py [targets ...]

Each input is read in a process of its own, which measures its processor time and peak memory.
"""

from __future__ import annotations

import io
import math
import os
import re
import resource
import shutil
import sys
import zipfile
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

import numpy as np

#: Size of the inputs [byte], and limits for one: processor time [s], peak memory [MB].
LARGE, SECONDS, MEGABYTES = 10**6 - 10**4, 5, 500

#: A reader that takes more processor time is ended [s].
HANGS = 60

#: Longest run of a character in a line; readers refuse longer lines.
_RUN = 32_000

Make = Callable[[int], bytes]


def _slug(name: str) -> str:
    return re.sub(r"[^a-z0-9.]+", "-", name.lower())


class Cost(NamedTuple):
    """What one input cost: size [byte], processor time [s], peak memory [MB], and its growth."""

    name: str
    size: int
    seconds: float
    megabytes: float
    exponent: float
    failure: str

    def __str__(self) -> str:
        growth = f"n^{self.exponent:.1f}" if self.exponent else "n^?"
        return (
            f"{self.seconds:6.2f} s {self.megabytes:5.0f} MB {self.size:9,d} byte {growth}"
            f"  {self.name} {self.failure}"
        )


# Text --------------------------------------------------------------------------------------------


def _filled(size: int, piece: Callable[[int], bytes]) -> bytes:
    """Return pieces 0, 1, 2, ... up to a size."""
    pieces, length, k = list[bytes](), 0, 0
    while length < size:
        pieces.append(piece(k))
        length += len(pieces[-1])
        k += 1
    return b"".join(pieces)


def texts(seed: bytes) -> Iterator[tuple[str, Make]]:
    """Yield a name and a maker of large inputs that begin like a good input."""
    middle, body = len(seed) // 2, seed.rstrip()
    start = body.rfind(b"\n") + 1
    head, last = seed[:start], body[start:]
    gaps = [found.end() for found in re.finditer(rb"[\w.]+|[^\w\s]", last)] or [len(last)]
    first = body.split(b"\n", 1)[0]
    for name, before, piece in (
        ("the input again and again", b"", seed),
        ("its half again and again", seed[:middle], seed[middle:]),
        ("its last line again and again", head, last + b"\n"),
        ("its first line again and again", b"", first + b"\n"),
        ("comments", b"", b"# a\n"),
        ("empty lines", head, b"\n"),
        ("cells", head + last, b",x"),
        ("cells of a spreadsheet", head + last, b";1"),
        ("titles", first, b",x_m"),
        ("quoted cells", head, b'"a\n",'),
        ("brackets", head, b"[{("),
        ("lists in lists", b'a = {"a":', b'[{"a":'),
        ("dotted keys", b"", b"a."),
        ("tables of settings", b"", b"[[a.b]]\n"),
        ("not UTF-8", head, b"\xff\xfe"),
        ("zeros", b"", b"\0"),
    ):
        yield name, lambda n, b=before, p=piece: b + p * (n // len(p) if p else 0)

    def numbered(k: int) -> bytes:
        return re.sub(rb"\d+", lambda found: b"%d" % (int(found[0][:9]) + k), last) + b"\n"

    def named(k: int) -> bytes:
        return re.sub(rb"[A-Za-z_]{2,}", lambda found: b"%s%d" % (found[0], k), last) + b"\n"

    yield "other numbers in each line", lambda n: head + _filled(n, numbered)
    yield "other names in each line", lambda n: head + _filled(n, named)
    yield "other keys", lambda n: head + _filled(n, lambda k: b"k%d = %d\n" % (k, k))
    yield "other tables", lambda n: head + _filled(n, lambda k: b"[t%d]\n" % k)
    yield "other columns", lambda n: first + _filled(n - len(seed), lambda k: b",c%d" % k) + seed
    for one in (*" \t,;\"'19a[{=-.#$:\\<", "é", "한"):
        run = one.encode() * (_RUN // len(one.encode()))

        def line(k: int, run: bytes = run) -> bytes:
            gap = gaps[k % len(gaps)]
            return last[:gap] + run + b"!" + last[gap:] + b"\n"

        yield f"runs of {one!r}", lambda n, line=line: head + _filled(n, line)
        yield f"a run of {one!r}", lambda n, o=one: seed[:middle] + o.encode() * n + seed[middle:]


# Archives ----------------------------------------------------------------------------------------


def packed(parts: dict[str, bytes]) -> bytes:
    """Return a compressed archive."""
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as file:
        for name, content in parts.items():
            file.writestr(name, content)
    return made.getvalue()


def _arrays(**arrays: np.ndarray) -> bytes:
    made = io.BytesIO()
    np.savez_compressed(made, **arrays)
    return made.getvalue()


def arrays(seed: bytes) -> Iterator[tuple[str, Make]]:
    """Yield archives of numbers: as many as are read, in records as far from usual as possible."""
    from shipnet import asi
    from shipnet.line.scope_file import MOST_NUMBERS

    most = MOST_NUMBERS - 100
    polled = np.round(asi.line(60, slaves=2).record(1e-3, rng=1).u.ravel(), 2)
    rng = np.random.default_rng(1)
    bits = np.repeat([0.0, 1.0], 12)
    noise = np.round(rng.normal(size=50_000), 1)
    for name, one in (
        ("zeros", np.zeros(1)),
        ("not a number", np.full(1, np.nan)),
        ("polling", polled),
        ("polling with gaps", np.append(polled, [np.nan] * 5)),
        ("polling with noise", np.resize(polled, 50_000) + noise),
        ("a square wave", bits),
        ("pulses", np.array([0.0] * 8 + [3.0] * 6 + [0.0] * 6 + [-3.0] * 6)),
        ("each sample another", np.array([1.0, -1.0])),
        ("noise", noise),
    ):
        for dt in (0.25e-6, 1e-6):
            for kind in ("f8", "f2"):
                yield (
                    f"{name}, {kind}, steps of {1e6 * dt:g} us",
                    lambda n, one=one, kind=kind, dt=dt: _arrays(
                        u=np.resize(one.astype(kind), most * n // LARGE), dt=np.array(dt)
                    ),
                )
    yield (
        "1024 channels",
        lambda n: _arrays(u=np.zeros((most // 1024 * n // LARGE, 1024)), dt=np.array(1e-6)),
    )
    yield "random numbers", lambda n: _arrays(u=rng.normal(size=n // 8), dt=np.array(1e-6))
    yield (
        "times",
        lambda n: _arrays(u=np.resize(polled, n // 8), t=1e-6 * np.arange(n // 8)),
    )
    yield "many arrays", lambda n: _arrays(**{f"a{k}": np.zeros(1) for k in range(n // 400)})
    with np.load(io.BytesIO(seed)) as held:
        good = {key: held[key] for key in held.files}
    if "channels" in good:  # strokes
        for count in (10, 100, 10_000, 10**6):
            yield (
                f"{count} strokes",
                lambda n, count=count: _arrays(
                    **{
                        key: x if key == "channels" else np.resize(x, (count, *x.shape[1:]))
                        for key, x in good.items()
                    }
                ),
            )


def sessions(seed: bytes) -> Iterator[tuple[str, Make]]:
    """Yield sessions of sigrok that unpack to as much as is read."""
    with zipfile.ZipFile(io.BytesIO(seed)) as file:
        good = {name: file.read(name) for name in file.namelist()}
    part = next((name for name in good if name.startswith("logic")), "logic-1-1")
    analogue = next((name for name in good if name.startswith("analog")), "")
    content = good[part]
    for name, one in (
        ("zeros", b"\0"),
        ("the levels again and again", content),
        ("changes", b"\0\xff"),
        ("changes of ten samples", b"\0" * 10 + b"\xff" * 10),
        ("all levels", bytes(range(256))),
    ):
        for size in (2**23, 2**25, 2**28, 2**29):
            yield (
                f"{name}, {size} samples",
                lambda n, one=one, size=size: packed(
                    good | {part: one * (size // len(one) * n // LARGE)}
                ),
            )
    if analogue:
        for size in (2**22, 2**24 - 100):
            for name, x in (("sines", good[analogue]), ("zeros", bytes(4))):
                yield (
                    f"{name}, {size} voltages",
                    lambda n, x=x, size=size: packed(
                        good | {analogue: x * (4 * size // len(x) * n // LARGE)}
                    ),
                )
    for name, line in (("keys", b"k%d=1\n"), ("probes", b"probe%d=D\n"), ("sections", b"[s%d]\n")):
        yield (
            f"{name} of metadata",
            lambda n, line=line: packed(
                good | {"metadata": good["metadata"] + _filled(n, lambda k: line % k)}
            ),
        )
    yield "spaces in metadata", lambda n: packed(good | {"metadata": b" " * n + good["metadata"]})
    yield "parts", lambda n: packed(good | {f"logic-1-{k}": b"\0" for k in range(1, n // 120)})


_NS = b'xmlns="http://schemas.openxmlformats.org/spreadsheetml/2006/main"'


def workbooks(seed: bytes) -> Iterator[tuple[str, Make]]:
    """Yield workbooks: each kind has a part that is large, or that names many things."""
    with zipfile.ZipFile(io.BytesIO(seed)) as file:
        good = {name: file.read(name) for name in file.namelist()}
    sheet = "xl/worksheets/sheet1.xml"
    front, rows, end = re.fullmatch(
        rb"(.*<sheetData>)(.*)(</sheetData>.*)", good[sheet], re.DOTALL
    ).groups()
    string, inline = b'<c r="A%d" t="s"><v>0</v></c>', b't="inlineStr"><is><t>%s</t></is></c>'
    above = rows.count(b"<row")

    def book(**changed: bytes) -> bytes:
        return packed(good | {name.replace("__", "/"): data for name, data in changed.items()})

    def sheet_of(more: bytes, after: bytes = b"") -> bytes:
        return packed(
            good
            | {sheet: front + rows + more + end.replace(b"</sheetData>", b"</sheetData>" + after)}
        )

    def row(k: int, cells: bytes, look: bytes = b"") -> bytes:
        return b'<row r="%d"%s>%s</row>' % (above + 1 + k, look, cells)

    def cell(k: int, column: bytes, text: bytes) -> bytes:
        return b'<c r="%s%d" ' % (column, above + 1 + k) + inline % text

    def number(k: int, column: bytes, value: bytes, look: bytes = b"") -> bytes:
        return b'<c r="%s%d"%s><v>%s</v></c>' % (column, above + 1 + k, look, value)

    letters = [bytes([a, b]) for a in b"ABCDEFGHIJ" for b in b"ABCDEFGHIJKLMNOPQRSTUVWXYZ"]
    pieces: dict[str, Callable[[int], bytes]] = {
        "rows of text": lambda k: row(k, cell(k, b"A", b"T%d" % k) + cell(k, b"B", b"rtd_3wire")),
        "rows of the same text": lambda k: row(k, string % (above + 1 + k)),
        "rows of numbers": lambda k: row(k, number(k, b"A", b"%d" % k)),
        "rows of huge numbers": lambda k: row(k, number(k, b"C", b"9" * 300)),
        "rows of long numbers": lambda k: row(k, number(k, b"C", b"1" * 30_000)),
        "rows of long text": lambda k: row(k, cell(k, b"A", b"x" * 30_000)),
        "rows of spaces": lambda k: row(k, cell(k, b"B", b"x" + b" " * 30_000 + b"x")),
        "rows of dates": lambda k: row(k, number(k, b"A", b"%d.5" % k, b' s="1"')),
        "rows of errors": lambda k: row(k, number(k, b"A", b"#N/A", b' t="e"')),
        "rows of truth values": lambda k: row(k, number(k, b"A", b"1", b' t="b"')),
        "rows of formulas": lambda k: row(k, b'<c r="A%d"><f>A1+%d</f></c>' % (above + 1 + k, k)),
        "rows of long formulas": lambda k: row(
            k, b'<c r="A%d"><f>%s</f></c>' % (above + 1 + k, b"A1+" * 9000)
        ),
        "empty rows": lambda k: row(k, b""),
        "hidden rows": lambda k: row(k, number(k, b"A", b"1"), b' hidden="1"'),
        "rows with attributes": lambda k: row(k, b"", b' ht="15" customHeight="1" s="1"'),
        "wide rows": lambda k: row(k, b"".join(number(k, one, b"1") for one in letters)),
        "far cells": lambda k: row(k, number(k, b"XFD", b"1")),
        "cells without a place": lambda k: b"<row><c><v>1</v></c></row>",
        "cells of unknown elements": lambda k: row(k, b"<x/><y><z/></y>"),
        "nested elements": lambda k: b"<row>",
        "rich text": lambda k: row(
            k,
            b'<c r="A%d" t="inlineStr"><is><r><t>x</t></r><r><t>y</t></r></is></c>'
            % (above + 1 + k),
        ),
        "comments of XML": lambda k: b"<!-- a -->",
        "a comment of XML": lambda k: (
            b"<!-- " + b"a" * 900_000 + b" -->" if k == 0 else b" " * 99_000
        ),
        "entities": lambda k: row(k, cell(k, b"A", b"&amp;" * 3000)),
        "character references": lambda k: row(k, cell(k, b"A", b"&#65;" * 3000)),
        "white space": lambda k: b" " * 9999,
        "attributes of a row": lambda k: (
            b"<row %s/>" % b" ".join(b'a%d="1"' % j for j in range(3000))
        ),
    }
    for name, piece in pieces.items():
        # Text compresses well, so the sheet is larger than the file.
        for times in (1, 4, 12):
            yield (
                f"{name}, {times} MB",
                lambda n, piece=piece, times=times: sheet_of(_filled(times * n, piece)),
            )
    hundred = b"".join(row(k, number(k, b"A", b"1")) for k in range(2000))
    for name, area in (
        ("equal merged areas", lambda k: b"A3:A2000"),
        ("merged areas below each other", lambda k: b"A%d:B%d" % (3 + 2 * k, 4 + 2 * k)),
        ("nested merged areas", lambda k: b"A3:B%d" % (4 + k % 2000)),
        ("merged areas of a sheet", lambda k: b"A1:XFD1048576"),
        ("merged areas far right", lambda k: b"XFD3:XFD%d" % (4 + k % 2000)),
    ):
        yield (
            name,
            lambda n, area=area: sheet_of(
                hundred,
                b"<mergeCells>%s</mergeCells>"
                % _filled(n, lambda k: b'<mergeCell ref="%s"/>' % area(k)),
            ),
        )
    for name, piece in (
        ("hyperlinks", lambda k: b'<hyperlink ref="A%d" display="x"/>' % (k + 1)),
        ("conditional formats", lambda k: b'<conditionalFormatting sqref="A%d"/>' % (k + 1)),
        ("validations", lambda k: b'<dataValidation type="list" sqref="A%d"/>' % (k + 1)),
        ("breaks", lambda k: b'<brk id="%d"/>' % k),
    ):
        for times in (1, 4):
            yield (
                f"{name}, {times} MB",
                lambda n, piece=piece, times=times: sheet_of(hundred, _filled(times * n, piece)),
            )
    types, relations = "[Content_Types].xml", "xl/_rels/workbook.xml.rels"
    shared = b'<Override PartName="/xl/sharedStrings.xml" ContentType="application/vnd.openxml'
    shared += b'formats-officedocument.spreadsheetml.sharedStrings+xml"/>'
    for name, piece in (
        ("shared strings", lambda k: b"<si><t>x%d</t></si>" % k),
        ("long shared strings", lambda k: b"<si><t>%s</t></si>" % (b"x" * 30_000)),
        ("rich shared strings", lambda k: b"<si><r><rPr><b/></rPr><t>x</t></r></si>"),
    ):
        for times in (1, 4):

            def strings(n: int, piece: Callable[[int], bytes] = piece, times: int = times) -> bytes:
                changed = {
                    "xl/sharedStrings.xml": b"<sst %s>%s</sst>" % (_NS, _filled(times * n, piece))
                }
                if b"sharedStrings" not in good[types]:
                    changed[types] = good[types].replace(b"</Types>", shared + b"</Types>")
                return packed(good | changed)

            yield f"{name}, {times} MB", strings
    style = good["xl/styles.xml"]
    for name, before, piece in (
        ("fonts", b"</fonts>", b'<font><name val="A"/><strike/></font>'),
        ("formats", b"</cellXfs>", b'<xf numFmtId="0" fontId="0"/>'),
        ("number formats", b"<fonts", b'<numFmt numFmtId="200" formatCode="0"/>'),
        ("named styles", b"</cellStyles>", b'<cellStyle name="x" xfId="0"/>'),
    ):
        yield (
            name,
            lambda n, before=before, piece=piece: packed(
                good | {"xl/styles.xml": style.replace(before, piece * (n // len(piece)) + before)}
            ),
        )
    whole = good["xl/workbook.xml"]
    yield (
        "defined names",
        lambda n: packed(
            good
            | {
                "xl/workbook.xml": whole.replace(
                    b"</sheets>",
                    b"</sheets><definedNames>%s</definedNames>"
                    % _filled(n, lambda k: b'<definedName name="n%d">S!$A$1</definedName>' % k),
                )
            }
        ),
    )
    yield (
        "sheets that are named",
        lambda n: packed(
            good
            | {
                "xl/workbook.xml": whole.replace(
                    b"</sheets>",
                    _filled(
                        n, lambda k: b'<sheet name="s%d" sheetId="%d" r:id="rId1"/>' % (k, k + 2)
                    )
                    + b"</sheets>",
                )
            }
        ),
    )
    yield (
        "relations",
        lambda n: packed(
            good
            | {
                relations: good[relations].replace(
                    b"</Relationships>",
                    _filled(n, lambda k: b'<Relationship Id="x%d" Type="t" Target="a%d"/>' % (k, k))
                    + b"</Relationships>",
                )
            }
        ),
    )
    yield "parts", lambda n: packed(good | {f"xl/x{k}.xml": b"<a/>" for k in range(n // 120)})
    yield (
        "content types",
        lambda n: packed(
            good
            | {
                types: good[types].replace(
                    b"</Types>",
                    _filled(n, lambda k: b'<Default Extension="e%d" ContentType="t"/>' % k)
                    + b"</Types>",
                )
            }
        ),
    )
    yield "comments of cells", commented
    yield "a picture", lambda n: packed(good | {"xl/media/a.png": bytes(n)})
    yield "a bomb", lambda n: packed(good | {"xl/media/a.png": bytes(2**28)})


def commented(size: int) -> bytes:
    """Return a workbook with a comment in each row, as openpyxl writes it."""
    import openpyxl
    from openpyxl.comments import Comment

    book = openpyxl.Workbook()
    sheet = book.active
    sheet.append(["tag", "signal", "x_m", "y_m", "z_m"])
    for k in range(size // 300):
        sheet.append([f"TI {k}", "rtd_3wire", 1.0, 2.0, 3.0])
        sheet.cell(k + 2, 1).comment = Comment(f"to be confirmed, no. {k}", "an engineer")
    made = io.BytesIO()
    book.save(made)
    return made.getvalue()


def inputs(name: str, seed: bytes) -> Iterator[tuple[str, Make]]:
    """Yield the large inputs of a target, made from one of its seeds."""
    if name.startswith("I/O list.xlsx"):
        return workbooks(seed)
    if seed[:2] == b"PK":
        return sessions(seed) if b"metadata" in seed else arrays(seed)
    return texts(seed)


def forked(job: Callable[[], object]) -> tuple[float, float, str]:
    """Return the processor time [s], peak memory [MB] and failure of a job in a new process."""
    from targets import REFUSALS

    child = os.fork()
    if not child:
        resource.setrlimit(resource.RLIMIT_CPU, (HANGS, HANGS))
        code = 1
        try:
            job()
            code = 0
        except REFUSALS:
            code = 0
        except BaseException as error:
            print(f"{type(error).__name__}: {error}"[:300], file=sys.stderr, flush=True)
        os._exit(code)
    _, status, used = os.wait4(child, 0)
    took, peak = used.ru_utime + used.ru_stime, used.ru_maxrss / 1024
    failure = "raised what is not a refusal" if status else ""
    if os.WIFSIGNALED(status):
        failure = f"ended by signal {os.WTERMSIG(status)}"
    if took > SECONDS or peak > MEGABYTES:
        failure += " beyond the limits"
    return took, peak, failure


def costs(name: str, file: Path) -> Iterator[Cost]:
    """Yield the cost of each large input of a target; the inputs are written to a file."""
    from targets import REFUSALS, TARGETS

    target = TARGETS[name]

    def read(make: Make, size: int) -> tuple[float, float, str]:
        # What is made and unpacked here would count as memory of the reader.
        file.unlink(missing_ok=True)
        forked(lambda: file.write_bytes(make(size)))
        return forked(lambda: target.run(file.read_bytes()))

    for seed in [*target.seeds()]:
        with suppress(*REFUSALS):
            target.run(seed)  # loads what it needs
        for kind, make in inputs(name, seed):
            took, peak, failure = read(make, LARGE)
            size, exponent = file.stat().st_size, 0.0
            if size > 1.05e6:
                continue  # too large to count
            if failure:
                shutil.copy(file, file.with_name(f"{file.name}-{_slug(kind)}"))
            if took > 0.3:
                before, *_ = read(make, LARGE // 4)
                exponent = math.log(took / max(before, 1e-3), 4)
            yield Cost(kind, size, took, peak, exponent, failure)


def main() -> int:
    """Print the costs of the largest inputs of some targets."""
    from targets import TARGETS

    failed, folder = 0, Path("build/fuzz")
    folder.mkdir(parents=True, exist_ok=True)
    for name in sys.argv[1:] or TARGETS:
        all_of = sorted(costs(name, folder / f"{_slug(name)}-large"), key=lambda one: -one.seconds)
        bad = [one for one in all_of if one.failure]
        failed += len(bad)
        highest = max((one.megabytes for one in all_of), default=0)
        print(f"{name}: {len(all_of)} inputs, at most {highest:.0f} MB, {len(bad)} failed")
        for one in dict.fromkeys([*all_of[:3], *bad]):
            print(f"    {one}", flush=True)
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(main())
