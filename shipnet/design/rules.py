"""Class rules as data, and the check of a design against them."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import MISSING, asdict, dataclass, fields
from functools import cache
from operator import ge, le, lt
from os import PathLike
from typing import Any

import numpy as np

from shipnet import datasets
from shipnet.answers import Findings
from shipnet.arrays import Floats
from shipnet.design.layout import Layout
from shipnet.design.measures import LEFT_OUT, MEASURES, Facts, Outcome
from shipnet.errors import ArgumentError, InputError
from shipnet.fields import (
    Choice,
    Kind,
    Number,
    Switch,
    check_fields,
    check_scalar,
    choice,
    declared,
    number,
    record,
    switch,
    text,
)
from shipnet.lazy import pd
from shipnet.tables import NUMBER, Sheet, frame_sheet, in_order, read_sheet, titled

#: Longest update time of a fast point [ms]: the shortest time in class rules, 0.1 s in
#: DNV-OS-D202 Ch.2 Sec.3 Table A1.
FAST_MS = 100.0

#: Functions that return a mask of the points to which a rule applies, by name.
APPLIES: Mapping[str, Callable[[pd.DataFrame], pd.Series[bool]]] = {
    "all": lambda points: points["type"] != "",
    "inputs": lambda points: points["type"].isin(["DI", "AI"]),
    "outputs": lambda points: points["type"].isin(["DO", "AO"]),
    "fast": lambda points: points["update_ms"] <= FAST_MS,
    "fast outputs": lambda points: APPLIES["fast"](points) & APPLIES["outputs"](points),
    "essential": lambda points: points["category"] != "I",
    "category III": lambda points: points["category"] == "III",
}


# Class rules as data ----------------------------------------------------------------------------

#: Rule sets of `data/design_rules.csv`; a society's rules apply together with those of the IMO.
RULE_SETS = ("DNV", "BV", "IMO", "lee2012", "supply", "NMEA 2000")
_WITH_IMO = ("DNV", "BV")

#: The comparison of a computed value with its limit, by its name in rules.
BOUNDS = {"at most": le, "below": lt, "at least": ge}

_YES = {"yes": True, "true": True, "1": True, "no": False, "false": False, "0": False, "": False}


@record(slots=True)
class Rule:
    """One class rule: the measure computed for it, and its limit.

    Raises
    ------
    ArgumentError
        If a value is not legal, or a rule with a measure has no limit.

    Examples
    --------
    >>> rule = Rule("one cable", "points lost by a cable", 10, confirmed="yes")
    >>> rule.meets(8), rule.unit
    (True, 'points')
    """

    rule: str = text("Name of the rule")
    measure: str = choice(
        ("", *MEASURES), "A name in `RuleSet.measures`, or empty if no plan can show compliance"
    )
    limit: float = number(0, 1e12, help="The limit, in the unit of the measure", missing=True)
    topic: str = text("Topic of the rule", default="own")
    asks: str = text("The requirement in words", default="", most=1000)
    applies: str = choice(tuple(APPLIES), "The points concerned", default="all")
    bound: str = choice(tuple(BOUNDS), "How a value compares with the limit", default="at most")
    unit: str = text("Unit of the limit: empty, or the unit of the measure", default="")
    host: bool = switch("Whether the time in the host is included", default=False)
    clause: str = text("Clause of the document", default="")
    edition: str = text("Edition of the document", default="")
    source: str = text("The document", default="", most=1000)
    confirmed: str = choice(
        ("no", "maker", "yes"),
        "yes: the rule's text was read; maker: only a manufacturer's "
        "document; no: neither was read, so the rule counts as not verified",
        default="no",
    )
    note: str = text("Why no plan can show compliance", default="", most=1000)
    rule_set: str = text("Rule set of the rule", default="own")

    def __post_init__(self) -> None:
        check_fields(self)
        if not self.rule:
            raise ArgumentError("rule is ''; it must be a name")
        if self.measure:
            unit = MEASURES[self.measure].unit
            if self.unit not in ("", unit):
                raise ArgumentError(f"unit is {self.unit!r}; it must be {unit!r} for this measure")
            if math.isnan(self.limit):
                raise ArgumentError("limit is nan; it must be a number, 0 or more")
            object.__setattr__(self, "unit", unit)

    def meets(self, computed: float) -> bool:
        """Return whether a computed value meets the limit; NaN never does."""
        return bool(BOUNDS[self.bound](computed, self.limit))


@dataclass(frozen=True)
class RuleSet:
    """A set of class rules: a published one, or your own from a file.

    Parameters
    ----------
    rules : tuple of Rule
        One or more rules.

    Raises
    ------
    ArgumentError
        If there is no rule.

    Examples
    --------
    >>> dnv = RuleSet.published("DNV")
    >>> len(dnv), float(dnv.table().loc["indication", "limit"])
    (15, 1.0)
    >>> RuleSet.measures().loc["response", "unit"]
    's'
    """

    rules: tuple[Rule, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "rules", tuple(self.rules))
        if not self.rules:
            raise ArgumentError("rules is empty; there must be at least one Rule")

    @classmethod
    def published(cls, rules: str = "DNV") -> RuleSet:
        """Return a published rule set by its name; DNV and BV include the rules of the IMO."""
        if rules not in RULE_SETS:
            raise ArgumentError(
                f"rules is {rules!r}; it must be one of {', '.join(RULE_SETS)}, or a file"
            )
        rule_sets = (rules, "IMO") if rules in _WITH_IMO else (rules,)
        return cls(tuple(rule for rule in _published() if rule.rule_set in rule_sets))

    @classmethod
    def read(cls, path: str | PathLike[str]) -> RuleSet:
        """Read your own rules from a CSV file or an Excel workbook."""
        what = "titles (at least rule, measure and limit)"
        return cls(_rules(read_sheet(path, what=what)))

    @classmethod
    def of(cls, rules: RuleSet | str | PathLike[str]) -> RuleSet:
        """Return `rules` if it is a rule set, or the set that it names: published, or in a file."""
        if isinstance(rules, RuleSet):
            return rules
        if isinstance(rules, PathLike) or str(rules).lower().endswith((".csv", ".xlsx")):
            return cls.read(rules)
        return cls.published(rules)

    def __len__(self) -> int:
        return len(self.rules)

    def __iter__(self) -> Iterator[Rule]:
        return iter(self.rules)

    def __repr__(self) -> str:
        sets = ", ".join(dict.fromkeys(rule.rule_set for rule in self.rules))
        return f"<RuleSet: {len(self)} rules of {sets}>"

    def table(self) -> pd.DataFrame:
        """Return a table with one row per rule, indexed by name."""
        return pd.DataFrame([asdict(rule) for rule in self.rules]).set_index("rule")

    @staticmethod
    def measures() -> pd.DataFrame:
        """Return a table of the measures that rules may name, with unit and meaning."""
        rows = {name: measure[:2] for name, measure in MEASURES.items()}
        table = pd.DataFrame.from_dict(rows, orient="index", columns=["unit", "meaning"])
        return table.rename_axis("measure")


@cache
def _published() -> tuple[Rule, ...]:
    name = "design_rules.csv"
    return _rules(frame_sheet(datasets.read(name), name))


def _rules(sheet: Sheet) -> tuple[Rule, ...]:
    kinds = declared(Rule)
    needed = {one.name for one in fields(Rule) if one.default is MISSING}
    rows, faults = titled(sheet, {name: None if name in needed else "" for name in kinds})
    rules: list[Rule] = []
    for row, cells in rows:
        values: dict[str, Any] = {}
        wrong = len(faults)
        for name, kind in kinds.items():
            if cells[name] or name in needed:
                try:
                    values[name] = kind.check(name, _value(kind, cells[name]), None)
                except ArgumentError as fault:
                    faults.append((row, f": {fault}"))
        if len(faults) == wrong:
            try:
                rules.append(Rule(**values))
            except ArgumentError as fault:
                faults.append((row, f": {fault}"))
    texts = in_order(faults)
    names = Counter((rule.rule_set, rule.rule) for rule in rules)
    texts += [f"rule {name!r} is listed twice" for (_, name), count in names.items() if count > 1]
    if texts or not rules:
        raise InputError(sheet.source, *(texts or ["has no rule; expected one row per rule"]))
    return tuple(rules)


def _value(kind: Kind, cell: str) -> object:
    """Return the value of a cell, or the cell itself if it is not legal."""
    if isinstance(kind, Switch):
        return _YES.get(cell.lower(), cell)
    if isinstance(kind, Choice):
        return next((option for option in kind.options if option.lower() == cell.lower()), cell)
    if isinstance(kind, Number):
        plain = cell.replace(",", ".") or "nan"
        return float(plain) if NUMBER.fullmatch(plain) or not cell else cell
    return cell


def longest_responses(rules: Iterable[Rule], points: pd.DataFrame, host_time: float) -> Floats:
    """Return the longest response that rules allow for each point [s]; inf without a limit.

    A limit that the host alone exceeds is ignored, because no plan can meet it.
    """
    longest = np.full(len(points), np.inf)
    for rule in rules:
        if rule.measure == "response" and rule.bound != "at least":
            # Reduced slightly, so that a rounding error cannot decide the verdict.
            limit = (rule.limit - rule.host * host_time) * (1 - 1e-9)
            if limit > 0:
                concerned = APPLIES[rule.applies](points).to_numpy(bool)
                longest[concerned] = np.minimum(longest[concerned], limit)
    return longest


# The check: each rule with the value computed for it, and its verdict ----------------------------


def check(
    design: Layout,
    failures: pd.DataFrame,
    rules: RuleSet | str | PathLike[str] = "DNV",
    *,
    host_time: float | None = None,
) -> Findings:
    """Check a design and its single failures against class rules."""
    host = design.settings.host_time if host_time is None else host_time
    facts = Facts(design, failures, check_scalar("host_time", host, "s", 0.0, 60.0))
    rows = []
    for rule in RuleSet.of(rules):
        outcome = Outcome(math.nan, why=rule.note or "a plan cannot show it")
        if rule.measure:
            concerned = APPLIES[rule.applies](design.iolist.points).to_numpy(bool)
            outcome = MEASURES[rule.measure].compute(facts, concerned, rule.host)
            out = int((concerned & facts.left_out).sum())
            if out and not outcome.partial and rule.measure != LEFT_OUT:
                # A point without a bus is neither late nor lost, so the value may omit it.
                why = f"{out} point{'s' if out > 1 else ''} left out"
                why = f"{outcome.why}; {why}" if outcome.why else why
                outcome = outcome._replace(why=why, partial=True)
        verdict, why = _judge(rule, outcome)
        values = {**asdict(rule), "object": outcome.subject, "value": float(outcome.computed)}
        values |= {"low" if rule.bound == "at least" else "high": rule.limit}
        rows.append({**values, "verdict": verdict, "why": why})
    return Findings(pd.DataFrame(rows, columns=_FINDINGS))


_FINDINGS = (
    "rule object value low high unit verdict why source limit bound clause edition confirmed "
    "topic asks rule_set"
).split()


def _judge(rule: Rule, outcome: Outcome) -> tuple[str, str]:
    """Return the verdict and its reason."""
    why, verdict = outcome.why, "met" if rule.meets(outcome.computed) else "violated"
    if math.isnan(outcome.computed) or (verdict == "met" and outcome.partial):
        return "not verified", why
    if rule.confirmed == "no":
        because = f" ({why})" if why else ""
        return "not verified", f"would be {verdict}{because}, but the clause was not read"
    if rule.confirmed == "maker":
        maker = "the limit is from a manufacturer's document; no standard was read for it"
        why = f"{why}; {maker}" if why else maker
    return verdict, why
