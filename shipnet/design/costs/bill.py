"""What a network consists of, counted: cables by type, devices, channels.

Nothing in a bill depends on a price; every figure of `shipnet.design.costs.quantities` is a sum
over it.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from shipnet.errors import ArgumentError

if TYPE_CHECKING:
    import pandas as pd

    from shipnet.design.network import Network

__all__ = ["Bill", "bill_of", "conductors_at_cabinet"]

Floats = npt.NDArray[np.float64]

#: The assumptions that a device of a kind costs on a bus, one price and one time each; "" stands
#: for every other bus.
_DEVICES: dict[str, dict[str, tuple[str, ...]]] = {
    "cabinet": {"": ()},
    "box": {"": ("box", "box_time")},
    "module": {"": ("asi_module", "module_time")},
    "station": {
        "CAN": ("can_station", "station_time"),
        "": ("modbus_station", "station_time"),
    },
    "master": {
        "AS-i": ("asi_master", "master_time"),
        "CAN": ("can_master", "master_time"),
        "": ("modbus_master", "master_time"),
    },
    "gateway": {"": ("gateway", "master_time")},
    "repeater": {"": ("repeater", "part_time")},
    "supply": {"AS-i": ("asi_supply", "part_time"), "": ("supply", "part_time")},
    "auxiliary supply": {"": ("supply", "part_time")},
    "terminator": {"": ("terminator", "part_time")},
}


@dataclass(frozen=True, eq=False)
class Bill:
    """The counts of a network.

    Parameters
    ----------
    cables : pandas.DataFrame
        Indexed by cable (a key of the catalogue): runs, length_m, ends (conductors in use, at both
        ends), conductors (in the cables, spare ones too), and at_cabinet (runs that enter it).
    conductors_at_cabinet : int
        Conductors in use in the cables that enter the cabinet.
    items : dict of str to int
        How often each price or time of `shipnet.design.costs.assumptions` is due.
    unconnected : int
        Points that the network leaves out: they cost nothing here.
    """

    cables: pd.DataFrame
    conductors_at_cabinet: int
    items: dict[str, int]
    unconnected: int

    def column(self, name: str) -> Floats:
        """Return a column of `cables` as an array.

        Parameters
        ----------
        name : str
            The column.

        Returns
        -------
        ndarray of float, shape (n_cables,)
            Its values.
        """
        return np.asarray(self.cables[name].to_numpy(dtype=float))


def conductors_at_cabinet(network: Network) -> int:
    """Count the conductors in use in the cables that enter the cabinet.

    Parameters
    ----------
    network : Network
        Points and the cables to them.

    Returns
    -------
    int
        Conductors; spare ones of a cable are not in use.

    Examples
    --------
    The 62 modules with four contacts each of kim2023, section 3.3:

    >>> from shipnet.design.costs.plants import Plant
    >>> plant = Plant(modules=62, contacts=4)
    >>> conductors_at_cabinet(plant.hardwired), conductors_at_cabinet(plant.on_asi)
    (496, 2)
    """
    runs = network.runs
    return int(runs["used"][runs["at_cabinet"]].sum())


def bill_of(network: Network) -> Bill:
    """Count what a network consists of.

    Parameters
    ----------
    network : Network
        Points, devices and cables.

    Returns
    -------
    Bill
        Its counts.

    Raises
    ------
    ArgumentError
        If a device is of a kind that has no price.

    Examples
    --------
    >>> from shipnet.design.costs.plants import Plant
    >>> bill = bill_of(Plant(modules=2, contacts=4).on_asi)
    >>> bill.cables["runs"].to_dict()
    {'ASI_MARINE': 2, 'MI1P075': 8}
    >>> bill.items["asi_module"], bill.items["gland"]
    (2, 20)
    """
    runs = network.runs
    cables = (
        runs.assign(runs=1, ends=2 * runs["used"])
        .groupby("cable")[["runs", "length_m", "ends", "conductors", "at_cabinet"]]
        .sum()
    )
    points = network.points[["bus", "device"]].assign(
        analogue=network.iolist.points["type"].isin(["AI", "AO"]).to_numpy()
    )
    items = _devices(network, points) | _channels(points)
    items["second_interface"] = _second_interfaces(network)
    items["gland"] = items["gland_time"] = 2 * len(runs)
    return Bill(
        cables=cables,
        conductors_at_cabinet=conductors_at_cabinet(network),
        items={name: number for name, number in items.items() if number},
        unconnected=int((points["bus"] == "").sum()),
    )


def _devices(network: Network, points: pd.DataFrame) -> dict[str, int]:
    bus_of = dict(zip(network.segments["segment"], network.segments["bus"], strict=True))
    bus = [bus_of.get(segment, "") for segment in network.devices["segment"]]
    devices = network.devices
    unknown = sorted(set(devices["kind"]) - set(_DEVICES))
    if unknown:
        raise ArgumentError(f"there is no price of a {', '.join(unknown)}")
    items: dict[str, int] = {}
    counted = Counter(zip(devices["kind"], bus, strict=True))
    for (kind, of_bus), number in counted.items():
        by_bus = _DEVICES[kind]
        for name in by_bus.get(of_bus, by_bus[""]):
            items[name] = items.get(name, 0) + number
    modules = devices["device"][devices["kind"] == "module"]
    analogue = int(modules.isin(points["device"][points["analogue"]]).sum())
    if analogue:
        items |= {"asi_analogue_module": analogue, "asi_module": items["asi_module"] - analogue}
    return items


def _second_interfaces(network: Network) -> int:
    """Count the stations at which both lines of a redundant pair end."""
    trunk = network.runs[(network.runs["kind"] == "trunk") & (network.runs["line"] != "")]
    lines = trunk.melt(id_vars="line", value_vars=["a", "b"], value_name="device")
    both = lines.groupby("device")["line"].nunique() > 1
    stations = network.devices["device"][network.devices["kind"] == "station"]
    return int(stations.isin(both.index[both]).sum())


def _channels(points: pd.DataFrame) -> dict[str, int]:
    analogue = points["analogue"]
    wired, station = points["bus"] == "hardwired", points["bus"].isin(["CAN", "Modbus RTU"])
    return {
        "plc_digital_channel": int((wired & ~analogue).sum()),
        "plc_analogue_channel": int((wired & analogue).sum()),
        "station_digital_channel": int((station & ~analogue).sum()),
        "station_analogue_channel": int((station & analogue).sum()),
    }
