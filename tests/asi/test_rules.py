from dataclasses import replace

import numpy as np
import pytest
from pandas.testing import assert_frame_equal

from shipnet import datasets
from shipnet.asi.master import Master
from shipnet.asi.plan import Plan
from shipnet.asi.receiver import TOLERANCE
from shipnet.asi.rules import meets, rule_limits
from shipnet.asi.segment import Repeater, Supply, Terminator
from shipnet.asi.slave import Slave
from shipnet.asi.timing import MASTER_PAUSE_BITS, Cycle, Transaction
from shipnet.asi.topologies import line, ring, star
from shipnet.errors import ArgumentError
from shipnet.line.network import CableRun
from tests.asi.lines import renamed

SHARED, ALONE = "S-0.A", "S-0.F"
NUMBERS = datasets.read("icn2007_numbers.csv").set_index("parameter")["value"]


def check(plan, **options):
    found = plan.check(**options)
    table = found.table()
    if not {"wanted_cycle", "transaction"} & set(options):
        assert meets(plan.lines, options.get("limits", rule_limits())) == found.ok
    return table.assign(passed=table["verdict"] == "met")


def failed(plan, **options):
    table = check(plan, **options)
    return sorted(table.loc[~table["passed"], "rule"].unique())


def of(plan, rule, **options):
    table = check(plan, **options)
    return table[table["rule"] == rule]


def changed(plan, **kinds):
    """Return a plan with some kinds of element replaced."""
    names = ("cables", "masters", "supplies", "slaves", "repeaters", "terminators")
    return Plan(**{name: kinds.get(name, getattr(plan, name)) for name in names})


def chain(segments, length=100.0, **options):
    """Return segments in series, each with a slave at its end."""
    plan = line(length, [length], **options)
    for number in range(2, segments + 1):
        near = f"{length:g} m" if number == 2 else f"{number - 1}: {length:g} m"
        far = line(length, [length], **options)
        plan = plan.with_repeater(near, far, prefix=f"{number}: ")
    return plan


# The structures that icn2007, section 4, allows.

UNEVEN = np.arange(1, 63) / np.arange(1, 63).sum()
ALLOWED = {
    "100 m and a slave at its end": line(100, [100]),
    "90 m and a star of 62": star(90, [10 / 62] * 62, supply=90),
    "star of 62 and the master, equal legs": star(100 / 63, [100 / 63] * 62),
    "star of 62, unequal legs": star(1, list(99 * UNEVEN)),
    "62 along a line, evenly": line(100, 62, supply=50),
    "62 along a line, unevenly": line(100, [100 * (k / 62) ** 2 for k in range(1, 63)], supply=50),
    "a mixture": star(70, [1.5] * 20, along=42, supply=35),
    "a passive ring": ring(100, 62),
}


@pytest.mark.parametrize("name", ALLOWED)
def test_the_structures_that_icn2007_allows_meet_every_rule(name):
    plan = ALLOWED[name]
    assert plan.segments[0].length <= 100 + 1e-9
    assert len(plan.slaves) in (1, 62)
    assert failed(plan) == []


def test_the_place_of_the_supply_decides_if_62_slaves_have_enough_voltage():
    # The same cable and slaves as above, with the supply at the master.
    assert failed(star(90, [10 / 62] * 62)) == ["slave_voltage"]
    assert failed(line(100, 62)) == ["slave_voltage"]
    lowest = of(line(100, 62), "slave_voltage")["value"].min()
    assert lowest == pytest.approx(30 - 0.027 * 0.065 * 100 * (62 + 1) / 2)


# Repeaters and lengths.


@pytest.mark.parametrize(("segments", "breaks"), [(1, []), (2, []), (3, []), (4, True)])
def test_two_repeaters_reach_300_m_and_no_more(segments, breaks):
    plan = chain(segments)
    assert max(segment.reach for segment in plan.segments) == 100 * segments
    # The assumed delay of a bit time agrees with the rule: a third repeater is too slow as well.
    assert failed(plan) == (["answer_delay", "repeaters_in_series"] if breaks else [])


def test_a_master_in_the_middle_has_500_m_of_cable():
    middle = line(100, [], master=50, supply=50)
    for side, near in [("left", "0 m"), ("right", "100 m")]:
        arm = chain(2)
        middle = middle.with_repeater(near, arm, prefix=f"{side} ")
    assert sum(run.length for run in middle.cables) == 500
    assert max(segment.reach for segment in middle.segments) == 250
    assert failed(middle) == []


@pytest.mark.parametrize("metres", range(100, 201, 20))
@pytest.mark.parametrize("slaves", [2, 8, 16])
def test_a_terminated_line_of_200_m_meets_all_limits(metres, slaves):
    plan = line(metres, slaves, current=0.02)
    ended = changed(plan, terminators=[Terminator(f"{metres} m")])
    assert ended.check().ok


def test_the_check_explains_what_a_terminator_costs():
    resistor = line(120, 8, terminator=100.0).check().violated().set_index("rule")["why"]
    assert "use a smaller inductance" in resistor["ringing"].iloc[0]
    crowded = changed(line(200, 31, current=0.01), terminators=[Terminator("200 m")])
    assert crowded.check().violated()["rule"].unique().tolist() == ["signal_level_least"]
    assert "use fewer slaves" in crowded.check().violated()["why"].iloc[0]


def test_a_terminator_allows_200_m_and_only_one_repeater_in_series():
    plan = changed(line(200, [200]), terminators=[Terminator("200 m")])
    assert "cable_length" not in check(plan)["rule"].tolist()
    assert of(plan, "cable_length_terminated").iloc[0]["passed"]
    long = changed(line(201, [201]), terminators=[Terminator("201 m")])
    assert not of(long, "cable_length_terminated").iloc[0]["passed"]
    for segments, good in [(2, True), (3, False)]:
        ended = changed(chain(segments), terminators=[Terminator("100 m")])
        rows = of(ended, "repeaters_in_series_terminated")
        assert rows["passed"].all() == good
        assert len(rows) == segments


def test_the_delay_of_a_repeater_is_added_both_ways():
    plan = chain(2)
    slow = changed(plan, repeaters=[replace(plan.repeaters[0], delay=18e-6)])
    one, other = (of(p, "answer_delay")["value"].iloc[1] for p in (plan, slow))
    assert other - one == pytest.approx(2 * (18 - 6) / 6)
    # 27.75 us of a slave that is not synchronous, 6.5 ns/m there and back, 6 us each way.
    assert one * 6 == pytest.approx(27.75 + 2 * 200 * 6.5e-3 + 2 * 6)
    assert failed(slow) == ["answer_delay"]
    note = of(plan, "answer_delay")["why"].iloc[1]
    assert note == f"each repeater may delay signals by up to {(60 - 27.75 - 2.6) / 2:.1f} us"


# Addresses.


def plan_of(*slaves):
    return changed(line(30, [30]), slaves=[Slave(*given, node="30 m") for given in slaves])


@pytest.mark.parametrize(
    ("slaves", "breaks"),
    [
        ([("1",), ("2",), ("31",)], []),
        ([("1A",), ("1B",)], []),
        ([("1A", SHARED), ("2",)], []),
        ([("5",), ("5",)], ["sharing"]),
        ([("5",), ("5A",)], ["sharing"]),
        ([("5",), ("5B",)], ["sharing"]),
        ([("5A",), ("5A",)], ["sharing"]),
        ([("0",)], ["address"]),
        ([("1A", ALONE)], ["half"]),
        ([("1", SHARED)], ["half"]),
    ],
)
def test_addresses(slaves, breaks):
    assert failed(plan_of(*slaves)) == breaks


def test_lines_do_not_share_addresses_with_each_other():
    first, second = renamed(line(30, [30]), "a "), renamed(line(30, [30]), "b ")
    both = Plan(
        [*first.cables, *second.cables],
        [*first.masters, *second.masters],
        [*first.supplies, *second.supplies],
        [*first.slaves, *second.slaves],
    )
    assert failed(both) == []
    assert of(both, "masters")["object"].tolist() == [
        "line of master at a 0 m",
        "line of master at b 0 m",
    ]


def test_the_wanted_cycle_is_that_of_the_slowest_slave():
    plan = plan_of(("1A",), ("1B",), ("2",))
    row = of(plan, "update_time", wanted_cycle=1.3e-3).iloc[0]
    assert row["value"] == pytest.approx(2 * 4 * 156e-6)
    assert row["passed"]
    assert failed(plan, wanted_cycle=1.2e-3) == ["update_time"]
    assert "update_time" not in check(plan)["rule"].tolist()
    short = Transaction(2, 2)
    full = ALLOWED["90 m and a star of 62"]
    assert failed(full, wanted_cycle=10e-3, transaction=short) == []
    assert failed(full, wanted_cycle=10e-3) == ["update_time"]
    assert Cycle(62).update_time() > 10e-3


# Supplies, masters, signals.


def test_supplies():
    plan = line(30, [30], current=2.0)
    assert failed(changed(plan, supplies=[Supply("0 m", 30, 2.0)])) == ["supply_rating"]
    assert failed(changed(plan, supplies=[Supply("0 m", 24, 8.0)])) == [
        "slave_voltage",
        "supply_voltage",
    ]
    strong = line(10, [10, 10], current=4.1)
    assert failed(changed(strong, supplies=[Supply("0 m", 30, 20.0)])) == ["supply_current"]


@pytest.mark.parametrize("count", [0, 2])
def test_a_segment_with_another_number_of_supplies_has_no_voltages(count):
    plan = changed(line(30, [30]), supplies=[Supply("0 m"), Supply("30 m")][:count])
    table = check(plan)
    wrong = table[~table["passed"]].set_index("rule")
    assert wrong.loc["supplies", "value"] == count
    # One row says why, and no row has a voltage or a signal.
    assert wrong.index.tolist() == ["supplies", "voltages_and_signals"]
    assert wrong.loc["voltages_and_signals", "why"] == f"{count} supplies in the segment"
    assert not table["value"].isna().sum() > 1
    assert not table["rule"].isin(["slave_voltage", "signal_level_least", "reception"]).any()


def test_a_line_with_another_number_of_masters():
    none = changed(line(30, [30]), masters=[])
    assert failed(none) == ["masters", "voltages_and_signals"]
    assert of(none, "voltages_and_signals")["why"].item() == "no master on the line"
    assert of(none, "slave_voltage")["passed"].item()
    assert of(none, "masters")["object"].item() == "line with segment at 0 m"
    two = changed(line(30, [30]), masters=[Master(node="0 m"), Master(node="30 m")])
    assert failed(two) == ["masters"]


def test_a_master_far_from_the_supply_hears_too_much():
    plan = line(100, [1, 40, 80], supply=100)
    assert failed(plan) == ["signal_level_most"]
    assert of(plan, "signal_level_most")["passed"].tolist() == [False, False, True]


# The table and its limits.


def test_the_limits_are_those_that_other_parts_use():
    limits = rule_limits()
    assert limits.loc["signal_evenness", "low"] == TOLERANCE.evenness
    assert limits.loc["ringing", "high"] == TOLERANCE.ringing
    assert limits.loc["answer_delay", "high"] == MASTER_PAUSE_BITS[1]
    total = float(NUMBERS["total cable length of a network, taps included"])
    assert limits.loc["cable_length", "high"] == total
    assert limits.loc["slaves", "high"] == float(NUMBERS["slaves of one master"])
    # A drop of 3 V is left between the lowest supply voltage and a slave's lowest voltage.
    least = limits["low"]
    assert least["supply_voltage"] - least["slave_voltage"] == 3.0


def test_every_rule_has_a_source_and_every_row_its_rule():
    limits = rule_limits()
    assert limits["source"].str.len().gt(3).all()
    assert limits.index.is_unique
    ended = changed(chain(2), terminators=[Terminator("100 m")])
    unfed = changed(line(9, [9]), supplies=[])
    plans = (ended, {"wanted_cycle": 1.0}), (line(9, [9]), {}), (unfed, {})
    used = {rule for plan, options in plans for rule in check(plan, **options)["rule"]}
    assert used == set(limits.index)


def test_limits_may_have_another_order_and_further_rules():
    plan, limits = line(120, [60, 120]), rule_limits()
    more = limits.iloc[::-1]
    more.loc["further"] = limits.loc["ringing"]
    assert_frame_equal(plan.check(limits=more).table(), plan.check().table())


def test_the_worst_row_of_each_rule():
    plan = line(100, [1, 40, 80], supply=100)
    table, found = check(plan, wanted_cycle=1e-3), plan.check(wanted_cycle=1e-3).worst()
    graded = found["margin"].dropna()
    assert graded.is_monotonic_increasing and found["margin"][: len(graded)].notna().all()
    # Those that are met or not are separate, at the end.
    apart = {"masters", "address", "sharing", "half", "supplies", "reception"}
    assert set(found.index[len(graded) :]) == apart
    assert found.index.is_unique and set(found.index) == set(table["rule"])
    assert found.loc["signal_level_most", "object"] == "slave 1 at 1 m"
    assert found.loc["signal_level_most", "margin"] < 0
    for rule, row in found.iterrows():
        rows = table[table["rule"] == rule]
        if rule not in apart:
            assert (row["margin"] >= 0) == rows["passed"].all() or abs(row["margin"]) < 1e-9
    lost = changed(line(30, [30]), supplies=[]).check().worst()
    assert lost.index[0] == "voltages_and_signals"
    assert lost.loc["supplies", "margin"] < 0


@pytest.mark.parametrize("wanted", [0, -1, float("nan"), float("inf")])
def test_illegal_cycles_are_refused(wanted):
    with pytest.raises(ArgumentError, match="wanted_cycle is"):
        check(line(9, [9]), wanted_cycle=wanted)


def test_limits_that_lack_something_are_refused():
    with pytest.raises(ArgumentError, match="limits lack ringing"):
        check(line(9, [9]), limits=rule_limits().drop("ringing"))
    with pytest.raises(ArgumentError, match="limits lack high"):
        check(line(9, [9]), limits=rule_limits().drop(columns="high"))


def test_the_smallest_plan():
    plan = Plan([CableRun("a", "b", 1)], [Master(node="a")], [Supply("b")])
    assert failed(plan) == []
    bare = check(Plan([CableRun("a", "b", 1)]))
    wrong = sorted(bare.loc[~bare["passed"], "rule"])
    assert wrong == ["masters", "supplies", "voltages_and_signals"]
    assert Repeater("a", "b").delay == 6e-6
