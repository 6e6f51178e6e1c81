"""Figs 12 and 13: what a two-channel scope shows, and readings of the response time in it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from shipnet.engine.faults import ModbusBreak
from shipnet.engine.simulation import simulate
from shipnet.engine.system import System
from shipnet.papers.lee2012.serial import JB1, JB3, LINE, answer, read

if TYPE_CHECKING:
    import pandas as pd

Trace = tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]

#: A response of 8 bytes, as Fig 4(b) draws it: its own address, a count of two bytes.
_DRAWN = bytes([JB1, 3, 0, 2, 0, 100, 0, 0])


def response_scope() -> dict[str, Trace]:
    """Return both lines during one request and its response as Fig 4 draws them: Fig 13.

    Returns
    -------
    dict of str to (ndarray, ndarray)
        Time [s] and level of what the AMS and the box send, the request from time 0 on.

    Examples
    --------
    >>> time, level = response_scope()["JB1 sends"]
    >>> round(1e3 * float(time[level == 0][-1]), 1) <= 22.3
    True
    """
    request = read(1).rtu(JB1)
    begin = LINE.frame_time(len(request)) + LINE.t35
    end = begin + LINE.frame_time(len(_DRAWN)) + LINE.t35
    return {
        "AMS sends": _trace([request], [0.0], end),
        "JB1 sends": _trace([_DRAWN], [begin], end),
    }


def _trace(frames: list[bytes], begins: list[float], end: float) -> Trace:
    """Return the line with frames that begin at these times."""
    if not frames:
        return np.array([0.0, end]), np.ones(2)
    ends = [begin + LINE.frame_time(len(f)) for f, begin in zip(frames, begins, strict=True)]
    gaps = [after - before for before, after in zip(ends, [*begins[1:], end], strict=True)]
    waveform = LINE.waveform(frames, gap=gaps, start=begins[0])
    return waveform.time, waveform.level


def switch_over_scope(system: System, *, cut: float = 1.5, end: float = 3.4) -> dict[str, Trace]:
    """Return what the AMS sends on both channels around a cut of channel 1: Fig 12(b).

    Parameters
    ----------
    system : System
        The system.
    cut : float, default 1.5
        When channel 1 is unplugged [s].
    end : float, default 3.4
        When the picture ends [s].

    Returns
    -------
    dict of str to (ndarray, ndarray)
        Time [s] and level of each channel: requests, and the responses of the boxes to them.

    Examples
    --------
    >>> sorted(switch_over_scope(System()))
    ['channel 1', 'channel 2']
    """
    run = simulate(system, faults=ModbusBreak("1", start=cut), until=end)
    traces = {}
    for channel, unit in (("channel 1", JB1), ("channel 2", JB3)):
        frames, begins = [], []
        own = run.requests().query(f"channel == {channel[-1]}")
        for time, outcome in zip(own["time_s"], own["outcome"], strict=True):
            request = read(system.registers).rtu(unit)
            frames.append(request)
            begins.append(float(time))
            if outcome == "answered":
                wait = LINE.frame_time(len(request)) + LINE.t35 + system.firmware.processing
                frames.append(answer(system.registers).rtu(unit))
                begins.append(float(time) + wait)
        traces[channel] = _trace(frames, begins, end)
    return traces


def response_readings(system: System) -> pd.DataFrame:
    r"""Return how long a request and its response take, read in several ways.

    .. math:: t = \left( 8 + 3.5 + n \right) \frac{b}{r}

    Parameters
    ----------
    system : System
        The system, for its serial line, registers and firmware.

    Returns
    -------
    pandas.DataFrame
        One row a reading: ``reading``, ``bits`` of a character, ``bytes`` of the response, and
        ``time_ms`` from the first bit of the request to the last one of the response; without
        processing, but for the last two rows, which are the system itself up to the first and up
        to the last bit of its response.

    Notes
    -----
    The paper prints 22.3 us from request to response (figure 13), 0.21 bit times. Read as ms, it
    is request, silence and response of 8 bytes each, as figure 4 draws them, in characters of 11
    bits, to the last digit; no FC03 response has 8 bytes, for 5 + 2 n is odd. That the sum fits
    may be chance: from the request alone 9.1 ms of processing would give it too.

    References
    ----------
    .. [1] J. H. Lee, D. S. Kim, "Design and implementation of distributed control system based on
       dual field-bus for ship engine", J. IEEK 49-SC(2), 2012, section IV.2.c, figures 4 and 13.

    Examples
    --------
    >>> table = response_readings(System())
    >>> table.loc[table["time_ms"].between(22.25, 22.35), ["bits", "bytes"]].values.tolist()
    [[11, 8]]
    """
    import pandas as pd

    rate = system.serial.bit_rate
    own = system.serial.character_bits
    cases = [
        ("as drawn in figure 4, 8 bits a character", 8, 8),
        ("as drawn, without the parity bit", 10, 8),
        ("as drawn, 8E1", 11, 8),
        ("one register, 8E1", 11, 7),
        ("two registers, 8E1", 11, 9),
    ]
    rows = [(name, bits, size, (8 + 3.5 + size) * bits / rate * 1e3) for name, bits, size in cases]
    size = 5 + 2 * system.registers
    whole = system.serial.frame_time(8) + system.poll.shortest_timeout
    first = whole - system.serial.frame_time(size)
    rows.append(("all points, to the first bit of the response", own, size, first * 1e3))
    rows.append(("all points, to the last bit of the response", own, size, whole * 1e3))
    return pd.DataFrame(rows, columns=["reading", "bits", "bytes", "time_ms"])
