"""Readers of CAN logs in the formats candump, Yacht Devices RAW, CSV, ASC, BLF and TRC.

Records become rows, which `_Records.add` checks. python-can reads ASC, BLF and TRC files.
"""

from __future__ import annotations

import io
import logging
import os
import re
import zlib
from array import array
from base64 import b64decode
from bisect import bisect_right
from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from functools import partial
from itertools import takewhile
from math import isnan, nan
from pathlib import Path
from struct import unpack_from
from typing import IO, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.can.dbc import one_line
from shipnet.can.log import Log, impossible
from shipnet.errors import InputError, load_extra
from shipnet.files import LARGEST_RECORD, LONGEST, open_file, read_bytes

# What is wrong with a file becomes a fault; python-can's own log would print it again.
logging.getLogger("can").addHandler(logging.NullHandler())

_FAULTS = 1000  #: Largest number of faults recorded per file.

#: Kinds of valid records other than classic CAN frames, and data lengths used only by CAN FD.
_FD, _ERROR, _FD_SIZES = "CAN FD frame", "error frame", (12, 16, 20, 24, 32, 48, 64)


class _Row(NamedTuple):
    """A record; `time` [s] is NaN if missing, and `kind` is empty for a classic CAN frame."""

    time: float
    channel: str
    number: int
    extended: bool
    remote: bool
    dlc: int
    data: bytes
    kind: str = ""


class _Records:
    """The records read from a file so far; a position is a line or frame number, as `unit` says."""

    def __init__(self, unit: str) -> None:
        self.unit = unit
        # Columns of the frames, in little memory, and the position of each frame in the file.
        self.time, self.number, self.position = array("d"), array("q"), array("q")
        self.extended, self.remote, self.dlc, self.data = (bytearray() for _ in range(4))
        self.channel: list[str] = []
        self.skipped: list[tuple[float, str, str]] = []
        self.faults: list[tuple[int, str]] = []
        self.more = 0

    def fault(self, position: int, why: str) -> None:
        """Record a fault at a position."""
        if len(self.faults) < _FAULTS:
            self.faults.append((position, f"{self.unit} {position}: {why}"))
        else:
            self.more += 1

    def add(self, position: int, row: _Row) -> None:
        """Add a row to the frames, to the skipped records or, if it is illegal, to the faults."""
        time, channel, number, extended, remote, dlc, data, kind = row
        if kind:
            self.skipped.append((time, channel, kind))
        elif why := impossible(
            0.0 if isnan(time) else time, number, extended, dlc, remote, len(data)
        ):
            self.fault(position, why)
        else:
            self.time.append(time)
            self.number.append(number)
            self.position.append(position)
            self.channel.append(channel)
            self.extended.append(extended)
            self.remote.append(remote)
            self.dlc.append(dlc)
            self.data += data.ljust(8, b"\0")

    def log(self) -> Log:
        """Return the log."""
        time, channel = np.array(self.time), np.array(self.channel, dtype=str)
        without = np.isnan(time)
        bad = without & ~without.all()
        for name in np.unique(channel) if np.any(np.diff(time) < 0) else ():
            on_channel = np.flatnonzero((channel == name) & ~bad)
            bad[on_channel[_out_of_order(time[on_channel])]] = True
        for at in np.flatnonzero(bad):
            why = f"the time {time[at]} s is out of order on {channel[at]}"
            self.fault(self.position[at], "it has no time, but others do" if without[at] else why)
        good = ~bad
        return Log(
            time[good],
            channel[good],
            np.array(self.number)[good],
            np.array(self.extended, dtype=bool)[good],
            np.array(self.remote, dtype=bool)[good],
            np.array(self.dlc, dtype=np.uint8)[good],
            np.array(self.data, dtype=np.uint8).reshape(-1, 8)[good],
            tuple(why for _, why in sorted(self.faults)),
            tuple(self.skipped),
        )


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
        file from python-can or SavvyCAN, or an ASC, BLF or TRC file; these three require
        python-can. The format is recognised by content, or otherwise by suffix.
    keep : bool, default False
        True to keep the readable frames of a damaged file; `Log.faults` lists what is missing. A
        BLF file that is cut off or whose containers are damaged is refused all the same.

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
    kind = log_kind(file) or "text"
    if kind == "mdf":
        raise InputError(
            str(path),
            "is an MDF (MF4) file, which cannot be read; convert it to ASC or BLF with asammdf "
            "or the software of the logger",
        )
    records = _read_text(file) if kind == "text" else _read_foreign(kind, file)
    log = records.log()
    if log.faults and not keep:
        raise InputError(str(path), *log.faults, more=records.more)
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
    with open_file(file) as stream:
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
    r"|\s+\[(?P<size>\d{1,2})\](?P<rest>(?:\s++[^\#;/'\s]++)*+)(?:\s+'.{1,64}')?"
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
    records, days, last = _Records("line"), 0, 0.0
    parse: Callable[[str], _Row] = _candump
    with open_file(file) as stream:
        for position, line in enumerate(_lines(stream), start=1):
            if len(line) > LONGEST:
                records.fault(position, f"has more than {LONGEST} bytes; expected a frame")
                continue
            text = line.decode("utf-8-sig" if position == 1 else "utf-8", "replace")
            if _COMMENT.match(text):
                continue
            if table := _table(text):
                parse = table
                continue
            if parse is _candump and _RAW.match(text):
                parse = _raw
            try:
                row = parse(text)
            except (ValueError, KeyError) as problem:
                records.fault(position, str(problem))
                continue
            if parse is _raw:  # midnight has passed if the clock is set back
                days, last = days + (row.time < last - 43_200), row.time
                row = row._replace(time=round(86_400 * days + last, 6))
            records.add(position, row)
    return records


def _lines(stream: IO[bytes]) -> Iterator[bytes]:
    """Yield the lines of a file; a line that is too long ends after one byte more than legal."""
    while line := stream.readline(LONGEST + 1):
        yield line
        while len(line) > LONGEST and line[-1:] != b"\n":
            line = stream.readline(LONGEST + 1)


def _candump(line: str) -> _Row:
    """Return the record in a line of any candump format."""
    match = _LINE.fullmatch(line)
    if match is None:
        raise ValueError(
            f"{_shown(line)} is not a frame; expected (seconds) channel identifier#data"
        )
    has = match.groupdict()
    number, extended = int(has["id"], 16), len(has["id"]) == 8
    channel, stamp, time = has["channel"] or "can0", has["time"], nan
    if stamp and re.match(r"\d{4}-\d\d-\d\d ", stamp):
        time = datetime.fromisoformat(stamp).replace(tzinfo=UTC).timestamp()
    elif stamp:
        if not _DECIMAL.fullmatch(stamp.strip()):
            raise ValueError(
                f"the time is {_shown(stamp)}; it must be a number of seconds or a date"
            )
        time = float(stamp)
    kind, remote = "", bool(has["ask"])
    if extended and number >> 29 == 1:
        kind = _ERROR
    elif has["fd"] or len(has["size"] or "") == 2:
        kind = _FD
    if kind:
        return _Row(time, channel, number, extended, False, 0, b"", kind)
    if has["size"]:
        dlc, text = int(has["size"]), has["rest"].strip()
        remote = text == "remote request"
        octets = [] if remote else text.split()
        if any(not re.fullmatch("[0-9A-Fa-f]{2}", octet) for octet in octets):
            raise ValueError(f"expected data bytes such as 01 2A, got {_shown(text)}")
        data = bytes(int(octet, 16) for octet in octets)
    else:
        data = bytes.fromhex(has["data"] or "")
        dlc = int(has["raw"] or has["asked"] or "0", 16) if remote or has["raw"] else len(data)
    return _Row(time, channel, number, extended, remote, dlc, data)


def _raw(line: str) -> _Row:
    """Return the record in a line of a RAW log, with the time of the day."""
    match = _RAW.fullmatch(line)
    if match is None:
        raise ValueError(f"{_shown(line)} is not a frame; expected hh:mm:ss.mmm R identifier data")
    hours, minutes, seconds, number, octets = match.groups()
    data = bytes.fromhex(octets)
    time = 3600.0 * int(hours) + 60 * int(minutes) + float(seconds)
    return _Row(time, "bus", int(number, 16), True, False, len(data), data)


def _table(line: str) -> Callable[[str], _Row] | None:
    """Return a parser for the rows below a title row, or None if the line is not a title row."""
    for separator in (mark for mark in ",;\t" if mark in line):
        titles = [re.sub(r"[\W_]", "", title).lower() for title in line.split(separator)]
        for needed, row in (
            ({"timestamp", "arbitrationid", "extended", "remote", "dlc", "data"}, _python_can_row),
            ({"timestamp", "id", "extended", "len", "d1"}, _savvycan_row),
        ):
            if needed <= set(titles):
                return partial(_table_row, titles, separator, row)
    return None


def _table_row(
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

#: The data length code and the bytes in a line of an ASC file with a classic CAN frame.
_ASC_DATA = re.compile(
    r"\s*\S+\s+\d+\s+\S+\s+[TR]x\s+[dr]\s+([0-9a-f]+)(?!\S)((?:\s+[0-9a-f]+(?!\S))*)", re.I
)

#: A byte of data in a line of a TRC file.
_OCTET = re.compile("[0-9A-Fa-f]{2}")

#: Marks the end of an ASC header; without it, python-can would drop the first frame.
_ASC_BODY = "no internal events logged"

#: Types of lines in a TRC file: error frames, and other lines that are not frames.
_TRC_ERRORS, _TRC_OTHERS = {"ER", "Error"}, {"ST", "EC", "EV", "Warng", "FFFFFFFF"}


class _Lines(io.StringIO):
    """The lines of a text file for python-can; `unused` gets the lines without a frame."""

    def __init__(self, file: Path, asc: bool, unused: Callable[[int, str], None]) -> None:
        super().__init__()
        text = read_bytes(file, LARGEST_RECORD).decode("utf-8-sig", errors="replace")
        self.lines = [(n, line) for n, line in enumerate(text.splitlines(), 1) if line.strip()]
        self.lines.reverse()
        self.number, self.text, self.unused = 0, "", unused
        self.in_body = not asc

    def __next__(self) -> str:  # type: ignore[override] # io's stubs say bytes
        if self.text:
            self.unused(self.number, self.text)
        self.text = ""
        if not self.lines:
            raise StopIteration
        if not self.in_body and self.lines[-1][1].lstrip()[:1].isdigit():
            self.in_body = True
            return _ASC_BODY
        self.number, self.text = self.lines.pop()
        return self.text if len(self.text) <= LONGEST else next(self)


def _read_foreign(kind: str, file: Path) -> _Records:
    """Read an ASC, BLF or TRC file with python-can."""
    can = load_extra("can", "python-can")
    if kind == "blf":
        return _read_blf(can, file)
    records, asc = _Records("line"), kind == "asc"

    def unused(position: int, text: str) -> None:
        text = text.strip()
        words = set(text.split()[:6])
        if not asc and words & _TRC_ERRORS:
            records.skipped.append((nan, "bus", _ERROR))
        elif len(text) > LONGEST:
            records.fault(position, f"has more than {LONGEST} characters; expected a frame")
        elif _ASC_FRAME.match(text) if asc else text[0] != ";" and not words & _TRC_OTHERS:
            records.fault(position, f"{_shown(text)} is not {'an ASC' if asc else 'a TRC'} frame")

    lines = _Lines(file, asc, unused)
    reader = can.ASCReader(lines) if asc else can.TRCReader(lines)
    more = True
    while more:
        try:
            for message in reader:
                row = _row(message, message.dlc)
                if asc and (match := _ASC_DATA.match(lines.text)):
                    # python-can limits the code to 15 and the bytes to 8, without a word.
                    base = 16 if reader.base == "hex" else 10
                    data = bytes(int(octet, base) for octet in match[2].split())
                    row = row._replace(dlc=int(match[1], base), data=data)
                elif not asc and not row.kind:
                    # It reads only as many bytes of a TRC record as its data length code says.
                    octets = [*takewhile(_OCTET.fullmatch, reversed(lines.text.split()))]
                    if len(octets) > len(row.data):
                        row = row._replace(data=bytes.fromhex("".join(reversed(octets))))
                records.add(lines.number, row)
                lines.text = ""
            more = False
        # A reader may raise any exception, after which a new iterator can continue.
        except Exception as problem:
            records.fault(lines.number, one_line(problem))
            more = bool(lines.text or lines.lines)
            lines.text, lines.in_body = "", not asc
    return records


def _row(message: Any, dlc: int) -> _Row:
    """Convert a message of python-can to a row."""
    return _Row(
        message.timestamp,
        "bus" if message.channel is None else str(message.channel),
        message.arbitration_id,
        message.is_extended_id,
        message.is_remote_frame,
        dlc,
        bytes(message.data),
        _ERROR if message.is_error_frame else _FD if message.is_fd else "",
    )


#: Types of BLF objects: containers, and all frames.
_CONTAINER, _FRAMES = 10, (1, 73, 86, 100, 101)

#: Largest ratio of the unpacked size to the file size, and what is always allowed [byte]. Identical
#: frames, which compress best, reach half that ratio.
_RATIO, _LARGEST = 20, 1 << 20


def _read_blf(can: Any, file: Path) -> _Records:
    """Read a BLF file; refuse what python-can would read forever or leave out without a word."""
    records, data = _Records("frame"), read_bytes(file, LARGEST_RECORD)
    size, left, inner = int.from_bytes(data[16:24], "little"), _RATIO * len(data) + _LARGEST, []
    if size > len(data):
        raise InputError(str(file), f"it has only {len(data)} of {size} bytes; it is cut off")
    frames = 0
    for kind, part in _objects(file, data, int.from_bytes(data[4:8], "little")):
        frames += kind in _FRAMES
        if kind == _CONTAINER:
            inner.append(_unpacked(file, part, left))
            left -= len(inner[-1])
    frames += sum(kind in _FRAMES for kind, _ in _objects(file, b"".join(inner), 0))
    count = 0
    try:
        with io.BytesIO(data) as stream:
            for count, message in enumerate(can.BLFReader(stream), 1):
                # In some objects, python-can converts length codes 9..15 to bytes, as in CAN FD.
                code = can.util.len2dlc(message.dlc) if 15 < message.dlc <= 64 else message.dlc
                records.add(count, _row(message, code))
    except Exception as problem:
        records.fault(count + 1, one_line(problem))
    if count < frames and not records.faults:
        records.fault(count + 1, f"only {count} of {frames} frames can be read")
    return records


def _objects(file: Path, data: bytes, position: int) -> Iterator[tuple[int, bytes]]:
    """Yield the type and the bytes of each BLF object."""
    while len(data) - position >= 16 or data[position:].strip(b"\0"):
        # Objects are padded to a multiple of four bytes.
        at = data.find(b"LOBJ", position, position + 8)
        if at < 0 or at + 16 > len(data):
            raise InputError(str(file), f"is damaged: no object begins at byte {position}")
        size, kind = unpack_from("<2I", data, at + 8)
        position = at + size
        if size < 16 or position > len(data):
            raise InputError(str(file), f"is damaged: an object has an illegal length of {size}")
        yield kind, data[at:position]


def _unpacked(file: Path, container: bytes, most: int) -> bytes:
    """Return the content of a container, of which at most `most` bytes are unpacked."""
    method, data = int.from_bytes(container[16:18], "little"), container[32:]
    if method == 0:
        return data
    stream = zlib.decompressobj()
    try:
        data = stream.decompress(data, max(1, most)) if method == 2 else b""
    except zlib.error as problem:
        raise InputError(str(file), f"is damaged: {problem}") from None
    if not stream.eof:
        raise InputError(
            str(file),
            f"a container is cut off, packed by an unknown method ({method}), or unpacks to more "
            f"than {_RATIO} times the size of the file",
        )
    return data
