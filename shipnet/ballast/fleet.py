"""Labelled sensor data of a fleet over months, as Parquet files for research on diagnosis.

The data are synthetic: our own simulator produces the faults and the sensor readings. Each task
simulates one block of valves for all days. The valves of a block are commanded together, so that
one array operation can advance all of them.
"""

from __future__ import annotations

import errno
import json
import os
from collections.abc import Iterator, Mapping
from contextlib import suppress
from io import BytesIO
from os import PathLike
from pathlib import Path
from time import sleep
from typing import Any, NamedTuple
from uuid import uuid4

import numpy as np

from shipnet.ballast.diagnosis import Diagnosis, Run, diagnose_run
from shipnet.ballast.plant import FAULTS, Command, Fault, Plant
from shipnet.ballast.sensors import CHANNELS
from shipnet.ballast.simulation import record
from shipnet.ballast.trials import BASIS, spread_valves
from shipnet.errors import InputError, load_extra
from shipnet.fields import check_scalar, check_whole
from shipnet.lazy import pd
from shipnet.parallel import Workers, spread

#: Valves per block; they are commanded together, so the number affects the data.
BLOCK = 50

_DAY = 86400.0

#: Midnight at the start of the first day.
_EPOCH = np.datetime64("2026-01-01", "ms")

#: Time of day by which all commands are given, so that no motor runs at midnight [s]; shortest time
#: between commands [s]; and probability that a command is given to a valve.
_LAST, _APART, _SHARE = 82_800.0, 60.0, 0.9

#: A fault appears at once or grows in steps: days of growth, number of steps, and days from full
#: growth to repair; our assumptions.
_GROWS, _STEPS, _REPAIR = (5.0, 60.0), 5, (1.0, 10.0)


class _Block(NamedTuple):
    """A task: one block of valves for all days."""

    folder: str
    number: int
    valves: int
    days: int
    faults_per_year: float
    strokes: int
    idle_step: float
    seed: int
    about: Mapping[str, str]


class _History(NamedTuple):
    """The successive faults of a valve, and the steps in which each grows."""

    rows: list[tuple[str, float, float, float]]
    steps: list[tuple[float, str, float]]

    @classmethod
    def drawn(cls, days: int, rate: float, rng: np.random.Generator) -> _History:
        """Return healthy periods of random length, each followed by a random fault."""
        rows, steps, now = [], [(0.0, "", 0.0)], 0.0
        while (now := now + rng.exponential(365.25 / rate) if rate else np.inf) < days:
            code, slow = str(rng.choice(list(FAULTS))), bool(rng.integers(2))
            grows = float(rng.uniform(*_GROWS)) if slow else 0.0
            over = now + grows + float(rng.uniform(*_REPAIR))
            rows.append((code, round(now * _DAY, 1), grows, round(over * _DAY, 1)))
            for step in range(_STEPS) if slow else [_STEPS - 1]:
                begin = now + grows * step / (_STEPS - 1) if slow else now
                steps.append((round(begin * _DAY, 1), code, (step + 1) / _STEPS))
            steps.append((round(over * _DAY, 1), "", 0.0))
            now = over
        return cls(rows, steps)

    def faults(self, valve: int) -> Iterator[Fault]:
        """Yield each step as a fault of the plant."""
        for (start, code, severity), (stop, *_) in zip(self.steps, self.steps[1:], strict=False):
            if code:
                yield Fault(code, severity, valve, start=start, stop=stop)

    def at(self, time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return, for each time, the fault's index in `FAULTS` (-1 if none) and its severity."""
        starts, codes, severities = zip(*self.steps, strict=True)
        places = np.array([list(FAULTS).index(code) if code else -1 for code in codes])
        now = np.searchsorted(starts, time + 1e-6, side="right") - 1
        return places[now], np.array(severities)[now]


def _orders(block: _Block, day: int, rng: np.random.Generator) -> list[Command]:
    """Return the commands of a day, which open and close the valves alternately."""
    spread = np.sort(rng.uniform(0, _LAST - _APART * block.strokes, block.strokes))
    times = day * _DAY + np.round(spread + _APART * np.arange(block.strokes), 1)
    orders = []
    for turn, time in enumerate(times, day * block.strokes):
        meant = np.flatnonzero(rng.random(block.valves) < _SHARE) + 1
        orders.append(Command(("open", "close")[turn % 2], float(time), meant.tolist()))
    return orders


def _days(
    block: _Block, plant: Plant, rng: np.random.Generator
) -> Iterator[tuple[int, Run, Diagnosis]]:
    """Yield each day's number, run and diagnosis; a run ends 1 s before the next midnight."""
    earlier = None
    pause = max(round(block.idle_step / plant.step), 1)
    size = 2 * round(_DAY / plant.step / pause) + 1000 * (block.strokes + 1)
    for day in range(block.days):
        orders, midnight = _orders(block, day, rng), plant.ticks((day + 1) * _DAY)
        last = midnight - 10
        events = {*plant.changes, *(plant.ticks(order.time) for order in orders)}
        due = sorted(event for event in events if plant.tick < event < last)
        (run,) = record(plant, orders, due, last, pause, size)
        while plant.tick < midnight:
            plant.advance()
        diagnosis = diagnose_run(run, earlier=earlier)
        earlier = diagnosis.tail
        yield day, run, diagnosis


def _written(block: _Block) -> dict[str, int]:
    """Write the files of a block that are absent or damaged, and return its counts."""
    if (complete := _counts(block)) is not None:
        return complete
    rng = np.random.default_rng(np.random.SeedSequence(block.seed, spawn_key=(block.number,)))
    history = [_History.drawn(block.days, block.faults_per_year, rng) for _ in range(block.valves)]
    faults = [fault for valve, past in enumerate(history, 1) for fault in past.faults(valve)]
    system = spread_valves(block.valves, rng)
    first = BLOCK * block.number + 1
    rows = [(first + k, *row) for k, past in enumerate(history) for row in past.rows]
    truth = pd.DataFrame(rows, columns=["valve", "code", "start_s", "grows_days", "stop_s"])
    n_valves, categories = block.valves, ["", *FAULTS]

    def labelled(valve: np.ndarray, time: np.ndarray, columns: dict[str, Any]) -> pd.DataFrame:
        code, severity = np.empty(valve.size, int), np.empty(valve.size, np.float32)
        for k in range(n_valves):
            rows = valve == k
            code[rows], severity[rows] = history[k].at(time[rows])
        stamp = _EPOCH + np.rint(1000 * time).astype("m8[ms]")
        head = {"valve": (first + valve).astype(np.int32), "time": stamp}
        label = pd.Categorical.from_codes(code + 1, dtype=pd.CategoricalDtype(categories))
        return pd.DataFrame({**head, **columns, "label": label, "severity": severity})

    samples = strokes = 0
    for day, run, diagnosis in _days(block, Plant(system, faults, rng), rng):
        folder = _folder(day)
        values = {
            channel.column: run.readings[:, k].T.ravel().astype(np.float32)
            for k, channel in enumerate(CHANNELS)
        }
        flags = {"running": run.running.T.ravel(), "active": run.active.T.ravel()}
        valve = np.repeat(np.arange(n_valves), run.time.size)
        table = labelled(valve, np.tile(run.time, n_valves), {**values, **flags})
        _save(block, table, "samples", folder)
        moved = diagnosis.commands().sort_values(["valve", "start_s"])
        moved = moved.assign(duration_s=moved["end_s"] - moved["start_s"])
        names = ["action", "outcome", "active", "top_fault", "duration_s", "delay_s"]
        columns = {name: moved[name].to_numpy() for name in names}
        place, start = moved["valve"].to_numpy(int) - 1, moved["start_s"].to_numpy(float)
        _save(block, labelled(place, start, columns), "strokes", folder)
        samples, strokes = samples + len(table), strokes + len(moved)
    truth = truth.astype({"valve": "int32", "code": "object"})
    _save(block, truth, "faults")
    counts = {"block": block.number, "valves": n_valves, "faults": len(truth)}
    return counts | {"samples": samples, "strokes": strokes, "bytes": _size(block)}


def _counts(block: _Block) -> dict[str, int] | None:
    """Return the counts of a block; None if one of its files is absent or damaged."""
    counts = {"block": block.number, "valves": block.valves}
    days = [_folder(day) for day in range(block.days)]
    # The file of the faults is written last, so it is absent from most incomplete blocks.
    for kind, folders in {"faults": [""], "samples": days, "strokes": days}.items():
        counts[kind] = 0
        for folder in folders:
            if (rows := _rows(_file(block, kind, folder), block.about)) is None:
                return None
            counts[kind] += rows
    return counts | {"bytes": _size(block)}


def _folder(day: int) -> str:
    return f"day={_EPOCH.astype('M8[D]') + day}"


def _file(block: _Block, *folders: str) -> Path:
    return Path(block.folder).joinpath(*folders, f"block-{block.number:04d}.parquet")


def _size(block: _Block) -> int:
    """Return the number of bytes of all files of the block."""
    return sum(f.stat().st_size for f in Path(block.folder).rglob(_file(block).name))


def _save(block: _Block, table: pd.DataFrame, *folders: str) -> None:
    """Write a table to a file that is marked as synthetic, unless it is there."""
    file = _file(block, *folders)
    if _rows(file, block.about) is not None:
        return
    made = load_extra("pyarrow", "pyarrow").Table.from_pandas(table, preserve_index=False)
    made = made.replace_schema_metadata({**made.schema.metadata, **block.about})
    # The intervals between times have few distinct values, and so do the other columns.
    others = [name for name in made.column_names if name != "time"]
    form = {"compression": "zstd", "use_dictionary": others, "write_page_checksum": True}
    if "time" in made.column_names:
        form["column_encoding"] = {"time": "DELTA_BINARY_PACKED"}
    content = BytesIO()
    load_extra("pyarrow.parquet", "pyarrow").write_table(made, content, **form)
    # The file is renamed when it is complete, so that no reader sees a partial file.
    partial = file.with_name(f".{file.name}.{uuid4().hex}")
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        with partial.open("xb") as stream:
            stream.write(content.getbuffer())
            stream.flush()
            os.fsync(stream.fileno())
        partial.replace(file)
    except OSError as problem:
        with suppress(OSError):
            partial.unlink()
        # A second run of the same fleet may have written the file and removed the partial one.
        if _rows(file, block.about) is None:
            raise _unusable(file, "written", problem) from problem


def _unusable(file: Path, use: str, problem: Any) -> InputError:
    why = f"cannot be {use}: {problem.strerror}; correct this and repeat the call, which resumes"
    return InputError(str(file), why)


def _rows(file: Path, expected: Mapping[str, str]) -> int | None:
    """Return the number of rows of a file of this fleet; None if it is absent or damaged."""
    read = load_extra("pyarrow.parquet", "pyarrow").read_table
    try:
        with file.open("rb") as stream:
            table = read(stream, page_checksum_verification=True)
    except (OSError, load_extra("pyarrow", "pyarrow").ArrowException) as problem:
        # An error of the system has a number; others are about the content.
        if getattr(problem, "errno", None) in (None, errno.ENOENT):
            return None
        raise _unusable(file, "read", problem) from problem
    metadata = table.schema.metadata or {}
    if any(metadata.get(name.encode()) != value.encode() for name, value in expected.items()):
        raise InputError(str(file), "is of another fleet; give an empty folder")
    return int(table.num_rows)


def _settings_in(file: Path) -> dict[str, str]:
    """Return the settings in a fleet's file, which another run may still be writing."""
    for _ in range(20):
        with suppress(TypeError, ValueError, RecursionError):
            return dict(json.loads(file.read_bytes()))
        sleep(0.1)
    raise InputError(str(file), "is incomplete; delete it and repeat the call")


def _claim(folder: Path, settings: Mapping[str, str]) -> None:
    """Write the fleet's settings into its folder, or refuse the folder of another fleet."""
    file, created = folder / "fleet.json", False
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with suppress(FileExistsError), file.open("x", encoding="utf-8") as stream:
            created = True
            stream.write(json.dumps(settings, indent=1))
        present = _settings_in(file)
    except OSError as problem:
        if created:
            file.unlink()
        raise _unusable(file, "written", problem) from problem
    for name, value in settings.items():
        if (other := present.get(name)) != value:
            why = f"is of another fleet: its {name} is {other!r}, not {value!r}"
            raise InputError(str(file), f"{why}; give an empty folder")


def write_fleet(
    folder: str | PathLike[str],
    valves: int = 1000,
    days: int = 365,
    *,
    faults_per_year: float = 2.0,
    strokes: int = 6,
    idle_step: float = 60.0,
    seed: int = 2024,
    workers: Workers = 1,
) -> pd.DataFrame:
    """Simulate a fleet with faults over months, and write labelled Parquet files for each day.

    Parameters
    ----------
    folder : path
        Folder for the files. After an interruption, the same call resumes: it checks the files
        that are there, and writes those that are absent or damaged. Two runs of the same call may
        share a folder. The folder of a fleet with other arguments, or of another version, is
        refused; ``fleet.json`` states both.
    valves : int, default 1000
        Number of valves, 1..100000; each task simulates a block of up to 50.
    days : int, default 365
        Number of days, 1..3650.
    faults_per_year : float, default 2
        Mean number of faults per valve-year of healthy operation, 0..50; each is one of `FAULTS`.
    strokes : int, default 6
        Commands per day, 0..100, which open and close the valves of a block alternately.
    idle_step : float, default 60
        Time between two readings while no motor of the block runs, 1..3600 [s]; otherwise 0.1 s.
    seed : int, default 2024
        Seed of the random numbers, 0..2^63 - 1.
    workers : int or map-like callable, default 1
        Number of processes, 1..1024, or -1 for one per core, which need the package loky; or a
        callable such as the ``map`` of a `concurrent.futures` executor or of Dask's
        ``client.get_executor()``. The files do not depend on it.

    Returns
    -------
    pandas.DataFrame
        One row per block: ``valves``, ``faults``, ``samples``, ``strokes``, and ``bytes``.

    Raises
    ------
    InputError
        If a file cannot be read or written, or the folder contains another fleet.
    ImportError
        If pyarrow is not installed: ``python -m pip install pyarrow``.

    Notes
    -----
    ``samples/day=2026-01-01/block-0000.parquet`` has one row per valve and reading: ``valve``,
    ``time`` in UTC, one column per sensor, such as ``FP_bar``, whether the motor is ``running`` and
    a command is ``active``, and the truth: ``label`` (code of the present fault, or empty) and
    ``severity`` (0..1). ``strokes/`` has one row per motor run, with the diagnosis by the rule
    table; ``faults/`` has one row per fault: its start, the duration of its growth (in five steps),
    and its repair. Every file states in its metadata that it is synthetic: finding these faults
    verifies the code of a method but does not validate the method.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:  # doctest: +SKIP
    ...     write_fleet(folder, valves=60, days=2)["strokes"].tolist()
    [505, 95]
    """
    from shipnet import __version__

    load_extra("pyarrow", "pyarrow")
    where = Path(folder).absolute()
    count = check_whole("valves", valves, 1, 100_000)
    lasts = check_whole("days", days, 1, 3650)
    rate = check_scalar("faults_per_year", faults_per_year, "", 0, 50)
    times = check_whole("strokes", strokes, 0, 100)
    idle = check_scalar("idle_step", idle_step, "s", 1, 3600)
    source = check_whole("seed", seed, 0, 2**63 - 1)
    settings = {"valves": count, "days": lasts, "faults_per_year": rate, "strokes": times}
    settings |= {"idle_step": idle, "seed": source}
    about = {"synthetic": BASIS, "made_by": f"shipnet {__version__}"}
    about |= {name: str(value) for name, value in settings.items()}
    _claim(where, about)
    if (earlier := next(where.rglob("block-*.parquet"), None)) is not None:
        _rows(earlier, about)
    blocks = [
        _Block(str(where), k, min(BLOCK, count - first), lasts, rate, times, idle, source, about)
        for k, first in enumerate(range(0, count, BLOCK))
    ]
    rows = spread(_written, blocks, workers, step="blocks of valves")
    for partial in where.glob("*/**/.block-*"):  # left by a run that was killed
        with suppress(OSError):
            partial.unlink()
    return pd.DataFrame(rows).set_index("block")
