"""What other makers' clients accept: the stored table, and a part of it measured again."""

import csv
import os
import sys
from collections import Counter
from concurrent.futures import ThreadPoolExecutor

import pytest

from benchmarks.modbus_clients import run
from tests.support import require

with run.TABLE.open(encoding="utf-8") as file:
    STORED = list(csv.DictReader(file))
KEYS = [(row["client"], row["transport"], row["fault"]) for row in STORED]


def test_the_table_has_every_client_with_every_fault_of_its_transports():
    assert tuple(STORED[0]) == run.COLUMNS
    transports = {(client, transport) for client, transport, _ in KEYS}
    assert sorted(KEYS) == sorted(
        (*one, fault) for one in transports for fault in run.faults(one[1])
    )
    assert {client for client, _ in transports} == {*run.OWN, *run.OTHERS}
    assert len(run.faults("tcp")) == len(run.faults("rtu")) == 12
    told = {row["client"]: (row["version"], row["defaults"]) for row in STORED}
    assert all((row["version"], row["defaults"]) == told[row["client"]] for row in STORED)
    assert all(all(row.values()) for row in STORED)


def test_each_row_counts_every_poll():
    for row in STORED:
        assert sum(int(row[outcome]) for outcome in run.OUTCOMES) == int(row["polls"]) == run.POLLS
        assert float(row["timeout_s"]) == run.TIMEOUT
        assert row["verdict"] == run.verdict({one: int(row[one]) for one in run.OUTCOMES})


def test_the_verdict_is_the_worst_outcome():
    wrong, hang, error, right = "wrong value accepted", "hang", "error", "right value"
    for outcomes, said in (
        ({"right": 40}, right),
        ({"right": 39, "error": 1}, error),
        ({"error": 39, "hang": 1}, hang),
        ({"right": 37, "error": 1, "hang": 1, "wrong": 1}, wrong),
    ):
        assert run.verdict(Counter(outcomes)) == said


def test_no_client_is_disturbed_by_faults_that_it_cannot_notice():
    # A delay or silence within the time-out must not disturb any client; else the bench is wrong.
    seen = {row["verdict"] for row in STORED if row["fault"] in ("delay", "gap")}
    assert seen == {"right value"}


def test_two_clients_still_behave_as_in_the_table():
    require("pty", hasattr(os, "openpty"), "this system has no pseudo-terminals")
    jobs = []
    for name in run.OWN:
        client = run.installed(name, *run.OWN[name])
        stored = {row["version"] for row in STORED if row["client"] == name}
        assert stored == {client.version}, f"{name} is {client.version}: run `make clients`"
        jobs += [(client, "rtu", fault) for fault in run.faults("rtu")]
    # A late answer arrives one second after a time-out and one second before the next.
    with ThreadPoolExecutor(len(jobs)) as pool:
        found = list(pool.map(lambda job: run.measure(*job, polls=6, timeout=2.0), jobs))
    new = {(job[0].name, *job[1:]): run.verdict(one) for job, one in zip(jobs, found, strict=True)}
    old = {key: row["verdict"] for key, row in zip(KEYS, STORED, strict=True) if key in new}
    assert new == old


def outcomes(program, patience=60.0):
    words = [sys.executable, "-c", program]
    return +run._outcomes(words, {}, polls=3, patience=patience)


def test_each_line_is_judged_by_itself():
    first, second, third = (" ".join(map(str, run.values(2 * k))) for k in range(3))
    for lines, expected in (
        ([f"ok {first}", f"ok {second}", f"ok {third}"], {"right": 3}),
        ([f"ok {first}", f"ok {first}", "error timed out"], {"right": 1, "wrong": 1, "error": 1}),
        ([f"ok {first.split()[0]}", "ok", "error"], {"wrong": 2, "error": 1}),
    ):
        assert outcomes(f"print({chr(10).join(lines)!r})") == Counter(expected)


def test_a_client_that_says_nothing_hangs_and_one_that_ends_is_an_error():
    assert outcomes("import time; print('error', flush=True); time.sleep(60)", 3.0) == Counter(
        {"error": 1, "hang": 2}
    )
    with pytest.raises(OSError, match="ended after 1 polls"):
        outcomes("print('error')")


def test_missing_clients_are_named():
    with pytest.raises(run.MissingError, match="no-such-program is not installed"):
        run._run("no-such-program")
    with pytest.raises(run.MissingError, match=r"failed: no such client$"):
        run._run(sys.executable, "-c", "raise SystemExit('no such client')")


def test_rows_of_missing_clients_are_kept(tmp_path, monkeypatch, capsys):
    def lacking(uv):
        raise run.MissingError("no-such-program is not installed")

    table = tmp_path / "modbus_clients.csv"
    table.write_bytes(run.TABLE.read_bytes())
    monkeypatch.setattr(run, "OTHERS", dict.fromkeys([*run.OWN, *run.OTHERS], lacking))
    for name, value in (("OWN", {}), ("TABLE", table), ("ROOT", tmp_path)):
        monkeypatch.setattr(run, name, value)
    before = table.read_bytes()
    assert run.main() == 0
    assert table.read_bytes() == before
    said = capsys.readouterr().out
    assert "skipped: mbpoll: no-such-program is not installed" in said
    assert said.count("skipped: ") == 10 and "0 clients, 10 skipped" in said
