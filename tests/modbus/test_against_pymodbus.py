"""Our frames and PDUs against pymodbus and minimalmodbus, byte by byte, in both directions."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymodbus.framer import FramerAscii, FramerRTU, FramerSocket
from pymodbus.pdu import DecodePDU
from pymodbus.pdu import ExceptionResponse as TheirException
from pymodbus.pdu import bit_message as bits_of
from pymodbus.pdu import register_message as registers_of

from shipnet.errors import FieldError
from shipnet.modbus.pdu import Adu, Request, Response, decode

WORD, UNIT = st.integers(0, 0xFFFF), st.integers(1, 247)
FRAMERS = {
    "rtu": FramerRTU,
    "ascii": FramerAscii,
    "tcp": FramerSocket,
}


def words(most):
    return st.lists(WORD, min_size=1, max_size=most)


def coils(most):
    return st.lists(st.booleans(), min_size=1, max_size=most)


def reads(function, most, theirs):
    return st.builds(
        lambda address, count: (
            Request.read(function, address, count),
            theirs(address=address, count=count),
        ),
        WORD,
        st.integers(1, most),
    )


REQUESTS = {
    1: reads(1, 2000, bits_of.ReadCoilsRequest),
    2: reads(2, 2000, bits_of.ReadDiscreteInputsRequest),
    3: reads(3, 125, registers_of.ReadHoldingRegistersRequest),
    4: reads(4, 125, registers_of.ReadInputRegistersRequest),
    5: st.builds(
        lambda a, v: (
            Request.write_single_coil(a, v),
            bits_of.WriteSingleCoilRequest(address=a, bits=[v]),
        ),
        WORD,
        st.booleans(),
    ),
    6: st.builds(
        lambda a, v: (
            Request.write_single_register(a, v),
            registers_of.WriteSingleRegisterRequest(address=a, registers=[v]),
        ),
        WORD,
        WORD,
    ),
    15: st.builds(
        lambda a, v: (Request.write_multiple_coils(a, v), bits_of.WriteMultipleCoilsRequest(a, v)),
        WORD,
        coils(1968),
    ),
    16: st.builds(
        lambda a, v: (
            Request.write_multiple_registers(a, v),
            registers_of.WriteMultipleRegistersRequest(address=a, registers=v),
        ),
        WORD,
        words(123),
    ),
    23: st.builds(
        lambda r, n, w, v: (
            Request.read_write_multiple_registers(r, n, w, v),
            registers_of.ReadWriteMultipleRegistersRequest(
                read_address=r, read_count=n, write_address=w, write_registers=v
            ),
        ),
        WORD,
        st.integers(1, 125),
        WORD,
        words(121),
    ),
}


def read_bits(function, theirs):
    return st.builds(lambda v: (Response(function, coils=v), theirs(bits=v)), coils(2000))


def read_registers(function, theirs):
    return st.builds(lambda v: (Response(function, registers=v), theirs(registers=v)), words(125))


def written(function, most, theirs):
    return st.builds(
        lambda a, n: (Response(function, address=a, quantity=n), theirs(address=a, count=n)),
        WORD,
        st.integers(1, most),
    )


RESPONSES = {
    1: read_bits(1, bits_of.ReadCoilsResponse),
    2: read_bits(2, bits_of.ReadDiscreteInputsResponse),
    3: read_registers(3, registers_of.ReadHoldingRegistersResponse),
    4: read_registers(4, registers_of.ReadInputRegistersResponse),
    5: st.builds(
        lambda a, v: (
            Request.write_single_coil(a, v).response(),
            bits_of.WriteSingleCoilResponse(address=a, bits=[v]),
        ),
        WORD,
        st.booleans(),
    ),
    6: st.builds(
        lambda a, v: (
            Request.write_single_register(a, v).response(),
            registers_of.WriteSingleRegisterResponse(address=a, registers=[v]),
        ),
        WORD,
        WORD,
    ),
    15: written(15, 1968, bits_of.WriteMultipleCoilsResponse),
    16: written(16, 123, registers_of.WriteMultipleRegistersResponse),
    23: read_registers(23, registers_of.ReadWriteMultipleRegistersResponse),
    "exception": st.builds(
        lambda f, e: (Response(f, exception=e), TheirException(f, e)),
        st.integers(1, 127),
        st.sampled_from([1, 2, 3, 4, 5, 6, 8, 10, 11]),
    ),
}


def their_pdu(message):
    return bytes([message.function_code]) + message.encode()


def agree(framing, server, ours, theirs, unit, transaction):
    """Compare both encoders, then read the frame of each with the reader of the other."""
    framer = FRAMERS[framing](DecodePDU(server))
    transaction = transaction if framing == "tcp" else 0
    theirs.dev_id, theirs.transaction_id = unit, transaction
    frame = getattr(Adu(unit, ours, transaction), framing)
    assert framer.buildFrame(theirs) == frame
    adu = decode(framer.buildFrame(theirs), framing)
    assert (adu.unit_id, adu.transaction_id or 0) == (unit, transaction)
    used, read = framer.handleFrame(frame, 0, 0)
    assert used == len(frame)
    assert (read.dev_id, read.transaction_id) == (unit, transaction)
    assert their_pdu(read) == ours.pdu
    return adu.pdu


@pytest.mark.parametrize("framing", FRAMERS)
@pytest.mark.parametrize("function", REQUESTS)
@settings(max_examples=25)  # of each function code in each framing
@given(data=st.data(), unit=UNIT, transaction=WORD)
def test_requests_are_the_same_bytes_and_read_alike(framing, function, data, unit, transaction):
    ours, theirs = data.draw(REQUESTS[function])
    assert Request.parse(agree(framing, True, ours, theirs, unit, transaction)) == ours


@pytest.mark.parametrize("framing", FRAMERS)
@pytest.mark.parametrize("function", RESPONSES)
@settings(max_examples=25)  # of each function code in each framing
@given(data=st.data(), unit=UNIT, transaction=WORD)
def test_responses_are_the_same_bytes_and_read_alike(framing, function, data, unit, transaction):
    ours, theirs = data.draw(RESPONSES[function])
    back = Response.parse(agree(framing, False, ours, theirs, unit, transaction))
    if (
        ours.function in (1, 2) and ours.exception is None
    ):  # the last byte is full of coils when it comes back
        assert back.coils[: len(ours.coils)] == ours.coils
        assert not any(back.coils[len(ours.coils) :])
    else:
        assert back == ours


def reserved(unit):
    """Return an RTU frame to a reserved unit id, which pymodbus sends without a word."""
    request = registers_of.ReadHoldingRegistersRequest(address=0, count=1, dev_id=unit)
    return FramerRTU(DecodePDU(True)).buildFrame(request)


def test_frames_to_reserved_unit_ids_are_refused_though_their_crc_is_right():
    rows = [reserved(unit) for unit in range(1, 256)]
    assert all(decode(row).unit_id == row[0] for row in rows[:247])
    for row in rows[247:]:
        with pytest.raises(FieldError, match=r"unit id is .*0\.\.247"):
            decode(row)
