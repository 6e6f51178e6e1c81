"""The command line: one grammar for all commands, exit code 0 good, 1 bad, 2 could not be done."""

import csv
import json
import re
import shlex
import subprocess
import sys

import numpy as np
import pandas as pd
import pytest

from shipnet import __main__ as command
from shipnet import __version__, asi, line
from shipnet.__main__ import main
from shipnet.papers import ledger

POINTS = "tag,signal,x,y,z\nLS-1,contact,3,2,3\nLS-2,contact,30,2,3\n"
COMMANDS = ("ledger", "decode", "design", "serve")


@pytest.fixture
def points(tmp_path):
    file = tmp_path / "points.csv"
    file.write_text(POINTS, encoding="utf-8")
    return str(file)


@pytest.fixture
def scope(tmp_path):
    """A record of one request and its response."""
    file, plan = tmp_path / "scope.csv", asi.line(80, slaves=(1, 80))
    request = asi.Request.data_exchange(21, 0xE)
    asked = plan.waveform(request, "1 m", dt=1e-7, before=20e-6, after=296e-6)
    answered = plan.waveform(request.answer(3), "80 m", dt=1e-7, before=122e-6, after=236e-6)
    line.Waveform(asked.u + answered.u, 1e-7, names=("voltage",)).save(file)
    return str(file)


def design(points, *more):
    return ["design", points, "--cabinet", "0,0,0", "--options", "home runs", *more]


def test_ledger_prints_every_claim_of_the_paper(capsys):
    assert main(["ledger", "kim2023"]) == 0
    out = capsys.readouterr().out
    assert all(claim in out for claim in ledger("kim2023").table().index)
    assert "icn2007" not in out
    (row,) = [line for line in out.splitlines() if line.startswith("kim2023-074")]
    assert row.split()[1:5] == ["0.7", "7.368", "model", "erratum"]
    assert row.endswith("[%] -> 7.4 %")
    assert "* under the condition" in out and "agrees* " in out
    (quoted,) = [line for line in out.splitlines() if line.startswith("kim2023-010")]
    assert quoted.split()[1:3] == ["100", "context"]


def test_summary_counts_only(capsys):
    assert main(["ledger", "--summary"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].split() == [
        "model", "arithmetic", "count", "ours", "erratum", "context", "not", "verified", "not",
        "reproducible", "open", "claims",
    ]  # fmt: skip
    assert len(lines) == 2 + 5


def test_a_csv_file_holds_all_columns(tmp_path, capsys):
    file = tmp_path / "ledger.csv"
    assert main(["ledger", "icn2007", "-o", str(file)]) == 0
    with open(file, newline="", encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    table = ledger("icn2007").table().reset_index()
    assert list(rows[0]) == list(table.columns)
    assert [row["id"] for row in rows] == list(table["id"])
    assert f"\nwritten: {file}\n" in capsys.readouterr().out


@pytest.mark.parametrize("name", ["ledger", "decode", "design"])
def test_the_suffix_of_a_file_decides_its_form(name, points, scope, tmp_path, capsys):
    words = {"ledger": ["ledger", "icn2007"], "decode": ["decode", scope], "design": design(points)}
    files = [tmp_path / f"out{suffix}" for suffix in (".csv", ".xlsx", ".json", ".png", ".svg", "")]
    asked = [word for file in files for word in ("-o", str(file))]
    assert main([*words[name], *asked]) == 0
    assert capsys.readouterr().out.count("written: ") == len(files)
    table, workbook, data, pixels, drawing, folder = files
    assert pixels.read_bytes().startswith(b"\x89PNG")
    assert "<svg" in drawing.read_text(encoding="utf-8")
    tables = json.loads(data.read_text(encoding="utf-8"))["tables"]
    assert len(pd.read_csv(table)) == len(next(iter(tables.values())))
    assert list(pd.read_excel(workbook, sheet_name=None)) == list(tables)
    assert {f"{title}.csv" for title in tables} <= {file.name for file in folder.iterdir()}


@pytest.mark.parametrize("name", ["ledger", "decode", "design"])
def test_json_is_the_answer_as_data(name, points, scope, capsys):
    words = {"ledger": ["ledger", "icn2007"], "decode": ["decode", scope], "design": design(points)}
    assert main([*words[name], "--json"]) == 0
    streams = capsys.readouterr()
    answer = json.loads(streams.out)
    assert (answer["command"], answer["version"], answer["ok"]) == (name, __version__, True)
    assert answer["verdict"] and all(set(one) == {"value", "unit"}
                                     for one in answer["numbers"].values())  # fmt: skip
    # A line that is in order has no causes of faults.
    empty = [title for title, rows in answer["tables"].items() if not rows]
    assert empty == (["causes"] if name == "decode" else [])
    assert streams.err == ""


def test_json_says_also_what_could_not_be_done(tmp_path, capsys):
    file = tmp_path / "list.csv"
    file.write_text("tag,signal,x,y,z\nA,contact,far,0,0\nB,contct,1,0,0\n", encoding="utf-8")
    assert main(["design", str(file), "--json"]) == 2
    streams = capsys.readouterr()
    answer = json.loads(streams.out)
    assert answer["command"] == "design" and answer["error"].startswith(str(file))
    assert [fault.split(":")[0] for fault in answer["faults"]] == [
        "row 2, column x (C)", "row 3, column signal (B)",
    ]  # fmt: skip
    assert streams.err.startswith("shipnet: ")


def test_a_bad_answer_exits_with_1(points, scope, tmp_path, capsys, monkeypatch):
    slow = ["--options", "CAN", "--set", "can.bit_rates=[50_000]", "--set", "host_time=60"]
    assert main(["design", points, "--cabinet", "0,0,0", *slow]) == 1
    assert "rules violated" in capsys.readouterr().out
    weak = tmp_path / "weak.npy"
    np.save(weak, pd.read_csv(scope)["voltage (V)"] / 4)
    assert main(["decode", str(weak), "--sample-interval", "100n"]) == 1
    assert "response level" in capsys.readouterr().out
    monkeypatch.setattr("shipnet.papers.judging._status", lambda claim: "open")
    assert main(["ledger", "icn2007", "--summary"]) == 1


def test_settings_are_set_by_name(points, capsys):
    assert main(design(points, "--set", "detour=1.5", "--set", "asi.tree=false")) == 0
    out = capsys.readouterr().out
    assert "not the default: detour 1.5 (1.15)" in out and "asi.tree false (true)" in out
    assert main(design(points, "--set", "detuor=1.5")) == 2
    assert "'detuor'; the nearest is detour" in capsys.readouterr().err
    assert main(design(points, "--set", "detour")) == 2
    assert "--set is 'detour'; it must be NAME=VALUE" in capsys.readouterr().err
    words = ["--set", "assumptions.labour_rate=[60, 65, 70]", "--set", "modbus.character=8N1"]
    assert main(["design", "--show-settings", *words]) == 0
    out = capsys.readouterr().out
    assert "labour_rate = [60, 65, 70]" in out and 'character = "8N1"' in out


@pytest.mark.parametrize(
    ("text", "value"), [("125k", 125e3), ("100n", 100e-9), ("1e-7", 1e-7), ("9600", 9600.0)]
)
def test_numbers_take_prefixes_of_si(text, value):
    assert command.number(text) == value


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["ledger", "kim"], "paper is 'kim'; it must be one of kim2023, icn2007"),
        (["ledger", "--paper", "kim"], "paper is 'kim'; it must be one of kim2023, icn2007"),
        (["ledger", "-o", "/nowhere/at/all.csv"], "there is no folder /nowhere/at"),
        (["ledger", "-o", "all.html"], "-o is 'all.html'; its suffix must be one of .csv, .xlsx"),
        (["design", "list.csv", "-o", "all.doc"], ".svg, .html, or none for a folder"),
    ],
)
def test_a_mistake_is_reported_in_one_line(arguments, message, capsys):
    assert main(arguments) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1


@pytest.mark.parametrize("arguments", [[], ["--help"], ["ledger", "--help"], ["nonsense"]])
def test_help_and_usage(arguments, capsys):
    with pytest.raises(SystemExit) as stop:
        main(arguments)
    assert stop.value.code == (0 if "--help" in arguments else 2)
    streams = capsys.readouterr()
    if "--help" in arguments:
        assert "example" in streams.out
    else:
        assert "usage: shipnet" in streams.err


@pytest.mark.parametrize("name", COMMANDS)
def test_the_examples_in_the_help_are_right(name, capsys):
    with pytest.raises(SystemExit):
        main([name, "--help"])
    examples = re.findall(r"^  shipnet ([^>\n]+)", capsys.readouterr().out, re.MULTILINE)
    assert examples
    for words in examples:
        assert command._parser().parse_args(shlex.split(words)).command == name


def test_the_faults_of_a_file_are_reported_line_by_line(tmp_path, capsys):
    file = tmp_path / "list.csv"
    rows = [f"L-{n},contact,far,0,0" for n in range(300)]
    file.write_text("\n".join(["tag,signal,x,y,z", *rows, "L-9,contct,5,0,0"]), encoding="utf-8")
    assert main(["design", str(file)]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == f"shipnet: {file}:"
    assert lines[1].startswith("  rows 2 to 301, column x (C): 'far'; expected")
    assert [line.split(":")[0] for line in lines[2:]] == [
        "  row 302, column tag (A)", "  row 302, column signal (B)",
    ]  # fmt: skip


def test_an_interrupt_exits_with_130(monkeypatch):
    def interrupted(paper):
        raise KeyboardInterrupt

    monkeypatch.setattr("shipnet.papers.judging.Ledger", interrupted)
    assert main(["ledger"]) == 130


def test_module_runs_as_a_program_and_into_a_closed_pipe(tmp_path):
    program, file = [sys.executable, "-m", "shipnet"], tmp_path / "all.csv"
    assert subprocess.check_output([*program, "--version"], text=True).startswith("shipnet 0.")
    reader = subprocess.Popen(
        [*program, "ledger", "lee2012", "-o", str(file)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    reader.stdout.close()
    assert reader.stderr.read() == b""
    reader.stderr.close()
    assert reader.wait() == 0
    # The file is written even if nobody reads on.
    assert len(file.read_text(encoding="utf-8").splitlines()) > len(ledger("lee2012"))
