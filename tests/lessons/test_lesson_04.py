"""The right answers of lesson 4, each found by a second route: a simulated line."""

import numpy as np
import pytest

from shipnet.asi import Slave, simulate
from shipnet.asi.timing import BIT_TIME, Transaction
from shipnet.exercises.lesson_04 import _efficiency
from tests.lessons.students import NAMED, right


def line(n):
    return [Slave(f"{address}") for address in range(1, n + 1)]


@NAMED
def test_two_requests_follow_each_other_as_computed(name):
    numbers, exchange = right("ex-04-1", name)
    run = simulate(line(2), cycles=10, transaction=Transaction(**numbers))
    rows = run.events().query("phase == 'data_exchange' and cycle == 8")
    assert np.diff(rows["time_s"]) * 1e6 == pytest.approx(exchange)


@NAMED
def test_the_cycle_is_that_of_a_simulated_line(name):
    numbers, cycle = right("ex-04-2", name)
    transaction = Transaction(master_pause=numbers["bits"] - 23)
    run = simulate(line(numbers["slaves"]), cycles=10, transaction=transaction)
    # The request for a new slave has no answer: it waits for 10 bit times and is over.
    silent = numbers["bits"] - transaction.unanswered
    simulated = run.cycle_times[-1] + silent * BIT_TIME
    assert simulated * 1e3 == pytest.approx(cycle)


@pytest.mark.parametrize("pauses", [(2, 2), (3, 2), (10, 2)])
def test_the_efficiency_is_counted_on_a_simulated_line(pauses):
    run = simulate(
        line(4), cycles=5, transaction=Transaction(master_pause=pauses[0], slave_pause=pauses[1])
    )
    rows = run.events().query("phase == 'data_exchange' and cycle == 3")
    span = rows["time_s"].iloc[-1] - rows["time_s"].iloc[0]
    assert 100 * 8 * 3 * BIT_TIME / span == pytest.approx(_efficiency(8, *pauses))


@NAMED
def test_one_more_slave_exceeds_the_limit(name):
    """Counted in whole bit times."""
    numbers, most = right("ex-04-4", name)
    limit = round(numbers["limit"] * 1e-3 / BIT_TIME)
    waited = [(n + 2 + numbers["repetitions"]) * 26 + 3 + 7 for n in (most, most + 1)]
    assert waited[0] <= limit < waited[1]
