"""Does a planned network keep the rules? Each rule with the value computed for it.

A rule whose own text was not read is never passed: it is *not verified*, with what it would be.
"""

from __future__ import annotations

from os import PathLike
from typing import TYPE_CHECKING

from shipnet.design.network import Network
from shipnet.design.rules.measures import LEFT_OUT, MEASURES, Facts, Outcome
from shipnet.design.rules.rule_set import Rule, load_rules, published_rules
from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["HOST_TIME", "RuleSet", "check", "rules_of"]

#: From a value's arrival at the host to its alarm or indication [s]: scan, alarm logic and screen.
#: Assumed; it is the host's, which no plan of cables knows.
HOST_TIME = 0.5

#: A published set by name, a file, or rules made elsewhere.
RuleSet = str | PathLike[str] | tuple[Rule, ...]

_COLUMNS = (
    "clause", "rule", "subject", "computed", "limit", "unit", "verdict", "why", "edition", "source",
    "confirmed", "topic", "asks", "bound", "rule_set",
)  # fmt: skip


def rules_of(rule_set: RuleSet) -> tuple[Rule, ...]:
    """Return the rules that a name, a file or a tuple stands for.

    Parameters
    ----------
    rule_set : str, path or tuple of Rule
        One of `shipnet.design.rules.RULE_SETS`, a file for `load_rules` (a path, or a name that
        ends in .csv or .xlsx), or the rules themselves.

    Returns
    -------
    tuple of Rule
        One or more.

    Raises
    ------
    ArgumentError
        If there is no such set.
    InputError
        If a file does not hold rules.

    Examples
    --------
    >>> [rule.clause for rule in rules_of("BV")][:2]
    ['1.1.1', '1.5.2']
    """
    if isinstance(rule_set, tuple):
        if not rule_set or not all(isinstance(rule, Rule) for rule in rule_set):
            raise ArgumentError(f"rule_set is {rule_set!r}; it must be one Rule or more")
        return rule_set
    if isinstance(rule_set, PathLike) or str(rule_set).lower().endswith((".csv", ".xlsx")):
        return load_rules(rule_set)
    return published_rules(rule_set)


def check(
    network: Network,
    rule_set: RuleSet = "DNV",
    *,
    host_time: float = HOST_TIME,
    cuts: pd.DataFrame | None = None,
) -> pd.DataFrame:
    """Check a planned network against a rule set.

    Parameters
    ----------
    network : Network
        What was planned.
    rule_set : str, path or tuple of Rule, default "DNV"
        As `rules_of`.
    host_time : float, default 0.5
        What the host adds to the response where a rule counts it [s], 0..60; assumed.
    cuts : pandas.DataFrame, optional
        What `single_cuts` returned for the network, if it is there already.

    Returns
    -------
    pandas.DataFrame
        One row a rule: ``clause``, ``rule``, ``subject`` (where the value is worst), ``computed``
        (NaN if nothing can be), ``limit``, ``unit``, ``verdict`` ("pass", "fail" or "not
        verified"), ``why``, ``edition``, ``source``, ``confirmed``, ``topic``, ``asks``,
        ``bound``, ``rule_set``.

    Raises
    ------
    ArgumentError
        If an argument is out of range.
    InputError
        If a file does not hold rules.

    Notes
    -----
    A pass is a computed value on the right side of a limit, under the assumptions of the plan. It
    is no approval by a class society.

    Examples
    --------
    Both boxes of the example hang on one line, and a cut costs points of two essential systems:

    >>> from shipnet.design.example import example
    >>> table = check(example()).round(2).set_index("rule")
    >>> table.loc[["alarm", "shared link redundant"], ["computed", "verdict"]].values.tolist()
    [[0.68, 'pass'], [2.0, 'fail']]
    >>> print(table.loc["alarm, ships", "why"])
    would pass (0.18 s to the host; 0.5 s in the host, assumed), but the clause was not read
    """
    import pandas as pd

    if not isinstance(network, Network):
        raise ArgumentError(f"network is {network!r}; it must be a Network")
    facts = Facts(network, check_scalar("host_time", host_time, "s", 0.0, 60.0), cuts)
    rows = []
    for rule in rules_of(rule_set):
        outcome = _outcome(rule, facts)
        verdict, why = _judge(rule, outcome)
        rows.append(
            (rule.clause, rule.rule, outcome.subject, float(outcome.computed), rule.limit,
             rule.unit, verdict, why, rule.edition, rule.source, rule.confirmed, rule.topic,
             rule.asks, rule.bound, rule.rule_set)
        )  # fmt: skip
    return pd.DataFrame(rows, columns=list(_COLUMNS))


def _outcome(rule: Rule, facts: Facts) -> Outcome:
    if not rule.measure:
        return Outcome(float("nan"), why=rule.note or "nothing in a plan tells")
    concerned = facts.concerned(rule.applies)
    outcome = MEASURES[rule.measure].compute(facts, concerned, rule.host)
    out = facts.left_out(concerned)
    if not out or outcome.partial or rule.measure == LEFT_OUT:
        return outcome
    # What is not connected is neither late nor lost; a pass would not be one of all points.
    said = f"{out} point{'s' if out > 1 else ''} left out"
    why = f"{outcome.why}; {said}" if outcome.why else said
    return outcome._replace(why=why, partial=True)


def _judge(rule: Rule, outcome: Outcome) -> tuple[str, str]:
    """Return the verdict, and why."""
    if outcome.computed != outcome.computed:
        return "not verified", outcome.why
    verdict = "pass" if rule.keeps(outcome.computed) else "fail"
    if verdict == "pass" and outcome.partial:
        return "not verified", outcome.why
    if rule.confirmed:
        return verdict, outcome.why
    made = f" ({outcome.why})" if outcome.why else ""
    return "not verified", f"would {verdict}{made}, but the clause was not read"
