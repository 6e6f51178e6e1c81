"""The wheel works where no checkout is."""

import os
import subprocess
import sys
import zipfile
from pathlib import Path

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


def test_wheel_runs_the_ledger_from_another_folder(wheel, tmp_path):
    target, elsewhere = tmp_path / "site", tmp_path / "elsewhere"
    elsewhere.mkdir()
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-index"]
    subprocess.run([*pip, "--target", str(target), str(wheel)], check=True, capture_output=True)
    run = [sys.executable, "-c", "import shipnet; print(shipnet.__file__)"]
    environment = {**os.environ, "PYTHONPATH": str(target)}
    where = subprocess.check_output(run, cwd=elsewhere, env=environment, text=True)
    assert Path(where.strip()).is_relative_to(target)
    command = [sys.executable, "-m", "shipnet", "ledger", "kim2014", "--summary"]
    out = subprocess.check_output(command, cwd=elsewhere, env=environment, text=True)
    assert out.strip() == ledger("kim2014").counts().to_string().strip()
