"""Transactions decoded from line voltages of our own simulator and of ngspice."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.signal import bilinear, lfilter

from shipnet.__main__ import main
from shipnet.arrays import parts_of
from shipnet.asi import Call, Request, bursts
from shipnet.asi.bursts import pieces
from shipnet.asi.capture import decode
from shipnet.asi.modulation import SEND_CURRENT, Modulation
from shipnet.errors import ArgumentError, InputError
from shipnet.line import scope_file

BIT = 6e-6
REFERENCE = np.load(Path(__file__).parents[1] / "reference" / "line" / "asi.npz")
#: Cases on 100 m and 150 m.
SHORT = ("a_resp", "a_req_", "b_resp", "b_req_", "len150")

REQUESTS = {a: Request.data_exchange(a, a % 16) for a in range(1, 32)}
ANSWERS = {a: request.answer(7 * a % 16) for a, request in REQUESTS.items()}


def cycle(addresses, *, start=20e-6, master_pause=3, slave_pause=2, silent=(), swing=None):
    """Return start, bits and swing [A] of the telegrams of one cycle, and when the next begins."""
    telegrams = []
    for address in addresses:
        telegrams.append((start, REQUESTS[address].bits, 60e-3))
        start += 14 * BIT
        if address in silent:
            start += 10 * BIT
            continue
        current = 60e-3 * (swing or {}).get(address, 1)
        telegrams.append((start + master_pause * BIT, ANSWERS[address].bits, current))
        start += (master_pause + 7 + slave_pause) * BIT
    return telegrams, start


def line(telegrams, duration, rate):
    """Return what a scope records of telegrams at the supply's 78 ohm || 100 uH."""
    # 1 MS/s does not resolve the network, so slow records are sampled from a fast one.
    step = 1 / max(rate, 10e6)
    current = np.zeros(round(duration / step))
    for start, bits, swing in telegrams:
        begin = int(start / step)
        end = min(len(current), int((start + (len(bits) + 1) * BIT) / step))
        t = np.arange(begin, end) * step
        current[begin:end] += swing / SEND_CURRENT * Modulation(bits).current(t, start=start)
    voltage = -lfilter(*bilinear([78.0 * 100e-6, 0], [100e-6, 78.0], 1 / step), current)
    return voltage[:: round(1 / (rate * step))]


def noise(u, sigma, seed=2024):
    return u + sigma * np.random.default_rng(seed).normal(size=u.size)


def five(rate=10e6, **options):
    telegrams, end = cycle((1, 2, 3, 4, 21), **options)
    return line(telegrams, end + 20e-6, rate)


def check_five(capture):
    table = capture.transactions
    assert table["address"].tolist() == [1, 2, 3, 4, 21]
    assert table["request"].tolist() == [REQUESTS[a].bits for a in (1, 2, 3, 4, 21)]
    assert table["response"].tolist() == [ANSWERS[a].bits for a in (1, 2, 3, 4, 21)]
    assert table["response_data"].tolist() == [7 * a % 16 for a in (1, 2, 3, 4, 21)]
    assert set(table["request_error"]) == set(table["response_error"]) == {"ok"}


def test_a_row_describes_a_whole_transaction():
    capture = decode(30 + five(), 1e-7)
    check_five(capture)
    row = capture.transactions.iloc[4]
    assert row["call"] == "data exchange"
    assert row["request_data"] == 5
    assert row["half"] == ""
    assert row["start_s"] == pytest.approx(20e-6 + 4 * 156e-6, abs=1.5e-6)
    assert row["master_pause_bit"] == pytest.approx(3, abs=0.02)
    assert capture.transactions["slave_pause_bit"][0] == pytest.approx(2, abs=0.02)
    assert np.isnan(row["slave_pause_bit"])
    assert row["request_amplitude_V"] == pytest.approx(2.36, abs=0.02)
    for who in ("request", "response"):
        assert 0.8 < row[f"{who}_weakest"] < 0.95
        assert 0.1 < row[f"{who}_ringing"] < 0.25
    assert row["text"] == (
        "data exchange with slave 21: outputs 0101 (5); response to data exchange: inputs 0011 (3)"
    )
    assert capture.duration == pytest.approx(820e-6)


@pytest.mark.parametrize("rate", [1e6, 2.5e6, 10e6, 100e6])
@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("offset", [0, 30])
def test_any_rate_polarity_and_coupling(rate, sign, offset):
    capture = decode(offset + sign * noise(five(rate), 0.1), 1 / rate)
    check_five(capture)
    assert capture.inverted == (sign < 0)


@pytest.mark.parametrize(
    "spoil",
    [
        lambda u, t: np.clip(u, -2, 2),
        lambda u, t: np.round((u + 30) / 0.15) * 0.15,
        lambda u, t: u + 0.5 * np.sin(2 * np.pi * 100 * t),
        lambda u, t: u + 0.3 * np.sin(2 * np.pi * 1000 * t) + 30,
        lambda u, t: u + 1000 * t,
        lambda u, t: lfilter([1, -1], [1, -np.exp(-2 * np.pi * 1000 * 1e-7)], u),
        lambda u, t: u / 100,
        lambda u, t: noise(u, 0.3) + 30,
        lambda u, t: (u * 1000).astype(np.int16),
        lambda u, t: u.astype(np.float32) + np.float32(30),
    ],
    ids="clipped 8bit hum ripple drift ac probe noise adc single".split(),
)
def test_what_a_scope_does_to_a_signal(spoil):
    u = five()
    check_five(decode(spoil(u, np.arange(u.size) * 1e-7), 1e-7))


@pytest.mark.parametrize("pauses", [(2, 1), (2.5, 1.5), (10, 2), (3, 80)])
def test_shortest_and_longest_pauses(pauses):
    capture = decode(five(master_pause=pauses[0], slave_pause=pauses[1]), 1e-7)
    check_five(capture)
    assert capture.transactions["master_pause_bit"].to_numpy() == pytest.approx(pauses[0], abs=0.05)
    found = capture.transactions["slave_pause_bit"].to_numpy()[:-1]
    assert found == pytest.approx(pauses[1], abs=0.05)


def test_two_cycles_with_every_kind_of_event():
    first, middle = cycle(range(1, 8), silent=(5,))
    second, end = cycle(range(1, 4), start=middle, silent=())
    broken = REQUESTS[4].bits[:8] + "10"[int(REQUESTS[4].bits[8])] + REQUESTS[4].bits[9:]
    second.append((end, broken, 60e-3))
    again, end = cycle((4, 5), start=end + 24 * BIT, silent=(5,))
    asked, end = cycle((6,), start=end, silent=(6,))
    rest, end = cycle((6, 7), start=end)
    u = line([*first, *second, *again, *asked, *rest], end + 20e-6, 5e6)
    capture = decode(30 - noise(u, 0.1), 2e-7)
    table, summary = capture.transactions, capture.summary()
    assert table["address"].fillna(0).tolist() == [1, 2, 3, 4, 5, 6, 7, 1, 2, 3, 0, 4, 5, 6, 6, 7]
    assert table["request_error"][10] == "ParityError"
    assert table["request"][10] == broken
    assert table["response_error"].tolist()[3:6] == ["ok", "no answer", "ok"]
    assert summary.transactions == 16
    assert summary.repetitions == 2
    assert summary.unanswered == 3
    assert summary.missing == ["5"]
    assert summary.seen == ["1", "2", "3", "4", "6", "7"]
    assert summary.errors == {"ParityError": 1}
    assert summary.cut_off == 0
    # Slaves 1 to 3, then 5 and 6 after the bad request, then 7 also after the repetition.
    assert summary.cycle_time == pytest.approx(
        np.median([180, 180, 180, 204, 204, 228]) * BIT, abs=1e-6
    )
    assert summary.slaves.loc["6", ["requests", "answers", "errors"]].tolist() == [3, 2, 0]
    assert summary.slaves.loc["4", "weakest_pulse"] == pytest.approx(
        table["response_weakest"][[3, 11]].min()
    )
    assert "never answered 5" in str(summary)


@pytest.mark.parametrize(("cycles", "light"), [(0, "red"), (1, "yellow"), (4, "green")])
def test_the_light_of_repetitions(cycles, light):
    telegrams, end = cycle((1, 2), silent=(2,))
    again, end = cycle((2,), start=end)
    telegrams += again
    for _ in range(cycles):
        more, end = cycle(range(1, 32), start=end + 10 * BIT)
        telegrams += more
    counters = decode(line(telegrams, end + 20e-6, 5e6), 2e-7).counters()
    assert counters.loc["repetitions", "value"] == pytest.approx(1 / (3 + 31 * cycles))
    assert counters.loc["repetitions", "light"] == light
    assert counters.loc["missing slave frames", "value"] == 1


def asked(requests, answered=(), gap=26):
    """Return the capture of a list of requests; those with an index in `answered` are answered."""
    telegrams = []
    for k, request in enumerate(requests):
        start = 20e-6 + k * gap * BIT
        telegrams.append((start, request.bits, 60e-3))
        if k in answered:
            telegrams.append((start + 17 * BIT, request.answer(6).bits, 60e-3))
    return decode(line(telegrams, len(requests) * gap * BIT + 200e-6, 5e6), 2e-7)


def silence(capture):
    found = capture.check().table().set_index("rule")
    return found.loc[found.index == "missing responses in a row", ["verdict", "value"]]


@pytest.mark.parametrize(
    "call",
    [Call.READ_STATUS, Call.READ_IO_CONFIGURATION, Call.READ_ID, Call.READ_ID1, Call.READ_ID2],
)
def test_a_vacant_address_may_be_searched_with_any_call(call):
    # One request per cycle, to the same address.
    requests = [REQUESTS[1], Request(call, 9)] * 8
    capture = asked(requests, range(0, 16, 2))
    assert capture.check().ok
    assert capture.summary().missing == []
    assert capture.summary().vacant == ["9"]
    assert capture.counters().loc["missing slave frames", "value"] == 0
    assert silence(capture)["value"].tolist() == [0.0]
    assert capture.causes().empty


def test_one_unanswered_data_exchange_is_not_evidence_of_anything():
    capture = asked([REQUESTS[1]])
    assert silence(capture)["verdict"].tolist() == ["not verified"]
    assert capture.check().ok is None
    assert capture.causes().empty
    assert "not verified at slave 1, one data exchange without a response" in str(capture.check())


@pytest.mark.parametrize(
    ("answered", "verdict", "value"),
    [
        ((), "violated", 4),
        ((0,), "violated", 3),
        ((0, 3), "violated", 2),
        ((0, 2), "met", 1),
        ((3,), "violated", 3),
        ((0, 1, 2, 3), "met", 0),
    ],
)
def test_a_repetition_needs_a_response(answered, verdict, value):
    capture = asked([REQUESTS[1]] * 4, answered)
    assert silence(capture).iloc[0].tolist() == [verdict, value]


def test_only_data_exchanges_count_as_missing_responses():
    requests = [REQUESTS[1], Request(Call.WRITE_PARAMETER, 1, 15), Request(Call.READ_STATUS, 1)] * 3
    capture = asked(requests, (0, 3, 6))
    assert silence(capture)["value"].tolist() == [0.0]


def test_a_dead_half_of_an_address():
    requests = [Request.data_exchange(3, 5, half) for half in "ABB" * 3]
    telegrams, start = [], 20e-6
    for k, request in enumerate(requests):
        telegrams.append((start, request.bits, 60e-3))
        if k % 3 == 0:
            telegrams.append((start + 17 * BIT, request.answer(6).bits, 60e-3))
        start += 26 * BIT
    u = line(telegrams, start + 200e-6, 5e6)
    for extended, object_ in (([3], "slave 3B"), ([], "slave 3")):
        broken = decode(u, 2e-7, extended=extended).check().violated()
        assert broken["object"].tolist() == [object_]


def test_a_lost_pulse_corrupts_only_one_telegram():
    telegrams, end = cycle((1, 2, 3))
    u = line(telegrams, end + 20e-6, 10e6)
    t = np.arange(u.size) * 1e-7
    # The pulse in the middle of bit 7 of the second request, and its neighbour's tail.
    hole = np.abs(t - (20e-6 + 26 * BIT + 7.5 * BIT + 2.2e-6)) < 2e-6
    table = decode(np.where(hole, 0, u), 1e-7).transactions
    assert table["request_error"].tolist() == ["ok", "AlternationError", "ok"]
    assert table["response_error"].tolist() == ["ok", "ok", "ok"]
    assert "?" in table["request"][1]
    assert table["text"][1].startswith("request AlternationError: ")


def test_an_impulse_in_a_pause_is_a_disturbance():
    u = five(slave_pause=20)
    t = np.arange(u.size) * 1e-7
    pulse = np.cos(np.pi * np.clip((t - 240e-6) / 3e-6, -0.5, 0.5)) ** 2
    capture = decode(u + 3 * pulse, 1e-7)
    check_five(capture)
    assert capture.disturbances == 1


def truth(telegrams, begin, end, margin):
    return [
        (start - begin, bits)
        for start, bits, _ in telegrams
        if start > begin - margin and start + len(bits) * BIT + 1e-6 < end + margin
    ]


def told(table):
    for row in table.to_dict("records"):
        if row["request_error"] == "ok":
            yield row["start_s"], row["request"]
        if row["response_error"] == "ok":
            late = (14 + row["master_pause_bit"]) * BIT if row["request"] else 0
            yield row["start_s"] + late, row["response"]


CUT, CUT_END = cycle(range(1, 9), swing={a: 0.8 + 0.17 * a for a in range(1, 9)})
CUT_LINE = line(CUT, CUT_END + 20e-6, 5e6)


@given(st.integers(0, 2000), st.integers(300, 5000), st.sampled_from([0, 30]))
@settings(max_examples=60)
def test_telegrams_cut_off_are_marked_and_whole_ones_are_not(first, length, offset):
    u = CUT_LINE[first : first + length]
    table = decode(u + offset, 2e-7).transactions
    found = [(start, bits) for start, bits in told(table) if not np.isnan(start)]
    whole, near = (
        truth(CUT, first * 2e-7, (first + len(u)) * 2e-7, margin) for margin in (-8e-6, 7e-6)
    )
    for start, bits in found:
        assert any(abs(start - at) < 3e-6 and bits == true for at, true in near)
    # A response whose request is cut off has no start here, but it counts.
    without = sum(np.isnan(start) for start, _ in told(table))
    assert len(found) + without >= len(whole)
    wrong = set(table["request_error"]) | set(table["response_error"])
    assert wrong <= {"ok", "", "cut off"}


def test_a_gap_starts_a_new_part():
    u = five()
    u[3000:5000] = np.nan
    capture = decode(30 + u, 1e-7)
    assert capture.transactions["address"].fillna(0).tolist() == [1, 2, 0, 21]
    assert capture.summary().cut_off == 2
    u[:] = np.nan
    assert len(decode(u, 1e-7).transactions) == 0


def test_pieces_do_not_change_the_result(monkeypatch):
    telegrams, end = cycle(range(1, 32))
    u = 30 + noise(line(telegrams, end + 20e-6, 10e6), 0.1)
    whole = decode(u, 1e-7).transactions
    monkeypatch.setattr(
        bursts,
        "pieces",
        lambda u, dt, length=7001, only=None: pieces(u, dt, length=length, only=only),
    )
    parts = decode(u, 1e-7).transactions
    words = ["request", "response", "request_error", "response_error", "text"]
    assert parts[words].equals(whole[words])
    numbers = whole.select_dtypes("number").columns
    np.testing.assert_allclose(
        parts[numbers].to_numpy(float, na_value=np.nan),
        whole[numbers].to_numpy(float, na_value=np.nan),
        atol=0.02,
    )


def test_calls_without_answer_and_without_meaning():
    telegrams = [
        (20e-6, Request(Call.BROADCAST_RESET, 31).bits, 60e-3),
        (300e-6, "01000001111101", 60e-3),
        (600e-6, "0011001", 60e-3),
    ]
    table = decode(line(telegrams, 700e-6, 10e6), 1e-7).transactions
    assert table["response_error"].tolist() == ["", "", "ok"]
    assert table["request_error"].tolist() == ["ok", "UnknownCallError", ""]
    assert table["text"][2] == "response: 0110 (6)"


CASES = sorted({name.split("/")[0] for name in REFERENCE.files})


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize(("sign", "offset"), [(1, 30), (-1, 0)])
def test_waveforms_of_ngspice(case, sign, offset):
    bits = "".join(map(str, REFERENCE[f"{case}/bits"]))
    kind = "request" if len(bits) == 14 else "response"
    for u in REFERENCE[f"{case}/v"]:
        table = decode(offset + sign * u, 250e-9).transactions
        good = [row[kind] for _, row in table.iterrows() if row[f"{kind}_error"] == "ok"]
        # From 200 m the near slave is lost, and on 300 m all are, but never with a wrong word.
        assert good in (([bits],) if case[:6] in SHORT else ([bits], []))


@pytest.mark.parametrize(
    "u",
    [
        np.zeros(1),
        np.zeros(5000),
        np.full(5000, 30.0),
        np.random.default_rng(1).normal(size=20_000),
        np.sin(np.arange(20_000) / 16),
        np.sign(np.sin(np.arange(20_000) / 30)),
        np.full(5000, np.nan),
        np.where(np.arange(20_000) % 5000 < 9, np.nan, 30 + np.sin(np.arange(20_000) / 4)),
        np.full(50_000, 30, np.int16),
    ],
    ids="one zeros dc noise sine square nan gaps int".split(),
)
def test_what_is_not_as_i_has_no_good_telegram(u):
    capture = decode(u, 1e-7)
    assert capture.telegrams == 0 and not capture.check().ok
    assert str(capture.summary()) and len(capture.counters()) == 8
    assert set(capture.causes().columns) == {"slave", "share", "evidence"}


@given(
    arrays(
        np.float32,
        st.integers(1, 600),
        elements=st.floats(-1e6, 1e6, width=32) | st.just(float("nan")),
    ),
    st.sampled_from([1e-6, 3e-7, 1e-7, 1e-8]),
)
@example(np.zeros(1, np.float32), 1e-7)
@settings(max_examples=60)
def test_any_samples_give_a_table(u, dt):
    capture = decode(u, dt)
    assert capture.summary().transactions == len(capture.transactions)
    assert len(capture.counters()) == 8
    assert set(capture.causes()["slave"]) <= {"", *capture.slaves.index}


@pytest.mark.parametrize(
    ("u", "dt", "options", "message"),
    [
        ([], 1e-7, {}, "record has shape"),
        ([[1.0]], 1e-7, {}, "record has shape"),
        (["a"], 1e-7, {}, "record has shape"),
        ([np.inf, 0], 1e-7, {}, "u contains inf V"),
        ([0, -1e300], 1e-7, {}, "u contains -1e.300 V"),
        ([0.0], None, {}, "dt is missing"),
        ([0.0], 2e-6, {}, "dt is 2e-06 s"),
        ([0.0], float("nan"), {}, "dt is nan"),
        ([0.0], 1e-7, {"threshold": 1}, "threshold is 1"),
        ([0.0], 1e-7, {"extended": [32]}, "extended contains 32"),
    ],
)
def test_bad_arguments_are_named(u, dt, options, message):
    with pytest.raises(ArgumentError, match=message):
        decode(u, dt, **options)


def test_command_decodes_a_scope_file(tmp_path, capsys):
    telegrams, middle = cycle(range(1, 32), silent=(5,))
    more, end = cycle(range(1, 32), start=middle, silent=(5,))
    u = 30 + noise(line(telegrams + more, end + 20e-6, 5e6), 0.05)
    file = tmp_path / "scope.csv"
    head = "Time,Channel A\n(us),(V)\n\n"
    file.write_text(head + "".join(f"{k / 5:.2f},{v:.3f}\n" for k, v in enumerate(u)))
    table, picture = tmp_path / "out.csv", tmp_path / "out.png"
    assert main(["decode", str(file), "-o", str(table), "-o", str(picture)]) == 1
    out = capsys.readouterr().out
    assert out.startswith(f"scope.csv: channel Channel A; {len(u)} samples at 5 MS/s")
    assert "... and 22 more\n" in out
    assert "data exchange with slave 5: outputs 0101 (5); no answer" in out
    assert "cycle time     4.824 ms" in out
    assert "never answered 5\n" in out
    assert "missing responses in a row: 2 at slave 5, at most 1 (1 violated)\n" in out
    assert len(table.read_text().splitlines()) == 63
    assert f"written: {table}\nwritten: {picture}\n" in out
    assert picture.read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("content", "options", "message"),
    [
        ("hello\n", [], "no column of numbers"),
        ("".join(f"{k}e-7,{k % 7}\n" for k in range(2000)), [], "no AS-i telegram"),
        ("".join(f"{k}e-7,{k % 7}\n" for k in range(99)), ["--threshold", "2"], "threshold is 2"),
        ("1\n2\n3\n", ["--sample-interval", "-1"], "--sample-interval is -1.0 s"),
    ],
)
def test_the_command_reports_a_mistake_in_one_line(content, options, message, tmp_path, capsys):
    file = tmp_path / "a.csv"
    file.write_text(content)
    assert main(["decode", str(file), *options]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1


@pytest.mark.parametrize("suffix", ["csv", "xlsx"])
def test_the_bits_in_a_file_survive_pandas(tmp_path, suffix):
    np.savez(tmp_path / "scope.npz", u=five(), dt=1e-7)
    file = tmp_path / f"transactions.{suffix}"
    main(["decode", str(tmp_path / "scope.npz"), "-o", str(file)])
    table = pd.read_csv(file) if suffix == "csv" else pd.read_excel(file)
    assert table["request"].tolist() == [f"0b{REQUESTS[a].bits}" for a in (1, 2, 3, 4, 21)]
    assert table["response"].tolist() == [f"0b{ANSWERS[a].bits}" for a in (1, 2, 3, 4, 21)]


@pytest.mark.parametrize("kind", [np.float64, np.float32, np.int16, ">f8"])
def test_a_mapped_file_decodes_like_its_samples(kind, tmp_path, monkeypatch):
    monkeypatch.setattr(scope_file, "MAPPED", 0)
    telegrams, end = cycle(range(1, 32))
    u = (1000 * noise(line(telegrams, end + 20e-6, 10e6), 0.05)).astype(kind)
    if u.dtype.kind == "f":
        u[7000:9000] = np.nan
    file = tmp_path / "scope.npy"
    np.save(file, u)
    capture = decode(file, sample_interval=1e-7)
    assert isinstance(capture.wave.u.base, np.memmap)
    expected = decode(u, 1e-7)
    pd.testing.assert_frame_equal(capture.transactions, expected.transactions)
    assert capture.telegrams > 40
    pd.testing.assert_frame_equal(capture.counters(), expected.counters())
    pd.testing.assert_frame_equal(capture.causes(), expected.causes())

    whole = file.read_bytes()
    file.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(InputError, match="not a complete"):
        decode(file, sample_interval=1e-7)


@pytest.mark.parametrize("begin", [0, 1000, 2**12 - 1, 2**12, 3 * 2**12 - 5])
@pytest.mark.parametrize("length", [1, 40, 2**12, 9000])
def test_gaps_are_found_across_parts(begin, length, monkeypatch):
    monkeypatch.setattr(bursts, "parts_of", lambda u: parts_of(u, 2**12))
    u = np.zeros(20_000)
    u[begin : begin + length] = np.nan
    begins, ends = bursts._edges(u, 1e-7)
    long = length * 1e-7 > 3e-6
    assert (begins * 1e7).round().tolist() == [0, *[min(begin + length, 20_000)] * long]
    assert (ends * 1e7).round().tolist() == [*[begin] * long, 20_000]
