import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shipnet import datasets
from shipnet.asi import Call, Profile, Request, Response
from shipnet.errors import (
    ArgumentError,
    EndBitError,
    FrameError,
    LengthError,
    ParityError,
    StartBitError,
    SymbolError,
    UnknownCallError,
)

FRAMES = datasets.read("asi_datasheet_frames.csv").set_index("name")["bits"]

# One request per call: fields, and the 14 bits derived by hand from the data sheets' table 6.
BY_HAND = [
    (Request.data_exchange(21, 0xE), "00101010111001"),
    (Request.data_exchange(21, 0x6, "A"), "00101010111001"),
    (Request.data_exchange(21, 0x6, "B"), "00101010011011"),
    (Request(Call.WRITE_PARAMETER, 1, 0xF), "00000011111101"),
    (Request(Call.WRITE_PARAMETER, 1, 0x7, "B"), "00000011011111"),
    (Request(Call.ASSIGN_ADDRESS, 0, 5), "00000000010101"),
    (Request(Call.WRITE_ID1, 0, 0x9), "01000000100111"),
    (Request(Call.DELETE_ADDRESS, 3), "01000110000011"),
    (Request(Call.DELETE_ADDRESS, 3, half="B"), "01000110100001"),
    (Request(Call.RESET, 3), "01000111110001"),
    (Request(Call.RESET, 3, half="B"), "01000111010011"),
    (Request(Call.READ_IO_CONFIGURATION, 31), "01111111000011"),
    (Request(Call.READ_ID, 31), "01111111000101"),
    (Request(Call.READ_ID1, 31), "01111111001001"),
    (Request(Call.READ_ID2, 31), "01111111001111"),
    (Request(Call.READ_STATUS, 31), "01111111111001"),
    (Request(Call.READ_STATUS, 31, half="B"), "01111111011011"),
    (Request(Call.BROADCAST_RESET, 31), "01111111010111"),
    (Request(Call.ENTER_PROGRAM_MODE, 0), "01000001110111"),
]


@pytest.mark.parametrize(("request_", "bits"), BY_HAND, ids=lambda value: str(value))
def test_requests_worked_out_by_hand(request_, bits):
    assert request_.bits == bits
    assert Request.parse(bits, extended=request_.half is not None) == request_


def test_the_list_by_hand_has_every_call():
    assert {request.call for request, _ in BY_HAND} == set(Call)
    assert len(Call) == 13


def test_parity_of_the_data_sheets():
    for bits in FRAMES:
        assert bits[:-1].count("1") % 2 == 0
        assert bits.count("1") % 2 == 1
    assert Request(Call.BROADCAST_RESET, 31).bits == FRAMES["broadcast reset"]
    assert Response(6).bits == FRAMES["answer 6"]
    assert Response(0).bits == FRAMES["answer 0"]
    assert Request.data_exchange(21, 0xE).bits == "00101010111001"
    with pytest.raises(ParityError, match=r"00101010111011 has 7 ones"):
        Request.parse("00101010111011")


def readable(parse, bits):
    try:
        parse(bits)
    except UnknownCallError:
        return True
    except FrameError:
        return False
    return True


@pytest.mark.parametrize(("kind", "length"), [(Request, 14), (Response, 7)])
def test_the_fields_say_what_the_decoder_accepts(kind, length):
    fields = kind.fields()
    assert fields["length_bit"].sum() == length
    verdict = {True: "valid", False: "invalid"}
    # A parity bit that matches the start bit prevents a parity error.
    zeros = "0" * (length - 3)
    starts = [verdict[readable(kind.parse, f"{bit}{zeros}{bit}1")] for bit in "01"]
    ends = [verdict[readable(kind.parse, f"0{zeros}0{bit}")] for bit in "01"]
    assert fields.loc["ST", ["value_0", "value_1"]].tolist() == starts
    assert fields.loc["EB", ["value_0", "value_1"]].tolist() == ends
    assert fields.loc["PB", "ones_even_over"] == "all bits but the end bit"
    for number in range(2 ** (length - 2)):
        bits = f"0{number:0{length - 2}b}1"
        assert readable(kind.parse, bits) == (bits[:-1].count("1") % 2 == 0)


def test_an_ab_slave_has_three_output_bits():
    assert Profile.parse("S-7.A.E").output_bits == 3
    assert Profile.parse("S-7.F").output_bits == 4
    with pytest.raises(ArgumentError, match=r"data is 8; .*0\.\.7"):
        Request.data_exchange(1, 8, "A")


def legal_requests():
    for call in Call:
        for half in (None, "A", "B"):
            layout = call.rule.layout(half is not None)
            if half and "s" not in layout.lower():
                continue
            addresses = (
                range(call.rule.lowest_address, 32) if "a" in layout else [int(layout[1:6], 2)]
            )
            lowest = int(call is Call.ASSIGN_ADDRESS)
            for address, data in itertools.product(
                addresses, range(lowest, 2 ** layout.count("d"))
            ):
                yield Request(call, address, data, half)


def test_every_legal_request_is_parsed_from_its_bits():
    requests = list(legal_requests())
    for request in requests:
        assert Request.parse(request.bits, extended=request.half is not None) == request
        assert len(request.bits) == 14
        assert "\n" not in str(request)
        assert str(request)
    for extended in (False, True):
        same_mode = [r.bits for r in requests if (r.half is not None) == extended]
        assert len(same_mode) == len(set(same_mode)), "two calls share their bits"


def test_all_words_are_either_a_request_or_a_named_error():
    seen = set()
    for word in range(2**14):
        bits = f"{word:014b}"
        try:
            assert Request.parse(bits).bits == bits
        except FrameError as error:
            seen.add(type(error))
    assert seen == {StartBitError, EndBitError, ParityError, UnknownCallError}


@given(st.text(alphabet="01 x\x00\u0661", max_size=20) | st.text(max_size=20))
def test_no_text_crashes_the_decoders(text):
    for parse in (Request.parse, Response.parse):
        try:
            assert parse(text).bits == text
        except FrameError as error:
            assert str(error)


BAD_REQUESTS = {
    LengthError: ("", 13 * "0", 15 * "1"),
    SymbolError: ("0010101011100x", "0010101011100X", "0010101011100\u0661"),
    StartBitError: ("10101010111001",),
    EndBitError: ("00101010111000",),
    ParityError: ("00101010111011", "00111010111001"),
    # Assign address 0; control bit without a call; reserved information 11111.
    UnknownCallError: ("00000000000001", "01000010000111", "01101011111111"),
}
BAD_RESPONSES = {
    LengthError: ("001100", "00110011"),
    SymbolError: ("0O11001",),
    StartBitError: ("1011001",),
    EndBitError: ("0011000",),
    ParityError: ("0011011",),
}
MESSAGES = {
    LengthError: r"^a \w+ has \d+ bits, but '.*' has \d+$",
    SymbolError: r"has '.' at bit \d+; bits are 0 or 1$",
    StartBitError: "starts with 1; the start bit is 0$",
    EndBitError: "ends with 0; the end bit is 1$",
    ParityError: r"has \d ones before .*; with the parity bit \d their number must be even$",
    UnknownCallError: r": no call has control bit \d, address \d+ and information \d{5}$",
}


@pytest.mark.parametrize(
    ("parse", "bad"), [(Request.parse, BAD_REQUESTS), (Response.parse, BAD_RESPONSES)]
)
def test_bad_bits_are_named(parse, bad):
    for kind, words in bad.items():
        for bits in words:
            with pytest.raises(kind, match=MESSAGES[kind]):
                parse(bits)


@pytest.mark.parametrize("bits", [None, 12, b"00101010111001", ["0"] * 14])
def test_bits_of_another_type(bits):
    for parse in (Request.parse, Response.parse):
        with pytest.raises(ArgumentError, match=r"^bits is .*; it must be a str$"):
            parse(bits)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Request.data_exchange(32, 0), r"address is 32; .*1\.\.31"),
        (lambda: Request.data_exchange(-1, 0), "address is -1"),
        (lambda: Request.data_exchange(0, 0), r"address is 0; .*: data exchange needs an address"),
        (lambda: Request(Call.WRITE_PARAMETER, 0, 0), "address is 0"),
        (lambda: Request(Call.DELETE_ADDRESS, 0), "address is 0"),
        (lambda: Request.data_exchange(1, 16), r"data is 16; .*0\.\.15"),
        (lambda: Request.data_exchange(1, 8, "B"), r"data is 8; .*7 in .* if half is B$"),
        (lambda: Request.data_exchange(1, 1.5), r"data is 1\.5; .*whole number"),
        (lambda: Request.data_exchange(True, 1), "address is True"),
        (lambda: Request.data_exchange("1", 1), "address is '1'"),
        (lambda: Request.data_exchange(1, 1, "C"), "half is 'C'"),
        (lambda: Request(Call.ASSIGN_ADDRESS, 0, 0), r"data is 0; .*1\.\.31"),
        (lambda: Request(Call.ASSIGN_ADDRESS, 0, 32), "data is 32"),
        (lambda: Request(Call.WRITE_ID1, 0, 16), "data is 16"),
        (lambda: Request(Call.RESET, 32), "address is 32"),
        (lambda: Request(Call.READ_ID, -1), "address is -1"),
        (lambda: Request(Call.ASSIGN_ADDRESS, 0, 3, "B"), "assign address has no select bit"),
        (lambda: Request(Call.ASSIGN_ADDRESS, 4, 3), r"address is 4; .*0\.\.0 for assign"),
        (lambda: Request(Call.BROADCAST_RESET, 0), r"address is 0; .*31\.\.31"),
        (lambda: Request(Call.ASSIGN_ADDRESS, 0.5, 3), r"address is 0\.5"),
        (lambda: Request(Call.ENTER_PROGRAM_MODE, False), "address is False"),
        (lambda: Request.data_exchange(1, 1).answer(False), "data is False"),
        (lambda: Request.data_exchange(1, 1).answer(""), "data is ''"),
        (lambda: Request(Call.RESET, 3, 1), r"data is 1; .*0\.\.0 in reset slave"),
        (lambda: Response(16), r"data is 16; .*0\.\.15 in a response$"),
        (lambda: Response(0, Call.BROADCAST_RESET), "which has no response"),
        (lambda: Request(Call.BROADCAST_RESET, 31).answer(), "which has no response"),
        (lambda: Request.data_exchange(1, 1).answer(), "data is missing"),
        (lambda: Request(13, 1), r"call is 13; it must be a whole number 0\.\.12"),
    ],
)
def test_bad_arguments_name_value_and_range(make, message):
    with pytest.raises(ArgumentError, match=message):
        make()


def test_answers_of_every_call():
    for call in Call:
        request = next(r for r in legal_requests() if r.call is call)
        if call.rule.answer is None:
            continue
        if isinstance(call.rule.answer, int):
            assert request.answer() == Response(call.rule.answer, call)
        answer = request.answer(call.rule.answer if isinstance(call.rule.answer, int) else 5)
        assert "requires" not in str(answer)
        assert Response.parse(answer.bits, call) == answer
        assert str(answer).startswith(f"response to {call.rule.title}: ")
    surprise = Response(3, Call.RESET)
    assert "requires 6" in str(surprise)


FIXED = {
    # SAP5S/SAP51 data sheet, table 6: what every slave must answer.
    Call.ASSIGN_ADDRESS: 6,
    Call.WRITE_ID1: 0,
    Call.DELETE_ADDRESS: 0,
    Call.RESET: 6,
}


def test_fixed_and_missing_answers_are_those_of_the_data_sheet():
    for call in Call:
        answer = call.rule.answer
        assert FIXED.get(call) == (answer if isinstance(answer, int) else None)
    silent = [call for call in Call if call.rule.answer is None]
    assert silent == [Call.BROADCAST_RESET, Call.ENTER_PROGRAM_MODE]
    assert Request(Call.RESET, 3).answer(0x1) == Response(0x1, Call.RESET)


@pytest.mark.parametrize(
    ("request_", "text"),
    [
        (Request.data_exchange(21, 0xB), "data exchange with slave 21: outputs 1011 (B)"),
        (Request.data_exchange(21, 0x3, "B"), "data exchange with slave 21B: outputs 011 (3)"),
        (Request(Call.WRITE_PARAMETER, 7, 0x9), "write parameter 1001 (9) to slave 7"),
        (Request(Call.ASSIGN_ADDRESS, 0, 29), "assign address 29 to the slave at address 0"),
        (
            Request(Call.WRITE_ID1, 0, 0xC),
            "write extended ID code 1 1100 (C) to the slave at address 0",
        ),
        (Request(Call.DELETE_ADDRESS, 8), "delete the address of slave 8"),
        (Request(Call.RESET, 9, half="A"), "reset slave 9A"),
        (Request(Call.READ_IO_CONFIGURATION, 3), "read the I/O configuration of slave 3"),
        (Request(Call.READ_ID, 4), "read the ID code of slave 4"),
        (Request(Call.READ_ID1, 5), "read extended ID code 1 of slave 5"),
        (Request(Call.READ_ID2, 6), "read extended ID code 2 of slave 6"),
        (Request(Call.READ_STATUS, 12), "read the status of slave 12"),
        (Request(Call.BROADCAST_RESET, 31), "broadcast reset of all slaves, without response"),
        (Request(Call.ENTER_PROGRAM_MODE, 0), "enter program mode at address 0, without response"),
    ],
)
def test_a_request_describes_itself(request_, text):
    assert str(request_) == text


@pytest.mark.parametrize(
    ("response", "text"),
    [
        (Response(0xB), "response: 1011 (B)"),
        (Response(0xB, Call.DATA_EXCHANGE), "response to data exchange: inputs 1011 (B)"),
        (Response(0xB, Call.WRITE_PARAMETER), "response to write parameter: 1011 (B)"),
        (Response(0x6, Call.ASSIGN_ADDRESS), "response to assign address: 6, done"),
        (
            Response(0x6, Call.DELETE_ADDRESS),
            "response to delete address: 6, but the standard requires 0",
        ),
        (
            Response(0x9, Call.READ_IO_CONFIGURATION),
            "response to read I/O configuration: 9, ports D0..D3 OUT OUT OUT IN",
        ),
        (Response(0xA, Call.READ_ID), "response to read ID code: 1010 (A)"),
        (Response(0x2, Call.READ_STATUS), "response to read status: 0010, S1 periphery fault"),
    ],
)
def test_a_response_describes_itself(response, text):
    assert str(response) == text


def test_the_reading_of_the_select_bit():
    assert Request.parse(Request(Call.READ_ID, 4, half="B").bits).slave == "4B"
    assert Request.parse(Request(Call.READ_ID, 4, half="A").bits).slave == "4"
    assert Request.parse(Request(Call.READ_ID, 4, half="A").bits, extended=True).slave == "4A"
