"""The scan of a master: time to poll all valves, and greatest age of a shown value."""

from __future__ import annotations

from dataclasses import KW_ONLY, field, replace
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from shipnet.ballast.actuator import Actuator
from shipnet.ballast.registers import COMMAND_REGISTER, FIRST_REGISTER, N_REGISTERS
from shipnet.ballast.sensors import Sensors
from shipnet.errors import ArgumentError
from shipnet.fields import check_fields, check_whole, choice, number, record, whole
from shipnet.lazy import pd
from shipnet.modbus.frame import MAX_UNIT
from shipnet.modbus.pdu import Request
from shipnet.modbus.polling import Poll
from shipnet.modbus.redundancy import Loop
from shipnet.modbus.uart import SerialLine

#: Usual bit rates from 2400 to 115200 bit/s, the range of both controllers in section 3 of the
#: paper.
BIT_RATES = (2400, 4800, 9600, 19200, 38400, 57600, 115200)

#: The request that a scan sends to each valve: input registers 0x4020 to 0x4023.
READ_STATUS = Request.read_input_registers(FIRST_REGISTER, N_REGISTERS)

#: Limit for the "display of fully updated screen views" in DNV-OS-D202 [s].
_SCREEN = 2.0


def status_poll(line: SerialLine | float = 9600.0, **timing: Any) -> Poll:
    """Return the poll with which a master reads the status of a valve: four input registers.

    Parameters
    ----------
    line : float or line, default 9600
        Bit rate [bit/s] of a line with 8E1 characters, or the settings of the line. The paper
        prints neither.
    **timing
        The arguments `processing`, `timeout` and `retries` of `Poll`.

    Returns
    -------
    Poll
        Poll for `System`, with a request of 8 bytes and a response of 13 bytes.

    Examples
    --------
    >>> poll = status_poll(9600)
    >>> poll.request_size, poll.response_size, round(poll.time * 1e3, 2)
    (8, 13, 32.08)
    """
    serial = line if isinstance(line, SerialLine) else SerialLine(line)
    return Poll(READ_STATUS, serial, **timing)


def command_poll(poll: Poll) -> Poll:
    """Return the poll that sends a command to a valve, without retries; the response is an echo."""
    request = Request.write_single_register(COMMAND_REGISTER, 0)
    return replace(poll, request=request, retries=0)


@record(eq=False)
class System:
    """Valves and, if there is a poll, the line and the master that scans them.

    Without a `poll` (see `status_poll`), the valves are commanded and read directly. More
    than 247 valves are divided among several masters. `opening` is the initial opening of the
    valves, 0..1, one number or one per valve.

    Examples
    --------
    >>> round(System(247, poll=status_poll(9600)).worst_age(), 2)
    7.94
    """

    n_valves: int = whole(
        1,
        10_000,
        help="Number of valves; if omitted, that of `actuator`, or 1",
        default=None,
        optional=True,
    )
    poll: Poll | None = None
    _: KW_ONLY
    actuator: Actuator = field(default_factory=Actuator)
    sensors: Sensors = field(default_factory=Sensors)
    opening: npt.ArrayLike = 0.0
    step: float = number(1e-3, 1, "s", "Time between two readings while a motor runs", default=0.1)
    move: Literal["slave", "downstream"] = choice(
        ("slave", "downstream"),
        "Slaves that the master moves to its other port when a slave does not respond: that "
        "slave only, or also all slaves downstream of it",
        default="slave",
    )
    watchdog: float | None = number(
        0.1,
        3600,
        "s",
        "Time without a request after which a motor stops; no limit if omitted",
        default=None,
        optional=True,
    )

    def __post_init__(self) -> None:
        check_fields(self)
        described = self.actuator.n_valves
        count = described or 1 if self.n_valves is None else self.n_valves
        if described not in (None, count):
            raise ArgumentError(
                f"n_valves is {count}; it must be that of the actuator, {described}"
            )
        opening = np.asarray(self.opening, float)
        if opening.shape not in ((), (count,)) or not ((opening >= 0) & (opening <= 1)).all():
            raise ArgumentError(
                f"opening is {self.opening!r}; it must be 0..1, one value for all valves or "
                f"one for each of {count}"
            )
        object.__setattr__(self, "n_valves", count)

    def __repr__(self) -> str:
        valves = f"{self.n_valves} valve{'s' if self.n_valves > 1 else ''}"
        return f"System({valves}{f', {self.poll.line.bit_rate:g} bit/s' if self.poll else ''})"

    @property
    def loop(self) -> Loop:
        """The line of the valves, a closed loop with a port of the master at each end."""
        if self.poll is None:
            raise ArgumentError("the system has no poll; give it one, such as status_poll(9600)")
        return Loop(self.n_valves, self.poll, move=self.move)

    def worst_age(self, *, commands: int = 0) -> float:
        """Return the greatest age of a shown position while all valves respond [s].

        `commands` is the number of commands sent within one scan.
        """
        system, poll = self.loop, self.loop.poll
        count = check_whole("commands", commands, 0, 1000)
        return system.period + count * command_poll(poll).time + poll.shortest_timeout

    def scan_times(self) -> pd.DataFrame:
        """Return the scan times, one row per bit rate.

        ``scan_s`` is the scan time of the master with the most valves, ``worst_age_s`` the greatest
        age of a shown position, and ``valves_in_2_s`` the number of valves that a master can update
        within 2 s, the limit of DNV-OS-D202 for a fully updated screen.
        """
        poll = self.poll if self.poll is not None else status_poll()
        masters = -(-self.n_valves // MAX_UNIT)
        largest = -(-self.n_valves // masters)
        rows = {}
        for rate in BIT_RATES:
            serial = SerialLine(rate, poll.line.character)
            # A time-out of one hour allows any processing time; no request times out here.
            read = status_poll(serial, processing=poll.processing, timeout=3600)
            scan = read.scan_time(largest)
            rows[rate] = masters, scan, scan + read.shortest_timeout, read.max_slaves(_SCREEN)
        columns = ["masters", "scan_s", "worst_age_s", "valves_in_2_s"]
        table = pd.DataFrame.from_dict(rows, orient="index", columns=columns)
        return table.rename_axis("bit_rate")

    def valve_addresses(self) -> pd.DataFrame:
        """Return the master and unit id of each valve; valves are divided evenly and in order."""
        shares = np.array_split(np.arange(self.n_valves), -(-self.n_valves // MAX_UNIT))
        rows = [
            (master, unit)
            for master, share in enumerate(shares, 1)
            for unit in range(1, share.size + 1)
        ]
        index = pd.RangeIndex(1, self.n_valves + 1, name="valve")
        return pd.DataFrame(rows, columns=["master", "unit"], index=index)


def as_system(system: System | int) -> System:
    """Return a system; a number means that many valves without a poll."""
    if isinstance(system, System):
        return system
    return System(check_whole("system", system, 1, 10_000))
