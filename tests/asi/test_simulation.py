"""The line simulated telegram by telegram: against closed forms, and against a second model."""

import numpy as np
import pytest

from shipnet import compiled
from shipnet.asi import BIT_TIME, Call, Request, Response
from shipnet.asi.channel import TRANSACTION
from shipnet.asi.commands import ChangeAddress, ReadCodes, ResetSlave, WriteParameter
from shipnet.asi.faults import (
    BrokenCable,
    DeadSlave,
    LateAnswer,
    LostReply,
    MasterFailure,
    PeripheryFault,
    SupplyDip,
    TelegramErrors,
)
from shipnet.asi.master import FAULTY, SILENT, Master, Phase, RunningMaster
from shipnet.asi.modulation import Modulation, Pulses
from shipnet.asi.simulation import Run, Standby, simulate
from shipnet.asi.slave import KINDS, Event, RunningSlave, as_read
from shipnet.asi.timing import Transaction
from shipnet.clock import Fault
from shipnet.errors import ArgumentError, SilenceError
from tests.asi.lines import draw, placed, simulate_drawn, slave, undisturbed

FULL = [slave("S-7.A.E", a, half, inputs=a % 16) for a in range(1, 32) for half in "AB"]
STANDARD = [slave("S-7.F.F", address, inputs=address % 16) for address in range(1, 32)]
THREE = STANDARD[:3]
PROJECTED = {one.label: one.profile for one in THREE}


# A second model: every slave receives every telegram as bits, with its table of states.


class EverySlaveHears:
    """A line that simulates every slave, and draws and records its own disturbances."""

    def __init__(self, slaves, rates, rng, n_cycles):
        self.slaves, self.rates, self.rng = slaves, rates, rng
        self.time, self.rows, self.begun = 0.0, [], 0
        self.drawn = undisturbed(n_cycles + 1, len(slaves))
        self.missed = np.zeros(len(slaves), dtype=bool)
        self.asked = np.zeros(len(slaves), dtype=bool)
        for one in slaves:
            one.pause()

    @property
    def seconds(self):
        return self.time * BIT_TIME

    def begin(self, phase, cycle):
        self.phase, self.cycle = phase, cycle if phase >= Phase.DATA_EXCHANGE else -1
        if phase == Phase.DATA_EXCHANGE:
            self.begun += 1

    def transact(self, order, attempt):
        cyclic = self.phase >= Phase.DATA_EXCHANGE
        end = self.time + 14
        answers, missed, asked = [], np.zeros_like(self.missed), np.zeros_like(self.asked)
        note = self.drawn[self.begun - 1, self.phase - 3, :, attempt] if cyclic else None
        for i, one in enumerate(self.slaves):
            lost = cyclic and self.rng.random() < self.rates[i][0]
            here = order.address == one.address and order.call is not Call.BROADCAST_RESET
            own = here and as_read(order.bits, one.kind) is not None
            in_step = one.fields["synchronised"]
            if own and cyclic:
                asked[i] = True
                note["missed"][i] |= self.missed[i] and not self.asked[i]
                note["lost"][i] |= lost
            missed[i] = lost
            bits = order.bits[:-2] + str(1 - int(order.bits[-2])) + "1" if lost else order.bits
            answer = one.hear(bits, end * BIT_TIME)
            if answer is not None:
                answers.append((i, answer, 3.0 if in_step else 5.0))
        self.missed, self.asked = missed, asked
        reply, error, pause, took = SILENT, SilenceError.code, np.nan, 10.0
        if answers:
            ((i, answer, pause),) = answers
            took = pause + 7 + 2
            slots = np.pad(Modulation(answer.bits).pulses.signs, (0, 2))
            if cyclic and self.rng.random() < self.rates[i][1]:
                variant = self.rng.integers(32)
                note["variant"][i] = variant + 1
                others = [v for v in (-1, 0, 1) if v != slots[variant // 2]]
                slots[variant // 2] = others[variant % 2]
            bits, code = Pulses(slots).check()
            error = int(code)
            reply = FAULTY if error else int("".join(map(str, bits[1:5])), 2)
            for one in self.slaves:
                one.pause(Event.PAUSE)
            for j, one in enumerate(self.slaves):
                if j != i:
                    one.hear(answer.bits, end * BIT_TIME)
        for one in self.slaves:
            one.pause(Event.SLAVE_PAUSE)
        outcome = attempt, error, pause, max(reply, -1), bool(answers)
        request = order.bits, order.call, order.address, KINDS.index(order.half), order.data
        self.rows.append((self.time, *outcome, self.phase, self.cycle, False, *request))
        self.time = end + took
        return reply


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("rate", [0.0, 0.05, 0.3])
def test_simulating_only_the_addressed_slaves_changes_nothing(seed, rate):
    rng = np.random.default_rng(seed)
    slaves = [FULL[0], FULL[1], FULL[3], STANDARD[4], STANDARD[8], FULL[40], FULL[41]]
    rates = rng.uniform(0, 2 * rate, (len(slaves), 2))
    n_cycles = 60
    line = EverySlaveHears([RunningSlave(one) for one in slaves], rates, rng, n_cycles)
    master = RunningMaster(Master())
    program = master.run(line)
    order = next(program)
    while line.begun <= n_cycles:
        order = program.send(line.transact(order, master.attempt))
    run = simulate_drawn(line.drawn, slaves, cycles=n_cycles)
    # At the first request all slaves are unsynchronised; only those at address 0 show it.
    expected = np.array(line.rows, TRANSACTION)
    for column in TRANSACTION.names:
        np.testing.assert_array_equal(run.record[column], expected[column])


@pytest.mark.parametrize("slaves", [FULL, STANDARD, [*THREE, STANDARD[2]]], ids=len)
def test_machine_code_simulates_the_same_line(slaves, monkeypatch):
    spoil = [TelegramErrors(one.label, 0.05, 0.05) for one in slaves[:3]]
    dead = DeadSlave(slaves[2].label, start=0.06, stop=0.07)
    settings = {"cycles": 60, "rng": 5, "faults": [*spoil, dead]}
    monkeypatch.setenv("SHIPNET_COMPILED", "0")
    plain = simulate(slaves, Master(drop_after=2), **settings)
    monkeypatch.delenv("SHIPNET_COMPILED")
    monkeypatch.setattr(compiled, "MANY", 0)
    fast = simulate(slaves, Master(drop_after=2), **settings)
    for column in TRANSACTION.names:
        np.testing.assert_array_equal(plain.record[column], fast.record[column])
    assert plain.summary.dropped == fast.summary.dropped > 0


# Times.


def test_the_cycle_is_the_sum_of_its_transactions():
    # 31 exchanges and a status of 26 bit times each, and an unanswered request of 24.
    for slaves, exchanges in ((FULL, 31), (STANDARD, 31), (THREE, 3)):
        run = simulate(slaves, cycles=20)
        assert run.cycle_times == pytest.approx(((exchanges + 1) * 26 + 24) * BIT_TIME)
        assert run.summary.cycles == 20
    assert simulate(FULL, cycles=20).cycle_times.max() < 5.148e-3  # OMRON W357: 33 x 26 bit


@pytest.mark.parametrize(("pauses", "bits"), [((2, 1.5), 24.5), ((3, 2), 26), ((3, 80), 104)])
def test_a_transaction_has_the_length_of_its_parts(pauses, bits):
    transaction = Transaction(master_pause=pauses[0], slave_pause=pauses[1])
    table = simulate(THREE, cycles=2, transaction=transaction).events()
    length = table["time_s"].diff().shift(-1) / BIT_TIME
    answered = table["outcome"] == "ok"
    assert length[answered].dropna().to_numpy() == pytest.approx(bits)
    assert length[~answered].dropna().to_numpy() == pytest.approx(24)


@pytest.mark.parametrize("timeout", [6.0, 10.0])
def test_repeaters_delay_until_the_time_out_and_no_longer(timeout):
    # A synchronised slave is received if 3 bit times and twice the delay are within the time-out;
    # any other needs two more. The sweep is over one-way delays.
    delays = np.arange(0.0, 4.0, 0.25) * BIT_TIME
    transaction = Transaction(timeout=timeout)
    heard = []
    for delay in delays:
        run = simulate(placed(THREE, delays={"2": delay}), until=0.05, transaction=transaction)
        heard.append("2" in run.masters[-1].lists.las)
    assert heard == [bool(3 + 2 * delay / BIT_TIME <= timeout) for delay in delays]
    pauses = simulate(placed(THREE, delays={"2": 6e-6}), cycles=3).events().query("slave == '2'")
    assert (pauses.query("outcome == 'ok'")["master_pause_bit"] == 5).all()


def test_a_line_on_which_nobody_answers_needs_a_duration():
    dead = [DeadSlave(one.label, start=0.15) for one in THREE]
    for slaves, faults in (([], []), (THREE, [SupplyDip(start=0.1, stop=0.2), *dead])):
        with pytest.raises(ArgumentError, match="no slave answers and no cycle begins for 10 s"):
            simulate(slaves, cycles=10**5, faults=faults)


# What the master does.


def test_the_phases_follow_each_other():
    table = simulate(THREE, cycles=3).events()
    order = table["phase"].astype(str)
    changed = order[order != order.shift()].to_list()
    cycle = ["data_exchange", "management", "inclusion"]
    assert changed == ["detection", "activation", *cycle * 3]
    asked = table.query("phase == 'detection' and call == 'READ_IO_CONFIGURATION'")
    # All addresses are polled, but the B halves only where there is no standard slave.
    assert len(asked) == 1 + 31 + (31 - 3)


def test_a_slave_receives_outputs_and_sends_inputs():
    slaves = [slave("S-0.F.F", 1, inputs=6), slave("S-8.F.F", 2), slave("S-7.A.E", 3, "B")]
    run = simulate(slaves, Master(outputs={"2": 5, "3B": 2}), cycles=3)
    received = run.events().query("phase == 'data_exchange'").groupby("slave")["response_data"]
    assert received.last().to_dict() == {"1": 6, "2": 5, "3B": 0}
    assert [slave.fields["outputs"] for slave in run.slaves] == [0xF, 5, 2]


def test_protected_mode_activates_only_what_is_projected():
    run = simulate(THREE, Master({"1": "S-7.F.F", "2": "S-0.F.F"}), cycles=200)
    lists = run.masters[-1].lists
    assert (lists.lds, lists.las) == (["1", "2", "3"], ["1"])
    assert simulate(THREE, Master(PROJECTED), cycles=2).masters[-1].lists.las == ["1", "2", "3"]


def test_a_failed_request_is_repeated_once_at_once():
    drawn = undisturbed(5, 3)
    drawn["lost"][2, 0, 1, 0] = True
    drawn["variant"][3, 0, 1, 0] = 9
    table = simulate_drawn(drawn, THREE, cycles=5).events()
    bad = table.query("phase == 'data_exchange' and outcome != 'ok'")
    assert bad["slave"].to_list() == ["2", "2"]
    assert bad["executed"].to_list() == [False, True]
    assert bad["executed_but_lost"].to_list() == [False, True]
    for row in bad.index:
        after = table.loc[row + 1]
        assert (after["slave"], after["attempt"], after["outcome"]) == ("2", 1, "ok")
    # It answers the repetition late if it missed the request, but not if only the answer was lost.
    assert table.loc[bad.index + 1, "master_pause_bit"].to_list() == [5, 3]


@pytest.mark.parametrize(("repetitions", "drop_after"), [(1, 3), (0, 3), (2, 5), (1, 1)])
def test_a_silent_slave_is_dropped_after_its_tries(repetitions, drop_after):
    master = Master(repetitions=repetitions, drop_after=drop_after)
    run = simulate(THREE, master, cycles=20, faults=[DeadSlave("2", start=12e-3)])
    tries = run.events().query("slave == '2' and phase == 'data_exchange' and outcome != 'ok'")
    worst = (1 + repetitions) * drop_after
    assert len(tries) == worst
    assert run.masters[-1].lists.las == ["1", "3"]
    classes = run.failure_classes()
    assert classes.shape == (3, worst)
    assert classes.loc["2"].to_dict() == {**dict.fromkeys(range(1, worst), 0), worst: 1}
    left = run.lists.query("slave == '2' and list == 'LAS' and not present")
    assert len(left) == run.summary.dropped == 1


@pytest.mark.parametrize("heard_again", [0, 1], ids=["at once", "after a repetition"])
def test_only_cycles_that_fail_in_a_row_drop_a_slave(heard_again):
    drawn = undisturbed(7, 3)
    drawn["lost"][[1, 2, 4, 5], 0, 1, :] = True
    drawn["lost"][3, 0, 1, :heard_again] = True
    run = simulate_drawn(drawn, THREE, cycles=7)
    assert (run.summary.dropped, run.masters[-1].lists.las) == (0, ["1", "2", "3"])
    drawn["lost"][6, 0, 1, :] = True
    assert simulate_drawn(drawn, THREE, cycles=7).summary.dropped == 1


def test_a_slave_that_returns_is_included_again():
    run = simulate(THREE, until=0.3, faults=[DeadSlave("2", start=0.05, stop=0.1)])
    events = run.lists.query("slave == '2' and list == 'LAS'")
    assert events["present"].to_list() == [True, False, True]
    assert events["time_s"].iloc[2] > 0.1
    assert run.slaves[1].fields["outputs"] == 0xF and run.slaves[1].fields["active"]


def test_a_new_slave_replaces_the_only_missing_one():
    slaves = [*THREE[:2], slave("S-7.F.F", 0)]
    master = Master(PROJECTED, automatic_addressing=True)
    run = simulate(slaves, master, until=0.3)
    assert run.masters[-1].lists.las == ["1", "2", "3"]
    assert run.slaves[2].address == 3
    assert run.slaves[2].status(0.3) == 0


def test_an_ab_slave_gets_its_half_first():
    slaves = [slave("S-7.A.E", 1, "A"), slave("S-7.A.E", 0, id1=2)]
    master = Master({"1A": "S-7.A.E", "1B": "S-7.A.E"}, automatic_addressing=True)
    run = simulate(slaves, master, until=0.3)
    assert run.masters[-1].lists.las == ["1A", "1B"]
    assert (run.slaves[1].label, run.slaves[1].id1) == ("1B", 0b1010)


@pytest.mark.parametrize(
    ("present", "new", "automatic"),
    [(THREE[:1], "S-7.F.F", True), (THREE[:2], "S-0.F.F", True), (THREE[:2], "S-7.F.F", False)],
    ids=["two are missing", "another profile", "not wanted"],
)
def test_otherwise_a_new_slave_keeps_address_0(present, new, automatic):
    master = Master(PROJECTED, automatic_addressing=automatic)
    run = simulate([*present, slave(new, 0)], master, until=0.3)
    assert run.slaves[-1].address == 0
    assert "0" in run.masters[-1].lists.lds


def test_periphery_faults_are_found_and_cleared():
    run = simulate(THREE, until=0.1, faults=[PeripheryFault("3", start=0.03, stop=0.06)])
    seen = run.lists.query("list == 'LPF'")
    assert seen["present"].to_list() == [True, False]
    assert seen["slave"].to_list() == ["3", "3"]
    times = seen["time_s"].to_numpy() - [0.03, 0.06]
    # Three slaves are polled in turn, one per cycle of 0.77 ms.
    assert (times > 0).all() and (times < 4 * 0.8e-3).all()


# Commands of the host.


def test_delete_then_assign_changes_the_address_of_a_slave_in_operation():
    run = simulate(THREE, cycles=100, commands=[(0.02, ChangeAddress("2", "9"))])
    assert run.commands["done"].to_list() == [True]
    assert run.masters[-1].lists.las == ["1", "3", "9"]
    assert (run.slaves[1].address, run.slaves[1].fields["active"]) == (9, True)
    sent = run.events().query("phase == 'management' and call != 'READ_STATUS' and time_s > .02")
    assert sent["call"].to_list()[:2] == ["DELETE_ADDRESS", "READ_IO_CONFIGURATION"]
    assert "ASSIGN_ADDRESS" in sent["call"].to_list()
    # No data were lost, and no slave was dropped.
    assert run.summary.dropped == 0
    assert run.failure_classes().to_numpy().sum() == 0
    reset = simulate(
        THREE, cycles=100, commands=[(0.02, ChangeAddress("2", "9")), (0.06, ResetSlave("9"))]
    )
    assert reset.slaves[1].address == 9


@pytest.mark.parametrize("call", [Call.DELETE_ADDRESS, Call.ASSIGN_ADDRESS])
def test_the_address_changes_even_if_the_reply_is_lost(call):
    run = simulate(
        THREE,
        cycles=200,
        commands=[(0.02, ChangeAddress("2", "9"))],
        faults=[LostReply("2", call, count=2)],
    )
    assert run.commands["done"].to_list() == [True]
    assert run.masters[-1].lists.las == ["1", "3", "9"]
    lost = run.events()[run.events()["executed_but_lost"]]
    assert lost["call"].to_list() == [call.name]
    assert run.summary.lost_replies == 1


@pytest.mark.parametrize(
    ("command", "says"),
    [
        (ChangeAddress("2", "3"), "address 3 is taken"),
        (ChangeAddress("7", "9"), "slave 7 is not in the LDS"),
        (ChangeAddress("2", "9A"), "label 9A does not fit the profile of slave 2, S-7.F.F"),
        (ReadCodes("7"), "slave 7 does not return its codes"),
        (WriteParameter("7", 1), "slave 7 is not in the LDS"),
        (ResetSlave("7"), "slave 7 is not in the LDS"),
    ],
    ids=str,
)
def test_a_failed_command_reports_why(command, says):
    run = simulate(THREE, cycles=50, commands=[(0.02, command)])
    assert run.commands[["done", "outcome"]].to_numpy().tolist() == [[False, says]]
    assert run.masters[-1].lists.las == ["1", "2", "3"]


@pytest.mark.parametrize(
    ("command", "says"),
    [
        (ReadCodes("2"), "slave 2 is S-7.F.F, ID1 F"),
        (WriteParameter("2", 5), "slave 2 echoes 5"),
        (ResetSlave("2"), "slave 2 was reset and is active"),
    ],
    ids=str,
)
def test_a_command_reports_its_outcome(command, says):
    run = simulate(THREE, cycles=300, commands=[(0.02, command)])
    assert run.commands[["done", "outcome"]].to_numpy().tolist() == [[True, says]]
    assert run.masters[-1].lists.las == ["1", "2", "3"]


@pytest.mark.parametrize("bits", [1, 13, 27, 100])
@pytest.mark.parametrize("cycle", [0, 10])
def test_a_command_is_carried_out_in_the_cycle_in_which_it_is_given(cycle, bits):
    # Three exchanges of 26 bit times precede the management phase.
    start = simulate(THREE, cycles=12).events().groupby("cycle")["time_s"].first()[cycle]
    run = simulate(THREE, cycles=20, commands=[(start + bits * BIT_TIME, ReadCodes("2"))])
    asked = run.events().query("phase == 'management' and call != 'READ_STATUS'")
    assert asked["cycle"].iloc[0] == (cycle if bits < 78 else cycle + 1)


def test_a_slave_that_is_dropped_while_it_is_activated_again_stays_dropped():
    # It misses its polls in the three cycles in which it is reset and receives parameters and data.
    drawn = undisturbed(20, 3)
    drawn["lost"][10:13, 0, 1, :] = True
    reset = simulate(THREE, cycles=12).events().groupby("cycle")["time_s"].first()[10]
    run = simulate_drawn(drawn, THREE, cycles=20, commands=[(reset, ResetSlave("2"))])
    assert run.commands["outcome"].to_list() == ["slave 2 was reset and is not active"]
    assert run.summary.dropped == 1


# Faults.


def test_equal_answers_of_two_slaves_are_one_and_different_ones_an_error():
    twins = [*THREE, slave("S-7.F.F", 2, inputs=2, id1=0xF)]
    fine = simulate(twins, cycles=20)
    assert fine.summary.repetitions == 0
    twins[3] = slave("S-7.F.F", 2, inputs=3, id1=0xF)
    bad = simulate(twins, cycles=20)
    assert bad.masters[-1].lists.las == ["1", "3"]
    table = bad.events().query("slave == '2' and call == 'DATA_EXCHANGE'")
    assert len(table) >= 2
    assert set(table["outcome"]) <= {"AlternationError", "PauseError", "InformationError"}


def test_id_code_1_does_not_distinguish_slaves_at_one_address():
    for id1 in range(15):
        twins = [*THREE, slave("S-7.F.F", 2, inputs=2, id1=id1)]
        run = simulate(twins, cycles=30, commands=[(0.02, ReadCodes("2"))])
        outcome = run.events().query("call == 'READ_ID1' and slave == '2'")["outcome"]
        assert "ok" not in set(outcome)
        assert "no ID1" in run.commands["outcome"].iloc[0]


def test_unsynchronised_slaves_at_one_address_are_an_error_even_with_equal_data():
    twins = [*THREE, slave("S-7.F.F", 2, inputs=2)]
    drawn = undisturbed(4, 4)
    drawn["missed"][2, 0, 3, 0] = True
    table = simulate_drawn(drawn, twins, cycles=4).events()
    bad = table.query("phase == 'data_exchange' and outcome != 'ok'")
    assert bad[["cycle", "slave"]].to_numpy().tolist() == [[2, "2"]]


def test_an_answer_after_the_time_out_garbles_the_next_request():
    run = simulate(THREE, cycles=10, faults=[LateAnswer("2", 8, start=12e-3)])
    table = run.events().query("phase == 'data_exchange'")
    first = table.query("slave == '2' and outcome != 'ok'").iloc[:2]
    # The repetition collides with the late answer to the first request and is not received.
    assert first["outcome"].to_list() == ["SilenceError", "SilenceError"]
    assert first["executed"].to_list() == [True, False]
    # Then the line is free again: slave 3 answers late, as it missed the previous request.
    third = table.loc[first.index[-1] + 1]
    assert third["slave"] == "3"
    assert (third["outcome"], third["master_pause_bit"]) == ("ok", 5)


def test_a_broken_cable_disconnects_all_slaves_downstream():
    plan = placed(STANDARD, positions={one.label: 3.0 * one.address for one in STANDARD})
    run = simulate(plan, until=0.3, faults=BrokenCable(60, start=0.1))
    assert run.masters[-1].lists.las == [str(address) for address in range(1, 21)]
    gone = run.lists.query("list == 'LAS' and not present")
    assert set(gone["slave"]) == {str(address) for address in range(21, 32)}
    assert (gone["time_s"] > 0.1).all()
    # Two tries in each of three cycles, each longer for 11 slaves that do not answer.
    assert (gone["time_s"] < 0.1 + 4 * (33 * 26 + 11 * 24) * BIT_TIME).all()


@pytest.mark.parametrize(
    "faults",
    [
        [DeadSlave("2", start=0.02, stop=0.05), BrokenCable(5, start=0.03, stop=0.2)],
        [BrokenCable(5, start=0.02, stop=0.2), DeadSlave("2", start=0.03, stop=0.05)],
    ],
)
def test_a_slave_returns_when_its_last_fault_ends(faults):
    for duration, las in ((0.15, ["1", "3"]), (0.4, ["1", "2", "3"])):
        run = simulate(placed(THREE, positions={"2": 10.0}), until=duration, faults=faults)
        assert run.masters[-1].lists.las == las


def test_a_supply_dip_resets_everything_and_the_master_begins_anew():
    run = simulate(
        THREE, Master(outputs={"1": 0}), until=0.1, faults=[SupplyDip(start=0.04, stop=0.06)]
    )
    table = run.events()
    assert table.query("time_s > 0.0402 and time_s < 0.06").empty
    after = table.query("time_s >= 0.06")["phase"].astype(str)
    assert after.iloc[0] == "detection" and after.iloc[-1] != "detection"
    assert run.masters[-1].lists.las == ["1", "2", "3"]
    # The cycle cut short by the dip does not count.
    assert run.cycle_times.max() < 1e-3
    assert run.summary.dropped == 0


def test_a_standby_master_takes_over_before_a_watchdog_trips():
    slaves = [slave("S-7.F.F", address, watchdog=50e-3) for address in (1, 2, 3)]
    first = Master(PROJECTED, outputs={"1": 1, "2": 2, "3": 3})
    standby = Standby(Master(PROJECTED))
    run = simulate(slaves, first, until=0.3, faults=[MasterFailure(start=0.1)], standby=standby)
    table = run.events()
    taken = table["standby"]
    assert taken.iloc[-1] and not taken.iloc[0]
    gap = table["time_s"][taken].iloc[0] - table["time_s"][~taken].iloc[-1]
    assert 1e-3 < gap < 1e-3 + 26 * BIT_TIME + 1e-9
    # It continues with data exchange, and with the outputs that it received.
    assert table["phase"][taken].iloc[0] == "data_exchange"
    assert [slave.fields["outputs"] for slave in run.slaves] == [1, 2, 3]
    assert [slave.trips for slave in run.slaves] == [[], [], []]
    alone = simulate(slaves, first, until=0.3, faults=[MasterFailure(start=0.1)])
    assert [slave.fields["outputs"] for slave in alone.slaves] == [0xF] * 3
    assert all(0.1 < slave.trips[0] < 0.152 for slave in alone.slaves)
    slow = Standby(Master(PROJECTED), silence=60e-3)
    late = simulate(slaves, first, until=0.3, faults=[MasterFailure(start=0.1)], standby=slow)
    assert all(len(slave.trips) == 1 for slave in late.slaves)


def test_a_standby_master_hears_both_halves():
    slaves = FULL[:4]
    projected = {one.label: one.profile for one in slaves}
    run = simulate(
        slaves,
        Master(projected),
        until=0.1,
        faults=[MasterFailure(start=0.05)],
        standby=Standby(Master(projected)),
    )
    assert run.masters[-1].lists.las == ["1A", "1B", "2A", "2B"]
    assert run.summary.dropped == 0
    # It had them all from the beginning and did not have to find them.
    assert len({time for time, *_ in run.masters[-1].lists.changes}) == 1


def test_the_first_cycle_of_a_standby_master_does_not_contain_the_silence():
    # The first master fails in its cycle 0, too.
    failure = MasterFailure(start=simulate(THREE, cycles=0).end * BIT_TIME + 40 * BIT_TIME)
    standby = Standby(Master(PROJECTED), silence=20e-3)
    run = simulate(THREE, until=0.1, faults=failure, standby=standby)
    assert run.events()["standby"].any()
    assert run.cycle_times.max() < 1e-3


# Statistics.


def test_the_number_of_repetitions_agrees_with_the_probability():
    p, q = 0.05, 0.03
    drawn = draw(np.random.default_rng(7), 20_000, [0, p, 0], [0, q, 0])
    run = simulate_drawn(drawn, THREE, Master(drop_after=1000), cycles=20_000)
    table = run.events().query("slave == '2' and phase == 'data_exchange'")
    first, again = table.query("attempt == 0"), table.query("attempt == 1")
    failing = 1 - (1 - p) * (1 - q)
    # Five standard deviations of a binomial of 20000.
    assert len(again) / len(first) == pytest.approx(
        failing, abs=5 * np.sqrt(failing * (1 - failing) / len(first))
    )
    garbled = (first["executed_but_lost"]).mean()
    assert garbled == pytest.approx((1 - p) * q, abs=5 * np.sqrt(q / len(first)))
    late = (first.query("outcome == 'ok'")["master_pause_bit"] == 5).mean()
    assert late == pytest.approx(p, abs=5 * np.sqrt(p / len(first)))


def test_failures_in_a_row_follow_the_geometric_law():
    # If responses are disturbed at the rate p, class n has the fraction (1 - p) p^(n - 1).
    p = 0.2
    run = simulate(
        THREE,
        Master(drop_after=1000),
        cycles=20_000,
        faults=TelegramErrors("2", response=p),
        rng=11,
    )
    counted = run.failure_classes().loc["2"].to_numpy()
    expected = (1 - p) * p ** np.arange(6)
    # Five standard deviations.
    tolerance = 5 * np.sqrt(expected / counted.sum())
    assert (np.abs(counted[:6] / counted.sum() - expected) < tolerance).all()


def test_a_change_of_an_input_is_known_after_the_next_exchange():
    changes = [(0.02 + 1.234e-3 * k, "2", k % 16) for k in range(40)]
    run = simulate(THREE, until=0.1, inputs=changes)
    seen = run.input_changes()["response_time_s"].to_numpy()
    bounds = run.response_times().loc["2"]
    assert not np.isnan(seen).any()
    assert (seen >= bounds["least_s"] - 1e-12).all() and (seen <= bounds["longest_s"] + 1e-12).all()
    # Normally: a cycle of 4 x 26 + 24 bit times, and pause and response after the request.
    cycle, fresh = 128 * BIT_TIME, 10 * BIT_TIME
    assert bounds.to_numpy() == pytest.approx([fresh, cycle / 2 + fresh, cycle + fresh, cycle])
    got = run.events().query("slave == '2' and phase == 'data_exchange'")
    for (time, _, value), delay in zip(changes, seen, strict=True):
        told = got[got["time_s"] + (14 + 3 + 7) * BIT_TIME >= time + delay - 1e-9].iloc[0]
        assert told["response_data"] == value


def test_the_table_spells_the_requests():
    table = simulate([*THREE, FULL[20]], cycles=3).events()
    for row in table.to_dict("records"):
        call, half = Call[row["call"]], row["half"] or None
        request = Request(call, row["address"], row["request_data"], half)
        assert row["request"] == request.bits
        if row["response_data"] >= 0:
            assert "requires" not in str(Response(row["response_data"], call))


def test_failures_of_two_slaves_are_not_taken_for_one_series():
    record = np.zeros(5, TRANSACTION)
    record["start"], record["address"] = 26.0 * np.arange(5), [1, 1, 1, 2, 2]
    record["outcome"] = [0, 5, 5, 5, 0]
    masters = [RunningMaster(Master())]
    classes = Run(record, 130.0, Transaction(), masters, [], []).failure_classes()
    assert classes.loc["1"].to_list() == [0, 1, 0, 0, 0, 0]
    assert classes.loc["2"].to_list() == [1, 0, 0, 0, 0, 0]


# Arguments.


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({}, "cycles and until are both None"),
        ({"cycles": -1}, "cycles is -1"),
        ({"until": float("nan")}, "until is nan s"),
        (
            {"cycles": 1, "faults": [DeadSlave("9")]},
            "slave 9 is not on the line; its slaves are 1, 2, 3",
        ),
        ({"cycles": 1, "faults": [TelegramErrors("1", 0.1)] * 2}, "TelegramErrors twice"),
        ({"cycles": 1, "faults": [LateAnswer("1", 20)]}, "would respond 25 bit times"),
        ({"cycles": 1, "inputs": [(0.0, "1", 16)]}, "input of slave 1 is 16"),
        ({"cycles": 1, "inputs": [(-1.0, "1", 1)]}, "time is -1 s"),
        ({"cycles": 1, "faults": [Fault()]}, "one of faults is Fault"),
    ],
)
def test_bad_arguments_are_refused(options, message):
    with pytest.raises(ArgumentError, match=message):
        simulate(THREE, **options)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: TelegramErrors("1", request=-0.1), "request is -0.1"),
        (lambda: TelegramErrors("1", response=float("nan")), "response is nan"),
        (lambda: DeadSlave("32"), "slave is '32'"),
        (lambda: DeadSlave("1", start=2.0, stop=1.0), "stop is 1 s; it must be after start, 2 s"),
        (lambda: LostReply("1", count=0), "count is 0"),
        (lambda: MasterFailure(start=-1.0), "start is -1 s"),
        (lambda: MasterFailure(stop=1.0), "stop is 1 s"),
        (lambda: SupplyDip(start=1.0), "stop is inf s"),
        (lambda: Standby(Master()), "no projected slaves"),
        (lambda: Standby(Master(PROJECTED), 1e-4), "silence is 0.0001 s"),
        (lambda: Master("PLC"), r"projected is 'PLC'; .* \{'1': .*node='PLC'"),
        (lambda: Master({"1A": "S-7.F"}), "slave 1A is projected as S-7.F"),
        (lambda: Master({"0": "S-7.F"}), "slave 0 is projected"),
        (lambda: Master(repetitions=8), "repetitions is 8"),
        (lambda: Master(drop_after=0), "drop_after is 0"),
        (lambda: Master(automatic_addressing=True), "automatic_addressing is True"),
        (lambda: Master(outputs={"1": 16}), "output of slave 1 is 16"),
        (lambda: ChangeAddress("1", "0"), "new is '0'"),
        (lambda: ChangeAddress("1", "1"), "new is '1'"),
        (lambda: WriteParameter("1A", 8), "parameter of slave 1A is 8"),
        (lambda: Transaction(timeout=1), "timeout is 1 bit times"),
        (
            lambda: Transaction(slave_pause=84).check_line(),
            r"slave_pause is 84 bit times; it must be 1\.\.83",
        ),
        (lambda: Transaction(bit_time=0), "bit_time is 0 s"),
    ],
)
def test_bad_descriptions_are_refused(make, message):
    with pytest.raises(ArgumentError, match=message):
        make()
