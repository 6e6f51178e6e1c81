"""No regular expression takes more than linear time, whatever text a file contains.

A matcher that backtracks tries each way in which a run of text can be divided between two loops of
a pattern. The check draws a pattern as a graph of the characters that it reads, and looks for two
loops that read the same word, with a path on this word from the first to the second: the criterion
of Weber and Seidl (1991). A search may begin anywhere, which is one more loop before the pattern.
"""

import ast
import builtins
import re
from collections import defaultdict
from importlib import import_module
from itertools import product
from pathlib import Path
from re import _constants as op
from re import _parser

import pytest

import shipnet

PACKAGE = Path(shipnet.__file__).parent

#: Characters that stand for their kinds, beside those that a pattern names.
KINDS = "aZ09 \n\x00_,\xe9\uac00\u0663\xa0"
CLASSES = {
    op.CATEGORY_DIGIT: r"\d",
    op.CATEGORY_NOT_DIGIT: r"\D",
    op.CATEGORY_SPACE: r"\s",
    op.CATEGORY_NOT_SPACE: r"\S",
    op.CATEGORY_WORD: r"\w",
    op.CATEGORY_NOT_WORD: r"\W",
}
REPEATS = (op.MAX_REPEAT, op.MIN_REPEAT, op.POSSESSIVE_REPEAT)
SEARCHES = {"search", "findall", "finditer", "sub", "subn", "split", "extract", "contains"}
METHODS = SEARCHES | {"match", "fullmatch", "compile"}


class Graph:
    """The characters that a pattern reads, as states, and those that lead from state to state."""

    def __init__(self, pattern, flags=0, uses=("fullmatch",)):
        parsed = _parser.parse(pattern, flags)
        self.flags = parsed.state.flags
        named = set(pattern)
        self.alphabet = sorted({*KINDS, *named, *(one.swapcase()[0] for one in named)})
        self.reads, self.edges = [], defaultdict(dict)
        first, last, _ = self.sequence(parsed)
        # Where a pattern may end, only `fullmatch` tries another way, if any text is left.
        everything = {state for state in last if self.reads[state] == set(self.alphabet)}
        self.ends = everything if "fullmatch" in uses else set(last)
        if SEARCHES & set(uses) and parsed[0][0] not in (op.AT, op.ASSERT, op.ASSERT_NOT):
            start = self.state(frozenset(self.alphabet))
            self.join({start}, first | {start})
        # Of the characters that no state tells apart, one is enough.
        alike = {tuple(one in reads for reads in self.reads): one for one in self.alphabet}
        self.alphabet = sorted(alike.values())

    def state(self, reads):
        self.reads.append(reads)
        return len(self.reads) - 1

    def join(self, last, first, barred=frozenset()):
        for before, after in product(last, first):
            self.edges[before].setdefault(after, self.reads[after] - barred)

    def sequence(self, nodes):
        """Add nodes; return the first states, the last ones, and whether all may be absent.

        The last states are the keys of a dictionary, with the characters that may not follow.
        """
        first, last, empty = set(), {}, True
        for node in nodes:
            begin, end, absent = self.node(*node)
            for before, barred in last.items():
                self.join({before}, begin, barred)
            first |= begin if empty else set()
            last = {**(last if absent else {}), **end}
            empty = empty and absent
        return first, last, empty

    def node(self, kind, value):
        if kind in (op.AT, op.ASSERT, op.ASSERT_NOT):
            return set(), {}, True
        if kind is op.SUBPATTERN:
            _, more, less, body = value
            outside, self.flags = self.flags, (self.flags | more) & ~less
            part = self.sequence(body)
            self.flags = outside
            return part
        if kind is op.ATOMIC_GROUP:
            return self.sequence(value)
        if kind is op.BRANCH:
            parts = [self.sequence(part) for part in value[1]]
            last = {state: barred for part in parts for state, barred in part[1].items()}
            return set().union(*(part[0] for part in parts)), last, any(part[2] for part in parts)
        if kind in REPEATS:
            return self.repeat(kind, *value)
        state = self.state(frozenset(one for one in self.alphabet if self.fits(one, kind, value)))
        return {state}, {state: frozenset()}, False

    def repeat(self, kind, low, high, body):
        """Add a repeat; a limited one is not a loop, so three of its turns stand for all."""
        turn, perhaps = (op.ATOMIC_GROUP, body), (op.BRANCH, (None, [body, []]))
        if high is not op.MAXREPEAT:
            return self.sequence([turn] * min(low, 3) + [perhaps] * min(high - low, 3))
        first, last, absent = self.sequence([turn] * max(1, min(low, 3)))
        begin, end, _ = self.sequence(body)
        self.join(last, begin)
        self.join(end, begin)
        if kind is op.POSSESSIVE_REPEAT and begin == set(end) and len(begin) == 1:
            last = dict.fromkeys({**last, **end}, self.reads[min(begin)])
        return first, {**end, **last}, absent or low == 0

    def fits(self, character, kind, value):
        """Return whether a node for one character matches a character."""
        variants = {character}
        if self.flags & re.IGNORECASE:
            variants |= {character.lower()[0], character.upper()[0]}
        if kind is op.ANY:
            return character != "\n" or bool(self.flags & re.DOTALL)
        if kind is op.NOT_LITERAL:
            return chr(value) not in variants
        if kind is op.LITERAL:
            return chr(value) in variants
        if kind is op.RANGE:
            return any(value[0] <= ord(one) <= value[1] for one in variants)
        if kind is op.CATEGORY:
            return bool(re.match(CLASSES[value], character, self.flags & re.ASCII))
        assert kind is op.IN, f"{kind} is not known here"
        negated = value[0][0] is op.NEGATE
        items = value[1:] if negated else value
        return any(self.fits(character, *item) for item in items) != negated

    def after(self, state, character):
        return [target for target, reads in self.edges[state].items() if character in reads]

    def closure(self):
        """Return for each state those that at least one character leads to."""
        reached = {state: set(self.edges[state]) for state in range(len(self.reads))}
        for middle in reached:
            for targets in reached.values():
                if middle in targets:
                    targets |= reached[middle]
        return reached

    def shared(self):
        """Return two loops that may share a run of text, as the characters of each, or None."""
        reached = self.closure()
        loops = [state for state in reached if state in reached[state]]
        for first, second in product(loops, loops):
            if second in reached[first] and second not in self.ends:
                if self.share(first, second, reached):
                    return tuple("".join(sorted(self.reads[state])) for state in (first, second))
        return None

    def share(self, first, second, reached):
        """Return whether a word can be read in both loops and on a path from one to the other.

        If both are the same loop, a word must lead from it to itself on two paths.
        """
        ends = (first, second, second)
        seen, todo = set(), [((first, first, second), first != second)]
        while todo:
            states, differ = todo.pop()
            for character in self.alphabet:
                for targets in product(*(self.after(state, character) for state in states)):
                    new = targets, differ or targets[1] != targets[2]
                    if new == (ends, True):
                        return True
                    ways = zip(targets, ends, strict=True)
                    if new not in seen and all(at == end or end in reached[at] for at, end in ways):
                        seen.add(new)
                        todo.append(new)
        return False


class Local(str):
    """What stands for the text or the pattern in a local variable."""

    pattern = "x"


class Scope(dict):
    """The names of a module and its functions."""

    def __missing__(self, name):
        return Local("x")


def patterns():
    """Return the patterns of the package with their flags and the methods that use them."""
    paths = sorted(PACKAGE.rglob("*.py"))
    trees = {path: ast.parse(path.read_text(encoding="utf-8")) for path in paths}
    used = defaultdict(set)
    for node in (node for tree in trees.values() for node in ast.walk(tree)):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name | ast.Attribute):
            used[ast.unparse(node.value).split(".")[-1]].add(node.attr)
    found = []
    for path, tree in trees.items():
        module = ".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts)
        names = {
            id(node.value): ast.unparse(node.targets[0])
            for node in ast.walk(tree)
            if isinstance(node, ast.Assign)
        }
        for node in ast.walk(tree):
            if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute)):
                continue
            method, of = node.func.attr, ast.unparse(node.func.value)
            if method in METHODS and node.args and (of == "re" or of.endswith(".str")):
                scope = Scope(vars(builtins) | vars(import_module(module)))
                pattern = eval(ast.unparse(node.args[0]), {}, scope)
                if isinstance(pattern, bytes):
                    pattern = pattern.decode("latin-1")
                options = map(ast.unparse, [*node.args[1:], *(one.value for one in node.keywords)])
                flags = sum(
                    int(eval(text, {}, scope)) for text in options if re.match(r"re\.[A-Z]", text)
                )
                uses = used[names.get(id(node), "")] if method == "compile" else {method}
                place = f"{path.relative_to(PACKAGE.parent)}:{node.lineno}"
                found.append(pytest.param(pattern, flags, uses & METHODS, id=place))
    return found


@pytest.mark.parametrize(("pattern", "flags", "uses"), patterns())
def test_no_two_loops_of_a_pattern_share_a_run_of_text(pattern, flags, uses):
    assert Graph(pattern, flags, uses or ("fullmatch",)).shared() is None


@pytest.mark.parametrize(
    ("pattern", "use", "is_slow"),
    [
        (r"\s*\d+\s*x", "fullmatch", False),
        (r"\s*\s+x", "fullmatch", True),
        (r"\s*(-?\s*)#?", "fullmatch", True),
        (r"(a+)+b", "match", True),
        (r"(?:a|ab)*c", "match", False),
        (r"(?:ab|a|b)*c", "match", True),
        (r".*,.*x", "match", True),
        (r".*,.*", "match", False),
        (r".*,.*", "fullmatch", True),
        (r"a*(?s:.*)", "fullmatch", False),
        (r"\d+x", "match", False),
        (r"\d+x", "search", True),
        (r"\d+", "search", False),
        (r"(?<!\d)\d+x", "search", False),
        (r"[a-z]*[a-z0]*x", "match", True),
        (r"[a-z]*+[a-z0]*x", "match", False),
        (r"[a-z]*+[0-9]*x", "match", False),
        (r"[a-z0]*+[a-z]*x", "match", False),
        (r"a{0,900}a*x", "match", False),
    ],
)
def test_slow_patterns_are_found(pattern, use, is_slow):
    assert (Graph(pattern, uses={use}).shared() is not None) == is_slow
