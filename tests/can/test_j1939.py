"""J1939 and NMEA 2000: identifiers, long messages, their load, response times and assembly.

Messages are cut into frames here, by other code than that of the package.
"""

import itertools
import math
from collections import defaultdict

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shipnet import can, datasets
from shipnet.can import Message, MessageSet
from shipnet.can.bus import send
from shipnet.can.j1939 import frame_count, pgn_names
from shipnet.errors import ArgumentError

GNSS, DM1, TO_ALL = 0x0DF80501, 0x18FECA00, 0xFF


def in_bits(number):
    """Return the parts of an identifier, read from its 29 bits as text."""
    bits = f"{number:029b}"
    priority, pages, form, specific, source = (
        int(bits[a:b], 2) for a, b in ((0, 3), (3, 5), (5, 13), (13, 21), (21, 29))
    )
    if form < 240:
        return priority, pages << 16 | form << 8, source, specific
    return priority, pages << 16 | form << 8 | specific, source, TO_ALL


@pytest.mark.parametrize(
    ("number", "parts"),
    [
        (0x0CF00400, (3, 61444, 0, 255)),  # EEC1
        (0x18EA01FE, (6, 59904, 254, 1)),  # a request by a node without an address
        (0x18EFFFFF, (6, 0xEF00, 255, 255)),  # PDU format 239
        (0x18F000FE, (6, 0xF000, 254, 255)),  # PDU format 240
        (0x0DF80500, (3, 129029, 0, 255)),  # data page 1
        (0x1FFFFFFF, (7, 0x3FFFF, 255, 255)),
        (0, (0, 0, 0, 0)),
    ],
)
def test_an_identifier_has_four_parts(number, parts):
    assert can.J1939Id.of(number) == in_bits(number) == parts


@given(st.integers(0, 2**29 - 1))
def test_the_parts_are_those_of_the_bits(number):
    assert can.J1939Id.of(number) == in_bits(number)


@pytest.mark.parametrize("number", [-1, 2**29])
def test_an_identifier_has_29_bits(number):
    with pytest.raises(ArgumentError, match=r"0\.\.536870911"):
        can.J1939Id.of(number)


def message(dlc, transport, number=GNSS, name="m", period=100.0, **more):
    return Message(name, number, dlc, period, extended=True, transport=transport, **more)


@pytest.mark.parametrize(
    ("transport", "legal"),
    [("", (0, 8)), ("fast packet", (0, 223)), ("BAM", (9, 1785)), ("RTS/CTS", (9, 1785))],
)
def test_a_transport_limits_the_length(transport, legal):
    for dlc in (0, 8, 9, 223, 224, 1785):
        if legal[0] <= dlc <= legal[1]:
            assert message(dlc, transport).dlc == dlc
        else:
            with pytest.raises(ArgumentError, match=f"dlc is {dlc}"):
                message(dlc, transport)
    with pytest.raises(ArgumentError, match="dlc is 1786"):
        message(1786, transport)


def test_a_transport_needs_a_29_bit_identifier():
    with pytest.raises(ArgumentError, match="needs `extended`"):
        Message("m", 1, 9, 1.0, transport="BAM")
    with pytest.raises(ArgumentError, match="transport is 'CAN'"):
        message(8, "CAN")


def cut(data, transport, number=GNSS, sequence=0, receiver=5):
    """Return the frames (identifier and bytes) that carry a message."""
    if transport == "":
        return [(number, bytes(data))]
    frames, left = [], bytearray(data)
    if transport == "fast packet":
        head = bytes([len(data)])
        for counter in itertools.count():
            room = 7 - len(head)
            body, left = head + left[:room], left[room:]
            frames.append((number, bytes([sequence * 32 + counter]) + body.ljust(7, b"\xff")))
            head = b""
            if not left:
                return frames
    _, pgn, source, _ = in_bits(number)
    to = TO_ALL if transport == "BAM" else receiver
    down, up = to << 8 | source, source << 8 | to
    size, tail = len(data).to_bytes(2, "little"), pgn.to_bytes(3, "little")
    while left:
        body, left = left[:7], left[7:]
        frames.append((0x1CEB0000 | down, bytes([len(frames) + 1]) + body.ljust(7, b"\xff")))
    count = bytes([len(frames)])
    first = bytes([32 if transport == "BAM" else 16]) + size + count + b"\xff" + tail
    frames.insert(0, (0x1CEC0000 | down, first))
    if transport == "RTS/CTS":
        frames.insert(1, (0x1CEC0000 | up, b"\x11" + count + b"\x01\xff\xff" + tail))
        frames.append((0x1CEC0000 | up, b"\x13" + size + count + b"\xff" + tail))
    return frames


SIZES = {
    "": (0, 1, 8),
    "fast packet": (0, 1, 6, 7, 8, 9, 13, 14, 222, 223),
    "BAM": (9, 14, 15, 223, 224, 1784, 1785),
    "RTS/CTS": (9, 14, 15, 223, 224, 1784, 1785),
}
CASES = [(transport, size) for transport, sizes in SIZES.items() for size in sizes]


@pytest.mark.parametrize(("transport", "size"), CASES)
def test_all_frames_count_in_the_load(transport, size):
    frames = cut(bytes(size), transport)
    one = message(size, transport)
    assert one.frames == frame_count(size, transport) == len(frames)
    longest = can.frame_length([len(data) for _, data in frames], extended=True).sum()
    assert one.frame_length() == longest
    assert can.bus_load(MessageSet([one]), 250e3) == pytest.approx(longest / 250e3 / 100, rel=1e-12)


def log_of(frames, times=None, channel="can0"):
    """Return a log of frames, by default 1 ms apart."""
    number = len(frames)
    data = np.array([[*octets.ljust(8, b"\0")] for _, octets in frames], np.uint8).reshape(-1, 8)
    return can.Log(
        np.arange(number) * 1e-3 if times is None else np.array(times, float),
        np.full(number, channel),
        np.array([identifier for identifier, _ in frames], dtype=np.int64),
        np.ones(number, bool),
        np.zeros(number, bool),
        np.array([len(octets) for _, octets in frames], np.uint8),
        data,
    )


def whole(log, **more):
    """Return (PGN, source, destination, data) of each message in a log, and the faults."""
    found = log.assemble(**more)
    columns = found.messages[["pgn", "source", "destination", "data"]].itertuples(index=False)
    return [(*row[:3], bytes.fromhex(row[3])) for row in columns], found.faults


def noise(size):
    return np.random.default_rng(size).bytes(size)


@pytest.mark.parametrize(("transport", "size"), CASES)
def test_a_message_is_put_together(transport, size):
    number, data = (GNSS if transport == "fast packet" else DM1), noise(size)
    _, pgn, source, _ = in_bits(number)
    to = 5 if transport == "RTS/CTS" else TO_ALL
    log = log_of(cut(data, transport, number))
    assert whole(log) == ([(pgn, source, to, data)], ())
    row = log.assemble().messages.iloc[0]
    # The frame that ends an RTS/CTS session is not a packet of the message.
    assert row["time_s"] == log.time[-2 if transport == "RTS/CTS" else -1]
    assert row["size"] == size
    assert row["name"] == ("GNSS position data" if transport == "fast packet" else "")


def test_sources_and_sequences_that_interleave_are_kept_apart():
    streams = [cut(noise(40 + k), "fast packet", GNSS + k % 3, k) for k in range(6)]
    streams += [cut(noise(30 + k), "BAM", DM1 + k) for k in range(3)]
    streams += [cut(noise(50 + k), "RTS/CTS", DM1 + k, receiver=9 + k) for k in range(3)]
    mixed = [one for row in itertools.zip_longest(*streams) for one in row if one]
    messages, faults = whole(log_of(mixed))
    assert not faults
    sizes = [*range(40, 46), *range(30, 33), *range(50, 53)]
    assert sorted(data for *_, data in messages) == sorted(map(noise, sizes))
    # Two channels do not share sessions either.
    twice = log_of([frame for frame in cut(noise(20), "BAM") for _ in "ab"])
    both = can.Log(twice.time, np.tile(["a", "b"], len(twice) // 2), *twice.columns[2:])
    assert len(whole(both)[0]) == 2 and not whole(both)[1]


@pytest.mark.parametrize(
    ("transport", "change", "number", "faults"),
    [
        ("fast packet", lambda f: f[:2] + f[3:], 0, ["then packet 3", "stray packet 4"]),
        ("fast packet", lambda f: f[1:], 0, [f"stray packet {k}" for k in range(1, 5)]),
        ("fast packet", lambda f: f[:-1], 0, ["4 of 5 packets, then the end of the log"]),
        ("fast packet", lambda f: f[:2] + f[1:], 1, ["packet 1 again"]),
        ("fast packet", lambda f: f[:1] + f, 1, ["1 of 5 packets, then a new transfer"]),
        ("fast packet", lambda f: f + f[-1:], 1, ["stray packet 4"]),
        ("fast packet", lambda f: [*f[:2], f[3], f[2], f[4]], 0, ["packet 3"] + ["stray"] * 2),
        ("fast packet", lambda f: [(f[0][0], b"\x00\xe0" + f[0][1][2:])], 0, ["length is illegal"]),
        ("fast packet", lambda f: [(f[0][0], b"\x00")], 0, ["a frame of 1 bytes"]),
        ("fast packet", lambda f: [(f[0][0], b"\x00\x05\x01")], 0, ["1 of 5 bytes"]),
        ("BAM", lambda f: f[:2] + f[3:], 0, ["1 of 5 packets, then packet 3"] + ["stray"] * 2),
        ("BAM", lambda f: f[:3] + f[2:], 1, ["packet 2 again"]),
        ("BAM", lambda f: f[1:], 0, ["stray"] * 5),
        ("BAM", lambda f: f[:3] + f, 1, ["2 of 5 packets, then a new transfer"]),
        ("BAM", lambda f: [(f[0][0], b"\x20\xfa\x06" + f[0][1][3:])], 0, ["length is illegal"]),
        ("BAM", lambda f: [(f[0][0], f[0][1][:7])], 0, ["a frame of 7 bytes"]),
        ("BAM", lambda f: [*f[:2], (f[2][0], b"\0" * 8)], 0, ["then packet 0"]),
        ("RTS/CTS", lambda f: [*f[:3], f[-1]], 0, ["1 of 5 packets, then its end"]),
        ("RTS/CTS", lambda f: [*f[:3], abort(f, 0)], 0, ["1 of 5 packets, then its end"]),
        ("RTS/CTS", lambda f: [*f[:3], abort(f, 1)], 0, ["1 of 5 packets, then its end"]),
        # The receiver asks for packets 2 and 3 again, then only for packet 2, then pauses.
        ("RTS/CTS", lambda f: [*f[:5], asks(f, 2, 2), *f[3:]], 1, []),
        ("RTS/CTS", lambda f: [*f[:6], asks(f, 1, 2), f[3], f[6], f[7]], 1, []),
        ("RTS/CTS", lambda f: [*f[:4], asks(f, 0, 255), *f[4:]], 1, []),
        ("RTS/CTS", lambda f: [*f[:4], asks(f, 9, 200), (f[2][0], b"\xc8" * 8)], 0, ["packet 200"]),
    ],
)
def test_a_fault_is_counted(transport, change, number, faults):
    data = noise(30)
    messages, reasons = whole(log_of(change(cut(data, transport, GNSS))))
    assert [message[3] for message in messages] == [data] * number
    assert len(reasons) == len(faults)
    assert all(word in reason for word, reason in zip(faults, reasons, strict=True))


def abort(frames, side):
    return frames[side][0], b"\xff\x01\xff\xff\xff" + frames[0][1][5:]


def asks(frames, count, first):
    return frames[1][0], bytes([17, count, first]) + frames[1][1][3:]


@pytest.mark.parametrize(
    ("transport", "limit"), [("fast packet", 0.75), ("BAM", 0.75), ("RTS/CTS", 1.25)]
)
def test_a_transfer_times_out(transport, limit):
    frames = cut(noise(30), transport)
    for gap, number in ((limit - 1e-3, 1), (limit + 1e-3, 0)):
        times = np.arange(len(frames)) * 1e-3
        times[4:] += gap - 1e-3
        messages, faults = whole(log_of(frames, times))
        assert len(messages) == number
        assert any("of silence" in fault for fault in faults) is not bool(number)
    # Without time stamps there is no time-out.
    assert len(whole(log_of(frames, np.full(len(frames), np.nan)))[0]) == 1


def test_remote_and_short_identifiers_are_no_messages():
    log = log_of(cut(b"1234", ""))
    for extended, remote in ((False, False), (True, True)):
        columns = [*log.columns]
        columns[2:5] = np.array([5]), np.array([extended]), np.array([remote])
        assert whole(can.Log(*columns)) == ([], ())
    assert whole(log_of([])) == ([], ())


@settings(max_examples=200)
@given(
    st.lists(
        st.tuples(
            st.sampled_from([0x1CECFF01, 0x1CEC0201, 0x1CEC0102, 0x1CEB0201, 0x1CEBFF01, GNSS]),
            st.one_of(
                st.binary(max_size=8),
                st.builds(
                    lambda code, rest: bytes([code, *rest]),
                    st.sampled_from([0, 1, 2, 16, 17, 19, 32, 255]),
                    st.lists(st.sampled_from([0, 1, 2, 9, 14, 255]), min_size=7, max_size=7),
                ),
            ),
        ),
        max_size=40,
    )
)
def test_no_bytes_are_too_strange(frames):
    found = log_of(frames).assemble()
    assert found.messages["size"].tolist() == [len(d) // 2 for d in found.messages["data"]]
    assert len(found.messages) + len(found.faults) <= 2 * len(frames)


def test_unlisted_numbers_are_named():
    unlisted = 0x19F21401  # PGN 127508
    assert 127508 not in pgn_names()
    log = log_of(cut(noise(20), "fast packet", unlisted))
    assert log.assemble().unlisted == (127508,)
    assert log.assemble(fast=[127508]).unlisted == ()
    assert whole(log, fast=[127508])[0] == [(127508, 1, TO_ALL, noise(20))]


@pytest.mark.parametrize("name", ["sigrok_nmea2000_snippet.sr", "sigrok_nmea2000_boat.sr"])
def test_every_message_of_the_boat_is_put_together(name):
    """Split each identifier's frames at those with the counter 0, and join what lies between."""
    log = can.read_capture(datasets.path(name)).log
    single = {126992, 129025, 129026, 129539}
    streams = defaultdict(list)
    for number, octets in zip(log.arbitration_id.tolist(), log.data.tolist(), strict=True):
        streams[number].append(octets)
    expected = defaultdict(list)
    for number, frames in streams.items():
        _, pgn, source, to = in_bits(number)
        if pgn in single:
            expected[pgn, source, to] = [bytes(frame) for frame in frames]
            continue
        starts = [row for row, frame in enumerate(frames) if frame[0] % 32 == 0]
        assert starts[0] == 0  # the recording does not begin within a fast packet
        for begin, end in itertools.pairwise([*starts, len(frames)]):
            joined = bytes(itertools.chain.from_iterable(frame[1:] for frame in frames[begin:end]))
            expected[pgn, source, to].append(joined[1 : 1 + joined[0]])
    found = defaultdict(list)
    messages, faults = whole(log)
    for *place, data in messages:
        found[tuple(place)].append(data)
    assert not faults
    assert found == expected
    assert len(messages) == {"s": 44, "b": 7382}[name[len("sigrok_nmea2000_")]]


@pytest.mark.parametrize(("span", "verdict"), [(0.0, "not seen"), (100.0, "missing")])
def test_a_log_without_a_whole_message_is_compared(span, verdict):
    stray = cut(noise(20), "BAM", DM1)[1:2] * 2
    found = can.compare(MessageSet([message(20, "BAM", DM1, period=1.0)]), log_of(stray, [0, span]))
    assert found.table()["verdict"].tolist() == [verdict]


def test_tables_show_the_parts_of_long_identifiers():
    messages = MessageSet([message(43, "fast packet"), Message("s", 3, 8, 1.0)])
    parts = ["priority", "pgn", "source", "destination"]
    expected = [[3, 129029, 1, 255], [None] * 4]
    tables = [messages.table(), can.response_times(messages, 250e3).table()]
    for table in tables:
        shown = table.loc[["m", "s"], parts].astype(object)
        assert shown.where(shown.notna(), None).values.tolist() == expected
    assert log_of(cut(b"", "", GNSS)).table()[parts].values.tolist() == expected[:1]
    assert not {*parts} & {*can.example().table()}
    assert messages.table()["transport"].to_dict() == {"s": "", "m": "fast packet"}
    assert MessageSet.parse(messages.text) == messages


def test_the_listed_numbers_are_legal():
    for pgn, (name, fast) in pgn_names().items():
        _, read, _, to = in_bits(pgn << 8)
        assert read == pgn and name
        assert not fast or pgn >= 0x10000  # fast packets have data page 1
        assert pgn < 0x1FF00  # the others are all fast packets
        assert to in (0, TO_ALL)


# Response times


def test_a_fast_packet_ends_with_its_last_frame():
    """7 frames of 160 bits wait for one of 135 bits and one of 160 bits that just began."""
    low = message(8, "", 0x1DF80501, "low")
    messages = MessageSet([Message("high", 1, 8, 1.0), message(43, "fast packet"), low])
    found = can.response_times(messages, 250e3)
    assert found["m"].response == pytest.approx((160 + 135 + 7 * 160) / 250e3)
    assert found["low"].response == pytest.approx((135 + 7 * 160 + 160) / 250e3)
    assert found["m"].frame_time == 7 * 160 / 250e3
    assert found["high"].blocking == 160 / 250e3  # one frame, not the whole fast packet


def drawn_set(rng):
    """Return random messages of all transports on a bus at 250 kbit/s."""
    messages = {}
    for k in range(rng.integers(2, 9)):
        transport = str(rng.choice([*SIZES]))
        form = 0xEF0500 if transport == "RTS/CTS" else 0xF00000 | int(rng.integers(64)) << 8
        number = int(rng.integers(8)) << 26 | form | int(rng.integers(4))
        least, most = {"": (0, 8), "fast packet": (0, 60)}.get(transport, (9, 70))
        periods = [1.0, 2.0] if least else [0.004, 0.01, 0.025, 0.05]
        messages[number] = message(
            *(int(rng.integers(least, most, endpoint=True)), transport, number, f"m{k}"),
            period=float(rng.choice(periods)),
            jitter=float(rng.choice([0, 0, 1e-3, 7e-3])),
            offset=float(rng.integers(12)) * 5e-4,
        )
    return MessageSet(messages.values())


def test_no_simulation_exceeds_the_bounds():
    rng, ratios = np.random.default_rng(45), defaultdict(list)
    for _ in range(60):
        messages = drawn_set(rng)
        found = can.response_times(messages, 250e3)
        run = can.simulate(messages, 250e3, until=4.2, rng=rng)
        for name, most in (run.table()["max_ms"] / 1e3).items():
            if math.isfinite(found[name].response) and most == most:
                ratios[found[name].message.transport].append(most / found[name].response)
    assert {*ratios} == {*SIZES}
    # No simulated time is longer, and some are close, so that the bounds are not idle.
    for transport, values in ratios.items():
        assert max(values) <= 1 + 1e-9
        assert max(values) > (0.999 if transport in ("", "fast packet") else 0.9)


def test_a_session_waits_for_its_gaps_and_its_sender():
    one = MessageSet([message(30, "BAM", DM1)])
    alone = can.response_times(one, 250e3)["m"].response
    frame = 2 * 160 / 250e3  # one frame of its own may be ahead
    assert 5 * 0.05 < alone <= 6 * (0.05 + frame) - 0.05
    slow = can.response_times(one, 250e3, assumptions=can.Assumptions(gap=0.2))["m"].response
    assert slow == pytest.approx(alone + 5 * 0.15)
    second = message(30, "BAM", DM1 + 0x100, "second")
    both = can.response_times(MessageSet([*one, second]), 250e3)
    assert both["m"].response == both["second"].response > 2 * alone
    other = can.response_times(MessageSet([*one, replaced(second, DM1 + 0x101)]), 250e3)
    assert other["m"].response < 1.1 * alone  # another sender
    # A sender cannot send two sessions of 0.3 s each in 0.5 s.
    busy = MessageSet([replaced(each, each.arbitration_id, period=0.5) for each in (*one, second)])
    assert can.response_times(busy, 250e3)["m"].response == math.inf
    # Sessions have priority 7, whatever that of their PGN.
    assert MessageSet([*one, message(8, "", 0x18FFFFFF, "last")]).names == ("last", "m")


def replaced(one, number, period=None):
    return message(one.dlc, one.transport, number, one.name, period or one.period)


def test_sessions_have_one_order_and_one_phase():
    sessions = MessageSet([message(30, "BAM", DM1)])
    with pytest.raises(ArgumentError, match="priority is fixed"):
        can.audsley(sessions, 250e3)
    found = can.analyse(sessions, [10e3, 250e3])
    assert (found.lowest, found.lowest_in_best_order, found.best.feasible) == (10e3, 10e3, True)
    for messages in (sessions, MessageSet([message(8, "fast packet")])):
        with pytest.raises(ArgumentError, match="single frames"):
            can.response_times(messages, 250e3, offsets=True)
        with pytest.raises(ArgumentError, match="single frames"):
            can.simulate_batch(messages, 250e3, offsets=[[0]], until=1.0)


def test_a_simulation_counts_messages_and_sends_frames():
    run = can.simulate(MessageSet([message(43, "fast packet", period=0.1)]), 250e3, until=0.95)
    assert run.table().loc["m", ["released", "sent", "missed"]].tolist() == [10, 10, 0]
    assert run.table().loc["m", "max_ms"] == pytest.approx(7 * 0.64)
    assert len(run.log()) == 70 and run.log().dlc.tolist() == [8] * 70
    assert run.load == pytest.approx(70 * 640e-6 / 0.95)
    assert run.utilisation().worst_response == pytest.approx(0.1 + 7 * 640e-6)


@pytest.mark.parametrize(("transport", "size"), CASES)
def test_the_log_of_a_simulation_has_the_frames_of_its_messages(transport, size):
    plan = MessageSet([message(size, transport, 0x18EF0501, period=20.0), Message("s", 3, 2, 5.0)])
    run = can.simulate(plan, 250e3, until=59.0)
    log = run.log()
    sent = log.arbitration_id[log.extended].tolist()
    assert sent == 3 * [number for number, _ in cut(bytes(size), transport, 0x18EF0501)]
    messages, faults = whole(log, fast=[0xEF00] if transport == "fast packet" else [])
    to = TO_ALL if transport == "BAM" else 5
    assert (messages, faults) == (3 * [(0xEF00, 1, to, bytes(size))], ())
    if transport:
        assert can.compare(plan, log).ok


# Gateways


def bus(rng, name, forwarded):
    numbers = rng.choice(400, 6, replace=False)
    periods = rng.choice([0.005, 0.01, 0.02], 6)
    return MessageSet(
        Message(
            f"{name}{k}" if k else forwarded,
            int(number),
            int(rng.integers(9)),
            0.02 if k == 0 else float(period),
            deadline=1.0,
            offset=float(rng.integers(3)) * 1e-3,
        )
        for k, (number, period) in enumerate(zip(numbers, periods, strict=True))
    )


def test_no_simulated_chain_exceeds_the_bound_of_a_gateway():
    rng, closest, delay = np.random.default_rng(5), 0.0, 3e-3
    for _ in range(60):
        first, second = bus(rng, "a", "speed"), bus(rng, "b", "rpm")
        before = can.response_times(first, 125e3)
        found = can.gateway(before, second, 125e3, {"speed": "rpm"}, delay=delay)
        events = can.simulate(first, 125e3, until=4.0).events()
        events = events[(events["message"] == "speed") & (events["outcome"] == "sent")]
        arrival = (events["arrival_ms"].to_numpy() * 1e6).round().astype(np.int64)
        end = (events["end_ms"].to_numpy() * 1e6).round().astype(np.int64)
        queued = np.maximum.accumulate(end + rng.choice([0, int(delay * 1e9)], len(end)))
        # The other messages of the second bus, and the forwarded frames when they are queued.
        horizon, parts, length = 4 * 10**9, [], second.lengths().astype(np.int64) * 8000
        for one in second:
            step, begin = round(one.period * 1e9), round(one.offset * 1e9)
            times = queued if one.name == "rpm" else np.arange(begin, horizon, step)
            parts.append(np.r_[times, horizon * 2])
        starts = send(
            np.concatenate(parts), np.r_[0, np.cumsum([*map(len, parts)])], length, horizon
        )
        rank = second.names.index("rpm")
        at = sum(map(len, parts[:rank]))
        sent = starts[at : at + len(queued)]
        ends = (sent + length[rank] - arrival)[sent >= 0]
        assert ends.max() / 1e9 <= found["rpm"].response
        closest = max(closest, ends.max() / 1e9 / found["rpm"].response)
    assert closest > 0.75  # the bound is not idle


def test_a_gateway_forwards_messages_with_a_bound():
    one = can.response_times(MessageSet([Message("a", 1, 8, 0.1)]), 125e3)
    same = MessageSet([Message("b", 1, 8, 0.1, jitter=5.0)])
    chained = can.gateway(one, same, 125e3, {"a": "b"}, delay=0)
    assert chained["b"].response == pytest.approx(2 * 135 / 125e3)
    assert can.gateway(chained, same, 125e3, {"b": "b"}, delay=1.0)["b"].response > 1
    with pytest.raises(ArgumentError, match=r"period of 'b', 0\.2 s"):
        can.gateway(one, same.replace("b", period=0.2), 125e3, {"a": "b"}, delay=0)
    with pytest.raises(ArgumentError, match="name is 'c'"):
        can.gateway(one, same, 125e3, {"a": "c"}, delay=0)
    with pytest.raises(ArgumentError, match="delay"):
        can.gateway(one, same, 125e3, {"a": "b"}, delay=-1)
    queued = can.response_times(same, 125e3, assumptions=can.Assumptions(own_jitter=False))
    with pytest.raises(ArgumentError, match="they must include the jitter"):
        can.gateway(queued, same, 125e3, {"b": "b"}, delay=0)
    late = can.response_times(MessageSet([Message("a", 1, 8, 1e-4)]), 125e3)
    with pytest.raises(ArgumentError, match="response of inf s"):
        can.gateway(late, same, 125e3, {"a": "b"}, delay=0)


# Plans and logs


def repeated(frames_of, number, period):
    rows = [
        (k * period + at * 1e-3, frame)
        for k in range(number)
        for at, frame in enumerate(frames_of(k))
    ]
    return log_of([frame for _, frame in rows], [time for time, _ in rows])


def test_long_messages_are_compared_as_a_whole():
    plan = MessageSet([message(43, "fast packet", period=0.2), message(30, "BAM", DM1, "DM1", 0.2)])

    def frames(k, size=43):
        first = cut(noise(size), "fast packet", 0x19F80507, k % 8)  # other priority and source
        return first + cut(noise(30), "BAM", 0x18FECA03)

    found = can.compare(plan, repeated(frames, 40, 0.2))
    assert found.ok, found.table()
    assert found.table()["frames"].to_dict() == {"m": 40, "DM1": 40}
    shorter = can.compare(plan, repeated(lambda k: frames(k, 40), 40, 0.2))
    assert shorter.table()["verdict"].to_dict() == {"m": "other length", "DM1": "as planned"}
    broken = can.compare(plan, repeated(lambda k: frames(k)[1:], 40, 0.2))
    assert broken.table()["verdict"].to_dict() == {"m": "missing", "DM1": "as planned"}


def test_a_planned_source_is_recognised_with_any_priority():
    def one(number, period):
        return message(30, "BAM", number, f"{number:08X}", period)

    plan = MessageSet([one(DM1, 0.2), one(DM1 + 3, 1.0), message(8, "", 0x0CF00403, "EEC1", 0.2)])
    log = repeated(
        lambda k: (
            cut(noise(30), "BAM", DM1)
            + (cut(noise(30), "BAM", DM1 + 3) if k % 5 == 0 else [])
            + cut(noise(8), "", 0x18F00403)
        ),
        50,
        0.2,
    )
    found = can.compare(plan, log, pgn=True)
    assert found.ok, found.table()
    assert found.table()["frames"].tolist() == [50, 50, 10]
    assert can.compare(plan, log).table()["verdict"]["EEC1"] == "missing"


DBC = """VERSION ""

BU_: GPS

BO_ 2381841662 Position: 43 GPS
 SG_ Count : 0|8@1+ (1,0) [0|250] "" Vector__XXX

BO_ 2566834942 Faults: 30 GPS
 SG_ Lamp : 0|8@1+ (1,0) [0|250] "" Vector__XXX

BO_ 2565801982 Direct: 20 GPS
 SG_ Key : 0|8@1+ (1,0) [0|250] "" Vector__XXX

BA_DEF_ BO_ "GenMsgCycleTime" INT 0 65535;
BA_DEF_DEF_ "GenMsgCycleTime" 1000;
BA_DEF_ "ProtocolType" STRING ;
BA_DEF_DEF_ "ProtocolType" "";
"""


def test_a_database_names_the_transport(tmp_path):
    pytest.importorskip("cantools")
    file = tmp_path / "ship.dbc"
    for mark, expected in (
        ("J1939", {"Position": "BAM", "Faults": "BAM", "Direct": "RTS/CTS"}),
        ("NMEA2000", dict.fromkeys(("Position", "Faults", "Direct"), "fast packet")),
    ):
        file.write_text(DBC + f'BA_ "ProtocolType" "{mark}";\n')
        assert {m.name: m.transport for m in can.read_messages(file)} == expected
    file.write_text(DBC)
    with pytest.raises(ValueError, match=r"has 43 bytes; .* marked as J1939 or NMEA 2000"):
        can.read_messages(file)
