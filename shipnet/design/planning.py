"""Planning of a design from an I/O list, a site and an option: home runs, boxes, and mixes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from math import ceil, inf
from types import MappingProxyType

import numpy as np

from shipnet.arrays import Floats, Indices
from shipnet.design.catalogue import Cable, cables, smallest, with_spare
from shipnet.design.designs import Design
from shipnet.design.drafting import Box, Draft, Laid, boxes, without_place
from shipnet.design.layout import Site, Strip
from shipnet.design.plan_asi import plan_asi
from shipnet.design.plan_stations import plan_can, plan_modbus
from shipnet.design.points import PointTable
from shipnet.design.rules import RuleSet, longest_responses
from shipnet.design.settings import Settings
from shipnet.errors import ArgumentError
from shipnet.fields import check_choice
from shipnet.signals import SIGNALS

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
        for cable, strip in _trunks(draft, box):
            laid = Laid(draft.middle, box.place)
            used = sum(_wires([one for one in part if one[0]])[0] for part in strip)
            run = draft.run("trunk", (draft.cabinet, name), laid, cable, used)
            draft.strips[run] = strip


def _trunks(draft: Draft, box: Box) -> list[tuple[Cable, Strip]]:
    """Divide the points of a box among cables that are large enough; those of a kept box stay."""
    largest = max(c.conductors for c in cables().values() if "hardwired" in c.buses)
    made = list[tuple[Cable, Strip]]()
    left = [(draft.tags[row], draft.signals[row], int(draft.wires[row])) for row in box.rows]
    old = [*_kept_trunks(draft, box.name)]
    stay = {place for _, strip in old for part in strip for place in part}.intersection(left)
    left = [place for place in left if place not in stay]
    for cable, strip in old:
        parts = [[one if one in stay else ("", *one[1:]) for one in part] for part in strip]
        for part in parts:
            for n, (tag, *form) in enumerate(part):
                like = next((one for one in left if [*one[1:]] == form and not tag), None)
                if like:
                    part[n] = like
                    left.remove(like)
        new: list[tuple[str, str, int]] = []
        for one in list(left):
            if 2 * sum(_wires(part)[1] for part in (*parts, [*new, one])) <= cable.conductors:
                new.append(one)
                left.remove(one)
        made.append((cable, [*parts, new] if new else parts))
    if not left:
        return made
    spare = draft.settings.spare
    each = np.array([(wires + 1) // 2 for _, _, wires in left])
    number = max(1, ceil(with_spare(2 * int(each.sum()), spare) / largest))
    while True:
        # Start a new part where the sum of pairs passes a multiple of an equal share.
        share = np.cumsum(each) - each / 2
        of = np.minimum((share * number / each.sum()).astype(np.intp), number - 1).tolist()
        divided = [[place for place, n in zip(left, of, strict=True) if n == k] for k in {*of}]
        pairs = [_wires(part)[1] for part in divided]
        if all(with_spare(2 * one, spare) <= largest for one in pairs) or number >= len(left):
            fresh = zip(pairs, divided, strict=True)
            return [*made, *((smallest(2 * one, spare=spare), [part]) for one, part in fresh)]
        number += 1


def _kept_trunks(draft: Draft, box: str) -> Iterator[tuple[Cable, Strip]]:
    """Yield the trunks of a box in the earlier design."""
    if draft.previous is not None:
        runs = draft.previous.cables
        for run, cable, b in zip(runs["run"], runs["cable"], runs["b"], strict=True):
            if b == box and run in draft.previous.strips:
                yield cables()[cable], draft.previous.strips[run]


def _wires(part: Sequence[tuple[str, str, int]]) -> tuple[int, int]:
    """Return the numbers of conductors and pairs needed; a common return counts once per signal."""
    common = {signal: SIGNALS[signal].common for _, signal, _ in part}
    alone = [wires for _, signal, wires in part if not common[signal]]
    shared = sum(wires - common[signal] for _, signal, wires in part if common[signal])
    shared += sum(common.values())
    return sum(alone) + shared, sum((wires + 1) // 2 for wires in alone) + ceil(shared / 2)


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
    keep: Design | None = None,
) -> Design:
    """Connect the points of a list by one option, except those for which `mix` names another.

    Points that an earlier design, `keep`, has in the same place keep their boxes and channels.

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
        draft = Draft(iolist, site, values, longest, keep)
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
