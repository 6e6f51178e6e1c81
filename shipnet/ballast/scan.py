"""The scan of a master: how long it takes to ask all valves, and how old what it shows can be."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from shipnet.ballast.registers import COMMAND_REGISTER
from shipnet.ballast.scales import FIRST_REGISTER, N_REGISTERS
from shipnet.fields import check_whole
from shipnet.modbus.adu import MAX_UNIT
from shipnet.modbus.pdu import Request
from shipnet.modbus.polling import Poll
from shipnet.modbus.redundancy import Loop
from shipnet.modbus.uart import SerialLine

if TYPE_CHECKING:
    import pandas as pd

__all__ = [
    "BIT_RATES",
    "READ_STATUS",
    "assignment",
    "command_poll",
    "scan_table",
    "status_poll",
    "worst_age",
]

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
    """Return the write that commands a valve; its response is the echo.

    Parameters
    ----------
    serial : Serial
        Settings of the line.
    processing, timeout
        As for `Poll`.

    Returns
    -------
    Poll
        Request and response of 8 bytes; it is not repeated.

    Examples
    --------
    >>> round(command_poll(SerialLine(9600)).time * 1e3, 2)
    26.35
    """
    request = Request.write_single_register(COMMAND_REGISTER, 0)
    return Poll(request, serial, processing=processing, timeout=timeout)


def worst_age(system: Loop, *, commands: int = 0) -> float:
    r"""Return how old the position that the master shows can be while all valves answer.

    .. math:: a = N T_{read} + m T_{write} + T_{read} - t_{request} - t_{3.5}

    Parameters
    ----------
    system : Loop
        The master with its valves, polled by `status_poll`.
    commands : int, default 0
        Commands m that are sent within one scan, 0..1000.

    Returns
    -------
    float
        From the end of the request, when the slave takes its reading, to the end of the next
        answer, which replaces it [s].

    Examples
    --------
    >>> loop = Loop(247, status_poll(SerialLine(9600)))
    >>> round(worst_age(loop), 2), round(worst_age(loop, commands=10), 2)
    (7.94, 8.21)
    """
    poll = system.poll
    write = command_poll(poll.line, processing=poll.processing, timeout=poll.timeout)
    count = check_whole("commands", commands, 0, 1000)
    return system.period + count * write.time + poll.shortest_timeout


def assignment(n_valves: int, *, most: int = MAX_UNIT) -> pd.DataFrame:
    """Share valves out among masters, evenly, and in the order of their numbers.

    Parameters
    ----------
    n_valves : int
        Number of valves, 1..10000.
    most : int, default 247
        Most slaves of a master, 1..247.

    Returns
    -------
    pandas.DataFrame
        Indexed by ``valve``, from 1 on: ``master``, from 1 on, and ``unit``, the slave id there.

    Notes
    -----
    The paper asks for several masters from 256 valves on; the standard asks for a second one from
    248 on (claims kim2014-001 and -047).

    Examples
    --------
    >>> assignment(256).groupby("master")["unit"].max().to_dict()
    {1: 128, 2: 128}
    >>> assignment(256).loc[[128, 129]].values.tolist()
    [[1, 128], [2, 1]]
    """
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
    """Return how long a scan takes at each bit rate.

    Parameters
    ----------
    n_valves : int, default 247
        Number of valves, 1..10000; more than 247 are shared out among masters that scan at once.
    bit_rates : iterable of float
        50..10e6 [bit/s]; `BIT_RATES` by default.
    character : str, default "8E1"
        As for `Serial`.
    processing : float, default 0
        Turnaround: what slave and master take for themselves in each transaction, 0..3600 [s].

    Returns
    -------
    pandas.DataFrame
        Indexed by ``bit_rate``: ``read_ms`` and ``write_ms``, a transaction; ``masters``;
        ``scan_s`` of the largest share; ``halves_s``, if the loop is cut in the middle and both
        ports scan at once; ``worst_age_s`` as `worst_age`; ``valves_in_2_s`` of one master.

    Notes
    -----
    Closed as the paper has it, the loop is one line on which both ports hear each other: halves
    can be scanned at once only if it is cut, which gives the redundancy away. 2 s is the time in
    which DNV-OS-D202 asks for a fully updated screen.

    Examples
    --------
    >>> table = scan_table(processing=5e-3)
    >>> table.loc[[2400, 9600, 115200], ["scan_s", "valves_in_2_s"]].round(2).values.tolist()
    [[32.93, 15.0], [9.16, 53.0], [2.59, 190.0]]
    """
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
