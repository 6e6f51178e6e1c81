"""environment.yml, pyproject.toml and requirements.lock name the same packages."""

import ast
import json
import re
import sys
import tomllib
from importlib.metadata import packages_distributions
from operator import attrgetter
from pathlib import Path

import yaml
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet

from docs import distribution

ROOT = Path(__file__).resolve().parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
CONDA = yaml.safe_load((ROOT / "environment.yml").read_text(encoding="utf-8"))
LOCK = (ROOT / "requirements.lock").read_text(encoding="utf-8")

# What a class needs beyond the package itself: the notebooks, and nbval to run them as tests.
CLASSROOM = ["pytest", "nbval"]


def declared():
    project = PROJECT["project"]
    requirements = project["dependencies"] + project["optional-dependencies"]["notebooks"]
    named = [Requirement(text) for text in requirements]
    named += [
        r for r in map(Requirement, PROJECT["dependency-groups"]["test"]) if r.name in CLASSROOM
    ]
    return {requirement.name: requirement.specifier for requirement in named}


def conda():
    named = [entry for entry in CONDA["dependencies"] if isinstance(entry, str)]
    pairs = [re.fullmatch(r"([a-z0-9-]+)(.*)", entry.replace(" ", "")).groups() for entry in named]
    return {name: SpecifierSet(specifier) for name, specifier in pairs}


def test_the_same_packages_with_the_same_versions():
    packages = conda()
    assert packages.pop("python") == SpecifierSet(PROJECT["project"]["requires-python"])
    packages.pop("pip")
    assert packages == declared()
    assert CONDA["channels"] == ["conda-forge", "nodefaults"]
    assert CONDA["dependencies"][-1] == {"pip": ["-e ."]}


def imports():
    """Return the modules that the notebooks import, with one notebook for each."""
    found = {}
    for path in ROOT.glob("notebooks/**/*.ipynb"):
        for cell in json.loads(path.read_text(encoding="utf-8"))["cells"]:
            if cell["cell_type"] == "code":
                for node in ast.walk(ast.parse("".join(cell["source"]))):
                    if isinstance(node, ast.Import):
                        found |= {one.name.partition(".")[0]: path.name for one in node.names}
                    elif isinstance(node, ast.ImportFrom):
                        found[node.module.partition(".")[0]] = path.name
    return {name: at for name, at in found.items() if name not in sys.stdlib_module_names}


def test_what_notebooks_import_is_in_the_extra_for_notebooks():
    found, known = imports(), packages_distributions()
    assert found.keys() >= {"numpy", "pymodbus", "sklearn"}
    allowed = set(declared())
    missing = {
        name: at
        for name, at in found.items()
        if name != "shipnet" and allowed.isdisjoint(map(str.lower, known.get(name, ())))
    }
    assert not missing


def test_no_text_advises_to_install_shipnet_by_name():
    """Nobody has registered the name: a stranger could, and the advice would run their code."""
    files = [*ROOT.glob("*.md"), ROOT / "environment.yml"]
    for folder in ("shipnet", "docs", "notebooks", ".github"):
        for suffix in ("py", "pyi", "md", "toml", "yml", "ipynb", "html", "js"):
            files += (ROOT / folder).rglob(f"*.{suffix}")
    advice = re.compile(
        r"shipnet\[\w|\b(?:install|tool run|uvx)\b[^\n]*?[ \"'`]shipnet[ \"'`\\=\n]"
    )
    for path in files:
        for line in path.read_text(encoding="utf-8").splitlines():
            assert "--no-index" in line or not advice.search(line + "\n"), (path, line)


def test_the_lock_satisfies_them_and_is_hashed():
    locked = re.findall(
        r"^([a-z0-9._-]+)==([^ ]+)(?: ; [^\\]+)? \\\n    --hash=sha256:", LOCK, re.M
    )
    assert len(locked) == len(re.findall(r"^[a-z0-9._-]+==", LOCK, re.M)) > 50
    assert "--index" not in LOCK and "://" not in LOCK
    versions = {}
    for name, version in locked:
        versions.setdefault(name, []).append(version)
    for name, specifier in declared().items():
        assert all(specifier.contains(version) for version in versions[name]), name


def test_versions_agree():
    import shipnet

    version = PROJECT["project"]["version"]
    assert shipnet.__version__ == version
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert citation["version"] == version
    assert f"## {version}" in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")


def test_the_repository_has_one_address():
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    address = PROJECT["tool"]["hatch"]["metadata"]["hooks"]["custom"]["repository"]
    assert citation.get("repository-code", "") == address


def test_the_readme_of_an_index_page_has_no_link_that_leads_nowhere():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    whole = distribution.readme(text, "https://forge.example/ships/shipnet/{}/v1.2")
    assert "![A request" in whole
    assert "](https://forge.example/ships/shipnet/raw/v1.2/docs/_static/telegram.png)" in whole
    assert "(https://forge.example/ships/shipnet/blob/v1.2/data/SOURCES.md)" in whole
    for page in (whole, distribution.readme(text, "")):
        assert set(re.findall(r"\]\((\w+:)?", page)) == {"https:"}
    assert "ten lessons of 40" in distribution.readme(text, "")


def test_the_new_names_of_the_upgrade_page_exist():
    import shipnet

    page = (ROOT / "docs" / "upgrade.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (`.*) \| (.*) \|$", page, re.M)
    assert len(rows) > 90
    names = [name for _, new in rows for name in re.findall(r"`([a-z_]+\.[\w.]+)`", new)]
    for name in names:
        whole, _, last = name.rpartition(".")
        parent = attrgetter(whole)(shipnet)
        assert hasattr(parent, last) or last in parent.__dataclass_fields__, name
    assert len(set(names)) > 90
