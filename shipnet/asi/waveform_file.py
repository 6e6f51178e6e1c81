"""Recorded waveforms from files: scope CSV, numpy arrays, sigrok sessions."""

from __future__ import annotations

import configparser
import io
import re
import zipfile
from os import PathLike
from pathlib import Path
from typing import IO, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.asi.scope_csv import Column, read_table
from shipnet.errors import ArgumentError, InputError

__all__ = ["SLOWEST_RATE", "Waveform", "read_waveform"]

#: Fewest samples a second that tell the pulses of 3 us apart [1/s].
SLOWEST_RATE = 1e6

#: Largest part of an archive that is unpacked [byte]; a few bytes can claim to be much more.
_LARGEST_PART = 2**30

#: Size from which a number is neither a time [s] nor a voltage [V], in no unit.
_LARGEST = 1e15

_COUNTERS = ("x", "#", "n", "no", "nr", "index", "sample", "samples", "point", "points", "sequence")

Floats = npt.NDArray[np.float64]


class Waveform(NamedTuple):
    """A voltage over time.

    Attributes
    ----------
    u : ndarray of float, shape (n_t,)
        Voltage [V]; NaN where the recorder says that it recorded nothing.
    dt : float
        Time between two samples [s].
    channel : str
        Name of the channel.
    description : str
        One line on what was read.
    """

    u: Floats
    dt: float
    channel: str
    description: str


def read_waveform(
    path: str | PathLike[str],
    *,
    channel: str | None = None,
    sample_interval: float | None = None,
) -> Waveform:
    r"""Read one channel of a recorded waveform.

    Parameters
    ----------
    path : path
        A scope's text file (see `shipnet.asi.scope_csv`), ``.npy`` (1-D: voltages; 2-D: time and
        voltages), ``.npz`` (``t`` or ``dt`` beside ``u`` or ``v``) or sigrok's ``.sr``.
    channel : str, optional
        Title of the channel, upper or lower case, or the number of its column, 1 for the first.
        The first channel with a voltage if omitted.
    sample_interval : float, optional
        Time between two samples [s]; it overrides what the file says.

    Returns
    -------
    Waveform
        Its times are even to 1 %, or as even as the digits printed allow.

    Raises
    ------
    InputError
        If the file cannot be read, is empty, has a cell that is no number, uneven times, fewer
        than 1e6 samples a second, or no such channel.
    ArgumentError
        If `sample_interval` is not positive.

    References
    ----------
    .. [1] sigrok, "File format: Sigrok/v2", https://sigrok.org/wiki/File_format:Sigrok/v2

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     file = Path(folder, "scope.csv")
    ...     _ = file.write_text("Second,Volt\n0,30.1\n4e-07,29.8\n8e-07,27.9\n")
    ...     u, dt, _, _ = read_waveform(file)
    >>> u.tolist(), dt
    ([30.1, 29.8, 27.9], 4e-07)
    """
    if sample_interval is not None and not 0 < sample_interval < np.inf:
        raise ArgumentError(f"sample_interval is {sample_interval} s; it must be positive")
    file = str(path)
    data = _bytes(file)
    kind = Path(file).suffix.lower()
    if kind in (".npy", ".npz", ".sr"):
        try:
            reader = {".npy": _read_npy, ".npz": _read_npz, ".sr": _read_sr}[kind]
            table = reader(file, data)
        except InputError:
            raise
        except Exception as fault:
            # The parsers below raise a dozen kinds, from BadZipFile and zlib.error to
            # UnicodeDecodeError and MemoryError; for the user all say that the file is broken.
            raise InputError(
                file, f"not a whole {kind} file: {fault or type(fault).__name__}"
            ) from fault
    else:
        read = read_table(file, data)
        table = _Channels(read.values, read.columns, read.interval, None)
    return _choose(file, table, channel, sample_interval)


class _Channels(NamedTuple):
    """All that a file holds: one column a channel, and what is known of the times."""

    values: Floats
    columns: list[Column]
    interval: float | None
    quantum: float | None  # step to which times are rounded; None: as the digits printed say


def _bytes(file: str) -> bytes:
    path = Path(file)
    try:
        # Reading a pipe or a device might never end.
        if path.exists() and not path.is_file():
            raise InputError(file, "not a file")
        data = path.read_bytes()
    except (OSError, ValueError) as fault:
        if isinstance(fault, InputError):
            raise
        why = fault.strerror if isinstance(fault, OSError) else fault
        raise InputError(file, f"cannot be read: {why}") from None
    if not data.strip():
        raise InputError(file, "the file is empty")
    return data


def _array(stream: IO[bytes]) -> npt.NDArray[Any]:
    """Read an array, and nothing that could run code."""
    return np.lib.format.read_array(stream, allow_pickle=False)


def _check_real(file: str, what: str, array: npt.NDArray[Any]) -> Floats:
    if array.dtype.kind not in "iuf" or not array.size:
        raise InputError(
            file,
            f"{what} has the shape {array.shape} and the type {array.dtype}; expected real numbers",
        )
    return array.astype(float)


def _rounding(times: npt.NDArray[Any]) -> float:
    """Return the step to which an array of times is rounded."""
    return float(np.spacing(np.abs(times).max())) if times.dtype.kind == "f" else 0.0


def _read_npy(file: str, data: bytes) -> _Channels:
    array = _array(io.BytesIO(data))
    values = _check_real(file, "the array", array)
    if values.ndim == 1:
        return _Channels(values[:, np.newaxis], [Column(1, "u", "V", 1.0, 0)], None, None)
    if values.ndim != 2 or min(values.shape) < 2:
        raise InputError(
            file,
            f"the array has the shape {array.shape}; expected voltages, or time and voltages",
        )
    if values.shape[0] < values.shape[1]:
        values, array = values.T, array.T
    columns = [Column(1, "t", "s", 1.0, 0)]
    columns += [Column(k + 1, f"u{k}", "V", 1.0, 0) for k in range(1, values.shape[1])]
    return _Channels(values, columns, None, _rounding(array[:, 0]))


def _read_npz(file: str, data: bytes) -> _Channels:
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        names = {name.removesuffix(".npy"): name for name in archive.namelist()}
        held = {key: _array(io.BytesIO(_part(archive, names[key]))) for key in names}
    voltage = next((key for key in ("u", "v") if key in held), None)
    if voltage is None:
        raise InputError(file, f"it holds {sorted(held)}; expected the voltages as u or v")
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
            raise InputError(file, f"t has the shape {t.shape}, but {voltage} {u.shape}")
        columns = [Column(0, "t", "s", 1.0, 0), *columns]
        return _Channels(np.column_stack([t, u]), columns, None, _rounding(held["t"]))
    interval = None
    if "dt" in held:
        dt = _check_real(file, "dt", held["dt"])
        if dt.size != 1 or not 0 < dt.item() < np.inf:
            raise InputError(file, "dt is not one positive number")
        interval = dt.item()
    return _Channels(u, columns, interval, None)


def _part(archive: zipfile.ZipFile, name: str) -> bytes:
    size = archive.getinfo(name).file_size
    if size > _LARGEST_PART:
        raise ValueError(f"{name} claims to hold {size} bytes; at most {_LARGEST_PART} are read")
    return archive.read(name)


def _read_sr(file: str, data: bytes) -> _Channels:
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        names = set(archive.namelist())
        if "metadata" not in names:
            raise InputError(file, "no metadata in it; expected a sigrok session")
        settings = configparser.RawConfigParser(strict=False)
        settings.read_string(_part(archive, "metadata").decode())
        device = next((settings[name] for name in settings.sections() if "device" in name), None)
        titles = {
            int(key[6:]): title
            for key, title in (device or {}).items()
            if re.fullmatch("analog[0-9]{1,4}", key)
        }
        chunks = {
            number: sorted(
                (int(name.split("-")[3]), name)
                for name in names
                if re.fullmatch(f"analog-1-{number}-[0-9]{{1,9}}", name)
            )
            for number in titles
        }
        chunks = {number: parts for number, parts in chunks.items() if parts}
        if not chunks or device is None:
            raise InputError(file, "no analog channel in it; expected a voltage, not logic levels")
        for number, parts in chunks.items():
            if [place for place, _ in parts] != list(range(1, len(parts) + 1)):
                raise InputError(file, f"a part of analog-1-{number} is missing")
        signals = [
            np.frombuffer(b"".join(_part(archive, name) for _, name in parts), dtype="<f4")
            for parts in chunks.values()
        ]
    if len({len(signal) for signal in signals}) > 1:
        raise InputError(file, "its analog channels differ in length")
    rate = re.fullmatch(r"([0-9.]+)\s*([kMG]?)(?:Hz)?", device.get("samplerate", "").strip())
    interval = None
    if rate:
        hertz = float(rate[1]) * {"": 1, "k": 1e3, "M": 1e6, "G": 1e9}[rate[2]]
        interval = 1 / hertz if hertz > 0 else None
    columns = [Column(number, titles[number], "V", 1.0, 0) for number in chunks]
    return _Channels(np.column_stack(signals).astype(float), columns, interval, None)


def _choose(
    file: str, table: _Channels, channel: str | None, sample_interval: float | None
) -> Waveform:
    """Pick the columns of time and voltage, and check both."""
    values, columns = table.values, table.columns
    if len(values) < 2:
        raise InputError(file, f"it holds {len(values)} sample; expected a waveform")
    # Neither a time nor a voltage; sums and products of such numbers would overflow further on.
    if not np.fmax.reduce(np.abs(values), axis=None) < _LARGEST:
        wild = np.argwhere(np.abs(values) >= _LARGEST)
        faults = [
            f"sample {k + 1}, column {columns[c].number}: {values[k, c]:g} is out of range"
            for k, c in wild[: InputError.shown]
        ]
        raise InputError(
            file, *(faults or ["it holds no numbers"]), more=max(0, len(wild) - InputError.shown)
        )
    time = _time_column(table)
    usable = [
        k
        for k, column in enumerate(columns)
        if k != time and column.unit in ("", "V") and not _is_counter(values, column, k, columns)
    ]
    known = ", ".join(columns[k].title or f"column {columns[k].number}" for k in usable)
    if not usable:
        raise InputError(file, "no voltage column; expected a channel in volts beside the time")
    wanted = usable
    if channel is not None:
        name = channel.strip().lower()
        wanted = [k for k in usable if name in (columns[k].title.lower(), str(columns[k].number))]
        if not wanted:
            raise InputError(file, f"no channel {channel!r}; its channels are {known}")
    chosen = columns[wanted[0]]
    u = values[:, wanted[0]] * chosen.scale
    if np.isnan(u).all():
        raise InputError(file, f"{chosen.title} holds no numbers")
    if sample_interval is None:
        if time is not None:
            sample_interval, u = _even(file, table, time, u)
        elif table.interval is not None:
            sample_interval = table.interval
        else:
            raise InputError(
                file, "it gives no times; state the time between two samples (--sample-interval)"
            )
    # A rate of exactly 1 MS/s, computed from rounded times, is fast enough.
    if sample_interval > 1.001 / SLOWEST_RATE:
        raise InputError(
            file,
            f"it has {1e-6 / sample_interval:.3g} MS/s; pulses of 3 us need {SLOWEST_RATE / 1e6:g} "
            "or more",
        )
    title = chosen.title or f"column {chosen.number}"
    among = f" of {known}" if len(usable) > 1 else ""
    description = (
        f"{Path(file).name}: channel {title}{among}; {len(u)} samples at "
        f"{1e-6 / sample_interval:.6g} MS/s, {len(u) * sample_interval * 1e3:.6g} ms"
    )
    return Waveform(u, sample_interval, title, description)


def _is_counter(values: Floats, column: Column, k: int, columns: list[Column]) -> bool:
    """Whether a column only numbers the samples."""
    if k > 0 or len(columns) == 1 or column.unit:
        return False
    return column.title.lower() in _COUNTERS or (
        not column.title and bool((np.diff(values[:1000, k]) == 1).all())
    )


def _time_column(table: _Channels) -> int | None:
    for k, column in enumerate(table.columns):
        if column.unit == "s" or re.match(r"t(ime)?\b|x-axis", column.title.lower()):
            return k
    # Without any title, a first column that only rises is the time.
    first = table.columns[0]
    rises = bool((np.diff(table.values[:, 0]) >= 0).all()) and np.ptp(table.values[:, 0]) > 0
    if len(table.columns) > 1 and not first.title and not first.unit and rises:
        return None if _is_counter(table.values, first, 0, table.columns) else 0
    return None


def _even(file: str, table: _Channels, time: int, u: Floats) -> tuple[float, Floats]:
    """Return the time between two samples, and the voltages in the order of time."""
    column = table.columns[time]
    t = table.values[:, time] * column.scale
    if not np.isfinite(t).all():
        raise InputError(file, "a time is not a finite number")
    if t[0] > t[-1]:
        t, u = t[::-1], u[::-1]
    dt = float(t[-1] - t[0]) / (len(t) - 1)
    if not dt > 0:
        raise InputError(file, "its times do not rise")
    quantum = table.quantum
    if quantum is None:
        largest = np.abs(t).max()
        quantum = 10.0 ** (np.floor(np.log10(largest)) + 1 - max(column.digits, 1))
    steps = np.diff(t)
    typical = float(np.median(steps)) if quantum < 0.1 * dt else dt
    wrong = np.flatnonzero(np.abs(steps - typical) > 0.01 * typical + quantum)
    if wrong.size:
        faults = [
            f"sample {k + 2} comes {steps[k] * 1e9:.6g} ns after the one before it, not "
            f"{typical * 1e9:.6g} ns"
            for k in wrong[: InputError.shown]
        ]
        raise InputError(file, *faults, more=wrong.size - len(faults))
    return dt, u
