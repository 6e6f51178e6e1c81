"""The command line: one grammar for all commands; exit code 0 if good, 1 if bad, 2 for errors."""

import io
import json
import re
import shlex
import subprocess
import sys
from xml.etree import ElementTree

import numpy as np
import pandas as pd
import pytest

from shipnet import __main__ as command
from shipnet import __version__, asi, ballast, can, datasets, fuzzy, line, modbus
from shipnet.__main__ import main
from shipnet.papers import ledger

POINTS = "tag,signal,x,y,z\nLS-1,contact,3,2,3\nLS-2,contact,30,2,3\n"
COMMANDS = "ledger decode check can modbus diagnose design serve fleet frame copy".split()
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
    request_wave = plan.waveform(request, "1 m", dt=1e-7, before=20e-6, after=296e-6)
    answered = plan.waveform(request.answer(3), "80 m", dt=1e-7, before=122e-6, after=236e-6)
    line.Waveform(request_wave.u + answered.u, 1e-7, names=("voltage",)).save(file)
    return str(file)


@pytest.fixture
def words(points, scope, tmp_path):
    """Return the words of an example with a good result for each command."""
    (tmp_path / "plan.csv").write_text(PLAN)
    can.example().save(tmp_path / "list.csv")
    return {
        "ledger": ["ledger", "icn2007"],
        "decode": ["decode", scope],
        "check": ["check", str(tmp_path / "plan.csv")],
        "can": ["can", str(tmp_path / "list.csv"), "--rates", "50k,125k"],
        "modbus": MODBUS,
        "diagnose": ["diagnose", log(tmp_path)],
        "design": design(points),
    }


def log(folder, *rows):
    """Write the log of a valve: by default, it opens and is healthy."""
    rows = rows or [f"{k};90;4;1,2;50;{10 + 5 * k}" for k in range(8)]
    (folder / "log.csv").write_text("\n".join(["time;FP;OP;MC;OT;VPos", *rows]))
    return str(folder / "log.csv")


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


@pytest.mark.parametrize("name", COMMANDS[:-4])
def test_the_suffix_of_a_file_decides_its_form(name, words, tmp_path, capsys):
    files = [tmp_path / f"out{suffix}" for suffix in (".csv", ".xlsx", ".json", ".png", ".svg", "")]
    options = [word for file in files for word in ("-o", str(file))]
    assert main([*words[name], *options]) == 0
    assert capsys.readouterr().out.count("written: ") == len(files)
    table, workbook, data, pixels, drawing, folder = files
    assert pixels.read_bytes().startswith(b"\x89PNG")
    assert "<svg" in drawing.read_text(encoding="utf-8")
    tables = json.loads(data.read_text(encoding="utf-8"))["tables"]
    assert len(pd.read_csv(table)) == len(next(iter(tables.values())))
    assert list(pd.read_excel(workbook, sheet_name=None)) == list(tables)
    assert {f"{title}.csv" for title in tables} <= {file.name for file in folder.iterdir()}


@pytest.mark.parametrize("name", COMMANDS[:-4])
def test_json_is_the_result_as_data(name, words, capsys):
    assert main([*words[name], "--json"]) == 0
    streams = capsys.readouterr()
    answer = json.loads(streams.out)
    ok = None if name == "modbus" else True
    assert (answer["command"], answer["version"], answer["ok"]) == (name, __version__, ok)
    assert answer["verdict"]
    assert all(set(one) == {"value", "unit"} for one in answer["numbers"].values())
    assert next(iter(answer["tables"].values()))
    assert streams.err == ""


def test_a_missing_library_for_workbooks_is_reported_before_any_work(capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "openpyxl", None)
    assert main(["design", "none.csv", "-o", "r.xlsx"]) == 2
    message = (
        "shipnet: openpyxl is not installed; install it with: python -m pip install openpyxl\n"
    )
    assert capsys.readouterr().err == message


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
    answer = asked(capsys, *words["can"])
    assert answer["verdict"] == can.analyse(messages, [50e3, 125e3]).verdict
    assert answer["numbers"]["lowest_bit_rate"] == {"value": 125e3, "unit": "bit/s"}
    bound = {one.message.name: 1e3 * one.response for one in can.response_times(messages, 125e3)}
    responses = {row["name"]: row["response_ms"] for row in answer["tables"]["responses"]}
    assert responses == pytest.approx(bound)
    slow = asked(capsys, "can", file, "--rates", "50k", code=1)
    assert slow["numbers"]["lowest_bit_rate"]["value"] is None
    # In reverse order of identifiers: the best order and its benefit are reported.
    messages.ordered(reversed(messages.names)).save(file)
    answer = asked(capsys, "can", file, "--rates", "125k,250k,1M")
    best = answer["numbers"]["lowest_bit_rate_in_best_order"]["value"]
    assert best < answer["numbers"]["lowest_bit_rate"]["value"]
    order = [row["name"] for row in answer["tables"]["best_order"]]
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
    answer = asked(capsys, "can", file, "--period", "0.01", "--log", log, code=1)
    verdicts = {row["name"]: row["verdict"] for row in answer["tables"]["messages"]}
    assert (verdicts["Speed"], verdicts["New"], verdicts["0x010"]) == (
        "as planned",
        "missing",
        "unknown",
    )
    assert answer["numbers"]["unknown"]["value"] == 9
    # The messages of a log can also be analysed.
    assert asked(capsys, "can", log, "--period", "1", "--log", log)["ok"] is True
    assert asked(capsys, "can", log, "--period", "1", "--rates", "125k")["ok"] is True


def test_own_titles_are_read(tmp_path, capsys):
    file = tmp_path / "list.csv"
    file.write_text("Name;CAN-ID (hex);DLC;Every;Pin\nA;10;8;20;7\n")
    assert main(["can", str(file)]) == 2
    assert "unknown titles: Every; Pin" in capsys.readouterr().err
    titles = ["--column", "Every=period_ms", "--column", "Pin=note"]
    assert len(asked(capsys, "can", file, *titles)["tables"]["responses"]) == 1


def test_a_scan_agrees_with_the_library_and_a_slow_one_exits_with_1(capsys):
    expected = modbus.scan(24, registers=20, bit_rate=19200, dead=2)
    words = "modbus --devices 24 --registers 20 --rate 19200 --parity E --dead 2".split()
    answer = asked(capsys, *words)
    assert answer["numbers"]["scan_time"]["value"] == expected.time
    assert answer["numbers"]["bus_time"]["value"] == expected.bus_time
    assert asked(capsys, *MODBUS) == answer
    assert asked(capsys, *MODBUS, "--limit", "3")["ok"] is True
    slow = asked(capsys, *MODBUS, "--limit", "2", code=1)
    assert slow["verdict"].endswith("limit of 2 s exceeded")
    even = modbus.scan(24, registers=20, bit_rate=19200, dead=2, character="8N2").time
    assert asked(capsys, *MODBUS, "--parity", "N")["numbers"]["scan_time"]["value"] == even


def test_a_plan_that_violates_a_rule_exits_with_1(tmp_path, capsys):
    file = tmp_path / "plan.csv"
    file.write_text(PLAN.replace(",70,", ",101,"))
    answer, findings = asked(capsys, "check", file, code=1), asi.read_plan(file).check()
    assert answer["verdict"] == findings.verdict
    assert answer["numbers"]["violated"]["value"] == len(findings.violated()) == 1
    assert answer["tables"]["rules"][0]["rule"] == "cable_length"
    assert len(answer["findings"]) == len(findings)
    assert main(["check", str(file)]) == 1
    out = capsys.readouterr().out
    assert "cable length: 101 m at segment at room, at most 100 m (1 violated)" in out


#: What a user may give instead of a correct file.
FILES = {
    "a folder": None,
    "empty": b"",
    "blank": b"\n\n \n",
    "binary": bytes(range(256)) * 40,
    "half a workbook": b"PK\x03\x04" + bytes(99),
    "prose": b"Dear all,\nplease find the list attached.\n",
    "titles only": b"name,arbitration_id,dlc,period_ms\n",
    "not a number": b"name,arbitration_id,dlc,period_ms\nA,1,8,nan\nB,2,8,inf\nC,3,nan,1\n",
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


def test_numbers_may_have_si_prefixes():
    read = {text: command.number(text) for text in ("125k", "100n", "1e-7", "9600")}
    assert read == {"125k": 125e3, "100n": 100e-9, "1e-7": 1e-7, "9600": 9600.0}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["ledger", "kim"], "paper is 'kim'; it must be one of 'kim2023'"),
        (["ledger", "-o", "/nowhere/at/all.csv"], "there is no folder /nowhere/at"),
        (["ledger", "-o", "all.html"], "-o is 'all.html'; its suffix must be one of .csv, .xlsx"),
        (["design", "list.csv", "-o", "all.doc"], ".svg, .html, or none for a folder"),
        (["can", "none.csv"], "none.csv: cannot be read: No such file"),
        (["can", "list.csv", "--rates", "5k", "--log", "a.log"], "cannot be combined"),
        (["can", "list.csv", "--column", "Every"], "--column is 'Every'; it must be TITLE=NAME"),
        ([*MODBUS, "--slaves", "0"], "--slaves is 0; it must be a whole number 1..247"),
        (["design", "list.csv", "--set", "detuor=1.5"], "'detuor'; the nearest is detour"),
        (["design", "list.csv", "--set", "detour"], "--set is 'detour'; it must be NAME=VALUE"),
    ],
)
def test_a_mistake_is_reported_in_one_line(arguments, message, capsys):
    assert main(arguments) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1


def test_a_capture_given_as_a_table_names_its_readers(capsys):
    file = str(datasets.path("sigrok_nmea2000_snippet.sr"))
    for words in (["can", file], ["check", file], ["design", file]):
        assert main(words) == 2
        error = capsys.readouterr().err
        assert error.startswith(f"shipnet: {file}: is a sigrok capture, not a table; read it with ")
        assert "can.read_capture" in error and "asi.decode" in error


@pytest.mark.parametrize("arguments", [["--help"], ["ledger", "--help"], ["nonsense"]])
def test_help_and_usage(arguments, capsys):
    with pytest.raises(SystemExit) as stop:
        main(arguments)
    assert stop.value.code == (0 if "--help" in arguments else 2)
    streams = capsys.readouterr()
    if "--help" in arguments:
        assert "example" in streams.out
    else:
        assert "usage: shipnet" in streams.err


def test_no_command_prints_the_help_with_the_exit_codes(capsys):
    assert main([]) == 0
    shown = " ".join(capsys.readouterr().out.split())
    assert "exit codes: 0 good, 1 done and the answer is bad, 2 could not be done" in shown


@pytest.mark.parametrize(
    ("words", "hint"),
    [
        ([*MODBUS, "--bitrate", "9600"], "unknown argument '--bitrate'; did you mean --bit-rate?"),
        (["can", "list.csv", "--xyzzy"], "unknown argument '--xyzzy'\n"),
        (
            ["can", "list.csv", "--rates", "125k", "250k"],
            "'250k'; lists have commas, such as 125k,",
        ),
    ],
)
def test_an_unknown_option_shows_the_usage_of_its_command_and_the_nearest_option(
    words, hint, capsys
):
    with pytest.raises(SystemExit):
        main(words)
    error = capsys.readouterr().err
    assert hint in error and f"usage: shipnet {words[0]}" in error


def test_a_coordinate_may_be_negative(points, capsys):
    words = ["design", points, "--options", "home runs", "--json", "--cabinet"]
    costs = []
    for cabinet in ("-1,-2,0", "1,2,0"):
        main([*words, cabinet])
        comparison = json.loads(capsys.readouterr().out)["tables"]["comparison"]
        costs.append(comparison[0]["total_cost_eur"])
    assert costs[0] > costs[1]


def test_a_minus_is_standard_input_and_standard_output(monkeypatch, capsys):
    def given(text):
        monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(text.encode())))

    given(PLAN)
    assert main(["check", "-", "-o", "-"]) == 0
    table = pd.read_csv(io.StringIO(capsys.readouterr().out))
    assert table["verdict"].eq("met").all() and len(table) > 5
    given("not,a,plan\n")
    assert main(["check", "-"]) == 2
    assert capsys.readouterr().err.startswith("shipnet: standard input: ")
    given(POINTS)
    assert main(["design", "-", "--options", "home runs", "--cabinet", "0,0,0"]) == 0
    assert "2 points" in capsys.readouterr().out
    given(PLAN)
    assert main(["check", "-", "-o", "-", "--json"]) == 2
    assert "-o -, --json and --junit cannot be combined" in capsys.readouterr().err


def test_several_files_are_checked_in_one_call(tmp_path, capsys):
    good, bad = tmp_path / "good.csv", tmp_path / "bad.csv"
    good.write_text(PLAN)
    bad.write_text(PLAN.replace("deck,70", "deck,700"))
    assert main(["check", str(good), str(bad)]) == 1
    shown = capsys.readouterr().out
    assert shown.index(f"{good}:\n") < shown.index(f"{bad}:\n")
    assert main(["check", str(good), str(good)]) == 0
    capsys.readouterr()
    assert main(["check", str(good), str(bad), "-o", str(tmp_path / "all.csv")]) == 2
    assert "-o requires one file; 2 are given" in capsys.readouterr().err


def test_junit_has_one_test_per_check_and_one_failure_per_violation(tmp_path, capsys):
    plans = {"good.csv": PLAN, "bad.csv": PLAN.replace("deck,70", "deck,700")}
    for name, text in plans.items():
        (tmp_path / name).write_text(text)
    files = [str(tmp_path / name) for name in plans]
    assert main(["check", *files, "--junit"]) == 1
    suites = list(ElementTree.fromstring(capsys.readouterr().out.encode()))
    for suite, file in zip(suites, files, strict=True):
        findings = asi.read_plan(file).check()
        assert int(suite.get("tests")) == len(suite) == len(findings)
        assert int(suite.get("failures")) == len(list(suite.iter("failure")))
        assert int(suite.get("failures")) == len(findings.violated())
    assert "it must be at most" in suites[1].find("testcase/failure").get("message")


def test_junit_of_a_scan_and_of_a_log(tmp_path, capsys):
    assert main([*MODBUS, "--limit", "0.1", "--junit"]) == 1
    (suite,) = ElementTree.fromstring(capsys.readouterr().out.encode())
    assert suite.get("failures") == suite.get("tests") == "1"
    messages, log = tmp_path / "list.csv", tmp_path / "trip.log"
    can.example().save(messages)
    sent = can.MessageSet(list(can.example())[1:])
    can.simulate(sent, 125_000, until=5.0).log().save(log)
    code = main(["can", str(messages), "--log", str(log), "--junit"])
    (suite,) = ElementTree.fromstring(capsys.readouterr().out.encode())
    compared = can.compare(can.read_messages(messages), log)
    bad = (compared.table()["verdict"] != "as planned").sum()
    assert int(suite.get("failures")) == bad == 1 and code == 1
    assert int(suite.get("tests")) == len(compared.table())
    assert main(["can", str(messages), "--junit"]) == 2
    assert "--junit requires --log" in capsys.readouterr().err
    assert main([*MODBUS, "--junit"]) == 2
    assert "--junit requires --limit" in capsys.readouterr().err


def test_an_error_in_json_names_the_option_as_it_is_typed(capsys):
    assert main([*MODBUS, "--slaves", "0", "--json"]) == 2
    assert json.loads(capsys.readouterr().out)["error"].startswith("--slaves is 0; ")


def test_diagnose_reports_each_fault_with_its_time_and_reason(tmp_path, capsys):
    rows = [f"12:00:0{k};{90 + 10 * k};3,5;1,2;50;50" for k in range(9)]
    answer = asked(capsys, "diagnose", log(tmp_path, *rows), code=1)
    # V1 fires from 120 bar, in the fourth row, and is reported after three of five rows.
    assert answer["verdict"] == "9 samples: 4 V1, 5 normal"
    (fault,) = answer["tables"]["not_normal"]
    reason = fault.pop("reason")
    assert fault == {"start_s": 5, "end_s": 8, "top": "V1", "samples": 4}
    assert reason == "V1 1.00: FP 140 bar high 1.00, OP 3.5 bar high 1.00"
    assert [row["top"] for row in answer["tables"]["samples"]] == ["normal"] * 5 + ["V1"] * 4
    assert answer["tables"]["reading"] == [{"how the log was read": "DVPos computed from VPos"}]


def test_diagnose_uses_ones_own_rules(tmp_path, capsys):
    file = log(tmp_path)
    rules = tmp_path / "my.toml"
    base = ballast.rule_base()
    fuzzy.RuleBase(base.variables, [fuzzy.Rule("Mine", "OP.high", 1)]).save(rules)
    assert asked(capsys, "diagnose", file)["verdict"] == "8 samples: 8 normal"
    answer = asked(capsys, "diagnose", file, "--rules", rules, code=1)
    assert answer["numbers"] == {
        "Mine": {"value": 6, "unit": ""},
        "normal": {"value": 2, "unit": ""},
    }
    rules.write_text(rules.read_text().replace("OP.high", "OP.hot"))
    assert main(["diagnose", file, "--rules", str(rules)]) == 2
    assert capsys.readouterr().err == f"shipnet: {rules}: Mine: OP.hot is not a term\n"


@pytest.mark.parametrize("name", COMMANDS)
def test_the_examples_in_the_help_are_right(name, capsys):
    with pytest.raises(SystemExit):
        main([name, "--help"])
    examples = re.findall(r"^  shipnet ([^>\n]+)", capsys.readouterr().out, re.MULTILINE)
    assert examples
    for words in examples:
        assert command.parser().parse_args(shlex.split(words)).command == name


def test_the_faults_of_a_file_are_reported_line_by_line_and_as_json(tmp_path, capsys):
    file = tmp_path / "list.csv"
    rows = [f"L-{n},contact,far,0,0" for n in range(300)]
    file.write_text("\n".join(["tag,signal,x,y,z", *rows, "L-9,contct,5,0,0"]), encoding="utf-8")
    assert main(["design", str(file)]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == f"shipnet: {file}:"
    assert lines[1].startswith("  rows 2 to 301, column x (C): 'far'; expected")
    places = [line.split(":")[0].strip() for line in lines[2:]]
    assert places == ["row 302, column tag (A)", "row 302, column signal (B)"]
    assert main(["design", str(file), "--json"]) == 2
    streams = capsys.readouterr()
    answer = json.loads(streams.out)
    assert answer["command"] == "design" and answer["error"].startswith(str(file))
    assert [fault.split(":")[0] for fault in answer["faults"]][300:] == places
    assert streams.err.startswith("shipnet: ")


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


@pytest.mark.parametrize(
    ("words", "shown"),
    [
        ("asi data-exchange 21 0xE", asi.Request.data_exchange(21, 0xE).bits),
        ("asi 00101010111001", "data exchange with slave 21: outputs 1110 (E)"),
        ("asi 0001101", str(asi.Response(3))),
        ("can 123#0102", can.Frame(0x123, b"\1\2").bits),
        ("can 00000123#", can.Frame(0x123, extended=True).bits),
        (f"can {can.Frame(0x7FF).bits}", "7FF#"),
        (
            "modbus read-holding-registers 17 0 10",
            modbus.Request.read_holding_registers(0, 10).rtu(17).hex(" "),
        ),
        (
            "modbus write-multiple-coils 1 2 1 0 1",
            modbus.Request.write_multiple_coils(2, [1, 0, 1]).rtu(1).hex(" "),
        ),
        ("modbus 11 03 00 00 00 0a c7 5d", "starting address  00 00"),
    ],
)
def test_a_frame_is_encoded_and_decoded(words, shown, capsys):
    assert main(["frame", *words.split()]) == 0
    assert shown in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("asi hello", "WORD is 'hello'; it must be bits, or a call such as reset"),
        ("asi reset", "reset requires an address, and data if the call has data"),
        ("asi reset 5 0 0", "reset requires an address, and data if the call has data"),
        ("asi reset five", "WORD is 'five'; it must be a whole number such as 21 or 0xE"),
        ("asi 001", "a response has 7 bits, but '001' has 3"),
        ("can zz#", "WORD is 'zz'; it must be an identifier such as 123"),
        ("can 123#1", "WORD is '1'; it must be bytes such as 0102"),
        (
            "modbus read-coils 1",
            "read-coils requires a unit id, an address, and a quantity or values",
        ),
        (
            "modbus read-coils 1 2 3 4",
            "read-coils requires a unit id, an address, and a quantity or values",
        ),
        ("modbus 11 0", "WORD is '110'; it must be a call, or bytes such as 11 03 00"),
        ("modbus 11 03", "the RTU frame has 2 bytes; it must have 4..256"),
    ],
)
def test_a_wrong_frame_is_answered_by_one_line(words, message, capsys):
    assert main(["frame", *words.split()]) == 2
    assert capsys.readouterr().err == f"shipnet: {message}\n"
