import itertools
import re
from contextlib import suppress

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shipnet.errors import ArgumentError, CrcError, FieldError, FormError, LengthError
from shipnet.remote_control import CobsFormat, MarkerFormat, System, changed_items
from shipnet.remote_control.packet import DATA_START, PACKET_END, PACKET_START, stuff, unstuff
from shipnet.remote_control.packet_format import flipped
from shipnet.remote_control.station import Sender

CHECKS = ["any", "known", "rising"]
FORMATS = [
    *(
        MarkerFormat(reading, 10, numbers, crc)
        for reading in "AB"
        for numbers in CHECKS
        for crc in (False, True)
    ),
    *(CobsFormat(10, numbers) for numbers in CHECKS),
]
WORDS = st.one_of(
    st.integers(0, 0xFFFF),
    st.sampled_from([0, 0xDDCC, 0xCCDD, 0xEECC, 0xDDDD, 0xEEEE, 0xCC00, 0x00CC, 0xEEDD]),
)
ITEMS = st.dictionaries(st.integers(0, 9), WORDS)
formats = pytest.mark.parametrize("form", FORMATS, ids=str)
streams = pytest.mark.parametrize("form", [FORMATS[k] for k in (0, 3, 8, 11, 13)], ids=str)


@pytest.mark.parametrize(
    ("form", "n_items", "size"),
    [
        (MarkerFormat("A"), 10, 33),
        (MarkerFormat("B"), 10, 42),
        (MarkerFormat("A"), 1, 6),
        (MarkerFormat("B"), 1, 6),
        (MarkerFormat("A"), 0, 3),
        (MarkerFormat("B"), 0, 2),
        (MarkerFormat("A", crc=True), 10, 35),
        (CobsFormat(), 10, 34),
        (CobsFormat(84), 84, 256),
        (MarkerFormat(n_numbers=204), 204, 615),
    ],
)
def test_a_packet_has_the_stated_length(form, n_items, size):
    assert form.size(n_items) == size
    assert len(form.encode(dict.fromkeys(range(n_items), 0))) == size


@streams
@given(packets=st.lists(ITEMS, max_size=5), cuts=st.lists(st.integers(0, 250), max_size=6))
def test_a_stream_may_be_fed_in_any_pieces(form, packets, cuts):
    encoded = list(map(form.encode, packets))
    parser, found, stream = form.parser(), [], b"".join(encoded)
    for start, stop in itertools.pairwise([0, *sorted(cuts), None]):
        found += parser.feed(stream[start:stop])
    assert found == [tuple(sorted(items.items())) for items in packets]
    assert list(map(form.decode, encoded)) == found
    assert parser.discarded == 0


@formats
@given(
    noise=st.one_of(
        st.binary(max_size=400),
        st.lists(st.sampled_from([0xCC, 0xDD, 0xEE, 0, 1, 9, 10]), max_size=400).map(bytes),
    )
)
def test_any_bytes_are_packets_discarded_or_still_open(form, noise):
    parser = form.parser()
    packets = parser.feed(noise)
    accounted = sum(form.size(len(items)) for items in packets) + parser.discarded
    assert 0 <= len(noise) - accounted
    if isinstance(form, MarkerFormat):
        assert len(noise) - accounted < form.size(10)
    if form.numbers != "any":
        assert all(number < 10 for items in packets for number, _ in items)


def accepts(form, packet, bits):
    return form._read(flipped(packet, bits)) is not None


ITEM = bytes([1, 2, 3])
GOOD = MarkerFormat().encode({0: 7})


@pytest.mark.parametrize(
    ("form", "noise", "discarded"),
    [
        (MarkerFormat(), b"\xcc", 1),
        (MarkerFormat(), b"\xcc\xcc\xcc", 3),
        (MarkerFormat(), b"\xdd\xee", 2),
        (MarkerFormat(numbers="known"), b"\xcc\xdd" + ITEM, 5),
        (MarkerFormat(), b"\xcc\xdd" + 10 * ITEM, 32),
        (MarkerFormat(), b"\xcc\xdd" + 11 * ITEM + b"\xee", 36),
        (MarkerFormat(numbers="known"), b"\xcc\xdd" + 2 * ITEM + b"\xee", None),
        (MarkerFormat(numbers="rising"), b"\xcc\xdd" + 2 * ITEM + b"\xee", 9),
    ],
)
def test_a_packet_is_found_after_a_broken_one_and_discarded_bytes_are_counted(
    form, noise, discarded
):
    parser = form.parser()
    found = parser.feed(noise + GOOD)
    assert found[-1] == ((0, 7),)
    assert len(found) == (2 if discarded is None else 1)
    assert parser.discarded == (discarded or 0)


def test_all_bytes_of_an_endless_packet_are_discarded_at_its_zero():
    parser = CobsFormat().parser()
    assert parser.feed(bytes([7]) * 100) == []
    assert parser.feed(b"\0") == []
    assert parser.discarded == 101
    assert parser.feed(CobsFormat().encode({3: 0})) == [((3, 0),)]


@streams
@given(noise=st.binary(max_size=60), items=ITEMS)
def test_the_parser_recovers_after_any_noise(form, noise, items):
    parser = form.parser()
    parser.feed(noise)
    # An incomplete packet of noise can swallow as many bytes as the longest packet has.
    found = [one for _ in range(50) for one in parser.feed(form.encode({0: 1}))]
    assert found[-1] == ((0, 1),)
    assert parser.feed(form.encode({1: 2}))[-1] == ((1, 2),)


@formats
@given(items=ITEMS, data=st.data())
def test_the_stream_agrees_with_decode_on_disturbed_packets(form, items, data):
    packet = bytearray(form.encode(items))
    places = st.tuples(st.integers(0, len(packet) - 1), st.integers(0, 255))
    for place, byte in data.draw(st.lists(places, max_size=4)):
        packet[place] = byte
    found = form.parser().feed(packet)
    whole = len(found) == 1 and form.size(len(found[0])) == len(packet)
    assert [form._read(packet)] == (found if whole else [None])


@pytest.mark.parametrize(
    ("form", "passed", "bits"),
    [
        (MarkerFormat("A"), 240, 264),
        (MarkerFormat("A", numbers="rising"), 160, 264),
        (MarkerFormat("B"), 240, 336),
        (MarkerFormat("A", 1), 24, 48),  # one value per packet: the third interpretation
        (MarkerFormat("A", crc=True), 0, 280),
        (CobsFormat(numbers="any"), 0, 272),
    ],
)
def test_single_flips_that_pass_are_those_that_hit_no_marker(form, passed, bits):
    # Closed form: every bit of number, low and high byte passes if it is not checked.
    values = np.random.default_rng(3).integers(0, 0x10000, form.n_numbers).tolist()
    packet = form.encode(dict(enumerate(values)))
    assert 8 * len(packet) == bits
    assert sum(accepts(form, packet, [bit]) for bit in range(bits)) == passed


def test_the_crc_detects_any_two_flips_in_three_values_and_the_markers_do_not():
    items = dict.fromkeys(range(3), 1000)
    for form, bits, passed in (
        # Both bits must be outside the markers; our numbers become 0xEE only by three or more.
        (MarkerFormat(n_numbers=3), 96, 72 * 71 // 2),
        (MarkerFormat(n_numbers=3, crc=True), 112, 0),
        (CobsFormat(3), 104, 0),
    ):
        packet, pairs = form.encode(items), itertools.combinations(range(bits), 2)
        assert 8 * len(packet) == bits
        assert sum(accepts(form, packet, pair) for pair in pairs) == passed


@pytest.mark.parametrize(
    ("form", "packet", "error"),
    [
        (MarkerFormat(), "", LengthError),
        (MarkerFormat(), "cc dd 01 02", LengthError),
        (MarkerFormat(n_numbers=1), "cc dd 00 02 03 00 02 03 ee", LengthError),
        (MarkerFormat(), "cc dc 01 02 03 ee", FormError),
        (MarkerFormat(), "cc dd ee 02 03 ee", FormError),
        (MarkerFormat("B"), "cc dd 01 02 03 ef", FormError),
        (MarkerFormat(crc=True), "cc dd ee 00 00", CrcError),
        (MarkerFormat(numbers="known"), "cc dd 0a 02 03 ee", FieldError),
        (MarkerFormat(numbers="rising"), "cc dd 01 02 03 01 02 03 ee", FieldError),
        (CobsFormat(), "03 ff ff", LengthError),
        (CobsFormat(), "03 ff ff 01", FormError),
        (CobsFormat(), "02 ff ff 00", FormError),
        (CobsFormat(), "03 ff fe 00", CrcError),
    ],
)
def test_each_fault_has_its_class(form, packet, error):
    with pytest.raises(error) as caught:
        form.decode(bytes.fromhex(packet))
    assert caught.type is error


@pytest.mark.parametrize(
    ("plain", "stuffed"),
    # The first is the example of S. Cheshire and M. Baker, 1999; the others are derived by hand.
    [
        ("45 00 00 2c 4c 79 00 00 40 06 4f 37", "02 45 01 04 2c 4c 79 01 05 40 06 4f 37"),
        ("", "01"),
        ("00", "01 01"),
        ("00 00", "01 01 01"),
        ("11 22 00 33", "03 11 22 02 33"),
        ("01" * 254, "ff" + "01" * 254),
    ],
)
def test_stuffed_bytes_are_those_published(plain, stuffed):
    assert stuff(bytes.fromhex(plain)) == bytes.fromhex(stuffed)


@given(data=st.binary(min_size=1, max_size=255))
def test_bytes_are_unstuffed_after_stuffing_and_stuffed_to_the_same_bytes(data):
    with suppress(FormError):
        assert stuff(unstuff(data)) == data
    stuffed = stuff(data[:254])
    assert unstuff(stuffed) == data[:254]
    assert 0 not in stuffed and len(stuffed) == len(data[:254]) + 1


def test_random_bytes_equal_a_marker_as_often_as_in_the_closed_form():
    markers = {PACKET_START, DATA_START, PACKET_END}
    pairs = itertools.product(range(256), repeat=2)
    assert sum(not markers.isdisjoint(pair) for pair in pairs) == MarkerFormat.false_sync(2) * 65536
    assert [round(100 * MarkerFormat.false_sync(20, m), 1) for m in (1, 3)] == [7.5, 21.0]
    assert MarkerFormat.false_sync(0) == 0 and MarkerFormat.false_sync(5, 256) == 1


def test_only_changes_are_sent():
    sender, sending = Sender(10), [0] * 10
    for mask in np.random.default_rng(5).permutation(1024).tolist():
        last = list(sending)
        for number in range(10):
            sending[number] = (sending[number] + (mask >> number & 1)) % 0x10000
        items = sender.items(sending)
        assert items == changed_items(sending, last)
        assert set(items) == {number for number in range(10) if mask >> number & 1}


@pytest.mark.parametrize(("repeat", "packets"), [(1, 10), (3, 4), (10, 1)])
def test_repeating_recovers_a_lost_packet_and_the_printed_rule_does_not(repeat, packets):
    def after_a_loss(sender, n_packets):
        sender.items([7] * 10)  # lost
        table = dict.fromkeys(range(10), 0)
        for _ in range(n_packets):
            table.update(sender.items([7] * 10))
        return list(table.values())

    assert after_a_loss(Sender(10, repeat), packets) == [7] * 10
    assert after_a_loss(Sender(10), 1000) == [0] * 10
    if repeat < 10:
        assert after_a_loss(Sender(10, repeat), packets - 1) != [7] * 10


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: MarkerFormat(n_numbers=0), r"n_numbers is 0.*1\.\.204"),
        (lambda: CobsFormat(85), r"n_numbers is 85.*1\.\.84"),
        (lambda: MarkerFormat().size(11), r"n_items is 11.*0\.\.10"),
        (lambda: MarkerFormat().encode({10: 0}), r"number is 10.*0\.\.9"),
        (lambda: MarkerFormat().encode({0: -1}), "value of item 0 is -1"),
        (lambda: CobsFormat().encode({0: 0x10000}), "value of item 0 is 65536"),
        (lambda: MarkerFormat().encode([(0, 1)]), "items is"),
        (lambda: stuff(bytes(255)), "length of data is 255"),
        (lambda: changed_items([1, 2], [1]), "sending has 2 values, sended 1; they must be"),
        (lambda: System(repeat=11), "repeat is 11"),
        (lambda: MarkerFormat().parser().feed(204), "data is 204; it must be bytes"),
        (lambda: CobsFormat().parser().feed(204), "data is 204; it must be bytes"),
        (lambda: MarkerFormat().decode(6), "packet is 6; it must be bytes"),
        (lambda: MarkerFormat().stream(-1), "n_bytes is -1"),
        (lambda: MarkerFormat().stream(10, items=11), "items is 11"),
        (lambda: MarkerFormat().trace(b"\xcc", start=128), r"start is 128.*0\.\.127"),
        (lambda: CobsFormat().trace(7), "stream is 7; it must be bytes"),
    ],
)
def test_arguments_out_of_range_are_named(make, message):
    with pytest.raises(ArgumentError) as error:
        make()
    assert re.search(message, str(error.value))


@streams
def test_a_stream_repeats_one_packet_starting_at_any_byte(form):
    packet = form.encode({0: 1000, 1: 1000})
    assert form.stream(50, items=2) == (packet * 10)[:50]


START, ITEM = "start of the packet/start of the data", "number/low byte/high byte"


@pytest.mark.parametrize(
    ("form", "stream", "meanings"),
    [
        (
            MarkerFormat(),
            "41 cc dd 03 34 12 09 01 02 ee 03 ee cc dd ee",
            f"discarded/{START}/{ITEM}/{ITEM}/end of the packet/discarded/discarded/{START}/"
            "end of the packet",
        ),
        (
            MarkerFormat("B", crc=True),
            MarkerFormat("B", crc=True).encode({0: 1}).hex() + "cc ee 00 00",
            f"{START}/{ITEM}/end of the packet/CRC/CRC/start of the packet/end of the packet/CRC/"
            "discarded",
        ),
        (
            CobsFormat(),
            "01 02 78 06 03 dd cc 09 14 00",
            "distance to the first 0: 1/number, a 0; distance to the next: 2/low byte/"
            f"high byte, a 0; distance to the next: 6/{ITEM}/CRC/CRC/end of the packet",
        ),
        (CobsFormat(), "07 00 01 02", "discarded/discarded/not complete/not complete"),
    ],
)
def test_a_trace_names_each_byte_as_the_receiver_reads_it(form, stream, meanings):
    steps = form.trace(bytes.fromhex(stream), start=122)
    assert steps.taken_as.tolist() == meanings.split("/")
    assert steps.place.tolist() == [(122 + k) % 128 for k in range(len(steps))]
