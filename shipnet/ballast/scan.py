"""The scan of a master: how long it takes to ask all valves, and how old what it shows can be."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from shipnet.ballast.registers import COMMAND_REGISTER, FIRST_REGISTER, N_REGISTERS
from shipnet.fields import check_whole
from shipnet.modbus.adu import MAX_UNIT
from shipnet.modbus.pdu import Request
from shipnet.modbus.polling import Poll
from shipnet.modbus.redundancy import Loop
from shipnet.modbus.uart import SerialLine

if TYPE_CHECKING:
    import pandas as pd


#: Usual bit rates within the 2400 to 115200 bit/s of both controllers; the paper, section 3.
BIT_RATES = (2400, 4800, 9600, 19200, 38400, 57600, 115200)


#: What a scan asks of each valve: input registers 0x4020 to 0x4023.
READ_STATUS = Request.read_input_registers(FIRST_REGISTER, N_REGISTERS)


#: "Display of fully updated screen views", as DNV-OS-D202 has it [s].
_SCREEN = 2.0


def status_poll(
    serial: SerialLine, *, processing: float = 0.0, timeout: float = 1.0, retries: int = 0
) -> Poll:
    """Return the poll with which a scan reads the status of a valve.

    Parameters
    ----------
    serial : Serial
        Settings of the line.
    processing, timeout, retries
        As for `Poll`.

    Returns
    -------
    Poll
        Request of 8 bytes, response of 13.

    Examples
    --------
    >>> poll = status_poll(SerialLine(9600))
    >>> poll.request_size, poll.response_size, round(poll.time * 1e3, 2)
    (8, 13, 32.08)
    """
    return Poll(READ_STATUS, serial, processing=processing, timeout=timeout, retries=retries)


def command_poll(serial: SerialLine, *, processing: float = 0.0, timeout: float = 1.0) -> Poll:
    """Return the write that commands a valve; its response is the echo."""
    request = Request.write_single_register(COMMAND_REGISTER, 0)
    return Poll(request, serial, processing=processing, timeout=timeout)


def worst_age(system: Loop, *, commands: int = 0) -> float:
    """Return how old the position that the master shows can be while all valves answer."""
    poll = system.poll
    write = command_poll(poll.line, processing=poll.processing, timeout=poll.timeout)
    count = check_whole("commands", commands, 0, 1000)
    return system.period + count * write.time + poll.shortest_timeout


def assignment(n_valves: int, *, most: int = MAX_UNIT) -> pd.DataFrame:
    """Share valves out among masters, evenly, and in the order of their numbers."""
    import pandas as pd

    valves = check_whole("n_valves", n_valves, 1, 10_000)
    masters = -(-valves // check_whole("most", most, 1, MAX_UNIT))
    share, more = divmod(valves, masters)
    rows = [
        (master, unit)
        for master in range(1, masters + 1)
        for unit in range(1, share + (master <= more) + 1)
    ]
    index = pd.RangeIndex(1, valves + 1, name="valve")
    return pd.DataFrame(rows, columns=["master", "unit"], index=index)


def scan_table(
    n_valves: int = MAX_UNIT,
    *,
    bit_rates: Iterable[float] = BIT_RATES,
    character: str = "8E1",
    processing: float = 0.0,
) -> pd.DataFrame:
    """Return how long a scan takes at each bit rate."""
    import pandas as pd

    share = assignment(n_valves)["master"].value_counts()
    largest = int(share.max())
    rows = {}
    for rate in bit_rates:
        serial = SerialLine(rate, character)
        # A timeout that any processing fits into; nothing times out here.
        read = status_poll(serial, processing=processing, timeout=3600)
        write = command_poll(serial, processing=processing, timeout=3600)
        rows[rate] = (
            1e3 * read.time,
            1e3 * write.time,
            len(share),
            read.scan_time(largest),
            read.scan_time(-(-largest // 2)),
            read.scan_time(largest) + read.shortest_timeout,
            read.max_slaves(_SCREEN),
        )
    columns = ["read_ms", "write_ms", "masters", "scan_s", "halves_s", "worst_age_s"]
    columns += ["valves_in_2_s"]
    table = pd.DataFrame.from_dict(rows, orient="index", columns=columns)
    return table.rename_axis("bit_rate")
