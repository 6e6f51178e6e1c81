"""Every function of two fronts that draws random numbers names a seed of a wrong type."""

import pytest

from shipnet import engine, remote_control
from tests.support import check_mistakes

CALLS = [
    (engine.serve, {"speed": 0}),
    (engine.simulate, {"system": engine.System(), "until": 0.1}),
    (engine.single_failures, {"system": engine.System(), "trials": 1}),
    (remote_control.compare_checks, {"n_items": [1], "rates": [1e-3], "packets": 10}),
    (remote_control.simulate, {"system": remote_control.System(), "until": 0.2}),
    (remote_control.switch_delays, {"changes": 1, "bit_rates": [9600]}),
]


@pytest.mark.parametrize(("function", "others"), CALLS)
def test_a_seed_of_a_wrong_type_is_named(function, others):
    check_mistakes(lambda rng: function(**others, rng=rng), {"rng": 1}, {"rng": "None empty"})
