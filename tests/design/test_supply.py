"""What supplies give and what arrives, against the solver for cables and by hand."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st

from shipnet.design.catalogue import cables
from shipnet.design.designs import Design
from shipnet.design.planning import plan
from shipnet.design.settings import Settings
from shipnet.design.site import Site
from shipnet.design.supply import LOADS
from shipnet.errors import ArgumentError
from shipnet.line.cable import Cable
from shipnet.line.network import CableRun, Network
from shipnet.signals import SIGNALS
from tests.design.lists import lists, ship, table

SITE = Site((0.0, 0.0, 0.0))


def solved(design):
    """The voltage at every device that a feeder reaches, by the solver for cables."""
    settings = design.settings
    supplies = design.devices[design.devices["kind"].isin(["supply", "auxiliary supply"])]
    feeders = design.cables[design.cables["kind"] == "feeder"]
    feeders = feeders[(feeders["a"] != "cabinet") & (feeders["b"] != "cabinet")]
    amps = design.iolist.points["signal"].map(
        {name: settings[f"supply.{kind}"] for name, kind in LOADS.items()}
    ).fillna(0)  # fmt: skip
    coil = design.iolist.points["type"] == "DO"
    amps[coil] *= settings["supply.simultaneity"]
    asi = design.points["bus"] == "AS-i"
    amps[asi & ~coil] = 0
    load = amps.groupby(design.points["device"]).sum()
    station = design.devices.loc[design.devices["kind"] == "station", "device"]
    load = load.add(pd.Series(settings["supply.station"], station), fill_value=0)
    found = {}
    for supply in supplies["device"]:
        reached, own = {supply}, {}
        line = feeders[feeders["line"].isin(feeders.loc[feeders["a"] == supply, "line"])]
        while new := [r for r in line.itertuples() if r.a in reached and r.run not in own]:
            for run in new:
                wire = Cable(cables()[run.cable].resistance, 1e-6, 1e-10)
                own[run.run] = CableRun(run.a, run.b, run.length_m, wire)
                reached.add(run.b)
        if own:
            draws = {node: float(load.get(node, 0.0)) for node in reached - {supply}}
            network = Network(own.values())
            point = network.operating_point(supply, settings["supply.voltage"], draws)
            found |= {(supply, node): volts for node, volts in point.voltage.items()}
    return found


@hypothesis_settings(max_examples=20)
@given(lists(), st.sampled_from(["AS-i", "CAN", "Modbus RTU"]), st.booleans())
def test_the_voltages_are_those_of_the_solver_for_cables(iolist, option, redundant):
    design = plan(iolist, SITE, option, settings=Settings({"redundant": redundant}))
    expected = solved(design)
    table = design.voltages()
    lines = table[table["segment"].str.startswith("AS-i") & ~table["supply"].str.contains("aux")]
    got = table.drop(lines.index).set_index(["supply", "device"])["voltage_v"]
    assert set(got.index) == {key for key in expected if key[0] != key[1]}
    for key, volts in got.items():
        assert volts == pytest.approx(expected[key], abs=1e-9)


def test_an_as_i_line_has_the_voltages_of_its_plan():
    # The planner solved each line with repeaters and supplies; here they are found in its tables.
    design = plan(ship(400), SITE, "AS-i")
    supplies = design.supplies()
    lines = supplies[supplies["kind"] == "supply"].groupby("segment")
    expected = design.segments.set_index("segment")
    assert (design.devices["kind"] == "repeater").sum() > 5
    for column, found in (
        ("lowest_v", lines["lowest_v"].min()),
        ("supply_current_a", lines["current_a"].max()),
    ):
        assert found.to_dict() == pytest.approx(expected[column].to_dict(), abs=1e-9)


def test_a_chain_by_hand():
    # Two stations: the first draws 0.5 + 0.022 A, the second 0.5 + 0.6 x 0.25 A.
    iolist = table([("current_loop", (40, 0, 0), 1000), ("solenoid", (100, 0, 0), 1000)])
    design = plan(iolist, Site((0.0, 0.0, 0.0), detour=1.0, tails=0.0), "CAN")
    ohms = 26e-3
    first = 24 - 40 * ohms * (0.522 + 0.65)
    second = first - 60 * ohms * 0.65
    got = design.voltages().set_index("device")
    assert got["voltage_v"].tolist() == pytest.approx([first, second], abs=1e-12)
    assert got["current_a"].tolist() == pytest.approx([1.172, 0.65])
    # One channel is shorted there: 1.7 A more on all of the way.
    assert got["shorted_v"].iloc[1] == pytest.approx(second - 100 * ohms * 1.7)
    (supply,) = design.supplies().to_dict("records")
    assert supply["worst_device"] == "CAN box 2" and supply["devices"] == 2
    assert (supply["current_a"], supply["drop_v"]) == pytest.approx((1.172, 24 - second))
    assert supply["cross_section_mm2"] == 1.5 and supply["length_m"] == 100


def test_the_cable_of_the_worst_point_counts():
    iolist = table([("solenoid", (10, 0, 0), 1000), ("solenoid", (30, 0, 0), 1000)])
    (row,) = plan(iolist, SITE, "CAN").voltages().to_dict("records")
    # The box is half way between; 10 m with detour and tails to either coil, and it is on alone.
    assert row["voltage_v"] - row["lowest_v"] == pytest.approx((1.15 * 10 + 5) * 52e-3 * 0.25)


def test_a_design_without_feeders_has_no_supplies():
    for design in (Design.example(), plan(ship(30), SITE, "junction boxes"),
                   plan(ship(30), SITE, "CAN", settings=Settings({"fed": False}))):  # fmt: skip
        assert len(design.supplies()) == len(design.voltages()) == 0


def test_every_signal_has_a_load_or_none():
    assert set(LOADS) < set(SIGNALS)
    passive = set(SIGNALS) - set(LOADS)
    assert all(SIGNALS[name].kind == "AI" for name in passive)


@pytest.mark.parametrize("name", ["voltage", "drop", "rating", "simultaneity", "solenoid", "short"])
@pytest.mark.parametrize("value", [-1, np.nan, np.inf, "much"])
def test_a_supply_that_cannot_be_is_refused(name, value):
    with pytest.raises(ArgumentError, match=f"supply.{name} is"):
        Settings({f"supply.{name}": value})
