import csv
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shipnet.can.batch import encode_frames, measure_frames
from shipnet.can.batch_reader import decode_frames
from shipnet.can.frame import Frame
from shipnet.can.lengths import longest_frame
from shipnet.can.reader import decode
from shipnet.errors import ArgumentError, FrameError, explain
from tests.can_frames import frames

REFERENCE = Path(__file__).with_name("reference") / "can" / "can_utils_lengths.csv"


def columns(found):
    """Return the arguments of the batch functions for frames."""
    data = np.array([list(frame.data.ljust(8, b"\xa5")) for frame in found], np.uint8)
    return (
        [frame.arbitration_id for frame in found],
        data.reshape(-1, 8),
        [frame.dlc for frame in found],
    ), {
        "extended": [frame.extended for frame in found],
        "remote": [frame.remote for frame in found],
    }


def some_frames(n, seed=2024):
    rng = np.random.default_rng(seed)
    for _ in range(n):
        extended, remote = bool(rng.integers(2)), rng.random() < 0.1
        dlc = int(rng.integers(16))
        data = rng.choice([0, 255, 15, rng.integers(256)], 0 if remote else min(dlc, 8))
        number = int(rng.integers(2**29 if extended else 2**11))
        yield Frame(number, data.astype(np.uint8).tobytes(), extended, remote, dlc)


def text(row):
    return "".join(map(str, row))


def assert_batch_is_as_frames(found):
    arguments, flags = columns(found)
    measures = measure_frames(*arguments, **flags)
    assert measures.crc.tolist() == [frame.crc for frame in found]
    assert measures.stuff_bits.tolist() == [frame.stuff_bits for frame in found]
    assert measures.length.tolist() == [frame.length for frame in found]
    encoded = encode_frames(*arguments, **flags)
    assert encoded.length.tolist() == measures.length.tolist()
    assert [text(row) for row in encoded.bits] == [frame.bits.ljust(160, "1") for frame in found]
    assert not measures.error.any() and not encoded.error.any()
    decoded = decode_frames(encoded.bits)
    assert not decoded.error.any() and (decoded.position == -1).all()
    assert decoded.length.tolist() == measures.length.tolist()
    again = [
        Frame(number, data.tobytes()[: len(frame.data)], extended, remote, dlc)
        for number, dlc, data, extended, remote, frame in zip(
            *(field.tolist() for field in decoded[2:4]),
            decoded.data,
            *(field.tolist() for field in decoded[5:7]),
            found,
            strict=True,
        )
    ]
    assert again == found
    assert all(
        not data[len(frame.data) :].any() for data, frame in zip(decoded.data, found, strict=True)
    )


@given(st.lists(frames(), min_size=1, max_size=8))
def test_any_frames_are_as_the_scalar_code_has_them(found):
    assert_batch_is_as_frames(found)


def test_thousands_of_frames_are_as_the_scalar_code_has_them():
    assert_batch_is_as_frames(list(some_frames(2000)))


def test_the_longest_frames_fit():
    assert_batch_is_as_frames(
        [longest_frame(dlc, extended=extended) for dlc in range(9) for extended in (False, True)]
    )


def test_lengths_are_those_of_can_utils():
    with REFERENCE.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    data = [list(bytes.fromhex(row["data_hex"]).ljust(8, b"\0")) for row in rows]
    measures = measure_frames(
        [int(row["arbitration_id_hex"], 16) for row in rows],
        data,
        [len(row["data_hex"]) // 2 for row in rows],
        extended=[row["extended"] == "1" for row in rows],
        remote=[row["remote"] == "1" for row in rows],
    )
    assert [length + 3 for length in measures.length.tolist()] == [
        int(row["length_with_intermission"]) for row in rows
    ]


def test_more_frames_than_one_chunk_keep_their_order():
    number = np.arange(20_000) % 2048
    short = measure_frames(number[:2048], np.zeros(8, int), 3)
    long = measure_frames(number, np.zeros(8, int), 3)
    assert (long.crc == short.crc[number]).all()
    bits = encode_frames(number, np.zeros(8, int), 3).bits
    assert (decode_frames(bits).arbitration_id == number).all()


def scalar(row):
    """Return the error's name, its position and the frame, as the scalar reader has them."""
    try:
        return "ok", -1, decode(text(row))
    except FrameError as error:
        return type(error).__name__, int(re.search(r"bit (\d+)", str(error))[1]), None


def assert_read_as_by_the_scalar_code(rows):
    decoded = decode_frames(rows)
    for place, row in enumerate(rows):
        name, position, frame = scalar(row)
        assert (explain(decoded.error[place]), decoded.position[place]) == (name, position)
        own = [field[place] for field in decoded[2:]]
        if frame is None:
            assert not any(np.any(value) for value in own)
        else:
            assert own[0] == frame.arbitration_id and own[1] == frame.dlc
            assert own[2].tobytes()[: len(frame.data)] == frame.data


def test_damaged_lines_get_the_error_and_the_place_of_the_scalar_code():
    rng = np.random.default_rng(5)
    arguments, flags = columns(list(some_frames(3000, seed=6)))
    encoded = encode_frames(*arguments, **flags)
    bits = encoded.bits
    for _ in range(3):
        hit = rng.integers(0, np.where(rng.random(3000) < 0.3, 45, encoded.length))
        bits[np.arange(3000), hit] ^= 1
    assert_read_as_by_the_scalar_code(bits)
    seen = {explain(code) for code in decode_frames(bits).error} - {"ok"}
    assert seen == {"AcknowledgeError", "CrcError", "FormError", "StartBitError", "StuffError"}


def test_every_single_wrong_bit_is_found_where_the_scalar_code_finds_it():
    for frame in (Frame(0x14, b"\x01"), longest_frame(2, extended=True), Frame(1, remote=True)):
        bits = np.array([list(map(int, frame.bits))] * frame.length)
        bits[np.diag_indices(frame.length)] ^= 1
        assert_read_as_by_the_scalar_code(np.column_stack([bits, np.ones_like(bits)[:, :30]]))


def test_every_cut_is_found_where_the_scalar_code_finds_it():
    for frame in (Frame(0x3E, bytes.fromhex("107803FE")), Frame(2**28, b"", True)):
        line = np.array([list(map(int, frame.bits))])
        for width in range(frame.length + 1):
            assert_read_as_by_the_scalar_code(line[:, :width])


@given(st.integers(0, 200), st.integers(0, 2**32), st.floats(0, 1))
def test_any_bits_are_read_as_by_the_scalar_code(width, seed, share):
    rng = np.random.default_rng(seed)
    assert_read_as_by_the_scalar_code((rng.random((4, width)) < share).astype(int))


def test_what_is_no_bit_counts_from_where_it_stands():
    line = np.array([list(map(int, Frame(0x14).bits))])
    rows = np.repeat(line, 3, axis=0)
    rows[0, 20], rows[1, 0], rows[2, -1] = 2, -1, 7
    decoded = decode_frames(rows)
    assert [explain(code) for code in decoded.error] == ["SymbolError"] * 3
    assert decoded.position.tolist() == [20, 0, line.size - 1]
    behind = np.column_stack([line, [[9]]])
    assert decode_frames(behind).error.tolist() == [0]


def test_frames_that_cannot_be_get_a_code_and_an_idle_bus():
    number = [2048, 2047, -1, 2**29, 2**29 - 1, 0, 0]
    extended = [False, False, False, True, True, False, False]
    dlc = [8, 8, 8, 8, 8, 16, -1]
    legal = [False, True, False, False, True, False, False]
    measures = measure_frames(number, [0] * 8, dlc, extended=extended)
    assert [explain(code) for code in measures.error] == [
        "ok" if good else "ArgumentError" for good in legal
    ]
    for field in measures[1:]:
        assert [bool(value) for value in field] == legal
    encoded = encode_frames(number, [0] * 8, dlc, extended=extended)
    assert (encoded.error == measures.error).all()
    assert [bool(length) for length in encoded.length] == legal
    assert encoded.bits[~np.array(legal)].all()
    rows = np.zeros((2, 8), int)
    rows[1, 7] = 256
    assert measure_frames(1, rows).error.tolist() == [0, ArgumentError.code]


def test_no_frames_and_one_frame():
    empty = measure_frames([], np.empty((0, 8), np.uint8), [])
    assert all(field.shape == (0,) for field in empty)
    assert encode_frames([], np.empty((0, 8), np.uint8)).bits.shape == (0, 160)
    assert decode_frames(np.empty((0, 50), int)).data.shape == (0, 8)
    nothing = decode_frames(np.empty((2, 0), int))
    assert [explain(code) for code in nothing.error] == ["LengthError"] * 2
    assert measure_frames(5, range(8)).length.tolist() == [Frame(5, bytes(range(8))).length]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"arbitration_id": [1.0]}, "arbitration_id must be whole numbers"),
        ({"arbitration_id": [True]}, "arbitration_id must be whole numbers"),
        ({"data": [float("nan")] * 8}, "data must be whole numbers"),
        ({"dlc": ["8"]}, "dlc must be whole numbers"),
        ({"extended": [1]}, "extended must be True or False"),
        ({"remote": 0}, "remote must be True or False"),
        ({"data": [0] * 7}, r"data have shape \(7,\)"),
        ({"data": 0}, r"data have shape \(\)"),
        ({"arbitration_id": [[1]]}, r"must be \(n, 8\) and \(n,\)"),
        ({"arbitration_id": [1, 2], "dlc": [1, 2, 3]}, "different lengths"),
    ],
)
def test_other_types_and_shapes_are_refused(change, message):
    arguments = {"arbitration_id": 1, "data": [0] * 8} | change
    for function in (measure_frames, encode_frames):
        with pytest.raises(ArgumentError, match=message):
            function(**arguments)


@pytest.mark.parametrize("bits", [[0, 1], [[0.0]], "01", np.zeros((1, 1025), int), [[True]]])
def test_bits_that_are_no_table_are_refused(bits):
    with pytest.raises(ArgumentError, match="must be whole numbers of shape"):
        decode_frames(bits)
