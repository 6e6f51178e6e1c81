"""Read recorded waveforms from scope CSV files, numpy arrays and sigrok sessions.

Text files from different manufacturers have different headers. The last rows of a file show which
columns contain numbers; the header, with titles and units, ends where rows of this kind begin.
Known layouts: Tektronix TDS and MDO, Keysight, Rigol, Siglent, LeCroy, PicoScope, Rohde & Schwarz,
OWON, Digilent.
"""

from __future__ import annotations

import configparser
import io
import os
import re
import zipfile
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from numbers import Real
from os import PathLike
from pathlib import Path
from typing import IO, Any, NamedTuple, TypeVar

import numpy as np
import numpy.typing as npt

from shipnet.arrays import Floats, parts_of
from shipnet.errors import ArgumentError, InputError
from shipnet.lazy import pd

#: Lowest sampling rate that resolves pulses of 3 us [1/s].
SLOWEST_RATE = 1e6

#: Limits on how many numbers the arrays of an archive or a channel of a session may unpack to: in
#: total, and per byte of the file; the larger one applies. A tiny archive can unpack to any size.
MOST_NUMBERS, MOST_PER_BYTE = 2**24, 4

#: Size above which a numpy file is memory-mapped instead of read [byte].
MAPPED = 2**26

#: Maximum ratio of logic data to the session file (deflate reaches 1032), and number of changes.
MOST_LOGIC_PER_BYTE, MOST_EDGES = 1100, 2**24

#: Number of logic samples per block.
_BLOCK = 2**22

#: Uncertainty of an interpolated edge of a sampled voltage [sample].
_INTERPOLATED = 0.3

#: Maximum size of the metadata of a sigrok session [byte].
_LARGEST_METADATA = 2**20

#: Magnitude above which a number cannot be a time or a voltage in any unit.
_LARGEST = 1e15

_COUNTERS = ("x", "#", "n", "no", "nr", "index", "sample", "samples", "point", "points", "sequence")

#: Number of last rows from which a file's layout is found, and maximum number of header rows.
_TAIL, _HEADER = 10, 2000

_NUMBER = r"[+-]?(?:[0-9]+(?:[.,][0-9]*)?|[.,][0-9]+)(?:[eE][+-]?[0-9]+)?"
_IS_NUMBER = re.compile(rf"{_NUMBER}|[+-]?inf", re.ASCII)
_QUANTITY = re.compile(rf"(?:[^:=]*[:=])?\s*({_NUMBER})\s*([a-zµμ/]*)", re.ASCII | re.IGNORECASE)
_UNIT_IN_TITLE = re.compile(r"(.*?)\s*(?:[(\[]([^()\[\]]*)[)\]]|\bin\s+(\S+))\s*")
_INTERVAL = re.compile(
    r"(sampl\w*\s+(interval|period)|time\s+(interval|increment)|(x\s*|t)?inc(rement)?"
    r"|interval|delta\s*t|dt)\b"
)
_RATE = re.compile(r"(sampl\w*\s+(rate|frequency|freq)|samplerate|fs)\b")

#: Prefixes of units. Scopes show neither megavolts nor megaseconds, so case does not matter.
_PREFIX = {"": 1.0, "p": 1e-12, "n": 1e-9, "u": 1e-6, "µ": 1e-6, "μ": 1e-6, "m": 1e-3, "k": 1e3}
_BASE = {
    "s": "s",
    "sec": "s",
    "second": "s",
    "seconds": "s",
    "v": "V",
    "volt": "V",
    "volts": "V",
    "a": "A",
    "amp": "A",
    "ampere": "A",
    "w": "W",
    "watt": "W",
    "hz": "Hz",
    "db": "dB",
}


class Recording(NamedTuple):
    """One channel of a file: voltages [V] at equal steps of `dt` [s]."""

    u: Floats
    dt: float
    channel: str
    description: str


def read_scope_file(
    path: str | PathLike[str], *, channel: str | None = None, sample_interval: float | None = None
) -> Recording:
    """Read one channel of a recorded waveform."""
    return _read(path, channel, sample_interval, _recording)


class Edges(NamedTuple):
    """The changes of one channel between two levels."""

    places: npt.NDArray[np.floating[Any]]  # most likely position of each change [sample]
    width: float  # uncertainty of a position [sample]
    first: int  # level before the first change, 0 or 1
    samples: float  # length of the record [sample]
    dt: float  # time between two samples [s]
    channel: str


def read_edges(
    path: str | PathLike[str], *, channel: str | None = None, sample_interval: float | None = None
) -> Edges:
    """Read the level changes of one channel, by default the one with the most changes."""
    return _read(path, channel, sample_interval, _edges)


def bit_time(edges: Edges, longest: int) -> float:
    """Return the number of samples per bit, estimated from runs of up to `longest` bits."""
    # Nearly half of the runs are one bit long, none is shorter, and all are multiples of a bit.
    runs = np.diff(edges.places)
    runs = runs[runs < 16 * np.quantile(runs, 0.2)]
    bit = float(runs[runs <= 1.6 * np.quantile(runs, 0.1)].mean())
    for _ in range(20):
        size = np.rint(runs / bit)
        few = (size >= 1) & (size <= longest)
        before, bit = bit, float(runs[few].sum() / size[few].sum())
        if abs(bit - before) < 1e-9 * bit:
            break
    return bit


_Read = TypeVar("_Read", Recording, Edges)


def _read(
    path: str | PathLike[str],
    channel: str | None,
    sample_interval: float | None,
    choose: Callable[[str, _Channels, str | None, float | None], _Read],
) -> _Read:
    """Read a file according to its suffix, and return the result of `choose` for the channel."""
    if sample_interval is not None and not (
        isinstance(sample_interval, Real) and 0 < sample_interval < np.inf
    ):
        raise ArgumentError(f"sample_interval is {sample_interval} s; it must be positive")
    file = str(path)
    kind = Path(file).suffix.lower()
    if kind in (".npy", ".npz", ".sr"):
        with _whole(file) as stream:
            if kind == ".sr":
                read = _read_sr(file, stream, logic=choose is _edges, channel=channel)
            else:
                read = {".npy": _read_npy, ".npz": _read_npz}[kind](file, stream)
            return choose(file, read, channel, sample_interval)
    with _opened(file) as stream:
        data = stream.read()
    if not data.strip():
        raise InputError(file, "the file is empty")
    return choose(file, _read_text(file, data), channel, sample_interval)


class _Channels(NamedTuple):
    """The content of a file: one column per channel, and the times or their interval if known."""

    values: Callable[[int], Floats]  # reads the numbers of a column
    columns: list[Column]
    interval: float | None
    quantum: float | None  # step to which times are rounded; None if it follows from the digits
    logic: _Logic | None = None  # level changes of a session, instead of numbers


class _Logic(NamedTuple):
    """Level changes of a session's logic channels."""

    places: npt.NDArray[np.int64]  # first sample after each change
    words: npt.NDArray[np.uint64]  # levels at the beginning and after each change
    samples: int
    interval: float | None


def _columns_of(values: Floats) -> Callable[[int], Floats]:
    return lambda k: values[:, k]


@contextmanager
def _whole(file: str) -> Iterator[IO[bytes]]:
    """Open a binary file; convert any parser error to an InputError."""
    try:
        with _opened(file) as stream:
            yield stream
    except InputError:
        raise
    except Exception as fault:
        # Parsers raise a dozen kinds of errors, such as BadZipFile; all mean a damaged file.
        why = str(fault) or type(fault).__name__
        raise InputError(file, f"not a complete {Path(file).suffix.lower()} file: {why}") from fault


def _opened(file: str) -> IO[bytes]:
    path = Path(file)
    try:
        # Reading a pipe or a device might never end.
        if path.exists() and not path.is_file():
            raise InputError(file, "not a file")
        if path.exists() and not path.stat().st_size:
            raise InputError(file, "the file is empty")
        return path.open("rb")
    except (OSError, ValueError) as fault:
        if isinstance(fault, InputError):
            raise
        why = fault.strerror if isinstance(fault, OSError) else fault
        raise InputError(file, f"cannot be read: {why}") from None


def _members(
    file: str, stream: IO[bytes], archive: zipfile.ZipFile, names: dict[str, str]
) -> dict[str, npt.NDArray[Any]]:
    """Read arrays from an archive; raise InputError if they would unpack to too many numbers."""
    # Check before reading, assuming eight bytes per number; a number may have as few as one.
    _check_size(file, stream, sum(archive.getinfo(name).file_size for name in names.values()) / 8)
    held = {}
    for key, name in names.items():
        with archive.open(name) as part:
            held[key] = np.lib.format.read_array(part, allow_pickle=False)
    _check_size(file, stream, sum(array.size for array in held.values()))
    return held


def read_arrays(path: str | PathLike[str], keys: Iterable[str]) -> dict[str, npt.NDArray[Any]]:
    """Read arrays from an ``.npz`` file by name; raise InputError if one is missing."""
    file, wanted = str(path), tuple(keys)
    with _whole(file) as stream, zipfile.ZipFile(stream) as archive:
        held = {name.removesuffix(".npy") for name in archive.namelist()}
        if missing := [key for key in wanted if key not in held]:
            names = ", ".join(sorted(held)[:10]) or "nothing"
            raise InputError(file, f"it has {names}; also expected {', '.join(missing)}")
        return _members(file, stream, archive, {key: f"{key}.npy" for key in wanted})


def _check_real(file: str, what: str, array: npt.NDArray[Any]) -> Floats:
    if array.dtype.kind not in "biuf" or not array.size:
        about = f"{what} has the shape {array.shape} and the type {array.dtype}"
        raise InputError(file, f"{about}; expected real numbers")
    mapped = isinstance(array, np.memmap) and array.dtype.kind != "b"
    return array if mapped else array.astype(float)


def _rounding(times: npt.NDArray[Any]) -> float:
    """Return the floating-point spacing at the largest of the times; 0 for integers."""
    return float(np.spacing(np.abs(times).max())) if times.dtype.kind == "f" else 0.0


def _read_npy(file: str, stream: IO[bytes]) -> _Channels:
    if _size(stream) > MAPPED:
        array = np.load(file, mmap_mode="r")
    else:
        array = np.lib.format.read_array(stream, allow_pickle=False)
    values = _check_real(file, "the array", array)
    if values.ndim == 1:
        one = _columns_of(values[:, np.newaxis])
        return _Channels(one, [Column(1, "u", "V", 1.0, 0)], None, None)
    if values.ndim != 2 or min(values.shape) < 2:
        about = f"the array has the shape {array.shape}"
        raise InputError(file, f"{about}; expected voltages, or time and voltages")
    if values.shape[0] < values.shape[1]:
        values, array = values.T, array.T
    columns = [Column(1, "t", "s", 1.0, 0)]
    columns += [Column(k + 1, f"u{k}", "V", 1.0, 0) for k in range(1, values.shape[1])]
    return _Channels(_columns_of(values), columns, None, _rounding(array[:, 0]))


def _read_npz(file: str, stream: IO[bytes]) -> _Channels:
    with zipfile.ZipFile(stream) as archive:
        names = {name.removesuffix(".npy"): name for name in archive.namelist()}
        voltage = next((key for key in ("u", "v") if key in names), None)
        if voltage is None:
            held_by = ", ".join(sorted(names)[:10]) or "nothing"
            raise InputError(file, f"it has {held_by}; expected the voltages as u or v")
        wanted = [key for key in (voltage, "t", "dt", "probes") if key in names]
        held = _members(file, stream, archive, {key: names[key] for key in wanted})
    u = _check_real(file, voltage, held[voltage])
    u = u[:, np.newaxis] if u.ndim == 1 else u
    if u.ndim != 2:
        raise InputError(file, f"{voltage} has the shape {u.shape}; expected (times, channels)")
    titles = [voltage] if u.shape[1] == 1 else [f"{voltage}{k}" for k in range(u.shape[1])]
    if "probes" in held and held["probes"].shape == (u.shape[1],):
        titles = [str(name) for name in held["probes"]]
    columns = [Column(k, title, "V", 1.0, 0) for k, title in enumerate(titles, start=1)]
    if "t" in held:
        t = _check_real(file, "t", held["t"])
        if t.shape != u.shape[:1]:
            raise InputError(file, f"t has the shape {t.shape}, but {voltage} has {u.shape}")
        columns = [Column(0, "t", "s", 1.0, 0), *columns]
        values = [t, *u.T]
        return _Channels(values.__getitem__, columns, None, _rounding(held["t"]))
    interval = None
    if "dt" in held:
        dt = _check_real(file, "dt", held["dt"])
        if dt.size != 1 or not 0 < dt.item() < np.inf:
            raise InputError(file, "dt is not a single positive number")
        interval = dt.item()
    return _Channels(_columns_of(u), columns, interval, None)


def _size(stream: IO[bytes]) -> int:
    return os.fstat(stream.fileno()).st_size


def _check_size(file: str, stream: IO[bytes], numbers: float) -> None:
    """Raise InputError if an archive would unpack to too many numbers."""
    most = max(MOST_NUMBERS, MOST_PER_BYTE * _size(stream))
    if numbers > most:
        raise InputError(
            file,
            f"it unpacks to {numbers:.0f} numbers; at most {most} are read ({MOST_NUMBERS}, or "
            f"{MOST_PER_BYTE} per byte of the file); save a part of the record",
        )


def _read_sr(
    file: str, stream: IO[bytes], logic: bool = False, channel: str | None = None
) -> _Channels:
    """Read the voltages of a sigrok session, or with `logic` its logic levels if it has any."""
    with zipfile.ZipFile(stream) as archive:
        names = set(archive.namelist())
        if "metadata" not in names:
            raise InputError(file, "no metadata in it; expected a sigrok session")
        if archive.getinfo("metadata").file_size > _LARGEST_METADATA:
            raise InputError(file, f"its metadata has more than {_LARGEST_METADATA} bytes")
        settings = configparser.RawConfigParser(strict=False)
        # Some programs indent keys, which the parser would read as parts of the value above.
        settings.read_string(re.sub(r"(?m)^[ \t]+", "", archive.read("metadata").decode()))
        device = next((settings[name] for name in settings.sections() if "device" in name), None)
        about: dict[str, str] = dict(device or {})
        rate = re.fullmatch(r"([0-9.]+)\s*([kMG]?)(?:Hz)?", about.get("samplerate", "").strip())
        interval = None
        if rate:
            hertz = float(rate[1]) * {"": 1, "k": 1e3, "M": 1e6, "G": 1e9}[rate[2]]
            interval = 1 / hertz if hertz > 0 else None
        titles = _named(about, "analog")
        parts: dict[int, list[tuple[int, str]]] = {}
        for name in names:
            match = re.fullmatch("analog-1-([0-9]{1,4})-([0-9]{1,9})", name)
            if match and int(match[1]) in titles:
                parts.setdefault(int(match[1]), []).append((int(match[2]), name))
        numbers = [number for number in titles if number in parts]
        wanted = (channel or "").strip().lower()
        if logic and "capturefile" in about and wanted not in map(str.lower, titles.values()):
            return _logic_of(file, stream, archive, about, interval)
        if not numbers:
            raise InputError(file, "no analog channel in it; expected a voltage, not logic levels")
        lengths = set()
        for number in numbers:
            parts[number].sort()
            if [part for part, _ in parts[number]] != list(range(1, len(parts[number]) + 1)):
                raise InputError(file, f"a part of analog-1-{number} is missing")
            lengths.add(sum(archive.getinfo(name).file_size for _, name in parts[number]) // 4)
    if len(lengths) > 1:
        raise InputError(file, "its analog channels differ in length")
    (length,) = lengths

    def samples(k: int) -> Floats:
        _check_size(file, stream, length)
        signal, filled = np.empty(length), 0
        with zipfile.ZipFile(stream) as archive:
            for _, name in parts[numbers[k]]:
                piece = np.frombuffer(archive.read(name), dtype="<f4")
                signal[filled : filled + piece.size] = piece
                filled += piece.size
        return signal

    columns = [Column(number, titles[number], "V", 1.0, 0) for number in numbers]
    return _Channels(samples, columns, interval, None)


def _logic_of(
    file: str,
    stream: IO[bytes],
    archive: zipfile.ZipFile,
    about: dict[str, str],
    interval: float | None,
) -> _Channels:
    """Read the changes of a session's logic levels block by block."""
    stem, size = about["capturefile"].strip(), about.get("unitsize", "1").strip()
    if size not in ("1", "2", "4", "8"):
        raise InputError(file, f"its unitsize is {size[:20]}; expected 1, 2, 4 or 8")
    pattern = re.compile(f"{re.escape(stem)}(-[0-9]{{1,9}})?")
    names = {name for name in archive.namelist() if pattern.fullmatch(name)}
    parts = [stem] if stem in names else [f"{stem}-{k}" for k in range(1, len(names) + 1)]
    if not names or names != set(parts):
        raise InputError(file, f"a part of {stem[:40]} is missing")
    total = sum(archive.getinfo(name).file_size for name in parts)
    most = max(MOST_NUMBERS, MOST_LOGIC_PER_BYTE * _size(stream))
    if total > most:
        raise InputError(file, f"it unpacks to {total} bytes of logic; at most {most} are read")
    unit, count, at = int(size), 0, 0
    places, words = [], []
    last = np.zeros(0, dtype=f"<u{unit}")
    for name in parts:
        with archive.open(name) as stream:
            while block := stream.read(_BLOCK * unit):
                # An incomplete sample is dropped.
                new = np.frombuffer(block[: len(block) // unit * unit], dtype=f"<u{unit}")
                seen = np.concatenate([last, new])
                changed = np.flatnonzero(seen[1:] != seen[:-1]) + 1
                if not last.size:
                    words.append(seen[:1])
                places.append(changed + (at - last.size))
                words.append(seen[changed])
                last, at, count = seen[-1:], at + new.size, count + changed.size
                if count > MOST_EDGES:
                    what = f"more than {MOST_EDGES} changes of level"
                    raise InputError(file, f"{what}; save a part of the record")
    if at < 2:
        raise InputError(file, f"number of samples is {at}; expected 2 or more")
    legal = range(1, 8 * unit + 1)
    titles = {k: title for k, title in _named(about, "probe").items() if k in legal}
    titles = titles or {k: f"D{k - 1}" for k in legal}
    columns = [Column(number, title, "", 1.0, 0) for number, title in sorted(titles.items())]
    levels = np.concatenate(words).astype(np.uint64)
    held = _Logic(np.concatenate(places).astype(np.int64), levels, at, interval)
    return _Channels(lambda k: np.zeros(0), columns, interval, None, held)


def _named(about: dict[str, str], kind: str) -> dict[int, str]:
    """Return the titles of the channels of one kind, by channel number."""
    matches = {key: re.fullmatch(f"{kind}([0-9]{{1,4}})", key) for key in about}
    return {int(match[1]): about[key] for key, match in matches.items() if match}


def _pick(file: str, table: _Channels, channel: str | None) -> tuple[list[int], int | None]:
    """Return the indices of the wanted voltage or level columns, and of the time column or None."""
    columns = table.columns
    time = None if table.logic else _time_column(table)
    usable = [k for k, column in enumerate(columns) if k != time and column.unit in ("", "V")]
    if not table.logic:
        usable = [k for k in usable if not _is_counter(table, k)]
    if not usable:
        raise InputError(file, "no voltage column; expected a channel in volts besides the time")
    if channel is None:
        return usable, time
    name = channel.strip().lower()
    wanted = [k for k in usable if name in (columns[k].title.lower(), str(columns[k].number))]
    if not wanted:
        channels = _titles(table, usable)
        raise InputError(file, f"no channel {channel!r}; its channels are {channels}")
    return wanted[:1], time


def _titles(table: _Channels, places: list[int]) -> str:
    named = [table.columns[k] for k in places]
    return ", ".join(column.title or f"column {column.number}" for column in named)


def _no_times(file: str) -> InputError:
    why = "it has no times; give the time between two samples (--sample-interval)"
    return InputError(file, why)


def _edges(
    file: str, table: _Channels, channel: str | None, sample_interval: float | None
) -> Edges:
    """Return the changes of the wanted channel, or of the one that changes most often."""
    wanted, time = _pick(file, table, channel)
    if table.logic:
        held = table.logic
        flips = held.words[1:] ^ held.words[:-1]
        masks = [np.uint64(1 << (table.columns[k].number - 1)) for k in wanted]
        busiest = int(np.argmax([np.count_nonzero(flips & mask) for mask in masks]))
        changed = (flips & masks[busiest]) > 0
        first = int((held.words[0] & masks[busiest]) > 0)
        dt = sample_interval or held.interval
        if dt is None:
            raise _no_times(file)
        title = table.columns[wanted[busiest]].title
        return Edges(held.places[changed] - 0.5, 1.0, first, held.samples, dt, title)
    edges = [_edges_of(file, table, k, time, sample_interval or table.interval) for k in wanted]
    return max(edges, key=lambda one: len(one.places))


def _edges_of(
    file: str, table: _Channels, k: int, time: int | None, interval: float | None
) -> Edges:
    """Return the level changes of one column of numbers."""
    u, title = _checked(file, table, k), table.columns[k].title
    if len(u) < 2:
        raise InputError(file, f"number of samples is {len(u)}; expected 2 or more")
    two = np.unique(u[~np.isnan(u)])
    logic = set(two.tolist()) <= {0.0, 1.0} and not np.isnan(u).any()
    if interval is None and time is not None and logic:
        # Many programs store only the changes of logic levels, each with its time.
        t = _checked(file, table, time) * table.columns[time].scale
        steps = np.diff(t)
        if not (steps >= 0).all():
            raise InputError(file, "its times do not increase")
        if steps.max() > 1.5 * steps.min():
            dt = float(steps[steps > 0].min()) / 100
            changed = np.flatnonzero(np.diff(u)) + 1
            return Edges((t[changed] - t[0]) / dt, 1.0, int(u[0]), (t[-1] - t[0]) / dt, dt, title)
    if interval is None:
        if time is None:
            raise _no_times(file)
        interval, u = _even(file, table, time, u)
    if len(two) <= 2:
        high = u == two[-1] if len(two) else np.zeros(len(u), dtype=bool)
        places = np.flatnonzero(high[1:] != high[:-1]) + 0.5
        return Edges(places, 1.0, int(high[0] and len(two) == 2), len(u), interval, title)
    first, places = _crossings(u)
    return Edges(places, _INTERPOLATED, first, len(u), interval, title)


def _crossings(u: Floats) -> tuple[int, Floats]:
    """Return the first level, 0 or 1, and where `u` crosses the middle of the two levels [sample].

    A change counts once the voltage has left a band of four times the noise on each side of the
    middle; this half-width is limited to 0.1 to 0.3 of the difference between the levels.
    """
    volts = u[~np.isnan(u)]
    middle = (volts.min() + volts.max()) / 2
    for _ in range(20):
        above = volts > middle
        low, high = volts[~above].mean(), volts[above].mean()
        middle, before = (low + high) / 2, middle
        if abs(middle - before) < 1e-6 * (high - low):
            break
    noise = 1.4826 * np.median(np.abs(volts - np.where(volts > middle, high, low)))
    band = np.clip(4 * noise, 0.1 * (high - low), 0.3 * (high - low))
    state = np.where(u > middle + band, 1, np.where(u < middle - band, 0, -1))
    sure = np.flatnonzero(state >= 0)
    flips = np.flatnonzero(np.diff(state[sure]))
    beyond = u > middle
    # The last crossing before the voltage leaves the band; halfway between samples if one is NaN.
    crossed = np.flatnonzero(beyond[1:] != beyond[:-1])
    last = np.maximum(np.searchsorted(crossed, sure[flips + 1]) - 1, 0)
    last = crossed[last] if len(flips) else flips
    before, after = u[last] - middle, u[last + 1] - middle
    with np.errstate(invalid="ignore"):
        part = np.nan_to_num(before / (before - after), nan=0.5)
    return int(state[sure[0]]), last + part


def _recording(
    file: str, table: _Channels, channel: str | None, sample_interval: float | None
) -> Recording:
    """Return the voltages of the wanted channel, by default the first, at equal steps."""
    wanted, time = _pick(file, table, channel)
    columns = table.columns
    usable, _ = _pick(file, table, None)
    chosen = columns[wanted[0]]
    u = _checked(file, table, wanted[0])
    if len(u) < 2:
        raise InputError(file, f"number of samples is {len(u)}; expected 2 or more")
    if chosen.scale != 1:
        u = u * chosen.scale
    if sample_interval is None:
        if time is not None:
            sample_interval, u = _even(file, table, time, u)
        elif table.interval is not None:
            sample_interval = table.interval
        else:
            raise _no_times(file)
    # Accept a rate of exactly 1 MS/s that is computed from rounded times.
    if sample_interval > 1.001 / SLOWEST_RATE:
        rate = f"it was sampled at {1e-6 / sample_interval:.3g} MS/s"
        raise InputError(file, f"{rate}; pulses of 3 us need {SLOWEST_RATE / 1e6:g} MS/s or more")
    title = chosen.title or f"column {chosen.number}"
    among = f" of {_titles(table, usable)}" if len(usable) > 1 else ""
    description = (
        f"{Path(file).name}: channel {title}{among}; {len(u)} samples at "
        f"{1e-6 / sample_interval:.6g} MS/s, {len(u) * sample_interval * 1e3:.6g} ms"
    )
    return Recording(u, sample_interval, title, description)


def _checked(file: str, table: _Channels, k: int) -> Floats:
    """Return a column, or raise InputError if its numbers cannot be times or voltages."""
    values, number = table.values(k), table.columns[k].number
    # Sums and products of larger numbers would overflow later.
    ends = [(np.fmax.reduce(part), np.fmin.reduce(part)) for _, part in parts_of(values)]
    high, low = (np.fmax.reduce(some) for some in zip(*ends, strict=True))
    if not (high < _LARGEST and low > -_LARGEST):
        wild = np.flatnonzero(np.abs(values) >= _LARGEST)
        faults = [
            f"sample {at + 1}, column {number}: {values[at]:g} is out of range"
            for at in wild[: InputError.shown]
        ]
        raise InputError(
            file, *(faults or ["it has no numbers"]), more=max(0, len(wild) - InputError.shown)
        )
    return values


def _is_counter(table: _Channels, k: int) -> bool:
    """Return True if a column only numbers the samples."""
    column = table.columns[k]
    if k > 0 or len(table.columns) == 1 or column.unit:
        return False
    return column.title.lower() in _COUNTERS or (
        not column.title and bool((np.diff(table.values(k)[:1000]) == 1).all())
    )


def _time_column(table: _Channels) -> int | None:
    for k, column in enumerate(table.columns):
        if column.unit == "s" or re.match(r"t(ime)?\b|x-axis", column.title.lower()):
            return k
    # A first column without title or unit is taken to be the time if its values rise and never
    # fall, unless it only numbers the samples.
    first = table.columns[0]
    if len(table.columns) == 1 or first.title or first.unit:
        return None
    values = table.values(0)
    rises = bool((np.diff(values) >= 0).all()) and np.ptp(values) > 0
    return 0 if rises and not _is_counter(table, 0) else None


def _even(file: str, table: _Channels, time: int, u: Floats) -> tuple[float, Floats]:
    """Return the time between two samples, and the voltages in order of increasing time."""
    column = table.columns[time]
    t = _checked(file, table, time) * column.scale
    if not np.isfinite(t).all():
        raise InputError(file, "a time is not a finite number")
    if t[0] > t[-1]:
        t, u = t[::-1], u[::-1]
    dt = float(t[-1] - t[0]) / (len(t) - 1)
    if not dt > 0:
        raise InputError(file, "its times do not increase")
    quantum = table.quantum
    if quantum is None:
        largest = np.abs(t).max()
        quantum = 10.0 ** (np.floor(np.log10(largest)) + 1 - max(column.digits, 1))
    steps = np.diff(t)
    typical = float(np.median(steps)) if quantum < 0.1 * dt else dt
    wrong = np.flatnonzero(np.abs(steps - typical) > 0.01 * typical + quantum)
    if wrong.size:
        faults = [
            f"sample {k + 2} comes {steps[k] * 1e9:.6g} ns after the previous one, not "
            f"{typical * 1e9:.6g} ns"
            for k in wrong[: InputError.shown]
        ]
        raise InputError(file, *faults, more=wrong.size - len(faults))
    return dt, u


class Column(NamedTuple):
    """A column of numbers, as described by the header."""

    number: int  # its position in the file, 1 for the first
    title: str
    unit: str  # "s", "V", another unit, or "" if the header states none
    scale: float  # factor from the unit printed to the base unit: 1e-6 for "(us)"
    digits: int  # significant digits of the longest number among the first and the last rows


def _read_text(file: str, data: bytes) -> _Channels:
    """Read a scope's text file."""
    data = _normal(file, data)
    tail = [line for line in _text(data[-64_000:]).split("\n") if line.strip(" ,;\t")][-_TAIL:]
    layout = _layout(tail)
    separator, places, _ = layout
    if not places:
        raise InputError(file, "no column of numbers at its end; expected time and voltage")
    header, offset = _header(file, data, layout)
    try:
        values = _parse(data, offset, layout)
    except ValueError:
        values = _parse_slowly(file, data, len(header), layout)
    beyond = np.isinf(values)
    if beyond.any():
        finite = np.where(beyond, np.nan, values)
        if np.isnan(finite).all(axis=0).any():
            raise InputError(file, "a column is off the scale throughout")
        values = np.clip(values, np.nanmin(finite, axis=0), np.nanmax(finite, axis=0))
    first = _text(data[offset : offset + 4000]).split("\n")[:-1] or tail
    digits = _digits(first[:_TAIL] + tail, separator, places)
    above = [_split(line, separator) for line in header]
    beside = [_split(line, separator)[: places[0]] for line in first]
    columns = _columns(above, places, digits)
    return _Channels(_columns_of(values), columns, _interval(above, beside), None)


def _normal(file: str, data: bytes) -> bytes:
    """Return the content as UTF-8 or Latin-1 without a byte order mark, with LF line endings."""
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        data = data.decode("utf-16", errors="replace").encode()
    if b"\0" in data:
        raise InputError(file, "not text: it contains NUL bytes; expected a table of numbers")
    data = data.removeprefix("\ufeff".encode())
    if b"\r" in data:
        data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    # PicoScope's mark for a sample that is off the scale, and a word processor's minus.
    return data.replace("∞".encode(), b"inf").replace("\u2212".encode(), b"-")


def _text(data: bytes) -> str:
    try:
        return data.decode()
    except UnicodeDecodeError:
        return data.decode("latin-1")


def _split(line: str, separator: str | None) -> list[str]:
    cells = line.split(separator)
    return [cell.strip(" \t\"'") for cell in cells]


def _is_number(cell: str) -> bool:
    return _IS_NUMBER.fullmatch(cell) is not None


class _Layout(NamedTuple):
    """The layout of the numbers in a text file."""

    separator: str | None  # None: white space
    places: tuple[int, ...]  # columns of numbers
    decimal: str


def _layout(tail: list[str]) -> _Layout:
    """Find the layout of the last rows of a file."""
    separator: str | None
    for separator in ("\t", ";", ","):
        if 2 * sum(separator in line for line in tail) > len(tail):
            break
    else:
        # A single column has no separator, but its header may have commas.
        separator = None if any(len(line.split()) > 1 for line in tail) else ","
    rows = [_split(line, separator) for line in tail]
    patterns = Counter(
        tuple(column for column, cell in enumerate(row) if _is_number(cell))
        for row in reversed(rows)
    )
    places = next(iter(patterns.most_common(1)), ((), 0))[0]
    cells = [row[column] for row in rows for column in places if column < len(row)]
    decimal = "," if separator != "," and any("," in cell for cell in cells) else "."
    return _Layout(separator, places, decimal)


def _header(file: str, data: bytes, layout: _Layout) -> tuple[list[str], int]:
    """Return the lines above the numbers, and the byte at which the numbers begin.

    The numbers begin at the first row of numbers followed by two rows of numbers or blank lines, or
    by fewer at the end of the file; the header may contain one or two consecutive rows of numbers.
    """
    lines: list[str] = []
    starts: list[int] = []
    run = position = 0
    while position < len(data) and len(lines) - run < _HEADER:
        end = data.find(b"\n", position)
        end = len(data) if end < 0 else end
        line = _text(data[position:end])
        lines.append(line)
        starts.append(position)
        position = end + 1
        cells = _split(line, layout.separator)
        numbers = all(_value(cells, k, layout.decimal) is not None for k in layout.places)
        run = run + 1 if numbers or (run and not any(cells)) else 0
        if run == 3:
            break
    if not run:
        what = f"no row of numbers in the first {_HEADER} rows"
        raise InputError(file, f"{what}; expected time and voltage")
    return lines[:-run], starts[-run]


def _value(cells: list[str], column: int, decimal: str) -> float | None:
    if column >= len(cells) or not _is_number(cells[column]):
        return None
    if decimal == "." and "," in cells[column]:
        return None
    try:
        return float(cells[column].replace(",", "."))
    except ValueError:
        return None


def _parse(data: bytes, offset: int, layout: _Layout) -> Floats:
    """Read all rows at once; raise ValueError if a row has a different layout."""
    body = io.BytesIO(data)
    body.seek(offset)
    frame = pd.read_csv(
        body,
        sep=layout.separator or r"\s+",
        header=None,
        usecols=list(layout.places),
        dtype=np.float64,
        decimal=layout.decimal,
        engine="c",
        quoting=3,
        na_filter=False,
        encoding="latin-1",
    )
    values = frame.to_numpy()
    if np.isnan(values).any():
        raise ValueError
    return values


def _parse_slowly(file: str, data: bytes, skip: int, layout: _Layout) -> Floats:
    """Parse row by row, and report every cell that is not a number."""
    rows: list[list[float]] = []
    faults: list[str] = []
    more = 0
    for number, line in enumerate(_text(data).split("\n")[skip:], start=skip + 1):
        cells = _split(line, layout.separator)
        if not any(cells):
            continue
        row = [_value(cells, column, layout.decimal) for column in layout.places]
        for column, value in zip(layout.places, row, strict=True):
            if value is None and len(faults) == InputError.shown:
                more += 1
            elif value is None:
                cell = cells[column] if column < len(cells) else ""
                what = f": {cell[:20]!r} is not a number" if cell else " is empty"
                faults.append(f"row {number}, column {column + 1}{what}")
        rows.append([np.nan if value is None else value for value in row])
    if faults:
        raise InputError(file, *faults, more=more)
    return np.array(rows)


def _digits(lines: list[str], separator: str | None, places: tuple[int, ...]) -> list[int]:
    rows = [_split(line, separator) for line in lines]
    mantissas = [
        [re.split("[eE]", row[column])[0] for row in rows if column < len(row)] for column in places
    ]
    return [
        max((len(re.sub("[^0-9]", "", cell).lstrip("0")) for cell in column), default=0)
        for column in mantissas
    ]


def _unit(text: str) -> tuple[str, float] | None:
    """Read a unit such as ``Volt``, ``(us)`` or ``mV``; return None if the text is not a unit."""
    text = text.strip(" ()[]").lower()
    if text in _BASE:
        return _BASE[text], 1.0
    if text[:1] in _PREFIX and text[1:] in ("s", "sec", "v", "volt", "a"):
        return _BASE[text[1:]], _PREFIX[text[0]]
    return None


def _columns(above: list[list[str]], places: tuple[int, ...], digits: list[int]) -> list[Column]:
    titles = [""] * len(places)
    units: list[tuple[str, float] | None] = [None] * len(places)
    for cells in reversed(above[-8:]):
        here = [cells[index] if index < len(cells) else "" for index in places]
        if not any(here):
            continue
        # Keysight titles its channels 1 to 4; other numbers are settings of the scope.
        if any(_is_number(cell) and not re.fullmatch("[0-9]{1,2}", cell) for cell in here):
            break
        row_units = [_unit(cell) for cell in here]
        # Rigol writes "Sequence" under its counter.
        unitless = {cell.lower() for cell, unit in zip(here, row_units, strict=True) if not unit}
        if any(row_units) and not any(titles) and not any(units) and unitless <= {"", "sequence"}:
            units = row_units
        else:
            titles = here
            break
    columns = []
    for index, title, unit, count in zip(places, titles, units, digits, strict=True):
        inside = _UNIT_IN_TITLE.fullmatch(title)
        if unit is None and inside and (unit := _unit(inside[2] or inside[3] or "")):
            title = inside[1]
        name, scale = unit or ("", 1.0)
        columns.append(Column(index + 1, title.lstrip("# "), name, scale, count))
    return columns


def _interval(above: list[list[str]], beside: list[list[str]]) -> float | None:
    """Return the time between two samples as stated in the header [s]; None if not stated."""
    header = [*above, *beside]
    for row, cells in enumerate(header):
        below = header[row + 1] if row + 1 < len(header) else []
        for index, cell in enumerate(cells):
            key = cell.lower().lstrip("#; ").replace("_", " ")
            kind = _INTERVAL.match(key) or _RATE.match(key)
            # The value is in the same cell, the next one, or the one below.
            around = [re.sub("^[^:=]*", "", cell), *cells[index + 1 : index + 2], *below[index:]]
            for candidate in around[:3] if kind else []:
                value = _quantity(candidate)
                if value and kind:
                    return value if kind.re is _INTERVAL else 1 / value
    return None


def _quantity(text: str) -> float | None:
    """Read a positive number, with its unit if any: ``4e-09``, ``4.0ns`` or ``CH1:250 MSa/s``."""
    match = _QUANTITY.fullmatch(text.strip())
    if not match:
        return None
    number, unit = match.groups()
    prefixed = len(unit) > 1 and unit.lower() not in _BASE
    scale = {**_PREFIX, "K": 1e3, "M": 1e6, "G": 1e9}.get(unit[0], 1.0) if prefixed else 1.0
    value = float(number.replace(",", ".")) * scale
    return value if 1e-13 < value < 1e13 else None
