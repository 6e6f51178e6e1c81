"""The public API of each package: its size, its documentation, what it loads."""

import ast
import importlib
import inspect
import pkgutil
import types
from pathlib import Path

import pytest
from numpydoc.docscrape import ClassDoc, FunctionDoc

import shipnet

ROOT = Path(__file__).resolve().parents[1] / "shipnet"
#: Packages with a public API.
FRONTS = sorted(path.parent.name for path in ROOT.glob("*/__init__.pyi"))


def stub(package):
    """Return what a package's stub imports: name -> defining module; a namespace has none."""
    found = {}
    for node in ast.parse((ROOT / package / "__init__.pyi").read_text("utf-8")).body:
        if isinstance(node, ast.ImportFrom) and node.level == 1:
            for alias in node.names:
                assert alias.asname == alias.name, f"{package}: write `{alias.name} as` the same"
                found[alias.name] = node.module
    return found


def front(package):
    return importlib.import_module(f"shipnet.{package}")


def public(package):
    """Yield (name, object) of a public API, and of the namespaces in it."""
    for name in sorted(stub(package)):
        value = getattr(front(package), name)
        if isinstance(value, types.ModuleType):
            yield from ((f"{name}.{inner}", getattr(value, inner)) for inner in value.__all__)
        else:
            yield name, value


def documented():
    for package in FRONTS:
        for name, value in public(package):
            if package == "papers" and "." in name:
                continue  # what the papers' notebooks share needs one or two sentences
            if inspect.isclass(value) or inspect.isfunction(value):
                yield pytest.param(value, id=f"{package}.{name}")


@pytest.mark.parametrize("package", FRONTS)
def test_a_front_has_few_names_and_shows_them(package):
    names = stub(package)
    assert len(names) <= 40
    assert dir(front(package)) == sorted(names) == sorted(front(package).__all__)
    assert front(package).__doc__


@pytest.mark.parametrize("package", FRONTS)
def test_no_public_name_equals_a_module(package):
    modules = {module.name for module in pkgutil.iter_modules([str(ROOT / package)])}
    namespaces = {name for name, module in stub(package).items() if module is None}
    assert set(stub(package)) & modules == namespaces


@pytest.mark.parametrize("value", list(documented()))
def test_a_public_name_is_documented_in_full(value):
    doc = (ClassDoc if inspect.isclass(value) else FunctionDoc)(value)
    assert doc["Summary"]
    assert doc["Examples"] or (inspect.isclass(value) and issubclass(value, Exception))
    entries = [*doc["Parameters"], *doc.get("Other Parameters", [])]
    listed = [name.strip(" *") for entry in entries for name in entry.name.split(",")]
    if inspect.isfunction(value):
        assert listed == list(inspect.signature(value).parameters)
        assert doc["Returns"] or doc["Yields"] or value.__annotations__.get("return") == "None"
    elif entries:
        wanted = [n for n in inspect.signature(value).parameters if not n.startswith("_")]
        assert set(listed) <= set(wanted), "documents a parameter that does not exist"
        assert set(wanted) <= set(listed), "leaves out a parameter"


def test_the_package_shows_its_packages():
    packages = {path.parent.name for path in ROOT.glob("*/__init__.py")}
    assert packages <= set(dir(shipnet))
    assert {"datasets", "errors", "style"} <= set(dir(shipnet))


NAMESPACES = ["crc", "datasets", "errors", "style"] + [
    f"{package}.{name}"
    for package in FRONTS
    for name in stub(package)
    if package != "papers"
    if inspect.ismodule(getattr(front(package), name))
]


@pytest.mark.parametrize("name", NAMESPACES)
def test_completion_shows_only_names_of_the_public_api(name):
    module = importlib.import_module(f"shipnet.{name}")
    assert sorted(module.__all__) == dir(module)
