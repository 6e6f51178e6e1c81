"""What other makers' clients accept: the stored table, and a part of it measured again."""

import csv
import os
import sys
from collections import Counter
from concurrent.futures import ThreadPoolExecutor

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


def test_no_client_is_disturbed_by_faults_that_it_cannot_notice():
    # A delay or silence within the time-out must not disturb any client; else the bench is wrong.
    seen = {row["verdict"] for row in STORED if row["fault"] in ("delay", "gap")}
    assert seen == {"right value"}


def test_each_row_counts_every_poll():
    for row in STORED:
        assert sum(int(row[outcome]) for outcome in run.OUTCOMES) == int(row["polls"]) == run.POLLS
        assert float(row["timeout_s"]) == run.TIMEOUT
        assert row["verdict"] == run.verdict({one: int(row[one]) for one in run.OUTCOMES})
        # A delay or silence within the time-out must not disturb any client.
        assert row["fault"] not in ("delay", "gap") or row["verdict"] == "right value"


def test_two_clients_still_behave_as_in_the_table():
    require("pty", hasattr(os, "openpty"), "this system has no pseudo-terminals")
    jobs = []
    for name in run.OWN:
        client = run.installed(name, *run.OWN[name])
        stored = {row["version"] for row in STORED if row["client"] == name}
        assert stored == {client.version}, f"{name} is {client.version}: run `make clients`"
        jobs += [(client, "rtu", fault) for fault in run.faults("rtu")]
    expected = {key: row["verdict"] for key, row in zip(KEYS, STORED, strict=True)}
    # A late response must arrive between two time-outs: half a time-out after the first, and half
    # a time-out before the second. Where a busy machine may have missed this, the time-out grows.
    for timeout in (2.0, 6.0, 18.0):
        with ThreadPoolExecutor(len(jobs)) as pool:
            found = pool.map(lambda job, t=timeout: run.measure(*job, polls=6, timeout=t), jobs)
            names = [(client.name, kind, fault) for client, kind, fault in jobs]
            verdicts = dict(zip(names, map(run.verdict, found), strict=True))
        different = {key: one for key, one in verdicts.items() if one != expected[key]}
        jobs = [job for job, name in zip(jobs, names, strict=True) if name in different]
        if not jobs:
            break
    assert not different


def test_each_line_is_judged_by_itself():
    first, second, third = (" ".join(map(str, run.values(2 * k))) for k in range(3))
    for lines, expected in (
        ([f"ok {first}", f"ok {second}", f"ok {third}"], {"right": 3}),
        ([f"ok {first}", f"ok {first}", "error timed out"], {"right": 1, "wrong": 1, "error": 1}),
        ([f"ok {first.split()[0]}", "ok", "error"], {"wrong": 2, "error": 1}),
    ):
        words = [sys.executable, "-c", f"print({chr(10).join(lines)!r})"]
        assert +run._outcomes(words, {}, polls=3, patience=60.0) == Counter(expected)
