import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from shipnet.engine.age import can_response
from shipnet.engine.faults import (
    BusOff,
    CutCan,
    CutModbus,
    DeadBox,
    DeadPort,
    LostCan,
    LostModbus,
)
from shipnet.engine.firmware import Firmware
from shipnet.engine.simulation import simulate
from shipnet.engine.system import System
from shipnet.errors import ArgumentError
from shipnet.modbus.timing import Serial
from tests.engine_reference import run_reference


def phases_of(rng, system):
    periods = dict(zip(system.boxes, (system.period_ns / 1e9).tolist(), strict=True))
    periods["AMS"] = system.poll_period
    return {name: round(rng.uniform(0, period), 9) for name, period in periods.items()}


def assert_same(system, duration, faults, phases):
    # Probabilities of 0 and 1 leave nothing to chance, but the call asks for a generator.
    run = simulate(system, duration, faults=faults, phases=phases, rng=np.random.default_rng(0))
    expected = run_reference(system, duration, faults, phases)
    assert run.views.seen.tolist() == [seen for seen, _ in expected]
    shown = [run.shown(point.tag) for point in system.points]
    good = run.views.number >= 0
    for row, (_, view) in enumerate(expected):
        for point, message in enumerate(system.message_of.tolist()):
            assert good[row, message] == (view[message] is not None)
            if view[message] is not None:
                samples, known = view[message]
                assert shown[point].sampled[row] == samples[point]
                assert run.views.known[row, message] == known
    return run


FIRMWARE = st.builds(
    Firmware,
    st.sampled_from([50e3, 125e3, 200e3]),
    st.sampled_from([0.4e-3, 1e-3]),
    receive=st.sampled_from([1e-9, 50e-6, 400e-6]),
    processing=st.sampled_from([1e-6, 5e-3, 60e-3]),
    holds_cpu=st.booleans(),
)
SHARED = {
    "firmware": FIRMWARE,
    "can_bit_rate": st.sampled_from([125_000, 250_000, 1_000_000]),
    "update_period": st.sampled_from([0.0, 0.1, 0.35, 0.5]),
    "topology": st.sampled_from(["line", "ring"]),
    "serial": st.sampled_from([Serial(9600), Serial(19200)]),
    "retries": st.integers(0, 2),
    "switch_rule": st.sampled_from(["stay", "return"]),
    "stale_limit": st.sampled_from([0.3, 0.6, 1.1]),
    "poll_period": st.sampled_from([0.4, 0.7, 1.0]),
}
SYSTEMS = st.one_of(
    st.builds(System, **SHARED),
    st.builds(System.mended, **{**SHARED, "serial": st.just(Serial(19200))}),
)


@st.composite
def faults_of(draw, system):
    found = []
    for _ in range(draw(st.integers(0, 3))):
        kind = draw(
            st.sampled_from([BusOff, CutCan, CutModbus, DeadBox, DeadPort, LostCan, LostModbus])
        )
        place = kind("").places(system)
        where = place[draw(st.integers(0, len(place) - 1))]
        start = round(draw(st.floats(0.1, 2.5)), 9)
        stop = round(start + draw(st.floats(0.3, 2.0)), 9)
        chance = {}
        if kind is LostCan:
            chance = {"probability": 1.0}
        if kind is LostModbus:
            chance = draw(st.sampled_from([{"request": 1.0}, {"request": 0.0, "response": 1.0}]))
        found.append(kind(where, start, stop, **chance))
    return found


def fits(system):
    try:
        can_response(system)
    except ArgumentError:
        return False
    return True


@settings(max_examples=20)
@given(system=SYSTEMS.filter(fits), seed=st.integers(0, 10**6), data=st.data())
def test_the_arrays_say_what_a_walk_from_event_to_event_says(system, seed, data):
    faults = data.draw(faults_of(system))
    phases = phases_of(np.random.default_rng(seed), system)
    assert_same(system, 3.0, faults, phases)
