"""Options side by side, the front that no other beats, and where the cabinet stands."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst

from shipnet import datasets
from shipnet.design.comparison import CRITERIA, compare, compare_networks, not_beaten
from shipnet.design.costs import quantities
from shipnet.design.designs import Network, example
from shipnet.design.failures import single_cuts
from shipnet.design.iolist import from_table, load_iolist, parse_iolist
from shipnet.design.rules import check
from shipnet.design.site import find_cabinet
from shipnet.errors import ArgumentError

SHIP = load_iolist(datasets.path("synthetic_iolist_ship.csv"))


@given(npst.arrays(float, st.tuples(st.integers(0, 12), st.integers(1, 4)),
                   elements=st.sampled_from([0.0, 1.0, 2.0, 3.0, np.nan, np.inf])))  # fmt: skip
def test_the_front_is_that_of_comparing_each_with_each(values):
    worth = np.where(np.isnan(values), np.inf, values)
    beaten = [any(all(b <= a) and any(b < a) for b in worth if b is not a) for a in worth]
    assert not_beaten(values).tolist() == [not each for each in beaten]


def test_the_front_of_nothing_is_empty_and_a_row_is_no_table():
    assert not_beaten(np.empty((0, 3))).tolist() == []
    with pytest.raises(ArgumentError, match="shape"):
        not_beaten([1.0, 2.0])


def test_the_table_says_what_each_part_says():
    both = compare_networks([example(), example(redundant=True)], rule_set="IMO")
    for name, network in both.networks.items():
        row = both.table.loc[name]
        takes = quantities(network)
        assert row["total cost"] == takes["total cost"]
        assert row["total cost, high"] == takes.table.loc["total cost", "high"]
        cuts = single_cuts(network)
        cuts = cuts[cuts["kind"] != "cabinet"]
        assert row["lost by one device"] == cuts.query("failure == 'device'")["points_lost"].max()
        assert row["lost by one failure"] == cuts.query("failure != 'tray'")["points_lost"].max()
        verdicts = check(network, "IMO")["verdict"]
        kept = [row[f"rules {what}"] for what in ("kept", "broken", "not verified")]
        assert kept == [(verdicts == v).sum() for v in ("pass", "fail", "not verified")]
    assert list(both.short.columns) == list(both.table.index)


def test_an_option_that_leaves_points_out_is_not_on_the_front():
    network = example()
    points = network.points.assign(fits=[True, True, True, False])
    fields = ("iolist", "site", "devices", "runs", "segments", "reasons")
    parts = {name: getattr(network, name) for name in fields}
    cheaper = Network("partly", points=points, **{**parts, "runs": network.runs.iloc[:-1]})
    both = compare_networks([network, cheaper])
    assert both.table["total cost"]["partly"] < both.table["total cost"]["example"]
    assert both.pareto.to_dict() == {"example": True, "partly": False}
    assert both.sentences[0] == "partly leaves 1 of 4 points out."
    assert both.tornado.between == ("example",)
    alone = compare_networks([cheaper])
    assert alone.tornado.between == ("partly",)
    assert alone.sentences[-1] == "No option connects every point."


def test_options_of_the_ship_are_planned_and_weighed():
    site_list = parse_iolist(
        "tag,signal,system,x,y,z\n"
        + "\n".join(f"LS-{n},contact,Bilge,{10 + n},2,3" for n in range(9))
    )
    small = example().site
    found = compare(site_list, small, ["home runs", "CAN"], rng=np.random.default_rng(1))
    assert list(found.networks) == ["home runs", "CAN"]
    assert found.table["conductors at the cabinet"].tolist() == [18.0, 4.0]
    assert found.likely is not None and ("CAN", "total cost") in found.likely.index
    low, high = found.likely.loc[("CAN", "total cost"), ["low", "high"]]
    row = found.table.loc["CAN"]
    assert row["total cost, low"] < low < high < row["total cost, high"]
    assert str(found.tornado).split(";")[0].startswith("total cost of")
    assert found.tornado.between == ("CAN", "home runs")
    more = compare(site_list, small, ["CAN"], more=[found.networks["home runs"]])
    assert list(more.networks) == ["CAN", "home runs"]


def test_a_saving_counts_from_the_first_option_to_the_cheapest_other():
    site_list = parse_iolist(
        "tag,signal,x,y,z\n" + "\n".join(f"L-{n},contact,{n},2,3" for n in range(9))
    )
    found = compare(site_list, example().site)
    costs = found.table["total cost"]
    assert found.tornado.between == (costs.drop("home runs").idxmin(), "home runs")
    (alone,) = compare_networks([found.networks["CAN"]]).tornado.between
    assert alone == "CAN"


def test_an_option_that_leaves_points_out_is_no_saving_and_says_why():
    unplaced = parse_iolist("tag,signal,home run,x,y,z\nL-1,contact,20,,,\nL-2,contact,20,5,2,3\n")
    found = compare(unplaced, example().site)
    assert found.table["points left out"].tolist() == [0, 1, 1, 1, 1]
    assert found.tornado.between == ("home runs",)
    assert any("the list gives no place for L-1" in said for said in found.sentences)
    turned = compare(unplaced, example().site, ["CAN", "AS-i", "home runs", "junction boxes"])
    assert turned.tornado.between == ("home runs",)
    fast = parse_iolist("tag,signal,x,y,z,update\nL-1,contact,5,2,3,1\nL-2,contact,6,2,3,1\n")
    (said,) = compare(fast, example().site, ["home runs", "Modbus RTU"]).sentences[:1]
    assert said.startswith("Modbus RTU leaves 2 of 2 points out: L-1 needs an update every 1 ms;")
    assert said.endswith("(and 1 more).")


def test_the_short_table_of_a_small_plant_is_not_all_noughts():
    lone = parse_iolist("tag,signal,x,y,z\nL-1,contact,3,2,3\n")
    found = compare(lone, example().site, ["home runs", "CAN"])
    cost = found.short.loc["total cost [EUR]", "home runs"]
    assert float(cost.replace(",", "")) == pytest.approx(
        found.table["total cost"]["home runs"], rel=0.005
    )
    length = found.short.loc["cable length [km]", "home runs"]
    assert float(length) == pytest.approx(found.table["cable length"]["home runs"], rel=0.005)


def test_wrong_arguments_are_named():
    network = example()
    with pytest.raises(ArgumentError, match="one or more"):
        compare_networks([])
    with pytest.raises(ArgumentError, match="each of its own name"):
        compare_networks([network, network])
    with pytest.raises(ArgumentError, match="criteria are"):
        compare_networks([network], criteria=["colour"])
    with pytest.raises(ArgumentError, match="criteria are"):
        compare_networks([network], criteria=[])
    assert set(CRITERIA) <= set(compare_networks([network]).table.columns)


def test_the_cabinet_of_the_example_ship_is_found_from_its_home_runs():
    found = find_cabinet(SHIP)
    assert found.place == (26.0, 6.0, 14.0)
    assert found.misfit < 0.05
    assert "within 0.1 m for half of them" in str(found)


def test_a_cabinet_that_lengths_do_not_settle_says_so():
    assert find_cabinet(SHIP).settled
    points = SHIP.points
    for system in ("Ballast valve", "Main engine", "Fire damper"):
        part = find_cabinet(from_table(points[points["system"] == system]))
        assert not part.settled
        assert "other places fit as well" in str(part)


@pytest.mark.parametrize("seed", range(4))
def test_a_cabinet_is_found_where_the_lengths_were_measured_from(seed):
    rng = np.random.default_rng(seed)
    points = SHIP.points.sample(60, random_state=seed).reset_index(drop=True)
    some = replace(SHIP, points=points)
    place = rng.uniform([0, -10, 0], [180, 10, 20]).round(1)
    length = 1.15 * np.abs(some.places - place).sum(axis=1) + 5
    # One length in ten is that of another way.
    length = np.where(rng.random(60) < 0.1, 1.3 * length, length).round(1)
    found = find_cabinet(replace(some, points=points.assign(home_run_m=length)))
    assert np.abs(np.array(found.place) - place).max() <= 0.1 + 1e-9


def test_a_cabinet_cannot_be_found_without_lengths():
    with pytest.raises(ArgumentError, match="it takes 4"):
        find_cabinet(example().iolist)
