"""The CAN explorer: the load and the response times of a message set at a bit rate."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from math import inf
from pathlib import Path
from typing import Any

from shipnet.can.analysis import read_messages
from shipnet.can.faults import ErrorBound
from shipnet.can.lengths import Stuffing
from shipnet.can.log_files import log_kind
from shipnet.can.messages import BIT_RATES, EXAMPLE, MessageSet, bus_load
from shipnet.can.offsets import spread_offsets
from shipnet.can.response import ResponseTimes, response_times
from shipnet.errors import ArgumentError, InputError
from shipnet.fields import choice, record, text, whole
from shipnet.files import as_file
from shipnet.tables import text_of
from shipnet.tools._tool import Tool
from shipnet.tools._view import Measure, Upload, View, words

_WORDS = words("can_load")

#: Suffixes of the files that can be loaded.
_SUFFIXES = (".csv", ".txt", ".xlsx", ".dbc", ".log", ".asc", ".blf", ".trc")

#: Bit rates to choose from, with their text in kbit/s.
_RATES = {rate: f"{rate / 1e3:g}" for rate in BIT_RATES}


@record
class CanLoad(Tool):
    """Load and response times of a CAN message set at a bit rate.

    `result` is the analysis, a `can.ResponseTimes`; `messages`, `load` and `lowest` are the message
    set, its bus load, and the lowest standard bit rate that meets all deadlines.

    Raises
    ------
    ArgumentError
        If a value is out of its range. Raised by `result` if offsets are combined with errors.
    InputError
        Raised by `messages` if the text is not a message set.

    Examples
    --------
    >>> CanLoad().verdict
    'all 10 messages meet their deadlines'
    >>> CanLoad(bit_rate=50_000).result.late
    ['speed']
    >>> [CanLoad(offsets=way).result["bearings"].response for way in ("not counted", "spread")]
    [0.00912, 0.00512]
    """

    text: str = text(_WORDS["text"], default=EXAMPLE, most=200_000, rows=12)
    bit_rate: int = choice(_RATES, _WORDS["bit_rate"], default=125_000, slider=True, unit="kbit/s")
    errors_per_s: int = whole(0, 1000, "1/s", _WORDS["errors_per_s"], (0, 100), default=0)
    offsets: str = choice(
        ("not counted", "as listed", "spread"), _WORDS["offsets"], default="not counted"
    )

    @cached_property
    def messages(self) -> MessageSet:
        """The messages of the text, with spread offsets if chosen."""
        messages = MessageSet.parse(self.text)
        return spread_offsets(messages) if self.offsets == "spread" else messages

    def _times(self, bit_rate: int) -> ResponseTimes:
        counted = self.offsets != "not counted"
        if counted and self.errors_per_s:
            raise ArgumentError(
                f"offsets are {self.offsets!r} and errors_per_s is {self.errors_per_s}; "
                "errors_per_s must be 0 if offsets are used"
            )
        faults = ErrorBound(interval=1 / self.errors_per_s) if self.errors_per_s else None
        return response_times(self.messages, bit_rate, faults=faults, offsets=counted)

    @cached_property
    def result(self) -> ResponseTimes:
        """The response times of the messages."""
        return self._times(self.bit_rate)

    @property
    def load(self) -> dict[str, float]:
        """Bus load, as a fraction, for each way of counting stuff bits."""
        counted: dict[str, Stuffing] = {
            "no stuff bits": "none",
            "random data": "mean",
            "most stuff bits": "worst",
        }
        return {name: bus_load(self.messages, self.bit_rate, way) for name, way in counted.items()}

    @cached_property
    def lowest(self) -> float:
        """The lowest standard bit rate that meets all deadlines [bit/s]; inf if there is none."""
        return next((rate for rate in BIT_RATES if self._times(rate).met), inf)

    def _view(self) -> View:
        late, n = self.result.late, len(self.result)
        load = {f"load, {name}": f"{share:.1%}" for name, share in self.load.items()}
        remarks = self.messages.remarks
        read = {"how the list was read": "; ".join(remarks)} if remarks else {}
        rate = "none" if self.lowest == inf else f"{self.lowest / 1e3:g} kbit/s"
        counted = self.offsets != "not counted"
        given = sum(message.offset > 0 for message in self.messages)
        offsets = {"offsets": f"{given} of {n} messages have one"} if counted else {}
        used = max((one.response / one.message.deadline for one in self.result), default=0.0)
        return View(
            verdict=f"{len(late)} of {n} may be late: {', '.join(late)}"
            if late
            else f"all {n} messages meet their deadlines",
            ok=not late,
            numbers={
                **load,
                **offsets,
                **read,
                "lowest standard bit rate that meets all deadlines": rate,
            },
            plot=self.plot,
            height=1.2 + 0.28 * n,
            about="Longest response time of each message, as a bar, and its deadline",
            files={"messages.csv": self.messages.text} if self.offsets == "spread" else {},
            curve=lambda: self.result.table()["response_ms"],
            data=self.result.table,
            short="late" if late else "in time",
            measure=Measure("used_percent", "longest response / deadline [%]", 100 * used, 100),
            idle={"errors_per_s": "errors are 0 while offsets are counted"} if counted else {},
            uses={"ship_design": {"own": f"[can]\nbit_rates = [{self.bit_rate}]\n"}},
        )

    def _options(self) -> dict[str, Any]:
        tip = "A list, a DBC file or a log, to replace the text above; remarks on it are on top."
        upload = Upload("load a message set", tip, ",".join(_SUFFIXES), _from_file)
        return {"uploads": [upload], "folds": {"message set": ("text",)}}


def _from_file(inputs: CanLoad, name: str, content: bytes) -> CanLoad:
    """Return the inputs with the messages of a file; a list in text stays as it is written."""
    suffix = Path(name).suffix.lower()
    with as_file(name, content, f"file{suffix if suffix in _SUFFIXES else '.txt'}") as path:
        if suffix not in (".dbc", ".xlsx") and not log_kind(path):
            text = text_of(content)
            if "\0" in text:
                raise InputError(name, "this is not a text file")
            return replace(inputs, text=text)
        messages = read_messages(path, strict=False)
    remarks = list(messages.overlooked)
    if messages.observed is not None:
        kinds = messages.observed["kind"].value_counts()
        counted = ", ".join(f"{number} {kind}" for kind, number in kinds.items())
        remarks.append(f"from a log: {counted}; if not periodic, the period is the mean")
    return replace(inputs, text="".join(f"# {one}\n" for one in remarks) + messages.text)
