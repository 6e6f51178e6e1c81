"""Planning of a design from an I/O list, a site and an option: home runs, boxes, and mixes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from math import ceil, inf
from types import MappingProxyType

import numpy as np

from shipnet.arrays import Floats, Indices
from shipnet.design.catalogue import cables, smallest, with_spare
from shipnet.design.designs import Design
from shipnet.design.drafting import Box, Draft, Laid, boxes, without_place
from shipnet.design.layout import Site
from shipnet.design.plan_asi import plan_asi
from shipnet.design.plan_stations import plan_can, plan_modbus
from shipnet.design.points import PointTable
from shipnet.design.rules import RuleSet, longest_responses
from shipnet.design.settings import Settings
from shipnet.errors import ArgumentError
from shipnet.fields import check_choice

# Each point on its own wires, to the cabinet or to a box with a multi-pair cable -----------------


def plan_home_runs(draft: Draft, rows: Indices) -> None:
    """Connect each point to the cabinet by a cable of its own."""
    lengths = draft.given_lengths("home_run_m")
    located = np.isfinite(lengths) | draft.iolist.located
    without_place(draft, rows[~located[rows]])
    for row in rows[located[rows]]:
        wires = int(draft.wires[row])
        laid = Laid(draft.middle, draft.spots[row], length=float(lengths[row]))
        ends = draft.cabinet, draft.tags[row]
        draft.run("home run", ends, laid, smallest(wires, spare=0), wires)
        draft.connect(row, "hardwired", "", draft.cabinet, "", 0.0)


def plan_boxes(draft: Draft, rows: Indices) -> None:
    """Connect points to junction boxes, and each box to the cabinet by multi-pair cables."""
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


def _trunks(draft: Draft, box: Box) -> list[Indices]:
    """Divide the points of a box among cables that are large enough."""
    largest = max(c.conductors for c in cables().values() if "hardwired" in c.buses)

    def needed(pairs: int) -> int:
        return with_spare(2 * pairs, draft.settings.spare)

    each = (draft.wires[box.rows] + 1) // 2
    number = max(1, ceil(needed(int(each.sum())) / largest))
    while True:
        # Start a new part where the sum of pairs passes a multiple of an equal share.
        share = np.cumsum(each) - each / 2
        part = np.minimum((share * number / each.sum()).astype(np.intp), number - 1)
        parts = [box.rows[part == points] for points in range(number) if (part == points).any()]
        fits = all(needed(_wires(draft, points)[1]) <= largest for points in parts)
        if fits or number >= len(box.rows):
            return parts
        number += 1


def _wires(draft: Draft, rows: Indices) -> tuple[int, int]:
    """Return the numbers of conductors and pairs needed; a common return counts once per signal."""
    signals, common = draft.signals[rows], draft.common[rows]
    wires, alone = draft.wires[rows] - common, common == 0
    returns = sum(dict(zip(signals, common.tolist(), strict=True)).values())
    pairs = ((wires[alone] + 1) // 2).sum()
    return int(wires.sum()) + returns, int(pairs) + ceil((int(wires[~alone].sum()) + returns) / 2)


# The options, and a mix of them -----------------------------------------------------------------

_PLANNERS: Mapping[str, Callable[[Draft, Indices], None]] = MappingProxyType(
    {
        "home runs": plan_home_runs,
        "junction boxes": plan_boxes,
        "AS-i": plan_asi,
        "AS-i doubled": partial(plan_asi, doubled=True),
        "CAN": plan_can,
        "CAN doubled": partial(plan_can, doubled=True),
        "Modbus RTU": plan_modbus,
        "Modbus RTU doubled": partial(plan_modbus, doubled=True),
    }
)

#: The options: ways to connect points. In a doubled form, each line is laid twice. An AS-i module
#: has one port, so the second line has modules of its own; we assume that a point can be wired to
#: two modules at once, and count its cables, terminals and work twice.
OPTIONS = tuple(_PLANNERS)

#: Columns whose values a mix may name, in order of precedence.
_BY = ("tag", "signal", "system", "category", "type")


def plan(
    iolist: PointTable,
    site: Site,
    option: str,
    *,
    settings: Settings | None = None,
    mix: Mapping[str, str] | None = None,
    name: str | None = None,
    rules: RuleSet | None = None,
) -> Design:
    """Connect the points of a list by one option, except those for which `mix` names another.

    If a response exceeds the limits of `rules`, the points are planned again within these limits;
    points that would then no longer fit are exempt from them.
    """
    choose = mix or {}
    check_choice("option", option, OPTIONS)
    for one in choose.values():
        check_choice("one of mix", one, OPTIONS)
    values = (settings or Settings()).replace({"detour": site.detour, "tails": site.tails})
    chosen = np.full(len(iolist), option, dtype=object)
    left = set(choose)
    for column in reversed(_BY) if choose else ():
        column_values = iolist.points[column]
        left -= set(column_values)
        named = column_values.map(lambda value: choose.get(value, ""))
        chosen = np.where(named != "", named, chosen)
    if left:
        raise ArgumentError(
            f"mix names {sorted(left)[0]!r}; it is not a tag, signal, system, category or type of "
            "the list"
        )
    if not values.field_barriers:
        on_bus = ~np.isin(chosen, ["home runs", "junction boxes"])
        chosen[on_bus & (iolist.points["ex"] != "").to_numpy()] = "home runs"

    def planned(longest: Floats | float = inf) -> Design:
        draft = Draft(iolist, site, values, longest)
        for way, planner in _PLANNERS.items():
            rows = np.flatnonzero(chosen == way)
            if len(rows):
                planner(draft, rows)
        return draft.made(name or ("mix" if choose else option))

    made = planned()
    longest = longest_responses(rules or (), iolist.points, values.host_time)
    while (made.points["response_ms"] > 1e3 * longest).any():
        within = planned(longest)
        out = (made.points["fits"] & ~within.points["fits"]).to_numpy() & np.isfinite(longest)
        if not out.any():
            return replace(within, without_limits=made)
        longest[out] = inf
    return made
