"""The second Table 1 as a rule base: how many faults, what overlaps, what it leaves open."""

from __future__ import annotations

import numpy as np

from shipnet import datasets
from shipnet.ballast.rule_table import rule_base
from shipnet.ballast.sensors import CHANNELS, rule_limits
from shipnet.papers.registry import check, numeric

__all__ = ["BASE"]

BASE = rule_base()

_TABLE = datasets.read("kim2014_rule_table.csv")
_POSITION_FLAG = "PosFault"


def _limit(channel: str, comparison: str) -> float:
    limits = rule_limits()
    return next(x.value for x in limits if (x.channel, x.comparison) == (channel, comparison))


@numeric("kim2014-024")
def faults(*, with_normal: bool = False) -> int:
    """Rows of the rule table, the normal one left out."""
    return len(_TABLE if with_normal else _TABLE[_TABLE["code"] != "normal"])


@numeric("kim2014-025")
def flags(*, with_position: bool = True) -> int:
    """Flags that the rules set, with or without the one for the position."""
    return len({rule.flag for rule in BASE.rules if with_position or rule.flag != _POSITION_FLAG})


@numeric("kim2014-036")
def nested_pairs(*, codes: tuple[str, ...] = BASE.codes) -> int:
    """Pairs of these rules of which one fires whenever the other does."""
    pairs = BASE.overlaps().table()
    nested = pairs[pairs["relation"] != "overlap"]
    return int((nested["a"].isin(codes) & nested["b"].isin(codes)).sum())


@numeric("kim2014-073")
def distinct_faults(*, equalities: bool = True) -> int:
    """Faults of the rule table, those counted once that its last rows declare equal."""
    rows = _TABLE[_TABLE["code"] != "normal"]
    same = rows["diagnosis_printed"].str.contains(r"= Pos\d", regex=True)
    return int((~same).sum()) if equalities else len(rows)


@numeric("kim2014-074")
def overlapping_pairs(*, as_printed: bool = True) -> int:
    """Pairs of rules that can fire together, in the middle of the ramps if not as printed."""
    return len(BASE.overlaps("crisp" if as_printed else "midpoint"))


@numeric("kim2014-082")
def silent_pressures(*, high: float = _limit("FP", ">"), low: float = _limit("FP", "<")) -> float:
    """Width of the range of FP in which no rule looks at it [bar]."""
    return high - low


@numeric("kim2014-100")
def quantities_with_limit(*, limit: float = 2.5) -> int:
    """Quantities that the rule table compares with this number."""
    return len({one.channel for one in rule_limits() if one.value == limit})


@check("kim2014-037", counter={"ramps": True})
def infers_by_degrees(*, ramps: bool = False) -> bool:
    """Whether a rule can hold in part, as printed or with the ramps that we assume."""
    sweep = {"FP": np.linspace(110, 130, 201), "OP": np.full(201, 4.0)}
    found = BASE.fire(sweep, "fuzzy" if ramps else "crisp").strength
    return bool(((found > 0) & (found < 1)).any())


@check("kim2014-061", counter={"sensors": ("FP", "OP", "MC", "VPos")})
def has_both_limits(*, sensors: tuple[str, ...] = tuple(c.name for c in CHANNELS)) -> bool:
    """Whether the rules ask for values above a limit, and for lower ones, of each sensor."""
    for sensor in sensors:
        said = [term.crisp for term in BASE[sensor].terms]
        upper = [one.low for one in said if np.isinf(one.high)]
        if not any(one.high <= limit for limit in upper for one in said):
            return False
    return True
