"""The CAN explorer: a message set as text, a bit rate, its load and its response times."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from matplotlib.axes import Axes

from shipnet.can.schedule import (
    BIT_RATES,
    ErrorModel,
    MessageSet,
    bus_load,
    lowest_bit_rate,
    parse_messages,
    response_table,
    response_times,
)
from shipnet.can.schedule.lengths import Lengths
from shipnet.can.schedule.plot import plot_response_times
from shipnet.fields import choice, record, text, whole
from shipnet.tools._page import Page, Upload
from shipnet.tools._state import decode_text
from shipnet.tools._view import View

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["EXAMPLE", "Inputs", "Result", "draw", "explorer", "update", "view"]

#: An example to begin with: synthetic, the messages of an engine's junction boxes and controls.
EXAMPLE = """name,arbitration_id,dlc,period_ms,deadline_ms,sender
shutdown,0x010,1,50,5,safety
speed,0x020,4,10,5,governor
fuel index,0x030,4,10,10,governor
load limit,0x040,2,20,20,governor
alarm,0x080,8,100,50,JB1
lube oil,0x100,8,200,200,JB1
cooling water,0x101,8,200,200,JB1
exhaust 1-4,0x200,8,500,500,JB2
exhaust 5-8,0x201,8,500,500,JB2
bearings,0x300,8,1000,1000,JB3
"""


@record
class Inputs:
    """What the widgets say."""

    text: str = text(
        default=EXAMPLE, most=200_000, rows=12, label="message set",
        help="One message a line: name, arbitration_id, dlc and period_ms; more columns are free. "
        "It is read when you leave the editor.",
    )  # fmt: skip
    bit_rate: int = choice(
        {rate: f"{rate / 1e3:g}" for rate in BIT_RATES},
        default=125_000, slider=True, unit="kbit/s",
        label="bit rate", help="Standard bit rates; a longer bus needs a lower one.",
    )  # fmt: skip
    errors_per_s: int = whole(
        0, 1000, default=0, slider=(0, 100), unit="1/s", label="errors",
        help="Errors on the bus, evenly spread; each costs an error frame and a repetition.",
    )  # fmt: skip


@dataclass(frozen=True, eq=False, slots=True)
class Result:
    """What becomes of the messages.

    Attributes
    ----------
    messages : MessageSet
        The messages, the highest priority first.
    load : dict of str to float
        Share of the bus, 0..: without stuff bits, with those of random data, with the most.
    responses : pandas.DataFrame
        What `response_table` returns.
    lowest : float
        Lowest standard bit rate at which all deadlines are met [bit/s]; inf if none is.
    """

    messages: MessageSet
    load: dict[str, float]
    responses: pd.DataFrame
    lowest: float

    @property
    def late(self) -> list[str]:
        """Messages that may miss their deadlines."""
        return [str(name) for name in self.responses.loc[~self.responses["met"], "name"]]

    @property
    def verdict(self) -> str:
        """One line: whether all deadlines are met."""
        if not self.late:
            return f"all {len(self.responses)} messages meet their deadlines"
        return f"{len(self.late)} of {len(self.responses)} may be late: {', '.join(self.late)}"

    @property
    def numbers(self) -> dict[str, str]:
        """Loads and the lowest bit rate as text with units."""
        load = {f"load, {name}": f"{share:.1%}" for name, share in self.load.items()}
        rate = "none" if self.lowest == float("inf") else f"{self.lowest / 1e3:g} kbit/s"
        return {**load, "lowest standard bit rate that works": rate}


def update(inputs: Inputs) -> Result:
    """Compute load and response times of the messages.

    Parameters
    ----------
    inputs : Inputs
        What the widgets say.

    Returns
    -------
    Result
        Messages, loads and response times.

    Raises
    ------
    InputError
        If the text is no message set.

    Examples
    --------
    >>> update(Inputs()).verdict
    'all 10 messages meet their deadlines'
    >>> update(Inputs(bit_rate=50_000)).late
    ['speed']
    """
    messages = parse_messages(inputs.text)
    errors = ErrorModel()
    if inputs.errors_per_s:
        errors = ErrorModel(burst=1, interval=1 / inputs.errors_per_s)
    counted: dict[str, Lengths] = {
        "no stuff bits": "nominal", "random data": "mean", "most stuff bits": "worst",
    }  # fmt: skip
    return Result(
        messages,
        {
            name: float(bus_load(messages, inputs.bit_rate, lengths).sum())
            for name, lengths in counted.items()
        },
        response_table(response_times(messages, inputs.bit_rate, errors=errors)),
        lowest_bit_rate(messages, BIT_RATES, errors=errors),
    )


def draw(result: Result, *, ax: Axes) -> Axes:
    """Draw the longest response of each message against its deadline.

    Parameters
    ----------
    result : Result
        What `update` returned.
    ax : matplotlib.axes.Axes
        Where to draw.

    Returns
    -------
    matplotlib.axes.Axes
        The axes given, the highest priority on top.

    Examples
    --------
    >>> from matplotlib.figure import Figure
    >>> ax = draw(update(Inputs()), ax=Figure().subplots())
    >>> ax.get_xlabel()
    'time [ms]'
    """
    return plot_response_times(result.responses, ax=ax)


def view(result: Result) -> View:
    """Return what the page shows of a result.

    Parameters
    ----------
    result : Result
        What `update` returned.

    Returns
    -------
    View
        Verdict, numbers and figure.

    Examples
    --------
    >>> view(update(Inputs())).good
    True
    """
    return View(
        text=result.verdict,
        good=not result.late,
        numbers=result.numbers,
        draw=lambda ax: draw(result, ax=ax),
        height=1.2 + 0.28 * len(result.responses),
        about="Longest response time of each message, as a bar, against its deadline",
    )


def explorer() -> Page:
    """Return the page: an editor and an upload for messages, a bit rate, and the response times.

    Returns
    -------
    Page
        To be shown as the last value of a notebook's cell.

    Examples
    --------
    >>> "meet their deadlines" in explorer().text
    True
    """

    def take(inputs: Inputs, name: str, content: bytes) -> Inputs:
        return replace(inputs, text=decode_text(name, content))

    own = Upload("load a message set", "A CSV file; it replaces the text above.", ".csv,.txt", take)
    return Page("can_load", Inputs(), lambda inputs: view(update(inputs)), uploads=[own])
