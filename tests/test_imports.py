import ast
import subprocess
import sys

import pytest

from shipnet import tools

HEAVY = [
    "dask",
    "distributed",
    "ipywidgets",
    "loky",
    "matplotlib",
    "networkx",
    "numpy",
    "pandas",
    "pyarrow",
    "pymodbus",
    "scipy",
    "scipy.optimize",
    "skfuzzy",
]
#: What every page draws and moves with.
PAGE = ["ipywidgets", "matplotlib", "numpy"]


def loaded(statement):
    program = f"{statement}; import sys; print([m for m in {HEAVY} if m in sys.modules])"
    return ast.literal_eval(subprocess.check_output([sys.executable, "-c", program], text=True))


@pytest.mark.parametrize(
    ("statement", "modules"),
    [
        ("import shipnet", []),
        ("import shipnet.errors", []),
        ("import shipnet.datasets", []),
        ("import shipnet.style", []),
        ("import shipnet.tables", []),
        ("import shipnet.asi", []),
        ("import shipnet.asi.plan_file, shipnet.asi.rules", ["numpy"]),
        ("import shipnet.line", []),
        ("import shipnet.design", []),
        ("import shipnet.__main__", []),
        (
            "from shipnet.__main__ import main; main('serve ballast --port 65536'.split())",
            [],
        ),
        ("import shipnet.asi.simulation", ["numpy"]),
        ("import shipnet.can", []),
        ("from shipnet.can import Frame, response_times, simulate, read_messages", ["numpy"]),
        ("import shipnet.modbus", []),
        ("from shipnet.modbus import Request, Poll, serve, udp", ["numpy"]),
        ("import shipnet.engine", []),
        ("import shipnet.engine.serving, shipnet.engine.class_rules", ["numpy"]),
        (
            "from shipnet import engine; engine.simulate(engine.System(), until=2)",
            ["numpy"],
        ),
        ("import shipnet.remote_control", []),
        ("from shipnet.remote_control import faults", []),
        ("from shipnet.remote_control import simulate, recommend", ["numpy"]),
        ("import shipnet.fuzzy", []),
        ("import shipnet.ballast", []),
        ("import shipnet.papers", []),
        ("import shipnet.exercises", []),
    ],
)
def test_an_entry_point_loads_no_more_than_it_needs(statement, modules):
    assert loaded(statement) == modules


@pytest.mark.parametrize(
    ("tool", "more"),
    [
        ("AsiLine", []),
        ("AsiNetwork", ["pandas"]),
        ("CanLoad", ["pandas"]),
        ("EngineFaults", ["pandas"]),
        ("ModbusScan", ["pandas"]),
        ("ReceiveRing", []),
        ("ShipDesign", ["pandas", "scipy", "scipy.optimize"]),
        ("ValveClient", ["pandas"]),
        ("ValveDiagnosis", []),
    ],
)
def test_the_first_picture_of_a_tool_loads_no_more_than_it_needs(tool, more):
    page = f"from shipnet import tools; tools.{tool}().explore().close()"
    # pandas takes pyarrow along where it is installed.
    assert [name for name in loaded(page) if name != "pyarrow"] == PAGE + more


def test_every_tool_is_listed():
    (mark,) = test_the_first_picture_of_a_tool_loads_no_more_than_it_needs.pytestmark
    listed = [tool for tool, _ in mark.args[1]]
    assert listed == [name for name in dir(tools) if isinstance(getattr(tools, name), type)]
