import numpy as np
import pytest

from shipnet import datasets
from shipnet.errors import ArgumentError, InputError
from shipnet.modbus import SerialLine
from shipnet.remote_control import read_capture
from tests.support import tolerance


def recording(name):
    return datasets.path(f"sigrok_uart_{name}")


HELLO = b"Hello World!\r\n" * 4
ODD = b"ASU1\x8164\n"


@pytest.mark.parametrize(
    ("name", "rate", "character", "data", "errors", "glitches"),
    [
        ("8e1_115200.sr", 115200, "8E1", HELLO, 0, 0),
        ("8n1_1200.sr", 1200, "8N1", HELLO, 0, 0),
        ("8n1_19200.sr", 19200, "8N1", HELLO, 0, 0),
        ("no_errors.sr", 4800, "8N1", b"AMPEL 64\n", 0, 0),
        ("frame_errors.sr", 4800, "8N1", ODD, 3, 1),
        ("gps.sr", 9600, "8N1", None, 0, 0),
        ("voltage.npz", 10678, "8N2", None, 2, 1),
    ],
)
def test_recorded_lines_are_read(name, rate, character, data, errors, glitches):
    capture = read_capture(recording(name))
    assert capture.bit_rate == pytest.approx(rate, rel=2e-3)
    assert (capture.character, capture.glitches) == (character, glitches)
    assert (capture.table()["error"] == "FormError").sum() == errors
    assert (capture.table()["error"] == "ParityError").sum() == 0
    assert data in (None, capture.data)
    if name == "voltage.npz":
        right = capture.table().query("error == 'ok'")["value"]
        assert set(right) == {0, *range(0x1A, 0x21)}  # as its author sent them


def test_sentences_of_a_gps_receiver_have_the_right_checksums():
    # A check independent of framing: NMEA 0183 ends each sentence with the XOR of its characters.
    lines = read_capture(recording("gps.sr")).data.split(b"\r\n")
    sentences = [line for line in lines if line[:1] == b"$" and line[-3:-2] == b"*"]
    assert len(sentences) > 15
    for line in sentences:
        body, check = line[1:].split(b"*")
        assert np.bitwise_xor.reduce(np.frombuffer(body, np.uint8)) == int(check, 16)


def test_one_character_does_not_determine_the_form_and_a_stated_form_is_used():
    given = read_capture(recording("glitch.sr"), 115200, "8N1")
    assert (given.data, given.glitches, given.character) == (b"\x4f", 1, "8N1")
    assert given.measured_rate == pytest.approx(115200, rel=0.03)


# Our own senders --------------------------------------------------------------------------------


def saved(tmp_path, data, line, per_bit, off=0.0, gap=None, turned=False, seed=1):
    """Write a logic analyser's recording of a sender with an inaccurate clock."""
    sender = SerialLine(line.bit_rate * (1 + off), line.character)
    rng = np.random.default_rng(seed)
    parts = [data[k : k + 8] for k in range(0, len(data), 8)]
    gaps = [float(rng.random() * 9 / line.bit_rate) for _ in parts] if gap is None else gap
    wave = sender.waveform(parts, gap=gaps, start=20 / line.bit_rate)
    dt = 1 / (line.bit_rate * per_bit)
    times = np.arange(0, wave.time[-1] + 20 / line.bit_rate, dt)
    level = wave.level[np.searchsorted(wave.time, times, side="right") - 1].astype(np.uint8)
    np.savez(tmp_path / "uart.npz", u=1 - level if turned else level, dt=dt)
    return tmp_path / "uart.npz"


SOME = np.random.default_rng(5).bytes(400)


@pytest.mark.parametrize("character", ["8N1", "8N2", "8E1", "8O1", "8E2", "8O2"])
@pytest.mark.parametrize(("off", "turned"), [(-0.07, False), (0.0, True), (0.07, False)])
def test_rate_and_form_of_a_sender_are_found(character, off, turned, tmp_path):
    line = SerialLine(9600, character)
    gaps = [0.0] * 49 + [0.004]
    capture = read_capture(saved(tmp_path, SOME, line, 20, off, gap=gaps, turned=turned))
    assert capture.data == SOME
    assert (capture.table()["error"] == "ok").all()
    assert capture.character == character
    assert capture.bit_rate == pytest.approx(9600 * (1 + off), rel=tolerance("uart.rate"))


def test_seven_data_bits_are_detected_and_five_are_read_if_stated(tmp_path):
    text = b"Engine 3 ahead, slow. " * 9
    for form, bits, parity in (("7E1", 7, 0), ("7O1", 7, 1), ("5N1", 5, None)):
        levels = [1] * 30
        for byte in text:
            own = [byte >> k & 1 for k in range(bits)]
            even = [] if parity is None else [sum(own) & 1 ^ parity]
            levels += [0, *own, *even, 1]
        np.save(tmp_path / "a.npy", np.repeat([*levels, *[1] * 30], 8))
        given = form if bits == 5 else None
        capture = read_capture(
            tmp_path / "a.npy", 9600 if given else None, given, sample_interval=1 / 9600 / 8
        )
        assert (capture.character, capture.waveform) == (form, None)
        assert capture.data == bytes(byte & (1 << bits) - 1 for byte in text)
        assert capture.bit_rate == pytest.approx(9600, rel=1e-3)


@pytest.mark.parametrize("character", ["8N1", "8E1"])
def test_a_receiver_at_the_nominal_rate_fails_at_the_limit_of_the_formula(character, tmp_path):
    line = SerialLine(9600, character)
    low, high = line.clock_tolerance()
    # An edge is recorded up to one sample late: 1/50 bit, over 9.5 or 10.5 bits to the stop bit.
    room = 1.5 / 50 / (line.character_bits - 0.5)
    for off, right in (
        (low + room, True),
        (low - room, False),
        (high - room, True),
        (high + room, False),
    ):
        file = saved(tmp_path, SOME, line, 50, off)
        capture = read_capture(file, 9600, character)
        assert (capture.data == SOME and (capture.table()["error"] == "ok").all()) == right
        assert capture.measured_rate == pytest.approx(9600 * (1 + off), rel=tolerance("uart.rate"))


def test_parity_errors_are_named(tmp_path):
    file = saved(tmp_path, SOME, SerialLine(9600, "8E1"), 16)
    capture = read_capture(file, 9600, "8O1")
    assert set(capture.table()["error"]) == {"ParityError"}
    assert capture.data == SOME


def test_glitches_are_removed_and_counted(tmp_path):
    file = saved(tmp_path, SOME, SerialLine(9600, "8N1"), 50)
    held = np.load(file)
    level = held["u"].copy()
    places = np.random.default_rng(3).choice(np.arange(0, len(level) - 50, 400), 60, replace=False)
    for place in places:
        if len(set(level[place - 9 : place + 19])) == 1:
            level[place : place + 5] ^= 1
    count = (np.diff(level.astype(int)) != 0).sum() - (np.diff(held["u"].astype(int)) != 0).sum()
    assert count > 60
    np.savez(file, u=level, dt=held["dt"])
    capture = read_capture(file)
    assert (capture.data, capture.glitches) == (SOME, count // 2)
    assert str(count // 2) + " glitches" in repr(capture)


# Signals that are not serial --------------------------------------------------------------------


def refused(file, *arguments, **options):
    with pytest.raises(InputError) as refusal:
        read_capture(file, *arguments, **options)
    return str(refusal.value)


def test_a_record_of_too_many_edges_is_refused(monkeypatch):
    monkeypatch.setattr("shipnet.remote_control.serial_capture._EDGES", 100)
    assert "more than 100 changes of level" in refused(recording("gps.sr"))


def test_silence_noise_and_other_signals_are_read(tmp_path):
    rng = np.random.default_rng(1)
    np.save(tmp_path / "a.npy", np.ones(1000))
    assert "too few changes" in refused(tmp_path / "a.npy", sample_interval=1e-6)
    silent = read_capture(tmp_path / "a.npy", 9600, sample_interval=1e-6)
    assert (len(silent.table()), silent.data) == (0, b"")
    for levels in (rng.integers(0, 2, 50_000), np.arange(9000) // 9 % 2, np.arange(900) % 2):
        np.save(tmp_path / "a.npy", levels)
        for rate in (None, 9600):
            try:
                read_capture(tmp_path / "a.npy", rate, sample_interval=1e-5).table()
            except InputError as refusal:
                assert "samples per bit" in str(refusal)
    assert "2 are needed" in refused(tmp_path / "a.npy", 1e6, sample_interval=1e-5)
    for options in ({"character": "8X1"}, {"character": 8}, {"bit_rate": 1}, {"bit_rate": np.nan}):
        with pytest.raises(ArgumentError):
            read_capture(recording("gps.sr"), **options)
    assert "no channel 'RX'" in refused(recording("gps.sr"), channel="RX")
