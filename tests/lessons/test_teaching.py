"""The teaching kit agrees with the lessons, and its exam answers are what the package computes."""

import doctest
import importlib
import re

import pytest

from docs import editions
from shipnet.exercises.exercise import EXERCISES
from tests.test_howto import SAME, blocks, run

KIT = editions.ROOT / editions.LESSONS / "teaching"
EXAM = KIT / "exam.md"
ROW = re.compile(r"^\| (\d\d) \| (.*) \| ((?:ex-|exam ).*) \|$", re.MULTILINE)
QUESTION = re.compile(r"^\*\*(\d+)\.\*\* ", re.MULTILINE)


@pytest.fixture(scope="module")
def rows():
    return ROW.findall((KIT / "README.md").read_text(encoding="utf-8"))


def objectives(source):
    text = source.read_text(encoding="utf-8").partition("**You will be able to**")[2]
    return re.findall(r"^- (.*)[,.]$", text.partition("```")[0], re.MULTILINE)


@pytest.mark.parametrize("source", editions.sources(), ids=lambda path: path.stem[:2])
def test_every_objective_is_tested_and_every_exercise_tests_one(rows, source):
    lesson = source.stem[:2]
    importlib.import_module(f"shipnet.exercises.lesson_{lesson}")
    mine = [(objective, tested) for number, objective, tested in rows if number == lesson]
    assert [objective for objective, _ in mine] == objectives(source) != []
    named = [one for _, tested in mine for one in tested.split(", ")]
    exercises = sorted(one for one in named if one.startswith("ex-"))
    assert exercises == sorted(key for key in EXERCISES if key.startswith(f"ex-{lesson}-"))


def test_questions_that_test_an_objective_stand_under_its_lesson(rows):
    text = EXAM.read_text(encoding="utf-8")
    parts = re.split(r"^## Lesson (\d+)$", text, flags=re.MULTILINE)
    under = {
        int(question): int(lesson)
        for lesson, part in zip(parts[1::2], parts[2::2], strict=True)
        for question in QUESTION.findall(part)
    }
    assert list(under) == list(range(1, 21))
    for lesson, _, tested in rows:
        for question in re.findall(r"exam (\d+)", tested):
            assert under[int(question)] == int(lesson)


def test_each_lesson_has_a_plan_of_one_page():
    text = (KIT / "plans.md").read_text(encoding="utf-8")
    parts = re.split(r"^## (.+)$", text, flags=re.MULTILINE)
    plans = dict(zip(parts[1::2], parts[2::2], strict=True))
    titles = [path.read_text("utf-8").partition("\n")[0][2:] for path in editions.sources()]
    assert list(plans) == titles
    for path, plan in zip(editions.sources(), plans.values(), strict=True):
        for part in ("**Board.**", "**Expected wrong predictions**", "**At minute 35.**"):
            assert part in plan
        assert ("**Write it.**" in plan) == ("**Write it.**" in path.read_text("utf-8"))
        assert plan.count("\n- ") >= 3 and len(plan.split()) <= 300


def test_answers_of_the_exam_are_what_its_code_prints():
    names = {}
    preamble, *answers = blocks(EXAM)
    run(*preamble[:2], names)
    assert len(answers) == 20
    for kind, code, shown in answers:
        printed = run(kind, code, names)
        assert shown and SAME.check_output(shown, printed, doctest.ELLIPSIS), f"{code}\n{printed}"


def test_the_marking_sheet_sums_to_100():
    sheet = (KIT / "README.md").read_text(encoding="utf-8").partition("## Marking sheet")[2]
    points = [int(found) for found in re.findall(r"^\| [^|*]+ \| (\d+) \|", sheet, re.MULTILINE)]
    assert sum(points) == int(re.search(r"\*\*sum\*\* \| \*\*(\d+)\*\*", sheet)[1]) == 100
    assert points[0] == sum(1 for source in editions.sources() for _ in range(4))
