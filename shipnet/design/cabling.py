"""How many conductors a set of points needs: one pair each, or one line for all.

The same points are counted twice, hardwired and on AS-i, so that a saving is never a comparison
of different plants. Lengths, prices and masses are not in these counts.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import ceil
from typing import TYPE_CHECKING

from shipnet.design.signals import SIGNALS, Signal
from shipnet.errors import ArgumentError
from shipnet.fields import check_whole

if TYPE_CHECKING:
    import pandas as pd

__all__ = [
    "SIGNALS",
    "Saving",
    "Signal",
    "asi_conductors",
    "count_points",
    "hardwired_conductors",
    "lines_needed",
    "saving",
    "slaves_needed",
]


def hardwired_conductors(points: Mapping[str, int], *, groups: int = 1) -> int:
    """Count the conductors when every point has its own wires to the control panel.

    Parameters
    ----------
    points : mapping of str to int
        Number of points of each kind of `SIGNALS`.
    groups : int, default 1
        Groups with a common return of their own, such as junction boxes; matters only for the
        kinds that share one, and there are never more groups than points.

    Returns
    -------
    int
        Conductors.

    Raises
    ------
    ArgumentError
        If a kind is unknown or a number is negative.

    Examples
    --------
    The 62 modules with four inputs each of kim2023, section 3.3, with two wires a contact and
    with a common return a module:

    >>> hardwired_conductors({"contact": 62 * 4})
    496
    >>> hardwired_conductors({"contact_common": 62 * 4}, groups=62)
    310
    """
    groups = check_whole("groups", groups, 1, 10**9)
    total = 0
    for kind, number in points.items():
        if kind not in SIGNALS:
            raise ArgumentError(
                f"kind of point is {kind!r}; it must be one of {', '.join(SIGNALS)}"
            )
        number = check_whole(f"number of {kind}", number, 0, 10**9)
        signal = SIGNALS[kind]
        total += number * signal.conductors + signal.common * min(groups, number)
    return total


def asi_conductors(lines: int = 1, *, auxiliary: bool = False) -> int:
    """Count the conductors of AS-i lines: two each carry data and supply at once.

    Parameters
    ----------
    lines : int, default 1
        Lines, that is masters.
    auxiliary : bool, default False
        Whether a second pair feeds strong actuators beside every line (the black flat cable).

    Returns
    -------
    int
        Conductors in the trunk; the short wires from module to sensor stay as they were.

    Raises
    ------
    ArgumentError
        If `lines` is negative.

    Examples
    --------
    The 14 masters of the submarine in kim2023, section 3.5:

    >>> asi_conductors(14), asi_conductors(14, auxiliary=True)
    (28, 56)
    """
    return check_whole("lines", lines, 0, 10**9) * (4 if auxiliary else 2)


def slaves_needed(
    inputs: int, outputs: int = 0, *, inputs_per_slave: int = 4, outputs_per_slave: int = 4
) -> int:
    """Count the modules that hold so many digital points.

    Parameters
    ----------
    inputs, outputs : int
        Points.
    inputs_per_slave, outputs_per_slave : int, default 4
        Ports of one module; an A/B slave before specification 3.0 has 3 outputs.

    Returns
    -------
    int
        Modules, when each uses its inputs and its outputs.

    Raises
    ------
    ArgumentError
        If a number is negative, or a module has no port of a kind that is asked for.

    Examples
    --------
    >>> slaves_needed(10, 3)
    3
    """
    inputs = check_whole("inputs", inputs, 0, 10**9)
    outputs = check_whole("outputs", outputs, 0, 10**9)
    inputs_per_slave = check_whole("inputs_per_slave", inputs_per_slave, int(inputs > 0), 10**9)
    outputs_per_slave = check_whole("outputs_per_slave", outputs_per_slave, int(outputs > 0), 10**9)
    return max(
        ceil(inputs / inputs_per_slave) if inputs else 0,
        ceil(outputs / outputs_per_slave) if outputs else 0,
    )


def lines_needed(slaves: int, *, slaves_per_line: int = 62) -> int:
    """Count the AS-i lines, and so the masters, that so many slaves need.

    Parameters
    ----------
    slaves : int
        Modules.
    slaves_per_line : int, default 62
        Slaves on a line: 62 with A/B addressing, 31 without; fewer to keep a reserve.

    Returns
    -------
    int
        Lines.

    Raises
    ------
    ArgumentError
        If `slaves` is negative or `slaves_per_line` outside 1..62.

    Examples
    --------
    >>> lines_needed(400), lines_needed(400, slaves_per_line=31)
    (7, 13)
    """
    slaves = check_whole("slaves", slaves, 0, 10**9)
    return ceil(slaves / check_whole("slaves_per_line", slaves_per_line, 1, 62))


@dataclass(frozen=True, slots=True)
class Saving:
    """The same points, hardwired and on a bus.

    Parameters
    ----------
    hardwired, bus : int
        Conductors of either; `hardwired` is at least 1.

    Raises
    ------
    ArgumentError
        If a number is out of range.

    Notes
    -----
    A share of *what is left* and a share of *what is saved* are easily mixed up; kim2023 prints
    the first. Claim kim2023-074 is its slip of a factor of ten.

    Examples
    --------
    >>> print(Saving(496, 2))
    496 -> 2 conductors: 0.40 % left, 99.60 % saved
    """

    hardwired: int
    bus: int

    def __post_init__(self) -> None:
        """Check both counts."""
        object.__setattr__(self, "hardwired", check_whole("hardwired", self.hardwired, 1, 10**12))
        object.__setattr__(self, "bus", check_whole("bus", self.bus, 0, 10**12))

    @property
    def left(self) -> float:
        """Conductors on the bus as a share of those hardwired."""
        return self.bus / self.hardwired

    @property
    def saved(self) -> float:
        """Share of the hardwired conductors that is no longer needed."""
        return 1 - self.left

    def __str__(self) -> str:
        """Say both shares."""
        return (
            f"{self.hardwired} -> {self.bus} conductors: "
            f"{self.left:.2%} left, {self.saved:.2%} saved".replace("%", " %")
        )


def saving(points: Mapping[str, int], *, lines: int = 1, groups: int = 1) -> Saving:
    """Count the same points twice, hardwired and on AS-i lines.

    Parameters
    ----------
    points : mapping of str to int
        As for `hardwired_conductors`.
    lines : int, default 1
        AS-i lines that replace the wires.
    groups : int, default 1
        As for `hardwired_conductors`.

    Returns
    -------
    Saving
        Conductors of either.

    Raises
    ------
    ArgumentError
        If there is no point, or an argument is out of range.

    Examples
    --------
    From kim2023, sections 3.3 and 3.5:

    >>> print(saving({"contact": 62 * 4}))
    496 -> 2 conductors: 0.40 % left, 99.60 % saved
    >>> print(saving({"contact": 190}, lines=14))
    380 -> 28 conductors: 7.37 % left, 92.63 % saved
    """
    return Saving(hardwired_conductors(points, groups=groups), asi_conductors(lines))


def count_points(iolist: pd.DataFrame) -> dict[str, int]:
    """Count the points of an I/O list by kind.

    Parameters
    ----------
    iolist : pandas.DataFrame
        One row a point, with the columns ``tag`` and ``signal``; `signal` is a key of `SIGNALS`.

    Returns
    -------
    dict of str to int
        Ready for `hardwired_conductors`.

    Raises
    ------
    ArgumentError
        If a column is missing, a tag stands twice or a kind is unknown; all the rows concerned
        are named.

    Examples
    --------
    >>> from shipnet import datasets
    >>> count_points(datasets.read("synthetic_iolist_valves.csv"))
    {'contact': 8, 'solenoid': 8}
    """
    missing = [column for column in ("tag", "signal") if column not in iolist.columns]
    if missing:
        raise ArgumentError(f"the I/O list has no column {' and no column '.join(missing)}")
    unknown = iolist[~iolist["signal"].isin(list(SIGNALS))]
    faults = [f"{row.tag}: unknown kind {row.signal!r}" for row in unknown.itertuples()]
    faults += [f"{tag}: stands twice" for tag in iolist["tag"][iolist["tag"].duplicated()]]
    if faults:
        raise ArgumentError(f"{'; '.join(faults)}; known kinds are {', '.join(SIGNALS)}")
    kinds = iolist["signal"].astype(str).value_counts()
    return {str(kind): int(number) for kind, number in kinds.items()}
