import ast
import os
import subprocess
import sys
from pathlib import Path

import pytest

import shipnet
from shipnet import tools

#: Modules that an engineer does not want to wait for.
HEAVY = (
    "dask distributed ipywidgets loky matplotlib networkx numba numpy pandas pyarrow pymodbus "
    "scipy scipy.optimize skfuzzy tqdm"
).split()
#: What every page draws and moves with.
PAGE = ["ipywidgets", "matplotlib", "numpy"]


FRONTS = sorted(path.parent.name for path in Path(shipnet.__file__).parent.glob("*/__init__.pyi"))


def loaded(statement):
    program = f"{statement}; import sys; print([m for m in {HEAVY} if m in sys.modules])"
    return ast.literal_eval(subprocess.check_output([sys.executable, "-c", program], text=True))


@pytest.mark.parametrize(
    ("statement", "modules"),
    [
        (f"import shipnet, {', '.join(f'shipnet.{name}' for name in FRONTS)}", []),
        ("import shipnet.errors, shipnet.datasets, shipnet.style, shipnet.tables", []),
        ("import shipnet.asi.plan_file, shipnet.asi.rules", ["numpy"]),
        ("import shipnet.__main__", []),
        ("from shipnet.__main__ import main; main('serve ballast --port 65536'.split())", []),
        ("import shipnet.asi.simulation", ["numpy"]),
        ("from shipnet.can import Frame, response_times, simulate, read_messages", ["numpy"]),
        ("from shipnet.modbus import Request, Poll, serve, udp", ["numpy"]),
        ("import shipnet.engine.serving, shipnet.engine.class_rules", ["numpy"]),
        ("from shipnet import engine; engine.simulate(engine.System(), until=2)", ["numpy"]),
        ("from shipnet.remote_control import faults", []),
        ("from shipnet.remote_control import simulate, recommend", ["numpy"]),
    ],
)
def test_an_entry_point_loads_no_more_than_it_needs(statement, modules):
    assert loaded(statement) == modules


#: What the page of each tool loads beside that.
MORE = {
    "AsiBench": ["numba", "pandas", "scipy"],
    "CanLoad": ["pandas"],
    "EngineFaults": ["pandas"],
    "ModbusScan": ["pandas"],
    "ReceiveRing": [],
    "ShipDesign": ["numba", "pandas", "scipy", "scipy.optimize"],
    "ValveClient": ["pandas"],
    "ValveDiagnosis": [],
}

#: Loads what all pages share, and opens each page in a fork of that.
PAGES = f"""
import os, sys
from shipnet.tools import _page
print([m for m in {HEAVY} if m in sys.modules], flush=True)
for tool in {[*MORE]}:
    if not os.fork():
        from shipnet import tools
        getattr(tools, tool)().explore().close()
        print([m for m in {HEAVY} if m in sys.modules], flush=True)
        os._exit(0)
    assert os.wait()[1] == 0
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system cannot fork")
def test_the_first_picture_of_a_tool_loads_no_more_than_it_needs():
    said = subprocess.check_output([sys.executable, "-c", PAGES], text=True)
    # pandas takes pyarrow along where it is installed.
    shared, *tools = (
        [m for m in ast.literal_eval(line) if m != "pyarrow"] for line in said.splitlines()
    )
    assert shared == PAGE
    assert dict(zip(MORE, tools, strict=True)) == {
        name: sorted(PAGE + more) for name, more in MORE.items()
    }


def test_every_tool_is_listed():
    shown = [name for name in dir(tools) if hasattr(getattr(tools, name), "explore")]
    assert list(MORE) == shown
