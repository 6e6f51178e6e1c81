import re
import signal
import subprocess
import sys

import numpy as np
import pytest
from pymodbus.client import ModbusTcpClient

from shipnet.__main__ import main
from shipnet.engine import SyntheticValues, load_points
from shipnet.engine.junction_box import JunctionBox, junction_box
from shipnet.engine.registers import RegisterMap
from shipnet.errors import ArgumentError
from shipnet.modbus.server import serve

POINTS = load_points()


@pytest.mark.parametrize("registers", [RegisterMap(POINTS), RegisterMap.mended(POINTS)])
def test_a_real_client_reads_what_the_sensors_measure(registers):
    sensors = SyntheticValues(POINTS, np.random.default_rng(2024))
    time = 42.0
    boxes = {unit: junction_box(registers, sensors.now) for unit in (2, 3)}
    with serve(boxes, clock=lambda: time) as server:
        client = ModbusTcpClient("127.0.0.1", port=server.port)
        found = {
            unit: client.read_holding_registers(0, count=len(registers), device_id=unit).registers
            for unit in boxes
        }
        refused = client.read_input_registers(0, count=1, device_id=2)
        beyond = client.read_holding_registers(len(registers), count=1, device_id=2)
        client.close()
    assert (refused.exception_code, beyond.exception_code) == (1, 2)
    steps = registers.table().query("kind == 'value'")["step"].to_numpy()
    for content in found.values():
        values = registers.decode(content).values
        good = ~np.isnan(values)
        # In the printed coding a reading of 25.5 is taken for the mark.
        assert good.sum() >= len(POINTS) - 1
        error = np.abs(values - sensors.now(time))[good]
        assert (error <= steps[good] / 2 + 1e-9).all()


def test_all_values_at_a_time_are_those_of_the_points():
    sensors = SyntheticValues(POINTS, np.random.default_rng(1))
    assert sensors.now(7.5).tolist() == [sensors.at(k, 7.5) for k in range(len(POINTS))]


def test_what_is_no_box_is_refused():
    with pytest.raises(ArgumentError, match="registers is 5"):
        JunctionBox(5, lambda time: [])
    with pytest.raises(ArgumentError, match="values is 5; it must take a time"):
        JunctionBox(RegisterMap(POINTS), 5)


def test_the_program_serves_the_boxes_and_stops_upon_an_interrupt():
    command = [sys.executable, "-m", "shipnet", "serve", "engine", "--port", "0", "--speed", "0"]
    program = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        said = program.stdout.readline()
        port = int(re.search(r"port (\d+) \(TCP\): unit ids 2 and 3", said)[1])
        client = ModbusTcpClient("127.0.0.1", port=port)
        found = [
            client.read_holding_registers(0, count=99, device_id=unit).registers for unit in (2, 3)
        ]
        client.close()
        program.send_signal(signal.SIGINT)
        out, error = program.communicate(timeout=20)
        assert (program.returncode, out, error) == (0, "stopped\n", "")
    finally:
        program.kill()
        program.wait()
    sensors = SyntheticValues(POINTS, np.random.default_rng(2024))
    assert found[0] == found[1] == RegisterMap(POINTS).encode(sensors.now(0.0)).tolist()


def test_the_engine_has_no_valve_to_break(capsys):
    assert main(["serve", "engine", "--fault", "3:V1"]) == 2
    assert capsys.readouterr().err.count("\n") == 1
