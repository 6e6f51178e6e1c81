"""The load of a bus from a recording of it."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import pandas as pd

from shipnet.can.batch import measure_frames
from shipnet.can.files.log import Log, read_log
from shipnet.can.layout import INTERMISSION
from shipnet.errors import ArgumentError

__all__ = ["LogLoad", "load_from_log"]

#: Bits on the line of each frame: from identifiers, DLC, data, extended, remote.
Lengths = Callable[..., npt.ArrayLike]


class LogLoad(NamedTuple):
    """How busy recorded buses were.

    Attributes
    ----------
    windows : pandas.DataFrame
        A row a frame: ``channel``, ``time_s``, and the ``load`` of the window that ends there.
    messages : pandas.DataFrame
        A row an identifier: ``channel``, ``arbitration_id``, ``extended``, ``frames``, ``bits``
        in all, ``load`` over the whole record, ``peak_load`` over its busiest window.
    total : pandas.DataFrame
        A row a bus: ``channel``, ``frames``, ``duration_s``, ``load``, ``peak_load``.
    """

    windows: pd.DataFrame
    messages: pd.DataFrame
    total: pd.DataFrame


def load_from_log(
    log: Log | str | os.PathLike[str],
    *,
    bit_rate: float,
    window: float = 1.0,
    lengths: Lengths | None = None,
) -> LogLoad:
    """Return the load of a bus over a sliding window, and what each identifier takes of it.

    Parameters
    ----------
    log : Log, str or path-like
        Frames, or a file for `read_log`.
    bit_rate : float
        Bit rate of the bus, 5e3 to 1e6 [bit/s]; a log does not hold it.
    window : float, default 1
        Length of the sliding window, positive [s].
    lengths : callable, optional
        ``lengths(ids, dlc, data, extended, remote)`` returns the length of each frame with stuff
        bits and intermission [bit]; by default the exact ones of ``shipnet.can.batch``.

    Returns
    -------
    LogLoad
        Loads as fractions, by bus.

    Raises
    ------
    ArgumentError
        If an argument is out of range, or `lengths` returns something else than positive numbers,
        one a frame.
    InputError
        As `read_log`.

    Notes
    -----
    A time stamp is taken for the end of its frame. Windows reach back from the end of a frame; the
    load of one that begins before the record is over the whole window, so the first are low, and
    one may exceed 1 by what its first frame reaches out of it, or by wrong time stamps. The load
    over the whole record counts from the start of its first frame. Error reports are left out.

    Examples
    --------
    A frame of 100 bits each 4 ms, at 125 kbit/s:

    >>> n = 1000
    >>> no = np.zeros(n, dtype=bool)
    >>> log = Log(np.arange(n) * 4e-3, np.full(n, "can0"), np.full(n, 0x10), no, no, no,
    ...           np.full(n, 8, dtype=np.uint8), np.zeros((n, 8), dtype=np.uint8))
    >>> load = load_from_log(log, bit_rate=125e3, lengths=lambda ids, *_: 100 + 0 * ids)
    >>> load.total[["frames", "load", "peak_load"]].round(3).values.tolist()
    [[1000.0, 0.2, 0.2]]
    """
    for name, value, low, high in (
        ("bit_rate", bit_rate, 5e3, 1e6),
        ("window", window, 1e-6, 1e9),
    ):
        if not isinstance(value, int | float | np.number) or not low <= value <= high:
            raise ArgumentError(f"{name} is {value!r}; it must be {low:g}..{high:g}")
    frames = log if isinstance(log, Log) else read_log(log)
    order = np.lexsort((frames.time, frames.channel))
    order = order[~frames.error[order]]
    time, channel, ids, extended, remote, _, dlc, data = (column[order] for column in frames[:8])
    if lengths is None:
        lengths = _exact
    bits = np.asarray(lengths(ids, dlc, data, extended, remote))
    if bits.shape != ids.shape or bits.dtype.kind not in "iuf" or not np.all(bits > 0):
        raise ArgumentError(f"lengths returned {bits!r}; it must return a positive number a frame")
    windows, messages, totals = [], [], []
    for name in np.unique(channel):
        at = channel == name
        when, size = time[at], bits[at].astype(float)
        load = _sliding(when, size, window) / (bit_rate * window)
        span = when[-1] - when[0] + size[0] / bit_rate
        windows.append(pd.DataFrame({"channel": name, "time_s": when, "load": load}))
        totals.append(
            {
                "channel": name,
                "frames": len(when),
                "duration_s": span,
                "load": size.sum() / bit_rate / span,
                "peak_load": load.max(),
            }
        )
        keys = ids[at] << 1 | extended[at]
        for key in np.unique(keys):
            mine = keys == key
            own = size[mine]
            messages.append(
                {
                    "channel": name,
                    "arbitration_id": key >> 1,
                    "extended": bool(key & 1),
                    "frames": len(own),
                    "bits": own.sum(),
                    "load": own.sum() / bit_rate / span,
                    "peak_load": _sliding(when[mine], own, window).max() / (bit_rate * window),
                }
            )
    return LogLoad(
        pd.concat(windows, ignore_index=True) if windows else _empty("channel time_s load"),
        pd.DataFrame(messages)
        if messages
        else _empty("channel arbitration_id extended frames bits load peak_load"),
        pd.DataFrame(totals) if totals else _empty("channel frames duration_s load peak_load"),
    )


def _exact(ids: Any, dlc: Any, data: Any, extended: Any, remote: Any) -> npt.NDArray[np.int64]:
    measured = measure_frames(ids, data, dlc, extended=extended, remote=remote)
    return np.asarray(measured.length, dtype=np.int64) + INTERMISSION


def _sliding(
    time: npt.NDArray[np.float64], bits: npt.NDArray[np.float64], window: float
) -> npt.NDArray[np.float64]:
    """Return the bits of the frames that ended within the window up to each of them."""
    summed = np.concatenate([[0.0], np.cumsum(bits)])
    # Stamps have microseconds: a frame exactly a window ago is out, in spite of roundings.
    first = np.searchsorted(time, time - window + 1e-7, side="left")
    last = np.searchsorted(time, time, side="right")
    return np.asarray(summed[last] - summed[first])


def _empty(columns: str) -> pd.DataFrame:
    names: Any = columns.split()
    return pd.DataFrame(columns=names)
