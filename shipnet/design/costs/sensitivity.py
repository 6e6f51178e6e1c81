"""Which assumptions matter: each one at its low and at its high, all others nominal.

The change of a figure is one thing, the change of the difference between two options another: a
price that both pay moves the first and not the decision.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from shipnet.design.costs.assumptions import words
from shipnet.design.costs.quantities import FIGURES, check_figure
from shipnet.design.costs.uncertainty import models_of
from shipnet.design.digits import number
from shipnet.errors import ArgumentError

if TYPE_CHECKING:
    import pandas as pd

    from shipnet.design.catalogue import Cable
    from shipnet.design.costs.assumptions import Assumptions
    from shipnet.design.network import Network

__all__ = ["Tornado", "tornado"]


@dataclass(frozen=True, eq=False)
class Tornado:
    """What each assumption does to a figure, the one that does most first.

    Parameters
    ----------
    figure : str
        One of `FIGURES`.
    between : tuple of str
        Two options, or the only one.
    nominal : dict of str to float
        The figure of each option with every assumption nominal, in the figure's unit.
    table : pandas.DataFrame
        Indexed by assumption. For each of the options ``"<option> at low"`` and ``"<option> at
        high"``; with two of them also ``"difference at low"`` and ``"difference at high"`` (first
        less second), and ``"order changes"``: whether the option that is lower at nominal is higher
        at one end. ``"swing"`` is what the rows are sorted by: from the one end to the other, of
        the difference if there is one.
    """

    figure: str
    between: tuple[str, ...]
    nominal: dict[str, float]
    table: pd.DataFrame

    @property
    def unit(self) -> str:
        """Unit of the figure."""
        return FIGURES[self.figure]

    @property
    def subject(self) -> str:
        """What the rows are about, in words."""
        return f"{self.figure} of {' less that of '.join(self.between)}"

    @property
    def at_nominal(self) -> float:
        """The figure, or the difference of both options, with every assumption nominal."""
        first, *second = (self.nominal[option] for option in self.between)
        return first - sum(second)

    @property
    def ends(self) -> pd.DataFrame:
        """Columns low and high: the figure, or the difference, at both ends of each assumption."""
        of = "difference" if len(self.between) == 2 else self.between[0]
        table = self.table[[f"{of} at low", f"{of} at high"]]
        return table.set_axis(["low", "high"], axis=1)

    def top(self, n: int = 3) -> list[str]:
        """Return the names of the assumptions that matter most.

        Parameters
        ----------
        n : int, default 3
            How many at most.

        Returns
        -------
        list of str
            Those that move anything at all, the one that moves it most first.
        """
        return [str(name) for name in self.table.index[self.table["swing"] > 0][:n]]

    def __str__(self) -> str:
        """Name the three assumptions that matter most."""
        unit = f" {self.unit}" if self.unit != "1" else ""
        low, high = self.ends["low"], self.ends["high"]
        said = [
            f"{words(name)} ({number(low[name])} to {number(high[name])})" for name in self.top()
        ]
        what = f"{self.subject} is {number(self.at_nominal)}{unit}"
        return f"{what}; what matters most: {', '.join(said) or 'nothing that is assumed'}"


def tornado(
    networks: Mapping[str, Network] | Network,
    figure: str = "total cost",
    *,
    between: tuple[str, str] | None = None,
    assumptions: Assumptions | None = None,
    cables: Mapping[str, Cable] | None = None,
) -> Tornado:
    """Take every assumption to its low and its high, one at a time.

    Parameters
    ----------
    networks : mapping of str to Network, or Network
        The options by name.
    figure : str, default "total cost"
        One of `FIGURES`.
    between : tuple of str, optional
        The two options whose difference matters; of several, if omitted, the lowest of the later
        ones and the first, from which a saving counts.
    assumptions : Assumptions, optional
        Those of the data file if omitted.
    cables : mapping of str to Cable, optional
        The catalogue if omitted.

    Returns
    -------
    Tornado
        Every assumption that one of the two depends on.

    Raises
    ------
    ArgumentError
        If there is no network, or a name is unknown.

    Notes
    -----
    The network stays as it is: a price does not send the planner back to its choice of cables.
    Of the cables, all types go to their low or high together.

    Examples
    --------
    >>> from shipnet.design.costs.plants import Plant
    >>> plant = Plant(modules=62, contacts=4)
    >>> found = tornado({"hardwired": plant.hardwired, "AS-i": plant.on_asi})
    >>> found.between
    ('AS-i', 'hardwired')
    """
    import pandas as pd

    models = models_of(networks, assumptions, cables=cables)
    check_figure(figure)
    nominal = {name: float(model.figures()[figure]) for name, model in models.items()}
    pair = _pair(nominal, between)
    names = list(dict.fromkeys(name for option in pair for name in models[option].names))
    table = pd.DataFrame(
        {
            f"{option} at {level}": [
                models[option].figures({name: level})[figure] for name in names
            ]
            for option in pair
            for level in ("low", "high")
        },
        index=pd.Index(names, name="assumption"),
        dtype=float,
    )
    of = pair[0]
    if len(pair) == 2:
        of = "difference"
        for level in ("low", "high"):
            table[f"{of} at {level}"] = (
                table[f"{pair[0]} at {level}"] - table[f"{pair[1]} at {level}"]
            )
        ends = table[[f"{of} at low", f"{of} at high"]]
        base = nominal[pair[0]] - nominal[pair[1]]
        table["order changes"] = (ends * base < 0).any(axis=1)
    table["swing"] = (table[f"{of} at high"] - table[f"{of} at low"]).abs()
    table = table.sort_values("swing", ascending=False, kind="stable")
    return Tornado(figure, pair, {option: nominal[option] for option in pair}, table)


def _pair(nominal: Mapping[str, float], between: tuple[str, str] | None) -> tuple[str, ...]:
    if between is None:
        first, *others = nominal
        return (*sorted(others, key=lambda option: nominal[option])[:1], first)
    if len(between) != 2 or between[0] == between[1] or not set(between) <= set(nominal):
        raise ArgumentError(
            f"between is {between!r}; it must be two of {', '.join(map(repr, nominal))}"
        )
    return tuple(between)
