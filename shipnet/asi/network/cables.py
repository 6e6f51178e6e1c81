"""The types of AS-i cable: one resistance for the supply, another for the signal.

The current of the supply fills the whole conductor; at the signal's 150 kHz the skin effect has
raised the resistance. So each type holds two cables, from `asi_cable_types.csv`.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from types import MappingProxyType
from typing import NamedTuple

from shipnet import datasets
from shipnet.line import Cable

__all__ = ["CableType", "cable_types"]


class CableType(NamedTuple):
    """One type of cable, as the supply and as the signal meet it.

    Attributes
    ----------
    dc : shipnet.line.Cable
        With the resistance of the loop at direct current.
    signal : shipnet.line.Cable
        With the resistance at signal frequencies.
    """

    dc: Cable
    signal: Cable


@cache
def cable_types() -> Mapping[str, CableType]:
    """Return the types of cable by name.

    Returns
    -------
    mapping of str to CableType
        Read-only; the names end in the area of a conductor [mm2].

    Examples
    --------
    What 1 A loses on 100 m, which Schneider prints as 5.2, 2.7 and 1.6 V:

    >>> for name, cable in sorted(cable_types().items()):
    ...     print(f"{name:<9} {100 * cable.dc.r:.1f} V")
    as-i 0.75 5.2 V
    as-i 1.5  2.7 V
    as-i 2.5  1.6 V
    """
    types = {}
    for row in datasets.read("asi_cable_types.csv").to_dict("records"):
        l, c = float(row["l_h_per_m"]), float(row["c_f_per_m"])  # noqa: E741  # symbols of a line
        dc, signal = (float(row[name]) for name in ("r_dc_ohm_per_m", "r_signal_ohm_per_m"))
        types[str(row["cable"])] = CableType(Cable(dc, l, c), Cable(signal, l, c))
    return MappingProxyType(types)
