import pytest

from shipnet import datasets
from shipnet.asi import BIT_TIME, Transaction
from shipnet.asi.timing import MASTER_PAUSE_BITS
from shipnet.errors import ArgumentError

TIMES = datasets.read("asi_published_timing.csv").set_index("quantity")["value_us"].astype(float)


def test_published_times_are_consistent():
    assert TIMES["bit"] == BIT_TIME * 1e6
    assert TIMES["request"] == 14 * TIMES["bit"]
    assert TIMES["response"] == 7 * TIMES["bit"]
    assert TIMES["time-out for an answer"] == MASTER_PAUSE_BITS[1] * TIMES["bit"]
    assert TIMES["transaction"].between(Transaction(2, 1.5).duration * 1e6, 156).all()
    assert TIMES["transaction"].max() == pytest.approx(Transaction().duration * 1e6)
    edges = TIMES[TIMES.index.str.startswith("edge")]
    assert edges.is_monotonic_increasing
    assert edges.iloc[2:].to_numpy() - edges.iloc[:2].to_numpy() == pytest.approx(2 * 6)


@pytest.mark.parametrize(
    ("pauses", "microseconds"), [((2, 1.5), 147), ((2, 2), 150), ((3, 2), 156), ((10, 2), 198)]
)
def test_transactions_of_published_length(pauses, microseconds):
    transaction = Transaction(*pauses)
    assert transaction.duration * 1e6 == pytest.approx(microseconds)
    assert transaction.bits == 14 + pauses[0] + 7 + pauses[1]


@pytest.mark.parametrize(
    "pauses",
    [
        {"master_pause": 1.9},
        {"master_pause": 10.1},
        {"master_pause": float("nan")},
        {"slave_pause": -1},
        {"slave_pause": float("inf")},
        {"bit_time": 0},
        {"bit_time": float("nan")},
    ],
)
def test_impossible_pauses(pauses):
    with pytest.raises(ArgumentError, match=next(iter(pauses))):
        Transaction(**pauses)


def test_a_master_may_stretch_its_pause():
    longest = TIMES["longest pause before the next request"]
    assert longest / TIMES["bit"] > 80
    stretched = Transaction(slave_pause=longest / TIMES["bit"])
    assert stretched.duration * 1e6 == pytest.approx(84 + 18 + 42 + longest)
