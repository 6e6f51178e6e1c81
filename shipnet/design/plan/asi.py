"""Points on AS-i: modules among them, and lines that keep every rule of an installation."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf

import numpy as np
import numpy.typing as npt

from shipnet.asi.cycle import ADDRESSES
from shipnet.asi.network.electrical import device_voltages, supply_current
from shipnet.design.catalogue import cables
from shipnet.design.plan.asi_line import Line, addresses_needed, build
from shipnet.design.plan.asi_modules import modules
from shipnet.design.plan.boxes import without_place
from shipnet.design.plan.clusters import divided
from shipnet.design.plan.draft import Draft, Laid, Place

__all__ = ["plan_asi"]

#: Conductors of a line, and of a feeder.
_PAIR = 2


def plan_asi(draft: Draft, rows: npt.NDArray[np.intp]) -> None:
    r"""Connect points by AS-i modules near them, on as few lines as keep the limits.

    Parameters
    ----------
    draft : Draft
        Where it is put down.
    rows : ndarray of int
        Points. One that has neither a place nor a box with one, that needs an update too soon, or
        whose module breaks a rule on a line of its own, does not fit.

    Notes
    -----
    Each line is drawn up as a `shipnet.asi.network.Plan` and keeps all of its rules, signals
    included: they reckon with 1.5 mm2 AS-i cable. Masters stand in the cabinet. A point without a
    place is taken to stand at its box; the boxes are not used otherwise.

    Examples
    --------
    >>> from shipnet.design.iolist import parse_iolist
    >>> from shipnet.design.plan.settings import Settings
    >>> from shipnet.design.site import Site
    >>> iolist = parse_iolist("tag,signal,x,y,z\nA,contact,80,0,0\nB,rtd_3wire,90,0,0")
    >>> draft = Draft(iolist, Site((0, 0, 0)), Settings())
    >>> plan_asi(draft, np.arange(2))
    >>> network = draft.network("AS-i")
    >>> network.points[["device", "address"]].values.tolist()
    [['AS-i 1 slave 1A', '1A I1'], ['AS-i 1 slave 2', '2 AI1']]
    >>> network.segments[["masters", "addresses", "repeaters"]].values.tolist()
    [[1, 2, 1]]
    """
    limits = draft.settings.asi
    places = np.where(draft.iolist.located[:, None], draft.places, draft.iolist.box_places)
    known = np.isfinite(places[rows]).all(axis=1)
    without_place(draft, rows[~known])
    rows = rows[known]
    found = modules(draft, rows, places[rows])
    spots = np.array([draft.middle, *(module.place for module in found)])

    def judge(group: Sequence[int]) -> tuple[Line | None, float]:
        own = [found[place] for place in group]
        needed = addresses_needed(own)
        if needed > ADDRESSES:
            return None, needed / ADDRESSES
        at = spots[[0, *(place + 1 for place in group)]]
        ways = draft.site.route(at[:, None], at[None, :])
        cable = draft.site.detour * ways + limits.slack
        line = build(own, ways, cable, draft.need, limits)
        return line, 1 if line.broken is None else inf

    number = 0
    for _, line in divided(range(len(found)), lambda place: found[place].place, judge):
        assert line is not None
        if line.broken is None:
            number += 1
            _lay(draft, f"AS-i {number}", line)
        else:
            _refuse(draft, line)


def _refuse(draft: Draft, line: Line) -> None:
    """Say of each point of a module that even a line of its own breaks a limit."""
    assert line.broken is not None
    limit, value, bound, unit = line.broken
    for row in line.modules[0].rows:
        tag = draft.tags[row]
        text = (
            f"{tag} breaks the limit of AS-i {limit} with a line of its own: "
            f"{value:.4g} {unit}, allowed {bound:.4g} {unit}"
        )
        draft.reason(tag, limit, value, bound, unit, text.replace(" ,", ","))


def _lay(draft: Draft, segment: str, line: Line) -> None:
    assert line.plan is not None
    limits, plan = draft.settings.asi, line.plan
    cabinet = draft.device(f"{segment} master", "master", segment, draft.middle, draft.cabinet)
    spots: list[Place] = [draft.middle, *(module.place for module in line.modules)]
    names = {"0": cabinet}
    where: dict[str, Place] = {str(place): spot for place, spot in enumerate(spots)}
    for slave, module in zip(line.slaves, line.modules, strict=True):
        name = f"{segment} slave {slave.label}"
        names[slave.node] = draft.device(name, "module", segment, module.place)
    _lay_repeaters(draft, segment, line, names, where, spots)
    for supply in plan.supplies:
        at = draft.cabinet if supply.node == "0" else names[supply.node]
        name = draft.device(f"{segment} supply", "supply", segment, where[supply.node], at)
        if at != draft.cabinet and draft.settings.fed:
            laid, feeder = Laid(draft.middle, where[supply.node]), cables()[draft.settings.feeder]
            draft.run("feeder", (draft.cabinet, name), laid, feeder, _PAIR, segment)
    for piece in line.drawn.pieces:
        near, far = piece.edge
        laid = Laid(spots[near], spots[far], slack=limits.slack * piece.share, share=piece.share)
        ends = names[piece.near], names[piece.far]
        draft.run("trunk", ends, laid, cables()[limits.cable], _PAIR, segment)
    if limits.auxiliary and (powered := _powered(line)):
        _lay_auxiliary(draft, segment, line, names, spots, powered)
    _connect(draft, segment, line, names)


def _lay_auxiliary(
    draft: Draft,
    segment: str,
    line: Line,
    names: dict[str, str],
    spots: Sequence[Place],
    powered: set[int],
) -> None:
    """Put a supply into the cabinet, and its pair along the line as far as outputs need it."""
    name = f"{segment} auxiliary supply"
    supply = draft.device(name, "auxiliary supply", segment, draft.middle, draft.cabinet)
    feeder, slack = cables()[draft.settings.feeder], draft.settings.asi.slack
    for near, far in dict.fromkeys(piece.edge for piece in line.drawn.pieces):
        if far in powered:
            laid = Laid(spots[near], spots[far], slack=slack)
            ends = supply if near == 0 else names[str(near)], names[str(far)]
            draft.run("feeder", ends, laid, feeder, _PAIR, segment)


def _lay_repeaters(
    draft: Draft,
    segment: str,
    line: Line,
    names: dict[str, str],
    where: dict[str, Place],
    spots: Sequence[Place],
) -> None:
    """Put repeaters beside the master or a module, or on the way where a cable is too long."""
    done = dict.fromkeys({piece.edge for piece in line.drawn.pieces}, 0.0)
    ends: dict[str, Place] = {}
    for piece in line.drawn.pieces:
        done[piece.edge] += piece.share
        near, far = (np.array(spots[place]) for place in piece.edge)
        x, y, z = (near + done[piece.edge] * (far - near)).tolist()
        ends[piece.far] = (x, y, z)
    for into, out in line.drawn.repeaters:
        beside = into in names
        place = where[into] if beside else ends[into]
        at = "" if not beside else draft.cabinet if into == "0" else names[into]
        name = draft.device(f"{segment} repeater", "repeater", segment, place, at)
        names[out] = name
        where[out] = place
        if not beside:
            names[into], where[into] = name, place


def _powered(line: Line) -> set[int]:
    """Return the places that lie on the way to a module with outputs, that module included."""
    before = {far: near for near, far in (piece.edge for piece in line.drawn.pieces)}
    powered: set[int] = set()
    for place, module in enumerate(line.modules, 1):
        while module.outputs and place != 0 and place not in powered:
            powered.add(place)
            place = before[place]
    return powered


def _connect(draft: Draft, segment: str, line: Line, names: dict[str, str]) -> None:
    assert line.plan is not None
    for module, slave, response in zip(line.modules, line.slaves, line.responses, strict=True):
        device = names[slave.node]
        for row, port, late in zip(module.rows, module.ports, response, strict=True):
            address = f"{slave.label} {port}"
            draft.connect(int(row), "AS-i", segment, device, address, float(late))
            draft.drop(int(row), device, module.place, segment, np.nan)
    rows = np.concatenate([module.rows for module in line.modules])
    parts = line.plan.segments
    used = len({slave.address for slave in line.slaves})
    draft.segment(
        segment=segment, bus="AS-i", points=len(rows),
        devices=len(line.slaves) + 1 + len(line.drawn.repeaters), length_m=line.drawn.length,
        load=used / ADDRESSES, response_ms=1e3 * max(float(r.max()) for r in line.responses),
        slowest_update_ms=1e3 * float(draft.need[rows].min()), masters=1, slaves=len(line.slaves),
        addresses=used, cycle_ms=1e3 * line.cycle, repeaters=len(line.drawn.repeaters),
        supply_current_a=max(supply_current(part) for part in parts),
        lowest_v=min(min(device_voltages(part)[node] for node, _ in part.draws) for part in parts),
    )  # fmt: skip
