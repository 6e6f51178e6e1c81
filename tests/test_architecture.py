"""The architecture page and its picture follow the code."""

import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.append(str(ROOT / "docs"))

import floors  # noqa: E402

PAGE = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")


def test_the_picture_shows_the_imports_of_the_code():
    drawn = floors.PICTURE.read_text(encoding="utf-8")
    (pairs,) = re.findall(r"<dc:description>(.*?)</dc:description>", drawn, re.S)
    found = {tuple(pair.replace("&gt;", ">").split(">")) for pair in pairs.split()}
    assert found == floors.imports(), "run `python docs/floors.py`"


def test_no_import_goes_up_a_floor():
    level = {name: k for k, row in enumerate(floors.floors()) for name in row}
    assert [pair for pair in floors.imports() if level[pair[0]] > level[pair[1]]] == []


def test_every_file_that_the_page_names_exists():
    package = ROOT / "shipnet"
    for name in re.findall(r"`((?:[a-z_]+/)?[a-z_*]+\.py)`", PAGE):
        places = (package.glob(name), package.glob(f"*/{name}"), ROOT.glob(name))
        assert any(map(list, places)), name
    for name in re.findall(r"`([a-z_]+)`, `", PAGE.partition("## A telegram")[0]):
        assert (package / name).exists() or (package / f"{name}.py").exists() or name in (
            "decode", "design", "ledger",
        ), name  # fmt: skip
