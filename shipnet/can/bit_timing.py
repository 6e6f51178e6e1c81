"""How a bit is divided into time quanta: the settings of an AT90CAN128, and what they allow.

A bit is a synchronisation segment of one quantum, a propagation segment, and two phase segments;
the bus is read between the phase segments.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pandas as pd

from shipnet import datasets
from shipnet.errors import ArgumentError

__all__ = ["bus_length", "oscillator_tolerance", "published_lengths", "settings"]

Floats = npt.NDArray[np.float64]

#: Ranges of the AT90CAN128 [quanta], and the prescaler; Atmel 4250E, 2004, p. 236.
_PRESCALER, _SEGMENT, _JUMP, _QUANTA = 64, 8, 4, (8, 25)


def settings(
    clock: float, bit_rate: float, *, sample_point: float = 0.75, tolerance: float = 0.0
) -> pd.DataFrame:
    """Return all legal settings of an AT90CAN128 for a bit rate, the best sample point first.

    Parameters
    ----------
    clock : float
        Clock of the controller, 1e6 to 16e6 [Hz].
    bit_rate : float
        Wanted bit rate, 1e3 to 1e6 [bit/s].
    sample_point : float, default 0.75
        Wanted place of the sample in the bit, between 0 and 1.
    tolerance : float, default 0
        Largest error of the bit rate, 0..0.05.

    Returns
    -------
    pandas.DataFrame
        A row a setting: ``prescaler`` (BRP + 1), ``tq_ns``, ``quanta`` a bit, ``prs``, ``phs1``,
        ``phs2`` and ``sjw`` in quanta, ``sample_point_percent``, ``bit_rate_bit_per_s``,
        ``error_percent``, and the registers ``canbt1``, ``canbt2``, ``canbt3`` as hexadecimals.
        Sorted by the distance from the wanted sample point, then by the error of the bit rate,
        then by the number of quanta, the most first, then by the jump width, the widest first.
        Empty if there is none.

    Raises
    ------
    ArgumentError
        If an argument is out of range.

    Notes
    -----
    Phase segment 2 has two quanta or more and is no longer than phase segment 1; the jump width
    is no longer than either [1]_. With a prescaler of 1 the controller samples one quantum
    earlier than the segments say and cannot sample three times, as the table of [2]_ has it; with
    any other prescaler, bit SMP is set here, as it is there.

    References
    ----------
    .. [1] Atmel, "AT90CAN128", data sheet 4250E, 2004, p. 236; and R. Bosch GmbH, "CAN
       specification 2.0", 1991, section 10, for the jump width.
    .. [2] Atmel, "ATmega16/32/64/M1/C1", data sheet 7647O, 2015, tables 16-2 and section 16.10,
       the same CAN controller.

    Examples
    --------
    From [2]_: 125 kbit/s from 16 MHz with 16 quanta a bit, CANBT1 to 3 = 0E 0C 37:

    >>> table = settings(16e6, 125e3)
    >>> row = table.query("quanta == 16 and prs == 7 and phs1 == 4 and sjw == 1").iloc[0]
    >>> row[["canbt1", "canbt2", "canbt3"]].tolist(), float(row["sample_point_percent"])
    (['0x0E', '0x0C', '0x37'], 75.0)
    """
    hertz = _number("clock", clock, "Hz", 1e6, 16e6)
    rate = _number("bit_rate", bit_rate, "bit/s", 1e3, 1e6)
    wanted = _number("sample_point", sample_point, "", 1e-3, 1 - 1e-3)
    most = _number("tolerance", tolerance, "", 0, 0.05)
    segment = np.arange(1, _SEGMENT + 1)
    grid = np.meshgrid(
        np.arange(1, _PRESCALER + 1), segment, segment, segment, np.arange(1, _JUMP + 1)
    )
    brp, before, one, two, jump = (axis.ravel() for axis in grid)
    total = 1 + before + one + two
    # A quotient of round numbers may miss its value by a rounding.
    legal = (
        (total >= _QUANTA[0])
        & (total <= _QUANTA[1])
        & (two >= 2)
        & (two <= one)
        & (jump <= two)
        & (np.abs(hertz / (brp * total) / rate - 1) <= most + 1e-12)
    )
    columns = np.stack([brp, total, before, one, two, jump])
    prescaler, quanta, prs, phs1, phs2, sjw = columns[:, legal]
    real = hertz / (prescaler * quanta)
    error = real / rate - 1
    once = prescaler == 1
    sample = (1 + prs + phs1 - once) / quanta
    order = np.lexsort((-sjw, -quanta, np.abs(error), np.abs(sample - wanted).round(12)))
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
            "bit_rate_bit_per_s": real,
            "error_percent": 100 * error,
            "canbt1": _hex(prescaler - 1 << 1),
            "canbt2": _hex(sjw - 1 << 5 | prs - 1 << 1),
            "canbt3": _hex(phs2 - 1 << 4 | phs1 - 1 << 1 | ~once),
        }
    )
    return table.iloc[order].reset_index(drop=True)


def oscillator_tolerance(
    quanta: npt.ArrayLike, phs1: npt.ArrayLike, phs2: npt.ArrayLike, sjw: npt.ArrayLike
) -> Floats:
    r"""Return by how much the clocks of two nodes may each be off.

    The smaller of what an error frame and what resynchronisation within ten bits allow:

    .. math:: \Delta f \le \frac{\min(PS_1, PS_2)}{2 (13 N - PS_2)}, \quad
              \Delta f \le \frac{SJW}{20 N}

    Parameters
    ----------
    quanta : int or array_like of int, shape (...)
        Time quanta N of a bit, 4 or more.
    phs1, phs2, sjw : int or array_like of int, shape (...)
        Phase segments and jump width [quanta], 1 or more, the jump no longer than a segment.

    Returns
    -------
    ndarray of float, shape (...)
        Largest deviation of a clock from its nominal frequency, as a fraction.

    Raises
    ------
    ArgumentError
        If an argument is out of range.

    References
    ----------
    .. [1] F. Hartwich, A. Bassemir (Robert Bosch GmbH), "The configuration of the CAN bit
       timing", 6th international CAN conference, 1999; the two conditions of ISO 11898-1.

    Examples
    --------
    Ten quanta, both phase segments and the jump width 4, the highest that there is, allow the
    most: 1.58 % by [1]_, cut off.

    >>> round(float(oscillator_tolerance(10, 4, 4, 4)) * 100, 3)
    1.587
    """
    n, one, two, jump = (np.asarray(value, dtype=float) for value in (quanta, phs1, phs2, sjw))
    good = (one >= 1) & (two >= 1) & (jump >= 1) & (jump <= np.minimum(one, two))
    good = good & (one + two + 2 <= n) & (n <= 1e6)
    if not np.all(good):
        raise ArgumentError(
            f"quanta, phs1, phs2, sjw are {quanta!r}, {phs1!r}, {phs2!r}, {sjw!r}; they must be "
            "1 or more, sjw no longer than either phase, and the bit 2 quanta longer than both"
        )
    return np.asarray(np.minimum(np.minimum(one, two) / (2 * (13 * n - two)), jump / (20 * n)))


def bus_length(
    prs: npt.ArrayLike, tq: npt.ArrayLike, *, loop_delay: float, delay_per_metre: float = 5e-9
) -> Floats:
    r"""Return the longest bus that a propagation segment allows.

    The segment holds the way there and back, and the delay of both nodes:

    .. math:: L = \frac{PRS \, t_q / 2 - t_{loop}}{t_{line}}

    Parameters
    ----------
    prs : int or array_like of int, shape (...)
        Propagation segment [quanta], 1 or more.
    tq : float or array_like of float, shape (...)
        Time quantum [s], positive.
    loop_delay : float
        Delay of one node from its output over its transceiver back to its input, 0 or more [s].
        Opto-couplers count as well.
    delay_per_metre : float, default 5e-9
        Delay of the line [s/m], positive; 5 ns/m is usual for twisted pairs [1]_.

    Returns
    -------
    ndarray of float, shape (...)
        Length [m]; 0 if the nodes alone take longer than the segment.

    Raises
    ------
    ArgumentError
        If an argument is out of range.

    Notes
    -----
    Nothing of the phase segments is counted, so that they stay for what the clocks are off.
    Published lengths (`published_lengths`) assume nodes of their own.

    References
    ----------
    .. [1] Texas Instruments, "Introduction to the Controller Area Network (CAN)", SLOA101;
       recalled, the text was not opened.

    Examples
    --------
    At 1 Mbit/s with quanta of 62.5 ns and nodes of 100 ns:

    >>> round(float(bus_length(8, 62.5e-9, loop_delay=100e-9)), 1)
    30.0
    """
    loop = _number("loop_delay", loop_delay, "s", 0, 1)
    line = _number("delay_per_metre", delay_per_metre, "s/m", 1e-12, 1)
    segment = np.asarray(prs, dtype=float) * np.asarray(tq, dtype=float)
    if not np.all((np.asarray(prs) >= 1) & (segment > 0) & (segment < 1)):
        raise ArgumentError(
            f"prs is {prs!r} and tq is {tq!r} s; prs must be 1 or more, tq positive"
        )
    return np.asarray(np.maximum(segment / 2 - loop, 0) / line)


def published_lengths() -> pd.DataFrame:
    """Return the bus lengths that a maker publishes, by bit rate.

    Returns
    -------
    pandas.DataFrame
        ``bit_rate_kbit_per_s``, ``length_m`` and ``source``, the highest rate first.

    Examples
    --------
    >>> published_lengths().set_index("bit_rate_kbit_per_s").loc[125, "length_m"].item()
    500
    """
    return pd.read_csv(datasets.path("can_bus_lengths.csv"))


def _number(name: str, value: float, unit: str, low: float, high: float) -> float:
    whole = isinstance(value, int | float | np.integer | np.floating)
    if not whole or isinstance(value, bool) or not low <= value <= high:
        shown = f"{name} is {value!r} {unit}".rstrip()
        raise ArgumentError(f"{shown}; it must be {low:g}..{high:g}")
    return float(value)


def _hex(values: npt.NDArray[np.integer]) -> list[str]:
    return [f"0x{value:02X}" for value in values]
