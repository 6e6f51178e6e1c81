"""Comparison of options, the Pareto front, and the position of the cabinet."""

import re
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst
from matplotlib.figure import Figure
from scipy.stats import triang

from shipnet import datasets
from shipnet.design.comparison import CRITERIA, compare, pareto_optimal
from shipnet.design.costs import number, quantities
from shipnet.design.failures import single_failures
from shipnet.design.iolist import IoList, read_iolist
from shipnet.design.layout import find_cabinet
from shipnet.design.planning import OPTIONS
from shipnet.design.rules import Rule, RuleSet
from shipnet.design.settings import Settings
from shipnet.errors import ArgumentError
from tests.design.lists import ship, small_loop

SHIP = read_iolist(datasets.path("synthetic_iolist_ship.csv"))


@given(
    npst.arrays(
        float,
        st.tuples(st.integers(0, 12), st.integers(1, 4)),
        elements=st.sampled_from([0.0, 1.0, 2.0, 3.0, np.nan, np.inf]),
    )
)
def test_the_front_agrees_with_pairwise_comparison(values):
    worth = np.where(np.isnan(values), np.inf, values)
    beaten = [any(all(b <= a) and any(b < a) for b in worth if b is not a) for a in worth]
    assert pareto_optimal(values).tolist() == [not each for each in beaten]


def test_an_empty_table_has_no_pareto_front_and_a_vector_is_refused():
    assert pareto_optimal(np.empty((0, 3))).tolist() == []
    with pytest.raises(ArgumentError, match="shape"):
        pareto_optimal([1.0, 2.0])


def test_the_table_agrees_with_its_parts():
    both = compare([small_loop(), small_loop(redundant=True)], rules="IMO")
    for name, design in both.designs.items():
        row = both.table().loc[name]
        takes = quantities(design)
        assert row["total_cost_eur"] == takes["total_cost_eur"]
        assert row["total_cost_high_eur"] == takes.table().loc["total_cost_eur", "high"]
        cuts = single_failures(design)
        cuts = cuts[cuts["kind"] != "cabinet"]
        assert row["lost_by_device"] == cuts.query("failure == 'device'")["points_lost"].max()
        assert row["lost_by_failure"] == cuts.query("failure != 'tray'")["points_lost"].max()
        verdicts = design.check("IMO").table()["verdict"]
        kept = [row[f"rules_{what}"] for what in ("met", "violated", "not_verified")]
        assert kept == [(verdicts == v).sum() for v in ("met", "violated", "not verified")]
    assert list(both.short().columns) == list(both.table().index)


def test_an_option_that_leaves_points_out_is_not_on_the_front():
    design = small_loop()
    points = design.points.assign(fits=[True, True, True, False])
    cheaper = replace(design, name="partly", points=points, cables=design.cables.iloc[:-1])
    both = compare([design, cheaper])
    assert both.table()["total_cost_eur"]["partly"] < both.table()["total_cost_eur"]["example"]
    assert both.pareto() == ["example"]
    assert both.conclusions()[1] == "partly leaves out 1 of 4 points."
    assert both.tornado().between == ("example",)
    alone = compare([cheaper])
    assert alone.tornado().between == ("partly",)
    assert alone.conclusions()[0] == "No design connects all points."


def test_the_headline_names_the_cheapest_design_without_violations_and_its_extra_cost():
    rules = RuleSet((Rule("two", "lines of a link", 2, bound="at least", confirmed="yes"),))
    one, two = small_loop(), small_loop(redundant=True)
    costs = [design.quantities()["total_cost_eur"] for design in (one, two)]
    less = number(costs[1] - costs[0])
    comparison = compare([one, two], rules=rules)
    assert comparison.best is two and comparison.verdict == (
        f"example, redundant, {number(costs[1])} EUR, is the only design that connects every point "
        f"and violates no rule; example costs {less} EUR less but violates 'two'"
    )
    assert comparison.conclusions()[:2] == [
        f"E{comparison.verdict[1:]}.",
        "example violates 'two'.",
    ]
    assert "less" not in compare([two], rules=rules).verdict
    assert compare([one], rules=rules).conclusions()[0] == (
        "Every design that connects all points violates a rule."
    )


def test_the_headline_says_how_many_rules_are_not_verified_and_how_many_are_unread():
    read, unread = (
        Rule(name, "lines of a link", 1, bound="at least", confirmed=name) for name in ("yes", "no")
    )
    unshown = Rule("memory", "", 0, confirmed="yes")

    def doubt(*rules):
        verdict = compare([small_loop()], rules=RuleSet(rules)).verdict
        return verdict.partition("violates no rule")[2]

    assert doubt(read) == ""
    assert doubt(read, unshown) == " (1 of 2 rules not verified)"
    assert doubt(read, unshown, unread) == " (2 of 3 rules not verified, 1 unread)"


def test_the_summary_names_the_rules_that_each_design_violates():
    rules = tuple(
        Rule(f"rule {n}", "lines of a link", 9, bound="at least", confirmed="yes") for n in range(5)
    )
    both = compare([small_loop(), small_loop(redundant=True)], rules=RuleSet(rules))
    sentence = "example, example, redundant violate 'rule 0', 'rule 1', 'rule 2' and 2 more."
    assert sentence in both.conclusions()


#: A rule set that every design that connects all points meets, and one that a single line violates.
NO_LIMIT = RuleSet((Rule("every point", "unconnected points", 0, confirmed="yes"),))
TWO_LINES = RuleSet((Rule("two", "lines of a link", 2, bound="at least", confirmed="yes"),))

RANGES = st.lists(st.integers(1, 100), min_size=3, max_size=3).map(sorted)


@settings(max_examples=20)
@given(RANGES, RANGES)
def test_the_probability_of_being_the_cheapest_agrees_with_an_integral(terminator, repeater):
    """Two designs differ in one part, and both prices have triangular distributions."""
    prices = {"terminator": terminator, "repeater": [n + 0.5 for n in repeater]}
    values = Settings({f"assumptions.{name}": ends for name, ends in prices.items()})
    one, designs = small_loop(), []
    for kind in prices:
        extra = one.devices.iloc[[-1]].assign(device="extra", kind=kind, at="")
        devices = pd.concat([one.devices, extra])
        designs.append(replace(one, name=kind, devices=devices).priced(values))
    comparison = compare(designs, rules=NO_LIMIT)
    a, b = (
        triang(c=(mode - low) / max(high - low, 1e-3), loc=low, scale=max(high - low, 1e-3))
        for low, mode, high in prices.values()
    )
    x = np.linspace(min(a.ppf(0), b.ppf(0)), max(a.ppf(1), b.ppf(1)), 20_001)
    expected = float((np.diff(b.cdf(x)) * a.cdf((x[1:] + x[:-1]) / 2)).sum())
    assert comparison.chances["terminator"] == pytest.approx(expected, abs=0.025)
    assert list(comparison.chances) == comparison.meeting
    assert sum(comparison.chances.values()) == pytest.approx(1)
    percent = re.search(r"cheapest with (\d+) % probability", comparison.verdict)
    chance = 100 * comparison.chances[comparison.best.name]
    assert int(percent[1]) == pytest.approx(min(max(chance, 1), 99), abs=0.51)
    assert comparison.chances == compare(designs, rules=NO_LIMIT).chances


def test_a_probability_of_one_or_zero_is_not_claimed():
    comparison = compare([small_loop(), small_loop(redundant=True)], rules=NO_LIMIT)
    assert comparison.chances == {"example": 1, "example, redundant": 0}
    assert "(cheapest with 99 % probability)" in comparison.verdict
    assert compare([small_loop()], rules=TWO_LINES).chances == {}


def test_the_headline_names_the_doubled_bus_that_would_be_the_best():
    iolist, ways = ship(60), ["home runs", "CAN"]
    cost = iolist.plan("CAN doubled", (0, 0, 0)).quantities()["total_cost_eur"]
    remedy = f"CAN doubled would cost {number(cost)} EUR and violate none of the rules verified"
    comparison = iolist.compare((0, 0, 0), ways, rules=TWO_LINES)
    assert comparison.best.name == "home runs" and comparison.verdict.endswith(f"; {remedy}")
    assert iolist.compare((0, 0, 0), ["CAN"], rules=TWO_LINES).verdict == (
        f"every design that connects all points violates a rule; {remedy}"
    )
    both = iolist.compare((0, 0, 0), [*ways, "CAN doubled"], rules=TWO_LINES)
    assert both.best.name == "CAN doubled" and "would" not in both.verdict
    assert "would" not in iolist.compare((0, 0, 0), ways, rules=NO_LIMIT).verdict
    few = ship(2).compare((0, 0, 0), ways, rules=TWO_LINES)
    assert few.best.name == "home runs" and "would" not in few.verdict


def test_single_and_doubled_buses_are_columns_of_one_table():
    comparison = ship(30).compare((0, 0, 0))
    assert list(comparison.designs) == list(comparison.short().columns) == list(OPTIONS)
    costs, lost = comparison.table()["total_cost_eur"], comparison.table()["lost_by_cable"]
    # On CAN and Modbus, a point has one cable to its station; on AS-i, one to each module.
    for bus, least in (("AS-i", 0), ("CAN", 1), ("Modbus RTU", 1)):
        assert costs[bus] < costs[f"{bus} doubled"] and lost[bus] > lost[f"{bus} doubled"] == least


def test_barriers_of_points_without_a_position_have_no_other_place():
    lengths = IoList.parse("tag,signal,home run\nA,contact,20\nB,4-20mA Ex ia,30\n")
    sentence = "Intrinsically safe points: 1, each with a barrier in the cabinet."
    assert sentence in lengths.compare().conclusions()


def test_a_list_without_positions_cannot_be_compared_and_says_what_to_give():
    lengths = IoList.parse("tag,signal,home run\nA,contact,20\nB,4-20mA Ex ia,30\n")
    comparison = lengths.compare(settings={"field_barriers": True})
    cost = number(comparison.quantities["home runs"]["total_cost_eur"])
    assert comparison.verdict.startswith(
        "nothing to compare: only home runs can connect points; give the position of each point, "
        f"as x, y, z or frame, deck and side; home runs, {cost} EUR, is the only design that"
    )
    table = comparison.table().drop(columns=["points_left_out", "pareto"]).drop(index="home runs")
    assert len(table) == 7 and table.isna().all(axis=None)
    short = comparison.short()
    assert short.loc["rules violated"].tolist() == ["0", *["-"] * 7]
    assert short.loc["total cost [EUR]"].tolist() == [cost, *["-"] * 7]
    assert sum(conclusion.endswith("(and 1 more).") for conclusion in comparison.conclusions()) == 1
    assert "no point is connected" in repr(comparison.quantities["CAN"])
    bottom, top = comparison.plot(ax=Figure().subplots()).get_ylim()
    assert bottom > 6.2 and top < -0.2  # every design has its row
    assert not re.search(r"\bnan\b", comparison.html() + str(comparison))
    alone = lengths.compare(None, ["CAN"], settings={"field_barriers": True})
    assert alone.verdict.startswith("nothing to compare: no design can connect a point; give the")
    assert not alone.ok and not re.search(r"\bnan\b", str(alone))


def test_the_text_says_how_many_prices_are_assumed():
    comparison, priced = (
        ship(4).compare((0, 0, 0), ["home runs"], settings=values)
        for values in ({}, {"assumptions.labour_rate": 60})
    )
    used = len(comparison.quantities["home runs"].assumptions)
    ending = "prices, masses, hours and factors are assumed."
    assert str(comparison).endswith(f"{used} of {used} {ending}")
    assert str(priced).endswith(f"{used - 1} of {used} {ending}")


def test_an_option_that_leaves_points_out_is_not_a_saving_and_gives_the_reason():
    unplaced = IoList.parse("tag,signal,home run,x,y,z\nL-1,contact,20,,,\nL-2,contact,20,5,2,3\n")
    comparison = unplaced.compare(small_loop().site)
    assert comparison.table()["points_left_out"].tolist() == [0, 1, 1, 1, 1, 1, 1, 1]
    assert comparison.tornado().between == ("home runs",)
    assert any(
        "the list gives no position for L-1" in conclusion
        for conclusion in comparison.conclusions()
    )
    turned = unplaced.compare(small_loop().site, ["CAN", "AS-i", "home runs", "junction boxes"])
    assert turned.tornado().between == ("home runs",)
    fast = IoList.parse("tag,signal,x,y,z,update\nL-1,contact,5,2,3,1\nL-2,contact,6,2,3,1\n")
    conclusion = fast.compare(small_loop().site, ["home runs", "Modbus RTU"]).conclusions()[1]
    assert conclusion.startswith(
        "Modbus RTU leaves out 2 of 2 points: L-1 needs an update every 1 ms;"
    )
    assert conclusion.endswith("(and 1 more).")


def test_wrong_arguments_are_named():
    design = small_loop()
    with pytest.raises(ArgumentError, match="one or more"):
        compare([])
    with pytest.raises(ArgumentError, match="with different names"):
        compare([design, design])
    comparison = compare([design])
    assert set(CRITERIA) <= set(comparison.table().columns)
    for columns in (["mass"], ["mass", "cables"]):
        with pytest.raises(ArgumentError, match="x is 'mass'"):
            comparison.plot(*columns)


def test_the_cabinet_of_the_example_ship_is_found_from_its_home_runs():
    fit = find_cabinet(SHIP)
    assert fit.place == (26.0, 6.0, 14.0)
    assert fit.misfit < 0.05
    assert "half of which agree within 0.1 m" in str(fit)


def test_an_ambiguous_position_of_the_cabinet_is_reported():
    assert find_cabinet(SHIP).settled
    points = SHIP.points
    for system in ("Ballast valve", "Main engine", "Fire damper"):
        part = find_cabinet(IoList.from_table(points[points["system"] == system]))
        assert not part.settled
        assert "other positions fit too" in str(part)


@pytest.mark.parametrize("seed", range(4))
def test_a_cabinet_is_found_at_the_origin_of_the_lengths(seed):
    rng = np.random.default_rng(seed)
    points = SHIP.points.sample(60, random_state=seed).reset_index(drop=True)
    some = replace(SHIP, points=points)
    cabinet = rng.uniform([0, -10, 0], [180, 10, 20]).round(1)
    length = 1.15 * np.abs(some.places - cabinet).sum(axis=1) + 5
    # One length in ten is that of another route.
    length = np.where(rng.random(60) < 0.1, 1.3 * length, length).round(1)
    fit = find_cabinet(replace(some, points=points.assign(home_run_m=length)))
    assert np.abs(np.array(fit.place) - cabinet).max() <= 0.1 + 1e-9


def test_a_cabinet_cannot_be_found_without_lengths():
    with pytest.raises(ArgumentError, match="4 are needed"):
        find_cabinet(small_loop().iolist)


def small(cabinet=(0, 0, 0), name=None, **settings):
    """Return a plan of three contacts for a cabinet and some settings."""
    iolist = IoList.parse("tag,signal,x,y,z\n" + "".join(f"L-{n},DI,{n},2,3\n" for n in range(3)))
    return iolist.plan("home runs", cabinet, settings=settings, name=name)


@pytest.mark.parametrize(
    ("other", "what"),
    [
        (small((9, 0, 0), "b"), "cabinet"),
        (small(name="b", detour=1.5), "detour"),
        (small(name="b", tails=1), "tails"),
        (small(name="b", assumptions={"gland": 5}), "assumptions"),
    ],
)
def test_designs_with_other_cabinets_or_prices_are_refused(other, what):
    with pytest.raises(ArgumentError, match=f"'b' and 'home runs' differ in {what}"):
        compare([small(), other])


def test_designs_with_other_limits_are_compared_and_distinguished():
    both = compare([small(), small(name="spare", spare=0.5)])
    (row,) = both.changes().to_dict("records")
    assert (row["name"], row["value"], row["designs"]) == ("spare", 0.5, "spare")
    assert "changed: spare 0.5 (default 0.2), spare" in str(both)
    assert both.ok and both.best.name in both.designs and "EUR" in both.verdict


def test_a_comparison_is_saved_as_tables(tmp_path):
    both = compare([small(), small(name="b/c")])
    both.save(tmp_path / "all")
    names = {path.name for path in (tmp_path / "all").iterdir()}
    assert names == {
        "comparison.csv",
        "findings.csv",
        "failures.csv",
        "reading.csv",
        "home runs",
        "b-c",
    }
    cables = pd.read_csv(tmp_path / "all" / "b-c" / "cables.csv")
    assert len(cables) == 3
    assert (tmp_path / "all" / "b-c" / "settings.toml").read_text() == both.settings.text()


def test_the_draws_are_the_same_each_time():
    both = compare([small(), small(name="b")], rng=np.random.default_rng(3))
    more = both.add(small(name="c"))
    pd.testing.assert_frame_equal(
        more.likely().loc[["home runs"]], both.likely().loc[["home runs"]]
    )


@pytest.mark.parametrize(("option", "limit"), [("AS-i", 0.7), ("CAN", 0.51)])
def test_the_price_of_a_response_limit_is_the_difference_from_the_plan_without_it(option, limit):
    rules = RuleSet((Rule("shown", "response", limit, host=True, confirmed="yes"),))
    iolist = ship(40)
    comparison = iolist.compare((0, 0, 0), ["home runs", option], rules=rules)
    design, loose = comparison.designs[option], iolist.plan(option, (0, 0, 0))
    more = comparison.quantities[option]["total_cost_eur"] - loose.quantities()["total_cost_eur"]
    assert more > 0 and design.check(rules).ok and not loose.check(rules).ok
    sentence = f"{option} costs {number(more)} EUR more than without the rules' response limits."
    assert sentence in comparison.conclusions()
    again = comparison.plan(option, name="again")
    assert again.points["response_ms"].equals(design.points["response_ms"])
    priced = design.priced(Settings({"assumptions.labour_rate": 0}))
    assert priced.without_limits.settings is priced.settings


def test_the_price_of_barriers_in_the_cabinet_is_the_difference_from_barriers_in_boxes():
    iolist = IoList.parse("tag,signal,x,y,z\nA,4-20mA Ex ia,20,0,0\nB,contact,21,0,0")
    inside, outside = (
        iolist.compare((0, 0, 0), ["home runs", "CAN"], settings={"field_barriers": field})
        for field in (False, True)
    )
    more = number(
        inside.quantities["CAN"]["total_cost_eur"] - outside.quantities["CAN"]["total_cost_eur"]
    )
    head = "Intrinsically safe points: 1, each with a barrier in"
    assert (
        f"{head} the cabinet; CAN costs {more} EUR more than with field_barriers, which connects "
        "such points to the bus." in inside.conclusions()
    )
    assert (
        f"{head} its box; CAN costs {more} EUR less than with home runs to barriers in the "
        "cabinet." in outside.conclusions()
    )
    hardwired = iolist.compare((0, 0, 0), ["home runs"])
    assert f"{head} the cabinet." in hardwired.conclusions()
    assert not any("safe" in one for one in ship(4).compare((0, 0, 0)).conclusions())
