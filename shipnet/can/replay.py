"""Play a simulated or recorded bus to a program that reads it through python-can."""

from __future__ import annotations

import time as clocks
from collections.abc import Callable
from typing import Any

import numpy as np

from shipnet.can.bus.simulation import BusRun
from shipnet.can.files.extras import load_extra
from shipnet.can.files.log import Log
from shipnet.errors import ArgumentError

__all__ = ["log_from_run", "replay"]


def log_from_run(
    run: BusRun,
    *,
    channel: str = "can0",
    payload: Callable[[str, int], bytes] | None = None,
) -> Log:
    """Return the frames that were sent on a simulated bus, as a log of it would hold them.

    Parameters
    ----------
    run : BusRun
        What `shipnet.can.bus.simulate` returned.
    channel : str, default "can0"
        Name of the bus.
    payload : callable, optional
        ``payload(message, number)`` returns the data of a message's frames, numbered from 0 in
        the order in which they are sent, 0..8 bytes; none by default.

    Returns
    -------
    Log
        Frames in the order of their end, which is their time stamp.

    Raises
    ------
    ArgumentError
        If a payload is no bytes or longer than 8.

    Examples
    --------
    >>> from shipnet.can.bus import simulate
    >>> table = {"name": ["level"], "arbitration_id": [5], "dlc": [2], "period_ms": [10]}
    >>> log = log_from_run(simulate(table, 0.03, 125e3), payload=lambda name, k: bytes([k, 7]))
    >>> log.time.tolist(), log.data[:, :2].tolist()
    ([0.0006, 0.0106, 0.0206], [[0, 7], [1, 7], [2, 7]])
    """
    statistics = run.statistics.set_index("message")
    sent = run.transmissions[run.transmissions["outcome"] == "sent"].sort_values("end_ms")
    names = sent["message"].astype(object)
    numbers = names.groupby(names).cumcount()
    data = np.zeros((len(sent), 8), dtype=np.uint8)
    dlc = np.zeros(len(sent), dtype=np.uint8)
    if payload is not None:
        for row, (name, number) in enumerate(zip(names, numbers, strict=True)):
            octets = payload(name, number)
            if not isinstance(octets, bytes | bytearray) or len(octets) > 8:
                raise ArgumentError(f"payload of {name!r} is {octets!r}; it must be 0..8 bytes")
            data[row, : len(octets)] = list(octets)
            dlc[row] = len(octets)
    no = np.zeros(len(sent), dtype=bool)
    return Log(
        sent["end_ms"].to_numpy() / 1e3,
        np.full(len(sent), channel),
        names.map(statistics["arbitration_id"]).to_numpy(dtype=np.int64),
        names.map(statistics["extended"]).to_numpy(dtype=bool),
        no,
        no,
        dlc,
        data,
    )


def replay(
    log: Log,
    bus: Any,
    *,
    speed: float = np.inf,
    clock: Callable[[], float] = clocks.monotonic,
    sleep: Callable[[float], object] = clocks.sleep,
) -> int:
    """Send the frames of a log on a bus of python-can, such as its virtual one.

    Parameters
    ----------
    log : Log
        Frames in the order of time; error reports are left out.
    bus : can.BusABC
        Where to send, such as ``can.Bus("ship", interface="virtual", preserve_timestamps=True)``;
        the program under test reads a second bus of the same name.
    speed : float, default infinity
        Seconds of the log that pass in a second; 1 is real time, infinity does not wait at all.
    clock, sleep : callable, optional
        Returns the time, and waits [s].

    Returns
    -------
    int
        Number of frames sent.

    Raises
    ------
    ArgumentError
        If `speed` is not positive, or times in the log fall.
    ImportError
        If python-can is missing.

    Notes
    -----
    Each frame is due by its own time stamp since the first, so delays do not add up. Messages
    carry the times of the log, which a virtual bus hands on if it was opened to preserve them.

    Examples
    --------
    >>> from shipnet.can.files import read_log
    >>> with can.Bus("ship", interface="virtual") as bus:  # doctest: +SKIP
    ...     replay(read_log("voyage.log"), bus, speed=1)
    """
    can = load_extra("can")
    if not isinstance(speed, int | float | np.number) or not speed > 0:
        raise ArgumentError(f"speed is {speed!r}; it must be positive")
    if np.any(np.diff(log.time) < 0):
        row = int(np.argmax(np.diff(log.time) < 0)) + 1
        raise ArgumentError(f"time of frame {row + 1} of the log lies before the one before it")
    begin = clock()
    first = log.time[0] if len(log.time) else 0.0
    count = 0
    for time, _, number, extended, remote, error, dlc, data in zip(*log[:8], strict=True):
        if error:
            continue
        if np.isfinite(speed):
            ahead = begin + (time - first) / speed - clock()
            if ahead > 0:
                sleep(ahead)
        message = can.Message(
            timestamp=float(time),
            arbitration_id=int(number),
            is_extended_id=bool(extended),
            is_remote_frame=bool(remote),
            dlc=int(dlc),
            data=None if remote else bytes(data[: min(dlc, 8)]),
        )
        bus.send(message)
        count += 1
    return count
