from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shipnet.ballast.actuator import (
    Actuator,
    hydraulics,
    load_pressure,
    losses,
    steady_temperature,
    stroke_time,
    velocity,
)
from shipnet.ballast.plant import FAULTS, Command, Fault, Plant, faulty
from shipnet.ballast.scan import System
from shipnet.ballast.simulation import blocks, simulate
from shipnet.errors import ArgumentError
from tests.ballast.nominal import IDEAL, normal_values

OPEN = [Command("open", 1.0)]


def rng():
    return np.random.default_rng(2024)


def test_simulated_strokes_take_the_stroke_time_in_both_directions():
    run = simulate(1, [Command("open"), Command("close", 15.0)], until=30)
    expected = [float(stroke_time(Actuator(), way)) for way in (1, -1)]
    assert run.strokes()["duration_s"].tolist() == pytest.approx(expected, abs=1e-4)
    assert run.strokes()["outcome"].tolist() == ["limit", "limit"]
    assert run.opening[-1, 0] == 0


def test_a_stroke_of_varying_speed_also_takes_the_stroke_time():
    leaking, _ = faulty(Actuator(), [Fault("V2", 0.8)], 1)
    run = simulate(1, [Command("open")], until=20, faults=[Fault("V2", 0.8)])
    # With the speed at the start of each step the error would be 8 ms; at its middle it is 0.1 ms.
    assert run.strokes()["duration_s"][0] == pytest.approx(stroke_time(leaking)[0], abs=1e-3)


@settings(max_examples=25)
@given(targets=st.lists(st.integers(0, 100), min_size=1, max_size=4), seed=st.integers(0, 99))
def test_a_valve_reaches_a_commanded_position_within_noise_and_dead_band(targets, seed):
    orders = [Command(p, 15.0 * k) for k, p in enumerate(targets)]
    generator = np.random.default_rng(seed)
    run = simulate(System(step=0.2), orders, until=15.0 * len(targets), rng=generator)
    for k, target in enumerate(targets, 1):
        row = np.searchsorted(run.time, 15.0 * k - 0.1)
        # Five deviations of the potentiometer, the dead band, and a step of the converter.
        assert abs(100 * run.opening[row, 0] - target) < 0.5 + 0.5 + 0.04
    assert not run.running[-1, 0]


def test_a_position_is_reached_after_the_integral_of_the_inverse_speed():
    run = simulate(System(sensors=IDEAL), [Command(40)], until=10)
    openings = 0.4 * (np.arange(20_000) + 0.5) / 20_000
    expected = 0.4 * np.mean(1 / velocity(Actuator(), openings))
    assert run.strokes()["duration_s"][0] == pytest.approx(expected, 1e-4)
    assert run.strokes()["opening"][0] == pytest.approx(0.4, abs=1e-9)
    assert not run.active[-1, 0]


def test_a_healthy_valve_shows_the_normal_values_while_it_moves_and_nothing_at_rest():
    run = simulate(64, OPEN, until=20, rng=rng())
    middle = (run.time > 5) & (run.time < 7)
    for name, value in normal_values().items():
        # The noise in the mean of 20 x 64 readings is a hundredth of the tolerance.
        assert run.samples[name][middle].mean() == pytest.approx(value, rel=0.08), name
    rest = run.time > 12
    assert run.samples["MC"][rest].max() < 0.15
    assert run.samples["FP"][rest].max() < 4
    assert np.nanmax(run.samples["VPos"][rest]) < 101


def test_dvpos_is_known_only_while_the_motor_has_run_for_the_whole_window():
    run = simulate(System(sensors=IDEAL), OPEN, until=20)
    known = ~np.isnan(run.DVPos[:, 0])
    on = run.time[run.running[:, 0]]
    assert run.time[known].min() == pytest.approx(on.min() + 1.0)
    assert run.time[known].max() == pytest.approx(on.max())
    moved = run.samples["VPos"][60, 0] - run.samples["VPos"][50, 0]
    assert run.DVPos[60, 0] == pytest.approx(moved)


def test_a_new_direction_begins_a_new_window():
    orders = [Command("open"), Command("close", 4.0)]
    run = simulate(System(sensors=IDEAL), orders, until=8)
    known = ~np.isnan(run.DVPos[:, 0])
    assert not known[(run.time >= 4.0) & (run.time < 4.95)].any()
    assert run.strokes()["outcome"].tolist() == ["replaced", "limit"]


@settings(max_examples=15)
@given(size=st.integers(1, 300), idle=st.sampled_from([0.1, 0.5, 1.0]))
def test_blocks_of_any_size_join_to_the_whole_run(size, idle):
    orders = [Command(30, 2.0), Command("close", 8.0, valves=2)]
    faults = [Fault("P2", 0.4, start=5.05)]
    whole = simulate(2, orders, faults=faults, until=12, idle_step=idle, rng=rng())
    parts = list(blocks(2, orders, faults=faults, until=12, idle_step=idle, rng=rng(), size=size))
    assert all(part.time.size <= size for part in parts)
    for name in ("time", "readings", "speed", "ran", "moving", "active", "opening"):
        together = np.concatenate([getattr(part, name) for part in parts])
        assert np.array_equal(together, getattr(whole, name), equal_nan=True), name
    assert sum((part.movements for part in parts), ()) == whole.movements


def test_rest_equals_measure_and_advance_in_turn():
    faults = [Fault("Pos2", valves=2), Fault("O1", start=60.0, valves=3)]
    plants = [Plant(System(3, opening=[0, 0.4, 1]), faults, rng=7) for _ in range(2)]
    one, other = plants
    steps = []
    for _ in range(12):
        steps.append(one.measure())
        one.advance(50)
    assert np.array_equal(other.rest(12, 50), steps)
    assert one.tick == other.tick
    assert np.array_equal(one.temperature, other.temperature)
    # The fault that is due now has begun in both runs.
    assert np.array_equal(one.measure(), other.measure())


def test_a_valve_that_reverses_beside_a_running_one_moves_as_it_would_alone():
    orders = [Command("open"), Command(10, 5.0, valves=1)]
    alone = simulate(1, orders, until=20)
    beside = simulate(2, orders, until=20)
    assert np.array_equal(beside.readings[:, :, 0], alone.readings[:, :, 0])
    # The torque of the flow helps to close the valve, so closing takes less pressure than opening.
    assert alone.samples["OP"][51, 0] < alone.samples["OP"][49, 0] - 0.1


def test_an_idle_day_has_one_reading_per_second_and_misses_no_event():
    run = simulate(1, [Command("open", 300.25)], until=600, idle_step=1.0)
    steps = np.diff(run.time)
    assert steps.max() == pytest.approx(1.0)
    assert steps.min() == pytest.approx(0.1)
    assert run.strokes()["start_s"][0] == pytest.approx(300.3)
    assert run.time[-1] == pytest.approx(600)


def test_the_temperature_follows_its_exponentials():
    quick = simulate(System(sensors=IDEAL), OPEN, until=400)
    slow = simulate(System(sensors=IDEAL), OPEN, until=400, idle_step=60)
    assert quick.samples["OT"][-1, 0] == pytest.approx(slow.samples["OT"][-1, 0], abs=1e-9)
    start = float(steady_temperature(Actuator()))
    # Heat of a stroke, less the heat lost in 10.5 s at 5 K above the surroundings.
    a, x = Actuator(), (np.arange(2000) + 0.5) / 2000
    pressure = hydraulics(a, load_pressure(a, x)).pump_pressure
    heat = np.mean(losses(a, pressure) / velocity(a, x))
    rise = (heat - 6.4 * (start - 45) * 10.5) / 4000
    assert quick.samples["OT"][105, 0] - start == pytest.approx(rise, rel=0.01)
    assert 45 < quick.samples["OT"][-1, 0] < quick.samples["OT"][105, 0]


@pytest.mark.parametrize("code", FAULTS)
def test_severity_0_is_healthy_to_the_last_bit_and_1_is_not(code):
    def run(faults):
        return simulate(System(sensors=IDEAL), OPEN, until=14, faults=faults)

    healthy, none, sick = (run(f) for f in ([], [Fault(code, 0.0)], [Fault(code)]))
    assert np.array_equal(healthy.readings, none.readings)
    assert not np.allclose(healthy.readings, sick.readings, atol=0.01)


#: Condition of each fault's rule, and when it is checked: while the motor runs or at rest.
MEETS = {
    "G1": (False, lambda r: (r["FP"] > 120) & (r["MC"] < 0.15)),
    "P1": (True, lambda r: (r["FP"] > 120) & (r["MC"] > 2.5)),
    "P2": (True, lambda r: (r["FP"] < 2.5) & (r["MC"] > 0.15) & (r["MC"] < 2.5)),
    "V1": (True, lambda r: (r["FP"] > 120) & (r["OP"] >= 2.5) & (r["MC"] < 2.5)),
    "V2": (True, lambda r: (r["OP"] < 2.5) & (r["OP"] > 0.1) & (r["DVPos"] < 0.5)),
    "O1": (True, lambda r: r["OT"] >= 90),
    "S1": (False, lambda r: (r["MC"] < 0.15) & (r["VPos"] > 104) & (r["OP"] < 0.15)),
    "S2": (False, lambda r: (r["MC"] < 0.15) & (r["VPos"] < -4) & (r["OP"] < 0.15)),
    "Pos1": (False, lambda r: (r["MC"] < 0.15) & (r["VPos"] > 104) & (r["OP"] > 1)),
    "Pos2": (False, lambda r: (r["MC"] < 0.15) & (r["VPos"] < -4) & (r["OP"] > 1)),
    "Pos3": (True, lambda r: r["VPos"] > 104),
    "Pos4": (True, lambda r: r["VPos"] < -4),
}


@pytest.mark.parametrize("code", FAULTS)
def test_a_fault_meets_the_antecedent_of_its_own_rule_and_a_healthy_valve_does_not(code):
    moving, rule = MEETS[code]
    closes = code in ("S2", "Pos2", "Pos4")
    order = [Command("close" if closes else "open", 1.0)]

    def seen(faults):
        run = simulate(System(16, opening=float(closes)), order, until=30, rng=rng(), faults=faults)
        met = rule(run.samples) & (run.running == moving)
        return met.sum(axis=0)

    # The condition holds for at least half a second on every valve.
    assert seen([Fault(code)]).min() >= 5
    assert seen([]).max() == 0


def test_a_fault_begins_and_ends_at_its_times_on_its_valves_with_its_severity():
    fault = Fault("G1", [0.2, 1.0], start=3.0, valves=[3, 1])
    run = simulate(System(3, sensors=IDEAL), until=6, faults=[fault])
    before, after = run.samples["FP"][run.time < 2.95], run.samples["FP"][run.time > 2.95]
    assert (before == 0).all()
    assert after[0].tolist() == [125.0, 0.0, 25.0]
    run = simulate(System(sensors=IDEAL), until=6, faults=replace(Fault("G1"), start=2.0, stop=4.0))
    wrong = run.samples["FP"][:, 0] > 0
    assert wrong.tolist() == [1.95 < t < 3.95 for t in run.time]


def test_faults_of_one_valve_add_up():
    sick, offsets = faulty(Actuator(), [Fault("Pos1", 0.8), Fault("Pos2"), Fault("Pos3")], 1)
    assert offsets[4, 0] == pytest.approx(4 - 5 + 15)
    assert sick.trapped[0] == 1
    twice, _ = faulty(Actuator(), [Fault("P2", 0.5), Fault("P2", 0.5)], 1)
    assert twice.pump_leak == pytest.approx(faulty(Actuator(), [Fault("P2")], 1)[0].pump_leak)


def test_the_motor_time_stops_a_valve_that_does_not_arrive():
    slow = replace(Actuator(), motor_time=[5.0, 20.0])
    run = simulate(System(actuator=slow), OPEN, until=20)
    assert run.strokes()["outcome"].tolist() == ["time", "limit"]
    assert run.strokes()["duration_s"][0] == pytest.approx(5.0)
    assert run.active[-1].tolist() == [True, False]


def test_a_command_that_is_already_met_starts_no_motor():
    orders = [Command("close"), Command(0.3, 1.0), Command("stop", 2.0)]
    run = simulate(System(sensors=IDEAL), orders, until=4)
    assert not run.running.any()
    assert run.strokes().empty


@settings(max_examples=30)
@given(
    orders=st.lists(
        st.tuples(st.sampled_from(["open", "close", "stop", 0, 35, 100]), st.floats(0, 12)),
        max_size=6,
    ),
    faults=st.lists(
        st.builds(
            Fault,
            st.sampled_from(list(FAULTS)),
            st.floats(0, 1),
            start=st.floats(0, 12),
            stop=st.floats(12.5, 20),
        ),
        max_size=3,
        # The same fault three times gives illegal parameters, which are rejected.
        unique_by=lambda fault: fault.code,
    ),
)
def test_the_state_always_stays_within_its_bounds(orders, faults):
    commands = [Command(what, time) for what, time in orders]
    run = simulate(System(step=0.25), commands, until=14, faults=faults, rng=rng())
    assert ((run.opening >= 0) & (run.opening <= 1)).all()
    assert np.isfinite(run.readings).all()
    assert not (run.moving & ~run.running).any()
    assert not (run.running & ~run.active).any()
    assert all(move.end >= move.start for move in run.movements)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Command("shut"), "action is 'shut'"),
        (lambda: Command("open", -1), "time is -1"),
        (lambda: Command("position"), "action is 'position'"),
        (lambda: Command(101), r"action is 101.*0\.\.100"),
        (lambda: Command("open", valves=0), "valves is 0"),
        (lambda: Fault("P1", 1.1), "severity is 1.1"),
        (lambda: Fault("P1", start=-1), "start is -1"),
        (lambda: simulate(1, until=1, faults=[Fault("P1", valves=2)]), r"valves is 2.*1\.\.1"),
        (lambda: simulate(1, until=1, faults=[Fault("P1", [0, 1])]), "2 values for 1"),
        (lambda: simulate(1, [Command("open", 9, valves=4)], until=1), "valves is 4"),
        (lambda: simulate(1, until=-1), "until is -1"),
        (lambda: simulate(0, until=1), "system is 0"),
        (lambda: simulate(System(2, actuator=Actuator(speed=[20] * 3)), until=1), "n_valves is 2"),
        (lambda: simulate(System(opening=1.1), until=1), r"opening is 1.1"),
        (lambda: simulate(System(opening=[0, 1]), until=1), "one for each of 1"),
        (lambda: simulate(System(step=0), until=1), "step is 0"),
        (lambda: simulate(1, until=1, idle_step=0.01), "idle_step is 0.01"),
        (lambda: blocks(1, until=1, size=0), "size is 0"),
        (lambda: simulate(1, until=1).valve(2), "valve is 2"),
    ],
)
def test_arguments_out_of_range_are_named(make, message):
    with pytest.raises(ArgumentError, match=message):
        make()
