"""One AS-i line with what is known of it: addresses, responses, and the limit that it breaks."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil
from typing import Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.asi import Profile
from shipnet.asi.cycle import ADDRESSES, cycle_time
from shipnet.asi.network import Plan, Slave, check, rule_limits, worst
from shipnet.design.plan.asi_cable import Drawn, draw, plan_of
from shipnet.design.plan.asi_modules import Module, analogue_response, digital_response
from shipnet.design.plan.settings import AsiLimits
from shipnet.errors import ArgumentError

__all__ = ["Broken", "Line", "addresses_needed", "assign_addresses", "build"]

Floats = npt.NDArray[np.float64]


class Broken(NamedTuple):
    """A limit that is not kept.

    Attributes
    ----------
    limit : str
        Its name.
    value, bound : float
        What there is, and what is allowed.
    unit : str
        Of both.
    """

    limit: str
    value: float
    bound: float
    unit: str


class Line(NamedTuple):
    """A line with what is known of it.

    Attributes
    ----------
    modules : list of Module
        Its modules.
    drawn : Drawn
        Its cable.
    slaves : list of Slave
        The modules as slaves.
    plan : Plan or None
        All of it; None if a limit is broken before anybody need look at voltages.
    cycle : float
        Time in which all addresses are asked [s]; NaN if there are too few.
    responses : list of ndarray
        Longest response of each point of each module [s].
    broken : Broken or None
        The limit that is broken; None if all are kept.
    """

    modules: list[Module]
    drawn: Drawn
    slaves: list[Slave]
    plan: Plan | None
    cycle: float
    responses: list[Floats]
    broken: Broken | None


def assign_addresses(
    group: Sequence[Module], need: Sequence[float], limits: AsiLimits
) -> list[Slave]:
    """Give each module an address, at the node of its number.

    Parameters
    ----------
    group : sequence of Module
        Modules of a line.
    need : sequence of float
        The most urgent update need of each [s].
    limits : AsiLimits
        What each draws.

    Returns
    -------
    list of Slave
        In the same order. As few addresses as can be are shared, by the modules that can wait
        longest: one that shares its address is asked every second cycle.

    Raises
    ------
    ArgumentError
        If there are more modules than addresses.

    Examples
    --------
    >>> import numpy as np
    >>> group = [Module("S-0.A", (0.0, 0.0, 0.0), np.array([k]), ["I1"]) for k in range(32)]
    >>> slaves = assign_addresses(group, [1.0] * 30 + [2.0] * 2, AsiLimits())
    >>> [slave.label for slave in slaves[::15]], slaves[-1].label
    (['1A', '16A', '31A'], '31B')
    """
    needed = addresses_needed(group)
    if needed > ADDRESSES:
        raise ArgumentError(f"{len(group)} modules need {needed} addresses; there are {ADDRESSES}")
    pairs = max(0, len(group) - ADDRESSES)
    sharing = [place for place, module in enumerate(group) if module.shares]
    waiting = sorted(sharing, key=lambda place: -need[place])[: 2 * pairs]
    labels: dict[int, tuple[int, Literal["A", "B"] | None]] = {}
    alone = [place for place in range(len(group)) if place not in waiting]
    for address, place in enumerate(alone, 1):
        labels[place] = address, "A" if group[place].shares else None
    for number, place in enumerate(sorted(waiting)):
        labels[place] = len(alone) + 1 + number // 2, "AB"[number % 2]  # type: ignore[assignment]
    return [
        Slave(str(place + 1), *labels[place], Profile.parse(module.profile), module.current(limits))
        for place, module in enumerate(group)
    ]


def build(
    group: Sequence[Module], ways: Floats, cable: Floats, need: Floats, limits: AsiLimits
) -> Line:
    """Draw up a line.

    Parameters
    ----------
    group : sequence of Module
        Modules, one or more.
    ways, cable : ndarray, shape (n + 1, n + 1)
        Way and cable between the master and all modules [m].
    need : ndarray
        Update need of each point of the list [s].
    limits : AsiLimits
        Limits.

    Returns
    -------
    Line
        What comes of it, with the limit that it breaks if there is one.

    Raises
    ------
    ArgumentError
        If there are more modules than addresses.

    Examples
    --------
    >>> group = [Module("S-0.A", (400.0, 0.0, 0.0), np.array([0]), ["I1"])]
    >>> away = np.array([[0.0, 400.0], [400.0, 0.0]])
    >>> build(group, away, away, np.array([1.0]), AsiLimits()).broken
    Broken(limit='length', value=400.0, bound=300.0, unit='m')
    """
    most = [float(min(need[module.rows])) for module in group]
    slaves = assign_addresses(group, most, limits)
    pairs = sum(slave.half == "B" for slave in slaves)
    cycle = float(cycle_time(len(group) - 2 * pairs, pairs))
    paired = {slave.address for slave in slaves if slave.half == "B"}
    responses = [
        _responses(module, cycle, slave.address in paired, limits)
        for module, slave in zip(group, slaves, strict=True)
    ]
    drawn = draw(ways, cable, limits)
    fault = _too_late(group, responses, need) or _too_long(drawn, limits)
    plan = None
    if fault is None:
        plan = plan_of(drawn, slaves, limits)
        fault = _against_rules(plan, limits)
    return Line(list(group), drawn, slaves, plan, cycle, responses, fault)


def addresses_needed(group: Sequence[Module]) -> int:
    """Return how many addresses modules need, where all share that can.

    Parameters
    ----------
    group : sequence of Module
        Modules.

    Returns
    -------
    int
        Addresses; a line has 31.

    Examples
    --------
    >>> digital = Module("S-0.A", (0.0, 0.0, 0.0), np.array([0]), ["I1"])
    >>> addresses_needed([digital] * 5), addresses_needed([digital._replace(profile="S-7.3")] * 5)
    (3, 5)
    """
    sharing = sum(module.shares for module in group)
    return len(group) - sharing + ceil(sharing / 2)


def _responses(module: Module, cycle: float, paired: bool, limits: AsiLimits) -> Floats:
    if module.analogue:
        return np.full(len(module.ports), analogue_response(len(module.ports), limits, cycle))
    outputs = [port.startswith("Q") for port in module.ports]
    late = {
        output: digital_response(cycle, paired, module.profile, output, limits)
        for output in set(outputs)
    }
    return np.array([late[output] for output in outputs])


def _too_late(group: Sequence[Module], responses: Sequence[Floats], need: Floats) -> Broken | None:
    for module, response in zip(group, responses, strict=True):
        late = response > need[module.rows]
        if late.any():
            place = int(np.argmax(response / need[module.rows]))
            bound = 1e3 * float(need[module.rows[place]])
            return Broken("update", 1e3 * float(response[place]), bound, "ms")
    return None


def _too_long(drawn: Drawn, limits: AsiLimits) -> Broken | None:
    if drawn.depth <= limits.repeaters:
        return None
    reach = limits.length * (1 + limits.repeaters)
    if drawn.reach > reach:
        return Broken("length", drawn.reach, reach, "m")
    return Broken("repeaters in series", drawn.depth, limits.repeaters, "")


def _against_rules(plan: Plan, limits: AsiLimits) -> Broken | None:
    rules = rule_limits()
    rules.loc["cable_length", "highest"] = limits.length
    rules.loc["repeaters_in_series", "highest"] = limits.repeaters
    table = check(plan, limits=rules)
    if table["passed"].all():
        return None
    first = worst(table).query("margin < 0 or margin.isna()").sort_values("margin").iloc[0]
    bound = first["lowest"] if first["value"] < first["lowest"] else first["highest"]
    name = str(first.name).replace("_", " ")
    return Broken(name, float(first["value"]), float(bound), str(first["unit"]))
