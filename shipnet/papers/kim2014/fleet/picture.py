"""Sections 2.1, 3.3 and 3.4: how late and how wrong the picture of a master can be.

All of it is our simulation; the paper prints no scan time, no time-out and no rule of change.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from shipnet.ballast.master import MasterRun, operate, received_run
from shipnet.ballast.plant import Command, Plant
from shipnet.ballast.scan import status_poll, worst_age
from shipnet.ballast.simulation import Run
from shipnet.errors import ArgumentError
from shipnet.modbus.faults import Break
from shipnet.modbus.redundancy import Loop
from shipnet.modbus.uart import SerialLine

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["NEAR", "Picture", "age_table", "broken_loops", "picture_table", "seen_strokes"]

#: A position is shown rightly that is nearer to the true one [%]: a register's step, and noise.
NEAR = 2.0

#: Rule and time-out [s] of the masters that are compared.
_CASES: tuple[tuple[Literal["slave", "downstream"], float], ...] = (
    ("slave", 1.0),
    ("slave", 0.1),
    ("downstream", 1.0),
    ("downstream", 0.1),
)


class Picture(NamedTuple):
    """A fleet as its master sees it, and as it is.

    Attributes
    ----------
    seen : MasterRun
        What the master saw.
    plant : Plant
        The valves at the end.
    """

    seen: MasterRun
    plant: Plant

    @property
    def wrong(self) -> int:
        """Valves whose position is not known, or shown more than `NEAR` from the true one."""
        shown = self.seen.screen()["position_percent"].to_numpy()
        return int((~(np.abs(shown - 100 * self.plant.opening) <= NEAR)).sum())


def seen_strokes(
    numbers: Iterable[int] = (5, 64, 247), *, duration: float = 15.0, start: float = 3.0
) -> dict[int, Run]:
    """Let masters with more and more valves open their last one.

    Parameters
    ----------
    numbers : iterable of int
        Numbers of valves, 1..247 each.
    duration : float, default 15
        For how long [s].
    start : float, default 3
        When the command is due; it goes out after the poll under way [s].

    Returns
    -------
    dict of int to Run
        By number of valves: what came of the last valve, at 9600 bit/s.

    Examples
    --------
    >>> {number: run.time.size for number, run in seen_strokes().items()}
    {5: 93, 64: 7, 247: 1}
    """
    runs = {}
    for number in numbers:
        system = Loop(number, status_poll(SerialLine(9600)))
        order = Command("open", start, valves=number - 1)
        seen = operate(Plant(n_valves=number), system, [order], duration=duration)
        runs[number] = received_run(seen, number, target=100.0)
    return runs


def age_table(
    commands: Iterable[int] = (0, 10, 100), *, n_valves: int = 247, duration: float = 50.0
) -> pd.DataFrame:
    """Return how old the picture gets when commands are sent between the polls.

    Parameters
    ----------
    commands : iterable of int
        How many valves are told to open at once, 0..n_valves each.
    n_valves : int, default 247
        Number of valves, 1..247, at 9600 bit/s.
    duration : float, default 50
        For how long; the commands are sent after half of it [s].

    Returns
    -------
    pandas.DataFrame
        Indexed by ``commands``: ``formula_s`` as `worst_age` has it, and ``simulated_s``.

    Raises
    ------
    ArgumentError
        If a number is out of its range, or the duration shorter than two scans after the commands.

    Examples
    --------
    >>> age_table().round(2).values.tolist()
    [[7.94, 7.94], [8.21, 8.21], [10.58, 10.58]]
    """
    import pandas as pd

    system = Loop(n_valves, status_poll(SerialLine(9600)))
    rows = {}
    for count in commands:
        age = worst_age(system, commands=count)
        if duration / 2 < 2 * age:
            raise ArgumentError(f"duration is {duration:g} s; it must be {4 * age:.3g} or more")
        orders = [Command("open", duration / 2, valves=range(count))] if count else []
        seen = operate(Plant(n_valves=n_valves), system, orders, duration=duration)
        rows[count] = (age, float(_longest(seen)))
    table = pd.DataFrame.from_dict(rows, orient="index", columns=["formula_s", "simulated_s"])
    return table.rename_axis("commands")


def broken_loops(
    n_valves: int = 247, *, opened: int = 100, start: float = 12.0, duration: float = 60.0
) -> dict[str, Picture]:
    """Break the loop in its middle while valves open, under four masters.

    Parameters
    ----------
    n_valves : int, default 247
        Number of valves, at 9600 bit/s.
    opened : int, default 100
        How many are told to open at 3 s.
    start : float, default 12
        When the loop breaks [s].
    duration : float, default 60
        How long the fleet is watched [s].

    Returns
    -------
    dict of str to Picture
        By the rule of the change, one by one or all beyond the break, and the time-out; before
        them ``no break``.

    Examples
    --------
    >>> [picture.wrong for picture in broken_loops().values()]
    [0, 100, 0, 0, 0]
    """
    orders = [Command("open", 3.0, valves=range(opened))]
    unbroken: list[Break] = []
    cases = {"no break": (Loop(n_valves, status_poll(SerialLine(9600))), unbroken)}
    for move, timeout in _CASES:
        name = f"{'one by one' if move == 'slave' else 'all beyond'}, time-out {timeout:g} s"
        poll = status_poll(SerialLine(9600), timeout=timeout)
        cases[name] = (Loop(n_valves, poll, move=move), [Break(n_valves // 2, start=start)])
    pictures = {}
    for name, (system, faults) in cases.items():
        plant = Plant(n_valves=n_valves)
        pictures[name] = Picture(
            operate(plant, system, orders, duration=duration, faults=faults), plant
        )
    return pictures


def picture_table(pictures: Mapping[str, Picture]) -> pd.DataFrame:
    """Return how good the pictures are.

    Parameters
    ----------
    pictures : mapping of str to Picture
        Such as from `broken_loops`.

    Returns
    -------
    pandas.DataFrame
        One row a picture: ``oldest_s``, the greatest age of what was shown of a valve;
        ``unanswered``, requests without an answer; ``shown_moving`` and ``moving`` at the end; and
        ``wrong``, valves shown at a wrong position then.

    Examples
    --------
    >>> table = picture_table(broken_loops(64, opened=30, duration=40))
    >>> table.loc["one by one, time-out 1 s"].round(1).tolist()
    [29.3, 27.0, 30.0, 0.0, 30.0]
    """
    import pandas as pd

    rows = {
        name: {
            "oldest_s": _longest(picture.seen),
            "unanswered": sum(not answered for *_, answered in picture.seen.tries),
            "shown_moving": int((picture.seen.screen()["state"] == "moving").sum()),
            "moving": int(picture.plant.running.sum()),
            "wrong": picture.wrong,
        }
        for name, picture in pictures.items()
    }
    return pd.DataFrame.from_dict(rows, orient="index")


def _longest(seen: MasterRun) -> float:
    """Return the greatest age of what was shown of any valve [s]."""
    return float(np.max(seen.longest_age))
