import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.figure import Figure

from shipnet.can.bus import arbitration_key, simulate, simulate_batch
from shipnet.can.bus.plot import plot_gantt
from shipnet.errors import ArgumentError

RATE = 125e3
BIT_MS = 8e-3


def table(**columns):
    return {"arbitration_id": [1, 2, 3], "bits": 125, "period_ms": [2.5, 3.5, 3.5], **columns}


@st.composite
def message_sets(draw, jitter=False):
    number = draw(st.integers(1, 5))
    several = [st.lists(values, min_size=number, max_size=number) for values in (
        st.integers(47, 160), st.integers(60, 900), st.integers(0, 900), st.integers(0, 300)
    )]  # fmt: skip
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


def bit_by_bit(messages, bits, queue):
    """Return message -> list of (release, start or None), looking at the bus once a bit."""
    rows = messages.sort_values("arbitration_id").to_dict("records")
    waiting = [[] for _ in rows]
    seen = [[] for _ in rows]
    free = 0
    for now in range(bits):
        for row, held, log in zip(rows, waiting, seen, strict=True):
            since = now - round(row["offset_ms"] / BIT_MS)
            if since >= 0 and since % round(row["period_ms"] / BIT_MS) == 0:
                if queue == "overwrite":
                    held.clear()
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


@given(message_sets(), st.sampled_from(["fifo", "overwrite"]))
def test_a_look_at_every_bit_finds_the_same_transmissions(messages, queue):
    frames = simulate(messages, 2000 * BIT_MS / 1e3, RATE, queue=queue).transmissions
    slow = bit_by_bit(messages, 2000, queue)
    for name, expected in slow.items():
        mine = frames[frames["message"] == name]
        assert (mine["release_ms"] / BIT_MS).round(6).tolist() == [when for when, _ in expected]
        starts = (mine["start_ms"] / BIT_MS).round(6).tolist()
        assert [None if np.isnan(t) else t for t in starts] == [start for _, start in expected]


@given(message_sets(), st.sampled_from(["fifo", "overwrite"]))
def test_the_bus_with_errors_equals_the_one_without_when_none_strikes(messages, queue):
    # The instant lies far behind the end, so only the other loop runs.
    late = {"error_instants": [1e5]}
    plain, other = (simulate(messages, 0.02, RATE, queue=queue, **extra) for extra in ({}, late))
    pd.testing.assert_frame_equal(plain.transmissions, other.transmissions)
    assert plain.load == other.load
    assert other.nodes["state"].eq("error active").all()


@settings(max_examples=50)
@given(message_sets(), st.integers(0, 2**32 - 1))
def test_a_batch_equals_the_single_runs_to_the_nanosecond(messages, seed):
    offsets = np.random.default_rng(seed).integers(0, 10**7, (7, len(messages))) / 1e9
    batch = simulate_batch(messages, offsets, 0.03, RATE)
    for row, offset in enumerate(offsets):
        one = simulate(messages.assign(offset_ms=offset * 1e3), 0.03, RATE).statistics
        one = one.set_index("arbitration_id").loc[messages["arbitration_id"]]
        assert batch.sent[row].tolist() == one["sent"].tolist()
        for mine, theirs in (
            (batch.max_response, one["max_ms"]),
            (batch.mean_response, one["mean_ms"]),
        ):
            assert np.allclose(mine[row] * 1e9, theirs * 1e6, rtol=0, atol=1e-3, equal_nan=True)


def longest_response(messages, rank):
    """Return the bound of Davis et al. 2007, eq. 4 to 11, in bits; None if it has none."""
    rows = messages.sort_values("arbitration_id").reset_index(drop=True)
    c = rows["bits"].tolist()
    t, j = (((rows[k] / BIT_MS).round().astype(int)).tolist() for k in ("period_ms", "jitter_ms"))
    block = max(c[rank + 1 :], default=0)
    if sum(c[k] / t[k] for k in range(rank + 1)) >= 1:
        return None

    def settle(first, step):
        value = first
        while (new := step(value)) != value:
            value = new
        return value

    def demand(w, k):
        return -(-(w + j[k]) // t[k]) * c[k]

    busy = settle(c[rank], lambda b: block + sum(demand(b, k) for k in range(rank + 1)))
    worst = 0
    for q in range(-(-(busy + j[rank]) // t[rank])):
        own = block + q * c[rank]
        w = settle(own, lambda w, own=own: own + sum(demand(w + 1, k) for k in range(rank)))
        worst = max(worst, j[rank] + w - q * t[rank] + c[rank])
    return worst


@settings(max_examples=50)
@given(message_sets(jitter=True), st.integers(0, 2**32 - 1))
def test_no_response_exceeds_the_bound_of_the_analysis(messages, seed):
    run = simulate(messages, 0.1, RATE, rng=np.random.default_rng(seed))
    bounds = [longest_response(messages, rank) for rank in range(len(messages))]
    for seen, bound in zip(run.statistics["max_ms"], bounds, strict=True):
        assert bound is None or np.isnan(seen) or round(seen / BIT_MS, 6) <= bound


def test_the_bound_is_met_where_the_critical_instant_comes():
    periods = np.array([312, 437, 437]) * BIT_MS
    messages = pd.DataFrame(table(period_ms=periods, jitter_ms=0.0))
    bounds = [longest_response(messages, rank) for rank in range(3)]
    together = simulate(messages, 0.1, RATE).statistics["max_ms"] / BIT_MS
    assert round(together[2], 6) == bounds[2] == 438
    # For the others the lowest frame begins a bit before they are released.
    offset = np.array([1, 1, 0]) * BIT_MS
    blocked = simulate(messages.assign(offset_ms=offset), 0.1, RATE).statistics["max_ms"] / BIT_MS
    assert blocked[:2].round(6).tolist() == [bounds[0] - 1, bounds[1] - 1] == [249, 374]


def leading_bits(number, extended, remote):
    if extended:
        return f"{number >> 18:011b}11{number & 0x3FFFF:018b}{remote:d}"
    return f"{number:011b}{remote:d}0" + 19 * "0"


@given(
    st.lists(
        st.one_of(
            st.tuples(st.integers(0, 0x7FF), st.just(False), st.booleans()),
            st.tuples(st.integers(0, 0x1FFFFFFF), st.just(True), st.booleans()),
            st.tuples(st.just(0x123 << 18), st.just(True), st.booleans()),
            st.tuples(st.just(0x123), st.just(False), st.booleans()),
        ),
        min_size=2,
        max_size=8,
        unique=True,
    )
)
def test_the_key_orders_frames_as_their_bits_do_with_0_dominant(frames):
    keys = arbitration_key(*np.array(frames).T)
    order = sorted(range(len(frames)), key=lambda k: leading_bits(*frames[k]))
    assert keys.argsort(kind="stable").tolist() == order


def test_frames_released_at_one_instant_are_sorted_before_any_is_sent():
    frames = simulate(table(arbitration_id=[3, 2, 1], period_ms=10), 0.01, RATE).transmissions
    assert frames.sort_values("start_ms")["message"].tolist() == ["0x001", "0x002", "0x003"]


def test_a_frame_that_failed_is_sent_again_behind_the_error_frame():
    messages = {"arbitration_id": [5], "bits": 100, "period_ms": 100, "sender": "a"}
    run = simulate(messages, 0.1, RATE, error_instants=[0.2e-3], error_bits=17)
    # The bit 25 is disturbed; 26 bits and an error frame of 17 are lost.
    assert run.errors["bit"].tolist() == [25]
    assert run.errors["free_ms"].tolist() == [0.344]
    assert run.transmissions["end_ms"].tolist() == [1.144]
    assert run.transmissions["retries"].tolist() == [1]
    assert run.statistics["retries"].tolist() == [1]
    assert run.load == pytest.approx((43 + 100) / 12500)


@pytest.mark.parametrize("instant", [98 * BIT_MS, 5.0, 97.5 * BIT_MS])
def test_an_error_between_frames_does_no_harm(instant):
    messages = {"arbitration_id": [5], "bits": 100, "period_ms": 100}
    run = simulate(messages, 0.1, RATE, error_instants=[instant / 1e3])
    assert run.errors.empty
    assert run.transmissions["end_ms"].tolist() == [0.8]


def test_the_last_bit_of_a_frame_can_still_fail():
    messages = {"arbitration_id": [5], "bits": 100, "period_ms": 100}
    run = simulate(messages, 0.1, RATE, error_instants=[96.5 * BIT_MS / 1e3])
    assert run.errors["bit"].tolist() == [96]


def every_attempt(count, error_bits=23):
    """Return instants that meet the first bit of as many attempts, one behind the other."""
    return 0.5 * BIT_MS / 1e3 + np.arange(count) * (1 + error_bits) * BIT_MS / 1e3


def test_counters_states_and_suspension_follow_the_standard():
    messages = {
        "arbitration_id": [1, 2], "bits": 100, "period_ms": [100, 100], "sender": ["a", "b"]
    }  # fmt: skip
    run = simulate(messages, 0.1, RATE, error_instants=every_attempt(16))
    assert run.errors["tec"].tolist() == list(range(8, 129, 8))
    assert run.errors["state"].tolist() == 15 * ["error active"] + ["error passive"]
    # Sixteen lost attempts of 24 bits. Then a is passive and waits 8 bits, so b goes first.
    first = run.transmissions.sort_values("start_ms")
    assert first["message"].tolist() == ["0x002", "0x001"]
    assert first["start_ms"].tolist() == pytest.approx([384 * BIT_MS, 484 * BIT_MS])
    # b counted 16 errors, sent one frame, heard one.
    assert run.nodes[["tec", "rec"]].to_numpy().tolist() == [[127, 0], [0, 15]]


def test_an_error_passive_node_alone_loses_8_bits_to_every_frame_of_its_own():
    messages = {"arbitration_id": [1], "bits": 100, "period_ms": 1.0}
    instants = every_attempt(17)
    instants[16] += 8 * BIT_MS / 1e3
    run = simulate(messages, 0.02, RATE, error_instants=instants)
    start = run.transmissions["start_ms"].to_numpy()
    # The counter falls from 136 to 127 with nine frames; then the suspension ends.
    assert start[0] == pytest.approx((17 * 24 + 16) * BIT_MS)
    assert np.diff(start[:9]) == pytest.approx(np.full(8, 108 * BIT_MS))
    assert start[9] - start[8] == pytest.approx(100 * BIT_MS)


def test_a_node_at_256_leaves_the_bus_and_returns_after_128_quiet_sequences():
    # Frames released meanwhile must not disturb the count of sequences.
    messages = {"arbitration_id": [1], "bits": 100, "period_ms": 1.3}
    # Passive from attempt 16 on, so attempts are 8 bits further apart.
    far = 8 * np.maximum(np.arange(32) - 15, 0)
    instants = every_attempt(32) + far * BIT_MS / 1e3
    run = simulate(messages, 0.5, RATE, error_instants=instants)
    assert run.errors["tec"].tolist()[-1] == 256
    assert run.errors["state"].tolist()[-1] == "bus off"
    gone = run.errors["free_ms"].iloc[-1]
    assert gone == pytest.approx((32 * 24 + 16 * 8) * BIT_MS)
    assert run.transmissions["start_ms"][0] == pytest.approx(gone + 128 * 11 * BIT_MS)
    assert run.nodes.loc[0, ["tec", "state", "bus_off"]].tolist() == [0, "error active", 1]
    never = simulate(messages, 0.5, RATE, error_instants=instants, recover=False)
    assert set(never.transmissions["outcome"]) == {"waiting"}
    assert never.nodes["state"].tolist() == ["bus off"]


def test_frames_of_others_count_for_the_return_of_a_node():
    messages = {"arbitration_id": [1, 2], "bits": 111, "period_ms": [1000, 0.888], "offset_ms": 0}
    # b sends whenever a pauses, so error instants are taken from what is seen.
    instants, attempts = list(every_attempt(1)), 1
    while attempts < 32:
        run = simulate(messages, 0.2, RATE, error_instants=instants)
        again = run.transmissions.loc[run.transmissions["message"] == "0x001", "start_ms"]
        instants.append((again.iloc[0] + 0.5 * BIT_MS) / 1e3)
        attempts += 1
    run = simulate(messages, 0.4, RATE, error_instants=instants)
    assert run.nodes["bus_off"].tolist() == [1, 0]
    gone = run.errors["free_ms"].iloc[-1]
    back = run.transmissions.loc[run.transmissions["message"] == "0x001", "start_ms"].iloc[0]
    # The bus is never at rest: each frame of b ends in one sequence of 11 recessive bits.
    assert back == pytest.approx(gone + 128 * 111 * BIT_MS)


def test_retries_follow_their_chance():
    chance, rng = 0.2, np.random.default_rng(2024)
    # Many nodes, so that none is ever passive for long.
    run = simulate(table(period_ms=5), 20.0, RATE, error_rate=chance, rng=rng)
    frames = run.transmissions["retries"]
    mean, deviation = chance / (1 - chance), np.sqrt(chance) / (1 - chance)
    assert abs(frames.mean() - mean) < 4 * deviation / np.sqrt(len(frames))
    bits = run.errors["bit"].to_numpy()
    assert bits.min() == 0
    assert bits.max() == 121
    assert abs(bits.mean() - 60.5) < 4 * 122 / np.sqrt(12 * len(bits))


@given(message_sets(jitter=True), st.integers(0, 2**32 - 1), st.sampled_from(["fifo", "overwrite"]))
def test_a_disturbed_bus_carries_one_frame_at_a_time_and_loses_none(messages, seed, queue):
    rng = np.random.default_rng(seed)
    messages = messages.assign(sender=["a", "b", "a", "c", "a"][: len(messages)])
    run = simulate(messages, 0.1, RATE, queue=queue, error_rate=0.7, rng=rng)
    frames, sent = run.transmissions, run.transmissions.dropna()
    spans = np.concatenate(
        [sent[["start_ms", "end_ms"]].to_numpy(), run.errors[["start_ms", "free_ms"]].to_numpy()]
    )
    spans = spans[spans[:, 0].argsort()]
    assert (np.rint(spans[1:, 0] * 1e6) >= np.rint(spans[:-1, 1] * 1e6)).all()
    assert frames["retries"].sum() == len(run.errors)
    counts = run.statistics[["sent", "waiting", "overwritten"]].sum(axis=1)
    assert (counts == run.statistics["released"]).all()
    order = sent[sent["message"].duplicated(keep=False)].groupby("message", observed=True)
    for _, group in order:
        assert group["start_ms"].is_monotonic_increasing
    assert (run.errors["tec"] < 256 + 8).all()
    assert ((run.errors["tec"] >= 256) == (run.errors["state"] == "bus off")).all()


def test_statistics_are_those_of_the_transmissions():
    run = simulate(table(deadline_ms=[2.5, 3.25, 3.25]), 1.0, RATE)
    by = run.transmissions.groupby("message", observed=True)["response_ms"]
    for mine, theirs in (("min_ms", by.min()), ("mean_ms", by.mean()), ("max_ms", by.max())):
        assert run.statistics[mine].tolist() == pytest.approx(theirs.tolist(), rel=1e-12)
    late = (run.transmissions["response_ms"] > 3.25) & (run.transmissions["message"] == "0x003")
    assert run.statistics["missed"].tolist() == [0, 0, late.sum()]
    assert late.sum() > 0


def test_what_waits_beyond_its_deadline_is_missed():
    messages = {"arbitration_id": [1, 2], "bits": 125, "period_ms": [1.0, 10.0]}
    run = simulate(messages, 0.1, RATE)
    assert run.statistics["missed"].tolist() == [0, 10 - 1]
    assert run.statistics["waiting"].tolist() == [0, 10]
    assert np.isnan(run.statistics["max_ms"][1])
    assert run.load == 1


def test_the_response_begins_with_the_event_and_ends_with_or_without_intermission():
    messages = {"arbitration_id": [1], "bits": 100, "period_ms": 10, "jitter_ms": 2}
    rng = np.random.default_rng(7)
    frames = simulate(messages, 5.0, RATE, rng=rng).transmissions
    delay = frames["release_ms"] - frames["arrival_ms"]
    assert 0 <= delay.min() < 0.05
    assert 1.95 < delay.max() <= 2
    assert frames["response_ms"].tolist() == pytest.approx((delay + 0.8).tolist())
    rng = np.random.default_rng(7)
    other = simulate(messages, 5.0, RATE, rng=rng, intermission=False).transmissions
    assert (frames["end_ms"] - other["end_ms"]).tolist() == pytest.approx(500 * [3 * BIT_MS])
    assert other["start_ms"].equals(frames["start_ms"])


def test_nothing_released_is_an_empty_table():
    run = simulate(table(offset_ms=1000.0), 0.5, RATE)
    assert run.transmissions.empty
    assert run.load == 0
    assert run.statistics["sent"].tolist() == [0, 0, 0]
    assert np.isnan(simulate_batch(table(), [[1, 1, 1]], 0.5, RATE).max_response).all()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"arbitration_id": []}, "messages are"),
        ({"arbitration_id": [1, 2, 2]}, "messages 2 and 3 have the same arbitration, 0x002"),
        ({"arbitration_id": [1, 2, 0x800]}, "arbitration_id is 0x800; it must be 0..0x7ff"),
        ({"arbitration_id": [1, 2, "x"]}, "arbitration_id of message 3 is 'x'"),
        ({"arbitration_id": [1, 2, 2.5]}, r"arbitration_id of message 3 is 2.5; it must be whole"),
        ({"arbitration_id": [True, False, True]}, "arbitration_id of message 1 is True"),
        ({"name": ["a", "b", "a"]}, "messages 1 and 3 have the same name, a"),
        ({"name": ["a", "", "c"]}, "name of message 2 is ''; it must be a text"),
        ({"period_ms": [1, 0, 1]}, "period_ms of message 2 is 0; it must be 0.001"),
        ({"period_ms": [1, 1, np.nan]}, "period_ms of message 3 is nan"),
        ({"offset_ms": -1.0}, "offset_ms of message 1 is -1.0"),
        ({"bits": 161}, "bits of message 1 is 161; it must be 47..160"),
        ({"extended": 2}, "extended of message 1 is 2; it must be 0..1"),
        ({"jitter_ms": 1.0}, "messages have jitter, but rng is missing"),
        ({"period_ms": 1e-3}, "it must be so short that they are 20000000"),
    ],
)
def test_a_table_that_makes_no_sense_is_refused(change, message):
    with pytest.raises(ArgumentError, match=message):
        simulate(table(**change), 10.0, RATE)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"duration": 0}, "duration is 0 s; it must be 1e-9"),
        ({"duration": np.nan}, "duration is nan"),
        ({"bit_rate": 2e6}, "bit_rate is 2000000.0 bit/s"),
        ({"bit_rate": "fast"}, "bit_rate is 'fast'"),
        ({"bit_rate": 83e3}, "a bit of 12048.2 ns; it must be a whole number"),
        ({"queue": "stack"}, "queue is 'stack'"),
        ({"error_rate": 1}, "error_rate is 1"),
        ({"error_rate": 0.1}, "error_rate is 0.1, but rng is missing"),
        ({"error_instants": [-1.0]}, "error_instants are"),
        ({"error_instants": [np.nan]}, "error_instants are"),
        ({"error_bits": 31}, "error_bits is 31; it must be a whole number 17..23"),
    ],
)
def test_an_argument_out_of_range_is_refused(change, message):
    with pytest.raises(ArgumentError, match=message):
        simulate(**{"messages": table(), "duration": 0.1, "bit_rate": RATE, **change})


@pytest.mark.parametrize(
    ("offsets", "message"),
    [
        ([0, 0, 0], r"offsets have the shape \(3,\)"),
        ([[0, 0]], r"offsets have the shape \(1, 2\)"),
        ([[0, 0, -1]], "offsets hold a time that is not"),
        ([[0, 0, np.nan]], "offsets hold a time that is not"),
        ([["a", "b", "c"]], "offsets have the shape"),
    ],
)
def test_offsets_that_do_not_fit_are_refused(offsets, message):
    with pytest.raises(ArgumentError, match=message):
        simulate_batch(table(), offsets, 0.1, RATE)


def test_columns_missing_are_named():
    for column, message in (
        ("arbitration_id", "no column 'arbitration_id'"),
        ("period_ms", "no column 'period_ms'"),
        ("bits", "neither a column 'bits' nor a column 'dlc'"),
    ):
        messages = {name: values for name, values in table().items() if name != column}
        messages["other"] = [1, 2, 3]
        with pytest.raises(ArgumentError, match=message):
            simulate(messages, 0.1, RATE)


def test_the_gantt_chart_shows_frames_waits_errors_and_losses():
    messages = table(period_ms=[1.5, 2.0, 2.0], name=["a", "b", "c"])
    run = simulate(messages, 0.02, RATE, queue="overwrite", error_instants=[0.5e-3])
    ax = plot_gantt(run, 0, 0.01, ax=Figure().subplots())
    assert [label.get_text() for label in ax.get_yticklabels()] == ["a", "b", "c"]
    frames, errors = ax.containers
    shown = run.transmissions.query("outcome == 'sent' and start_ms < 10")
    assert [bar.get_x() for bar in frames] == shown["start_ms"].tolist()
    assert [bar.get_width() for bar in errors] == [run.errors["free_ms"][0]]
    labels = {text.get_text() for text in ax.get_legend().get_texts()}
    assert labels == {"frame", "error", "overwritten", "waiting"}
    assert ax.get_xlabel() == "time [ms]"
    (waits,) = ax.collections
    assert len(waits.get_segments()) == len(run.transmissions.query(
        "outcome != 'overwritten' and release_ms < 10"
    ))  # fmt: skip
    with pytest.raises(ArgumentError, match=r"begin is 1 s; it must lie before end, 0.5 s"):
        plot_gantt(run, 1, 0.5, ax=Figure().subplots())
