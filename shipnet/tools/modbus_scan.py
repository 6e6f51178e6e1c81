"""The scan explorer: how long a Modbus master takes to poll all slaves, compared with a limit."""

from __future__ import annotations

from functools import cached_property

from shipnet.fields import choice, number, record, whole
from shipnet.modbus.frame import MAX_UNIT
from shipnet.modbus.polling import BIT_RATES, Scan, scan
from shipnet.tools._tool import Tool
from shipnet.tools._view import View

#: Character formats to choose from: those of the standard, and 8N1, which many devices use.
CHARACTERS = ("8E1", "8O1", "8N2", "8N1")


@record
class ModbusScan(Tool):
    """How long a Modbus master takes to poll all slaves, compared with a limit.

    `result` is the scan, a `modbus.Scan`.

    Raises
    ------
    ArgumentError
        If a value is out of range. Raised by `result` if the time-out is shorter than a response.

    Examples
    --------
    >>> ModbusScan().verdict, ModbusScan(dead=1).verdict
    ('in time: 1.576 s', 'too slow: 2.543 s')
    """

    bit_rate: int = choice(
        BIT_RATES, default=9600, unit="bit/s", label="bit rate", help="Bit rate of the line."
    )
    character: str = choice(
        CHARACTERS,
        default="8E1",
        label="character",
        help="Data bits, parity and stop bits. The standard's characters have 11 bits; 8N1 has 10.",
    )
    slaves: int = whole(
        1, MAX_UNIT, default=31, label="slaves", help="Number of slaves, polled in turn."
    )
    registers: int = whole(
        1, 125, default=10, label="registers per slave", help="Holding registers to read."
    )
    processing_ms: float = number(
        0,
        500,
        default=5.0,
        unit="ms",
        slider=(0, 100),
        step=1,
        label="processing time",
        help="Time a slave takes to process a request, in addition to the silences between frames.",
    )
    dead: int = whole(
        0,
        MAX_UNIT,
        default=0,
        at_most="slaves",
        label="dead slaves",
        help="Slaves that do not respond; each request to one of them costs a full time-out.",
    )
    timeout_ms: float = number(
        10,
        5000,
        default=500.0,
        unit="ms",
        slider=(10, 3000),
        step=10,
        label="response time-out",
        help="How long the master waits for a response before it repeats the request or gives up.",
    )
    retries: int = whole(
        0, 10, default=1, label="retries", help="Number of repeats of an unanswered request."
    )
    limit: float = number(
        0.1,
        60,
        default=2.0,
        unit="s",
        slider=(0.1, 10),
        step=0.1,
        label="longest scan",
        help="Longest time that the scan may take.",
    )

    @cached_property
    def result(self) -> Scan:
        """The scan."""
        return scan(
            self.slaves,
            registers=self.registers,
            bit_rate=self.bit_rate,
            character=self.character,
            processing=1e-3 * self.processing_ms,
            dead=self.dead,
            timeout=1e-3 * self.timeout_ms,
            retries=self.retries,
            limit=self.limit,
        )

    def _view(self) -> View:
        result, poll = self.result, self.result.polls[0]
        used = poll.utilisation(self.slaves, self.limit, dead=self.dead)
        return View(
            verdict=f"{'in time' if result.ok else 'too slow'}: {result.time:.3f} s",
            ok=bool(result.ok),
            numbers={
                "one slave": f"{1e3 * poll.time:.1f} ms, of which {1e3 * poll.on_wire:.1f} ms "
                f"are bytes and {2e3 * poll.line.t35:.1f} ms are silence",
                "a dead slave costs": f"{1e3 * poll.timeout_time:.0f} ms",
                "scan without dead slaves": f"{poll.scan_time(self.slaves):.3f} s",
                "scan": f"{result.time:.3f} s",
                "bus time": f"{used.bus_time:.1%}".replace("%", " %"),
                "capacity used": f"{used.capacity_used:.1%}".replace("%", " %"),
                "worst response": f"{used.worst_response:.3f} s",
                "slaves that fit": f"{result.max_slaves}",
            },
            plot=self.plot,
            height=3.0,
            about="Scan time over bit rate, on logarithmic scales, with the limit",
        )
