from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure

from shipnet.ballast.diagnosis import diagnose_run
from shipnet.ballast.plant import Command, Fault
from shipnet.ballast.rule_table import rule_base
from shipnet.ballast.scan import System
from shipnet.ballast.sensors import CHANNELS, position_speed
from shipnet.ballast.simulation import blocks, simulate
from shipnet.errors import ArgumentError
from shipnet.fuzzy import Rule, RuleBase
from shipnet.fuzzy.firing import METHODS

BASE = rule_base()
ORDERS = [
    Command("open", 1.0),
    Command("close", 4.0, valves=[1, 3]),
    Command(40, 16.0),
    Command("open", 31.0),
]
FAULTY = [
    Fault("V1", start=2.0, valves=2),
    Fault("P2", 0.95, valves=3),
    Fault("Pos1", start=20.0, valves=4),
    Fault("G1", start=14.0, valves=5),
]


def pieces(size):
    yield from blocks(5, ORDERS, faults=FAULTY, until=45, idle_step=0.5, rng=7, size=size)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("size", [2, 11, 97])
def test_diagnosis_in_blocks_equals_that_of_the_whole_run(method, size):
    run, rules = noisy(), rule_base(slow_stroke=10)
    # Two sensors have outages.
    run.readings[40:90, 0] = np.nan
    run.readings[::3, 3] = np.nan
    whole, tail, start, alarms = diagnose_run(run, rules, method=method), None, 0, []
    for piece in pieces(size):
        rows = slice(start, start + piece.time.size)
        piece.readings[:] = run.readings[rows]
        part = diagnose_run(piece, rules, method=method, earlier=tail)
        for name, values in part.samples.items():
            np.testing.assert_array_equal(values, whole.samples[name][rows])
        for name in ("active", "open", "top"):
            np.testing.assert_array_equal(getattr(part, name), getattr(whole, name)[rows])
        alarms += part.alarms().values.tolist()
        tail, start = part.tail, rows.stop
    assert whole.open.any() and start == run.time.size
    assert alarms == whole.alarms().values.tolist() and len(alarms) > 3


def noisy():
    return simulate(5, ORDERS, faults=FAULTY, until=45, idle_step=0.5, rng=7)


def test_each_valve_and_instant_alone_gives_the_same():
    run = noisy()
    diagnosis = diagnose_run(run, k=1, n=1)
    rows = np.linspace(0, len(run.time) - 1, 40).astype(int)
    for valve in range(run.n_valves):
        frame = run.valve(valve + 1).iloc[rows]
        for row, (_, seen) in zip(rows, frame.iterrows(), strict=True):
            fp, op, mc, ot, pos, speed = (float(x) for x in seen.iloc[:6])
            waits = seen["active"] and speed == speed and speed <= 1
            expected = {
                "G1": fp >= 120 and mc <= 0.1,
                "P1": fp >= 120 and mc >= 2.5,
                "P2": fp <= 2.5 and 0.1 <= mc <= 2.5,
                "V1": fp >= 120 and op >= 2.5,
                "V2": 0.1 <= op <= 2.5 and waits,
                "S1": mc <= 0.1 and pos >= 102.5,
                "S2": mc <= 0.1 and pos <= -2.5,
                "O1": ot >= 85,
                "Pos1": 0.1 <= op <= 2.5 and mc <= 0.1 and pos >= 102.5,
                "Pos2": 0.1 <= op <= 2.5 and mc <= 0.1 and pos <= -2.5,
                "Pos3": pos >= 102.5,
                "Pos4": pos <= -2.5,
            }
            found = dict(zip(BASE.codes, diagnosis.active[row, valve], strict=True))
            assert found == expected, (valve, row)


def test_trapped_pressure_at_rest_looks_like_a_leak_only_if_dvpos_always_counts():
    quiet = [Fault("Pos1", 0.1)]  # leaves a tenth of the pressure; the shift of VPos is 0.5 %
    run = simulate(1, [Command("open")], until=20, faults=quiet)
    meant, literal = (diagnose_run(run, method=r).active[-1, 0] for r in ("midpoint", "crisp"))
    assert not meant.any()
    assert literal[BASE.codes.index("V2")]


def test_alarms_and_explanations_name_the_same_codes():
    run = noisy()
    diagnosis = diagnose_run(run)
    assert {"V1", "P2", "V2", "G1"} <= set(diagnosis.alarms()["code"])
    for alarm in diagnosis.alarms().itertuples():
        sentence = diagnosis.explain(alarm.valve, alarm.time_s)
        assert sentence.startswith(alarm.top_fault)
        assert alarm.code in sentence
        row = int(np.searchsorted(run.time, alarm.time_s))
        assert diagnosis.is_active(alarm.valve, alarm.code)[row]
        first = diagnosis.first_alarm(alarm.valve, alarm.code)
        assert first <= alarm.time_s
    never = ~diagnosis.active.any(axis=0)
    assert np.isnan(diagnosis.alarm_times[never]).all()


@pytest.mark.parametrize("settle", [5.0, 30.0])
def test_a_command_shows_the_highest_ranked_active_code(settle, monkeypatch):
    # The next command begins after 30 s and ends the period that counts.
    monkeypatch.setattr("shipnet.ballast.diagnosis._SETTLE", settle)
    diagnosis = diagnose_run(noisy())
    time = diagnosis.time
    for command in diagnosis.commands().itertuples():
        given = [one.time for one in ORDERS if one.valves is None or command.valve in one.valves]
        until = min([command.end_s + settle, *(t - 1e-6 for t in given if t > command.start_s)])
        seen = (time >= command.start_s - 1e-9) & (time <= until + 1e-9)
        active = diagnosis.active[seen, command.valve - 1].any(axis=0)
        expected = [c for c in BASE.ranking if active[BASE.codes.index(c)]]
        assert command.active.split() == expected
        assert command.top_fault == (expected or ["normal"])[0]
        assert (command.delay_s >= 0) == bool(expected)


def test_the_slow_stroke_is_reported_by_the_added_rule_alone():
    worn = [Fault("P2", 0.25)]
    run = simulate(1, [Command("open")], until=20, faults=worn)
    lasted = run.strokes()["duration_s"][0]
    assert 10.3 < lasted < 12
    assert not diagnose_run(run).active.any()
    table = diagnose_run(run, rule_base(slow_stroke=10)).commands()
    assert table["top_fault"].tolist() == ["T1"]
    assert table["delay_s"][0] == pytest.approx(10.2)
    sound = simulate(1, [Command("open")], until=20)
    assert not diagnose_run(sound, rule_base(slow_stroke=10)).active.any()
    assert rule_base(slow_stroke=10).rules[:12] == BASE.rules


def test_a_motor_that_reverses_is_timed_from_zero():
    orders = [Command("open", 1.0), Command("close", 3.0), Command("stop", 4.0)]
    run = simulate(System(step=0.5), orders, until=5)
    nan = np.nan
    expected = [nan, nan, 0, 0.5, 1, 1.5, 0, 0.5, nan, nan, nan]
    np.testing.assert_array_equal(run.ran[:, 0], expected)


def test_strokes_have_the_values_of_the_operating_point():
    run = simulate(1, [Command("open"), Command(90, 20), Command("close", 30)], until=45)
    whole, short, back = run.strokes().itertuples()
    assert whole.duration_s == pytest.approx(9.0, abs=0.05)
    assert back.duration_s == pytest.approx(0.9 * whole.duration_s, abs=0.2)
    assert short.travel_percent == pytest.approx(10, abs=0.2)
    assert whole.FP_bar == pytest.approx(90, abs=0.3)
    assert whole.MC_A == pytest.approx(1.2, abs=0.01)
    assert whole.OP_max_bar == pytest.approx(run.samples["OP"].max(), abs=1e-9)


def test_a_run_without_instants_has_no_alarms():
    run = simulate(1, until=0)
    diagnosis = diagnose_run(run)
    assert diagnosis.top.tolist() == [["normal"]]
    assert len(diagnosis.alarms()) == len(diagnosis.commands()) == len(run.strokes()) == 0


def without(run, name, start, stop, value=np.nan):
    """Return a run in which a sensor of the first valve is dead for a time."""
    gone = (run.time >= start) & (run.time < stop)
    place = [channel.name for channel in CHANNELS].index(name)
    readings = run.readings.copy()
    readings[gone, place, 0] = value
    return replace(run, readings=readings, speed=position_speed(run.time, readings[:, 4]))


@pytest.mark.parametrize("method", METHODS)
def test_a_healthy_valve_is_never_undetermined_although_no_speed_applies_at_rest(method):
    run = simulate(2, [Command("open", 3.0)], until=25)
    diagnosis = diagnose_run(run, rule_base(slow_stroke=10), method=method)
    assert not diagnosis.open.any() and "undetermined" not in diagnosis.top
    assert "missing" not in diagnosis.explain(1, 2.0)


@pytest.mark.parametrize(
    ("name", "codes", "missing"),
    [("VPos", "V2 Pos3 Pos4", "VPos DVPos"), ("FP", "P2", "FP"), ("OT", "O1", "OT")],
)
def test_a_dead_sensor_makes_a_healthy_stroke_undetermined(name, codes, missing):
    run = without(simulate(2, [Command("open", 3.0)], until=25, rng=1), name, 5.0, 8.0)
    diagnosis = diagnose_run(run)
    dead = (run.time >= 5.5) & (run.time < 7.9)
    assert set(diagnosis.top[dead, 0]) == {"undetermined"} and not diagnosis.active.any()
    assert set(diagnosis.top[:, 1]) == {"normal"} == set(diagnosis.top[run.time > 10, 0])
    assert diagnosis.explain(1, 7.0) == f"undetermined: cannot exclude {codes}; missing {missing}"
    assert diagnosis.commands()["top_fault"].tolist() == ["undetermined", "normal"]
    assert repr(diagnosis) == "Diagnosis(2 valves, valve 1: undetermined)"
    title = diagnosis.plot(1, ax=Figure().subplots()).get_title(loc="left")
    assert title == "diagnosis of valve 1: undetermined"


def test_without_the_current_it_is_unknown_whether_the_speed_applies():
    run = without(simulate(1, until=5), "MC", 2.0, 4.0)
    run = replace(run, readings=run.readings + np.array([0, 2.0, 0, 0, 0])[:, np.newaxis])
    diagnosis = diagnose_run(run)
    assert diagnosis.open[30, 0, BASE.codes.index("V2")] and not diagnosis.open[15].any()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"method": "vague"}, "method is 'vague'; it must be one of 'crisp', 'midpoint', 'fuzzy'"),
        ({"k": 6}, "k is 6; it must be a whole number 1..5"),
        ({"n": 0}, "n is 0"),
        ({"n": 1001}, "n is 1001"),
        ({"threshold": 0}, "threshold is 0"),
        ({"threshold": float("nan")}, "threshold is nan"),
    ],
)
def test_a_setting_out_of_range_is_named(arguments, message):
    with pytest.raises(ArgumentError, match=message):
        diagnose_run(simulate(1, until=1), **arguments)


def test_rules_with_unknown_variables_are_refused():
    other = [v for v in BASE.variables if v.name == "FP"]

    strange = RuleBase((replace(other[0], name="Level"),), (Rule("L1", (("Level", "high"),), 1),))
    with pytest.raises(ArgumentError, match="rules use Level; a run has FP, OP"):
        diagnose_run(simulate(1, until=1), strange)


def test_the_tail_does_not_keep_its_block_in_memory():
    run = next(pieces(400))
    tail = diagnose_run(run).tail
    assert all(x.base is None and len(x) == 4 for x in tail.samples.values())


def test_an_unknown_instant_or_valve_is_named():
    diagnosis = diagnose_run(simulate(1, until=1))
    with pytest.raises(ArgumentError, match=r"time is -1 s; it must be 0\.\.inf s"):
        diagnosis.explain(1, -1)
    with pytest.raises(ArgumentError, match="valve is 2"):
        diagnosis.explain(2, 0.0)
    with pytest.raises(ArgumentError, match="valve is 0"):
        diagnosis.firing(0)
