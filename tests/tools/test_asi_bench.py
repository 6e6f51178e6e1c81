"""The AS-i bench without a browser: states in, answers out."""

import json
from dataclasses import asdict
from math import isnan

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shipnet import asi
from shipnet.asi.receiver import matched_filter
from shipnet.errors import ArgumentError, InputError
from shipnet.tools._bench_devices import KINDS, LONGEST
from shipnet.tools._view import read_link, read_state, write_link, write_state
from shipnet.tools.asi_bench import FILTERED, STEP, TRIES, AsiBench, update

START = ("master@0", "supply@0", "scope@0")


def bench(*devices, **others):
    return AsiBench(devices=(*START, *devices), **others)


# The installation -------------------------------------------------------------------------------


@pytest.mark.parametrize("slaves", [1, 2, 31, 32, 62])
@pytest.mark.parametrize("ring", [False, True])
def test_evenly_spaced_slaves_are_the_plan_of_the_same_topology(slaves, ring):
    ours = bench(f"{slaves}*slave@100", ring=ring).plan
    textbook = asi.ring(100, slaves) if ring else asi.line(100, slaves)
    assert len(ours.slaves) == slaves and ours.cycle.time == textbook.cycle.time
    assert sum(run.length for run in ours.cables) == pytest.approx(100)
    if not ring:
        # Places are rounded to the centimetre.
        ours, textbook = (plan.quality() for plan in (ours, textbook))
        assert ours.evenness == pytest.approx(textbook.evenness, abs=1e-3)
        assert ours.ringing == pytest.approx(textbook.ringing, abs=1e-3)


def test_a_spur_is_a_cable_of_its_own_and_legs_make_a_star():
    star = bench(*["slave@90/2.5"] * 4, length=90)
    textbook = asi.star(90, [2.5] * 4)
    assert star.strengths.evenness == pytest.approx(textbook.quality().evenness, abs=0.05)
    assert star.result.table()["value"].tolist() == pytest.approx(
        textbook.check().table()["value"].tolist()
    )
    assert star.plan.segments[0].length == 100


def test_a_repeater_divides_the_cable_and_each_part_needs_a_supply():
    parts = bench("repeater@60", "slave@50", "slave@120", length=150)
    assert [segment.length for segment in parts.plan.segments] == [60, 90]
    weakest = update(asdict(parts))["arrays"]["weakest"]
    assert weakest[0] > 90 and isnan(weakest[1])
    (first, second) = parts.broken()
    assert first["text"].startswith("voltages and signals: not verified")
    assert second["text"].startswith("supplies: 0 at segment at 60 m, right")
    assert first["stretches"][0] == second["stretches"][0] == (60.0, 150.0)
    supplied = bench("repeater@60", "slave@50", "slave@120", "supply@100", length=150)
    assert supplied.broken() == [] and supplied.ok


def test_places_are_rounded_to_the_centimetre_so_that_close_devices_share_a_node():
    assert bench("3*slave@100").devices[3:] == ("slave@33.33", "slave@66.67", "slave@100")
    close = bench("slave@50.001", "slave@49.999", length=50.004)
    assert {slave.node for slave in close.plan.slaves} == {"50 m"} and close.length == 50


def test_a_device_beyond_the_end_is_at_the_end():
    beyond, end = (bench(f"slave@{place}", length=50).wave.u for place in (300, 50))
    assert beyond == pytest.approx(end)


@pytest.mark.parametrize(
    ("slaves", "pairs", "shared"), [(31, 0, 0), (31, 31, 15), (62, 0, 31), (40, 20, 20), (40, 3, 9)]
)
def test_pairs_shorten_the_cycle_but_are_polled_every_second_cycle(slaves, pairs, shared):
    tool = AsiBench(
        devices=("master@0", "supply@50", "scope@0", f"{slaves}*slave@100"), pairs=pairs
    )
    assert sum(slave.half == "B" for slave in tool.plan.slaves) == shared
    cycle = 1e3 * float(asi.cycle_time(slaves, pairs=shared))
    assert tool.numbers["cycle"].startswith(f"{cycle:.2f} ms")
    assert tool.numbers["polled every"] == f"{cycle * (2 if shared else 1):.2f} ms"
    assert f", {shared} of them shared" in tool.numbers["addresses"]
    assert tool.ok


# Signals ----------------------------------------------------------------------------------------


def test_the_scope_at_the_master_shows_what_the_plan_computes():
    shown = bench("slave@20", "slave@80", sender=2, data=9)
    times = {"dt": STEP, "before": 6e-6, "after": 28.8e-6}
    computed = shown.plan.waveform(asi.Response(9), "80 m", **times)
    assert shown.wave.u == pytest.approx(computed.u) and shown.wave.start == computed.start
    assert shown.reading == "read 0100101: response: 1001 (9)"


def test_a_resistor_at_the_end_absorbs_the_echo_and_a_terminator_is_the_makers():
    resistor = bench("slave@5", "resistor@300", length=300)
    judged = asi.line(300, [5], terminator=100).check().table()
    (ringing,) = judged.loc[judged["rule"] == "ringing", "value"]
    assert resistor.strengths.ringing == pytest.approx([ringing])
    assert resistor.reading.startswith("read 0011001")
    (plug,) = bench("slave@5", "terminator@300", length=300).plan.terminators
    assert plug == asi.Terminator("300 m")


def test_slave_and_scope_can_change_places_if_no_load_moves():
    loads = ("master@0", "supply@30", "slave@0", "slave@80")
    one = AsiBench(devices=(*loads, "scope@80"), sender=1)
    other = AsiBench(devices=(*loads, "scope@0"), sender=2)
    assert one.wave.u == pytest.approx(other.wave.u)


@pytest.mark.parametrize(
    ("scope", "slave", "part"),
    [
        (20, 90, ("master@0", "supply@10", "scope@20", "slave@40")),
        (50, 90, ("master@0", "supply@15", "scope@10", "slave@30")),
        (50, 20, ("master@30", "supply@15", "scope@10", "slave@0")),
        (90, 20, ("master@30", "supply@10", "scope@20", "slave@0")),
    ],
)
def test_from_another_segment_a_response_comes_through_the_repeater_between(scope, slave, part):
    others = ("supply@10", "repeater@40", "supply@55", "repeater@70", "supply@80", "slave@100")
    whole = AsiBench(devices=("master@0", f"scope@{scope}", f"slave@{slave}", *others))
    if slave == 90:
        whole = AsiBench(devices=(*whole.devices[:2], "slave@90", *others[:-1]))
    # In its segment, a repeater is a device like the others, which sends what it receives.
    alone = AsiBench(devices=part, length=40 if part[0] == "master@0" and scope == 20 else 30)
    assert whole.wave.u == pytest.approx(alone.wave.u)


def test_a_response_that_passes_no_supply_is_not_shown():
    tool = bench("repeater@40", "slave@90")
    answer = update(asdict(tool))
    assert tool.reading.startswith("not verified") and not answer["read_well"]
    assert np.isnan(answer["arrays"]["line"]).all() and np.isnan(answer["arrays"]["filtered"]).all()


def test_a_line_with_uneven_pulses_is_named_even_if_the_response_is_read():
    far = bench("slave@230", length=230)
    assert far.reading == "read 0011001: response: 0110 (6); pulses outside their tolerance"
    assert not update(asdict(far))["read_well"]
    assert update(asdict(bench("slave@5")))["read_well"]


def test_noise_hides_the_response_or_some_of_many():
    assert bench("slave@5", noise=10).reading.startswith("SilenceError: no pulse")
    lost = [
        int(bench("slave@5", noise=noise).numbers["lost in noise"].split()[0])
        for noise in (0.1, 0.9, 10)
    ]
    assert lost[0] == 0 < lost[1] < lost[2] == TRIES
    assert "lost in noise" not in bench("slave@5").numbers


def test_a_fault_that_no_check_finds_is_named(monkeypatch):
    monkeypatch.setattr(AsiBench, "received", bench("slave@5", data=0).received)
    shown = bench("slave@5")
    assert shown.reading == "read 0000001, but 0011001 was sent: the fault went undetected"
    assert not shown.answer()["read_well"]


def test_the_filter_reduces_the_noise_by_the_computed_ratio():
    noise = np.random.default_rng(1).normal(0, 1, (200, 4000))
    assert matched_filter(noise, STEP).std() == pytest.approx(FILTERED, rel=0.01)


# Rules ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("inputs", "violated"),
    [
        ({"devices": ("master@0", "supply@50", "scope@0", "62*slave@100")}, []),
        (
            {"devices": (*START, "62*slave@100")},
            ["slave voltage: 24.47 V at slave 31B at 100 m, at least 26.5 V"],
        ),
        ({"devices": (*START, "62*slave@100"), "ring": True}, []),
        ({"length": 300}, ["cable length: 300 m", "at most 100 m"]),
        ({"devices": (*START, "62*slave@100"), "current_ma": 200}, ["supply current", "at most 8"]),
    ],
)
def test_what_violates_a_rule_is_named(inputs, violated):
    tool = AsiBench(**inputs)
    assert tool.ok == (not violated) and all(part in tool.verdict for part in violated)
    assert tool.ok == tool.verdict.startswith("all rules met: ")


def test_a_rule_is_named_at_the_worst_device_and_marks_all_others():
    tool = bench("62*slave@100")
    (rule,) = tool.broken()
    worst, *every = rule["devices"]
    assert tool.devices[worst] == "slave@100" and len(every) == 38 and worst in every
    assert all(tool.devices[index].startswith("slave") for index in every)
    (length,) = bench("slave@5", length=120).broken()
    assert length["devices"] == [] and set(length["stretches"]) == {(0.0, 120.0)}


def test_the_strengths_and_voltages_are_those_that_the_rules_judge():
    tool = bench("62*slave@100", length=160)
    table = tool.result.table()
    for rule, key, scale in [("signal_evenness", "weakest", 100), ("ringing", "ringing", 100)]:
        judged = table.loc[table["rule"] == rule, "value"].to_numpy(float)
        assert update(asdict(tool))["arrays"][key] == pytest.approx(scale * judged, rel=1e-6)
    judged = table.loc[table["rule"] == "slave_voltage", "value"].to_numpy(float)
    assert update(asdict(tool))["arrays"]["volts"] == pytest.approx(judged, rel=1e-6)


def test_repeaters_that_delay_responses_too_long_are_named_instead_of_a_time():
    four = bench(*(f"repeater@{place}" for place in (20, 40, 60, 80)), "2*slave@100")
    assert "beyond the time-out" in four.numbers["input known after"]


def test_the_table_has_a_row_per_slave_with_units():
    table = bench("slave@20/3", "slave@80").table()
    assert table.index.tolist() == ["1", "2"]
    assert table["place_m"].tolist() == [20, 80] and table["spur_m"].tolist() == [3, 0]
    columns = ["voltage_V", "level_least_Vpp", "evenness", "ringing", "best_ms", "worst_ms"]
    assert set(columns) < set(table)
    files = bench("slave@20/3", "slave@80")._view().files
    assert files["slaves.csv"].decode("utf-8-sig").startswith("slave,place_m,spur_m,voltage_V")
    assert len(files["waveform.csv"].splitlines()) == 1 + bench("slave@5").wave.u.size


# States -----------------------------------------------------------------------------------------


def test_an_answer_is_plain_json_beside_its_arrays_of_float32():
    answer = update(json.loads(json.dumps(asdict(AsiBench()))))
    arrays = answer.pop("arrays")
    assert json.loads(json.dumps(answer)) == answer
    assert {array.dtype.str for array in arrays.values()} == {"<f4"}
    assert update({})["state"] == answer["state"]


DEVICES = st.lists(
    st.builds(
        lambda kind, place, spur: f"{kind}@{place:g}" + (f"/{spur:g}" if kind == "slave" else ""),
        st.sampled_from(sorted(KINDS)),
        st.floats(0, LONGEST).map(lambda place: round(place, 1)),
        st.integers(0, 30),
    ),
    max_size=12,
)


@settings(max_examples=40)
@given(devices=DEVICES, length=st.floats(10, 300), ring=st.booleans())
def test_any_devices_are_computed_or_refused_in_one_sentence(devices, length, ring):
    try:
        tool = AsiBench(
            devices=(*START[:1], "scope@0", "slave@9", *devices), length=length, ring=ring
        )
    except ArgumentError as error:
        assert "\n" not in str(error)
        return
    answer, view = tool.answer(), tool._view()
    assert len(tool.broken()) == len([*filter(str.strip, tool.result.broken)])
    assert view.verdict and len(answer["arrays"]["weakest"]) == len(answer["labels"])
    assert read_state(write_state("asi_bench", tool).encode(), "asi_bench", AsiBench) == [tool]


@pytest.mark.parametrize(
    ("state", "message"),
    [
        ({"devices": "slave@5"}, "devices is 'slave@5'"),
        ({"devices": [*START, 5]}, "one of devices is 5; it must be a kind and its place"),
        ({"devices": [*START, "slave@5 "]}, "one of devices is 'slave@5 '"),
        ({"devices": [*START, "slave@\u0665"]}, "one of devices"),
        ({"devices": [*START, "slave@1e9"]}, "one of devices"),
        ({"devices": [*START, "slave@" + "9" * 10**6]}, "one of devices"),
        ({"devices": [*START, "slave@nan"]}, "one of devices"),
        ({"devices": [*START, "slave@501"]}, "place of slave@501 is 501 m; it must be 0..500 m"),
        ({"devices": [*START, "slave@5/101"]}, "spur of slave@5/101 is 101 m"),
        ({"devices": [*START, "slave@5", "supply@5/3"]}, "spur of supply@5/3 is 3 m; it must be 0"),
        ({"devices": [*START, "99*slave@5"]}, "number of devices of kind slave is 99; .* 1..62"),
        ({"devices": START}, "number of devices of kind slave is 0"),
        ({"devices": ["scope@0", "slave@5"]}, "number of devices of kind master is 0"),
        ({"devices": [*START, "master@5", "slave@5"]}, "kind master is 2"),
        ({"devices": ["master@0", "slave@5"]}, "kind scope is 0"),
        (
            {"devices": [*START, "slave@5", "repeater@0"]},
            "repeaters are at 0 m; each must have its",
        ),
        ({"devices": [*START, "slave@5", "repeater@100"]}, "between the ends of the cable"),
        ({"devices": [*START, "slave@5", "2*repeater@50", "repeater@25"]}, "its own place"),
        ({"devices": [*START, "slave@5", "repeater@50"], "ring": True}, "ring is True"),
        ({"devices": [*START] * 9999}, "kind master is 9999"),
        ({"length": 1e999}, "length is inf"),
        ({"length": "100"}, "length is '100'"),
        ({"cable": ["nominal"]}, "cable is"),
        ({"sender": 0}, "sender is 0"),
        ({"__class__": 1}, "the state has a field '__class__'; its fields are devices, length"),
    ],
)
def test_an_illegal_state_is_refused_by_name(state, message):
    with pytest.raises(ArgumentError, match=message):
        update(state)


def test_a_link_carries_the_whole_state_of_62_slaves():
    devices = tuple(f"slave@{place}/{place % 7}" for place in range(1, 63))
    tool = bench(*devices, "repeater@70.5", length=90, data=3, noise=0.5)
    link = write_link(tool)
    query = link.split('href="?')[1].split('"')[0].replace("&amp;", "&")
    assert read_link(query, AsiBench) == [tool]
    with pytest.raises(InputError, match="the link: one of devices is 'slave'"):
        read_link("devices=slave", AsiBench)


# The page ---------------------------------------------------------------------------------------


@pytest.fixture
def page(monkeypatch):
    page = AsiBench().explore()
    page.sent = []
    monkeypatch.setattr(page.drawing, "send", lambda *message: page.sent.append(message))
    yield page
    page.close()


def tell(page, change, *, final, asked=1):
    page.drawing._handle_custom_msg({"asked": asked, "change": change, "final": final}, [])
    return page.sent[-1]


def test_a_drag_is_answered_at_once_and_changes_the_page_when_released(page):
    before = page.text
    devices = [*START, "62*slave@100"]
    content, buffers = tell(page, {"devices": devices}, final=False, asked=7)
    assert content["asked"] == 7 and "broken" not in content and page.text == before
    volts = np.frombuffer(buffers[content["names"].index("volts")], "<f4")
    assert len(volts) == 62 and volts.min() < 26.5
    content, _ = tell(page, {"devices": devices}, final=True, asked=8)
    assert content["asked"] == 8 and content["broken"][0]["text"].startswith("slave voltage")
    assert page.text.startswith("1. slave voltage: 24.47 V") and len(page.sent) == 2
    assert 'download="slaves.csv"' in page.links.value and "devices=master" in page.links.value


def test_a_refused_change_says_why_and_the_drawing_goes_back(page):
    bad = {"devices": [*START, "slave@5", "repeater@0"]}
    content, buffers = tell(page, bad, final=False)
    assert content["fault"].startswith("repeaters are at 0 m") and buffers == []
    content, _ = tell(page, bad, final=True)
    assert content["state"] == page.drawing._inputs.answer()["state"] and content["asked"] == 1
    assert page.note.startswith("repeaters are at 0 m") and page.inputs == AsiBench()


def test_a_slider_changes_the_drawing_unasked(page):
    page.controls["length"].value = 150.0
    ((content, _),) = page.sent
    assert content["asked"] is None and content["state"]["length"] == 150
    assert content["broken"][0]["text"].startswith("cable length: 150 m")
    content, _ = tell(page, {}, final=True)
    assert content["state"]["length"] == 150 and len(page.sent) == 2
