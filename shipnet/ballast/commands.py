"""What a valve is told: open, close, go to a position, stop."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar, check_whole

__all__ = ["ACTIONS", "Command"]

#: What a command may ask for.
ACTIONS = ("open", "close", "position", "stop")


@dataclass(frozen=True)
class Command:
    """A command to some valves.

    Parameters
    ----------
    action : str
        ``open``, ``close``, ``position`` or ``stop``.
    time : float, default 0
        When it is given [s].
    position : float or None, default None
        Where to go, 0..100 [%]; only and always with ``position``.
    valves : int, sequence of int or None, default None
        Which valves, counted from 0; None is all.

    Raises
    ------
    ArgumentError
        If a field is out of its range.

    Examples
    --------
    >>> Command("position", 5.0, position=40, valves=[0, 7]).valves
    (0, 7)
    """

    action: str
    time: float = 0.0
    position: float | None = None
    valves: int | Iterable[int] | None = None

    def __post_init__(self) -> None:
        """Check every field."""
        if self.action not in ACTIONS:
            raise ArgumentError(
                f"action is {self.action!r}; it must be one of {', '.join(ACTIONS)}"
            )
        object.__setattr__(self, "time", check_scalar("time", self.time, "s", 0, 1e9))
        if (self.position is None) == (self.action == "position"):
            raise ArgumentError(
                f"position is {self.position!r} with action {self.action!r}; it belongs to "
                "'position', and must be given there"
            )
        if self.position is not None:
            position = check_scalar("position", self.position, "%", 0, 100)
            object.__setattr__(self, "position", position)
        if self.valves is not None:
            many = self.valves if isinstance(self.valves, Iterable) else (self.valves,)
            checked = tuple(check_whole("valve", valve, 0, 9_999) for valve in many)
            object.__setattr__(self, "valves", checked)

    def mask(self, n_valves: int) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
        """Return which of so many valves are meant.

        Parameters
        ----------
        n_valves : int
            Number of valves.

        Raises
        ------
        ArgumentError
            If one of them is not there.
        """
        if self.valves is None:
            return np.ones(n_valves, bool)
        meant = np.zeros(n_valves, bool)
        for valve in self.valves:  # type: ignore[union-attr]
            meant[check_whole("valve", valve, 0, n_valves - 1)] = True
        return meant
