import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shipnet.errors import ArgumentError
from shipnet.modbus.udp import LossyPath, compare, replies, transaction_ids


class Scripted:
    """A path on which the response to one request has its own transit time."""

    def __init__(self, request, response, delay=0.0, others=0.0):
        self.request, self.response, self.delay, self.others = request, response, delay, others
        self.is_answer = False  # the requests are drawn first

    def transit(self, n, rng):
        delay = self.others if self.is_answer else self.delay
        times = np.full((n, 2), [delay, np.inf])
        if self.is_answer:
            # A request has two copies, each with an answer; the second does not exist here.
            times[2 * self.request, 0] = self.response
        self.is_answer = True
        return times


@pytest.mark.parametrize("late", [0, 3, 40, 99])
def test_one_late_response_mismatches_all_that_follow_if_ids_are_0_and_none_if_they_count(late):
    # It arrives 0.01 s after the time-out of 0.5 s, so before the answer to the next request.
    reply_to, dropped = replies([0] * 100, Scripted(late, 0.5, 0.01, 0.01), 0.5, None)
    # Each request accepts the answer to the previous one.
    assert reply_to.tolist() == [*range(late), -1, *range(late, 99)]
    assert dropped == 0
    counted, dropped = replies(transaction_ids(100), Scripted(late, 0.5, 0.01, 0.01), 0.5, None)
    assert counted.tolist() == [*range(late), -1, *range(late + 1, 100)]
    assert dropped == (late < 99)


@given(
    seed=st.integers(0, 2**32),
    lost=st.floats(0, 1),
    late=st.floats(0, 1),
    duplicated=st.floats(0, 1),
)
def test_counted_ids_are_never_mismatched_on_any_network(seed, lost, late, duplicated):
    path = LossyPath(lost, late, duplicated, delay=0.01, lateness=0.6)
    units = np.arange(60) % 5
    table = compare(units, path, rng=seed)
    assert table.mismatched["transaction id"] == 0
    assert table.wrong_unit["unit id"] == 0
    assert (table.wrong_unit <= table.mismatched).all()
    assert (table.mismatched + table.timeouts <= 60).all()
    for marks in (units.tolist(), transaction_ids(60)):
        reply_to, _ = replies(marks, path, 0.5, np.random.default_rng(seed))
        taken = np.flatnonzero(reply_to >= 0)
        assert (reply_to[taken] <= taken).all()  # no reply comes before its request


def test_an_id_returns_after_65536_requests():
    # All but the first are lost; its reply arrives during request 65536, which has the same id.
    path = Scripted(0, 65.5361, others=np.inf)
    reply_to, _ = replies(transaction_ids(65538), path, 1e-3, None)
    assert reply_to[65536] == 0
    assert (np.delete(reply_to, 65536) == -1).all()


def test_the_path_loses_delays_and_duplicates_as_often_as_its_probabilities_say():
    path, n = LossyPath(0.2, 0.3, 0.4, delay=1.0, lateness=2.0), 100_000
    times = path.transit(n, np.random.default_rng(2024))
    arrived, second = np.isfinite(times[:, 0]), np.isfinite(times[:, 1])
    for share, expected in [
        (arrived.mean(), 0.8),
        (second.mean(), 0.4 * 0.8),
        ((times[arrived, 0] == 3.0).mean(), 0.3),
        ((times[second, 1] == 3.0).mean(), 0.3),
    ]:
        assert share == pytest.approx(expected, abs=4 * 0.5 / n**0.5 * 2)
    assert set(times[arrived, 0]) == {1.0, 3.0}
    assert compare([1, 2, 3], LossyPath(), rng=1).to_numpy().tolist() == [[0, 0, 0, 0]] * 3
    assert compare([1, 2], LossyPath(lost=1.0), rng=1)["timeouts"].tolist() == [2, 2, 2]


def test_a_duplicated_request_is_answered_twice_and_the_second_response_is_left_over():
    reply_to, _ = replies([0, 0], LossyPath(duplicated=1.0), 0.5, np.random.default_rng(1))
    # Two copies arrive, each is answered, and each answer is duplicated: three are left over.
    assert reply_to.tolist() == [0, 0]


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: LossyPath(lost=1.1), "lost is 1.1"),
        (lambda: LossyPath(delay=-1), "delay is -1 s"),
        (lambda: LossyPath().transit(-1, np.random.default_rng(1)), "n is -1"),
        (lambda: compare([], LossyPath(), rng=1), "row of 1"),
        (lambda: compare([1.0], LossyPath(), rng=1), "whole numbers"),
        (lambda: compare([256], LossyPath(), rng=1), r"0\.\.255"),
        (lambda: compare([1], LossyPath(), rng=1, timeout=0), "timeout is 0"),
    ],
)
def test_arguments_out_of_range_are_named(make, message):
    with pytest.raises(ArgumentError, match=message):
        make()
