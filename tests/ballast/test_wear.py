from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.stats import linregress, t

from shipnet.ballast.actuator import Actuator, stroke_time
from shipnet.ballast.plant import Command, Fault
from shipnet.ballast.simulation import simulate
from shipnet.ballast.wear import (
    PREDICTORS,
    Wear,
    fit_trend,
    leak_from_pressure,
    limit_leak,
    mid_pressure,
    remaining_life,
)
from shipnet.errors import ArgumentError
from tests.ballast.nominal import operating_point

X = np.arange(60.0)
FEW = X[::2]
SCALES = pytest.mark.parametrize("logarithmic", [False, True])


def line(rng, logarithmic, slope, noise, x=X):
    """Return points on a line, or on an exponential, with noise on its scale."""
    y = 50.0 + slope * x + noise * rng.standard_normal(x.size)
    return np.exp(y / 20) if logarithmic else y


@SCALES
def test_intervals_of_slope_and_crossing_have_the_stated_coverage(logarithmic):
    rng = np.random.default_rng(2024)
    rounds, inside, crossed = 400, 0, 0
    limit = 50.0 + 0.5 * 120
    for _ in range(rounds):
        trend = fit_trend(FEW, line(rng, logarithmic, 0.5, 6.0, FEW), logarithmic=logarithmic)
        scale = 20 if logarithmic else 1
        inside += abs(trend.slope - 0.5 / scale) <= trend.slope_margin
        crossing = trend.crossing(np.exp(limit / 20) if logarithmic else limit)
        crossed += crossing.low <= 120 <= crossing.high
    # 95 % of 400 is 380; four standard deviations are 17.
    assert 363 <= inside <= 397
    assert 363 <= crossed <= 397


@SCALES
def test_the_band_reaches_the_limit_where_the_crossing_says(logarithmic):
    y = line(np.random.default_rng(1), logarithmic, 0.5, 3.0)
    trend = fit_trend(X, y, logarithmic=logarithmic)
    limit = np.exp(110 / 20) if logarithmic else 110.0
    crossing = trend.crossing(limit)

    def meets(end, place):
        return trend.band(place)[end] - limit

    assert float(trend.at(crossing.estimate)) == pytest.approx(limit)
    assert brentq(lambda x: meets(1, x), X.mean(), 1000) == pytest.approx(crossing.low)
    assert brentq(lambda x: meets(0, x), X.mean(), 1000) == pytest.approx(crossing.high)


def test_the_band_equals_that_of_polyfit():
    y = line(np.random.default_rng(9), False, 0.5, 3.0)
    (slope, offset), cov = np.polyfit(X, y, 1, cov=True)
    at = np.array([-10.0, 29.5, 100.0])
    deviation = np.sqrt([x @ cov @ x for x in np.stack([at, np.ones(3)], axis=1)])
    low, high = fit_trend(X, y).band(at)
    np.testing.assert_allclose((high + low) / 2, slope * at + offset)
    np.testing.assert_allclose((high - low) / 2, t.ppf(0.975, 58) * deviation)


@pytest.mark.parametrize("noise", [0.1, 5.0, 50.0])
@SCALES
def test_least_squares_equal_those_of_scipy(logarithmic, noise):
    y = line(np.random.default_rng(11), logarithmic, 0.5, noise)
    trend = fit_trend(X, y, logarithmic=logarithmic)
    peer = linregress(X, np.log(y) if logarithmic else y)
    fitted = (trend.slope, trend.slope_margin)
    assert fitted == pytest.approx((peer.slope, t.ppf(0.975, 58) * peer.stderr), rel=1e-9)
    assert trend.p_value == pytest.approx(peer.pvalue, rel=1e-6)


def test_without_a_trend_the_prediction_says_that_there_is_none():
    trend = fit_trend(X, np.random.default_rng(5).normal(90, 1, 60))
    assert not trend.found
    assert trend.text.startswith("no trend in 60 points (p = ")
    estimate, low, high = remaining_life(trend, 100.0, 60)
    assert np.isnan([estimate, low]).all() and high == np.inf


@SCALES
def test_equal_points_have_no_trend(logarithmic):
    trend = fit_trend(X, np.full(60, 7.0), logarithmic=logarithmic)
    assert not trend.found
    assert trend.at(100) == pytest.approx(7.0)


@SCALES
def test_a_line_without_noise_is_found_exactly(logarithmic):
    y = np.exp(0.1 * X) if logarithmic else 2 + 0.1 * X
    trend = fit_trend(X, y, logarithmic=logarithmic)
    assert trend.found
    assert trend.slope == pytest.approx(0.1)
    goal = np.exp(8.0) if logarithmic else 10.0
    assert remaining_life(trend, goal, 59).estimate == pytest.approx(21, abs=1e-6)


def test_missing_points_and_those_without_a_logarithm_are_left_out():
    y = 3 + 0.2 * X
    gaps = np.where(X % 3 == 0, np.nan, y)
    present = ~np.isnan(gaps)
    assert fit_trend(X, gaps) == fit_trend(X[present], y[present])
    gaps[~present] = -1.0
    few = fit_trend(X[present], y[present], logarithmic=True)
    assert fit_trend(X, gaps, logarithmic=True) == few
    with pytest.raises(ArgumentError, match="have 4 valid points; a trend needs 5"):
        fit_trend(X[:5], [np.nan, 1, 2, 3, 4])


@SCALES
@pytest.mark.parametrize(
    "points", [[20, 18.1, 16, 14.2, 12, 10], [10, 12, 14.2, 16, 18.1, 20], [20] * 6, [20, 21] * 3]
)
def test_a_limit_already_reached_leaves_no_life(points, logarithmic):
    trend = fit_trend(np.arange(6), points, logarithmic=logarithmic)
    assert remaining_life(trend, 5.0, now=5) == (0.0, 0.0, 0.0)


@SCALES
def test_a_falling_trend_never_reaches_a_limit_above_it(logarithmic):
    falling = fit_trend(np.arange(6), [20, 18.1, 16, 14.2, 12, 10], logarithmic=logarithmic)
    assert remaining_life(falling, 25.0, now=5) == (np.inf,) * 3


def test_the_limit_of_the_leak_is_that_of_the_simulated_stroke():
    factor = limit_leak() / Actuator().pump_leak
    severity = np.log(factor) / np.log(821)
    run = simulate(1, [Command("open")], until=15, faults=[Fault("P2", severity)])
    assert run.strokes()["duration_s"][0] == pytest.approx(10.0, abs=0.005)
    assert float(mid_pressure(limit_leak())) == pytest.approx(73, abs=0.5)


def test_the_inverted_model_returns_the_leak_it_was_given():
    leaks = Actuator().pump_leak * np.array([0.5, 1, 2, 5, 30])
    sick = replace(Actuator(), pump_leak=leaks)
    np.testing.assert_allclose(leak_from_pressure(operating_point(sick).FP), leaks, rtol=1e-9)
    assert np.isnan(leak_from_pressure([0.0, 2.0, 126.0, np.nan])).all()


def test_synthetic_wear_follows_its_law():
    wear = Wear.synthetic(5, 900, noise=(0.0, 0.0), rng=np.random.default_rng(1))
    k0 = Actuator().pump_leak
    np.testing.assert_allclose(np.diff(np.log(wear.leak), axis=0), np.tile(wear.rate, (899, 1)))
    assert wear.leak[0] == pytest.approx(np.full(5, k0))
    for valve in range(5):
        at = [0, 100, 450, 899]
        exact = replace(Actuator(), pump_leak=wear.leak[at, valve])
        np.testing.assert_allclose(wear.FP[at, valve], operating_point(exact).FP, rtol=1e-12)
        np.testing.assert_allclose(wear.stroke_time[at, valve], stroke_time(exact), atol=1e-4)
        life = int(wear.life[valve])
        if life < 899:
            assert wear.stroke_time[life, valve] <= 10 < wear.stroke_time[life + 1, valve]
    again = Wear.synthetic(2000, 1, rng=np.random.default_rng(1)).rate
    # Median and spread of 2000 logarithms: four standard deviations are 0.034 and 0.02.
    assert np.median(np.log(again)) == pytest.approx(np.log(2.6e-3), abs=0.034)
    assert np.std(np.log(again)) == pytest.approx(0.3, abs=0.02)


def test_p2_reports_a_worn_pump_more_than_a_thousand_strokes_too_late_and_t1_in_time():
    wear = Wear.synthetic(64, 4000, rng=np.random.default_rng(2024))
    table = wear.alarms()
    # FP falls to 2.5 bar at 609 times the initial leak; the stroke takes 10 s at 3.32 times.
    closed = np.log(609.4 / 3.3233) / wear.rate
    late = table["P2"] - table["life"]
    seen = late.notna()
    assert late[seen].to_numpy() == pytest.approx(closed[seen], rel=0.01)
    assert late.median() > 1000
    assert (table["T1"] - table["life"]).abs().max() < 40


def test_only_the_inverted_model_predicts_life_without_bias():
    wear = Wear.synthetic(48, 1000, rng=np.random.default_rng(2024))
    table = wear.compare_predictors(parts=(0.3, 0.6, 0.9))
    assert (table.loc[["FP membership", "stroke time"], "median"] > 1.15).all()
    assert (table.loc["leak", "median"] - 1).abs().max() < 0.01
    assert (table.loc["leak", "within_20"] == 1).all()
    # 95 % of 48 is 45.6; four standard deviations are 6.
    assert (48 * table.loc["leak", "covers"] >= 39).all()
    assert (table.loc["FP membership", "covers"] == 0).all()
    assert (table["valves"] == 48).all()


def test_a_pump_that_does_not_wear_has_no_trend_and_no_end():
    wear = Wear.synthetic(1, 300, rate=1e-6, spread=0.0, rng=np.random.default_rng(3))
    for predictor in PREDICTORS:
        prediction = wear.predict(1, 300, predictor=predictor)
        assert not prediction.trend.found
        assert np.isnan(prediction.remaining.estimate)


def test_arguments_of_wear_are_named():
    rng = np.random.default_rng(0)
    wear = Wear.synthetic(2, 50, rng=rng)
    with pytest.raises(ArgumentError, match="n_valves is 0"):
        Wear.synthetic(0, rng=rng)
    with pytest.raises(ArgumentError, match="rate is nan"):
        Wear.synthetic(1, rate=float("nan"), rng=rng)
    with pytest.raises(ArgumentError, match="predictor is 'luck'"):
        wear.predict(1, 20, predictor="luck")
    with pytest.raises(ArgumentError, match="at is 51"):
        wear.predict(1, 51)
    with pytest.raises(ArgumentError, match="part is 1"):
        wear.compare_predictors(parts=(1.0,))
