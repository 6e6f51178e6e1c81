import csv
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shipnet import modbus
from shipnet.errors import ArgumentError
from shipnet.modbus.pdu import Request
from shipnet.modbus.polling import Poll
from shipnet.modbus.uart import SerialLine
from tests.support import tolerance

STATUS = Request.read_input_registers(0, 4)
TABLE = Path(__file__).parents[1] / "reference" / "modbus" / "modbus_rtu_timing.csv"
with TABLE.open() as file:
    ROWS = list(csv.DictReader(file))


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row["baud"])
def test_the_reference_table_is_reproduced_to_its_last_digit(row):
    line = SerialLine(int(row["baud"]))
    read, write = Poll(STATUS, line), Poll(Request.write_single_register(0x4001, 1), line)
    columns = list(row.values())[1:]
    ours = [
        line.character_time * 1e6,
        line.t15 * 1e6,
        line.t35 * 1e6,
        line.frame_time(8) * 1e3,
        line.frame_time(81) * 1e3,
        line.frame_time(13) * 1e3,
        read.time * 1e3,
        write.time * 1e3,
        read.scan_time(247),
        # 250 and 256 slaves are more than the standard allows: the table counts transactions.
        250 * read.time,
        256 * read.time,
        line.frame_time(256) * 1e3,
    ]
    for printed, value in zip(columns, ours, strict=True):
        digit = 10.0 ** -len(printed.partition(".")[2])
        assert value == pytest.approx(float(printed), abs=tolerance("modbus.times") * digit)


def test_the_silences_are_fixed_above_19200_only():
    assert SerialLine(19200).t35 == pytest.approx(3.5 * 11 / 19200)
    for rate in (19200.1, 38400, 1e6):
        assert (SerialLine(rate).t15, SerialLine(rate).t35) == (750e-6, 1.75e-3)


def walk(poll, n, dead):
    """Run a clock through a scan event by event, and return its final time."""
    byte = poll.line.character_time
    clock = 0.0
    for slave in range(n):
        for _ in range(poll.retries + 1):
            clock += poll.request_size * byte
            if slave >= dead:
                clock += poll.line.t35 + poll.processing + poll.response_size * byte
                clock += poll.line.t35
                break
            clock += poll.timeout
    return clock


POLLS = st.builds(
    Poll,
    st.one_of(
        st.builds(Request.read_holding_registers, st.just(0), st.integers(1, 125)),
        st.builds(lambda n: Request.write_multiple_registers(0, [0] * n), st.integers(1, 123)),
    ),
    st.builds(
        SerialLine, st.sampled_from([1200, 9600, 19200, 115200]), st.sampled_from(["8E1", "8N1"])
    ),
    st.floats(0, 0.5),
    st.floats(3.5, 9),
    st.integers(0, 3),
)


@given(poll=POLLS, n=st.integers(1, 247), data=st.data())
def test_a_scan_takes_as_long_as_its_transactions_one_by_one(poll, n, data):
    dead = data.draw(st.integers(0, n))
    assert poll.scan_time(n, dead=dead) == pytest.approx(walk(poll, n, dead), rel=1e-9)


@given(poll=POLLS, n=st.integers(1, 247), data=st.data())
def test_the_maximum_number_of_slaves_fits_and_one_more_does_not(poll, n, data):
    dead = data.draw(st.integers(0, n))
    assert poll.max_slaves(poll.scan_time(n, dead=dead), dead=dead) == n
    period = data.draw(st.floats(0.01, 100))
    most = poll.max_slaves(period, dead=dead)
    if most >= max(dead, 1):
        assert poll.scan_time(most, dead=dead) <= period * (1 + 1e-9)
    if dead <= most < 247:
        assert poll.scan_time(most + 1, dead=dead) > period * (1 - 1e-9)
    if most == 0 and dead:
        assert dead * poll.timeout_time > period


@pytest.mark.parametrize(
    ("n", "registers", "dead", "retries", "rate", "character"),
    [
        (1, 1, 0, 0, 9600, "8E1"),
        (24, 20, 2, 1, 19200, "8E1"),
        (247, 125, 247, 0, 1200, "8N1"),
        (5, 126, 1, 3, 115200, "8N2"),
        (3, 1 << 16, 0, 0, 38400, "8O1"),
    ],
)
def test_a_scan_in_one_line_is_that_of_its_formula(n, registers, dead, retries, rate, character):
    line = {"bit_rate": rate, "character": character, "processing": 3e-3}
    found = modbus.scan(n, registers=registers, dead=dead, timeout=3.0, retries=retries, **line)
    byte = (10 if character == "8N1" else 11) / rate
    silence = 3.5 * byte if rate <= 19200 else 1.75e-3
    parts = [125] * (registers // 125) + [registers % 125] * (registers % 125 > 0)
    answered = sum((8 + 5 + 2 * part) * byte for part in parts)
    asked = len(parts) * 8 * byte
    slave = answered + len(parts) * (2 * silence + 3e-3)
    given_up = (1 + retries) * (asked + len(parts) * 3.0)
    time = (n - dead) * slave + dead * given_up
    assert (found.slave_time, found.dead_time) == pytest.approx((slave, given_up))
    assert found.time == pytest.approx(time)
    on_line = (n - dead) * answered + dead * (1 + retries) * asked
    assert found.bus_time == pytest.approx(on_line / time)
    assert found.table().loc[rate].tolist() == pytest.approx(
        [time, 1e3 * slave, 1e3 * given_up, 100 * on_line / time]
    )


def test_a_limit_is_met_exactly_or_not():
    free = modbus.scan(24, registers=20, bit_rate=19200, dead=2)
    assert (free.ok, free.max_slaves) == (None, None) and "met" not in free.table()
    for limit, ok in ((free.time, True), (free.time * (1 - 1e-9), False), (0.5, False)):
        found = modbus.scan(24, registers=20, bit_rate=19200, dead=2, limit=limit)
        assert found.ok is ok and found.table().loc[19200, "met"] == ok
        assert found.max_slaves == (24 if ok else 23 if limit > 1 else 0)
        assert ("met" if ok else "exceeded") in found.verdict


@given(st.integers(1, 60), st.integers(1, 300), st.integers(0, 3), st.floats(0, 0.02))
def test_a_scan_names_the_longest_processing_time_that_meets_the_limit(n, registers, dead, now):
    options = {"registers": registers, "dead": min(dead, n), "timeout": 0.5}
    scan = modbus.scan(n, processing=now, limit=8.0, **options)
    assert f" s at a processing time of {1e3 * now:g} ms, limit of 8 s" in scan.verdict
    most = scan.max_processing
    if most is None:
        assert not scan.ok or options["dead"] == n
        assert scan.verdict.endswith(("exceeded", "met"))
        return
    rounded = float(scan.verdict.split(" up to ")[1].removesuffix(" ms")) * 1e-3
    assert most - 1e-4 <= rounded <= most + 1e-12
    assert modbus.scan(n, processing=max(most - 1e-9, 0.0), limit=8.0, **options).ok
    try:
        assert not modbus.scan(n, processing=most + 1e-6, limit=8.0, **options).ok
    except ArgumentError as late:
        assert "timeout is 0.5 s" in str(late)


def test_the_table_leaves_out_bit_rates_too_slow_for_the_time_out_and_adds_that_of_the_scan():
    # 255 bytes of 11 bits take 2.3 s at 1200 bit/s, and 0.6 s at 4800.
    found = modbus.scan(31, registers=125, bit_rate=10e3, timeout=0.5)
    assert found.table().index.tolist() == [9600, 10_000, 19200, 38400, 57600, 115200]


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: SerialLine(0), "bit_rate is 0"),
        (lambda: SerialLine(9600, "7E1"), "character is '7E1'"),
        (lambda: SerialLine(9600, "8e1"), "character"),
        (lambda: SerialLine(9600).frame_time(257), r"size is 257.*4\.\.256"),
        (lambda: Poll(STATUS, SerialLine(9600), processing=-1), "processing is -1"),
        (lambda: Poll(STATUS, SerialLine(9600), timeout=0.018), "timeout is 0.018 s"),
        (lambda: Poll(STATUS, SerialLine(9600), retries=-1), "retries"),
        (lambda: Poll(STATUS, SerialLine(9600)).scan_time(248), r"n_slaves is 248.*1\.\.247"),
        (lambda: Poll(STATUS, SerialLine(9600)).scan_time(2, dead=3), r"dead is 3.*0\.\.2"),
        (lambda: modbus.scan(2, registers=4, dead=3), r"dead is 3.*0\.\.2"),
        (lambda: modbus.scan(0, registers=4), r"slaves is 0.*1\.\.247"),
        (lambda: modbus.scan(2, registers=65537), r"registers is 65537.*1\.\.65536"),
        (lambda: modbus.scan(2, registers=125, timeout=0.1), "timeout is 0.1 s; it must be"),
        (lambda: modbus.scan(2, registers=4, limit=-1), "limit is -1"),
    ],
)
def test_arguments_out_of_range_are_named(make, message):
    with pytest.raises(ArgumentError, match=message):
        make()
