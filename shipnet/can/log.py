"""Recorded CAN frames: read, written, their load, what they should have been, played again."""

from __future__ import annotations

import io
import os
import re
import time as clocks
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from shipnet import style
from shipnet.answers import COLUMNS, Findings
from shipnet.can.frame import check_bit_rate, highest_id
from shipnet.can.lengths import measure_frames
from shipnet.can.messages import MessageSet, check_set, load_extra
from shipnet.errors import ArgumentError, InputError
from shipnet.fields import check_scalar

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

Booleans = npt.NDArray[np.bool_]
Floats = npt.NDArray[np.float64]

#: One line of a log as candump writes it and python-can, which adds the direction. A remote frame
#: has R and perhaps its DLC in the place of its data.
_LINE = re.compile(
    rb"^\((\d{1,10}\.\d{1,9})\) +(\S+) +([0-9A-Fa-f]{8}|[0-9A-Fa-f]{3})#"
    rb"(?:([Rr][0-8]?)|((?:[0-9A-Fa-f]{2}){0,8}))(?: [RT])?[ \t]*\r?$",
    re.M,
)

#: Flag in an identifier of 8 digits: not a frame but an error, from linux/can.h, CAN_ERR_FLAG.
_ERROR_FLAG = 0x20000000

#: Formats of python-can that are read: the name of the reader, and whether it reads lines.
_FORMATS = {
    ".asc": ("ASCReader", True),
    ".blf": ("BLFReader", False),
    ".csv": ("CSVReader", True),
    ".trc": ("TRCReader", True),
}

#: More frames than any file has per byte, even a compressed one; damaged ones can be endless.
_PER_BYTE = 100

#: About how much of a file is worked on at once [byte], and how many faults are kept.
_BLOCK, _FAULTS = 1 << 22, 1000


@dataclass(frozen=True, eq=False, repr=False)
class Log:
    """Recorded frames as columns, in the order of the file.

    Parameters
    ----------
    time : ndarray of float, shape (n,)
        Time stamps [s].
    channel : ndarray of str, shape (n,)
        Bus of each frame.
    arbitration_id : ndarray of int, shape (n,)
        Identifiers.
    extended, remote, error : ndarray of bool, shape (n,)
        Whether the identifier has 29 bits, it is a remote frame, it is not a frame but an error.
    dlc : ndarray of uint8, shape (n,)
        Data length codes.
    data : ndarray of uint8, shape (n, 8)
        Data bytes; what a frame does not carry is 0.
    faults : tuple of str, optional
        What was wrong with the file and is left out.

    Raises
    ------
    ArgumentError
        If the columns have different lengths.

    Examples
    --------
    >>> from shipnet import can
    >>> can.simulate(can.example(), 125e3, until=1.0).log()
    Log(295 frames in 0.991 s)
    """

    time: Floats
    channel: npt.NDArray[np.str_]
    arbitration_id: npt.NDArray[np.int64]
    extended: Booleans
    remote: Booleans
    error: Booleans
    dlc: npt.NDArray[np.uint8]
    data: npt.NDArray[np.uint8]
    faults: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Check that all columns are equally long."""
        sizes = [len(column) for column in self.columns]
        if len(set(sizes)) != 1:
            raise ArgumentError(f"log has columns of {sizes} rows; all must agree")

    @property
    def columns(self) -> tuple[Any, ...]:
        """The eight columns, from `time` to `data`."""
        return tuple(getattr(self, field.name) for field in fields(self)[:8])

    def __len__(self) -> int:
        """Return the number of frames."""
        return len(self.time)

    def __repr__(self) -> str:
        """Count the frames."""
        span = float(np.ptp(self.time)) if len(self) else 0.0
        faults = f", {len(self.faults)} faults" if self.faults else ""
        return f"Log({len(self)} frames in {span:.3g} s{faults})"

    def table(self) -> pd.DataFrame:
        """Return one row per frame: its time, bus, identifier, kind, data length code and data."""
        import pandas as pd

        text = self.data.tobytes().hex(" ", 8).split() if len(self) else []
        size = np.where(self.remote, 0, np.minimum(self.dlc, 8))
        names = [field.name for field in fields(self)[:7]]
        table = pd.DataFrame(dict(zip(names, self.columns, strict=False)))
        table["data"] = [octets[: 2 * n] for octets, n in zip(text, size, strict=True)]
        return table.rename(columns={"time": "time_s"})

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the frames as ``candump -l`` does; the suffix must be ``.log``."""
        if Path(path).suffix.lower() != ".log":
            raise ArgumentError(f"path is {str(path)!r}; its suffix must be .log")
        text = self.data.astype(np.uint8).tobytes().hex().upper()
        columns = (column.tolist() for column in self.columns[:7])
        with open(path, "w", encoding="utf-8", newline="\n") as file:
            for row, (time, channel, number, long, remote, error, dlc) in enumerate(
                zip(*columns, strict=True)
            ):
                name = f"{number | _ERROR_FLAG:08X}" if error else f"{number:0{8 if long else 3}X}"
                rest = f"R{dlc or ''}" if remote else text[16 * row : 16 * row + 2 * min(dlc, 8)]
                file.write(f"({time:017.6f}) {channel} {name}#{rest}\n")

    def load(self, bit_rate: float, *, window: float = 1.0) -> LogLoad:
        """Return how busy the buses were, over a sliding window and by identifier.

        `bit_rate` is 5e3..1e6 [bit/s], which a log does not hold; `window` is the length of the
        window [s]. A time stamp is taken as the end of its frame. The load of a window that begins
        before the record counts over the whole window, so the first ones are low. Errors are left
        out.
        """
        import pandas as pd

        rate = check_bit_rate(bit_rate, 5e3)
        window = check_scalar("window", window, "s", 1e-6, 1e9)
        order = np.lexsort((self.time, self.channel))
        order = order[~self.error[order]]
        time, channel, ids, extended, remote, _, dlc, data = (c[order] for c in self.columns)
        measured = measure_frames(ids, data, dlc, extended=extended, remote=remote)
        wrong = (measured.error != 0) | ~np.isfinite(time)
        if wrong.any():
            at = int(np.argmax(wrong))
            why = _impossible(time[at], ids[at], extended[at], dlc[at])
            raise ArgumentError(f"frame {order[at] + 1} of the log: {why}")
        bits, share = measured.length.astype(float), np.zeros(len(order))
        totals, messages = [], []
        for name in np.unique(channel).tolist():
            here = channel == name
            when, size = time[here], bits[here]
            share[here] = _sliding(when, size, window) / (rate * window)
            span = when[-1] - when[0] + size[0] / rate
            totals.append((name, len(when), span, size.sum() / rate / span, share[here].max()))
            keys = ids[here] << 1 | extended[here]
            for key in np.unique(keys):
                mine = keys == key
                own = size[mine]
                peak = _sliding(when[mine], own, window).max() / (rate * window)
                messages.append(
                    (
                        name,
                        key >> 1,
                        bool(key & 1),
                        len(own),
                        own.sum(),
                        own.sum() / rate / span,
                        peak,
                    )
                )
        columns = ["channel", "frames", "duration_s", "load", "peak_load"]
        each = ["channel", "arbitration_id", "extended", "frames", "bits", "load", "peak_load"]
        return LogLoad(
            pd.DataFrame({"channel": channel, "time_s": time, "load": share}),
            pd.DataFrame(messages, columns=each),
            pd.DataFrame(totals, columns=columns).set_index("channel"),
        )

    def compare(self, messages: MessageSet) -> Findings:
        """Return what the log says about a set of messages: missing, unknown, late, too often.

        Between two frames of a message at most its period and its deadline may pass, and n frames
        take at least n - 1 periods less a deadline. Frames of all buses count, errors do not.
        """
        import pandas as pd

        check_set(messages)
        frames = ~self.error
        keys = self.arbitration_id << 1 | self.extended
        known = {m.arbitration_id << 1 | m.extended: m for m in messages}
        rows: list[tuple[Any, ...]] = []

        def add(rule: str, name: str, value: float, low: float, high: float, unit: str) -> None:
            met = not (value < low or value > high)
            verdict = "met" if met else "violated"
            rows.append((rule, name, value, low, high, unit, verdict, _WHY[rule], "message set"))

        for key, message in known.items():
            times = np.sort(self.time[frames & (keys == key)])
            add("sent", message.name, len(times), 1, np.inf, "frames")
            if len(times) > 1:
                latest = message.period + message.deadline
                gaps, spans = np.diff(times), times[-1] - times[0]
                add("interval", message.name, round(float(gaps.max()), 9), 0, latest, "s")
                least = max(0.0, (len(times) - 1) * message.period - message.deadline)
                add("time of all frames", message.name, round(float(spans), 9), least, np.inf, "s")
            sizes = np.unique(self.dlc[frames & (keys == key)])
            if len(sizes):
                odd = [int(size) for size in sizes if size != message.dlc]
                size = odd[0] if odd else message.dlc
                add("length", message.name, size, message.dlc, message.dlc, "bytes")
        for key in np.unique(keys[frames]):
            if int(key) not in known:
                digits = 8 if key & 1 else 3
                count = int((frames & (keys == key)).sum())
                add("known", f"0x{key >> 1:0{digits}X}", count, 0, 0, "frames")
        return Findings(pd.DataFrame(rows, columns=list(COLUMNS)))

    def replay(
        self,
        bus: Any,
        *,
        speed: float = np.inf,
        clock: Callable[[], float] = clocks.monotonic,
        sleep: Callable[[float], object] = clocks.sleep,
    ) -> int:
        """Send the frames on a bus of python-can, and return how many.

        A `speed` of 1 keeps the times of the log; by default nothing waits.
        """
        can = load_extra("can", "python-can")
        if not isinstance(speed, int | float | np.number) or not speed > 0:
            raise ArgumentError(f"speed is {speed!r}; it must be positive")
        if np.any(np.diff(self.time) < 0):
            row = int(np.argmax(np.diff(self.time) < 0)) + 1
            raise ArgumentError(f"time of frame {row + 1} of the log lies before the one before it")
        begin = clock()
        first = self.time[0] if len(self.time) else 0.0
        count = 0
        for time, _, number, extended, remote, error, dlc, data in zip(*self.columns, strict=True):
            if error:
                continue
            if np.isfinite(speed):
                ahead = begin + (time - first) / speed - clock()
                if ahead > 0:
                    sleep(ahead)
            message = can.Message(
                timestamp=float(time),
                arbitration_id=int(number),
                is_extended_id=bool(extended),
                is_remote_frame=bool(remote),
                dlc=int(dlc),
                data=None if remote else bytes(data[: min(dlc, 8)]),
            )
            bus.send(message)
            count += 1
        return count


@dataclass(frozen=True, eq=False, repr=False)
class LogLoad:
    """How busy recorded buses were; `Log.load` makes it.

    Examples
    --------
    >>> from shipnet import can
    >>> load = can.simulate(can.example(), 125e3, until=1.0).log().load(125e3)
    >>> load
    LogLoad(can0: load 20.5 %, peak 20.3 %)
    >>> load.total().round(3)["load"].to_dict()
    {'can0': 0.205}
    """

    _windows: pd.DataFrame
    _messages: pd.DataFrame
    _total: pd.DataFrame

    def total(self) -> pd.DataFrame:
        """Return one row per bus: ``frames``, ``duration_s``, ``load`` and ``peak_load``."""
        return self._total.copy()

    def table(self) -> pd.DataFrame:
        """Return one row per identifier: its frames, bits, load, and load of its busiest window."""
        return self._messages.copy()

    def windows(self) -> pd.DataFrame:
        """Return one row per frame: the load of the window that ends with it."""
        return self._windows.copy()

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the load over time, one line per bus."""
        ax = style.axes(ax)
        for channel, own in self._windows.groupby("channel"):
            time = own["time_s"] - self._windows["time_s"].min()
            ax.plot(time, 100 * own["load"], label=str(channel))
        ax.set(xlabel="time since the first frame [s]", ylabel="bus load [%]")
        ax.set_ylim(bottom=0)
        if len(self._total) > 1:
            ax.legend()
        return ax

    def __repr__(self) -> str:
        """Name the load of each bus."""
        parts = [
            f"{channel}: load {row.load:.1%}, peak {row.peak_load:.1%}".replace("%", " %")
            for channel, row in zip(self._total.index, self._total.itertuples(), strict=True)
        ]
        return f"LogLoad({'; '.join(parts) or 'no frames'})"


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
    >>> log
    Log(2 frames in 0.1 s)
    >>> log.time.tolist(), log.dlc.tolist(), log.extended.tolist(), log.remote.tolist()
    ([12.5, 12.6], [2, 0], [False, True], [False, True])
    """
    file = Path(path)
    kind = file.suffix.lower()
    if kind != ".log" and kind not in _FORMATS:
        known = ", ".join([".log", *_FORMATS])
        raise InputError(str(path), f"its suffix is {kind!r}; it must be one of {known}")
    can = None if kind == ".log" else load_extra("can", "python-can")
    try:
        log, faults = _read_candump(file) if can is None else _read_foreign(file, kind, can)
    except OSError as problem:
        raise InputError(str(path), f"cannot be read: {problem.strerror}") from None
    if faults and not keep:
        raise InputError(str(path), *faults[:_FAULTS], more=max(0, len(faults) - _FAULTS))
    return replace(log, faults=tuple(faults[:_FAULTS]))


def _read_candump(file: Path) -> tuple[Log, list[str]]:
    parts, faults, before = [], [], 0
    with open(file, "rb") as stream:
        while lines := stream.readlines(_BLOCK):
            good, rows = _LINE.findall(b"".join(lines)), np.arange(len(lines))
            if len(good) < len(lines):
                matches = [_LINE.match(line) for line in lines]
                faults += [
                    (before + row, f"{_shown(lines[row])} is not a frame; expected (seconds) "
                    "channel identifier#data")
                    for row, match in enumerate(matches)
                    if match is None and lines[row].strip()
                ]  # fmt: skip
                good = [match.groups(b"") for match in matches if match is not None]
                rows = np.array([row for row, match in enumerate(matches) if match is not None])
            part = _columns(good)
            # The form of a line leaves only the identifier to be checked.
            ids = part.arbitration_id
            bad = ids > np.where(part.extended, highest_id(True), highest_id(False))
            for at in np.flatnonzero(bad):
                why = _impossible(part.time[at], ids[at], part.extended[at], part.dlc[at])
                faults.append((before + rows[at], why))
            parts.append(Log(*(column[~bad] for column in part.columns)) if bad.any() else part)
            before += len(lines)
    return _joined(parts), [f"line {row + 1}: {why}" for row, why in sorted(faults)]


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
        np.where(error, ids & highest_id(True), ids),
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
    messages: list[Any] = []
    faults: list[str] = []
    most = _PER_BYTE * file.stat().st_size
    with open(file, "rb") as binary:
        reader, by_line = _FORMATS[kind]
        stream = _Lines(binary, "utf-8", errors="replace") if by_line else None
        try:
            for number, message in enumerate(getattr(can, reader)(stream or binary), 1):
                if number > most:
                    raise ValueError(f"more than {most} frames in {most // _PER_BYTE} bytes")
                if message.is_fd:
                    raise ValueError("a CAN FD frame")
                fault = _impossible(
                    message.timestamp, message.arbitration_id, message.is_extended_id,
                    message.dlc, len(message.data),
                )  # fmt: skip
                if fault:
                    faults.append(f"frame {number}: {fault}")
                else:
                    messages.append(message)
        # The readers raise whatever their parsing meets.
        except Exception as problem:
            place = f"line {stream.line}" if stream else f"after frame {len(messages)}"
            faults.append(f"{place}: {str(problem) or type(problem).__name__}")
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


def _impossible(time: float, number: int, extended: bool, dlc: int, size: int = 0) -> str:
    """Return what no frame of classic CAN can have, or nothing; each format is checked here."""
    highest = highest_id(extended)
    if not 0 <= number <= highest:
        return f"the identifier is {number:#x}; it must be 0..{highest:#x}"
    if not 0 <= dlc <= 15:
        return f"the data length code is {dlc}; it must be 0..15"
    if size > 8:
        return f"it has {size} bytes of data; it must have 0..8"
    return "" if np.isfinite(time) else f"the time is {time}"


def _joined(parts: list[Log]) -> Log:
    kinds: list[Any] = [float, str, np.int64, bool, bool, bool, np.uint8]
    empty: list[Any] = [np.zeros(0, dtype=kind) for kind in kinds]
    empty.append(np.zeros((0, 8), dtype=np.uint8))
    filled = [part for part in parts if len(part.time)]
    if not filled:
        return Log(*empty)
    joined: list[Any] = [
        np.concatenate(column) for column in zip(*(part.columns for part in filled), strict=True)
    ]
    return Log(*joined)


def _shown(line: bytes) -> str:
    text = line.decode("utf-8", "replace").strip()
    return repr(text if len(text) <= 60 else text[:57] + "...")


# What a log says -------------------------------------------------------------------------------


def _sliding(
    time: npt.NDArray[np.float64], bits: npt.NDArray[np.float64], window: float
) -> npt.NDArray[np.float64]:
    """Return the bits of the frames that ended within the window up to each of them."""
    summed = np.concatenate([[0.0], np.cumsum(bits)])
    # Stamps have microseconds: a frame exactly a window ago is out, in spite of roundings.
    first = np.searchsorted(time, time - window + 1e-7, side="left")
    last = np.searchsorted(time, time, side="right")
    return np.asarray(summed[last] - summed[first])


#: What each rule of a comparison means.
_WHY = {
    "sent": "every message is in the log",
    "interval": "between two frames at most a period and a deadline pass",
    "time of all frames": "n frames take at least n - 1 periods less a deadline",
    "length": "every frame has the data bytes of its message",
    "known": "every identifier belongs to a message",
}
