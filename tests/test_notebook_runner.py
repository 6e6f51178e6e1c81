"""docs/notebooks.py on notebooks of a few cells."""

import os
from pathlib import Path

import nbformat
import pytest
from jupyter_client.launcher import launch_kernel
from jupyter_client.provisioning import local_provisioner
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook, new_output
from nbval.plugin import get_sanitize_patterns

from docs import notebooks

ROOT = Path(__file__).resolve().parents[1]
TITLE = new_markdown_cell("# A title", id="title")
LOADED = """import os, sys
print([name for name in ("pandas", "scipy.stats", "shipnet", "kernels") if name in sys.modules])
"""
# All that a kernel takes from the process it starts in, or sets when a library is loaded.
STATE = """import locale, signal, warnings
import matplotlib.pyplot as plt, numpy as np, pandas as pd, scipy.stats
plt.plot([1, 2])
print(pd.describe_option(_print_desc=False).lower(), dict(plt.rcParams), np.get_printoptions())
print(sys.path, os.getcwd(), os.getsid(0) == os.getpid(), locale.setlocale(locale.LC_ALL))
print(sorted(map(str, warnings.filters)))
print([signal.getsignal(number) for number in range(1, signal.NSIG)])
pd.DataFrame([range(30)])
"""


STYLE = "import matplotlib.pyplot as plt\nfrom shipnet import style\nstyle.use()\n"
# Figures that are not legible if they are narrow.
CROWDED = """fig, ax = plt.subplots(figsize=(8, 3))
for x in range(8):
    ax.text(x / 9, 0.5, "a long word")
"""
BOXED = """fig, ax = plt.subplots(figsize=(8, 3))
style.box(ax, 0.4, 0.2, 0.2, 0.6, "words in a box")
"""
OUTLINED = """from matplotlib.collections import PathCollection
from matplotlib.textpath import TextPath
plt.gca().add_collection(PathCollection([TextPath((0, 0), word) for word in "ab"]))
"""
COLLAPSED = "plt.subplots(1, 12, figsize=(9, 3))"
TITLED = "plt.title(75 * 'a')"


def code(source, identifier, **metadata):
    return new_code_cell(source, id=identifier, metadata=metadata)


def write(root: Path, name: str, *cells) -> Path:
    path = root / "notebooks" / name
    path.parent.mkdir(parents=True, exist_ok=True)
    nbformat.write(new_notebook(cells=[TITLE, *cells]), path)
    return path


def test_run_executes_only_what_is_stale(tmp_path, capsys):
    module = tmp_path / "shipnet" / "signal.py"
    module.parent.mkdir()
    module.write_text("level = 1\n")
    path = write(tmp_path, "deep/a.ipynb", code("from pathlib import Path; Path.cwd().name", "a"))
    copy = tmp_path / "build" / "notebooks" / "deep" / "a.ipynb"

    assert notebooks.main(["run"], tmp_path) == 0
    assert "[1/1]" in capsys.readouterr().out
    assert nbformat.read(copy, 4).cells[1].outputs[0].data["text/plain"] == "'deep'"

    assert notebooks.main(["run"], tmp_path) == 0
    assert "[1/1]" not in capsys.readouterr().out

    later = module.stat().st_mtime_ns + 1_000_000_000
    os.utime(module, ns=(later, later))
    assert notebooks.main(["run"], tmp_path) == 0
    assert "[1/1]" in capsys.readouterr().out

    path.unlink()
    assert notebooks.main(["run"], tmp_path) == 0
    assert not copy.exists()


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs a system that can fork")
def test_a_fork_shows_what_a_kernel_of_its_own_does(tmp_path, monkeypatch):
    path = write(tmp_path, "deep/a.ipynb", code(LOADED, "a"), code(STATE, "b"))
    forks = [nbformat.reads(notebooks.execute(path).text, 4).cells[1:] for _ in range(2)]
    monkeypatch.setattr(local_provisioner, "launch_kernel", launch_kernel)
    own = nbformat.reads(notebooks.execute(path).text, 4).cells[1:]
    assert own[0].outputs[0].text == "[]\n"
    for cells in forks:
        assert cells[0].outputs[0].text == "['pandas', 'scipy.stats']\n"
        assert cells[1] == own[1]


def test_a_failure_names_the_cell_and_stops_no_other_notebook(tmp_path, capsys):
    write(tmp_path, "good.ipynb", code("1 + 1", "a"))
    write(
        tmp_path,
        "bad.ipynb",
        code("x = 1", "a"),
        new_markdown_cell("text", id="b"),
        code("\ny = x\nraise ValueError('x is 1, but may be 2..3')", "c"),
    )
    assert notebooks.main(["run"], tmp_path) == 1
    lines = [line.strip() for line in capsys.readouterr().out.splitlines()]
    where = lines.index("FAILED notebooks/bad.ipynb")
    assert lines[where + 1] == "cell 4, In [2]: y = x"
    assert lines[where + 2] == "ValueError: x is 1, but may be 2..3"
    copies = tmp_path / "build" / "notebooks"
    assert {path.name for path in copies.iterdir()} == {"good.ipynb", "good.sha256"}


@pytest.fixture
def moved(tmp_path):
    """Return a notebook whose stored number is not the one that it prints."""
    cell = code("print('saved', 0.105, 'of', 3)", "a")
    cell.outputs = [new_output("stream", name="stdout", text="saved 0.104 of 3\n")]
    return write(tmp_path, "a.ipynb", cell)


def test_store_shows_what_changes_and_writes_only_what_is_accepted(tmp_path, moved, capsys):
    before = moved.read_bytes()
    assert notebooks.main(["store"], tmp_path) == 1
    assert "notebooks/a.ipynb cell 2: 0.104 -> 0.105\n" in capsys.readouterr().out
    assert moved.read_bytes() == before

    assert notebooks.main(["store", "--accept", str(moved)], tmp_path) == 0
    assert "0.104 -> 0.105" in capsys.readouterr().out
    accepted = moved.read_bytes()
    assert b"0.105" in accepted

    assert notebooks.main(["store", "--accept"], tmp_path) == 0
    assert moved.read_bytes() == accepted
    assert "->" not in capsys.readouterr().out


def test_the_figure_in_the_form_of_an_object_is_in_the_book_but_not_stored(tmp_path):
    source = "from shipnet import can\ncan.response_times(can.example(), 125e3)"
    path = write(tmp_path, "a.ipynb", code(source, "a"))
    assert notebooks.main(["store", "--accept"], tmp_path) == 0
    stored = nbformat.read(path, 4).cells[1].outputs[0].data
    assert "all in time" in stored["text/plain"] and "slack_ms" in stored["text/html"]
    assert "<figure></figure>" in stored["text/html"] and "data:image" not in stored["text/html"]
    assert notebooks.main(["run"], tmp_path) == 0
    copy = tmp_path / "build" / "notebooks" / "a.ipynb"
    shown = nbformat.read(copy, 4).cells[1].outputs[0].data["text/html"]
    assert shown.count('src="data:image/svg+xml;base64,') == 1
    # The tests compare the stored form with one that has a figure.
    text = (Path(__file__).parent / "nbval_sanitize.cfg").read_text(encoding="utf-8")
    patterns = get_sanitize_patterns(text)
    assert (notebooks.FIGURE.pattern, "<figure></figure>") in patterns
    assert notebooks.FIGURE.sub("<figure></figure>", shown) == stored["text/html"]


def test_a_figure_has_a_narrow_form_if_it_is_legible_there(tmp_path):
    drawings = ["plt.plot([1, 2])", CROWDED, BOXED, OUTLINED, COLLAPSED, TITLED]
    cells = [code(f"{STYLE}{drawing}\nplt.show()", f"c{n}") for n, drawing in enumerate(drawings)]
    path = write(tmp_path, "a.ipynb", *cells)
    plain, both = notebooks.execute(path), notebooks.execute(path, narrow=True)
    assert notebooks.execute(path, narrow=True).text == both.text
    wide, shown = (
        [cell.outputs for cell in nbformat.reads(done.text, 4).cells[1:]] for done in (plain, both)
    )
    narrow = shown[0].pop(0)
    assert shown == wide
    assert [len(outputs) for outputs in shown] == [1] * len(drawings)
    (size,) = narrow.metadata.values()
    assert size.keys() == {"width"}
    assert size["width"] < 440 < wide[0][0].metadata["image/png"]["width"]


def test_stored_form(tmp_path):
    path = write(
        tmp_path,
        "a.ipynb",
        code("print(1, flush=True)\nprint(2)", "a", tags=["keep"], scrolled=True),
        code("print('a slider')", "b", tags=["widget"]),
        code("3", "c"),
    )
    assert notebooks.main(["store", "--accept"], tmp_path) == 0
    stored = nbformat.read(path, 4)
    _, first, widget, last = stored.cells
    assert stored.metadata == notebooks.METADATA
    assert [cell.id for cell in stored.cells] == ["title", "a", "b", "c"]
    assert first.metadata == {"tags": ["keep"]}
    assert [output.text for output in first.outputs] == ["1\n2\n"]
    assert (widget.execution_count, widget.outputs) == (None, [])
    assert last.execution_count == 3


@pytest.mark.parametrize(
    ("old", "new", "change"),
    [
        ("t  9 ms", "t 10 ms", ["9 -> 10"]),
        ("a 1 b 2", "a 3 b 4", ["1 -> 3", "2 -> 4"]),
        ("1e-3", "-1.5e-3", ["1e-3 -> -1.5e-3"]),
        ("agrees", "differs", ["output changed\n    @@ -1 +1 @@\n    -agrees\n    +differs"]),
        ("", "5", ["new output"]),
    ],
)
def test_changes_of_text(old, new, change):
    def notebook(text):
        cell = code("", "a")
        cell.outputs = [new_output("stream", name="stdout", text=text)] if text else []
        return new_notebook(cells=[cell])

    assert [what for _, what in notebooks.changes(notebook(old), notebook(new))] == change


def stems(*files):
    return {path.stem for path in notebooks.affected(ROOT, files)}


def test_a_file_affects_the_notebooks_that_import_it_and_no_others():
    assert {"04_polling", "2_access"} <= stems("shipnet/asi/timing.py")
    assert not {"05_can", "1_buses"} & stems("shipnet/asi/timing.py")
    assert stems("shipnet/exercises/lesson_03.py") == {"03_frames"}
    assert stems("shipnet/tools/page.css") > {"asi_bench", "can_load"}
    assert stems("notebooks/lessons/05_can.ipynb") == {"05_can"}
    assert stems("docs/build.py") == stems() == set()
    assert {"1_telegrams", "2_diagnosis", "00_start_here"} <= stems("data/claims.csv")
