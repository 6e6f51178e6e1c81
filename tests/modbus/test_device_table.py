"""Tables of devices: their scan, the best order, and a server for them."""

from itertools import pairwise, product
from math import inf

import numpy as np
import pytest
from pymodbus.client import ModbusTcpClient
from pymodbus.exceptions import ModbusIOException

from shipnet import modbus
from shipnet.__main__ import main
from shipnet.errors import ArgumentError, InputError
from shipnet.modbus.polling import Poll, Polled, best_order, spread
from shipnet.modbus.slave import read_slaves

TITLES = (
    "device,address,register,registers,function,period [ms],timeout [ms],retries,dead,host,"
    "delay [ms]\n"
)
#: Rows as title line and, by hand: request and response bytes of each request, delay, time-out,
#: tries and whether it is dead. 126 registers need two requests, 10 coils two bytes.
ROWS = {
    "fan 1,1,0x64,20,3,400,100,1,no,,": ([(8, 45)], 0, 0.1, 2, False),
    "fan 2,2,0,126,3,,300,,yes,,": ([(8, 255), (8, 7)], 0, 0.3, 1, True),
    "pump,247,65535,1,16,900,,,,,5": ([(11, 8)], 5e-3, 1.0, 1, False),
    "lamp,5,7,10,1,,,,,,": ([(8, 7)], 0, 1.0, 1, False),
    "drive,1,0,4,4,2000,,,,10.0.0.7,20": ([], 20e-3, 1.0, 1, False),
}


@pytest.fixture
def table(tmp_path):
    def write(text, name="drives.csv"):
        (tmp_path / name).write_text(text, encoding="utf-8")
        return tmp_path / name

    return write


def by_hand(row, rate):
    """Return the time of a row's requests, and what it costs if it is dead, from bytes and bits."""
    pairs, delay, timeout, tries, _ = row
    byte = (1 + 8 + 1 + 1) / rate
    t35 = 3.5 * byte if rate <= 19200 else 1.75e-3
    if not pairs:
        return delay, tries * timeout
    answer = sum((ask + reply) * byte + 2 * t35 + delay for ask, reply in pairs)
    return answer, sum(tries * (ask * byte + timeout) for ask, _ in pairs)


@pytest.mark.parametrize("rate", [9600, 19200, 115200])
def test_a_table_is_scanned_as_computed_by_hand(table, rate):
    found = modbus.scan(table(TITLES + "\n".join(ROWS)), bit_rate=rate)
    times = [by_hand(row, rate) for row in ROWS.values()]
    whole = sum(
        dead if row[-1] else alive for row, (alive, dead) in zip(ROWS.values(), times, strict=True)
    )
    slaves = found.slaves()
    assert found.time == pytest.approx(whole, rel=1e-12)
    assert (found.n_slaves, found.dead) == (5, 1)
    assert slaves["time_ms"].tolist() == pytest.approx([1e3 * alive for alive, _ in times])
    adds = [1e3 * (dead - alive) for alive, dead in times]
    assert slaves["dead_adds_ms"].tolist() == pytest.approx(adds)
    assert found.dead_time == pytest.approx(max(dead for _, dead in times))
    assert slaves["age_worst_ms"].isna().tolist() == [row[-1] for row in ROWS.values()]


def test_one_more_dead_device_adds_what_the_table_says(table):
    alive = [row.replace("yes", "no") for row in ROWS]
    before = modbus.scan(table(TITLES + "\n".join(alive)))
    for k, row in enumerate(alive):
        cells = row.split(",")
        cells[8] = "yes"
        after = modbus.scan(
            table(TITLES + "\n".join([*alive[:k], ",".join(cells), *alive[k + 1 :]]))
        )
        added = 1e3 * (after.time - before.time)
        assert before.slaves()["dead_adds_ms"].iloc[k] == pytest.approx(added)


def test_ages_are_those_seen_by_a_master_that_polls_in_turn(table):
    rows = [row.replace("yes", "no") for row in ROWS]
    found = modbus.scan(table(TITLES + "\n".join(rows)))
    now, seen = 0.0, {}
    for _ in range(3):
        for row in found.rows:
            for poll in row.polls:
                read = now + poll.line.frame_time(poll.request_size)
                arrived = read + poll.shortest_timeout
                before = seen.get((row.name, poll))
                seen[row.name, poll] = (read, arrived, arrived - before[0] if before else 0.0)
                now = arrived + poll.line.t35
    slaves = found.slaves()
    for row in found.rows:
        ends = [seen[row.name, poll] for poll in row.polls]
        best = max(arrived - read for read, arrived, _ in ends)
        assert slaves.loc[row.name, "age_best_ms"] == pytest.approx(1e3 * best)
        worst = max(oldest for _, _, oldest in ends)
        assert slaves.loc[row.name, "age_worst_ms"] == pytest.approx(1e3 * worst)


def test_equal_rows_are_the_scan_of_so_many_slaves_and_of_the_simulated_master(table):
    lines = "\n".join(f"{unit},0,20,yes" if unit < 3 else f"{unit},0,20," for unit in range(1, 25))
    path = table(f"address,register,registers,dead\n{lines}")
    plain = {"bit_rate": 19200, "timeout": 0.1, "retries": 1, "processing": 2e-3}
    rows, equal = modbus.scan(path, **plain), modbus.scan(24, registers=20, dead=2, **plain)
    assert rows.time == pytest.approx(equal.time, rel=1e-12)
    assert rows.bus_time == pytest.approx(equal.bus_time, rel=1e-12)
    assert (rows.dead_time, rows.slave_time) == (equal.dead_time, equal.slave_time)
    alive = modbus.scan(
        table("address,register,registers,dead\n" + lines.replace("yes", "")), **plain
    )
    run = modbus.simulate(modbus.Loop(24, alive.polls[0]), until=10)
    interval = alive.slaves()["interval_ms"].to_numpy() / 1e3
    assert interval == pytest.approx(run.gaps, rel=1e-9)


def rows_of(times, periods):
    """Return rows that take the given times, over TCP."""
    request = modbus.Request.read_holding_registers(0, 1)
    link = modbus.polling.TcpLink(9600)
    return [
        Polled((Poll(request, link, time),), name=f"{k}", period=period)
        for k, (time, period) in enumerate(zip(times, periods, strict=True))
    ]


def lateness(times, periods, sequence):
    """Return the largest ratio of interval to period, if a sequence is repeated."""
    whole, worst = sum(times[k] for k in sequence), 0.0
    for row, period in enumerate(periods):
        begins = [sum(times[k] for k in sequence[:n]) for n, k in enumerate(sequence) if k == row]
        if not begins:
            return inf
        gaps = (b - a for a, b in pairwise([*begins, begins[0] + whole]))
        worst = max(worst, max(gaps) / period)
    return worst


def test_hardly_any_sequence_of_few_polls_is_better_than_the_best_order():
    # Of two or three rows, none is. A cycle of three, which powers of two do not have, may gain up
    # to 15 % if four rows cannot be polled as often as wanted.
    rng = np.random.default_rng(7)
    gains = []
    for n, longest in [(2, 9)] * 8 + [(3, 7)] * 8 + [(4, 6)] * 3:
        times = rng.uniform(0.02, 0.2, n).tolist()
        periods = rng.choice([0.1, 0.2, 0.5, 1.0], n).tolist()
        every = (s for size in range(n, longest + 1) for s in product(range(n), repeat=size))
        best = min(lateness(times, periods, s) for s in every if len(set(s)) == n)
        found = best_order(rows_of(times, periods))[2]
        ours = max(a / b for a, b in zip(found, periods, strict=True))
        assert ours <= best * (1 + 1e-9 if n < 4 or best <= 1 else 1.15)
        gains.append(sum(times) / min(periods) / ours)
    assert max(gains) > 1.2  # in the order of the table, some rows would be later


def test_an_order_is_what_its_table_says():
    times, periods = [0.1, 0.02, 0.03, 0.05, 0.04], [0.2, 0.4, 0.8, 0.9, 6.4]
    every, first, interval = best_order(rows_of(times, periods))
    cycles = [[k for k in range(5) if c % every[k] == first[k]] for c in range(max(every))]
    assert {k for cycle in cycles for k in cycle} == set(range(5))
    order = sorted(range(5), key=lambda k: (every[k], -times[k]))
    sequence = [k for cycle in cycles for k in order if k in cycle]
    assert lateness(times, periods, sequence) == pytest.approx(
        max(a / b for a, b in zip(interval, periods, strict=True))
    )
    assert spread(times, [1] * 5)[2] == pytest.approx([sum(times)] * 5)
    assert max(best_order(rows_of([0.01] * 3, [0.02, 1000.0, 1000.0]))[0]) == 64


def test_namesakes_are_told_apart_by_address_and_blocks_by_register(table):
    rows = ["fan,1,100", "fan,2,100", "fan,2,200", "pump,3,0", "pump,3,9"]
    text = "\n".join(["device,address,register,registers", *(f"{row},1" for row in rows)])
    names = ["fan 1", "fan 2 FC3 100", "fan 2 FC3 200", "pump FC3 0", "pump FC3 9"]
    assert modbus.scan(table(text)).slaves().index.tolist() == names


def test_dead_devices_and_those_without_a_period_are_not_judged(table):
    one = modbus.scan(table(TITLES + "a,1,0,1,,10,,,yes,,\nb,2,0,1,,,,,,,"))
    assert one.ok is None
    assert one.slaves()["met"].isna().all()
    everything = modbus.scan(table(TITLES + "a,1,0,1,,10,,,yes,,"), limit=1)
    assert (everything.dead, everything.ok) == (everything.n_slaves, False)
    late = modbus.scan(table(TITLES + "a,1,0,1,,10,,,,,"))
    assert (late.ok, late.n_slaves) == (False, 1)
    assert repr(late) == "Scan(1 slaves: 0.025 s, 1 of 1 rows too late, 1 in the best order)"
    assert "<table" in late._repr_html_()
    assert len(late.plot().get_lines()) == 2


def test_a_device_over_tcp_needs_no_bit_rate(table):
    path = table("host,address,register,registers,delay [ms]\n10.0.0.7,255,0,10,20")
    for rate in (300, 115200):
        assert modbus.scan(path, bit_rate=rate).time == pytest.approx(20e-3)
    assert modbus.scan(path).bus_time == 0


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        ("", "has no devices"),
        ("a,0,0,1,,,,,,,", r"row 2, column address \(B\): '0'; expected 1\.\.247 on a serial line"),
        ("a,248,0,1,,,,,,,", r"'248'; expected 1\.\.247"),
        ("a,256,0,1,,,,,,,", r"'256'; expected a whole number 0\.\.255"),
        ("a,nan,0,1,,,,,,,", "'nan'; expected a whole number"),
        ("a,1,0,,,,,,,,", "is empty; expected a value"),
        ("a,1,0,0,,,,,,,", r"'0'; expected a whole number 1\.\.65536"),
        ("a,1,65535,2,,,,,,,", "at most 65535 for the last register"),
        ("a,1,0,1,7,,,,,,", r"'7'; expected 1\.\.6, 15 or 16"),
        ("a,1,0,1,,0,,,,,", "expected a number above 0"),
        ("a,1,0,1,,nan,,,,,", "'nan'; expected"),
        ("a,1,0,1,,,10,,,,", "row 2: timeout is 0.01 s"),
        ("a,1,0,1,,,,101,,,", r"'101'; expected a whole number 0\.\.100"),
        ("a,1,0,1,,,,,perhaps,,", "expected yes or no"),
        ("a,1,0,1,,,,,,10.0.0.1,", "expected the latency of a device over TCP"),
        (
            "a,1,0,1,,,,,,,\na,1,0,5,,,,,,,",
            "row 3: the same address, function and register as row 2",
        ),
        ("a,1,0,1,,,,,,,\nb,1,9,5,,,,,,,", "row 3: the same address as a"),
    ],
)
def test_faults_of_a_table_name_row_column_and_legal_values(table, rows, message):
    with pytest.raises(InputError, match=message):
        modbus.scan(table(TITLES + rows))


def test_arguments_that_do_not_fit_are_refused(table):
    path = table(TITLES + "a,1,0,1,,,,,,,")
    for make in (
        lambda: modbus.scan(path, registers=2),
        lambda: modbus.scan(path, dead=1),
        lambda: modbus.scan(3),
    ):
        with pytest.raises(ArgumentError, match="registers"):
            make()
    with pytest.raises(InputError, match="no column registers"):
        modbus.scan(table("address,register\n1,2"))
    remarks = modbus.scan(table("address,register,registers\n1,40001,2")).remarks
    assert "40001 of a manual has address 0" in remarks[0]


SERVED = """device;address;register;registers;function;values;exception;delay [ms];dead
fan;1;100;3;3;10 0x14 30;;;
fan;1;100;3;16;;;;
fan;1;200;2;3;;4;;
fan;1;100;3;4;;11;;
fan;1;201;1;6;;3;;
lamp;2;0;10;1;1;;100,5;
gone;3;0;1;3;;4;;yes
"""


def test_a_client_reads_the_values_exceptions_delay_and_silence_of_a_table(table):
    client_of = {"timeout": 0.4, "retries": 0}
    with modbus.serve(table(SERVED)) as server:
        with ModbusTcpClient("127.0.0.1", port=server.port, **client_of) as client:
            read = client.read_holding_registers
            assert read(100, count=3, device_id=1).registers == [10, 20, 30]
            assert not client.write_registers(101, [7, 8], device_id=1).isError()
            assert read(100, count=3, device_id=1).registers == [10, 7, 8]
            assert client.read_coils(0, count=10, device_id=2).bits[:10] == [True] * 10
            refused = {
                1: client.read_discrete_inputs(0, count=1, device_id=1),
                2: read(103, count=1, device_id=1),
                3: client.write_register(201, 1, device_id=1),
                4: read(201, count=1, device_id=1),
                11: client.read_input_registers(100, count=1, device_id=1),
            }
            assert {code: one.exception_code for code, one in refused.items()} == {
                code: code for code in refused
            }
            # Of a block of which one register is refused, all are.
            assert read(199, count=2, device_id=1).exception_code == 4
            with pytest.raises(ModbusIOException):
                read(0, count=1, device_id=3)
    slaves = read_slaves(table(SERVED))
    assert (slaves[1].delay, slaves[2].delay, slaves[3].silent) == (0, 0.1005, True)


def test_slaves_of_several_hosts_and_coils_of_7_are_refused(table):
    titles = "host,address,register,registers,delay [ms],function,values\n"
    with pytest.raises(InputError, match="address 1 belongs to several hosts"):
        read_slaves(table(f"{titles}a,1,0,1,5,,\nb,1,0,1,5,,"))
    with pytest.raises(ArgumentError, match="coils"):
        read_slaves(table(f"{titles}a,1,0,1,5,1,7"))
    with pytest.raises(InputError, match="expected 1 value or 3"):
        read_slaves(table(f"{titles}a,1,0,3,5,,1 2"))
    assert set(read_slaves(table(f"{titles}a,255,0,1,5,,"))) == {0}


def test_two_values_of_a_register_are_refused(table):
    text = "address,register,registers,function,values\n1,10,4,3,1 2 3 4\n1,12,2,16,{}\n1,8,4,3,"
    device = read_slaves(table(text.format("3 4")))[1].device
    assert device.read("holding_registers", 8, 6, 0.0) == [0, 0, 1, 2, 3, 4]
    with pytest.raises(InputError, match=r"row 3: address 12 has another value in an earlier row"):
        read_slaves(table(text.format("9")))


def test_the_command_prints_the_slaves_and_their_cases(table, tmp_path, capsys):
    path = str(table(TITLES + "\n".join(ROWS)))
    assert main(["modbus", path, "-o", str(tmp_path / "ages.png")]) == 1
    assert "dead_adds_ms" in capsys.readouterr().out
    assert main(["modbus", path, "--junit", "--limit", "9", "--length", "50"]) == 1
    out = capsys.readouterr().out
    assert 'tests="12" failures="1" skipped="1"' in out, out
    for words, message in (
        ([path, "--slaves", "3"], "either a TABLE or --slaves"),
        ([path, "--junit", "--stub", "2"], "require --length"),
        ([path, "--length", "-1"], "--length is -1"),
        (["--slaves", "3"], "--registers is None"),
    ):
        assert main(["modbus", *words]) == 2
        assert message in capsys.readouterr().err


def test_serve_refuses_what_is_not_a_table(table, capsys):
    for words, message in (
        (["engines"], "it must be ballast, engine or a table"),
        (["x.csv", "--fault", "1:V1"], "--fault applies to ballast and engine"),
        (["x.csv"], "cannot be read"),
    ):
        assert main(["serve", *words]) == 2
        assert message in capsys.readouterr().err
