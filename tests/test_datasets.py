import csv
import hashlib
import re
from pathlib import Path

import pytest

from shipnet import datasets
from shipnet.errors import ArgumentError, InputError

DATA = Path(__file__).resolve().parents[1] / "data"
COLUMNS = (
    "file | what, columns with units | source | licence | how obtained | transformations | "
    "verified by | SHA-256"
).split(" | ")


def sources():
    lines = (DATA / "SOURCES.md").read_text(encoding="utf-8").splitlines()
    rows = [
        [cell.strip() for cell in line.strip("| ").split(" | ")]
        for line in lines
        if line[:1] == "|"
    ]
    assert rows[0] == COLUMNS
    return {row[0].strip("`"): dict(zip(COLUMNS, row, strict=True)) for row in rows[2:]}


SOURCES = sources()


def test_every_file_has_a_row_and_every_row_a_file():
    assert list(SOURCES) == datasets.names()
    assert {file.name for file in DATA.iterdir()} == {*datasets.names(), "SOURCES.md"}


@pytest.mark.parametrize("name", datasets.names())
def test_file_is_the_one_described(name):
    row = SOURCES[name]
    assert all(row.values()), f"{name} has an empty cell in SOURCES.md"
    assert row["SHA-256"] == hashlib.sha256((DATA / name).read_bytes()).hexdigest()
    tests = (DATA.parent / "tests").rglob("test_*.py")
    functions = {
        f for file in tests for f in re.findall(r"^def (test_\w+)", file.read_text(), re.M)
    }
    named = set(re.findall(r"(?<!/)\btest_\w+\b(?!\.py)", row["verified by"]))
    assert named, f"no test verifies {name}"
    assert named <= functions, f"{name}: no such test: {named - functions}"


@pytest.mark.parametrize("name", [name for name in datasets.names() if name.endswith(".csv")])
def test_file_is_clean_csv(name):
    text = (DATA / name).read_bytes().decode("utf-8")
    assert "\r" not in text
    assert text.endswith("\n")
    header, *rows = csv.reader(text.splitlines())
    assert all(re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", column) for column in header)
    assert len(set(header)) == len(header)
    assert {len(row) for row in rows} == {len(header)}
    for row in rows:
        assert all(cell == cell.strip() for cell in row), row


def test_synthetic_data_say_so():
    for name in datasets.names():
        synthetic = name.startswith("synthetic_")
        assert synthetic == ("synthetic" in SOURCES[name]["how obtained"]), name


def test_an_unknown_file_is_refused_with_the_nearest_names():
    for name in ("nothing.csv", "../README.md", ""):
        with pytest.raises(
            ArgumentError, match=r"name is .*; it must be one of .*, such as \w+\.csv"
        ):
            datasets.path(name)
    with pytest.raises(ArgumentError, match=r"such as claims\.csv"):
        datasets.path("claim.csv")


def test_a_recording_is_no_table():
    with pytest.raises(InputError, match=r"sigrok_nmea2000_snippet\.sr: "):
        datasets.read("sigrok_nmea2000_snippet.sr")
