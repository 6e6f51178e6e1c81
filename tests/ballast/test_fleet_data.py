"""A fleet as Parquet files: labels, the same bytes everywhere, restarts, constant memory."""

import hashlib
import os
import shutil
import subprocess
import sys
import tracemalloc
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from importlib.util import find_spec

import numpy as np
import pandas as pd
import pytest

from shipnet import __version__
from shipnet.__main__ import main
from shipnet.ballast import FAULTS, simulate, write_fleet
from shipnet.ballast.fleet import _Block, _days, _History, _orders
from shipnet.ballast.plant import Plant
from shipnet.ballast.sensors import CHANNELS
from shipnet.ballast.trials import spread_valves
from shipnet.errors import ArgumentError, InputError
from tests.support import losing_a_worker, require, two_workers

DAY = 86400.0


@pytest.fixture(autouse=True, scope="module")
def parquet():
    parts = ("pyarrow", "distributed", "loky")
    require("cluster", all(map(find_spec, parts)), f"one of {', '.join(parts)} is missing")
    # Use pyarrow strings, like the workers of a cluster.
    with pd.option_context("mode.string_storage", "auto"):
        yield


@pytest.fixture(scope="module")
def fleet(tmp_path_factory):
    if not find_spec("pyarrow"):
        return None
    folder = tmp_path_factory.mktemp("fleet")
    return folder, write_fleet(folder, 55, 2, faults_per_year=50)


def sums(folder):
    """Return a checksum of each data file."""
    return {
        str(file.relative_to(folder)): hashlib.sha256(file.read_bytes()).hexdigest()
        for file in folder.rglob("*.parquet")
    }


def test_pandas_reads_one_file_per_day_and_block(fleet):
    folder, made = fleet
    names = [f"day=2026-01-0{day}/block-000{block}.parquet" for day in (1, 2) for block in (0, 1)]
    files = {str(file.relative_to(folder)) for file in folder.rglob("*.parquet")}
    assert files == {f"{kind}/{name}" for kind in ("samples", "strokes") for name in names} | {
        f"faults/block-000{block}.parquet" for block in (0, 1)
    }
    samples, strokes = (pd.read_parquet(folder / kind) for kind in ("samples", "strokes"))
    assert made["valves"].tolist() == [50, 5]
    assert made[["samples", "strokes"]].sum().tolist() == [len(samples), len(strokes)]
    assert set(samples["valve"]) == set(range(1, 56))
    channels = [channel.column for channel in CHANNELS]
    assert list(samples) == [
        "valve",
        "time",
        *channels,
        "running",
        "active",
        "label",
        "severity",
        "day",
    ]
    assert (samples["time"].dt.strftime("%Y-%m-%d") == samples["day"].astype(str)).all()
    for _, mine in samples.groupby("valve"):
        assert mine["time"].is_monotonic_increasing and mine["time"].is_unique
    gaps = samples[samples["valve"] == 1]["time"].diff().dt.total_seconds()
    assert gaps.min() == pytest.approx(0.1) and gaps.max() <= 60


def test_labels_are_those_of_the_faults(fleet):
    folder, _ = fleet
    truth = pd.read_parquet(folder / "faults")
    assert len(truth) > 5 and set(truth["code"]) <= set(FAULTS)
    slow = truth["grows_days"] > 0
    assert 0 < slow.sum() < len(truth)
    start = np.datetime64("2026-01-01")
    for kind in ("samples", "strokes"):
        rows = pd.read_parquet(folder / kind)
        seconds = (rows["time"] - start).dt.total_seconds().to_numpy()
        expected = np.full(len(rows), "", object)
        for valve, code, begin, grows, end in truth.itertuples(index=False):
            mine = (rows["valve"] == valve) & (seconds >= begin - 1e-3) & (seconds < end - 1e-3)
            expected[mine] = code
            # After two days a fault that grows for five or more is in its first two steps.
            assert set(rows["severity"][mine]) <= (
                {np.float32(0.2), np.float32(0.4)} if grows else {1.0}
            )
        assert (rows["label"].astype(str) == expected).all()
        assert ((rows["severity"] > 0) == (rows["label"] != "")).all()


def test_labels_belong_to_the_valves_with_the_fault(fleet):
    strokes = pd.read_parquet(fleet[0] / "strokes")
    whole = strokes[(strokes["severity"] == 1) & strokes["label"].isin(["P1", "P2", "V2", "S2"])]
    assert len(whole) > 10 and (whole["top_fault"] == whole["label"].astype(str)).all()
    assert (strokes["top_fault"][strokes["label"] == ""] == "normal").all()


def test_a_fault_begins_grows_and_ends_even_near_midnight():
    steps = [(0.0, "", 0.0), (DAY - 0.1, "V1", 1.0), (2 * DAY, "", 0.0), (2 * DAY + 5, "P2", 0.4)]
    history = _History([], [*steps, (3 * DAY, "", 0.0)])
    code, severity = history.at(np.array([0, DAY - 0.2, DAY - 0.1, 2 * DAY, 2 * DAY + 5, 4 * DAY]))
    names = ["", *FAULTS]
    assert [names[place + 1] for place in code] == ["", "", "V1", "", "P2", ""]
    assert severity.tolist() == [0, 0, 1, 0, 0.4, 0]
    block = _Block("", 0, 2, 3, 0.0, 4, 60.0, 1, {})
    plant = Plant(spread_valves(2, np.random.default_rng(1)), [*history.faults(2)])
    last = [run.time[-1] for _, run, _ in _days(block, plant, np.random.default_rng(1))]
    assert last == pytest.approx([DAY - 1, 2 * DAY - 1, 3 * DAY - 1])


def test_faults_are_as_frequent_and_as_long_as_requested():
    rng = np.random.default_rng(5)
    rows = [row for _ in range(400) for row in _History.drawn(3650, 2.0, rng).rows]
    days = np.array([[start / DAY, grows, stop / DAY] for _, start, grows, stop in rows])
    assert ((days[:, 2] - days[:, 0] - days[:, 1]) >= 1 - 1e-6).all()
    # Valves are healthy for half a year on average; a fault grows for 16 days and lasts 5.5 more.
    assert len(rows) / 400 == pytest.approx(3650 / (182.6 + 16.25 + 5.5), rel=0.02)
    share = pd.Series([row[0] for row in rows]).value_counts(normalize=True)
    assert set(share.index) == set(FAULTS) and share.max() < 0.11


def test_days_simulated_one_by_one_equal_one_run():
    block = _Block("", 0, 4, 3, 0.0, 5, 60.0, 1, {})
    system = spread_valves(4, np.random.default_rng(1))
    history = _History([], [(0.0, "", 0.0), (DAY + 40.0, "P2", 0.6), (2.4 * DAY, "", 0.0)])
    faults = list(history.faults(3))
    moved = [
        move
        for _, run, _ in _days(block, Plant(system, faults), np.random.default_rng(2))
        for move in run.movements
    ]
    rng = np.random.default_rng(2)
    orders = [order for day in range(3) for order in _orders(block, day, rng)]
    whole = simulate(system, orders, faults=faults, until=3 * DAY, idle_step=60.0)
    assert len(moved) > 20 and moved == list(whole.movements)


def test_every_file_says_that_it_is_synthetic(fleet):
    import pyarrow.parquet as pq

    folder, _ = fleet
    for file in folder.rglob("*.parquet"):
        about = pq.read_schema(file).metadata
        assert about[b"synthetic"].startswith(b"faults simulated by us to fit the rules")
        assert about[b"made_by"] == f"shipnet {__version__}".encode()
        assert (about[b"seed"], about[b"faults_per_year"]) == (b"2024", b"50.0")


def test_two_workers_write_the_same_bytes_even_if_one_is_killed(tmp_path):
    with two_workers() as client:
        killed = []
        workers = losing_a_worker(client, killed)
        there = write_fleet(tmp_path / "there", 160, 1, workers=workers)
    here = write_fleet(tmp_path / "here", 160, 1)
    assert killed and there.equals(here)
    assert sums(tmp_path / "there") == sums(tmp_path / "here")
    # Adding valves does not change the existing ones.
    write_fleet(tmp_path / "less", 50, 1)
    data = [pd.read_parquet(tmp_path / name / "samples") for name in ("less", "here")]
    assert data[0].equals(data[1][data[1]["valve"] <= 50].reset_index(drop=True))


def test_a_stopped_fleet_continues_where_it_stopped(tmp_path):
    class Stop(Exception):
        pass

    def stopped(function, tasks):
        yield function(tasks[0])
        raise Stop

    with pytest.raises(Stop):
        write_fleet(tmp_path, 60, 1, workers=stopped)
    (file,) = tmp_path.glob("samples/*/*.parquet")
    written = file.stat().st_mtime_ns
    (file.parent / ".block-0001.parquet.host.1").write_bytes(b"half a file")
    made = write_fleet(tmp_path, 60, 1)
    assert file.stat().st_mtime_ns == written
    assert made["valves"].tolist() == [50, 10] and not list(tmp_path.rglob(".block-*"))
    with pytest.raises(
        InputError, match="is of another fleet: its days is '1', not '2'; give an empty"
    ):
        write_fleet(tmp_path, 60, 2)


#: A fleet of two blocks, each with five files, that is written in a second.
SMALL = {"valves": 52, "days": 2, "strokes": 1, "idle_step": 3600.0, "faults_per_year": 50.0}


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """The folder of an undisturbed fleet, and its table."""
    folder = tmp_path_factory.mktemp("small")
    return folder, write_fleet(folder, **SMALL)


def the_same(folder, small):
    """Return whether the call, repeated, leaves the files of the undisturbed fleet, and no more."""
    made = write_fleet(folder, **SMALL)
    names = [{file.name for file in place.rglob("*")} for place in (folder, small[0])]
    return made.equals(small[1]) and sums(folder) == sums(small[0]) and names[0] == names[1]


@contextmanager
def at_first_sync(monkeypatch, action):
    """Call a function once, when the first file is about to be renamed."""
    actions = [action]

    def sync(number):
        if actions:
            actions.pop()()

    monkeypatch.setattr(os, "fsync", sync)
    yield
    assert not actions
    monkeypatch.undo()


def test_a_fleet_that_was_killed_is_completed(tmp_path, small):
    program = f"from shipnet.ballast import write_fleet; write_fleet({str(tmp_path)!r}, **{SMALL})"
    with subprocess.Popen([sys.executable, "-c", program]) as process:
        while len(list(tmp_path.rglob("block-*.parquet"))) < 4:
            assert process.poll() is None
        process.kill()
    assert the_same(tmp_path, small)


@pytest.mark.parametrize("name", ["samples/day=2026-01-02", "strokes/day=2026-01-01", "faults"])
@pytest.mark.parametrize(
    "damage",
    [
        lambda file, content: file.unlink(),
        lambda file, content: file.write_bytes(b""),
        lambda file, content: file.write_bytes(content[: len(content) // 2]),
        lambda file, content: file.write_bytes(content[:40] + b"?" + content[41:]),
        lambda file, content: file.write_bytes(content[:-9] + b"?" + content[-8:]),
        lambda file, content: file.write_text("valve,time\n1,2\n"),
    ],
    ids=["absent", "empty", "truncated", "one byte", "length of the footer", "other"],
)
def test_a_damaged_file_is_written_again(tmp_path, small, name, damage):
    shutil.copytree(small[0], tmp_path, dirs_exist_ok=True)
    file = tmp_path / name / "block-0001.parquet"
    damage(file, file.read_bytes())
    assert the_same(tmp_path, small)


@pytest.mark.parametrize(("limit", "file"), [(10, "fleet.json"), (3000, "block-0000.parquet")])
def test_a_full_disk_is_reported_in_a_sentence_and_loses_nothing(tmp_path, small, limit, file):
    resource = pytest.importorskip("resource")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, before[1]))
    try:
        with pytest.raises(InputError, match=f"{file}: cannot be written: File too large; correct"):
            write_fleet(tmp_path, **SMALL)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert not [place for place in tmp_path.rglob("*") if place.name.startswith(".")]
    assert the_same(tmp_path, small)


def test_what_cannot_be_used_is_named(tmp_path, small):
    (tmp_path / "samples").touch()
    with pytest.raises(InputError, match=r"block-0000\.parquet: cannot be .*: Not a directory"):
        write_fleet(tmp_path, **SMALL)
    (tmp_path / "samples").unlink()
    (tmp_path / "faults" / "block-0000.parquet").mkdir(parents=True)
    with pytest.raises(InputError, match=r"block-0000\.parquet: cannot be read: Is a directory"):
        write_fleet(tmp_path, **SMALL)
    (tmp_path / "faults" / "block-0000.parquet").rmdir()
    for text in ("", "{", "[1]", "7"):
        (tmp_path / "fleet.json").write_text(text)
        with pytest.raises(InputError, match=r"fleet\.json: is incomplete; delete it"):
            write_fleet(tmp_path, **SMALL)
    (tmp_path / "fleet.json").unlink()
    assert the_same(tmp_path, small)


def test_a_second_run_of_the_same_fleet_does_not_disturb_the_first(tmp_path, small, monkeypatch):
    with at_first_sync(monkeypatch, lambda: write_fleet(tmp_path, **SMALL)):
        assert write_fleet(tmp_path, **SMALL).equals(small[1])
    assert the_same(tmp_path, small)
    with ThreadPoolExecutor(2) as pool:
        folder = tmp_path / "both"
        both = list(pool.map(lambda _: write_fleet(folder, **SMALL), range(2)))
    assert both[0].equals(small[1]) and both[1].equals(small[1]) and the_same(folder, small)


def test_of_two_fleets_in_one_folder_the_second_is_refused(tmp_path, small, monkeypatch):
    def other(why=": its seed is '2024', not '3'"):
        with pytest.raises(InputError, match=f"is of another fleet{why}; give an empty folder"):
            write_fleet(tmp_path, **SMALL, seed=3)

    with at_first_sync(monkeypatch, other):
        write_fleet(tmp_path, **SMALL)
    assert the_same(tmp_path, small)
    (tmp_path / "fleet.json").unlink()
    other("")


def test_memory_does_not_grow_with_the_days(tmp_path):
    def most(days):
        tracemalloc.start()
        write_fleet(tmp_path / str(days), 5, days, strokes=1)
        most = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return most

    most(1)  # one-time imports
    assert most(8) < 1.2 * most(2)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"valves": 0}, r"valves is 0; it must be a whole number 1\.\.100000"),
        ({"days": -1}, r"days is -1; it must be a whole number 1\.\.3650"),
        ({"days": 1.5}, r"days is 1\.5"),
        ({"faults_per_year": -1.0}, "faults_per_year is -1"),
        ({"faults_per_year": float("nan")}, "faults_per_year is nan"),
        ({"strokes": 101}, "strokes is 101"),
        ({"idle_step": 0.5}, r"idle_step is 0\.5"),
        ({"seed": -1}, "seed is -1"),
        ({"seed": None}, "seed is None"),
        ({"workers": 0}, r"workers is 0; it must be a whole number 1\.\.1024"),
    ],
)
def test_bad_arguments_are_named(tmp_path, change, message):
    with pytest.raises(ArgumentError, match=message):
        write_fleet(**{"folder": tmp_path, "valves": 1, "days": 1, **change})
    assert not list(tmp_path.rglob("*.parquet"))


def test_without_strokes_and_faults_there_are_samples_only(tmp_path):
    made = write_fleet(tmp_path, 1, 1, strokes=0, faults_per_year=0)
    assert made.loc[0, ["faults", "samples", "strokes"]].tolist() == [0, 1441, 0]
    assert pd.read_parquet(tmp_path / "strokes").empty


def test_the_command_writes_a_fleet_and_names_mistakes(tmp_path, capsys, monkeypatch):
    words = ["fleet", "--valves", "2", "--days", "1", "--out", str(tmp_path / "out")]
    assert main(words) == 0
    said = capsys.readouterr().out
    assert said.startswith("2 valves, 1 days, 0 faults, ") and "of synthetic data in" in said
    assert main([*words[:-2], "--out", "/proc/shipnet"]) == 2
    assert capsys.readouterr().err.startswith(
        "shipnet: /proc/shipnet/fleet.json: cannot be written: "
    )
    monkeypatch.setitem(__import__("sys").modules, "pyarrow", None)
    assert main(words) == 2
    assert "python -m pip install pyarrow" in capsys.readouterr().err
