from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shipnet.errors import ArgumentError
from shipnet.remote_control import MarkerFormat
from shipnet.remote_control.usart import Status, Usart, send_intended, send_printed

RATES = st.sampled_from([600, 1200, 2400, 4800, 9600])
BYTE = 10 / 9600
PACKET = MarkerFormat().encode({number: 1000 + number for number in range(10)})


def busy_chip(n, rate=9600):
    chip = Usart(10 / rate)
    for byte in range(n):
        chip.write(0x30 + byte, 0.0)
    return chip


def test_ready_and_empty_follow_a_byte_through_the_chip():
    chip = Usart(BYTE)
    assert chip.status(0.0) == Status.TXRDY | Status.TXEMPTY
    chip.write(1, 0.0)
    assert chip.status(0.0) == Status.TXRDY
    chip.write(2, 0.1 * BYTE)
    assert chip.status(0.99 * BYTE) == 0
    assert chip.status(1.01 * BYTE) == Status.TXRDY
    assert chip.status(1.99 * BYTE) == Status.TXRDY
    assert chip.status(2.01 * BYTE) == Status.TXRDY | Status.TXEMPTY
    chip.write(3, 5 * BYTE)
    assert chip.line == [(0.0, 1), (BYTE, 2), (5 * BYTE, 3)]


@given(
    gaps=st.lists(st.tuples(st.integers(0, 255), st.floats(0, 3)), max_size=30),
    character_time=st.floats(1e-4, 1e-2),
)
def test_every_byte_written_goes_out_once_or_was_replaced(gaps, character_time):
    chip, time = Usart(character_time), 0.0
    for byte, gap in gaps:
        time += gap * character_time
        chip.write(byte, time)
    end = chip.finish()
    starts = [start for start, _ in chip.line]
    assert sorted([byte for _, byte in chip.line] + chip.overwritten) == sorted(b for b, _ in gaps)
    assert all(b - a >= character_time * (1 - 1e-9) for a, b in pairwise(starts))
    assert not starts or end == pytest.approx(max(time, starts[-1] + character_time))


@given(rate=RATES, data=st.binary(max_size=40), n=st.integers(0, 2))
def test_the_intended_loop_sends_every_byte_once_whatever_the_chip_was_doing(rate, data, n):
    chip = busy_chip(n, rate)
    sent = send_intended(chip, data)
    assert bytes(byte for _, byte in chip.line) == bytes([0x30, 0x31][:n]) + data
    assert (sent.lost, sent.writes) == (0, len(data))
    assert chip.overwritten == []
    # The line is never idle in between, once a second byte waits.
    if n + len(data) > 1:
        assert chip.finish() == pytest.approx((n + len(data)) * 10 / rate, abs=41e-6)


@given(rate=RATES, data=st.binary(max_size=40), n=st.integers(0, 1))
def test_the_printed_loop_sends_nothing_when_the_chip_is_ready(rate, data, n):
    sent = send_printed(busy_chip(n, rate), data)
    assert sent == (b"", 0, len(data))


@given(rate=RATES, poll=st.floats(2e-6, 2e-4), first=st.integers(0, 255))
def test_the_printed_loop_on_a_busy_chip_repeats_its_first_byte_and_loses_the_rest(
    rate, poll, first
):
    data = bytes([first]) + PACKET[1:]
    chip = busy_chip(2, rate)
    sent = send_printed(chip, data, poll=poll)
    # The byte that waited is replaced; the first of the packet goes out once or more.
    assert set(sent.line) == {first}
    assert sent.lost == 1 + len(data) - 1  # the byte that waited, and all but the first
    assert sent.writes >= len(sent.line)
    assert chip.overwritten[0] == 0x31


def test_a_printed_loop_without_end_is_refused():
    # The chip is always free between a question and the next writing.
    chip = Usart(16.00001 * 2**-14)
    chip.write(1, 0.0)
    chip.write(2, 0.0)
    with pytest.raises(ArgumentError, match=r"poll is 6\.1.*byte 0 is still written"):
        send_printed(chip, b"a", poll=2**-14)


def test_how_often_the_first_byte_is_repeated_depends_on_the_moment():
    counts = {
        len(send_printed(busy_chip(2), PACKET, poll=poll * 1e-6).line) for poll in range(15, 30)
    }
    assert len(counts) > 3


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Usart(0), "character_time is 0"),
        (lambda: Usart(BYTE).write(256, 0.0), r"byte is 256.*0\.\.255"),
        (lambda: Usart(BYTE).status(-1.0), r"time is -1.0 s; it must be 0.0 or more"),
        (lambda: Usart(BYTE).status(float("nan")), "time is nan"),
        (lambda: send_printed(Usart(BYTE), b"a", poll=0), "poll is 0"),
    ],
)
def test_arguments_out_of_range_are_named(make, message):
    with pytest.raises(ArgumentError, match=message):
        make()
