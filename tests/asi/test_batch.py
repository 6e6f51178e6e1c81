import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis.extra import numpy as hnp

from shipnet.asi import Call, Request, Requests, Response
from shipnet.asi.batch import NONE, parse_responses
from shipnet.asi.telegram import all_requests
from shipnet.errors import ArgumentError, FrameError, LengthError

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
