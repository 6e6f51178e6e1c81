"""An Excel workbook as its file is: an archive of XML parts that refer to each other."""

from __future__ import annotations

import posixpath
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import datetime
from io import BytesIO
from lzma import LZMAError
from xml.parsers import expat
from zipfile import BadZipFile, ZipFile

from shipnet.errors import ArgumentError, InputError
from shipnet.workbook.moments import kind_of
from shipnet.workbook.parts import Elements, Gatherer, Merged, Row, Rows, Strings

__all__ = ["Workbook"]

#: Most bytes that a workbook may unpack to.
_UNPACKED = 2**28

_CHUNK = 2**16


class Workbook:
    """An Excel workbook.

    Parameters
    ----------
    data : bytes
        What the file holds.
    source : str, default "workbook"
        What to call it in an error.

    Raises
    ------
    InputError
        If it is no workbook, is torn, or unpacks to more than 256 MiB.

    Examples
    --------
    >>> Workbook(b"PK")
    Traceback (most recent call last):
        ...
    shipnet.errors.InputError: workbook: is no Excel workbook (.xlsx): File is not a zip file
    """

    def __init__(self, data: bytes, source: str = "workbook") -> None:
        self._source = source
        with _told(source):
            self._archive = ZipFile(BytesIO(data))
            entries = self._archive.infolist()
            if sum(entry.file_size for entry in entries) > _UNPACKED:
                raise InputError(
                    source, f"unpacks to more than {_UNPACKED} bytes; expected a table"
                )
            self._parts = {_known(entry.filename): entry for entry in entries}
            kinds = dict(self._relations("").values())
            book = kinds["officeDocument"]
            related = self._relations(book)
            parts = dict(related.values())
            self._strings = self._read_strings(parts.get("sharedStrings"))
            self._formats = self._read_formats(parts.get("styles"))
            self._epoch = datetime(1899, 12, 30)
            self._sheets: dict[str, str] = {}
            hidden = []
            for _, name, own in self._elements(book):
                if name == "workbookPr" and own.get("date1904") in ("1", "true"):
                    self._epoch = datetime(1904, 1, 1)
                elif name == "sheet" and related[own["id"]][0] == "worksheet":
                    self._sheets[own["name"]] = related[own["id"]][1]
                    if own.get("state", "visible") != "visible":
                        hidden.append(own["name"])
            self._hidden = tuple(hidden)
            if not self._sheets:
                raise InputError(source, "has no sheet with cells; expected an Excel workbook")

    @property
    def sheets(self) -> tuple[str, ...]:
        """Names of the sheets with cells, in their order, hidden ones too."""
        return tuple(self._sheets)

    @property
    def hidden(self) -> tuple[str, ...]:
        """Names of those of the sheets that Excel does not show."""
        return self._hidden

    def rows(self, sheet: str, merged: list[Merged] | None = None) -> Iterator[Row]:
        """Yield the rows of a sheet that the file holds, also those without anything in a cell.

        Parameters
        ----------
        sheet : str
            One of `sheets`.
        merged : list of Merged, optional
            Gets the merged cells, once all rows have been yielded: the file names them behind.

        Yields
        ------
        Row
            Whole numbers without a decimal point, other numbers with the digits that tell them
            apart; of a formula, the value that was saved with it; of merged cells, only the first
            holds anything.

        Raises
        ------
        ArgumentError
            If there is no such sheet.
        InputError
            If the sheet is torn, its rows or cells are out of order or outside Excel's grid, or
            it spans more than 16 777 216 cells.
        """
        if sheet not in self._sheets:
            raise ArgumentError(f"sheet is {sheet!r}; it must be one of {', '.join(self._sheets)}")
        taker = Rows(self._strings, self._formats, self._epoch)
        with _told(self._source):
            for _ in self._parse(self._sheets[sheet], taker):
                yield from taker.done
                taker.done.clear()
        if merged is not None:
            merged += taker.merged

    def _parse(self, part: str, taker: Gatherer) -> Iterator[None]:
        """Have the elements of a part taken, chunk by chunk."""
        entry = self._parts.get(_known(part))
        if entry is None:
            raise ValueError(f"it has no part {part!r}")
        parser = expat.ParserCreate(namespace_separator=" ")
        parser.buffer_text = True
        parser.StartDoctypeDeclHandler = _refuse
        parser.StartElementHandler, parser.EndElementHandler = taker.start, taker.end
        parser.CharacterDataHandler = taker.pieces.append
        with self._archive.open(entry) as stream:
            while chunk := stream.read(_CHUNK):
                parser.Parse(chunk)
                yield
        parser.Parse(b"", True)
        yield

    def _elements(self, part: str) -> Iterator[tuple[str, str, dict[str, str]]]:
        """Yield each element of a part: name of its parent, its name, its attributes."""
        taker = Elements()
        for _ in self._parse(part, taker):
            yield from taker.done
            taker.done.clear()

    def _relations(self, part: str) -> dict[str, tuple[str, str]]:
        """Return kind and path of the parts that a part refers to, by the names it has for them."""
        folder, name = posixpath.split(part)
        found = {}
        for _, element, own in self._elements(posixpath.join(folder, "_rels", f"{name}.rels")):
            if element == "Relationship" and own.get("TargetMode") != "External":
                path = posixpath.normpath(posixpath.join("/", folder, own["Target"]))
                found[own["Id"]] = own["Type"].rpartition("/")[2], path.lstrip("/")
        return found

    def _read_strings(self, part: str | None) -> list[str]:
        """Return the texts that cells share."""
        taker = Strings()
        for _ in self._parse(part, taker) if part is not None else ():
            pass
        return taker.found

    def _read_formats(self, part: str | None) -> dict[str, str]:
        """Return what the numbers of a style are, as `kind_of`; others are plain numbers."""
        codes: dict[str, str] = {}
        styles = []
        for parent, name, own in self._elements(part) if part is not None else ():
            if (parent, name) == ("numFmts", "numFmt"):
                codes[own["numFmtId"]] = own["formatCode"]
            elif (parent, name) == ("cellXfs", "xf"):
                styles.append(own.get("numFmtId", "0"))
        kinds = {str(place): kind_of(int(n), codes.get(n)) for place, n in enumerate(styles)}
        return {place: kind for place, kind in kinds.items() if kind}


@contextmanager
def _told(source: str) -> Iterator[None]:
    """Say what is wrong with a file, whatever finds it."""
    try:
        yield
    except InputError:
        raise
    except (
        BadZipFile, EOFError, LZMAError, LookupError, OSError, OverflowError, RuntimeError,
        ValueError, expat.ExpatError, zlib.error,
    ) as error:  # fmt: skip
        said = " ".join(str(error).split())[:200]
        raise InputError(source, f"is no Excel workbook (.xlsx): {said}") from None


def _known(part: str) -> str:
    """Return a name of a part as it is compared; some programs on Windows write backslashes."""
    return part.replace("\\", "/").casefold()


def _refuse(*declared: object) -> None:
    """Refuse a DTD: no spreadsheet writes one, and its entities could grow without bound."""
    raise ValueError(f"it declares a document type {declared[0]!r}")
