"""Every reader, with paths that are not files, with damaged files, and with text as large as 1 MB.

Each ends in a result or in one of our errors. No test measures time: limits on what is read bound
it, and `make fuzz` reports how the time of each reader grows.
"""

import csv
import json
import os
import random
import re
import signal
from contextlib import contextmanager, suppress
from functools import partial
from zipfile import ZIP_DEFLATED, ZipFile

import numpy as np
import openpyxl
import pytest

from shipnet import (
    asi,
    ballast,
    can,
    datasets,
    design,
    engine,
    files,
    fuzzy,
    line,
    remote_control,
    style,
)
from shipnet.__main__ import main
from shipnet.errors import ArgumentError, FrameError, InputError
from tests.fuzz.targets import TARGETS
from tests.objects import made

REFUSALS = (ArgumentError, FrameError, InputError)

#: The readers of files, each with a suffix that it reads.
READERS = {
    "asi.decode": (asi.decode, ".csv"),
    "asi.read_plan": (asi.read_plan, ".csv"),
    "ballast.read_log": (ballast.read_log, ".csv"),
    "ballast.read_strokes": (ballast.read_strokes, ".npz"),
    "can.analyse": (can.analyse, ".csv"),
    "can.compare": (lambda path: can.compare(can.example(), path), ".log"),
    "can.read_capture": (can.read_capture, ".sr"),
    "can.read_log": (can.read_log, ".log"),
    "can.read_log, ASC": (can.read_log, ".asc"),
    "can.read_log, BLF": (can.read_log, ".blf"),
    "can.read_messages": (can.read_messages, ".csv"),
    "can.read_messages, DBC": (can.read_messages, ".dbc"),
    "design.read_iolist": (design.read_iolist, ".csv"),
    "design.RuleSet": (design.RuleSet.read, ".csv"),
    "design.Settings": (design.Settings.read, ".toml"),
    "engine.read_points": (engine.read_points, ".csv"),
    "fuzzy.read_rules": (fuzzy.read_rules, ".toml"),
    "line.Waveform": (line.Waveform.read, ".csv"),
    "line.Waveform, numpy": (line.Waveform.read, ".npy"),
    "remote_control.read_capture": (remote_control.read_capture, ".sr"),
}

#: The commands that read files, each with `{}` where it takes one: its suffix, and a target of the
#: fuzzer with the same reader.
COMMANDS = {
    "decode {}": (".csv", "asi capture.csv"),
    "check {}": (".csv", "asi plan"),
    "can {}": (".csv", "can messages"),
    "can messages.csv --log {}": (".log", "can log.log"),
    "diagnose {}": (".csv", "log of a valve"),
    "diagnose list.csv --rules {}": (".toml", "rules"),
    "design {}": (".xlsx", "I/O list.xlsx"),
    "design list.csv --settings {}": (".toml", "settings"),
    "design list.csv --rules {}": (".csv", "class rules"),
}

#: For each option of the commands that read no file, values that it refuses.
_NUMBERS = ["", "x", "nan", "inf", "-1", "1e999", "9" * 5000, "\0", "1,1", "1k1"]
_WORDS = ["", ":", "3", "3:", "x:y", ":" * 5000, "9" * 5000, "3:P2:nan", "late:2", "\0", "\ud800"]
REFUSED = {
    "modbus --registers 9": {"--slaves": [*_NUMBERS, "0", "1.5", "248"]},
    "modbus --slaves 9": {"--registers": [*_NUMBERS, "0", "65537"]},
    "modbus --slaves 9 --registers 9": {
        "--bit-rate": [*_NUMBERS, "0"],
        "--character": _NUMBERS,
        "--dead": [*_NUMBERS, "10"],
        **dict.fromkeys(("--processing", "--timeout", "--limit"), _NUMBERS),
        "--retries": _NUMBERS,
    },
    "serve engine --port 0": {
        "--host": ["", "\0", "256.256.256.256", "no host", "x" * 5000],
        "--speed": _NUMBERS,
        "--fault": _WORDS,
        "--wire-fault": _WORDS,
        "--watchdog": [*_NUMBERS, "1"],
        "--serial": ["", "/", "\0", "x" * 5000],
        "--udp --serial": ["/dev/null"],
    },
    "serve ballast --port 0": {
        "--valves": [*_NUMBERS, "0", "248"],
        "--fault": _WORDS,
        "--watchdog": _NUMBERS,
        "--serial x --bit-rate": _NUMBERS,
        "--serial x --character": _NUMBERS,
    },
    "serve ballast": {"--port": [*_NUMBERS, "65536"]},
    "serve": {"": ["", "valve"]},
    "fleet --days 1": {"--out": ["/dev/null", "\0", "x" * 5000]},
    "fleet --out {}": {
        "--valves": [*_NUMBERS, "0", "100001"],
        "--days": [*_NUMBERS, "0", "3651"],
        "--faults-per-year": [*_NUMBERS, "51"],
        "--seed": [one for one in _NUMBERS if one != "9" * 5000],
        "--workers": [*(one for one in _NUMBERS if one != "-1"), "0"],
        "--scheduler": ["x", "\0", "tcp://"],
    },
    "grade": {"": ["", "/dev/null", "\0", "x" * 5000, "none"]},
}


def words(command, path):
    """Return the words of a command line, with the files that are in order."""
    good = {"messages.csv": "synthetic_can_lee2012.csv", "list.csv": "synthetic_iolist_valves.csv"}
    return [
        str(path) if word == "{}" else str(datasets.path(good[word])) if word in good else word
        for word in command.split()
    ]


@contextmanager
def no_hang():
    """Fail instead of waiting for a pipe for ever."""

    def fail(*_):
        raise AssertionError("the reader waits")

    before = signal.signal(signal.SIGALRM, fail)
    signal.alarm(60)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def not_files(folder, suffix):
    """Return a folder, a pipe and a device, each with this suffix."""
    paths = [folder / f"{kind}{suffix}" for kind in ("folder", "pipe", "device")]
    paths[0].mkdir()
    os.mkfifo(paths[1])
    paths[2].symlink_to("/dev/zero")
    return paths


@pytest.mark.parametrize("name", READERS)
def test_a_reader_refuses_what_is_not_a_file(name, tmp_path):
    read, suffix = READERS[name]
    for path in not_files(tmp_path, suffix):
        with no_hang(), pytest.raises(InputError) as refused:
            read(path)
        why = "cannot be read: it is not a file, but a folder, a pipe or a device"
        assert str(refused.value) == f"{path}: {why}"
    with pytest.raises(InputError, match="cannot be read: No such file"):
        read(tmp_path / f"none{suffix}")


@pytest.mark.parametrize("command", COMMANDS)
def test_a_command_refuses_what_is_not_a_file(command, tmp_path, capsys):
    for path in not_files(tmp_path, COMMANDS[command][0]):
        with no_hang():
            assert main(words(command, path)) == 2
        assert "it is not a file, but a folder, a pipe or a device" in capsys.readouterr().err


def test_a_file_that_is_read_as_a_whole_has_a_largest_size(tmp_path):
    for suffix, most, read in (
        (".csv", files.LARGEST_TABLE, asi.read_plan),
        (".toml", files.LARGEST_TABLE, design.Settings.read),
        (".asc", files.LARGEST_RECORD, can.read_log),
        (".blf", files.LARGEST_RECORD, can.read_log),
        (".csv", files.LARGEST_RECORD, line.Waveform.read),
        (".npz", files.LARGEST_RECORD, ballast.read_strokes),
    ):
        path = tmp_path / f"large{suffix}"
        path.write_bytes(b"")
        os.truncate(path, most + 1)  # a file with a hole, which takes no space
        with pytest.raises(InputError, match=f"is larger than {most} bytes"):
            read(path)


def test_a_long_line_of_a_log_is_a_fault_and_no_frame_is_lost(tmp_path):
    path, long = tmp_path / "a.log", b"x" * (3 * files.LONGEST)
    path.write_bytes(b"(1.0) can0 123#01\n" + long + b"\n(2.0) can0 123#02\n")
    with pytest.raises(InputError, match=f"line 2: has more than {files.LONGEST} bytes"):
        can.read_log(path)
    log = can.read_log(path, keep=True)
    assert (log.time.tolist(), log.data[:, 0].tolist(), len(log.faults)) == ([1, 2], [1, 2], 1)
    path = tmp_path / "a.asc"
    path.write_bytes(b"0.1 1 123 Rx d 1 01\n0.2 1 " + long + b"\n0.3 1 123 Rx d 1 02\n")
    with pytest.raises(InputError, match=f"line 2: has more than {files.LONGEST} characters"):
        can.read_log(path)
    assert can.read_log(path, keep=True).data[:, 0].tolist() == [1, 2]


def test_a_long_line_of_a_record_is_refused(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("t,u\n" + "".join(f"{k}e-7,1\n" for k in range(9)) + "1,1" + "0" * 40_000)
    with pytest.raises(InputError, match=f"row 11 has more than {files.LONGEST} characters"):
        line.Waveform.read(path)


PLAN = [["kind", "node", "a", "b"], ["master", "head"]]


@pytest.mark.parametrize("suffix", [".csv", ".xlsx"])
def test_cells_too_long_or_too_far_to_the_right_are_refused(suffix, tmp_path):
    def save(rows):
        path = tmp_path / f"plan{suffix}"
        if suffix == ".csv":
            path.write_text("\n".join(map(",".join, rows)))
        else:
            book = openpyxl.Workbook()
            for row in rows:
                book.active.append(row)
            book.save(path)
        return path

    with pytest.raises(InputError, match="row 2, column 3: a cell has 32768 characters; at most"):
        asi.read_plan(save([PLAN[0], [*PLAN[1], "x" * 32_768]]) if suffix == ".csv" else long(save))
    for row in (0, 1):
        rows = [[*cells] for cells in PLAN]
        rows[row] += [""] * (1023 - len(rows[row])) + ["x", "y"]
        with pytest.raises(InputError, match=f"row {row + 1} has 1025 cells; at most 1024 are"):
            asi.read_plan(save(rows))
    rows[1][-2:] = ["", ""]
    with pytest.raises(InputError) as refused:  # empty cells are not a fault
        asi.read_plan(save(rows))
    assert "has no row of kind cable" in str(refused.value)


@pytest.mark.parametrize("cell", ["x" * 200_000, '"' + "x\n" * 100_000 + '"'])
def test_a_cell_beyond_the_limit_of_csv_is_refused_with_its_row(cell, tmp_path, monkeypatch):
    def fail(*_):
        raise AssertionError("another thread may read a file with this limit")

    monkeypatch.setattr(csv, "field_size_limit", fail)
    path, why = tmp_path / "plan.csv", "field larger than field limit (131072), in row "
    for row, text in (
        (4, f"a note\nkind,node,a,b\nmaster,head\nsupply,head,,{cell}\n"),
        (1, "x" * 200_000 + "\nkind,node\nmaster,head\n"),
    ):
        path.write_text(text)
        with pytest.raises(InputError, match=re.escape(f"{why}{row}")):
            asi.read_plan(path)


def test_tables_with_too_many_rows_or_cells_are_refused(tmp_path):
    path = tmp_path / "plan.csv"
    path.write_text("kind,node\n" + "\n" * 9 + "master,head\n" * 65_537)
    with pytest.raises(InputError, match="row 65547: at most 65536 filled rows are read"):
        asi.read_plan(path)
    path.write_text("kind,node\n" + "master,head\n" * 5000 + "," * 1000 + "1\n")
    with pytest.raises(InputError, match="spans 5001 rows and 1001 columns; at most 4194304 cells"):
        asi.read_plan(path)
    path.write_text("kind,node\n" + "master,head\n" * 65_536)
    with pytest.raises(InputError, match="has no row of kind cable"):
        asi.read_plan(path)


def test_a_column_of_other_text_is_not_searched_for_signals(tmp_path):
    path = tmp_path / "list.csv"
    rows = [f"T-{k},reading no. {k}\n" for k in range(1002)]
    path.write_text("tag,signal\n" + "".join(rows[:1000]))
    with pytest.raises(InputError, match="row 2, column signal"):
        design.read_iolist(path)
    path.write_text("tag,signal\n" + "".join(rows))
    why = (
        r"column signal \(B\): more than 1000 different cells are not known signals, such as 'read"
    )
    with pytest.raises(InputError, match=why):
        design.read_iolist(path)


def long(save):
    """Return a workbook with a cell that is longer than openpyxl would write."""
    path = save([PLAN[0], [*PLAN[1], "LONG"]])
    return rewritten(path, "sheet1.xml", lambda data: data.replace(b"LONG", b"x" * 32_768))


def rewritten(path, part, change):
    """Change a part of a workbook."""
    with ZipFile(path) as book:
        content = {name: book.read(name) for name in book.namelist()}
    with ZipFile(path, "w", ZIP_DEFLATED) as book:
        for name, data in content.items():
            book.writestr(name, change(data) if name.endswith(part) else data)
    return path


# Foreign exceptions ------------------------------------------------------------------------------


def strokes(path, **changed):
    """Save the first strokes of the shipped recording, with other arrays for some."""
    with np.load(datasets.path("vtnsi_actuator_strokes.npz")) as shipped:
        arrays = {name: x if name == "channels" else x[:3] for name, x in shipped.items()}
    np.savez(path, **{**arrays, **changed})
    return path


@pytest.mark.parametrize("name", ["channels", "actuator", "condition"])
@pytest.mark.parametrize("code", [0xD800, 0x110000, 0xFFFFFFFF])
def test_names_of_strokes_that_are_not_text_are_refused(name, code, tmp_path):
    count = 7 if name == "channels" else 3
    names = np.full((count, 2), code, "u4").view("U2")[:, 0]
    with pytest.raises(InputError, match=f"{name} is not text"):
        ballast.read_strokes(strokes(tmp_path / "a.npz", **{name: names}))


@pytest.mark.parametrize(
    ("record", "why"),
    [
        ("d 64" + " 01" * 64, "the data length code is 100; it must be 0..15"),
        ("d 8" + " 01" * 64, "it has 64 bytes of data; it must have 0..8"),
        ("d 2 01 02 03", "it has 3 bytes of data, but its data length code is 2"),
        ("r 11", "the data length code is 17; it must be 0..15"),
        ("d 1 100", r"byte must be in range\(0, 256\)"),
    ],
)
def test_an_asc_record_with_more_bytes_than_its_frame_can_have_is_a_fault(record, why, tmp_path):
    pytest.importorskip("can")
    path = tmp_path / "a.asc"
    path.write_text(f"0.1 1 123 Rx d 1 01\n0.2 1 124 Rx {record}\n")
    with pytest.raises(InputError, match=f"line 2: {why}"):
        can.read_log(path)


def test_an_asc_file_in_decimal_and_a_remote_frame_keep_their_data_length_code(tmp_path):
    pytest.importorskip("can")
    path = tmp_path / "a.asc"
    path.write_text(
        "date Mon Jan 1 01:00:00.000 am 2026\nbase dec timestamps absolute\n"
        "0.1 1 291 Rx d 2 100 255 Length = 1\n0.2 1 292 Rx d 12 1 2 3 4 5 6 7 8\n"
        "0.3 1 293 Rx r 10\n0.4 1 294 Rx r\n"
    )
    log = can.read_log(path)
    assert log.dlc.tolist() == [2, 12, 10, 0]
    assert log.data[0].tolist() == [100, 255, 0, 0, 0, 0, 0, 0]


def test_a_dbc_file_with_a_huge_power_of_ten_is_refused(tmp_path):
    pytest.importorskip("cantools")
    path = tmp_path / "a.dbc"
    path.write_text('VERSION ""\nBU_:\nBA_DEF_ BO_ "a" INT 0 1;\nBA_DEF_DEF_ "a" 1e99999999;\n')
    with no_hang(), pytest.raises(InputError, match="the power of ten of a number is"):
        can.read_messages(path)


def test_an_infinite_number_in_a_list_is_a_fault():
    list_of = "name,arbitration_id,dlc,period_ms\na,1,{},{}\n"
    for dlc, period in (("1e999", 5), (8, "1e999"), ("9" * 400, 5)):
        with pytest.raises(InputError, match="row 2, column"):
            can.MessageSet.parse(list_of.format(dlc, period))


FORMULA = r"$\frac{$"


def test_text_of_a_file_is_no_formula_in_a_figure(tmp_path):
    from matplotlib import pyplot as plt

    figure, ax = plt.subplots()
    messages = can.MessageSet([can.Message(FORMULA, 1, 8, 0.1)])
    points = design.read_iolist(datasets.path("synthetic_iolist_valves.csv")).points
    points = points.assign(
        tag=[f"{FORMULA} {tag}" for tag in points["tag"]],
        device=[f"{FORMULA} {device}" for device in points["device"]],
    )
    iolist = design.IoList.from_table(points.head(8))
    planned = iolist.plan("AS-i", name=FORMULA)
    for draw in (
        can.response_times(messages, 125e3).plot,
        lambda ax: can.simulate(messages, 125e3, until=1.0).plot(ax=ax),
        iolist.plot,
        planned.plot,
        planned.quantities().plot,
        partial(made("engine.Run").plot_ages, "ME-JB2-044", label=FORMULA),
        partial(made("engine.Run").plot_ages, "ME-JB2-044", limits={FORMULA: 1.0}),
        partial(can.arbitrate([can.Frame(1), can.Frame(2)]).plot, [FORMULA, "2"]),
        lambda ax: style.moment(ax, 0.5, FORMULA),
    ):
        ax.clear()
        draw(ax=ax)
        figure.canvas.draw()
        assert any(r"\$\frac{\$" in text.get_text() for text in ax.findobj(plt.Text))
    path = tmp_path / "messages.csv"
    messages.save(path)
    assert main(["can", str(path), "-o", str(tmp_path / "a.png")]) == 0
    plt.close(figure)


# A sweep of damaged files ------------------------------------------------------------------------


def damaged(seed, rng):
    """Yield damaged forms of the content of a file."""
    middle = len(seed) // 2
    yield from (b"", seed[:middle], seed[:-1], seed[middle:], seed * 2, seed + seed[:middle])
    yield from (b"\0" * 99, rng.randbytes(999), b"\xff\xfe" + seed, b"\xef\xbb\xbf" + seed)
    yield seed[:middle] + b"\0" + seed[middle:]
    yield seed[:middle] + rng.randbytes(20) + seed[middle:]
    for before, after in ((b"1", b"9" * 400), (b"1", b"1e999"), (b"0", b"nan"), (b"\n", b"\r")):
        yield seed.replace(before, after)
    text = seed.decode("latin-1")
    yield from (text.encode("utf-16"), text.encode("utf-16-be"), text.encode("utf-8"))
    yield from (b"[" * 5000, b"a=" + b"[" * 5000, b"a=" + b"{b=" * 5000, b'{"a":' * 5000)
    for _ in range(4):
        data = bytearray(seed)
        for _ in range(8 if data else 0):
            data[rng.randrange(len(data))] = rng.randrange(256)
        yield bytes(data)


@pytest.mark.parametrize("name", TARGETS)
def test_a_damaged_input_gives_a_result_or_an_error_of_ours(name):
    rng = random.Random(name)
    for seed in TARGETS[name].seeds():
        for data in damaged(seed[:3000], rng):
            with suppress(*REFUSALS):
                TARGETS[name].run(data)


def code_of(arguments):
    """Return the exit code of a command, also if argparse ends it."""
    try:
        return main(arguments)
    except SystemExit as end:
        return end.code


@pytest.mark.parametrize("command", REFUSED)
def test_a_command_refuses_a_wrong_value_of_every_option(command, tmp_path, capsys):
    taken = []
    for option, values in REFUSED[command].items():
        for value in values:
            *others, last = option.split(" ")
            given = [f"{last}={value}"] if last else [value]
            with no_hang():
                code = code_of([*words(command, tmp_path), *others, *given])
            said = capsys.readouterr().err
            assert "Traceback" not in said
            if code != 2 or not said:
                taken.append((option, value[:40]))
    assert not taken


def test_damaged_notebooks_are_flagged(tmp_path, capsys):
    rng = random.Random(1)
    seed = b'{"cells": [{"cell_type": "code", "source": ["me = 1\\n", "x = [0.5]"]}]}'
    for number, data in enumerate(damaged(seed, rng)):
        (tmp_path / f"{number}.ipynb").write_bytes(data)
    assert main(["grade", str(tmp_path), "--json"]) == 0
    grades = json.loads(capsys.readouterr().out)["tables"]["grades"]
    assert len(grades) == number + 1 and all(row["flags"] for row in grades)


def test_a_fleet_with_damaged_files_is_refused_or_completed(tmp_path, capsys, monkeypatch):
    pytest.importorskip("pyarrow")
    monkeypatch.setattr("shipnet.ballast.fleet.sleep", lambda _: None)
    folder, rng = tmp_path / "fleet", random.Random(1)
    command = ["fleet", "--valves", "1", "--days", "1", "--out", str(folder)]
    assert main(command) == 0
    for file in (one for one in sorted(folder.rglob("*")) if one.is_file()):
        good = file.read_bytes()
        for data in damaged(good[:3000], rng):
            file.write_bytes(data)
            code = main(command)
            assert code in (0, 2) and "Traceback" not in capsys.readouterr().err
            # A damaged table is computed again; what is not this fleet's is never replaced.
            again = code == 0 and file.suffix == ".parquet"
            assert file.read_bytes() == (good if again else data)
        file.write_bytes(good)


@pytest.mark.parametrize("command", COMMANDS)
def test_a_command_with_a_damaged_file_ends_in_an_exit_code(command, tmp_path, capsys):
    (suffix, target), rng = COMMANDS[command], random.Random(command)
    path, (seed, *_) = tmp_path / f"a{suffix}", TARGETS[target].seeds()
    for data in damaged(seed[:3000], rng):
        path.write_bytes(data)
        assert main(words(command, path)) in (0, 1, 2)
        assert "Traceback" not in capsys.readouterr().err
