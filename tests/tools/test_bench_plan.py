"""Plans that the AS-i bench opens from a file, and those that it refuses."""

from dataclasses import replace

import numpy as np
import pytest

from shipnet import asi, datasets
from shipnet.errors import InputError
from shipnet.tools._bench_plan import open_plan
from shipnet.tools.asi_bench import AsiBench
from tests.tools.test_tools_page import load

SUPPLY = asi.Supply("0 m")


def opened(plan, tmp_path, name="plan.csv"):
    plan.save(tmp_path / name)
    return open_plan(AsiBench(data=9), name, (tmp_path / name).read_bytes())


def judged(plan):
    """Return the values of each rule, without the names of the objects."""
    table = plan.check().table()
    return {rule: np.sort(rows["value"].to_numpy(float)) for rule, rows in table.groupby("rule")}


def plan_of(*cables, slaves, master="0 m", **others):
    runs = [asi.CableRun(f"{a} m", f"{b} m", abs(b - a)) for a, b in cables]
    slaves = [asi.Slave(f"{n}", node=node) for n, node in enumerate(slaves, 1)]
    masters = [asi.Master(node=master)]
    return asi.Plan(runs, masters, [SUPPLY], slaves, **others)


PLANS = {
    "line": asi.line(100, 31),
    "one slave": asi.line(7, [7]),
    "resistor": asi.line(180, [5, 100], terminator=100),
    "star": asi.star(90, [2.5] * 4),
    "ring": asi.ring(100, 62),
    "master amid": plan_of((0, 40), (40, 90), slaves=["0 m", "90 m"], master="40 m"),
    "plug": replace(asi.line(150, [20, 150]), terminators=[asi.Terminator("150 m")]),
    "300 m": asi.read_plan(datasets.path("synthetic_asi_plan_300m.csv")),
}


@pytest.mark.parametrize("name", PLANS)
def test_the_rules_judge_the_drawing_as_the_plan(name, tmp_path):
    plan = PLANS[name]
    drawn, remarks = opened(plan, tmp_path)
    ours, theirs = judged(drawn.plan), judged(plan)
    assert set(ours) == set(theirs) and drawn.data == 9
    for rule, values in theirs.items():
        # Places are rounded to the centimetre.
        assert ours[rule] == pytest.approx(values, rel=2e-3, abs=2e-3, nan_ok=True), rule
    assert [remark for remark in remarks if "profile" not in remark] == []
    assert drawn.plan.cycle.time == plan.cycle.time


def test_what_the_bench_draws_with_its_own_values_is_counted(tmp_path):
    ballast = datasets.path("synthetic_asi_plan_ballast.csv")
    drawn, remarks = open_plan(AsiBench(), "ballast.csv", ballast.read_bytes())
    assert "master (1), supply (1), slave (6); slaves draw 120 mA" in remarks[-1]
    assert drawn.current_ma == 120 and drawn.pairs == 1
    assert [one for one in drawn.devices if "slave" in one][-2:] == ["slave@70"] * 2
    assert opened(PLANS["line"], tmp_path)[1] == []
    assert "decimetre" in opened(asi.line(99.96, [5, 99.96]), tmp_path)[1][0]


def test_a_repeater_parts_the_devices_at_its_ends_and_addresses_order_the_slaves(tmp_path):
    drawn, _ = opened(PLANS["300 m"], tmp_path)
    assert [sum("supply" in one for one in drawn.devices), *drawn.cuts] == [3, 100, 200]
    assert [len(segment.supplies) for segment in drawn.plan.segments] == [1, 1, 1]
    mixed = asi.line(90, [30, 60, 90])
    labels = ["4B", "9", "4A"]
    slaves = [replace(one, label=label) for one, label in zip(mixed.slaves, labels, strict=True)]
    drawn, _ = opened(replace(mixed, slaves=slaves), tmp_path)
    assert drawn.devices[3:] == ("slave@60", "slave@90", "slave@30") and drawn.pairs == 1
    assert [slave.label for slave in drawn.plan.slaves] == ["1", "2A", "2B"]


@pytest.mark.parametrize(
    ("plan", "why"),
    [
        (asi.read_plan(datasets.path("synthetic_asi_plan_submarine.csv")), "14 masters and 14"),
        (replace(PLANS["line"], masters=[]), "it has 0 masters and 1 lines"),
        (plan_of((0, 40), (40, 60), (40, 70), slaves=["60 m", "60 m", "70 m", "70 m"]), "at 40 m"),
        (asi.line(100, [50], cable="as-i 2.5"), "its cables must all be of one type: nominal"),
        (asi.line(600, [50]), "length is 600 m"),
        (plan_of((0, 40), slaves=[]), "number of devices of kind slave is 0"),
        (replace(PLANS["line"], slaves=PLANS["line"].slaves * 2), "have the same address"),
        (plan_of((0, 40), (0, 60), (0, 200), slaves=["40 m", "60 m", "200 m"]), "spur"),
    ],
)
def test_a_plan_that_the_bench_cannot_draw_is_refused_with_the_reason(plan, why, tmp_path):
    with pytest.raises(InputError, match=r"^mine.csv: the bench cannot draw this plan: ") as fault:
        opened(plan, tmp_path, "mine.csv")
    assert why in str(fault.value)


def test_a_file_that_is_no_plan_is_refused_by_the_reader_and_the_page_stays():
    with pytest.raises(InputError, match=r"own\.csv: row 2, column length_m"):
        open_plan(AsiBench(), "own.csv", b"kind,node\ncable,x\n")
    page = AsiBench().explore()
    shown = page.text
    for name, content in (("no.csv", b"\x89PNG"), ("own.csv", b"kind,node\ncable,x\n")):
        load(page.uploads["open a plan"], content, name)
        assert page.note.startswith(name) and page.text == shown
    file = datasets.path("synthetic_asi_plan_ballast.csv")
    load(page.uploads["open a plan"], file.read_bytes(), "ballast.csv")
    assert "63 checks" in page.text and page.inputs.length == 70
    assert "ballast.csv is loaded<br>" in page._noted.value and "(6)" in page._noted.value


def test_the_bench_is_used_in_ship_design():
    uses = AsiBench(length=140, current_ma=80)._view().uses
    assert uses == {"ship_design": {"own": "[asi]\ncurrent = 0.08\nlength = 140\n"}}
    from shipnet.tools import ShipDesign

    settings = ShipDesign(**uses["ship_design"])._settings()
    assert settings["asi.length"] == 140 and settings["asi.current"] == 0.08
