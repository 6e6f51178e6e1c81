from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shipnet import modbus
from shipnet.errors import ArgumentError
from shipnet.remote_control import (
    Change,
    CobsFormat,
    MarkerFormat,
    Supervision,
    System,
    read_capture,
    simulate,
)
from shipnet.remote_control.faults import HOPS, DeadStation, LostPacket, Stall
from shipnet.remote_control.system import BIT_RATES, VALUES, Counter, forwarded, values_on
from tests.support import several

PRINTED, INTENDED = Supervision(), Supervision.intended()


def full(**fields):
    """Return a system that sends all its items in every packet."""
    system = System(**fields)
    return replace(system, repeat=system.n_items)


def ticks(run, station):
    """Return the largest number of ticks that a station had counted when a heartbeat arrived."""
    return max(ticks for _, name, _, ticks in run.heartbeats if name == station)


def silences(run, station):
    """Return how long a slave received no heartbeat after each of its own packets."""
    signs = np.array([time for time, name, *_ in run.heartbeats if name == station])
    ends = np.array([packet.end for packet in run.packets if packet.source == station])
    place = np.searchsorted(signs, ends, side="right")
    heard = place < signs.size
    return signs[place[heard]] - ends[heard]


def cycle_times(run):
    """Return the times from one packet of RCS to BCS to the next."""
    traffic = run.traffic()
    return np.diff(traffic.start_s[(traffic.source == "RCS") & (traffic.target == "BCS")])


SYSTEMS = st.builds(
    lambda reading, n, rate, bits, work: full(
        packet_format=MarkerFormat(reading, n), bit_rate=rate, character_bits=bits, processing=work
    ),
    st.sampled_from("AB"),
    st.integers(1, 20),
    st.sampled_from(BIT_RATES),
    st.sampled_from([10, 11]),
    st.floats(0, 0.2),
)


@settings(max_examples=25)
@given(system=SYSTEMS, seed=st.integers(0, 1000))
def test_a_healthy_simulated_link_has_the_times_of_the_closed_forms(system, seed):
    rng = np.random.default_rng(seed)
    run = simulate(system, until=6.5 * system.cycle_time, rng=rng)
    assert cycle_times(run) == pytest.approx(system.cycle_time, rel=1e-9)
    assert (run.traffic().outcome.iloc[:-1] == "ok").all()
    for slave in ("BCS", "SS"):
        assert silences(run, slave)[:-1] == pytest.approx(system.idle_time, rel=1e-9)
        assert system.max_ticks - 2 <= ticks(run, slave) <= system.max_ticks


def test_the_maximum_number_of_ticks_is_reached_in_some_phase_and_exceeded_in_none():
    system = full(bit_rate=600)
    seen = [ticks(simulate(system, until=30, rng=seed), "BCS") for seed in range(25)]
    assert max(seen) == system.max_ticks == 17


def test_a_station_that_sends_stores_no_bytes():
    # RCS gives up after 10 ms and sends to the other slave while the answer of 34 ms arrives.
    traffic = simulate(full(turn_timeout=0.01), until=1.0).traffic()
    answers = traffic[traffic.target == "RCS"]
    assert len(answers) > 3 and (answers.outcome == "lost").all()


@pytest.mark.parametrize(("rule", "ticks"), [(PRINTED, 44), (INTENDED, 30)])
def test_a_counter_fails_at_its_tick_and_again_after_as_many_ticks(rule, ticks):
    counter = Counter(rule)
    failures = [k for k in range(1, 3 * ticks + 1) if counter.step()]
    assert failures == [ticks, 2 * ticks, 3 * ticks] == [rule.n_ticks * k for k in (1, 2, 3)]
    assert counter.clear() and not counter.clear()


def test_a_master_that_is_dead_at_power_on_sends_nothing_until_it_starts():
    fault = DeadStation("RCS", stop=0.5)
    traffic = simulate(full(), until=1, faults=fault).traffic()
    assert traffic.start_s.iloc[0] == 0.5 and traffic.source.iloc[0] == "RCS"


@pytest.mark.parametrize("rule", [PRINTED, INTENDED, Supervision(0.05, 4, 2)])
def test_a_dead_master_is_noticed_within_the_detection_time(rule):
    system = full(slave=rule, bit_rate=9600)
    rng = np.random.default_rng(5)
    for _ in range(20):
        run = simulate(system, until=7, faults=[DeadStation("RCS", start=1.0)], rng=rng)
        for slave in ("BCS", "SS"):
            heard = max(time for time, name, *_ in run.heartbeats if name == slave)
            failed = run.alarms().query("station == @slave").time_s.iloc[0]
            low, high = rule.detection_time
            # A slave that is still sending counts later, by the time of that packet.
            assert low < failed - heard <= high + system.packet_time + rule.tick


@pytest.mark.parametrize(("bit_rate", "alarm"), [(9600, "possible"), (600, "certain")])
def test_a_dead_slave_costs_the_wait_and_the_silence_of_the_closed_form(bit_rate, alarm):
    system, rng = full(bit_rate=bit_rate), np.random.default_rng(7)
    # SS dies during an exchange of RCS with BCS, so no partial packet spoils the next exchange.
    died = 10 * system.cycle_time + system.packet_time
    waits, silent, alarms = [], [], 0
    for _ in range(20):
        run = simulate(system, until=died + 6, faults=DeadStation("SS", start=died), rng=rng)
        first = run.alarms().query("station == 'RCS'").time_s.min()
        waits.append(first - next(p.end for p in run.packets if p.target == "SS" and died <= p.end))
        silent.append(silences(run, "BCS").max())
        alarms += bool(len(run.alarms().query("station == 'BCS' and time_s < @first + 0.2")))
    seen, slack = system.cascade(), 1e-6
    assert seen.wait[0] - slack <= min(waits) <= max(waits) <= seen.wait[1] + slack
    assert seen.silent[0] - slack <= min(silent) <= max(silent) <= seen.silent[1] + slack
    assert seen.alarm == alarm == ("certain" if alarms == 20 else "possible")
    assert alarms > 0


@pytest.mark.parametrize("bit_rate", [9600, 600])
@pytest.mark.parametrize(
    "change",
    [{}, *({"master": Supervision(miss_limit=m)} for m in (0, 1)), {"turn_timeout": 1.0}],
    ids=["printed", "limit 0", "limit 1", "turn"],
)
def test_no_failure_in_the_cycle_silences_bcs_longer_than_the_bound(change, bit_rate):
    system, rng = full(bit_rate=bit_rate, **change), np.random.default_rng(5)
    seen, pairs, longest, places = system.cascade(), set(), 0.0, several(12, 30)
    for k in range(places):
        died = 3 + system.cycle_time * (k + 0.5) / places
        run = simulate(system, until=died + 16, faults=[DeadStation("SS", start=died)], rng=rng)
        pairs |= set(zip(run.alarms().station, run.alarms().partner, strict=True))
        longest = max(longest, silences(run, "BCS").max())
    # In some runs a partial answer in the ring spoils that of BCS: the bound is nearly attained.
    assert seen.longest - 2 * system.master.tick <= longest <= seen.longest + 1e-9
    assert (seen.alarm == "never") == (("BCS", "RCS") not in pairs)
    # RCS declares the healthy BCS failed, unless the turn ends before the counters reach the limit.
    assert (("RCS", "BCS") in pairs) == (system.turn_timeout is None)


def test_a_lost_packet_leaves_a_switch_stale_until_it_moves_again_unless_values_are_repeated():
    changes = [Change(1.0, "BCS", 1, 1), Change(9.0, "BCS", 1, 0)]
    fault, patient = LostPacket("BCS", "RCS", start=1.0), Supervision(miss_limit=0)
    stale, corrected = (
        simulate(system, changes, until=12, faults=fault).delays("SS")
        for system in (System(master=patient), full(master=patient))
    )
    # The second move returns the switch to the position that SS still shows.
    assert np.isnan(stale.delay_s[0]) and stale.delay_s[1] == 0
    # RCS waits 1.1 s for the lost packet, and receives the values in the next cycle.
    assert 1.0 < corrected.delay_s[0] < 1.1 + 2 * full().response_time()


@settings(max_examples=15)
@given(system=SYSTEMS, times=st.lists(st.floats(0.1, 10), min_size=1, max_size=4, unique=True))
def test_a_change_reaches_the_other_slave_within_the_response_time(system, times):
    system = replace(system, packet_format=MarkerFormat("A", 10), repeat=10)
    long = 2 * system.response_time()
    when = np.cumsum([long + time for time in times])
    changes = [Change(float(t), "BCS", 1, k + 1) for k, t in enumerate(when)]
    run = simulate(system, until=float(when[-1] + long), changes=changes)
    delay = run.delays("SS").delay_s
    assert (delay <= system.response_time() * (1 + 1e-9)).all()
    hop = run.delays("RCS").delay_s
    assert (hop < delay).all()


def test_the_response_time_is_reached_by_a_change_just_after_a_packet_was_made():
    system = full(bit_rate=2400, processing=0.05)
    made = 3 * system.cycle_time + system.packet_time + system.processing
    run = simulate(system, until=made + 6, changes=[Change(made + 1e-9, "BCS", 2, 1)])
    assert run.delays("SS").delay_s[0] == pytest.approx(system.response_time(), rel=1e-6)


def test_a_stall_overruns_the_ring_after_the_time_of_the_closed_form():
    system = full(turn_timeout=0.1)
    stall, byte = system.overrun_stall()[0], system.character_time
    start = 10 * system.cycle_time + 0.9 * byte

    def repairs(length):
        fault = Stall("BCS", start=start, stop=start + length)
        table = simulate(system, until=start + length + 1, faults=[fault]).events()
        return int(table.event.str.startswith("ring").sum())

    assert [repairs(stall - byte), repairs(stall + byte)] == [0, 1]


def test_a_task_that_finds_two_unread_laps_takes_the_ring_for_empty():
    # The first response, of 32 bytes, arrives while the task of RCS is busy.
    form = MarkerFormat(n_numbers=9, crc=True)
    system, fault = full(packet_format=form, ring_size=16), Stall("RCS", start=0.03, stop=0.1)
    table = simulate(system, until=0.2, faults=fault).events()
    assert table[["event", "detail"]].values.tolist()[1:] == [
        ["ring overrun unnoticed", "32 bytes unread, 32 lost"]
    ]


@settings(max_examples=15)
@given(seed=st.integers(0, 10**6), corrected=st.booleans(), stall=st.floats(0.01, 3))
def test_no_combination_of_faults_stops_the_simulation(seed, corrected, stall):
    form = CobsFormat() if corrected else MarkerFormat("B", numbers="any")
    system = System(form, turn_timeout=0.05, repeat=3)
    faults = [
        LostPacket("SS", "RCS", start=0.1),
        Stall("RCS", start=1, stop=1 + stall),
        DeadStation("BCS", start=0.5, stop=2.5),
    ]
    changes = [Change(0.2, "SS", 1, 0xCCDD)]
    rng = np.random.default_rng(seed)
    run = simulate(system, until=4, faults=faults, changes=changes, rng=rng)
    assert run.states().time_s.is_monotonic_increasing and run.states().time_s.max() <= 4
    assert set(run.traffic().outcome) <= {"ok", "wrong", "lost"}


def test_three_seconds_at_600_bit_per_s_allow_a_number_of_items():
    for name, reading, most in (
        ("idle_time", "A", 28),
        ("idle_time", "B", 21),
        ("counted_time", "A", 19),
        ("counted_time", "B", 21),
    ):
        systems = [System(MarkerFormat(reading, n), bit_rate=600) for n in (most, most + 1)]
        within, beyond = (getattr(system, name) for system in systems)
        assert within <= 3.0 < beyond


def test_a_slower_line_leaves_fewer_ticks_before_the_alarm():
    table = System().timing().table()
    assert table.ticks.is_monotonic_increasing and table.printed_margin.is_monotonic_decreasing
    assert (table.printed_margin - table.intended_margin == 14).all()


def test_one_fault_or_change_needs_no_list():
    run = simulate(System(), Change(0.5, "SS", 1, 1), until=8, faults=DeadStation("BCS", stop=1))
    assert run.faults == (DeadStation("BCS", stop=1),)
    assert repr(run) == f"Run(8 s, {len(run.packets)} packets, {len(run.alarms())} alarms)"
    assert run.history(1, "SS").values.tolist() == [[0, 0], [0.5, 1]]
    assert run.history(1, "RCS").value.tolist()[-1] == 1


def test_a_packet_is_lost_only_if_it_begins_during_the_fault():
    for stop, lost in ((3.0, 1), (2.7, 0)):  # BCS begins a packet at 0.55 s and at 2.75 s
        fault = LostPacket("BCS", "RCS", start=1.0, stop=stop)
        traffic = simulate(full(bit_rate=600), until=4, faults=fault).traffic()
        assert (traffic.outcome[traffic.end_s < 4] == "lost").sum() == lost


def test_a_packet_that_the_end_of_the_run_cuts_off_is_not_drawn_as_lost(ax):
    run = simulate(full(), until=0.4)
    assert run.packets[-1].end > run.until and run.packets[-1].outcome == "lost"
    run.plot(ax)
    assert not any(patch.get_hatch() for patch in ax.patches)
    assert "lost" not in [text.get_text() for text in ax.get_legend().get_texts()]


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: System(repeat=11), r"repeat is 11.*0\.\.10"),
        (lambda: Supervision(miss_limit=0, strict=False), "miss_limit is 0"),
        (lambda: System(None), "packet_format is None"),
        (lambda: System(master=None), "master is None"),
        (
            lambda: simulate(System(), until=1, changes=[(0.1, "SS", 1)]),
            r"one of changes is \(0\.1, 'SS', 1\)",
        ),
        (lambda: Stall("SS", start=0, stop=float("inf")), "a stall must end"),
        (lambda: LostPacket("BCS", "SS", start=0), "'BCS', 'SS'"),
        (lambda: simulate(System(), until=1e6), "bytes and ticks"),
        (lambda: simulate(System(), until=1, faults=["SS dies"]), "one of faults is 'SS dies'"),
        (
            lambda: simulate(System(), until=1, changes=[Change(0, "BCS", 10, 1)]),
            r"number.*is 10.*0\.\.9",
        ),
        (lambda: System(ring_size=33).overrun_stall(), "ring_size is 33"),
        (lambda: simulate(System(), until=1).plot(start=50, stop=60), "contains 0 packets"),
    ],
)
def test_arguments_out_of_range_are_named(make, message):
    with pytest.raises(ArgumentError, match=message):
        make()


@pytest.mark.parametrize(
    "make",
    [
        lambda rate: System(bit_rate=rate),
        lambda rate: modbus.SerialLine(rate),
        lambda rate: modbus.scan(2, registers=4, bit_rate=rate),
        lambda rate: modbus.interfaces(2, 60, rate),
        lambda rate: read_capture("bus.csv", rate),
    ],
)
def test_a_bit_rate_in_kbit_per_second_is_refused(make):
    for rate in (9.6, 19.2, 115.2):
        with pytest.raises(ArgumentError, match=rf"bit_rate is {rate:g} bit/s; it must be 300\.\."):
            make(rate)


def test_the_values_are_numbered_used_and_sent_through_rcs():
    assert [value.number for value in VALUES] == list(range(len(VALUES)))
    assert {hop for value in VALUES for hop in value.hops} == set(HOPS)
    assert not any(set(value.sources) & set(value.readers) for value in VALUES)
    table = System().signals()
    for source, target in HOPS:
        numbers = table["number"][table[f"{source}-{target}"]].tolist()
        assert numbers == [value.number for value in values_on(source, target)]


def test_only_the_switches_that_the_paper_doubles_are_mirrored():
    mirrored = {value.name: set(value.sources) for value in VALUES if value.mirrored}
    assert mirrored == {
        "control_position": {"BCS", "RCS"},
        "shutdown_cancel": {"BCS", "SS"},
        "slowdown_cancel": {"BCS", "SS"},
    }
    assert all(value.kind == "switch" for value in VALUES if value.mirrored)


def test_forwarded_values_cross_both_lines():
    for source, target in (("BCS", "SS"), ("SS", "BCS")):
        first = {value.number for value in values_on(source, "RCS")}
        second = {value.number for value in values_on("RCS", target)}
        assert forwarded(source, target) <= first & second
