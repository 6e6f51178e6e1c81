"""RS-232, RS-422 and RS-485: their limits, and which of them fit a line.

The tables of several manufacturers agree on the limits. The standards themselves limit the
capacitance of an RS-232 line (2500 pF), not its length; for RS-485 they limit neither.
"""

from __future__ import annotations

from math import ceil, inf, nan
from typing import NamedTuple

import numpy as np

from shipnet import datasets
from shipnet.answers import COLUMNS, Findings
from shipnet.arrays import Complexes
from shipnet.fields import check_scalar, check_whole
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


#: A cable of AWG 26, the thinnest that the Modbus guide allows for 1000 m: 133.9 ohm/km per wire at
#: 20 degC (ASTM B258), with the characteristic impedance and delay of the catalogue's "rs-485".
AWG_26 = Cable(2 * 0.1339, 120 * 5e-9, 5e-9 / 120)

#: Resistance between the wires of one unit load, which has 12 kohm from each to ground; resistance
#: of the weakest driver, which gives 1.5 V at 54 ohm (TIA-485-A), and its open-circuit voltage [V].
_UNIT_LOAD, _SOURCE = 24e3, 27.0
_DRIVER = 1.5 * (54 + _SOURCE) / 54

#: Lowest bias supply, 5 V less 5 %, and what the eye is computed from: bits, samples per bit, and
#: the least ratio of edge to bit, which bounds the work.
_BIAS_SUPPLY, _BITS, _SAMPLES, _EDGE = 4.75, 12, 64, 0.01


def rs485_line(
    length: float, unit_loads: float, terminator: float | None, bias: float | None, stub: float
) -> tuple[Network, dict[str, float]]:
    """Return a trunk with a driver at node t0, and the distances of its receivers [m]."""
    taps = max(2, min(32, ceil(unit_loads)))
    step = length / (taps - 1)
    runs = [CableRun(f"t{k}", f"t{k + 1}", step, AWG_26) for k in range(taps - 1)]
    runs += [CableRun(f"t{k}", f"s{k}", stub, AWG_26) for k in range(1, taps) if stub]
    receivers = {f"{'s' if stub else 't'}{k}": k * step + stub for k in range(1, taps)}
    loads = dict.fromkeys(["t0", *receivers], Load(r=_UNIT_LOAD * taps / unit_loads))
    ends = [(node, terminator) for node in ("t0", f"t{taps - 1}")]
    for node, r in [*ends, ("t0", bias and 2 * bias)]:
        if r:
            loads[node] = loads[node] + Load(r=r) if node in loads else Load(r=r)
    return Network(runs, loads), receivers


def least_eye(
    line: Network, receivers: dict[str, float], bit_rate: float, rise_time: float
) -> float:
    """Return the least voltage of a bit's middle after the worst bits, at any receiver [V].

    The weakest driver sends from node t0. Of the response to a step, sampled once per bit, the
    first sample is the bit's own, and each change to the next one is added by an earlier bit.
    """
    bit = 1 / bit_rate
    edge = max(rise_time, _EDGE * bit)
    driven = Network(line.runs, line.loads | {"t0": line.loads["t0"] + Load(r=_SOURCE)})
    rows = [line.index(node) for node in receivers]

    def spectrum(s: Complexes) -> Complexes:
        x = s * edge / 2  # a raised-cosine edge
        step = -np.expm1(-2 * x) / (2 * x) / (1 + (x / np.pi) ** 2) / s
        return driven.transfer("t0", s)[rows] * step * _DRIVER / _SOURCE

    longest = max(receivers.values()) * AWG_26.delay
    count = ceil((_BITS * bit + longest + edge) / bit * _SAMPLES)
    v = record_of(spectrum, count, bit / _SAMPLES, 3 / edge)
    eyes = []
    for wave, metres in zip(v, receivers.values(), strict=True):
        at = metres * AWG_26.delay + edge / 2 + (0.5 + np.arange(_BITS)) * bit
        own = np.interp(at, np.arange(count) * bit / _SAMPLES, wave)
        eyes.append(own[0] - abs(np.diff(own)).sum())
    return float(min(eyes))


def check_rs485(
    length: float,
    bit_rate: float,
    *,
    unit_loads: float = 32.0,
    terminator: float | None = 120.0,
    bias: float | None = None,
    stub: float = 0.0,
    rise_time: float | None = None,
) -> Findings:
    """Check a two-wire RS-485 line by a line model and, beside it, by rules of thumb.

    Parameters
    ----------
    length : float
        Length of the trunk, 0.1..10000 [m].
    bit_rate : float
        300..10e6 [bit/s].
    unit_loads : float, default 32
        Sum of the unit loads of all devices, 0.125..256; they are spread evenly.
    terminator : float, optional
        Resistor at each end, 1..1e6 [ohm], by default 120; None leaves the ends open.
    bias : float, optional
        Each of the two bias resistors, at the master, 1..1e6 [ohm]; None if there are none.
    stub : float, default 0
        Length of each device's stub, 0..1000 [m].
    rise_time : float, optional
        Rise time of the drivers, 1e-9..1e-3 [s]. The model takes at least 1/100 of a bit.

    Returns
    -------
    Findings
        The checks, each with value, limit, margin and source. Without bias, the idle voltage is not
        verified: receivers may have a fail-safe of their own.

    Notes
    -----
    The cable is AWG 26 with 120 ohm and 5 ns/m. The driver, at one end, gives 1.5 V at 54 ohm.

    Examples
    --------
    The bias of a short line would be enough, but the cable's resistance takes a quarter of it:

    >>> check_rs485(300, 19200, unit_loads=24, bias=560, stub=2, rise_time=200e-9).broken
    ['idle voltage: 0.1661 V at receiver, at least 0.2 V (1 violated)']
    """
    check_scalar("length", length, "m", 0.1, 1e4)
    check_scalar("bit_rate", bit_rate, "bit/s", 300, 10e6)
    check_scalar("unit_loads", unit_loads, "", 0.125, 256)
    check_scalar("stub", stub, "m", 0, 1e3)
    for name, value in (("terminator", terminator), ("bias", bias)):
        if value is not None:
            check_scalar(name, value, "ohm", 1, 1e6)
    if rise_time is not None:
        check_scalar("rise_time", rise_time, "s", 1e-9, 1e-3)
    rs485 = INTERFACES["RS-485"]
    line, receivers = rs485_line(length, unit_loads, terminator, bias, stub)
    z = line.transfer("t0", [1.0])[:, 0].real  # at 1 rad/s, a line is as at direct current
    values = {
        "length": (length, nan),
        "length_at_bit_rate": (length, min(rs485.length, rs485.product / bit_rate)),
        "unit_loads_with_bias" if bias else "unit_loads": (unit_loads, nan),
        "terminator": (terminator or inf, nan),
        "stub": (stub, nan),
        "driver_load": (z[line.index("t0")], nan),
        "idle_voltage": (nan, nan),
        "eye": (least_eye(line, receivers, bit_rate, rise_time or 0.0), nan),
    }
    if bias:
        idle = _BIAS_SUPPLY / (2 * bias) * min(z[line.index(node)] for node in receivers)
        loads = 4 / (terminator or inf) + 2 * unit_loads / _UNIT_LOAD + 1 / bias
        values |= {"bias": (bias, nan), "idle_voltage": (idle, nan)}
        values["idle_voltage_of_short_line"] = _BIAS_SUPPLY / bias / loads, nan
    if stub:
        longest = nan if rise_time is None else rise_time / 10 / AWG_26.delay
        values["stub_of_rise_time"] = (stub if rise_time else nan), longest
    rules = datasets.read("modbus_rs485_rules.csv").set_index("rule").loc[[*values]].reset_index()
    rules["value"], own = np.array([*values.values()], dtype=float).T
    rules[["low", "high"]] = rules[["low", "high"]].apply(pd.to_numeric)
    rules["high"] = rules["high"].fillna(pd.Series(own))
    missed = (rules["value"] < rules["low"]) | (rules["value"] > rules["high"])
    rules["verdict"] = np.where(
        missed, "violated", np.where(rules["value"].isna(), "not verified", "met")
    )
    return Findings(rules.rename(columns={"note": "why"})[[*COLUMNS]])
