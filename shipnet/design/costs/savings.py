"""What AS-i saves on a plant of which a paper names the counts: conductors, and cost.

The conductors follow from the counts. A saving of cost does not: it hangs on lengths, on prices,
and on what is counted as wiring. Here it is a range, for a plant that is stated.
"""

from __future__ import annotations

from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from shipnet.design.cabling import Saving
from shipnet.design.costs.bill import conductors_at_cabinet
from shipnet.design.costs.quantities import quantities
from shipnet.design.costs.uncertainty import draw

if TYPE_CHECKING:
    from collections.abc import Mapping

    import pandas as pd

    from shipnet.design.catalogue import Cable
    from shipnet.design.costs.assumptions import Assumptions
    from shipnet.design.costs.plants import Plant

__all__ = ["COUNTED", "conductor_saving", "cost_saving"]

#: What "wiring cost" may mean, and the figures that it then adds up.
COUNTED: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "cable": ("cable cost",),
        "cable and labour": ("cable cost", "labour cost"),
        "cable, labour and hardware": ("total cost",),
    }
)


def conductor_saving(plant: Plant) -> Saving:
    """Return the conductors at the cabinet of a plant, hardwired and on AS-i.

    Parameters
    ----------
    plant : Plant
        The counts.

    Returns
    -------
    Saving
        Conductors of either.

    Examples
    --------
    From kim2023, sections 3.3 and 3.5:

    >>> from shipnet.design.costs.plants import Plant
    >>> print(conductor_saving(Plant(modules=62, contacts=4)))
    496 -> 2 conductors: 0.40 % left, 99.60 % saved
    >>> print(conductor_saving(Plant(modules=190, contacts=1, lines=14)))
    380 -> 28 conductors: 7.37 % left, 92.63 % saved
    """
    return Saving(conductors_at_cabinet(plant.hardwired), conductors_at_cabinet(plant.on_asi))


def cost_saving(
    plant: Plant,
    assumptions: Assumptions | None = None,
    *,
    rng: np.random.Generator,
    draws: int = 10_000,
    cables: Mapping[str, Cable] | None = None,
) -> pd.DataFrame:
    """Return the share of the wiring cost that AS-i saves on a plant, for each reading of it.

    Parameters
    ----------
    plant : Plant
        Counts and distances.
    assumptions : Assumptions, optional
        Those of the data file if omitted.
    rng : numpy.random.Generator
        Draws the assumptions.
    draws : int, default 10000
        How often.
    cables : mapping of str to Cable, optional
        The catalogue if omitted.

    Returns
    -------
    pandas.DataFrame
        Indexed by what is counted (`COUNTED`): nominal, and low, median and high of the draws (5,
        50 and 95 %), each a share of the hardwired cost; below 0 where AS-i costs more.

    Raises
    ------
    ArgumentError
        If `draws` is out of range.

    Notes
    -----
    kim2023, section 3.5, reports that a plant of safety doors saved about 70 % of its wiring cost
    (claim kim2023-063). It names neither the doors and their distances, nor prices, nor what it
    counts; so the number cannot be reproduced. Small plants close to their cabinet save far less
    here, large ones far away more.

    Examples
    --------
    Ten doors with two contacts each, 20 m from the cabinet:

    >>> import numpy as np
    >>> from shipnet.design.costs.plants import Plant
    >>> doors = Plant(modules=10, contacts=2, distance=20, spacing=4)
    >>> saved = cost_saving(doors, rng=np.random.default_rng(2024))
    >>> saved["nominal"].round(2).tolist()
    [0.72, 0.47, 0.12]
    """
    import pandas as pd

    options = {"hardwired": plant.hardwired, "AS-i": plant.on_asi}
    sample = draw(options, assumptions, rng=rng, draws=draws, cables=cables)
    nominal = {
        name: quantities(network, assumptions, cables=cables).table["nominal"]
        for name, network in options.items()
    }
    rows = {}
    for counted, figures in COUNTED.items():
        names = list(figures)
        wired, bus = (sample[option][names].to_numpy().sum(axis=1) for option in options)
        low, median, high = np.quantile(1 - bus / wired, [0.05, 0.5, 0.95])
        rows[counted] = {
            "nominal": 1 - nominal["AS-i"][names].sum() / nominal["hardwired"][names].sum(),
            "low": low,
            "median": median,
            "high": high,
        }
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("counted")
