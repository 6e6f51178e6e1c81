"""The rules in a slave: what valves report of themselves, from their own sensors."""

from __future__ import annotations

from collections import deque

import numpy as np
import numpy.typing as npt

from shipnet.ballast.channels import CHANNELS
from shipnet.ballast.plant import Plant
from shipnet.ballast.rule_table import rule_base
from shipnet.ballast.speed import WINDOW, position_speed
from shipnet.errors import ArgumentError
from shipnet.fields import check_whole
from shipnet.fuzzy.rules import RuleBase

__all__ = ["Monitor"]

Floats = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

#: The status has four bits for the row of the rule table at least.
_MOST_RULES = 12


class Monitor:
    """Applies the rules to every reading of a plant's sensors, for all its valves at once.

    Parameters
    ----------
    plant : Plant
        The valves; the monitor looks on at each of its readings from now on.
    rules : RuleBase, optional
        The rules, 1..12 of them; those of the paper if omitted.
    k, n : int, default 3 and 5
        A code is found if its rule fired in `k` of the last `n` readings, 1 <= k <= n <= 1000.
        These are a step of the plant apart while a motor runs, else they come with the requests.

    Raises
    ------
    ArgumentError
        If there are more rules than the status has rows for, or `k` or `n` is out of range.

    Notes
    -----
    In the paper the slave finds Pos1 to Pos4; the other rules need no more than its own readings
    either. The reading of the rules is the fuzzy one of `shipnet.ballast.diagnose_run`, cut at 0.5.
    A code that was found stays until the next command, for most rules need a motor that runs: the
    master would miss them between two scans.

    Examples
    --------
    >>> from shipnet.ballast import Command, Fault
    >>> plant = Plant(n_valves=2, faults=[Fault("V1", valves=1)])
    >>> monitor = Monitor(plant)
    >>> plant.order(Command("open"))
    >>> readings = plant.run_until(25.0)
    >>> monitor.row(0), monitor.row(1), monitor.codes(1)
    (0, 4, ('V1',))
    """

    def __init__(
        self, plant: Plant, rules: RuleBase | None = None, *, k: int = 3, n: int = 5
    ) -> None:
        self.plant = plant
        self.base = rules if rules is not None else rule_base()
        if len(self.base.rules) > _MOST_RULES:
            raise ArgumentError(
                f"rules has {len(self.base.rules)} rules; it must be 1..{_MOST_RULES}"
            )
        window = check_whole("n", n, 1, 1000)
        self._least = check_whole("k", k, 1, window)
        known = {*(channel.name for channel in CHANNELS), "DVPos"}
        strange = [name for name in self.base.names if name not in known]
        if strange:
            raise ArgumentError(f"rules speak of {', '.join(strange)}; a slave has {sorted(known)}")
        self.found = np.zeros((plant.n_valves, len(self.base.rules)), bool)
        self._ranked = np.array([self.base.codes.index(code) for code in self.base.ranking])
        self._fired: deque[Flags] = deque(maxlen=window)
        self._places: deque[tuple[float, Floats]] = deque()
        self._calm: tuple[Floats, Flags] | None = None
        plant.watchers.append(self._look)

    def row(self, valve: int) -> int:
        """Return what the status says: the row of the first code in rank that was found, or 0.

        Parameters
        ----------
        valve : int
            Which, from 0 on.
        """
        found = self.found[valve, self._ranked]
        return int(self._ranked[found.argmax()]) + 1 if np.count_nonzero(found) else 0

    def codes(self, valve: int) -> tuple[str, ...]:
        """Return all codes that were found since the last command, the highest priority first.

        Parameters
        ----------
        valve : int
            Which, from 0 on.
        """
        return tuple(self.base.codes[k] for k in self._ranked if self.found[valve, k])

    def report(self, valve: int, row: int) -> None:
        """Take a code for found, and no other, and begin to count anew.

        What is still wrong is found again.

        Parameters
        ----------
        valve : int
            Which, from 0 on.
        row : int
            Its row in the rule table; 0 for none, as after a command.
        """
        place = check_whole("row", row, 0, len(self.base.rules))
        self.found[valve] = False
        for fired in self._fired:
            fired[valve] = False
        if place:
            self.found[valve, place - 1] = True

    def _look(self) -> None:
        """Apply the rules to the present reading; another at the same time takes its place."""
        plant = self.plant
        if self._places and self._places[-1][0] == plant.time:
            self._places.pop()
            self._fired.pop()
        self._places.append((plant.time, plant.readings[4]))
        # The speed needs the last reading that is a window old, and the present one.
        while len(self._places) > 1 and self._places[1][0] < plant.time - WINDOW + 1e-9:
            self._places.popleft()
        self._fired.append(self._fires())
        self.found |= sum(self._fired, np.zeros(self.found.shape, int)) >= self._least

    def _fires(self) -> Flags:
        """Return which rules fire for the present reading, shape (n_valves, n_rules)."""
        plant, speed = self.plant, np.full(self.plant.n_valves, np.nan)
        calm = not np.count_nonzero(plant.active)
        if calm and self._calm is not None and np.array_equal(plant.readings, self._calm[0]):
            # Without noise, most readings of a fleet at rest are the one before.
            return self._calm[1].copy()
        if not calm:
            ends = (self._places[0], self._places[-1])
            time, places = (np.array(column) for column in zip(*ends, strict=True))
            found = position_speed(time, places, (plant.ran - 1) * plant.step)[-1]
            speed = np.where(plant.active, found, np.nan)
        values = {c.name: x for c, x in zip(CHANNELS, plant.readings, strict=True)}
        values["DVPos"] = speed
        fires = self.base.decide({name: values[name] for name in self.base.names}).active
        self._calm = (plant.readings, fires.copy()) if calm else None
        return fires
