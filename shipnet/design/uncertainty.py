"""What the assumptions do to the figures of designs: drawn all at once, and one at a time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from shipnet.design.costs import CABLE_RANGES, FIGURES, Model, check_figure, number
from shipnet.design.settings import words
from shipnet.errors import ArgumentError
from shipnet.fields import check_whole

if TYPE_CHECKING:
    import numpy.typing as npt
    import pandas as pd
    from matplotlib.axes import Axes

    from shipnet.design.designs import Design
    from shipnet.design.iolist import Rng
    from shipnet.design.settings import Assumptions


# Where the figures of designs lie when every assumption is drawn from its range ----------------


def models_of(
    designs: Mapping[str, Design] | Design, assumptions: Assumptions | None = None
) -> dict[str, Model]:
    """Return the models of several designs under the same assumptions, else under their own."""
    named = designs if isinstance(designs, Mapping) else {designs.name: designs}
    if not named:
        raise ArgumentError("there is no design")
    return {name: Model(design, assumptions) for name, design in named.items()}


def draw(
    designs: Mapping[str, Design] | Design,
    assumptions: Assumptions | None = None,
    *,
    rng: Rng,
    draws: int = 10_000,
    figures: Sequence[str] = tuple(FIGURES),
) -> pd.DataFrame:
    """Draw every assumption from its range, again and again, and return the figures."""
    import pandas as pd

    models = models_of(designs, assumptions)
    rng = np.random.default_rng(rng)
    n = check_whole("draws", draws, 1, 1_000_000)
    wanted = [check_figure(figure) for figure in figures]
    # Every assumption is drawn, in use or not: a further option must not change the others' draws.
    names = [*CABLE_RANGES, *next(iter(models.values())).assumptions]
    levels = dict(zip(names, rng.random((len(names), n)), strict=True))
    columns: dict[tuple[str, str], npt.NDArray[np.float64]] = {}
    for option, model in models.items():
        every = model.figures(levels)
        columns |= {(option, figure): np.broadcast_to(every[figure], n) for figure in wanted}
    return pd.DataFrame(columns).rename_axis(columns=["option", "figure"])


def likely(sample: pd.DataFrame, share: float = 0.9) -> pd.DataFrame:
    """Return the range that holds a share of the draws, as much above it as below."""
    if not 0 < share < 1:
        raise ArgumentError(f"share is {share}; it must be above 0 and below 1")
    quantiles = {"low": 0.5 - share / 2, "median": 0.5, "high": 0.5 + share / 2}
    table = sample.quantile(list(quantiles.values())).T
    table.columns = list(quantiles)
    return table.assign(
        unit=[FIGURES[figure][1] for figure in table.index.get_level_values("figure")]
    )


# Which assumptions matter: each one at its low and at its high, all others nominal


@dataclass(frozen=True, eq=False)
class Tornado:
    """Which assumption matters: each one at its low and at its high, all others nominal.

    `Comparison.tornado` returns one.

    Parameters
    ----------
    figure : str
        The figure, such as ``"total_cost_eur"``.
    between : tuple of str
        One design, or two whose difference counts.
    nominal : dict of str to float
        The figure of each design with every assumption nominal.
    every : pandas.DataFrame
        One row per assumption, the one that does most first: the figure of each design at low and
        at high, their difference, whether their order changes, and the swing.

    Examples
    --------
    >>> from shipnet.design import Plant, compare
    >>> plant = Plant(10, contacts=2, distance=20, spacing=4)
    >>> found = compare([plant.hardwired, plant.on_asi]).tornado()
    >>> found.between, found.top(1)
    (('AS-i', 'hardwired'), ['laying_time'])
    """

    figure: str
    between: tuple[str, ...]
    nominal: dict[str, float]
    every: pd.DataFrame

    def table(self) -> pd.DataFrame:
        """Return one row per assumption: the figures at low and at high, and the swing."""
        return self.every.copy()

    def plot(self, ax: Axes | None = None, *, rows: int = 8) -> Axes:
        """Draw the assumptions that do most, the longest bar on top."""
        from shipnet.design.plot import plot_tornado

        return plot_tornado(self, ax=ax, rows=rows)

    @property
    def unit(self) -> str:
        """Unit of the figure."""
        return FIGURES[self.figure][1]

    @property
    def subject(self) -> str:
        """What the rows are about, in words."""
        return f"{FIGURES[self.figure][0]} of {' less that of '.join(self.between)}"

    @property
    def at_nominal(self) -> float:
        """The figure, or the difference of both designs, with every assumption nominal."""
        first, *second = (self.nominal[option] for option in self.between)
        return first - sum(second)

    @property
    def ends(self) -> pd.DataFrame:
        """Columns low and high: the figure, or the difference, at both ends of each assumption."""
        of = "difference" if len(self.between) == 2 else self.between[0]
        table = self.every[[f"{of} at low", f"{of} at high"]]
        return table.set_axis(["low", "high"], axis=1)

    def top(self, n: int = 3) -> list[str]:
        """Return the names of the assumptions that matter most."""
        return [str(name) for name in self.every.index[self.every["swing"] > 0][:n]]

    def __str__(self) -> str:
        """Name the three assumptions that matter most."""
        unit = f" {self.unit}" if self.unit else ""
        low, high = self.ends["low"], self.ends["high"]
        said = [
            f"{words(name)} ({number(low[name])} to {number(high[name])})" for name in self.top()
        ]
        what = f"{self.subject} is {number(self.at_nominal)}{unit}"
        return f"{what}; what matters most: {', '.join(said) or 'nothing that is assumed'}"


def tornado(
    designs: Mapping[str, Design] | Design,
    figure: str = "total_cost_eur",
    *,
    between: tuple[str, str] | None = None,
    assumptions: Assumptions | None = None,
) -> Tornado:
    """Take every assumption to its low and its high, one at a time."""
    import pandas as pd

    models = models_of(designs, assumptions)
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
