"""Frames and PDUs: reference frames, faults by field, and pymodbus byte by byte."""

import csv
import pickle
from contextlib import suppress
from dataclasses import FrozenInstanceError, replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymodbus.framer import FramerRTU, FramerSocket
from pymodbus.pdu import DecodePDU

from shipnet.errors import (
    ArgumentError,
    CrcError,
    FieldError,
    FrameError,
    LengthError,
    MismatchError,
    UnknownCallError,
)
from shipnet.modbus.frame import rtu_frame, tcp_frame
from shipnet.modbus.pdu import Adu, ExceptionCode, FunctionCode, Request, Response, decode

VECTORS = Path(__file__).parents[1] / "reference" / "modbus" / "modbus_crc_vectors.csv"
WORD, UNIT = st.integers(0, 0xFFFF), st.integers(1, 247)
PDU = st.binary(min_size=1, max_size=253)
FRAMERS = {"rtu": FramerRTU, "tcp": FramerSocket}


def words(most):
    return st.lists(WORD, min_size=1, max_size=most)


def coils(most):
    return st.lists(st.booleans(), min_size=1, max_size=most)


REQUESTS = st.one_of(
    st.builds(Request, st.sampled_from([1, 2]), WORD, st.integers(1, 2000)),
    st.builds(Request, st.sampled_from([3, 4]), WORD, st.integers(1, 125)),
    st.builds(Request.write_single_coil, WORD, st.booleans()),
    st.builds(Request.write_single_register, WORD, WORD),
    st.builds(Request.write_multiple_coils, WORD, coils(1968)),
    st.builds(Request.write_multiple_registers, WORD, words(123)),
)
RESPONSES = st.one_of(
    st.builds(Response, st.sampled_from([1, 2]), coils=coils(2000)),
    st.builds(Response, st.sampled_from([3, 4]), registers=words(125)),
    st.builds(Request.write_single_coil, WORD, st.booleans()).map(Request.response),
    st.builds(Request.write_single_register, WORD, WORD).map(Request.response),
    st.builds(Response, st.just(15), address=WORD, quantity=st.integers(1, 1968)),
    st.builds(Response, st.just(16), address=WORD, quantity=st.integers(1, 123)),
    st.builds(Response, st.integers(1, 127), exception=st.sampled_from(ExceptionCode)),
)


def answer(request):
    """Return a normal response to a request, as a slave whose values are all 0 sends it."""
    reads = request.function in (1, 2, 3, 4)
    return request.response([0] * request.quantity if reads else ())


def crc_by_shifting(data):
    """Return a CRC by the procedure in section 6.2.2 of the serial line guide."""
    register = 0xFFFF
    for byte in data:
        register ^= byte
        for _ in range(8):
            register = register >> 1 ^ (0xA001 if register & 1 else 0)
    return register


def test_the_reference_frames_are_encoded_and_decoded():
    with VECTORS.open() as file:
        frames = [row["adu_hex_lowbyte_first"] for row in csv.DictReader(file)]
    frames = [bytes.fromhex(frame) for frame in frames if frame]
    assert len(frames) == 10
    for frame in frames:
        adu = decode(frame)
        assert rtu_frame(adu.unit_id, adu.pdu) == frame
        assert adu == Adu(frame[0], frame[1:-2]) and adu.rtu == frame


@given(unit=st.integers(0, 247), pdu=PDU, transaction=WORD)
def test_every_frame_is_decoded_to_its_contents(unit, pdu, transaction):
    rtu = rtu_frame(unit, pdu)
    assert rtu[-2] | rtu[-1] << 8 == crc_by_shifting(bytes([unit]) + pdu)
    assert decode(rtu) == Adu(unit, pdu)
    tcp = tcp_frame(unit, pdu, transaction)
    assert decode(tcp, "tcp") == Adu(unit, pdu, transaction)
    assert Adu(unit, pdu, transaction).tcp == tcp
    assert (len(rtu), len(tcp)) == (len(pdu) + 3, len(pdu) + 7)


@given(pdu=PDU, data=st.data())
def test_up_to_two_wrong_bits_never_pass_the_crc(pdu, data):
    frame = bytearray(rtu_frame(1, pdu))
    place = st.integers(0, 8 * len(frame) - 1)
    for bit in data.draw(st.sets(place, min_size=1, max_size=2)):
        frame[bit // 8] ^= 1 << bit % 8
    with pytest.raises(CrcError):
        decode(frame)


@given(function=st.sampled_from([*range(26), 0x80, 0x81, 0x90, 0xFF]), data=st.binary(max_size=300))
def test_decoders_survive_any_bytes_and_parsers_read_their_own_output(function, data):
    for framing in ("rtu", "tcp"):
        with suppress(FrameError):
            assert 1 <= len(decode(data, framing).pdu) <= 253
    for parse in (Request.parse, Response.parse):
        for pdu in (data, bytes([function]) + data):
            with suppress(FrameError):
                message = parse(pdu)
                assert parse(message.pdu) == message
                assert len(message.pdu) == len(pdu)


@given(request=REQUESTS)
def test_requests_are_read_back_and_their_responses_have_the_predicted_size(request):
    assert Request.parse(request.pdu) == eval(repr(request)) == request
    response = answer(request)
    assert len(response.pdu) == request.response_size
    assert Response.parse(response.pdu, request) == response
    refused = request.exception(2)
    assert Response.parse(refused.pdu, request) == refused


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Request.read_coils(0, 2001), r"quantity is 2001.*1\.\.2000 for function code 1"),
        (lambda: Request.read_holding_registers(0, 126), r"1\.\.125"),
        (lambda: Request.read_input_registers(0, 0), "quantity is 0"),
        (lambda: Request(23, 0, 1), r"function is 23; it must be 1\.\.6, 15 or 16"),
        (lambda: Request.read_holding_registers(65536, 1), "address is 65536"),
        (lambda: Request.read_holding_registers(0, 1.5), r"quantity is 1\.5"),
        (lambda: Request.write_single_coil(0, 2), r"coils\[0\] is 2"),
        (lambda: Request.write_single_register(0, -1), r"registers\[0\] is -1"),
        (
            lambda: Request.write_multiple_coils(0, [0] * 1969),
            r"1969 values; it must have 1\.\.1968",
        ),
        (lambda: Request.write_multiple_coils(0, 1), "must be a sequence"),
        (lambda: Request.write_multiple_registers(0, [0] * 124), r"1\.\.123"),
        (lambda: Request.write_multiple_registers(0, []), "0 values"),
        (lambda: Response(7, registers=[0]), "function is 7"),
        (lambda: Response(16, address=0, quantity=124), r"1\.\.123"),
        (lambda: Response(3, exception=7), "exception is 7"),
        (lambda: Response(128, exception=1), "function is 128"),
        (lambda: rtu_frame(248, b"\1"), r"unit_id is 248.*0\.\.247"),
        (lambda: Adu(1, b""), r"1\.\.253 bytes"),
        (lambda: Adu(1, bytes(254)), r"1\.\.253 bytes"),
        (lambda: tcp_frame(256, b"\1", 0), "unit_id is 256"),
        (lambda: tcp_frame(1, b"\1", 65536), r"^transaction_id is 65536; .*0\.\.65535$"),
        (lambda: Request.parse([3]), "must be bytes"),
        (lambda: Request.read_coils(0, 4).response([1]), "1 values; 4 were requested"),
        (lambda: Response.parse(bytes([3, 2, 0, 1]), 5), "request is 5; it must be a Request"),
    ],
)
def test_arguments_out_of_range_are_named(make, message):
    with pytest.raises(ArgumentError, match=message):
        make()


@pytest.mark.parametrize(
    ("pdu", "error", "message"),
    [
        ("", LengthError, "0 bytes"),
        ("07", UnknownCallError, "function code is 7"),
        ("83", UnknownCallError, "131"),
        ("0300000001ff", LengthError, "6 bytes; it must have 5"),
        ("0300000000", FieldError, "quantity is 0"),
        ("050000ff01", FieldError, "coil value is 0xFF01"),
        ("0f0000000901ff", FieldError, "byte count is 1, .* 9 coils"),
        ("0f0000000802ff", LengthError, "byte count is 2, but 1 bytes"),
        ("100000000204000a", LengthError, "byte count is 4, but 2 bytes"),
        ("100000000202000a", FieldError, "byte count is 2; it must be 2 x 2"),
        ("1000000001", LengthError, "6 or more"),
        ("17000000010000000102000a", UnknownCallError, "function code is 23"),
    ],
)
def test_faulty_requests_are_refused_by_field(pdu, error, message):
    with pytest.raises(error, match=message) as caught:
        Request.parse(bytes.fromhex(pdu))
    assert caught.type is error


READ = Request.read_holding_registers(0, 2)
WRITE = Request.write_multiple_registers(1, [0, 0])


@pytest.mark.parametrize(
    ("pdu", "request_", "error", "message"),
    [
        ("0303000000", None, FieldError, "an even number"),
        ("0300", None, FieldError, "registers has 0 values"),
        ("030200010002", None, LengthError, "byte count is 2, but 4 bytes"),
        ("8307", None, FieldError, "exception is 7"),
        ("8302ff", None, LengthError, "must have 2"),
        ("80", None, UnknownCallError, "128"),
        ("04020000", READ, MismatchError, "function code is 4, but 3"),
        ("8402", READ, MismatchError, "function code is 4"),
        ("03020000", READ, MismatchError, "byte count is 2, .* requires 4"),
        ("0101ff", Request.read_coils(0, 9), MismatchError, "byte count is 1"),
        ("0600010003", Request.write_single_register(1, 4), MismatchError, "echo is 0600010003"),
        ("1000010003", WRITE, MismatchError, "00010003.*00010002"),
    ],
)
def test_faulty_responses_are_refused_by_field(pdu, request_, error, message):
    with pytest.raises(error, match=message) as caught:
        Response.parse(bytes.fromhex(pdu), request_)
    assert caught.type is error


@pytest.mark.parametrize(
    ("pdu", "fields"),
    [
        (READ, "unit id, function code, starting address, quantity, CRC"),
        (READ.response([0] * 2), "unit id, function code, byte count, values, CRC"),
        (READ.exception(2), "unit id, function code, exception code, CRC"),
        (Request.write_single_register(1, 2), "unit id, function code, address, value, CRC"),
        (WRITE, "unit id, function code, starting address, quantity, byte count, values, CRC"),
        (WRITE.response(), "unit id, function code, starting address, quantity, CRC"),
        (bytes.fromhex("2b0e"), "unit id, function code, data, CRC"),
    ],
)
def test_a_table_names_each_field_and_contains_every_byte(pdu, fields):
    adu = Adu(1, pdu)
    table = adu.table()
    assert ", ".join(table.index) == fields
    assert bytes.fromhex("".join(table["bytes"])) == adu.rtu
    tcp = Adu(1, pdu, 5).table()
    assert bytes.fromhex("".join(tcp["bytes"])) == Adu(1, pdu, 5).tcp
    assert list(tcp.index[:4]) == ["transaction id", "protocol id", "length", "unit id"]


@pytest.mark.parametrize(
    ("framing", "frame", "error", "message"),
    [
        ("rtu", b"\1\3\0", LengthError, "the RTU frame has 3 bytes; it must have 4..256"),
        ("rtu", bytes(257), LengthError, "the RTU frame has 257 bytes; it must have 4..256"),
        ("rtu", b"123456789\0\0", CrcError, "CRC is 0x0000, but the bytes before it give 0x4B37"),
        ("tcp", bytes(7), LengthError, "the TCP frame has 7 bytes; it must have 8..260"),
        ("tcp", bytes(261), LengthError, "the TCP frame has 261 bytes; it must have 8..260"),
        ("tcp", b"\0\0\0\1\0\2\xff\3", FieldError, "protocol id is 1; it must be 0"),
        ("tcp", b"\0\0\0\0\0\3\xff\3", LengthError, "length field is 3, but 2 bytes follow it"),
        ("x", bytes(9), ArgumentError, "framing is 'x'; it must be one of 'rtu', 'tcp'"),
    ],
)
def test_faulty_frames_are_refused(framing, frame, error, message):
    with pytest.raises(error) as caught:
        decode(frame, framing)
    assert caught.type is error
    assert str(caught.value) == message


def test_a_reserved_unit_id_with_a_right_crc_is_refused():
    for unit in range(1, 256):
        body = bytes([unit]) + b"\x03\0\0\0\1"
        frame = body + crc_by_shifting(body).to_bytes(2, "little")
        if unit <= 247:
            assert decode(frame).unit_id == unit
        else:
            with pytest.raises(FieldError, match=r"unit id is .*0\.\.247"):
                decode(frame)


def test_numpy_values_are_numbers_too():
    registers = np.array([1, 2], np.uint16)
    assert Request.write_multiple_registers(np.int64(1), registers).registers == (1, 2)
    assert Request.write_multiple_coils(0, np.array([True, False])).coils == (True, False)
    assert Request.write_single_coil(0, 1) == Request.write_single_coil(0, True)


# Against pymodbus: it reads our frames, and encodes what it read to the same bytes.


def read_by_pymodbus(framing, server, ours, unit, transaction):
    """Return our message as pymodbus reads it from its frame."""
    framer = FRAMERS[framing](DecodePDU(server))
    transaction = transaction if framing == "tcp" else 0
    frame = getattr(Adu(unit, ours, transaction), framing)
    used, theirs = framer.handleFrame(frame, 0, 0)
    assert used == len(frame)
    assert (theirs.dev_id, theirs.transaction_id) == (unit, transaction)
    assert framer.buildFrame(theirs) == frame
    assert theirs.function_code & 0x7F == ours.function
    if ours.coils:
        assert theirs.bits[: len(ours.coils)] == list(ours.coils)
    assert list(ours.registers) in ([], list(theirs.registers))
    return theirs


@pytest.mark.parametrize("framing", FRAMERS)
@settings(max_examples=200)
@given(ours=REQUESTS, unit=UNIT, transaction=WORD)
def test_requests_are_read_by_pymodbus(framing, ours, unit, transaction):
    theirs = read_by_pymodbus(framing, True, ours, unit, transaction)
    assert theirs.address == ours.address
    assert ours.function > 4 or theirs.count == ours.quantity


@pytest.mark.parametrize("framing", FRAMERS)
@settings(max_examples=200)
@given(ours=RESPONSES, unit=UNIT, transaction=WORD)
def test_responses_are_read_by_pymodbus(framing, ours, unit, transaction):
    theirs = read_by_pymodbus(framing, False, ours, unit, transaction)
    if ours.exception is not None:
        assert theirs.exception_code == ours.exception
    elif ours.function > 4:
        assert theirs.address == ours.address
        assert ours.quantity in (None, theirs.count)
    back = Response.parse(ours.pdu)
    if ours.function in (1, 2) and ours.exception is None:
        # The last byte comes back padded to eight coils.
        padding = [False] * (-len(ours.coils) % 8)
        assert back.coils == (*ours.coils, *padding)
    else:
        assert back == ours


def test_a_request_keeps_only_what_its_function_code_sends():
    made = Request(3, 7.0, 2, coils=None, registers="none")
    assert made == Request.read_holding_registers(7, 2) and made.coils == made.registers == ()
    assert hash(made) == hash(Request.read_holding_registers(7, 2))
    assert type(made.function) is FunctionCode and type(made.address) is int
    assert Request(6, 1, 99, coils=[True], registers=[5]) == Request.write_single_register(1, 5)
    assert replace(made, quantity=3).rtu(1) == Request.read_holding_registers(7, 3).rtu(1)
    assert pickle.loads(pickle.dumps(made)) == made
    with pytest.raises(FrozenInstanceError):
        made.address = 1
