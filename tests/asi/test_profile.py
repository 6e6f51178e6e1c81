import itertools

import pytest

from shipnet.asi import Profile
from shipnet.asi.profile import (
    IO_CONFIGURATIONS,
    describe_io_configuration,
    describe_status,
)
from shipnet.errors import ArgumentError


def test_io_codes_mirror_inputs_and_outputs():
    swap = {"IN": "OUT", "OUT": "IN", "I/O": "I/O"}
    for code in (0, 1, 2, 3, 4, 5, 6):
        assert tuple(swap[port] for port in IO_CONFIGURATIONS[code]) == IO_CONFIGURATIONS[code + 8]
    assert len(set(IO_CONFIGURATIONS)) == 16


@pytest.mark.parametrize("code", [-1, 16, 1.5, "3", None, True])
def test_codes_out_of_range(code):
    with pytest.raises(ArgumentError, match=r"0\.\.15"):
        describe_io_configuration(code)
    with pytest.raises(ArgumentError, match=r"0\.\.15"):
        describe_status(code)
    with pytest.raises(ArgumentError, match=r"0\.\.15"):
        Profile(code, 0)


def test_status_flags():
    assert describe_status(0) == "no flag set"
    assert describe_status(0b1001).split(", ") == [
        "S0 address or ID code still volatile",
        "S3 memory read error",
    ]
    assert describe_status(0b0100) == "S2 reserved"


def test_profiles_are_parsed_from_their_text():
    for codes in itertools.product(range(16), range(16), [None, *range(16)]):
        profile = Profile(*codes)
        assert Profile.parse(str(profile)) == profile
        assert profile.extended == (codes[1] == 10)


def test_only_id_code_a_shares_its_address():
    assert [code for code in range(16) if Profile(7, code).extended] == [0xA]


@pytest.mark.parametrize("text", ["", "7.A.E", "S-7", "S-G.A", "S-7.A.E.0", "S-7.A.", "S-77.A"])
def test_other_profiles_are_refused(text):
    with pytest.raises(ArgumentError, match="must look like"):
        Profile.parse(text)
