"""Plans from files as devices on the cable of the AS-i bench."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from math import ceil
from typing import Any

from shipnet import asi
from shipnet.asi.plan import read_plan
from shipnet.asi.segment import Element
from shipnet.asi.slave import slave_key
from shipnet.errors import ArgumentError, InputError
from shipnet.tools._view import Loaded, read_file
from shipnet.tools.asi_bench import CABLE_CHOICES, AsiBench, Device


def open_plan(inputs: AsiBench, name: str, content: bytes) -> Loaded:
    """Return the inputs with the plan of a file, and what the bench draws differently."""
    plan = read_file(name, content, read_plan)
    try:
        drawn = replace(inputs, sender=1, **_fields(plan))
    except ArgumentError as problem:
        raise InputError(name, f"the bench cannot draw this plan: {problem}") from None
    known = [_plain(element) for element in drawn.plan]
    unlike = Counter(
        type(element).__name__.lower()
        for element in plan
        if not isinstance(element, asi.CableRun) and _plain(element) not in known
    )
    remarks = list(plan.remarks)
    metres = sum(float(run.length) for run in plan.cables)
    if abs(sum(float(run.length) for run in drawn.plan.cables) - metres) > 0.01:
        remarks.append(f"the cable, {metres:g} m with spurs, is drawn to the decimetre")
    if unlike:
        which = ", ".join(f"{kind} ({number})" for kind, number in unlike.items())
        remarks.append(
            f"drawn with the bench's own profile, voltage, current, delay and load: {which}; "
            f"slaves draw {drawn.current_ma:g} mA each, the most of any"
        )
    return Loaded(drawn, remarks)


def _plain(element: Element) -> Element:
    """Return an element without its place and address."""
    if isinstance(element, asi.Repeater):
        return replace(element, a="a", b="b")
    if isinstance(element, asi.Slave):
        return replace(element, node="", label="1A" if slave_key(element.label)[1] else "1")
    return replace(element, node="a") if not isinstance(element, asi.CableRun) else element


def _fields(plan: asi.Plan) -> dict[str, Any]:
    """Return the bench's fields for a plan; raise ArgumentError if it is not one straight cable."""
    if len(plan.masters) != 1 or len(plan.lines) != 1:
        counts = f"{len(plan.masters)} masters and {len(plan.lines)} lines"
        raise ArgumentError(f"it has {counts}; the bench has one of each")
    cables = {run.made_of for run in plan.cables}
    catalogue = {asi.CableRun("a", "b", 1, cable).made_of: n for n, cable in CABLE_CHOICES.items()}
    if len(cables) > 1 or not cables <= set(catalogue):
        raise ArgumentError(f"its cables must all be of one type: {', '.join(catalogue.values())}")
    path, ring = _trunk(plan)
    lengths = {frozenset((run.a, run.b)): float(run.length) for run in plan.cables}
    place, metres, cuts = {path[0]: 0.0}, 0.0, []
    for a, b in pairwise([*path, path[0]] if ring else path):
        length = lengths.get(frozenset((a, b)))
        cuts += [Device("repeater", metres, 0)] if length is None else []
        metres += length or 0
        # The node on the right of a repeater needs a place of its own.
        place.setdefault(b, metres if length is not None else round(metres + 0.01, 2))
    spurs = dict.fromkeys(place, 0.0)
    for run in plan.cables:
        for near, end in ((run.a, run.b), (run.b, run.a)):
            if end not in path:
                place[end], spurs[end] = place[near], float(run.length)
    keys = [slave_key(slave.label)[0] for slave in plan.slaves]
    if len(set(keys)) < len(keys) or min(keys, default=2) < 2:
        raise ArgumentError("two of its slaves have the same address, or one has address 0")
    shared = Counter(key >> 1 for key in keys)
    # Slaves that share addresses are the last.
    ranked = sorted(
        zip(keys, plan.slaves, strict=True), key=lambda one: (shared[one[0] >> 1], one[0])
    )
    slaves = [slave for _, slave in ranked]
    of_kind: dict[str, Sequence[Any]] = {
        "master": plan.masters,
        "scope": plan.masters,
        "supply": plan.supplies,
    }
    devices = [
        *(Device(kind, place[one.node], 0) for kind, some in of_kind.items() for one in some),
        *(Device("slave", place[one.node], spurs[one.node]) for one in slaves),
        *(
            Device("resistor" if one.inductance >= 1 else "terminator", place[one.node], 0)
            for one in plan.terminators
        ),
        *cuts,
    ]
    return {
        "devices": tuple(map(str, devices)),
        "length": round(metres, 1),
        "cable": catalogue[cables.pop()],
        "ring": ring,
        "current_ma": ceil(max((1e3 * one.current for one in slaves), default=0.0) - 1e-9),
        "pairs": sum(number > 1 for number in shared.values()),
    }


def _trunk(plan: asi.Plan) -> tuple[list[str], bool]:
    """Return the nodes along the cable, and whether it is a ring; spurs of slaves are left out."""
    joins = [(run.a, run.b) for run in plan.cables] + [(one.a, one.b) for one in plan.repeaters]
    near: dict[str, list[str]] = {}
    for a, b in joins:
        near.setdefault(a, []).append(b)
        near.setdefault(b, []).append(a)
    others: list[Any] = [*plan.masters, *plan.supplies, *plan.terminators]
    slaves = Counter(slave.node for slave in plan.slaves)
    taken = {one.node for one in others} | {end for one in plan.repeaters for end in (one.a, one.b)}
    spurs = {n for n in near if len(near[n]) == 1 and slaves[n] == 1 and n not in taken}
    trunk = {node: [one for one in near[node] if one not in spurs] for node in near}
    for node, ahead in trunk.items():
        if node not in spurs and len(ahead) > 2:
            raise ArgumentError(
                f"its cable branches at {node}; a branch may only be a spur with one slave"
            )
    ends = [node for node, ahead in trunk.items() if node not in spurs and len(ahead) < 2]
    path, last = [ends[0] if ends else plan.masters[0].node], ""
    while ahead := [one for one in trunk[path[-1]] if one != last and one != path[0]]:
        last = path[-1]
        path.append(ahead[0])
    for _ in range(2 if ends else 0):  # a spur at the end of the cable is drawn as part of it
        path.reverse()
        path += [one for one in near[path[-1]] if one in spurs and one not in path][:1]
    if path.index(plan.masters[0].node) > len(path) / 2:
        path.reverse()
    return path, not ends
