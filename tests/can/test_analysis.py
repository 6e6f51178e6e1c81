"""A message set at several bit rates: each number against the function that it comes from."""

import math

import numpy as np
import pytest

from shipnet import can
from shipnet.errors import InputError
from tests.can.test_messages import DBC

RATES = [20e3, 50e3, 125e3, 250e3]


def test_each_bit_rate_has_its_load_its_late_messages_and_its_verdict():
    messages = can.example()
    found = can.analyse(messages, reversed(RATES))
    table = found.table()
    assert (1e3 * table.index).tolist() == RATES == list(found.responses)
    for rate, row in zip(RATES, table.itertuples(), strict=True):
        responses = can.response_times(messages, rate)
        assert row.load_percent == pytest.approx(100 * can.bus_load(messages, rate))
        assert row.late == len(responses.late) and row.critical == responses.critical
        assert row.first_late == (responses.late[0] if responses.late else "")
        assert (row.critical_percent > 100) == (row.late > 0)
        assert row.some_order == can.audsley(messages, rate).feasible
    assert found.lowest == 125e3


def test_another_order_may_gain_a_bit_rate():
    turned = can.MessageSet(
        [
            can.Message("slow", 1, 8, 0.1),
            can.Message("other", 2, 8, 0.1),
            can.Message("fast", 3, 8, 10e-3, deadline=6e-3),
        ]
    )
    found = can.analyse(turned, [50e3, 62.5e3, 125e3])
    assert (found.lowest, found.lowest_in_best_order) == (125e3, 50e3)
    assert found.best.messages.names[0] == "fast" and found.best.feasible
    assert repr(found).endswith("lowest bit rate: 125 kbit/s, in the best order: 50 kbit/s)")
    assert found.table()["some_order"].all()


def test_a_set_that_no_bit_rate_can_carry_says_so():
    found = can.analyse(can.example(), 10e3)
    assert found.lowest == found.lowest_in_best_order == math.inf
    assert not found.best.feasible and "lowest bit rate: none" in repr(found)
    few = can.faults.ErrorBound(interval=0.001)
    assert can.analyse(can.example(), 125e3, faults=few).lowest == math.inf
    assert can.analyse(can.MessageSet([]), 125e3).lowest == 125e3


def test_lists_dbc_files_and_logs_give_their_messages(tmp_path):
    messages = can.example("lee2012")
    for name in ("list.csv", "list.txt"):
        (tmp_path / name).write_text(messages.text)
        assert can.analyse(tmp_path / name, 125e3).messages == messages
    (tmp_path / "ship.dbc").write_text(DBC)
    with pytest.raises(InputError, match="no cycle time; give one with period="):
        can.analyse(tmp_path / "ship.dbc", 125e3)
    assert len(can.analyse(str(tmp_path / "ship.dbc"), 125e3, period=0.1).messages) == 2
    log = can.simulate(messages, 125e3, until=3.0).log()
    log.save(tmp_path / "bus.log")
    for source in (log, tmp_path / "bus.log"):
        assert can.analyse(source, 125e3).messages.periods == pytest.approx(messages.periods)
    with pytest.raises(InputError, match=r"none\.csv: cannot be read"):
        can.analyse(tmp_path / "none.csv")


def test_a_log_shows_the_messages_that_made_it():
    messages = can.example()
    log = can.simulate(messages, 125e3, until=5.0).log()
    found = log.messages()
    assert [m.arbitration_id for m in found] == [m.arbitration_id for m in messages]
    assert [m.dlc for m in found] == [m.dlc for m in messages]
    assert found.periods == pytest.approx(messages.periods, rel=2e-3)
    longest = can.response_times(messages, 125e3)
    for one, bound in zip(found, longest, strict=True):
        assert one.jitter <= bound.response
    # Whatever the log shows fits the periods and jitters that were made of it.
    for one in found:
        times = log.time[log.arbitration_id == one.arbitration_id]
        late = times - times[0] - one.period * np.arange(len(times))
        assert np.ptp(late) == pytest.approx(one.jitter, abs=2e-9 * len(times))
    once = can.simulate(messages, 125e3, until=0.6).log()
    assert once.messages().overlooked == ("0x300: one frame has no period; give one with period=",)
    assert once.messages(period=1.0)["0x300"].period == 1.0
