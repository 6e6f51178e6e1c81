"""The rule table of kim2014 as a rule base, and the paper's test values."""

from __future__ import annotations

from functools import cache
from math import inf

from shipnet import datasets
from shipnet.arrays import Bools
from shipnet.fields import check_choice, check_scalar
from shipnet.fuzzy.rule_file import read_rules
from shipnet.fuzzy.rules import RuleBase
from shipnet.fuzzy.terms import Rule, Term, Variable
from shipnet.lazy import pd

#: The versions of the test values, and their names in the data file.
VERSIONS = {"printed": "printed", "corrected": "meant"}

#: Choices for a sensor value that a row does not print.
FILLS = ("absent", "normal", "physical")


def rule_base(slow_stroke: float | None = None) -> RuleBase:
    """Return the twelve rules of Table 1 of kim2014 as a rule base.

    Parameters
    ----------
    slow_stroke : float, optional
        Time above which a stroke is slow [s], 1..3600. If given, the rule base also has a variable
        ``Time``, the running time of the motor, and a rule T1 of lowest priority, with a ramp of 1
        s. The rule is ours: the table prints strokes of up to 10 s, but no fault for a slow valve.

    Returns
    -------
    shipnet.fuzzy.RuleBase
        Comparisons as printed; ramps, units, universes and priorities are our assumption.

    Examples
    --------
    >>> base = rule_base()
    >>> base.codes
    ('G1', 'P1', 'P2', 'V1', 'V2', 'S1', 'S2', 'O1', 'Pos1', 'Pos2', 'Pos3', 'Pos4')
    >>> str(base["MC"]["run"].crisp), base["MC"]["run"].corners
    ('0 < x < 2.5', (0.05, 0.15, 2.0, 3.0))
    """
    base = _paper()
    if slow_stroke is None:
        return base
    limit = check_scalar("slow_stroke", slow_stroke, "s", 1, 3600)
    slow = Term("slow", (limit - 0.5, limit + 0.5, inf, inf), f"x > {limit:g}", "slow")
    time = Variable("Time", "s", 0, 3600, (slow,), "running time")
    last = max(rule.priority for rule in base.rules) + 1
    rule = Rule("T1", "Time.slow", last, "Degraded", "stroke slow (ours)")
    return RuleBase((*base.variables, time), (*base.rules, rule))


@cache
def _paper() -> RuleBase:
    """Return the rules of the paper; a rule base is immutable, so one is enough."""
    return read_rules(datasets.path("kim2014_assumed_rules.toml"))


def rule_vectors(version: str = "corrected", *, fill: str = "absent") -> pd.DataFrame:
    """Return the values with which kim2014 tests its rules.

    Parameters
    ----------
    version : {"corrected", "printed"}, default "corrected"
        With the misprints corrected, or as printed.
    fill : {"absent", "normal", "physical"}, default "absent"
        Reading of a sensor whose value a row does not print: NaN, its normal value, or its value
        in the state of the plant that the row describes.

    Returns
    -------
    pandas.DataFrame
        One row per test, indexed by the code that the paper expects, as input for
        `shipnet.fuzzy.RuleBase.check`; one column per variable, NaN if its value is missing.

    Examples
    --------
    As printed, the position of S2 contradicts its rule:

    >>> [rule_vectors(version).loc["S2", "VPos"].item() for version in ("printed", "corrected")]
    [305.0, -5.0]
    """
    check_choice("version", version, VERSIONS)
    check_choice("fill", fill, FILLS)
    base = rule_base()
    names = list(base.names)
    every = datasets.read("kim2014_assumed_vectors.csv")
    chosen = every[every["reading"] == VERSIONS[version]].set_index("code")
    table = _numbers(chosen[names])
    states = datasets.read("kim2014_assumed_fills.csv")
    states = states[states["fill"] == fill]
    left = table.notna().any(axis=1)
    for when, (_, state) in zip(states["when"], _numbers(states[names]).iterrows(), strict=True):
        here = left & (_holds(base, when, table) if when else True)
        table[here] = table[here].fillna(state)
        left &= ~here
    return table


def _numbers(text: pd.DataFrame) -> pd.DataFrame:
    return text.replace("", "nan").astype(float)


def _holds(base: RuleBase, term: str, table: pd.DataFrame) -> Bools:
    """Return a mask of the rows that satisfy the printed comparison of a term."""
    condition = RuleBase(base.variables, (Rule("condition", term, 1),))
    return condition.fire(table, "crisp").strength[:, 0] > 0
