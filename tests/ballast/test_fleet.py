from functools import partial

import numpy as np
import pytest

from shipnet.ballast.diagnosis import diagnose_run
from shipnet.ballast.plant import FAULTS, Command, Fault
from shipnet.ballast.scan import System
from shipnet.ballast.sensors import Sensors
from shipnet.ballast.simulation import blocks, simulate
from shipnet.ballast.trials import run_fleet
from shipnet.errors import ArgumentError

PLAN = {"operations": 4, "group": 8}


@pytest.fixture(scope="module")
def report():
    rng = np.random.default_rng(2024)
    faults = Fault.random(12, rng=rng, n_valves=16, until=5000)
    plan = Command.random(16, until=7200.0, rng=rng, **PLAN)
    return run_fleet(16, plan, faults=faults, until=7200.0, rng=rng)


def test_every_fault_but_o1_is_found_by_its_own_code_only(report):
    found = report.faults().set_index("code")
    assert sorted(found.index) == sorted(FAULTS)
    # A motor only gets hot after many strokes in a row.
    assert found.index[~found["named"]].tolist() == ["O1"]
    assert found.index[found["detection_time_s"].isna()].tolist() == ["O1"]
    assert (found["detection_time_s"].dropna() >= 0).all()
    isolated = found[found["isolation_time_s"].notna()]
    assert (isolated["isolation_time_s"] >= isolated["detection_time_s"]).all()
    assert isolated["named"].all()
    assert report.false_alarms().empty
    assert report.summary()["named"].sum() == 11
    assert report.summary().index.tolist() == list(FAULTS)
    assert "12 faults: 11 detected, 11 named, 11 isolated; 0 false alarms" in str(report)


def test_a_stuck_valve_waits_for_its_next_command(report):
    stuck = report.faults().set_index("code").loc["V1"]
    starts = report.commands[report.commands["valve"] == stuck["valve"]]["start_s"]
    following = starts[starts >= stuck["start_s"]].min()
    assert stuck["command_s"] == following
    # Three of five readings, the first when the motor has just started.
    assert stuck["start_s"] + stuck["detection_time_s"] == pytest.approx(following + 0.2, abs=0.11)
    assert stuck["detection_time_s"] == pytest.approx(
        stuck["after_command_s"] + following - stuck["start_s"]
    )


def test_a_gauge_that_reads_too_high_is_found_at_rest(report):
    gauge = report.faults().set_index("code").loc["G1"]
    assert gauge["detection_time_s"] < 4
    assert np.isnan(gauge["after_command_s"])
    assert gauge["isolation_time_s"] == gauge["detection_time_s"]
    assert gauge["true_detection_rate"] > 0.99


@pytest.mark.parametrize("size", [1, 37, 100_000])
def test_the_size_of_a_block_does_not_change_the_report(size, monkeypatch):
    monkeypatch.setattr("shipnet.ballast.trials.blocks", partial(blocks, size=size))
    commands = [Command("open", 5.0), Command("close", 40.0, valves=[1, 3])]
    faults = [Fault("V1", start=30.0, valves=3), Fault("Pos1", start=2.0, valves=2)]
    whole = simulate(3, commands, faults=faults, until=60.0, idle_step=1.0, rng=1)
    single = diagnose_run(whole)
    report = run_fleet(3, commands, faults=faults, until=60.0, rng=1)
    assert report.n_samples == whole.readings.shape[0] * 3
    assert report.alarms.values.tolist() == single.alarms().values.tolist()
    top = single.top
    before = np.concatenate([[["normal"] * 3], top[:-1]])
    changes = [(whole.time[i], k + 1, top[i, k]) for i, k in np.argwhere(top != before)]
    assert [tuple(row) for row in report.signals.values.tolist()] == changes
    assert report.commands["end_s"].tolist() == whole.strokes()["end_s"].tolist()
    assert len(report.alarms) > 3


def test_detection_rates_equal_those_of_a_loop_over_the_instants():
    commands = [Command("open", 5.0), Command("close", 40.0)]
    faults = [Fault("V1", start=30.0, stop=70.0, valves=3), Fault("G1", start=50.0, valves=2)]
    options = dict(faults=faults, until=90.0, rng=1)
    run = simulate(3, commands, idle_step=1.0, **options)
    top = diagnose_run(run).top
    report = run_fleet(3, commands, **options)
    ends = [*run.time[1:], 90.0]

    def share(valve, low, high):
        spans = [
            max(min(end, high) - max(time, low), 0)
            for time, end, code in zip(run.time, ends, top[:, valve - 1], strict=True)
            if code != "normal"
        ]
        return sum(spans)

    rates = report.faults().set_index("code")["true_detection_rate"]
    assert rates["V1"] == pytest.approx(share(3, 30, 70) / 40, abs=1e-9)
    assert rates["G1"] == pytest.approx(share(2, 50, 90) / 40, abs=1e-9)


def test_a_fault_beyond_the_end_has_no_rates():
    report = run_fleet(1, [], faults=[Fault("G1", start=0.0), Fault("V1", start=20.0)], until=10)
    assert report.faults()["true_detection_rate"].isna().tolist() == [False, True]
    assert np.isnan(report.summary().loc["V1", "isolability"])


def test_an_alarm_before_its_fault_is_a_false_alarm():
    # With noise of 5 %, open valves appear to be beyond their end.
    faults = [Fault("V1", start=50.0, valves=2)]
    noisy = System(2, sensors=Sensors(noise=(0.5, 0.03, 0.02, 0.3, 5.0)))
    report = run_fleet(noisy, [Command("open", 5.0)], faults=faults, until=60, rng=1)
    assert set(report.false_alarms()["valve"]) == {1, 2}
    sick = report.false_alarms().query("valve == 2")
    assert sick["time_s"].max() < 50


def test_a_healthy_fleet_also_has_a_report():
    # A fault of severity 0 is none.
    report = run_fleet(2, [Command("open", 5.0)], faults=Fault("V1", 0.0, valves=2), until=60)
    assert "0 faults: 0 detected, 0 named, 0 isolated; 0 false alarms" in str(report)
    assert report.summary().empty
    sick = run_fleet(2, [], faults=[Fault("G1", valves=2)], until=60)
    assert report.summary().columns.tolist() == sick.summary().columns.tolist()
    assert report.faults().dtypes.to_dict() == sick.faults().dtypes.to_dict()
    assert sick.summary().loc["G1", ["faults", "detected", "isolated"]].tolist() == [1, 1, 1]


def test_faults_are_drawn_evenly_and_in_order():
    faults = Fault.random(256, rng=np.random.default_rng(3), severity=(0.2, 0.9))
    counts = {code: sum(f.code == code for f in faults) for code in FAULTS}
    assert set(counts.values()) == {21, 22}
    assert len({f.valves for f in faults}) == 256
    starts = [f.start for f in faults]
    assert starts == sorted(starts)
    assert 0 <= starts[0] and starts[-1] <= 86400
    severities = [f.severity for f in faults]
    assert 0.2 <= min(severities) < 0.25 and 0.85 < max(severities) <= 0.9
    # Kolmogorov-Smirnov: 1.63 / sqrt(256) is exceeded with a probability of 1 %.
    even = np.abs(np.sort(starts) / 86400 - (np.arange(256) + 0.5) / 256).max()
    assert even < 0.1
    assert Fault.random(0, rng=np.random.default_rng(1)) == []


def test_a_plan_commands_every_valve_as_often_as_asked_and_groups_do_not_meet():
    plan = Command.random(rng=np.random.default_rng(5), n_valves=50, operations=3, group=16)
    commanded = np.bincount([valve for command in plan for valve in command.valves], minlength=51)
    assert set(commanded[1:]) == {3}
    times = [command.time for command in plan]
    assert min(np.diff(times)) >= 30 - 1e-6
    assert [c.action for c in plan] == ["open"] * 4 + ["close"] * 4 + ["open"] * 4


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda rng: Fault.random(5, rng=rng, n_valves=4), "n_faults is 5"),
        (lambda rng: Fault.random(1, rng=rng, severity=(0.5, 0.4)), "severity is 0.4"),
        (lambda rng: Fault.random(1, rng=rng, until=float("nan")), "until is nan"),
        (lambda rng: Command.random(rng=rng, n_valves=256, until=100), "until is 100 s"),
        (lambda rng: Command.random(rng=rng, group=257), "group is 257"),
        (lambda rng: run_fleet(0, []), "system is 0"),
    ],
)
def test_a_bad_argument_is_named(make, message):
    with pytest.raises(ArgumentError, match=message):
        make(np.random.default_rng(1))
