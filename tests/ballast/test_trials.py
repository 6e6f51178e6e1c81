import numpy as np
import pandas as pd
import pytest

from shipnet.ballast.diagnosis import diagnose_run
from shipnet.ballast.plant import FAULTS, Command, Fault
from shipnet.ballast.rule_table import rule_base
from shipnet.ballast.simulation import simulate
from shipnet.ballast.trials import false_alarms, fault_trials, run_fleet, spread_valves
from shipnet.errors import ArgumentError
from shipnet.fuzzy import Rule, RuleBase, Term, Variable
from shipnet.fuzzy.firing import METHODS


@pytest.fixture(scope="module")
def trials():
    return fault_trials(n_valves=12, rng=np.random.default_rng(2024))


def test_midpoint_and_fuzzy_name_all_faults(trials):
    table = trials.rates()
    for reading in ("midpoint", "fuzzy"):
        found = table.loc[reading]
        assert (found.loc[list(FAULTS), "named"] == 1).all()
        assert found.loc["normal", "detected"] == 0
        isolated = found.loc[list(FAULTS), "isolated"]
        # With the motor off, S1 and S2 are also true, and they rank higher.
        assert isolated[isolated < 1].index.tolist() == ["Pos3", "Pos4"]
    same = [
        trials.rows[trials.rows["method"] == r].drop(columns="method").reset_index(drop=True)
        for r in ("midpoint", "fuzzy")
    ]
    pd.testing.assert_frame_equal(*same)


def test_rates_and_confusion_count_the_same_trials(trials):
    table = trials.rates()
    assert (table["n"] == 12).all()
    for reading in METHODS:
        matrix = trials.confusion(reading)
        assert (matrix.sum(axis=1) == 12).all()
        right = [matrix.loc[fault, fault] / 12 for fault in matrix.index]
        assert table.loc[reading, "isolated"].tolist() == right
    assert table["named_low"].le(table["named"]).all()
    assert table["named_high"].ge(table["named"]).all()


def test_isolability_and_sensitivity_are_those_of_the_detected_faults():
    severity = np.linspace(0, 1, 9)
    codes = ["normal", "V1", "Pos3"]
    trials = fault_trials(codes, n_valves=9, severity=severity, methods=["fuzzy"], rng=2024)
    rows, table = trials.table(), trials.rates().loc["fuzzy"]
    for code in ("V1", "Pos3"):
        mine = rows[(rows["fault"] == code) & rows["detected"]]
        assert 0 < len(mine) < 9
        assert table.loc[code, "sensitivity"] == min(mine["severity"])
        assert table.loc[code, "isolability"] == sum(mine["isolated"]) / len(mine)
        assert (mine["isolation_time_s"].notna() == mine["isolated"]).all()
    assert table["isolability"].tolist()[1:] == [1, 0]
    assert table.loc["normal", ["isolability", "sensitivity", "detection_time_s"]].isna().all()


def test_a_trial_equals_the_diagnosis_of_the_same_run():
    rng = np.random.default_rng(11)
    trials = fault_trials(["V2"], n_valves=3, methods=["fuzzy"], rng=rng).table()
    again = np.random.default_rng(11)
    system = spread_valves(3, again)
    orders = [Command("open", 5.0), Command("close", 35.0)]
    run = simulate(system, orders, until=65, faults=[Fault("V2")], idle_step=0.5, rng=again)
    diagnosis = diagnose_run(run)
    first = np.nanmin(diagnosis.alarm_times, axis=1)
    np.testing.assert_allclose(trials["detection_time_s"], np.maximum(first - 5.0, 0))
    own = diagnosis.alarm_times[:, diagnosis.base.codes.index("V2")]
    np.testing.assert_allclose(trials["isolation_time_s"], np.maximum(own - 5.0, 0))
    assert trials["active"].tolist() == ["V2"] * 3


def test_false_alarms_equal_those_of_the_whole_run():
    table = false_alarms(6, until=130, period=60, methods=["crisp", "fuzzy"], rng=4)
    rng = np.random.default_rng(4)
    system = spread_valves(6, rng)
    orders = [Command("open"), Command("close", 60.0)]
    run = simulate(system, orders, until=119.9, idle_step=1.0, rng=rng)
    quiet = diagnose_run(run, method="crisp").top == "normal"
    begins = quiet[:-1] & ~quiet[1:]
    assert table.loc["crisp", "alarms"] == begins.sum() + (~quiet[0]).sum()
    assert table.loc["crisp", "commands"] == table.loc["crisp", "alarmed"] == 12
    assert table.loc["fuzzy", "alarms"] == 0
    spans = np.diff(run.time)
    share = (spans @ ~quiet[:-1]) / 6 / run.time[-1]
    assert table.loc["crisp", "false_detection_rate"] == pytest.approx(share.sum(), rel=1e-9)
    assert 0 < share.sum() < 1
    assert table.loc["fuzzy", "false_detection_rate"] == 0
    assert table["valve_years"].to_numpy() == pytest.approx(6 * 120 / (365.25 * 86400))
    years = table.loc["fuzzy", "valve_years"]
    assert table.loc["fuzzy", "per_valve_year_high"] == pytest.approx(-np.log(0.025) / years)


def test_blocks_do_not_change_the_count_of_false_alarms(monkeypatch):

    def count():
        return false_alarms(until=60, period=60, n_valves=3, rng=np.random.default_rng(4))

    import shipnet.ballast.trials

    whole, original = count(), shipnet.ballast.trials.blocks
    monkeypatch.setattr(
        shipnet.ballast.trials, "blocks", lambda *a, **k: original(*a, **k | {"size": 7})
    )
    pd.testing.assert_frame_equal(count(), whole)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda r: fault_trials(["V9"], n_valves=2, rng=r).table(), "codes is 'V9'"),
        (lambda r: fault_trials([], n_valves=2, rng=r).table(), "codes is empty"),
        (lambda r: fault_trials(["V1"], methods=[], rng=r), "methods is empty"),
        (
            lambda r: fault_trials(["V1"], n_valves=3, severity=[0.1, 0.2], rng=r),
            "severity is .*one value for all or 3 values",
        ),
        (lambda r: fault_trials(["V1"], n_valves=0, rng=r).table(), "n_valves is 0"),
        (lambda r: fault_trials(["V1"], n_valves=2, severity=2.0, rng=r).table(), "severity is 2"),
        (
            lambda r: fault_trials(["V1"], n_valves=2, methods=["x"], rng=r).table(),
            "methods is 'x'",
        ),
        (lambda r: false_alarms(until=10, period=60, rng=r), "until is 10"),
        (lambda r: false_alarms(period=1, rng=r), "period is 1"),
    ],
)
def test_an_argument_of_a_trial_out_of_range_is_named(call, message):
    with pytest.raises(ArgumentError, match=message):
        call(np.random.default_rng(0))


def test_a_method_without_trials_is_named(trials):
    with pytest.raises(ArgumentError, match="method is 'x'; it must be one of 'crisp', 'midpoint'"):
        trials.confusion("x")


# One's own rules.


def own(*rules):
    """Return a rule base with the variables of the paper."""
    return RuleBase(rule_base().variables, rules)


def test_false_alarms_are_those_of_ones_own_rules():
    # A motor that runs is healthy, so this rule alarms at every command.
    running = own(Rule("X1", "MC.run", 1))
    counts = {"until": 240, "period": 60, "methods": ["fuzzy"]}
    table = false_alarms(4, rules=running, rng=1, **counts)
    assert table.loc["fuzzy", ["commands", "alarmed"]].tolist() == [16, 16]
    quiet = own(Rule("X1", "OT.hot", 1))
    assert false_alarms(4, rules=quiet, rng=1, **counts).loc["fuzzy", "alarmed"] == 0
    same = false_alarms(4, rules=rule_base(), rng=1, **counts)
    pd.testing.assert_frame_equal(same, false_alarms(4, rng=1, **counts))


def test_trials_name_a_fault_by_the_rule_with_its_code():
    rules = own(Rule("V1", "FP.high & OP.high", 2), Rule("X1", "OT.hot", 1))
    codes = ["normal", "V1", "O1"]
    trials = fault_trials(codes, n_valves=4, rules=rules, methods=["fuzzy"], rng=1)
    table = trials.rates().loc["fuzzy"]
    assert table["detected"].to_dict() == {"normal": 0, "V1": 1, "O1": 1}
    assert table["named"].to_dict() == {"normal": 0, "V1": 1, "O1": 0}
    assert trials.confusion().loc["O1", "X1"] == 4


def test_a_fleet_is_diagnosed_by_ones_own_rules():
    plan = [Command("open", 60.0), Command("close", 200.0)]
    faults = Fault("V1", valves=2, start=100)
    rules = own(Rule("MyCode", "FP.high & OP.high", 1))
    report = run_fleet(3, plan, faults=faults, until=400, rules=rules, rng=1)
    assert report.faults()["top_fault"].tolist() == ["MyCode"]
    assert report.false_alarms().empty and not report.faults()["named"].any()
    blind = run_fleet(3, plan, faults=faults, until=400, rules=own(Rule("O1", "OT.hot", 1)), rng=1)
    assert blind.faults()["top_fault"].tolist() == [""]


def test_rules_with_a_variable_that_no_valve_has_are_refused():
    term = Term("weak", (0, 1, 2, 3), "x < 2")
    rules = RuleBase([Variable("Flow", "l/min", 0, 9, (term,))], [Rule("F1", "Flow.weak", 1)])
    for call in (
        lambda: false_alarms(2, until=60, period=60, rules=rules, rng=1),
        lambda: fault_trials(["V1"], n_valves=2, rules=rules, rng=1),
        lambda: run_fleet(2, [], until=10, rules=rules),
    ):
        with pytest.raises(ArgumentError, match="rules use Flow; a run has FP, OP, MC, OT, VPos"):
            call()
