from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shipnet.engine.faults import (
    BusOff,
    CanBreak,
    DeadBox,
    DeadPort,
    LostCanFrames,
    LostModbusFrames,
    ModbusBreak,
    StuckSensor,
)
from shipnet.engine.simulation import simulate, single_failures
from shipnet.engine.system import System
from shipnet.errors import ArgumentError

PRINTED, RING, CORRECTED = System(), System(topology="ring"), System.corrected()
AT = 10.0
LOSSES = [LostCanFrames, LostModbusFrames]


def row(system, fault, **options):
    return single_failures(system, [fault], trials=3, **options).iloc[1]


@pytest.mark.parametrize(
    ("fault", "lost", "noticed"),
    [
        (CanBreak("JB1-JB2", start=AT), 56, "mark"),
        (CanBreak("JB2-JB3", start=AT), 38, "mark"),
        (DeadBox("JB1", start=AT), 43, "link, mark"),
        (DeadBox("JB2", start=AT), 18, "mark"),
        (BusOff("JB1", start=AT), 56, "mark"),
        (ModbusBreak("1", start=AT), 0, "link"),
        (ModbusBreak("2", start=AT), 0, "no"),
        (DeadPort("2", start=AT), 0, "no"),
        (StuckSensor("ME-JB2-044", start=AT), 1, "no"),
    ],
)
def test_what_the_printed_design_loses_and_notices(fault, lost, noticed):
    found = row(PRINTED, fault)
    assert (found["lost"], found["noticed"]) == (lost, noticed)
    assert found["answer_ok"]
    # Rule a is always met; rule b is violated by each value that is not marked in time, and by a
    # response that breaks off just before its end.
    assert found["age_ok"] == (lost == 0 and noticed == "no")
    assert found["oldest_s"] <= found["bound_s"]
    if noticed != "no" and lost:
        assert 2 < found["marked_after_s"] <= PRINTED.staleness_flag().after
        assert found["oldest_s"] <= PRINTED.staleness_flag().oldest


def test_the_corrected_design_shows_nothing_old_and_notices_all_but_a_stuck_sensor():
    table = single_failures(CORRECTED, trials=2)
    stuck = table.index.str.startswith("sensor")
    healthy = table.index == "none"
    assert table.loc[~stuck, "age_ok"].all()
    # Occasionally lost frames are replaced by the next ones, so no alarm is needed.
    passing = table.index.str.startswith("lost CAN frames")
    assert (table.loc[~stuck & ~healthy & ~passing, "noticed"] != "no").all()
    assert (table.loc[stuck | healthy, "noticed"] == "no").all()
    assert not table.loc[stuck, "age_ok"].any()
    cut = table.index.str.startswith("CAN cable")
    assert (table.loc[cut, "lost"] == 0).all()


MEETS = System(poll_period=0.4, update_period=0.25, stale_limit=0.6)


def test_the_verdict_on_the_age_comes_from_a_bound():
    channel = [ModbusBreak("1", start=AT), LostModbusFrames("1", start=AT, response=0.5)]
    for trials in (1, 3):
        assert not single_failures(PRINTED, channel, trials=trials)["age_ok"].iloc[1:].any()
    assert single_failures(MEETS, channel, trials=1)["age_ok"].all()


def worst_phases(system):
    """Return phases in which a poll misses the oldest value, the last to arrive, by 2 ns."""
    oldest = system.worst_age()["worst_s"].to_numpy().argmax()
    # All boxes queue at once, so the frame waits for all frames of higher priority.
    loops = system.loop_ns / 1e9
    phases = {box: 0.3 - loop for box, loop in zip(system.boxes, loops.tolist(), strict=True)}
    response = system.can_response[system.message_of[oldest]]
    read = system.serial.frame_time(8) + system.serial.t35
    return {**phases, "AMS": 0.3 + response + system.firmware.receive - read - 2e-9}


@pytest.mark.parametrize("retries", [0, 2])
def test_the_worst_phase_of_a_broken_response_attains_the_bound(retries):
    system = replace(PRINTED, retries=retries)
    phases = worst_phases(system)
    # The response breaks off at its last bit.
    start = phases["AMS"] + 5 + system.poll.time - system.serial.t35 - 1e-8
    cut = ModbusBreak("1", start=start)
    run = simulate(system, until=12, faults=cut, phases=phases)
    bounds = system.failure_bounds(cut)
    assert run.answers()["answer_s"].max() == pytest.approx(bounds.answer, abs=1e-8)
    assert np.diff(run.views.seen).max() / 1e9 == pytest.approx(bounds.gap, abs=1e-8)
    # The bound allows for a frame of lower priority that blocks the bus.
    assert bounds.oldest - 0.01 < run.worst_age <= bounds.oldest


def test_a_cut_of_a_ring_costs_one_update():
    # Of two rounds between the polls, the cut destroys the second.
    cut = CanBreak("JB1-JB2", start=4.8001)
    run = simulate(RING, until=12, faults=cut, phases=worst_phases(RING))
    bound = RING.failure_bounds(cut).oldest
    assert bound == pytest.approx(RING.worst_age()["worst_s"].max() + RING.update_period)
    assert bound - 0.005 < run.worst_age <= bound


@settings(max_examples=60)
@given(
    system=st.builds(
        System,
        retries=st.integers(0, 2),
        timeout=st.sampled_from([0.02, 0.1238, 0.5]),
        poll_period=st.sampled_from([0.3, 0.5, 1.0]),
        update_period=st.sampled_from([0.2, 0.5]),
        stale_limit=st.sampled_from([0.6, 4.0]),
        topology=st.sampled_from(["line", "ring"]),
    ),
    lasts=st.sampled_from([np.inf, 0.003, 0.1, 1.5]),
    seed=st.integers(0, 10**6),
    data=st.data(),
)
def test_no_phases_of_clocks_and_faults_exceed_the_bounds(system, lasts, seed, data):
    several = [f for f in system.single_faults() if f.at != "sensor"]
    fault = data.draw(st.sampled_from(several))
    rng = np.random.default_rng(seed)
    start = 5 + rng.uniform(0, system.poll_period)
    fault = replace(fault, start=start, stop=start + lasts)
    run = simulate(system, until=13, faults=fault, rng=rng)
    bounds = system.failure_bounds(fault)
    assert run.answers()["answer_s"].max() <= bounds.answer + 1e-8
    seen = run.views.seen[run.views.seen > 4e9]
    assert np.diff(seen).max() / 1e9 <= bounds.gap + 1e-8
    assert run.worst_age <= bounds.oldest + 1e-8


@settings(max_examples=15)
@given(
    kinds=st.lists(
        st.sampled_from([BusOff, CanBreak, ModbusBreak, DeadBox, DeadPort, *LOSSES]), max_size=3
    ),
    seed=st.integers(0, 10**6),
)
def test_no_mixture_of_faults_makes_the_corrected_design_show_an_old_value(kinds, seed):
    rng = np.random.default_rng(seed)
    faults = []
    for kind in kinds:
        where = rng.choice(CORRECTED.places[kind.at])
        start = rng.uniform(0, 8)
        faults.append(kind(str(where), start=start, stop=start + rng.uniform(0.01, 8)))
    run = simulate(CORRECTED, until=15, faults=faults, rng=rng)
    worst = run.table()["worst_s"]
    assert (worst[worst.notna()] <= CORRECTED.age_limit).all()


@pytest.mark.parametrize("system", [PRINTED, CORRECTED], ids=["printed", "corrected"])
def test_only_an_age_that_grows_without_end_is_infinite(system):
    tag = system.points[0].tag
    table = single_failures(
        system,
        [StuckSensor(tag, start=AT), StuckSensor(tag, start=AT, stop=14), DeadBox("JB2", start=AT)],
        trials=2,
    )
    stuck, passing, dead = table["oldest_s"].iloc[1:]
    assert stuck == np.inf
    # The sensor recovers after four seconds; a new value is seen one healthy age later.
    assert 4 < passing < 4 + system.worst_age()["worst_s"].max()
    assert dead <= system.staleness_flag().oldest
    both = row(PRINTED, ModbusBreak("1", start=AT))
    assert both["oldest_s"] <= both["bound_s"] < 2.05


def test_the_alarm_of_a_channel_comes_and_goes():
    system = replace(PRINTED, retries=2)
    cuts = [ModbusBreak("1", start=4.5, stop=8.5), ModbusBreak("2", start=9.5)]
    run = simulate(system, until=12, faults=cuts)
    assert run.alarms()[["source", "kind"]].values.tolist() == [
        ["channel 1", "no answer"],
        ["channel 2", "no answer"],
        ["channel 1", "answers again"],
    ]
    three = 3 * (8 * 11 / 9600 + system.timeout)
    assert run.alarms()["time_s"].iloc[0] == pytest.approx(5 + three)


def test_a_box_that_comes_back_is_good_again():
    run = simulate(PRINTED, until=30, faults=[DeadBox("JB2", start=10, stop=18)])
    own = run.alarms()[run.alarms()["source"] == "ME-JB2-044"]
    assert own["kind"].tolist() == ["0xFF", "good again"]
    assert 18 < own["time_s"].iloc[1] < 18 + PRINTED.worst_age()["worst_s"].max()
    marked = run.table().loc["ME-JB2-044", "marked_s"]
    assert marked == pytest.approx(own["time_s"].diff().iloc[1])


def test_without_any_channel_old_values_stay():
    run = simulate(
        PRINTED, until=20, faults=[ModbusBreak("1", start=10.5), ModbusBreak("2", start=10.5)]
    )
    assert np.isinf(run.answers()["answer_s"]).sum() == 9
    assert run.table()["worst_s"].min() > 9
    assert set(run.alarms()["source"]) == {"channel 1", "channel 2"}


def test_requests_are_lost_with_the_given_probability():
    lost = LostModbusFrames("1", request=0.2, response=0.1)
    # Without channel 2 the AMS always returns to channel 1.
    faults = [lost, ModbusBreak("2")]
    run = simulate(PRINTED, until=4000, faults=faults, rng=np.random.default_rng(11))
    first = run.requests()[run.requests()["channel"] == 1]
    share = first["outcome"].value_counts(normalize=True)
    # The tolerance is four standard errors of 4000 draws.
    assert share["no answer"] == pytest.approx(0.2, abs=4 * (0.2 * 0.8 / 4000) ** 0.5)
    assert share["response damaged"] == pytest.approx(0.08, abs=4 * (0.08 * 0.92 / 4000) ** 0.5)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: ModbusBreak(1), "where is 1; it must be text"),
        (lambda: simulate(PRINTED, until=1, faults=[ModbusBreak("3")]), "where is '3'.*1, 2"),
        (lambda: simulate(PRINTED, until=1, faults=[DeadBox("JB9")]), "JB1, JB2, JB3"),
        (lambda: simulate(PRINTED, until=1, faults=["JB1"]), "one of faults is 'JB1'"),
        (lambda: simulate(PRINTED, until=1, faults=[LostCanFrames("JB1")]), "rng is None"),
        (lambda: single_failures(PRINTED, trials=0), "trials is 0"),
    ],
)
def test_impossible_faults_are_refused(make, message):
    with pytest.raises(ArgumentError, match=message):
        make()
