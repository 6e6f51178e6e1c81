import io
import zipfile

import numpy as np
import pytest

from shipnet import can, datasets
from shipnet.can import capture as module
from shipnet.can.capture import read_capture, read_rows
from shipnet.can.lengths import measure_frames
from shipnet.errors import ArgumentError, FrameError, InputError
from tests.support import tolerance

BOAT = datasets.path("sigrok_nmea2000_boat.sr")
SNIPPET = datasets.path("sigrok_nmea2000_snippet.sr")
BOARD = {name: datasets.path(f"sigrok_can_board_{name}.sr") for name in ("25", "75", "extended")}


@pytest.fixture(scope="module")
def boat():
    return read_capture(BOAT)


def some_frames(n, seed):
    rng = np.random.default_rng(seed)
    frames = []
    for _ in range(n):
        extended = bool(rng.random() < 0.5)
        data = rng.choice([rng.bytes(8), bytes(8), b"\xff" * 8])[: rng.integers(0, 9)]
        number = int(rng.integers(0, 2**29 if extended else 2**11))
        frames.append(
            can.Frame(number, bytes(data), extended, bool(not data and rng.random() < 0.3))
        )
    return frames


def edges_of(frames, per_bit, off=0.0, seed=1, flip=False, gap=3, jitter=0.01, late=0.02):
    """Return the samples at which a line changes: senders that are fast or slow by `off`."""
    rng, at, times = np.random.default_rng(seed), 20.0, []
    for frame in frames:
        bits = np.array([int(bit) for bit in frame.bits], dtype=np.int8)
        if flip:
            bits[rng.integers(1, len(bits) - 12)] ^= 1
        bits = np.concatenate([[1], bits, [1]])
        changes = np.flatnonzero(np.diff(bits))
        bit_time = per_bit * (1 + rng.choice([-off, off]))
        lag = late * per_bit * bits[changes + 1] + rng.normal(0, jitter * per_bit, len(changes))
        times.append(at + changes * bit_time + lag)
        at += len(frame.bits) * bit_time + (gap + rng.random() + rng.integers(0, 40)) * per_bit
    samples = np.ceil(np.concatenate(times)).astype(int)
    return samples, int(at) + 20


def levels_of(frames, per_bit, **options):
    changes, total = edges_of(frames, per_bit, **options)
    flips = np.zeros(total, dtype=np.uint8)
    np.add.at(flips, changes, 1)
    return 1 - (np.cumsum(flips) & 1).astype(np.uint8)


def session(levels, rate="500 kHz", unit=1, split=1, metadata="", names=None):
    """Return a session of sigrok; `levels` may contain several channels, one bit per channel."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        probes = names or {1: "CAN"}
        archive.writestr(
            "metadata",
            f"[device 1]\ncapturefile=logic-1\nsamplerate={rate}\nunitsize={unit}\n"
            + "".join(f"probe{k}={name}\n" for k, name in probes.items())
            + metadata,
        )
        for k, part in enumerate(np.array_split(np.asarray(levels), split), start=1):
            name = "logic-1" if split == 1 else f"logic-1-{k}"
            archive.writestr(name, part.astype(f"<u{unit}").tobytes())
    return stream.getvalue()


@pytest.fixture
def save(tmp_path):
    def save(content, name="bus.sr"):
        file = tmp_path / name
        if name.endswith(".npy"):
            np.save(file, content)
        else:
            file.write_bytes(content if isinstance(content, bytes) else content.encode())
        return file

    return save


def read_back(capture):
    """Return the correct frames of a capture as frames."""
    log = capture.log
    size = np.where(log.remote, 0, np.minimum(log.dlc, 8))
    return [
        can.Frame(int(number), bytes(data[:n]), bool(extended), bool(remote), int(dlc))
        for number, data, n, extended, remote, dlc in zip(
            log.arbitration_id, log.data, size, log.extended, log.remote, log.dlc, strict=True
        )
    ]


# Real lines -------------------------------------------------------------------------------------


def test_every_frame_of_the_boat_is_right(boat):
    assert boat.bit_rate == 250e3
    table = boat.table()
    assert len(table) == 19474
    assert (table["error"] == "ok").all()
    assert boat.log.faults == ()
    # Two checks that do not depend on the CRC: messages of 1 Hz occur once per second, ...
    counts = table["arbitration_id"].value_counts()
    assert counts[["0x0DF01000", "0x19FA0300"]].tolist() == [345, 345]
    # ... and the frames of messages in several parts are numbered without a gap.
    assert fast_packets(boat.log) == (1863, 13955, 0)


def test_the_labels_of_the_board_are_not_bus_loads():
    captures = {name: read_capture(file) for name, file in BOARD.items()}
    assert {name: len(capture.log) for name, capture in captures.items()} == {
        "25": 14,
        "75": 107,
        "extended": 5,
    }
    assert all(not capture.log.faults for capture in captures.values())
    starts = {name: np.median(np.diff(captures[name].table()["start_s"])) for name in ("25", "75")}
    assert starts["25"] / starts["75"] == pytest.approx(8, rel=1e-3)
    loads = {name: captures[name].loads()["load"] for name in ("25", "75")}
    assert loads["25"]["with intermission"] < 0.004
    assert loads["75"]["with intermission"] < 0.03
    assert read_back(captures["extended"])[0].extended


def fast_packets(log):
    """Return the numbers of messages with several frames, of their frames, and of gaps in them."""
    messages = frames = breaks = 0
    for number in (0x09F20101, 0x0DF80500, 0x19FA0400, 0x1DFF1601, 0x15FF1001):
        frames_of_number = log.data[log.arbitration_id == number].astype(int)
        counter, position = frames_of_number[:, 0] >> 5, frames_of_number[:, 0] & 31
        begins = np.flatnonzero(position == 0)
        # The first frame gives the number of bytes: 6 in this frame, 7 in each of the others.
        size = 1 + -(-(frames_of_number[begins, 1] - 6) // 7)
        messages, frames = messages + len(begins), frames + len(frames_of_number)
        breaks += int((np.diff(begins) != size[:-1]).sum()) + int(begins[0] != 0)
        same = np.diff(position) == 1
        breaks += int((~same & (position[1:] != 0)).sum() + (np.diff(counter)[same] != 0).sum())
        breaks += int((np.diff(counter[begins]) % 8 != 1).sum())
    return messages, frames, breaks


def test_bits_on_the_line_are_those_of_the_frames(boat):
    table, log = boat.table(), boat.log
    lengths = measure_frames(
        log.arbitration_id, log.data, log.dlc, extended=log.extended, remote=log.remote
    )
    assert (table["bits"] + 3 == lengths).all()
    frames = read_back(boat)
    assert [frame.stuff_bits for frame in frames[:500]] == table["stuff_bits"][:500].tolist()
    loads = boat.loads()
    assert loads["bits"]["with intermission"] == lengths.sum()
    assert loads["load"]["with intermission"] == pytest.approx(
        lengths.sum() / (250e3 * 345.10848), rel=1e-9
    )


def test_the_detected_rate_gives_the_same_frames_as_the_stated_rate():
    for file, rate in [(SNIPPET, 250e3), *((file, 125e3) for file in BOARD.values())]:
        detected, stated = read_capture(file), read_capture(file, rate)
        assert detected.bit_rate == rate
        assert detected.table().equals(stated.table())


# An independent check ---------------------------------------------------------------------------


def test_rows_are_read_like_single_frames():
    rng = np.random.default_rng(7)
    frames = some_frames(1500, 3)
    line = np.ones((176, len(frames)), dtype=np.uint8)
    lengths = rng.integers(1, 180, len(frames))
    lengths[rng.random(len(frames)) < 0.8] = 176
    for column, frame in enumerate(frames):
        line[: len(frame.bits), column] = [int(bit) for bit in frame.bits]
        kind = rng.integers(0, 4)
        if kind == 1:
            line[rng.integers(1, len(frame.bits)), column] ^= 1
        elif kind == 2:
            start = rng.integers(1, 120)
            line[start : start + rng.integers(2, 8), column] = rng.integers(0, 2)
        elif kind == 3:
            line[1:, column] = rng.integers(0, 2, 175)
    rows = read_rows(line, lengths)
    seen = set()
    for column in range(len(frames)):
        text = "".join(map(str, line[: lengths[column], column].tolist()))
        try:
            frame, code, position = can.decode(text), 0, -1
        except FrameError as fault:
            frame, code = None, fault.code
            words = str(fault).replace("before bit", "bit").split("bit ")[1]
            position = int("".join(c for c in words.split(",")[0] if c.isdigit()))
        # A frame is complete without the last bit of end of frame, which receivers ignore.
        if code == 1 and position == rows.tail[column] + 9:
            continue
        assert (rows.error[column], rows.place[column]) == (code, position), text
        seen.add(code)
        if frame:
            assert frame.data == rows.data[column].tobytes()[: len(frame.data)]
            assert (frame.arbitration_id, frame.dlc) == (rows.number[column], rows.dlc[column])
            assert (frame.extended, frame.remote) == (rows.extended[column], rows.remote[column])
            assert frame.stuff_bits == rows.stuffed[column]
    assert seen == {0, 1, 12, 13, 14, 15}


@pytest.mark.parametrize(
    ("per_bit", "off", "gap"),
    [(2, 0.001, 3), (2, 0.003, 2), (3, 0.005, 2), (8, 0.015, 2), (100, 0.0158, 2)],
)
def test_senders_that_are_fast_and_slow_are_read(per_bit, off, gap, save):
    # After two bits of intermission the next node may start.
    frames = some_frames(300, 11)
    capture = read_capture(
        save(session(levels_of(frames, per_bit, off=off, gap=gap), rate=f"{per_bit * 125} kHz"))
    )
    assert capture.bit_rate == pytest.approx(125e3, rel=1e-3)
    assert (capture.table()["error"] == "ok").all()
    assert read_back(capture) == frames


def test_frames_of_deviating_clocks_are_read_correctly_or_listed(save):
    frames = some_frames(500, 5)
    capture = read_capture(save(session(levels_of(frames, 2, off=0.005), rate="250 kHz")), 125e3)
    faults = (capture.table()["error"] != "ok").sum()
    assert 0 < faults == len(capture.log.faults) < 50
    assert set(read_back(capture)) <= set(frames)


def test_few_damaged_frames_pass_as_correct_and_most_of_them_are_marked(save):
    taken = {}
    for per_bit in (2, 8):
        frames = some_frames(3000, per_bit)
        levels = levels_of(frames, per_bit, off=0.002, flip=True)
        capture = read_capture(save(session(levels, rate=f"{per_bit * 125} kHz")), 125e3)
        right = capture.table()["error"] == "ok"
        assert 2 * capture.table()["second_reading"][right].sum() >= right.sum()
        taken[per_bit] = right.mean()
    assert taken[2] < tolerance("can.flipped")
    assert taken[8] == 0


def test_other_bit_rates_are_found(save):
    for rate, per_bit in ((33333.3, 12), (47.619e3, 21), (83333.3, 6), (615384.6, 13)):
        frames = some_frames(80, 9)
        content = session(
            levels_of(frames, per_bit, off=0.001), rate=f"{rate * per_bit / 1e3:.6f} kHz"
        )
        capture = read_capture(save(content))
        assert capture.bit_rate == pytest.approx(rate, rel=2e-3)
        assert read_back(capture) == frames


# File formats -------------------------------------------------------------------------------------


def test_the_same_frames_come_from_every_form(save, tmp_path):
    frames = some_frames(20, 21)
    levels = levels_of(frames, 4, jitter=0, late=0)
    times = np.arange(len(levels)) * 1e-6
    changed = np.append(True, np.diff(levels) != 0)
    wide = levels.astype(np.uint16) << 9

    def text(times, levels):
        return "".join(f"{t:.9f},{u}\n" for t, u in zip(times, levels, strict=True))

    files = [
        save(session(levels, "1 MHz"), "a.sr"),
        save(session(levels, "1 MHz", split=3), "b.sr"),
        save(session(wide, "1 MHz", unit=2, names={1: "idle", 10: "CAN RX"}), "c.sr"),
        save("Time (s),CAN\n" + text(times, levels), "d.csv"),
        save(
            "Time [s],Channel 0\n"
            + text(times[changed], levels[changed])
            + f"{times[-1] + 5e-5:.9f},1\n",
            "e.csv",
        ),
        save(
            "; CSV, generated by libsigrok\n; Channels (1/8): CAN\n; Samplerate: 1 MHz\nlogic\n"
            + "".join(f"{u}\n" for u in levels),
            "f.csv",
        ),
    ]
    np.savez_compressed(tmp_path / "g.npz", u=levels.astype(bool), dt=1e-6)
    np.savez_compressed(tmp_path / "h.npz", t=times, v=3.3 * levels)
    for file in [*files, tmp_path / "g.npz", tmp_path / "h.npz"]:
        capture = read_capture(file)
        assert read_back(capture) == frames, file.name
        assert capture.bit_rate == 250e3, file.name
        assert capture.duration == pytest.approx(len(levels) * 1e-6, abs=1e-4)
    named = read_capture(files[2], channel="can rx")
    assert (len(named.log), named.channel) == (20, "CAN RX")
    assert len(read_capture(files[2], 250e3, channel="1").log) == 0
    assert len(read_capture(save(levels, "i.npy"), sample_interval=1e-6).log) == 20


@pytest.mark.parametrize("rate", [250e3, 1e6])
def test_voltages_of_a_bus_are_read(rate, tmp_path, monkeypatch):
    monkeypatch.setattr("shipnet.can.segment._STEPS", 1)
    frames = some_frames(4, int(rate))
    bits = "".join("1" * 11 + frame.bits for frame in frames) + "1" * 12
    line = can.Segment(40, 4).send({1: bits}, rate)
    rng = np.random.default_rng(2)
    for per_bit in (4, 20):
        dt = 1 / (rate * per_bit)
        times = np.arange(0, line.t[-1], dt)
        for node in (1, 4):
            volts = np.interp(times, line.t, line.v[line.row(node)])
            volts += rng.normal(0, 0.1, len(times))
            for form in (volts, 2.5 - volts / 2, 2.5 + volts / 2):  # the difference, CAN_L, CAN_H
                np.savez(tmp_path / "bus.npz", u=form, dt=dt)
                capture = read_capture(tmp_path / "bus.npz")
                assert capture.bit_rate == rate
                assert read_back(capture) == frames


@pytest.mark.parametrize("per_bit", [4, 20])
def test_noise_of_a_seventh_of_the_swing_changes_no_bit(per_bit, tmp_path):
    frames = some_frames(40, 3)
    bits = "1" * 15 + "".join(frame.bits + "1" * 12 for frame in frames)
    volts = np.repeat([2.0 if bit == "0" else 0.0 for bit in bits], per_bit)
    volts += np.random.default_rng(1).normal(0, 0.3, len(volts))
    np.savez(tmp_path / "bus.npz", u=volts, dt=1 / (250e3 * per_bit))
    assert read_back(read_capture(tmp_path / "bus.npz")) == frames


def test_blocks_of_any_size_give_the_same_frames(monkeypatch):
    whole = read_capture(SNIPPET).table()
    for size in (2**10 + 1, 2**22):
        monkeypatch.setattr("shipnet.line.scope_file._BLOCK", size)
        monkeypatch.setattr(module, "CHUNK", 10)
        assert read_capture(SNIPPET).table().equals(whole)


def test_a_record_may_begin_and_end_anywhere(save):
    frames = some_frames(3, 2)
    levels = levels_of(frames, 8)
    for cut in range(30, len(levels) - 60, 37):
        for part in (levels[cut:], levels[:cut]):
            capture = read_capture(save(session(part, "1 MHz")), 125e3)
            table = capture.table()
            assert set(read_back(capture)) <= set(frames)
            assert set(table["error"]) <= {"ok", "LengthError"}
            assert (table["error"] != "ok").sum() <= 1


# What is not a bus --------------------------------------------------------------------------------


def test_a_silent_line_has_no_frames(save):
    for level in (0, 1):
        file = save(session(np.full(1000, level)))
        capture = read_capture(file, 125e3)
        assert (len(capture.table()), len(capture.log), capture.loads()["load"].max()) == (0, 0, 0)
        assert "too few changes of level to find the bit rate" in refused(file)


def refused(file, *arguments, **options):
    with pytest.raises(InputError) as refusal:
        read_capture(file, *arguments, **options)
    return str(refusal.value)


def test_noise_and_other_signals_are_read_as_faults_only(save):
    rng = np.random.default_rng(4)
    for levels in (
        rng.integers(0, 2, 100_000),
        np.arange(50_000) % 2,
        np.arange(50_000) // 7 % 2,
        np.repeat(rng.integers(0, 2, 20_000), rng.integers(1, 60, 20_000)),
    ):
        for rate in (None, 125e3):
            capture = read_capture(save(session(levels)), rate)
            assert (capture.table()["error"] == "ok").mean() < 0.01 or not len(capture.table())
            capture.loads()
    for rate in (250e3, 1e6):
        assert "samples per bit" in refused(save(session(levels, "400 kHz")), rate)


def test_can_fd_and_error_flags_are_named(save):
    frame = can.Frame(0x123, b"ship")
    bits = frame.bits
    flexible = bits[:14] + "1" + bits[15:]
    flag = bits[:40] + "000000" + "1" * 11
    silent = bits[:-9] + "1" + bits[-8:]
    line = "1" * 20 + ("1" * 11).join([bits, flexible, flag, silent, bits]) + "1" * 20
    levels = np.repeat([int(bit) for bit in line], 8)
    table = read_capture(save(session(levels, "1 MHz"))).table()
    assert table["error"].tolist()[0] == "ok"
    assert {"FormError", "StuffError", "AcknowledgeError"} <= set(table["error"])
    lonely = table[table["error"] == "AcknowledgeError"].iloc[0]
    assert (lonely["arbitration_id"], lonely["data"]) == ("0x123", "73686970")
    assert (
        table["arbitration_id"].isna().sum()
        == (table["error"].isin(["FormError", "StuffError"])).sum()
    )


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (session([0, 1] * 50)[:-40], "not a complete .sr file"),
        (session([0, 1] * 50, rate="fast"), "it has no times"),
        (session([1]), "number of samples is 1"),
        (session([0, 1] * 50, metadata="unitsize=3\n"), "its unitsize is 3; expected 1, 2, 4 or 8"),
        (session([0, 1] * 50, metadata="capturefile=other\n"), "a part of other is missing"),
        (session(np.zeros(20_000_000)), "it unpacks to 20000000 bytes of logic; at most 4194304"),
    ],
)
def test_bad_sessions_are_refused(content, message, save, monkeypatch):
    monkeypatch.setattr("shipnet.line.scope_file.MOST_LOGIC_PER_BYTE", 1)
    assert message in refused(save(content), 125e3)


def test_bad_arguments_are_refused(save, tmp_path, monkeypatch):
    assert "no channel 'x'; its channels are" in refused(SNIPPET, channel="x")
    assert "No such file" in refused(tmp_path / "none.sr")
    for rate in (0, -1, np.nan, 2e6):
        with pytest.raises(ArgumentError, match="bit_rate"):
            read_capture(SNIPPET, rate)
    with pytest.raises(ArgumentError, match="sample_interval"):
        read_capture(SNIPPET, sample_interval=0)
    monkeypatch.setattr(module, "_FRAMES", 112)
    assert "it has more than 112 frames" in refused(SNIPPET)
    monkeypatch.setattr("shipnet.line.scope_file.MOST_EDGES", (100, 100))
    assert "more than 100 changes of level" in refused(SNIPPET)
