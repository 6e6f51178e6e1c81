from dataclasses import replace
from functools import partial
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shipnet.ballast.live import gateway
from shipnet.ballast.master import Station, operate
from shipnet.ballast.plant import Command, Fault, Plant
from shipnet.ballast.registers import COMMAND_REGISTER, Code
from shipnet.ballast.scan import READ_STATUS, System, command_poll, status_poll
from shipnet.ballast.simulation import simulate
from shipnet.errors import ArgumentError
from shipnet.modbus.faults import Break, DeadPort, DeadSlave, Short
from shipnet.modbus.pdu import Adu, Request
from shipnet.modbus.redundancy import Loop
from shipnet.modbus.simulation import simulate as poll_loop
from shipnet.modbus.slave import answer
from shipnet.modbus.uart import SerialLine
from shipnet.papers.kim2014.registers import answer_table

LINE = SerialLine(9600)


def plant(n, **options):
    return Plant(System(n, status_poll(LINE), **options))


def simulated(n, *orders, until, timeout=1.0, **options):
    system = System(n, status_poll(LINE, timeout=timeout))
    return simulate(system, orders, until=until, **options)


def scan_gap(run):
    """Return the longest time between two statuses of any valve [s]."""
    return run.answers.groupby("unit")["shown_s"].diff().max()


@pytest.mark.parametrize("rate", [2400, 9600, 19200, 38400, 115200])
def test_scan_times_follow_from_characters_and_silences(rate):
    silence = 3.5 * 11 / rate if rate <= 19200 else 1.75e-3
    row = System(247, status_poll(processing=5e-3)).scan_times().loc[rate]
    read = (8 + 13) * 11 / rate + 2 * silence + 5e-3
    assert row["scan_s"] == pytest.approx(247 * read)
    assert row["worst_age_s"] == pytest.approx(248 * read - 8 * 11 / rate - silence)
    assert row["valves_in_2_s"] == int(2 / read)


@pytest.mark.parametrize("n", [1, 247, 248, 249, 256, 494, 495, 1000])
def test_valves_are_divided_evenly_among_as_few_masters_as_possible(n):
    shares = System(n).valve_addresses()
    sizes = shares["master"].value_counts()
    assert len(sizes) == -(-n // 247)
    assert sizes.max() - sizes.min() <= 1
    assert sizes.max() <= 247
    assert list(shares.index) == list(range(1, n + 1))
    for _, own in shares.groupby("master"):
        assert own["unit"].tolist() == list(range(1, len(own) + 1))
    assert System(n).scan_times()["masters"].unique().tolist() == [len(sizes)]


@pytest.mark.parametrize(("n", "commands"), [(1, 0), (5, 0), (40, 0), (40, 3)])
def test_the_oldest_position_shown_has_the_age_of_the_closed_form(n, commands):
    orders = [Command("open", 3.0, valves=range(1, commands + 1))] if commands else []
    run = simulated(n, *orders, until=10)
    age = System(n, status_poll(LINE)).worst_age(commands=commands)
    assert run.oldest == pytest.approx(age, abs=1e-9)
    times = np.linspace(5, 9, 4001)
    # The age as seen at any time.
    assert run.ages(times).max() <= age + 1e-9
    assert run.ages(times).min() >= status_poll(LINE).shortest_timeout - 1e-9


def test_shown_positions_are_those_at_the_end_of_the_request():
    run = simulated(20, Command("open", 2.0, valves=8), until=12)
    mine = run.answers.query("unit == 8")
    sent = run.commands["sent_s"][0]
    since = mine["read_s"].to_numpy() - sent
    expected = np.clip(100 * since / 9.0, 0, 100)
    # 0.1 s between two readings at 11.1 % per second, and half a percent of rounding.
    assert mine["VPos_percent"].to_numpy() == pytest.approx(expected, abs=1.7)
    assert run.answers.query("unit != 8")["VPos_percent"].max() == 0


def test_a_command_is_sent_between_two_polls_and_takes_one_transaction():
    run = simulated(10, Command("open", 1.0, valves=[3, 6]), until=3)
    first, second = run.commands.itertuples()
    assert (first.unit, second.unit) == (3, 6)
    assert 1.0 <= first.sent_s < 1.0 + status_poll(LINE).time
    assert second.sent_s == first.free_s
    assert first.free_s - first.sent_s == pytest.approx(command_poll(run.poll).time)
    assert scan_gap(run) == pytest.approx(10 * run.poll.time + 2 * command_poll(run.poll).time)
    assert run.commands["value"].tolist() == ["0x0008", "0x0008"]


def test_without_commands_the_station_polls_like_the_loop_simulation():
    system = System(12, status_poll(LINE, timeout=0.3))
    faults = [Break(5, start=2.0), DeadSlave(3, start=4.0, stop=90.0)]
    station = Station(Plant(system), faults)
    station.run_until(150.0)
    theirs = poll_loop(system.loop, faults=faults, until=150.0)
    ours = [t for t in station.tries if t[0] < 150]
    assert [t[1:] for t in ours] == [t[1:] for t in theirs.tries]
    assert [t[0] for t in ours] == pytest.approx([t[0] for t in theirs.tries])


@pytest.mark.parametrize(
    "faults", [[Break(5)], [DeadPort("A")], [DeadSlave(4)], [Break(3), Break(6)]]
)
def test_no_gap_is_longer_than_the_ring_allows(faults):
    begun = [replace(fault, start=1.7) for fault in faults]
    run = simulated(10, timeout=0.4, until=30, faults=begun)
    bound = Loop(10, run.poll).worst_gap(faults)
    for unit in range(1, 11):
        shown = run.answers.query(f"unit == {unit}")["shown_s"].to_numpy()
        if np.isfinite(bound[unit - 1]):
            assert np.diff(shown).max() <= bound[unit - 1] + 1e-9
            assert shown[-1] > 29
        else:
            assert shown[-1] < 2.2
            assert run.screen().table().state[unit] == "silent"


def test_a_shorted_line_is_retried_later_and_recovers():
    run = simulated(3, until=100, faults=Short(1, start=1.0, stop=30.0))
    assert run.screen(20.0).table().state.tolist() == ["silent"] * 3
    assert run.screen().table().state.tolist() == ["closed"] * 3
    assert run.screen(0.01).table().state.tolist() == ["not seen"] * 3
    assert np.isinf(run.screen(0.01).table()["age_s"]).all()


def test_a_command_that_is_lost_is_reported_and_not_repeated():
    orders = [Command("open", 2.0, valves=4)]
    cut = [Break(0, start=1.99), DeadPort("B", start=1.99)]
    valves = plant(5)
    run = operate(valves, orders, until=15, faults=cut)
    assert run.commands["outcome"].tolist() == ["no answer"]
    assert valves.opening.tolist() == [0.0] * 5


@pytest.mark.parametrize("n", [5, 50])
def test_the_scan_gap_of_a_command_has_the_closed_form(n):
    expected = answer_table(LINE, n, 9.0).loc["at the start"]
    run = simulate(System(n, status_poll(LINE)), [Command("open", 2.0, valves=2)], until=25)
    assert run.commands["outcome"].tolist() == ["done"]
    assert scan_gap(run) == pytest.approx(expected.scan_gap_s, abs=1e-9)
    moving = run.answers.query("unit == 2 and MC_A > 0")
    assert abs(len(moving) - expected.polls_while_moving) <= 1


def test_position_codes_depend_on_the_position_shown():
    orders = [Command(60, 1.0, valves=1), Command(20, 10.0, valves=1)]
    valves = plant(2)
    run = operate(valves, orders, until=20)
    assert run.commands["value"].tolist() == [f"0x{60:02X}0A", f"0x{20:02X}06"]
    assert valves.opening == pytest.approx([0.2, 0.0], abs=0.002)
    assert run.screen().table().position_percent.tolist() == [20, 0]
    assert run.screen().table().state.tolist() == ["part open", "closed"]


def test_modes_and_refusals():
    station = Station(plant(3))
    station.slaves[2].device.local = True
    assert station.command("open", 2).outcome == "server device failure"
    assert station.command("open", 1).outcome == "done"
    station.run_until(3.0)
    assert station.seen.screen().table().state.tolist() == ["moving", "closed", "closed"]
    assert station.command("manual", 1).outcome == "done"
    station.run_until(4.0)
    assert station.seen.screen().table().state[1] == "part open"
    assert station.command("close", 1).outcome == "server device failure"
    assert station.command("auto", 1).outcome == "done"
    assert station.command("close", 1).outcome == "done"
    station.slaves[3].device.monitor.found[2, 3] = True
    station.run_until(9.0)
    assert station.seen.screen().table()[["state", "fault"]].values.tolist()[2] == ["fault", 4]
    with pytest.raises(ArgumentError, match="no code for it"):
        station.command("stop", 1)
    with pytest.raises(ArgumentError, match="unit is 4"):
        station.command("open", 4)
    with pytest.raises(ArgumentError, match="action is 101"):
        station.command(101, 1)


def test_a_pc_sees_the_last_scan_and_commands_through_the_master():
    system = System(3, status_poll(LINE))
    station = Station(Plant(system, Fault("Pos3", valves=3)))
    served = gateway(station)

    def ask(unit, request):
        return answer(served, Adu(unit, request), station.time).pdu

    write_request = partial(Request.write_single_register, COMMAND_REGISTER)
    assert ask(1, READ_STATUS).hex() == "840b"
    station.run_until(1.0)
    sent = write_request(station.registers.command(Code.OPEN))
    before = station.time
    assert ask(1, sent) == sent.pdu
    assert station.time - before == pytest.approx(command_poll(station.seen.poll).time)
    station.run_until(14.0)
    assert ask(3, READ_STATUS)[2] == 15
    assert ask(1, READ_STATUS)[2] == 100
    assert ask(9, READ_STATUS).hex() == "840b"
    assert ask(1, write_request(7)).hex() == "8603"
    assert ask(0, sent) == b""
    station.slaves[1].device.local = True
    assert ask(1, sent).hex() == "8604"


@settings(max_examples=25)
@given(
    st.lists(
        st.tuples(
            st.sampled_from(["open", "close", "position"]), st.floats(0, 7.5), st.integers(0, 4)
        ),
        max_size=6,
    ),
    st.lists(
        st.sampled_from(
            [
                Break(0, start=2.0),
                Break(3, start=1.0, stop=4.0),
                DeadSlave(2, start=3.0),
                DeadPort("B"),
            ]
        ),
        max_size=2,
        unique=True,
    ),
)
def test_transactions_never_overlap(orders, faults):
    commands = [
        Command(50 if action == "position" else action, time, valves=valve + 1)
        for action, time, valve in orders
    ]
    poll = status_poll(LINE, timeout=0.1)
    run = simulate(System(5, poll), commands, until=8, faults=faults)
    spans = [(t[0], t[0] + (poll.time if t[4] else poll.unanswered_time)) for t in run.tries]
    spans = sorted(spans + [(w.time, w.end) for w in run.writes])
    assert all(a[1] <= b[0] + 1e-9 for a, b in pairwise(spans))
    assert all(shown.read < shown.time for shown in run.shown)
    assert len(run.writes) == len(commands) or faults
    assert set(run.screen().table().state) <= {
        "silent",
        "not seen",
        "moving",
        "open",
        "closed",
        "part open",
    }


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Station(Plant(2)), "the system has no poll"),
        (lambda: Station(plant(1), [Break(2)]), "section is 2"),
        (lambda: operate(plant(1), until=-1), "until is -1"),
        (lambda: operate(plant(1), [Command("stop")], until=1), "no code for it"),
        (lambda: System(1, status_poll()).worst_age(commands=-1), "commands is -1"),
    ],
)
def test_a_bad_argument_is_named(make, message):
    with pytest.raises(ArgumentError, match=message):
        make()


def test_a_master_without_statuses_shows_every_valve_as_not_seen():
    run = simulated(2, until=0)
    assert run.answers.empty and run.commands.empty
    assert np.isinf(run.oldest)
    assert run.screen().table().state.tolist() == ["not seen"] * 2
