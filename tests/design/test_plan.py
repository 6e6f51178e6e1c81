"""Plans meet every limit, checked again from their tables, or give the reason why not."""

import math

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shipnet import datasets
from shipnet.design.costs import bill_table
from shipnet.design.iolist import IoList, read_iolist
from shipnet.design.layout import Site
from shipnet.design.planning import OPTIONS, plan
from shipnet.design.rules import Rule, RuleSet, longest_responses
from shipnet.design.settings import Settings
from shipnet.errors import ArgumentError
from tests.design.checks import check_everything
from tests.design.lists import lists, ship, table

SITE = Site((0.0, 0.0, 0.0))
BUSES = OPTIONS[2:]

#: Limits so low that lists of a dozen points reach them.
TIGHT = Settings(
    {
        "boxes": {"points": 3, "reach": 8.0},
        "asi": {"inputs": 2, "outputs": 2, "channels": 2, "length": 60.0, "repeaters": 2},
        "can": {"nodes": 3, "load": 0.1},
        "modbus": {"unit_loads": 3, "bit_rates": (9600, 19_200), "repeaters": 1, "length": 150.0},
    }
)
TREELESS = Settings({"asi.tree": False, "asi.shared": False, "fed": False})


@pytest.fixture(scope="module")
def example():
    return read_iolist(datasets.path("synthetic_iolist_ship.csv"))


def test_a_mix_of_single_and_doubled_lines_has_segments_of_different_names():
    for bus in ("CAN", "Modbus RTU"):
        design = plan(ship(60), SITE, bus, mix={"DI": f"{bus} doubled"})
        check_everything(design, Settings())
        assert design.segments["segment"].is_unique and len(design.segments) > 1
        trunks = design.cables[design.cables["kind"] == "trunk"]
        assert set(trunks["line"]) == {"", "A", "B"}


@settings(max_examples=12)
@given(lists(), st.sampled_from(OPTIONS), st.sampled_from([Settings(), TIGHT, TREELESS]))
def test_a_plan_meets_every_limit_or_gives_a_reason(iolist, option, limits):
    design = plan(iolist, SITE, option, settings=limits)
    check_everything(design, limits)


@pytest.mark.parametrize("limits", [Settings(), TIGHT, TREELESS], ids=["usual", "tight", "chain"])
@pytest.mark.parametrize("option", BUSES)
def test_a_plan_of_many_close_points_meets_every_limit(option, limits):
    design = plan(ship(80), SITE, option, settings=limits)
    check_everything(design, limits)
    assert len(design.segments) > 0


@pytest.mark.parametrize("option", OPTIONS)
def test_the_example_ship_fits_on_every_bus(example, option):
    design = plan(example, Site((26, 6, 14)), option)
    assert design.fits
    if option in BUSES:
        check_everything(design, Settings())


def test_the_hardwired_example_is_as_long_as_its_list_says(example):
    homes = plan(example, Site((26, 6, 14)), "home runs").cables
    assert homes["length_m"].sum() == pytest.approx(example.points["home_run_m"].sum())
    assert homes["used"].sum() == example.points["conductors"].sum() == 792
    boxes = plan(example, Site((26, 6, 14)), "junction boxes").cables
    drops = boxes[boxes["kind"] == "drop"]
    assert drops["length_m"].sum() == pytest.approx(example.points["to_box_m"].sum())
    assert boxes.loc[boxes["kind"] == "trunk", "used"].sum() == 792


@pytest.mark.parametrize(
    ("option", "kind"), [("home runs", "home run"), ("junction boxes", "drop")]
)
def test_lengths_of_the_list_can_be_ignored(example, option, kind):
    bare = IoList.from_table(example.points.drop(columns=["home_run_m", "to_box_m"]))
    site = Site((26, 6, 14))
    reckoned = plan(example, site, option, settings=Settings({"list_lengths": False})).cables
    pd.testing.assert_frame_equal(reckoned, plan(bare, site, option).cables)
    kept = plan(example, site, option).cables
    mine = kept["kind"] == kind
    assert (kept["length_m"] != reckoned["length_m"])[mine].any()


def test_a_point_without_a_place_keeps_its_length_whatever_the_settings_say():
    iolist = IoList.parse("tag,type,x,y,z,home run\nA,DI,,,,40\nB,DI,9,0,0,40")
    runs = plan(iolist, SITE, "home runs", settings=Settings({"list_lengths": False})).cables
    assert runs["length_m"].tolist() == [40.0, SITE.length(9.0)]


@pytest.mark.parametrize("spare", [0.0, 0.2, 1.0])
@pytest.mark.parametrize("option", OPTIONS)
def test_every_option_has_the_same_spare_channels(example, option, spare):
    design = plan(example, Site((26, 6, 14)), option, settings=Settings({"spare": spare}))
    value = example.points["type"].str[0] == "A"
    bill = bill_table(design).set_index("item")["number"]
    if option.startswith("AS-i"):
        bill /= 2 if option == "AS-i doubled" else 1
        # An analogue module may be fast enough for only some of its ports; the others are spare.
        for kind, own in (("AS-i analogue module", value), ("AS-i module", ~value)):
            inputs = example.points.loc[own, "type"].str[1] == "I"
            used = max(inputs.sum(), (~inputs).sum()) if kind == "AS-i module" else len(inputs)
            assert 4 * bill[kind] >= round((1 + spare) * used, 9)
        return
    of = "PLC" if option in ("home runs", "junction boxes") else "station"
    for kind, own in (("analogue", value), ("digital", ~value)):
        assert bill[f"{of} {kind} channel"] == math.ceil(round((1 + spare) * own.sum(), 9))


def test_a_trunk_has_enough_pairs_and_spares(example):
    design = plan(example, Site((26, 6, 14)), "junction boxes", settings=Settings({"spare": 0.5}))
    trunks = design.cables[design.cables["kind"] == "trunk"]
    pairs = -(-example.points["conductors"] // 2)
    for box, own in trunks.groupby("b"):
        needed = 2 * pairs[design.points["device"] == box].sum()
        assert own["conductors"].sum() >= 1.5 * needed
        assert (
            own["used"].sum()
            == example.points.loc[design.points["device"] == box, "conductors"].sum()
        )


def test_a_common_return_counts_once_per_trunk_and_once_per_home_run():
    iolist = table([("contact_common", (10, 0, 0), 1000)] * 4)
    boxes = plan(iolist, SITE, "junction boxes").cables
    assert boxes.loc[boxes["kind"] == "trunk", "used"].tolist() == [5]
    assert plan(iolist, SITE, "home runs").cables["used"].tolist() == [2] * 4


@pytest.mark.parametrize(
    ("option", "away", "limit", "bound"),
    [
        ("AS-i", 400, "length", 300),
        ("CAN", 900, "length", 1000),
        ("Modbus RTU", 1100, "length", 1219),
    ],
)
def test_points_that_are_too_far_away_are_left_out_with_value_and_bound(option, away, limit, bound):
    iolist = table([("contact", (away - 200, 200, 0), 1000), ("contact", (20, 0, 0), 1000)])
    design = plan(iolist, SITE, option)
    assert design.points["fits"].tolist() == [False, True]
    (reason,) = design.reasons.itertuples()
    assert (reason.subject, reason.limit, reason.bound, reason.unit) == ("P0", limit, bound, "m")
    assert reason.value == pytest.approx(SITE.detour * away + SITE.tails)
    assert "P0" in reason.text and f"{bound}" in reason.text
    check_everything(design, Settings())


@pytest.mark.parametrize("option", BUSES)
@pytest.mark.parametrize("signal", ["contact", "current_loop"])
def test_points_with_too_short_update_times_are_left_out_but_not_others(option, signal):
    iolist = table([(signal, (20, 0, 0), 0.4), (signal, (20, 0, 0), 1000)])
    design = plan(iolist, SITE, option)
    assert design.points["fits"].tolist() == [False, True]
    (reason,) = design.reasons.itertuples()
    assert reason.subject == "P0" and reason.bound == 0.4 < reason.value and reason.unit == "ms"


def test_a_modbus_bit_rate_above_100_kbit_s_shortens_the_line():
    # EIA-485: 1219 m up to 100 kbit/s; above, the product is constant: 244 m at 500 kbit/s.
    far = table([("contact", (100 * n, 0, 0), 1000) for n in (1, 4, 8)])
    slow, fast, both = (
        plan(far, SITE, "Modbus RTU", settings=Settings({"modbus.bit_rates": rates}))
        for rates in ((57_600,), (500_000,), (57_600, 500_000))
    )
    assert slow.fits and both.fits and both.segments["bit_rate"].tolist() == [57_600]
    assert fast.points["fits"].tolist() == [True, False, False]
    assert fast.reasons["bound"].tolist() == pytest.approx([243.8] * 2)
    # Points that need a fast line are left out unless they are near enough.
    urgent = table([("contact", (x, 0, 0), 9) for x in (80, 400)])
    found = plan(
        urgent,
        SITE,
        "Modbus RTU",
        settings=Settings({"modbus.bit_rates": (57_600, 1_000_000), "modbus.processing": 0}),
    )
    assert found.points["fits"].tolist() == [True, False]


def test_many_urgent_points_are_divided_among_several_segments():
    crowd = table([("current_loop", (20, 0, 0), 60)] * 40)
    for option in ("CAN", "Modbus RTU"):
        design = plan(crowd, SITE, option, settings=Settings({"can.bit_rates": (50_000,)}))
        assert design.fits and len(design.segments) > 1
        check_everything(design, Settings({"can.bit_rates": (50_000,)}))


def test_messages_that_would_be_late_go_to_segments_of_their_own():
    # Sent every 57 ms, due 3 ms later: a frame takes 2.7 ms at 50 kbit/s, so a second is late.
    limits = Settings({"can.bit_rates": (50_000,), "can.period_share": 0.95, "can.load": 1.0})
    design = plan(table([("current_loop", (20, 0, 0), 60)] * 12), SITE, "CAN", settings=limits)
    assert design.fits and design.segments["messages"].tolist() == [1] * len(design.segments)
    check_everything(design, limits)


def test_a_value_with_a_short_update_time_gets_a_module_with_fewer_channels():
    for need, modules in ((1000, 1), (400, 2), (140, 4)):
        values = table([("current_loop", (20, 0, 0), need)] * 4)
        design = plan(values, SITE, "AS-i", settings=Settings({"spare": 0}))
        assert design.fits and (design.devices["kind"] == "module").sum() == modules


def test_more_than_31_modules_share_addresses_and_then_need_two_lines():
    def crowd(n):
        return table([("contact", (10 + k % 2, 0, 0), 1000) for k in range(4 * n)])

    site, limits = Site(SITE.cabinet, tails=0.1), Settings({"tails": 0.1, "spare": 0})
    for modules, addresses in ((31, [31]), (32, [31]), (62, [31]), (63, [31, 31])):
        design = plan(crowd(modules), site, "AS-i", settings=limits)
        assert design.segments["addresses"].tolist() == addresses
        assert design.segments["slaves"].sum() == modules
        check_everything(design, limits)
    # kim2023, section 3.3: 62 modules of four contacts have 496 conductors, or 2 on the bus.
    local = Settings({"fed": False, "spare": 0})
    for option, conductors in (("home runs", 496), ("AS-i", 2)):
        runs = plan(crowd(62), site, option, settings=local).cables
        assert runs.loc[runs["at_cabinet"], "used"].sum() == conductors
    alone = Settings({"asi.shared": False, "spare": 0})
    assert len(plan(crowd(32), site, "AS-i", settings=alone).segments) == 2


def test_a_point_without_a_position_fits_only_on_a_home_run():
    iolist = IoList.parse("tag,signal,home run,JB\nA,contact,30,\nB,contact,40,J1")
    assert plan(iolist, SITE, "home runs").cables["length_m"].tolist() == [30, 40]
    for option in OPTIONS[1:]:
        design = plan(iolist, SITE, option)
        assert not design.points["fits"].any()
        assert design.reasons["limit"].tolist() == ["place", "place"]
        check_everything(design, Settings())


def test_a_mix_connects_each_kind_by_its_bus_and_the_first_choice_decides(example):
    choose = {"AI": "CAN", "DI": "AS-i", "Fire damper": "junction boxes", "I": "home runs"}
    design = plan(example, Site((26, 6, 14)), "Modbus RTU", mix=choose)
    points = example.points.assign(bus=design.points["bus"])
    assert design.fits
    assert set(points.loc[points["category"] == "I", "bus"]) == {"hardwired"}
    assert set(points.loc[points["system"] == "Fire damper", "bus"]) == {"hardwired"}
    rest = points[(points["category"] != "I") & (points["system"] != "Fire damper")]
    buses = rest.groupby("type")["bus"].unique().map(list).to_dict()
    assert buses == {"AI": ["CAN"], "DI": ["AS-i"], "DO": ["Modbus RTU"]}
    check_everything(design, Settings())


def test_unknown_options_and_kinds_are_named():
    iolist = ship(5)
    with pytest.raises(ArgumentError, match="option is 'LIN'; it must be one of 'home runs'"):
        plan(iolist, SITE, "LIN")
    with pytest.raises(ArgumentError, match="one of mix is 'LIN'"):
        plan(iolist, SITE, "home runs", mix={"AI": "LIN"})
    with pytest.raises(ArgumentError, match="mix names 'bilge'"):
        plan(iolist, SITE, "home runs", mix={"bilge": "CAN"})


def test_the_planner_avoids_names_that_the_list_uses():
    iolist = IoList.parse(
        "tag,signal,x,y,z,JB\ncabinet,contact,1,0,0,CAN 1 master\nCAN J2,contact,2,0,0,J2"
    )
    for option in OPTIONS:
        design = plan(iolist, SITE, option)
        assert design.fits
        check_everything(design, Settings())


@pytest.mark.parametrize("option", OPTIONS)
def test_the_order_of_a_list_does_not_decide_what_fits(option):
    iolist = ship(60)
    table_ = iolist.points.iloc[::-1].reset_index(drop=True)
    turned = type(iolist)(table_, iolist.source)
    there, back = plan(iolist, SITE, option), plan(turned, SITE, option)
    assert there.points["fits"].tolist() == back.points["fits"].tolist()[::-1]
    assert there.cables["length_m"].sum() == pytest.approx(back.cables["length_m"].sum(), rel=0.05)


def test_points_in_one_place_can_be_connected():
    iolist = table([("contact", (0, 0, 0), 1000)] * 9 + [("current_loop", (0, 0, 0), 1000)] * 5)
    for option in OPTIONS:
        design = plan(iolist, SITE, option)
        assert design.fits
        check_everything(design, Settings())


def test_the_limits_are_those_of_the_rules():
    rules = datasets.read("asi_plan_rules.csv").set_index("rule")["highest"]
    assert Settings().asi.length == float(rules["cable_length"])
    assert Settings().asi.repeaters == int(rules["repeaters_in_series"])
    assert Settings().asi.rating == float(rules["supply_current"])


@pytest.mark.parametrize("values", [{"can.cable": "ASI_FLAT"}, {"feeder": "ASI_FLAT"}])
def test_a_cable_that_does_not_suit_a_bus_is_refused(values):
    with pytest.raises(ArgumentError, match="is 'ASI_FLAT'; it must be one of"):
        Settings(values)


def test_points_without_an_update_time_have_that_of_the_settings():
    iolist = IoList.parse("tag,signal,x,y,z,update\nA,contact,20,0,0,\nB,contact,21,0,0,800")
    for update, slowest in ((0.4, 400), (1.0, 800), (3.0, 800)):
        design = plan(iolist, Site((0, 0, 0)), "CAN", settings=Settings({"update": update}))
        assert design.segments["slowest_update_ms"].tolist() == [slowest]
        assert design.points["response_ms"][0] == pytest.approx(500 * update, abs=2)


# Limits of rules on responses, and points that are intrinsically safe -----------------------------

#: Inputs with an update time of 5 s, and outputs.
SLOW = table(
    [
        (signal, (x, 0, 2), 5000.0)
        for x in range(0, 60, 3)
        for signal in ("contact", "current_loop", "solenoid")
    ]
)


def within(seconds, applies="inputs"):
    return RuleSet(
        (Rule("shown", "response", seconds, applies=applies, confirmed="yes", host=True),)
    )


@pytest.mark.parametrize("option", BUSES)
def test_a_limit_on_responses_is_met_where_the_list_alone_would_exceed_it(option):
    loose = plan(SLOW, SITE, option, settings=Settings({"modbus.processing": 0.1}))
    host = loose.settings.host_time
    inputs = SLOW.points["type"].isin(["DI", "AI"])
    rules = within(host + 0.7 * loose.points["response_ms"][inputs].max() / 1e3)
    assert not loose.check(rules).ok
    design = plan(SLOW, SITE, option, settings=loose.settings, rules=rules)
    assert design.fits and design.check(rules).ok
    assert (1e3 * host + design.points["response_ms"][inputs]).max() <= 1e3 * rules.rules[0].limit
    pd.testing.assert_frame_equal(design.without_limits.points, loose.points)
    longest = 1e3 * (rules.rules[0].limit - host)
    used = design.tables()["points"].set_index("tag")[["update_ms", "planned_update_ms"]]
    assert (used["update_ms"] == 5000).all()
    assert used["planned_update_ms"].to_numpy() == pytest.approx(np.where(inputs, longest, 5000))
    columns = list(design.tables()["points"])
    assert columns.index("planned_update_ms") == columns.index("update_ms") + 1


def test_a_limit_that_is_met_anyway_changes_nothing():
    assert plan(SLOW, SITE, "AS-i", rules=within(5.0)).without_limits is None
    assert plan(SLOW, SITE, "home runs", rules=within(1e-3)).without_limits is None


def test_the_hosts_time_is_subtracted_from_a_limit_and_shorter_limits_are_ignored():
    inputs = SLOW.points["type"].isin(["DI", "AI"]).to_numpy()
    for limit, left in ((2.0, 1.5), (0.75, 0.25), (0.5, np.inf), (0.2, np.inf)):
        longest = longest_responses(within(limit), SLOW.points, 0.5)
        assert longest[inputs] == pytest.approx(left) and np.isinf(longest[~inputs]).all()
    # A second limit that the host can meet still applies, also to the same points.
    both = RuleSet((*within(0.2), *within(2.0, "all")))
    assert longest_responses(both, SLOW.points, 0.5) == pytest.approx(1.5)


def test_points_that_cannot_meet_a_limit_keep_the_need_of_the_list():
    """An analogue value exceeds this limit on AS-i, but a contact does not."""
    design = plan(SLOW, SITE, "AS-i", rules=within(0.55), settings=Settings({"asi.conversion": 2}))
    late = design.points["response_ms"]
    assert design.fits and not design.check(within(0.55)).ok
    assert (late[SLOW.points["type"] == "AI"] > 2000).all()
    assert (late[SLOW.points["type"] == "DI"] <= 50).all()


@pytest.mark.parametrize("option", BUSES)
def test_an_intrinsically_safe_point_is_on_a_bus_only_with_a_barrier_in_its_box(option):
    iolist = IoList.parse("tag,signal,x,y,z\nA,4-20mA Ex ia,20,0,0\nB,4-20mA,21,0,0")
    for barriers, bus in ((False, "hardwired"), (True, option.removesuffix(" doubled"))):
        limits = Settings({"field_barriers": barriers})
        design = plan(iolist, SITE, option, settings=limits)
        assert design.points["bus"].tolist() == [bus, option.removesuffix(" doubled")]
        assert bill_table(design).set_index("item").loc["barrier", "number"] == 1
    mixed = plan(iolist, SITE, "home runs", mix={"A": option})
    assert mixed.points["bus"].tolist() == ["hardwired", "hardwired"]
