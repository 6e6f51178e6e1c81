"""Recorded CAN frames as columns: candump logs by ourselves, other formats through python-can."""

from __future__ import annotations

import io
import os
import re
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.can.files.extras import load_extra
from shipnet.errors import ArgumentError, InputError

__all__ = ["Log", "read_log", "write_log"]

Booleans = npt.NDArray[np.bool_]

#: One line of a log as candump writes it and python-can, which adds the direction. A remote frame
#: has R and perhaps its DLC in the place of its data.
_START = rb"^\((\d{1,10}\.\d{1,9})\) +(\S+) +([0-9A-Fa-f]{8}|[0-9A-Fa-f]{3})#"
_END = rb"(?: [RT])?[ \t]*\r?$"
_LINE = re.compile(_START + rb"(?:([Rr][0-8]?)|((?:[0-9A-Fa-f]{2}){0,8}))" + _END, re.M)
#: The same for most lines, and faster; it does not see an odd number of digits.
_QUICK = re.compile(_START + rb"([Rr][0-8]?|)([0-9A-Fa-f]{0,16})" + _END, re.M)

#: Flag in an identifier of 8 digits: not a frame but an error, from linux/can.h, CAN_ERR_FLAG.
_ERROR_FLAG = 0x20000000

_LONGEST, _SHORTEST = 0x1FFFFFFF, 0x7FF

#: Formats of python-can that are read, and whether they consist of lines.
_FORMATS = {".asc": True, ".blf": False, ".csv": True, ".trc": True}

#: About how much of a file is worked on at once [byte], and how many faults are kept.
_BLOCK, _FAULTS = 1 << 22, 1000


class Log(NamedTuple):
    """Frames in the order of the file.

    Attributes
    ----------
    time : ndarray of float, shape (n,)
        Time stamps [s].
    channel : ndarray of str, shape (n,)
        Name of the bus.
    arbitration_id : ndarray of int64, shape (n,)
        Identifier.
    extended, remote, error : ndarray of bool, shape (n,)
        Whether the identifier has 29 bits, whether the frame asks for data, and whether it is no
        frame but the report of an error.
    dlc : ndarray of uint8, shape (n,)
        Data length code.
    data : ndarray of uint8, shape (n, 8)
        Data, 0 behind their end.
    faults : tuple of str
        What could not be read, if the reader was asked to keep the rest; the first thousand.
    """

    time: npt.NDArray[np.float64]
    channel: npt.NDArray[np.str_]
    arbitration_id: npt.NDArray[np.int64]
    extended: Booleans
    remote: Booleans
    error: Booleans
    dlc: npt.NDArray[np.uint8]
    data: npt.NDArray[np.uint8]
    faults: tuple[str, ...] = ()


def read_log(path: str | os.PathLike[str], *, keep: bool = False) -> Log:
    r"""Read a log of classic CAN frames.

    Parameters
    ----------
    path : str or path-like
        File with the suffix ``.log`` (of candump -l), or ``.asc``, ``.blf``, ``.csv`` or ``.trc``,
        for which python-can is needed.
    keep : bool, default False
        Whether to keep what can be read of a damaged file; its `Log.faults` then say what is
        missing. A format that python-can reads ends at its first fault.

    Returns
    -------
    Log
        Its columns; a file without frames gives columns without rows.

    Raises
    ------
    InputError
        If the file is missing or of another kind, or, unless `keep`, if anything in it cannot be
        read; the message gives the numbers of the lines. CAN FD frames count as faults.
    ImportError
        If python-can is needed and missing.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder, "bus.log")
    ...     _ = path.write_text("(12.5) can0 123#0102\n(12.6) can0 00000123#R\n")
    ...     log = read_log(path)
    >>> log.time.tolist(), log.dlc.tolist(), log.extended.tolist(), log.remote.tolist()
    ([12.5, 12.6], [2, 0], [False, True], [False, True])
    """
    file = Path(path)
    kind = file.suffix.lower()
    if kind != ".log" and kind not in _FORMATS:
        known = ", ".join([".log", *_FORMATS])
        raise InputError(str(path), f"its suffix is {kind!r}; it must be one of {known}")
    can = None if kind == ".log" else load_extra("can")
    try:
        log, faults = _read_candump(file) if can is None else _read_foreign(file, kind, can)
    except OSError as problem:
        raise InputError(str(path), f"cannot be read: {problem.strerror}") from None
    if faults and not keep:
        raise InputError(str(path), *faults[:_FAULTS], more=max(0, len(faults) - _FAULTS))
    return log._replace(faults=tuple(faults[:_FAULTS]))


def write_log(path: str | os.PathLike[str], log: Log) -> None:
    """Write frames as candump -l does.

    Parameters
    ----------
    path : str or path-like
        File to write; its suffix must be ``.log``.
    log : Log
        Frames; times are rounded to microseconds.

    Raises
    ------
    ArgumentError
        If the suffix is another, or the columns differ in length.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> no = np.zeros(1, dtype=bool)
    >>> data = np.array([[1, 2, 0, 0, 0, 0, 0, 0]], dtype=np.uint8)
    >>> log = Log(np.array([12.5]), np.array(["can0"]), np.array([0x123]), no, no, no,
    ...           np.array([2], dtype=np.uint8), data)
    >>> with TemporaryDirectory() as folder:
    ...     write_log(f"{folder}/bus.log", log)
    ...     print(Path(folder, "bus.log").read_text(), end="")
    (0000000012.500000) can0 123#0102
    """
    if Path(path).suffix.lower() != ".log":
        raise ArgumentError(f"path is {str(path)!r}; its suffix must be .log")
    if len({len(column) for column in log[:8]}) != 1:
        raise ArgumentError(f"log has columns of {[len(c) for c in log[:8]]} rows; all must agree")
    text = log.data.astype(np.uint8).tobytes().hex().upper()
    columns = (column.tolist() for column in log[:7])
    with open(path, "w", encoding="utf-8", newline="\n") as file:
        for row, (time, channel, number, long, remote, error, dlc) in enumerate(
            zip(*columns, strict=True)
        ):
            name = f"{number | _ERROR_FLAG:08X}" if error else f"{number:0{8 if long else 3}X}"
            rest = f"R{dlc or ''}" if remote else text[16 * row : 16 * row + 2 * min(dlc, 8)]
            file.write(f"({time:017.6f}) {channel} {name}#{rest}\n")


def _read_candump(file: Path) -> tuple[Log, list[str]]:
    parts, faults, before = [], [], 0
    with open(file, "rb") as stream:
        while lines := stream.readlines(_BLOCK):
            good = _QUICK.findall(b"".join(lines))
            rows = np.arange(len(lines))
            if len(good) < len(lines) or any(len(g[4]) % 2 or (g[3] and g[4]) for g in good):
                matches = [_LINE.match(line) for line in lines]
                faults += [
                    f"line {before + row + 1}: {_shown(lines[row])} is no frame; expected "
                    "(seconds) channel identifier#data"
                    for row, match in enumerate(matches)
                    if match is None and lines[row].strip()
                ]
                good = [match.groups(b"") for match in matches if match is not None]
                rows = np.array([row for row, match in enumerate(matches) if match is not None])
            part = _columns(good)
            high = part.arbitration_id > np.where(part.extended, _LONGEST, _SHORTEST)
            if high.any():
                faults += [
                    f"line {before + rows[at] + 1}: the identifier {part.arbitration_id[at]:X} is "
                    f"above {_LONGEST if part.extended[at] else _SHORTEST:X}"
                    for at in np.flatnonzero(high)
                ]
                part = Log._make([*(column[~high] for column in part[:8]), ()])
            parts.append(part)
            before += len(lines)
    faults.sort(key=lambda fault: int(fault.split()[1].rstrip(":")))
    return _joined(parts), faults


def _columns(groups: list[tuple[bytes, ...]]) -> Log:
    if not groups:
        return _joined([])
    time, channel, number, remote, data = zip(*groups, strict=True)
    ids = np.array([int(text, 16) for text in number], dtype=np.int64)
    long = np.array([len(text) == 8 for text in number])
    error = long & (ids >> 29 == 1)
    asks = np.array([text != b"" for text in remote])
    dlc = [
        int(ask[1:] or b"0") if ask else len(octets) // 2
        for octets, ask in zip(data, remote, strict=True)
    ]
    names = {name: name.decode("utf-8", "replace") for name in set(channel)}
    text = b"".join([octets.ljust(16, b"0") for octets in data]).decode("ascii")
    return Log(
        np.array(time).astype(float),
        np.array([names[name] for name in channel]),
        np.where(error, ids & _LONGEST, ids),
        long & ~error,
        asks,
        error,
        np.array(dlc, dtype=np.uint8),
        np.frombuffer(bytes.fromhex(text), dtype=np.uint8).reshape(-1, 8),
    )


class _Lines(io.TextIOWrapper):
    """A text file that knows its line."""

    line = 0

    def __next__(self) -> str:  # type: ignore[override] # io's stubs say bytes
        self.line += 1
        return super().__next__()


def _read_foreign(file: Path, kind: str, can: Any) -> tuple[Log, list[str]]:
    readers = {".asc": "ASCReader", ".blf": "BLFReader", ".csv": "CSVReader", ".trc": "TRCReader"}
    messages: list[Any] = []
    faults: list[str] = []
    with open(file, "rb") as binary:
        stream = _Lines(binary, "utf-8", errors="replace") if _FORMATS[kind] else None
        try:
            for message in getattr(can, readers[kind])(stream or binary):
                if message.is_fd:
                    raise ValueError("a CAN FD frame")
                messages.append(message)
        # The readers raise whatever their parsing meets.
        except Exception as problem:
            place = f"line {stream.line}" if stream else f"behind frame {len(messages)}"
            faults.append(f"{place}: {problem or type(problem).__name__}")
    data = np.zeros((len(messages), 8), dtype=np.uint8)
    for row, message in enumerate(messages):
        data[row, : len(message.data)] = list(message.data)
    log = Log(
        np.array([message.timestamp for message in messages], dtype=float),
        np.array([str(message.channel) for message in messages], dtype=str),
        np.array([message.arbitration_id for message in messages], dtype=np.int64),
        np.array([message.is_extended_id for message in messages], dtype=bool),
        np.array([message.is_remote_frame for message in messages], dtype=bool),
        np.array([message.is_error_frame for message in messages], dtype=bool),
        np.array([message.dlc for message in messages], dtype=np.uint8),
        data,
    )
    return log, faults


def _joined(parts: list[Log]) -> Log:
    kinds: list[Any] = [float, str, np.int64, bool, bool, bool, np.uint8]
    empty = [*(np.zeros(0, dtype=kind) for kind in kinds), np.zeros((0, 8), dtype=np.uint8)]
    filled = [part for part in parts if len(part.time)]
    if not filled:
        return Log._make([*empty, ()])
    columns = zip(*(part[:8] for part in filled), strict=True)
    return Log._make([*(np.concatenate(column) for column in columns), ()])


def _shown(line: bytes) -> str:
    text = line.decode("utf-8", "replace").strip()
    return repr(text if len(text) <= 60 else text[:57] + "...")
