"""Rules as data, the values computed for them, and the verdicts."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shipnet import datasets
from shipnet.design.failures import lost
from shipnet.design.iolist import IoList
from shipnet.design.layout import Site
from shipnet.design.planning import plan
from shipnet.design.rules import APPLIES, MEASURES, RULE_SETS, Rule, RuleSet
from shipnet.design.settings import Settings
from shipnet.errors import ArgumentError, InputError
from shipnet.modbus.faults import Break
from shipnet.modbus.pdu import Request
from shipnet.modbus.polling import Poll
from shipnet.modbus.redundancy import Loop
from shipnet.modbus.uart import SerialLine
from tests.design.lists import small_loop
from tests.modbus.sweeps import sweep

ONE_LINE, TWO_LINES = small_loop(), small_loop(redundant=True)


def checked(design, rules="DNV", **more):
    """Return the result of a check of a design; a tuple is a rule set of its own."""
    return design.check(RuleSet(rules) if isinstance(rules, tuple) else rules, **more).table()


def judged(design, measure, limit, **words):
    words = {"confirmed": "yes", **words}
    return checked(design, (Rule("r", measure, limit, **words),)).iloc[0]


def test_lee2012_is_quoted_in_the_words_of_the_engine():
    rules = RuleSet.published("lee2012")
    quoted = datasets.read("lee2012_class_rules.csv")[["rule", "asks"]]
    assert [[rule.rule, rule.asks] for rule in rules] == quoted.to_numpy().tolist()


@pytest.mark.parametrize("rule_set", RULE_SETS)
def test_an_unread_rule_is_never_met_and_a_read_one_has_a_source(rule_set):
    for design in (ONE_LINE, TWO_LINES):
        table = checked(design, rule_set)
        open_ = table[table["confirmed"] == "no"]
        assert set(open_["verdict"]) <= {"not verified"}
        computed = open_[open_["value"].notna()]
        assert computed["why"].str.match("would be (met|violated)").all()
        assert (table["source"] != "").all() and (table["clause"] != "").all()
        assert (table.loc[table["value"].isna(), "verdict"] == "not verified").all()
        assert (table["why"] != "").all()


def test_a_rule_is_met_once_it_is_confirmed():
    (rule,) = (r for r in RuleSet.published("lee2012") if r.rule == "links duplicated")
    design = TWO_LINES
    assert checked(design, (rule,))["verdict"].item() == "not verified"
    assert checked(design, (replace(rule, confirmed="yes"),))["verdict"].item() == "met"
    assert checked(ONE_LINE, (replace(rule, confirmed="yes"),))["verdict"].item() == "violated"


def test_a_limit_from_a_manufacturer_is_judged_and_the_verdict_says_where_it_is_from():
    rule = Rule("answer", "response", 1.0, confirmed="maker")
    for limit, verdict in ((1.0, "met"), (0.1, "violated")):
        row = checked(ONE_LINE, (replace(rule, limit=limit),)).iloc[0]
        assert (row["verdict"], row["confirmed"]) == (verdict, "maker")
        assert row["why"] == (
            "0.18 s to the host; the limit is from a manufacturer's document; no standard was read "
            "for it"
        )
    # Here the limits are from a manufacturer's document, not from the standard or the settings.
    found = checked(ONE_LINE, "NMEA 2000")
    assert set(found["confirmed"]) == {"maker"}
    assert found.loc[found["value"].notna(), "why"].str.contains("no standard was read").all()


def test_the_host_time_is_added_only_if_the_rule_includes_it():
    rule = Rule("alarm", "response", 0.7, confirmed="yes", host=True)
    assert checked(ONE_LINE, (rule,))["value"].item() == pytest.approx(0.18 + Settings().host_time)
    assert checked(ONE_LINE, (rule,), host_time=0.53)["verdict"].item() == "violated"
    assert judged(ONE_LINE, "response", 0.18)["value"] == pytest.approx(0.18)


def test_the_bound_decides_whether_a_value_on_the_limit_meets_it():
    design = ONE_LINE
    verdicts = [
        judged(design, "lines of a link", 1.0, bound=bound)["verdict"]
        for bound in ("at most", "below", "at least")
    ]
    assert verdicts == ["met", "violated", "met"]


def test_a_point_without_a_response_leaves_a_pass_open_but_not_a_fail():
    design = ONE_LINE
    points = design.points.assign(response_ms=[180.0, np.nan, 180.0, 180.0])
    partly = replace(design, points=points)
    assert judged(partly, "response", 2.0)["verdict"] == "not verified"
    assert "1 points have no response time" in judged(partly, "response", 2.0)["why"]
    assert judged(partly, "response", 0.1)["verdict"] == "violated"
    none = replace(design, points=points.assign(response_ms=np.nan))
    assert judged(none, "response", 2.0)["verdict"] == "not verified"


def test_a_point_is_fast_if_it_is_updated_at_least_every_100_ms():
    points = ONE_LINE.points.assign(update_ms=[10.0, 100.0, 101.0, np.nan])
    assert APPLIES["fast"](points).tolist() == [True, True, False, False]


def test_hardwired_points_respond_at_once():
    design = ONE_LINE
    points = design.points.assign(bus="hardwired", response_ms=np.nan)
    assert judged(replace(design, points=points), "response", 0.0)["value"] == 0.0


def test_a_rule_counts_only_the_points_to_which_it_applies():
    design = ONE_LINE
    outputs = design.iolist.points["type"].isin(["DO", "AO"])
    assert not outputs.any()
    row = judged(design, "response", 2.0, applies="outputs")
    assert (row["verdict"], row["why"]) == ("not verified", "the list has no such point")
    # LS-4, of category I, is on the cable that loses the most points.
    assert judged(design, "points lost by a cable", 0.0)["value"] == 4
    assert judged(design, "points lost by a cable", 0.0, applies="essential")["value"] == 3


def test_losses_agree_with_the_failures():
    design = TWO_LINES
    assert judged(design, "points lost by a cable", 0.0)["value"] == 1  # a drop
    stations = design.devices.query("kind == 'station'")["device"]
    worst = max(len(lost(design, devices=[name])) for name in stations)
    assert judged(design, "points lost by a station", 0.0)["value"] == worst
    assert judged(design, "points lost by a supply", 0.0)["verdict"] == "not verified"
    assert judged(design, "points lost by a device", 9.0)["object"] == "master"


def test_two_essential_systems_on_one_line_violate_the_rule():
    row = checked(ONE_LINE, "IMO").set_index("rule").loc["shared link redundant"]
    assert (row["value"], row["verdict"]) == (2, "violated")
    assert "Cooling, Fuel oil" in row["why"]  # Bilge is of category I
    row = checked(TWO_LINES, "IMO").set_index("rule").loc["shared link redundant"]
    assert (row["value"], row["verdict"]) == (0, "met")


def test_unnamed_systems_do_not_count_as_one():
    design = ONE_LINE
    unnamed = replace(design.iolist, points=design.iolist.points.assign(system=""))
    row = judged(replace(design, iolist=unnamed), "systems on one link", 1.0)
    assert (row["verdict"], row["why"]) == (
        "not verified",
        "the list names no system for 4 points lost in a failure",
    )
    partly = design.iolist.points.assign(system=["", "", "Fuel oil", "Bilge"])
    row = judged(replace(design, iolist=replace(unnamed, points=partly)), "systems on one link", 1)
    assert (row["value"], row["verdict"]) == (2, "violated")
    # A cut without lost points loses no system, named or not.
    both = replace(TWO_LINES, iolist=unnamed)
    assert judged(both, "systems on one link", 1.0)["verdict"] == "met"
    row = judged(design, "systems on one link", 1.0, applies="category III")
    assert (row["verdict"], row["why"]) == ("not verified", "the list has no such point")


@pytest.mark.parametrize("measure", sorted(set(MEASURES) - {"unconnected points"}))
def test_a_rule_is_not_met_while_a_point_concerned_is_left_out(measure):
    design = TWO_LINES
    out = design.points.assign(fits=False, bus="", segment="", device="", response_ms=np.nan)
    partly = design.points.assign(fits=[True, True, False, True])
    nothing = {table: getattr(design, table).iloc[:0] for table in ("cables", "segments")}
    nothing["devices"] = design.devices[design.devices["kind"] == "cabinet"]
    for left in (replace(design, points=out, **nothing), replace(design, points=partly)):
        row = judged(left, measure, 1e9)
        assert row["verdict"] in ("not verified", "violated"), row["why"]
        assert row["why"] != ""
    left = replace(design, points=design.points.assign(fits=[True, True, True, False]))
    row = judged(left, "late points", 0.0, applies="essential")  # the bilge is of category I
    assert row["verdict"] == "met"


def planned(option, signals=("contact",) * 3, **settings):
    rows = [f"P-{n},{signal},{40 * n},0,0" for n, signal in enumerate(signals, 1)]
    iolist = IoList.parse("\n".join(["tag,signal,x,y,z", *rows]))
    return plan(iolist, Site((0, 0, 0)), option, settings=Settings(settings))


def test_the_switch_over_of_a_loop_takes_as_long_as_in_the_simulation():
    design = planned("Modbus RTU doubled")
    row = judged(design, "switch-over", 5.0, confirmed="yes")
    line = SerialLine(9600)
    wait = 1.005 + line.frame_time(256)
    poll = Poll(Request.read_input_registers(0, 1), line, processing=0.005, timeout=wait)
    loop = Loop(3, poll)
    assert row["value"] == pytest.approx(sweep(loop, [Break(0)]).max())
    assert row["verdict"] == "met"
    assert judged(design, "switch-over", 3.0, confirmed="yes")["verdict"] == "violated"


def test_a_link_with_one_line_never_switches_over_and_can_has_nothing_to_switch():
    row = judged(planned("Modbus RTU"), "switch-over", 60.0, confirmed="yes")
    assert (row["value"], row["verdict"], row["object"]) == (np.inf, "violated", "Modbus 1")
    row = judged(planned("CAN doubled"), "switch-over", 0.0, confirmed="yes")
    assert (row["value"], row["verdict"]) == (0.0, "met")
    assert (
        judged(planned("home runs"), "switch-over", 0.0)["why"] == "no data link has such a point"
    )
    row = judged(TWO_LINES, "switch-over", 60.0, confirmed="yes")
    assert row["verdict"] == "not verified" and "the plan does not show" in row["why"]
    outputs = judged(planned("CAN doubled"), "switch-over", 0.0, applies="outputs")
    assert outputs["verdict"] == "not verified"


def test_a_supply_changes_over_only_if_another_feeds_in_parallel():
    for option, computed, verdict in (("CAN doubled", 0.0, "met"), ("CAN", np.inf, "violated")):
        design = planned(option)
        row = judged(design, "supply change-over", 2.0, confirmed="yes")
        assert (row["value"], row["verdict"]) == (computed, verdict)
    asi = planned("AS-i", ("contact", "solenoid"))
    assert judged(asi, "supply change-over", 2.0, confirmed="yes")["verdict"] == "violated"
    none = judged(planned("home runs"), "supply change-over", 2.0, confirmed="yes")
    assert (none["verdict"], none["why"]) == ("not verified", "no supply is planned")


def test_standards_and_checksums_of_buses_are_known():
    design = ONE_LINE
    assert judged(design, "bit errors unseen", 0.0)["value"] == 0
    asi = replace(design, segments=design.segments.assign(bus="AS-i"))
    assert judged(asi, "bit errors unseen", 0.0)["verdict"] == "violated"
    assert judged(asi, "links without a standard", 0.0)["why"] == "AS-i: IEC 62026-2"
    can = replace(design, segments=design.segments.assign(bus="CAN"))
    assert judged(can, "repeats", 1.0, bound="at least")["verdict"] == "met"
    assert judged(design, "repeats", 1.0, bound="at least")["verdict"] == "not verified"
    hardwired = replace(design, segments=design.segments.assign(bus="hardwired"))
    for measure in ("bit errors unseen", "lines of a link", "repeats"):
        assert judged(hardwired, measure, 0.0)["why"] == "no data link"


def test_points_that_are_late_or_fit_nowhere_are_counted():
    design = ONE_LINE
    points = design.points.assign(response_ms=[600.0, 600.0, 1200.0, 600.0])
    points["fits"] = [True, True, False, True]
    other = replace(design, points=points)
    row = judged(other, "late points", 0.0)
    assert (row["value"], row["object"]) == (2, "PS-1")
    row = judged(other, "unconnected points", 0.0)
    assert (row["value"], row["object"]) == (1, "TT-3")


@pytest.mark.parametrize("measure", MEASURES)
@pytest.mark.parametrize("applies", APPLIES)
def test_every_measure_has_a_result_for_every_kind_of_point(measure, applies):
    row = judged(ONE_LINE, measure, 0.0, applies=applies)
    assert row["verdict"] in ("met", "violated", "not verified")
    assert np.isnan(row["value"]) or row["value"] >= 0
    assert row["unit"] == MEASURES[measure].unit


def test_own_rules_are_read_in_any_order(tmp_path):
    file = tmp_path / "own.csv"
    file.write_text(
        "Limit;RULE;measure;Confirmed;applies\n0,5;quick;response;Yes;Inputs\n"
        "2;two lines;lines of a link;no;\n",
        encoding="utf-8",
    )
    quick, lines = RuleSet.read(file)
    assert (quick.limit, quick.confirmed, quick.applies) == (0.5, "yes", "inputs")
    assert (lines.confirmed, lines.bound) == ("no", "at most")
    assert checked(ONE_LINE, str(file))["verdict"].tolist() == ["met", "not verified"]
    assert RuleSet.of(file).rules == (quick, lines)


def test_all_faults_of_a_file_are_reported_at_once(tmp_path):
    file = tmp_path / "own.csv"
    file.write_text(
        "rule,measure,limit,unit,bound,confirmed,applies\n"
        "a,respons,2,s,at most,yes,all\n"
        "b,response,fast,s,at most,perhaps,all\n"
        "c,response,-1,s,about,no,pumps\n"
        ",late points,0,,,,\n"
        "d,late points,0,,,,,7\n"
        "e,late points,0,,,,\n"
        "e,late points,1,,,,\n",
        encoding="utf-8",
    )
    with pytest.raises(InputError) as error:
        RuleSet.read(file)
    told = error.value.faults
    expected = [
        "row 2: measure is 'respons'",
        "row 3: limit is 'fast'",
        "row 3: confirmed is 'perhaps'",
        "row 4: limit is -1;",
        "row 4: applies is 'pumps'",
        "row 4: bound is 'about'",
        "row 5: rule is ''",
        "row 6 has 8 cells; expected 7",
        "rule 'e' is listed twice",
    ]
    assert len(told) == len(expected)
    assert all(t.startswith(e) for t, e in zip(told, expected, strict=True)), told
    file.write_text("rule,measure,limit,unit\na,response,2000,ms\n", encoding="utf-8")
    with pytest.raises(InputError, match="row 2: unit is 'ms'; it must be 's' for"):
        RuleSet.read(file)


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("", "is empty; expected a row of titles"),
        ("rule,limit\na,1\n", "no column measure"),
        ("rule,measure,limit,colour\na,,,red\n", "title 'colour' is unknown; expected one of rule"),
        ("rule,rule,measure,limit\na,b,,\n", "title 'rule' occurs twice"),
        ("rule,measure,limit\n", "has no rule"),
    ],
)
def test_a_file_without_rules_is_reported(text, fault, tmp_path):
    file = tmp_path / "own.csv"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=fault):
        RuleSet.read(file)


@settings(max_examples=30)
@given(
    st.binary(max_size=200)
    | st.text(max_size=200).map(lambda t: ("rule,measure,limit\n" + t).encode())
)
def test_any_bytes_are_read_as_rules_or_raise_an_input_error(tmp_path_factory, data):
    file = tmp_path_factory.getbasetemp() / "any rules.csv"
    file.write_bytes(data)
    try:
        assert RuleSet.read(file)
    except InputError as error:
        assert error.faults


def test_wrong_arguments_are_named():
    with pytest.raises(
        ArgumentError,
        match="'KR'; it must be one of DNV, BV, IMO, lee2012, supply, NMEA 2000, or a file",
    ):
        checked(ONE_LINE, "KR")
    with pytest.raises(ArgumentError, match="host_time"):
        checked(ONE_LINE, host_time=-1.0)
    with pytest.raises(ArgumentError, match="at least one Rule"):
        checked(ONE_LINE, ())
    with pytest.raises(InputError, match="cannot be read"):
        checked(ONE_LINE, "nowhere.csv")


def test_the_data_file_names_each_rule_once_in_its_set():
    rules = RuleSet.read(datasets.path("design_rules.csv"))
    assert {rule.rule_set for rule in rules} == set(RULE_SETS)
    for rule in rules:
        unread = "not read" in rule.source.split(";")[-1] or "not seen" in rule.source
        if unread and not rule.source.startswith("DNV-OS"):
            assert rule.confirmed != "yes"
