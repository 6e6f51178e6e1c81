"""The lessons' exercises: stubs, solutions and typical mistakes, without a kernel."""

import re
from dataclasses import replace
from functools import cache
from itertools import product

import nbformat
import numpy as np
import pandas as pd
import pytest

from docs import editions
from shipnet import datasets
from shipnet.asi.modulation import ramp_spectrum
from shipnet.errors import ArgumentError
from shipnet.exercises import check, given, glossary, student
from shipnet.exercises.answers import (
    Bits,
    Bytes,
    Choice,
    Choices,
    Function,
    NotSolved,
    Number,
    Table,
    Whole,
)
from shipnet.exercises.checking import exercise, exercises

SOURCES = editions.sources()
NAMES = ("Kim", "Jeong", "a student")
LESSONS = pytest.mark.parametrize("source", SOURCES, ids=lambda path: path.stem)
HANGUL = re.compile(r"[\u1100-\u11ff\u3130-\u318f\uac00-\ud7a3]")


@cache
def lesson(source):
    return editions.read(source)


def keys(source):
    """Return the exercises of a lesson in the order of their cells."""
    cells = [cell for cell in lesson(source).cells if "exercise" in editions.tags(cell)]
    return [key for cell in cells for key in editions.keys(cell)]


def verdicts(source, solve, name):
    """Execute the cells of the exercises as a kernel would; return key -> verdict."""
    stubs = {editions.solved(c.source): editions.stub(c.source) for c in lesson(source).cells}
    found, names = {}, {}
    for cell in editions.solutions_edition(lesson(source)).cells:
        if cell.cell_type != "code":
            continue
        if "check" in editions.tags(cell):
            verdict = eval(cell.source, names)
            found[verdict.key] = verdict
            continue
        text = cell.source if solve else stubs.get(cell.source, cell.source)
        exec(re.sub(r'student\(".*?"\)', f"student({name!r})", text), names)
    return found


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


def test_every_numbered_lesson_has_a_source():
    assert editions.orphans(editions.ROOT) == []


@LESSONS
def test_tags_agree(source):
    number = source.name[:2]
    found = keys(source)
    assert found == [f"ex-{number}-{k}" for k in range(1, len(found) + 1)]
    assert 3 <= len(found) <= 4
    assert set(found) == {one.key for one in exercises(int(number))}
    checks = [cell for cell in lesson(source).cells if "check" in editions.tags(cell)]
    assert [editions.keys(cell) for cell in checks] == [[key] for key in found]
    for cell, key in zip(checks, found, strict=True):
        assert re.fullmatch(rf'check\("{key}", \w+(, me)?\)', cell.source)


@LESSONS
@pytest.mark.parametrize("name", NAMES)
def test_every_solution_is_accepted(source, name):
    found = verdicts(source, True, name)
    assert list(found) == keys(source)
    assert [str(verdict) for verdict in found.values()] == [f"{key}: correct" for key in found]


@LESSONS
def test_every_stub_says_that_nothing_is_solved(source):
    found = verdicts(source, False, "Kim")
    assert [str(verdict) for verdict in found.values()] == [
        f"{key}: not solved yet" for key in keys(source)
    ]


EXERCISES = [key for source in SOURCES for key in keys(source)]


#: A slip that every kind of answer has a hint for, and a part of that hint.
SLIPS = {
    Number: (lambda right: 1e3 * right, "1000 times too large"),
    Whole: (lambda right: 7 * right + 31, "too large"),
    Bits: (lambda right: right[1:], "1 too few"),
    Bytes: (lambda right: right[1:], "1 too few"),
    Choice: (lambda right: right + "?", "is none of"),
    Choices: (lambda right: [*right, "?"], "is none of"),
    Table: (lambda right: [{**row, "delay": row["delay"] / 1e3} for row in right], "1000 times"),
}


def slip(right):
    """Return a hint and the wrong answer for it, made from the right one."""
    if not isinstance(right, Function):
        make, hint = SLIPS[type(right)]
        return hint, make(right.value)
    make, hint = SLIPS[type(right.answer(right.value(*right.cases[0])))]
    return hint, lambda *case: make(right.value(*case))


def gives_away(said, right):
    shown = f"{right.value:.6g}" if isinstance(right.value, float) else str(right.value)
    return shown in re.findall(r"[\w.]+", said)


class Drawn:
    """Whoever has these numbers."""

    def __init__(self, numbers):
        self.numbers = numbers

    def pick(self, what, options):
        return self.numbers[what.split()[1]]


def draws(one, most=300):
    """Return everybody's numbers; of very many a sample, the same each time."""
    every = list(product(*one.draws.values()))
    if len(every) > most:
        places = np.random.default_rng(2024).choice(len(every), most, replace=False)
        every = [every[place] for place in places]
    return [dict(zip(one.draws, values, strict=True)) for values in every]


@pytest.mark.parametrize("key", EXERCISES)
def test_mistakes_are_told_apart_whatever_the_numbers(key):
    one = exercise(key)
    for numbers in draws(one):
        right, trapped = solution = one.solve(**numbers)
        # It is not computed again for each mistake.
        solved = replace(one, solve=lambda solution=solution, **_: solution)
        mistakes = trapped | dict([slip(right)])
        for hint, answered in mistakes.items():
            said = solved.fault(answered, Drawn(numbers))
            assert said is not None and hint in said, f"{numbers}: {hint!r} got {said!r}"
            assert not gives_away(said, right), f"{numbers}: {said!r}"
            for other, value in trapped.items():
                if other != hint:
                    same = replace(right, value=value).fault(answered) is None
                    assert not same, f"{numbers}: {hint!r} is {other!r}"


#: What players answered, and the hint that each of them should have got.
PLAYED = [
    ("ex-01-4", lambda limit: limit / 8, "half of it"),
    ("ex-02-2", lambda length, delay: 1e-3 * length * delay, "there and back"),
    ("ex-03-1", lambda bits: f"0{bits[::-1]}{bits.count('1') % 2}1", "in which order"),
    ("ex-03-4", lambda **mine: 2 * right_of("ex-03-4", mine), "twice as much"),
    ("ex-03-4", lambda **mine: right_of("ex-03-4", mine) + 1, "one too many"),
    ("ex-06-1", lambda unit, number, quantity: request(unit, 6, number - 1, quantity), "writes"),
    ("ex-06-1", lambda unit, number, quantity: request(unit, 1, number - 1, quantity), "bits"),
    (
        "ex-06-1",
        lambda unit, number, quantity: request(unit, 8, number - 1, quantity),
        "byte 2 of 6 is",
    ),
    ("ex-06-1", lambda unit, number, quantity: request(unit, 3, number, quantity), "counts from 1"),
    (
        "ex-06-1",
        lambda unit, number, quantity: request(unit, 3, 40000 + number, quantity),
        "the 4 in front",
    ),
    ("ex-06-2", lambda registers, rate: 1e4 * (5 + 2 * registers) / rate, "start, data, parity"),
    ("ex-06-2", lambda registers, rate: 11e3 * (3 + 2 * registers) / rate, "CRC"),
    ("ex-06-2", lambda registers, rate: 11e3 * (6 + 2 * registers) / rate, "one byte too many"),
    ("ex-06-3", lambda: scan(lambda registers: 13 + registers), "16 bits"),
    ("ex-06-3", lambda: scan(lambda registers: 9 + 2 * registers), "CRC"),
    ("ex-06-3", lambda: scan(lambda registers: 13 + 2 * registers, 10), "start, data, parity"),
    ("ex-06-4", lambda **mine: 2 * right_of("ex-06-4", mine), "twice as much"),
    (
        "ex-09-3",
        lambda: (
            lambda fires, k, n: "".join(
                str(int(fires[i : i + n].count("1") >= k)) for i in range(len(fires))
            )
        ),
        "ends with this reading",
    ),
    ("ex-09-4", lambda **mine: right_of("ex-09-4", mine)[0], "a list of rows"),
    (
        "ex-09-4",
        lambda **mine: [tuple(row.values()) for row in right_of("ex-09-4", mine)],
        "{'n': ..., 'k': ..., 'delay': ...}",
    ),
]


def right_of(key, numbers):
    return exercise(key).solve(**numbers)[0].value


def request(unit, function, first, quantity):
    return bytes([unit, function]) + first.to_bytes(2) + quantity.to_bytes(2)


def scan(size, bits=11):
    """Return a function for a scan of frames so long, with characters of so many bits."""

    def scan_time(n_slaves, n_registers, bit_rate):
        silence = 3.5 * bits / bit_rate if bit_rate <= 19200 else 1.75e-3
        return n_slaves * (size(n_registers) * bits / bit_rate + 2 * silence)

    return scan_time


@pytest.mark.parametrize(("key", "wrong", "hint"), PLAYED)
def test_what_players_answered_gets_the_hint_that_helps(key, wrong, hint):
    one = exercise(key)
    for numbers in draws(one):
        assert hint in one.fault(wrong(**numbers), Drawn(numbers)), numbers


class Hostile:
    """Objects to everything."""

    def _object(self, *_):
        raise RuntimeError("no")

    __iter__ = __eq__ = __repr__ = __str__ = __call__ = __float__ = __len__ = _object
    __hash__ = None


@pytest.mark.parametrize("key", EXERCISES)
@pytest.mark.parametrize(
    "answer",
    [
        True,
        "",
        "x",
        -1,
        float("nan"),
        [],
        {},
        len,
        str,
        object(),
        1j,
        np.zeros(3),
        b"\xff",
        Hostile(),
        lambda *_: Hostile(),
        [Hostile()],
    ],
)
def test_whatever_is_answered_a_sentence_comes_back(key, answer):
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


@LESSONS
def test_korean_comes_from_the_glossary_only(source):
    assert not HANGUL.search(source.read_text("utf-8"))


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
        (Number(6.0, "us"), 6e-3, "1000 times too small: is it in us"),
        (Number(6.0, "us"), "6 us", "without quotes"),
        (Number(6.2431, "us"), 6.2, "round only at the end"),
        (Number(6.25, "us"), 6.2, "round only at the end"),
        (Number(0.062831, "us", 1e-4), 0.0628, "round only at the end"),
        (Number(-62.431, "V"), -62, "round only at the end"),
        (Number(6.2831, "us"), 6.4, "is something small missing, or counted twice"),
        (Number(6.2831, "us"), 6.2, "is something small missing, or counted twice"),
        (Number(0.0, "us"), 0.04, "is something small missing"),
        (Number(6.0, "us"), 9, "too large"),
        (Number(6.0), 1 / 6, "one over the answer"),
        (Number(0.3), 30, "percentage"),
        (Number(30, "%"), 0.3, "share"),
        (Number(-3.0, "V"), 3, "sign"),
        (Number(3.0, "byte"), 24, "bits or bytes"),
        (Number(3.0, "us"), 6, "twice as much"),
        (Number(3.0, "us"), 1.5, "half of it"),
        (Number(100.0, "us"), 0.01, "one over the answer"),
        (Number(3.0, "us"), 30, "point is in the wrong place"),
        (Number(0.0, "us"), 1, "too large"),
        (Number(6.0, "us"), float("inf"), "inf is none"),
        (Number(1.0, "us"), True, "not a bool"),
        (Whole(31), 32, "one too many"),
        (Whole(31), 30, "one too few"),
        (Whole(31), 62, "twice as much"),
        (Whole(31, "valves"), 15.5, "half of it"),
        (Whole(1), 2, "one too many"),
        (Whole(4, "valves"), 32, "too large"),
        (Whole(31), 31.4, "whole number"),
        (Whole(31), 40, "too large"),
        (Bits("0011001"), 11001, "in quotes"),
        (Bits("0011001"), "001100", "1 too few"),
        (Bits("0011001"), "1001100", "reverse"),
        (Bits("0011011"), "1100100", "the other way round"),
        (Bits("00010111"), "00101110", "moved by one place"),
        (Bits("00010111"), "01110001", "halves"),
        (Bits("0011001"), "0011101", "1 of 7 bits is wrong"),
        (Bits("0011001"), "001x001", "'x' is no bit"),
        (Bytes(b"\x01\x03\x0a\x84"), "0103840a", "last two bytes are swapped"),
        (Bytes(b"\x01\x03\x0a\x84"), b"\x84\x0a\x03\x01", "reverse"),
        (Bytes(b"\x01\x03"), b"\x80\xc0", "bits of each byte"),
        (Bytes(b"\x01\x03"), "1 3", "two digits"),
        (Bytes(b"\x01\x03"), "01", "1 too few"),
        (Bytes(b"\x01\x03"), "01 04", "byte 2 of 2 is wrong"),
        (Bytes(b"\x01\x03\x0a\x84"), "02 03 0a 85", "bytes 1, 4 of 4 are wrong"),
        (Choice("near", ("near", "far")), "far", "it is not far"),
        (Choice("near", ("near", "far")), 3, "none of near, far"),
        (Choices(frozenset("ab"), ("a", "b", "c")), "a, c", "1 is missing"),
        (Choices(frozenset("ab"), ("a", "b", "c")), "abc", "none of"),
    ],
)
def test_a_wrong_answer_gets_a_hint(answer, wrong, hint):
    assert hint in answer.fault(wrong)


@pytest.mark.parametrize(
    ("answer", "right"),
    [
        (Number(6.0, "us"), np.float32(6.001)),
        (Number(6.0, "us"), 6),
        (Number(0.0, "us"), 0.001),
        (Whole(31), 31.0),
        (Bits("0011001"), "001 1001"),
        (Bits("0011001"), np.array([0, 0, 1, 1, 0, 0, 1])),
        (Bytes(b"\x01\x03"), "0x01 0x03"),
        (Choice("near", ("near", "far")), " Near"),
        (Choices(frozenset("ab"), ("a", "b", "c")), {"b", "a"}),
    ],
)
def test_a_right_answer_in_another_form_is_right(answer, right):
    assert answer.fault(right) is None


TWICE = Function(lambda n: 2.0 * n, [(1,), (5,)])


def test_a_function_that_stops_is_told_where():
    def divide(n):
        zero = n - 1
        return n / zero

    assert re.fullmatch(
        r"divide\(1\) stops in its line 3, `return n / zero`: ZeroDivisionError, .*",
        TWICE.fault(divide),
    )


def test_a_function_is_told_input_and_result():
    assert TWICE.fault(lambda n: 2 if n == 1 else 9).startswith("<lambda>(5) returned 9: ")


@pytest.mark.parametrize(
    ("wrong", "hint"),
    [
        (lambda n: None, "returned nothing"),
        (lambda: 1, "takes 0 positional arguments"),
        (3, "a function is asked for"),
        (lambda n: "2", "without quotes"),
    ],
)
def test_a_function_of_another_form_gets_a_hint(wrong, hint):
    assert hint in TWICE.fault(wrong)


def test_a_function_may_spoil_what_it_is_given():
    total = Function(sum, [([1, 2, 3],)])
    assert total.fault(lambda row: sum(row.pop() for _ in range(len(row)))) is None


@pytest.mark.parametrize("stub", [lambda n: ..., pytest.param(None, id="raises")])
def test_a_stub_is_not_solved(stub):
    def raises(n):
        raise NotImplementedError

    with pytest.raises(NotSolved):
        TWICE.fault(stub or raises)


TABLE = Table([{"n": 1, "cycle": 0.5}, {"n": 31, "cycle": 5.0}], {"cycle": "ms"})


def test_a_table_is_compared_row_by_row():
    right = pd.DataFrame({"n": [1, 31], "cycle": [0.5, 5.0], "note": ["", ""]})
    assert TABLE.fault(right) is None
    assert "row 2 (n = 31), cycle is 5000" in TABLE.fault(right.assign(cycle=[0.5, 5000.0]))
    assert "'cycle' is missing" in TABLE.fault(right[["n"]])
    assert "1 rows, but 2" in TABLE.fault(right[:1])
    assert TABLE.fault(right.to_dict("records")) is None
    with pytest.raises(NotSolved):
        TABLE.fault([{"n": 1, "cycle": ...}, {"n": 31, "cycle": 5}])


@pytest.mark.parametrize(
    ("given", "hint"),
    [
        (5, "not a int"),
        ({"n": 1, "cycle": 0.5}, "that is a single one"),
        ([], "0 rows, but 2"),
        ([(1, 0.5), (31, 5.0)], "row 1 is a tuple"),
        ([{"n": 1, "cycle": 0.5}, [31, 5.0]], "row 2 is a list"),
        ("1 0.5", "not a str"),
    ],
)
def test_a_table_of_another_form_is_told_what_a_row_looks_like(given, hint):
    said = TABLE.fault(given)
    assert hint in said
    assert not given or "such as {'n': ..., 'cycle': ...}" in said


# Students and names


def test_numbers_are_the_same_everywhere_and_differ_between_students():
    assert student("Kim").pick("length", range(1000)) == 412  # SHA-256 by another program
    names = [f"student {k}" for k in range(200)]
    picks = {student(name).pick("length", range(1000)) for name in names}
    assert len(picks) > 150


@pytest.mark.parametrize("name", ["", "  ", None, 5])
def test_a_student_has_a_name(name):
    with pytest.raises(ArgumentError, match="name is"):
        student(name)


@pytest.mark.parametrize("key", ["ex-01-9", "ex-99-1", "ex-1-1", "", None])
def test_an_unknown_exercise_is_the_writers_mistake(key):
    with pytest.raises(ArgumentError, match=r"there is no such|key is None"):
        check(key, 1)


def test_own_numbers_need_a_name():
    with pytest.raises(ArgumentError, match="me is missing"):
        check("ex-01-1", "0")
