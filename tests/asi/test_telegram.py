import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from shipnet import datasets
from shipnet.asi import Call, Profile, Request, Requests, Response
from shipnet.asi.batch import NONE, parse_responses
from shipnet.asi.telegram import all_requests
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
        (lambda: Request.data_exchange(0, 0), r"address is 0; .*: data exchange needs an address"),
        (lambda: Request.data_exchange(1, 16), r"data is 16; .*0\.\.15"),
        (lambda: Request.data_exchange(1, 8, "B"), r"data is 8; .*7 in .* if half is B$"),
        (lambda: Request.data_exchange(1, 1.5), r"data is 1\.5; .*whole number"),
        (lambda: Request.data_exchange(True, 1), "address is True"),
        (lambda: Request.data_exchange(1, 1, "C"), "half is 'C'"),
        (lambda: Request(Call.ASSIGN_ADDRESS, 0, 0), r"data is 0; .*1\.\.31"),
        (lambda: Request(Call.ASSIGN_ADDRESS, 0, 3, "B"), "assign address has no select bit"),
        (lambda: Request(Call.ASSIGN_ADDRESS, 4, 3), r"address is 4; .*0\.\.0 for assign"),
        (lambda: Request(Call.BROADCAST_RESET, 0), r"address is 0; .*31\.\.31"),
        (lambda: Request.data_exchange(1, 1).answer(False), "data is False"),
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


LETTER = re.compile(r"([adsS])\1*")
HALVES = {None: NONE, "A": 0, "B": 1}


@pytest.mark.parametrize("extended", [False, True])
def test_the_patterns_of_the_data_sheet_say_which_words_are_requests(extended):
    read: dict[str, list[Request]] = {}
    for bits, request in all_requests(extended).items():
        read.setdefault(bits[1:-2], []).append(request)
    for information in range(2**11):
        word = f"{information:011b}"
        meanings = []
        for call in Call:
            layout = call.rule.layout(extended)
            pattern = LETTER.sub(lambda n: f"(?P<{n[1]}>[01]{{{len(n[0])}}})", layout)
            if found := re.fullmatch(pattern, word):
                data, address = int(found.groupdict().get("d", "0"), 2), int(word[1:6], 2)
                addressed = "a" not in found.groupdict() or address >= call.rule.lowest_address
                if addressed and (data or call is not Call.ASSIGN_ADDRESS):
                    select = found.groupdict().get("s", "01"[found.groupdict().get("S") == "0"])
                    selects = extended and "s" in layout.lower()
                    half = "B" if select == "1" else "A" if selects else None
                    meanings.append(Request(call, address, data, half))
        assert meanings == read.get(word, [])


@pytest.mark.parametrize("extended", [False, True])
def test_all_requests_parse_as_the_scalar_code_does(extended):
    batch = Requests.parse(np.arange(2**14), extended=extended)
    for word in range(2**14):
        try:
            request = Request.parse(f"{word:014b}", extended=extended)
            expected = (0, request.call, request.address, request.data, HALVES[request.half])
        except FrameError as error:
            expected = (error.code, NONE, NONE, NONE, NONE)
        assert tuple(int(field[word]) for field in batch) == expected


def test_all_responses_parse_as_the_scalar_code_does():
    data, error = parse_responses(np.arange(2**7))
    for word in range(2**7):
        try:
            expected = (Response.parse(f"{word:07b}").data, 0)
        except FrameError as fault:
            expected = (NONE, fault.code)
        assert (data[word], error[word]) == expected


@given(
    hnp.arrays(hnp.integer_dtypes() | hnp.unsigned_integer_dtypes(), hnp.array_shapes(min_side=0))
)
def test_any_words_of_any_shape_get_a_code(words):
    batch = Requests.parse(words)
    assert all(field.shape == words.shape for field in batch)
    outside = (words.astype(object) < 0) | (words.astype(object) >= 2**14)
    assert ((batch.error == LengthError.code) == outside).all()
    data, error = parse_responses(words)
    assert ((data == NONE) == (error > 0)).all()


def test_extended_may_differ_from_word_to_word():
    word = int(Request.data_exchange(21, 0xE).bits, 2)
    batch = Requests.parse([word, word], extended=[False, True])
    assert batch.data.tolist() == [14, 6]
    assert batch.half.tolist() == [NONE, 0]


@pytest.mark.parametrize("extended", [[True, False], "no", 1, float("nan"), [[True], [False]]])
def test_a_mode_that_does_not_fit_is_refused(extended):
    with pytest.raises(ArgumentError, match="extended"):
        Requests.parse([1, 2, 3], extended=extended)


@pytest.mark.parametrize(
    "values", [[0.5], ["1"], [None], [np.nan], [True], np.array([1], "timedelta64[s]")]
)
def test_other_types_are_refused(values):
    for function in (Requests.parse, parse_responses):
        with pytest.raises(ArgumentError, match="must be whole numbers"):
            function(values)


def test_an_ab_slave_has_three_output_bits():
    assert Profile.parse("S-7.A.E").output_bits == 3
    assert Profile.parse("S-7.F").output_bits == 4
    with pytest.raises(ArgumentError, match=r"data is 8; .*0\.\.7"):
        Request.data_exchange(1, 8, "A")
