import pytest
from hypothesis import given
from hypothesis import strategies as st

from shipnet.errors import ArgumentError
from shipnet.tools.ring_buffer import ACTIONS, CASES, RULES, SIZES, ReceiveRing

PACKET = ("packet",)
ALL = ("empty",)


@given(
    size=st.sampled_from(SIZES),
    rule=st.sampled_from(list(RULES)),
    actions=st.lists(st.sampled_from(list(ACTIONS)), max_size=40).map(tuple),
)
def test_every_byte_is_accounted_for_in_any_order_of_buttons(size, rule, actions):
    tool = ReceiveRing(size, rule, actions)
    result, ring = tool.result, tool.result.ring
    assert ring.case in CASES and f"case {ring.case}" in tool.numbers
    # Every stored byte is read once, lost, or still unread.
    assert 0 <= ring.lost + ring.unread <= ring.written
    assert result.wrong <= result.packets
    assert (result.report and "nothing done" not in result.report) or not actions
    if rule != "printed":
        assert ring.stale == 0


def test_the_printed_repair_loses_bytes_that_the_corrected_ring_keeps():
    late = 3 * PACKET
    rules = ("intended", "corrected")
    printed, corrected = (ReceiveRing(16, rule, (*late, "repair")).result for rule in rules)
    # Of 18 bytes in a ring of 16, two are overwritten. Place 8 is the middle, 12 a packet's start.
    assert (printed.ring.lost, corrected.ring.lost) == (12, 2)
    packets = [ReceiveRing(16, rule, (*late, *ALL)).result.packets for rule in rules]
    assert packets == [1, 2]


def test_a_repair_is_refused_if_none_is_needed():
    result = ReceiveRing(actions=(*PACKET, "repair")).result
    assert "nothing to repair" in result.report and result.ring.unread == 6


def test_endless_reading_is_stopped():
    # The reader is past the last position of the writer, and endlessly returns to it.
    result = ReceiveRing(8, "printed", (*7 * ("byte",), *ALL)).result
    assert "never end" in result.report
    # The packet in the ring is found twice; the second time it is old.
    assert (result.packets, result.wrong) == (2, 1)


def test_more_than_256_packets_are_distinguished():
    result = ReceiveRing(8, "intended", 450 * (*PACKET, *ALL)).result
    assert (result.packets, result.wrong) == (450, 0)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"actions": ("byte", "read")}, "one of actions is 'read'"),
        ({"actions": 2001 * ("byte",)}, "there are 2001 actions"),
    ],
)
def test_a_value_that_is_not_a_choice_is_named(fields, message):
    with pytest.raises(ArgumentError, match=message):
        ReceiveRing(**fields)


def test_the_buttons_do_what_they_say():
    page = ReceiveRing().explore()
    labels = [*(label for label, _ in ACTIONS.values()), "undo", "start again"]
    assert list(page.buttons)[: len(labels)] == labels
    size, rule = page.controls["size"], page.controls["rule"]
    assert (size.value, rule.value) == (ReceiveRing().size, ReceiveRing().rule)
    empty = page.figure.value
    for _ in range(3):
        page.buttons["store a packet"].click()
    assert "to the end of packet 3" in page.text and page.figure.value != empty
    assert "case c: flags differ" in page.text
    page.buttons["repair"].click()
    assert "12 bytes lost" in page.text
    rule.value = "corrected"
    assert "2 bytes lost" in page.text and "12 bytes" not in page.text
    size.value = 128
    assert "nothing to repair" in page.text
    page.buttons["undo"].click()
    assert "to the end of packet 3" in page.text
    page.buttons["start again"].click()
    assert "nothing done yet" in page.text
