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
from typing import IO, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.arrays import Floats, parts_of
from shipnet.errors import ArgumentError, InputError
from shipnet.files import LARGEST_RECORD, LONGEST, open_file
from shipnet.lazy import pd

#: Lowest sampling rate that resolves pulses of 3 us [1/s].
SLOWEST_RATE = 1e6

#: Limits on how many numbers the arrays of an archive or a channel of a session may unpack to: in
#: total, and per byte of the file; the larger one applies. A tiny archive can unpack to any size.
MOST_NUMBERS, MOST_PER_BYTE = 2**22, 4

#: Maximum number of channels in an array.
MOST_CHANNELS = 1024

#: Size above which a numpy file is memory-mapped instead of read [byte].
MAPPED = 2**26

#: Maximum ratio of logic data to the session file (deflate reaches 1032).
MOST_LOGIC_PER_BYTE = 1100

#: Maximum number of changes of level: one per byte of the file, but within these limits.
MOST_EDGES = 2**22, 2**24

_BLOCK = 2**22  #: Number of logic samples per block.
_INTERPOLATED = 0.3  #: Uncertainty of an interpolated edge of a sampled voltage [sample].
_LARGEST_METADATA = 2**20  #: Maximum size of the metadata of a sigrok session [byte].
_LARGEST = 1e15  #: Magnitude above which a number cannot be a time or a voltage in any unit.

_COUNTERS = ("x", "#", "n", "no", "nr", "index", "sample", "samples", "point", "points", "sequence")

#: Number of last rows from which a file's layout is found, and maximum number of header rows.
_TAIL, _HEADER = 10, 2000

_NUMBER = r"[+-]?(?:[0-9]+(?:[.,][0-9]*)?|[.,][0-9]+)(?:[eE][+-]?[0-9]+)?"
_IS_NUMBER = re.compile(rf"{_NUMBER}|[+-]?inf", re.ASCII)
_QUANTITY = re.compile(rf"(?:[^:=]*[:=])?\s*({_NUMBER})\s*([a-zµμ/]*)", re.ASCII | re.IGNORECASE)
_UNIT_IN_TITLE = re.compile(r"(.*)(?:[(\[]([^()\[\]]*)[)\]]|\bin\s+(\S+))\s*")
_INTERVAL = re.compile(
    r"(sampl\w*\s+(interval|period)|time\s+(interval|increment)|(x\s*|t)?inc(rement)?"
    r"|interval|delta\s*t|dt)\b"
)
_RATE = re.compile(r"(sampl\w*\s+(rate|frequency|freq)|samplerate|fs)\b")

#: Prefixes of units. Scopes show neither megavolts nor megaseconds, so case does not matter.
_PREFIX = {"": 1.0, "p": 1e-12, "n": 1e-9, "u": 1e-6, "µ": 1e-6, "μ": 1e-6, "m": 1e-3, "k": 1e3}
_BASE = dict.fromkeys(("s", "sec", "second", "seconds"), "s")
_BASE |= dict.fromkeys(("v", "volt", "volts"), "V") | {
    "hz": "Hz",
    "db": "dB",
    "w": "W",
    "watt": "W",
}
_BASE |= dict.fromkeys(("a", "amp", "ampere"), "A")


class Recording(NamedTuple):
    """One channel of a file: voltages [V] at equal steps of `dt` [s]."""

    u: Floats
    dt: float
    channel: str
    description: str


class Edges(NamedTuple):
    """The changes of one channel between two levels."""

    places: npt.NDArray[np.floating[Any]]  # most likely position of each change [sample]
    width: float  # uncertainty of a position [sample]
    first: int  # level before the first change, 0 or 1
    samples: float  # length of the record [sample]
    dt: float  # time between two samples [s]
    channel: str


class _Column(NamedTuple):
    """A column of numbers, as described by the header."""

    number: int  # its position in the file, 1 for the first
    title: str
    unit: str = "V"  # "s", "V", another unit, or "" if the header states none
    scale: float = 1.0  # factor from the unit printed to the base unit: 1e-6 for "(us)"
    digits: int = 1  # significant digits of the longest number in the last rows of a text file

    @property
    def name(self) -> str:
        """The title or, without one, the number."""
        return self.title or f"column {self.number}"


class _Channels(NamedTuple):
    """The content of a file: one column per channel, and the times or their interval if known."""

    file: str
    values: Callable[[int], Floats]  # reads the numbers of a column
    columns: list[_Column]
    interval: float | None = None
    quantum: float | None = None  # step to which times are rounded; None if the digits show it
    #: Instead of numbers: the first sample after each change of a session's logic channels, the
    #: levels at the beginning and after each change, and the number of samples.
    logic: tuple[npt.NDArray[np.int64], npt.NDArray[Any], int] | None = None


def read_scope_file(
    path: str | PathLike[str], *, channel: str | None = None, sample_interval: float | None = None
) -> Recording:
    """Read one channel of a recorded waveform, by default the first, at equal steps."""
    with _read(path, sample_interval) as table:
        (k, *_), time = _pick(table, channel)
        usable, _ = _pick(table, None)
        column, u = table.columns[k], _samples(table, k)
        if column.scale != 1:
            u = u * column.scale
        if sample_interval is None and time is not None:
            dt, u = _even(table, time, u)
        else:
            dt = _known_interval(sample_interval or table.interval, table)
        # Accept a rate of exactly 1 MS/s that is computed from rounded times.
        if dt > 1.001 / SLOWEST_RATE:
            rate = f"it was sampled at {1e-6 / dt:.3g} MS/s"
            raise InputError(
                table.file, f"{rate}; pulses of 3 us need {SLOWEST_RATE / 1e6:g} MS/s or more"
            )
        among = f" of {_names(table, usable)}" if len(usable) > 1 else ""
        description = (
            f"{Path(table.file).name}: channel {column.name}{among}; {len(u)} samples at "
            f"{1e-6 / dt:.6g} MS/s, {len(u) * dt * 1e3:.6g} ms"
        )
        return Recording(u, dt, column.name, description)


def read_edges(
    path: str | PathLike[str], *, channel: str | None = None, sample_interval: float | None = None
) -> Edges:
    """Read the level changes of one channel, by default the one with the most changes."""
    with _read(path, sample_interval, (channel or "").strip().lower()) as table:
        chosen, time = _pick(table, channel)
        if table.logic is None:
            interval = sample_interval or table.interval
            edges = [_edges_of(table, k, time, interval) for k in chosen]
            return max(edges, key=lambda candidate: len(candidate.places))
        places, words, samples = table.logic
        flips = words[1:] ^ words[:-1]
        masks = [words.dtype.type(1 << (table.columns[k].number - 1)) for k in chosen]
        busiest = int(np.argmax([np.count_nonzero(flips & mask) for mask in masks]))
        changed, first = (flips & masks[busiest]) > 0, int((words[0] & masks[busiest]) > 0)
        dt = _known_interval(sample_interval or table.interval, table)
        title = table.columns[chosen[busiest]].title
        return Edges(places[changed] - 0.5, 1.0, first, samples, dt, title)


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


def read_arrays(path: str | PathLike[str], keys: Iterable[str]) -> dict[str, npt.NDArray[Any]]:
    """Read arrays from an ``.npz`` file by name; raise InputError if one is missing."""
    required = tuple(keys)
    with _opened(path) as (file, stream), zipfile.ZipFile(stream) as archive:
        arrays = _members(file, stream, archive, required)
        if missing := [key for key in required if key not in arrays]:
            names = ", ".join(sorted(_stems(archive))[:10]) or "nothing"
            raise InputError(file, f"it has {names}; also expected {', '.join(missing)}")
        return arrays


@contextmanager
def _opened(path: str | PathLike[str]) -> Iterator[tuple[str, IO[bytes]]]:
    """Open a file and yield its name and content; convert errors of parsers to an InputError."""
    file = str(path)
    mapped = Path(file).suffix.lower() == ".npy"
    with open_file(path, None if mapped else LARGEST_RECORD) as stream:
        if not _size(stream):
            raise InputError(file, "the file is empty")
        try:
            yield file, stream
        except InputError:
            raise
        except Exception as fault:
            # Parsers raise a dozen kinds of errors, such as BadZipFile; all mean a damaged file.
            why = str(fault) or type(fault).__name__
            kind = Path(file).suffix.lower() or "text"
            raise InputError(file, f"not a complete {kind} file: {why}") from fault


@contextmanager
def _read(
    path: str | PathLike[str], sample_interval: float | None, logic: str | None = None
) -> Iterator[_Channels]:
    """Read a file according to its suffix; `logic` allows levels, and names the wanted channel."""
    if sample_interval is not None and not (
        isinstance(sample_interval, Real) and 0 < sample_interval < np.inf
    ):
        raise ArgumentError(f"sample_interval is {sample_interval} s; it must be positive")
    with _opened(path) as (file, stream):
        kind = Path(file).suffix.lower()
        if kind == ".sr":
            yield _read_sr(file, stream, logic)
        else:
            readers = {".npy": _read_npy, ".npz": _read_npz}
            yield readers.get(kind, _read_text)(file, stream)


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


def _stems(archive: zipfile.ZipFile) -> dict[str, str]:
    return {name.removesuffix(".npy"): name for name in archive.namelist()}


def _members(
    file: str, stream: IO[bytes], archive: zipfile.ZipFile, keys: Iterable[str]
) -> dict[str, npt.NDArray[Any]]:
    """Read arrays that an archive has; raise InputError if they unpack to too many numbers."""
    names = {key: name for key, name in _stems(archive).items() if key in keys}
    # Check before reading, assuming eight bytes per number; a number may have as few as one.
    _check_size(file, stream, sum(archive.getinfo(name).file_size for name in names.values()) / 8)
    arrays = {}
    for key, name in names.items():
        with archive.open(name) as part:
            arrays[key] = np.lib.format.read_array(part, allow_pickle=False)
    _check_size(file, stream, sum(array.size for array in arrays.values()))
    return arrays


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
        return _Channels(file, lambda k: values, [_Column(1, "u")])
    if values.ndim != 2 or not 2 <= min(values.shape) <= 1 + MOST_CHANNELS:
        about = f"the array has the shape {array.shape}; expected voltages, or time and voltages"
        raise InputError(file, f"{about} of at most {MOST_CHANNELS} channels")
    if values.shape[0] < values.shape[1]:
        values, array = values.T, array.T
    columns = [_Column(1, "t", "s")]
    columns += [_Column(k + 1, f"u{k}") for k in range(1, values.shape[1])]
    quantum = _rounding(array[:, 0])
    return _Channels(file, values.T.__getitem__, columns, quantum=quantum)


def _read_npz(file: str, stream: IO[bytes]) -> _Channels:
    with zipfile.ZipFile(stream) as archive:
        names = _stems(archive)
        voltage = next((key for key in ("u", "v") if key in names), None)
        if voltage is None:
            has = ", ".join(sorted(names)[:10]) or "nothing"
            raise InputError(file, f"it has {has}; expected the voltages as u or v")
        arrays = _members(file, stream, archive, (voltage, "t", "dt", "probes"))
    u = _check_real(file, voltage, arrays[voltage])
    u = u[:, np.newaxis] if u.ndim == 1 else u
    if u.ndim != 2 or u.shape[1] > MOST_CHANNELS:
        expected = f"(times, channels), with at most {MOST_CHANNELS} channels"
        raise InputError(file, f"{voltage} has the shape {u.shape}; expected {expected}")
    titles = [voltage] if u.shape[1] == 1 else [f"{voltage}{k}" for k in range(u.shape[1])]
    if "probes" in arrays and arrays["probes"].shape == (u.shape[1],):
        titles = [str(name) for name in arrays["probes"]]
    columns = [_Column(k, title) for k, title in enumerate(titles, start=1)]
    if "t" in arrays:
        t = _check_real(file, "t", arrays["t"])
        if t.shape != u.shape[:1]:
            raise InputError(file, f"t has the shape {t.shape}, but {voltage} has {u.shape}")
        columns, values = [_Column(0, "t", "s"), *columns], [t, *u.T]
        return _Channels(file, values.__getitem__, columns, quantum=_rounding(arrays["t"]))
    interval = None
    if "dt" in arrays:
        dt = _check_real(file, "dt", arrays["dt"])
        if dt.size != 1 or not 0 < dt.item() < np.inf:
            raise InputError(file, "dt is not a single positive number")
        interval = dt.item()
    return _Channels(file, u.T.__getitem__, columns, interval)


def _read_sr(file: str, stream: IO[bytes], logic: str | None) -> _Channels:
    """Read the voltages of a sigrok session or, if `logic` is text, its levels if it has any."""
    archive = zipfile.ZipFile(stream)
    names = set(archive.namelist())
    if "metadata" not in names:
        raise InputError(file, "no metadata in it; expected a sigrok session")
    if archive.getinfo("metadata").file_size > _LARGEST_METADATA:
        raise InputError(file, f"its metadata has more than {_LARGEST_METADATA} bytes")
    settings = configparser.RawConfigParser(strict=False)
    # Some programs indent keys, which the parser would read as parts of the value above.
    settings.read_string(re.sub(r"(?m)^[ \t]+", "", archive.read("metadata").decode()))
    device = next((name for name in settings.sections() if "device" in name), None)
    about = dict(settings[device]) if device else {}
    rate = re.fullmatch(r"([0-9.]+)\s*([kMG]?)(?:Hz)?", about.get("samplerate", "").strip())
    hertz = float(rate[1]) * {"": 1, "k": 1e3, "M": 1e6, "G": 1e9}[rate[2]] if rate else 0
    interval = 1 / hertz if hertz > 0 else None

    titles = _titles(about, "analog")
    if logic is not None and "capturefile" in about:
        if logic not in map(str.lower, titles.values()):
            return _read_logic(file, stream, archive, about, interval)
    parts: dict[int, list[str]] = {}
    for number in titles:
        pattern = re.compile(f"analog-1-{number}-[0-9]{{1,9}}")
        if count := sum(pattern.fullmatch(name) is not None for name in names):
            parts[number] = [f"analog-1-{number}-{k}" for k in range(1, count + 1)]
            if not names.issuperset(parts[number]):
                raise InputError(file, f"a part of analog-1-{number} is missing")
    if not parts:
        raise InputError(file, "no analog channel in it; expected a voltage, not logic levels")
    lengths = {
        sum(archive.getinfo(name).file_size for name in each) // 4 for each in parts.values()
    }
    if len(lengths) > 1:
        raise InputError(file, "its analog channels differ in length")

    def samples(k: int) -> Floats:
        _check_size(file, stream, *lengths)
        pieces = map(archive.read, [*parts.values()][k])
        return np.concatenate([np.frombuffer(piece, dtype="<f4") for piece in pieces]).astype(float)

    return _Channels(file, samples, [_Column(number, titles[number]) for number in parts], interval)


def _titles(about: dict[str, str], kind: str) -> dict[int, str]:
    """Return the titles of the channels of one kind, by channel number."""
    matches = {key: re.fullmatch(f"{kind}([0-9]{{1,4}})", key) for key in about}
    return {int(match[1]): about[key] for key, match in matches.items() if match}


def _read_logic(
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
    most_edges = np.clip(_size(stream), *MOST_EDGES)
    if total > most:
        raise InputError(file, f"it unpacks to {total} bytes of logic; at most {most} are read")
    unit, count, at = int(size), 0, 0
    places, words = [], []
    last = np.zeros(0, dtype=f"<u{unit}")
    for name in parts:
        with archive.open(name) as part:
            while block := part.read(_BLOCK * unit):
                # An incomplete sample is dropped.
                new = np.frombuffer(block[: len(block) // unit * unit], dtype=f"<u{unit}")
                levels = np.concatenate([last, new])
                changed = np.flatnonzero(levels[1:] != levels[:-1]) + 1
                if not last.size:
                    words.append(levels[:1])
                places.append(changed + (at - last.size))
                words.append(levels[changed])
                last, at, count = levels[-1:], at + new.size, count + changed.size
                if count > most_edges:
                    what = f"more than {most_edges} changes of level"
                    raise InputError(file, f"{what}; save a part of the record")
    if at < 2:
        raise InputError(file, f"number of samples is {at}; expected 2 or more")
    legal = range(1, 8 * unit + 1)
    titles = {k: title for k, title in _titles(about, "probe").items() if k in legal}
    titles = titles or {k: f"D{k - 1}" for k in legal}
    columns = [_Column(number, title, "") for number, title in sorted(titles.items())]
    changes = np.concatenate(places), np.concatenate(words), at
    return _Channels(file, lambda k: np.zeros(0), columns, interval, logic=changes)


def _pick(table: _Channels, channel: str | None) -> tuple[list[int], int | None]:
    """Return the indices of the wanted voltage or level columns, and of the time column or None."""
    columns = table.columns
    usable = [k for k, column in enumerate(columns) if column.unit in ("", "V")]
    time = None
    if table.logic is None:
        time = _time_column(table)
        usable = [k for k in usable if k != time and not _is_counter(table, k)]
    if not usable:
        raise InputError(
            table.file, "no voltage column; expected a channel in volts besides the time"
        )
    if channel is None:
        return usable, time
    name = channel.strip().lower()
    matching = [k for k in usable if name in (columns[k].title.lower(), str(columns[k].number))]
    if not matching:
        channels = _names(table, usable)
        raise InputError(table.file, f"no channel {channel!r}; its channels are {channels}")
    return matching[:1], time


def _names(table: _Channels, indices: list[int]) -> str:
    return ", ".join(table.columns[k].name for k in indices)


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
    if len(table.columns) == 1 or first.title or first.unit or _is_counter(table, 0):
        return None
    values = table.values(0)
    return 0 if (np.diff(values) >= 0).all() and np.ptp(values) > 0 else None


def _known_interval(interval: float | None, table: _Channels) -> float:
    if interval is None:
        why = "it has no times; give the time between two samples (--sample-interval)"
        raise InputError(table.file, why)
    return interval


def _samples(table: _Channels, k: int) -> Floats:
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
        ] or ["it has no numbers"]
        raise InputError(table.file, *faults, more=max(0, len(wild) - InputError.shown))
    if len(values) < 2:
        raise InputError(table.file, f"number of samples is {len(values)}; expected 2 or more")
    return values


def _even(table: _Channels, time: int, u: Floats) -> tuple[float, Floats]:
    """Return the time between two samples, and the voltages in order of increasing time."""
    *_, scale, digits = table.columns[time]
    t = _samples(table, time) * scale
    if not np.isfinite(t).all():
        raise InputError(table.file, "a time is not a finite number")
    if t[0] > t[-1]:
        t, u = t[::-1], u[::-1]
    dt = float(t[-1] - t[0]) / (len(t) - 1)
    if not dt > 0:
        raise InputError(table.file, "its times do not increase")
    quantum = table.quantum
    if quantum is None:
        quantum = 10.0 ** (np.floor(np.log10(np.abs(t).max())) + 1 - digits)
    steps = np.diff(t)
    typical = float(np.median(steps)) if quantum < 0.1 * dt else dt
    wrong = np.flatnonzero(np.abs(steps - typical) > 0.01 * typical + quantum)
    if wrong.size:
        faults = [
            f"sample {k + 2} comes {steps[k] * 1e9:.6g} ns after the previous one, not "
            f"{typical * 1e9:.6g} ns"
            for k in wrong[: InputError.shown]
        ]
        raise InputError(table.file, *faults, more=wrong.size - len(faults))
    return dt, u


def _edges_of(table: _Channels, k: int, time: int | None, interval: float | None) -> Edges:
    """Return the level changes of one column of numbers."""
    u, title = _samples(table, k), table.columns[k].title
    two = np.unique(u[~np.isnan(u)])
    logic = set(two.tolist()) <= {0.0, 1.0} and not np.isnan(u).any()
    if interval is None and time is not None and logic:
        # Many programs store only the changes of logic levels, each with its time.
        t = _samples(table, time) * table.columns[time].scale
        steps = np.diff(t)
        if not (steps >= 0).all():
            raise InputError(table.file, "its times do not increase")
        if steps.max() > 1.5 * steps.min():
            dt = float(steps[steps > 0].min()) / 100
            changed = np.flatnonzero(np.diff(u)) + 1
            return Edges((t[changed] - t[0]) / dt, 1.0, int(u[0]), (t[-1] - t[0]) / dt, dt, title)
    if interval is None and time is not None:
        interval, u = _even(table, time, u)
    interval = _known_interval(interval, table)
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


def _read_text(file: str, stream: IO[bytes]) -> _Channels:
    """Read a scope's text file."""
    text = _decoded(file, stream.read())
    lines = io.StringIO(text)
    if long := next((n for n, line in enumerate(lines, 1) if len(line) > LONGEST + 1), 0):
        raise InputError(file, f"row {long} has more than {LONGEST} characters; expected a table")
    tail = [line for line in text[-64_000:].split("\n") if line.strip(" ,;\t")][-_TAIL:]
    if not tail:
        raise InputError(file, "the file is empty")
    for separator in ("\t", ";", ",", None):
        if separator and 2 * sum(separator in line for line in tail) > len(tail):
            break
    else:
        # A single column has no separator, but its header may have commas.
        separator = None if any(len(line.split()) > 1 for line in tail) else ","

    def split(line: str) -> list[str]:
        return [cell.strip(" \t\"'") for cell in line.split(separator)]

    # The columns that contain numbers in most of the last rows.
    rows = [split(line) for line in reversed(tail)]
    kinds = Counter(tuple(k for k, cell in enumerate(row) if _is_number(cell)) for row in rows)
    ((places, _),) = kinds.most_common(1)
    if not places:
        raise InputError(file, "no column of numbers at its end; expected time and voltage")
    cells = [row[k] for row in rows for k in places if k < len(row)]
    decimal = "," if separator != "," and any("," in cell for cell in cells) else "."

    # The numbers begin at the first row of numbers followed by two rows of numbers or blank lines,
    # or by fewer at the end of the file; the header may contain one or two rows of numbers.
    header: list[list[str]] = []
    run = 0
    for line in text.split("\n", _HEADER + 3)[: _HEADER + 3]:
        row = split(line)
        numbers = all(k < len(row) and _value(row[k], decimal) is not None for k in places)
        run = run + 1 if numbers or (run and not any(row)) else 0
        header.append(row)
        if run == 3 or len(header) - run >= _HEADER:
            break
    if not run:
        what = f"no row of numbers in the first {_HEADER} rows"
        raise InputError(file, f"{what}; expected time and voltage")
    header, first = header[:-run], header[-run]
    try:
        values = pd.read_csv(
            io.StringIO(text),
            sep=separator or r"\s+",
            header=None,
            skiprows=len(header),
            usecols=list(places),
            dtype=np.float64,
            decimal=decimal,
            quoting=3,
            na_filter=False,
        ).to_numpy()
        if np.isnan(values).any():
            raise ValueError
    except ValueError:
        values = _parse_slowly(file, text, len(header), split, places, decimal)
    beyond = np.isinf(values)
    if beyond.any():
        finite = np.where(beyond, np.nan, values)
        if np.isnan(finite).all(axis=0).any():
            raise InputError(file, "a column is off the scale throughout")
        values = np.clip(values, np.nanmin(finite, axis=0), np.nanmax(finite, axis=0))
    interval = _interval([*header, first[: places[0]]])
    columns = [
        column._replace(digits=max(_digits(row[k]) for row in [first, *rows] if k < len(row)))
        for column, k in zip(_columns(header, places), places, strict=True)
    ]
    return _Channels(file, values.T.__getitem__, columns, interval)


def _decoded(file: str, data: bytes) -> str:
    """Return the content of a text file with LF line endings."""
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        text = data.decode("utf-16", errors="replace")
    else:
        try:
            text = data.decode("utf-8-sig")
        except UnicodeDecodeError:
            text = data.decode("latin-1")
    if "\0" in text:
        raise InputError(file, "not text: it contains NUL bytes; expected a table of numbers")
    if "\r" in text:
        text = text.replace("\r\n", "\n").replace("\r", "\n")
    # PicoScope's mark for a sample that is off the scale, and a word processor's minus.
    return text.replace("∞", "inf").replace("\u2212", "-")


def _is_number(cell: str) -> bool:
    return _IS_NUMBER.fullmatch(cell) is not None


def _digits(cell: str) -> int:
    """Return the number of significant digits of a number, at least 1."""
    return max(1, len(re.sub("[^0-9]", "", re.split("[eE]", cell)[0]).lstrip("0")))


def _value(cell: str, decimal: str) -> float | None:
    if not _is_number(cell) or (decimal == "." and "," in cell):
        return None
    return float(cell.replace(",", "."))


def _parse_slowly(
    file: str,
    text: str,
    skip: int,
    split: Callable[[str], list[str]],
    places: tuple[int, ...],
    decimal: str,
) -> Floats:
    """Parse row by row, and report every cell that is not a number."""
    rows: list[list[float]] = []
    faults: list[str] = []
    wrong = 0
    for number, line in enumerate(text.split("\n")[skip:], start=skip + 1):
        cells = split(line)
        if not any(cells):
            continue
        row = []
        for k in places:
            cell = cells[k] if k < len(cells) else ""
            value = _value(cell, decimal)
            row.append(np.nan if value is None else value)
            if value is None:
                wrong += 1
                what = f": {cell[:20]!r} is not a number" if cell else " is empty"
                faults += [f"row {number}, column {k + 1}{what}"][: InputError.shown - len(faults)]
        rows.append(row)
    if faults:
        raise InputError(file, *faults, more=wrong - len(faults))
    return np.array(rows)


def _unit(text: str) -> tuple[str, float] | None:
    """Read a unit such as ``Volt``, ``(us)`` or ``mV``; return None if the text is not a unit."""
    text = text.strip(" ()[]").lower()
    if text in _BASE:
        return _BASE[text], 1.0
    if text[:1] in _PREFIX and text[1:] in ("s", "sec", "v", "volt", "a"):
        return _BASE[text[1:]], _PREFIX[text[0]]
    return None


def _columns(header: list[list[str]], places: tuple[int, ...]) -> list[_Column]:
    """Return the titles and units of the columns of numbers from the last rows of the header."""
    titles = [""] * len(places)
    units: list[tuple[str, float] | None] = [None] * len(places)
    for cells in reversed(header[-8:]):
        here = [cells[index] if index < len(cells) else "" for index in places]
        if not any(here):
            continue
        # Keysight titles its channels 1 to 4; other numbers are settings of the scope.
        if any(_is_number(cell) and not re.fullmatch("[0-9]{1,2}", cell) for cell in here):
            break
        row_units = [_unit(cell) for cell in here]
        # Rigol writes "Sequence" under its counter.
        unitless = {cell.lower() for cell, unit in zip(here, row_units, strict=True) if not unit}
        if not any(row_units) or any(units) or not unitless <= {"", "sequence"}:
            titles = here
            break
        units = row_units
    columns = []
    for index, title, unit in zip(places, titles, units, strict=True):
        inside = _UNIT_IN_TITLE.fullmatch(title)
        if unit is None and inside and (unit := _unit(inside[2] or inside[3] or "")):
            title = inside[1].rstrip()
        columns.append(_Column(index + 1, title.lstrip("# "), *(unit or ("", 1.0))))
    return columns


def _interval(header: list[list[str]]) -> float | None:
    """Return the time between two samples as stated in the header [s]; None if not stated."""
    for row, cells in enumerate(header):
        below = header[row + 1] if row + 1 < len(header) else []
        for index, cell in enumerate(cells):
            key = cell.lower().lstrip("#; ").replace("_", " ")
            is_interval = _INTERVAL.match(key)
            if not is_interval and not _RATE.match(key):
                continue
            # The value is in the same cell, the next one, or the one below.
            around = [re.sub("^[^:=]*", "", cell), *cells[index + 1 : index + 2], *below[index:]]
            for candidate in around[:3]:
                # Such as 4e-09, 4.0ns or CH1:250 MSa/s.
                match = _QUANTITY.fullmatch(candidate.strip())
                if not match:
                    continue
                number, unit = match.groups()
                prefixes = {**_PREFIX, "K": 1e3, "M": 1e6, "G": 1e9}
                prefixed = len(unit) > 1 and unit.lower() not in _BASE
                value = float(number.replace(",", ".")) * prefixes.get(unit[:prefixed], 1.0)
                if 1e-13 < value < 1e13:
                    return value if is_interval else 1 / value
    return None
