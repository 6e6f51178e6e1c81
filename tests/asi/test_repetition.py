import numpy as np
import pytest

from shipnet.asi.emc.failures import CYCLES, TRIES, cycle_effect, error_series
from shipnet.asi.timing import Transaction
from shipnet.errors import ArgumentError

SLOT = 156e-6


def rng():
    return np.random.default_rng(2024)


def test_three_failed_cycles_in_a_row_take_as_long_as_a_chain_of_states_says():
    # The chain counts failed cycles in a row, 0 to 2; the third is the end. Mean steps to it.
    for p in (0.2, 0.5, 0.9):
        q = p**2
        step = np.array([[1 - q, q, 0], [1 - q, 0, q], [1 - q, 0, 0]])
        cycles = np.linalg.solve(np.eye(3) - step, np.ones(3))[0]
        row = cycle_effect(p, cycle_time=4e-3).iloc[0]
        assert row["between_drops_s"] == pytest.approx(4e-3 * cycles, rel=1e-9)
        assert row["cycle_failure"] == pytest.approx(q)
        assert row["three_cycles"] == pytest.approx(q**3)
        assert row["drops_per_h"] == pytest.approx(31 * 3600 / (4e-3 * cycles))


def test_the_ends_of_the_scale_and_the_number_of_slaves():
    table = cycle_effect([0, 1, 1e-200], slaves=10, cycle_time=2e-3)
    assert table["between_drops_s"].tolist() == [np.inf, pytest.approx(6e-3), np.inf]
    assert table["drops_per_h"].tolist() == [0, pytest.approx(10 * 3600 / 6e-3), 0]
    assert table["repetitions_per_s"][:2].tolist() == [0, 5000]
    # A cycle of 31 slaves with one repetition: 150 us of 5 ms, or 200 repetitions a second.
    assert cycle_effect(1 / 31)["repetitions_per_s"][0] == pytest.approx(200)
    assert cycle_effect([]).empty


def plain_series(inside, generator, packets, slaves, slot, length):
    """Count series as a first script would: one packet, one exchange after the other."""
    counts = [0] * 7
    for _ in range(packets):
        t = -generator.uniform(0, (slaves + 2) * slot)
        row = [0] * slaves
        while t < length:
            for slave in range(slaves):
                for _ in range(2):
                    failed = -slot < t < length and generator.random() < inside
                    t += slot
                    if not failed:
                        counts[row[slave]] += 1
                        row[slave] = 0
                        break
                    row[slave] += 1
                if row[slave] == 6:
                    counts[6] += 1
                    row[slave] = 0
            t += 2 * slot
        for left in row:
            counts[left] += 1
    return np.array(counts[1:])


@pytest.mark.parametrize(
    ("inside", "slaves", "length"), [(0.3, 31, 15e-3), (0.7, 5, 15e-3), (1.0, 2, 4e-3)]
)
def test_batches_count_what_a_plain_loop_counts(inside, slaves, length):
    packets = 300
    expected = plain_series(inside, rng(), packets, slaves, SLOT, length) / packets
    table = error_series(inside, rng(), 6000, slaves=slaves, packet_length=length)
    assert table["failures"].tolist() == [1, 2, 3, 4, 5, 6]
    # Counts a packet scatter with their root or less; five sigma of the loop, and of nothing.
    tolerance = 5 * np.sqrt((expected + 1 / packets) / packets)
    assert (np.abs(table["per_packet"] - expected) < tolerance).all()
    assert (table["per_packet"] == table["series"] / 6000).all()
    assert table["per_h"].tolist() == pytest.approx((table["per_packet"] * 12_000).tolist())


def test_a_single_packet_counts_as_much_as_one_of_many():
    # Series that are still open when the packet ends count as well.
    options = {"slaves": 3, "packet_length": 2e-3}
    generator = rng()
    alone = sum(error_series(0.9, generator, 1, **options)["series"] for _ in range(400)) / 400
    many = error_series(0.9, rng(), 8000, **options)["per_packet"]
    assert (np.abs(alone - many) <= 5 * np.sqrt(many / 400)).all()


def test_in_a_packet_without_end_the_closed_form_holds():
    # 10 s of independent failures: series are geometric up to the sixth, drops as often as
    # `cycle_effect` says with cycles as long as repetitions make them.
    p, slaves, length = 0.5, 8, 10.0
    table = error_series(
        p, rng(), 40, slaves=slaves, packet_length=length, packet_period=11.0
    ).set_index("failures")
    law = np.array([p**k * (1 - p) for k in range(1, 6)] + [p**6])
    share = (table["series"] / table["series"].sum()).tolist()
    assert share == pytest.approx(law / law.sum(), rel=0.03)
    cycle = (slaves * (1 + p) + 2) * SLOT
    drops = cycle_effect(p, slaves=slaves, cycle_time=cycle)["drops_per_h"][0] * length / 3600
    assert table.loc[6, "per_packet"] == pytest.approx(drops, rel=0.03)


def test_packets_drop_slaves_far_more_often_than_independent_failures():
    duty = 15 / 300
    table = error_series(0.5, rng(), 4000, slaves=8).set_index("failures")
    cycle = (8 + 2) * SLOT
    independent = cycle_effect(0.5 * duty, slaves=8, cycle_time=cycle)["drops_per_h"][0]
    assert table.loc[6, "per_h"] > 1000 * independent


def test_certain_failure_and_none():
    assert not error_series(0, rng(), 100)["series"].any()
    # A cycle of one slave has four slots of 156 us, two of them tries: 3 ms hold four of them and
    # drop it once or more. A cycle of 31 slaves takes 10 ms when all tries are repeated.
    assert error_series(1, rng(), 500, slaves=1, packet_length=3e-3)["series"].iloc[-1] >= 500
    assert error_series(1, rng(), 500, slaves=31)["series"].iloc[-1] == 0
    # A packet that lasts no time still hits what is under way: one of 31 slots in 33.
    point = error_series(1, rng(), 4000, slaves=31, packet_length=0.0)
    assert point["per_packet"][0] == pytest.approx(31 / 33, abs=0.02)
    assert not point["series"][1:].any()


def test_longer_exchanges_are_hit_less_often_in_a_row():
    long = Transaction(master_pause=10, slave_pause=20)
    ordinary, slow = (
        error_series(0.5, rng(), 2000, slaves=8, transaction=one).set_index("failures")["series"]
        for one in (None, long)
    )
    assert slow[6] < 0.5 * ordinary[6]
    assert TRIES * CYCLES == 6


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: cycle_effect(1.1), "rate is 1.1; it must be one probability or a row"),
        (lambda: cycle_effect([0.1, np.nan]), "rate is"),
        (lambda: cycle_effect("a"), "rate is 'a'"),
        (lambda: cycle_effect([[0.1]]), "one probability or a row"),
        (lambda: cycle_effect(0.1, slaves=0), r"slaves is 0; .* 1\.\.31"),
        (lambda: cycle_effect(0.1, slaves=62), "slaves is 62"),
        (lambda: cycle_effect(0.1, cycle_time=0), "cycle_time is 0 s"),
        (lambda: error_series(-0.1, rng()), "inside is -0.1"),
        (lambda: error_series(0.1, rng(), 0), "n_packets is 0"),
        (lambda: error_series(0.1, rng(), slaves=1.5), "slaves is 1.5"),
        (lambda: error_series(0.1, rng(), packet_length=np.nan), "packet_length is nan"),
        (lambda: error_series(0.1, rng(), packet_period=15e-3), "must be longer than the packet"),
    ],
)
def test_bad_arguments_are_named(call, message):
    with pytest.raises(ArgumentError, match=message):
        call()
