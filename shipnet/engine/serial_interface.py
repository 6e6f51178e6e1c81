r"""RS-232, RS-422 or RS-485: what each allows, and which of them fit a line.

The junction box of lee2012 can be set to any of the three (section IV.1.a); Table 2 has RS-485.
The length of a balanced line falls with the bit rate:

.. math:: l \le \min \left( l_{max}, \frac{P}{r} \right)
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Literal

from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar, check_whole

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["INTERFACES", "Interface", "choose", "longest_line"]

#: The tables that the limits are from.
_NI = "National Instruments, PCMCIA-232 manual, table B-1"
_BRAINBOXES = "Brainboxes, FAQ 'RS232 RS422 RS485 standards'"
_TI = "Texas Instruments, SN75ALS174 data sheet SLLSFU5A, section 8.2.2.3"

#: 4000 ft and 50 ft as the tables print them [m].
_FEET_4000, _FEET_50 = 1219.0, 15.0


@dataclass(frozen=True, slots=True)
class Interface:
    """A serial interface standard.

    Parameters
    ----------
    name : str
        Its name.
    drivers, receivers : int
        Most drivers and receivers on a line; of RS-485 at one unit load each.
    length : float
        Longest line [m].
    bit_rate : float
        Highest bit rate [bit/s].
    product : float
        Highest product of length and bit rate [m bit/s]; infinite if the limits hold together.
    wires : mapping of str to int
        Conductors of the lines, without screen, by ``"half"`` and ``"full"`` duplex; a balanced
        line has its common conductor beside the pairs.
    source : str
        Where the limits are from.

    Examples
    --------
    >>> INTERFACES["RS-485"].receivers
    32
    """

    name: str
    drivers: int
    receivers: int
    length: float
    bit_rate: float
    product: float
    wires: Mapping[str, int]
    source: str


#: The three interfaces by name. The product is that of 10 Mbit/s and 40 ft, which is that of
#: 100 kbit/s and 4000 ft too.
INTERFACES: Mapping[str, Interface] = MappingProxyType(
    {
        one.name: one
        for one in (
            Interface("RS-232", 1, 1, _FEET_50, 20e3, float("inf"), {"half": 3, "full": 3}, _NI),
            Interface(
                "RS-422", 1, 10, _FEET_4000, 10e6, _FEET_4000 * 100e3, {"full": 5},
                f"{_NI}; {_BRAINBOXES}",
            ),
            Interface(
                "RS-485", 32, 32, _FEET_4000, 10e6, _FEET_4000 * 100e3, {"half": 3, "full": 5},
                f"{_NI}; {_BRAINBOXES}; {_TI}",
            ),
        )
    }
)  # fmt: skip


def longest_line(interface: str, bit_rate: float) -> float:
    """Return how long a line may be at a bit rate.

    Parameters
    ----------
    interface : {"RS-232", "RS-422", "RS-485"}
        Standard.
    bit_rate : float
        Bit rate, 50..10e6 [bit/s].

    Returns
    -------
    float
        Length [m]; 0 if the bit rate is too high for the standard.

    Raises
    ------
    ArgumentError
        If there is no such standard, or the bit rate is out of range.

    Notes
    -----
    Limits as the makers' tables give them; RS-232 has a capacitance (2500 pF) rather than a
    length, and RS-485 none at all: they are what the tables agree on, not what cannot be exceeded.

    Examples
    --------
    >>> [round(longest_line("RS-485", rate)) for rate in (9600, 100_000, 1_000_000, 10_000_000)]
    [1219, 1219, 122, 12]
    """
    one = _interface(interface)
    rate = check_scalar("bit_rate", bit_rate, "bit/s", 50, 10e6)
    return min(one.length, one.product / rate) if rate <= one.bit_rate else 0.0


def choose(
    n_stations: int,
    length: float,
    bit_rate: float,
    *,
    duplex: Literal["half", "full"] = "half",
    unit_load: float = 1.0,
) -> pd.DataFrame:
    """Return which interfaces fit a line of one master and its slaves, and why others do not.

    Parameters
    ----------
    n_stations : int
        Stations, the master included, 2..256.
    length : float
        Length of the line, 0..100000 [m].
    bit_rate : float
        Bit rate, 50..10e6 [bit/s].
    duplex : {"half", "full"}, default "half"
        Whether both sides speak in turn or at once; Modbus needs ``"half"``.
    unit_load : float, default 1
        Load of a receiver in unit loads of RS-485, 0.125..1; one is about 12 kohm.

    Returns
    -------
    pandas.DataFrame
        One row an interface: ``interface``, ``fits``, ``why_not`` (empty if it fits),
        ``stations`` (most on the line), ``longest_m`` at this bit rate, ``wires`` and ``source``.

    Raises
    ------
    ArgumentError
        If an argument is out of its range.

    Notes
    -----
    Every slave of a master has to answer, so a line has as many drivers as stations; RS-232 and
    RS-422 have one for each direction, which is two stations. The 31 addresses that lee2012
    (section III.2.a) takes from RS-485 are 32 unit loads less the master: a count of stations,
    not addresses, and with receivers of an eighth of a unit load it is 255.

    Examples
    --------
    One junction box on a line of its own, then both on one:

    >>> [list(choose(n, 60, 9600).query("fits")["interface"]) for n in (2, 3)]
    [['RS-422', 'RS-485'], ['RS-485']]
    >>> print(choose(3, 2000, 9600).set_index("interface").why_not["RS-485"])
    2000 m are more than 1219 m
    """
    import pandas as pd

    count = check_whole("n_stations", n_stations, 2, 256)
    far = check_scalar("length", length, "m", 0, 1e5)
    load = check_scalar("unit_load", unit_load, "", 0.125, 1)
    if duplex not in ("half", "full"):
        raise ArgumentError(f"duplex is {duplex!r}; it must be half or full")
    rows = []
    for one in INTERFACES.values():
        longest = longest_line(one.name, bit_rate)
        # One driver a direction joins two stations, whatever number of receivers listens.
        most = 2 if one.drivers == 1 else int(one.receivers / load)
        faults = []
        if count > most:
            faults.append(f"{count} stations are more than {most}")
        if bit_rate > one.bit_rate:
            faults.append(f"{bit_rate:g} bit/s are more than {one.bit_rate:g} bit/s")
        elif far > longest:
            faults.append(f"{far:g} m are more than {longest:.4g} m")
        # A line with a pair for each direction carries one at a time as well.
        wires = one.wires.get(duplex, one.wires["full"])
        rows.append((one.name, not faults, "; ".join(faults), most, longest, wires, one.source))
    columns = ["interface", "fits", "why_not", "stations", "longest_m", "wires", "source"]
    return pd.DataFrame(rows, columns=columns)


def _interface(name: str) -> Interface:
    if name not in INTERFACES:
        raise ArgumentError(f"interface is {name!r}; it must be one of {', '.join(INTERFACES)}")
    return INTERFACES[name]
