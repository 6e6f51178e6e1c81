import re
import signal

import numpy as np
import pytest
from pymodbus.client import ModbusTcpClient

from shipnet.__main__ import main
from shipnet.engine.faults import (
    BusOff,
    CanBreak,
    DeadBox,
    DeadPort,
    LostCanFrames,
    ModbusBreak,
    OpenWire,
    ShortCircuit,
    StuckSensor,
)
from shipnet.engine.inputs import InputCard
from shipnet.engine.points import read_points
from shipnet.engine.registers import RegisterMap
from shipnet.engine.run import SyntheticValues
from shipnet.engine.serving import JunctionBox, fault_registers, parse_fault, serve
from shipnet.engine.simulation import simulate
from shipnet.engine.system import System
from shipnet.errors import ArgumentError
from shipnet.modbus.pdu import Request
from tests.support import running

POINTS = read_points()
SENSORS = SyntheticValues(POINTS, 2024)
BOX = np.array([point.box for point in POINTS])
ALL = bytes.fromhex("03 0000 0063")


def known(faults, time, box=0):
    """Return a mask of the points with values in a box at a time, and the values."""
    values = JunctionBox(System(), faults, SENSORS, box).values(time)
    return ~np.isnan(values), values


def at(time, sensors=SENSORS):
    """Return the values of all sensors at a time."""
    return np.array([sensors.at(index, time) for index in range(len(POINTS))])


def test_a_real_client_reads_what_the_sensors_measure():
    registers = RegisterMap(POINTS)
    with serve(speed=0) as server:
        client = ModbusTcpClient("127.0.0.1", port=server.port, timeout=60)
        values_of = {
            unit: client.read_holding_registers(0, count=99, device_id=unit).registers
            for unit in (2, 3)
        }
        refused = client.read_input_registers(0, count=1, device_id=2)
        beyond = client.read_holding_registers(99, count=1, device_id=2)
        client.close()
    assert (refused.exception_code, beyond.exception_code) == (1, 2)
    steps = registers.table()["step"].to_numpy()
    for content in values_of.values():
        values = registers.decode(content)
        good = ~np.isnan(values)
        # In the printed coding a reading of 25.5 is mistaken for the mark.
        assert good.sum() >= len(POINTS) - 1
        error = np.abs(values - at(0.0))[good]
        assert (error <= steps[good] / 2 + 1e-9).all()


@pytest.mark.parametrize(
    ("fault", "silent"),
    [
        (DeadBox("JB1", start=5, stop=9), 2),
        (ModbusBreak("2", start=5, stop=9), 3),
        (DeadPort("1", start=5, stop=9), 2),
    ],
)
def test_a_box_out_of_reach_is_silent_and_the_other_one_is_not(fault, silent):
    slaves = serve(faults=fault, speed=0).slaves
    for time, quiet in ((4.9, False), (5.0, True), (8.9, True), (9.0, False)):
        answers = {unit: slave.answer(ALL, time) for unit, slave in slaves.items()}
        assert (answers.pop(silent) == b"") == quiet
        assert all(answers.values())


@pytest.mark.parametrize(
    ("fault", "lost"),
    [
        (DeadBox("JB2", start=5), {"JB2"}),
        (BusOff("JB1", start=5), {"JB2", "JB3"}),
        (CanBreak("JB2-JB3", start=5), {"JB3"}),
    ],
)
def test_values_of_a_box_that_is_not_received_stay_for_four_seconds(fault, lost):
    out = np.isin(BOX, list(lost))
    good, values = known([fault], 8.9)
    assert good.all()
    assert values[out].tolist() == at(5.0)[out].tolist()
    assert values[~out].tolist() == at(8.9)[~out].tolist()
    assert known([fault], 9.1)[0].tolist() == (~out).tolist()


def test_a_returning_box_is_received_again_and_a_stuck_sensor_is_constant():
    assert known([DeadBox("JB2", start=5, stop=12)], 12.5)[0].all()
    stuck = known([StuckSensor(POINTS[0].tag, start=3, stop=6)], 5.0)[1]
    assert stuck[0] == SENSORS.at(0, 3.0) != SENSORS.at(0, 5.0)
    assert known([StuckSensor(POINTS[0].tag, start=3, stop=6)], 7.0)[1][0] == SENSORS.at(0, 7.0)


def test_a_box_that_was_never_heard_has_no_values():
    good, _ = known([DeadBox("JB2")], 0.5)
    assert good.tolist() == (BOX != "JB2").tolist()


def test_what_cannot_be_served_is_refused():
    for action, message in (
        (lambda: serve(System.corrected()), "coding is 'corrected'"),
        (lambda: serve(faults=LostCanFrames("JB2")), "random losses"),
        (lambda: serve(faults=DeadBox("JB9")), "where is 'JB9'"),
        (lambda: serve(speed=-1), "speed is -1"),
    ):
        with pytest.raises(ArgumentError, match=message):
            action()


def test_the_program_serves_the_boxes_and_stops_upon_an_interrupt():
    with running("serve", "engine", "--port", "0", "--speed", "0") as program:
        line = program.stdout.readline()
        port = int(re.search(r"port (\d+) \(TCP\): unit ids 2 and 3, and 247 for faults", line)[1])
        client = ModbusTcpClient("127.0.0.1", port=port, timeout=60)
        values = [
            client.read_holding_registers(0, count=99, device_id=unit).registers for unit in (2, 3)
        ]
        client.close()
        program.send_signal(signal.SIGINT)
        out, error = program.communicate(timeout=60)
        assert (program.returncode, out, error) == (0, "stopped\n", "")
    sensors = SyntheticValues(POINTS, np.random.default_rng(2024))
    assert values[0] == values[1] == RegisterMap(POINTS).encode(at(0.0, sensors)).tolist()


def test_a_valve_fault_is_not_an_engine_fault(capsys):
    assert main(["serve", "engine", "--fault", "3:V1"]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and "such as 2:dead" in error


def test_words_that_name_no_fault_are_refused():
    system = System()
    for words in ("fire", "box dead JB1", "4:dead", "JB2:cut", "2:stuck", "dead"):
        with pytest.raises(ArgumentError, match=f"fault is '{words}'; it must be a place and"):
            parse_fault(system, words)


@pytest.mark.parametrize(
    ("words", "fault"),
    [
        ("2:dead", DeadBox("JB1")),
        ("3:dead", DeadBox("JB3")),
        ("JB2:dead", DeadBox("JB2")),
        ("JB2:bus-off", BusOff("JB2")),
        ("3:cut", ModbusBreak("2")),
        ("JB1-JB2:cut", CanBreak("JB1-JB2")),
        ("ME-JB2-044:stuck", StuckSensor("ME-JB2-044")),
        ("ME-JB2-044:open", OpenWire("ME-JB2-044")),
        ("ME-JB2-044:short", ShortCircuit("ME-JB2-044")),
    ],
)
def test_a_fault_is_a_place_and_an_event(words, fault):
    assert parse_fault(System(), words) == fault


def test_broken_wires_read_the_value_that_the_card_computes():
    tag, card = "ME-JB2-044", InputCard(POINTS)
    index = next(k for k, point in enumerate(POINTS) if point.tag == tag)
    for kind, wire in ((OpenWire, "open"), (ShortCircuit, "short")):
        good, values = known([kind(tag, start=3, stop=6)], 5.0)
        assert good.all() and values[index] == card.value(card.broken(wire))[index]
        assert known([kind(tag, start=3, stop=6)], 6.5)[1][index] == SENSORS.at(index, 6.5)
        others = np.arange(len(POINTS)) != index
        assert values[others].tolist() == at(5.0)[others].tolist()
    run = simulate(System(), until=9, faults=[OpenWire(tag, start=3)])
    screen = run.screen(8.0).table()
    read = round(card.value(card.broken("open"))[index])
    assert screen.loc[tag, ["value", "mark"]].tolist() == [read, ""] and run.alarms().empty


def write(slaves, address, value, time):
    return slaves[247].answer(Request.write_single_register(address, value), time)


def test_a_register_starts_and_ends_a_fault():
    slaves = serve(speed=0).slaves
    assert write(slaves, 0, 1, 5.0)  # JB1 dead
    assert slaves[2].answer(ALL, 4.9) and slaves[3].answer(ALL, 5.1)
    assert slaves[2].answer(ALL, 5.1) == b""
    assert slaves[247].answer(Request.read_holding_registers(0, 3), 6.0).hex() == "0306000100000000"
    assert write(slaves, 0, 0, 7.0)
    assert slaves[2].answer(ALL, 6.9) == b"" != slaves[2].answer(ALL, 7.0)


def test_the_register_of_a_sensor_has_one_of_three_faults():
    slaves, read = serve(speed=0).slaves, Request.read_holding_registers(100, 1)
    request = Request.read_holding_registers(0, 1)
    moving = [slaves[2].answer(request, time) for time in (5.0, 50.0)]
    assert moving[0] != moving[1]
    for content in (1, 2, 3, 2, 0):
        assert write(slaves, 100, content, 5.0)
        assert slaves[247].answer(read, 5.0) == bytes([3, 2, 0, content])
    assert slaves[2].answer(request, 50.0) == moving[1]
    write(slaves, 100, 1, 5.0)
    assert slaves[2].answer(request, 50.0) == moving[0]


def test_unknown_registers_and_faults_are_refused():
    slaves, table = serve(speed=0).slaves, fault_registers()
    assert table.index.tolist() == [*range(12), *range(100, 199)]
    for address, value, code in ((12, 1, 2), (199, 1, 2), (0, 2, 3), (100, 4, 3)):
        assert write(slaves, address, value, 1.0) == bytes([0x86, code])
    assert slaves[247].answer(Request.read_input_registers(0, 1)) == bytes([0x84, 1])
