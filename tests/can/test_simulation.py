import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shipnet.can import Message, MessageSet, response_times, simulate, simulate_batch
from shipnet.can.faults import BitErrors, ErrorAt
from shipnet.errors import ArgumentError

RATE = 125e3
BIT_MS = 8e-3


def as_set(columns):
    """Return columns as in `MessageSet.table`, with missing ones filled in."""
    table = pd.DataFrame(columns)
    if "name" not in table:
        table["name"] = [f"{number:#05x}" for number in table["arbitration_id"]]
    return MessageSet(
        Message(
            row.pop("name"),
            int(row.pop("arbitration_id")),
            int(row.pop("dlc", 8)),
            **{
                field.removesuffix("_ms"): value / 1e3 if field.endswith("_ms") else value
                for field, value in row.items()
            },
        )
        for row in table.to_dict("records")
    )


def run_of(columns, until, faults=(), **more):
    return simulate(as_set(columns), RATE, until=until, faults=faults, **more)


def hits(instants):
    return [ErrorAt(float(instant)) for instant in instants]


def table(**columns):
    return {"arbitration_id": [1, 2, 3], "bits": 125, "period_ms": [2.5, 3.5, 3.5], **columns}


@st.composite
def message_sets(draw, jitter=False):
    number = draw(st.integers(1, 5))
    several = [
        st.lists(values, min_size=number, max_size=number)
        for values in (
            st.integers(47, 160),
            st.integers(60, 900),
            st.integers(0, 900),
            st.integers(0, 300),
        )
    ]
    bits, period, offset, delay = map(draw, several)
    ids = draw(st.lists(st.integers(0, 2047), min_size=number, max_size=number, unique=True))
    return pd.DataFrame(
        {
            "arbitration_id": ids,
            "bits": bits,
            "period_ms": np.array(period) * BIT_MS,
            "offset_ms": np.array(offset) * BIT_MS,
            "jitter_ms": np.array(delay) * BIT_MS if jitter else 0,
        }
    )


def bit_by_bit(messages, bits):
    """Return message -> list of (release, start or None), looking at the bus once per bit."""
    rows = messages.sort_values("arbitration_id").to_dict("records")
    waiting = [[] for _ in rows]
    seen = [[] for _ in rows]
    free = 0
    for now in range(bits):
        for row, held, log in zip(rows, waiting, seen, strict=True):
            since = now - round(row["offset_ms"] / BIT_MS)
            if since >= 0 and since % round(row["period_ms"] / BIT_MS) == 0:
                frame = [now, None]
                held.append(frame)
                log.append(frame)
        if now < free:
            continue
        for row, held in zip(rows, waiting, strict=True):
            if held:
                held.pop(0)[1] = now
                free = now + row["bits"]
                break
    return {f"{row['arbitration_id']:#05x}": log for row, log in zip(rows, seen, strict=True)}


@given(message_sets())
def test_a_simulation_bit_by_bit_finds_the_same_transmissions(messages):
    frames = run_of(messages, 2000 * BIT_MS / 1e3).events()
    slow = bit_by_bit(messages, 2000)
    for name, expected in slow.items():
        rows = frames[frames["message"] == name]
        assert (rows["release_ms"] / BIT_MS).round(6).tolist() == [when for when, _ in expected]
        starts = (rows["start_ms"] / BIT_MS).round(6).tolist()
        assert [None if np.isnan(t) else t for t in starts] == [start for _, start in expected]


@given(message_sets())
def test_the_bus_with_errors_equals_the_one_without_if_no_error_occurs(messages):
    # The error comes long after the end, so only the other loop runs.
    plain, other = (run_of(messages, 0.2, faults=faults) for faults in ((), ErrorAt(1e5)))
    pd.testing.assert_frame_equal(plain.events(), other.events())
    assert plain.load == other.load
    assert other.nodes()["state"].eq("error active").all()


@settings(max_examples=50)
@given(message_sets(), st.integers(0, 2**32 - 1))
def test_a_batch_equals_the_single_runs_to_the_nanosecond(messages, seed):
    offsets = np.random.default_rng(seed).integers(0, 10**7, (7, len(messages))) / 1e9
    messages = messages.sort_values("arbitration_id")
    batch = simulate_batch(as_set(messages), RATE, offsets=offsets, until=0.03)
    longest = np.full(len(messages), -np.inf)
    for row, offset in enumerate(offsets):
        one = run_of(messages.assign(offset_ms=offset * 1e3), 0.03).table()
        longest = np.fmax(longest, one["max_ms"])
        assert batch.sent[row].tolist() == one["sent"].tolist()
        for single, theirs in (
            (batch.max_response, one["max_ms"]),
            (batch.mean_response, one["mean_ms"]),
        ):
            assert np.allclose(single[row] * 1e9, theirs * 1e6, rtol=0, atol=1e-3, equal_nan=True)
    table = batch.table()
    assert table.index.equals(one.index)
    assert table["sent"].tolist() == batch.sent.sum(axis=0).tolist()
    assert np.allclose(table["max_ms"].fillna(-np.inf), longest, rtol=1e-12)


def bounds(messages):
    """Return the bounds of the analysis [bit], by message."""
    responses = response_times(as_set(messages), RATE)
    return {one.message.name: round(one.response * RATE, 6) for one in responses}


@settings(max_examples=50)
@given(message_sets(jitter=True), st.integers(0, 2**32 - 1))
def test_no_response_exceeds_the_bound_of_the_analysis(messages, seed):
    longest = run_of(messages, 0.1, rng=seed).table()["max_ms"].dropna() / BIT_MS
    bound = bounds(messages)
    assert all(round(bits, 6) <= bound[name] for name, bits in longest.items())


def test_the_bound_is_attained_at_the_critical_instant():
    messages = pd.DataFrame(table(period_ms=np.array([312, 437, 437]) * BIT_MS, jitter_ms=0.0))
    bound = [*bounds(messages).values()]
    together = run_of(messages, 0.1).table()["max_ms"].to_numpy() / BIT_MS
    assert round(together[2], 6) == bound[2] == 438
    # For the other two, the frame of lowest priority begins one bit before they are released.
    offset = np.array([1, 1, 0]) * BIT_MS
    blocked = run_of(messages.assign(offset_ms=offset), 0.1).table()["max_ms"].to_numpy() / BIT_MS
    assert blocked[:2].round(6).tolist() == [bound[0] - 1, bound[1] - 1] == [249, 374]


@pytest.mark.parametrize(
    ("instant", "bit", "end"),
    [
        # Bit 25 is disturbed; 26 bits and an error frame of 23 are lost.
        (25 * BIT_MS, 25, 149 * BIT_MS),
        (96.5 * BIT_MS, 96, 220 * BIT_MS),  # the last bit before the intermission
        (97.5 * BIT_MS, None, 0.8),
        (98 * BIT_MS, None, 0.8),
        (5.0, None, 0.8),
    ],
)
def test_a_frame_that_failed_is_sent_again_after_the_error_frame(instant, bit, end):
    messages = {"arbitration_id": [5], "bits": 100, "period_ms": 100, "sender": "a"}
    run = run_of(messages, 0.1, ErrorAt(instant / 1e3))
    failed = bit is not None
    assert run.errors()["bit"].tolist() == [bit] * failed
    assert run.errors()["free_ms"].tolist() == pytest.approx([(bit or 0) * BIT_MS + 0.192] * failed)
    assert run.events()["end_ms"].tolist() == pytest.approx([end])
    assert run.events()["retries"].tolist() == run.table()["retries"].tolist() == [failed]
    assert run.load == pytest.approx(end / BIT_MS / 12500)


def every_attempt(count):
    """Return instants in the first bits of this many successive attempts."""
    return 0.5 * BIT_MS / 1e3 + np.arange(count) * (1 + 23) * BIT_MS / 1e3


def test_counters_states_and_suspension_follow_the_standard():
    messages = {
        "arbitration_id": [1, 2],
        "bits": 100,
        "period_ms": [100, 100],
        "sender": ["a", "b"],
    }
    run = run_of(messages, 0.1, hits(every_attempt(16)))
    assert run.errors()["tec"].tolist() == list(range(8, 129, 8))
    assert run.errors()["state"].tolist() == 15 * ["error active"] + ["error passive"]
    # After sixteen lost attempts of 24 bits, a is passive and waits 8 bits, so b goes first.
    first = run.events().sort_values("start_ms")
    assert first["message"].tolist() == ["0x002", "0x001"]
    assert first["start_ms"].tolist() == pytest.approx([384 * BIT_MS, 484 * BIT_MS])
    # b counted 16 errors, sent one frame and received one.
    assert run.nodes()[["tec", "rec"]].to_numpy().tolist() == [[127, 0], [0, 15]]


def test_an_error_passive_node_alone_pauses_8_bits_after_each_of_its_frames():
    messages = {"arbitration_id": [1], "bits": 100, "period_ms": 1.0}
    instants = every_attempt(17)
    instants[16] += 8 * BIT_MS / 1e3
    run = run_of(messages, 0.02, hits(instants))
    start = run.events()["start_ms"].to_numpy()
    # Nine frames reduce the counter from 136 to 127; then the suspension ends.
    assert start[0] == pytest.approx((17 * 24 + 16) * BIT_MS)
    assert np.diff(start[:9]) == pytest.approx(np.full(8, 108 * BIT_MS))
    assert start[9] - start[8] == pytest.approx(100 * BIT_MS)


def test_a_node_at_256_leaves_the_bus_and_returns_after_128_quiet_sequences():
    # Frames released meanwhile must not disturb the count of sequences.
    messages = {"arbitration_id": [1], "bits": 100, "period_ms": 1.3}
    # From attempt 16 the node is passive, so attempts are 8 bits further apart.
    far = 8 * np.maximum(np.arange(32) - 15, 0)
    instants = every_attempt(32) + far * BIT_MS / 1e3
    run = run_of(messages, 0.5, hits(instants))
    assert run.errors()["tec"].tolist()[-1] == 256
    assert run.errors()["state"].tolist()[-1] == "bus off"
    gone = run.errors()["free_ms"].iloc[-1]
    assert gone == pytest.approx((32 * 24 + 16 * 8) * BIT_MS)
    assert run.events()["start_ms"][0] == pytest.approx(gone + 128 * 11 * BIT_MS)
    assert run.nodes()[["tec", "state", "bus_off"]].to_numpy().tolist()[0] == [0, "error active", 1]


def test_frames_of_others_count_towards_the_return_of_a_node():
    messages = {"arbitration_id": [1, 2], "bits": 111, "period_ms": [1000, 0.888], "offset_ms": 0}

    def first_start(run):
        return run.events().loc[run.events()["message"] == "0x001", "start_ms"].iloc[0]

    # b sends whenever a pauses, so the instants of errors are taken from the run itself.
    instants = list(every_attempt(1))
    for _ in range(31):
        again = first_start(run_of(messages, 0.2, hits(instants)))
        instants.append((again + 0.5 * BIT_MS) / 1e3)
    run = run_of(messages, 0.4, hits(instants))
    assert run.nodes()["bus_off"].tolist() == [1, 0]
    gone = run.errors()["free_ms"].iloc[-1]
    # The bus is never idle: each frame of b ends in one sequence of 11 recessive bits.
    assert first_start(run) == pytest.approx(gone + 128 * 111 * BIT_MS)
    # A node that returns after a destroyed frame has not counted its error.
    last = gone + 127 * 111 * BIT_MS
    errors = hits([*instants, (last + 0.5 * BIT_MS) / 1e3])
    run = run_of(messages, (last + BIT_MS) / 1e3, errors)
    assert run.errors()[["message", "start_ms"]].iloc[-1].tolist() == ["0x002", pytest.approx(last)]
    assert run.nodes().loc["0x001"].tolist() == [0, 0, "error active", 1]


def test_errors_with_the_smallest_probability_and_the_latest_start_never_occur():
    faults = [BitErrors(5e-324), BitErrors(0.5, start=1e9), BitErrors(1e-300, start=0.01)]
    run = run_of(table(period_ms=5), 0.1, faults, rng=1)
    pd.testing.assert_frame_equal(run.events(), run_of(table(period_ms=5), 0.1).events())


def test_the_latest_times_do_not_overflow():
    messages = MessageSet([Message("a", 1, 8, period=1e5, jitter=1e5, offset=1e5, bits=160)])
    run = simulate(messages, 5e3, until=1e6, faults=BitErrors(1e-5), rng=1)
    assert run.table()[["released", "sent", "waiting"]].to_numpy().tolist() == [[9, 9, 0]]
    assert run.events()["start_ms"].is_monotonic_increasing
    assert run.events()["end_ms"].iloc[-1] > 9e8


def test_the_mean_of_many_long_responses_does_not_overflow():
    # On this overloaded bus the responses of b grow steadily; their sum is 600 years.
    messages = MessageSet(Message(name, k, 8, 0.06, bits=160) for k, name in enumerate("ab"))
    run = simulate_batch(messages, 5e3, offsets=[[0, 0]], until=1.5e5)
    assert run.mean_response[0, 1] == pytest.approx(run.max_response[0, 1] / 2, rel=1e-3)


@pytest.mark.parametrize("faults", [BitErrors(2e-3), [BitErrors(1.2e-3), BitErrors(8.00961e-4)]])
def test_retries_follow_their_probability(faults):
    # Many nodes, so that none is ever passive for long. Two faults disturb a bit as one does.
    rate, bits = 2e-3, 122
    run = run_of(table(period_ms=5), 20.0, faults, rng=2024)
    chance = 1 - (1 - rate) ** bits
    frames = run.events()["retries"]
    mean, deviation = chance / (1 - chance), np.sqrt(chance) / (1 - chance)
    assert abs(frames.mean() - mean) < 4 * deviation / np.sqrt(len(frames))
    # The first disturbed bit, if there is one, has a truncated geometric distribution.
    hit, bit = run.errors()["bit"].to_numpy(), np.arange(bits)
    weight = (1 - rate) ** bit * rate / chance
    expected = (weight * bit).sum()
    spread = np.sqrt((weight * bit**2).sum() - expected**2)
    assert hit.min() <= 1
    assert hit.max() >= 119
    assert abs(hit.mean() - expected) < 4 * spread / np.sqrt(len(hit))


def test_bit_errors_last_from_start_to_stop():
    fault = BitErrors(0.02, start=3.0, stop=4.0)
    errors = run_of(table(period_ms=5), 10.0, fault, rng=1).errors()
    begin = errors["start_ms"] + errors["bit"] * BIT_MS
    # The first disturbed bit may begin before the fault.
    assert len(errors) > 100
    assert begin.min() > 3000 - BIT_MS
    assert begin.max() < 4000
    assert run_of(table(period_ms=5), 2.0, fault, rng=1).errors().empty


def test_the_same_seed_gives_the_same_run():
    one, other = (
        run_of(table(period_ms=5, jitter_ms=1.0), 1.0, BitErrors(1e-3), rng=7).events()
        for _ in range(2)
    )
    pd.testing.assert_frame_equal(one, other)


@given(message_sets(jitter=True), st.integers(0, 2**32 - 1))
def test_a_disturbed_bus_carries_one_frame_at_a_time_and_loses_none(messages, seed):
    messages = messages.assign(sender=["a", "b", "a", "c", "a"][: len(messages)])
    run = run_of(messages, 0.1, BitErrors(0.01), rng=seed)
    frames, sent = run.events(), run.events().dropna()
    spans = np.concatenate(
        [sent[["start_ms", "end_ms"]].to_numpy(), run.errors()[["start_ms", "free_ms"]].to_numpy()]
    )
    spans = spans[spans[:, 0].argsort()]
    assert (np.rint(spans[1:, 0] * 1e6) >= np.rint(spans[:-1, 1] * 1e6)).all()
    assert frames["retries"].sum() == len(run.errors())
    counts = run.table()[["sent", "waiting"]].sum(axis=1)
    assert (counts == run.table()["released"]).all()
    order = sent[sent["message"].duplicated(keep=False)].groupby("message", observed=True)
    for _, group in order:
        assert group["start_ms"].is_monotonic_increasing
    assert (run.errors()["tec"] < 256 + 8).all()
    assert ((run.errors()["tec"] >= 256) == (run.errors()["state"] == "bus off")).all()


def test_statistics_are_those_of_the_transmissions():
    run = run_of(table(deadline_ms=[2.5, 3.25, 3.25]), 1.0)
    by = run.events().groupby("message", observed=True)["response_ms"]
    for column, theirs in (("min_ms", by.min()), ("mean_ms", by.mean()), ("max_ms", by.max())):
        assert run.table()[column].tolist() == pytest.approx(theirs.tolist(), rel=1e-12)
    late = (run.events()["response_ms"] > 3.25) & (run.events()["message"] == "0x003")
    assert run.table()["missed"].tolist() == [0, 0, late.sum()]
    assert late.sum() > 0


def test_a_frame_that_waits_beyond_its_deadline_is_missed():
    messages = {"arbitration_id": [1, 2], "bits": 125, "period_ms": [1.0, 10.0]}
    run = run_of(messages, 0.1)
    assert run.table()["missed"].tolist() == [0, 10 - 1]
    assert run.table()["waiting"].tolist() == [0, 10]
    assert np.isnan(run.table()["max_ms"].iloc[1])
    assert run.load == 1


def test_the_response_begins_with_the_event():
    messages = {"arbitration_id": [1], "bits": 100, "period_ms": 10, "jitter_ms": 2}
    frames = run_of(messages, 5.0, rng=7).events()
    delay = frames["release_ms"] - frames["arrival_ms"]
    assert 0 <= delay.min() < 0.05
    assert 1.95 < delay.max() <= 2
    assert frames["response_ms"].tolist() == pytest.approx((delay + 0.8).tolist())


def test_messages_without_a_sender_have_nodes_of_their_own():
    messages = MessageSet([Message("a", 1, 8, 1.0), Message("b", 2, 8, 1.0, sender="JB1")])
    assert simulate(messages, RATE, until=1.0).nodes().index.tolist() == ["a", "JB1"]


def test_a_run_without_releases_is_an_empty_table():
    run = run_of(table(offset_ms=1000.0), 0.5)
    assert run.events().empty
    assert run.load == 0
    assert run.table()["sent"].tolist() == [0, 0, 0]
    assert np.isnan(
        simulate_batch(as_set(table()), RATE, offsets=[[1, 1, 1]], until=0.5).max_response
    ).all()


def test_the_counters_equal_those_counted_attempt_by_attempt():
    run = run_of(table(period_ms=[2.9, 5, 5], sender=["a", "b", "a"]), 20.0, BitErrors(3e-4), rng=9)
    good, bad = run.events().dropna(), run.errors()
    sender = dict(zip(["0x001", "0x002", "0x003"], "aba", strict=True))
    attempts = sorted(
        [
            (start, sender[name], False)
            for start, name in zip(good.start_ms, good.message, strict=True)
        ]
        + [(start, name, True) for start, name in zip(bad.start_ms, bad.sender, strict=True)]
    )
    tec, rec, seen = {"a": 0, "b": 0}, {"a": 0, "b": 0}, []
    for _, own, failed in attempts:
        other = "b" if own == "a" else "a"
        tec[own] = tec[own] + 8 if failed else max(tec[own] - 1, 0)
        rec[other] = rec[other] + 1 if failed else max(rec[other] - 1, 0)
        if failed:
            seen.append(tec[own])
    assert len(seen) > 200
    assert max(seen) < 128
    assert bad["tec"].tolist() == seen
    assert run.nodes()[["tec", "rec"]].to_numpy().T.tolist() == [[*tec.values()], [*rec.values()]]


def batch(offsets):
    return simulate_batch(as_set(table()), RATE, offsets=offsets, until=0.1)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: run_of(table(), 0), "until is 0 s; it must be 1e-09"),
        (lambda: simulate(as_set(table()), 2e6, until=1.0), r"bit_rate is 2e\+06 bit/s"),
        (lambda: simulate(as_set(table()), 83e3, until=1.0), r"a bit lasts 12048\.2 ns; it must"),
        (lambda: simulate(MessageSet([]), RATE, until=1.0), "messages are empty; there must be at"),
        (lambda: run_of(table(period_ms=1e-3), 10.0), "at most 20000000 are allowed"),
        (
            lambda: run_of(table(), 0.02).plot(1, 0.5),
            r"start is 1 s; it must be before stop, 0\.5 s",
        ),
        (lambda: BitErrors(1), "rate is 1; it must be 0..0.5"),
        (lambda: BitErrors(0.1, start=2.0, stop=1.0), "stop is 1 s; it must be after start"),
        (lambda: ErrorAt(-1.0), "time is -1 s"),
        (lambda: batch([0, 0, 0]), r"offsets have the shape \(3,\)"),
        (lambda: batch([[0, 0]]), r"offsets have the shape \(1, 2\)"),
        (lambda: batch([[0, 0, -1]]), "offsets contain a time outside"),
        (lambda: batch([[0, 0, np.nan]]), "offsets contain a time outside"),
        (lambda: batch([["a", "b", "c"]]), "offsets have the shape"),
    ],
)
def test_an_argument_out_of_range_is_refused(call, message):
    with pytest.raises(ArgumentError, match=message):
        call()
