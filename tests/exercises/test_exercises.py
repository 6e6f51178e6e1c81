"""The lessons' exercises: stubs, solutions and typical mistakes, without a kernel."""

import re
from collections import Counter
from dataclasses import replace
from fractions import Fraction
from functools import cache
from itertools import product
from threading import enumerate as enumerate_threads

import nbformat
import numpy as np
import pandas as pd
import pytest

from docs import editions
from shipnet import datasets
from shipnet.asi.modulation import ramp_spectrum
from shipnet.errors import ArgumentError
from shipnet.exercises import answers, check, given, glossary, student
from shipnet.exercises.answers import (
    Bits,
    Bytes,
    Function,
    Misread,
    NotSolved,
    Number,
    Table,
    Whole,
    Words,
)
from shipnet.exercises.exercise import ANY, exercise, exercises
from tests.exercises import independent

SOURCES = editions.sources()
NAMES = ("Kim", "Jeong", "a student")
LESSONS = pytest.mark.parametrize("source", SOURCES, ids=lambda path: path.stem)


@cache
def lesson(source):
    return editions.read(source)


def keys(source):
    """Return the exercises of a lesson in the order of their cells."""
    cells = [cell for cell in lesson(source).cells if "exercise" in editions.tags(cell)]
    return [key for cell in cells for key in editions.keys(cell)]


@LESSONS
def test_committed_editions_are_those_of_the_source(source):
    for path, notebook in editions.editions(editions.ROOT, source).items():
        stored = nbformat.read(path, as_version=4)
        assert editions.same(stored, notebook), "run `python docs/editions.py derive`"


@LESSONS
def test_the_stored_solutions_are_correct_and_the_stubs_are_not_solved(source):
    for path, said in zip(
        editions.editions(editions.ROOT, source), ("not solved yet", "correct"), strict=True
    ):
        for cell in nbformat.read(path, as_version=4).cells:
            if "check" in editions.tags(cell):
                assert cell.outputs[0].data["text/plain"].endswith(said), f"{path}: {cell.source}"


@LESSONS
def test_tags_agree(source):
    number = source.name[:2]
    keys_found = keys(source)
    assert keys_found == [f"ex-{number}-{k}" for k in range(1, len(keys_found) + 1)]
    assert 3 <= len(keys_found) <= 4
    assert set(keys_found) == {one.key for one in exercises(int(number))}
    checks = [cell for cell in lesson(source).cells if "check" in editions.tags(cell)]
    assert [editions.keys(cell) for cell in checks] == [[key] for key in keys_found]
    for cell, key in zip(checks, keys_found, strict=True):
        assert re.fullmatch(rf'check\("{key}", {exercise(key).variable}(, me)?\)', cell.source)


@LESSONS
@pytest.mark.parametrize("name", NAMES)
def test_every_solution_is_accepted(source, name):
    verdicts, names = [], {}
    for cell in editions.solutions_edition(lesson(source)).cells:
        if "check" in editions.tags(cell):
            verdicts.append(str(eval(cell.source, names)))
        elif cell.cell_type == "code":
            exec(re.sub(r'student\(".*?"\)', f"student({name!r})", cell.source), names)
    assert verdicts == [f"{key}: correct" for key in keys(source)]


EXERCISES = [key for source in SOURCES for key in keys(source)]


class Drawn:
    """Whoever has these numbers."""

    def __init__(self, numbers):
        self.numbers = numbers

    def pick(self, what, options):
        return self.numbers[what.split()[1]]


def draws(one, most=50):
    """Return everybody's numbers; of very many a sample, the same each time."""
    every = list(product(*one.draws.values()))
    if len(every) > most:
        places = np.random.default_rng(2024).choice(len(every), most, replace=False)
        every = [every[place] for place in places]
    return [dict(zip(one.draws, values, strict=True)) for values in every]


def hints(one, numbers):
    """Return the right answer, the hints by what they are for, and the one for all others."""
    right, every = one.solve(**numbers)
    mistakes = {hint: wrong for hint, wrong in every.items() if wrong is not ANY}
    (begin,) = set(every) - set(mistakes)
    return right, mistakes, begin


def gives_away(said, right):
    """Return whether a hint says the right answer, if that is more than a word of the question."""
    if isinstance(right, Function | Table | Words):
        return False
    shown = f"{right.value:.6g}" if isinstance(right.value, float) else str(right.value)
    return shown in re.findall(r"[\w.]+", said)


#: Least number of named mistakes where it is below 5: among few bits or small counts, a wrong
#: answer has too often another reason than the one that a hint names.
FEW_MISTAKES = {"ex-01-1": 3, "ex-02-4": 4, "ex-03-1": 4, "ex-03-2": 0, "ex-03-4": 4}
FEW_MISTAKES |= {"ex-04-4": 2, "ex-05-4": 4, "ex-08-1": 4}


@pytest.mark.parametrize("key", EXERCISES)
def test_each_mistake_is_refused_and_named_unless_another_one_gives_the_same(key):
    one, named, n_draws = exercise(key), Counter(), 0
    for numbers in draws(one):
        n_draws += 1
        # It is not solved again for each mistake.
        solution = one.solve(**numbers)
        solved = replace(one, solve=lambda solution=solution, **_: solution)
        right, mistakes, begin = hints(solved, numbers)
        assert len(mistakes) >= FEW_MISTAKES.get(key, 5)
        for hint, wrong in mistakes.items():
            fault = solved.fault(wrong, Drawn(numbers))
            assert fault is not None, f"{numbers}: {hint!r} is right"
            assert fault == hint or fault.endswith(f". {begin}"), (
                f"{numbers}: {hint!r} got {fault!r}"
            )
            named[hint] += fault == hint
            if fault != hint and "if you rounded" not in fault:
                answer = right.read(wrong)
                same = [w for w in mistakes.values() if not replace(right, value=w).fault(answer)]
                assert len(same) > 1
            assert not gives_away(fault, right), f"{numbers}: {fault!r}"
    # A hint that hardly anybody gets is one that the numbers of the exercise hide.
    assert key == "ex-05-4" or min(named.values(), default=n_draws) > n_draws / 4, (
        named.most_common()[-1]
    )


#: The answer is a function, the same for everybody; an AS-i answer has four bits, of which four
#: rows are the same backwards.
FEW = {"ex-03-1": 12}


@pytest.mark.parametrize("key", EXERCISES)
def test_a_class_gets_twenty_different_sets_of_numbers(key):
    one = exercise(key)
    if not one.draws:
        assert isinstance(one.solve()[0], Function)
    else:
        every = {repr(values) for values in product(*one.draws.values())}
        assert len(every) >= FEW.get(key, 20)


@pytest.mark.parametrize("key", EXERCISES)
def test_a_typical_wrong_answer_is_refused_and_leads_on(key):
    one = exercise(key)
    for numbers, wrong in product(draws(one, 8), independent.WRONG[key].values()):
        right, mistakes, begin = hints(one, numbers)
        answer = wrong(numbers, right.value)
        fault = one.fault(answer, Drawn(numbers))
        if fault is None:  # a wrong way may lead to the right answer with some numbers
            assert right.fault(right.read(answer)) is None and right.value is not answer
            continue
        assert fault in mistakes or fault.endswith(("?", f". {begin}")) or " stops on " in fault
        assert not gives_away(fault, right)


@pytest.mark.parametrize("key", EXERCISES)
def test_a_right_answer_is_right_in_any_notation(key):
    one = exercise(key)
    for numbers in draws(one, 5):
        right = one.solve(**numbers)[0]
        for answer in independent.in_other_words(right):
            assert one.fault(answer, Drawn(numbers)) is None


def test_an_answer_guessed_by_chance_hardly_ever_gets_a_diagnosis():
    rng, diagnosed, words = np.random.default_rng(1), [], []
    for one in map(exercise, EXERCISES):
        for numbers in draws(one, 10):
            right, mistakes, _ = hints(one, numbers)
            if type(right) is Number:
                guesses = right.value * np.exp(rng.uniform(-1, 1, 10))
                diagnosed += [one.fault(guess, Drawn(numbers)) in mistakes for guess in guesses]
            elif type(right) is Bits:
                guesses = ["".join(rng.choice([*"01"], len(right.value))) for _ in range(10)]
                words += [one.fault(guess, Drawn(numbers)) in mistakes for guess in guesses]
    # Each of up to nine mistakes covers 0.1 % of a number.
    assert len(diagnosed) > 1000 and np.mean(diagnosed) <= 0.005
    assert len(words) >= 400 and np.mean(words) <= 0.04


#: What may be tried one after the other until the check says yes.
@pytest.mark.parametrize("key", ["ex-02-1", "ex-05-1", "ex-05-4", "ex-07-4", "ex-09-1"])
def test_no_hint_says_which_part_of_an_answer_is_wrong(key):
    one = exercise(key)
    for numbers in draws(one, 10):
        right, mistakes, begin = hints(one, numbers)
        if isinstance(right, Words) and isinstance(right.value, tuple):
            others = [end for end in right.options if end not in right.value]
            near = [(*right.value[:k], others[0], *right.value[k + 1 :]) for k in range(4)]
        elif isinstance(right, Words):
            near = [right.value ^ {code} for code in right.options]
        elif isinstance(right, Bits):
            near = [right.value + "10"[k] * 2 for k in range(2)]
        else:
            near = [right.value + 3, right.value + 4]
        faults = {one.fault(answer, Drawn(numbers)) for answer in near} - set(mistakes)
        assert {re.sub(r"these \d+ bits", "these bits", text) for text in faults} <= {
            f"not right yet. {begin}",
            f"these bits are not right yet. {begin}",
            f"far too large. {begin}",
        }


class Hostile:
    """Objects to everything."""

    def _object(self, *_):
        raise RuntimeError("no")

    __iter__ = __eq__ = __repr__ = __str__ = __call__ = __float__ = __len__ = _object
    __hash__ = None


@pytest.mark.parametrize("key", EXERCISES)
def test_whatever_is_answered_a_sentence_comes_back(key):
    objects = [object(), Hostile(), [Hostile()], lambda *_: Hostile(), len, str]
    for answer in [True, "", "x", -1, float("nan"), 1j, b"\xff", [], {}, np.zeros(3), *objects]:
        verdict = check(key, answer, student("Kim"))
        assert not verdict
        assert verdict.text and "\n" not in verdict.text


# The lessons' words


@LESSONS
def test_the_words_of_a_lesson_are_bold_in_it_and_listed(source):
    number = int(source.name[:2])
    prose = "\n".join(c.source for c in lesson(source).cells if c.cell_type == "markdown")
    bold = " ".join(re.findall(r"\*\*(.+?)\*\*", prose)).casefold()
    for term in glossary(number).index:
        plain = re.sub(r" \(.*\)", "", term).casefold()
        assert any(part in bold for part in plain.split(", ")), f"{term} is not bold in the lesson"
    code = [cell.source for cell in lesson(source).cells if cell.cell_type == "code"]
    assert f"glossary({number})" in code


def test_the_glossary_is_in_order():
    words = datasets.read("glossary.csv")
    terms = words["term"].str.casefold().tolist()
    assert terms == sorted(set(terms))
    assert words["meaning"].str.len().between(5, 90).all()
    assert set(words["lesson"]) <= {"", *map(str, range(1, 11))}
    with pytest.raises(ArgumentError, match="lesson is 11"):
        glossary(11)


# Lesson 1


def test_the_limit_of_lesson_1_is_a_zero_of_the_spectrum():
    for name in NAMES:
        numbers = given("ex-01-4", student(name))
        rate = exercise("ex-01-4").solve(**numbers)[0].value * 1e3
        at_zero = abs(ramp_spectrum(2j * np.pi * numbers["limit"] * 1e3, half_bit=1 / (2 * rate)))
        assert at_zero < 1e-9


# Kinds of answers


@pytest.mark.parametrize(
    ("answer", "wrong", "hint"),
    [
        (Number(6.0, "us"), 6e-3, "1000 times too small: which unit"),
        (Number(6.0, "us"), "6 us", "without quotes"),
        (Number(6.2431, "us"), 6.2, "if you rounded"),
        (Number(-62.431, "V"), -62, "if you rounded"),
        (Number(6.2831, "us"), 6.4, "not right yet"),
        (Number(0.0, "us"), 0.04, "not right yet"),
        (Number(6.0, "us"), 19, "far too large"),
        (Number(6.0, "us"), 1, "far too small"),
        (Number(0.3), 30, "percentage"),
        (Number(30, "%"), 0.3, "fraction"),
        (Number(-3.0, "V"), 3, "sign"),
        (Number(6.0, "us"), float("inf"), "inf is not one"),
        (Number(1.0, "us"), True, "of type bool"),
        (Number(1.0, "us"), np.zeros(2), "of type ndarray"),
        (Whole(31), 32, "not right yet"),
        (Whole(31), 31.4, "whole number"),
        (Bits("0011001"), 11001, "in quotes"),
        (Bits("0011001"), None.__class__, "of type type"),
        (Bits("0011001"), "001100", "these 6 bits are not right yet"),
        (Bits("0011001"), "001x001", "'x' is not a bit"),
        (Bytes(b"\x01\x03"), "1 3", "two digits"),
        (Bytes(b"\x01\x03"), "01", "2 bytes are expected, got 1"),
        (Bytes(b"\x01\x03"), [1, 256], "from 0 to 255"),
        (Bytes(b"\x01\x03"), 1, "of type int"),
        (Bytes(b"\x01\x03\x0a\x84"), "02 03 0a 85", "bytes 1, 4 are not right yet"),
        (Words("near", ("near", "far")), "far", "not right yet"),
        (Words(("a", "b"), ("a", "b", "c")), ["b", "a"], "not right yet"),
        (Words(frozenset("ab"), ("a", "b", "c")), "a, c", "not right yet"),
        (Words(frozenset("ab"), ("a", "b", "c")), "abc", "not one of"),
        (Words(frozenset("ab"), ("a", "b", "c")), 5, "a list of words is expected"),
    ],
)
def test_a_report_on_a_wrong_answer_states_only_facts(answer, wrong, hint):
    assert hint in said_of(answer, wrong)


def said_of(answer, given):
    try:
        return answer.fault(answer.read(given))
    except Misread as kind:
        return str(kind)


@pytest.mark.parametrize(
    ("answer", "right"),
    [
        (Number(6.0, "us"), Fraction(6)),
        (Number(0.0, "us"), 0.001),
        (Bits("0011001"), "001_1001"),
        (Bytes(b"\x01\x03"), "0x01, 0x03"),
        (Words("near", ("near", "far")), " Near"),
        (Words(frozenset("ab"), ("a", "b", "c")), "A,B"),
        (Function(sum, [([1, 2, 3],)]), lambda row: sum(row.pop() for _ in range(len(row)))),
    ],
)
def test_a_right_answer_in_another_form_is_right(answer, right):
    assert said_of(answer, right) is None


TWICE = Function(lambda n: 2.0 * n, [(1,), (5,)])


def test_a_function_that_stops_is_reported_with_its_line():
    def divide(n):
        zero = n - 1
        return n / zero

    assert re.fullmatch(
        r"divide\(1\) stops on line 3, `return n / zero`: ZeroDivisionError: .*",
        said_of(TWICE, divide),
    )


@pytest.mark.parametrize(
    ("wrong", "hint"),
    [
        (lambda n: None, "returned None"),
        (lambda n: 2 if n == 1 else 9, "<lambda>(5) returned 9: "),
        (lambda: 1, "takes 0 positional arguments"),
        (3, "a function is expected"),
        (lambda n: "2", "without quotes"),
    ],
)
def test_a_function_of_another_form_gets_a_hint(wrong, hint):
    assert hint in said_of(TWICE, wrong)


@pytest.mark.parametrize("stub", [lambda n: ..., pytest.param(None, id="raises")])
def test_a_stub_is_not_solved(stub):
    def raises(n):
        raise NotImplementedError

    with pytest.raises(NotSolved):
        said_of(TWICE, stub or raises)


def test_a_function_without_an_end_is_stopped(monkeypatch):
    monkeypatch.setattr(answers, "LIMIT", 0.2)
    rounds = []

    def endless(n):
        while True:
            rounds.append(n)

    assert said_of(TWICE, endless) == (
        "endless did not end within 0.2 s: does every loop in it end?"
    )
    for thread in enumerate_threads():
        if thread.name == "endless":
            thread.join(60)
            assert not thread.is_alive()
    done = len(rounds)
    assert said_of(TWICE, lambda n: 2 * n) is None
    assert len(rounds) == done


TABLE = Table([{"n": 1, "cycle": 0.5}, {"n": 31, "cycle": 5.0}], {"cycle": "ms"})


def test_a_table_is_compared_row_by_row():
    right = pd.DataFrame({"n": [1, 31], "cycle": [0.5, 5.0], "note": ["", ""]})
    assert said_of(TABLE, right) is None
    assert "in the row with n = 31, cycle is 5000" in said_of(
        TABLE, right.assign(cycle=[0.5, 5000.0])
    )
    assert "'cycle' is missing" in said_of(TABLE, right[["n"]])
    assert "expected number of rows: 2, got 1" in said_of(TABLE, right[:1])
    assert said_of(TABLE, right.to_dict("records")) is None
    assert said_of(TABLE, right[::-1]) is None
    with pytest.raises(NotSolved):
        said_of(TABLE, [{"n": 1, "cycle": ...}, {"n": 31, "cycle": 5}])


@pytest.mark.parametrize(
    ("given", "hint"),
    [
        ({"n": 1, "cycle": 0.5}, "that is a single row"),
        ([{"n": 1, "cycle": 0.5}, [31, 5.0]], "row 2 is of type list"),
        ("1 0.5", "of type str"),
    ],
)
def test_a_table_of_another_form_gets_an_example_of_a_row(given, hint):
    message = said_of(TABLE, given)
    assert hint in message and "such as {'n': ..., 'cycle': ...}" in message


# Students and names


def test_numbers_are_the_same_everywhere_and_differ_between_students():
    assert student("Kim").pick("length", range(1000)) == 412  # SHA-256 by another program
    names = [f"student {k}" for k in range(200)]
    picks = {student(name).pick("length", range(1000)) for name in names}
    assert len(picks) > 150


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda key=key: check(key, 1), "there is no such")
        for key in ("ex-01-9", "ex-99-1", "", None)
    ]
    + [(lambda: check("ex-01-1", "0"), "me is missing"), (lambda: student("  "), "name is")],
)
def test_an_unknown_exercise_or_student_is_an_error(call, message):
    with pytest.raises(ArgumentError, match=message):
        call()
