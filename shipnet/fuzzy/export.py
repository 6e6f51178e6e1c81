"""A rule base as text: TOML, and the languages of PLCs: FCL and structured text (ST).

The grammars are those of IEC 61131-7 (FCL; none of us has read the standard, only the production
rules of its draft CD 1.0 that the Free Fuzzy Logic Library prints) and of IEC 61131-3. In a PLC,
names have prefixes, so that none is a keyword.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import fields
from math import inf

import numpy as np

from shipnet.errors import ArgumentError
from shipnet.fuzzy.terms import Rule, Term, Variable
from shipnet.toml_file import shown

_TOML = """\
# A rule base, for shipnet.fuzzy.read_rules. The corners of a term are its left foot, left shoulder,
# right shoulder and right foot; -inf or inf means an open shoulder. Priority 1 is reported first.
"""


def toml_text(variables: Sequence[Variable], rules: Sequence[Rule]) -> str:
    """Return a rule base as TOML, for `read_rules`."""
    lines = [_TOML]
    for one in variables:
        terms = [", ".join(_keys(term, crisp=shown(str(term.crisp)))) for term in one.terms]
        rows = "".join(f"  {{ {term} }},\n" for term in terms)
        lines += ["[[variables]]", *_keys(one, terms=f"[\n{rows}]"), ""]
    for rule in rules:
        lines += ["[[rules]]", *_keys(rule, antecedent=shown(rule.text)), ""]
    return "\n".join(lines)


def _keys(part: Variable | Term | Rule, **written: str) -> list[str]:
    """Return the fields of a part as TOML; `written` are those that are TOML already."""
    names = [one.name for one in fields(part)]
    return [f"{name} = {written.get(name) or shown(getattr(part, name))}" for name in names]


def fcl_text(variables: Sequence[Variable], rules: Sequence[Rule]) -> str:
    """Return a rule base in the Fuzzy Control Language of IEC 61131-7.

    The output of a rule is the centre of two singletons: 1, as strong as the rule, and 0, as strong
    as its negation. It is therefore the firing strength.
    """
    lines = _head(variables, rules, "REAL")
    for one in variables:
        lines.append(f"FUZZIFY in_{one.name}")
        for term in one.terms:
            points = " ".join(f"({_real(x)}, {_real(y)})" for x, y in _points(one, term))
            lines.append(f"  TERM {one.name}_is_{term.name} := {points};")
        lines += ["END_FUZZIFY", ""]
    for rule in rules:
        lines += [f"DEFUZZIFY rule_{rule.code}", "  TERM fires := 1.0;", "  TERM rests := 0.0;"]
        lines += ["  METHOD : COGS;", "  DEFAULT := 0.0;", "END_DEFUZZIFY", ""]
    # Where AND takes the minimum, the standard's OR takes the maximum.
    lines += ["RULEBLOCK diagnosis", "  AND : MIN;", "  ACT : MIN;", "  ACCU : MAX;"]
    for number, rule in enumerate(rules, 1):
        pairs = [(f"in_{name} IS", f"{name}_is_{term}") for name, term in rule.antecedent]
        holds = " AND ".join(f"{name} {term}" for name, term in pairs)
        fails = " OR ".join(f"{name} NOT {term}" for name, term in pairs)
        lines.append(f"  RULE {2 * number - 1} : IF {holds} THEN rule_{rule.code} IS fires;")
        lines.append(f"  RULE {2 * number} : IF {fails} THEN rule_{rule.code} IS rests;")
    return "\n".join([*lines, "END_RULEBLOCK", "", "END_FUNCTION_BLOCK", ""])


def _points(variable: Variable, term: Term) -> list[tuple[float, float]]:
    """Return the points of a term's membership function, which is 0 for invalid values.

    REAL has 32 bits, so the sides of a step are neighbouring numbers of 32 bits.
    """
    (a, b, c, d), (lowest, highest) = term.corners, variable.valid
    inside = [corner for corner in term.corners if variable.low < corner < variable.high]
    below = [lowest, *(x for x in inside if x == a == b)]
    above = [highest, *(x for x in inside if x == c == d)]
    beside = [np.nextafter(np.float32(x), np.float32(-inf)) for x in below]
    beside += [np.nextafter(np.float32(x), np.float32(inf)) for x in above]
    x = np.unique([lowest, variable.low, *inside, variable.high, highest, *map(float, beside)])
    valid = (x >= lowest) & (x <= highest)
    y = term.membership(x.clip(variable.low, variable.high)) * valid
    # A point between two of the same height is not needed.
    bends = np.diff(y, prepend=y[0], append=y[-1]) != 0
    kept = bends[1:] | bends[:-1]
    return list(zip(x[kept].tolist(), y[kept].tolist(), strict=True))


def st_text(variables: Sequence[Variable], rules: Sequence[Rule]) -> str:
    """Return a rule base as a function block in structured text.

    Its arithmetic is that of `shipnet.fuzzy.terms.trapezoid`, in 64 bits.
    """
    lines = _head(variables, rules, "LREAL")
    names = [f"{one.name}_is_{term.name}" for one in variables for term in one.terms]
    lines += ["VAR", "  x : LREAL;", *(f"  {name} : LREAL;" for name in names), "END_VAR", ""]
    for one in variables:
        value, (lowest, highest) = f"in_{one.name}", map(_real, one.valid)
        lines.append(f"valid_{one.name} := ({value} >= {lowest}) AND ({value} <= {highest});")
        lines += [f"{one.name}_is_{term.name} := 0.0;" for term in one.terms]
        lines.append(f"IF valid_{one.name} THEN")
        lines.append(f"  x := LIMIT({_real(one.low)}, {value}, {_real(one.high)});")
        for term in one.terms:
            lines.append(f"  {one.name}_is_{term.name} := {_weakest(_sides(term))};")
        lines += ["END_IF;", ""]
    for rule in rules:
        conditions = [f"{name}_is_{term}" for name, term in rule.antecedent]
        lines.append(f"rule_{rule.code} := {_weakest(conditions)};")
    return "\n".join([*lines, "", "END_FUNCTION_BLOCK", ""])


def _sides(term: Term) -> list[str]:
    """Return the rising and the falling side of the membership of x, without open shoulders."""
    a, b, c, d = term.corners
    sides = []
    if a < b:
        minus = f"{'-' if a >= 0 else '+'} {_real(abs(a))}"
        sides.append(f"(LIMIT({_real(a)}, x, {_real(b)}) {minus}) / {_real(b - a)}")
    elif a > -inf:
        sides.append(f"SEL(x >= {_real(b)}, 0.0, 1.0)")
    if c < d:
        sides.append(f"({_real(d)} - LIMIT({_real(c)}, x, {_real(d)})) / {_real(d - c)}")
    elif d < inf:
        sides.append(f"SEL(x <= {_real(c)}, 0.0, 1.0)")
    return sides


def _weakest(parts: Sequence[str]) -> str:
    return f"MIN({', '.join(parts)})" if len(parts) > 1 else parts[0]


def _head(variables: Sequence[Variable], rules: Sequence[Rule], kind: str) -> list[str]:
    """Return the beginning of a function block, up to its outputs; refuse what no PLC can name."""
    names = [f"{prefix}_{one.name}" for one in variables for prefix in ("in", "valid")]
    names += [f"{one.name}_is_{term.name}" for one in variables for term in one.terms]
    names += [f"rule_{rule.code}" for rule in rules]
    counts = Counter(map(str.lower, names))
    wrong = [name for name in names if "__" in name or name[-1] == "_" or counts[name.lower()] > 1]
    if wrong:
        raise ArgumentError(
            f"names in the PLC would be {', '.join(wrong)}; underscores must be single and not the "
            "last character, and names must differ in more than case"
        )
    valid = [f"  valid_{one.name} : BOOL;" for one in variables if kind == "LREAL"]
    return [
        "(* Written by shipnet. Its syntax has been tested, but it has not been compiled. *)",
        "(* If an input is invalid, the rules that need it have a firing strength of 0. *)",
        *("FUNCTION_BLOCK diagnosis_rules", "", "VAR_INPUT"),
        *(f"  in_{v.name} : {kind}; {_comment(f'{v.english} [{v.unit}]')}" for v in variables),
        *("END_VAR", "", "VAR_OUTPUT", *valid),
        *(
            f"  rule_{r.code} : {kind}; {_comment(f'{r.english}, priority {r.priority}')}"
            for r in rules
        ),
        *("END_VAR", ""),
    ]


def _comment(text: str) -> str:
    return f"(* {text.replace('*', '')} *)"


def _real(value: float) -> str:
    """Return a number as a literal, which has digits on both sides of a point."""
    digits, mark, exponent = repr(value).partition("e")
    return f"{digits if '.' in digits else f'{digits}.0'}{mark}{exponent}"
