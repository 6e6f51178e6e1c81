"""Rare errors, compared with counts where possible, with theory where valid, and repeated."""

from dataclasses import replace
from importlib.util import find_spec

import numpy as np
import pytest

from shipnet import asi
from shipnet.asi.emc import rare_errors
from shipnet.asi.emc.disturbances import Noise
from shipnet.asi.emc.error_rates import count_errors, error_rate
from shipnet.asi.emc.rare_errors import rare_error_rates
from shipnet.asi.receiver import RECEIVERS, Receiver
from shipnet.errors import ArgumentError
from tests.support import require, tolerance

# A short silence before the telegrams keeps the tests fast.
NEAR = asi.line(100, slaves=(5, 100)).waveform(node="5 m", before=6.5e-6)
PROOF, DEAF = RECEIVERS["noise-proof"], Receiver(minimum=1.3)
DENSITY = Noise().density


def rate_of(deviation, n, receiver=PROOF, wave=NEAR, **options):
    return rare_error_rates(wave, DENSITY(deviation), n, receiver=receiver, **options).iloc[0]


def within(row, low, high):
    """Return True if two intervals overlap."""
    return row["rate_low"] <= high and low <= row["rate_high"]


@pytest.mark.parametrize(
    ("deviation", "receiver", "n"),
    [(0.6, PROOF, 40_000), (0.5, PROOF, 150_000), (0.7, DEAF, 100_000)],
)
def test_counting_agrees(deviation, receiver, n):
    counted = count_errors(NEAR, Noise(), deviation, n, 1, receiver=receiver).iloc[0]
    sampled = rate_of(deviation, 20_000, receiver)
    assert within(sampled, counted["rate_low"], counted["rate_high"]) and sampled["sound"]
    # Its interval is also narrower.
    width = sampled["rate_high"] - sampled["rate_low"]
    assert width < counted["rate_high"] - counted["rate_low"]


def test_theory_gives_the_same_rate_down_to_1e_10():
    table = rare_error_rates(NEAR, DENSITY([0.5, 0.4, 0.3, 0.28]), 30_000, receiver=PROOF)
    theory = error_rate(NEAR, table["noise_density"], receiver=PROOF)
    assert table["sound"].all()
    assert theory[0] > 1e-3 and theory[-1] < 2e-10
    assert table["rate"].to_numpy() == pytest.approx(theory, rel=tolerance("asi.rare"))


def test_the_interval_contains_the_rate_as_often_as_it_says():
    truth = rate_of(0.4, 100_000, seed=1)["rate"]
    case = rare_errors._Case(*map(np.ascontiguousarray, NEAR.records), NEAR.dt, PROOF, 0.4)
    rng = np.random.default_rng(2024)
    held = 0
    for _ in range(150):
        found = rare_errors._summary([rare_errors._sample((case, 500, rng))])
        held += found["rate_low"] <= truth <= found["rate_high"]
    # 95 % of 150 are 142.5; four standard deviations are 10.7.
    assert 132 <= held


def test_a_rate_is_the_mean_of_strong_and_weak_telegrams():
    strong = replace(NEAR, u=NEAR.u[:1], bits=NEAR.bits[:1])
    weak = replace(strong, u=0.55 * strong.u)
    both = replace(NEAR, u=np.vstack([strong.u, weak.u]), bits=NEAR.bits[[0, 0]])
    table = rare_error_rates(
        {"strong": strong, "weak": weak, "both": both}, DENSITY(0.4), 40_000, receiver=PROOF
    )
    rates = dict(zip(table["wave"], table["rate"], strict=True))
    assert rates["weak"] > 100 * rates["strong"]
    # Both intervals are up to 7 % wide to either side.
    assert rates["both"] == pytest.approx((rates["strong"] + rates["weak"]) / 2, rel=0.15)


def test_a_forgotten_way_to_lose_a_telegram_makes_the_rate_unsound(monkeypatch):
    # Above 1 V, telegrams are lost if a weakened first pulse peaks a few samples off.
    assert rate_of(0.5, 100_000, DEAF)["sound"]
    monkeypatch.setattr(rare_errors, "_SLIPS", -1)
    rare_errors._points_of.cache_clear()
    rare_errors._proposal.cache_clear()
    blind = rate_of(0.5, 100_000, DEAF)
    rare_errors._points_of.cache_clear()
    rare_errors._proposal.cache_clear()
    assert not blind["sound"]


def test_each_design_point_satisfies_its_inequalities_and_none_nearer_does():
    rng = np.random.default_rng(3)
    for size in (1, 2, 5):
        sides = [(rng.standard_normal(8), float(rng.uniform(0.5, 2))) for _ in range(size)]
        point = rare_errors._design_point(sides)
        a, b = np.array([one for one, _ in sides]), np.array([other for _, other in sides])
        assert (a @ point >= b - 1e-9).all()
        # At the nearest point, every feasible direction leads away.
        for other in point + 0.3 * rng.standard_normal((2000, 8)):
            assert (a @ other < b).any() or other @ other >= point @ point - 1e-9
    opposite = [(np.array([1.0, 0.0]), 1.0), (np.array([-1.0, 0.0]), 1.0)]
    assert rare_errors._design_point(opposite) is None


def test_where_nothing_is_lost_the_rate_has_a_bound_and_is_not_sound():
    part = dict.fromkeys(("n", "w", "ww", "x", "xx", "lost", "far", "largest"), 0.0) | {"n": 1000.0}
    found = rare_errors._summary([part])
    assert found["rate"] == found["rate_low"] == 0 and not found["sound"]
    # The rule of three, for the hundred that were drawn without a shift.
    assert found["rate_high"] == pytest.approx(3.69 / 100, rel=0.01)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"waves": {}}, "waves is empty"),
        ({"waves": 3}, "waves is 3; it must be a Waveform"),
        ({"waves": {"a": None}}, "waves is None"),
        ({"noise_density": 0.0}, r"noise_density is 0\.0"),
        ({"noise_density": [np.nan]}, "noise_density is"),
        ({"n_telegrams": 999}, "n_telegrams is 999"),
        ({"n_telegrams": 2000.5}, r"n_telegrams is 2000\.5"),
        ({"seed": None}, "seed is None"),
        ({"seed": -1}, "seed is -1"),
        ({"receiver": Receiver(minimum=5.0)}, "received without an error"),
        ({"waves": replace(NEAR, u=0.1 * NEAR.u)}, "received without an error"),
        (
            {"waves": replace(NEAR, u=np.tile(NEAR.u, (5, 1)), bits=np.tile(NEAR.bits, (5, 1)))},
            "a wave has 80 telegrams; it may have at most 64",
        ),
    ],
)
def test_bad_arguments_are_named(change, message):
    good = {"waves": NEAR, "noise_density": 1e-3, "n_telegrams": 1000}
    with pytest.raises(ArgumentError, match=message):
        rare_error_rates(**good | change)


def test_the_last_bits_of_the_rates_do_not_depend_on_the_workers():
    require("cluster", find_spec("loky") is not None, "loky is missing")
    wave = asi.line(100, slaves=(5, 100)).waveform(node="5 m")
    options = {"n_telegrams": 4000, "receiver": RECEIVERS["noise-proof"]}
    density = Noise().density([0.4])
    here, there = (
        rare_error_rates(wave, density, **options, workers=workers) for workers in (1, 2)
    )
    assert here.equals(there)
