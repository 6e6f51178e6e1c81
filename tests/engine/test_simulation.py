import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shipnet.engine.faults import (
    BusOff,
    CanBreak,
    DeadBox,
    DeadPort,
    LostCanFrames,
    LostModbusFrames,
    ModbusBreak,
)
from shipnet.engine.firmware import Firmware
from shipnet.engine.simulation import simulate
from shipnet.engine.system import System
from shipnet.errors import ArgumentError
from shipnet.modbus.uart import SerialLine
from tests.engine.reference import run_reference


def phases_of(rng, system):
    periods = dict(zip(system.boxes, (system.period_ns / 1e9).tolist(), strict=True))
    periods["AMS"] = system.poll_period
    return {name: round(rng.uniform(0, period), 9) for name, period in periods.items()}


def assert_same(system, duration, faults, phases):
    # Probabilities of 0 and 1 need no random numbers, but the call requires a generator.
    run = simulate(
        system, until=duration, faults=faults, phases=phases, rng=np.random.default_rng(0)
    )
    expected = run_reference(system, duration, faults, phases)
    assert run.views.seen.tolist() == [seen for seen, _ in expected]
    shown = [run._shown(place) for place in range(len(system.points))]
    good = run.views.number >= 0
    for row, (_, view) in enumerate(expected):
        for point, message in enumerate(system.message_of.tolist()):
            assert good[row, message] == (view[message] is not None)
            if view[message] is not None:
                samples, earliest = view[message]
                assert shown[point].sampled[row] == samples[point]
                assert run.views.earliest[row, message] == earliest
    return run


FIRMWARE = st.builds(
    Firmware,
    st.sampled_from([50e3, 125e3, 200e3]),
    st.sampled_from([0.4e-3, 1e-3]),
    receive=st.sampled_from([1e-9, 50e-6, 400e-6]),
    processing=st.sampled_from([1e-6, 5e-3, 60e-3]),
)
SHARED = {
    "firmware": FIRMWARE,
    "can_bit_rate": st.sampled_from([125_000, 250_000, 1_000_000]),
    "update_period": st.sampled_from([0.0, 0.1, 0.35, 0.5]),
    "topology": st.sampled_from(["line", "ring"]),
    "serial": st.sampled_from([SerialLine(9600), SerialLine(19200)]),
    "retries": st.integers(0, 2),
    "stale_limit": st.sampled_from([0.3, 0.6, 1.1]),
    "poll_period": st.sampled_from([0.4, 0.7, 1.0]),
}
SYSTEMS = st.one_of(
    st.builds(System, **SHARED),
    st.builds(System.corrected, **{**SHARED, "serial": st.just(SerialLine(19200))}),
)


LOSSES = [LostCanFrames, LostModbusFrames]


@st.composite
def faults_of(draw, system):
    found = []
    for _ in range(draw(st.integers(0, 3))):
        kind = draw(st.sampled_from([BusOff, CanBreak, ModbusBreak, DeadBox, DeadPort, *LOSSES]))
        place = system.places[kind.at]
        where = place[draw(st.integers(0, len(place) - 1))]
        start = round(draw(st.floats(0.1, 2.5)), 9)
        stop = round(start + draw(st.floats(0.3, 2.0)), 9)
        chance = {}
        if kind is LostCanFrames:
            chance = {"probability": 1.0}
        if kind is LostModbusFrames:
            chance = draw(st.sampled_from([{"request": 1.0}, {"request": 0.0, "response": 1.0}]))
        found.append(kind(where, start=start, stop=stop, **chance))
    return found


def fits(system):
    try:
        system.can_response  # noqa: B018
    except ArgumentError:
        return False
    return True


@settings(max_examples=12)
@given(system=SYSTEMS.filter(fits), seed=st.integers(0, 10**6), data=st.data())
def test_the_arrays_equal_an_event_by_event_simulation(system, seed, data):
    faults = data.draw(faults_of(system))
    phases = phases_of(np.random.default_rng(seed), system)
    assert_same(system, 3.0, faults, phases)


def test_the_loads_are_those_of_the_closed_forms():
    system = System()
    run = simulate(system, until=600, rng=np.random.default_rng(1))
    # 2850 worst-case bits twice a second at 125 kbit/s, with a second and a half before the start.
    assert run.bus_time["CAN"] == pytest.approx(2 * 2850 / 125e3, rel=0.01)
    characters = (8 + 203) * 11 / 9600
    assert run.bus_time["channel 1"] == pytest.approx(characters, rel=1e-3)
    assert run.bus_time["channel 2"] == 0


def test_responses_arrive_unless_the_fault_says_that_they_are_lost():
    healthy, requests_only, both = (
        simulate(System(), until=20, faults=faults, rng=4).requests()["outcome"].value_counts()
        for faults in ((), LostModbusFrames("1", request=0.0), LostModbusFrames("1", response=1.0))
    )
    assert requests_only.to_dict() == healthy.to_dict() != both.to_dict()


def test_the_same_generator_gives_the_same_run():
    faults = [LostCanFrames("JB2"), LostModbusFrames("1")]
    tables = [simulate(System(), until=20, faults=faults, rng=4).table() for _ in range(2)]
    assert tables[0].equals(tables[1])


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: System(polled="both"), "polled is 'both' with coding 'printed'"),
        (lambda: System(topology="star"), "topology is 'star'"),
        (lambda: System(can_bit_rate=1), "can_bit_rate is 1;"),
        (lambda: System(timeout=0.001), "timeout is 0.001"),
        (lambda: System(retries=-1), "retries is -1"),
        (lambda: System(firmware=None), "firmware is None"),
        (lambda: System(points=()), "points are empty"),
        (lambda: System(points=System().points[:10]), r"1 boxes; there must be 2\.\.7"),
        (lambda: System.corrected(poll_period=0.3), "a poll takes 0.3"),
        (lambda: simulate(System(), until=0), "until is 0"),
        (lambda: simulate(System(), until=float("nan")), "until is nan"),
        (lambda: simulate(System(), until=1e6), "frames are sent"),
        (
            lambda: simulate(System(update_period=100, poll_period=0.3), until=1e6),
            "frames are sent and read",
        ),
        (lambda: simulate(System(), until=1, phases={"JB4": 0}), "JB4"),
        (lambda: simulate(System(), until=1, phases={"JB1": -1}), "phase of JB1 is -1"),
        (lambda: simulate(System(), until=1).ages("x"), "tag is 'x'"),
    ],
)
def test_arguments_out_of_range_are_named(make, message):
    with pytest.raises(ArgumentError, match=message):
        make()


def test_a_break_destroys_the_frame_on_the_bus_and_those_queued():
    phases = {"JB1": 0.1, "JB2": 0.2, "JB3": 0.4, "AMS": 0.0}
    system = System()
    # 1.5 frames after box 2 has queued its five.
    cut = 5.2 + system.loop_ns[1] / 1e9 + 1.5 * 135 * 8e-6
    faults = [CanBreak("JB1-JB2", start=cut, stop=cut + 2)]
    assert_same(system, 9, faults, phases)
    run = simulate(system, until=9, faults=faults, phases=phases)
    last = run.sent.arrival[(run.sent.arrival > 5.2e9) & (run.sent.arrival < 5.3e9)]
    assert len(last) == 1


def test_a_box_that_comes_back_has_no_values_of_others():
    phases = {"JB1": 0.1, "JB2": 0.2, "JB3": 0.4, "AMS": 0.9}
    # The box returns 0.4 ms before the first request that it answers again; box 2 is then dead.
    faults = [DeadBox("JB1", start=5.5, stop=6.8995), DeadBox("JB2", start=5.0), ModbusBreak("2")]
    run = assert_same(System(), 9, faults, phases)
    own = System().box_of[0]
    first = run.views.number[run.views.seen > 6.9e9][0]
    assert own == 0
    assert (first[System().sender == 1] == -1).all()
