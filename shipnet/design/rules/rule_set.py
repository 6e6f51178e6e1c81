"""Class rules as data: what each asks, what is computed for it, and where it stands.

    rule,measure,limit,unit,applies,bound,clause,source,confirmed
    alarm,response,2,s,inputs,at most,4.2.1,contract of the yard,yes

`rule`, `measure` and `limit` must be there; the other columns have defaults. `measure` names what
is computed (`shipnet.design.rules.measures.MEASURES`); a rule without one cannot be verified, and
needs no limit. A rule that is not `confirmed` was not read in its own text.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from os import PathLike
from typing import TYPE_CHECKING

from shipnet import datasets
from shipnet.design.rules.measures import APPLIES, MEASURES
from shipnet.errors import ArgumentError, InputError
from shipnet.tables import NUMBER, frame_sheet, read_sheet

if TYPE_CHECKING:
    from shipnet.tables import Sheet

__all__ = ["BOUNDS", "RULE_COLUMNS", "RULE_SETS", "Rule", "load_rules", "published_rules"]

#: Rule sets of `data/design_rules.csv`; what IMO asks holds beside the rules of a class society.
RULE_SETS = ("DNV", "BV", "IMO", "lee2012")
_WITH_IMO = ("DNV", "BV")

#: On which side of the limit a computed value is good.
BOUNDS = ("at most", "below", "at least")

#: Columns of a file of rules, with their defaults; without one a column must be there.
RULE_COLUMNS: Mapping[str, str | None] = {
    "rule": None, "measure": None, "limit": None, "topic": "own", "asks": "", "applies": "all",
    "bound": "at most", "unit": "", "host": "no", "clause": "", "edition": "", "source": "",
    "confirmed": "no", "note": "", "rule_set": "own",
}  # fmt: skip

_YES = {"yes": True, "true": True, "1": True, "no": False, "false": False, "0": False, "": False}


@dataclass(frozen=True, slots=True)
class Rule:
    """One rule.

    Parameters
    ----------
    rule : str
        Short name.
    measure : str
        What is computed, a key of `MEASURES`; ``""`` if nothing computes it.
    limit : float
        The computed value may be this, in the unit of the measure; NaN without a measure.
    topic, asks : str
        What it is about, and what it asks.
    applies : str, default "all"
        The points it is for, one of `APPLIES`.
    bound : {"at most", "below", "at least"}
        Which side of the limit is good.
    unit : str
        Of the limit.
    host : bool, default False
        Whether the host's own time counts.
    clause, edition, source : str
        Where it stands.
    confirmed : bool, default False
        Whether the clause itself was read.
    note : str
        What else there is to say.
    rule_set : str, default "own"
        Whose rule it is.

    Examples
    --------
    >>> Rule("alarm", "response", 2.0, applies="inputs").bound
    'at most'
    """

    rule: str
    measure: str
    limit: float
    topic: str = "own"
    asks: str = ""
    applies: str = "all"
    bound: str = "at most"
    unit: str = ""
    host: bool = False
    clause: str = ""
    edition: str = ""
    source: str = ""
    confirmed: bool = False
    note: str = ""
    rule_set: str = "own"

    def __post_init__(self) -> None:
        """Check the words, and that limit and measure go together."""
        words = (self.rule, self.measure, self.applies, self.bound, self.unit)
        if faults := list(_faults(*words, limit=self.limit)):
            raise ArgumentError("; ".join(faults))
        if self.measure:
            object.__setattr__(self, "unit", MEASURES[self.measure].unit)

    def keeps(self, computed: float) -> bool:
        """Return whether a computed value is on the good side of the limit.

        Parameters
        ----------
        computed : float
            In the unit of the measure.
        """
        if self.bound == "at least":
            return computed >= self.limit
        return computed < self.limit if self.bound == "below" else computed <= self.limit


def published_rules(rule_set: str = "DNV") -> tuple[Rule, ...]:
    """Return a rule set of a class society, of IMO, or as lee2012 quotes it.

    Parameters
    ----------
    rule_set : {"DNV", "BV", "IMO", "lee2012"}
        With DNV and BV come the rules of IMO.

    Returns
    -------
    tuple of Rule
        In the order of the file.

    Raises
    ------
    ArgumentError
        If there is no such set.

    Examples
    --------
    >>> [rule.limit for rule in published_rules("DNV") if rule.topic == "alarm delay"]
    [2.0, 2.0]
    >>> any(rule.confirmed for rule in published_rules("lee2012"))
    False
    """
    if rule_set not in RULE_SETS:
        raise ArgumentError(f"rule_set is {rule_set!r}; it must be one of {', '.join(RULE_SETS)}")
    wanted = (rule_set, "IMO") if rule_set in _WITH_IMO else (rule_set,)
    return tuple(rule for rule in _all() if rule.rule_set in wanted)


@cache
def _all() -> tuple[Rule, ...]:
    name = "design_rules.csv"
    return _rules(frame_sheet(datasets.read(name), name))


def load_rules(path: str | PathLike[str]) -> tuple[Rule, ...]:
    """Read rules of one's own from a CSV file or an Excel workbook.

    Parameters
    ----------
    path : path
        File with the columns of `RULE_COLUMNS`, in any order.

    Returns
    -------
    tuple of Rule
        In the order of the rows.

    Raises
    ------
    InputError
        If the file cannot be read, or does not hold rules: every fault with its row, column and
        value, and what was expected.

    Examples
    --------
    >>> len(load_rules(datasets.path("design_rules.csv"))) > 20
    True
    """
    return _rules(read_sheet(path, what="titles, which are at least rule, measure and limit"))


def _rules(sheet: Sheet) -> tuple[Rule, ...]:
    titles = ["_".join(title.lower().split()) for title in sheet.titles]
    faults = [
        f"column {place}: title {title!r}; expected one of {', '.join(RULE_COLUMNS)}"
        for place, title in enumerate(titles, start=1)
        if title not in RULE_COLUMNS
    ]
    faults += [f"title {t!r} stands twice" for t in dict.fromkeys(titles) if titles.count(t) > 1]
    faults += [
        f"no column {t}" for t, value in RULE_COLUMNS.items() if value is None and t not in titles
    ]
    if faults:
        raise InputError(sheet.source, *faults)
    rules: list[Rule] = []
    for number, cells in sheet.rows:
        if any(cells[len(titles) :]):
            faults.append(f"row {number} has {len(cells)} cells; expected {len(titles)}")
            continue
        given = {t: cell for t, cell in zip(titles, cells, strict=False) if cell}
        wrong, rule = _rule({t: given.get(t, value or "") for t, value in RULE_COLUMNS.items()})
        faults += [f"row {number}: {fault}" for fault in wrong]
        rules += rule
    names = [(rule.rule_set, rule.rule) for rule in rules]
    faults += [f"rule {name[1]!r} stands twice" for name in _twice(names)]
    if faults or not rules:
        raise InputError(sheet.source, *(faults or ["has no rule; expected one row a rule"]))
    return tuple(rules)


def _twice(names: Sequence[tuple[str, str]]) -> list[tuple[str, str]]:
    return [name for name in dict.fromkeys(names) if names.count(name) > 1]


def _rule(cells: Mapping[str, str]) -> tuple[list[str], list[Rule]]:
    """Return what is wrong with a row, and the rule if nothing is."""
    faults = []
    number = cells["limit"].replace(",", ".")
    if not NUMBER.fullmatch(number) and (number or cells["measure"]):
        faults.append(f"limit is {cells['limit']!r}; expected a number")
        number = "0"
    limit = float(number or "nan")
    flags = {name: cells[name].lower() for name in ("host", "confirmed")}
    faults += [
        f"{n} is {cells[n]!r}; expected yes or no" for n, f in flags.items() if f not in _YES
    ]
    words = {name: cells[name] for name in RULE_COLUMNS if name not in ("limit", *flags)}
    checked = (words[name] for name in ("rule", "measure", "applies", "bound", "unit"))
    faults += _faults(*checked, limit=limit)
    if faults:
        return faults, []
    return [], [
        Rule(**words, limit=limit, host=_YES[flags["host"]], confirmed=_YES[flags["confirmed"]])
    ]


def _faults(
    rule: str, measure: str, applies: str, bound: str, unit: str, *, limit: float
) -> Iterator[str]:
    for name, value, known in (
        ("measure", measure, ("", *MEASURES)),
        ("applies", applies, tuple(APPLIES)),
        ("bound", bound, BOUNDS),
    ):
        if value not in known:
            yield f"{name} is {value!r}; expected one of {', '.join(map(repr, known))}"
    if not rule:
        yield "rule is ''; expected a name"
    if measure in MEASURES:
        if not (math.isfinite(limit) and limit >= 0):
            yield f"limit is {limit!r}; expected a number, 0 or more"
        if unit not in ("", MEASURES[measure].unit):
            yield f"unit is {unit!r}; expected {MEASURES[measure].unit!r}, as computed"
