import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from shipnet.can.frame import Frame, decode
from shipnet.errors import (
    AcknowledgeError,
    ArgumentError,
    CrcError,
    FormError,
    FrameError,
    LengthError,
    StartBitError,
    StuffError,
    SymbolError,
)
from tests.can.frames import LONGEST, frames, line_bits, rows


@given(frames())
@example(Frame(0x078, bytes.fromhex("01E1E1E1E1E1E00F")))
@example(Frame(0x7FF, b"\xff" * 8, dlc=15))
@example(Frame(0, b"", True, True, 9))
def test_the_bits_are_those_of_the_specification_taken_literally(frame):
    reference = line_bits(frame.arbitration_id, frame.data, frame.extended, frame.remote, frame.dlc)
    assert frame.bits == reference
    assert len(frame.bits) == len(reference)
    assert frame.length == len(reference) + 3


def test_known_long_frames_have_the_expected_crc_and_stuff_bits():
    for row, frame in zip(rows("worst_attainable_frames.csv"), LONGEST, strict=True):
        assert frame.crc == int(row["crc15"])
        assert frame.stuff_bits == int(row["stuff_bits"])
        assert frame.length == int(row["total_bits_incl_ifs3"])


@given(frames())
def test_the_fields_cover_the_frame_without_and_with_stuff_bits(frame):
    plain = frame.unstuffed + "1011111111"
    start = line_start = 0
    for field in frame.fields:
        assert (field.start, field.line_start) == (start, line_start)
        start += field.length
        line_start += field.line_length
        assert int(plain[field.start : start], 2) == field.value
        within = range(field.line_start, line_start)
        unstuffed = [k for k in within if k not in frame.stuff_positions]
        assert "".join(frame.bits[k] for k in unstuffed) == plain[field.start : start]
    assert (start, line_start) == (len(plain), len(frame.bits))
    for k in frame.stuff_positions:
        assert len(set(frame.bits[k - 5 : k])) == 1 and frame.bits[k] != frame.bits[k - 1]
    assert frame.stuff_bits == len(frame.stuff_positions) == len(frame.bits) - len(plain)


def test_a_stuff_bit_after_the_last_bit_of_the_crc_belongs_to_it():
    frame = Frame(0x3E, bytes.fromhex("107803FE"))
    assert f"{frame.crc:015b}" == "000111100001111"
    frame = next(f for f in map(Frame, range(2048)) if f"{f.crc:015b}".endswith("011111"))
    sequence, delimiter = (
        next(field for field in frame.fields if field.name == name)
        for name in ("CRC sequence", "CRC delimiter")
    )
    assert frame.bits[delimiter.line_start - 1] == "0"
    assert frame.stuff_positions[-1] == delimiter.line_start - 1
    assert sequence.line_start + sequence.line_length == delimiter.line_start
    assert decode(frame.bits) == frame


def test_fields_of_an_extended_remote_frame_are_named_as_in_the_standard():
    frame = Frame(0x1ABCDEF5, extended=True, remote=True, dlc=3)
    assert {field.name: field.value for field in frame.fields} == {
        "SOF": 0,
        "base identifier": 0x1ABCDEF5 >> 18,
        "SRR": 1,
        "IDE": 1,
        "identifier extension": 0x1ABCDEF5 & 0x3FFFF,
        "RTR": 1,
        "r1": 0,
        "r0": 0,
        "DLC": 3,
        "CRC sequence": frame.crc,
        "CRC delimiter": 1,
        "ACK slot": 0,
        "ACK delimiter": 1,
        "EOF": 127,
    }


@pytest.mark.parametrize(
    ("frame", "text"),
    [
        (Frame(0x113, bytes.fromhex("91D8")), "113#91D8"),
        (Frame(0), "000#"),
        (Frame(5, extended=True), "00000005#"),
        (Frame(0x7FF, remote=True), "7FF#R"),
        (Frame(0x7FF, remote=True, dlc=5), "7FF#R5"),
        (Frame(1, bytes(8)), "001#0000000000000000"),
        (Frame(1, bytes(8), dlc=14), "001#0000000000000000_E"),
        (Frame(1, remote=True, dlc=9), "001#R8_9"),
    ],
)
def test_a_frame_prints_as_candump_prints_it(frame, text):
    assert str(frame) == text


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"arbitration_id": 2048}, r"arbitration_id is 2048; .* 0\.\.2047 for an id of 11 bits"),
        ({"arbitration_id": 2**29, "extended": True}, r"0\.\.536870911 for an id of 29 bits"),
        ({"arbitration_id": -1}, "arbitration_id is -1"),
        ({"data": bytes(9)}, r"data has 9 bytes; it must have 0\.\.8"),
        ({"data": "12"}, "data is '12'; it must be bytes"),
        ({"data": b"1", "remote": True}, "a remote frame carries none"),
        ({"dlc": 16}, r"dlc is 16; it must be a whole number 0\.\.15"),
        ({"data": b"12", "dlc": 3}, "dlc is 3, but data has 2 bytes"),
        ({"dlc": 9}, "dlc is 9, but data has 0 bytes"),
        ({"remote": 1}, "remote is 1"),
    ],
)
def test_impossible_frames_are_refused(arguments, message):
    with pytest.raises(ArgumentError, match=message):
        Frame(**{"arbitration_id": 1} | arguments)


def test_other_kinds_of_numbers_and_bytes_are_accepted():
    frame = Frame(np.int16(5), bytearray(b"12"), np.True_, np.False_, np.uint8(2))
    assert frame == Frame(5, b"12", extended=True)
    assert hash(frame) == hash(Frame(5, b"12", extended=True))
    assert type(frame.arbitration_id) is int and type(frame.extended) is bool


@given(frames(), st.text("01x", max_size=20))
def test_a_frame_is_read_back_from_a_stream(frame, behind):
    assert decode(frame.bits + behind) == frame


def flipped(bits, index):
    return bits[:index] + "10"[int(bits[index])] + bits[index + 1 :]


@given(frames(), st.data())
def test_every_single_wrong_bit_but_the_last_is_detected(frame, data):
    index = data.draw(st.integers(0, len(frame.bits) - 1))
    damaged = flipped(frame.bits, index) + "1" * 40
    if index < len(frame.bits) - 1:
        with pytest.raises(FrameError):
            decode(damaged)
    assert decode(flipped(frame.bits, len(frame.bits) - 1)) == frame


@given(frames(), st.data())
def test_any_bits_give_a_frame_or_the_error_of_a_class(frame, data):
    bits = data.draw(st.just(frame.bits) | st.text("01", max_size=200) | st.text(max_size=30))
    for _ in range(data.draw(st.integers(1, 4)) if bits == frame.bits else 0):
        bits = flipped(bits, data.draw(st.integers(0, len(bits) - 1)))
    try:
        read = decode(bits)
    except FrameError as error:
        assert type(error) is not FrameError and error.code
    else:
        assert bits.startswith(read.bits[:-1])


CUT = [
    Frame(0x155, b"\x55"),
    Frame(0x1ABCDEF5, b"\x00\xff", extended=True),
    Frame(0x15555555, extended=True, remote=True, dlc=3),
    *LONGEST,
]


@pytest.mark.parametrize("frame", CUT, ids=str)
def test_a_frame_cut_short_names_the_bit_and_the_field_that_it_lacks(frame):
    names = [field.name for field in frame.fields for _ in range(field.line_length)]
    first = "SRR" if frame.extended else "RTR"
    for length in range(len(frame.bits)):
        name = names[length]
        if length in frame.stuff_positions and name != "CRC sequence":
            name = names[length + 1]  # the reader takes a stuff bit for a part of what comes next
        name = "RTR or SRR" if name == first else name
        with pytest.raises(LengthError, match=f"^the bits end before bit {length}, in the {name}$"):
            decode(frame.bits[:length])


@pytest.mark.parametrize(
    ("index", "error", "message"),
    [
        (0, StartBitError, "bit 0, SOF: recessive"),
        (-10, FormError, "CRC delimiter: dominant"),
        (-9, AcknowledgeError, "ACK slot: recessive; no receiver acknowledged"),
        (-8, FormError, "ACK delimiter: dominant"),
        (-7, FormError, "EOF: dominant"),
        (-2, FormError, "EOF: dominant"),
    ],
)
def test_each_rule_names_bit_and_field(index, error, message):
    bits = Frame(0x155, b"\x55").bits
    index %= len(bits)
    with pytest.raises(error, match=message) as caught:
        decode(flipped(bits, index))
    assert str(caught.value).startswith(f"bit {index}, ")


def test_stuff_crc_and_reserved_bits_name_bit_and_field():
    bits = Frame(0x155, b"\x55").bits
    with pytest.raises(
        StuffError, match=r"^bit 9, base identifier: a sixth 0 in a row instead of a stuff bit$"
    ):
        decode(bits[:5] + "000000" + bits[11:])
    frame = Frame(0x155, b"\x55\x55")
    index = next(f.line_start for f in frame.fields if f.name == "data")
    with pytest.raises(CrcError, match=r"bit \d+, CRC sequence: received 0x[0-9a-f]{4}, but comp"):
        decode(flipped(frame.bits, index))
    with pytest.raises(FormError, match=r"bit 14, r0: recessive, .* CAN FD"):
        decode(flipped(frame.bits, 14))
    extended = Frame(0x15555555, b"\x55", extended=True)
    starts = {field.name: field.line_start for field in extended.fields}
    with pytest.raises(FormError, match="IDE: recessive after a dominant SRR"):
        decode(flipped(extended.bits, starts["SRR"]))
    with pytest.raises(FormError, match="r1: recessive"):
        decode(flipped(extended.bits, starts["r1"]))
    for symbol in "xX2":
        with pytest.raises(
            SymbolError, match=f"bit 3, base identifier: '{symbol}' is neither 0 nor 1"
        ):
            decode(bits[:3] + symbol + bits[4:])


def test_an_error_flag_is_seen_at_its_sixth_bit():
    frame = Frame(0x123, b"ship")
    for index in range(1, 60):
        with pytest.raises(StuffError) as caught:
            decode(frame.bits[:index] + "0" * 6 + "1" * 11)
        assert index <= int(str(caught.value).split()[1].rstrip(",")) <= index + 5
