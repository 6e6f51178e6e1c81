"""The scan explorer: how long a Modbus master takes to ask all its slaves, against a limit."""

from __future__ import annotations

from dataclasses import dataclass, replace

import ipywidgets as widgets
from matplotlib.axes import Axes

from shipnet import style
from shipnet.errors import ArgumentError, check_whole
from shipnet.line.quantity import check_scalar
from shipnet.modbus.codes import FunctionCode
from shipnet.modbus.frame import LAST_UNIT
from shipnet.modbus.request import ReadRequest
from shipnet.modbus.timing import Poll, Serial
from shipnet.tools._view import BAD, GOOD, Board, follow

__all__ = ["BIT_RATES", "CHARACTERS", "Inputs", "Result", "draw", "explorer", "update"]

#: Bit rates to choose from [bit/s].
BIT_RATES = (1200, 2400, 4800, 9600, 19200, 38400, 57600, 115200)

#: Characters to choose from: those of the standard, and what many devices are set to.
CHARACTERS = ("8E1", "8O1", "8N2", "8N1")


@dataclass(frozen=True, slots=True)
class Inputs:
    """What the sliders say.

    Parameters
    ----------
    bit_rate : int, default 9600
        One of `BIT_RATES` [bit/s].
    character : str, default "8E1"
        One of `CHARACTERS`.
    slaves : int, default 31
        Slaves, 1..247.
    registers : int, default 10
        Holding registers read of each, 1..125.
    processing_ms : float, default 5
        How long a slave works on a request, on top of the silence [ms], 0..500.
    dead : int, default 0
        Slaves that do not answer, 0 up to all.
    timeout_ms : float, default 500
        How long the master waits for a response [ms], 10..5000.
    retries : int, default 1
        How many more times it asks a slave that does not answer, 0..10.
    limit : float, default 2
        Longest scan that is allowed [s], 0.1..60.

    Raises
    ------
    ArgumentError
        If a value is outside its range.
    """

    bit_rate: int = 9600
    character: str = "8E1"
    slaves: int = 31
    registers: int = 10
    processing_ms: float = 5.0
    dead: int = 0
    timeout_ms: float = 500.0
    retries: int = 1
    limit: float = 2.0

    def __post_init__(self) -> None:
        """Check the ranges."""
        for name, known in (("bit_rate", BIT_RATES), ("character", CHARACTERS)):
            if getattr(self, name) not in known:
                raise ArgumentError(f"{name} is {getattr(self, name)!r}; it must be one of {known}")
        check_whole("slaves", self.slaves, 1, LAST_UNIT)
        check_whole("registers", self.registers, 1, 125)
        check_whole("dead", self.dead, 0, self.slaves)
        check_whole("retries", self.retries, 0, 10)
        for name, unit, low, high in [
            ("processing_ms", "ms", 0, 500),
            ("timeout_ms", "ms", 10, 5000),
            ("limit", "s", 0.1, 60),
        ]:
            check_scalar(name, getattr(self, name), unit, low, high)

    @property
    def poll(self) -> Poll:
        """The poll of one slave."""
        return Poll.of(
            ReadRequest(FunctionCode.READ_HOLDING_REGISTERS, 0, self.registers),
            Serial(self.bit_rate, self.character),
            processing=1e-3 * self.processing_ms,
            timeout=1e-3 * self.timeout_ms,
            retries=self.retries,
        )


@dataclass(frozen=True, slots=True)
class Result:
    """What becomes of the scan.

    Attributes
    ----------
    inputs : Inputs
        What was asked.
    poll : Poll
        The poll of one slave.
    healthy, scan : float
        Scan with all slaves alive, and with the dead ones among them [s].
    most_slaves : int
        Slaves, the dead ones included, that a scan within the limit can have.
    by_bit_rate : dict of int to float
        Scan time [s] at every bit rate at which the timeout is long enough for the response.
    """

    inputs: Inputs
    poll: Poll
    healthy: float
    scan: float
    most_slaves: int
    by_bit_rate: dict[int, float]

    @property
    def in_time(self) -> bool:
        """Whether the scan keeps the limit."""
        return self.scan <= self.inputs.limit

    @property
    def numbers(self) -> dict[str, str]:
        """Times and counts as text with units."""
        serial = self.poll.serial
        on_line = serial.frame_time(self.poll.request_size) + serial.frame_time(
            self.poll.response_size
        )
        return {
            "one slave": f"{1e3 * self.poll.answered:.1f} ms, of which "
            f"{1e3 * on_line:.1f} ms bytes and {2e3 * serial.t35:.1f} ms silence",
            "a dead slave costs": f"{1e3 * self.poll.given_up:.0f} ms",
            "scan with all alive": f"{self.healthy:.3f} s",
            "scan": f"{self.scan:.3f} s",
            "slaves that fit": f"{self.most_slaves}",
        }


def update(inputs: Inputs) -> Result:
    """Compute the scan.

    Parameters
    ----------
    inputs : Inputs
        What the sliders say.

    Returns
    -------
    Result
        Times of the poll and the scan.

    Raises
    ------
    ArgumentError
        If the timeout is shorter than the slave takes for its whole response.

    Examples
    --------
    >>> result = update(Inputs())
    >>> round(result.scan, 3), result.in_time, result.most_slaves
    (1.576, True, 39)
    >>> update(Inputs(dead=1)).in_time
    False
    """
    poll = inputs.poll
    by_bit_rate = {}
    for rate in BIT_RATES:
        try:
            other = replace(inputs, bit_rate=rate).poll
        except ArgumentError:
            continue
        by_bit_rate[rate] = other.scan(inputs.slaves, dead=inputs.dead)
    return Result(
        inputs,
        poll,
        poll.scan(inputs.slaves),
        poll.scan(inputs.slaves, dead=inputs.dead),
        poll.most_slaves(inputs.limit, dead=inputs.dead),
        by_bit_rate,
    )


def draw(result: Result, *, ax: Axes) -> Axes:
    """Draw the scan time at every bit rate, and the limit.

    Parameters
    ----------
    result : Result
        What `update` returned.
    ax : matplotlib.axes.Axes
        Where to draw.

    Returns
    -------
    matplotlib.axes.Axes
        The axes given; both scales are logarithmic.

    Examples
    --------
    >>> from matplotlib.figure import Figure
    >>> ax = draw(update(Inputs()), ax=Figure().subplots())
    >>> ax.get_ylabel()
    'scan time [s]'
    """
    inputs = result.inputs
    rates, times = list(result.by_bit_rate), list(result.by_bit_rate.values())
    ax.plot(rates, times, "o-", color="C0", mfc="white", label="other bit rates")
    ax.plot(inputs.bit_rate, result.scan, "o", color="C0", ms=9, label="chosen")
    colour, dashes = style.LIMIT["color"], style.LIMIT["linestyle"]
    ax.axhline(inputs.limit, color=colour, linestyle=dashes, label=f"limit, {inputs.limit:g} s")
    ax.set(xscale="log", yscale="log", xlabel="bit rate [bit/s]", ylabel="scan time [s]")
    ax.set_xticks(BIT_RATES, [str(rate) for rate in BIT_RATES], fontsize="small")
    ax.set_xticks([], minor=True)
    ax.yaxis.set_major_formatter("{x:g}")
    ax.yaxis.set_minor_formatter("{x:g}")
    ax.set_xlim(0.85 * BIT_RATES[0], 1.2 * BIT_RATES[-1])
    ax.legend(loc="upper right")
    return ax


def explorer() -> widgets.VBox:
    """Return the sliders with the scan that follows them.

    Returns
    -------
    ipywidgets.VBox
        To be shown as the last value of a notebook's cell.

    Examples
    --------
    >>> sliders, verdict, image = explorer().children
    >>> "in time" in verdict.value
    True
    """
    wide = {"style": {"description_width": "11em"}, "layout": {"width": "30em"}}
    start = Inputs()

    def whole(name: str, low: int, high: int, text: str) -> widgets.IntSlider:
        return widgets.IntSlider(getattr(start, name), min=low, max=high, description=text, **wide)

    def number(name: str, low: float, high: float, step: float, text: str) -> widgets.FloatSlider:
        return widgets.FloatSlider(
            getattr(start, name), min=low, max=high, step=step, description=text, **wide
        )

    controls = {
        "bit_rate": widgets.Dropdown(
            options=BIT_RATES, value=start.bit_rate, description="bit rate [bit/s]", **wide
        ),
        "character": widgets.Dropdown(options=CHARACTERS, description="character", **wide),
        "slaves": whole("slaves", 1, LAST_UNIT, "slaves"),
        "registers": whole("registers", 1, 125, "registers of each"),
        "processing_ms": number("processing_ms", 0, 100, 1, "a slave works [ms]"),
        "dead": whole("dead", 0, LAST_UNIT, "dead slaves"),
        "timeout_ms": number("timeout_ms", 10, 3000, 10, "response timeout [ms]"),
        "retries": whole("retries", 0, 10, "retries"),
        "limit": number("limit", 0.1, 10, 0.1, "longest scan [s]"),
    }
    board = Board()

    def show() -> None:
        try:
            values = {name: control.value for name, control in controls.items()}
            result = update(Inputs(**{**values, "dead": min(values["dead"], values["slaves"])}))
        except ArgumentError as error:
            board.say(str(error), BAD)
            return
        said = f"{'in time' if result.in_time else 'too slow'}: {result.scan:.3f} s"
        colour = GOOD if result.in_time else BAD
        board.show(said, colour, result.numbers, lambda ax: draw(result, ax=ax), 3.0)

    follow(show, controls.values())
    rows = list(controls.values())
    columns = widgets.HBox([widgets.VBox(rows[:5]), widgets.VBox(rows[5:])])
    return widgets.VBox([columns, *board.parts])
