import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shipnet.engine.faults import DeadBox
from shipnet.engine.firmware import Firmware
from shipnet.engine.run import Cpu
from shipnet.engine.simulation import simulate
from shipnet.engine.system import System
from shipnet.errors import ArgumentError


def test_conversion_times_are_proportional_to_the_analogue_inputs():
    system = System()
    one = system.firmware.input_time
    assert one == pytest.approx(1e-3 + 13 / 125e3)
    assert (system.convert_ns / 1e9).tolist() == pytest.approx([37 * one, 16 * one, 27 * one])
    frames = np.array([10, 5, 7])
    assert (system.loop_ns - system.convert_ns).tolist() == (frames * 100_000).tolist()


def test_points_are_sampled_in_turn_and_switches_last():
    system = System()
    own = system.box_of == 2
    offsets = system.offset_ns[own]
    analogue = np.array([p.analogue for p in system.points])[own]
    assert np.ptp(np.diff(offsets[analogue])) == 0
    assert set(offsets[~analogue].tolist()) == {int(system.convert_ns[2])}
    # The last input is sampled 13 - 1.5 clocks before its conversion ends.
    left = (system.convert_ns[2] - offsets[analogue].max()) / 1e9
    assert left == pytest.approx(11.5 / 125e3, abs=1e-8)


BUSY = st.lists(st.integers(7, 40), max_size=6).map(np.cumsum)
LENGTH = 6


def brute(begins, length, until):
    """Return for each nanosecond whether the CPU is free for other work."""
    free = np.ones(until, dtype=bool)
    for begin in begins:
        free[begin : begin + length] = False
    return free


@given(begins=BUSY, time=st.integers(0, 300), work=st.integers(1, 90))
def test_work_ends_where_a_count_of_free_nanoseconds_ends(begins, time, work):
    free = brute(begins, LENGTH, 1000)
    cpu = Cpu(begins, LENGTH)
    assert cpu.until(np.array([time]))[0] == free[:time].sum()
    done = time + int(np.searchsorted(np.cumsum(free[time:]), work)) + 1
    assert cpu.at(cpu.until(np.array([time])) + work)[0] == done


@given(begins=BUSY, due=st.lists(st.integers(0, 300), min_size=1, max_size=8).map(sorted))
def test_jobs_wait_for_each_other(begins, due):
    work, cpu = 5, Cpu(begins, LENGTH)
    free = brute(begins, LENGTH, 2000)
    now, expected = 0, []
    for time in due:
        now = max(now, time)
        now += int(np.searchsorted(np.cumsum(free[now:]), work)) + 1
        expected.append(now)
    assert cpu.at(cpu.queue(np.array(due), work) + work).tolist() == expected


def test_modbus_interrupts_prolong_the_conversion_but_can_does_not():
    phases = {"JB1": 0.0, "JB2": 0.25, "JB3": 0.28, "AMS": 0.0}
    firmware = Firmware(processing=6e-3)
    system = System(firmware=firmware, update_period=0.5)
    run = simulate(system, until=3, phases=phases)
    loop = run.loops[0].converted
    length = np.diff(loop[loop > 0])[:4] / 1e6
    # A poll falls in the rounds at 1.0 s and 2.0 s, but not in those at 0.5 s and 1.5 s.
    assert length.tolist() == pytest.approx([494.0, 506.0, 494.0, 506.0])
    assert np.ptp(np.diff(run.loops[1].converted)) == 0


def test_a_cpu_does_one_thing_at_a_time_and_loses_no_work():
    phases = {"JB1": 0.0, "JB2": 0.01, "JB3": 0.02, "AMS": 0.0}
    run = simulate(System(), until=5, phases=phases)
    table = run.timeline(0.9, 3.2)
    for _, rows in table.groupby("row"):
        ordered = rows.sort_values("start_ms")
        gaps = ordered["start_ms"].to_numpy()[1:] - ordered["end_ms"].to_numpy()[:-1]
        assert (gaps >= -1e-9).all()
    one = table[(table["row"] == "JB1") & table["start_ms"].between(1000, 1100)]
    took = (one["end_ms"] - one["start_ms"]).groupby(one["task"]).sum()
    # 12 frames of the other two boxes, the interrupt, and 10 frames to hand over.
    assert took["CAN"] == pytest.approx(12 * 0.05)
    assert took["Modbus"] == pytest.approx(5)
    assert took["send"] == pytest.approx(1)
    within = one[(one["task"] == "CAN") & (one["start_ms"] < 1000 + 45.848)]
    lost = (within["end_ms"] - within["start_ms"]).sum()
    assert took["convert"] == pytest.approx(37 * 1.104 - lost, abs=0.06)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Firmware(adc_clock=1e6), "adc_clock is 1e"),
        (lambda: Firmware(settling=-1), "settling is -1"),
        (lambda: Firmware(receive=float("nan")), "receive is nan"),
        (lambda: Firmware(processing=0), "processing is 0"),
        (lambda: Firmware().conversion_time(-1), r"n_analogue is -1.*0\.\.1000"),
        (lambda: simulate(System(), until=1).timeline(0, None), "stop is None"),
        (lambda: simulate(System(), until=1).timeline(1, 1), "stop is 1 s"),
    ],
)
def test_arguments_out_of_range_are_named(make, message):
    with pytest.raises(ArgumentError, match=message):
        make()


def test_the_timer_marks_a_silent_box_once_and_only_where_values_are_read():
    system = System()
    run = simulate(system, until=20, faults=[DeadBox("JB2", start=10)], phases={"JB2": 0.2})
    table = run.timeline(0, 20).query("task == 'timer'")
    # JB1 and JB3 answer the AMS. The last frames of JB2 came from the round before its death.
    assert table["row"].tolist() == ["JB1", "JB3"]
    for mark in table.itertuples():
        assert mark.end_ms - mark.start_ms == pytest.approx(1e3 * system.firmware.mark)
        assert 13.5e3 < mark.start_ms < 14e3
    assert run.timeline(0, 10).query("task == 'timer'").empty
    corrected = simulate(System.corrected(), until=20, faults=[DeadBox("JB2", start=10)])
    assert corrected.timeline(0, 20).query("task == 'timer'").empty
