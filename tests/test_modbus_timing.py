import csv
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shipnet.errors import ArgumentError
from shipnet.modbus.request import ReadRequest, WriteRegister
from shipnet.modbus.timing import Poll, Serial, broadcast_time

TABLE = Path(__file__).parent / "reference" / "modbus" / "modbus_rtu_timing.csv"
with TABLE.open() as file:
    ROWS = list(csv.DictReader(file))


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row["baud"])
def test_the_reference_table_comes_out_to_its_last_digit(row):
    line = Serial(int(row["baud"]))
    read, write = Poll.of(ReadRequest(4, 0x4020, 4), line), Poll.of(WriteRegister(0x4001, 1), line)
    columns = list(row.values())[1:]
    scan = read.answered
    ours = [
        line.character_time * 1e6,
        line.t15 * 1e6,
        line.t35 * 1e6,
        line.frame_time(8) * 1e3,
        line.frame_time(81) * 1e3,
        line.frame_time(13) * 1e3,
        read.answered * 1e3,
        write.answered * 1e3,
        read.scan(247),
        # 250 and 256 slaves are more than the standard has: the table counts transactions.
        250 * scan,
        256 * scan,
        line.frame_time(256) * 1e3,
    ]
    for printed, value in zip(columns, ours, strict=True):
        digit = 10.0 ** -len(printed.partition(".")[2])
        assert value == pytest.approx(float(printed), abs=0.501 * digit)


@pytest.mark.parametrize(
    ("character", "bits"), [("8N1", 10), ("8E1", 11), ("8O1", 11), ("8N2", 11), ("8E2", 12)]
)
def test_the_parity_bit_counts(character, bits):
    assert Serial(9600, character).character_bits == bits
    assert Serial(9600, character).t35 == pytest.approx(3.5 * bits / 9600)


def test_the_silences_are_fixed_above_19200_only():
    assert Serial(19200).t35 == pytest.approx(3.5 * 11 / 19200)
    for rate in (19200.1, 38400, 1e6):
        assert (Serial(rate).t15, Serial(rate).t35) == (750e-6, 1.75e-3)


def walk(poll, alive):
    """Let a clock run through a scan event by event; return where it stands at the end."""
    byte = poll.serial.character_time
    clock = 0.0
    for answers in alive:
        for _ in range(poll.retries + 1):
            clock += poll.request_size * byte
            if not answers():
                clock += poll.timeout
                continue
            clock += poll.serial.t35 + poll.processing + poll.response_size * byte
            clock += poll.serial.t35
            break
    return clock


POLLS = st.builds(
    Poll,
    st.builds(
        Serial, st.sampled_from([1200, 9600, 19200, 115200]), st.sampled_from(["8E1", "8N1"])
    ),
    st.integers(4, 256),
    st.integers(4, 256),
    st.floats(0, 0.5),
    st.floats(3.5, 9),
    st.integers(0, 3),
)


@given(poll=POLLS, n=st.integers(1, 247), data=st.data())
def test_a_scan_takes_what_a_walk_through_it_takes(poll, n, data):
    dead = data.draw(st.integers(0, n))
    clock = walk(poll, [lambda k=k: k >= dead for k in range(n)])
    assert poll.scan(n, dead=dead) == pytest.approx(clock, rel=1e-9)


@given(poll=POLLS, n=st.integers(1, 247), data=st.data())
def test_the_most_slaves_fit_and_one_more_does_not(poll, n, data):
    dead = data.draw(st.integers(0, n))
    assert poll.most_slaves(poll.scan(n, dead=dead), dead=dead) == n
    period = data.draw(st.floats(0.01, 100))
    most = poll.most_slaves(period, dead=dead)
    if most >= max(dead, 1):
        assert poll.scan(most, dead=dead) <= period * (1 + 1e-9)
    if dead <= most < 247:
        assert poll.scan(most + 1, dead=dead) > period * (1 - 1e-9)
    if most == 0 and dead:
        assert dead * poll.given_up > period


@given(poll=POLLS, n=st.integers(1, 247))
def test_the_budget_is_the_processing_that_was_put_in(poll, n):
    assert poll.budget(n, poll.scan(n)) == pytest.approx(poll.processing, abs=1e-9)


def test_random_failures_cost_what_a_simulation_says():
    poll = Poll(Serial(9600), 8, 13, timeout=0.2, retries=2)
    rng = np.random.default_rng(2024)
    n, p = 40_000, 0.3
    mean = walk(poll, [lambda: rng.random() >= p] * n) / n
    # A poll spreads by 0.12 s or so: four standard errors of the mean.
    assert poll.expected(p) == pytest.approx(mean, abs=4 * 0.13 / n**0.5)
    assert poll.expected(0) == pytest.approx(poll.answered)
    assert poll.expected(1) == pytest.approx(poll.given_up)


def test_a_dead_slave_costs_its_timeouts_instead_of_its_transaction():
    poll = Poll(Serial(9600), 8, 13, timeout=1.0, retries=2)
    extra = poll.scan(250 - 3, dead=1) - poll.scan(247)
    assert extra == pytest.approx(3 * (8 * 11 / 9600 + 1) - poll.answered)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Serial(0), "bit_rate is 0"),
        (lambda: Serial(float("nan")), "bit_rate is nan"),
        (lambda: Serial("9600"), "bit_rate"),
        (lambda: Serial(9600, "7E1"), "character is '7E1'"),
        (lambda: Serial(9600, "8e1"), "character"),
        (lambda: Serial(9600).frame_time(257), r"size is 257.*4\.\.256"),
        (lambda: Poll(Serial(9600), 3, 13), "request_size is 3"),
        (lambda: Poll(Serial(9600), 8, 13, -1), "processing is -1"),
        (lambda: Poll(Serial(9600), 8, 13, timeout=0.018), "timeout is 0.018 s"),
        (lambda: Poll(Serial(9600), 8, 13, retries=-1), "retries"),
        (lambda: Poll(Serial(9600), 8, 13).scan(248), r"n_slaves is 248.*1\.\.247"),
        (lambda: Poll(Serial(9600), 8, 13).scan(2, dead=3), r"dead is 3.*0\.\.2"),
        (lambda: Poll(Serial(9600), 8, 13).expected(1.1), "failure is 1.1"),
        (lambda: Poll(Serial(9600), 8, 13).budget(247, 7.9), "247 slaves take 7.92"),
        (lambda: Poll.of(None, Serial(9600)), "request is None; it must be a request"),
        (lambda: Poll(None, 8, 13), "serial is None; it must be a Serial"),
        (lambda: broadcast_time(Serial(9600), 8, turnaround=0), "turnaround is 0"),
    ],
)
def test_arguments_out_of_range_are_named(make, message):
    with pytest.raises(ArgumentError, match=message):
        make()
