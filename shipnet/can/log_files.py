"""Readers of CAN logs in the formats candump, Yacht Devices RAW, CSV, ASC, BLF and TRC.

Records become rows, which `_Records.add` checks. python-can is used for ASC and TRC files, but not
for BLF, because its BLF reader may never finish on a damaged file.
"""

from __future__ import annotations

import io
import os
import re
import zlib
from base64 import b64decode
from bisect import bisect_right
from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from functools import partial
from math import nan
from pathlib import Path
from struct import error as StructError
from struct import unpack_from
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.can.log import Log, impossible
from shipnet.can.messages import one_line
from shipnet.errors import InputError, load_extra

_ROWS = 1 << 16  #: Number of rows kept as Python objects; more rows are packed into an array.
_FAULTS = 1000  #: Largest number of faults recorded per file.

#: Kinds of valid records other than classic CAN frames, and data lengths used only by CAN FD.
_FD, _ERROR, _FD_SIZES = "CAN FD frame", "error frame", (12, 16, 20, 24, 32, 48, 64)


class _Row(NamedTuple):
    """A record; `time` [s] is None if missing, and `kind` is empty for a classic CAN frame."""

    time: float | None
    channel: str
    number: int
    extended: bool
    remote: bool
    dlc: int
    data: bytes
    kind: str = ""


#: Columns of a log, and the position of each frame in the file.
_COLUMNS = np.dtype(
    [
        ("time", float),
        ("channel", object),
        ("arbitration_id", np.int64),
        ("extended", bool),
        ("remote", bool),
        ("dlc", np.uint8),
        ("data", "S8"),
        ("position", np.int64),
    ]
)


class _Records:
    """The records read from a file so far; a position is a line or frame number, as `unit` says."""

    def __init__(self, unit: str) -> None:
        self.unit = unit
        self.rows: list[tuple[Any, ...]] = []
        self.packed: list[npt.NDArray[np.void]] = []
        self.skipped: list[tuple[float, str, str]] = []
        self.faults: list[tuple[int, str]] = []
        self.more = 0

    def fault(self, position: int, why: str, where: str = "") -> None:
        """Record a fault at a position."""
        if len(self.faults) < _FAULTS:
            self.faults.append((position, f"{where or f'{self.unit} {position}'}: {why}"))
        else:
            self.more += 1

    def add(self, position: int, row: _Row) -> None:
        """Add a row to the frames, to the skipped records or, if it is illegal, to the faults."""
        time = nan if row.time is None else row.time
        if row.kind:
            self.skipped.append((time, row.channel, row.kind))
            return
        checked = 0.0 if row.time is None else time
        why = impossible(checked, row.number, row.extended, row.dlc, row.remote, len(row.data))
        if why:
            self.fault(position, why)
            return
        self.rows.append((time, *row[1:7], position))
        if len(self.rows) == _ROWS:
            self.pack()

    def pack(self) -> None:
        """Move the rows into an array, which takes less memory."""
        self.packed.append(np.array(self.rows, dtype=_COLUMNS))
        self.rows = []

    def log(self) -> tuple[Log, int]:
        """Return the log, and the number of faults that it does not list."""
        self.pack()
        frames = np.concatenate(self.packed)
        time, channel = frames["time"], frames["channel"].astype(str)
        without = np.isnan(time)
        bad = without & ~without.all()
        for name in np.unique(channel) if np.any(np.diff(time) < 0) else ():
            on_channel = np.flatnonzero((channel == name) & ~bad)
            bad[on_channel[_out_of_order(time[on_channel])]] = True
        for at in np.flatnonzero(bad):
            why = f"the time {time[at]} s is out of order on {channel[at]}"
            position = int(frames["position"][at])
            self.fault(position, "it has no time, but others do" if without[at] else why)
        frames, channel = frames[~bad], channel[~bad]
        data = np.ascontiguousarray(frames["data"]).view(np.uint8).reshape(-1, 8)
        log = Log(
            frames["time"],
            channel,
            frames["arbitration_id"],
            frames["extended"],
            frames["remote"],
            frames["dlc"],
            data,
            tuple(why for _, why in sorted(self.faults)),
            tuple(self.skipped),
        )
        return log, self.more


def _out_of_order(time: npt.NDArray[np.float64]) -> npt.NDArray[np.intp]:
    """Return the smallest set of indices to remove so that times never decrease."""
    if not np.any(np.diff(time) < 0):
        return np.zeros(0, dtype=np.intp)
    # Longest non-decreasing subsequence: the smallest last value per length, and its index.
    lasts: list[float] = []
    ends: list[int] = []
    before = np.full(len(time), -1)
    # The search runs backwards so that, of two equally long sequences, the earlier one is kept.
    for position, now in enumerate((-time[::-1]).tolist()):
        length = bisect_right(lasts, now)
        before[position] = ends[length - 1] if length else -1
        lasts[length : length + 1], ends[length : length + 1] = [now], [position]
    kept = np.zeros(len(time), dtype=bool)
    position = ends[-1]
    while position >= 0:
        kept[position] = True
        position = int(before[position])
    return np.flatnonzero(~kept[::-1])


def read_log(path: str | os.PathLike[str], *, keep: bool = False) -> Log:
    r"""Read a log of classic CAN frames.

    Parameters
    ----------
    path : str or path-like
        A log written by ``candump -l`` or printed by candump, a RAW log of Yacht Devices, a CSV
        file from python-can or SavvyCAN, or a BLF, ASC or TRC file; ASC and TRC require
        python-can. The format is recognised by content, or otherwise by suffix.
    keep : bool, default False
        True to keep the readable frames of a damaged file; `Log.faults` lists what is missing.

    Returns
    -------
    Log
        The frames. CAN FD frames and error frames are not faults; `Log.skipped` lists them.

    Raises
    ------
    InputError
        If the file cannot be read or is an MDF file; or, unless `keep` is True, if it has an
        unreadable record, an illegal identifier, data length or time, too few or too many data
        bytes, or times that decrease on a channel. The message names the lines or BLF frames.
    ImportError
        If python-can is required but not installed.

    Notes
    -----
    Line numbers, empty lines and comments after ``#``, ``;`` or ``//`` are ignored. With `keep`,
    if times on a channel decrease, as few frames as possible are left out to restore the order.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder, "bus.log")
    ...     _ = path.write_text("(12.5) can0 123#0102\n(12.6) can0 00000123#R\n")
    ...     log = read_log(path)
    >>> log
    Log(2 frames in 0.1 s)
    >>> log.time.tolist(), log.dlc.tolist(), log.extended.tolist(), log.remote.tolist()
    ([12.5, 12.6], [2, 0], [False, True], [False, True])
    """
    file = Path(path)
    try:
        kind = log_kind(file) or "text"
        if kind == "mdf":
            raise InputError(
                str(path),
                "is an MDF (MF4) file, which cannot be read; convert it to ASC or BLF with asammdf "
                "or the software of the logger",
            )
        readers = {"text": _read_text, "blf": _read_blf}
        records = readers.get(kind, partial(_read_foreign, kind))(file)
    except OSError as problem:
        raise InputError(str(path), f"cannot be read: {problem.strerror}") from None
    log, more = records.log()
    if log.faults and not keep:
        raise InputError(str(path), *log.faults, more=more)
    return log


#: Patterns at the beginning of a line that identify a text format.
_SIGNS = {
    "asc": re.compile(
        r"(date\s+\w+\s|base\s+(hex|dec)\b|begin\s+triggerblock|"
        r"\d+\.\d+\s+(CANFD|\d+\s+(ErrorFrame|[0-9a-f]+x?\s+[TR]x))\b)",
        re.I,
    ),
    "trc": re.compile(r";\$|\d+\)\s+\d"),
}


def log_kind(file: Path) -> str:
    """Return the format of a log from its first lines or its suffix, "" if unknown."""
    with open(file, "rb") as stream:
        head = stream.read(1 << 14)
    if head[:4] == b"LOGG":
        return "blf"
    if head[:8] in (b"MDF     ", b"UnFinMF "):
        return "mdf"
    for line in map(str.strip, head.decode("utf-8-sig", "replace").splitlines()):
        for kind, sign in _SIGNS.items():
            if sign.match(line):
                return kind
        if _LINE.match(line) or _RAW.match(line) or _table(line):
            return "text"
    kind = file.suffix.lower()[1:]
    return kind if kind in ("asc", "blf", "trc") else ""


#: A line of candump. A line number, a time or date, and a comment are optional; so is the length in
#: brackets, which has two digits in CAN FD. A remote frame has R in place of data, optionally
#: followed by its DLC. python-can appends the direction.
_LINE = re.compile(
    r"\s*(?:\d+[:.)|]?\s*(?=[(A-Za-z]))?(?:\((?P<time>[^()]{1,40})\)\s+)?"
    r"(?:(?P<channel>\S{1,64})\s+(?:[RT]X\s+[B-]\s+[E-]\s+)?|<0x(?=[0-9A-Fa-f]{3,8}>\s+\[))"
    r"(?P<id>[0-9A-Fa-f]{8}|[0-9A-Fa-f]{3})>?(?:"
    r"#(?:(?P<fd>\#[0-9A-Fa-f]+)|(?P<ask>[Rr](?P<asked>[0-8]?))|(?P<data>(?:[0-9A-Fa-f]{2}){0,8}))"
    r"(?:_(?P<raw>[9A-Fa-f]))?(?:\s+[RT])?"
    r"|\s+\[(?P<size>\d{1,2})\](?P<rest>[^\#;/']*?)(?:\s'.{1,64}')?"
    r")\s*(?:\s(?:\#|;|//).*)?",
    re.S,
)

#: A line of a RAW log of Yacht Devices, whose time is that of the day.
_RAW = re.compile(
    r"\s*(\d\d):([0-5]\d):([0-5]\d(?:\.\d{1,6})?)\s+[RT]\s+([0-9A-Fa-f]{8})((?:\s+[0-9A-Fa-f]{2})*)\s*"
)

#: A line without a frame: a comment, the first line of an early candump, or the explanation of an
#: error by ``candump -e``.
_COMMENT = re.compile(r"\s*(?:\#|;|//|$)|interface = |\t[a-z-]+\{")

#: Legal forms of a number; Python's own conversions also accept underscores.
_DECIMAL = re.compile(r"\d{1,18}(\.\d{0,12})?")
_DIGITS = re.compile(r"(?:0[xX])?[0-9A-Fa-f]{1,16}")


def _read_text(file: Path) -> _Records:
    records = _Records("line")
    parse: Callable[[str], _Row] = _candump
    with open(file, "rb") as stream:
        for position, line in enumerate(stream, start=1):
            text = line.decode("utf-8-sig" if position == 1 else "utf-8", "replace")
            if _COMMENT.match(text):
                continue
            if table := _table(text):
                parse = table
                continue
            if parse is _candump and _RAW.match(text):
                parse = _raw_parser()
            try:
                records.add(position, parse(text))
            except (ValueError, KeyError) as problem:
                records.fault(position, str(problem))
    return records


def _candump(line: str) -> _Row:
    """Return the record in a line of any candump format."""
    match = _LINE.fullmatch(line)
    if match is None:
        raise ValueError(
            f"{_shown(line)} is not a frame; expected (seconds) channel identifier#data"
        )
    has = match.groupdict()
    number, extended = int(has["id"], 16), len(has["id"]) == 8
    channel = has["channel"] or "can0"
    time = None if has["time"] is None else _seconds(has["time"])
    kind, remote = "", bool(has["ask"])
    if extended and number >> 29 == 1:
        kind = _ERROR
    elif has["fd"] or len(has["size"] or "") == 2:
        kind = _FD
    if kind:
        return _Row(time, channel, number, extended, False, 0, b"", kind)
    if has["size"]:
        dlc, rest = int(has["size"]), has["rest"].strip()
        remote = rest == "remote request"
        octets = [] if remote else rest.split()
        if any(not re.fullmatch("[0-9A-Fa-f]{2}", octet) for octet in octets):
            raise ValueError(f"expected data bytes such as 01 2A, got {_shown(rest)}")
        data = bytes(int(octet, 16) for octet in octets)
    else:
        data = bytes.fromhex(has["data"] or "")
        dlc = int(has["raw"] or has["asked"] or "0", 16) if remote or has["raw"] else len(data)
    return _Row(time, channel, number, extended, remote, dlc, data)


def _raw_parser() -> Callable[[str], _Row]:
    """Return a parser for the lines of a RAW log; midnight has passed if the clock is set back."""
    days, last = 0, 0.0

    def parse(line: str) -> _Row:
        nonlocal days, last
        match = _RAW.fullmatch(line)
        if match is None:
            raise ValueError(
                f"{_shown(line)} is not a frame; expected hh:mm:ss.mmm R identifier data"
            )
        hours, minutes, seconds, number, octets = match.groups()
        clock = 3600.0 * int(hours) + 60 * int(minutes) + float(seconds)
        days += clock < last - 43_200
        last = clock
        data = bytes.fromhex(octets)
        time = round(86_400 * days + clock, 6)
        return _Row(time, "bus", int(number, 16), True, False, len(data), data)

    return parse


def _seconds(text: str) -> float:
    """Return the time [s] of a candump time stamp, a number of seconds or a UTC date."""
    if re.match(r"\d{4}-\d\d-\d\d ", text):
        return datetime.fromisoformat(text).replace(tzinfo=UTC).timestamp()
    if not _DECIMAL.fullmatch(text.strip()):
        raise ValueError(f"the time is {_shown(text)}; it must be a number of seconds or a date")
    return float(text)


def _table(line: str) -> Callable[[str], _Row] | None:
    """Return a parser for the rows below a title row, or None if the line is not a title row."""
    for separator in (mark for mark in ",;\t" if mark in line):
        titles = [re.sub(r"[\W_]", "", title).lower() for title in line.split(separator)]
        if {"timestamp", "arbitrationid", "extended", "remote", "dlc", "data"} <= set(titles):
            return partial(_cells, titles, separator, _python_can_row)
        if {"timestamp", "id", "extended", "len", "d1"} <= set(titles):
            return partial(_cells, titles, separator, _savvycan_row)
    return None


def _cells(
    titles: list[str], separator: str, row: Callable[[dict[str, str]], _Row], line: str
) -> _Row:
    cells = [cell.strip().strip('"') for cell in line.split(separator)]
    return row(dict(zip(titles, cells, strict=False)))


def _cell(cells: dict[str, str], title: str, pattern: re.Pattern[str] = _DECIMAL) -> str:
    """Return the text of a cell; raise an error unless it is a number."""
    cell = cells.get(title, "")
    if not pattern.fullmatch(cell):
        raise ValueError(f"column {title} is {_shown(cell)}; expected a number")
    return cell


def _switch(cells: dict[str, str], title: str) -> bool:
    cell = cells.get(title, "0").lower()
    if cell not in ("0", "1", "false", "true"):
        raise ValueError(f"column {title} is {_shown(cell)}; expected 0 or 1")
    return cell in ("1", "true")


def _python_can_row(cells: dict[str, str]) -> _Row:
    time = float(_cell(cells, "timestamp"))
    extended, remote = _switch(cells, "extended"), _switch(cells, "remote")
    try:
        data = b64decode(cells.get("data", ""), validate=True)
    except ValueError:
        raise ValueError(f"column data is {_shown(cells['data'])}; expected base64") from None
    dlc, kind = int(_cell(cells, "dlc", _DIGITS)), _ERROR if _switch(cells, "error") else ""
    if dlc in _FD_SIZES and len(data) == dlc and not kind:
        kind = _FD
    number = int(_cell(cells, "arbitrationid", _DIGITS), 16)
    return _Row(time, cells.get("channel") or "bus", number, extended, remote, dlc, data, kind)


def _savvycan_row(cells: dict[str, str]) -> _Row:
    time = float(_cell(cells, "timestamp")) / 1e6
    number, size = int(_cell(cells, "id", _DIGITS), 16), int(_cell(cells, "len"))
    kind = _ERROR if number >> 29 == 1 else _FD if size in _FD_SIZES else ""
    if size > 8 and not kind:
        raise ValueError(f"column len is {size}; expected 0..8")
    octets = [] if kind else [_cell(cells, f"d{k}", _DIGITS) for k in range(1, size + 1)]
    if any(int(octet, 16) > 255 for octet in octets):
        raise ValueError(f"the data are {_shown(' '.join(octets))}; expected bytes")
    data = bytes(int(octet, 16) for octet in octets)
    channel, extended = cells.get("bus") or "bus", _switch(cells, "extended")
    return _Row(time, channel, number, extended, False, size, data, kind)


def _shown(text: str) -> str:
    text = text.strip()
    return repr(text if len(text) <= 60 else text[:57] + "...")


#: A line of an ASC file with a time, a channel and an identifier.
_ASC_FRAME = re.compile(r"\d+\.\d+\s+\d+\s+[0-9a-fA-F]+x?\s")

#: Marks the end of an ASC header; without it, python-can would drop the first frame.
_ASC_BODY = "no internal events logged\n"

#: Types of lines in a TRC file: error frames, and other lines that are not frames.
_TRC_ERRORS, _TRC_OTHERS = {"ER", "Error"}, {"ST", "EC", "EV", "Warng", "FFFFFFFF"}


class _Lines(io.TextIOWrapper):
    """A text file that counts its lines, and reports lines in which no frame was found."""

    def __init__(self, binary: Any, asc: bool, unused: Callable[[int, str], None]) -> None:
        super().__init__(binary, "utf-8-sig", errors="replace")
        self.line, self.text, self.asc, self.unused = 0, "", asc, unused
        self.in_body, self.kept, self.ended = False, "", False

    def __next__(self) -> str:  # type: ignore[override] # io's stubs say bytes
        if self.kept:
            self.text, self.kept = self.kept, ""
            return self.text
        self.flush_line()
        while True:
            try:
                text = super().__next__()
            except StopIteration:
                self.ended = True
                raise
            self.line += 1
            if text.strip():
                break
        if self.asc and not self.in_body and text.lstrip()[:1].isdigit():
            self.in_body, self.kept = True, text
            return _ASC_BODY
        self.text = text
        return text

    def flush_line(self) -> None:
        """Report the last line, unless a frame was found in it."""
        if self.text:
            self.unused(self.line, self.text.strip())
        self.text = ""


def _read_foreign(kind: str, file: Path) -> _Records:
    """Read an ASC or TRC file with python-can."""
    can = load_extra("can", "python-can")
    records, asc = _Records("line"), kind == "asc"

    def unused(position: int, text: str) -> None:
        words = set(text.split()[:6])
        if asc and _ASC_FRAME.match(text):
            records.fault(position, f"{_shown(text)} is not an ASC frame")
        elif asc or text[0] == ";" or words & _TRC_OTHERS:
            return
        elif words & _TRC_ERRORS:
            records.skipped.append((nan, "bus", _ERROR))
        else:
            records.fault(position, f"{_shown(text)} is not a TRC frame")

    with open(file, "rb") as binary:
        stream = _Lines(binary, asc, unused)
        reader = can.ASCReader(stream) if asc else can.TRCReader(stream)
        messages = iter(reader)
        while True:
            try:
                message = next(messages)
            except StopIteration:
                break
            # A reader may raise any exception, after which its iterator cannot continue.
            except Exception as problem:
                records.fault(stream.line, one_line(problem))
                if stream.ended:
                    break
                stream.text, stream.in_body = "", False
                messages = iter(reader)
                continue
            # For ASC, python-can converts length codes 9..15 to numbers of bytes, as in CAN FD.
            dlc = can.util.len2dlc(message.dlc) if asc else message.dlc
            records.add(stream.line, _row(message, dlc))
            stream.text = ""
    return records


def _row(message: Any, dlc: int) -> _Row:
    """Convert a message of python-can to a row."""
    kind = _ERROR if message.is_error_frame else _FD if message.is_fd else ""
    channel = "bus" if message.channel is None else str(message.channel)
    return _Row(
        message.timestamp,
        channel,
        message.arbitration_id,
        message.is_extended_id,
        message.is_remote_frame,
        dlc,
        bytes(message.data),
        kind,
    )


#: Types of BLF objects: containers, all frames, error frames, and two forms of CAN FD frames.
_CONTAINER, _FRAMES, _ERRORS, _FD_FORM, _FD_LONG = 10, (1, 86, 73, 100, 101), 73, 100, 101

#: Largest container and object [byte], and largest ratio of the unpacked size to the file size.
#: Identical frames, which compress best, reach half that ratio.
_LARGEST, _LARGEST_OBJECT, _RATIO = 1 << 24, 1 << 20, 20


def _read_blf(file: Path) -> _Records:
    records, data = _Records("frame"), file.read_bytes()
    start = int.from_bytes(data[4:8], "little")
    if not 144 <= start <= len(data):
        records.fault(
            0, f"the header length is {start}; expected 144..{len(data)}", "after frame 0"
        )
        return records
    size, count, tail = int.from_bytes(data[16:24], "little"), 0, b""
    if size > len(data):
        records.fault(0, f"it has only {len(data)} of {size} bytes; it is cut off", "the file")
    year, month, _, day, hour, minute, second, ms = unpack_from("<8H", data, 40)
    try:
        at = datetime(year, month, day, hour, minute, second, 1000 * ms, tzinfo=UTC)
        begin = at.timestamp()
    except ValueError:  # all zeros: there is no date
        begin = 0.0
    left = _RATIO * len(data) + _LARGEST_OBJECT

    def fault(why: str) -> None:
        records.fault(count, why, f"after frame {count}")

    objects = _Objects(data, start, len(data), fault)
    for kind, whole in objects:
        if kind == _CONTAINER:
            inner = tail + _unpacked(whole, min(left, _LARGEST), fault)
            left -= len(inner) - len(tail)
        else:
            inner = tail + whole
        parts = _Objects(inner, 0, _LARGEST_OBJECT, fault)
        for part_kind, part in parts:
            if part_kind in _FRAMES:
                count += 1
                try:
                    records.add(count, _object_row(part_kind, part, begin))
                except StructError:
                    records.fault(count, f"a frame object of {len(part)} bytes cannot be decoded")
        tail = inner[parts.position :]
        if left <= 0:
            fault(f"the containers unpack to more than {_RATIO} times the file size")
            break
    if tail or objects.position < len(data):
        fault("the end of the file is cut off")
    return records


def _object_row(kind: int, part: bytes, begin: float) -> _Row:
    """Return a frame or an error frame of a BLF file whose time stamps count from `begin` [s]."""
    version, unit, stamp = unpack_from("<6xH8xI4xQ", part)
    if version not in (1, 2):
        raise StructError
    time, body = begin + stamp * (1e-5 if unit == 1 else 1e-9), 24 + 8 * version
    fd = 0
    if kind == _FD_LONG:
        channel, dlc, size, number, flags = unpack_from("<BBBxI4xI24x", part, body)
        data, remote, fd = part[body + 40 :], flags & 0x10, flags & 0x1000
    elif kind == _FD_FORM:
        form = "<HBBI5xBB5x64s"
        channel, flags, dlc, number, fd, size, data = unpack_from(form, part, body)
        remote, fd = flags & 0x80, fd & 1
    else:
        channel, flags, dlc, number, data = unpack_from("<HBBI8s", part, body)
        size, remote = dlc, flags & 0x80
    return _Row(
        time,
        str(channel - 1),
        number & 0x1FFFFFFF,
        number >> 31 == 1,
        bool(remote),
        dlc,
        b"" if remote else data[:size],
        _ERROR if kind == _ERRORS else _FD if fd else "",
    )


class _Objects:
    """Iterator over the types and bytes of BLF objects; the next search starts at `position`."""

    def __init__(self, data: bytes, position: int, most: int, fault: Callable[[str], None]) -> None:
        self.data, self.position, self.most, self.fault = data, position, most, fault

    def __iter__(self) -> Iterator[tuple[int, bytes]]:
        data = self.data
        while True:
            # Objects are padded to a multiple of four bytes.
            at = data.find(b"LOBJ", self.position, self.position + 8)
            if at < 0:
                if len(data) - self.position < 8:
                    self.position = (
                        len(data) if not data[self.position :].strip(b"\0") else self.position
                    )
                    return
                self.fault("no object begins here")
                at = data.find(b"LOBJ", self.position)
                if at < 0:
                    self.position = len(data)
                    return
            self.position = at
            if at + 16 > len(data):
                return
            size, kind = unpack_from("<2I", data, at + 8)
            if not 16 <= size <= self.most:
                self.fault(f"an object has an illegal length of {size} bytes")
                self.position = at + 4
                continue
            if at + size > len(data):
                return
            self.position = at + size
            yield kind, data[at : at + size]


def _unpacked(container: bytes, most: int, fault: Callable[[str], None]) -> bytes:
    """Return the content of a container, of which at most `most` bytes are unpacked."""
    method = int.from_bytes(container[16:18], "little")
    if method == 0:
        return container[32:]
    if method != 2:
        fault(f"a container uses the unknown compression method {method}")
        return b""
    stream = zlib.decompressobj()
    try:
        data = stream.decompress(container[32:], max(1, most))
    except zlib.error as problem:
        fault(f"a container cannot be unpacked: {problem}")
        return b""
    if not stream.eof:
        fault(f"a container is cut off, or unpacks to more than {most} bytes")
    return data
