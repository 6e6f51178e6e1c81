"""The wheel works where no checkout is."""

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import nbformat
import pytest

from shipnet import datasets
from shipnet.papers import ledger

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    folder = tmp_path_factory.mktemp("wheel")
    build = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)]
    subprocess.run(build, cwd=ROOT, check=True, capture_output=True)
    (file,) = folder.glob("*.whl")
    return file


def test_wheel_holds_package_and_data_and_nothing_else(wheel):
    names = [name for name in zipfile.ZipFile(wheel).namelist() if ".dist-info/" not in name]
    assert {name.split("/")[0] for name in names} == {"shipnet"}
    assert {f"shipnet/data/{name}" for name in datasets.names()} <= set(names)
    code = {path.relative_to(ROOT).as_posix() for path in (ROOT / "shipnet").rglob("*.py*")}
    assert {path for path in code if "__pycache__" not in path} <= set(names)
    others = "shipnet.mplstyle py.typed data/SOURCES.md design/report.css"
    tools = "tools/bench.js tools/page.css tools/pages.toml"
    assert {f"shipnet/{name}" for name in f"{others} {tools}".split()} <= set(names)
    assert not any("__pycache__" in name for name in names)


@pytest.fixture(scope="module")
def target(wheel, tmp_path_factory):
    """Return a folder in which the wheel is installed."""
    folder = tmp_path_factory.mktemp("site")
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-index"]
    subprocess.run([*pip, "--target", str(folder), str(wheel)], check=True, capture_output=True)
    return folder


def test_wheel_runs_the_ledger_from_another_folder(target, tmp_path):
    elsewhere = tmp_path
    run = [sys.executable, "-c", "import shipnet; print(shipnet.__file__)"]
    environment = {**os.environ, "PYTHONPATH": str(target)}
    where = subprocess.check_output(run, cwd=elsewhere, env=environment, text=True)
    assert Path(where.strip()).is_relative_to(target)
    command = [sys.executable, "-m", "shipnet", "ledger", "kim2014", "--summary"]
    out = subprocess.check_output(command, cwd=elsewhere, env=environment, text=True)
    assert out.strip() == ledger("kim2014").counts().to_string().strip()


def test_a_student_gets_every_notebook_and_data_file_from_the_wheel(target, tmp_path, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", str(target))
    command = [sys.executable, "-m", "shipnet", "copy", "course"]
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True)
    course = tmp_path / "course"
    copied = {path.relative_to(course) for path in course.rglob("*.*")}
    tracked = subprocess.check_output(["git", "ls-files", "notebooks", "data"], cwd=ROOT, text=True)
    expected = {
        Path(name) for name in tracked.split() if name.endswith(".ipynb") or "data/" in name
    }
    assert copied == {path for path in expected if "solutions" not in path.parts}
    again = subprocess.run(command, cwd=tmp_path, check=False, capture_output=True, text=True)
    assert (again.returncode, "new or empty" in again.stderr) == (2, True)
    lesson = course / "notebooks" / "lessons" / "01_bits.ipynb"
    notebook = nbformat.read(lesson, as_version=4)
    notebook.cells.append(nbformat.v4.new_code_cell("import shipnet; shipnet.__file__"))
    nbformat.write(notebook, lesson)
    # Kernels of the tests' own process are forks that have imported the checkout's package.
    execute = [sys.executable, "-c", "from nbclient.cli import main; main()", "--inplace", lesson]
    subprocess.run(execute, check=True, capture_output=True)
    done = nbformat.read(lesson, as_version=4)
    assert str(target) in done.cells[-1].outputs[0]["data"]["text/plain"]
