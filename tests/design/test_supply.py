"""Voltages and currents of supplies and devices, compared with the cable solver and by hand."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st

from shipnet.design.catalogue import Range, cables, read_assumptions
from shipnet.design.costs import bill_table
from shipnet.design.layout import Site
from shipnet.design.planning import OPTIONS, plan
from shipnet.design.rules import Rule, RuleSet
from shipnet.design.settings import Settings
from shipnet.design.supply import LOADS, feeders_of, supply_tables
from shipnet.errors import ArgumentError
from shipnet.line.cable import Cable
from shipnet.line.network import CableRun, Network
from shipnet.signals import SIGNALS
from tests.design.lists import lists, ship, small_loop, table

SITE = Site((0.0, 0.0, 0.0))


def solved(design):
    """Return the voltage at every device that a feeder reaches, from the cable solver."""
    settings = design.settings
    supplies = design.devices[design.devices["kind"].isin(["supply", "auxiliary supply"])]
    feeders = design.cables[design.cables["kind"] == "feeder"]
    feeders = feeders[(feeders["a"] != "cabinet") & (feeders["b"] != "cabinet")]
    amps = (
        design.iolist.points["signal"]
        .map({name: settings[f"supply.{kind}"] for name, kind in LOADS.items()})
        .fillna(0)
    )
    coil = design.iolist.points["type"] == "DO"
    amps[coil] *= settings["supply.simultaneity"]
    asi = design.points["bus"] == "AS-i"
    amps[asi & ~coil] = 0
    drops = design.cables[design.cables["kind"] == "drop"]
    load = amps.set_axis(design.points["tag"])[drops["b"]].groupby(drops["a"].to_numpy()).sum()
    station = design.devices.loc[design.devices["kind"] == "station", "device"]
    load = load.add(pd.Series(settings["supply.station"], station), fill_value=0)
    voltages = {}
    for supply in supplies["device"]:
        reached, spurs = {supply}, {}
        line = feeders[feeders["line"].isin(feeders.loc[feeders["a"] == supply, "line"])]
        while new := [r for r in line.itertuples() if r.a in reached and r.run not in spurs]:
            for run in new:
                wire = Cable(cables()[run.cable].resistance, 1e-6, 1e-10)
                spurs[run.run] = CableRun(run.a, run.b, run.length_m, wire)
                reached.add(run.b)
        if spurs:
            draws = {node: float(load.get(node, 0.0)) for node in reached - {supply}}
            network = Network(spurs.values())
            point = network.operating_point(supply, settings["supply.voltage"], draws)
            voltages |= {(supply, node): volts for node, volts in point.items()}
    return voltages


@hypothesis_settings(max_examples=20)
@given(lists(), st.sampled_from(OPTIONS[2:]))
def test_the_voltages_agree_with_the_cable_solver(iolist, option):
    design = plan(iolist, SITE, option)
    expected = solved(design)
    table = supply_tables(design)[1]
    lines = table[table["segment"].str.startswith("AS-i") & ~table["supply"].str.contains("aux")]
    got = table.drop(lines.index).set_index(["supply", "device"])["voltage_v"]
    assert set(got.index) == {key for key in expected if key[0] != key[1]}
    for key, volts in got.items():
        assert volts == pytest.approx(expected[key], abs=1e-9)


@pytest.mark.parametrize("loop", [0.022, 0.03])
@pytest.mark.parametrize("option", ["AS-i", "AS-i doubled"])
def test_an_as_i_line_has_the_voltages_of_its_plan(loop, option):
    # The planner solved each line with repeaters and supplies; here the tables are solved.
    design = plan(ship(400), SITE, option, settings=Settings({"supply.loop": loop}))
    supplies = supply_tables(design)[0].query("kind == 'supply'")
    line = supplies["supply"].map(design.devices.set_index("device")["line"])
    lines = supplies.groupby([line, "segment"])[["lowest_v", "current_a"]]
    computed = lines.agg({"lowest_v": "min", "current_a": "max"})
    assert (design.devices["kind"] == "repeater").sum() > 5
    assert set(line) == ({"A", "B"} if option == "AS-i doubled" else {""})
    expected = design.segments.set_index("segment")[["lowest_v", "supply_current_a"]]
    for name in set(line):
        values = computed.loc[name].loc[expected.index].to_numpy()
        assert values == pytest.approx(expected.to_numpy(), abs=1e-9)


def test_a_chain_by_hand():
    # Two stations: the first draws 0.5 + 0.022 A, the second 0.5 + 0.6 x 0.25 A; a shorted
    # channel adds 1.7 A.
    iolist = table([("current_loop", (40, 0, 0), 1000), ("solenoid", (100, 0, 0), 1000)])
    site = Site((0.0, 0.0, 0.0), detour=1.0, tails=0.0)
    # With 1.5 mm2 (26 ohm/km), the drop would be 8.6 V; 2.5 mm2 has 15.96 ohm/km.
    assert 40 * 26e-3 * (1.172 + 1.7) + 60 * 26e-3 * (0.65 + 1.7) > 6
    first = 24 - 40 * 15.96e-3 * (0.522 + 0.65)
    second = first - 60 * 15.96e-3 * 0.65
    design = plan(iolist, site, "CAN")
    got = supply_tables(design)[1].set_index("device")
    assert got["voltage_v"].tolist() == pytest.approx([first, second], abs=1e-12)
    assert got["current_a"].tolist() == pytest.approx([1.172, 0.65])
    assert got["load_a"].tolist() == pytest.approx([0.522, 0.65])
    assert got["shorted_v"].iloc[1] == pytest.approx(second - 100 * 15.96e-3 * 1.7)
    (supply,) = supply_tables(design)[0].to_dict("records")
    assert supply["worst_device"] == "CAN box 2" and supply["devices"] == 2
    assert (supply["current_a"], supply["drop_v"]) == pytest.approx((1.172, 24 - second))
    assert supply["cross_section_mm2"] == 2.5 and supply["length_m"] == 100


def test_a_long_chain_of_stations_has_supplies_along_it():
    # A station with coils every 23 m: with 1.5 mm2 from one supply, the voltage of the last one
    # would be far below zero.
    rows = [("solenoid", (23 * (n // 8), 0, 0), 1000) for n in range(8, 8 * 32)]
    design = plan(table(rows), SITE, "CAN", settings=Settings({"boxes.points": 8}))
    assert design.fits and len(design.segments) == 1
    devices, (segment,) = design.devices, design.segments["segment"]
    assert design.check("supply").ok
    idle = {f"supply.{name}": 0 for name in ("solenoid", "station", "short")}
    once = plan(table(rows), SITE, "CAN", settings=Settings({"boxes.points": 8, **idle}))
    (bare,) = supply_tables(once.priced(Settings({"boxes.points": 8})))[0].to_dict("records")
    assert bare["lowest_v"] < -100 and bare["length_m"] > 700 and bare["cross_section_mm2"] == 1.5
    # Each further supply has mains from the cabinet and a cable to its station, all counted.
    supplies = supply_tables(design)[0]
    assert len(supplies) > 1 and (supplies["lowest_v"] >= 18).all()
    assert (supplies["current_a"] + 1.7 <= 20).all()
    moved = supplies[supplies["at"] != "cabinet"]
    mains = design.cables[(design.cables["kind"] == "feeder") & (design.cables["a"] == "cabinet")]
    assert sorted(mains["b"]) == sorted(moved["supply"]) and mains["at_cabinet"].all()
    bill = bill_table(design).set_index("item")
    assert bill.loc["supply", "number"] == len(supplies)
    feeders = design.cables[design.cables["kind"] == "feeder"].groupby("cable")["length_m"].sum()
    for cable, metres in feeders.items():
        assert bill.loc[cable, "number"] >= metres
    assert set(supply_tables(design)[1]["device"]) == set(
        devices.loc[devices["kind"] == "station", "device"]
    )
    local = plan(table(rows), SITE, "CAN", settings=Settings({"boxes.points": 8, "fed": False}))
    assert segment and len(supply_tables(local)[0]) == 0


@pytest.mark.parametrize("option", OPTIONS[2:])
def test_feeders_are_as_thin_as_the_limits_allow(option):
    design = plan(ship(150), SITE, option)
    sizes = feeders_of("MI1P150")
    limits, table = design.settings.supply, supply_tables(design)[1]
    table = table.join(design.cables.set_index("run")["cable"], on="run")
    table = table[table["cable"].isin([size.id for size in sizes])]
    assert len(table) > 5
    for _, tree in table.groupby("supply"):
        (cable,) = set(tree["cable"])
        assert (tree["shorted_v"] >= tree["needed_v"] - 1e-9).all()
        assert (tree["current_a"] + limits.short <= cables()[cable].current).all()
        index = [size.id for size in sizes].index(cable)
        if index == 0:
            continue
        thinner, lost = sizes[index - 1], 24 - tree["shorted_v"]
        spur = tree["voltage_v"] - tree["lowest_v"]
        lost = spur + (lost - spur) * thinner.resistance / sizes[index].resistance
        late = tree["current_a"] + limits.short > thinner.current
        assert (lost > limits.drop * limits.voltage + 1e-9).any() or late.any()


@pytest.mark.parametrize("option", ["CAN", "Modbus RTU", "AS-i"])
def test_thicker_feeders_and_more_supplies_are_weighed_by_price(option, monkeypatch):
    # The costs are those of the bill, which does not depend on how the planner chooses.
    def planned(price):
        assumptions = read_assumptions()
        priced = replace(assumptions["supply"], range=Range(price, price, price))
        monkeypatch.setattr(
            "shipnet.design.supply.read_assumptions", lambda: {**assumptions, "supply": priced}
        )
        design = plan(ship(400), SITE, option)
        assert design.check("supply").table().set_index("rule")["verdict"]["voltage"] == "met"
        kind = "auxiliary supply" if option == "AS-i" else "supply"
        out = (design.devices["kind"] == kind) & (design.devices["at"] != "cabinet")
        return design.quantities()["total_cost_eur"], out.sum()

    nominal = read_assumptions()["supply"].range.nominal
    (cost, out), (dear, fewest), (free, most) = map(planned, (nominal, 1e6, 0.0))
    assert fewest <= out <= most and fewest < most
    # A supply moved out of the cabinet counts as an additional one.
    assert cost < dear and cost <= free + nominal * out


@pytest.mark.parametrize("option", ["CAN", "Modbus RTU"])
def test_a_second_feed_from_the_far_end_would_cost_more(option):
    """No plan has one, because a cable back costs more than a thicker cable or a nearer supply."""
    design = plan(ship(400), SITE, option)
    price = {name: one.range.nominal for name, one in read_assumptions().items()}
    rate, limits = price["labour_rate"], design.settings.supply
    places = design.devices.set_index("device")[["x_m", "y_m", "z_m"]]

    def spent(cable, metres):
        each = price["laid_length"] * (cable.price.nominal + rate * cable.lay.nominal)
        end = price["gland"] + rate * (price["gland_time"] + 2 * cable.termination.nominal)
        return metres * each + 2 * end

    tried = 0
    for segment in design.segments["segment"]:
        runs = design.cables[design.cables["segment"] == segment]
        feeders, order = runs[runs["kind"] == "feeder"], runs["b"][runs["kind"] == "trunk"].tolist()
        supplies = (supply_tables(design)[0]["segment"] == segment).sum()
        taken = (supplies - 1) * (price["supply"] + rate * price["part_time"])
        taken += sum(spent(cables()[r.cable], r.length_m) for r in feeders.itertuples())
        load = (
            supply_tables(design)[1].drop_duplicates("device").set_index("device")["load_a"][order]
        )
        way = np.vstack([np.zeros(3), places.loc[order].to_numpy(), np.zeros(3)])
        metres = SITE.length(np.abs(np.diff(way, axis=0)).sum(axis=1))
        nodes = ["supply", *order, "supply"]
        for size in feeders_of("MI1P150"):
            wire = Cable(size.resistance, 1e-6, 1e-10)
            ring = Network(map(CableRun, nodes, nodes[1:], metres.tolist(), [wire] * len(metres)))
            lowest = min(
                ring.operating_point(
                    "supply", 24.0, dict(load + limits.short * (load.index == shorted))
                )[shorted]
                for shorted in order
            )
            if lowest >= 18 and load.sum() + limits.short <= limits.rating:
                tried += 1
                assert sum(spent(size, each) for each in metres.tolist()) > taken
                break
    assert tried


def test_a_load_that_no_supply_serves_is_a_reason():
    rows = [("solenoid", (30, 0, 0), 1000)] * 8
    design = plan(table(rows), SITE, "CAN", settings=Settings({"supply.rating": 3.0}))
    (reason,) = design.reasons.to_dict("records")
    assert reason["subject"] == "CAN box 1" and reason["limit"] == "supply"
    # 0.5 A, 60 % of 8 coils of 0.25 A, and 1.7 A.
    assert (reason["value"], reason["bound"], reason["unit"]) == (pytest.approx(3.4), 3.0, "A")
    assert "CAN box 1 draws 3.4 A" in reason["text"]
    assert not design.points["fits"].any()


def test_the_cable_of_the_worst_point_counts():
    iolist = table([("solenoid", (10, 0, 0), 1000), ("solenoid", (30, 0, 0), 1000)])
    (row,) = supply_tables(plan(iolist, SITE, "CAN"))[1].to_dict("records")
    # The box is halfway: 10 m plus detour and tails to each coil; only one coil is on.
    assert row["voltage_v"] - row["lowest_v"] == pytest.approx((1.15 * 10 + 5) * 52e-3 * 0.25)


def boat(values=None, *, tails=1.0, places=((10, 0, 0), (40, 0, 0)), each=1):
    """Return a CAN design that meets every rule of NMEA 2000 and of supplies."""
    small = {"supply.station": 0.1, "supply.solenoid": 0.1, "boxes.reach": 3, "tails": tails}
    rows = [("solenoid", position, 1000) for position in places for _ in range(each)]
    site = Site((0.0, 0.0, 0.0), detour=1.0, tails=tails)
    return plan(table(rows), site, "CAN", settings=Settings(small | (values or {})))


def priced(**values):
    """Return the same boat with other loads, for which it was not planned."""
    return boat().priced(boat().settings.replace({f"supply.{k}": v for k, v in values.items()}))


#: A design that violates each rule, and the computed value. The feeders are 11 m and 31 m of
#: 26 ohm/km, and a cable to a point is 1 m of 52 ohm/km.
VIOLATIONS = {
    "voltage": (
        lambda: priced(solenoid=10.0),
        (11 * 26e-3 * 12.2 + 31 * 26e-3 * 6.1 + 52e-3 * 10) / 0.24,
    ),
    "voltage above nominal": (lambda: boat({"supply.voltage": 32.0}), 100 / 3),
    "spur short circuit": (
        lambda: priced(short=10.0),
        (11 * 26e-3 * 10.32 + 31 * 26e-3 * 10.16 + 52e-3 * 0.1) / 0.24,
    ),
    "segment current": (lambda: priced(rating=0.2), 160.0),
    "cable current": (lambda: priced(station=10.5), 105.6),
    "spur overcurrent": (lambda: boat({"supply.solenoid": 0.6}), 0.6),
    "trunk resistance": (lambda: boat({"can.cable": "CAN_2x2x025"}), 100 * 80 / 60),
    "backbone": (lambda: boat(places=((10, 0, 0), (110, 0, 0))), 112),
    "drop": (lambda: boat(tails=6.5), 6.5),
    "drops in all": (lambda: boat(tails=4.0, each=10), 80),
    "nodes": (lambda: crowded(51), 51),
    "terminators": (lambda: with_ends(1), 1),
    "voltage drop": (lambda: priced(station=1.2), 11 * 26e-3 * 2.52 + 31 * 26e-3 * 1.26),
    "load of a device": (lambda: boat({"supply.station": 1.0}), 22),
    "load of a supply": (
        lambda: boat({"supply.station": 0.9}, places=[(x, 0, 0) for x in (5, 15, 25, 35)]),
        80,
    ),
}


def crowded(devices):
    design = boat()
    return replace(design, segments=design.segments.assign(devices=devices))


def with_ends(most):
    devices = boat().devices
    ends = devices["kind"] == "terminator"
    return replace(boat(), devices=devices[~ends | (ends.cumsum() <= most)])


def test_a_small_boat_meets_every_rule_of_supply_and_nmea_2000():
    tables = [boat().check(name).table() for name in ("supply", "NMEA 2000")]
    assert set(pd.concat(tables)["rule"]) == set(VIOLATIONS)
    assert (pd.concat(tables)["verdict"] == "met").all()


@pytest.mark.parametrize("rule", VIOLATIONS)
def test_each_rule_of_supply_has_a_design_that_violates_it(rule):
    make, computed = VIOLATIONS[rule]
    names = ("supply", "NMEA 2000")
    table = pd.concat([make().check(name).table() for name in names]).set_index("rule")
    row = table.loc[rule]
    assert row["verdict"] == "violated" and row["source"]
    assert row["value"] == pytest.approx(computed, rel=1e-3)


def test_the_resistance_of_a_trunk_is_that_of_its_cable():
    rule = Rule("resistance", "trunk resistance", 2.0, confirmed="yes")
    row = boat().check(RuleSet((rule,))).table().iloc[0]
    # 10 + 1 and 30 + 1 m at 52 ohm/km.
    assert row["value"] == pytest.approx(42 * 52e-3) and row["verdict"] == "violated"
    assert row["object"] == "CAN 1"


@pytest.mark.parametrize(
    ("far", "cable", "ohms", "listed"),
    [
        (30, "CAN_2x2x025", 80, 70),  # 30 m plus 10 m are 40 m of trunk, the last length of its row
        (30.1, "CAN_2x2x025", 80, 60),
        (290, "CAN_2x2x034", 54, 60),
        (590, "CAN_5_0p75", 26, 40),
        (990, "CAN_5_0p75", 26, 26),
    ],
)
def test_the_resistance_of_a_can_trunk_is_judged_by_its_length(far, cable, ohms, listed):
    design = boat({"can.cable": "CAN_5_0p75"}, tails=0.0, places=((10, 0, 0), (10 + far, 0, 0)))
    cables = design.cables["cable"].where(design.cables["kind"] != "trunk", cable)
    design = replace(design, cables=design.cables.assign(cable=cables))
    row = design.check("supply").table().set_index("rule").loc["trunk resistance"]
    assert row["value"] == pytest.approx(100 * ohms / listed)
    assert row["verdict"] == ("met" if ohms <= listed else "violated")


def test_a_trunk_whose_resistance_or_length_is_not_listed_is_not_verified():
    long = boat(tails=0.0, places=((10, 0, 0), (1000, 0, 0)))
    row = long.cables.index[long.cables["kind"] == "trunk"][0]
    long.cables.loc[row, "length_m"] = 11
    unknown = boat().cables.assign(cable=boat().cables["cable"].replace("CAN_5_0p75", "N2K_MID"))
    for design in (
        long,
        replace(boat(), cables=unknown),
        plan(ship(30), SITE, "Modbus RTU"),
        plan(ship(30), SITE, "home runs"),
    ):
        finding = design.check("supply").table().set_index("rule").loc["trunk resistance"]
        assert finding["verdict"] == "not verified" and np.isnan(finding["value"])


def test_a_design_without_feeders_has_no_supplies():
    for design in (
        small_loop(),
        plan(ship(30), SITE, "junction boxes"),
        plan(ship(30), SITE, "CAN", settings=Settings({"fed": False})),
    ):
        assert len(supply_tables(design)[0]) == len(supply_tables(design)[1]) == 0


def test_every_signal_has_a_load_or_none():
    assert set(LOADS) < set(SIGNALS)
    passive = set(SIGNALS) - set(LOADS)
    assert all(SIGNALS[name].kind == "AI" for name in passive)


@pytest.mark.parametrize("name", ["voltage", "drop", "rating", "simultaneity", "solenoid", "short"])
@pytest.mark.parametrize("value", [-1, np.nan, np.inf, "much"])
def test_an_impossible_supply_is_refused(name, value):
    with pytest.raises(ArgumentError, match=f"supply.{name} is"):
        Settings({f"supply.{name}": value})
