"""The ring explorer: store and extract bytes by hand, and watch the four variables."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property
from itertools import accumulate
from types import MappingProxyType
from typing import Any, ClassVar

from matplotlib.axes import Axes

from shipnet.errors import ArgumentError
from shipnet.fields import check_choice, check_fields, choice, part, record
from shipnet.remote_control.packet import MarkerFormat, MarkerParser
from shipnet.remote_control.ring_buffer import Ring, Rule, Step
from shipnet.tools._tool import Tool
from shipnet.tools._view import Button, View

#: Sizes to choose from; chung1998 uses 128.
SIZES = (8, 16, 32, 64, 128)

#: Rules to choose from, and the effect of each.
RULES: MappingProxyType[Rule, str] = MappingProxyType(
    {
        "printed": "as printed: an empty ring is read",
        "intended": "as intended: an empty ring is not read",
        "corrected": "corrected: the count of bytes does not wrap",
    }
)

#: The actions: the label and the effect of each button.
ACTIONS = MappingProxyType(
    {
        "byte": ("store a byte", "The interrupt stores the next byte of a packet."),
        "packet": ("store a packet", "The interrupt stores bytes up to the end of a packet."),
        "extract": ("extract a byte", "The task extracts one byte, if the rule allows it."),
        "empty": ("extract all", "The task extracts bytes until the rule stops it."),
        "repair": ("repair", "The task moves its pointer as the rule requires after an overrun."),
    }
)

#: The four cases in words.
CASES = MappingProxyType(
    {
        "a": "same flags, no < get_no: the reader seems to have passed the writer",
        "b": "same flags, no >= get_no: in order, or empty",
        "c": "flags differ, no >= get_no: the writer seems to have passed the reader",
        "d": "flags differ, no < get_no: in order; the writer has wrapped around",
    }
)

#: Number of items in a packet, and its format.
_ITEMS = 1
_FORM = MarkerFormat(n_numbers=_ITEMS)

#: Maximum number of actions; each picture repeats all of them.
_MOST_ACTIONS = 2000


@record
class ReceiveRing(Tool):
    """A receive ring that is filled and read by hand, step by step.

    `result` has the ring, a description of the last action (`said`), and the number of packets.

    Examples
    --------
    >>> ReceiveRing(16, "intended", ("packet", "extract")).verdict
    '0xCC extracted from 0'
    """

    #: The rules of the reader to choose from, and the effect of each.
    RULES: ClassVar[Mapping[Rule, str]] = RULES

    size: int = choice(
        SIZES, default=16, label="places", help="Size of the ring; the paper uses 128."
    )
    rule: Rule = choice(
        RULES, default="printed", label="reader", help="The rule that the reader follows."
    )
    actions: tuple[str, ...] = part(
        tuple, "The actions so far, starting with an empty ring.", default=(), label="actions"
    )

    def __post_init__(self) -> None:
        check_fields(self)
        if len(self.actions) > _MOST_ACTIONS:
            raise ArgumentError(
                f"there are {len(self.actions)} actions; the limit is {_MOST_ACTIONS}"
            )
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
        return View(
            verdict=game.said,
            ok=not (ring.lost or ring.stale or overwritten),
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
        )

    def _options(self) -> dict[str, Any]:
        def does(action: str) -> Button:
            return Button(*ACTIONS[action], lambda inputs: inputs.then(action))

        def back(inputs: ReceiveRing) -> ReceiveRing:
            return replace(inputs, actions=inputs.actions[:-1])

        def restart(inputs: ReceiveRing) -> ReceiveRing:
            return replace(inputs, actions=())

        buttons = [
            *map(does, ACTIONS),
            Button("undo", "Undoes the last action.", back),
            Button("start again", "Empties the ring.", restart),
        ]
        return {"buttons": buttons}


class Game:
    """A ring with a writer and a reader of packets.

    `said` describes the last action, and `found` has the values of the packets that were read.
    """

    def __init__(self, inputs: ReceiveRing) -> None:
        self.ring = Ring(inputs.size, inputs.rule)
        self.parser: MarkerParser = _FORM.parser()
        self.said = "nothing done yet"
        self.found: list[int] = []
        for action in inputs.actions:
            getattr(self, f"_{action}")()

    @property
    def packets(self) -> int:
        """Number of packets found."""
        return len(self.found)

    @property
    def wrong(self) -> int:
        """Number of packets that are not newer than one read before, or that were never sent."""
        sent = {_value(number) for number in range(self.ring.written // _FORM.size(_ITEMS))}
        due = accumulate((value + 1 for value in self.found), max, initial=0)
        pairs = zip(self.found, due, strict=False)
        return sum(value < least or value not in sent for value, least in pairs)

    def _byte(self) -> None:
        size = _FORM.size(_ITEMS)
        number, place = divmod(self.ring.written, size)
        byte = _FORM.encode({0: _value(number)})[place]
        where = self.ring.state.no
        self.ring.store(byte)
        self.said = f"byte {place + 1} of packet {number + 1}, 0x{byte:02X}, stored at {where}"

    def _packet(self) -> None:
        size = _FORM.size(_ITEMS)
        first = self.ring.written
        for _ in range(size - first % size):
            self._byte()
        self.said = (
            f"{self.ring.written - first} bytes stored, to the end of packet {first // size + 1}"
        )

    def _extract(self) -> Step:
        where = self.ring.state.get_no
        step = self.ring.extract()
        if step.byte is not None:
            packets = self.parser.feed(bytes([step.byte]))
            self.found += [items[0][1] if items else 0 for items in packets]
        self.said = _in_words(step, where, self.ring)
        return step

    def _empty(self) -> None:
        # Reading an empty ring may never end, so stop after two laps.
        for taken in range(2 * self.ring.size):
            if self._extract().action in ("wait", "stop"):
                self.said = f"{taken} steps, then: {self.said}"
                return
        self.said = f"stopped after {2 * self.ring.size} steps, because reading would never end"

    def _repair(self) -> None:
        trial = self.ring.copy().extract()
        if trial.action == "repair":
            self._extract()
        else:
            self.said = "with the chosen rule there is nothing to repair"


def _value(number: int) -> int:
    # Values increase, and neither byte of a value is a marker or 0.
    return (number // 200 + 1) << 8 | number % 200 + 1


def _in_words(step: Step, where: int, ring: Ring) -> str:
    if step.action == "wait":
        return "the ring appears to be empty: the reader waits"
    if step.action == "stop":
        return "case a: the reader stops receiving and starts sending"
    if step.action == "repair":
        return f"repaired: reader moved from {where} to {ring.state.get_no}, {step.lost} bytes lost"
    what = ", in error" if step.stale else ""
    skipped = f", {step.lost} bytes lost unnoticed" if step.lost else ""
    return f"0x{step.byte:02X} extracted from {where}{what}{skipped}"
