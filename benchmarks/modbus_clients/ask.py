"""Poll a server with a third-party client, and print one line per poll: its values or its error.

    python ask.py CLIENT tcp PORT POLLS TIMEOUT
    python ask.py CLIENT rtu DEVICE POLLS TIMEOUT

Poll k reads two holding registers of unit 1, starting at address 2 k. A client keeps its own
defaults, except for the time-out and the settings of the serial line, and is not reset after an
error. `ask.c`, `ask.js` and `ask.go` do the same.
"""

import re
import subprocess
import sys


def pymodbus(kind, place, timeout):
    from pymodbus.client import ModbusSerialClient, ModbusTcpClient

    if kind == "tcp":
        client = ModbusTcpClient("127.0.0.1", port=int(place), timeout=timeout)
    else:
        client = ModbusSerialClient(place, baudrate=19200, timeout=timeout)
    client.connect()

    def ask(address):
        answer = client.read_holding_registers(address, count=2, device_id=1)
        if answer.isError():
            raise OSError(answer)
        return answer.registers

    return ask


def minimalmodbus(kind, place, timeout):
    import minimalmodbus

    instrument = minimalmodbus.Instrument(place, 1)
    instrument.serial.baudrate, instrument.serial.timeout = 19200, timeout
    return lambda address: instrument.read_registers(address, 2)


def umodbus(kind, place, timeout):
    from umodbus.client import tcp
    from umodbus.client.serial import rtu

    if kind == "tcp":
        import socket

        port, library = socket.create_connection(("127.0.0.1", int(place)), timeout), tcp
    else:
        import serial

        port, library = serial.Serial(place, 19200, timeout=timeout), rtu
    return lambda address: library.send_message(library.read_holding_registers(1, address, 2), port)


def pymodbustcp(kind, place, timeout):
    from pyModbusTCP.client import ModbusClient

    client = ModbusClient("127.0.0.1", int(place), 1, timeout)

    def ask(address):
        found = client.read_holding_registers(address, 2)
        if found is None:
            raise OSError(client.last_error_as_txt)
        return found

    return ask


def modbus_tk(kind, place, timeout):
    from modbus_tk import modbus_rtu, modbus_tcp

    if kind == "tcp":
        master = modbus_tcp.TcpMaster("127.0.0.1", int(place))
    else:
        import serial

        master = modbus_rtu.RtuMaster(serial.Serial(place, 19200))
    master.set_timeout(timeout)
    return lambda address: master.execute(1, 3, address, 2)


def mbpoll(kind, place, timeout):
    """Return a function that runs mbpoll once per poll, because a run has one start address."""
    import termios

    where = ["-p", place, "127.0.0.1"] if kind == "tcp" else ["-b", "19200", "-P", "none", place]

    def ask(address):
        words = ["mbpoll", "-m", kind, "-a", "1", "-0", "-r", str(address), "-c", "2", "-1"]
        done = subprocess.run(
            [*words, "-o", f"{timeout:g}", *where], capture_output=True, text=True, check=False
        )
        if kind == "rtu":  # a real port would discard unread bytes when mbpoll closes it
            with open(place, "rb", buffering=0) as port:
                termios.tcflush(port, termios.TCIFLUSH)
        found = re.findall(r"^\[\d+\]:\s+(\d+)", done.stdout, re.MULTILINE)
        if not found:
            raise OSError(done.stderr.strip() or done.stdout.strip()[-80:])
        return found

    return ask


def main(client, kind, place, polls, timeout):
    ask = globals()[client](kind, place, float(timeout))
    for k in range(int(polls)):
        try:
            print("ok", *ask(2 * k), flush=True)
        except Exception as problem:  # each library has its own exceptions
            print("error", type(problem).__name__, " ".join(str(problem).split()), flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
