"""The how-to pages do what they say: their code runs, and prints what stands below it."""

import contextlib
import doctest
import io
import re
import shlex
from importlib.util import find_spec
from os.path import normpath
from pathlib import Path

import pytest

from shipnet.__main__ import main
from tests.support import require

ROOT = Path(__file__).resolve().parents[1]
PAGES = sorted((ROOT / "docs" / "howto").glob("*.md"))
#: Pages that the book generates.
GENERATED = {"ledger.md", "errata.md", "glossary.md"}
BLOCK = re.compile(
    r"^```(python|sh)\n(.*?)^```\n(?:\n```text\n(.*?)^```\n)?", re.MULTILINE | re.DOTALL
)
SHIPNET = "python -m shipnet "
SAME = doctest.OutputChecker()


def run(kind, code, names):
    """Run a block and return what it prints."""
    with contextlib.redirect_stdout(io.StringIO()) as out:
        if kind == "python":
            exec(compile(code, "page", "exec"), names)
        else:
            for line in code.replace("\\\n", " ").splitlines():
                assert line.startswith(SHIPNET), line
                assert main(shlex.split(line.removeprefix(SHIPNET))) == 0, line
    return out.getvalue()


def blocks(page):
    return BLOCK.findall(page.read_text(encoding="utf-8"))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_what_a_page_shows_is_what_happens(page, tmp_path, monkeypatch):
    if page.stem == "run_on_a_cluster":
        require("cluster", find_spec("pyarrow") is not None, "pyarrow is missing")
    monkeypatch.chdir(tmp_path)
    names = {"__name__": "__main__"}
    found = blocks(page)
    assert len(found) >= 2
    for kind, code, shown in found:
        printed = run(kind, code, names)
        if shown:
            assert SAME.check_output(shown, printed, doctest.ELLIPSIS), f"{code}\n{printed}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_a_title_begins_with_a_verb_and_links_lead_somewhere(page):
    text = page.read_text(encoding="utf-8")
    title = text.splitlines()[0]
    verbs = "Add Check Compare Decode Find Hand Read Run Serve Simulate".split()
    assert title.split()[1] in verbs
    for target in re.findall(r"\]\(((?!http)[^)#]+)\)", text):
        # In the book, the folder howto/ lies beside notebooks/ and data/.
        path = ROOT / normpath(f"howto/{target}")
        known = path.exists() or (page.parent / target).exists()
        assert known or path.name in GENERATED or path.parent.name == "api", target
