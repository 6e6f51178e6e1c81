"""Search for the fewest repeaters and supplies with which a plan meets every rule."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations, count
from math import ceil, inf
from typing import Any, NamedTuple, TypeAlias

from shipnet.asi.plan_file import note_key
from shipnet.asi.rules import first_violated, rule_limits
from shipnet.asi.segment import Repeater, Segment, Supply, nodes_of
from shipnet.errors import ArgumentError
from shipnet.lazy import pd
from shipnet.line.network import CableRun

#: Maximum numbers of repeaters added and of plans and segments tried, and of cables at a node of
#: which every subset is tried; at a node with more, the cables moved are consecutive in the plan.
_REPEATERS, _TRIES, _CABLES = 4, 2000, 6

#: A `Plan`, which this module must not import: plans import it.
_Plan: TypeAlias = Any

#: Each added device and the rule that required it.
_Added: TypeAlias = dict[Repeater | Supply, str]


class Improvement(NamedTuple):
    """A plan with added devices, a table of them with the rules that required them, and a summary.

    The verdict says what is added, which rules that cures, and which stay violated.
    """

    plan: _Plan
    added: pd.DataFrame
    verdict: str


def improved(plan: _Plan, limits: pd.DataFrame | None) -> Improvement:
    """Return the improvement with the fewest devices; it adds nothing if none meets every rule."""
    before = plan.check(limits=limits).worst()
    search = _Search(rule_limits() if limits is None else limits.copy())
    # Each segment needs one supply, so the fewest repeaters are also the fewest devices.
    tried = (search.devices(plan, most) for most in range(_REPEATERS + 1))
    better, added = next((one for one in tried if one), (plan, {}))
    after = better.check(limits=limits).worst()
    open_before, open_after = (one.index[one["verdict"] != "met"] for one in (before, after))
    verdict = f"add {', '.join(map(str, added))}" if added else "no device to add"
    if search.tries > _TRIES and not added:
        verdict += f" found in {_TRIES} tries"
    cured = ", ".join(open_before.difference(open_after, sort=False)).replace("_", " ")
    verdict += f", which cures {cured}" if cured else ""
    stay = [rule.replace("_", " ") + f" at {after['object'][rule]}" for rule in open_after]
    rows = [(str(device), rule.replace("_", " ")) for device, rule in added.items()]
    return Improvement(
        better,
        pd.DataFrame(rows, columns=["add", "because of"]),
        "; ".join([verdict, f"stays: {', '.join(stay)}" if stay else "every rule is met"]),
    )


class _Search:
    """Depth-first search: a repeater divides the first segment that violates a rule."""

    def __init__(self, limits: pd.DataFrame) -> None:
        self.limits = limits.assign(high=limits["high"].astype(float).fillna(inf))
        # No added device changes the voltage of a supply.
        self.limits.loc["supply_voltage", ["low", "high"]] = float("nan")
        self.rule_of: dict[str, str] = {}
        self.tries = 0

    def devices(self, plan: _Plan, most: int) -> tuple[_Plan, _Added] | None:
        """Return a plan that meets every rule with at most `most` more repeaters, or None."""
        terminated = [any(one.terminators for one in line) for line in plan.lines]
        headed = [one for one in plan.segments if one.head is not None]
        self.tries += 1
        if sum(map(self.repeaters_for, headed)) > most or self.tries > _TRIES:
            return None
        added: _Added = {}
        for segment in headed:
            supply, rule = self.supplied(segment, terminated[segment.line])
            if rule:
                break
            added |= {supply: "supplies"} if supply else {}
        else:
            supplies = [*plan.supplies, *(one for one in added if isinstance(one, Supply))]
            return _noted(replace(plan, supplies=supplies), added), added
        series = "repeaters_in_series" + "_terminated" * terminated[segment.line]
        divisible = most and len(segment.path) < self.limits["high"][series]
        for divided, repeater in _divisions(plan, segment) if divisible else ():
            first: _Added = {repeater: rule}
            if met := self.devices(_noted(divided, first), most - 1):
                return met[0], first | met[1]
        return None

    def repeaters_for(self, segment: Segment) -> int:
        """Return the smallest number of repeaters that a segment's cables and supplies need."""
        rules = "cable_length", "cable_length_terminated"
        longest = float(self.limits["high"][rules[bool(segment.terminators)]])
        pieces = ceil(segment.length / max(longest, 1e-3) - 1e-9)  # no cable is shorter than 1 cm
        return max(pieces, len(segment.supplies), 1) - 1

    def supplied(self, segment: Segment, terminated: bool) -> tuple[Supply | None, str]:
        """Return the supply that a segment lacks, and a rule that it violates nevertheless."""
        if segment.supplies:
            return None, self.violated(segment, terminated)
        rule = ""
        for supply in map(Supply, segment.distances):
            rule = self.violated(replace(segment, supplies=(supply,)), terminated)
            if not rule:
                return supply, ""
        return None, rule

    def violated(self, segment: Segment, terminated: bool) -> str:
        """Return the first rule that a segment violates, or ""."""
        key = repr((segment, terminated))
        if key not in self.rule_of and self.tries <= _TRIES:
            self.tries += 1
            self.rule_of[key] = first_violated(segment, terminated, self.limits)
        return self.rule_of.get(key, "not tried")


def _noted(plan: _Plan, added: _Added) -> _Plan:
    notes = {note_key(one): f"added: {rule}".replace("_", " ") for one, rule in added.items()}
    return replace(plan, notes={**plan.notes, **notes})


def _divisions(plan: _Plan, segment: Segment) -> Iterator[tuple[_Plan, Repeater]]:
    """Yield the plans in which a repeater at a node separates some of the node's cables."""
    taken = {node for run in plan.cables for node in (run.a, run.b)}
    occupied = {node for one in plan if not isinstance(one, CableRun) for node in nodes_of(one)}
    for node in segment.distances:
        runs = [run for run in segment.cables if node in (run.a, run.b)]
        out = next(name for n in count(2) if (name := f"{node} ({n})") not in taken)
        for size in range(1, len(runs)):
            groups: Iterator[tuple[CableRun, ...]] = combinations(runs, size)
            if len(runs) > _CABLES:
                groups = (tuple(runs[n : n + size]) for n in range(len(runs) - size + 1))
            for moved in groups:
                if node not in occupied and runs[0] in moved:
                    continue  # at a node without devices, both sides are alike
                new = {
                    run: replace(run, a=out) if run.a == node else replace(run, b=out)
                    for run in moved
                }
                cables = [new.get(run, run) for run in plan.cables]
                notes = {note_key(new[run]): plan.notes.get(note_key(run), "") for run in new}
                repeater = Repeater(node, out)
                more = {"repeaters": [*plan.repeaters, repeater], "notes": {**plan.notes, **notes}}
                try:
                    yield replace(plan, cables=cables, **more), repeater
                except ArgumentError:  # one repeater does not divide a ring
                    continue
