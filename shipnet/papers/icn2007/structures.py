"""Section 4 and data link layer 3: structures that are allowed, and efficiency among buses."""

from __future__ import annotations

import numpy as np

from shipnet.asi.plan import Plan
from shipnet.asi.topologies import line, ring, star
from shipnet.papers.icn2007.rates import bus_efficiencies
from shipnet.papers.registry import check

__all__ = ["allowed", "keeps_all_rules"]

SLAVES = 62


def allowed() -> dict[str, Plan]:
    """Return the structures that section 4 allows, as plans with the supply in a good place.

    Returns
    -------
    dict of str to Plan
        Eight plans of 100 m; all but the first with 62 slaves.

    Examples
    --------
    >>> plans = allowed()
    >>> [name for name, plan in plans.items() if not keeps_all_rules(plan)]
    []
    """
    growing = np.arange(1, SLAVES + 1)
    return {
        "100 m and a slave at its end": line(100, [100]),
        "90 m and a star of 62": trunk_and_star(),
        "star, legs as long as the master's": star(100 / 63, [100 / 63] * SLAVES),
        "star, unequal legs": star(1, (99 * growing / growing.sum()).tolist()),
        "62 along a line, evenly": line(100, SLAVES, supply=50),
        "62 along a line, unevenly": line(100, (100 * (growing / SLAVES) ** 2).tolist(), supply=50),
        "mixture": star(70, [1.5] * 20, along=42, supply=35),
        "passive ring": ring(100, SLAVES),
    }


def keeps_all_rules(plan: Plan) -> bool:
    """Return whether a plan passes every rule.

    Parameters
    ----------
    plan : Plan
        The plan.

    Returns
    -------
    bool
        True if no rule fails.

    Examples
    --------
    >>> keeps_all_rules(line(101, [101]))
    False
    """
    return plan.check().ok is True


def trunk_and_star(leg: float = 10 / SLAVES) -> Plan:
    """Return 90 m of cable, then a star of 62 slaves with the supply at its hub."""
    return star(90, [leg] * SLAVES, supply=90)


@check("icn2007-003", counter={"leg": 2.0})
def trunk_and_star_is_allowed(*, leg: float = 10 / SLAVES) -> bool:
    """Whether 90 m and 62 legs of this length [m] keep every rule."""
    return keeps_all_rules(trunk_and_star(leg))


@check("icn2007-004", counter={"length": 101.0})
def slave_at_end(*, length: float = 100.0) -> bool:
    """Whether a cable of this length with a slave at its end keeps every rule."""
    return keeps_all_rules(line(length, [length]))


@check("icn2007-048", counter={"supply": 0.0})
def structures_are_allowed(*, supply: float = 50.0) -> bool:
    """Whether all structures keep every rule, with the supply of the even line in this place."""
    plans = {**allowed(), "evenly": line(100, SLAVES, supply=supply)}
    return all(keeps_all_rules(plan) for plan in plans.values())


@check("icn2007-027", counter={"user_bits": 4})
def best_of_buses(*, user_bits: int = 64) -> bool:
    """Whether AS-i is the most efficient of three buses for so many bits each way."""
    return bool(bus_efficiencies(user_bits).iloc[0].idxmax() == "as_i")
