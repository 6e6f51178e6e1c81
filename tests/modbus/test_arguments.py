"""Wrong values for the arguments of every name of the front."""

import pytest

from shipnet import modbus
from tests.support import check_mistakes

READ = modbus.Request.read_holding_registers(0, 4)
LINE = modbus.SerialLine(9600)
POLL = modbus.Poll(READ, LINE)
SLAVE = modbus.Slave()
LISTS = ("coils", "discrete_inputs", "holding_registers", "input_registers")

#: By function: legal arguments, and the mistakes that some of them take.
CALLS = [
    (modbus.interfaces, {
        "n_stations": 2, "length": 1.0, "bit_rate": 9600, "duplex": "half", "unit_load": 1.0,
    }, {}),
    (modbus.Adu, {"unit_id": 1, "pdu": READ, "transaction_id": 1}, {"transaction_id": "None"}),
    (modbus.Request, {"function": 3, "address": 0, "quantity": 1}, {}),
    (modbus.Response, {"function": 3, "registers": [1]}, {}),
    (modbus.decode, {"data": READ.rtu(1), "framing": "rtu"}, {}),
    (modbus.Poll, {"request": READ, "line": LINE, "processing": 0, "timeout": 1, "retries": 0}, {}),
    (modbus.scan, {
        "n_slaves": 3, "registers": 4, "bit_rate": 9600, "character": "8E1", "processing": 0,
        "dead": 0, "timeout": 1, "retries": 0, "limit": 2,
    }, {"limit": "None"}),
    (modbus.Loop, {
        "n_slaves": 3, "poll": POLL, "closed": True, "isolators": False, "move": "slave",
        "failures": 1, "recheck": 60,
    }, {}),
    (modbus.DualChannel, {"poll": POLL, "period": 1, "failures": 1, "recheck": 60}, {}),
    (modbus.simulate, {"system": modbus.Loop(3, POLL), "faults": (), "until": 1},
     {"faults": "empty"}),
    (modbus.Slave, {"device": SLAVE.device}, {"device": "None"}),
    (modbus.Slave, dict.fromkeys(LISTS, ()), dict.fromkeys(LISTS, "empty")),
    (modbus.Slave, {
        "limits": {}, "functions": {3}, "delay": 0, "exception": 2, "silent": False,
    }, {"limits": "None", "functions": "empty", "exception": "None"}),
    (modbus.DeviceError, {"exception": 2}, {}),
    (modbus.answer, {"slaves": {1: SLAVE}, "adu": modbus.Adu(1, READ), "time": 0, "serial": False},
     {}),
    (modbus.serve, {
        "devices": {1: SLAVE}, "transport": "tcp", "host": "127.0.0.1", "port": 0,
        "serial_port": "", "line": LINE, "silence": 0.05, "speed": 1, "clock": None,
        "max_clients": 3, "idle_limit": 10, "wire_faults": (), "rng": 1,
    }, {"host": "text", "clock": "None", "wire_faults": "empty", "rng": "None empty"}),
    (modbus.WireFault, {"name": "late", "probability": 1, "seconds": 1}, {"seconds": "None"}),
    (modbus.SerialLine, {"bit_rate": 9600, "character": "8E1"}, {}),
    (modbus.Waveform, {"time": [0, 1], "level": [1, 1], "line": LINE, "threshold": 0.5}, {}),
    (modbus.udp.LossyPath, {"lost": 0, "late": 0, "duplicated": 0, "delay": 0, "lateness": 1}, {}),
    (modbus.udp.compare, {
        "units": [1], "path": modbus.udp.LossyPath(), "timeout": 0.5, "period": 0,
        "processing": 0, "flush": False, "rng": 1,
    }, {"rng": "None empty"}),
    (modbus.faults.Break, {"section": 1, "start": 0, "stop": 1}, {}),
    (modbus.faults.Short, {"section": 1, "start": 0, "stop": 1}, {}),
    (modbus.faults.DeadSlave, {"slave": 1, "start": 0, "stop": 1}, {}),
    (modbus.faults.DeadPort, {"port": "A", "start": 0, "stop": 1}, {}),
]  # fmt: skip

#: Made by a function of the front, or with nothing to check.
RESULTS = {
    "Characters", "Device", "ExceptionCode", "FunctionCode", "Reach", "Run", "Scan", "Server",
    "faults", "udp",
}  # fmt: skip


@pytest.mark.parametrize(("function", "good", "legal"), CALLS)
def test_a_mistake_in_an_argument_is_an_error_that_names_it(function, good, legal):
    check_mistakes(function, good, legal)


def test_every_name_of_the_front_is_in_the_table():
    assert set(modbus.__all__) - RESULTS <= {function.__name__ for function, *_ in CALLS}
