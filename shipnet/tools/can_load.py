"""The CAN explorer: a message set as text, a bit rate, its load and its response times."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from math import inf
from typing import Any

from matplotlib.axes import Axes

from shipnet import style
from shipnet.can.faults import ErrorBound
from shipnet.can.lengths import Stuffing
from shipnet.can.messages import BIT_RATES, EXAMPLE, MessageSet, bus_load, parse_dbc
from shipnet.can.response import ResponseTimes, lowest_bit_rate, response_times
from shipnet.errors import InputError
from shipnet.fields import choice, record, text, whole
from shipnet.tables import text_of
from shipnet.tools._tool import Tool
from shipnet.tools._view import Upload, View


@record
class CanLoad(Tool):
    """Load and response times of a CAN message set at a bit rate.

    `result` has the messages, their loads, their response times and the lowest bit rate.

    Raises
    ------
    ArgumentError
        If a value is out of its range.
    InputError
        From `result`, if the text is not a message set.

    Examples
    --------
    >>> CanLoad().verdict
    'all 10 messages meet their deadlines'
    >>> CanLoad(bit_rate=50_000).result.late
    ['speed']
    """

    text: str = text(
        default=EXAMPLE, most=200_000, rows=12, label="message set",
        help="One message per line: name, arbitration_id, dlc, period_ms; others are optional. "
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

    @cached_property
    def result(self) -> Result:
        """Compute load and response times of the messages."""
        messages = MessageSet.parse(self.text)
        faults = [ErrorBound(interval=1 / self.errors_per_s)] if self.errors_per_s else []
        counted: dict[str, Stuffing] = {
            "no stuff bits": "none", "random data": "mean", "most stuff bits": "worst",
        }  # fmt: skip
        return Result(
            messages,
            {name: bus_load(messages, self.bit_rate, way) for name, way in counted.items()},
            response_times(messages, self.bit_rate, faults=faults),
            lowest_bit_rate(messages, faults=faults),
        )

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the longest response of each message against its deadline."""
        result, ax = self.result, style.axes(ax)
        return result.responses.plot(ax)

    def _view(self) -> View:
        """Return what the page shows."""
        result = self.result
        return View(
            verdict=result.verdict,
            ok=not result.late,
            numbers=result.numbers,
            plot=self.plot,
            height=1.2 + 0.28 * len(result.responses),
            about="Longest response time of each message, as a bar, against its deadline",
        )

    def _options(self) -> dict[str, Any]:
        """Return what the page has beside controls and figure."""

        def take(inputs: CanLoad, name: str, content: bytes) -> CanLoad:
            given = text_of(content)
            if "\0" in given:
                raise InputError(name, "this is not a text file")
            dbc = name.lower().endswith(".dbc")
            if dbc:
                messages = parse_dbc(given, name, strict=False)
                given = "".join(f"# {fault}\n" for fault in messages.overlooked) + messages.text
            return replace(inputs, text=given)

        tip = "A CSV or DBC file; it replaces the text above, with faults of a DBC file on top."
        own = Upload("load a message set", tip, ".csv,.txt,.dbc", take)
        return {"uploads": [own]}


@dataclass(frozen=True, eq=False, slots=True)
class Result:
    """What becomes of the messages: loads, responses, and the lowest bit rate [bit/s]."""

    messages: MessageSet
    load: dict[str, float]
    responses: ResponseTimes
    lowest: float

    @property
    def late(self) -> list[str]:
        """Messages that may miss their deadlines."""
        return self.responses.late

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
        rate = "none" if self.lowest == inf else f"{self.lowest / 1e3:g} kbit/s"
        return {**load, "lowest standard bit rate that works": rate}
