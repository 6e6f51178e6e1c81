"""What prices, hours and factors of a design are assumed to be: low, nominal and high.

Nothing is typed here: the values stand in ``data/synthetic_design_assumptions.csv``, each with its
unit, its status and its source. Those of the cables stand in the catalogue.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache
from math import isfinite
from types import MappingProxyType
from typing import TYPE_CHECKING, Literal

import numpy as np
import numpy.typing as npt

from shipnet import datasets
from shipnet.design.catalogue import Range
from shipnet.errors import ArgumentError

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["LEVELS", "Assumption", "Assumptions", "Level", "values_at", "words"]

Floats = npt.NDArray[np.float64]

#: The names of the three values of a range.
LEVELS: tuple[Literal["low", "nominal", "high"], ...] = ("low", "nominal", "high")

#: Where in its range an assumption is taken: at one of its three values, or at quantiles of the
#: triangular distribution over it, shape (n_draws,).
Level = Literal["low", "nominal", "high"] | Floats

_FILE = "synthetic_design_assumptions.csv"

#: Parts of names that are written otherwise in a text.
_SPELT = {"asi": "AS-i", "can": "CAN", "modbus": "Modbus", "plc": "PLC"}


@dataclass(frozen=True, slots=True)
class Assumption:
    """A price, an hour or a factor that a design rests on.

    Parameters
    ----------
    range : Range
        Low, nominal and high, finite, 0 or more and in this order.
    unit : str
        Their unit; 1 for a factor.
    meaning : str
        What it is the value of.
    status : str
        ``"assumed"``, ``"derived"`` or ``"given"`` by the user.
    source : str
        Where it comes from.

    Raises
    ------
    ArgumentError
        If the range is not in order.

    Examples
    --------
    >>> Assumption(Range(35, 55, 85), "EUR/h").range.nominal
    55
    """

    range: Range
    unit: str
    meaning: str = ""
    status: str = "given"
    source: str = "the user"

    def __post_init__(self) -> None:
        """Check the order."""
        _check("range", self.range)


class Assumptions(Mapping[str, Range]):
    """All assumptions by name: a mapping to their ranges.

    Parameters
    ----------
    entries : mapping of str to Assumption, optional
        Read from the data file if omitted.

    Raises
    ------
    ArgumentError
        If one of the names that the data file has is missing.

    Examples
    --------
    >>> assumed = Assumptions()
    >>> assumed["labour_rate"]
    Range(low=35.0, nominal=55.0, high=85.0)
    >>> dear = assumed.with_(labour_rate=Range(90, 110, 140))
    >>> dear.at("labour_rate", "low"), assumed.at("labour_rate", "low")
    (90, 35.0)
    """

    def __init__(self, entries: Mapping[str, Assumption] | None = None) -> None:
        read = _read()
        self._entries = dict(read if entries is None else entries)
        missing = [name for name in read if name not in self._entries]
        if missing:
            raise ArgumentError(f"the assumptions lack {', '.join(missing)}")

    def __getitem__(self, name: str) -> Range:
        return self._entries[name].range

    def __iter__(self) -> Iterator[str]:
        return iter(self._entries)

    def __len__(self) -> int:
        return len(self._entries)

    def __hash__(self) -> int:
        """Return the same for equal ranges."""
        return hash(frozenset(self.items()))

    def __repr__(self) -> str:
        given = [name for name, entry in self._entries.items() if entry.status == "given"]
        return f"<Assumptions: {len(self)}, given by the user: {', '.join(given) or 'none'}>"

    def entry(self, name: str) -> Assumption:
        """Return an assumption with its unit and source.

        Parameters
        ----------
        name : str
            Its name.

        Returns
        -------
        Assumption
            Range, unit, meaning, status and source.

        Raises
        ------
        ArgumentError
            If there is none of this name.
        """
        if name not in self._entries:
            raise ArgumentError(
                f"assumption is {name!r}; it must be one of {', '.join(self._entries)}"
            )
        return self._entries[name]

    def at(self, name: str, level: Literal["low", "nominal", "high"] = "nominal") -> float:
        """Return one of the three values of an assumption.

        Parameters
        ----------
        name : str
            Its name.
        level : {"low", "nominal", "high"}, default "nominal"
            Which value.

        Returns
        -------
        float
            The value, in the assumption's unit.

        Raises
        ------
        ArgumentError
            If there is no such name or level.
        """
        return self.entry(name).range[_place(level)]

    def with_(self, **ranges: Range) -> Assumptions:
        """Return assumptions of which some are the user's own.

        Parameters
        ----------
        **ranges : Range
            New ranges by name, in the unit of the old.

        Returns
        -------
        Assumptions
            All of them; those given have the status ``"given"``.

        Raises
        ------
        ArgumentError
            If a name is unknown or a range is not in order.
        """
        changed = dict(self._entries)
        for name, given in ranges.items():
            _check(name, given)
            changed[name] = replace(
                self.entry(name), range=Range(*given), status="given", source="the user"
            )
        return Assumptions(changed)

    @property
    def table(self) -> pd.DataFrame:
        """One row an assumption: name, meaning, low, nominal, high, unit, status, source."""
        import pandas as pd

        rows = [
            (name, entry.meaning, *entry.range, entry.unit, entry.status, entry.source)
            for name, entry in self._entries.items()
        ]
        return pd.DataFrame(
            rows, columns=["name", "meaning", *LEVELS, "unit", "status", "source"]
        ).set_index("name")


def values_at(ranges: npt.ArrayLike, level: Level) -> Floats:
    r"""Return where ranges stand at a level: one of their three values, or quantiles.

    A range is read as a triangular distribution from low to high with its peak at nominal, so
    that the quantile of u is

    .. math::
        x(u) = \begin{cases}
        l + \sqrt{u (h - l)(m - l)} & u < (m - l) / (h - l) \\
        h - \sqrt{(1 - u)(h - l)(h - m)} & \text{else}
        \end{cases}

    Parameters
    ----------
    ranges : array_like of float, shape (k, 3)
        Low, nominal and high of each.
    level : {"low", "nominal", "high"} or ndarray of float, shape (n_draws,)
        One value of each range, or quantiles 0..1 that all ranges share.

    Returns
    -------
    ndarray of float, shape (k,) or (n_draws, k)
        The values.

    Raises
    ------
    ArgumentError
        If there is no such level.

    Examples
    --------
    >>> values_at([(1, 2, 5), (3, 3, 3)], "high").tolist()
    [5.0, 3.0]
    >>> values_at([(1, 2, 5), (3, 3, 3)], np.array([0, 0.25, 1])).tolist()
    [[1.0, 3.0], [2.0, 3.0], [5.0, 3.0]]
    """
    rows = np.asarray(ranges, dtype=float).reshape(-1, 3)
    if isinstance(level, str):
        chosen: Floats = rows[:, _place(level)]
        return chosen
    low, nominal, high = rows.T
    u = np.asarray(level, dtype=float)[:, None]
    width, rise, fall = high - low, nominal - low, high - nominal
    left = low + np.sqrt(u * width * rise)
    right = high - np.sqrt((1 - u) * width * fall)
    drawn: Floats = np.clip(np.where(u * width < rise, left, right), low, high)
    return drawn


def words(name: str) -> str:
    """Return the name of an assumption as a text or a figure says it.

    Parameters
    ----------
    name : str
        Its name.

    Returns
    -------
    str
        The words.

    Examples
    --------
    >>> words("asi_analogue_module")
    'AS-i analogue module'
    """
    return " ".join(_SPELT.get(part, part) for part in name.split("_"))


def _place(level: str) -> int:
    if level not in LEVELS:
        raise ArgumentError(f"level is {level!r}; it must be one of {', '.join(LEVELS)}")
    return LEVELS.index(level)


def _check(name: str, given: Range) -> None:
    ordered = len(given) == 3 and all(isfinite(value) for value in given)
    if not ordered or not 0 <= given[0] <= given[1] <= given[2]:
        raise ArgumentError(
            f"{name} is {tuple(given)}; it must be low <= nominal <= high, 0 or more and finite"
        )


@cache
def _read() -> Mapping[str, Assumption]:
    return MappingProxyType(
        {
            row["name"]: Assumption(
                Range(*(float(row[level]) for level in LEVELS)),
                row["unit"], row["meaning"], row["status"], row["source"],
            )
            for row in datasets.read(_FILE).to_dict("records")
        }
    )  # fmt: skip
