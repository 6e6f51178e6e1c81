import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shipnet.asi import BIT_TIME
from shipnet.asi.channel import MISSED
from shipnet.asi.master import Master
from shipnet.asi.slave import Slave
from shipnet.asi.timing import Transaction
from shipnet.errors import ArgumentError
from tests.asi.lines import draw, placed, simulate_drawn
from tests.asi.poll import poll

FULL = [f"{address}{half}" for address in range(1, 32) for half in "AB"]
STANDARD = [str(address) for address in range(1, 32)]


def slave(label):
    return Slave(label, "S-7.A.E" if label[-1] in "AB" else "S-7.F.F", inputs=5)


def one_by_one(labels, drawn, **options):
    """Simulate each run, telegram by telegram."""
    drop_after, status_poll = options.pop("drop_after", 3), options.pop("status_poll", True)
    master = Master(
        readmit=False, drop_after=drop_after, repetitions=drawn.shape[-1] - 1,
        status_poll=status_poll,
    )  # fmt: skip
    slaves = placed([slave(label) for label in labels], delays=options.pop("delays", None))
    cycles = drawn.shape[1]
    return [simulate_drawn(run, slaves, master, cycles=cycles, **options) for run in drawn]


def assert_equal(labels, drawn, **options):
    many = poll(labels, drawn, **options)
    for i, run in enumerate(one_by_one(labels, drawn, **options)):
        summary = run.summary
        # Lengths are whole and half bit times, so their sums are exact.
        np.testing.assert_array_equal(run.cycle_times, many.cycle_time[i])
        assert summary.requests == many.requests[i]
        assert summary.repetitions == many.repetitions[i]
        dropped = run.lists.query("list == 'LAS' and not present").set_index("slave")["time_s"]
        assert set(dropped.index) == {
            label for label, cycle in zip(labels, many.dropped_in[i], strict=True) if cycle >= 0
        }
        begins = np.array([run.record.starts[row] for row, n in run.record.cycles[:-1] if n >= 0])
        for label, time in dropped.items():
            cycle = np.searchsorted(begins * BIT_TIME, time, side="right") - 1
            assert many.dropped_in[i, labels.index(label)] == cycle
        classes = run.failure_classes().reindex(labels)
        np.testing.assert_array_equal(classes, many.failure_classes[i])
        # Two sums of the same squares in different order: equal to rounding.
        times = run.response_times().reindex(labels)
        for ours, theirs in (
            (many.mean_response[i], times["mean_s"]),
            (many.longest_response[i], times["longest_s"]),
        ):
            np.testing.assert_allclose(ours, theirs, rtol=1e-9)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("rate", [0.01, 0.2, 0.6])
def test_both_models_agree_on_every_cycle(seed, rate):
    rng = np.random.default_rng(seed)
    labels = [*FULL[:8], "9A", "10B", *STANDARD[11:16]]
    rng.shuffle(labels)
    rates = rng.uniform(0, rate, (2, len(labels)))
    drawn = draw(rng, 60, *rates, n_runs=2)
    assert_equal(labels, drawn, delays={labels[0]: 6e-6, labels[1]: 1.5e-6})


@given(
    labels=st.sampled_from([["5"], ["5A"], ["5B"], ["5A", "5B"], ["5B", "2", "5A"], FULL[:5]]),
    attempts=st.integers(1, 4),
    drop_after=st.integers(1, 4),
    status_poll=st.booleans(),
    rates=st.tuples(st.sampled_from([0.0, 0.3, 0.9, 1.0]), st.sampled_from([0.0, 0.3, 1.0])),
    seed=st.integers(0, 2**32 - 1),
    pauses=st.tuples(st.sampled_from([2.0, 3.0]), st.sampled_from([0.0, 2.0])),
)
@settings(max_examples=40)
def test_both_models_agree_whatever_the_line(
    labels, attempts, drop_after, status_poll, rates, seed, pauses
):
    rng = np.random.default_rng(seed)
    n = len(labels)
    drawn = draw(rng, 12, np.full(n, rates[0]), np.full(n, rates[1]), attempts=attempts, n_runs=1)
    if n == 1:
        # The request before the first cycle went to this slave: it cannot be another's.
        drawn[:, 0] &= 0xFF - MISSED
    transaction = Transaction(master_pause=pauses[0], unsynchronised=pauses[1], slave_pause=1.5)
    assert_equal(
        labels, drawn, drop_after=drop_after, status_poll=status_poll, transaction=transaction
    )


def test_undisturbed_runs_are_all_alike():
    many = poll(FULL, np.zeros((3, 8, 3, 62, 2), dtype=np.uint8))
    assert (many.cycle_time == (32 * 26 + 24) * BIT_TIME).all()
    assert (many.requests == 8 * 33).all()
    assert not many.repetitions.any() and not many.failure_classes.any()
    # An A/B slave is polled every other cycle.
    fresh = 10 * BIT_TIME
    assert many.longest_response == pytest.approx(2 * many.cycle_time[0, 0] + fresh)
    assert many.mean_response == pytest.approx(many.cycle_time[0, 0] + fresh)


def test_failures_in_a_row_follow_the_geometric_law():
    # With responses disturbed at the rate p, class n has the share (1 - p) p^(n - 1).
    p, cycles, runs = 0.2, 200, 200
    rng = np.random.default_rng(11)
    drawn = draw(rng, cycles, np.zeros(4), np.full(4, p), n_runs=runs)
    counted = poll(STANDARD[:4], drawn, drop_after=1000).failure_classes.sum(axis=(0, 1))
    total = counted.sum()
    expected = (1 - p) * p ** np.arange(6)
    # Five standard deviations.
    assert counted[:6] / total == pytest.approx(expected, abs=5 * np.sqrt(expected.max() / total))
    assert (np.abs(counted[:6] / total - expected) < 5 * np.sqrt(expected / total)).all()


def test_a_slave_is_dropped_as_often_as_six_failures_are_likely():
    # Of three cycles with two tries each, with lost responses only: p^6 from the first on.
    p, runs = 0.5, 4000
    rng = np.random.default_rng(12)
    drawn = draw(rng, 3, np.zeros(2), np.full(2, p), n_runs=runs)
    dropped = poll(STANDARD[:2], drawn).dropped_in
    assert set(np.unique(dropped)) == {-1, 2}
    share = (dropped == 2).mean()
    assert share == pytest.approx(p**6, abs=5 * np.sqrt(p**6 / (2 * runs)))


def test_slaves_come_in_the_order_given():
    drawn = np.zeros((1, 4, 3, 3, 2), dtype=np.uint8)
    drawn[:, :, 0, 2] = 1
    many = poll(["9", "5", "7"], drawn)
    assert many.slaves == ("9", "5", "7")
    assert many.dropped_in.tolist() == [[-1, -1, 2]]


def test_no_cycles_and_no_runs_are_no_fault():
    assert poll(["5"], np.zeros((2, 0, 3, 1, 2), np.uint8)).cycle_time.shape == (2, 0)
    assert poll(["5"], np.zeros((0, 3, 3, 1, 2), np.uint8)).cycle_time.shape == (0, 3)


@pytest.mark.parametrize(
    ("labels", "options", "message"),
    [
        ([], {}, "there must be one or more"),
        (["5", "5"], {}, "addresses of their own"),
        (["5", "5B"], {}, "addresses of their own"),
        (["0"], {}, "addresses of their own"),
        (["5A", "5C"], {}, "slave is '5C'"),
        (["5"], {"delays": {"6": 1e-6}}, "delays name 6"),
        (["5"], {"delays": {"5": 20e-6}}, "within 10 bit times"),
        (["5"], {"delays": {"5": -1e-6}}, "within 10 bit times"),
        (["5"], {"drop_after": 0}, "drop_after is 0"),
        (["5", "6"], {"n": 1}, "have the shape"),
    ],
)
def test_bad_arguments_are_refused(labels, options, message):
    n = options.pop("n", len(labels))
    with pytest.raises(ArgumentError, match=message):
        poll(labels, np.zeros((1, 2, 3, n, 2), dtype=np.uint8), **options)
