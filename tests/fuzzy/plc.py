"""Interpreters of FCL (IEC 61131-7) and of a part of structured text (IEC 61131-3), for tests.

They know nothing of the program that wrote a text. FCL follows the production rules of the draft
CD 1.0 as http://ffll.sourceforge.net/ffll_and_fcl.htm prints them, without local variables; ST has
assignments, IF, expressions and the functions LIMIT, MAX, MIN and SEL. Both are stricter than most
compilers: a keyword is not a name, every name is declared once, and a REAL literal has a point.
"""

import operator
import re
from itertools import pairwise

TOKEN = re.compile(
    r"\s+|\(\*(?:(?!\*\)|\(\*)[\s\S])*\*\)|"
    r"(?P<real>\d+\.\d+(?:[eE][+-]?\d+)?)|(?P<integer>\d+)(?![\w.])|"
    r"(?P<word>[A-Za-z](?:_?[A-Za-z0-9])*)(?!\w)|(?P<sign>:=|<=|>=|<>|[-+*/<>=():;,])"
)
KEYWORDS = set(
    "FUNCTION_BLOCK END_FUNCTION_BLOCK VAR VAR_INPUT VAR_OUTPUT END_VAR REAL LREAL BOOL INT TIME "
    "FUZZIFY END_FUZZIFY DEFUZZIFY END_DEFUZZIFY TERM METHOD COG COGS COA LM RM DEFAULT NC RANGE "
    "RULEBLOCK END_RULEBLOCK AND OR XOR NOT MIN MAX PROD ASUM BSUM BDIF NSUM ACT ACCU RULE IF IS "
    "THEN ELSE ELSIF END_IF WITH TRUE FALSE LIMIT SEL MOD ON OF DO TO BY AT S1 R1 R S L N P D "
    "STEP TASK TYPE WITH RETURN EXIT FOR WHILE REPEAT CASE PROGRAM FUNCTION".split()
)


class SyntaxFault(ValueError):
    """The text is not a program."""


class Reader:
    """Reads a program token by token."""

    def __init__(self, text):
        self.tokens, place = [], 0
        while place < len(text):
            match = TOKEN.match(text, place)
            if match is None:
                raise SyntaxFault(f"at {text[place : place + 20]!r}")
            if match.lastgroup:
                self.tokens.append((match.lastgroup, match[0]))
            place = match.end()
        self.place = 0
        self.kinds = {}

    @property
    def token(self):
        return self.tokens[self.place] if self.place < len(self.tokens) else ("end", "")

    @property
    def next(self):
        return self.token[1].upper()

    def take(self, *legal):
        """Read one of these keywords or signs."""
        if self.next not in legal:
            raise SyntaxFault(f"{self.next!r} instead of {' '.join(legal)}")
        self.place += 1
        return self.tokens[self.place - 1][1].upper()

    def has(self, *legal):
        """Read one of these keywords or signs if it comes next."""
        return self.take(self.next) if self.next in legal else ""

    def every(self, *words):
        for word in words:
            self.take(word)

    def name(self):
        kind, text = self.token
        if kind != "word" or text.upper() in KEYWORDS:
            raise SyntaxFault(f"{text!r} is not a name")
        self.place += 1
        return text.upper()

    def known(self, *kinds):
        name = self.name()
        if self.kinds.get(name) not in kinds:
            raise SyntaxFault(f"{name} is not declared as {' '.join(kinds)}")
        return name

    def number(self):
        negative = self.has("-")
        kind, text = self.token
        if kind != "real":
            raise SyntaxFault(f"{text!r} is not a real literal")
        self.place += 1
        return -float(text) if negative else float(text)

    def integer(self):
        kind, text = self.token
        if kind != "integer":
            raise SyntaxFault(f"{text!r} is not an integer")
        self.place += 1
        return int(text)

    def declarations(self, *types):
        """Read the head of a function block; return the names of inputs and outputs."""
        self.take("FUNCTION_BLOCK")
        self.name()
        sections = {"VAR_INPUT": {}, "VAR_OUTPUT": {}, "VAR": {}}
        while section := self.has(*sections):
            while not self.has("END_VAR"):
                name = self.name()
                if name in self.kinds:
                    raise SyntaxFault(f"{name} is declared twice")
                self.take(":")
                self.kinds[name] = section
                sections[section][name] = self.take(*types)
                self.take(";")
        return sections


class Fcl(Reader):
    """A program in FCL; `run` returns the outputs for the values of its inputs."""

    def __init__(self, text):
        super().__init__(text)
        self.sections = self.declarations("REAL")
        if self.sections["VAR"]:
            raise SyntaxFault("FCL has no local variables")
        self.terms, self.singletons, self.defaults, self.rules = {}, {}, {}, []
        while self.has("FUZZIFY"):
            self.terms[self.known("VAR_INPUT")] = terms = {}
            while self.has("TERM"):
                name = self.name()
                self.take(":=")
                terms[name] = points = []
                while self.has("("):
                    x = self.number()
                    self.take(",")
                    points.append((x, self.number()))
                    self.take(")")
                self.take(";")
                if not points or points != sorted(points) or len(dict(points)) < len(points):
                    raise SyntaxFault(f"points of {name} do not ascend")
            self.take("END_FUZZIFY")
        while self.has("DEFUZZIFY"):
            output = self.known("VAR_OUTPUT")
            self.singletons[output] = terms = {}
            while self.has("TERM"):
                name = self.name()
                self.take(":=")
                terms[name] = self.number()
                self.take(";")
            self.every("METHOD", ":", "COGS", ";", "DEFAULT", ":=")
            self.defaults[output] = self.number()
            self.every(";", "END_DEFUZZIFY")
        self.take("RULEBLOCK")
        self.name()
        self.every("AND", ":", "MIN", ";", "ACT", ":", "MIN", ";", "ACCU", ":", "MAX", ";")
        while self.has("RULE"):
            self.rules.append(self.rule(len(self.rules) + 1))
        self.every("END_RULEBLOCK", "END_FUNCTION_BLOCK")
        if self.next:
            raise SyntaxFault(f"{self.next!r} after the end")

    def rule(self, expected):
        if self.integer() != expected:
            raise SyntaxFault(f"rule {expected} has another number")
        self.every(":", "IF")
        conditions = [self.condition()]
        joint = self.next if self.next in ("AND", "OR") else "AND"
        while self.has(joint):
            conditions.append(self.condition())
        self.take("THEN")
        output = self.known("VAR_OUTPUT")
        self.take("IS")
        term = self.name()
        self.take(";")
        if term not in self.singletons[output]:
            raise SyntaxFault(f"{term} is not a term of {output}")
        return joint, conditions, output, term

    def condition(self):
        variable = self.known("VAR_INPUT")
        self.take("IS")
        negated, term = self.has("NOT"), self.name()
        if term not in self.terms[variable]:
            raise SyntaxFault(f"{term} is not a term of {variable}")
        return variable, negated, self.terms[variable][term]

    def run(self, values):
        outputs = {name: dict.fromkeys(terms, 0.0) for name, terms in self.singletons.items()}
        for joint, conditions, output, term in self.rules:
            degrees = [
                1 - height(points, values[name]) if negated else height(points, values[name])
                for name, negated, points in conditions
            ]
            strength = min(degrees) if joint == "AND" else max(degrees)
            outputs[output][term] = max(outputs[output][term], strength)
        results = {}
        for name, weights in outputs.items():
            total = sum(weights.values())
            moment = sum(self.singletons[name][term] * w for term, w in weights.items())
            results[name] = moment / total if total else self.defaults[name]
        return results


def height(points, x):
    """Return the membership: linear between the points, constant beyond the first and the last."""
    if x <= points[0][0]:
        return points[0][1]
    for (left, low), (right, high) in pairwise(points):
        if x <= right:
            return low + (high - low) * (x - left) / (right - left)
    return points[-1][1]


LEVELS = (("OR",), ("XOR",), ("AND",), ("=", "<>"), ("<", ">", "<=", ">="), ("+", "-"), ("*", "/"))
OPERATORS = {
    "OR": operator.or_,
    "XOR": operator.xor,
    "AND": operator.and_,
    "=": operator.eq,
    "<>": operator.ne,
    "<": operator.lt,
    ">": operator.gt,
    "<=": operator.le,
    ">=": operator.ge,
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": operator.truediv,
}
FUNCTIONS = {
    "MIN": min,
    "MAX": max,
    "LIMIT": lambda low, x, high: min(max(x, low), high),
    "SEL": lambda choice, no, yes: yes if choice else no,
}


class StructuredText(Reader):
    """A function block in structured text; `run` returns its outputs."""

    def __init__(self, text):
        super().__init__(text)
        self.sections = self.declarations("LREAL", "BOOL")
        self.body = self.statements("END_FUNCTION_BLOCK")
        self.take("END_FUNCTION_BLOCK")
        if self.next:
            raise SyntaxFault(f"{self.next!r} after the end")

    def statements(self, *ends):
        body = []
        while self.next not in ends:
            body.append(self.choice() if self.has("IF") else self.assignment())
            self.take(";")
        return body

    def assignment(self):
        name = self.known("VAR", "VAR_OUTPUT")
        self.take(":=")
        value = self.expression(0)

        def run(values):
            values[name] = value(values)

        return run

    def choice(self):
        condition = self.expression(0)
        self.take("THEN")
        body = self.statements("END_IF")
        self.take("END_IF")

        def run(values):
            if condition(values):
                for statement in body:
                    statement(values)

        return run

    def expression(self, level):
        if level == len(LEVELS):
            return self.primary()
        left = self.expression(level + 1)
        while word := self.has(*LEVELS[level]):
            left = joined(OPERATORS[word], left, self.expression(level + 1))
        return left

    def primary(self):
        if self.has("("):
            value = self.expression(0)
            self.take(")")
            return value
        if function := self.has(*FUNCTIONS):
            self.take("(")
            parts = [self.expression(0)]
            while self.has(","):
                parts.append(self.expression(0))
            self.take(")")
            call = FUNCTIONS[function]
            return lambda values: call(*(part(values) for part in parts))
        if self.next == "-" or self.token[0] == "real":
            literal = self.number()
            return lambda values: literal
        name = self.known("VAR", "VAR_INPUT", "VAR_OUTPUT")
        return lambda values: values[name]

    def run(self, inputs):
        values = {
            **dict.fromkeys({**self.sections["VAR"], **self.sections["VAR_OUTPUT"]}),
            **inputs,
        }
        for statement in self.body:
            statement(values)
        return {name: values[name] for name in self.sections["VAR_OUTPUT"]}


def joined(operation, left, right):
    return lambda values: operation(left(values), right(values))
