import binascii
import zlib
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shipnet.crc import ALGORITHMS, Algorithm, crc, crc_batch, undetected
from shipnet.errors import ArgumentError, SymbolError

# Two that the standard library computes too: one of each direction, one with a final addition.
PEERS = {
    "CRC-16/XMODEM": (
        Algorithm(16, 0x1021, 0, 0, False, 0x31C3),
        lambda data: binascii.crc_hqx(data, 0),
    ),
    "CRC-32/ISO-HDLC": (
        Algorithm(32, 0x04C11DB7, 0xFFFFFFFF, 0xFFFFFFFF, True, 0xCBF43926),
        zlib.crc32,
    ),
}


@pytest.fixture(scope="module", autouse=True)
def peers():
    with pytest.MonkeyPatch.context() as patch:
        for name, (algorithm, _) in PEERS.items():
            patch.setitem(ALGORITHMS, name, algorithm)
        yield


def remainder(algorithm, bits):
    """Divide the message by the polynomial as one learns it on paper, bits as they are sent."""
    width = algorithm.width
    first = f"{algorithm.init:0{width}b}"
    message = [int(bit) for bit in bits] + [0] * width
    for place, bit in enumerate(first):
        message[place] ^= int(bit)
    divisor = [1, *(int(bit) for bit in f"{algorithm.polynomial:0{width}b}")]
    for place in range(len(bits)):
        if message[place]:
            for k, bit in enumerate(divisor):
                message[place + k] ^= bit
    rest = "".join(map(str, message[len(bits) :]))
    return int(rest[::-1] if algorithm.reflected else rest, 2) ^ algorithm.xorout


@pytest.mark.parametrize("name", [*ALGORITHMS, *PEERS])
def test_each_row_of_the_table_gives_its_check_value(name):
    assert crc(name, b"123456789") == ALGORITHMS[name].check
    assert crc_batch(name, np.frombuffer(b"123456789", np.uint8)) == ALGORITHMS[name].check


@pytest.mark.parametrize("name", PEERS)
@given(data=st.binary(max_size=40))
def test_the_engine_agrees_with_the_standard_library(name, data):
    expected = PEERS[name][1](data)
    assert crc(name, data) == expected
    assert crc_batch(name, np.frombuffer(data, np.uint8)) == expected


@pytest.mark.parametrize("name", [*ALGORITHMS, *PEERS])
@given(bits=st.text("01", max_size=100))
def test_any_number_of_bits_leaves_the_remainder_of_a_long_division(name, bits):
    assert crc(name, bits) == remainder(ALGORITHMS[name], bits)


# From the libraries pymodbus, umodbus and fastcrc, which agree; low byte first on the line.
@pytest.mark.parametrize(
    ("message", "line"),
    [("01030000000A", "C5CD"), ("1103006B0003", "7687"), ("0207", "4112"), ("018402", "C2C1")],
)
def test_known_modbus_frames_end_in_their_check(message, line):
    assert crc("CRC-16/MODBUS", bytes.fromhex(message)).to_bytes(2, "little").hex().upper() == line


@pytest.mark.parametrize("name", [*ALGORITHMS, *PEERS])
def test_rows_of_different_length_give_what_single_messages_give(name):
    rng = np.random.default_rng(1)
    rows = rng.integers(0, 256, (3, 40, 12), dtype=np.uint8)
    lengths = rng.integers(0, 13, (3, 40))
    batch = crc_batch(name, rows, lengths)
    assert batch.shape == (3, 40)
    for place in np.ndindex(3, 40):
        assert batch[place] == crc(name, rows[place][: lengths[place]].tobytes())


def test_leading_zeros_do_not_count_for_can():
    assert crc("CRC-15/CAN", b"\0\0\x57") == crc("CRC-15/CAN", "1010111")
    assert crc("CRC-16/MODBUS", b"\0\x57") != crc("CRC-16/MODBUS", b"\x57")


def test_nothing_gives_the_first_register():
    for nothing in (b"", ""):
        assert crc("CRC-15/CAN", nothing) == 0
        assert crc("CRC-16/MODBUS", nothing) == 0xFFFF
    assert crc_batch("CRC-16/MODBUS", np.empty((2, 0), np.uint8)).tolist() == [0xFFFF] * 2
    assert crc_batch("CRC-16/MODBUS", np.empty((0, 5), np.uint8)).shape == (0,)


def test_other_arguments_are_refused():
    with pytest.raises(ArgumentError, match=r"'CRC-15/CAN', 'CRC-16/"):
        crc("CRC-8", b"")
    with pytest.raises(ArgumentError, match="must be bytes"):
        crc("CRC-15/CAN", [1, 2])
    with pytest.raises(SymbolError, match="'2' among its bits"):
        crc("CRC-15/CAN", "012")
    with pytest.raises(ArgumentError, match="uint8"):
        crc_batch("CRC-15/CAN", [[1.0]])
    rows = np.zeros((2, 3), np.uint8)
    for lengths, message in [
        ([1, 4], r"1\.\.4; they must be 0\.\.3"),
        ([-1, 0], r"-1\.\.0"),
        ([1], r"shape \(1,\)"),
        ([1.0, 2.0], "whole"),
    ]:
        with pytest.raises(ArgumentError, match=message):
            crc_batch("CRC-16/MODBUS", rows, lengths)


@pytest.mark.parametrize("name", ALGORITHMS)
@pytest.mark.parametrize("flips", [1, 2])
def test_no_one_or_two_wrong_bits_pass_a_crc(name, flips):
    assert undetected(name, flips=flips) == 0
    # The second route: bit by bit, over two bytes.
    width, data = ALGORITHMS[name].width, b"\x01\x02"
    good = crc(name, data)
    missed = 0
    for wrong in combinations(range(16 + width), flips):
        pattern = sum(1 << bit for bit in wrong)
        received = (int.from_bytes(data, "big") ^ (pattern & 0xFFFF)).to_bytes(2, "big")
        missed += crc(name, received) == good ^ (pattern >> 16)
    assert missed == undetected(name, 2, flips)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("CRC-8",), "name is 'CRC-8'"),
        (("CRC-16/MODBUS", 17), "payload is 17"),
        (("CRC-16/MODBUS", 6, 3), "flips is 3"),
    ],
)
def test_errors_that_cannot_be_tried_are_refused(arguments, message):
    with pytest.raises(ArgumentError, match=message):
        undetected(*arguments)
