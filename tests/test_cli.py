import csv
import subprocess
import sys

import pytest

from shipnet.__main__ import main
from shipnet.papers import ledger


def test_ledger_prints_every_claim_of_the_paper(capsys):
    assert main(["ledger", "--paper", "kim2023"]) == 0
    out = capsys.readouterr().out
    assert all(claim in out for claim in ledger("kim2023").table().index)
    assert "icn2007" not in out
    (row,) = [line for line in out.splitlines() if line.startswith("kim2023-074")]
    assert row.split()[1:4] == ["0.7", "7.368", "typo"]
    assert row.endswith("[%]")
    (quoted,) = [line for line in out.splitlines() if line.startswith("kim2023-010")]
    assert quoted.split()[1:3] == ["100", "context"]


def test_summary_counts_only(capsys):
    assert main(["ledger", "--summary"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].split() == [
        "recomputed", "checked", "ours", "context", "not", "reproducible", "open", "claims",
    ]  # fmt: skip
    assert len(lines) == 2 + 5


def test_csv_holds_all_columns(tmp_path, capsys):
    file = tmp_path / "ledger.csv"
    assert main(["ledger", "--paper", "icn2007", "--csv", str(file)]) == 0
    with open(file, newline="", encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    table = ledger("icn2007").table().reset_index()
    assert list(rows[0]) == list(table.columns)
    assert [row["id"] for row in rows] == list(table["id"])
    assert f"{len(rows)} claims written" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["ledger", "--paper", "kim"], "paper is 'kim'; it must be one of kim2023, icn2007"),
        (["ledger", "--csv", "/nowhere/at/all.csv"], "/nowhere/at"),
    ],
)
def test_a_mistake_is_told_in_one_line(arguments, message, capsys):
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


def test_the_faults_of_a_file_are_told_line_by_line(tmp_path, capsys):
    file = tmp_path / "list.csv"
    rows = [f"L-{n},contact,far,0,0" for n in range(300)]
    file.write_text("\n".join(["tag,signal,x,y,z", *rows, "L-9,contct,5,0,0"]), encoding="utf-8")
    assert main(["design", str(file)]) == 2
    told = capsys.readouterr().err.splitlines()
    assert told[0] == f"shipnet: {file}:"
    assert told[1].startswith("  rows 2 to 301, column x: 'far'; expected")
    assert [line.split(":")[0] for line in told[2:]] == [
        "  row 302, column tag", "  row 302, column signal",
    ]  # fmt: skip


def test_module_runs_as_a_program_and_into_a_closed_pipe():
    program = [sys.executable, "-m", "shipnet"]
    assert subprocess.check_output([*program, "--version"], text=True).startswith("shipnet 0.")
    reader = subprocess.Popen(
        [*program, "ledger", "--paper", "lee2012"], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    reader.stdout.close()
    assert reader.stderr.read() == b""
    reader.stderr.close()
    assert reader.wait() == 0


def test_the_file_is_written_even_if_nobody_reads_on(tmp_path):
    file = tmp_path / "all.csv"
    command = [sys.executable, "-m", "shipnet", "ledger", "--paper", "lee2012", "--csv", str(file)]
    reader = subprocess.Popen(command, stdout=subprocess.PIPE)
    reader.stdout.close()
    assert reader.wait() == 0
    assert len(file.read_text(encoding="utf-8").splitlines()) > len(ledger("lee2012"))
