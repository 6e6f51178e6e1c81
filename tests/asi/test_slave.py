import pytest
from hypothesis import given
from hypothesis import strategies as st

from shipnet.asi import Call, Profile, Request, Response
from shipnet.asi.slave import (
    WATCHDOG,
    WRITE_TIME,
    Event,
    RunningSlave,
    Slave,
    State,
)
from shipnet.asi.telegram import frame
from shipnet.errors import ArgumentError
from tests.asi.lines import slave

GARBLED = "00101010111011"  # data exchange with slave 21 with a wrong parity bit
FOREIGN = Request.data_exchange(3, 0).bits


def listening(profile="S-7.F.F", address=21, half=None, **options):
    running = RunningSlave(slave(profile, address, half, **options))
    running.pause()
    return running


def say(slave, request, time=0.0):
    """Send a request to a slave in state RECEIVE, and let the transaction end."""
    answer = slave.hear(request.bits, time)
    slave.pause()
    return answer


# The receive states, edge by edge.


@pytest.mark.parametrize("event", [Event.PAUSE, Event.SLAVE_PAUSE])
def test_any_pause_brings_an_asynchronous_slave_to_receive(event):
    slave = RunningSlave(Slave("21", "S-7.F.F"))
    slave.pause(event)
    assert slave.state is State.RECEIVE
    assert not slave.fields["synchronised"]


UNKNOWN = frame("11010111111")  # information 11111 is reserved


@pytest.mark.parametrize(
    ("bits", "answer", "state"),
    [
        (GARBLED, None, State.ASYNCHRONOUS),
        (FOREIGN, None, State.SYNCHRONOUS),
        (UNKNOWN, None, State.SYNCHRONOUS),
        (Request(Call.BROADCAST_RESET, 31).bits, None, State.SYNCHRONOUS),
        (Request(Call.READ_ID, 21).bits, Response(0xF, Call.READ_ID), State.SYNCHRONOUS),
    ],
    ids="error foreign unknown silent own".split(),
)
def test_a_request_brings_a_slave_to_its_next_state(bits, answer, state):
    slave = listening()
    say(slave, Request(Call.WRITE_PARAMETER, 21, 5))
    assert slave.fields["synchronised"] and slave.fields["active"]
    assert slave.hear(bits) == answer
    assert (slave.state, slave.fields["synchronised"]) == (state, state is State.SYNCHRONOUS)
    assert slave.fields["active"] == (bits != Request(Call.BROADCAST_RESET, 31).bits)


def test_a_synchronous_slave_ignores_the_response_until_the_pause_after_it():
    slave = listening()
    slave.hear(FOREIGN)
    slave.pause(Event.PAUSE)
    assert slave.hear(Response(6).bits) is None
    assert slave.state is State.SYNCHRONOUS
    slave.pause(Event.SLAVE_PAUSE)
    assert slave.state is State.RECEIVE
    assert slave.fields["synchronised"]


def test_an_unsynchronised_slave_reads_the_response_as_a_faulty_request():
    slave = listening()
    slave.hear(GARBLED)
    slave.pause(Event.PAUSE)
    assert slave.hear(Response(6).bits) is None
    assert slave.state is State.ASYNCHRONOUS


@given(st.lists(st.text("01", max_size=16) | st.sampled_from([FOREIGN, GARBLED]), max_size=30))
def test_a_slave_always_follows_the_table_and_answers_only_its_own_requests(traffic):
    slave = listening(inputs=9)
    for bits in traffic:
        answer = slave.hear(bits)
        assert slave.state in State
        if answer is not None:
            assert Request.parse(bits).address in (0, 21)
            assert slave.state is State.SYNCHRONOUS
        slave.pause()
        assert slave.state is State.RECEIVE


# The 13 calls.


def test_data_need_a_parameter_first():
    slave = listening("S-3.F.F", inputs=0b0011)
    assert say(slave, Request.data_exchange(21, 0b1000)) is None
    assert say(slave, Request(Call.WRITE_PARAMETER, 21, 0xA)).data == 0xA
    # D0 and D1 are inputs; D2 and D3 are outputs, and echoed.
    assert say(slave, Request.data_exchange(21, 0b1000)).data == 0b1011
    assert (slave.fields["outputs"], slave.parameter) == (0b1000, 0xA)


def test_the_codes_are_read():
    slave = listening("S-7.F.E", id1=5)
    asked = [Call.READ_IO_CONFIGURATION, Call.READ_ID, Call.READ_ID1, Call.READ_ID2]
    assert [say(slave, Request(call, 21)).data for call in asked] == [7, 0xF, 5, 0xE]


def test_an_old_slave_has_no_extended_codes():
    slave = listening("S-7.F")
    assert say(slave, Request(Call.READ_ID1, 21)) is None
    assert say(slave, Request(Call.READ_ID2, 21)) is None
    assert say(slave, Request(Call.READ_ID, 21)).data == 0xF


def test_delete_then_assign_changes_the_address():
    slave = listening(address=21)
    assert say(slave, Request(Call.DELETE_ADDRESS, 21)).data == 0
    assert slave.address == 0
    assert say(slave, Request(Call.ASSIGN_ADDRESS, 0, 9)).data == 6
    assert slave.address == 9
    assert say(slave, Request(Call.ASSIGN_ADDRESS, 0, 10)) is None
    assert slave.address == 9


def test_a_reset_restores_a_deleted_address():
    slave = listening(address=21)
    say(slave, Request(Call.DELETE_ADDRESS, 21))
    assert slave.status() & 1
    assert say(slave, Request(Call.RESET, 0)).data == 6
    assert slave.address == 21
    assert not slave.status() & 1


def test_it_stores_for_15_ms_and_stores_nothing_else_meanwhile():
    slave = listening(address=0)
    say(slave, Request(Call.ASSIGN_ADDRESS, 0, 9), 1.0)
    assert say(slave, Request(Call.READ_STATUS, 9), 1.0 + 0.99 * WRITE_TIME).data == 1
    assert say(slave, Request(Call.DELETE_ADDRESS, 9), 1.0 + 0.99 * WRITE_TIME) is None
    assert say(slave, Request(Call.READ_STATUS, 9), 1.0 + WRITE_TIME).data == 0
    assert say(slave, Request(Call.DELETE_ADDRESS, 9), 1.0 + WRITE_TIME).data == 0


@pytest.mark.parametrize(("part", "address", "status"), [(0.5, 0, 0b1000), (1, 9, 0)])
def test_a_slave_that_loses_its_supply_while_storing_loses_its_address(part, address, status):
    slave = listening(address=0)
    say(slave, Request(Call.ASSIGN_ADDRESS, 0, 9), 1.0)
    slave.switch_off(1.0 + part * WRITE_TIME)
    assert slave.hear(Request(Call.READ_ID, 9).bits) is None
    slave.switch_on()
    assert (slave.state, slave.fields["synchronised"]) == (State.ASYNCHRONOUS, False)
    slave.pause()
    assert slave.address == address
    assert say(slave, Request(Call.READ_STATUS, address), 2.0).data == status


def test_bit_3_of_id1_is_the_half():
    slave = listening("S-7.A.E", address=0, id1=5)
    assert say(slave, Request(Call.WRITE_ID1, 0, 5 | 8)).data == 0
    assert slave.half == "B"
    assert say(slave, Request(Call.ASSIGN_ADDRESS, 0, 9), 1.0).data == 6
    assert slave.label == "9B"
    assert say(slave, Request(Call.READ_ID1, 9, half="B"), 1.0).data == 0xD
    assert say(slave, Request(Call.READ_ID1, 9, half="A"), 1.0) is None


def test_no_address_is_accepted_while_a_code_is_stored():
    slave = listening("S-7.A.E", address=0, id1=5)
    say(slave, Request(Call.WRITE_ID1, 0, 5 | 8), 1.0)
    assert say(slave, Request(Call.ASSIGN_ADDRESS, 0, 9), 1.0 + 0.99 * WRITE_TIME) is None
    assert say(slave, Request(Call.WRITE_ID1, 0, 5), 1.0 + 0.99 * WRITE_TIME) is None
    assert say(slave, Request(Call.ASSIGN_ADDRESS, 0, 9), 1.0 + WRITE_TIME).data == 6
    assert slave.label == "9B"


@pytest.mark.parametrize("half", ["A", "B"])
def test_without_an_address_it_is_of_no_half(half):
    slave = listening("S-7.A.E", address=0)
    assert say(slave, Request(Call.READ_ID, 0, half=half)).data == 0xA


def test_the_periphery_fault_is_status_bit_1():
    slave = listening()
    slave.fields["periphery_fault"] = True
    assert say(slave, Request(Call.READ_STATUS, 21)).data == 2


@pytest.mark.parametrize("address", [0, 21])
def test_the_program_mode_is_locked(address):
    slave = listening(address=address)
    assert say(slave, Request(Call.ENTER_PROGRAM_MODE, 0)) is None
    assert say(slave, Request(Call.READ_ID, address)) is not None


SELECTING = [
    Call.DELETE_ADDRESS,
    Call.RESET,
    Call.READ_IO_CONFIGURATION,
    Call.READ_ID,
    Call.READ_ID1,
    Call.READ_ID2,
    Call.READ_STATUS,
]


@pytest.mark.parametrize("call", SELECTING)
@pytest.mark.parametrize("half", ["A", "B"])
@pytest.mark.parametrize("asked", ["A", "B"])
def test_only_the_half_that_is_asked_answers(call, half, asked):
    answer = say(listening("S-7.A.E", half=half), Request(call, 21, half=asked))
    assert (answer is not None) == (half == asked)


@pytest.mark.parametrize("half", ["A", "B"])
def test_data_and_parameters_go_to_one_half(half):
    slave = listening("S-7.A.E", half=half, inputs=0xC)
    other = "A" if half == "B" else "B"
    assert say(slave, Request(Call.WRITE_PARAMETER, 21, 3, other)) is None
    assert say(slave, Request(Call.WRITE_PARAMETER, 21, 3, half)).data == 3
    assert say(slave, Request.data_exchange(21, 5, other)) is None
    assert say(slave, Request.data_exchange(21, 5, half)).data == 0xC
    assert slave.fields["outputs"] == 5


def test_a_standard_slave_answers_no_call_to_a_b_slave():
    assert say(listening(), Request(Call.READ_ID, 21, half="B")) is None
    assert say(listening(), Request(Call.READ_ID, 21, half="A")) is not None


# Watchdog and arguments.


def test_the_watchdog_resets_after_its_time_without_data():
    slave = listening()
    say(slave, Request(Call.WRITE_PARAMETER, 21, 1), 0.0)
    say(slave, Request.data_exchange(21, 0), 0.05)
    assert say(slave, Request.data_exchange(21, 0), 0.05 + WATCHDOG) is not None
    assert slave.fields["outputs"] == 0
    assert say(slave, Request.data_exchange(21, 0), 0.06 + 2 * WATCHDOG) is None
    assert slave.fields["outputs"] == 0xF
    assert slave.trips == [pytest.approx(0.05 + 2 * WATCHDOG)]


def test_reading_does_not_feed_the_watchdog():
    slave = listening(watchdog=50e-3)
    say(slave, Request(Call.WRITE_PARAMETER, 21, 1), 0.0)
    say(slave, Request(Call.READ_STATUS, 21), 0.049)
    say(slave, Request(Call.READ_STATUS, 21), 0.051)
    assert slave.trips == [50e-3]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"address": 32}, "label is '32'"),
        ({"half": "B"}, "a label with A or B is for A/B slaves"),
        ({"profile": "S-7.A.E", "half": "C"}, "label is '1C'"),
        ({"profile": "S-7.A.E", "address": 0, "half": "B"}, "label is '0B'"),
        ({"profile": "S-7.A.E", "id1": 8}, r"id1 is 8; .* 0\.\.7"),
        ({"inputs": 16}, "inputs is 16"),
        ({"watchdog": -1.0}, "watchdog is -1 s"),
        ({"profile": "7.A"}, "profile is '7.A'"),
    ],
)
def test_bad_arguments_are_refused(options, message):
    with pytest.raises(ArgumentError, match=message):
        RunningSlave(slave(**{"profile": Profile(7, 0xF), "address": 1} | options))
