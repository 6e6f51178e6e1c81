import itertools

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shipnet import datasets
from shipnet.errors import ArgumentError
from shipnet.papers.chung1998.ring import extraction
from shipnet.remote_control import MarkerFormat, Ring
from shipnet.remote_control.ring_buffer import State, Step, case_of

RULES = ["printed", "intended", "corrected"]
SIZES = range(2, 9)


def filled(size, rule, data):
    ring = Ring(size, rule)
    ring.store_all(bytes(data))
    return ring


OPERATIONS = st.lists(
    st.one_of(st.none(), st.sampled_from([0xCC, 0xDD, 1, 2]), st.integers(1, 40)), max_size=60
)


@pytest.mark.parametrize("rule", ["printed", "intended"])
@given(size=st.integers(2, 9), operations=OPERATIONS)
def test_place_and_flag_together_count_modulo_twice_the_size(rule, size, operations):
    ring, stored, reader = Ring(size, rule), [], 0
    for operation in operations:
        if operation is not None:
            ring.store(operation)
            stored.append(operation)
        else:
            action, no = ring.extract().action, len(stored) % size
            if action == "take":
                reader += 1
            elif action == "repair":
                # The reader moves to the first 0xCC of the last lap, or of its second half.
                oldest = len(stored) - no + (size // 2 - size if no < size // 2 else 0)
                starts = [k for k in range(oldest, len(stored)) if stored[k] == 0xCC]
                reader = min(starts, default=len(stored))
        (ring_f, no), (ring_get_f, get_no) = (
            divmod(count % (2 * size), size) for count in (len(stored), reader)
        )
        assert ring.state == (no, ring_f, get_no, ring_get_f)


@pytest.mark.parametrize("rule", RULES)
@given(size=st.integers(2, 9), operations=OPERATIONS)
def test_lost_and_stale_bytes_equal_those_of_a_queue(rule, size, operations):
    # The test identifies every byte by its number, counted from the first; the ring cannot see it.
    ring, count, taken, stale, due_from = Ring(size, rule), 0, [], 0, 0
    for operation in operations:
        if operation is not None:
            ring.store(count % 251)
            count += 1
            continue
        place = ring.state.get_no
        step = ring.extract()
        if step.action == "take":
            held = [k for k in range(count) if k % size == place][-1:]
            due = bool(held) and held[0] >= due_from
            assert step.stale == (not due)
            taken += held if due else []
            stale += step.stale
            due_from = held[0] + 1 if due else due_from
        elif step.action == "repair":
            due_from = max(due_from, count - ring.seems_unread)
    assert taken == sorted(set(taken)) and ring.stale == stale
    assert ring.written == count == len(taken) + ring.lost + ring.unread


@given(size=st.integers(2, 9), operations=OPERATIONS)
def test_the_corrected_ring_reads_all_bytes_in_order_but_those_overwritten(size, operations):
    ring, queue = Ring(size, "corrected"), []
    for operation in operations:
        if operation is not None:
            ring.store(operation)
            queue.append(operation)
        elif not queue:
            assert ring.extract().action == "wait"
        elif len(queue) > size:
            step = ring.extract()
            assert (step.action, step.lost) == ("repair", len(queue) - size)
            queue = queue[-size:]
        else:
            step = ring.extract()
            assert (step.action, step.byte, step.stale) == ("take", queue.pop(0), False)


def test_cases_are_those_of_the_data_file():
    table = pd.read_csv(datasets.path("chung1998_ring_states.csv"), dtype=str)
    cases = {
        (
            "same" if state.ring_f == state.ring_get_f else "different",
            "<" if state.no < state.get_no else ">=",
        ): state.case
        for state in itertools.starmap(State, itertools.product(range(3), (0, 1), range(3), (0, 1)))
    }
    printed = zip(table.ring_flags, table.no_against_get_no, strict=True)
    assert cases == dict(zip(printed, table.case, strict=True))


@pytest.mark.parametrize("size", SIZES)
def test_the_table_of_cases_agrees_with_rings(size):
    counted = {(lap, case): 0 for lap in range(3) for case in "abcd"}
    for lead, place in itertools.product(range(3 * size), range(size)):
        ring = Ring.filled(lead, place, size, "corrected")
        assert ring.unread == lead
        assert ring.seems_unread == lead % (2 * size)
        counted[lead // size, ring.case] += 1
    table = Ring(size).cases().table()
    assert [*table] == ["from", "to", "a", "b", "c", "d"]
    assert table["from"].tolist() == [0, size, 2 * size]
    assert (table["to"] == table["from"] + size - 1).all()
    assert {(lap, case): table.loc[lap, case] for lap, case in counted} == counted


@pytest.mark.parametrize("size", SIZES)
def test_all_interleavings_of_a_small_ring_are_among_the_states_explored(size):
    for rule in RULES:
        table = Ring(size, rule).explore(4 * size)
        columns = ["no", "ring_f", "get_no", "ring_get_f", "unread", "action", "lost", "stale"]
        explored = set(table[columns].itertuples(index=False, name=None))
        level, met = [Ring(size, rule)], set()
        for _ in range(11):
            following = []
            for ring in level:
                after, stored = ring.copy(), ring.copy()
                step = after.extract()
                stored.store(0xCC)
                met.add((*ring.state, ring.unread, step.action, step.lost, step.stale))
                following += [after, stored]
            # Rings with the same state, unread bytes and cells develop in the same way.
            level = list({(*r.state, r.unread, r.cells): r for r in following}.values())
        assert {row for row in met if row[4] <= 4 * size} <= explored


@pytest.mark.parametrize("size", SIZES)
def test_by_the_intended_rule_a_ring_that_is_never_full_is_always_in_order(size):
    table = Ring(size, "intended").explore(size - 1)
    assert set(table.case) == {"b", "d"}
    assert set(table.action) == {"take", "wait"}
    assert not table.stale.any() and not table.lost.any()
    assert ((table.action == "wait") == (table.unread == 0)).all()
    # By the printed rule, even one byte at a time reaches the abnormal cases.
    printed = Ring(size, "printed").explore(1)
    assert {"a", "c"} <= set(printed.case) and printed.stale.any()


@pytest.mark.parametrize("size", SIZES)
def test_a_ring_that_is_exactly_full_is_repaired_though_nothing_is_lost(size):
    table = Ring(size, "intended").explore(size)
    full = table[table.unread == size]
    assert set(full.case) == {"c"} and set(full.action) == {"repair"}
    assert full.lost.max() == (size + 1) // 2
    corrected = Ring(size, "corrected").explore(size)
    assert not corrected.lost.any() and not corrected.stale.any()


@pytest.mark.parametrize("size", SIZES)
def test_by_the_printed_rule_even_one_byte_at_a_time_reaches_the_abnormal_cases(size):
    table = Ring(size, "printed").explore(1)
    assert {"a", "c"} <= set(table.case)
    assert table.stale.any()


@pytest.mark.parametrize(
    "form", [MarkerFormat("A"), MarkerFormat("B"), MarkerFormat("A", 1)], ids=str
)
def test_after_the_repair_every_ring_of_packets_is_in_order(form):
    items = {number: 1000 + number for number in range(form.n_numbers)}
    packet = form.encode(items)
    stream = packet * (400 // len(packet) + 2)
    given_up = []
    for phase, no in itertools.product(range(len(packet)), range(128)):
        # The reader is at the start; `no` bytes beyond a full ring have been overwritten.
        ring = filled(128, "intended", stream[phase : phase + 128 + no])
        assert ring.case == "c"
        given_up.append(ring.extract().lost - no)
        assert ring.case in ("b", "d") and ring.unread == ring.seems_unread
        assert ring.cells[ring.state.get_no] == 0xCC
    # At most half a ring, and on average half a packet until the next one begins.
    assert np.mean(given_up) == pytest.approx(32.5 + (len(packet) - 1) / 2)
    assert max(given_up) == 64 + len(packet) - 1


@pytest.mark.parametrize("form", [MarkerFormat("A"), MarkerFormat("B")], ids=str)
def test_twenty_of_128_places_break_a_value_as_printed_and_none_with_wrapped_indices(form):
    items = dict.fromkeys(range(10), 4660)
    printed = extraction(items, form)
    # By hand: the number of item k is at offset + first + k * step; places 126 and 127 are bad.
    first, step = (2, 3) if form.reading == "A" else (2, 4)
    bad = [
        sum((offset + first + k * step) % 128 in (126, 127) for k in range(10))
        for offset in range(128)
    ]
    assert printed.wrong.tolist() == bad
    assert sum(bad) == 20
    assert printed.outside.sum() == 10 * (1 + 2)
    corrected = extraction(items, form, wrap=True)
    assert not corrected.wrong.any() and not corrected.outside.any()


@given(size=st.integers(2, 9), data=st.data())
def test_a_filled_ring_has_the_requested_bytes_place_and_case(size, data):
    get_no = data.draw(st.integers(0, size - 1))
    unread = data.draw(st.integers(0, 3 * size))
    ring = Ring.filled(unread, get_no, size)
    assert (ring.unread, ring.state.get_no, ring.stale) == (unread, get_no, 0)
    assert ring.case == case_of(get_no, unread, size)


def test_each_step_reports_its_case_and_action():
    assert Ring(4, "corrected").extract() == Step("b", "wait")
    assert Ring(4, "intended").extract() == Step("b", "wait")
    assert Ring.filled(6, size=4, rule="corrected").extract() == Step("c", "repair", lost=2)
    assert Ring.filled(6, size=4).extract() == Step("c", "repair", lost=6)
    assert Ring.filled(3, 2, size=4).extract() == Step("d", "take", 2)
    # Two laps later the ring shows one byte, and eight are lost.
    assert Ring.filled(9, size=4).extract() == Step("b", "take", 8, lost=8)
    ring = Ring(4)
    assert ring.extract() == Step("b", "take", 0, stale=True)
    assert ring.extract() == Step("a", "stop")


def test_a_ring_begins_empty_with_128_cells():
    assert Ring().size == Ring.filled(0).size == 128
    assert Ring.filled(3).state == State(3, 0, 0, 0)
    assert Ring.filled(257, size=512).cells[:258] == bytes([*range(256), 0, 0])
    assert [Ring.filled(1, rule=rule).rule for rule in RULES] == RULES
    assert Ring(2, "corrected").explore()["unread"].max() == 6
    assert Ring(2).explore(0)["unread"].max() == 0


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Ring(1), "size is 1; it must be a whole number 2..65536"),
        (lambda: Ring(8, "x"), "rule is 'x'; it must be one of 'printed', 'intended', 'corrected'"),
        (lambda: Ring.filled(-1), "unread is -1; it must be a whole number 0..1000000"),
        (lambda: Ring.filled(3, 500), "get_no is 500; it must be a whole number 0..127"),
        (lambda: Ring(8).store(256), "byte is 256; it must be a whole number 0..255"),
        (lambda: Ring(4).store_all("12"), "data is '12'; it must be bytes"),
        (lambda: Ring(17).explore(), "size is 17; it must be a whole number 2..16"),
        (lambda: Ring(4).explore(17), "max_unread is 17; it must be a whole number 0..16"),
        (lambda: Ring(513).cases(), "size is 513; it must be a whole number 2..512"),
        (lambda: Ring(8).cases().plot(get_no=8), "get_no is 8; it must be a whole number 0..7"),
        (
            lambda: extraction(dict.fromkeys(range(60), 1), MarkerFormat(n_numbers=60)),
            "bytes of the packet is 183; it must be a whole number 0..128",
        ),
    ],
)
def test_arguments_out_of_range_are_named(make, message):
    with pytest.raises(ArgumentError) as caught:
        make()
    assert str(caught.value) == message
