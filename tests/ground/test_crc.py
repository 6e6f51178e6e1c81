import binascii
import zlib
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shipnet.crc import CAN, MODBUS, Crc
from shipnet.errors import ArgumentError, SymbolError

# Two that the standard library computes too: one per direction, one with a final XOR.
XMODEM = Crc("CRC-16/XMODEM", 16, 0x1021)
ISO_HDLC = Crc("CRC-32/ISO-HDLC", 32, 0x04C11DB7, 0xFFFFFFFF, 0xFFFFFFFF, reflected=True)
# The narrowest and the widest.
SMBUS = Crc("CRC-8/SMBUS", 8, 0x07)
WE = Crc("CRC-64/WE", 64, 0x42F0E1EBA9EA3693, 2**64 - 1, 2**64 - 1)
XZ = Crc("CRC-64/XZ", 64, 0x42F0E1EBA9EA3693, 2**64 - 1, 2**64 - 1, reflected=True)
ALL = [CAN, MODBUS, XMODEM, ISO_HDLC, SMBUS, WE, XZ]
#: Check values of b"123456789" in the catalogue.
CHECKS = [0x059E, 0x4B37, 0x31C3, 0xCBF43926, 0xF4, 0x62EC59E3F1A4F00A, 0x995DC9BBDF1939FA]


def remainder(algorithm, bits):
    """Return the remainder of a long division by the polynomial, bits in the order sent."""
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


@pytest.mark.parametrize(("check", "value"), [*zip(ALL, CHECKS, strict=True)])
def test_each_algorithm_gives_its_check_value(check, value):
    assert check.of(b"123456789") == value
    assert check.of(np.frombuffer(b"123456789", np.uint8)) == value


@pytest.mark.parametrize(
    ("check", "peer"), [(XMODEM, lambda data: binascii.crc_hqx(data, 0)), (ISO_HDLC, zlib.crc32)]
)
@given(data=st.binary(max_size=40))
def test_check_values_agree_with_the_standard_library(check, peer, data):
    assert check.of(data) == check.of(np.frombuffer(data, np.uint8)) == peer(data)


@pytest.mark.parametrize("check", ALL)
@given(bits=st.text("01", max_size=100))
def test_any_number_of_bits_leaves_the_remainder_of_a_long_division(check, bits):
    assert check.of(bits) == remainder(check, bits)


# From the libraries pymodbus, umodbus and fastcrc, which agree; low byte first on the line.
@pytest.mark.parametrize(
    ("message", "line"),
    [("01030000000A", "C5CD"), ("1103006B0003", "7687"), ("0207", "4112"), ("018402", "C2C1")],
)
def test_known_modbus_frames_end_with_their_check_value(message, line):
    assert MODBUS.of(bytes.fromhex(message)).to_bytes(2, "little").hex().upper() == line


@pytest.mark.parametrize("check", ALL)
def test_rows_give_the_same_as_single_messages(check):
    rows = np.random.default_rng(1).integers(0, 256, (3, 40, 12), dtype=np.uint8)
    assert check.of(rows).tolist() == [
        [check.of(row.tobytes()) for row in codewords] for codewords in rows
    ]


@pytest.mark.parametrize(
    ("data", "error", "message"),
    [
        ([1, 2], ArgumentError, "must be bytes"),
        ("012", SymbolError, "data contains '2'"),
        (np.array([[1.0]]), ArgumentError, "uint8"),
        (np.array(1, np.uint8), ArgumentError, "0-D"),
    ],
)
def test_other_data_are_refused(data, error, message):
    with pytest.raises(error, match=message):
        CAN.of(data)


@pytest.mark.parametrize("name", ["polynomial", "init", "xorout"])
def test_a_number_of_more_bits_than_the_register_is_refused(name):
    most = {"polynomial": 0x7FFF, "init": 0x7FFF, "xorout": 0x7FFF}
    assert 0 <= Crc("x", 15, **most).of(b"a") <= 0x7FFF
    with pytest.raises(ArgumentError, match=rf"{name} is 50585; .* 0\.\.32767, 15 bits"):
        Crc("x", 15, **most | {name: 0xC599})


@pytest.mark.parametrize("check", [CAN, MODBUS])
@pytest.mark.parametrize("flips", [1, 2])
def test_a_crc_detects_any_one_or_two_wrong_bits(check, flips):
    assert check.undetected(flips=flips) == 0
    # Check this another way: bit by bit, over two bytes.
    data = b"\x01\x02"
    good = check.of(data)
    missed = 0
    for wrong in combinations(range(16 + check.width), flips):
        pattern = sum(1 << bit for bit in wrong)
        received = (int.from_bytes(data, "big") ^ (pattern & 0xFFFF)).to_bytes(2, "big")
        missed += check.of(received) == good ^ (pattern >> 16)
    assert missed == check.undetected(2, flips)
