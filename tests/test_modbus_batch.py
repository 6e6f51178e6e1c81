from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shipnet.errors import ArgumentError, FrameError, explain
from shipnet.modbus.batch import check_frames, encode_requests
from shipnet.modbus.frame import decode_rtu, encode_rtu
from shipnet.modbus.request import ReadRequest, WriteCoil, WriteRegister

EDGES = (-1, 0, 1, 2, 125, 126, 247, 248, 2000, 2001, 65535, 65536)


def single(unit, function, address, value):
    if function == 5:
        request = WriteCoil(address, value)
    elif function == 6:
        request = WriteRegister(address, value)
    else:
        request = ReadRequest(function, address, value)
    return encode_rtu(unit, request.pdu)


def test_a_batch_encodes_what_single_requests_encode_at_every_edge():
    rows = list(product((-1, 0, 247, 248), range(-1, 9), (-1, 0, 65535, 65536), EDGES))
    batch = encode_requests(*np.array(rows).T)
    for row, error, frame in zip(rows, batch.error, batch.frames, strict=True):
        try:
            expected = single(*row)
        except ArgumentError:
            assert (explain(error), frame.tobytes()) == ("ArgumentError", bytes(8))
        else:
            assert (error, frame.tobytes()) == (0, expected)


def test_every_function_code_is_among_those_that_agree():
    for function in range(1, 7):
        batch = encode_requests(9, function, 0x1234, 1)
        assert batch.error.tolist() == [0]
        assert batch.frames[0].tobytes() == single(9, function, 0x1234, 1)


@given(data=st.data())
def test_a_batch_finds_the_faults_that_the_decoder_finds(data):
    frame = st.builds(encode_rtu, st.integers(0, 247), st.binary(min_size=1, max_size=12))
    reserved = st.just(bytes.fromhex("f803000000019063"))
    rows = data.draw(st.lists(frame | reserved | st.binary(max_size=15), min_size=1, max_size=20))
    padded = np.array([list(row.ljust(15, b"\x55")) for row in rows], np.uint8)
    codes = check_frames(padded, [len(row) for row in rows])
    for row, code in zip(rows, codes, strict=True):
        try:
            decode_rtu(row)
        except FrameError as error:
            assert code == error.code
        else:
            assert code == 0


def test_nothing_and_the_longest_are_thought_of():
    assert encode_requests([], 3, 0, 1).frames.shape == (0, 8)
    assert check_frames(np.zeros((0, 8), np.uint8)).shape == (0,)
    assert check_frames(np.zeros((2, 0), np.uint8)).tolist() == [1, 1]
    longest = np.frombuffer(encode_rtu(1, bytes(253)), np.uint8)[None]
    assert check_frames(longest).tolist() == [0]
    assert check_frames(np.zeros((1, 257), np.uint8)).tolist() == [1]


def test_arrays_of_another_kind_are_refused():
    for arguments, message in [
        (([1.0], 3, 0, 1), "unit_id must be whole"),
        (([1, 2], [3, 3, 3], 0, 1), "shapes are"),
        (([[1]], 3, 0, 1), "2 axes"),
        (([True], 3, 0, 1), "bool"),
        ((1, 3, 0, np.array([2**64 - 1], np.uint64)), "which no field holds"),
    ]:
        with pytest.raises(ArgumentError, match=message):
            encode_requests(*arguments)
    rows = np.zeros((2, 8), np.uint8)
    for frames, lengths in [(rows.astype(int), None), (rows[0], None), (rows, 9), (rows, [1])]:
        with pytest.raises(ArgumentError, match=r"rows of uint8|lengths must be"):
            check_frames(frames, lengths)
