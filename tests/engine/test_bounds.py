from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shipnet.engine.faults import DeadBox, ModbusBreak
from shipnet.engine.firmware import Firmware
from shipnet.engine.simulation import simulate
from shipnet.engine.system import System
from shipnet.errors import ArgumentError
from shipnet.modbus.uart import SerialLine

SYSTEMS = {
    "printed": System(),
    "corrected": System.corrected(),
    "never rests": System(update_period=0.0),
    "slow poll": System.corrected(coding="corrected", polled="one", poll_period=0.3, age_limit=9.0),
    "fast bus": System(can_bit_rate=1_000_000, serial=SerialLine(19200), topology="ring"),
}


@pytest.mark.parametrize("name", SYSTEMS)
def test_no_random_phases_exceed_the_formula(name):
    system, rng = SYSTEMS[name], np.random.default_rng(2024)
    bound = system.worst_age()["worst_s"].to_numpy()
    ages = [simulate(system, until=8, rng=rng).table()["worst_s"] for _ in range(12)]
    assert (np.max(ages, axis=0) <= bound + 1e-9).all()
    # The phases of 12 runs are close enough to the worst case to rule out a loose bound.
    assert np.max(ages) > 0.8 * bound.max()


def read_time(system):
    return system.poll.line.frame_time(8) + system.serial.t35


def test_the_worst_phases_attain_the_bound_of_a_value_of_the_polled_box():
    system = System()
    # The registers are read a nanosecond before the conversion ends.
    end = system.convert_ns[0] / 1e9
    phases = {"JB1": 0.2, "JB2": 0.3, "JB3": 0.4, "AMS": 0.2 + end - read_time(system) - 1e-9}
    run = simulate(system, until=10, phases=phases)
    index = 0
    bound = system.worst_age()["worst_s"].iloc[index]
    assert run.table()["worst_s"].iloc[index] == pytest.approx(bound, abs=1e-7)


def test_the_worst_phases_attain_the_bound_of_a_value_received_on_can():
    system = System()
    # All boxes queue their frames at once; the message of lowest priority is sent last, and the
    # registers are read a nanosecond before it is stored.
    loops = system.loop_ns / 1e9
    phases = {box: 0.3 - loop for box, loop in zip(system.boxes, loops.tolist(), strict=True)}
    taken = 0.3 + system.can_response[-1] + system.firmware.receive
    phases["AMS"] = taken - read_time(system) - 2e-9
    run = simulate(system, until=10, phases=phases)
    index = int(np.flatnonzero(system.message_of == 21)[0])
    bound = system.worst_age()["worst_s"].iloc[index]
    # Frame times are rounded to nanoseconds, here for 22 frames.
    assert run.table()["worst_s"].iloc[index] == pytest.approx(bound, abs=1e-7)


def test_the_terms_add_up_and_own_values_skip_the_bus():
    ages = System().worst_age()
    terms = ages.columns[3:-1]
    assert ages[terms].sum(axis=1).to_numpy() == pytest.approx(ages["worst_s"].to_numpy())
    polled = ages["box"] == "JB1"
    assert (ages.loc[polled, ["can_s", "handling_s", "interrupt_s"]] == 0).all(axis=None)
    assert (ages.loc[~polled, "can_s"] > 0).all()
    # Registers are read 13.2 ms before the poll is 250 ms old: request and silence come first.
    assert ages["transaction_s"].iloc[0] == pytest.approx(0.25479 - 0.0131771, abs=1e-5)


def silent(system, start, phases):
    return simulate(system, until=start + 8, faults=[DeadBox("JB2", start=start)], phases=phases)


def test_the_worst_phases_of_a_dead_box_attain_the_bound():
    system = System()
    phases = {"JB1": 0.4, "JB2": 0.1, "JB3": 0.3, "AMS": 0.0}
    received = 0.1 + system.loop_ns[1] / 1e9 + 605 * 8e-6 + system.firmware.receive
    marked = received + 5 + system.stale_limit + system.firmware.mark
    phases["AMS"] = (marked - read_time(system)) % 1.0 - 1e-4
    # The box dies after its last frame, and the poll comes just before the mark.
    run = silent(system, received + 5, phases)
    after = run.alarms()["time_s"].max() - (received + 5)
    # The bound includes another interrupt and a queue of CAN frames, 6.1 ms in all.
    assert after == pytest.approx(system.staleness_flag().after, abs=0.0065)
    assert after == pytest.approx(5.25, abs=0.01)


def noticed(system, box, start, rng):
    """Return the time for which a dead box looks good, and the greatest age shown as good."""
    bound = system.staleness_flag()
    run = simulate(
        system, until=start + bound.after + 5, faults=[DeadBox(box, start=start)], rng=rng
    )
    points = run.table()[run.table()["box"] == box]
    return points["good_until_s"].max() - start, points["worst_s"].max()


@pytest.mark.parametrize(
    "system",
    [
        # The AMS polls JB1 eleven times and waits half a second each time, 5.6 s in total.
        System(retries=10, timeout=0.5),
        # The first answer on the other channel comes after the mark.
        System(timeout=0.72, stale_limit=0.1),
    ],
    ids=["late mark", "early mark"],
)
def test_the_bound_includes_time_outs_of_a_dead_polled_box(system):
    rng = np.random.default_rng(2024)
    bound = system.staleness_flag()
    delays = [noticed(system, "JB1", 10 + rng.uniform(0, 1), rng) for _ in range(40)]
    after, oldest = np.max(delays, axis=0)
    # With long time-outs the bound is conservative: it allows a mark at any time in a poll.
    assert 0.6 * bound.after < after <= bound.after
    assert oldest <= bound.oldest


LEGAL = {
    "firmware": st.builds(
        Firmware,
        receive=st.sampled_from([1e-9, 50e-6, 400e-6]),
        processing=st.sampled_from([1e-6, 5e-3, 30e-3]),
    ),
    "can_bit_rate": st.sampled_from([125_000, 250_000, 1_000_000]),
    "update_period": st.sampled_from([0.2, 0.35, 0.5]),
    "topology": st.sampled_from(["line", "ring"]),
    "serial": st.just(SerialLine(19200)),
    "retries": st.integers(0, 10),
    "timeout": st.sampled_from([0.04, 0.1238, 0.5, 1.3]),
    "stale_limit": st.sampled_from([0.6, 1.1, 4.0]),
    "poll_period": st.sampled_from([0.4, 0.7, 1.0]),
}


@settings(max_examples=40)
@given(
    system=st.builds(System, **LEGAL) | st.builds(System.corrected, **LEGAL),
    box=st.sampled_from(["JB1", "JB2", "JB3"]),
    start=st.floats(5, 6),
    seed=st.integers(0, 10**6),
)
def test_no_dead_box_of_any_system_is_shown_for_longer_than_the_bound(system, box, start, seed):
    bound = system.staleness_flag()
    after, oldest = noticed(system, box, start, np.random.default_rng(seed))
    assert after <= bound.after + 1e-9
    assert oldest <= bound.oldest + 1e-9


def test_the_ams_leaves_a_cut_channel_after_133_ms_and_has_an_answer_within_2_s():
    system = System()
    times = system.switch_over()
    run = simulate(system, until=20, faults=[ModbusBreak("1", start=9.9)])
    lost = run.requests()[run.requests()["outcome"] == "no answer"]
    taken = run.requests()[run.requests()["channel"] == 2]
    assert len(lost) == 1
    assert taken["time_s"].iloc[0] - lost["time_s"].iloc[0] == pytest.approx(times.request)
    assert times.request == pytest.approx(0.133, abs=5e-5)
    assert run.answers()["answer_s"].max() == pytest.approx(times.answer)
    assert times.answer < times.loss < times.gap < 2
    assert times.gap == pytest.approx(1.255, abs=5e-4)


@pytest.mark.parametrize("bit_rate", [1200, 9600, 115200])
@pytest.mark.parametrize("retries", [0, 1, 10])
def test_timeout_for_inverts_the_switch_over_time(bit_rate, retries):
    system = System(serial=SerialLine(bit_rate))
    # The shortest and longest time-outs are included.
    for timeout in (system.shortest_timeout, 0.5, 100.0):
        time = (1 + retries) * (system.serial.frame_time(8) + timeout)
        assert system.timeout_for(time, retries=retries) == pytest.approx(timeout, rel=1e-12)
        late = replace(system, retries=retries, timeout=system.timeout_for(time, retries=retries))
        assert late.switch_over().request == pytest.approx(time)


def test_the_known_age_is_at_least_the_true_age_and_marks_no_healthy_value():
    system = System.corrected()
    run = simulate(system, until=60, rng=np.random.default_rng(5))
    for index, message in enumerate(system.message_of.tolist()):
        shown = run._shown(index)
        assert (run.views.earliest[:, message] <= shown.sampled).all()
    assert run.alarms().empty
    assert (system.hop_ns(0) > 0).all()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: System(firmware=Firmware(settling=0.05)).worst_age(), "poll_period is 1 s"),
        (
            lambda: System(update_period=0, firmware=Firmware(settling=0)).can_response,
            "can_bit_rate is 125000",
        ),
        (lambda: System.corrected().switch_over(), "polled is 'both'"),
        (lambda: System().timeout_for(0.001), "time is 0.001"),
        (lambda: System().timeout_for(0.0095), "time is 0.0095"),
        (lambda: System().timeout_for(101), "time is 101"),
        (lambda: System().hop_ns(3), r"reader is 3.*0\.\.2"),
        (lambda: System().timeout_for(0.133, retries=-1), "retries is -1"),
    ],
)
def test_questions_without_an_answer_are_refused(make, message):
    with pytest.raises(ArgumentError, match=message):
        make()


def test_a_poll_longer_than_its_period_skips_one():
    assert System(poll_period=0.1).poll_spacing() == pytest.approx(0.3)
    run = simulate(System(poll_period=0.1), until=5)
    assert np.diff(run.requests()["time_s"]).tolist() == pytest.approx([0.3] * 16)
