"""The ring explorer: store and extract bytes by hand, and watch the four variables."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property
from itertools import accumulate
from typing import Any, ClassVar

from matplotlib.axes import Axes

from shipnet.errors import ArgumentError
from shipnet.fields import check_choice, check_fields, choice, part, record
from shipnet.lazy import pd
from shipnet.remote_control.packet import MarkerFormat, MarkerParser
from shipnet.remote_control.ring_buffer import Ring, Rule, Step
from shipnet.tools._tool import Tool
from shipnet.tools._view import Button, Measure, View, words

_WORDS = words("ring_buffer")

#: Sizes to choose from; chung1998 uses 128.
SIZES = (8, 16, 32, 64, 128)

#: Rules to choose from, and the effect of each.
RULES: Mapping[Rule, str] = {
    "printed": "as printed: an empty ring is read",
    "intended": "as intended: an empty ring is not read",
    "corrected": "corrected: the count of bytes does not wrap",
}

#: The actions: the label and the effect of each button.
ACTIONS = {
    "byte": ("store a byte", "The interrupt stores the next byte of a packet."),
    "packet": ("store a packet", "The interrupt stores bytes up to the end of a packet."),
    "extract": ("extract a byte", "The task extracts one byte, if the rule allows it."),
    "empty": ("extract all", "The task extracts bytes until the rule stops it."),
    "repair": ("repair", "The task moves its pointer as the rule requires after an overrun."),
}

#: The four cases in words.
CASES = {
    "a": "same flags, no < get_no: the reader seems to have passed the writer",
    "b": "same flags, no >= get_no: in order, or empty",
    "c": "flags differ, no >= get_no: the writer seems to have passed the reader",
    "d": "flags differ, no < get_no: in order; the writer has wrapped around",
}

#: The format of a packet with one item, and its size [bytes].
_FORM = MarkerFormat(n_numbers=1)
_SIZE = _FORM.size(1)

#: Maximum number of actions; each picture repeats all of them.
_MOST_ACTIONS = 2000


@record
class ReceiveRing(Tool):
    """A receive ring that is filled and read by hand, step by step.

    `result` has the ring, a description of the last action (`report`), and the number of packets.

    Examples
    --------
    >>> ReceiveRing(16, "intended", ("packet", "extract")).verdict
    '0xCC extracted from 0'
    """

    #: The rules of the reader to choose from, and the effect of each.
    RULES: ClassVar[Mapping[Rule, str]] = RULES

    size: int = choice(SIZES, _WORDS["size"], default=16)
    rule: Rule = choice(RULES, _WORDS["rule"], default="printed")
    actions: tuple[str, ...] = part(tuple, _WORDS["actions"], default=())

    def __post_init__(self) -> None:
        check_fields(self)
        if len(self.actions) > _MOST_ACTIONS:
            number = len(self.actions)
            raise ArgumentError(f"there are {number} actions; the limit is {_MOST_ACTIONS}")
        for action in self.actions:
            check_choice("one of actions", action, ACTIONS)

    def then(self, action: str) -> ReceiveRing:
        """Return the ring after one more action, such as ``"byte"`` or ``"repair"``."""
        return replace(self, actions=(*self.actions, check_choice("action", action, ACTIONS)))

    @cached_property
    def result(self) -> Game:
        """The ring after all actions, starting with an empty ring."""
        return Game(self)

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the ring with its writer and its reader."""
        return self.result.ring.plot(ax)

    def _view(self) -> View:
        game, ring = self.result, self.result.ring
        overwritten = max(0, ring.unread - ring.size)
        wrong = ring.lost + ring.stale + overwritten
        read = set(self.actions) - {"byte", "packet"}
        return View(
            verdict=game.report,
            ok=not wrong,
            numbers={
                f"case {ring.case}": CASES[ring.case],
                "unread": f"{ring.unread} bytes, of which {overwritten} are overwritten; the "
                f"variables show {ring.seems_unread}",
                "lost": f"{ring.lost} bytes",
                "extracted in error": f"{ring.stale} bytes",
                "packets found": f"{game.packets}, of which {game.wrong} old or false; "
                f"{game.parser.discarded} bytes discarded",
            },
            plot=self.plot,
            height=4.2,
            about="The ring with its bytes, its writer and its reader",
            data=game.table,
            short="bytes lost or in error" if wrong else "no byte lost",
            measure=Measure("wrong_bytes", "bytes lost, overwritten or in error", wrong, 0),
            idle={} if read else {"rule": "nothing has been extracted yet"},
        )

    def _options(self) -> dict[str, Any]:
        def button(action: str) -> Button:
            return Button(*ACTIONS[action], lambda inputs: inputs.then(action))

        def keep(label: str, help: str, part: slice) -> Button:
            return Button(label, help, lambda one: replace(one, actions=one.actions[part]))

        undo = keep("undo", "Undoes the last action.", slice(-1))
        restart = keep("start again", "Empties the ring.", slice(0))
        return {"buttons": [*map(button, ACTIONS), undo, restart]}


class Game:
    """A ring with a writer and a reader of packets.

    `report` describes the last action, and `values` has the values of the packets that were read.
    """

    def __init__(self, inputs: ReceiveRing) -> None:
        self.ring = Ring(inputs.size, inputs.rule)
        self.parser: MarkerParser = _FORM.parser()
        self.report = "nothing done yet"
        self.values: list[int] = []
        rows = []
        for action in inputs.actions:
            getattr(self, f"_{action}")()
            counts = (self.ring.unread, self.ring.seems_unread, self.ring.lost, self.ring.stale)
            rows.append((action, self.report, self.ring.case, *counts, self.packets))
        self._rows = rows

    def table(self) -> pd.DataFrame:
        """Return one row per action: its effect, and the state of the ring after it."""
        columns = ["action", "effect", "case", "unread", "seems_unread", "lost", "in_error"]
        return pd.DataFrame(self._rows, columns=[*columns, "packets_found"])

    @property
    def packets(self) -> int:
        """Number of packets found."""
        return len(self.values)

    @property
    def wrong(self) -> int:
        """Number of packets that are not newer than one read before, or that were never sent."""
        sent = {_value(number) for number in range(self.ring.written // _SIZE)}
        due = accumulate((value + 1 for value in self.values), max, initial=0)
        pairs = zip(self.values, due, strict=False)
        return sum(value < least or value not in sent for value, least in pairs)

    def _byte(self) -> None:
        number, index = divmod(self.ring.written, _SIZE)
        byte = _FORM.encode({0: _value(number)})[index]
        where = self.ring.state.no
        self.ring.store(byte)
        self.report = f"byte {index + 1} of packet {number + 1}, 0x{byte:02X}, stored at {where}"

    def _packet(self) -> None:
        number, stored = divmod(self.ring.written, _SIZE)
        for _ in range(_SIZE - stored):
            self._byte()
        self.report = f"{_SIZE - stored} bytes stored, to the end of packet {number + 1}"

    def _extract(self) -> Step:
        where = self.ring.state.get_no
        step = self.ring.extract()
        if step.byte is not None:
            packets = self.parser.feed(bytes([step.byte]))
            self.values += [items[0][1] if items else 0 for items in packets]
            error = ", in error" if step.stale else ""
            lost = f", {step.lost} bytes lost unnoticed" if step.lost else ""
            self.report = f"0x{step.byte:02X} extracted from {where}{error}{lost}"
        elif step.action == "repair":
            moved = f"reader moved from {where} to {self.ring.state.get_no}"
            self.report = f"repaired: {moved}, {step.lost} bytes lost"
        elif step.action == "wait":
            self.report = "the ring appears to be empty: the reader waits"
        else:
            self.report = "case a: the reader stops receiving and starts sending"
        return step

    def _empty(self) -> None:
        # Reading an empty ring may never end, so stop after two laps.
        for taken in range(2 * self.ring.size):
            if self._extract().action in ("wait", "stop"):
                self.report = f"{taken} steps, then: {self.report}"
                return
        self.report = f"stopped after {2 * self.ring.size} steps, because reading would never end"

    def _repair(self) -> None:
        if self.ring.copy().extract().action == "repair":
            self._extract()
        else:
            self.report = "with the chosen rule there is nothing to repair"


def _value(number: int) -> int:
    # Values increase, and neither byte of a value is a marker or 0.
    return (number // 200 + 1) << 8 | number % 200 + 1
