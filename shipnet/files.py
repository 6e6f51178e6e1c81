"""Reading files that others wrote, and writing files as a whole or not at all.

No pipe is waited for, and no huge file fills the memory.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from os import PathLike, fstat
from pathlib import Path
from shutil import copymode
from tempfile import TemporaryDirectory
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


@contextmanager
def as_file(name: str, content: bytes, file: str = "file.csv") -> Iterator[Path]:
    """Yield the path of a temporary file with this content; errors in it state `name`."""
    with TemporaryDirectory() as folder:
        path = Path(folder, file)
        path.write_bytes(content)
        try:
            yield path
        except InputError as mistake:
            raise InputError(name, *mistake.faults, more=mistake.more) from None


@contextmanager
def complete(path: str) -> Iterator[str]:
    """Yield a path for a file or folder that replaces `path` when it is complete.

    A folder keeps its other files. After an error nothing has changed.
    """
    target = Path(path).resolve()
    try:
        if target.exists() and not (target.is_file() or target.is_dir()):
            yield path  # a device is not replaced
            return
        beside = target if target.is_dir() else target.parent
        with TemporaryDirectory(prefix=".shipnet-", dir=beside) as folder:
            new = Path(folder, f"new{Path(path).suffix}")
            yield str(new)
            for part in filter(Path.is_file, [new, *new.rglob("*")]):
                file = target / part.relative_to(new)
                file.parent.mkdir(parents=True, exist_ok=True)
                if file.exists():
                    copymode(file, part)
                part.replace(file)
    except OSError as error:
        raise InputError(path, f"cannot be written: {error.strerror or error}") from None
