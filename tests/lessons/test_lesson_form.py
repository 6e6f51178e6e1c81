"""What a class meets in a lesson: short cells, readable calls, and questions that spoil nothing."""

import ast
import builtins
import re
from contextlib import redirect_stdout
from io import StringIO
from statistics import median

import matplotlib.pyplot as plt
import nbformat
import pytest

from docs import editions

SOURCES = editions.sources()
LESSONS = pytest.mark.parametrize("source", SOURCES, ids=lambda path: path.stem)
TRY, WRITE = "**Try it", "**Write it"


def cells(source, kind):
    return [cell for cell in editions.read(source).cells if cell.cell_type == kind]


@LESSONS
def test_half_of_the_text_cells_have_35_words_or_fewer(source):
    texts = [c.source for c in cells(source, "markdown") if "solution" not in editions.tags(c)]
    words = [sum(any(map(str.isalnum, word)) for word in text.split()) for text in texts]
    assert median(words) <= 35


@LESSONS
def test_a_lesson_shows_the_source_of_its_model_and_at_most_one_table_of_claims(source):
    code = "\n".join(cell.source for cell in cells(source, "code"))
    assert re.search(r"\bCode\(", code)
    assert len(re.findall(r"(?<!plt\.)\bshow\(\"", code)) <= 1


def unreadable(source):
    """Yield the constructs in a cell that a student with a little Python cannot read."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.NamedExpr):
            yield "walrus"
        if isinstance(node, ast.Set):
            yield "set"
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Tuple):
            if isinstance(node.value, ast.GeneratorExp):
                yield "unpacks a generator"
        if isinstance(node, ast.FormattedValue) and "z." in ast.unparse(node.format_spec or node):
            yield "format z"
        if isinstance(node, ast.Attribute) and node.attr in ("agg", "recompute"):
            yield node.attr


@LESSONS
def test_a_student_can_read_every_call(source):
    assert not [found for cell in cells(source, "code") for found in unreadable(cell.source)]


@pytest.mark.parametrize(
    "source",
    [
        "f(x := 1)",
        "record = {'dt', 'u'}",
        "a, b = (each for each in c)",
        "f'{x:+z.1f}'",
        "t.groupby('k')['x'].agg(' '.join)",
        "Claim('x').recompute",
    ],
)
def test_each_unreadable_call_is_found(source):
    assert list(unreadable(source))


@LESSONS
def test_no_output_is_a_bare_object(source):
    path = editions.ROOT / editions.LESSONS / f"{source.stem}.ipynb"
    for cell in nbformat.read(path, as_version=4).cells:
        if cell.cell_type == "code" and not {"setup", "check"} & editions.tags(cell):
            printed = "".join(output.get("text", "") for output in cell.outputs)
            assert not re.search(r"\{'|\b[A-Z]\w+\(\w+[=:]|<.* at 0x", printed), printed


def output(cell, names):
    """Run a cell and return what it prints and shows as text."""
    tree, printed = ast.parse(cell.source), StringIO()
    last = tree.body.pop() if tree.body and isinstance(tree.body[-1], ast.Expr) else None
    with redirect_stdout(printed):
        exec(compile(tree, "<cell>", "exec"), names)
        if last is not None and "widget" not in editions.tags(cell):
            shown = eval(compile(ast.Expression(last.value), "<cell>", "eval"), names)
            printed.write("" if shown is None else repr(shown))
    plt.close("all")
    return printed.getvalue()


def used(code):
    """Return the names that a code object and its functions refer to."""
    inner = [each for each in code.co_consts if isinstance(each, type(code))]
    return {*code.co_names}.union(*map(used, inner))


def compiled(source):
    return compile(source, "<cell>", "exec")


def changes(run, place, variant):
    """Return the later cells whose output changes if a cell is replaced by a variant."""
    names = dict(run[place - 1][1])
    output(variant, names)
    for cell, after, expected in run[place + 1 :]:
        changed = {name for name in names if names[name] is not after.get(name)}
        if not changed & used(compiled(cell.source)):
            bound = compiled(cell.source).co_names
            names.update({name: after[name] for name in bound if name in after})
        elif output(cell, names) != expected:
            yield cell.source


@pytest.fixture
def no_windows(monkeypatch):
    monkeypatch.setattr(plt, "show", lambda: None)
    monkeypatch.setattr(builtins, "display", print, raising=False)
    plt.switch_backend("agg")


def executed(code, last):
    """Run the first cells; return for each the cell, the names after it, and its output."""
    names, run = {}, []
    for cell in code[: last + 1]:
        shown = output(cell, names)
        run.append((cell, dict(names), shown))
    return run


@LESSONS
def test_what_a_text_suggests_to_try_runs_and_changes_no_later_cell(source, no_windows):
    lesson = editions.read(source)
    suggested = sum(TRY in cell.source for cell in lesson.cells)
    code = [cell for cell in editions.student_edition(lesson).cells if cell.cell_type == "code"]
    marked = [cell.metadata.get("try", []) for cell in cells(source, "code")]
    places = [place for place, variants in enumerate(marked) if variants]
    assert suggested == len(places)
    if not places:
        return
    assigned = set().union(*(compiled(code[place].source).co_names for place in places))
    later = [k for k in range(places[-1], len(code)) if assigned & used(compiled(code[k].source))]
    run = executed(code, max(places[-1], *later))
    for place in places:
        for old, new in marked[place]:
            assert code[place].source.count(old) == 1
            variant = nbformat.v4.new_code_cell(code[place].source.replace(old, new))
            assert list(changes(run, place, variant)) == []


def test_a_change_of_a_later_cell_is_found():
    texts = ["n = 31", "n = 31\nx = n", "y = 2 * n", "print(y)", "print(3)"]
    code = [nbformat.v4.new_code_cell(text) for text in texts]
    run = executed(code, len(code) - 1)
    assert list(changes(run, 1, nbformat.v4.new_code_cell("n = 10\nx = n"))) == ["print(y)"]
    assert list(changes(run, 1, code[1])) == []


@LESSONS
def test_a_function_that_students_write_agrees_with_the_package(source, no_windows):
    lesson = editions.read(source).cells
    for place, cell in enumerate(lesson):
        if WRITE not in cell.source:
            continue
        answer = re.search(r"```python\n(.*?)```", lesson[place + 3].source, re.DOTALL)[1]
        before = [one for one in lesson[:place] if one.cell_type == "code"]
        names = executed(before, len(before))[-1][1]
        output(lesson[place + 1], names)
        stub = output(lesson[place + 2], names)
        exec(answer, names)
        written = output(lesson[place + 2], names)
        assert len({*re.findall(r"\d+", written)}) == 1 < len({*re.findall(r"\d+", stub)})
        assert len(answer.split("\n\n\n")[0].splitlines()) <= 10
