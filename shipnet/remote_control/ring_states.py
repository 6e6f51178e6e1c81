"""All states that a ring can come into, and what its four variables show of the truth."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

import numpy as np

from shipnet.fields import check_whole
from shipnet.remote_control.packet import PACKET_START
from shipnet.remote_control.ring_buffer import Ring, Rule

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["case_table", "explore"]


def case_table(size: int = 128, rounds: int = 3) -> pd.DataFrame:
    """Return how often each case shows, by how far the writer leads the reader.

    Parameters
    ----------
    size : int, default 128
        Size of the ring, 2..1024.
    rounds : int, default 3
        Up to how many rounds the writer leads, 1..16.

    Returns
    -------
    pandas.DataFrame
        A row for each round: the lead ``from`` and ``to`` [byte], and a, b, c and d: in how many
        of the size x size pairs of lead and reader's place the case shows.

    Raises
    ------
    ArgumentError
        If an argument is out of its range.

    Notes
    -----
    A lead of one round exactly is a full ring: nothing is lost yet, though case c shows.

    Examples
    --------
    >>> case_table(128)
       from   to     a     b     c     d
    0     0  127     0  8256     0  8128
    1   128  255  8128     0  8256     0
    2   256  383     0  8256     0  8128

    The writer has passed the reader in the second and third row. In half of the second row the
    case is the one that the paper calls impossible, and the third looks like the first.
    """
    import pandas as pd

    check_whole("size", size, 2, 1024)
    check_whole("rounds", rounds, 1, 16)
    lead, place = np.ogrid[: rounds * size, :size]
    written = lead + place
    same = written // size % 2 == 0
    ahead = written % size >= place
    shown = {"a": same & ~ahead, "b": same & ahead, "c": ~same & ahead, "d": ~same & ~ahead}
    first = np.arange(rounds) * size
    table = {case: at.reshape(rounds, -1).sum(axis=1) for case, at in shown.items()}
    return pd.DataFrame({"from": first, "to": first + size - 1, **table})


def explore(size: int, rule: Rule = "literal", *, most_unread: int | None = None) -> pd.DataFrame:
    """Return every state that some order of storing and extracting reaches, and the step from it.

    Parameters
    ----------
    size : int
        Size of the ring, 2..16.
    rule : {"literal", "meant", "mended"}, default "literal"
        How the reader decides, see `Ring`.
    most_unread : int, optional
        How many bytes may be unread before the writer rests, 0..4 * size; three rounds if
        omitted.

    Returns
    -------
    pandas.DataFrame
        A row for each state: ``no``, ``ring_f``, ``get_no``, ``ring_get_f``; ``unread``, the
        truth; ``first_round``, whether there are cells never stored in; the ``case`` that shows;
        and the ``action`` of the reader in it, with the bytes it has ``lost``, and whether what
        it took was ``stale``.

    Raises
    ------
    ArgumentError
        If an argument is out of its range.

    Notes
    -----
    Every byte stored is 0xCC, so that a repair finds a packet's start at once. States are the
    same if writer and reader stand at the same places with the same flags, as many bytes are
    unread, and as many cells were stored in: these alone decide what follows.

    Examples
    --------
    With at most three bytes unread in a ring of four, nothing can be wrong, and by the meant rule
    nothing is. By the letter, the reader reads on in the empty ring, and passes the writer:

    >>> for rule in ("meant", "literal"):
    ...     table = explore(4, rule, most_unread=3)
    ...     print(sorted(set(table.case)), table.lost.max(), int(table.stale.sum()))
    ['b', 'd'] 0 0
    ['a', 'b', 'c', 'd'] 2 68
    """
    import pandas as pd

    check_whole("size", size, 2, 16)
    limit = (
        3 * size if most_unread is None else check_whole("most_unread", most_unread, 0, 4 * size)
    )
    start = Ring(size, rule)
    seen, rows, waiting = {_key(start)}, [], deque([start])
    while waiting:
        ring = waiting.popleft()
        after = ring.copy()
        step = after.extract()
        row = (*ring.state, ring.unread, ring.written < size)
        rows.append((*row, step.case, step.action, step.lost, step.stale))
        following = [after]
        if ring.unread < limit:
            more = ring.copy()
            more.store(PACKET_START)
            following.append(more)
        for other in following:
            if _key(other) not in seen:
                seen.add(_key(other))
                waiting.append(other)
    columns = ["no", "ring_f", "get_no", "ring_get_f", "unread", "first_round"]
    return pd.DataFrame(rows, columns=[*columns, "case", "action", "lost", "stale"])


def _key(ring: Ring) -> tuple[int, ...]:
    return (*ring.state, ring.unread, min(ring.written, ring.size))
