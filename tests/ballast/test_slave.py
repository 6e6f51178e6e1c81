from math import inf

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shipnet.ballast.diagnosis import Recorder, diagnose_run
from shipnet.ballast.live import serve
from shipnet.ballast.master import operate
from shipnet.ballast.plant import FAULTS, Command, Fault, Plant
from shipnet.ballast.registers import Code, RegisterMap
from shipnet.ballast.scan import System, status_poll
from shipnet.ballast.simulation import simulate
from shipnet.ballast.slave import Monitor, ValveDevice, valve_slaves
from shipnet.errors import ArgumentError
from shipnet.modbus.faults import Break
from shipnet.modbus.pdu import Request, Response
from shipnet.modbus.polling import Poll
from shipnet.modbus.slave import DeviceError
from shipnet.modbus.uart import SerialLine
from shipnet.papers.kim2014.registers import answer_table

MAP = RegisterMap()
READ = Request.read_input_registers(0x4020, 4)


def write(device, code, time, position=0):
    device.write("holding_registers", 0x4001, [MAP.command(code, position)], time)


def status(device, time):
    return MAP.decode([device.read("input_registers", 0x4020, 4, time)])


def test_a_position_command_moves_the_valve_as_the_simulation_does():
    device = ValveDevice(Plant())
    write(device, Code.POSITION_OPEN, 1.0, 40)
    run = simulate(1, [Command(40, 1.0)], until=8)
    for time in (1.0, 2.5, 4.0, 7.0):
        row = round(time * 10)
        read = status(device, time).readings[:, 0]
        expected = run.readings[row, :, 0]
        assert np.abs(read - expected)[[0, 3, 4]].max() <= 0.5 + 1e-9
        assert np.abs(read - expected)[[1, 2]].max() <= 0.05 + 1e-9
    last = status(device, 8.0)
    assert last.open[0]
    assert not last.close[0]
    assert last.operating_time[0] == pytest.approx(3.6)
    assert last.auto[0]


def test_manual_mode_refuses_the_master_and_the_switch_needs_it():
    device = ValveDevice(Plant())
    with pytest.raises(ArgumentError, match="auto mode"):
        device.turn("open", 0.0)
    device.local = True
    with pytest.raises(DeviceError, match="SERVER_DEVICE_FAILURE"):
        write(device, Code.OPEN, 0.0)
    device.turn("open", 0.0)
    device.turn("stop", 2.0)
    seen = status(device, 5.0)
    assert not seen.auto[0]
    assert seen.readings[4, 0] == 22
    device.local = False
    write(device, Code.MANUAL, 6.0)
    with pytest.raises(DeviceError, match="SERVER_DEVICE_FAILURE"):
        write(device, Code.CLOSE, 6.0)
    write(device, Code.AUTO, 6.0)
    write(device, Code.CLOSE, 6.0)
    assert status(device, 20.0).readings[4, 0] == 0


def test_the_watchdog_stops_a_valve_when_requests_cease():
    fed, starved = (ValveDevice(Plant(System(watchdog=2.0))) for _ in range(2))
    for device in (fed, starved):
        write(device, Code.OPEN, 0.0)
    for time in np.arange(0.5, 12, 1.5):
        status(fed, time)
    assert status(fed, 12.0).readings[4, 0] == 100
    assert status(starved, 12.0).readings[4, 0] == 22
    assert starved.plant.movements[0].end == pytest.approx(2.0)
    assert ValveDevice(Plant()).plant.deadline[0] == inf


def test_slaves_answer_as_the_standard_requires():
    slave = valve_slaves(Plant())[1]
    echo = Request.write_single_register(0x4001, MAP.command(Code.POSITION_OPEN, 40))
    assert slave.answer(echo.pdu) == echo.pdu
    answer = Response.parse(slave.answer(READ.pdu, 2.0), READ)
    assert MAP.decode([answer.registers]).readings[4, 0] == 22
    exceptions = {
        "03 4020 0004": 1,
        "04 4020 0005": 2,
        "04 401f 0001": 2,
        "06 4002 0001": 2,
        "06 4001 0003": 3,
        "06 4001 650a": 3,
    }
    for request, code in exceptions.items():
        pdu = bytes.fromhex(request)
        assert slave.answer(pdu) == bytes([pdu[0] | 0x80, code]), request
    assert slave.answer(bytes.fromhex("04 4023 0001"), 2.0)[:2] == b"\x04\x02"


@given(pdu=st.binary(min_size=1, max_size=8), time=st.floats(0, 50))
def test_no_request_breaks_a_slave(pdu, time):
    slave = valve_slaves(Plant())[1]
    answer = slave.answer(pdu, time)
    # Exception 4 means manual mode only; any other cause would be a bug of ours.
    assert answer == b"" or answer[0] == pdu[0] or answer[1] in (1, 2, 3)


def test_a_slave_reports_its_fault_and_clipped_readings():
    device = ValveDevice(Plant(1, [Fault("Pos4")]))
    # Three of five readings; S2, in row 7, is Pos4 without motor current, and ranks higher.
    assert [status(device, 0.1 * k).fault[0] for k in range(4)] == [0, 0, 7, 7]
    seen = status(device, 0.4)
    assert device.monitor.base.active_codes(device.monitor.found) == ["S2 Pos4"]
    assert seen.readings[4, 0] == 0


def test_a_slave_finds_what_the_offline_diagnosis_of_the_same_readings_finds():
    faults = [Fault(code, valves=k + 1) for k, code in enumerate(FAULTS)]
    plant = Plant(13, faults, rng=7)
    monitor, recorder = Monitor(plant), Recorder(plant)
    for action, until in (("open", 25.0), ("close", 50.0)):
        plant.order(Command(action))
        while plant.time < until:
            recorder.take()
            plant.advance()
    recorder.take()
    active = diagnose_run(recorder.run).active.any(axis=0)
    np.testing.assert_array_equal(monitor.found, active)
    # Without cooling the motor was too warm before; a healthy valve reports no fault.
    assert active.any(axis=1).tolist() == [True] * 12 + [False]


def test_a_lasting_fault_is_found_again_with_unchanged_readings():
    plant = Plant(2, [Fault("Pos4", valves=2)])
    monitor = Monitor(plant)
    rows = []
    for time in range(1, 9):
        plant.run_until(float(time))
        rows.append((monitor.row(0), monitor.row(1)))
        if time == 4:
            monitor.forget(1)
    wrong = rows[2]
    assert wrong[0] == 0 < wrong[1]
    # Three of the last five readings; the count restarts after the command.
    assert rows == [(0, 0)] * 2 + [wrong] * 2 + [(0, 0)] * 2 + [wrong] * 2


def test_a_fault_that_begins_at_rest_shows_in_the_next_readings():
    plant = Plant(1, [Fault("Pos4", start=3.5)])
    monitor = Monitor(plant)
    rows = []
    for time in range(1, 8):
        plant.run_until(float(time))
        rows.append(monitor.row(0))
    assert rows[:5] == [0] * 5
    assert rows[5] == rows[6] > 0


def test_a_found_fault_stays_until_the_next_command_and_a_dead_sensor_finds_none():
    plant = Plant(1, [Fault("V1")])
    device = ValveDevice(plant)
    write(device, Code.OPEN, 0.0)
    assert status(device, 0.1).fault[0] == 0
    assert [status(device, time).fault[0] for time in (0.3, 5.0, 100.0)] == [4, 4, 4]
    write(device, Code.CLOSE, 100.0)
    assert status(device, 101.0).fault[0] == 0
    dead = Plant(rng=1)
    dead._offsets = np.full((5, 1), np.nan)
    blind = ValveDevice(dead)
    assert [status(blind, 0.1 * k).fault[0] for k in range(8)] == [0] * 8


def test_the_watchdog_is_reached_through_slaves_station_and_server():
    slaves = valve_slaves(Plant(System(2, watchdog=2.0)))
    write(slaves[1].device, Code.OPEN, 0.0)
    assert status(slaves[1].device, 12.0).readings[4, 0] == 22
    # The first valve is cut off from both ends and receives nothing more.
    lost = [Break(0, start=3.0), Break(1, start=3.0)]
    ends = []
    for watchdog in (None, 5.0):
        plant = Plant(System(2, status_poll(9600), watchdog=watchdog))
        operate(plant, [Command("open", 1.0)], until=15, faults=lost)
        ends.append({moved.valve: moved.outcome for moved in plant.movements})
    assert ends[0] == {0: "limit", 1: "limit"}
    assert ends[1] == {0: "time", 1: "limit"}
    with serve(2, watchdog=1.5) as server:
        assert [slave.device.watchdog for slave in server.slaves.values()] == [1.5, 1.5]


@given(baud=st.sampled_from([2400, 9600, 19200, 115200]), movement=st.floats(0, 30))
def test_the_cost_of_a_late_answer_equals_a_step_by_step_account(baud, movement):
    serial = SerialLine(baud)
    table = answer_table(serial, 50, movement)
    frame, scan = serial.frame_time(8), Poll(READ, serial).scan_time(50)
    arrival = frame + serial.t35 + movement + frame
    for case, given_up in (("at the end", frame + 1.0), ("at the end, waited for", np.inf)):
        row = table.loc[case]
        assert row.answered == (arrival <= given_up)
        ends = arrival + serial.t35 if row.answered else given_up
        assert row.write_s == pytest.approx(ends)
        assert row.scan_gap_s == pytest.approx(scan + ends)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: answer_table(SerialLine(9600), 0, 9), "n_slaves is 0"),
        (lambda: answer_table(SerialLine(9600), 5, -1), "movement is -1"),
        (lambda: ValveDevice(Plant(), 1), "valve is 1"),
        (lambda: System(watchdog=0), "watchdog is 0"),
        (lambda: serve(1, watchdog=4000), "watchdog is 4000"),
        (lambda: valve_slaves(Plant(248)), "plant has 248 valves"),
        (lambda: ValveDevice(Plant()).turn("position", 0.0), "action is 'position'"),
    ],
)
def test_arguments_out_of_range_are_named(make, message):
    with pytest.raises(ArgumentError, match=message):
        make()
