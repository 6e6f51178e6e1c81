"""Response times, compared with published ones and with buses simulated bit time by bit time."""

import csv
import json
import math
from collections import deque
from itertools import pairwise
from pathlib import Path
from unittest.mock import Mock, patch

import matplotlib.pyplot as plt
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.figure import Figure

from shipnet.can import (
    Assumptions,
    Message,
    MessageSet,
    faults,
    response_times,
    simulate,
)
from shipnet.can.faults import ErrorBound
from shipnet.can.response import all_instances, instances
from shipnet.errors import ArgumentError

REFERENCE = Path(__file__).parents[1] / "reference" / "can"

#: At this bit rate a bit time is 1 us.
FAST = 1_000_000
US = 1e-6


def schedulable(messages, bit_rate, **more):
    return response_times(messages, bit_rate, **more).met


def errors(burst, interval=math.inf, bits=31):
    return ErrorBound(interval, burst, bits=bits)


def davis():
    with (REFERENCE / "davis2007_example.csv").open() as stream:
        return list(csv.DictReader(stream))


def davis_messages():
    return MessageSet(
        Message(
            row["name"],
            number,
            int(row["bytes"]),
            period=float(row["T_ms"]) / 1e3,
            deadline=float(row["D_ms"]) / 1e3,
        )
        for number, row in enumerate(davis()[:3])
    )


@pytest.mark.parametrize("row", [row for row in davis() if row["method"] == "davis"])
def test_the_example_of_davis_2007_is_reproduced(row):
    result = response_times(davis_messages(), 125_000)[row["name"]]
    assert result.frame_time == float(row["C_ms_125k"]) / 1e3
    assert result.instances == tuple(r / 1e3 for r in json.loads(row["R_per_instance_ms"]))
    assert result.response == float(row["R_ms"]) / 1e3
    assert result.met is (row["deadline_met"] == "True")
    assert result.blocking == float(row["B_ms"]) / 1e3
    assert result.busy_period == float(row["busy_period_ms"]) / 1e3
    assert len(result.instances) == int(row["Q"])


def message_set(frames, periods, jitters=None, deadlines=None):
    """Return a set with times in bit times; the first message is the most urgent."""
    jitters = jitters or [0] * len(frames)
    deadlines = deadlines or periods
    return MessageSet(
        Message(f"m{k}", k, 8, period * US, deadline * US, jitter * US, bits=bits)
        for k, (bits, period, deadline, jitter) in enumerate(
            zip(frames, periods, deadlines, jitters, strict=True)
        )
    )


@st.composite
def small_sets(draw, most_jitter=2.0):
    """Draw frames, periods and jitters of two to five messages with a load below 0.97."""
    n = draw(st.integers(2, 5))
    frames = draw(st.lists(st.integers(47, 160), min_size=n, max_size=n))
    periods = [draw(st.integers(n * bits, 12 * n * bits)) for bits in frames]
    load = sum(bits / period for bits, period in zip(frames, periods, strict=True))
    if load > 0.97:
        periods = [math.ceil(period * load / 0.97) for period in periods]
    jitters = [draw(st.integers(0, int(most_jitter * period))) for period in periods]
    return frames, periods, jitters


def play(frames, releases, *, begun=None, faults=(), error_bits=31):
    """Send frames on a bus without any theory; return when each instance ends, by message.

    Times are bit times, and the most urgent waiting frame goes first. `releases` contains the
    queueing times of each message, the most urgent first, and `begun` is the (start, length) of a
    frame that is already on the bus. A fault destroys the frame on the bus; an error frame follows,
    and the frame waits for arbitration again.
    """
    waiting = [deque(sorted(times)) for times in releases]
    faults = deque(sorted(faults))
    finish = [[] for _ in releases]
    now = min((times[0] for times in waiting if times), default=0)
    if begun:
        now = sum(begun)
    while any(waiting):
        ready = [m for m, times in enumerate(waiting) if times and times[0] <= now]
        if not ready:
            now = min(times[0] for times in waiting if times)
            continue
        m, end = ready[0], now + frames[ready[0]]
        # A fault on an idle bus or in an error frame destroys nothing.
        while faults and faults[0] <= now:
            faults.popleft()
        if faults and faults[0] <= end:
            now = faults.popleft() + error_bits
            continue
        now = end
        waiting[m].popleft()
        finish[m].append(end)
    return finish


@given(small_sets())
def test_the_worst_release_attains_the_response_of_every_instance(drawn):
    frames, periods, jitters = drawn
    for m, result in enumerate(response_times(message_set(*drawn), FAST)):
        blocking = max(frames[m + 1 :], default=0)
        assert result.blocking == pytest.approx(blocking * US, rel=1e-15)
        busy = round(result.busy_period / US)
        # All are queued at 0, as late as possible; another frame began one bit time earlier.
        arrivals = [
            [q * period - jitter for q in range((busy + jitter) // period + 2)]
            for period, jitter in zip(periods[: m + 1], jitters, strict=False)
        ]
        releases = [[max(0, arrival) for arrival in times] for times in arrivals]
        begun = (-1, blocking + 1) if blocking else None
        finish = play(frames, releases, begun=begun)[m]
        expected = [end - arrival for end, arrival in zip(finish, arrivals[m], strict=True)]
        instances = [round(response / US) for response in result.instances]
        assert instances == expected[: len(instances)]
        assert len(instances) == -(-(busy + jitters[m]) // periods[m])


@pytest.mark.parametrize(
    "odd",
    [
        {"period": 7e-3, "jitter": 1e5},  # 10 ** 7 instances are late at once
        {"period": 1e5},  # 10 ** 20 ticks of 1 fs
        {"period": 0.13e-3},  # the bus is overloaded
    ],
)
def test_times_that_exceed_64_bits_are_computed_without_rounding(odd):
    messages = [Message(f"m{k}", k, 8, 0.1) for k in range(80)]
    results = response_times(MessageSet([*messages, Message("odd", 99, 8, **odd)]), 999_983)
    alone = response_times(MessageSet([*messages, Message("odd", 99, 8, 0.1)]), 999_983)
    assert [one[1:] for one in results[:-1]] == [one[1:] for one in alone[:-1]]
    assert results["odd"].response == ((81 * 135) / 999_983 if odd == {"period": 1e5} else math.inf)


@given(small_sets(), st.integers(0, 3), st.integers(300, 10**5))
def test_each_message_alone_has_the_same_busy_period_and_instances(drawn, burst, interval):
    C, T, J = drawn
    terms = C, C, T, J, 1, burst, interval if burst else 2**62, 31, 10**4
    blocking, busy, R, ends = all_instances(*terms)
    for m, (B, t, end) in enumerate(zip(blocking, busy, ends, strict=True)):
        assert instances(0, m, *terms) == (B, t, R[ends[m - 1] if m else 0 : end])


@pytest.mark.parametrize("interval", [0.1, 1e5, math.inf])
@pytest.mark.parametrize(
    "messages",
    [
        [Message(f"m{k}", k, 8, 7.966e-3, jitter=0.7966) for k in range(59)],  # load 0.9999
        [Message(f"m{k}", k, 8, 0.015 + 1e-9) for k in range(90)],
    ],
)
def test_large_sets_at_odd_bit_rates_are_compiled(messages, interval):
    number = len(messages)
    fast = Mock(return_value=([0] * number, [0] * number, [0] * number, range(1, number + 1)))
    with patch.dict(all_instances.__dict__, fast=fast):
        response_times(MessageSet(messages), 999_983, faults=errors(1, interval))
    columns, numbers = fast.call_args.args[:4], fast.call_args.args[4:]
    assert max(*(max(column) for column in columns), *numbers) <= 2**62


@given(small_sets(most_jitter=1.0), st.integers(0, 3), st.integers(0, 2**32 - 1))
def test_no_release_and_no_faults_exceed_the_bound(drawn, burst, seed):
    frames, periods, jitters = drawn
    rng = np.random.default_rng(seed)
    results = response_times(message_set(*drawn), FAST, faults=errors(burst))
    bound = [round(min(each.response / US, 10**9)) for each in results]
    for _ in range(3):
        arrivals = [
            rng.integers(period) + period * np.arange(6000 // period + 2) for period in periods
        ]
        # Instances of one message keep their order, whatever their jitter.
        releases = [
            np.maximum.accumulate(times + rng.integers(jitter + 1, size=len(times))).tolist()
            for times, jitter in zip(arrivals, jitters, strict=True)
        ]
        finish = play(frames, releases, faults=rng.integers(0, 1500, size=burst).tolist())
        for ends, times, most in zip(finish, arrivals, bound, strict=True):
            assert (np.array(ends) - times).max() <= most


#: The messages of Broster et al. 2002, the most urgent first: data bytes, period [ms], and the
#: response without errors at 250 kbit/s [ms], which SchedCAT also computes. The last message, of
#: 1 byte and 100 ms, is left out: there it waits for an intermission.
BROSTER = [
    (8, 10, 1.028),
    (3, 14, 1.368),
    (3, 20, 1.708),
    (2, 15, 2.008),
    (5, 20, 2.428),
    (5, 40, 2.848),
    (4, 15, 3.228),
    (5, 50, 3.648),
    (4, 20, 4.028),
    (7, 100, 4.448),
    (5, 50, 4.708),
]


@pytest.mark.parametrize("count", range(10))
def test_the_published_responses_with_faults_are_reproduced(count):
    messages = MessageSet(
        Message(f"m{k}", k, size, period / 1e3)
        for k, (size, period, _) in enumerate([*BROSTER, (1, 100, None)])
    )
    # Their 29 bits exclude the intermission, which is part of a frame here.
    few = errors(count, bits=26)
    between = Assumptions(intermission="between")
    results = response_times(messages, 250e3, assumptions=between, faults=few)
    for one, (_, period, alone) in zip(results, BROSTER, strict=False):
        # An error costs 29 bits, and 132 bits of the longest frame, which is the most urgent.
        if alone + 0.644 * count < period and (count == 0 or one.message.name in ("m0", "m7")):
            assert one.response * 1e3 == pytest.approx(alone + 0.644 * count, abs=1e-9)


def test_the_least_cost_of_an_error_bounds_a_simulated_bus():
    messages = MessageSet([Message("A", 1, 8, 0.1, sender="x"), Message("B", 2, 8, 0.1)])
    low = errors(1, bits=20)  # two error flags of 6 bits and a delimiter of 8 bits
    bound = response_times(messages, FAST, faults=low)["B"].response
    seen = [
        simulate(messages, FAST, until=0.01, faults=faults.ErrorAt(k * US)).table().max_ms["B"]
        for k in (*range(125, 140), *range(255, 270))
    ]
    assert max(seen) / 1e3 == pytest.approx(bound, abs=1e-12)


def test_an_error_may_hit_the_longest_frame_that_goes_first():
    low = response_times(message_set([160, 60], [5000, 5000]), FAST, faults=errors(1))[1]
    assert low.response == pytest.approx((160 + 31 + 160 + 60) * US, rel=1e-12)


def test_recurring_errors_equal_a_count_by_hand():
    # F = 2 + ceil(t / 500) - 1 errors; the lower message has 135 bits, none below, 100 above it.
    messages = message_set([100, 135], [5000, 5000])
    low = response_times(messages, FAST, faults=errors(2, 500 * US, 29))[1]
    # w = 100 + F(w + 135) 164: 428 needs 3 errors, 592 needs 3: F(727) = 2 + 2 - 1.
    assert low.response == pytest.approx((100 + 3 * 164 + 135) * US, rel=1e-12)


def test_an_error_that_is_due_as_the_busy_period_ends_does_not_count():
    # The frame, then once 31 bits and the frame again; the next error is due at 231.
    (alone,) = response_times(message_set([100], [5000]), FAST, faults=errors(1, 231 * US))
    assert alone.busy_period == alone.response == pytest.approx(231 * US, rel=1e-12)
    (alone,) = response_times(message_set([100], [5000]), FAST, faults=errors(1, 230 * US))
    assert alone.busy_period == pytest.approx((231 + 131) * US, rel=1e-12)


@given(small_sets(), st.sampled_from([2, 4, 5, 8, 20]))
def test_responses_scale_with_time(drawn, factor):
    frames, periods, jitters = drawn
    slow = message_set(frames, [factor * t for t in periods], [factor * t for t in jitters])
    ours = response_times(slow, FAST // factor)
    for a, b in zip(response_times(message_set(*drawn), FAST), ours, strict=True):
        assert round(a.response / US) * factor == round(b.response / US)
        assert len(a.instances) == len(b.instances)


def test_a_frame_that_is_queued_within_the_arbitration_time_goes_first():
    frames, periods = [60, 100], [160.5, 1000]
    lower = response_times(message_set(frames, periods), FAST)[1]
    assert lower.response == pytest.approx(160 * US)
    # The second frame of m0 is queued 0.5 bit times after the bus is free.
    frames, periods = [60, 60, 100], [120.5, 1000, 1000]
    last = response_times(message_set(frames, periods), FAST)[2]
    assert last.response == pytest.approx(280 * US)


def test_each_assumption_shifts_the_response_by_its_bits():
    messages = MessageSet(
        [Message("A", 1, 8, 0.01, jitter=0.001), Message("B", 2, 8, 0.01), Message("C", 3, 1, 0.01)]
    )

    def response(name="A", **changes):
        results = response_times(messages, 125_000, assumptions=Assumptions(**changes))
        return next(r.response for r in results if r.message.name == name)

    def bits(n):
        return pytest.approx(n / 125_000, rel=1e-12)

    assert response() == bits(2 * 135 + 125)
    assert response(own_jitter=False) == bits(2 * 135)
    assert response(intermission="between") == bits(2 * 135 + 125 - 3)
    assert response(stuffing="attainable") == bits(2 * 133 + 125)
    assert response(stuffing="none") == bits(2 * 111 + 125)
    assert response("C") == bits(2 * 135 + 65)


def test_an_overloaded_bus_has_infinite_responses():
    messages = message_set([100, 100, 100], [150, 300, 1000])
    high, full, over = response_times(messages, FAST)
    assert high.response == pytest.approx(200 * US)
    # A load of exactly 1 ends only if nothing blocks; C blocks B.
    assert full.response == over.response == full.busy_period == math.inf
    assert (full.met, over.met) == (False, False)
    assert full.instances == (math.inf,)
    assert not schedulable(messages, FAST)
    alone = response_times(message_set([100, 100], [150, 300]), FAST)[1]
    assert alone.busy_period == pytest.approx(300 * US, rel=1e-12)
    assert [round(r / US) for r in alone.instances] == [200]


def test_a_load_of_almost_one_ends_or_counts_as_endless():
    # 1 - 2.5e-3: the backlog of 160 bits takes a busy period of 160 / 2.5e-3 bits to work off.
    messages = message_set([100, 100, 160], [200, 201, 10**6])
    low = response_times(messages, FAST)[1]
    load = 100 / 200 + 100 / 201
    most = (160 + 200) / (1 - load) * US
    assert 160 / (1 - load) * US <= low.busy_period <= most
    assert len(low.instances) == math.ceil(round(low.busy_period / US) / 201)
    # 1 - 2.5e-9: a busy period of two years counts as endless.
    near = [Message("A", 1, 8, 0.2, bits=100), Message("B", 2, 8, 0.200000001, 9e4, bits=100)]
    assert schedulable(MessageSet(near), 1000)
    blocked = MessageSet([*near, Message("C", 3, 8, 1e5, bits=100)])
    low = response_times(blocked, 1000)[1]
    assert low.response == low.busy_period == math.inf


def test_a_bit_time_that_is_not_a_whole_nanosecond_stays_exact():
    # 135 bits at 30 kbit/s are 4.5 ms to the last digit: the period ends with the frame.
    lone = MessageSet([Message("A", 1, 8, 4.5e-3)])
    result = response_times(lone, 30_000)[0]
    assert (result.response, result.met, len(result.instances)) == (4.5e-3, True, 1)
    assert response_times(lone, 29_999)[0].response == math.inf
    # Three frames, each a third of the period long, fill the bus; one bit/s less is too little.
    thirds = MessageSet([Message(f"m{k}", k, 8, 13.5e-3) for k in range(3)])
    assert [r.response for r in response_times(thirds, 30_000)] == [9e-3, 13.5e-3, 13.5e-3]
    assert schedulable(thirds, 30_000)
    assert response_times(thirds, 29_999)[2].response == math.inf


def test_empty_sets_are_accepted_and_wrong_arguments_refused():
    nothing = MessageSet([])
    assert list(response_times(nothing, FAST)) == []
    assert response_times(nothing, FAST).table().empty
    assert response_times(nothing, FAST).critical == ""
    assert schedulable(nothing, FAST)
    for rate in (999, 1_000_001, 83_333.3, math.nan, None, "125000"):
        with pytest.raises(ArgumentError, match=r"bit_rate is .*; it must be"):
            response_times(davis_messages(), rate)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Assumptions(stuffing="mean"), "stuffing is 'mean'"),
        (lambda: Assumptions(intermission="nowhere"), "intermission is 'nowhere'"),
        (lambda: Assumptions(own_jitter=1), "own_jitter is 1"),
        (lambda: ErrorBound(math.inf, -1), "burst is -1"),
        (lambda: ErrorBound(0.1, 0), "burst is 0; interval must be"),
        (lambda: ErrorBound(1e6), r"interval is 1e\+06 s and burst is 1; interval must be"),
        (lambda: ErrorBound(0), "interval is 0 s"),
        (lambda: ErrorBound(math.inf, bits=16), "bits is 16"),
    ],
)
def test_a_wrong_assumption_or_error_bound_is_refused(make, message):
    with pytest.raises(ArgumentError, match=message):
        make()


def test_the_table_agrees_with_the_results():
    results = response_times(davis_messages(), 125_000)
    table = results.table()
    assert results["C"] == results[-1] and (results.bit_rate, table.index.name) == (125_000, "name")
    assert (results.met, results.late, results.critical) == (False, ["C"], "C")
    assert repr(results) == "ResponseTimes(3 messages at 125 kbit/s, 1 late, critical: C)"
    expected = {
        "frame_ms": [1.0, 1.0, 1.0],
        "blocking_ms": [1.0, 1.0, 0.0],
        "response_ms": [2.0, 3.0, 3.5],
        "slack_ms": [0.5, 0.25, -0.25],
        "busy_period_ms": [2.0, 5.0, 7.0],
        "met": [True, True, False],
        "instances": [1, 2, 2],
    }
    assert {name: table[name].tolist() for name in expected} == expected
    assert table["load_percent"].sum() == pytest.approx(100 * (1 / 2.5 + 2 / 3.5), rel=1e-9)
    nothing = response_times(MessageSet([]), 125_000).table()
    assert (len(nothing), [*nothing], nothing["met"].dtype) == (0, [*table], bool)
    with pytest.raises(ArgumentError, match="name is 'D'; the messages are A, B, C"):
        results["D"]


def test_a_response_without_bound_and_a_set_without_messages_are_drawn():
    ax = response_times(message_set([100, 100], [150, 180]), FAST).plot(Figure().subplots())
    assert [text.get_text() for text in ax.texts] == ["no bound"]
    response_times(MessageSet([]), 125_000).plot(Figure().subplots())


def test_a_figure_of_many_messages_is_tall_enough_for_their_names():
    messages = MessageSet(Message(f"MSG_{k}", k, 8, 0.01 + 0.005 * k) for k in range(60))
    figure = response_times(messages, 250e3).plot().figure
    figure.draw_without_rendering()
    boxes = [label.get_window_extent() for label in figure.axes[0].get_yticklabels()]
    assert not any(one.overlaps(other) for one, other in pairwise(boxes))
    plt.close("all")
