"""The twelve faults of the rule table, as changes of the actuator and of its sensors.

What a fault changes is our reading: the paper tells how it was seen, not what was broken. The
values at severity 1 are chosen so that the rule of the fault is met; a diagnosis that finds them
verifies code, it does not validate the rules.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.ballast.actuator import Actuator
from shipnet.ballast.sensors import CHANNELS
from shipnet.errors import ArgumentError
from shipnet.fields import check_whole

if TYPE_CHECKING:
    import pandas as pd


Floats = npt.NDArray[np.float64]


#: What severity s makes of a number: a factor that grows evenly or by powers, a factor without
#: bound, or something added. Severity 0 leaves the number as it is, to the last bit.
_LAWS = {
    "linear": lambda number, value, s: number * (1 + (value - 1) * s),
    "power": lambda number, value, s: number * value**s,
    "stuck": lambda number, value, s: number / np.maximum(1 - s, 0.0),
    "added": lambda number, value, s: number + value * s,
}


class Change(NamedTuple):
    """What a fault does to one number."""

    target: str
    law: str
    value: float


#: Meaning and changes by the code of the rule table.
FAULTS: dict[str, tuple[str, tuple[Change, ...]]] = {
    "G1": ("pressure gauge reads too high", (Change("FP", "added", 125.0),)),
    "P1": (
        "discharge blocked and pump seizing",
        (Change("restrictor", "linear", 0.02), Change("friction", "added", 10.6)),
    ),
    "P2": ("pump leaks inside", (Change("pump_leak", "power", 821.0),)),
    "V1": ("valve stuck", (Change("bearing_torque", "stuck", np.inf),)),
    "V2": ("piston leaks", (Change("piston_leak", "power", 6000.0),)),
    "O1": ("motor no longer cooled", (Change("cooling", "linear", 0.1),)),
    "S1": ("position reads too high, cylinder vented", (Change("VPos", "added", 5.0),)),
    "S2": ("position reads too low, cylinder vented", (Change("VPos", "added", -5.0),)),
    "Pos1": (
        "position reads too high, pressure trapped",
        (Change("VPos", "added", 5.0), Change("trapped", "added", 1.0)),
    ),
    "Pos2": (
        "position reads too low, pressure trapped",
        (Change("VPos", "added", -5.0), Change("trapped", "added", 1.0)),
    ),
    "Pos3": ("position reads far too high", (Change("VPos", "added", 15.0),)),
    "Pos4": ("position reads far too low", (Change("VPos", "added", -15.0),)),
}


_SENSORS = {channel.name: place for place, channel in enumerate(CHANNELS)}


@dataclass(frozen=True)
class Fault:
    """A fault of some valves, from a time on.

    Parameters
    ----------
    code : str
        Code of the rule table: G1, P1, P2, V1, V2, O1, S1, S2 or Pos1 to Pos4.
    severity : float or array of float, shape (n,), default 1
        0 healthy to 1; an array has one for each valve of `valves`.
    start : float, default 0
        When it begins [s]. A motor that is not cooled from time 0 on has been so for long, and is
        as warm as that makes it.
    valves : int, sequence of int or None, default None
        Which valves have it, counted from 0; None is all.

    Raises
    ------
    ArgumentError
        If there is no such code, or a number is out of its range.

    Examples
    --------
    >>> Fault("V3")
    Traceback (most recent call last):
        ...
    shipnet.errors.ArgumentError: code is 'V3'; it must be one of G1, P1, P2, V1, V2, O1, S1, ...
    """

    code: str
    severity: float | Floats = 1.0
    start: float = 0.0
    valves: int | Iterable[int] | None = None

    def __post_init__(self) -> None:
        """Check every field."""
        if self.code not in FAULTS:
            raise ArgumentError(f"code is {self.code!r}; it must be one of {', '.join(FAULTS)}")
        try:
            severity = np.asarray(self.severity, float)
        except (TypeError, ValueError):
            severity = np.array(np.nan)
        if severity.ndim > 1 or not ((severity >= 0) & (severity <= 1)).all():
            raise ArgumentError(f"severity of {self.code} is {self.severity!r}; it must be 0..1")
        object.__setattr__(self, "severity", float(severity) if not severity.ndim else severity)
        if not isinstance(self.start, int | float) or not 0 <= self.start < np.inf:
            raise ArgumentError(f"start of {self.code} is {self.start!r} s; it must be 0 or more")
        object.__setattr__(self, "valves", _valves(self.valves))

    def severities(self, n_valves: int) -> Floats:
        """Return how severe it is for each valve, shape (n_valves,)."""
        mine = range(n_valves) if self.valves is None else list(self.valves)  # type: ignore[arg-type]
        for valve in mine:
            check_whole(f"valve of {self.code}", valve, 0, n_valves - 1)
        if np.ndim(self.severity) and np.size(self.severity) != len(mine):
            raise ArgumentError(
                f"severity of {self.code} has {np.size(self.severity)} values for {len(mine)} "
                "valves"
            )
        found = np.zeros(n_valves)
        found[list(mine)] = self.severity
        return found


def faulty(actuator: Actuator, faults: Iterable[Fault], n_valves: int) -> tuple[Actuator, Floats]:
    """Return what faults make of an actuator and its sensors, once they have begun."""
    n = check_whole("n_valves", n_valves, 1, 10_000)
    offsets = np.zeros((len(CHANNELS), n))
    numbers: dict[str, Any] = {}
    for fault in faults:
        severity = fault.severities(n)
        for target, law, value in FAULTS[fault.code][1]:
            if target in _SENSORS:
                offsets[_SENSORS[target]] += value * severity
                continue
            number = numbers.get(target, getattr(actuator, target))
            with np.errstate(divide="ignore"):
                numbers[target] = _LAWS[law](number, value, severity)
    if "trapped" in numbers:
        numbers["trapped"] = np.minimum(numbers["trapped"], 1.0)
    return replace(actuator, **numbers), offsets


def fault_table() -> pd.DataFrame:
    """Return what each fault changes."""
    import pandas as pd

    rows = [(code, meaning, *change) for code, (meaning, ch) in FAULTS.items() for change in ch]
    return pd.DataFrame(rows, columns=["code", "meaning", "target", "law", "value"])


def _valves(valves: Any) -> tuple[int, ...] | None:
    if valves is None:
        return None
    try:
        many = tuple(valves)
    except TypeError:
        many = (valves,)
    return tuple(check_whole("valve", valve, 0, 9_999) for valve in many)
