"""The scan explorer: how long a Modbus master takes to ask all its slaves, against a limit."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

from matplotlib.axes import Axes
from matplotlib.ticker import LogLocator, NullFormatter

from shipnet import style
from shipnet.errors import ArgumentError
from shipnet.fields import choice, number, record, whole
from shipnet.modbus.frame import MAX_UNIT
from shipnet.modbus.pdu import Request
from shipnet.modbus.polling import Poll
from shipnet.modbus.uart import SerialLine
from shipnet.tools._tool import Tool
from shipnet.tools._view import View

#: Bit rates to choose from [bit/s].
BIT_RATES = (1200, 2400, 4800, 9600, 19200, 38400, 57600, 115200)

#: Characters to choose from: those of the standard, and what many devices are set to.
CHARACTERS = ("8E1", "8O1", "8N2", "8N1")


@record
class ModbusScan(Tool):
    """How long a Modbus master takes to ask all its slaves, against a limit.

    `scan` is the scan time [s], `max_slaves` how many slaves fit, and `by_bit_rate` the scan time
    at every bit rate that the timeout allows.

    Raises
    ------
    ArgumentError
        If a value is out of its range, or the timeout is shorter than a whole response.

    Examples
    --------
    >>> ModbusScan().verdict, ModbusScan(dead=1).verdict
    ('in time: 1.576 s', 'too slow: 2.543 s')
    """

    bit_rate: int = choice(
        BIT_RATES, default=9600, unit="bit/s", label="bit rate", help="Bit rate of the line."
    )
    character: str = choice(
        CHARACTERS, default="8E1", label="character",
        help="Data bits, parity and stop bits; the standard's have 11 bits, 8N1 has 10.",
    )  # fmt: skip
    slaves: int = whole(
        1, MAX_UNIT, default=31, label="slaves", help="Slaves that are asked in turn."
    )
    registers: int = whole(
        1, 125, default=10, label="registers of each", help="Holding registers read of each slave."
    )
    processing_ms: float = number(
        0, 500, default=5.0, unit="ms", slider=(0, 100), step=1, label="a slave works",
        help="How long a slave works on a request, on top of the silence between frames.",
    )  # fmt: skip
    dead: int = whole(
        0, MAX_UNIT, default=0, at_most="slaves", label="dead slaves",
        help="Slaves that do not answer: the master waits for each until its timeout.",
    )  # fmt: skip
    timeout_ms: float = number(
        10, 5000, default=500.0, unit="ms", slider=(10, 3000), step=10, label="response timeout",
        help="How long the master waits for a response before it asks again or gives up.",
    )  # fmt: skip
    retries: int = whole(
        0,
        10,
        default=1,
        label="retries",
        help="How many more times it asks a slave that is silent.",
    )
    limit: float = number(
        0.1, 60, default=2.0, unit="s", slider=(0.1, 10), step=0.1, label="longest scan",
        help="The limit that the scan is measured against.",
    )  # fmt: skip

    @property
    def poll(self) -> Poll:
        """The poll of one slave."""
        return Poll(
            Request.read_holding_registers(0, self.registers),
            SerialLine(self.bit_rate, self.character),
            processing=1e-3 * self.processing_ms,
            timeout=1e-3 * self.timeout_ms,
            retries=self.retries,
        )

    @property
    def scan(self) -> float:
        """How long the master takes to ask all slaves [s]."""
        return self.poll.scan_time(self.slaves, dead=self.dead)

    @property
    def max_slaves(self) -> int:
        """How many slaves fit into the limit, with as many dead."""
        return self.poll.max_slaves(self.limit, dead=self.dead)

    @cached_property
    def by_bit_rate(self) -> dict[int, float]:
        """Scan time by bit rate [s], without those at which a response exceeds the timeout."""
        by_bit_rate = {}
        for rate in BIT_RATES:
            try:
                by_bit_rate[rate] = replace(self, bit_rate=rate).scan
            except ArgumentError:
                continue
        return by_bit_rate

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the scan time at every bit rate, and the limit."""
        ax = style.axes(ax)
        rates, times = list(self.by_bit_rate), list(self.by_bit_rate.values())
        ax.plot(rates, times, "o-", color="C0", mfc="white", label="other bit rates")
        ax.plot(self.bit_rate, self.scan, "o", color="C0", ms=9, label="chosen")
        colour, dashes = style.LIMIT["color"], style.LIMIT["linestyle"]
        ax.axhline(self.limit, color=colour, linestyle=dashes, label=f"limit, {self.limit:g} s")
        ax.set(xscale="log", yscale="log", xlabel="bit rate [bit/s]", ylabel="scan time [s]")
        ax.set_xticks(BIT_RATES, [str(rate) for rate in BIT_RATES], fontsize="small")
        ax.set_xticks([], minor=True)
        ax.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        ax.yaxis.set_major_formatter("{x:g}")
        ax.yaxis.set_minor_formatter(NullFormatter())
        ax.set_xlim(0.85 * BIT_RATES[0], 1.2 * BIT_RATES[-1])
        ax.legend(loc="upper right")
        return ax

    def _view(self) -> View:
        """Return what the page shows."""
        poll, in_time = self.poll, self.scan <= self.limit
        used = poll.utilisation(self.slaves, self.limit, dead=self.dead)
        return View(
            verdict=f"{'in time' if in_time else 'too slow'}: {self.scan:.3f} s",
            ok=in_time,
            numbers={
                "one slave": f"{1e3 * poll.time:.1f} ms, of which {1e3 * poll.on_wire:.1f} ms "
                f"bytes and {2e3 * poll.line.t35:.1f} ms silence",
                "a dead slave costs": f"{1e3 * poll.timeout_time:.0f} ms",
                "scan with all alive": f"{poll.scan_time(self.slaves):.3f} s",
                "scan": f"{self.scan:.3f} s",
                "bus time": f"{used.bus_time:.1%}".replace("%", " %"),
                "capacity used": f"{used.capacity_used:.1%}".replace("%", " %"),
                "worst response": f"{used.worst_response:.3f} s",
                "slaves that fit": f"{self.max_slaves}",
            },
            plot=self.plot,
            height=3.0,
            about="Scan time over bit rate, both logarithmic, with the limit",
        )
