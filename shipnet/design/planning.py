"""Which point gets which cable: an I/O list, a site and an option become a design."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from os import PathLike
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from shipnet.design.designs import Design
from shipnet.design.drafting import Draft
from shipnet.design.iolist import Given, IoList, Where
from shipnet.design.plan_asi_lines import plan_asi
from shipnet.design.plan_can import plan_can
from shipnet.design.plan_hardwired import plan_boxes, plan_home_runs
from shipnet.design.plan_modbus import plan_modbus
from shipnet.design.settings import Settings
from shipnet.design.site import Site, Trays, find_cabinet
from shipnet.errors import ArgumentError

_Planner = Callable[[Draft, npt.NDArray[np.intp]], None]

_PLANNERS: Mapping[str, _Planner] = MappingProxyType(
    {
        "home runs": plan_home_runs,
        "junction boxes": plan_boxes,
        "AS-i": plan_asi,
        "CAN": plan_can,
        "Modbus RTU": plan_modbus,
    }
)

#: The ways to connect all points alike.
OPTIONS = tuple(_PLANNERS)

#: What a choice may go by; the first that names a point decides.
_BY = ("tag", "signal", "system", "category", "type")


def plan(
    iolist: IoList,
    site: Site,
    option: str,
    *,
    settings: Settings | None = None,
    mix: Mapping[str, str] | None = None,
    name: str | None = None,
) -> Design:
    """Connect the points of a list in one way, and those that `mix` names in another."""
    choose = mix or {}
    for one in (option, *choose.values()):
        _known(one)
    allowances = {"detour": site.detour, "tails": site.tails}
    values = Settings(allowances) if settings is None else settings
    if any(values[what] != value for what, value in allowances.items()):
        values = values.replace(allowances)
    draft = Draft(iolist, site, values)
    chosen = np.full(len(iolist), option, dtype=object)
    left = set(choose)
    for column in reversed(_BY) if choose else ():
        given = iolist.points[column]
        left -= set(given)
        named = given.map(lambda value: choose.get(value, ""))
        chosen = np.where(named != "", named, chosen)
    if left:
        raise ArgumentError(
            f"mix names {sorted(left)[0]!r}; it is not a tag, signal, system, category or type of "
            "the list"
        )
    for way, planner in _PLANNERS.items():
        rows = np.flatnonzero(chosen == way)
        if len(rows):
            planner(draft, rows)
    return draft.made(name or ("mix" if choose else option))


def as_settings(settings: Given) -> Settings:
    """Return settings from themselves, from values by name, or from nothing."""
    return settings if isinstance(settings, Settings) else Settings(settings)


def site_of(
    iolist: IoList, cabinet: Where, trays: Trays | str | PathLike[str] | None, settings: Settings
) -> tuple[Site, str]:
    """Return where a list is planned, and how the cabinet's place is known if it was found."""
    if isinstance(cabinet, Site):
        return cabinet, ""
    if isinstance(trays, str | PathLike):
        trays = Trays.read(trays)
    known = {} if trays is None else trays.cabinets
    names = f" or one of {', '.join(map(repr, known))}" if known else ""
    place, said = cabinet, ""
    if isinstance(cabinet, str):
        if cabinet not in known:
            raise ArgumentError(f"cabinet is {cabinet!r}; it must be a place x, y, z in m{names}")
        place = known[cabinet]
    elif cabinet is None:
        place = (0.0, 0.0, 0.0)
        if iolist.located.any() or np.isfinite(iolist.box_places).any():
            try:
                found = find_cabinet(iolist)
            except ArgumentError as mistake:
                raise ArgumentError(
                    f"cabinet is not given, and {mistake}; give its place x, y, z in m{names}"
                ) from None
            place, said = found.place, str(found)
    return Site(place, trays, settings.detour, settings.tails), said  # type: ignore[arg-type]


def _known(option: str) -> None:
    if option not in _PLANNERS:
        raise ArgumentError(f"option is {option!r}; it must be one of {', '.join(OPTIONS)}")
