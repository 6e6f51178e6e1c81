"""Rules, the rule base that they make, and the two CSV files that hold one.

    code,antecedent,flag,priority,english,korean
    V1,FP.high & OP.high,ValveStick,3,valve stuck,

    variable,term,unit,low,high,left_foot,left_shoulder,right_shoulder,right_foot,crisp,english,korean
    FP,,bar,0,160,,,,,,oil pump pressure,
    FP,high,,,,115,125,,,x > 120,high,

A row of the second file without a term describes its variable; both left corners empty, or both
right ones, are an open shoulder. Columns may come in any order; a column `note` is not kept.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import inf
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar

import numpy as np

from shipnet.errors import ArgumentError, InputError
from shipnet.fields import check_whole
from shipnet.fuzzy.terms import Term, Variable, check_word, number_text
from shipnet.tables import NUMBER, parse_sheet, read_bytes

if TYPE_CHECKING:
    import numpy.typing as npt
    import pandas as pd

    from shipnet.fuzzy.audit import Overlaps
    from shipnet.fuzzy.decision import Decision
    from shipnet.fuzzy.firing import Firing, Ramps, Samples

#: What is reported when no rule fires, and when no sensor reports anything.
NORMAL, UNKNOWN = "normal", "unknown"

#: How the terms are read.
METHODS = {
    "fuzzy": "membership functions",
    "crisp": "comparisons as written",
    "midpoint": "comparisons in the middle of the ramps",
}

#: Columns of the two files, in the order in which they are written.
RULE_COLUMNS = ("code", "antecedent", "flag", "priority", "english", "korean")
_CORNERS = ("left_foot", "left_shoulder", "right_shoulder", "right_foot")
TERM_COLUMNS = ("variable", "term", "unit", "low", "high", *_CORNERS, "crisp", "english", "korean")

#: Columns that a row of each kind leaves empty.
_NOT_OF_A_VARIABLE, _NOT_OF_A_TERM = (*_CORNERS, "crisp"), ("unit", "low", "high")

_Row: TypeAlias = tuple[str, Mapping[str, str]]
_Made = TypeVar("_Made", "Rule", Term, Variable)


@dataclass(frozen=True, slots=True)
class Rule:
    """If all of these terms hold, then this fault.

    Parameters
    ----------
    code : str
        Name of the fault, such as ``V1``; not ``normal`` or ``unknown``.
    antecedent : str or tuple of (str, str)
        Variables and terms such as ``FP.high & OP.high``, or pairs of them; each variable once.
    priority : int
        Rank when several rules fire, 1..9999; 1 is reported first.
    flag : str, default ""
        The flag that the rule sets; several rules may set the same flag.
    english, korean : str, default ""
        Labels.

    Raises
    ------
    ArgumentError
        If a field is not as above.

    Examples
    --------
    >>> rule = Rule("V1", "FP.high & OP.high", 3, "ValveStick", "valve stuck")
    >>> rule.antecedent, rule.text
    ((('FP', 'high'), ('OP', 'high')), 'FP.high & OP.high')
    """

    code: str
    antecedent: tuple[tuple[str, str], ...]
    priority: int
    flag: str = ""
    english: str = ""
    korean: str = ""

    if TYPE_CHECKING:

        def __init__(
            self,
            code: str,
            antecedent: str | tuple[tuple[str, str], ...],
            priority: int,
            flag: str = "",
            english: str = "",
            korean: str = "",
        ) -> None: ...

    def __post_init__(self) -> None:
        """Check every field."""
        if check_word("code", self.code) in (NORMAL, UNKNOWN):
            raise ArgumentError(f"code is {self.code!r}, which says that no rule fires")
        object.__setattr__(self, "priority", check_whole("priority", self.priority, 1, 9999))
        given = self.antecedent
        pairs = _antecedent(given) if isinstance(given, str) else tuple((v, t) for v, t in given)
        object.__setattr__(self, "antecedent", pairs)
        names = self.variables
        if not names or len(set(names)) < len(names):
            raise ArgumentError(
                f"antecedent of {self.code} is {self.text!r}; it must have one term or more, each "
                "of another variable"
            )

    @property
    def text(self) -> str:
        """The antecedent as text."""
        return " & ".join(f"{variable}.{term}" for variable, term in self.antecedent)

    @property
    def variables(self) -> tuple[str, ...]:
        """Names of the variables that the rule needs."""
        return tuple(variable for variable, _ in self.antecedent)


@dataclass(frozen=True)
class RuleBase:
    """Rules and the variables that they use.

    Parameters
    ----------
    variables : sequence of Variable
        One or more, each name once.
    rules : sequence of Rule
        One or more, each code and each priority once; they are numbered from 1 in this order.

    Raises
    ------
    ArgumentError
        If names repeat, or a rule uses a term that does not exist: all faults at once.

    Examples
    --------
    >>> from shipnet import datasets
    >>> base = read_rules(*(datasets.path(f"kim2014_assumed_{x}.csv") for x in ("rules", "terms")))
    >>> len(base.rules), base.names, base.ranking[:3]
    (12, ('FP', 'OP', 'MC', 'OT', 'VPos', 'DVPos'), ('G1', 'P1', 'V1'))
    >>> base.decide({"FP": 121, "OP": 2.9}).explain()
    'V1 0.60: FP 121 bar high 0.60, OP 2.9 bar high 0.90; missing MC OT VPos DVPos'
    >>> base.fire({"FP": [90, 120, 124], "OP": 2.83})["V1"].round(2).tolist()
    [0.0, 0.5, 0.83]
    >>> len(base.overlaps()), int(base.regions()["count"].max())
    (42, 6)
    """

    variables: tuple[Variable, ...]
    rules: tuple[Rule, ...]

    if TYPE_CHECKING:

        def __init__(self, variables: Sequence[Variable], rules: Sequence[Rule]) -> None: ...

    def __post_init__(self) -> None:
        """Check that they fit together."""
        object.__setattr__(self, "variables", tuple(self.variables))
        object.__setattr__(self, "rules", tuple(self.rules))
        if not self.rules or not self.variables:
            raise ArgumentError("a rule base must have one variable and one rule, or more")
        twice = sorted({name for name in self.names if self.names.count(name) > 1})
        faults = [f"variable {name} occurs twice" for name in twice]
        faults += [fault for _, fault in _rule_faults(self.variables, self.rules)]
        if faults:
            raise ArgumentError("; ".join(faults))

    def __repr__(self) -> str:
        """Return the numbers of rules and variables."""
        return f"RuleBase({len(self.rules)} rules, variables {' '.join(self.names)})"

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the variables, in order."""
        return tuple(variable.name for variable in self.variables)

    @cached_property
    def codes(self) -> tuple[str, ...]:
        """Codes of the rules, in order."""
        return tuple(rule.code for rule in self.rules)

    @cached_property
    def ranking(self) -> tuple[str, ...]:
        """Codes of the rules, the highest priority first."""
        return tuple(rule.code for rule in sorted(self.rules, key=lambda rule: rule.priority))

    @cached_property
    def ramps(self) -> Ramps:
        """The rules as ramps, from which firing strengths are computed."""
        from shipnet.fuzzy.firing import Ramps

        return Ramps(self.variables, [rule.antecedent for rule in self.rules])

    def __getitem__(self, name: str) -> Variable:
        """Return the variable of a name."""
        for variable in self.variables:
            if variable.name == name:
                return variable
        raise ArgumentError(f"variable is {name!r}; there are {', '.join(self.names)}")

    def rule(self, code: str) -> Rule:
        """Return the rule of a code."""
        for rule in self.rules:
            if rule.code == code:
                return rule
        raise ArgumentError(f"code is {code!r}; there are {', '.join(self.codes)}")

    def terms_of(self, rule: Rule) -> list[tuple[Variable, Term]]:
        """Return the variables and terms that a rule uses."""
        return [(self[name], self[name][term]) for name, term in rule.antecedent]

    def table(self) -> pd.DataFrame:
        """Return the rules: code, antecedent, flag, priority and labels."""
        import pandas as pd

        rows = [
            (rule.code, rule.text, rule.flag, rule.priority, rule.english, rule.korean)
            for rule in self.rules
        ]
        return pd.DataFrame(rows, columns=list(RULE_COLUMNS))

    def random_samples(self, n: int, rng: Any = None) -> dict[str, npt.NDArray[np.float64]]:
        """Return `n` samples, uniform over the universe of each variable."""
        generator = np.random.default_rng(rng)
        return {v.name: generator.uniform(v.low, v.high, n) for v in self.variables}

    def fire(self, samples: Samples, method: str = "fuzzy") -> Firing:
        """Return the firing strength of every rule for every sample.

        `samples` gives the values of the variables by name, as single numbers, arrays or a
        DataFrame; a variable that is left out is missing, as is NaN, and a rule that needs it does
        not fire. `method` is ``fuzzy``, ``crisp`` (comparisons as written) or ``midpoint``
        (comparisons in the middle of the ramps).
        """
        from shipnet.fuzzy.firing import fire

        return fire(self, samples, method)

    def decide(
        self,
        samples: Samples,
        method: str = "fuzzy",
        *,
        threshold: float = 0.5,
        k: int = 1,
        n: int = 1,
    ) -> Decision:
        """Return what to report of every sample: `fire`, then `Firing.decide`."""
        return self.fire(samples, method).decide(threshold=threshold, k=k, n=n)

    def overlaps(self, method: str = "crisp") -> Overlaps:
        """Return the pairs of rules that can fire together."""
        from shipnet.fuzzy.audit import Overlaps

        return Overlaps(self, method)

    def regions(
        self, method: str = "crisp", *, values: Mapping[str, Sequence[float]] | None = None
    ) -> pd.DataFrame:
        """Return every combination of terms that can hold at once, and the rules that then fire.

        One row per region: a value of each variable (those of `values` where given), the codes that
        ``fired``, and their number ``count``. The terms of a variable hold or not in a whole
        region, so the regions cover all that the sensors can report; how often each occurs is
        another question. `method` is ``crisp`` or ``midpoint``.
        """
        from shipnet.fuzzy.audit import regions

        return regions(self, method, values)

    def check(self, vectors: pd.DataFrame, method: str = "fuzzy") -> pd.DataFrame:
        """Return what the rules make of test vectors, whose index is the code expected of each.

        One row per vector: the code ``expected``, the codes that ``fired``, the ``top`` one, and
        whether that is ``right``.
        """
        from shipnet.fuzzy.audit import check

        return check(self, vectors, method)

    def centroid(self, samples: Samples) -> pd.DataFrame:
        """Defuzzify the number of the fault, as a controller would, to show why one must not.

        One row per sample: the ``active`` codes, the ``top`` one, the ``centroid`` of their
        numbers, and the code ``nearest`` to it.
        """
        from shipnet.fuzzy.audit import centroid

        return centroid(self, samples)

    def to_skfuzzy(self, n_points: int = 101) -> Any:
        """Return the rules as a `skfuzzy.control.ControlSystem`, to compare with.

        Each variable becomes an antecedent with `n_points` points and the corners of its terms, and
        each rule a consequent of its code with the one term ``on``.
        """
        from shipnet.fuzzy.firing import control_system

        return control_system(self, n_points)

    def save(self, rules: str | PathLike[str], terms: str | PathLike[str]) -> None:
        """Write two CSV files, from which `read_rules` makes the same rule base."""
        term_rows: list[tuple[Any, ...]] = []
        for variable in self.variables:
            ends = (number_text(variable.low), number_text(variable.high))
            labels = (variable.english, variable.korean)
            empty = ("",) * len(_NOT_OF_A_VARIABLE)
            term_rows.append((variable.name, "", variable.unit, *ends, *empty, *labels))
            for term in variable.terms:
                corners = (number_text(corner) for corner in term.corners)
                labels = (term.english, term.korean)
                term_rows.append(
                    (variable.name, term.name, "", "", "", *corners, str(term.crisp), *labels)
                )
        rows = self.table().to_numpy().tolist()
        for path, titles, cells in ((rules, RULE_COLUMNS, rows), (terms, TERM_COLUMNS, term_rows)):
            with Path(path).open("w", newline="", encoding="utf-8") as stream:
                writer = csv.writer(stream, lineterminator="\n")
                writer.writerow(titles)
                writer.writerows(cells)


def _antecedent(text: str) -> tuple[tuple[str, str], ...]:
    """Return the pairs of an antecedent such as ``FP.high & OP.high``."""
    pairs = []
    for part in text.split("&"):
        variable, dot, term = part.strip().partition(".")
        if not dot:
            raise ArgumentError(f"antecedent is {text!r}; it must be like FP.high & OP.high")
        pairs.append((check_word("variable", variable), check_word("term", term)))
    return tuple(pairs)


def _rule_faults(variables: Sequence[Variable], rules: Sequence[Rule]) -> list[tuple[int, str]]:
    """Return what is wrong with rules, each fault with the place of its rule."""
    known = {(variable.name, term.name) for variable in variables for term in variable.terms}
    faults = []
    codes: set[str] = set()
    priorities: set[int] = set()
    for place, rule in enumerate(rules):
        faults += [
            (place, f"{rule.code}: there is no term {variable}.{term}")
            for variable, term in rule.antecedent
            if (variable, term) not in known
        ]
        if rule.code in codes:
            faults.append((place, f"code {rule.code} occurs twice"))
        if rule.priority in priorities:
            faults.append((place, f"{rule.code}: priority {rule.priority} occurs twice"))
        codes.add(rule.code)
        priorities.add(rule.priority)
    return faults


def read_rules(rules: str | PathLike[str], terms: str | PathLike[str]) -> RuleBase:
    """Read a rule base from two CSV files.

    Parameters
    ----------
    rules : path
        File with one row per rule: code, antecedent, flag, priority, english, korean.
    terms : path
        File with one row per variable and one row per term: variable, term, unit, low, high,
        left_foot, left_shoulder, right_shoulder, right_foot, crisp, english, korean. Both files are
        UTF-8, separated by commas, semicolons or tabs, numbers with a decimal point. Blank rows are
        skipped.

    Returns
    -------
    RuleBase
        Variables and rules in the order of the rows.

    Raises
    ------
    InputError
        If a file cannot be read or is faulty: every fault with its row, column and value, and what
        was expected. The terms are read first.

    Examples
    --------
    >>> from shipnet import datasets
    >>> files = (datasets.path(f"kim2014_assumed_{what}.csv") for what in ("rules", "terms"))
    >>> read_rules(*files).rule("V1").text
    'FP.high & OP.high'
    """
    variables = _variables(str(terms), _rows(terms, TERM_COLUMNS, ("variable", "term")))
    rows = _rows(rules, RULE_COLUMNS, ("code", "antecedent", "priority"))
    faults: list[str] = []
    made, places = [], []
    for place, cells in rows:
        rule = _make(place, faults, lambda cells=cells: _rule(cells))  # type: ignore[misc]
        if rule is not None:
            made.append(rule)
            places.append(place)
    faults += [f"{places[number]}: {fault}" for number, fault in _rule_faults(variables, made)]
    if faults or not made:
        raise InputError(str(rules), *(faults or ["has no rule; expected one row per rule"]))
    return RuleBase(tuple(variables), tuple(made))


def _rows(path: str | PathLike[str], known: tuple[str, ...], needed: tuple[str, ...]) -> list[_Row]:
    """Return the rows that are not blank, each with its place; the titles are checked."""
    file = str(path)
    try:
        # No other encoding is guessed: it would make other letters of the labels.
        sheet = parse_sheet(read_bytes(path).decode("utf-8-sig"), file)
    except UnicodeDecodeError as error:
        raise InputError(file, f"is not UTF-8: byte {error.start} is wrong") from None
    columns = [title.lower() for title in sheet.titles]
    faults = [
        f"column {place}: title {title!r} is unknown; expected one of {', '.join(known)}, note"
        for place, title in enumerate(columns, start=1)
        if title not in (*known, "note")
    ]
    faults += [f"title {t!r} occurs twice" for t in sorted(set(columns)) if columns.count(t) > 1]
    faults += [f"no column {title}" for title in needed if title not in columns]
    # A row that is too long is shifted: its cells cannot be trusted.
    faults += [
        f"row {number} has {len(row)} cells; expected {len(columns)}"
        for number, row in sheet.rows
        if any(row[len(columns) :])
    ]
    if faults:
        raise InputError(file, *faults)
    blank = dict.fromkeys(known, "")
    return [
        (f"row {n}", {**blank, **dict(zip(columns, row, strict=False))}) for n, row in sheet.rows
    ]


def _rule(cells: Mapping[str, str]) -> Rule:
    number = cells["priority"]
    if not re.fullmatch("[0-9]{1,4}", number):
        raise ArgumentError(f"column priority: {number!r}; expected a whole number 1..9999")
    labels = (cells["english"], cells["korean"])
    return Rule(cells["code"], cells["antecedent"], int(number), cells["flag"], *labels)


def _variables(file: str, rows: list[_Row]) -> list[Variable]:
    """Make the variables of the rows, or raise all that is wrong with them."""
    faults: list[str] = []
    heads: dict[str, _Row] = {}
    terms: dict[str, list[Term]] = {}
    for place, cells in rows:
        name, empty = cells["variable"], _NOT_OF_A_TERM if cells["term"] else _NOT_OF_A_VARIABLE
        kind = "term" if cells["term"] else "variable"
        faults += [
            f"{place}, column {column}: {cells[column]!r}; expected nothing, a {kind} has none"
            for column in empty
            if cells[column]
        ]
        if cells["term"]:
            term = _make(place, faults, lambda cells=cells: _term(cells))  # type: ignore[misc]
            terms.setdefault(name, [])
            terms[name] += [term] if term is not None else []
        elif name in heads:
            faults.append(f"{place}: variable {name} occurs twice")
        else:
            heads[name] = (place, cells)
    faults += [f"no row describes variable {name!r}" for name in terms if name not in heads]
    made = []
    for name, (place, cells) in heads.items():
        mine = tuple(terms.get(name, ()))
        # Without a row there is nothing else to say; faulty terms were named before.
        if mine or name not in terms:
            make = lambda cells=cells, mine=mine: _variable(cells, mine)  # noqa: E731
            variable = _make(place, faults, make)
            made += [variable] if variable is not None else []
    if faults or not made:
        raise InputError(file, *(faults or ["has no variable; expected one row per variable"]))
    return made


def _variable(cells: Mapping[str, str], terms: tuple[Term, ...]) -> Variable:
    low, high = (_number(cells, column) for column in ("low", "high"))
    labels = (cells["english"], cells["korean"])
    return Variable(cells["variable"], cells["unit"], low, high, terms, *labels)


def _term(cells: Mapping[str, str]) -> Term:
    corners = [
        _number(cells, column, inf if column.startswith("right") else -inf) for column in _CORNERS
    ]
    a, b, c, d = corners
    return Term(cells["term"], (a, b, c, d), cells["crisp"], cells["english"], cells["korean"])


def _number(cells: Mapping[str, str], column: str, default: float | None = None) -> float:
    cell = cells[column]
    if not cell and default is not None:
        return default
    if not NUMBER.fullmatch(cell):
        raise ArgumentError(f"column {column}: {cell!r}; expected a number")
    return float(cell)


def _make(place: str, faults: list[str], make: Callable[[], _Made]) -> _Made | None:
    """Return what is made, or None and note the fault."""
    try:
        return make()
    except ArgumentError as fault:
        faults.append(f"{place}: {fault}")
        return None
