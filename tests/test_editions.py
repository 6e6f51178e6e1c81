"""Editions of a small lesson, and what they must not lose or show."""

import re
from os.path import normpath
from zipfile import ZipFile

import nbformat
import pytest
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook, new_output

from docs import editions, graders, slides

SOURCE = '''# 01 A title?

+++

## The problem on the ship

See [the start](../00_start.ipynb) and $T = \\frac{1}{R}$; `$HOME` is code.

```{code-cell}
:tags: [setup]
two = 2
```

```{code-cell}
print("only the lesson")
```

## Exercises

```{code-cell}
:tags: [exercise, ex-01-1]
answer = ...
### BEGIN SOLUTION
answer = two + 40
### END SOLUTION
```

```{code-cell}
:tags: [check, ex-01-1]
check("ex-01-1", answer)
```

+++ {"tags": ["solution"]}

A secret, as [the start](../00_start.ipynb) says.

+++

```{code-cell}
:tags: [exercise, ex-01-2]
def double(x):
    """Return twice x."""
    raise NotImplementedError
    ### BEGIN SOLUTION
    return two * x
    ### END SOLUTION
```

## What we learned

Much.
'''


@pytest.fixture
def source(tmp_path):
    path = tmp_path / editions.LESSONS / "source" / "01_small.md"
    path.parent.mkdir(parents=True)
    path.write_text(SOURCE)
    return path


def texts(notebook):
    return [cell.source for cell in notebook.cells]


def test_students_get_stubs_and_no_solutions(source):
    student = "\n".join(texts(editions.student_edition(editions.read(source))))
    assert "answer = ...\n" in student
    assert student.count("raise NotImplementedError") == 1
    for secret in ("40", "two * x", "SOLUTION", "secret"):
        assert secret not in student


def test_solutions_hold_the_exercises_only(source):
    cells = texts(editions.solutions_edition(editions.read(source)))
    assert cells[0].startswith("# Solutions: 01 A title?")
    assert "two = 2" in cells
    assert "answer = two + 40" in cells
    assert 'def double(x):\n    """Return twice x."""\n    return two * x' in cells
    assert "A secret, as [the start](../../00_start.ipynb) says." in cells
    for text in ("only the lesson", "Much.", "NotImplemented", "..."):
        assert not any(text in cell.replace("../", "") for cell in cells)


def test_no_lesson_takes_more_than_an_hour_of_class():
    assert editions.readme(editions.ROOT) == (
        editions.ROOT / editions.LESSONS / "README.md"
    ).read_text("utf-8")
    rows = re.findall(r"^\| \d\d \|.*\|$", editions.table(editions.ROOT), flags=re.M)
    minutes = [int(row.split("|")[5]) for row in rows]
    assert len(minutes) == 10 and all(40 <= each <= 60 for each in minutes)


@pytest.mark.parametrize(
    ("old", "new", "fault"),
    [
        ("answer = ...\n### BEGIN", "### BEGIN", "no stub line"),
        ("[exercise, ex-01-1]", "[ex-01-1]", "go together"),
        ("### BEGIN SOLUTION\nanswer = two + 40\n### END SOLUTION\n", "", "go together"),
        ("### END SOLUTION\n```", "```", "no stub line"),
    ],
)
def test_a_source_of_another_form_is_refused(source, old, new, fault):
    source.write_text(SOURCE.replace(old, new, 1))
    with pytest.raises(ValueError, match=rf"01_small.md, cell \d+: .*{fault}"):
        editions.read(source)


def write_editions(root, source):
    for path, notebook in editions.editions(root, source).items():
        path.parent.mkdir(exist_ok=True)
        nbformat.write(notebook, path)


def test_an_edition_that_differs_from_its_source_is_found(source, tmp_path, capsys):
    assert editions.main(["check"], tmp_path) == 1
    write_editions(tmp_path, source)
    assert editions.main(["check"], tmp_path) == 0
    edited = tmp_path / editions.LESSONS / "solutions" / "01_small.ipynb"
    edited.write_text(edited.read_text().replace("two + 40", "two + 41"))
    (tmp_path / editions.LESSONS / "02_orphan.ipynb").write_text("{}")
    capsys.readouterr()
    assert editions.main(["check"], tmp_path) == 1
    assert capsys.readouterr().out.splitlines() == [
        "not derived: notebooks/lessons/solutions/01_small.ipynb",
        "not derived: notebooks/lessons/02_orphan.ipynb",
    ]


def test_derive_executes_only_what_has_changed(source, tmp_path, monkeypatch):
    executed = []

    def execute(root, paths):
        executed.append(sorted(path.parent.name for path in paths))
        for path in paths:
            notebook = nbformat.read(path, as_version=4)
            for cell in notebook.cells:
                if cell.cell_type == "code":
                    cell.execution_count = 1
            yield editions.notebooks.Executed(path, 0.0, nbformat.writes(notebook))

    monkeypatch.setattr(editions.notebooks, "execute_all", execute)
    assert editions.main(["derive"], tmp_path) == 0
    assert editions.main(["derive"], tmp_path) == 0
    source.write_text(SOURCE.replace("two + 40", "two + 40.0"))
    assert editions.main(["derive"], tmp_path) == 0
    assert executed == [["lessons", "solutions"], [], ["solutions"]]


def test_nbgrader_gets_solutions_and_graded_checks(source, tmp_path):
    notebook = nbformat.read(graders.write_nbgrader(tmp_path, source), as_version=4)
    about = {c.metadata.nbgrader.grade_id: c for c in notebook.cells if "nbgrader" in c.metadata}
    assert list(about) == ["ex-01-1", "ex-01-1-check", "ex-01-2"]
    solution = "### BEGIN SOLUTION\nanswer = two + 40\n### END SOLUTION"
    assert about["ex-01-1"].source == f"answer = ...\n{solution}"
    assert "raise" not in about["ex-01-2"].source
    assert about["ex-01-1"].metadata.nbgrader.solution
    assert about["ex-01-1-check"].source.endswith("\nassert verdict, verdict")
    assert about["ex-01-1-check"].metadata.nbgrader.points == 1
    assert "secret" not in "".join(texts(notebook))


def test_otter_gets_questions_with_solutions_and_tests(source, tmp_path):
    notebook = nbformat.read(graders.write_otter(tmp_path, source), as_version=4)
    raw = [cell.source.partition("\n")[0] for cell in notebook.cells if cell.cell_type == "raw"]
    marks = "ASSIGNMENT CONFIG|BEGIN QUESTION|BEGIN SOLUTION|END SOLUTION|BEGIN TESTS|END TESTS"
    assert raw[:7] == [f"# {mark}" for mark in f"{marks}|END QUESTION".split("|")]


def test_slides_ask_no_address(source, tmp_path):
    write_editions(tmp_path, source)
    page = slides.write(tmp_path, source).read_text("utf-8")
    body = page[page.index("<body") :]
    assert "<math" in body and "<code>$HOME</code>" in body
    assert "A title?" in body and "two = 2" not in body
    assert not re.search(r"""(src|href)=["']?(https?:)?//|@import|url\(["']?http""", page)
    assert "sourceMappingURL" not in page
    assert len(re.findall(r"<section", body)) >= 4
    assert body.count("<section") == body.count("</section")


def test_the_notes_of_a_lesson_take_as_long_as_the_lesson():
    for path in editions.sources():
        lesson = editions.read(path)
        notebook = editions.student_edition(lesson)
        slides.untimed(notebook)
        slides.mark(notebook)
        slides.add_notes(notebook, lesson)
        ends = re.findall(r"Minutes \d+ to (\d+)", " ".join(cell.source for cell in notebook.cells))
        stated = re.search(r"Time: (\d+) minutes", lesson.cells[0].source)
        assert abs(int(ends[-1]) - int(stated[1])) <= 5, path


def test_the_hand_out_has_no_solution_and_no_broken_link():
    with ZipFile(editions.handout(editions.ROOT)) as archive:
        texts = {name: archive.read(name).decode("utf-8", "replace") for name in archive.namelist()}
    assert sum("/lessons/" in name for name in texts if name.endswith("nb")) == 10
    assert not [name for name in texts if "solution" in name or "BEGIN SOLUTION" in texts[name]]
    assert not [name for name in texts if "/teaching/" in name]
    for name, text in texts.items():
        if "/notebooks/" in name:
            for target in re.findall(r"\]\((?!\w+:|#)([^)#\s]+)", text):
                assert normpath(f"{name}/../{target}") in texts


def test_the_hand_out_has_no_output_below_a_prediction():
    shown = 0
    with ZipFile(editions.handout(editions.ROOT)) as archive:
        for name in archive.namelist():
            if not re.search(r"/lessons/\d\d_", name):
                continue
            cells = nbformat.reads(archive.read(name).decode(), as_version=4).cells
            kinds = [cell.cell_type for cell in cells]
            asked = [
                k
                for k, cell in enumerate(cells)
                if re.search(r"\*\*(Predict|Try it|Write it)", cell.source)
            ]
            assert len(asked) >= 3, name
            for place in asked:
                below = cells[kinds.index("code", place)]
                heading = any(
                    c.source.startswith("#") for c in cells[place + 1 : cells.index(below)]
                )
                assert heading or not below.outputs, below.source
            shown += sum(bool(cell.get("outputs")) for cell in cells)
    assert shown >= 10


def test_outputs_return_below_the_next_heading():
    question, heading = new_markdown_cell("**Predict** it."), new_markdown_cell("## Next")
    caption = new_markdown_cell("*A caption.*")
    ran = [
        new_code_cell("1", execution_count=k, outputs=[new_output("stream", text="1")])
        for k in (1, 2, 3, 4)
    ]
    cells = [ran[0], question, ran[1], caption, ran[2], heading, ran[3]]
    kept = editions.unspoiled(new_notebook(cells=cells)).cells
    assert [bool(cell.outputs) for cell in kept if cell.cell_type == "code"] == [
        True,
        False,
        False,
        True,
    ]
