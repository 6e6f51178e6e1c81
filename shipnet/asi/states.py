"""States of a master and its slaves while they exchange telegrams, step by step."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import KW_ONLY
from enum import Enum
from functools import cached_property
from itertools import islice
from types import SimpleNamespace
from typing import Any, NamedTuple

from shipnet import style
from shipnet.asi.master import FAULTY, SILENT, Master, RunningMaster
from shipnet.asi.slave import Event, RunningSlave, Slave, State
from shipnet.asi.telegram import Request, Response
from shipnet.asi.timing import Transaction
from shipnet.errors import ArgumentError
from shipnet.fields import check_choice, check_fields, check_kind, check_whole, part, record, whole
from shipnet.lazy import Axes, pd


class Turn(Enum):
    """The states of a master in an exchange."""

    SEND = "send"
    WAIT = "wait"
    REPEAT = "repeat"


#: Time that a master waits for a response [bit].
_TIMEOUT = Transaction().timeout

#: Half the width of a state, and the distances between states and between the two machines.
_HALF, _DOWN, _APART = 1.7, 2.4, 7.2

#: The events that bring a master from one state to the next, from icn2007, data link layer,
#: sections 1 to 3.
TURNS = {
    (Turn.SEND, Turn.WAIT): ["request"],
    (Turn.WAIT, Turn.SEND): ["valid response,", "or no try left"],
    (Turn.WAIT, Turn.REPEAT): [f"{_TIMEOUT:g} bit times of", "silence, or error"],
    (Turn.REPEAT, Turn.WAIT): ["request", "again"],
}

#: The events that bring a slave from one state to the next, in short; see `TRANSITIONS`.
CHANGES = {
    (State.ASYNCHRONOUS, State.RECEIVE): ["any pause"],
    (State.RECEIVE, State.ASYNCHRONOUS): ["error in the telegram"],
    (State.RECEIVE, State.SYNCHRONOUS): ["request without error;", "answer if it is its own"],
    (State.SYNCHRONOUS, State.RECEIVE): ["pause after the response"],
}


class Step(NamedTuple):
    """A telegram, or the silence in place of a response, and the states after it."""

    sender: str
    telegram: str
    meaning: str
    master: Turn
    slaves: Mapping[str, State]


@record
class ExchangeStates:
    """The states of a master and its slaves after each telegram, from power-on.

    At power-on every slave is asynchronous. The master already knows the slaves: in each cycle it
    polls them, reads the status of one, and looks for a new one. Silence cannot be damaged.

    Examples
    --------
    >>> states = ExchangeStates([Slave("1"), Slave("2")], damaged=[5])
    >>> states.table()[["telegram", "master", "slave 1", "slave 2"]].head(4)
             telegram  master       slave 1       slave 2
    0  00000010111111    wait  asynchronous  asynchronous
    1                  repeat       receive       receive
    2  00000010111111    wait   synchronous   synchronous
    3         0000001    send       receive       receive
    """

    slaves: Sequence[Slave] = part(Sequence, "Slaves of the line, with different addresses")
    _: KW_ONLY
    damaged: Sequence[int] = part(
        Sequence, "Numbers of the steps in which a bit of the telegram is inverted", default=()
    )
    steps: int = whole(1, 1000, help="Number of steps", default=20)

    def __post_init__(self) -> None:
        check_fields(self)
        for slave in self.slaves:
            check_kind("a slave", slave, Slave)
        taken = [(one.address, half) for one in self.slaves for half in one.half or "AB"]
        if not taken or len({*taken}) < len(taken):
            labels = [slave.label for slave in self.slaves]
            raise ArgumentError(f"slaves are {labels}; give at least one, and no address twice")
        for number in self.damaged:
            check_whole("a step in damaged", number, 0, self.steps - 1)

    @cached_property
    def _steps(self) -> list[Step]:
        return list(islice(self._run(), self.steps))

    def _run(self) -> Iterator[Step]:
        slaves = {slave.label: RunningSlave(slave) for slave in self.slaves}
        for slave in slaves.values():
            slave.fields["active"] = True
        master = RunningMaster(Master({slave.label: slave.profile for slave in self.slaves}))
        watch: Any = SimpleNamespace(seconds=0.0, begin=lambda phase, cycle: None)
        program = master.run(watch, dict.fromkeys(slaves, 0xF))
        number, request = 0, next(program)
        while True:
            bits, meaning, _ = self._sent(request, number)
            answers = {label: slave.hear(bits) for label, slave in slaves.items()}
            states = {label: slave.state for label, slave in slaves.items()}
            yield Step("master", bits, meaning, Turn.WAIT, states)

            sender, bits, meaning, reply = "", "", f"silence of {_TIMEOUT:g} bit times", SILENT
            for label, answer in answers.items():
                if answer:
                    sender = f"slave {label}"
                    bits, meaning, damaged = self._sent(answer, number + 1)
                    reply = FAULTY if damaged else answer.data
            for label, slave in slaves.items():
                slave.pause(Event.PAUSE)
                if bits and not answers[label]:
                    slave.hear(bits)
                slave.pause(Event.SLAVE_PAUSE)
            number, request = number + 2, program.send(reply)
            states = {label: slave.state for label, slave in slaves.items()}
            turn = Turn.REPEAT if master.attempt else Turn.SEND
            yield Step(sender, bits, meaning, turn, states)

    def _sent(self, telegram: Request | Response, number: int) -> tuple[str, str, bool]:
        """Return the bits and the meaning of a telegram, and whether it is damaged."""
        bits = telegram.bits
        if number not in self.damaged:
            return bits, str(telegram), False
        return f"{bits[:2]}{1 - int(bits[2])}{bits[3:]}", f"{telegram}, damaged", True

    def table(self) -> pd.DataFrame:
        """Return one row per step: ``sender``, ``telegram``, ``meaning``, and the states after it.

        The states are in the columns ``master``, ``slave 1`` and so on.
        """
        rows = [
            {**step._asdict(), "master": step.master.value}
            | {f"slave {label}": state.value for label, state in step.slaves.items()}
            for step in self._steps
        ]
        return pd.DataFrame(rows).drop(columns="slaves")

    @style.applied
    def plot(self, slave: str, step: int | None = None, *, ax: Axes | None = None) -> Axes:
        """Draw the states of the master and of one slave, and how a step has changed them.

        Without a step, no state is marked: icn2007's missing Fig 3.19. A damaged telegram is red.
        """
        check_choice("slave", slave, [one.label for one in self.slaves])
        if step is not None:
            check_whole("step", step, 0, self.steps - 1)
        ax = style.axes(ax, figsize=(6.5, 3.4))
        masters: list[Turn] = []
        slaves: list[State] = []
        if step is not None:
            masters = [Turn.SEND, *(one.master for one in self._steps)]
            slaves = [State.ASYNCHRONOUS, *(one.slaves[slave] for one in self._steps)]
            both = slice(step, step + 2)  # before and after the step
            masters, slaves = masters[both], slaves[both]
            self._plot_telegram(ax, slave, step)
        _plot_states(ax, 0, "master", TURNS, masters)
        _plot_states(ax, _APART, f"slave {slave}", CHANGES, slaves)
        return style.bare(ax, (-3.3, _APART + 3.4), (-5.4, 1.2))

    def _plot_telegram(self, ax: Axes, slave: str, step: int) -> None:
        """Draw a telegram between the master and a slave, or to the master from another slave."""
        now = self._steps[step]
        near, far = _HALF + 0.1, _APART - _HALF - 0.1
        if now.telegram:
            colour = style.LIMIT["color"] if step in self.damaged else "black"
            arrow = {"arrowstyle": "-|>", "mutation_scale": 16, "linewidth": 2, "color": colour}
            begin = far if now.sender == f"slave {slave}" else far - 0.7
            ends = (far, near) if now.sender == "master" else (near, begin)
            ax.annotate("", (ends[0], -_DOWN), (ends[1], -_DOWN), arrowprops=arrow)
            middle: dict[str, Any] = {"ha": "center", "va": "bottom", "family": "monospace"}
            ax.text((near + far) / 2, 0.15 - _DOWN, now.telegram, color=colour, **middle)
        ax.set_title(f"step {step}: {now.meaning}", loc="left")


def _plot_states(
    ax: Axes,
    x: float,
    title: str,
    transitions: Mapping[tuple[Any, Any], Sequence[str]],
    passed: Sequence[Enum],
) -> None:
    """Draw states around x, one below the other; mark the last one passed, and the way to it."""
    ax.text(x, 0.65, title, ha="center", va="bottom", weight="bold")
    states: type[Enum] = type(next(iter(transitions))[0])
    rows = {state: -_DOWN * place for place, state in enumerate(states)}
    for state, y in rows.items():
        now = state in passed[-1:]
        colour = style.FIELD["information" if now else "address"]
        look = {"facecolor": colour, "edgecolor": "0.3"}
        style.box(ax, x - _HALF, y - 0.4, 2 * _HALF, 0.8, state.value, **look)
        if now:
            ax.plot(x - _HALF, y, "ko", markersize=9, zorder=4)
    for (begin, end), events in transitions.items():
        taken = [begin, end] == list(passed)
        arrow: dict[str, Any] = {"arrowstyle": "-|>", "mutation_scale": 12}
        arrow |= {"shrinkA": 0, "shrinkB": 0}
        arrow |= {"color": "black", "linewidth": 3} if taken else {"color": "0.5"}
        down = 1 if rows[end] < rows[begin] else -1
        start, stop = rows[begin] - 0.4 * down, rows[end] + 0.4 * down
        ax.annotate("", (x - 0.3 * down, stop), (x - 0.3 * down, start), arrowprops=arrow)
        side = "right" if down > 0 else "left"
        middle = (start + stop) / 2
        ax.text(x - 0.5 * down, middle, "\n".join(events), ha=side, va="center")
