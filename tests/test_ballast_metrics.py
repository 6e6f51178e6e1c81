import numpy as np
import pandas as pd
import pytest
from scipy.optimize import brentq
from scipy.stats import binomtest, poisson

from shipnet.ballast import (
    Actuator,
    Command,
    Fault,
    Sensors,
    diagnose_run,
    operating_point,
    simulate,
)
from shipnet.ballast.diagnosis import READINGS
from shipnet.ballast.faults import FAULTS, faulty
from shipnet.ballast.metrics import (
    BASIS,
    confusion,
    false_alarms,
    rates,
)
from shipnet.ballast.trials import fault_trials, half_found, spread_actuator
from shipnet.errors import ArgumentError
from shipnet.intervals import event_interval, share_interval


@pytest.fixture(scope="module")
def trials():
    return fault_trials(n_valves=12, rng=np.random.default_rng(2024))


@pytest.mark.parametrize(("hits", "n"), [(0, 1), (0, 2048), (3, 7), (7, 7), (100, 2048)])
@pytest.mark.parametrize("confidence", [0.5, 0.95, 0.999])
def test_the_interval_of_a_share_is_that_of_the_exact_test(hits, n, confidence):
    low, high = share_interval(hits, n, confidence=confidence)
    peer = binomtest(hits, n).proportion_ci(confidence, method="exact")
    assert (low, high) == pytest.approx((peer.low, peer.high), abs=1e-9)


@pytest.mark.parametrize("events", [0, 1, 4, 250])
def test_the_ends_of_a_rate_leave_half_the_rest_on_either_side(events):
    low, high = event_interval(events, 3.0, confidence=0.9)
    assert poisson.cdf(events, 3.0 * high) == pytest.approx(0.05)
    if events:
        assert poisson.sf(events - 1, 3.0 * low) == pytest.approx(0.05)
    else:
        assert low == 0


def test_intervals_of_rows_and_of_nothing():
    low, high = share_interval([0, 1, 0], [0, 2, 4])
    assert low[0] == 0
    assert high[0] == 1
    assert low.shape == high.shape == (3,)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: share_interval(3, 2), "hits is 3 of 2 trials"),
        (lambda: share_interval(-1, 2), "hits is -1"),
        (lambda: share_interval(0.5, 2), "hits is 0.5"),
        (lambda: share_interval(np.nan, 2), "hits is nan"),
        (lambda: share_interval(1, 2, confidence=1.0), "confidence is 1.0"),
        (lambda: event_interval(1, 0.0), "exposure is 0.0"),
        (lambda: event_interval(1, np.nan), "exposure is nan"),
    ],
)
def test_counts_that_cannot_be_are_named(call, message):
    with pytest.raises(ArgumentError, match=message):
        call()


def test_all_faults_are_named_by_dead_bands_and_ramps_alike(trials):
    table = rates(trials)
    for reading in ("crisp", "fuzzy"):
        found = table.loc[reading]
        assert (found.loc[list(FAULTS), "named"] == 1).all()
        assert found.loc["normal", "detected"] == 0
        isolated = found.loc[list(FAULTS), "isolated"]
        # With the motor off S1 and S2 are true as well, and of higher rank.
        assert isolated[isolated < 1].index.tolist() == ["Pos3", "Pos4"]
    same = [trials[trials["reading"] == r].drop(columns="reading").reset_index(drop=True)
            for r in ("crisp", "fuzzy")]  # fmt: skip
    pd.testing.assert_frame_equal(*same)


def test_read_as_printed_every_healthy_valve_has_an_alarm(trials):
    table = rates(trials).loc["literal"]
    assert table.loc["normal", "detected"] == 1
    # What outranks P2, which noise alone sets off at rest, is all that is right.
    assert table.index[table["isolated"] == 1].tolist() == ["G1", "P1", "P2", "V1"]


def test_shares_and_confusion_count_the_same_trials(trials):
    table = rates(trials)
    assert (table["n"] == 12).all()
    for reading in READINGS:
        matrix = confusion(trials, reading=reading)
        assert (matrix.sum(axis=1) == 12).all()
        right = [matrix.loc[fault, fault] / 12 for fault in matrix.index]
        assert table.loc[reading, "isolated"].tolist() == right
    assert table["named_low"].le(table["named"]).all()
    assert table["named_high"].ge(table["named"]).all()


def test_tables_say_what_stands_behind_them(trials):
    assert "does not validate" in BASIS
    assert rates(trials).attrs["basis"] == confusion(trials).attrs["basis"] == BASIS


def test_a_trial_is_what_the_run_of_the_same_valve_shows():
    rng = np.random.default_rng(11)
    trials = fault_trials(["V2"], n_valves=3, readings=["fuzzy"], spread=0.1, rng=rng)
    again = np.random.default_rng(11)
    actuator = spread_actuator(3, 0.1, again)
    orders = [Command("open", 5.0), Command("close", 35.0)]
    run = simulate(actuator, orders, duration=65, faults=[Fault("V2")], idle_step=0.5, rng=again)
    diagnosis = diagnose_run(run)
    first = np.nanmin(diagnosis.first_alarm, axis=1)
    np.testing.assert_allclose(trials["delay_s"], np.maximum(first - 5.0, 0))
    assert trials["active"].tolist() == ["V2"] * 3


def root(function, tolerance=1e-6):
    return brentq(function, 1e-6, 1 - 1e-6, xtol=tolerance)


def lowest_pressure(severity):
    """Return the lowest pump pressure of a trial without noise while its motor ran."""
    orders = [Command("open", 0.0), Command("close", 25.0)]
    run = simulate(
        commands=orders, duration=50, faults=[Fault("P2", severity)], sensors=Sensors.ideal()
    )
    return run.FP[run.running].min()


def point(code, severity):
    sick, _ = faulty(Actuator(), [Fault(code, severity)], 1)
    return operating_point(sick)


def test_half_of_the_faults_are_found_where_the_closed_form_crosses_the_middle_of_the_ramp():
    codes = ["P2", "P1", "G1", "O1", "S1", "Pos3"]
    quiet = Sensors(noise=(0.0,) * 5)
    rng = np.random.default_rng(1)
    table = half_found(codes, n_valves=2, spread=0.0, sensors=quiet, rng=rng)["half"]
    expected = {
        "P2": root(lambda s: lowest_pressure(s) - 2.5, 1e-3),
        "P1": root(lambda s: point("P1", s).MC[0] - 2.5),
        "G1": 120 / 125,
        "S1": 2.5 / 5,
        "Pos3": 2.5 / 15,
    }
    # Bisection leaves 0.002, the root of P2 0.001; a step of the converter is 0.007 of 5 %.
    for code, severity in expected.items():
        assert table[code] == pytest.approx(severity, abs=0.008), code
    # The motor is hotter after the two strokes than in the mean of many.
    assert 0.9 < table["O1"] < root(lambda s: point("O1", s).OT[0] - 85) + 0.005


def test_noise_finds_a_fault_sooner_never_later():
    noisy, quiet = (
        half_found(["P2", "S1"], n_valves=6, spread=0.0, steps=6, sensors=sensors,
                   rng=np.random.default_rng(1))["half"]
        for sensors in (None, Sensors(noise=(0.0,) * 5))
    )  # fmt: skip
    assert (noisy < quiet).all()


def test_about_half_of_the_trials_at_that_severity_are_found():
    more = dict(n_valves=64, spread=0.1)
    half = half_found(["V1"], steps=7, rng=np.random.default_rng(1), **more).loc["V1", "half"]
    shares = [
        fault_trials(["V1"], severity=half + change, readings=["fuzzy"],
                     rng=np.random.default_rng(2), **more)["named"].mean()
        for change in (-0.04, 0.0, 0.04)
    ]  # fmt: skip
    assert shares[0] < 0.2
    # Median and share each vary by 0.0625; four standard deviations of both, and a bisection.
    assert 0.12 <= shares[1] <= 0.88
    assert shares[2] > 0.8


def test_a_fault_that_is_not_found_at_all_has_no_severity():
    never = half_found(["V1"], n_valves=3, reading="fuzzy", k=900, n=900, steps=1,
                       rng=np.random.default_rng(1))  # fmt: skip
    assert never.loc["V1"].isna().all()


def test_severities_may_differ_from_valve_to_valve():
    trials = fault_trials(["Pos3"], n_valves=3, severity=[0.0, 0.1, 1.0], readings=["fuzzy"],
                          rng=np.random.default_rng(1))  # fmt: skip
    assert trials["named"].tolist() == [False, False, True]
    assert trials["delay_s"].isna().tolist() == [True, True, False]


def test_false_alarms_are_those_of_a_diagnosis_of_the_whole_run():
    more = dict(n_valves=6, spread=0.0)
    table = false_alarms(duration=130, period=60, readings=["literal", "fuzzy"],
                         rng=np.random.default_rng(4), **more)  # fmt: skip
    rng = np.random.default_rng(4)
    actuator = spread_actuator(6, 0.0, rng)
    orders = [Command("open"), Command("close", 60.0)]
    run = simulate(actuator, orders, duration=119.9, idle_step=1.0, rng=rng)
    quiet = diagnose_run(run, reading="literal").headline == "normal"
    begins = quiet[:-1] & ~quiet[1:]
    assert table.loc["literal", "alarms"] == begins.sum() + (~quiet[0]).sum()
    assert table.loc["literal", "commands"] == table.loc["literal", "alarmed"] == 12
    assert table.loc["fuzzy", "alarms"] == 0
    assert table["valve_years"].to_numpy() == pytest.approx(6 * 120 / (365.25 * 86400))
    years = table.loc["fuzzy", "valve_years"]
    assert table.loc["fuzzy", "per_valve_year_high"] == pytest.approx(-np.log(0.025) / years)


def test_blocks_do_not_change_the_count_of_false_alarms(monkeypatch):
    from shipnet.ballast import metrics

    def count():
        return false_alarms(duration=60, period=60, n_valves=3, rng=np.random.default_rng(4))

    whole, original = count(), metrics.blocks
    monkeypatch.setattr(metrics, "blocks", lambda *a, **k: original(*a, **k | {"size": 7}))
    pd.testing.assert_frame_equal(count(), whole)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda r: fault_trials(["V9"], n_valves=2, rng=r), "code is 'V9'"),
        (lambda r: fault_trials([], n_valves=2, rng=r), "codes is empty"),
        (lambda r: fault_trials(["V1"], n_valves=0, rng=r), "n_valves is 0"),
        (lambda r: fault_trials(["V1"], n_valves=2, severity=2.0, rng=r), "severity of V1"),
        (lambda r: fault_trials(["V1"], n_valves=2, readings=["x"], rng=r), "reading is 'x'"),
        (lambda r: half_found(["V1"], criterion="x", rng=r), "criterion is 'x'"),
        (lambda r: half_found(["V1"], steps=0, rng=r), "steps is 0"),
        (lambda r: false_alarms(duration=10, period=60, rng=r), "duration is 10"),
        (lambda r: false_alarms(period=1, rng=r), "period is 1"),
        (lambda r: spread_actuator(3, -1, r), "spread is -1"),
    ],
)
def test_an_argument_of_a_trial_out_of_range_is_named(call, message):
    with pytest.raises(ArgumentError, match=message):
        call(np.random.default_rng(0))


def test_a_reading_that_was_not_tried_is_named(trials):
    with pytest.raises(ArgumentError, match="reading is 'x'; the trials are of literal, crisp"):
        confusion(trials, reading="x")
