"""The scan explorer: how long a Modbus master takes to poll all slaves, compared with a limit."""

from __future__ import annotations

from functools import cached_property

from shipnet.fields import choice, number, record, whole
from shipnet.modbus.frame import MAX_UNIT
from shipnet.modbus.polling import BIT_RATES, Scan, scan
from shipnet.tools._tool import Tool
from shipnet.tools._view import Measure, View, words

_WORDS = words("modbus_scan")

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

    bit_rate: int = choice(BIT_RATES, _WORDS["bit_rate"], default=9600, unit="bit/s")
    character: str = choice(CHARACTERS, _WORDS["character"], default="8E1")
    slaves: int = whole(1, MAX_UNIT, help=_WORDS["slaves"], default=31)
    registers: int = whole(1, 125, help=_WORDS["registers"], default=10)
    processing_ms: float = number(0, 500, "ms", _WORDS["processing_ms"], (0, 100), default=5.0)
    dead: int = whole(0, MAX_UNIT, help=_WORDS["dead"], default=0, at_most="slaves")
    timeout_ms: float = number(
        10, 5000, "ms", _WORDS["timeout_ms"], (10, 3000), default=500.0, step=10
    )
    retries: int = whole(0, 10, help=_WORDS["retries"], default=1)
    limit: float = number(0.1, 60, "s", _WORDS["limit"], (0.1, 10), default=2.0, step=0.1)

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
        own = f"[modbus]\nbit_rates = [{self.bit_rate}]\nprocessing = {poll.processing:g}\n"
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
            curve=lambda: result.table()["scan_s"],
            data=result.table,
            short="in time" if result.ok else "too slow",
            measure=Measure("scan_s", "scan time [s]", result.time, self.limit),
            uses={"ship_design": {"own": own}},
        )
