"""Every public name says what it takes, gives and raises, with an example that runs."""

import importlib
import inspect
import pkgutil
from pathlib import Path

import pytest
from numpydoc.docscrape import FunctionDoc

import shipnet

ROOT = Path(__file__).resolve().parents[1]
# What is drawn, decorated or run as a program is shown by its tests, not by a doctest.
NO_EXAMPLE = ("shipnet.__main__", "shipnet.design.command", "shipnet.papers.registry", ".plot")


def modules():
    yield "shipnet"
    for module in pkgutil.walk_packages(shipnet.__path__, "shipnet."):
        yield module.name


def functions():
    for name in modules():
        module = importlib.import_module(name)
        for public in module.__all__:
            value = getattr(module, public)
            if inspect.isfunction(value) and value.__module__ == name:
                yield pytest.param(value, id=f"{name}.{public}")


@pytest.mark.parametrize("name", list(modules()))
def test_a_module_says_what_it_is_and_what_it_offers(name):
    module = importlib.import_module(name)
    assert module.__doc__
    assert all(hasattr(module, public) for public in module.__all__)


@pytest.mark.parametrize("function", list(functions()))
def test_a_function_documents_its_interface(function):
    doc = FunctionDoc(function)
    signature = inspect.signature(function)
    documented = [name.strip(" *") for entry in doc["Parameters"] for name in entry.name.split(",")]
    assert documented == list(signature.parameters)
    assert doc["Returns"] or signature.return_annotation in (None, "None")
    assert doc["Examples"] or function.__module__.endswith(NO_EXAMPLE)


def test_no_file_is_longer_than_one_idea():
    files = (ROOT / "shipnet").rglob("*.py")
    assert [file.name for file in files if len(file.read_text("utf-8").splitlines()) > 400] == []
