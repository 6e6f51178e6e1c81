"""Every point on wires of its own: to the cabinet, or to a box with a cable of many pairs."""

from __future__ import annotations

from math import ceil

import numpy as np
import numpy.typing as npt

from shipnet.design.catalogue import cables, smallest
from shipnet.design.drafting import Box, Draft, Laid, boxes, without_place

Rows = npt.NDArray[np.intp]


def plan_home_runs(draft: Draft, rows: Rows) -> None:
    """Give each point a cable of its own to the cabinet."""
    given = draft.given_lengths("home_run_m")
    known = np.isfinite(given) | draft.iolist.located
    without_place(draft, rows[~known[rows]])
    for row in rows[known[rows]]:
        wires = int(draft.wires[row])
        x, y, z = draft.places[row].tolist()
        laid = Laid(draft.middle, (x, y, z), float(given[row]))
        ends = draft.cabinet, draft.tags[row]
        draft.run("home run", ends, laid, smallest(wires, spare=0), wires)
        draft.connect(row, "hardwired", "", draft.cabinet, "", 0.0)


def plan_boxes(draft: Draft, rows: Rows) -> None:
    """Bring points to junction boxes, and each box to the cabinet with a cable of many pairs."""
    for box in boxes(draft, rows):
        name = draft.device(box.name, "box", "", box.place)
        for row, length in zip(box.rows, box.lengths, strict=True):
            draft.drop(row, name, box.place, "", float(length))
            draft.connect(row, "hardwired", "", name, "", 0.0)
        for part in _trunks(draft, box):
            used, pairs = _wires(draft, part)
            cable = smallest(2 * pairs, spare=draft.settings.spare)
            laid = Laid(draft.middle, box.place)
            draft.run("trunk", (draft.cabinet, name), laid, cable, used)


def _trunks(draft: Draft, box: Box) -> list[Rows]:
    """Divide the points of a box among cables that are large enough."""
    largest = max(c.conductors for c in cables().values() if c.bus == "hardwired") // 2
    room = int(largest / (1 + draft.settings.spare) + 1e-9)
    each = _pairs(draft, box.rows)
    number = max(1, ceil(each.sum() / room))
    while True:
        # Cut where the pairs so far pass an equal share.
        share = np.cumsum(each) - each / 2
        part = np.minimum((share * number / each.sum()).astype(np.intp), number - 1)
        parts = [box.rows[part == own] for own in range(number) if (part == own).any()]
        if all(_wires(draft, own)[1] <= room for own in parts) or number >= len(box.rows):
            return parts
        number += 1


def _wires(draft: Draft, rows: Rows) -> tuple[int, int]:
    """Return conductors in use and pairs of a trunk; common returns count once a kind."""
    signals = draft.iolist.points["signal"].to_numpy(object)[rows]
    returns = 0
    pairs = _pairs(draft, rows)
    alone = draft.common[rows] == 0
    for kind in dict.fromkeys(signals[~alone]):
        returns += int(draft.common[rows][signals == kind][0])
    own = int((draft.wires - draft.common)[rows].sum())
    shared = int((draft.wires - draft.common)[rows][~alone].sum()) + returns
    return own + returns, int(pairs[alone].sum()) + ceil(shared / 2)


def _pairs(draft: Draft, rows: Rows) -> npt.NDArray[np.intp]:
    return np.asarray((draft.wires[rows] + 1) // 2, dtype=np.intp)
