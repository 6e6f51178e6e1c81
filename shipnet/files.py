"""Opening files that others wrote: no pipe is waited for, and no huge file fills the memory."""

from __future__ import annotations

from os import PathLike, fstat
from pathlib import Path
from typing import IO

from shipnet.errors import InputError

#: Maximum sizes of files that are read as a whole: of a table, and of a record or log [byte].
LARGEST_TABLE, LARGEST_RECORD = 2**24, 2**30

#: Maximum length of a cell or line [characters]; a spreadsheet allows no longer cell.
LONGEST = 2**15 - 1


def open_file(path: str | PathLike[str], most: int | None = None) -> IO[bytes]:
    """Open a regular file of at most `most` bytes, or raise InputError."""
    why = "cannot be read: it is not a file, but a folder, a pipe or a device"
    try:
        file = Path(path)
        # Opening a pipe waits for a writer, and a device may have no end.
        if not file.exists() or file.is_file():
            stream = file.open("rb")
            if most is None or fstat(stream.fileno()).st_size <= most:
                return stream
            stream.close()
            why = f"is larger than {most} bytes; save a part of it"
    except OSError as error:
        why = f"cannot be read: {error.strerror or error}"
    except ValueError as error:  # no system accepts this path: it contains a zero byte
        why = f"cannot be read: {error}"
    raise InputError(str(path), why)


def read_bytes(path: str | PathLike[str], most: int = LARGEST_TABLE) -> bytes:
    """Return the content of a regular file of at most `most` bytes, or raise InputError."""
    with open_file(path, most) as stream:
        return stream.read(most)
