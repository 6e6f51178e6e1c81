"""RS-232, RS-422 and RS-485: their limits, which of them fit a line, and a check of RS-485.

The tables of several manufacturers agree on the limits. The standards themselves limit the
capacitance of an RS-232 line (2500 pF), not its length; for RS-485 they limit neither.
"""

from __future__ import annotations

from math import ceil, inf, nan
from typing import Any, NamedTuple

import numpy as np

from shipnet import datasets
from shipnet.answers import COLUMNS, Findings
from shipnet.arrays import Complexes
from shipnet.fields import check_fields, check_scalar, check_whole, number, record
from shipnet.lazy import pd
from shipnet.line.cable import Cable
from shipnet.line.network import CableRun, Load, Network
from shipnet.line.waveform import record_of

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


#: The thinnest cable that the Modbus guide allows for 1000 m, AWG 26: 133.9 ohm/km per wire at 20
#: degC (ASTM B258), with the 120 ohm and 5 ns/m of the catalogue's "rs-485".
_CABLE = Cable(2 * 0.1339, 120 * 5e-9, 5e-9 / 120)

#: Resistance between the wires of one unit load, which has 12 kohm from each to ground.
_UNIT_LOAD = 24e3

#: Resistance of a driver, which is our assumption, and the open-circuit voltage of the weakest one
#: [V], which gives 1.5 V at 54 ohm (TIA-485-A).
_SOURCE = 27.0
_DRIVER = 1.5 * (54 + _SOURCE) / 54

#: Lowest voltage of the bias, 5 V less 5 % [V].
_BIAS_SUPPLY = 4.75

#: Bits and samples per bit from which the eye is computed, and the fastest edge in bits.
_BITS, _SAMPLES, _EDGE = 12, 64, 0.01


def _resistance(help: str, **default: Any) -> Any:
    return number(1, 1e6, "ohm", help, optional=True, **default)


@record
class Rs485:
    """A two-wire RS-485 line of AWG 26 with 120 ohm and 5 ns/m, whose devices are spread evenly.

    The master is at one end. The drivers give 1.5 V at 54 ohm.

    Examples
    --------
    The resistance of the cable takes over a quarter of the idle voltage:

    >>> line = Rs485(300, 19200, unit_loads=24, bias=560, stub=2, rise_time=200e-9)
    >>> line.check().broken
    ['idle voltage: 0.1661 V at receiver, at least 0.2 V (1 violated)']
    """

    length: float = number(0.1, 1e4, "m", "Length of the trunk")
    bit_rate: float = number(300, 10e6, "bit/s", "Bit rate")
    unit_loads: float = number(0.125, 256, "", "Unit loads of all devices together", default=32.0)
    terminator: float | None = _resistance("Resistor at each end; None if open", default=120.0)
    bias: float | None = _resistance("Each of two bias resistors at the master", default=None)
    stub: float = number(0, 1e3, "m", "Length of each device's stub", default=0.0)
    rise_time: float | None = number(
        1e-9, 1e-3, "s", "Rise time of the drivers", default=None, optional=True
    )

    def __post_init__(self) -> None:
        check_fields(self)

    def network(self) -> tuple[Network, dict[str, float]]:
        """Return the line with the master at node t0, and the receivers' distances from it [m]."""
        taps = max(2, min(32, ceil(self.unit_loads)))
        step = self.length / (taps - 1)
        runs = [CableRun(f"t{k - 1}", f"t{k}", step, _CABLE) for k in range(1, taps)]
        if self.stub:
            runs += [CableRun(f"t{k}", f"s{k}", self.stub, _CABLE) for k in range(1, taps)]
        receivers = {runs[k - taps].b: k * step + self.stub for k in range(1, taps)}
        loads = dict.fromkeys(["t0", *receivers], Load(r=_UNIT_LOAD * taps / self.unit_loads))
        ends = [("t0", self.terminator), (f"t{taps - 1}", self.terminator)]
        for node, r in [*ends, ("t0", self.bias and 2 * self.bias)]:
            if r:
                loads[node] = loads[node] + Load(r=r) if node in loads else Load(r=r)
        return Network(runs, loads), receivers

    def eye(self) -> float:
        """Return the least voltage in the middle of a bit after the worst bits at a receiver [V].

        Of the response to a step, sampled once per bit, the first sample is due to the bit itself,
        and the change to each further one to an earlier bit. Edges last at least 1/100 of a bit.
        """
        network, receivers = self.network()
        loads = network.loads | {"t0": network.loads["t0"] + Load(r=_SOURCE)}
        driven, rows = Network(network.runs, loads), [network.index(node) for node in receivers]
        edge = max(self.rise_time or 0.0, _EDGE / self.bit_rate)

        def spectrum(s: Complexes) -> Complexes:
            x = s * edge / 2  # a raised-cosine edge
            step = -np.expm1(-2 * x) / (2 * x) / (1 + (x / np.pi) ** 2) / s
            return driven.transfer("t0", s)[rows] * step * _DRIVER / _SOURCE

        delays, dt = np.array([*receivers.values()]) * _CABLE.delay, 1 / self.bit_rate / _SAMPLES
        count = _BITS * _SAMPLES + ceil((delays.max() + edge) / dt)
        middle = edge / 2 + (np.arange(_BITS) + 0.5) / self.bit_rate
        waves = record_of(spectrum, count, dt, 3 / edge)
        pairs = zip(delays, waves, strict=True)
        bits = np.array([np.interp(late + middle, dt * np.arange(count), v) for late, v in pairs])
        return float((bits[:, 0] - abs(np.diff(bits)).sum(axis=1)).min())

    def check(self) -> Findings:
        """Check the line by the line model and, beside it, by rules of thumb.

        Without bias, the idle voltage is not verified: receivers may have a fail-safe of their own.
        """
        network, receivers = self.network()
        z = network.transfer("t0", [1e-6])[:, 0].real  # as at direct current
        limits = INTERFACES["RS-485"]
        values: dict[str, tuple[float, float]] = {
            "length": (self.length, nan),
            "length_at_bit_rate": (self.length, min(limits.length, limits.product / self.bit_rate)),
            "unit_loads_with_bias" if self.bias else "unit_loads": (self.unit_loads, nan),
            "terminator": (self.terminator or inf, nan),
            "stub": (self.stub, nan),
            "driver_load": (z[network.index("t0")], nan),
            "idle_voltage": (nan, nan),
            "eye": (self.eye(), nan),
        }
        if self.bias:
            idle = _BIAS_SUPPLY / (2 * self.bias) * min(z[network.index(one)] for one in receivers)
            load = 4 / (self.terminator or inf) + 2 * self.unit_loads / _UNIT_LOAD + 1 / self.bias
            values |= {"bias": (self.bias, nan), "idle_voltage": (idle, nan)}
            values["idle_voltage_of_short_line"] = _BIAS_SUPPLY / self.bias / load, nan
        if self.stub:
            longest = float((self.rise_time or nan) / 10 / _CABLE.delay)
            values["stub_of_rise_time"] = (self.stub if self.rise_time else nan), longest
        rules = datasets.read("modbus_rs485_rules.csv").set_index("rule").loc[[*values]]
        rules["value"], computed_high = np.array([*values.values()], dtype=float).T
        rules[["low", "high"]] = rules[["low", "high"]].apply(pd.to_numeric)
        rules["high"] = rules["high"].where(np.isnan(computed_high), computed_high)
        beyond = (rules["value"] < rules["low"]) | (rules["value"] > rules["high"])
        rules["verdict"] = np.where(rules["value"].isna(), "not verified", "met")
        rules.loc[beyond, "verdict"] = "violated"
        return Findings(rules.reset_index().rename(columns={"note": "why"})[[*COLUMNS]])
