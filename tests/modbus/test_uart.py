import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shipnet.errors import ArgumentError, FormError, ParityError
from shipnet.modbus.uart import SerialLine, Waveform, _line_bits

FORMATS = ["8N1", "8N2", "8E1", "8E2", "8O1", "8O2"]
LINES = st.builds(SerialLine, st.sampled_from([1200, 9600, 115200, 1e6]), st.sampled_from(FORMATS))
EVERY_BYTE = bytes(range(256))


@pytest.mark.parametrize(
    ("character", "byte", "bits"),
    [
        # Written by hand: start, least significant bit first, parity, stop.
        ("8N1", 0x53, "0 11001010 1"),
        ("8N2", 0x53, "0 11001010 11"),
        ("8E1", 0x53, "0 11001010 0 1"),
        ("8O1", 0x53, "0 11001010 1 1"),
        ("8E1", 0x01, "0 10000000 1 1"),
        ("8O1", 0x01, "0 10000000 0 1"),
        ("8E2", 0x80, "0 00000001 1 11"),
        ("8E1", 0x00, "0 00000000 0 1"),
        ("8O1", 0xFF, "0 11111111 1 1"),
    ],
)
def test_known_characters_have_the_bits_written_by_hand(character, byte, bits):
    row = _line_bits(bytes([byte]), SerialLine(9600, character))[0]
    assert "".join(map(str, row)) == bits.replace(" ", "")


@given(data=st.binary(min_size=1, max_size=20), serial=LINES)
def test_a_waveform_lasts_as_long_as_frames_and_silences(data, serial):
    sent = serial.waveform([data, data], gap=0.002, start=0.001)
    time, level, characters = sent.time, sent.level, sent.decode()
    assert characters.data == 2 * data and not characters.code.any()
    frame = len(data) * serial.character_time
    assert time[0] == 0 and time[-1] == pytest.approx(0.001 + 2 * frame + 2 * 0.002)
    assert time[1] == pytest.approx(0.001)
    assert (np.diff(time) > 0).all() and (np.diff(level)[:-1] != 0).all()
    places = np.arange(len(data)) * serial.character_time
    expected = np.append(0.001 + places, 0.003 + frame + places)
    assert characters.time == pytest.approx(expected)


def test_a_scope_trace_is_read_like_its_corners():
    line = SerialLine(9600)
    sent = line.waveform(EVERY_BYTE)
    samples = np.arange(0, sent.time[-1], 1 / (9600 * 20))
    volts = sent.level[np.searchsorted(sent.time, samples, side="right") - 1]
    volts = volts + np.random.default_rng(2024).normal(0, 0.08, volts.size)
    assert Waveform(samples, volts, line).decode().data == EVERY_BYTE


@pytest.mark.parametrize("character", ["8E1", "8O1", "8E2"])
def test_one_wrong_bit_in_a_character_is_a_parity_error(character):
    line = SerialLine(9600, character)
    for bit in range(1, 10):
        bits = _line_bits(b"\x5a", line)[0].astype(float)
        bits[bit] = 1 - bits[bit]
        time = np.arange(bits.size + 2) / 9600
        characters = Waveform(time, np.concatenate([[1], bits, [1]]), line).decode()
        assert characters.code.tolist() == [ParityError.code]
        assert characters.value[0] == (0x5A ^ (1 << bit - 1) if bit < 9 else 0x5A)


@pytest.mark.parametrize("character", FORMATS)
def test_a_stop_bit_of_0_is_a_framing_error_and_the_line_is_found_again(character):
    line = SerialLine(9600, character)
    bits = _line_bits(b"\x5a\xff", line).astype(float)
    bits[0, -int(character[2])] = 0
    row = np.concatenate([[1], bits[0], [1, 1], bits[1], [1]])
    characters = Waveform(np.arange(row.size) / 9600, row, line).decode()
    assert characters.code.tolist() == [FormError.code, 0]
    assert characters.value.tolist() == [0x5A, 0xFF]


@pytest.mark.parametrize("levels", [[1, 0, 1], [1, 0]])
def test_a_break_is_one_character_of_zeros_with_a_framing_error(levels):
    characters = Waveform(range(len(levels)), levels, SerialLine(9600, "8N1")).decode()
    assert (characters.value.tolist(), characters.code.tolist()) == ([0], [FormError.code])


def test_a_spike_is_not_a_start_bit():
    line = SerialLine(1000, "8N1")
    sent = line.waveform(b"\x41", start=0.1)
    spiked = Waveform([0, 0.01, 0.0104, *sent.time[1:]], [1, 0, 1, *sent.level[1:]], line)
    assert spiked.decode().data == b"\x41"


@pytest.mark.parametrize("nothing", [([], []), ([0], [1]), ([0], [0]), ([0, 1, 2], [1, 1, 1])])
def test_an_idle_line_has_no_characters(nothing):
    characters = Waveform(*nothing, SerialLine(9600)).decode()
    assert characters.data == b"" and characters.time.size == characters.code.size == 0


@given(steps=st.lists(st.tuples(st.floats(0, 5e-3), st.floats(-10, 10)), max_size=60), serial=LINES)
def test_the_decoder_survives_any_levels(steps, serial):
    time, level = np.cumsum([s[0] for s in steps]), [s[1] for s in steps]
    characters = Waveform(time, level, serial).decode()
    assert set(characters.code) <= {0, ParityError.code, FormError.code}
    assert len(characters.data) == characters.time.size == characters.code.size
    bits = 10 + (serial.character[1] != "N")
    # The next start bit follows the sample of a stop bit of 1 by at least half a bit.
    least = (bits - 1) / serial.bit_rate
    assert (np.diff(characters.time) >= least).all()


#: Bytes with 0 or 1 before the stop bit, for either parity.
WORST = [0x00, 0xFF, 0x80, 0x7F, 0x01, 0xFE, 0x81, 0x7E]


def reads(deviation, line, phase):
    """Return whether a receiver reads successive bytes from a sender with another bit rate."""
    sender = SerialLine(line.bit_rate * (1 + deviation), line.character)
    for first in WORST:
        data = bytes([first, *WORST])
        characters = sender.waveform(data, start=(20 + phase) / line.bit_rate).decode(line)
        if characters.data != data or characters.code.any():
            return False
    return True


@pytest.mark.parametrize("character", FORMATS)
def test_the_tolerance_is_where_a_simulated_receiver_begins_to_fail(character):
    line = SerialLine(9600, character)
    for limit in line.clock_tolerance():
        for phase in np.linspace(0, 1, 9):
            assert reads(limit * (1 - 1e-3), line, phase)
            assert not reads(limit * (1 + 1e-3), line, phase)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: SerialLine(9600).waveform(b"", gap=-1), "gap is -1"),
        (lambda: SerialLine(9600).waveform(b"", start=float("nan")), "start is nan"),
        (lambda: Waveform([0, 1], [1], SerialLine(9600)), "shape"),
        (lambda: Waveform([[0]], [[1]], SerialLine(9600)), "shape"),
        (lambda: Waveform([1, 0], [1, 0], SerialLine(9600)), "time decreases"),
        (lambda: Waveform([0, np.nan], [1, 0], SerialLine(9600)), "finite"),
        (lambda: Waveform([0, 1], [1, np.inf], SerialLine(9600)), "finite"),
    ],
)
def test_arguments_out_of_range_are_named(make, message):
    with pytest.raises(ArgumentError, match=message):
        make()


def test_every_frame_can_have_its_own_silence():
    line = SerialLine(9600)
    gaps = [0.5, 0.0, 0.25]
    sent = line.waveform([b"a", b"bc", b"d"], gap=gaps, start=1.0)
    ends = 1.0 + np.cumsum([0.5 + line.character_time, 2 * line.character_time])
    starts = sent.decode().time
    assert starts[[0, 1, 3]] == pytest.approx([1.0, *ends])
    assert sent.time[-1] == pytest.approx(ends[1] + line.character_time + 0.25)
    single = line.waveform(b"\0\0")  # the silence of the standard
    assert single.time[[1, -1]] == pytest.approx([line.t35, 2 * line.t35 + line.frame_time(4) / 2])
    with pytest.raises(ArgumentError, match="gap has 2 values; there are 3 frames"):
        line.waveform([b"a", b"b", b"c"], gap=[0.0, 1.0])
    with pytest.raises(ArgumentError, match=r"gap\[1\] is -1 s"):
        line.waveform([b"a", b"b"], gap=[0.0, -1.0])
