"""Bitwise arbitration and its picture."""

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from matplotlib.figure import Figure

from shipnet.can.frame import Frame, arbitrate
from shipnet.errors import ArgumentError


@st.composite
def frames(draw):
    # Few ids, so that standard and extended frames often begin alike.
    base, remote = draw(st.sampled_from([0, 1, 0x100, 0x101, 0x555, 0x7FF])), draw(st.booleans())
    data = b"" if remote else draw(st.binary(max_size=2))
    if draw(st.booleans()):
        rest = draw(st.sampled_from([0, 1, 0x3FFFF]))
        return Frame(base << 18 | rest, data, extended=True, remote=remote)
    return Frame(base, data, remote=remote)


def key(frame):
    """Return the bits that decide an arbitration, as they are sent."""
    number = frame.arbitration_id
    if frame.extended:
        return f"{number >> 18:011b}11{number & 0x3FFFF:018b}{frame.remote:d}"
    return f"{number:011b}{frame.remote:d}0" + 19 * "0"


@given(st.lists(frames(), min_size=1, max_size=6, unique_by=key))
def test_the_frame_with_the_lowest_bits_wins_and_is_on_the_bus(contenders):
    contest = arbitrate(contenders)
    assert contest.winner == min(contenders, key=key)
    assert contest.winner.bits.startswith(contest.bus)
    for frame, stopped in zip(contenders, contest.stopped, strict=True):
        if stopped is not None:
            assert frame.bits[:stopped] == contest.bus[:stopped]
            assert frame.bits[stopped] == "1" and contest.bus[stopped] == "0"


@given(frames(), frames())
def test_two_senders_part_where_their_bits_first_differ(one, other):
    assume(key(one) != key(other))
    place = next(k for k, (a, b) in enumerate(zip(one.bits, other.bits, strict=False)) if a != b)
    assert max(stopped or 0 for stopped in arbitrate([one, other]).stopped) == place


def test_by_its_rtr_a_standard_data_frame_beats_an_extended_one_that_begins_alike():
    contest = arbitrate([Frame(0x555 << 18, extended=True), Frame(0x555)])
    assert contest.stopped == (12, None)
    # A remote frame also sends a recessive RTR, and wins one bit later by its IDE bit.
    assert arbitrate([Frame(0x555 << 18, extended=True), Frame(0x555, remote=True)]).stopped == (
        13,
        None,
    )


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ([], "frames is empty; it must contain at least one Frame"),
        (
            [Frame(1), Frame(1, b"\x01")],
            "frames 001# and 001#01 have the same id; they would collide in their data",
        ),
    ],
)
def test_frames_that_would_collide_are_refused(wrong, message):
    with pytest.raises(ArgumentError) as caught:
        arbitrate(wrong)
    assert str(caught.value) == message


@pytest.mark.parametrize(
    ("frame", "last"), [(Frame(0x155), "IDE"), (Frame(0x15555555, extended=True), "RTR")]
)
def test_the_bus_has_exactly_the_bits_that_can_decide(frame, last):
    decides = {field.name: field.line_start for field in frame.fields}[last]
    assert arbitrate([frame]).bus == frame.bits[: decides + 1]


CONTEST = arbitrate([Frame(0x100), Frame(0x101), Frame(0x200)])


def test_the_picture_refuses_names_and_bits_that_do_not_fit():
    with pytest.raises(ArgumentError, match="2 names for 3 frames"):
        CONTEST.plot(["a", "b"], Figure().subplots())
    with pytest.raises(ArgumentError, match="upto"):
        CONTEST.plot(["a", "b", "c"], Figure().subplots(), upto=15)
