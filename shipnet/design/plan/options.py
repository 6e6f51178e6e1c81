"""Which point gets which cable: an I/O list, a site and an option become a network.

Each option has a planner of its own; a plan never fails. What a bus cannot do stands in the
network's `reasons`, with the value and its bound.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from shipnet.design.iolist import IoList
from shipnet.design.network import Network
from shipnet.design.plan.asi import plan_asi
from shipnet.design.plan.can import plan_can
from shipnet.design.plan.draft import Draft
from shipnet.design.plan.hardwired import plan_boxes, plan_home_runs
from shipnet.design.plan.modbus import plan_modbus
from shipnet.design.plan.settings import Settings
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
    r"""Connect all points of a list in one way.

    Parameters
    ----------
    iolist : IoList
        The points.
    site : Site
        Where the cabinet is, and how cables get there.
    option : str
        One of `OPTIONS`.
    settings : Settings, optional
        The limits; all have defaults.

    Returns
    -------
    Network
        Devices, cables and segments. Points that do not fit within the limits are left out, with a
        reason each.

    Raises
    ------
    ArgumentError
        If there is no such option.

    Examples
    --------
    >>> from shipnet.design.iolist import parse_iolist
    >>> iolist = parse_iolist("tag,type,x,y,z\nLS-1,DI,30,0,0\nLS-2,DI,34,1,0\nLS-3,DI,33,0,2")
    >>> for option in OPTIONS:
    ...     print(plan(iolist, Site((0, 0, 0)), option))
    <Network 'home runs': 3 of 3 points fit, 3 cables, 130 m>
    <Network 'junction boxes': 3 of 3 points fit, 4 cables, 66 m>
    <Network 'AS-i': 3 of 3 points fit, 4 cables, 62 m>
    <Network 'CAN': 3 of 3 points fit, 5 cables, 109 m>
    <Network 'Modbus RTU': 3 of 3 points fit, 5 cables, 109 m>
    """
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
    r"""Connect each point in the way that is chosen for its kind.

    Parameters
    ----------
    iolist, site
        As for `plan`.
    choose : mapping of str to str
        Option by tag, signal, system, category or type. Where several name a point, the first in
        this order decides.
    default : str, default "home runs"
        Option of all other points.
    settings : Settings, optional
        As for `plan`.
    name : str, default "mix"
        What the network is called.

    Returns
    -------
    Network
        As for `plan`.

    Raises
    ------
    ArgumentError
        If there is no such option, or a key names no point.

    Examples
    --------
    >>> from shipnet.design.iolist import parse_iolist
    >>> iolist = parse_iolist("tag,signal,x,y,z\nS1,switch,30,0,0\nT2,pot,34,1,0\nT3,pot,33,0,2")
    >>> network = mix(iolist, Site((0, 0, 0)), {"AI": "CAN", "T3": "home runs"})
    >>> network.points["bus"].tolist()
    ['hardwired', 'CAN', 'hardwired']
    """
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
