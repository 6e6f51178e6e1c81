"""RS-232, RS-422 and RS-485: their limits, and which of them fit a line.

The tables of several manufacturers agree on the limits. The standards themselves limit the
capacitance of an RS-232 line (2500 pF), not its length; for RS-485 they limit neither.
"""

from __future__ import annotations

from math import inf
from typing import NamedTuple

from shipnet.fields import check_scalar, check_whole
from shipnet.lazy import pd

#: Sources of the limits.
_NI = "National Instruments, PCMCIA-232 manual, table B-1"
_BRAINBOXES = "Brainboxes, FAQ 'RS232 RS422 RS485 standards'"
_TI = "Texas Instruments, SN75ALS174 data sheet SLLSFU5A, section 8.2.2.3"

#: The 4000 ft of the tables [m], and the product of bit rate and length [m bit/s]: 100 kbit/s over
#: 4000 ft, the same as 10 Mbit/s over 40 ft.
_FEET_4000 = 1219.0
_PRODUCT = _FEET_4000 * 100e3


class Interface(NamedTuple):
    """A serial interface standard, and the source of its limits."""

    #: Largest numbers of drivers and receivers on a line; for RS-485 with one unit load each.
    drivers: int
    receivers: int
    #: Longest line [m], highest bit rate [bit/s], and largest product of the two [m bit/s],
    #: which is infinite if a line may reach both limits at once.
    length: float
    bit_rate: float
    product: float
    #: Conductors for both directions, including a common conductor but not the screen.
    wires: int
    source: str


#: The interfaces by name.
INTERFACES = {
    "RS-232": Interface(1, 1, 15.0, 20e3, inf, 3, _NI),
    "RS-422": Interface(1, 10, _FEET_4000, 10e6, _PRODUCT, 5, f"{_NI}; {_BRAINBOXES}"),
    "RS-485": Interface(32, 32, _FEET_4000, 10e6, _PRODUCT, 3, f"{_NI}; {_BRAINBOXES}; {_TI}"),
}


def interfaces(n_stations: int, length: float, bit_rate: float) -> pd.DataFrame:
    r"""Return which serial interfaces fit a master with its slaves, and why the others do not.

    Parameters
    ----------
    n_stations : int
        Number of stations including the master, 2..256.
    length : float
        Length of the line, 0..100000 [m].
    bit_rate : float
        Bit rate, 300..10e6 [bit/s].

    Returns
    -------
    pandas.DataFrame
        One row per interface: ``interface``, ``fits``, ``why_not``, ``stations`` (largest number
        allowed), ``longest_m`` at this bit rate, ``wires`` and ``source``.

    Notes
    -----
    The maximum length of a balanced line depends on the bit rate r:

    .. math:: l \le \min \left( l_{max}, \frac{P}{r} \right)

    Every slave must respond, so a line has as many drivers as stations. RS-232 and RS-422 allow one
    driver per direction, enough for two stations. The 31 addresses that lee2012 (section III.2.a)
    derives from RS-485 are 32 unit loads less one for the master; 1/8 unit load would permit 255.

    Examples
    --------
    One junction box per line, then two on one line:

    >>> [list(interfaces(n, 60, 9600).query("fits")["interface"]) for n in (2, 3)]
    [['RS-422', 'RS-485'], ['RS-485']]
    >>> interfaces(3, 2000, 9600).set_index("interface").why_not["RS-485"]
    '2000 m is more than 1219 m'
    """
    count = check_whole("n_stations", n_stations, 2, 256)
    far = check_scalar("length", length, "m", 0, 1e5)
    rate = check_scalar("bit_rate", bit_rate, "bit/s", 300, 10e6)
    rows = []
    for name, one in INTERFACES.items():
        longest = min(one.length, one.product / rate) if rate <= one.bit_rate else 0.0
        # One driver per direction connects two stations, however many receivers listen.
        most = 2 if one.drivers == 1 else one.receivers
        faults = []
        if count > most:
            faults.append(f"{count} stations are more than {most}")
        if rate > one.bit_rate:
            faults.append(f"{rate:g} bit/s is more than {one.bit_rate:g} bit/s")
        elif far > longest:
            faults.append(f"{far:g} m is more than {longest:.4g} m")
        rows.append((name, not faults, "; ".join(faults), most, longest, one.wires, one.source))
    columns = ["interface", "fits", "why_not", "stations", "longest_m", "wires", "source"]
    return pd.DataFrame(rows, columns=columns)
