"""J1939 and NMEA 2000: what a 29-bit identifier says, and messages of more than 8 bytes.

The formats and times are those of SAE J1939-21, as in net/can/j1939 of Linux, and of canboat.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field
from functools import cache
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet import datasets
from shipnet.arrays import Integers
from shipnet.can.frame import hexadecimal, highest_id
from shipnet.fields import check_whole
from shipnet.lazy import pd

#: PGNs of the two kinds of frames of a session: connection management and data transfer.
TP_CM, TP_DT = 0xEC00, 0xEB00
RTS, CTS, END, BAM, ABORT = 16, 17, 19, 32, 255  #: First byte of a TP.CM frame.
GLOBAL = 255  #: Address of all nodes.

#: Fewest and most data bytes by transport; "" is a single frame.
TRANSPORTS = {"": (0, 8), "fast packet": (0, 223), "BAM": (9, 1785), "RTS/CTS": (9, 1785)}

#: Longest times between two frames of a BAM session or fast packet, and of an RTS/CTS session [s].
_T1, _T2 = 0.75, 1.25


def id_parts(arbitration_id: npt.ArrayLike) -> tuple[Integers, ...]:
    """Return priority, PGN, source and destination in 29-bit identifiers."""
    number = np.asarray(arbitration_id)
    group, low = number >> 8 & 0x3FFFF, number >> 8 & 0xFF
    addressed = (group >> 8 & 0xFF) < 240  # PDU1: the low byte is the destination
    pgn = np.where(addressed, group - low, group)
    return number >> 26, pgn, number & 0xFF, np.where(addressed, low, GLOBAL)


class J1939Id(NamedTuple):
    """The parts of a 29-bit identifier in J1939 and NMEA 2000.

    The PGN contains both data page bits. If its second-lowest byte, the PDU format, is below 240,
    its lowest byte is 0 and the message has a destination (PDU1); all others go to all nodes, 255.

    Examples
    --------
    >>> J1939Id.of(0x18EA01FE)
    J1939Id(priority=6, pgn=59904, source=254, destination=1)
    """

    priority: int
    pgn: int
    source: int
    destination: int

    @classmethod
    def of(cls, arbitration_id: int) -> J1939Id:
        """Return the parts of an identifier."""
        check_whole("arbitration_id", arbitration_id, 0, highest_id(True))
        return cls(*map(int, id_parts(arbitration_id)))


def id_columns(arbitration_id: npt.ArrayLike, extended: npt.ArrayLike) -> dict[str, Any]:
    """Return columns with identifiers and, if some have 29 bits, with their parts in J1939."""
    numbers, long = np.asarray(arbitration_id, np.int64), np.asarray(extended, bool)
    keys, rows = np.unique(numbers << 1 | long, return_inverse=True)
    names = [hexadecimal(key >> 1, bool(key & 1)) for key in keys.tolist()]
    columns: dict[str, Any] = {"arbitration_id": np.array(names, dtype=object)[rows]}
    parts = zip(J1939Id._fields, id_parts(numbers), strict=True) if long.any() else ()
    return columns | {name: pd.arrays.IntegerArray(part, ~long) for name, part in parts}


def frame_count(size: int, transport: str) -> int:
    """Return the number of frames of a message, with those by which a session's receiver answers.

    The receiver of an RTS/CTS session accepts all packets with one CTS frame.
    """
    if transport == "fast packet":
        return 1 + max(0, -(-(size - 6) // 7))
    return -(-size // 7) + (1 if transport == "BAM" else 3) if transport else 1


def packets(arbitration_id: int, size: int, transport: str) -> list[tuple[int, bytes]]:
    """Return the identifier of each frame of a message, and the bytes before the data."""
    if not transport:
        return [(arbitration_id, b"")]
    _, pgn, source, to = J1939Id.of(arbitration_id)
    if transport == "fast packet":
        later = [(arbitration_id, bytes([k])) for k in range(1, frame_count(size, transport))]
        return [(arbitration_id, bytes([0, size])), *later]
    number, to = -(-size // 7), GLOBAL if transport == "BAM" else to
    down, up = (7 << 26 | low for low in (to << 8 | source, source << 8 | to))
    about, whole = pgn.to_bytes(3, "little"), size.to_bytes(2, "little") + bytes([number, 255])
    sent = [(TP_DT << 8 | down, bytes([k])) for k in range(1, number + 1)]
    if transport == "BAM":
        return [(TP_CM << 8 | down, bytes([BAM]) + whole + about), *sent]
    request = TP_CM << 8 | down, bytes([RTS]) + whole + about
    clear = TP_CM << 8 | up, bytes([CTS, number, 1, 255, 255]) + about
    return [request, clear, *sent, (TP_CM << 8 | up, bytes([END]) + whole + about)]


@cache
def pgn_names() -> dict[int, tuple[str, bool]]:
    """Return the name of each listed PGN, and whether it is sent as a fast packet."""
    rows = datasets.read("nmea2000_pgns.csv").itertuples(index=False)
    return {int(pgn): (name, fast == "yes") for pgn, name, fast in rows}


def fast_pgns() -> set[int]:
    """Return the PGNs of fast packets: the listed ones, and the range of proprietary ones."""
    listed = {pgn for pgn, (_, is_fast) in pgn_names().items() if is_fast}
    return listed.union(range(0x1FF00, 0x20000))


class Assembled(NamedTuple):
    """The messages of a J1939 or NMEA 2000 log, one per row, as returned by `Log.assemble`.

    ``data`` are hexadecimal; `faults` lists the transfers and frames that gave no message. PGNs in
    `unlisted` were read as single frames, but may be fast packets.

    Examples
    --------
    >>> from shipnet.can import read_capture
    >>> assembled = read_capture(datasets.path("sigrok_nmea2000_snippet.sr")).log.assemble()
    >>> len(assembled.messages), assembled.faults
    (44, ())
    >>> assembled.messages.loc[9, ["pgn", "source", "frames", "size"]].tolist()
    [129029, 0, 7, 47]
    """

    messages: pd.DataFrame
    faults: tuple[str, ...]
    unlisted: tuple[int, ...]


@dataclass(slots=True)
class _Transfer:
    """A fast packet or session of which `parts` have been sent; packet `next` is due."""

    pgn: int
    size: int
    packets: range
    limit: float
    last: float
    next: int
    parts: dict[int, bytes] = field(default_factory=dict)


def assemble(
    time: Any, channel: Any, numbers: Any, sizes: Any, data: Any, fast: Collection[int]
) -> Assembled:
    """Return the messages in data frames with 29-bit identifiers, which are given as columns.

    The key of a transfer is its channel, source and destination and, of a fast packet, its PGN and
    sequence number.
    """
    fast, names, octets = fast_pgns() | {*fast}, pgn_names(), data.astype(np.uint8).tobytes()
    rows: list[tuple[Any, ...]] = []
    faults: list[str] = []
    opened: dict[tuple[Any, ...], _Transfer] = {}

    def fault(key: tuple[Any, ...], what: str) -> None:
        faults.append(f"{key[0]}, {key[1]} to {key[2]}: {what}")

    def close(key: tuple[Any, ...], why: str) -> None:
        if one := opened.pop(key, None):
            some = f"{len(one.parts)} of {len(one.packets)} packets"
            fault(key, f"PGN {one.pgn}, {some}, then {why}")

    parts = zip(*(part.tolist() for part in id_parts(numbers)), strict=True)
    columns = time.tolist(), channel.tolist(), parts, sizes.tolist()
    for row, (now, bus, (priority, pgn, source, to), size) in enumerate(zip(*columns, strict=True)):
        part, number = octets[8 * row : 8 * row + size], -1
        key: tuple[Any, ...] = bus, source, to
        is_fast, new, legal = pgn in fast, None, True
        if size < (8 if pgn in (TP_CM, TP_DT) else 2 * is_fast):
            fault(key, f"PGN {pgn}, a frame of {size} bytes")
        elif pgn == TP_CM:
            code, count, back = part[0], part[3], (bus, to, source)
            length, about = (int.from_bytes(two, "little") for two in (part[1:3], part[5:8]))
            if code in (RTS, BAM):
                limit = _T1 if code == BAM else _T2
                new = _Transfer(about, length, range(1, count + 1), limit, now, 1)
                legal = 9 <= length <= 1785 and count == -(-length // 7) and about < 2**18
            elif code == CTS and (one := opened.get(back)):
                one.last, one.next = now, part[2] if part[1] else one.next
                for again in range(part[2], part[2] + part[1]):
                    one.parts.pop(again, None)
            elif code in (END, ABORT):
                close(key if code == ABORT and key in opened else back, "its end")
        elif pgn == TP_DT:
            number, part = part[0], part[1:]
        elif is_fast:
            key, number = (*key, pgn, part[0] >> 5), part[0] & 31
            if number == 0:
                new = _Transfer(
                    pgn, part[1], range(frame_count(part[1], "fast packet")), _T1, now, 0
                )
                legal = part[1] <= 223
            part = part[1 if number else 2 :]
        else:
            rows.append((now, bus, priority, pgn, source, to, 1, part))
        if new:
            close(key, "a new transfer")
            opened[key] = new
        if not legal:
            close(key, "refused: its length is illegal")
        elif number >= 0:
            if (one := opened.get(key)) and now - one.last > one.limit:
                close(key, f"{now - one.last:.3g} s of silence")
            if (one := opened.get(key)) is None:
                fault(key, f"PGN {pgn}, stray packet {number}")
            elif number in one.parts:
                fault(key, f"PGN {one.pgn}, packet {number} again")
            elif number != one.next or number not in one.packets:
                close(key, f"packet {number}")
            else:
                one.parts[number], one.last, one.next = part, now, number + 1
                while one.next in one.parts:  # the receiver asked only for earlier packets again
                    one.next += 1
                if len(one.parts) == len(one.packets):
                    whole = b"".join(one.parts[k] for k in one.packets)[: one.size]
                    del opened[key]
                    if len(whole) == one.size:
                        rows.append(
                            (now, bus, priority, one.pgn, source, to, len(one.parts), whole)
                        )
                    else:
                        fault(key, f"PGN {one.pgn}, {len(whole)} of {one.size} bytes")
    for key in [*opened]:
        close(key, "the end of the log")
    titles = "time_s channel priority pgn source destination frames data".split()
    table = pd.DataFrame(rows, columns=titles)
    table.insert(4, "name", [names.get(pgn, ("",))[0] for pgn in table["pgn"]])
    table.insert(8, "size", [len(data) for data in table["data"]])
    table["data"] = [data.hex() for data in table["data"]]
    unlisted = {*table["pgn"]} - {*names} - fast
    return Assembled(table, tuple(faults), tuple(sorted(k for k in unlisted if k >= 0x1F000)))
