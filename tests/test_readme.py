import doctest
import re
import subprocess
from pathlib import Path

from shipnet.papers import ledger

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def test_examples_run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    failed, tried = doctest.testfile(str(ROOT / "README.md"), module_relative=False)
    assert (failed, tried > 3) == (0, True)


def test_links_lead_somewhere():
    targets = re.findall(r"\]\(((?!http)[^)#]+)\)", README)
    assert [target for target in targets if not (ROOT / target).exists()] == []
    assert len(re.findall(r"^!\[", README, re.M)) == 2


def test_every_notebook_is_linked():
    apart = {".ipynb_checkpoints", "lessons"}  # the lessons have a table of their own
    found = [path.relative_to(ROOT) for path in (ROOT / "notebooks").rglob("*.ipynb")]
    found = [path.as_posix() for path in found if not apart & set(path.parts)]
    assert set(re.findall(r"\]\((notebooks/.*?\.ipynb)\)", README)) == set(found)


def test_commands_exist():
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    for target in re.findall(r"`?make ([a-z]+)", README):
        if target not in ("and",):
            assert re.search(rf"^{target}:", makefile, re.M), target


def test_contributors_need_ten_targets_at_most():
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    guide = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    targets = set(re.findall(r"`make(?: ([a-z]+))?", guide))
    assert len(targets) <= 10
    assert all(re.search(rf"^{target or 'all'}:", makefile, re.M) for target in targets)


def test_nothing_names_a_machine_or_a_registry():
    tracked = subprocess.check_output(["git", "ls-files", "-z"], cwd=ROOT, text=True)
    names = tracked.strip("\0").split("\0")
    assert "README.md" in names
    for name in names:
        path = ROOT / name
        if path.suffix in (".npz", ".png", ".lock", ".sr") or not path.exists():
            continue
        text = path.read_text(encoding="utf-8")
        assert not re.search(r"(?<![\w.])/(home|root|work|Users)/\w", text), name


def test_the_counts_are_those_of_the_ledger():
    table = ledger().counts().sum()
    assert table["open"] == 0
    said = (
        f"Of {table['claims']} claims, {table['measurement']} are judged by a measurement, "
        f"{table['independent']} by another program, a published table or a second derivation, "
        f"{table['own simulator']} by our own simulators and {table['definition']} by definition, "
        "and none is open"
    )
    assert said in " ".join(README.split())
