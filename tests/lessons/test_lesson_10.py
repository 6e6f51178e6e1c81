"""Lesson 10: its right answers, and what its text says, by a second route."""

from functools import cache

import pytest

from shipnet import datasets
from shipnet.design.comparison import compare
from shipnet.design.costs import tornado
from shipnet.design.iolist import IoList, read_iolist
from shipnet.design.layout import Site
from shipnet.design.planning import plan
from shipnet.design.plant import Plant
from shipnet.design.settings import Settings
from tests.lessons.students import NAMED, right, solved


@cache
def ballast():
    points = read_iolist(datasets.path("synthetic_iolist_ship.csv")).points
    return IoList.from_table(points[points["system"] == "Ballast valve"].reset_index(drop=True))


@cache
def design(option, repeaters=2, tree=True):
    settings = Settings({"asi.repeaters": repeaters, "asi.tree": tree, "spare": 0})
    site = Site((20, -6, 14), tails=2.0)
    return plan(ballast(), site, option, settings=settings, name=f"{option} {repeaters}")


@NAMED
def test_what_is_left_is_counted_wire_by_wire(name):
    numbers, left = right("ex-10-1", name)
    plant = Plant(modules=numbers["contacts"], contacts=1, lines=numbers["lines"])
    wires = [
        runs.loc[runs["at_cabinet"], "conductors"].sum()
        for runs in (plant.on_asi.cables, plant.hardwired.cables)
    ]
    assert left == pytest.approx(100 * wires[0] / wires[1])


@NAMED
def test_a_saving_adds_up_from_its_parts(name):
    numbers, saved = right("ex-10-2", name)
    plant = Plant(contacts=2, spacing=4, **numbers)
    parts = ["cable_cost_eur", "labour_cost_eur", "hardware_cost_eur"]
    wired, bus = (
        sum(each.quantities()[part] for part in parts) for each in (plant.hardwired, plant.on_asi)
    )
    assert saved == pytest.approx(100 * (wired - bus) / wired)


@pytest.mark.parametrize(("modules", "spacing"), [(4, 1), (4, 2), (8, 1), (8, 2)])
def test_at_the_break_even_distance_both_designs_cost_the_same(modules, spacing):
    place = solved("ex-10-3", modules=modules, spacing=spacing).value
    plant = Plant(modules=modules, contacts=2, distance=place, spacing=spacing)
    wired, bus = (each.quantities()["total_cost_eur"] for each in (plant.hardwired, plant.on_asi))
    assert bus == pytest.approx(wired, rel=1e-9)
    assert 10 < place < 50
    assert "repeater" not in set(plant.on_asi.devices["kind"])  # else the lines would jump


def test_the_choice_meets_the_limit_and_no_cheaper_plan_does():
    function = solved("ex-10-4")
    chosen = [function.value(*case) for case in function.cases]
    assert chosen == ["CAN", "AS-i", "home runs", "AS-i", "junction boxes", "none", "CAN"]
    for (options, limit), name in zip(function.cases, chosen, strict=True):
        ranked = sorted(options, key=lambda option: options[option][0])
        kept = [o for o in ranked if options[o][1] <= limit and options[o][2] == 0]
        assert name == (kept or ["none"])[0]


def test_the_options_of_exercise_4_are_those_of_the_plans():
    long, short = (function_case[0] for function_case in solved("ex-10-4").cases[-2:])
    for row, planned in (
        (long["AS-i"], design("AS-i")),
        (long["home runs"], design("home runs")),
        (short["AS-i without repeaters"], design("AS-i", 0)),
    ):
        assert row[0] == pytest.approx(planned.quantities()["total_cost_eur"], abs=51)
        assert row[2] == len(ballast()) - planned.points["fits"].sum()


def test_the_defended_choice_of_the_lesson_holds():
    short, boxes = design("AS-i", 1, tree=False), design("junction boxes")
    both = compare([short, boxes])
    table = both.table().loc[[short.name, boxes.name]]
    assert table["points_left_out"].tolist() == [0, 0]
    assert table["lost_by_failure"].tolist() == [40, 60]
    assert (table["total_cost_eur"] / 1e3).round().tolist() == [48, 67]
    kept = table[["rules_met", "rules_violated", "rules_not_verified"]].iloc[0]
    assert kept.tolist() == [4, 0, 11]
    # A line is lost with its master.
    assert sorted(short.segments["points"]) == [10, 10, 20, 40, 40]
    # 40 points are 8 whole valves, whichever of the worst failures it is.
    cuts = short.failures()
    worst = cuts[(cuts["kind"] != "cabinet") & (cuts["points_lost"] == 40)]
    assert len(worst) > 1
    assert {len({tag.partition("-")[0] for tag in tags}) for tags in worst["tags"]} == {8}
    assert not tornado(both.designs).every["order changes"].any()
    # What speaks against it: single cables, and two rules that nobody read.
    assert table["lost_by_cable"].tolist() == [40, 10]
    rules = short.check().table()
    failing = rules["why"].str.startswith("would be violated")
    assert set(rules["rule"][failing]) == {"network", "supply changes over"}
    assert table["labour_h"].round().tolist() == [421, 582]
