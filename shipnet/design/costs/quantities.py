"""What a network takes: conductors, cable, hours and money, each low, nominal and high.

Every figure is a sum over the bill of a network, so that two options, or a paper's plant and a
ship's, are never counted in two ways.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from shipnet.design.catalogue import cables as catalogue
from shipnet.design.costs.assumptions import LEVELS, Assumptions, Level, values_at, words
from shipnet.design.costs.bill import Bill, bill_of
from shipnet.errors import ArgumentError

if TYPE_CHECKING:
    import pandas as pd

    from shipnet.design.catalogue import Cable
    from shipnet.design.network import Network

__all__ = [
    "CABLE_RANGES",
    "EXCLUDED",
    "FIGURES",
    "Model",
    "Quantities",
    "check_figure",
    "quantities",
]

Floats = npt.NDArray[np.float64]

#: The figures of a network, and their units.
FIGURES: Mapping[str, str] = MappingProxyType(
    {
        "conductors at the cabinet": "1",
        "conductors laid": "1",
        "cables": "1",
        "cable length": "km",
        "cable mass": "kg",
        "cable volume": "l",
        "cross-section": "cm2",
        "terminations": "1",
        "labour": "h",
        "cable cost": "EUR",
        "hardware cost": "EUR",
        "labour cost": "EUR",
        "total cost": "EUR",
    }
)

#: The assumptions of which each cable of the catalogue has its own range, and the field that holds
#: it. A level of one is the level of all cables: they are dear together, or cheap together.
CABLE_RANGES: Mapping[str, tuple[str, str]] = MappingProxyType(
    {
        "cable_mass": ("mass", "kg/m"),
        "cable_price": ("price", "EUR/m"),
        "laying_time": ("lay", "h/m"),
        "termination_time": ("termination", "h"),
    }
)

#: What no figure holds.
EXCLUDED = (
    "sensors and actuators, and their hook-up and test, which are the same in every option",
    "engineering, documentation and software",
    "commissioning and training",
    "class approval and type approval",
    "spares",
    "cable trays, penetrations and the cabinet itself",
    "cable cut to waste, and the termination of spare conductors and screens",
    "operation, maintenance and what a failure costs",
)


@dataclass(frozen=True, eq=False)
class Quantities:
    """The figures of a network.

    Parameters
    ----------
    name : str
        The network's.
    table : pandas.DataFrame
        Indexed by `FIGURES`: low, nominal, high, unit.
    assumptions : pandas.DataFrame
        What was assumed, and only that: name, low, nominal, high, unit, status, source.
    by_cable : pandas.DataFrame
        Indexed by cable: runs, length_m, mass_kg, cost_eur, all nominal.
    unconnected : int
        Points that the network leaves out: they cost nothing here.
    excluded : tuple of str
        What no figure holds.
    """

    name: str
    table: pd.DataFrame
    assumptions: pd.DataFrame
    by_cable: pd.DataFrame
    unconnected: int
    excluded: tuple[str, ...] = EXCLUDED

    def __getitem__(self, figure: str) -> float:
        """Return a figure at nominal."""
        return float(self.table["nominal"][check_figure(figure)])

    def __repr__(self) -> str:
        """Say the figures that are asked for first, and what is left out."""
        cost = self.table.loc["total cost"]
        left_out = f"; {self.unconnected} points not connected" if self.unconnected else ""
        return (
            f"<Quantities of {self.name!r}: {self['conductors at the cabinet']:.0f} conductors, "
            f"{self['cable length']:.2f} km, {cost['nominal'] / 1e3:.0f} kEUR "
            f"({cost['low'] / 1e3:.0f} to {cost['high'] / 1e3:.0f}){left_out}>"
        )


def check_figure(figure: str) -> str:
    """Return the name of a figure, or raise if there is none of this name.

    Parameters
    ----------
    figure : str
        The name.

    Returns
    -------
    str
        The same.

    Raises
    ------
    ArgumentError
        If it is not one of `FIGURES`.

    Examples
    --------
    >>> check_figure("cable mass")
    'cable mass'
    """
    if figure not in FIGURES:
        raise ArgumentError(f"figure is {figure!r}; it must be one of {', '.join(FIGURES)}")
    return figure


class Model:
    """The figures of one network as a function of what is assumed.

    Parameters
    ----------
    network : Network
        Points, devices and cables.
    assumptions : Assumptions, optional
        Those of the data file if omitted.
    cables : mapping of str to Cable, optional
        The catalogue if omitted.

    Raises
    ------
    ArgumentError
        If the network has a cable or a device that nobody knows the price of.

    Examples
    --------
    >>> from shipnet.design.costs.plants import Plant
    >>> model = Model(Plant(modules=62, contacts=4).on_asi)
    >>> low, high = (model.figures({"labour_rate": level}) for level in ("low", "high"))
    >>> low["labour"] == high["labour"], low["labour cost"] < high["labour cost"]
    (True, True)
    """

    def __init__(
        self,
        network: Network,
        assumptions: Assumptions | None = None,
        *,
        cables: Mapping[str, Cable] | None = None,
    ) -> None:
        self.bill: Bill = bill_of(network)
        self.assumptions = Assumptions() if assumptions is None else assumptions
        known = catalogue() if cables is None else cables
        unknown = sorted(set(self.bill.cables.index) - set(known))
        if unknown:
            raise ArgumentError(f"the catalogue has no cable {', '.join(unknown)}")
        self.cables = {str(name): known[str(name)] for name in self.bill.cables.index}
        self._section = 1e-6 * np.array([c.area_mm2 for c in self.cables.values()], dtype=float)
        self._ranges = {
            name: np.array([getattr(c, field) for c in self.cables.values()]).reshape(-1, 3)
            for name, (field, _) in CABLE_RANGES.items()
        }

    @property
    def names(self) -> list[str]:
        """Names of the assumptions that the figures depend on, those of the cables first."""
        factors = ["laid_length", "cable_diameter"] if self.cables else []
        own = [*factors, "labour_rate", *self.bill.items]
        return [*(CABLE_RANGES if self.cables else ()), *(n for n in self.assumptions if n in own)]

    def figures(
        self, levels: Mapping[str, Level] | None = None, *, others: Level = "nominal"
    ) -> dict[str, Any]:
        """Return every figure at given levels of the assumptions.

        Parameters
        ----------
        levels : mapping of str to level, optional
            Where some assumptions stand: "low", "nominal", "high", or quantiles of shape
            (n_draws,).
        others : level, default "nominal"
            Where all others stand.

        Returns
        -------
        dict of str to float or ndarray of float, shape (n_draws,)
            By the names of `FIGURES`, in their units.

        Raises
        ------
        ArgumentError
            If a level is unknown.
        """
        given = {} if levels is None else levels
        bill, column = self.bill, self.bill.column

        def at(name: str) -> Floats:
            ranges = self._ranges.get(name)
            ranges = np.array([self.assumptions[name]]) if ranges is None else ranges
            return values_at(ranges, given.get(name, others))

        def due(unit: str) -> Floats | float:
            items = bill.items.items()
            fits = [(name, n) for name, n in items if self.assumptions.entry(name).unit == unit]
            return sum((n * at(name)[..., 0] for name, n in fits), start=0.0)

        length = column("length_m") * at("laid_length")
        section_m2 = self._section * at("cable_diameter") ** 2
        labour = (length * at("laying_time") + column("ends") * at("termination_time")).sum(-1)
        labour = labour + due("h")
        cable_cost = (length * at("cable_price")).sum(-1)
        hardware_cost = due("EUR")
        labour_cost = labour * at("labour_rate")[..., 0]
        figures = {
            "conductors at the cabinet": bill.conductors_at_cabinet,
            "conductors laid": column("conductors").sum(),
            "cables": column("runs").sum(),
            "cable length": length.sum(-1) / 1e3,
            "cable mass": (length * at("cable_mass")).sum(-1),
            "cable volume": (length * section_m2).sum(-1) * 1e3,
            "cross-section": (column("at_cabinet") * section_m2).sum(-1) * 1e4,
            "terminations": column("ends").sum(),
            "labour": labour,
            "cable cost": cable_cost,
            "hardware cost": hardware_cost,
            "labour cost": labour_cost,
            "total cost": cable_cost + hardware_cost + labour_cost,
        }
        return {
            name: float(value) if np.ndim(value) == 0 else value for name, value in figures.items()
        }

    @property
    def used(self) -> pd.DataFrame:
        """The assumptions in use: name, low, nominal, high, unit, status, source."""
        import pandas as pd

        columns = ["name", *LEVELS, "unit", "status", "source"]
        own = [name for name in self.names if name not in CABLE_RANGES]
        listed = self.assumptions.table.loc[own].reset_index()[columns]
        return pd.concat(
            [pd.DataFrame(list(self._cable_rows()), columns=columns), listed]
        ).reset_index(drop=True)

    def _cable_rows(self) -> Iterator[tuple[Any, ...]]:
        for name, (field, unit) in CABLE_RANGES.items():
            for cable in self.cables.values():
                what = f"{words(name)} of {cable.id}"
                yield (what, *getattr(cable, field), unit, cable.status, cable.source)


def quantities(
    network: Network,
    assumptions: Assumptions | None = None,
    *,
    cables: Mapping[str, Cable] | None = None,
) -> Quantities:
    """Return what a network takes: conductors, cable, hours and money.

    Parameters
    ----------
    network : Network
        From `shipnet.design.plan`, or made by hand.
    assumptions : Assumptions, optional
        Those of the data file if omitted.
    cables : mapping of str to Cable, optional
        The catalogue if omitted.

    Returns
    -------
    Quantities
        The figures, what was assumed for them, and the cables by type.

    Raises
    ------
    ArgumentError
        If the network has a cable or a device that nobody knows the price of.

    Notes
    -----
    Low is every figure with all assumptions at low, high with all at high: as every figure grows
    with each of them, the truth lies between if each assumption does. So far apart it hardly ever
    is; `shipnet.design.costs.uncertainty` says where it lies in 90 of 100 draws.

    Terminations are the conductors in use at both ends of every cable. The cross-section is that
    of the cables that enter the cabinet, without the room between them.

    Examples
    --------
    From kim2023, section 3.3:

    >>> from shipnet.design.costs.plants import Plant
    >>> plant = Plant(modules=62, contacts=4, distance=300)
    >>> quantities(plant.hardwired)["conductors at the cabinet"]
    496.0
    >>> quantities(plant.on_asi)["conductors at the cabinet"]
    2.0
    """
    import pandas as pd

    model = Model(network, assumptions, cables=cables)
    table = pd.DataFrame({level: model.figures(others=level) for level in LEVELS})
    return Quantities(
        name=network.name,
        table=table.assign(unit=pd.Series(dict(FIGURES))).rename_axis("figure"),
        assumptions=model.used,
        by_cable=_by_cable(model),
        unconnected=model.bill.unconnected,
    )


def _by_cable(model: Model) -> pd.DataFrame:
    counts = model.bill.cables[["runs", "length_m"]]
    kinds = model.cables.values()
    each = {name: np.array([getattr(c, name).nominal for c in kinds]) for name in ("mass", "price")}
    length = counts["length_m"] * model.assumptions.at("laid_length")
    return counts.assign(
        length_m=length, mass_kg=length * each["mass"], cost_eur=length * each["price"]
    )
