"""Grades of notebooks as students hand them in, the hostile ones too."""

import csv
import json
import os
from pathlib import Path

import pytest

from shipnet.__main__ import main
from shipnet.exercises import given, student
from shipnet.exercises.exercise import exercises
from shipnet.exercises.grading import grade

ME = "class Me: name = 'Ann'\nme = Me()"
SOLUTIONS = Path(__file__).parents[2] / "notebooks/lessons/solutions"

#: A right answer to the third exercise of lesson 4.
RIGHT = "def efficiency_of(n, master, slave): return 100 * n / (21 + master + slave)"


def write(path, *cells):
    path.write_text(
        json.dumps({"cells": [{"cell_type": "code", "source": cell} for cell in cells]})
    )


def checks(lesson):
    """Return the check cells of a lesson."""
    return [f'check("{one.key}", {one.variable}, me)' for one in exercises(lesson)]


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
    "endless loop": ("while True: pass", "stopped: it took over 5 s"),
    "crash": ("import os; os._exit(0)", "stopped: Python ended"),
    "exit": ("raise SystemExit(3)", "SystemExit: 3"),
    "input": ("input()", "EOFError"),
    "memory": ("rate_kbit = 'x' * (1 << 34)", "MemoryError"),
    "large answer": ("rate_kbit = '7' * (1 << 21)", "the answer is longer than 1 MB"),
    "large code": ("rate_kbit = " + "-" * 20_000 + "1", "Error"),
    "deep answer": ("rate_kbit = []\nfor _ in range(9999): rate_kbit = [rate_kbit]", "a number"),
    "hostile answer": ("class Bad:\n __class__ = 1 / 0\nrate_kbit = Bad()", "ZeroDivisionError"),
    "patched check": (
        "import shipnet.exercises as x\nx.check = lambda *a: True\nrate_kbit = 1e9",
        "",
    ),
    "patched judge": (
        "import shipnet.exercises.exercise as x, json\njson.dumps = lambda *a: '{\"value\": 1e9}'\n"
        "rate_kbit = 1e9",
        "",
    ),
    "written to the pipe": (
        'import os\nfor n in range(3, 9):\n try: os.write(n, b\'{"value": {"set": [[]]}}\\n\')\n'
        " except OSError: pass\nrate_kbit = 1e9",
        "",
    ),
    "flood of the pipe": (
        "import os, time\nfor n in range(3, 9):\n try:\n  os.write(n, b'7' * (1 << 21))\n"
        "  os.close(n)\n except OSError: pass\ntime.sleep(20)",
        "stopped",
    ),
}


#: Those that break the pipe of their own process spoil their other answers too.
OWN_LOSS = ("patched judge", "written to the pipe")


@pytest.mark.parametrize("kind", HOSTILE)
def test_a_hostile_hand_in_gets_a_verdict_and_spoils_no_other_exercise(kind, tmp_path, monkeypatch):
    monkeypatch.setattr("shipnet.exercises.grading.LIMIT", 5.0)
    cell, verdict = HOSTILE[kind]
    if "rate_kbit" not in cell:
        cell += "\nrate_kbit = 1"
    other = [RIGHT, 'check("ex-04-3", efficiency_of)']
    write(tmp_path / "hostile.ipynb", ME, cell, *checks(1), *other)
    write(tmp_path / "honest.ipynb", ME.replace("Ann", "Ben"), *other)
    verdicts = of(tmp_path, ["file", "exercise"])
    graded = verdicts["hostile.ipynb", "ex-01-4"]
    assert verdict in graded
    assert graded not in ("correct", "not solved yet")
    missing = "NameError: name 'time_us' is not defined"
    assert (verdicts["hostile.ipynb", "ex-01-2"] == missing) or kind in OWN_LOSS
    assert verdicts["honest.ipynb", "ex-04-3"] == "correct"
    assert (verdicts["hostile.ipynb", "ex-04-3"] == "correct") or kind in OWN_LOSS


#: A child that leaves its process group and keeps the pipes open until the test ends.
CHILD = """
import os, time
if os.fork() == 0:
    os.setsid()
    for _ in range(1000):
        if os.path.exists({done!r}):
            os._exit(0)
        time.sleep(0.1)
    open({late!r}, "w")
    os._exit(0)
"""


@pytest.mark.skipif(os.name != "posix", reason="needs fork")
@pytest.mark.parametrize("then", ["rate_kbit = 1e9", "os._exit(0); rate_kbit = 1"])
def test_a_child_that_keeps_the_pipes_open_does_not_stop_the_grading(then, tmp_path, monkeypatch):
    monkeypatch.setattr("shipnet.exercises.grading.LIMIT", 5.0)
    done, late = tmp_path / "done", tmp_path / "late"
    cell = CHILD.format(done=str(done), late=str(late)) + then
    write(tmp_path / "a.ipynb", ME, cell, *checks(1), RIGHT, *checks(4))
    try:
        verdicts = of(tmp_path)
        assert not late.exists()
    finally:
        done.touch()
    assert ("it took over 5 s" in verdicts["ex-01-4"]) == ("exit" in then)
    assert verdicts["ex-04-3"] == "correct"


#: A cell that sends a signal to the process that started its own.
SIGNAL = "import os, signal, time\nos.kill(os.getppid(), signal.{})\ntime.sleep(5)"


@pytest.mark.skipif(os.name != "posix", reason="needs signals")
@pytest.mark.parametrize("signal", ["SIGKILL", "SIGSTOP"])
def test_a_hand_in_that_ends_or_stops_its_parent_affects_only_its_own_row(
    signal, tmp_path, monkeypatch
):
    if signal == "SIGSTOP":
        monkeypatch.setattr("shipnet.exercises.grading.WHOLE", 10.0)
    write(tmp_path / "a.ipynb", ME, SIGNAL.format(signal), *checks(4))
    write(tmp_path / "b.ipynb", ME, RIGHT, *checks(4))
    grades = grade(str(tmp_path))[0]
    flag = "not graded: its process ended or did not end in time"
    assert grades["flags"].tolist() == [flag, ""]
    assert grades["points"].tolist() == [0, 1]


def test_text_that_is_not_unicode_is_written_and_printed(tmp_path, capsys):
    write(tmp_path / "a.ipynb", ME.replace("Ann", "A\\ud800B"), RIGHT, *checks(4))
    write(tmp_path / "b.ipynb", "me = 1; cell = '\ud800'", *checks(4))
    name = tmp_path / os.fsdecode(b"caf\xe9.ipynb")
    try:
        write(name, ME, RIGHT, *checks(4))
    except OSError:  # this file system accepts Unicode names only
        write(tmp_path / "caf.ipynb", ME, RIGHT, *checks(4))
    files = [tmp_path / f"grades{suffix}" for suffix in (".csv", ".html", ".xlsx", ".json")]
    assert main(["grade", str(tmp_path), *(w for file in files for w in ("-o", str(file)))]) == 0
    rows = list(csv.DictReader(files[0].read_text(encoding="utf-8-sig").splitlines()))
    assert [row["name"] for row in rows] == ["A\\ud800B", "", "Ann"]
    assert [row["points"] for row in rows] == ["1", "0", "1"]
    assert "A\\ud800B" in capsys.readouterr().out
    assert "<td>NameError: name 'cycle_ms' is not defined</td>" in files[1].read_text()


def test_only_regular_files_of_the_folder_are_read(tmp_path):
    folder = tmp_path / "handed_in"
    folder.mkdir()
    write(tmp_path / "secret.ipynb", *solution(5))
    write(folder / "honest.ipynb", *solution(5, "Ben"))
    names = []
    if hasattr(os, "mkfifo"):
        os.mkfifo(folder / "fifo.ipynb")
        links = {"gone": "nothing", "outside": "../secret.ipynb", "self": "self.ipynb"}
        for name, target in (links | {"zero": "/dev/zero"}).items():
            (folder / f"{name}.ipynb").symlink_to(target)
        names = ["fifo", "zero", *links]
    grades = grade(str(folder))[0].set_index("file")
    assert grades.pop("flags").to_dict() == {
        "honest.ipynb": "",
        **{f"{name}.ipynb": "not graded: not a regular file in this folder" for name in names},
    }
    assert grades.loc["honest.ipynb", "points"] == grades["points"].sum() == 4


def test_a_flag_names_the_limit_that_a_notebook_exceeds(tmp_path):
    write(tmp_path / "cells.ipynb", *["1"] * 501)
    write(tmp_path / "large.ipynb", "#" * (16 << 20))
    write(tmp_path / "name.ipynb", "class Me: name = 'A' * 9999\nme = Me()", RIGHT, *checks(4))
    grades = grade(str(tmp_path))[0].set_index("file")
    flags = grades["flags"]
    assert flags["cells.ipynb"] == "more than 500 cells"
    assert flags["large.ipynb"] == "not graded: larger than 16 MB"
    assert flags["name.ipynb"] == "name longer than 100 characters"
    assert grades.loc["name.ipynb", "name"] == "A" * 100
    assert grades.loc["name.ipynb", "points"] == 1


def test_an_unexpected_error_is_flagged_in_its_row(tmp_path, monkeypatch):
    from shipnet.exercises import grading

    errors = iter([OSError("the disk is full")])

    def file(made=grading.TemporaryFile):
        for error in errors:
            raise error
        return made()

    for name in ("a", "b"):
        write(tmp_path / f"{name}.ipynb", ME, RIGHT, *checks(4))
    monkeypatch.setattr(grading, "TemporaryFile", file)
    grades = grade(str(tmp_path))[0]
    assert sorted(grades["flags"]) == ["", "not graded: the disk is full"]
    assert sorted(grades["points"]) == [0, 1]


@pytest.mark.parametrize(
    "cells",
    [
        ["print(efficiency_of)"],
        ['# check("ex-04-3", efficiency_of)'],
        ['check("ex-04-3", lambda *a: 1)'],
        ['check("ex-04-3", other)'],
        [],
    ],
    ids=["print", "comment", "other answer", "other name", "removed"],
)
def test_an_exercise_with_an_edited_check_is_graded_from_its_answer_and_flagged(cells, tmp_path):
    kept = [cell for cell in checks(4) if "ex-04-3" not in cell]
    write(tmp_path / "a.ipynb", ME, RIGHT, *kept, *cells)
    grades, verdicts = grade(str(tmp_path))
    assert verdicts.set_index("exercise").loc["ex-04-3", "verdict"] == "correct"
    assert grades.loc[0, "flags"] == "check of ex-04-3 edited"


def test_an_endless_function_is_stopped_and_one_without_a_body_is_not_solved(tmp_path, monkeypatch):
    monkeypatch.setattr("shipnet.exercises.grading.LIMIT", 5.0)
    endless = "def efficiency_of(*a):\n while True: pass"
    count = "def count_pulses(bits): raise NotImplementedError"
    write(tmp_path / "a.ipynb", ME, endless, count, *checks(4), *checks(1))
    verdicts = of(tmp_path)
    assert "it took over 5 s" in verdicts["ex-04-3"]
    assert verdicts["ex-01-3"] == "not solved yet"


def test_what_a_teacher_should_look_at_is_flagged(tmp_path):
    copied = "def efficiency_of(data, master, slave):\n" + "".join(
        f"    step_{n} = data + master + slave + {n}\n" for n in range(5)
    )
    (tmp_path / "b").mkdir()
    write(tmp_path / "a.ipynb", ME, copied, *checks(4))
    write(tmp_path / "b/b.ipynb", ME.replace("Ann", "Ben"), "# mine\n" + copied, *checks(4))
    write(tmp_path / "c.ipynb", ME.replace("Ann", "Kim"), RIGHT, *checks(4))
    write(tmp_path / "d.ipynb", RIGHT, *checks(4))
    imported = "from shipnet.exercises.exercise import exercise"
    write(tmp_path / "e.ipynb", ME, imported, RIGHT, *checks(4))
    write(tmp_path / "f.ipynb", ME, "1 +", "%matplotlib inline\n" + RIGHT, *checks(4))
    (tmp_path / "g.ipynb").write_text('{"cells": [1]}')
    write(tmp_path / "h.ipynb", ME, 'check("ex-99-1", me)')
    grades = grade(str(tmp_path))[0].set_index("file")
    flags = grades["flags"].to_dict()
    assert "same lines for ex-04-3 as b/b.ipynb" in flags["a.ipynb"]
    assert "same name as e.ipynb, f.ipynb" in flags["a.ipynb"]
    assert flags["b/b.ipynb"] == "same lines for ex-04-3 as a.ipynb"
    assert flags["c.ipynb"] == "name unchanged"
    assert flags["d.ipynb"] == "no name; name unchanged"
    assert "imports the code that checks answers" in flags["e.ipynb"]
    assert grades.loc["f.ipynb", "points"] == 1
    assert flags["g.ipynb"] == "not a readable notebook"
    assert flags["h.ipynb"] == "no exercise found"


@pytest.mark.parametrize("make", [False, True])
def test_a_folder_without_notebooks_is_refused(make, tmp_path, capsys):
    folder = tmp_path / "empty"
    if make:
        folder.mkdir()
    assert main(["grade", str(folder)]) == 2
    assert "there is no" in capsys.readouterr().err


def test_moodle_can_map_the_columns_of_the_csv_file(tmp_path):
    folder = tmp_path / "handed_in"
    folder.mkdir()
    names = {"Ann.Lee@ship.example": 4, "ben2026": 1}
    write(folder / "a.ipynb", *solution(4, "Ann.Lee@ship.example"))
    write(folder / "b.ipynb", ME.replace("Ann", "ben2026"), RIGHT, *checks(4))
    assert main(["grade", str(folder), "-o", str(tmp_path / "grades.csv")]) == 0
    with open(tmp_path / "grades.csv", encoding="utf-8-sig", newline="") as file:
        header, *rows = csv.reader(file)
    keys = [f"ex-04-{k}" for k in (1, 2, 3, 4)]
    assert header == ["name", "file", *keys, "points", "flags"]
    table = [dict(zip(header, row, strict=True)) for row in rows]
    # Moodle looks a user up by the exact text, and reads a grade as a number.
    assert {row["name"]: float(row["points"]) for row in table} == {
        name.lower(): points for name, points in names.items()
    }
    assert all(row[key] in ("0", "1") for row in table for key in keys)
