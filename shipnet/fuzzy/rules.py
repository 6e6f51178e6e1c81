"""Rules, and the rule base that they make: if these terms hold, then this fault."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

from shipnet.errors import ArgumentError
from shipnet.fields import check_whole
from shipnet.fuzzy.ramps import Ramps
from shipnet.fuzzy.terms import Term, Variable, check_word

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["NORMAL", "UNKNOWN", "Rule", "RuleBase"]

#: What is said when no rule fires, and when no sensor says anything.
NORMAL, UNKNOWN = "normal", "unknown"


@dataclass(frozen=True, slots=True)
class Rule:
    """If all of these terms hold, then this fault.

    Parameters
    ----------
    code : str
        Name of the fault, such as ``V1``; not ``normal`` or ``unknown``.
    antecedent : tuple of (str, str)
        Pairs of variable and term, one or more, each variable once.
    priority : int
        Rank when several rules fire, 1..9999; 1 is reported first.
    flag : str, default ""
        The flag that it sets; several rules may set one.
    english, korean : str, default ""
        Labels.

    Raises
    ------
    ArgumentError
        If a field is not as above.

    Examples
    --------
    >>> rule = Rule("V1", Rule.parse("FP.high & OP.high"), 3, "ValveStick", "valve stuck")
    >>> rule.antecedent, rule.text
    ((('FP', 'high'), ('OP', 'high')), 'FP.high & OP.high')
    """

    code: str
    antecedent: tuple[tuple[str, str], ...]
    priority: int
    flag: str = ""
    english: str = ""
    korean: str = ""

    def __post_init__(self) -> None:
        """Check every field."""
        if check_word("code", self.code) in (NORMAL, UNKNOWN):
            raise ArgumentError(f"code is {self.code!r}, which says that no rule fires")
        object.__setattr__(self, "priority", check_whole("priority", self.priority, 1, 9999))
        pairs = tuple((variable, term) for variable, term in self.antecedent)
        object.__setattr__(self, "antecedent", pairs)
        names = self.variables
        if not names or len(set(names)) < len(names):
            raise ArgumentError(
                f"antecedent of {self.code} is {self.text!r}; it must have one term or more, each "
                "of another variable"
            )

    @staticmethod
    def parse(text: str) -> tuple[tuple[str, str], ...]:
        """Return the pairs of an antecedent such as ``FP.high & OP.high``.

        Parameters
        ----------
        text : str
            Terms behind their variables, joined by ``&``.
        """
        pairs = []
        for part in text.split("&"):
            variable, dot, term = part.strip().partition(".")
            if not dot:
                raise ArgumentError(f"antecedent is {text!r}; it must be like FP.high & OP.high")
            pairs.append((check_word("variable", variable), check_word("term", term)))
        return tuple(pairs)

    @property
    def text(self) -> str:
        """The antecedent as `parse` reads it."""
        return " & ".join(f"{variable}.{term}" for variable, term in self.antecedent)

    @property
    def variables(self) -> tuple[str, ...]:
        """Names of the variables that it needs."""
        return tuple(variable for variable, _ in self.antecedent)


@dataclass(frozen=True)
class RuleBase:
    """Rules and the variables they speak of.

    Parameters
    ----------
    variables : sequence of Variable
        One or more, each name once.
    rules : sequence of Rule
        One or more, each code and each priority once; their number, from 1 on, is their place here.

    Raises
    ------
    ArgumentError
        If names repeat, or a rule speaks of a term that there is not: all that is wrong.

    Examples
    --------
    >>> from shipnet.fuzzy import published
    >>> base = published.rule_base("kim2014")
    >>> len(base.rules), base.names, base.ranking[:3]
    (12, ('FP', 'OP', 'MC', 'OT', 'VPos', 'DVPos'), ('G1', 'P1', 'V1'))
    """

    variables: tuple[Variable, ...]
    rules: tuple[Rule, ...]

    def __post_init__(self) -> None:
        """Check that they fit together."""
        object.__setattr__(self, "variables", tuple(self.variables))
        object.__setattr__(self, "rules", tuple(self.rules))
        if not self.rules or not self.variables:
            raise ArgumentError("a rule base must have one variable and one rule, or more")
        twice = repeated(self.names)
        faults = [f"variable {name} stands twice" for name in twice]
        faults += [fault for _, fault in rule_faults(self.variables, self.rules)]
        if faults:
            raise ArgumentError("; ".join(faults))

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
        """The rules as ramps, from which `shipnet.fuzzy.strengths` makes firing strengths."""
        return Ramps(self.variables, [rule.antecedent for rule in self.rules])

    def variable(self, name: str) -> Variable:
        """Return the variable of a name.

        Parameters
        ----------
        name : str
            One of `names`.
        """
        for variable in self.variables:
            if variable.name == name:
                return variable
        raise ArgumentError(f"variable is {name!r}; there are {', '.join(self.names)}")

    def rule(self, code: str) -> Rule:
        """Return the rule of a code.

        Parameters
        ----------
        code : str
            One of `codes`.
        """
        for rule in self.rules:
            if rule.code == code:
                return rule
        raise ArgumentError(f"code is {code!r}; there are {', '.join(self.codes)}")

    def terms_of(self, rule: Rule) -> list[tuple[Variable, Term]]:
        """Return the variables and terms that a rule speaks of.

        Parameters
        ----------
        rule : Rule
            One of the rules.
        """
        found = ((self.variable(name), term) for name, term in rule.antecedent)
        return [(variable, variable.term(term)) for variable, term in found]

    def with_term(self, variable: str, term: Term) -> RuleBase:
        """Return the same rule base with another meaning of one term.

        Parameters
        ----------
        variable : str
            One of `names`.
        term : Term
            The term that takes the place of that of the same name.
        """
        old = self.variable(variable)
        old.term(term.name)
        terms = tuple(term if one.name == term.name else one for one in old.terms)
        new = replace(old, terms=terms)
        return RuleBase(tuple(new if one is old else one for one in self.variables), self.rules)

    @property
    def table(self) -> pd.DataFrame:
        """The rules as a table: code, antecedent, flag, priority and labels."""
        import pandas as pd

        rows = [
            (rule.code, rule.text, rule.flag, rule.priority, rule.english, rule.korean)
            for rule in self.rules
        ]
        columns = ["code", "antecedent", "flag", "priority", "english", "korean"]
        return pd.DataFrame(rows, columns=columns)


def rule_faults(variables: Sequence[Variable], rules: Sequence[Rule]) -> list[tuple[int, str]]:
    """Return what keeps rules from being a rule base, each with the place of the rule.

    Parameters
    ----------
    variables : sequence of Variable
        What the rules may speak of.
    rules : sequence of Rule
        The rules.

    Returns
    -------
    list of (int, str)
        Place of the rule, from 0 on, and what is wrong.

    Examples
    --------
    >>> rule_faults([], [Rule("V1", (("FP", "high"),), 1)])
    [(0, 'V1: there is no term FP.high')]
    """
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
            faults.append((place, f"code {rule.code} stands twice"))
        if rule.priority in priorities:
            faults.append((place, f"{rule.code}: priority {rule.priority} stands twice"))
        codes.add(rule.code)
        priorities.add(rule.priority)
    return faults


def repeated(names: Iterable[str]) -> list[str]:
    """Return the names that stand more than once, sorted.

    Parameters
    ----------
    names : iterable of str
        Names.

    Returns
    -------
    list of str
        Each once.
    """
    every = list(names)
    return sorted({name for name in every if every.count(name) > 1})
