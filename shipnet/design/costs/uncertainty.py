"""Where the figures of networks lie when every assumption is drawn from its range.

All low and all high at once are bounds that nobody meets. Here each assumption is drawn by itself
from a triangular distribution over its range, and all options share the draws, so that their
difference is that of the options and not of the luck.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from shipnet.design.costs.quantities import CABLE_RANGES, FIGURES, Model, check_figure
from shipnet.errors import ArgumentError
from shipnet.fields import check_whole

if TYPE_CHECKING:
    import numpy.typing as npt
    import pandas as pd

    from shipnet.design.catalogue import Cable
    from shipnet.design.costs.assumptions import Assumptions
    from shipnet.design.network import Network

__all__ = ["draw", "likely", "models_of"]


def models_of(
    networks: Mapping[str, Network] | Network,
    assumptions: Assumptions | None = None,
    *,
    cables: Mapping[str, Cable] | None = None,
) -> dict[str, Model]:
    """Return the models of several options under the same assumptions.

    Parameters
    ----------
    networks : mapping of str to Network, or Network
        The options by name; a single network goes by its own.
    assumptions : Assumptions, optional
        Those of the data file if omitted.
    cables : mapping of str to Cable, optional
        The catalogue if omitted.

    Returns
    -------
    dict of str to Model
        In the order given.

    Raises
    ------
    ArgumentError
        If there is no network.

    Examples
    --------
    >>> from shipnet.design.costs.plants import Plant
    >>> list(models_of(Plant(modules=2, contacts=4).on_asi))
    ['AS-i']
    """
    named = networks if isinstance(networks, Mapping) else {networks.name: networks}
    if not named:
        raise ArgumentError("there is no network")
    return {name: Model(network, assumptions, cables=cables) for name, network in named.items()}


def draw(
    networks: Mapping[str, Network] | Network,
    assumptions: Assumptions | None = None,
    *,
    rng: np.random.Generator,
    draws: int = 10_000,
    figures: Sequence[str] = tuple(FIGURES),
    cables: Mapping[str, Cable] | None = None,
) -> pd.DataFrame:
    """Draw every assumption from its range, again and again, and return the figures.

    Parameters
    ----------
    networks : mapping of str to Network, or Network
        The options by name.
    assumptions : Assumptions, optional
        Those of the data file if omitted.
    rng : numpy.random.Generator
        Draws them.
    draws : int, default 10000
        How often, 1..1000000.
    figures : sequence of str, default all
        Which of `FIGURES`.
    cables : mapping of str to Cable, optional
        The catalogue if omitted.

    Returns
    -------
    pandas.DataFrame
        One row a draw, with two levels of columns: option and figure.

    Raises
    ------
    ArgumentError
        If there is no network, a figure is unknown, or `draws` is out of range.

    Notes
    -----
    The assumptions are independent of each other, but for the cables: price, mass, laying and
    termination time of all types rise and fall together.

    Examples
    --------
    >>> import numpy as np
    >>> from shipnet.design.costs.plants import Plant
    >>> plant = Plant(modules=62, contacts=4)
    >>> options = {"hardwired": plant.hardwired, "AS-i": plant.on_asi}
    >>> sample = draw(options, rng=np.random.default_rng(2024), draws=1000)
    >>> bool((sample["AS-i"]["total cost"] < sample["hardwired"]["total cost"]).all())
    True
    """
    import pandas as pd

    models = models_of(networks, assumptions, cables=cables)
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
    """Return the range that holds a share of the draws, as much above it as below.

    Parameters
    ----------
    sample : pandas.DataFrame
        From `draw`.
    share : float, default 0.9
        Share of the draws, above 0 and below 1: 0.9 for 5 to 95 %.

    Returns
    -------
    pandas.DataFrame
        Indexed by option and figure: low, median, high, unit.

    Raises
    ------
    ArgumentError
        If `share` is out of range.

    Examples
    --------
    >>> import numpy as np
    >>> from shipnet.design.costs.plants import Plant
    >>> sample = draw(Plant(modules=62, contacts=4).on_asi, rng=np.random.default_rng(2024))
    >>> likely(sample).loc[[("AS-i", "cable length")]].round(2).to_numpy().tolist()
    [[2.07, 2.29, 2.53, 'km']]
    """
    if not 0 < share < 1:
        raise ArgumentError(f"share is {share}; it must be above 0 and below 1")
    quantiles = {"low": 0.5 - share / 2, "median": 0.5, "high": 0.5 + share / 2}
    table = sample.quantile(list(quantiles.values())).T
    table.columns = list(quantiles)
    return table.assign(unit=[FIGURES[figure] for figure in table.index.get_level_values("figure")])
