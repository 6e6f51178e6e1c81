"""Message sets from any file, at several bit rates and compared with a log."""

import math
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from shipnet import can, datasets
from shipnet.can.analysis import CLOCK_TOLERANCE
from shipnet.errors import ArgumentError, InputError
from tests.can.test_log import write_with
from tests.can.test_messages import DBC

RATES = [20e3, 50e3, 125e3, 250e3]


def test_each_bit_rate_has_a_load_late_messages_and_a_verdict():
    messages = can.example()
    analysis = can.analyse(messages, reversed(RATES))
    table = analysis.table()
    assert (1e3 * table.index).tolist() == RATES == list(analysis.responses)
    for rate, row in zip(RATES, table.itertuples(), strict=True):
        responses = can.response_times(messages, rate)
        assert row.load_percent == pytest.approx(100 * can.bus_load(messages, rate))
        assert row.late == len(responses.late) and row.critical == responses.critical
        assert row.first_late == (responses.late[0] if responses.late else "")
        assert (row.critical_percent > 100) == (row.late > 0)
        assert row.some_order == can.audsley(messages, rate).feasible
    assert analysis.lowest == 125e3 == analysis.at_lowest.bit_rate and analysis.ok
    # Simulated responses never exceed the bound, and can be late where the analysis says so.
    played = can.simulate(messages, analysis.lowest, until=10.0).table()["max_ms"]
    assert (played <= analysis.at_lowest.table()["response_ms"] + 1e-9).all()
    blocked = can.MessageSet(replace(m, offset=1e-4 * (m.name != "bearings")) for m in messages)
    slow = can.simulate(blocked, 50e3, until=1.0).table()["max_ms"]
    assert slow["speed"] > 1e3 * messages["speed"].deadline


def test_another_order_may_allow_a_lower_bit_rate():
    turned = can.MessageSet(
        can.Message(name, number, 8, period, deadline)
        for number, (name, period, deadline) in enumerate(
            [("slow", 0.1, 0.1), ("other", 0.1, 0.1), ("fast", 10e-3, 6e-3)]
        )
    )
    analysis = can.analyse(turned, [50e3, 62.5e3, 125e3])
    assert (analysis.lowest, analysis.lowest_in_best_order) == (125e3, 50e3)
    assert analysis.best.messages.names[0] == "fast" and analysis.best.feasible
    assert repr(analysis).endswith("lowest bit rate: 125 kbit/s, in the best order: 50 kbit/s)")
    assert analysis.table()["some_order"].all()


def test_a_set_that_is_late_at_all_bit_rates_is_reported():
    analysis = can.analyse(can.example(), 10e3)
    assert analysis.lowest == analysis.lowest_in_best_order == math.inf
    assert not analysis.best.feasible and "lowest bit rate: none" in repr(analysis)
    assert not analysis.ok and analysis.at_lowest is analysis.responses[10e3]
    few = can.faults.ErrorBound(interval=0.001)
    assert can.analyse(can.example(), 125e3, faults=few).lowest == math.inf
    assert can.analyse(can.MessageSet([]), 125e3).lowest == 125e3


def test_messages_are_read_from_lists_dbc_files_and_logs(tmp_path):
    messages = can.example("lee2012")
    for name in ("list.csv", "list.txt"):
        (tmp_path / name).write_text(messages.text)
        assert can.analyse(tmp_path / name, 125e3).messages == messages
    (tmp_path / "ship.dbc").write_text(DBC)
    with pytest.raises(InputError, match="no cycle time; give one with --period on the"):
        can.analyse(tmp_path / "ship.dbc", 125e3)
    assert len(can.analyse(str(tmp_path / "ship.dbc"), 125e3, period=0.1).messages) == 2
    log = can.simulate(messages, 125e3, until=3.0).log()
    log.save(tmp_path / "bus.log")
    for source in (log, tmp_path / "bus.log"):
        assert can.analyse(source, 125e3).messages.periods == pytest.approx(messages.periods)
    with pytest.raises(InputError, match=r"none\.csv: cannot be read"):
        can.analyse(tmp_path / "none.csv")


# The messages of a log -------------------------------------------------------------------------


def joined(*logs):
    """Return the frames of several logs as one log."""
    return can.Log(
        *(np.concatenate(column) for column in zip(*(log.columns for log in logs), strict=True))
    )


def irregular(messages):
    """Return the names of messages of a log that are not periodic."""
    return messages.observed.index[messages.observed["kind"] != "periodic"].tolist()


def loads(log, rate=250e3):
    """Return the load of a log's messages, and the load that the log measures."""
    table = can.analyse(log, [rate, 1e6]).table()["load_percent"]
    assert table[1000.0] * 4 == pytest.approx(table[250.0])
    return table[rate / 1e3] / 100, log.load(rate).total()["load"].item()


@pytest.mark.parametrize(
    ("name", "kinds"),
    [("snippet", {"unclear": 6, "periodic": 2, "burst": 1}), ("boat", {"burst": 5, "periodic": 4})],
)
def test_the_load_of_a_recorded_bus_is_that_of_its_log(name, kinds):
    log = can.read_capture(datasets.path(f"sigrok_nmea2000_{name}.sr"), 250e3).log
    analysis = can.analyse(log)
    load, measured = loads(log)
    assert 0.95 * measured < load < 1.23 * measured < 0.04
    assert analysis.lowest <= 125e3 and (analysis.table()["late"] == 0)[125.0:].all()
    # Fast packets of several frames are sent in bursts; the others are periodic.
    assert analysis.messages.observed["kind"].value_counts().to_dict() == kinds
    assert {"0x09F80100", "0x09F80200"}.isdisjoint(irregular(analysis.messages))
    words = ", ".join(f"{kinds[kind]} {kind}" for kind in sorted(kinds))
    assert analysis.verdict.endswith(f"; from a log: {words}")
    snippet = can.read_capture(datasets.path("sigrok_nmea2000_snippet.sr"), 250e3).log
    assert can.compare(log, snippet).ok and can.compare(log, log).ok


@pytest.mark.parametrize("monotonic", [True, False])
@pytest.mark.parametrize("seed", range(5))
def test_the_log_of_a_busy_plan_has_the_verdict_of_the_plan(seed, monotonic):
    rng = np.random.default_rng(seed)
    periods = rng.choice([5e-3, 10e-3, 20e-3, 50e-3, 100e-3, 200e-3], 40)
    plan = [
        can.Message(
            f"0x{number:03X}",
            number,
            int(rng.integers(1, 9)),
            float(period),
            offset=rng.integers(0, 10**6) / 1e9,
        )
        for number, period in enumerate(sorted(periods) if monotonic else periods, 0x100)
    ]
    while can.bus_load(can.MessageSet(plan), 125e3) > 0.8:
        plan.pop()
    expected = can.analyse(can.MessageSet(plan))
    analysis = can.analyse(can.simulate(can.MessageSet(plan), 125e3, until=20.0).log())
    assert analysis.messages.periods == pytest.approx([m.period for m in plan], rel=1e-3)
    assert analysis.responses[125e3].late == expected.responses[125e3].late
    assert analysis.lowest == expected.lowest
    if monotonic:
        assert irregular(analysis.messages) == []
        assert analysis.lowest_in_best_order == expected.lowest_in_best_order
        columns = ["late", "first_late", "critical", "some_order"]
        assert analysis.table()[columns][125:].equals(expected.table()[columns][125:])
    else:
        # Some messages are late; if they wait for longer than a period, they are not periodic.
        assert expected.responses[125e3].late and len(irregular(analysis.messages)) <= 3


@pytest.mark.parametrize("bit_rate", [50e3, 125e3])
@pytest.mark.parametrize(("number", "gap"), [(2, 4e-3), (7, 1e-3), (20, 0.5e-3)])
def test_the_response_to_a_log_bounds_every_frame_of_a_burst(number, gap, bit_rate):
    # The frames are queued faster than they are sent, so the last ones wait for those before them.
    bursts = (np.arange(20)[:, np.newaxis] * 0.5 + np.arange(number) * gap).ravel()
    log = joined(log_of(bursts), log_of(np.arange(100) * 0.1 + 0.3e-3, 0x005))
    analysis = can.analyse(log, bit_rate)
    reported = analysis.at_lowest["0x010"].response
    frame = 135 / bit_rate
    free, waits = frame, []  # a frame with a higher priority is sent first
    for queued in np.arange(number) * gap:
        free = max(free, queued) + frame
        waits.append(free - queued)
    assert max(waits) <= reported <= max(waits) + (number - 1) * gap + 2 * frame
    assert analysis.ok and can.response_times(analysis.messages, bit_rate).met


def test_a_drifting_clock_makes_no_message_late():
    gaps = 0.01 + 0.0004 * np.sin(np.linspace(0, 2 * np.pi, 3000))
    log = joined(log_of(np.cumsum(gaps)), log_of(np.arange(300) * 0.1, 0x20))
    analysis = can.analyse(log)
    assert irregular(analysis.messages) == []
    assert analysis.messages.observed.loc["0x010", "jitter_ms"] < 0.01
    assert can.compare(log, log).ok
    assert analysis.messages.periods == pytest.approx([0.01, 0.1], rel=1e-3)
    assert (analysis.lowest, analysis.at_lowest.late) == (50e3, [])


def test_a_burst_may_be_queued_at_once_but_loads_the_bus_at_its_mean_rate():
    # Seven frames, 1 ms apart, once per second, above a message with a period of 10 ms.
    bursts = (np.arange(30)[:, np.newaxis] + np.arange(7) * 1e-3).ravel()
    log = joined(log_of(bursts), log_of(np.arange(3000) * 0.01 + 0.5e-3, 0x20))
    analysis = can.analyse(log, [125e3, 250e3])
    burst = analysis.messages["0x010"]
    assert irregular(analysis.messages) == ["0x010"]
    seen = analysis.messages.observed.loc["0x010"]
    assert seen[["kind", "burst"]].tolist() == ["burst", 7]
    assert seen[["period_ms", "shortest_ms"]].tolist() == pytest.approx([1000, 1])
    # Its mean rate, and a jitter that allows seven frames within the 6 ms that they take.
    span, step = np.ptp(log.time), 1e-6
    assert burst.period == pytest.approx(span / 210, abs=1e-9)
    assert burst.jitter == pytest.approx(6 * (burst.period - 1e-3) - step, abs=1e-8)
    # The last of them is queued 6 ms after the first. Until then, the lower message waits for six.
    below = analysis.responses[250e3]["0x020"]
    assert below.response == pytest.approx((6 + 1) * 135 / 250e3)
    alike = can.MessageSet(
        [
            *(can.Message(f"b{k}", k, 8, 1.0, offset=k * 1e-3, bits=135) for k in range(7)),
            can.Message("below", 0x20, 8, 0.01, bits=135),
        ]
    )
    assert can.simulate(alike, 250e3, until=1.0).table().max_ms["below"] <= 1e3 * below.response
    assert (burst.deadline, analysis.ok) == (burst.period + burst.jitter, True)
    load, measured = loads(log)
    assert measured < load < 1.23 * measured
    # Counted from the event, a response includes the jitter, and so does the deadline.
    assert can.response_times(log.messages(), 125e3).met


@pytest.mark.parametrize("share", [0.02, 0.1, 0.5])
def test_a_node_that_is_on_for_part_of_the_log_makes_no_other_message_late(share):
    start = 100 * (1 - share)
    parts = [log_of(np.arange(start, 100, 0.01) + n * 1e-4, n + 1) for n in range(5)]
    log = joined(*parts, log_of(np.arange(0, 100, 0.01) + 1e-3, 0x20))
    analysis = can.analyse(log)
    assert len(irregular(analysis.messages)) == 5 and analysis.lowest <= 125e3
    load, measured = loads(log)
    assert measured < load < 1.23 * measured


def test_messages_seen_once_and_twice_count_with_the_frames_of_the_log():
    log = joined(log_of(np.arange(101) / 10), log_of([5.0], 0x20), log_of([3.0, 3.1], 0x30))
    analysis = can.analyse(log)
    assert analysis.messages.periods.tolist() == [0.1, 10.0, 5.0]
    assert irregular(analysis.messages) == ["0x020", "0x030"] and analysis.ok
    assert log.messages(period=1.0)["0x020"].period == 1.0
    assert can.analyse(log_of([1.0, 1.5])).messages.periods.tolist() == [0.5]


@pytest.mark.parametrize("step", [1e-3, 10e-3, 0.1, 1.0])
def test_coarse_time_stamps_give_the_load_of_the_log_and_no_late_messages(step):
    log = can.simulate(can.example("lee2012"), 125e3, until=30.0).log()
    fast = can.simulate(can.example(), 125e3, until=30.0).log()
    for exact in (log, fast):
        coarse = replace(exact, time=np.floor(exact.time / step) * step)
        load, measured = loads(coarse)
        assert 0.95 * measured < load < 1.3 * measured
        assert can.analyse(coarse, [250e3, 500e3]).ok


@pytest.mark.parametrize(
    ("times", "said"),
    [
        ([], "0 frames in 0 s"),
        ([1.0], "1 frame in 0 s"),
        ([1.7e9] * 300, "300 frames in 0 s"),
        (np.arange(300) * 1e-6, "300 frames in 0.000299 s"),
    ],
)
def test_a_log_whose_time_stamps_contain_no_rates_is_refused(tmp_path, times, said):
    log = log_of(times)
    with pytest.raises(ArgumentError, match=f"the log has {said}; a message set requires"):
        can.analyse(log)
    if len(times):
        log.save(tmp_path / "bus.log")
        with pytest.raises(InputError, match=rf"bus\.log: the log has {said}"):
            can.analyse(tmp_path / "bus.log")


def test_a_log_of_two_buses_is_refused_and_one_of_them_can_be_selected():
    log = joined(log_of(np.arange(10)), replace(log_of(np.arange(10)), channel=np.full(10, "1")))
    with pytest.raises(ArgumentError, match="the log has the buses 0, 1; a message set has one"):
        can.analyse(log)
    one = can.Log(*(column[log.channel == "0"] for column in log.columns))
    assert can.analyse(one).ok


def test_the_order_of_frames_and_the_epoch_do_not_matter():
    log = can.simulate(can.example(), 125e3, until=3.0).log()
    mixed = np.random.default_rng(1).permutation(len(log))
    other = can.Log(*(column[mixed] for column in replace(log, time=log.time + 2**30).columns))
    assert other.messages().periods == pytest.approx(log.messages().periods, abs=1e-6)
    assert irregular(other.messages()) == irregular(log.messages())


@given(
    seed=st.integers(0, 2**32),
    periods=st.lists(st.integers(1000, 100_000), max_size=4),
    events=st.lists(st.integers(20, 100), max_size=2),
    lost=st.floats(0, 0.1),
)
def test_the_load_of_a_log_is_that_of_the_frames_sent(seed, periods, events, lost):
    # Stamps are whole microseconds. Periodic messages are sent throughout the log; some of their
    # frames are lost. The frames of events count as they are, at any times. The first message has
    # a frame at each end of the log, one period apart.
    rng, span = np.random.default_rng(seed), 5_000_000
    parts, sent, ends = [log_of([0.0, span / 1e6])], can.frame_length(8), 0.0
    for key, period in enumerate(periods, 0x20):
        times = np.arange(rng.integers(period), span, period)
        left = np.delete(times, rng.choice(len(times), int(lost * len(times)), replace=False))
        parts.append(log_of(left / 1e6, key, dlc=key % 9))
        sent, ends = sent + len(times) * can.frame_length(key % 9), ends + can.frame_length(key % 9)
    for key, number in enumerate(events, 0x30):
        parts.append(log_of(np.sort(rng.integers(0, span, number)) / 1e6, key, dlc=key % 9))
        sent += number * can.frame_length(key % 9)
    messages = joined(*parts).messages()
    assert irregular(messages) == ["0x010", *(f"0x{0x30 + k:03X}" for k in range(len(events)))]
    # At its ends, the log may hold part of a period of each periodic message.
    assert can.bus_load(messages, 1e6) * span == pytest.approx(sent, abs=ends + 1e-6 * sent)


@given(st.data())
def test_the_messages_of_any_log_have_its_frames_or_it_is_refused(data):
    step = data.draw(st.sampled_from([1e-6, 1e-3, 1.0]))
    stamps = st.lists(st.integers(0, 20_000), min_size=1, max_size=30)
    number = data.draw(st.integers(1, 6))
    log = joined(*(log_of(np.array(data.draw(stamps)) * step, key) for key in range(number)))
    try:
        messages = log.messages()
    except ArgumentError as refused:
        assert "a message set requires" in str(refused)
        return
    for message, seen in zip(messages, messages.observed.itertuples(), strict=True):
        frames = np.ptp(log.time) / message.period
        if not math.isclose(seen.period_ms, 1e3 * message.period, rel_tol=1e-3):
            assert frames == pytest.approx(seen.frames, rel=1e-3)
        else:
            # A quarter of the frames may be lost, and a quarter of the times between them short.
            assert 0.75 * (seen.frames - 1) <= frames <= 4 / 3 * (seen.frames + 1)


def recorded(rng, number, period, *, drift=0.0, jitter=0.0, step=1e-6, lost=0.0, burst=1):
    """Return the time stamps of a periodic message, or of one sent in bursts."""
    slow = 1 + drift * np.sin(np.arange(number) * 2 * np.pi / 1000)
    times = np.cumsum(period * slow) + jitter * period * rng.random(number)
    times = np.delete(times, rng.choice(number, int(lost * number), replace=False))
    times = (times[:, np.newaxis] + np.arange(burst) * period / (20 * burst)).ravel()
    return np.floor(times / step) * step


@given(
    seed=st.integers(0, 2**32),
    number=st.integers(20, 600),
    period=st.floats(1e-3, 2.0),
    drift=st.sampled_from([0.0, 0.01, 0.04]),
    jitter=st.floats(0, 0.3),
    step=st.sampled_from([1e-6, 1e-3, 1e-2]),
    lost=st.sampled_from([0.0, 0.05, 0.1]),
    burst=st.sampled_from([1, 1, 2, 7]),
)
@settings(max_examples=200)
def test_the_period_of_any_regular_message_is_recovered(
    seed, number, period, drift, jitter, step, lost, burst
):
    # Stamps coarser than a quarter of the period, or of a burst, hide lost frames and bursts.
    assume(period > (100 if burst > 1 else 10) * step)
    times = recorded(
        np.random.default_rng(seed),
        number,
        period,
        drift=drift,
        jitter=jitter,
        step=step,
        lost=lost,
        burst=burst,
    )
    (seen,) = log_of(times).messages().observed.itertuples()
    assert seen.kind == ("periodic" if burst == 1 else "burst") and seen.burst == burst
    slack = 3 * (jitter * period + step) / number + drift * period
    assert seen.period_ms / 1e3 == pytest.approx(period, abs=slack + 1e-9)
    # Jitter is local: slow drift is not part of it. In the log of one message, whose frames never
    # share a time stamp, steps may not be recognised; they then count as jitter.
    assert seen.jitter_ms / 1e3 <= 1.8 * jitter * period + 0.01 * period + 2 * step
    if number > 100:
        assert seen.jitter_ms / 1e3 >= 0.7 * jitter * period - 2 * step


def test_events_are_of_their_own_kind_and_count_at_their_mean_rate():
    rng = np.random.default_rng(7)
    events = np.cumsum(0.05 + rng.exponential(1.0, 200))
    log = joined(log_of(events), log_of(np.arange(0, events[-1], 0.1) + 1e-3, 0x20))
    analysis = can.analyse(log, [125e3])
    seen = analysis.messages.observed.loc["0x010"]
    assert seen["kind"] == "event" and math.isnan(seen["period_ms"])
    assert seen["shortest_ms"] == pytest.approx(1e3 * np.diff(events).min(), abs=1e-3)
    assert analysis.messages["0x010"].period == pytest.approx(np.ptp(log.time) / 200)
    assert analysis.verdict.endswith("; from a log: 1 event, 1 periodic") and analysis.ok
    assert can.compare(log, log).ok


@pytest.mark.parametrize("number", [1, 2, 3])
def test_a_message_with_fewer_than_four_frames_is_unclear(number):
    log = joined(log_of(np.arange(number) + 1.2345e-3), log_of(np.arange(31) * 0.1, 0x20))
    assert log.messages().observed.loc["0x010", "kind"] == "unclear"
    assert can.analyse(log).verdict.endswith("; from a log: 1 periodic, 1 unclear")


@given(st.data())
def test_no_log_is_late_compared_with_itself(data):
    step = data.draw(st.sampled_from([1e-6, 1e-3, 1.0]))
    stamps = st.lists(st.integers(0, 20_000), min_size=1, max_size=40)
    log = joined(*(log_of(np.array(data.draw(stamps)) * step, key) for key in range(1, 4)))
    try:
        comparison = can.compare(log, log)
    except ArgumentError as refused:
        assert "a message set requires" in str(refused)
        return
    assert comparison.ok, comparison.table()


# A plan and a log ------------------------------------------------------------------------------


def log_of(times, key=0x10, dlc=8, extended=False):
    """Return a log of one message."""
    n = len(times)
    no, data = np.zeros(n, bool), np.zeros((n, 8), np.uint8)
    time, channel, long = np.array(times, float), np.full(n, "0"), np.full(n, extended)
    return can.Log(time, channel, np.full(n, key), long, no, np.full(n, dlc, np.uint8), data)


def test_a_log_of_the_planned_messages_is_as_planned_in_every_format(tmp_path):
    messages = can.example()
    log = can.simulate(messages, 125e3, until=10.0).log()
    messages.save(tmp_path / "list.csv")
    python_can = pytest.importorskip("can")
    write_with(python_can, tmp_path / "theirs.blf", log)
    for written in (log, tmp_path / "theirs.blf"):
        comparison = can.compare(tmp_path / "list.csv", written)
        assert comparison.ok and comparison.verdict == "10 messages, all as planned"
    table = comparison.table()
    with python_can.LogReader(tmp_path / "theirs.blf") as reader:
        theirs = pd.DataFrame(
            [(f"0x{m.arbitration_id:03X}", m.timestamp) for m in reader], columns=["id", "t"]
        )
    gaps = 1e3 * theirs.groupby("id")["t"].diff().groupby(theirs["id"]).agg(["min", "mean"])
    ours = table.set_index("arbitration_id")[["shortest_ms", "mean_ms"]]
    assert ours.to_numpy() == pytest.approx(gaps.loc[ours.index].to_numpy(), abs=2e-3)
    assert table["frames"].tolist() == [
        int((theirs["id"] == number).sum()) for number in ours.index
    ]
    # A log is a plan too.
    assert can.compare(log, log).ok


def test_missing_unknown_late_faster_and_other_frames_are_named():
    log = can.simulate(can.example(), 125e3, until=10.0).log()
    changed = {"speed": 0.005, "fuel index": 0.03, "exhaust 1-4": 0.4}
    plan = can.MessageSet(
        [
            *(
                replace(m, period=changed.get(m.name, m.period), deadline=m.deadline / 2)
                for m in can.example()
                if m.name not in ("alarm", "load limit")
            ),
            can.Message("load limit", 0x040, 3, 0.02),
            can.Message("new", 0x700, 8, 0.1),
            can.Message("seldom", 0x701, 8, 60.0),
        ]
    )
    comparison = can.compare(plan, log)
    odd = comparison.table()["verdict"].loc[lambda verdict: verdict != "as planned"]
    assert odd.to_dict() == {
        "speed": "late",
        "fuel index": "faster",
        "load limit": "other length",
        "exhaust 1-4": "late",
        "new": "missing",
        "seldom": "not seen",
        "0x080": "unknown",
    }
    summary = "11 messages, 1 missing, 2 late, 1 faster, 1 other length, 1 unknown, 1 not seen"
    assert (comparison.ok, comparison.verdict) == (False, summary)


@given(
    times=st.lists(st.integers(0, 60), min_size=1, max_size=12),
    period=st.integers(1, 8),
    deadline=st.integers(1, 12),
    jitter=st.integers(0, 12),
)
def test_late_and_faster_agree_with_a_check_of_all_pairs_of_frames(times, period, deadline, jitter):
    # Another message marks the beginning and the end of the log.
    message = can.Message("A", 0x10, 8, period, deadline, jitter)
    times, slack = sorted(times), max(deadline, jitter)
    both = joined(log_of(times), log_of([0.0, 60.0], 0x20))
    pairs = [(j - i, times[j] - times[i]) for j in range(len(times)) for i in range(j)]
    silences = np.diff([0, *times, 60])
    slack += both.step  # the times between frames differ from those of their stamps by less
    late = any(span > n * period * (1 + CLOCK_TOLERANCE) + slack for n, span in pairs)
    late |= silences.max() > period * (1 + CLOCK_TOLERANCE) + slack
    faster = any(span < n * period * (1 - CLOCK_TOLERANCE) - slack for n, span in pairs)
    row = can.compare(can.MessageSet([message]), both).table().loc["A"]
    assert ("late" in row["verdict"], "faster" in row["verdict"]) == (late, faster)
    assert row["longest_ms"] == 1e3 * silences.max()


def test_a_message_that_falls_silent_is_late_and_a_short_log_shows_nothing():
    plan = can.MessageSet([can.Message("A", 0x10, 8, 0.1), can.Message("B", 0x20, 8, 10.0)])
    died = can.compare(plan, joined(log_of(np.arange(20) / 10), log_of([0, 10.0], 0x20)))
    assert died.table()["verdict"].to_dict() == {"A": "late", "B": "as planned"}
    assert died.table().loc["A", "longest_ms"] == pytest.approx(8100)
    short = can.compare(plan, log_of([0.0, 0.1]))
    assert (short.ok, short.verdict) == (None, "2 messages, 1 not seen")
    assert can.compare(plan, log_of([])).verdict == "2 messages, 2 missing"
    assert can.compare(can.MessageSet([]), log_of([])).verdict == "0 messages, all as planned"


#: A J1939 database: source address FE; EEC1 is sent by two engines, and TSC1 has a destination.
J1939 = """VERSION ""

BU_: Engine

BO_ 2364540158 EEC1: 8 Engine
 SG_ Speed : 24|16@1+ (0.125,0) [0|8000] "rpm" Vector__XXX

BO_ 2348810494 TSC1: 8 Engine
 SG_ Torque : 0|8@1+ (1,0) [0|250] "%" Vector__XXX

BO_ 2566843134 AMB: 8 Engine
 SG_ Air : 0|8@1+ (1,0) [0|250] "kPa" Vector__XXX

BA_DEF_ BO_ "GenMsgCycleTime" INT 0 65535;
BA_DEF_DEF_ "GenMsgCycleTime" 100;
"""
MARK = (
    'BA_DEF_ "ProtocolType" STRING ;\nBA_DEF_DEF_ "ProtocolType" "";\nBA_ "ProtocolType" "J1939";\n'
)


def test_a_j1939_database_matches_a_log_by_pgn(tmp_path):
    pytest.importorskip("cantools")
    (tmp_path / "plain.dbc").write_text(J1939)
    (tmp_path / "j1939.dbc").write_text(J1939 + MARK)
    times = np.arange(50) * 0.1
    ids = (0x0CF00400, 0x0CF00401, 0x0C000003, 0x18FF0100)
    log = joined(*(log_of(times + k * 1e-3, key, extended=True) for k, key in enumerate(ids)))
    marked = can.compare(tmp_path / "j1939.dbc", log)
    assert marked.table()["verdict"].to_dict() == {
        "TSC1": "as planned",
        "EEC1 0x0CF00400": "as planned",
        "EEC1 0x0CF00401": "as planned",
        "AMB": "missing",
        "0x18FF0100": "unknown",
    }
    assert marked.verdict == "4 messages, 1 missing, 1 unknown"
    assert can.compare(tmp_path / "plain.dbc", log, pgn=True).table().equals(marked.table())
    slower = can.read_messages(tmp_path / "j1939.dbc").replace("TSC1", period=0.2)
    assert can.compare(slower, log).table().loc["TSC1", "verdict"] == "faster"
    plain = can.compare(tmp_path / "plain.dbc", log)
    assert plain.verdict == "3 messages, 3 missing, 4 unknown"
    # A source that the plan names is not taken for another one.
    two = can.MessageSet(
        can.Message(f"E{k}", 0x0CF00400 + k, 8, period, extended=True)
        for k, period in enumerate((0.1, 10.0))
    )
    verdicts = can.compare(two, log, pgn=True).table()["verdict"]
    assert verdicts[["E0", "E1"]].tolist() == ["as planned", "faster"]
