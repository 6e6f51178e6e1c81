"""Which point gets which cable: an I/O list, a site and an option become a network."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from shipnet.design.designs import Network
from shipnet.design.drafting import Draft
from shipnet.design.iolist import IoList
from shipnet.design.plan_asi_lines import plan_asi
from shipnet.design.plan_can import plan_can
from shipnet.design.plan_hardwired import plan_boxes, plan_home_runs
from shipnet.design.plan_modbus import plan_modbus
from shipnet.design.settings import Settings
from shipnet.design.site import Site
from shipnet.errors import ArgumentError

__all__ = ["OPTIONS", "Settings", "mix", "plan"]

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


def plan(iolist: IoList, site: Site, option: str, *, settings: Settings | None = None) -> Network:
    """Connect all points of a list in one way."""
    _known(option)
    draft = Draft(iolist, site, Settings() if settings is None else settings)
    _PLANNERS[option](draft, np.arange(len(iolist)))
    return draft.network(option)


def mix(
    iolist: IoList,
    site: Site,
    choose: Mapping[str, str],
    *,
    default: str = "home runs",
    settings: Settings | None = None,
    name: str = "mix",
) -> Network:
    """Connect each point in the way that is chosen for its kind."""
    for option in (default, *choose.values()):
        _known(option)
    chosen = np.full(len(iolist), default, dtype=object)
    left = set(choose)
    for column in reversed(_BY):
        values = iolist.points[column]
        left -= set(values)
        named = values.map(lambda value: choose.get(value, ""))
        chosen = np.where(named != "", named, chosen)
    if left:
        raise ArgumentError(
            f"choose names {sorted(left)[0]!r}; it is no tag, signal, system, category or type of "
            "the list"
        )
    draft = Draft(iolist, site, Settings() if settings is None else settings)
    for option, planner in _PLANNERS.items():
        rows = np.flatnonzero(chosen == option)
        if len(rows):
            planner(draft, rows)
    return draft.network(name)


def _known(option: str) -> None:
    if option not in _PLANNERS:
        raise ArgumentError(f"option is {option!r}; it must be one of {', '.join(OPTIONS)}")
