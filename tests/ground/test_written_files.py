"""Files that a spreadsheet may open, and text that a terminal prints, execute nothing."""

import ast
import csv
import inspect
import io
import json
from contextlib import contextmanager
from pathlib import Path

import openpyxl
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

import shipnet
from shipnet import asi, ballast, can, datasets, design, fuzzy, line
from shipnet.__main__ import main
from shipnet.asi.plan_file import read_elements, write_elements
from shipnet.design.iolist import IoList, read_iolist
from shipnet.errors import ArgumentError
from shipnet.results import Answer
from shipnet.tables import (
    NUMBER,
    as_csv,
    as_workbook,
    cell_text,
    csv_text,
    read_sheet,
    save_table,
)

PACKAGE = Path(__file__).resolve().parents[2] / "shipnet"

#: Text that some spreadsheet reads as a formula, or nearly.
SIGNS = [
    *"=1+1 +A1 -X1 @SUM(A1) '=K ''-K - ' 'quoted' -1.5 +3 '-5 \uff1d1 \uff0bA \uff0dA".split(),
    *(
        "\uff20A",
        "\t=1",
        "\r=1",
        "\n=1",
        " =1",
        "\u3000=1",
        "\ufeff=1",
        "\x00=1",
        "' =1",
        "a\r=1",
        "a\n=1",
    ),
    *("=cmd|' /C calc'!A0", "\ud800"),
]
TEXT = st.sampled_from(SIGNS) | st.text("'=+-@\t\r\n \uff1d;,\"a1.\ud800", max_size=6) | st.text()
CELL = TEXT | st.floats() | st.integers() | st.booleans() | st.none()


def starts_a_formula(cell):
    """Return whether a spreadsheet that trims cells and accepts wide signs sees a formula."""
    if cell[:1] in ("\t", "\r", "\n"):
        return True
    return cell.strip("\ufeff\x00 \u3000\t\r\n")[:1] in tuple("=+-@\uff1d\uff0b\uff0d\uff20") and (
        NUMBER.fullmatch(cell) is None and cell not in ("-inf", "nan")
    )


def rows_of(data):
    text = data.decode("utf-8-sig") if isinstance(data, bytes) else data
    return list(csv.reader(io.StringIO(text, newline="")))


@given(st.lists(st.lists(CELL, min_size=2, max_size=2), max_size=4))
def test_no_cell_of_a_table_begins_a_formula(rows):
    for written in (csv_text(rows), as_csv(pd.DataFrame(rows, columns=["=a", "-b"], dtype=object))):
        read = rows_of(written)
        assert not [cell for row in read for cell in row if starts_a_formula(cell)]
        assert len(read) == len(rows) + isinstance(written, bytes)


@given(TEXT, TEXT)
def test_text_is_read_back_as_it_was(title, cell):
    (again,) = rows_of(csv_text([(title, cell)]))
    for text, read in zip((title, cell), again, strict=True):
        plain = text.encode("utf-8", "backslashreplace").decode()
        assert cell_text(read) == plain.replace("\r\n", "\n").replace("\r", "\n").strip()


@given(CELL)
def test_no_cell_of_a_workbook_is_a_formula(cell):
    book = openpyxl.load_workbook(io.BytesIO(as_workbook({"one": pd.DataFrame({"=a": [cell]})})))
    assert "f" not in {cell.data_type for row in book["one"].iter_rows() for cell in row}


def test_editing_a_text_in_a_workbook_makes_no_formula():
    book = openpyxl.load_workbook(
        io.BytesIO(as_workbook({"one": pd.DataFrame({"a": ["=1", "b"]})}))
    )
    assert [cell.quotePrefix for cell in book["one"]["A"]] == [False, True, False]
    assert [cell.value for cell in book["one"]["A"]] == ["a", "=1", "b"]


def formulas(path):
    rows = rows_of(path.read_bytes())
    return [cell for row in rows for cell in row if starts_a_formula(cell)]


def printable_names():
    """Return names that a plan, a message set and an I/O list accept."""
    letters = st.characters(exclude_categories=["C", "Z"])
    names = st.tuples(
        st.sampled_from(["=", "-", "+", "@", "'=", "''-", "\uff1d", ""]),
        st.text(letters, min_size=1, max_size=5),
    ).map("".join)
    return names.filter(lambda name: name.isprintable() and name == name.strip())


def plan(path, first, second):
    run, slave = asi.CableRun(first, second, 10.0), asi.Slave(label="1", node=second)
    elements, notes = [asi.Master(node=first), run, slave], {("master", first): first}
    write_elements(elements, path, notes)
    return read_elements(path) == (elements, notes, ())


def message_set(path, name, sender):
    messages = can.MessageSet([can.Message(name, 1, 8, 0.01, sender=sender)])
    messages.save(path)
    return [*can.read_messages(path)] == [*can.MessageSet.parse(messages.text)] == [*messages]


def io_list(path, tag, note):
    rows = [("tag", "signal", "x", "y", "z", "note"), (tag, "contact", -1.5, 2, 3, note)]
    try:
        iolist = IoList.parse(csv_text(rows))
    except ValueError:  # not every name is a tag, such as "spare"
        return True
    iolist.save(path)
    return read_iolist(path).points.equals(iolist.points)


@pytest.mark.parametrize("saved", [plan, message_set, io_list])
@given(first=printable_names(), second=printable_names())
def test_what_is_saved_is_read_back_as_it_was(tmp_path_factory, saved, first, second):
    path = tmp_path_factory.getbasetemp() / "saved.csv"
    path.unlink(missing_ok=True)
    if first != second:
        assert saved(path, first, second)
        assert not path.exists() or formulas(path) == []


@pytest.mark.parametrize("suffix", [".csv", ".xlsx", ".json", ""])
def test_an_answer_is_saved_without_formulas(suffix, tmp_path):
    table = pd.DataFrame({"=name": SIGNS, "value": range(-1, len(SIGNS) - 1)})
    answer = Answer(None, "", "", {}, {"grades": table}, lambda ax: None)
    file = tmp_path / f"out{suffix}"
    answer.save(str(file), "grade")
    if suffix == ".json":
        names = [
            row["=name"] for row in json.loads(file.read_text(encoding="utf-8"))["tables"]["grades"]
        ]
        assert names == [*SIGNS[:-1], "\\ud800"]
    elif suffix != ".xlsx":
        file = file if suffix else file / "grades.csv"
        assert rows_of(file.read_bytes())[:2] == [["'=name", "value"], ["'=1+1", "-1"]]
        assert formulas(file) == []


LIST = IoList.parse("tag,signal,x,y,z\n1,contact,1,2,3\n007,4-20mA_loop,1,2,3\n")


def shipped(read, name):
    return lambda: read(datasets.path(name))


#: What makes an object of each class, its legal suffixes, and what reads a file for comparison.
MADE = {
    "asi.Plan": (
        shipped(asi.read_plan, "synthetic_asi_plan_300m.csv"),
        ".csv .xlsx",
        asi.read_plan,
    ),
    "asi.Waveform": (lambda: asi.star(10, [5]).waveform(node="leg 1"), ".csv .txt .npz", None),
    "can.Log": (lambda: can.simulate(can.example(), 125e3, until=0.1).log(), ".log", None),
    "can.MessageSet": (can.example, ".csv .xlsx", can.read_messages),
    "design.Comparison": (lambda: LIST.compare((20, 0, 4), ["home runs"]), "folder", None),
    "design.Design": (lambda: LIST.plan("home runs", (20, 0, 4)), "folder", None),
    "design.IoList": (shipped(read_iolist, "synthetic_iolist_ship.csv"), ".csv .xlsx", read_iolist),
    "design.Settings": (
        lambda: design.Settings().replace({"supply.voltage": 26}),
        ".toml",
        design.Settings.read,
    ),
    "fuzzy.RuleBase": (ballast.rule_base, ".toml .fcl .st", fuzzy.read_rules),
    "line.Waveform": (lambda: line.Waveform([0.0, 1.5], 1e-6), ".csv .txt .npz", None),
}
FOLDERS = [name for name, (_, legal, _) in MADE.items() if legal == "folder"]
SUFFIXES = (".csv", ".txt", ".xlsx", ".XLSX", ".log", ".toml", ".npz", ".png", ".dbc", "")


def test_every_class_that_saves_is_tested():
    packages = {name: getattr(shipnet, name) for name in dir(shipnet)}
    assert {
        f"{name}.{title}"
        for name, package in packages.items()
        for title in dir(package)
        if inspect.isclass(thing := getattr(package, title)) and hasattr(thing, "save")
    } == set(MADE)


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("name", sorted(MADE.keys() - FOLDERS))
def test_a_file_is_what_its_suffix_says_or_is_refused(name, suffix, tmp_path):
    make, legal, read = MADE[name]
    made, path = make(), tmp_path / f"saved{suffix}"
    if suffix.lower() not in legal.split():
        with pytest.raises(ArgumentError, match="its suffix must be"):
            made.save(path)
        assert not path.exists()
        return
    made.save(path)
    workbook_or_archive = suffix.lower() in (".xlsx", ".npz")
    assert path.read_bytes().startswith(b"PK") == workbook_or_archive
    if read:
        again = read(path)
        same = again.points.equals(made.points) if name == "design.IoList" else again == made
        assert same


@pytest.mark.parametrize("name", FOLDERS)
def test_a_folder_with_the_suffix_of_a_file_is_refused(name, tmp_path):
    made = MADE[name][0]()
    for suffix in (".xlsx", ".csv", ".html"):
        with pytest.raises(ArgumentError, match="it must be a folder, not a file"):
            made.save(tmp_path / f"saved{suffix}")
    made.save(tmp_path / "hull 2.5")
    assert [folder.name for folder in tmp_path.iterdir()] == ["hull 2.5"]


def test_a_workbook_has_numbers_where_they_are_read_back_as_they_were(tmp_path):
    cells = ["7", "-1.5", "007", "1e5", "+3", "12A", "", "22.50", "9" * 20, "1e999", None, 2.5]
    save_table(tmp_path / "a.xlsx", pd.DataFrame({"a": cells, "b": "x"}))
    again = read_sheet(tmp_path / "a.xlsx")
    assert [row[0] for _, row in again.rows] == [str(cell or "") for cell in cells]
    column = openpyxl.load_workbook(tmp_path / "a.xlsx").active["A"][1:]
    assert [cell.value for cell in column if isinstance(cell.value, int | float)] == [7, -1.5, 2.5]


WRITERS = {"to_csv", "to_excel", "DictWriter", "ExcelWriter", "Workbook", "writer", "savetxt"}


def test_only_one_module_writes_csv_and_workbooks():
    """`Waveform.save` writes numbers by `savetxt`, under titles of the one writer."""
    dangerous = set()
    for path in PACKAGE.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call):
                name = getattr(node.func, "attr", getattr(node.func, "id", ""))
                dangerous |= (
                    {(path.relative_to(PACKAGE).as_posix(), name)} if name in WRITERS else set()
                )
    assert dangerous == {
        ("tables.py", "writer"),
        ("tables.py", "Workbook"),
        ("line/waveform.py", "savetxt"),
    }


# Escapes that set the title, move the cursor, reverse text; half a pair of surrogates.
HOSTILE = "Ann\x1b]0;x\x07\x9b2J\x7f\u202e\ud800\rB"
SAFE = r"Ann\u001b]0;x\u0007\u009b2J\u007f\u202e\ud800\u000dB"


def commands(text):
    """Return the characters of text that command a terminal."""
    return [c for c in text if not c.isprintable() and c not in "\n\t\xa0"]


def test_the_name_of_a_student_cannot_command_the_terminal(tmp_path, capsys, monkeypatch):
    grades = pd.DataFrame(
        {"name": [HOSTILE], "file": "a.ipynb", "ex-04-3": 1, "points": 1, "flags": ""}
    )
    verdicts = pd.DataFrame({"file": ["a.ipynb"], "exercise": "ex-04-3", "verdict": HOSTILE})
    monkeypatch.setattr("shipnet.exercises.grading.grade", lambda folder: (grades, verdicts))
    files = [tmp_path / f"g{suffix}" for suffix in (".csv", ".xlsx", ".json", "")]
    assert main(["grade", str(tmp_path), *(w for file in files for w in ("-o", str(file)))]) == 0
    output = capsys.readouterr().out
    assert SAFE.replace(r"\u000d", r"\r") in output
    assert not commands(output)
    assert main(["grade", str(tmp_path), "--json"]) == 0
    printed = capsys.readouterr().out
    assert not commands(printed)
    assert printed == files[2].read_text(encoding="utf-8")
    name = json.loads(printed)["tables"]["grades"][0]["name"]
    assert name == HOSTILE.replace("\ud800", "\\ud800")


def test_a_title_cannot_command_the_terminal(tmp_path, capsys):
    file = tmp_path / "list.csv"
    title = HOSTILE.replace("\ud800", "").replace("\r", "")
    file.write_text(f"name,id,dlc,{title}\nA,1,8,10\n", encoding="utf-8")
    for words in (
        ["--column", "Every=period_ms"],
        ["--column", f"{title}=period_ms", "--rates", "1"],
    ):
        assert main(["can", str(file), *words]) == 2
        assert not commands(capsys.readouterr().err)


def test_a_word_of_the_command_line_cannot_command_the_terminal(capsys):
    with pytest.raises(SystemExit):
        main(["ledger", "--\x1b]0;x\x07"])
    assert not commands(capsys.readouterr().err)
    assert main(["check", "none\x1b[2J\udcff.csv"]) == 2
    assert r"none\u001b[2J\udcff.csv" in capsys.readouterr().err


# Files that cannot be written ---------------------------------------------------------------------


@contextmanager
def no_room():
    """Refuse files of more than 9 bytes, as a full disk does."""
    resource = pytest.importorskip("resource")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (9, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.mark.parametrize("name", ["a.csv", "a.json", "a.png", "a.svg", "folder"])
def test_a_full_disk_is_named_and_leaves_the_old_file(name, tmp_path, capsys):
    messages = str(datasets.path("synthetic_can_lee2012.csv"))
    for old in ("", "old"):
        file = tmp_path / name
        if old:
            file = (file.mkdir(), file / "responses.csv")[1] if name == "folder" else file
            file.write_text(old)
        with no_room():
            code = main(["can", messages, "-o", str(tmp_path / name)])
        assert code == 2
        assert f"shipnet: {tmp_path / name}: cannot be written: " in capsys.readouterr().err
        assert [path.name for path in tmp_path.iterdir()] == ([name] if old else [])
        assert not old or (file.read_text() == old and len(list(file.parent.iterdir())) == 1)


def test_a_folder_keeps_its_other_files_a_device_itself_and_a_file_its_mode(tmp_path, capsys):
    messages = str(datasets.path("synthetic_can_lee2012.csv"))
    folder, link = tmp_path / "folder", tmp_path / "link"
    folder.mkdir()
    (folder / "mine.txt").write_text("mine")
    link.symlink_to(folder)
    assert main(["can", messages, "-o", str(link)]) == 0
    names = {path.name for path in folder.iterdir()}
    assert {"mine.txt", "responses.csv"} <= names and link.is_symlink()
    (tmp_path / "a.csv").symlink_to("/dev/null")
    assert main(["can", messages, "-o", str(tmp_path / "a.csv")]) == 0
    assert (tmp_path / "a.csv").resolve() == Path("/dev/null")
    (tmp_path / "b.csv").touch(mode=0o600)
    assert main(["can", messages, "-o", str(tmp_path / "b.csv")]) == 0
    assert (tmp_path / "b.csv").stat().st_mode & 0o777 == 0o600
