import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shipnet import datasets
from shipnet.asi import Transaction
from shipnet.asi.timing import Cycle, cycle_time
from shipnet.errors import ArgumentError
from tests.support import tolerance

PUBLISHED = datasets.read("asi_published_cycles.csv").astype({"number": int, "time_ms": float})


def published(quantity):
    found = PUBLISHED[PUBLISHED["quantity"].str.startswith(quantity)]
    assert len(found) == 1
    return found["number"].item(), found["time_ms"].item() * 1e-3


def requests(alone, pairs, cycles):
    """Return the cycles of a master, one transaction per row: a slave or None."""
    for cycle in range(cycles):
        yield from (f"{address}" for address in range(alone))
        yield from (f"{address}{'AB'[cycle % 2]}" for address in range(pairs))
        yield from (None, None)


def test_published_cycles_are_reproduced():
    slaves, time = published("cycle, OMRON")
    assert cycle_time(slaves) == pytest.approx(time, rel=tolerance("asi.cycles"))
    slaves, time = published("cycle, Schneider, slaves of a full line")
    assert cycle_time(slaves, inclusion=0) == pytest.approx(time, rel=tolerance("asi.cycles"))


def test_the_specified_cycles_need_short_transactions():
    slaves, limit = published("cycle, specification, standard")
    short, long = Transaction(2, 2), Transaction()
    assert cycle_time(slaves, transaction=short) == pytest.approx(4.95e-3)
    assert cycle_time(slaves, transaction=short) < limit < cycle_time(slaves, transaction=long)
    slaves, limit = published("cycle, specification, A/B")
    assert Cycle(slaves, transaction=short).update_time() == pytest.approx(9.9e-3)
    assert Cycle(slaves, transaction=short).update_time() < limit


def test_schneider_prints_156_us_times_n_plus_one_above_a_floor():
    n = np.arange(1, 32)
    last, floor = published("cycle, Schneider, slaves up to")
    ours = np.maximum([cycle_time(int(number), inclusion=0) for number in n], floor)
    printed = np.where(n <= last, floor, 156e-6 * (1 + n))
    # At 19 slaves the formula gives 3.12 ms already; the FAQ still prints 3.
    assert n[~np.isclose(ours, printed)].tolist() == [last]


@given(st.integers(1, 31).flatmap(lambda n: st.tuples(st.just(n), st.integers(0, n))))
def test_a_master_that_polls_in_turn_updates_every_slave_in_time(used):
    addresses, pairs = used
    alone = addresses - pairs
    line = list(requests(alone, pairs, cycles=4))
    step = Transaction().duration
    cycle = Cycle(alone + 2 * pairs, pairs=pairs)
    assert len(line) / 4 * step == pytest.approx(cycle.time)
    gaps = []
    for slave in set(line) - {None}:
        places = [place for place, asked in enumerate(line) if asked == slave]
        gaps += [b - a for a, b in itertools.pairwise(places)]
    assert max(gaps) * step == pytest.approx(cycle.update_time())


@pytest.mark.parametrize(("alone", "pairs", "slave"), [(5, 0, "3"), (3, 2, "1A"), (3, 2, "2")])
def test_changes_at_any_time_are_received_within_the_bounds(alone, pairs, slave):
    transaction = Transaction(3, 2)
    bit, step = transaction.bit_time, transaction.duration
    line = list(requests(alone, pairs, cycles=8))
    looks = [place * step + 14 * bit for place, asked in enumerate(line) if asked == slave]
    change = np.random.default_rng(1).uniform(looks[0], looks[-1], 200_000)
    heard = np.array(looks)[np.searchsorted(looks, change)] + (3 + 7) * bit
    cycle = Cycle(alone + 2 * pairs, pairs=pairs)
    best, typical, worst = cycle.response_time(paired=slave.endswith("A"))
    waited = heard - change
    assert waited.mean() == pytest.approx(typical, rel=0.01)
    assert best <= waited.min() < best + 1e-6
    assert worst - 1e-6 < waited.max() <= worst


def test_repetitions_only_delay_the_worst_case():
    cycle = Cycle(31)
    plain, late = cycle.response_time(repetitions=0), cycle.response_time(repetitions=3)
    assert late[:2] == plain[:2]
    # A request that is repeated, or a slave that is out of step, takes two bit times longer.
    assert late.worst - plain.worst == pytest.approx(3 * 168e-6)
    assert plain.worst - cycle.response_time().worst == pytest.approx((33 + 1) * 12e-6)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: cycle_time(63), "slaves is 63; .* 0..62"),
        (lambda: cycle_time(-1), "slaves is -1"),
        (lambda: cycle_time(1.5), "slaves is 1.5"),
        (lambda: cycle_time(True), "slaves is True"),
        (lambda: cycle_time("5"), "slaves is '5'"),
        (lambda: cycle_time(44, pairs=12), "pairs is 12; for 44 slaves it must be 13..22"),
        (lambda: cycle_time(3, pairs=2), "for 3 slaves it must be 0..1"),
        (lambda: cycle_time(1, inclusion=2), "inclusion is 2"),
        (lambda: Cycle().response_time(repetitions=0.5), "repetitions is 0.5"),
        (lambda: Cycle().response_time("S-7.3", conversion=-1), "conversion is -1 s"),
    ],
)
def test_illegal_cycles_are_refused(call, message):
    with pytest.raises(ArgumentError, match=message):
        call()
