"""Grades of notebooks as students hand them in, the hostile ones too."""

import json
from pathlib import Path

import pytest

from shipnet.__main__ import main
from shipnet.exercises import given, student
from shipnet.exercises.grading import grade

ME = "class Me: name = 'Ann'\nme = Me()"
SOLUTIONS = Path(__file__).parents[2] / "notebooks/lessons/solutions"

#: A right answer to the third exercise of lesson 4.
RIGHT = "def efficiency_of(n, master, slave): return 100 * n / (21 + master + slave)"


def write(path, *cells):
    path.write_text(
        json.dumps({"cells": [{"cell_type": "code", "source": cell} for cell in cells]})
    )


def solution(lesson, name="Kim"):
    """Return the cells of a lesson's solutions, under a name, solved with its own numbers."""
    notebook = json.loads(next(SOLUTIONS.glob(f"{lesson:02}_*")).read_text(encoding="utf-8"))
    cells = ["".join(c["source"]) for c in notebook["cells"] if c["cell_type"] == "code"]
    return [cell.replace('student("Kim")', f'student("{name}")') for cell in cells]


def of(folder, key="exercise"):
    """Return the verdicts by exercise, of the only notebook of a folder."""
    return grade(str(folder))[1].set_index(key)["verdict"].to_dict()


# The other lessons have answers of the same kinds.
@pytest.mark.parametrize("lesson", [5, 9])
def test_a_solved_lesson_has_all_points(lesson, tmp_path):
    write(tmp_path / "ann.ipynb", *solution(lesson))
    grades, verdicts = grade(str(tmp_path))
    assert set(verdicts["verdict"]) == {"correct"}
    assert grades.loc[0, ["name", "points", "flags"]].tolist() == ["kim", 4, "name unchanged"]


def test_each_notebook_is_judged_by_the_numbers_of_its_name(tmp_path):
    cells = [ME, "time_us = 7.0", 'check("ex-01-2", time_us, me)']
    write(tmp_path / "a.ipynb", *cells)
    numbers = given("ex-01-2", student("Ann"))
    assert "correct" != of(tmp_path)["ex-01-2"]
    other = next(name for name in "BCDEFGH" if given("ex-01-2", student(name)) != numbers)
    for name in ("Ann", other):
        write(tmp_path / "a.ipynb", *solution(1, name))
        assert grade(str(tmp_path))[0].loc[0, "points"] == 4


HOSTILE = {
    "endless loop": ("while True: pass", "stopped: it took over 2 s"),
    "crash": ("import os; os._exit(0)", "stopped: Python ended"),
    "exit": ("exit()", "SystemExit"),
    "system exit": ("raise SystemExit(3)", "SystemExit: 3"),
    "input": ("input()", "EOFError"),
    "memory": ("rate_kbit = 'x' * (1 << 34)", "MemoryError"),
    "large answer": ("rate_kbit = '7' * (1 << 21)", "stopped: the answer is too large"),
    "deep answer": ("rate_kbit = []\nfor _ in range(9999): rate_kbit = [rate_kbit]", "a number"),
    "hostile answer": ("class Bad:\n __class__ = 1 / 0\nrate_kbit = Bad()", "ZeroDivisionError"),
    "patched check": (
        "import shipnet.exercises as x\nx.check = lambda *a: True\nrate_kbit = 1e9", "",
    ),
    "patched judge": (
        "import shipnet.exercises.exercise as x, json\njson.dumps = lambda *a: '{\"value\": 1e9}'\n"
        "rate_kbit = 1e9", "",
    ),
    "written to the pipe": (
        "import os\nfor n in range(3, 9):\n try: os.write(n, b'{\"value\": {\"set\": [[]]}}\\n')\n"
        " except OSError: pass\nrate_kbit = 1e9", "",
    ),
}  # fmt: skip


#: Those that break the pipe of their own process spoil their other answers too.
OWN_LOSS = ("patched judge", "written to the pipe")


@pytest.mark.parametrize("kind", HOSTILE)
def test_a_hostile_hand_in_gets_a_verdict_and_spoils_no_other_exercise(kind, tmp_path, monkeypatch):
    monkeypatch.setattr("shipnet.exercises.grading.LIMIT", 2.0)
    cell, said = HOSTILE[kind]
    if "rate_kbit" not in cell:
        cell += "\nrate_kbit = 1"
    other = [RIGHT, 'check("ex-04-3", efficiency_of)']
    write(tmp_path / "hostile.ipynb", ME, cell, 'check("ex-01-4", rate_kbit, me)', *other)
    write(tmp_path / "honest.ipynb", ME.replace("Ann", "Ben"), *other)
    verdicts = of(tmp_path, ["file", "exercise"])
    found = verdicts["hostile.ipynb", "ex-01-4"]
    assert said in found
    assert found not in ("correct", "not solved yet")
    assert verdicts["hostile.ipynb", "ex-01-2"] == "no check"
    assert verdicts["honest.ipynb", "ex-04-3"] == "correct"
    assert (verdicts["hostile.ipynb", "ex-04-3"] == "correct") or kind in OWN_LOSS


def test_an_endless_function_is_stopped_and_one_without_a_body_is_not_solved(tmp_path, monkeypatch):
    monkeypatch.setattr("shipnet.exercises.grading.LIMIT", 2.0)
    endless = "def efficiency_of(*a):\n while True: pass"
    count = "def count_pulses(bits): raise NotImplementedError"
    checks = 'check("ex-04-3", efficiency_of)', 'check("ex-01-3", count_pulses)'
    write(tmp_path / "a.ipynb", ME, endless, count, *checks)
    verdicts = of(tmp_path)
    assert "it took over 2 s" in verdicts["ex-04-3"]
    assert verdicts["ex-01-3"] == "not solved yet"


def test_what_a_teacher_should_look_at_is_flagged(tmp_path):
    copied = "def efficiency_of(data, master, slave):\n" + "".join(
        f"    step_{n} = data + master + slave + {n}\n" for n in range(5)
    )
    check = 'check("ex-04-3", efficiency_of)'
    (tmp_path / "b").mkdir()
    write(tmp_path / "a.ipynb", ME, copied, check)
    write(tmp_path / "b/b.ipynb", ME.replace("Ann", "Ben"), "# mine\n" + copied, check)
    write(tmp_path / "c.ipynb", ME.replace("Ann", "Kim"), RIGHT, check)
    write(tmp_path / "d.ipynb", RIGHT, check, 'check("ex-01-4", 7)')
    write(tmp_path / "e.ipynb", ME, "from shipnet.exercises.exercise import exercise", RIGHT, check)
    write(tmp_path / "f.ipynb", ME, "1 +", "%matplotlib inline\n" + RIGHT, check)
    (tmp_path / "g.ipynb").write_text('{"cells": [1]}')
    write(tmp_path / "h.ipynb", ME, 'check("ex-99-1", me)')
    grades = grade(str(tmp_path))[0].set_index("file")
    flags = grades["flags"].to_dict()
    assert "same lines for ex-04-3 as b/b.ipynb" in flags["a.ipynb"]
    assert "same name as e.ipynb, f.ipynb" in flags["a.ipynb"]
    assert flags["b/b.ipynb"] == "same lines for ex-04-3 as a.ipynb"
    assert flags["c.ipynb"] == "name unchanged"
    assert flags["d.ipynb"] == "check of ex-01-4 edited; no name; name unchanged"
    assert "imports the code that checks answers" in flags["e.ipynb"]
    assert grades.loc["f.ipynb", "points"] == 1
    assert flags["g.ipynb"] == "not a readable notebook"
    assert flags["h.ipynb"] == "no exercise check found"


def test_the_command_writes_grades_and_what_is_not_correct(tmp_path, capsys):
    write(tmp_path / "a.ipynb", ME, RIGHT, 'check("ex-04-3", efficiency_of)')
    files = [tmp_path / f"grades{suffix}" for suffix in (".csv", ".html")]
    outputs = [word for file in files for word in ("-o", str(file))]
    assert main(["grade", str(tmp_path), *outputs]) == 0
    assert "1 notebook, 0 with a flag" in capsys.readouterr().out
    titles, row = files[0].read_text(encoding="utf-8-sig").splitlines()
    assert titles == "name,file,ex-04-1,ex-04-2,ex-04-3,ex-04-4,points,flags"
    assert row == "Ann,a.ipynb,0,0,1,0,1,"
    assert "<td>no check</td>" in files[1].read_text()


@pytest.mark.parametrize("make", [False, True])
def test_a_folder_without_notebooks_is_refused(make, tmp_path, capsys):
    folder = tmp_path / "empty"
    if make:
        folder.mkdir()
    assert main(["grade", str(folder)]) == 2
    assert "there is no" in capsys.readouterr().err
