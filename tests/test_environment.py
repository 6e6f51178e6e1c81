"""environment.yml, pyproject.toml and requirements.lock name the same packages."""

import re
import tomllib
from pathlib import Path

import yaml
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet

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


def test_the_lock_satisfies_them_and_is_hashed():
    locked = re.findall(
        r"^([a-z0-9._-]+)==([^ ]+)(?: ; [^\\]+)? \\\n    --hash=sha256:", LOCK, re.M
    )
    assert len(locked) == len(re.findall(r"^[a-z0-9._-]+==", LOCK, re.M)) > 50
    versions = {}
    for name, version in locked:
        versions.setdefault(name, []).append(version)
    for name, specifier in declared().items():
        assert all(specifier.contains(version) for version in versions[name]), name


def test_the_lock_names_no_index():
    assert "--index" not in LOCK
    assert "://" not in LOCK


def test_versions_agree():
    import shipnet

    version = PROJECT["project"]["version"]
    assert shipnet.__version__ == version
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert citation["version"] == version
    assert f"## {version}" in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
