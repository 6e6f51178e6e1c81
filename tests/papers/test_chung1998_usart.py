from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shipnet.errors import ArgumentError
from shipnet.papers.chung1998.usart import Status, Usart, send
from shipnet.remote_control import MarkerFormat

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
    gaps=st.lists(st.tuples(st.integers(0, 255), st.floats(0, 3)), min_size=1, max_size=30),
    character_time=st.floats(1e-4, 1e-2),
)
def test_every_byte_written_goes_out_once_or_is_replaced(gaps, character_time):
    chip, time, replaced = Usart(character_time), 0.0, 0
    for byte, gap in gaps:
        time += gap * character_time
        replaced += chip.write(byte, time)
    end = chip.finish()
    starts = [start for start, _ in chip.line]
    assert len(starts) + replaced == len(gaps) and chip.line[-1][1] == gaps[-1][0]
    assert all(b - a >= character_time * (1 - 1e-9) for a, b in pairwise(starts))
    assert end == pytest.approx(starts[-1] + character_time) and end > time


@given(rate=RATES, data=st.binary(max_size=40), n=st.integers(0, 2))
def test_the_intended_loop_sends_every_byte_once_whatever_the_chip_was_doing(rate, data, n):
    chip = busy_chip(n, rate)
    sent = send(chip, data, printed=False)
    assert bytes(byte for _, byte in chip.line) == bytes([0x30, 0x31][:n]) + data
    assert (sent.lost, sent.writes) == (0, len(data))
    # The line is never idle in between, once a second byte waits.
    if n + len(data) > 1:
        assert chip.finish() == pytest.approx((n + len(data)) * 10 / rate, abs=41e-6)


@given(rate=RATES, data=st.binary(max_size=40), n=st.integers(0, 1))
def test_the_printed_loop_sends_nothing_when_the_chip_is_ready(rate, data, n):
    assert send(busy_chip(n, rate), data, printed=True) == (b"", 0, len(data))


@given(rate=RATES, poll=st.floats(2e-6, 2e-4), first=st.integers(0, 255))
def test_the_printed_loop_on_a_busy_chip_repeats_its_first_byte_and_loses_the_rest(
    rate, poll, first
):
    data, chip = bytes([first]) + PACKET[1:], busy_chip(2, rate)
    sent = send(chip, data, printed=True, poll=poll)
    # The byte that waited is replaced; the first of the packet goes out once or more.
    assert set(sent.line) == {first}
    assert 0x31 not in (byte for _, byte in chip.line[: -len(sent.line)])
    assert sent.lost == 1 + len(data) - 1  # the byte that waited, and all but the first
    assert sent.writes >= len(sent.line)


def test_how_often_the_first_byte_is_repeated_depends_on_the_moment():
    lines = [send(busy_chip(2), PACKET, printed=True, poll=1e-6 * k).line for k in range(15, 30)]
    assert len({len(line) for line in lines}) > 3


def test_a_printed_loop_without_end_is_refused():
    # The chip is always free between a question and the next writing.
    chip = Usart(16.00001 * 2**-14)
    chip.write(1, 0.0)
    chip.write(2, 0.0)
    with pytest.raises(ArgumentError, match=r"poll is 6\.1.*byte 0 is still being rewritten"):
        send(chip, b"a", printed=True, poll=2**-14)
    with pytest.raises(ArgumentError, match="poll is 0"):
        send(Usart(BYTE), b"a", printed=True, poll=0)
