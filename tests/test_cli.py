"""The command line: one grammar for all commands; exit code 0 if good, 1 if bad, 2 for errors."""

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
from shipnet import __version__, asi, can, line, modbus
from shipnet.__main__ import main
from shipnet.papers import ledger

POINTS = "tag,signal,x,y,z\nLS-1,contact,3,2,3\nLS-2,contact,30,2,3\n"
COMMANDS = ("ledger", "decode", "check", "can", "modbus", "design", "serve", "fleet")
PLAN = """kind,node,to,length_m,address,profile,current_ma
master,room,,,,,
supply,room,,,,,
cable,room,deck,70,,,
slave,deck,,,1,S-0.F,65
"""
MODBUS = ["modbus", "--slaves", "24", "--registers", "20", "--bit-rate", "19.2k", "--dead", "2"]


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


@pytest.fixture
def words(points, scope, tmp_path):
    """Return the words of an example with a good result for each command."""
    (tmp_path / "plan.csv").write_text(PLAN)
    can.example().save(tmp_path / "list.csv")
    return {
        "ledger": ["ledger", "icn2007"], "decode": ["decode", scope], "design": design(points),
        "check": ["check", str(tmp_path / "plan.csv")],
        "can": ["can", str(tmp_path / "list.csv"), "--rates", "50k", "125k"], "modbus": MODBUS,
    }  # fmt: skip


def design(points, *more):
    return ["design", points, "--cabinet", "0,0,0", "--options", "home runs", *more]


def test_ledger_prints_every_claim_of_the_paper(capsys):
    assert main(["ledger", "kim2023"]) == 0
    out = capsys.readouterr().out
    assert all(claim in out for claim in ledger("kim2023").table().index)
    assert "icn2007" not in out
    (row,) = [line for line in out.splitlines() if line.startswith("kim2023-074")]
    assert row.split()[1:4] == ["0.7", "7.368", "erratum"]
    assert row.endswith("[%] -> 7.4 %")
    assert "*: holds under the condition" in out and "agrees* " in out
    (quoted,) = [line for line in out.splitlines() if line.startswith("kim2023-068")]
    assert quoted.split()[1:3] == ["14", "context"]


def test_summary_counts_only(capsys):
    assert main(["ledger", "--summary"]) == 0
    lines = capsys.readouterr().out.splitlines()
    titles = "measurement independent own simulator definition ours erratum context not verified"
    assert lines[0].split() == f"{titles} not reproducible open claims".split()
    assert len(lines) == 2 + 5


def test_a_csv_file_contains_all_columns(tmp_path, capsys):
    file = tmp_path / "ledger.csv"
    assert main(["ledger", "icn2007", "-o", str(file)]) == 0
    with open(file, newline="", encoding="utf-8-sig") as stream:
        rows = list(csv.DictReader(stream))
    table = ledger("icn2007").table().reset_index()
    assert list(rows[0]) == list(table.columns)
    assert [row["id"] for row in rows] == list(table["id"])
    assert f"\nwritten: {file}\n" in capsys.readouterr().out


@pytest.mark.parametrize("name", COMMANDS[:-2])
def test_the_suffix_of_a_file_decides_its_form(name, words, tmp_path, capsys):
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


@pytest.mark.parametrize("name", COMMANDS[:-2])
def test_json_is_the_result_as_data(name, words, capsys):
    assert main([*words[name], "--json"]) == 0
    streams = capsys.readouterr()
    answer = json.loads(streams.out)
    ok = None if name == "modbus" else True
    assert (answer["command"], answer["version"], answer["ok"]) == (name, __version__, ok)
    assert answer["verdict"] and all(set(one) == {"value", "unit"}
                                     for one in answer["numbers"].values())  # fmt: skip
    assert next(iter(answer["tables"].values()))
    assert streams.err == ""


def test_a_missing_library_for_workbooks_is_reported_before_any_work(capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "openpyxl", None)
    assert main(["design", "none.csv", "-o", "r.xlsx"]) == 2
    said = "shipnet: openpyxl is not installed; install it with: python -m pip install openpyxl\n"
    assert capsys.readouterr().err == said


def test_json_also_reports_errors(tmp_path, capsys):
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


def test_a_bad_result_exits_with_1(points, scope, tmp_path, capsys, monkeypatch):
    slow = ["--options", "CAN", "--set", "can.bit_rates=[50_000]", "--set", "host_time=60"]
    assert main(["design", points, "--cabinet", "0,0,0", *slow]) == 1
    assert "rules violated" in capsys.readouterr().out
    weak = tmp_path / "weak.npy"
    np.save(weak, pd.read_csv(scope)["voltage (V)"] / 4)
    assert main(["decode", str(weak), "--sample-interval", "100n"]) == 1
    assert "response level" in capsys.readouterr().out
    monkeypatch.setattr("shipnet.papers.judging._status", lambda claim: "open")
    assert main(["ledger", "icn2007", "--summary"]) == 1


def asked(capsys, *words, code=0):
    """Return the result of a command as data."""
    assert main([*map(str, words), "--json"]) == code
    return json.loads(capsys.readouterr().out)


def test_a_can_list_is_analysed_and_late_messages_exit_with_1(words, tmp_path, capsys):
    messages, file = can.example(), tmp_path / "list.csv"
    found = asked(capsys, *words["can"])
    assert found["verdict"] == can.analyse(messages, [50e3, 125e3]).verdict
    assert found["numbers"]["lowest_bit_rate"] == {"value": 125e3, "unit": "bit/s"}
    assert found["numbers"]["bus_time"]["value"] == pytest.approx(can.bus_load(messages, 125e3))
    rates, responses = found["tables"]["bit_rates"], found["tables"]["responses"]
    assert [(row["late"], row["first_late"]) for row in rates] == [(1, "speed"), (0, "")]
    bound = {one.message.name: 1e3 * one.response for one in can.response_times(messages, 125e3)}
    assert {row["name"]: row["response_ms"] for row in responses} == pytest.approx(bound)
    slow = asked(capsys, "can", file, "--rates", "50k", code=1)
    assert slow["numbers"]["lowest_bit_rate"]["value"] is None
    # In reverse order of identifiers: the best order and its benefit are reported.
    messages.ordered(reversed(messages.names)).save(file)
    found = asked(capsys, "can", file, "--rates", "125k", "250k", "1M")
    best = found["numbers"]["lowest_bit_rate_in_best_order"]["value"]
    assert best < found["numbers"]["lowest_bit_rate"]["value"]
    order = [row["name"] for row in found["tables"]["best_order"]]
    assert can.response_times(messages.ordered(order), best).met


def test_a_log_is_compared_with_a_dbc_file(tmp_path, capsys):
    pytest.importorskip("cantools")
    file, log = tmp_path / "ship.dbc", tmp_path / "trip.log"
    dbc = 'VERSION ""\n\nBU_: JB1\n\nBO_ 32 Speed: 4 JB1\n\nBO_ 2000 New: 8 JB1\n'
    file.write_text(dbc)
    can.simulate(can.example(), 125e3, until=2.0).log().save(log)
    assert main(["can", str(file), "--log", str(log)]) == 2
    error = capsys.readouterr().err
    assert "message 'Speed': has no cycle time; give one with --period on" in error.replace(
        " has", ": has"
    )
    found = asked(capsys, "can", file, "--period", "0.01", "--log", log, code=1)
    said = {row["name"]: row["verdict"] for row in found["tables"]["messages"]}
    assert (said["Speed"], said["New"], said["0x010"]) == ("as planned", "missing", "unknown")
    assert found["numbers"]["unknown"]["value"] == 9
    # The messages of a log can also be analysed.
    assert asked(capsys, "can", log, "--period", "1", "--log", log)["ok"] is True
    assert asked(capsys, "can", log, "--period", "1", "--rates", "125k")["ok"] is True


def test_own_titles_are_read_and_faults_of_a_dbc_file_can_be_overlooked(tmp_path, capsys):
    file = tmp_path / "list.csv"
    file.write_text("Name;CAN-ID (hex);DLC;Every;Pin\nA;10;8;20;7\n")
    assert main(["can", str(file)]) == 2
    assert "unknown titles: Every; Pin" in capsys.readouterr().err
    titles = ["--column", "Every=period_ms", "--column", "Pin=note"]
    assert len(asked(capsys, "can", file, *titles)["tables"]["responses"]) == 1
    pytest.importorskip("cantools")
    file = tmp_path / "ship.dbc"
    attribute = 'BA_DEF_ BO_ "GenMsgCycleTime" INT 0 9;\nBA_DEF_DEF_ "GenMsgCycleTime" 0;\n'
    attribute += 'BA_ "GenMsgCycleTime" BO_ 32 9;\n'
    file.write_text(f'VERSION ""\nBU_: J\nBO_ 32 Speed: 4 J\nBO_ 9 New: 8 J\n{attribute}')
    assert main(["can", str(file)]) == 2
    capsys.readouterr()
    (left,) = asked(capsys, "can", file, "--overlook")["tables"]["left_out"]
    assert "'New' has no cycle time" in left["fault"]


def test_a_scan_agrees_with_the_library_and_a_slow_one_exits_with_1(capsys):
    found = modbus.scan(24, registers=20, bit_rate=19200, dead=2)
    words = "modbus --devices 24 --registers 20 --rate 19200 --parity E --dead 2".split()
    answer = asked(capsys, *words)
    assert answer["numbers"]["scan_time"]["value"] == found.time
    assert answer["numbers"]["bus_time"]["value"] == found.bus_time
    assert asked(capsys, *MODBUS) == answer
    assert asked(capsys, *MODBUS, "--limit", "3")["ok"] is True
    slow = asked(capsys, *MODBUS, "--limit", "2", code=1)
    assert slow["verdict"].endswith("limit of 2 s exceeded")
    for parity, character in (("O", "8O1"), ("N", "8N2"), ("8N1", "8N1")):
        own = modbus.scan(24, registers=20, bit_rate=19200, dead=2, character=character).time
        assert asked(capsys, *MODBUS, "--parity", parity)["numbers"]["scan_time"]["value"] == own


def test_a_plan_that_violates_a_rule_exits_with_1(tmp_path, capsys):
    file = tmp_path / "plan.csv"
    file.write_text(PLAN.replace(",70,", ",101,"))
    answer, found = asked(capsys, "check", file, code=1), asi.read_plan(file).check()
    assert answer["verdict"] == found.verdict
    assert answer["numbers"]["violated"]["value"] == len(found.violated()) == 1
    assert answer["tables"]["rules"][0]["rule"] == "cable_length"
    assert len(answer["findings"]) == len(found)
    assert main(["check", str(file)]) == 1
    out = capsys.readouterr().out
    assert "cable length: 101 m at segment at room, at most 100 m (1 violated)" in out


#: What a user may give instead of a correct file.
FILES = {
    "a folder": None,
    "empty": b"",
    "blank": b"\n\n \n",
    "binary": bytes(range(256)) * 40,
    "zeros": bytes(4096),
    "half a workbook": b"PK\x03\x04" + bytes(99),
    "prose": b"Dear all,\nplease find the list attached.\n",
    "titles only": b"name,arbitration_id,dlc,period_ms\n",
    "not a number": b"name,arbitration_id,dlc,period_ms\nA,1,8,nan\nB,2,8,inf\nC,3,nan,1\n",
    "twice": b"name,arbitration_id,dlc,period_ms\nA,1,8,10\nA,1,8,10\n",
    "no unit": b"name,id,dlc,cycle\nA,1,8,10\n",
    "wrong unit": b"name,id,dlc,cycle [min]\nA,1,8,10\n",
    "plan of nothing": b"kind,node,to,length_m,address,profile,current_ma\n",
    "plan with nan": PLAN.replace("70", "nan").encode(),
    "plan with one address twice": (PLAN + "slave,room,,,1,S-0.F,65\n").encode(),
}


@pytest.mark.parametrize("suffix", [".csv", ".dbc", ".xlsx", ".log", ".blf"])
@pytest.mark.parametrize("name", FILES)
def test_no_bad_file_ends_in_a_traceback(name, suffix, tmp_path, capsys):
    file, good = tmp_path / f"in{suffix}", tmp_path / "good.csv"
    can.example().save(good)
    file.mkdir() if FILES[name] is None else file.write_bytes(FILES[name])
    for words in (["can", file], ["can", good, "--log", file], ["check", file]):
        code = main(list(map(str, words)))
        error = capsys.readouterr().err
        # A plan may be readable but wrong, and a log readable but empty.
        legible = "check" in words and "address twice" in name
        legible |= "--log" in words and name in ("empty", "blank") and suffix != ".blf"
        assert code == (1 if legible else 2), (words, error)
        assert legible or error.startswith(f"shipnet: {file}"), error


def test_settings_are_set_by_name(points, capsys):
    assert main(design(points, "--set", "detour=1.5", "--set", "asi.tree=false")) == 0
    out = capsys.readouterr().out
    assert "changed: detour 1.5 (default 1.15)" in out and "asi.tree false (default true)" in out
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
def test_numbers_may_have_si_prefixes(text, value):
    assert command.number(text) == value


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["ledger", "kim"], "paper is 'kim'; it must be one of 'kim2023'"),
        (["ledger", "-o", "/nowhere/at/all.csv"], "there is no folder /nowhere/at"),
        (["ledger", "-o", "all.html"], "-o is 'all.html'; its suffix must be one of .csv, .xlsx"),
        (["design", "list.csv", "-o", "all.doc"], ".svg, .html, or none for a folder"),
        (["can", "none.csv"], "none.csv: cannot be read: No such file"),
        (["can", "a\0b"], "cannot be read: embedded null"),
        (["can", "list.csv", "--rates", "5k", "--log", "a.log"], "cannot be combined"),
        (["can", "list.csv", "--column", "Every"], "--column is 'Every'; it must be TITLE=NAME"),
        (["can", "list.csv", "--period", "inf"], "period is inf"),
        ([*MODBUS, "--slaves", "0"], "n_slaves is 0; it must be a whole number 1..247"),
        ([*MODBUS, "--dead", "25"], "dead is 25; it must be a whole number 0..24"),
        ([*MODBUS, "--bit-rate", "inf"], "bit_rate is inf"),
        ([*MODBUS, "--parity", "M"], "character is 'M'"),
        ([*MODBUS, "--timeout", "1m"], "timeout is 0.001 s; it must be"),
        ([*MODBUS, "--limit", "-1"], "limit is -1 s; it must be 0..1e+06 s"),
        (["check", "none.csv"], "none.csv: cannot be read"),
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


def test_the_module_runs_as_a_program_even_with_a_closed_pipe(tmp_path):
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
    # The file is written even if the output is no longer read.
    assert len(file.read_text(encoding="utf-8").splitlines()) > len(ledger("lee2012"))
