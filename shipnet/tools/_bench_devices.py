"""Devices on the cable of the AS-i bench: their texts, and those of a plan."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from math import ceil
from types import MappingProxyType
from typing import Any, NamedTuple

from shipnet import asi, fields
from shipnet.asi.plan import read_plan
from shipnet.asi.segment import Element, nodes_of
from shipnet.asi.slave import slave_key
from shipnet.asi.timing import ADDRESSES
from shipnet.asi.topologies import evenly_spaced
from shipnet.errors import ArgumentError, InputError
from shipnet.files import as_file
from shipnet.line.cable import Cable
from shipnet.tools._view import Loaded

#: Cables to choose from. The extremes combine limits from a data sheet (Lapp, UNITRONIC BUS ASI:
#: 0.5 to 0.75 uH/m, at most 80 pF/m) with the resistance of the nominal cable.
CABLE_CHOICES = MappingProxyType[str, str | Cable](
    {
        "nominal: 100 ohm, 6.5 ns/m": "as-i 1.5",
        "lossless: 100 ohm, 6.5 ns/m": "as-i lossless",
        "low: 79 ohm, 6.3 ns/m": Cable(r=0.06, l=0.5e-6, c=80e-12),
        "slow: 97 ohm, 7.7 ns/m": Cable(r=0.06, l=0.75e-6, c=80e-12),
    }
)

#: Kinds of devices, with the legal number of each. The scope shows the voltage at its place.
KINDS = MappingProxyType(
    {
        "master": (1, 1),
        "scope": (1, 1),
        "slave": (1, 2 * ADDRESSES),
        "supply": (0, 8),
        "repeater": (0, 8),
        "terminator": (0, 8),
        "resistor": (0, 8),
    }
)

#: Longest cable, and longest spur of a slave [m]; resistor that absorbs the echo [ohm].
LONGEST, LONGEST_SPUR, RESISTOR = 500.0, 100.0, 100.0

_METRES = r"([0-9]{1,3}(?:\.[0-9]{1,9})?)"
_DEVICE = re.compile(rf"(?:([0-9]{{1,2}})\*)?([a-z]+)@{_METRES}(?:/{_METRES})?")


class Device(NamedTuple):
    """A device, its distance along the cable, and the length of its spur [m]."""

    kind: str
    place: float
    spur: float

    def __str__(self) -> str:
        return f"{self.kind}@{self.place:g}" + (f"/{self.spur:g}" if self.spur else "")


def read_devices(texts: Sequence[str]) -> list[Device]:
    """Return the devices that texts such as ``"slave@50/3"`` describe, to the centimetre."""
    devices: list[Device] = []
    for text in texts:
        match = _DEVICE.fullmatch(text) if isinstance(text, str) else None
        if match is None or match[2] not in KINDS:
            raise ArgumentError(
                f"one of devices is {text!r}; it must be a kind and its place in metres, such as "
                f"'slave@50', 'slave@50/3' or '31*slave@100'; kinds are {', '.join(KINDS)}"
            )
        count, kind, *metres = match.groups()
        place, spur = (float(one or 0) for one in metres)
        fields.check_scalar(f"place of {text}", place, "m", 0, LONGEST)
        fields.check_scalar(f"spur of {text}", spur, "m", 0, LONGEST_SPUR if kind == "slave" else 0)
        spaced = evenly_spaced(place, int(count or 1))
        devices += [Device(kind, round(one, 2), round(spur, 2)) for one in spaced]
    for kind, (least, most) in KINDS.items():
        number = sum(device.kind == kind for device in devices)
        fields.check_whole(f"number of devices of kind {kind}", number, least, most)
    return devices


def open_plan(inputs: Any, name: str, content: bytes) -> Loaded:
    """Return the inputs with the plan of a file, and what the bench draws differently."""
    with as_file(name, content) as path:
        plan = read_plan(path)
    try:
        drawn = replace(inputs, sender=1, **_fields(plan))
    except ArgumentError as problem:
        raise InputError(name, f"the bench cannot draw this plan: {problem}") from None
    drawable = [_plain(element) for element in drawn.plan]
    unlike = Counter(
        type(element).__name__.lower()
        for element in plan
        if not isinstance(element, asi.CableRun) and _plain(element) not in drawable
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
    joints, path, ring = _trunk(plan)
    spots, metres, cuts = {path[0]: (0.0, 0.0)}, 0.0, []
    for a, b in pairwise([*path, path[0]] if ring else path):
        if length := joints.edges[a, b].get("length"):
            metres += length
            spots.setdefault(b, (metres, 0.0))
        else:
            cuts.append(Device("repeater", metres, 0))
            # The node on the right of a repeater needs a place of its own.
            spots[b] = round(metres + 0.01, 2), 0.0
    for node in set(joints).difference(path):
        (near,) = joints[node]
        spots[node] = spots[near][0], joints.edges[node, near]["length"]
    keys = [slave_key(slave.label)[0] for slave in plan.slaves]
    if len(set(keys)) < len(keys) or min(keys, default=2) < 2:
        raise ArgumentError("two of its slaves have the same address, or one has address 0")
    shared = Counter(slave.address for slave in plan.slaves)
    of_kind: dict[str, Sequence[Any]] = {
        "master": plan.masters,
        "scope": plan.masters,
        "supply": plan.supplies,
        # Slaves that share addresses are the last.
        "slave": sorted(plan.slaves, key=lambda one: (shared[one.address], slave_key(one.label))),
        "terminator": [one for one in plan.terminators if one.inductance < 1],
        "resistor": [one for one in plan.terminators if one.inductance >= 1],
    }
    placed = [Device(kind, *spots[one.node]) for kind, some in of_kind.items() for one in some]
    return {
        "devices": tuple(map(str, [*placed, *cuts])),
        "length": round(metres, 1),
        "cable": catalogue[cables.pop()],
        "ring": ring,
        "current_ma": ceil(max((1e3 * one.current for one in plan.slaves), default=0.0) - 1e-9),
        "pairs": sum(number > 1 for number in shared.values()),
    }


def _trunk(plan: asi.Plan) -> tuple[Any, list[str], bool]:
    """Return a graph of the plan, the nodes along its cable without spurs, and if it is a ring."""
    import networkx as nx

    joints = nx.Graph([(one.a, one.b) for one in plan.repeaters])
    joints.add_weighted_edges_from(((r.a, r.b, float(r.length)) for r in plan.cables), "length")
    slaves = Counter(slave.node for slave in plan.slaves)
    others: list[Any] = [*plan.masters, *plan.supplies, *plan.terminators, *plan.repeaters]
    taken = {node for one in others for node in nodes_of(one)}
    spurs = {n for n in joints if joints.degree[n] == 1 and slaves[n] == 1 and n not in taken}
    trunk = joints.copy()
    trunk.remove_nodes_from(spurs)
    for node, degree in trunk.degree:
        if degree > 2:
            raise ArgumentError(
                f"its cable branches at {node}; a branch may only be a spur with one slave"
            )
    master = plan.masters[0].node
    ends = [node for node, degree in trunk.degree if degree < 2]
    path = list(nx.dfs_preorder_nodes(trunk, ends[0] if ends else master))
    for _ in range(2 if ends else 0):  # a spur at the end of the cable is drawn as part of it
        path.reverse()
        path += [one for one in joints[path[-1]] if one in spurs and one not in path][:1]
    if path.index(master) > len(path) / 2:
        path.reverse()
    return joints, path, not ends
