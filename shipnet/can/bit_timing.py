"""Bit timing: the settings of a controller, and the bus length and clock error they allow.

A bit consists of a synchronisation segment of one quantum, a propagation segment and two phase
segments; the bus is sampled between the phase segments.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from shipnet import datasets
from shipnet.arrays import Floats
from shipnet.can.frame import check_bit_rate
from shipnet.fields import check_scalar
from shipnet.lazy import pd

#: Limits of the AT90CAN128: prescaler, segment, jump width, quanta per bit; Atmel 4250E, p. 236.
_PRESCALER, _SEGMENT, _JUMP, _QUANTA = 64, 8, 4, (8, 25)

_DELAY = 5e-9  #: Propagation delay of the line [s/m]; ISO 11898-2.


def bit_timings(
    clock: float, bit_rate: float, *, sample_point: float = 0.75, loop_delay: float = 150e-9
) -> pd.DataFrame:
    r"""Return all legal settings of an AT90CAN128 for a bit rate, best sample point first.

    Parameters
    ----------
    clock : float
        Clock of the controller, 1e6..16e6 [Hz].
    bit_rate : float
        Desired bit rate, 1e3..1e6 [bit/s].
    sample_point : float, default 0.75
        Desired sample point as a fraction of the bit, 0.001..0.999.
    loop_delay : float, default 150e-9
        Delay of a node from its output through the transceiver to its input, including
        optocouplers, 0..1 [s].

    Returns
    -------
    pandas.DataFrame
        One row per setting: ``prescaler``, ``tq_ns``, ``quanta`` per bit, ``prs``, ``phs1``,
        ``phs2`` and ``sjw`` in quanta, ``sample_point_percent``, registers ``canbt1`` to
        ``canbt3``, ``oscillator_tolerance_percent`` (largest error of each clock) and
        ``longest_bus_m`` (limited by the propagation segment). Sorted by sample point, closest
        first, then by most quanta and widest jump.

    Notes
    -----
    Phase segment 2 has at least two quanta and is not longer than phase segment 1, and the jump
    width is not longer than either segment [1]_. With prescaler 1 the controller samples each bit
    once, one quantum early, as in the table of [2]_; otherwise it samples three times (bit SMP).

    With N quanta per bit, two cases limit the relative error of each clock: reading an error frame,
    and ten bits between resynchronisations [3]_. The propagation segment must cover the propagation
    delay of the line in both directions and the loop delays of two nodes:

    .. math:: \Delta f \le \frac{\min(PS_1, PS_2)}{2 (13 N - PS_2)}, \quad
              \Delta f \le \frac{SJW}{20 N}, \quad
              L = \frac{PRS \, t_q / 2 - t_{loop}}{5\ ns/m}

    References
    ----------
    .. [1] Atmel, "AT90CAN128", data sheet 4250E, 2004, p. 236; jump width: R. Bosch GmbH, "CAN
       specification 2.0", 1991, section 10.
    .. [2] Atmel, "ATmega16/32/64/M1/C1", data sheet 7647O, 2015, tables 16-2 and section 16.10,
       the same CAN controller.
    .. [3] F. Hartwich, A. Bassemir (Robert Bosch GmbH), "The configuration of the CAN bit
       timing", 6th international CAN conference, 1999.

    Examples
    --------
    From [2]_: 125 kbit/s from 16 MHz with 16 quanta per bit, CANBT1 to 3 = 0E 0C 37:

    >>> table = bit_timings(16e6, 125e3)
    >>> row = table.query("quanta == 16 and prs == 7 and phs1 == 4 and sjw == 1").iloc[0]
    >>> row[["canbt1", "canbt2", "canbt3"]].tolist(), float(row["sample_point_percent"])
    (['0x0E', '0x0C', '0x37'], 75.0)
    >>> round(float(row["oscillator_tolerance_percent"]), 2), round(float(row["longest_bus_m"]))
    (0.31, 320)
    """
    hertz = check_scalar("clock", clock, "Hz", 1e6, 16e6)
    rate = check_bit_rate(bit_rate)
    target = check_scalar("sample_point", sample_point, "", 1e-3, 1 - 1e-3)
    loop = check_scalar("loop_delay", loop_delay, "s", 0, 1)
    segment = np.arange(1, _SEGMENT + 1)
    grid = np.meshgrid(
        np.arange(1, _PRESCALER + 1), segment, segment, segment, np.arange(1, _JUMP + 1)
    )
    brp, before, one, two, jump = (axis.ravel() for axis in grid)
    total = 1 + before + one + two
    legal = (
        (total >= _QUANTA[0])
        & (total <= _QUANTA[1])
        & (two >= 2)
        & (two <= one)
        & (jump <= two)
        & np.isclose(hertz / (brp * total), rate, rtol=1e-12, atol=0)
    )
    columns = np.stack([brp, total, before, one, two, jump])
    prescaler, quanta, prs, phs1, phs2, sjw = columns[:, legal]
    once = prescaler == 1
    sample = (1 + prs + phs1 - once) / quanta
    error_frame, ten_bits = phs2 / (2 * (13 * quanta - phs2)), sjw / (20 * quanta)
    order = np.lexsort((-sjw, -quanta, np.abs(sample - target).round(12)))
    table = pd.DataFrame(
        {
            "prescaler": prescaler,
            "tq_ns": prescaler / hertz * 1e9,
            "quanta": quanta,
            "prs": prs,
            "phs1": phs1,
            "phs2": phs2,
            "sjw": sjw,
            "sample_point_percent": 100 * sample,
            "canbt1": prescaler - 1 << 1,
            "canbt2": sjw - 1 << 5 | prs - 1 << 1,
            "canbt3": phs2 - 1 << 4 | phs1 - 1 << 1 | ~once,
            "oscillator_tolerance_percent": 100 * np.minimum(error_frame, ten_bits),
            "longest_bus_m": np.maximum(prs * prescaler / hertz / 2 - loop, 0) / _DELAY,
        }
    )
    registers = ["canbt1", "canbt2", "canbt3"]
    table[registers] = table[registers].map("0x{:02X}".format)
    return table.iloc[order].reset_index(drop=True)


def longest_bus(bit_rate: float) -> float:
    """Return the longest bus at a bit rate, as published by a manufacturer of controllers.

    Parameters
    ----------
    bit_rate : float
        Bit rate, 1e3..1e6 [bit/s].

    Returns
    -------
    float
        Length of the trunk at the same or the next higher published bit rate [m].

    Notes
    -----
    The documentation of the Beckhoff BX5100 lists lengths from 20 m at 1 Mbit/s (with optocouplers)
    to 5000 m at 10 kbit/s. `bit_timings` returns the length for each setting of the AT90CAN128.

    Examples
    --------
    >>> longest_bus(125e3), longest_bus(100e3)
    (500.0, 500.0)
    """
    rates, lengths = _published()
    return float(lengths[rates >= check_bit_rate(bit_rate)].max())


@cache
def _published() -> tuple[Floats, Floats]:
    """Return published bit rates [bit/s] and bus lengths [m]."""
    table = datasets.read("can_bus_lengths.csv")[["bit_rate_kbit_per_s", "length_m"]].astype(float)
    return table["bit_rate_kbit_per_s"].to_numpy() * 1e3, table["length_m"].to_numpy()
