"""What the bus does next, event by event, in whole nanoseconds.

The most important frame that waits when the bus falls free is sent, and nothing interrupts it.
All releases of an instant are gathered before the arbitration, as all nodes begin together.
"""

from __future__ import annotations

from heapq import heappop, heappush
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

__all__ = ["NEVER", "OVERWRITTEN", "WAITING", "Releases", "send_all", "unpacked"]

Integers = npt.NDArray[np.int64]

#: What stands for the start of a frame that never began.
WAITING, OVERWRITTEN = -1, -2

#: A time behind all others [ns].
NEVER = 1 << 62


class Releases(NamedTuple):
    """Frames that ask for the bus, in the order of their release.

    Attributes
    ----------
    time : ndarray of int64, shape (n_releases,)
        Times of release [ns], not falling.
    message : ndarray of int64, shape (n_releases,)
        Number of the message, which is its priority; 0 is the highest.
    duration : ndarray of int64, shape (n_releases,)
        Time on the bus with intermission [ns].
    """

    time: Integers
    message: Integers
    duration: Integers


class Unpacked(NamedTuple):
    """Releases as lists, which a loop reads faster than arrays."""

    due: list[int]
    """times of release, `NEVER` behind the last [ns]"""
    rank: list[int]
    duration: list[int]
    item: list[int]
    """priority and place in one number: the smallest is the next to be sent"""
    mask: int
    """which bits of an item are its place"""


def unpacked(releases: Releases) -> Unpacked:
    """Return releases in the form in which the bus works on them.

    Parameters
    ----------
    releases : Releases
        Frames that ask for the bus.

    Returns
    -------
    Unpacked
        The same as lists.

    Examples
    --------
    >>> unpacked(Releases(*np.array([[0, 7], [1, 0], [10, 10]]))).item
    [4, 1]
    """
    number = len(releases.time)
    shift = number.bit_length()
    return Unpacked(
        [*releases.time.tolist(), NEVER],
        releases.message.tolist(),
        releases.duration.tolist(),
        (releases.message << shift | np.arange(number)).tolist(),
        (1 << shift) - 1,
    )


def send_all(releases: Releases, horizon: int, *, overwrite: bool) -> list[int]:
    """Return when each frame begins on a bus without errors.

    Parameters
    ----------
    releases : Releases
        Frames that ask for the bus.
    horizon : int
        Time from which no frame begins [ns].
    overwrite : bool
        Whether a release replaces an older frame of its message that still waits.

    Returns
    -------
    list of int
        Start [ns]; -1 for a frame still waiting at the end, -2 for one that was overwritten.

    Examples
    --------
    >>> frames = Releases(*np.array([[0, 0, 5, 9], [1, 0, 1, 1], [10, 10, 10, 10]]))
    >>> send_all(frames, 100, overwrite=False), send_all(frames, 100, overwrite=True)
    ([10, 0, 20, 30], [-2, 0, -2, 10])
    """
    due, ranks, durations, items, mask = unpacked(releases)
    newest = [-1] * (int(releases.message.max(initial=0)) + 1)
    start = [WAITING] * len(ranks)
    waiting: list[int] = []
    at, upcoming, now = 0, due[0], 0
    while now < horizon:
        while upcoming <= now:
            if overwrite:
                rank = ranks[at]
                if newest[rank] >= 0:
                    start[newest[rank]] = OVERWRITTEN
                newest[rank] = at
            heappush(waiting, items[at])
            at += 1
            upcoming = due[at]
        if not waiting:
            if upcoming == NEVER:
                break
            now = upcoming
            continue
        picked = heappop(waiting) & mask
        if overwrite:
            if start[picked] == OVERWRITTEN:
                continue
            newest[ranks[picked]] = -1
        start[picked] = now
        now += durations[picked]
    return start
