"""No simulator reacts to a fault before it begins: what comes later leaves the past as it was."""

from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shipnet import asi, ballast, engine, modbus
from shipnet import remote_control as rc

UNITS = [asi.Slave("5"), asi.Slave("7"), asi.Slave("12")]


def past(run, start):
    """What an AMS asked, raised and showed before a time [s]."""
    asked, alarms = run.requests(), run.alarms()
    early = run.views.seen < start * 1e9
    stored = [run.views.number[early].tolist(), run.views.earliest[early].tolist()]
    return [
        asked.loc[asked["time_s"] < start, ["poll", "channel", "time_s"]].values.tolist(),
        alarms[alarms["time_s"] < start].values.tolist(),
        run.views.seen[early].tolist(),
        *stored,
    ]


ENGINES = st.builds(
    engine.System,
    retries=st.integers(0, 2),
    timeout=st.sampled_from([0.012, 0.1238, 0.3]),
    poll_period=st.sampled_from([0.3, 1.0]),
    stale_limit=st.sampled_from([0.6, 4.0]),
    topology=st.sampled_from(["line", "ring"]),
) | st.builds(engine.System.corrected)


@st.composite
def engine_faults(draw, system):
    kinds = [*system.single_faults(), engine.faults.LostModbusFrames("1", response=1.0)]
    kind = draw(st.sampled_from(kinds))
    start = draw(st.floats(1, 5))
    lasts = draw(st.sampled_from([np.inf, 0.004, 0.15, 2.0]))
    fields = {k: v for k, v in vars(kind).items() if k not in ("start", "stop")}
    return type(kind)(**fields, start=start, stop=start + lasts)


@settings(max_examples=50)
@given(system=ENGINES, data=st.data(), seed=st.integers(0, 10**6))
def test_the_engine_reacts_to_no_fault_before_it_begins(system, data, seed):
    fault = data.draw(engine_faults(system))
    rng = np.random.default_rng(seed)
    phases = {box: rng.uniform(0, 0.5) for box in system.boxes} | {"AMS": rng.uniform(0, 1)}
    failed, healthy = (
        engine.simulate(system, until=7, faults=faults, phases=phases, rng=seed)
        for faults in ([fault], [])
    )
    assert past(failed, fault.start) == past(healthy, fault.start)


@pytest.mark.parametrize("late", [0.0, 0.009, 0.0131, 0.0181, 0.0182, 0.1, 0.14, 0.2507])
@pytest.mark.parametrize("kind", ["ModbusBreak", "DeadPort", "DeadBox"])
def test_an_ams_waits_for_the_end_of_a_response_that_breaks_off(kind, late):
    fault = getattr(engine.faults, kind)("JB1" if kind == "DeadBox" else "1", start=5 + late)
    system = engine.System()
    run = engine.simulate(system, until=9, faults=fault)
    asked = run.requests().query("channel == 2")["time_s"].iloc[0]
    # The response begins 18.2 ms after the request; without one the AMS waits for its time-out.
    expected = system.poll.time if late >= 0.0182 else system.switch_over().request
    assert asked - 5 == pytest.approx(expected, abs=1e-9)
    assert asked > fault.start
    raised = run.alarms().query("kind == 'no answer'")["time_s"].item()
    assert raised == pytest.approx(asked, abs=1e-9)


POLL = modbus.Poll(modbus.Request.read_input_registers(0, 4), modbus.SerialLine(9600), timeout=0.1)
LOOP, OPEN = modbus.Loop(6, POLL), modbus.Loop(3, POLL, closed=False, recheck=1.5)


@settings(max_examples=30)
@given(
    system=st.sampled_from([LOOP, OPEN]),
    start=st.floats(0.1, 4),
    lasts=st.sampled_from([np.inf, 0.01, 0.7]),
    data=st.data(),
)
def test_a_modbus_master_reacts_to_no_fault_before_it_begins(system, start, lasts, data):
    kind = data.draw(st.sampled_from(system.single_faults()))
    fields = {k: v for k, v in vars(kind).items() if k not in ("start", "stop")}
    fault = type(kind)(**fields, start=start, stop=start + lasts)
    tries = []
    for faults in ([fault], []):
        run = modbus.simulate(system, faults=faults, until=6)
        events = run.events()
        before = events.loc[events["start_s"] < start, ["start_s", "slave", "port", "kind"]]
        known = events.loc[events["end_s"] < start, "answered"]
        tries.append((before.values.tolist(), known.tolist()))
    assert tries[0] == tries[1]


LINE_FAULTS = {
    "dead slave": lambda t, end: asi.faults.DeadSlave("7", start=t, stop=end),
    "supply": lambda t, _: asi.faults.SupplyDip(start=t, stop=t + 0.02),
    "late": lambda t, end: asi.faults.LateAnswer("7", 9.0, start=t, stop=end),
    "lost": lambda t, end: asi.faults.LostReply("7", count=9, start=t, stop=end),
    "periphery": lambda t, end: asi.faults.PeripheryFault("7", start=t, stop=end),
    "master": lambda t, _: asi.faults.MasterFailure(start=t),
    "errors": lambda t, end: asi.faults.TelegramErrors("7", request=0.9, start=t, stop=end),
}


@settings(max_examples=30)
@given(
    name=st.sampled_from(sorted(LINE_FAULTS)),
    start=st.floats(0.02, 0.09),
    lasts=st.sampled_from([np.inf, 1e-4, 0.01]),
)
def test_an_asi_master_reacts_to_no_fault_before_it_begins(name, start, lasts):
    fault = LINE_FAULTS[name](start, start + lasts)
    seen = []
    for faults in ([fault], []):
        standby = asi.Standby(asi.Master({one.label: one.profile for one in UNITS}))
        run = asi.simulate(UNITS, until=0.1, faults=faults, standby=standby, rng=1)
        events, lists = run.events(), run.lists
        # A request on the line at the moment of the fault belongs to both.
        ended = events[events["time_s"] < start - 14 * asi.BIT_TIME]
        outcome = events.loc[events["time_s"] < start - 50 * asi.BIT_TIME, "outcome"]
        seen.append(
            (
                ended[["time_s", "call", "slave", "attempt", "standby"]].values.tolist(),
                outcome.tolist(),
                lists[lists["time_s"] < start].values.tolist(),
            )
        )
    assert seen[0] == seen[1]


LINK_FAULTS = {
    "dead": lambda who, t, end: rc.faults.DeadStation(who, start=t, stop=end),
    "stall": lambda who, t, end: rc.faults.Stall(who, start=t, stop=min(end, t + 1)),
    "lost": lambda who, t, end: rc.faults.LostPacket(
        who, "BCS" if who == "RCS" else "RCS", start=t, stop=end
    ),
}


@settings(max_examples=15)
@given(
    name=st.sampled_from(sorted(LINK_FAULTS)),
    who=st.sampled_from(["RCS", "BCS", "SS"]),
    start=st.floats(0.5, 6),
    lasts=st.sampled_from([np.inf, 0.01, 2.0]),
)
def test_the_remote_control_reacts_to_no_fault_before_it_begins(name, who, start, lasts):
    fault = LINK_FAULTS[name](who, start, start + lasts)
    seen = []
    for faults in ([fault], []):
        system = rc.System(bit_rate=1200, repeat=5)
        run = rc.simulate(system, rc.Change(1.0, "BCS", 1, 1), until=9, faults=faults, rng=2)
        events, states, packets = run.events(), run.states(), run.traffic()
        seen.append(
            [
                events.loc[events["time_s"] < start].values.tolist(),
                states[states["time_s"] < start].values.tolist(),
                packets.loc[packets["start_s"] < start, ["start_s", "source"]].values.tolist(),
                [update for update in run.updates if update.time < start],
            ]
        )
    assert seen[0] == seen[1]


POLL = ballast.status_poll(9600)
#: Read directly, and by a master.
VALVES = {"direct": 3, "scanned": ballast.System(3, POLL)}


def stroke(valves, *faults):
    orders = [ballast.Command("open", 1.0, valves=2), ballast.Command("close", 12.0, valves=2)]
    return ballast.simulate(VALVES[valves], orders, faults=faults, until=18)


healthy_stroke = cache(stroke)


@settings(max_examples=25)
@given(
    code=st.sampled_from(sorted(ballast.FAULTS)),
    start=st.integers(50, 1500).map(lambda k: k / 100),
    lasts=st.sampled_from([np.inf, 0.05, 4.0]),
    valves=st.sampled_from(sorted(VALVES)),
)
def test_the_valves_react_to_no_fault_before_it_begins(code, start, lasts, valves):
    fault = ballast.Fault(code, valves=2, start=start, stop=start + lasts)
    seen = []
    for run in (stroke(valves, fault), healthy_stroke(valves)):
        if valves != "direct":
            early = [one for one in run.shown if one.read < start]
            seen.append((early, [w for w in run.writes if w.end < start]))
        else:
            early = run.time < start
            seen.append((run.readings[early].tolist(), run.moving[early].tolist()))
    assert seen[0] == seen[1]
