"""Message sets from any file, at several bit rates and compared with a log."""

import math
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.figure import Figure

from shipnet import can
from shipnet.can.analysis import CLOCK_TOLERANCE
from shipnet.errors import InputError
from tests.can.test_log import write_with
from tests.can.test_messages import DBC

RATES = [20e3, 50e3, 125e3, 250e3]


def test_each_bit_rate_has_a_load_late_messages_and_a_verdict():
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
    assert found.lowest == 125e3 == found.at_lowest.bit_rate and found.ok
    # Simulated responses never exceed the bound, and can be late where the analysis says so.
    played = can.simulate(messages, found.lowest, until=10.0).table()["max_ms"]
    assert (played <= found.at_lowest.table()["response_ms"] + 1e-9).all()
    blocked = can.MessageSet(replace(m, offset=1e-4 * (m.name != "bearings")) for m in messages)
    slow = can.simulate(blocked, 50e3, until=1.0).table()["max_ms"]
    assert slow["speed"] > 1e3 * messages["speed"].deadline
    ax = found.plot(Figure().subplots())
    assert [label.get_text() for label in ax.get_yticklabels()] == list(messages.names)
    assert ax.get_xlabel() == "time at 125 kbit/s [ms]"


def test_another_order_may_allow_a_lower_bit_rate():
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


def test_a_set_that_is_late_at_all_bit_rates_is_reported():
    found = can.analyse(can.example(), 10e3)
    assert found.lowest == found.lowest_in_best_order == math.inf
    assert not found.best.feasible and "lowest bit rate: none" in repr(found)
    assert not found.ok and found.at_lowest is found.responses[10e3]
    few = can.faults.ErrorBound(interval=0.001)
    assert can.analyse(can.example(), 125e3, faults=few).lowest == math.inf
    assert can.analyse(can.MessageSet([]), 125e3).lowest == 125e3


def test_messages_are_read_from_lists_dbc_files_and_logs(tmp_path):
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


def test_a_log_of_a_simulated_bus_shows_its_messages():
    messages = can.example()
    log = can.simulate(messages, 125e3, until=5.0).log()
    found = log.messages()
    assert [m.arbitration_id for m in found] == [m.arbitration_id for m in messages]
    assert [m.dlc for m in found] == [m.dlc for m in messages]
    assert found.periods == pytest.approx(messages.periods, rel=2e-3)
    longest = can.response_times(messages, 125e3)
    for one, bound in zip(found, longest, strict=True):
        assert one.jitter <= bound.response
    # All frames of the log fit the periods and jitters that were derived from it.
    for one in found:
        times = log.time[log.arbitration_id == one.arbitration_id]
        late = times - times[0] - one.period * np.arange(len(times))
        assert np.ptp(late) == pytest.approx(one.jitter, abs=2e-9 * len(times))
    once = can.simulate(messages, 125e3, until=0.6).log()
    assert once.messages().overlooked == (
        "0x300: a single frame has no period; give one with period=",
    )
    assert once.messages(period=1.0)["0x300"].period == 1.0


# Any file --------------------------------------------------------------------------------------

#: A supplier's list: a heading, columns that are not used, and a blank row.
LIST = [
    ["Engine control, message list, rev. 3"],
    [],
    ["No.", "Message", "CAN-ID (hex)", "DLC", "Cycle [ms]", "Max. latency [ms]", "Sender",
     "Receiver", "Signals", "Remarks"],
    [1, "Speed", "100", 8, 100, 50, "JB1", "MCU", "Rpm", ""],
    [],
    [2, "Valve", "18FF0100h", 3, 50, "", "JB2", "MCU", "Position", "new"],
]  # fmt: skip


@pytest.mark.parametrize("form", ["xlsx", "semicolons", "tabs"])
def test_a_list_in_the_form_of_a_supplier_is_read_in_one_call(tmp_path, form):
    table = pd.DataFrame([row + [""] * (10 - len(row)) for row in LIST])
    file = tmp_path / ("list.xlsx" if form == "xlsx" else "list.csv")
    if form == "xlsx":
        table.to_excel(file, header=False, index=False)
    else:
        table.to_csv(file, header=False, index=False, sep={"tabs": "\t"}.get(form, ";"))
    assert list(can.read_messages(file)) == [
        can.Message("Speed", 0x100, 8, 0.1, 0.05, sender="JB1"),
        can.Message("Valve", 0x18FF0100, 3, 0.05, extended=True, sender="JB2"),
    ]
    assert can.analyse(file, [125e3]).ok


def test_messages_of_a_dbc_file_equal_those_of_cantools(tmp_path):
    cantools = pytest.importorskip("cantools")
    (tmp_path / "ship.dbc").write_text(DBC)
    found = can.read_messages(tmp_path / "ship.dbc", period=0.05)
    theirs = {one.name: one for one in cantools.database.load_file(tmp_path / "ship.dbc").messages}
    assert set(found.names) == set(theirs)
    for message in found:
        one = theirs[message.name]
        assert (message.arbitration_id, message.extended) == (one.frame_id, one.is_extended_frame)
        assert (message.dlc, message.sender) == (one.length, one.senders[0])
        assert message.period == (one.cycle_time or 50) / 1e3


# A plan and a log ------------------------------------------------------------------------------


def log_of(times, key=0x10, dlc=8):
    """Return a log of one message."""
    n = len(times)
    no, data = np.zeros(n, bool), np.zeros((n, 8), np.uint8)
    codes = np.full(n, dlc, np.uint8)
    return can.Log(np.array(times, float), np.full(n, "0"), np.full(n, key), no, no, codes, data)


def test_a_log_of_the_planned_messages_is_as_planned_in_every_format(tmp_path):
    messages = can.example()
    log = can.simulate(messages, 125e3, until=10.0).log()
    messages.save(tmp_path / "list.csv")
    python_can = pytest.importorskip("can")
    write_with(python_can, tmp_path / "theirs.blf", log)
    for written in (log, tmp_path / "theirs.blf"):
        found = can.compare(tmp_path / "list.csv", written)
        assert found.ok and found.verdict == "10 messages, all as planned"
    table = found.table()
    with python_can.LogReader(tmp_path / "theirs.blf") as reader:
        theirs = pd.DataFrame(
            [(m.arbitration_id, m.timestamp) for m in reader], columns=["id", "t"]
        )
    gaps = 1e3 * theirs.groupby("id")["t"].diff().groupby(theirs["id"]).agg(["min", "mean"])
    ours = table.set_index("arbitration_id")[["shortest_ms", "mean_ms"]]
    assert ours.to_numpy() == pytest.approx(gaps.loc[ours.index].to_numpy(), abs=2e-3)
    assert table["frames"].tolist() == [
        int((theirs["id"] == number).sum()) for number in ours.index
    ]
    # A log is a plan too.
    assert can.compare(log, log).ok


def test_missing_unknown_late_faster_and_other_frames_are_named():
    log = can.simulate(can.example(), 125e3, until=10.0).log()
    changed = {"speed": 0.005, "fuel index": 0.03, "exhaust 1-4": 0.4}
    plan = can.MessageSet(
        [
            *(
                replace(m, period=changed.get(m.name, m.period), deadline=m.deadline / 2)
                for m in can.example()
                if m.name not in ("alarm", "load limit")
            ),
            can.Message("load limit", 0x040, 3, 0.02),
            can.Message("new", 0x700, 8, 0.1),
            can.Message("seldom", 0x701, 8, 60.0),
        ]
    )
    found = can.compare(plan, log)
    odd = found.table()["verdict"].loc[lambda verdict: verdict != "as planned"]
    assert odd.to_dict() == {
        "speed": "late",
        "fuel index": "faster",
        "load limit": "other length",
        "exhaust 1-4": "late",
        "new": "missing",
        "seldom": "not seen",
        "0x080": "unknown",
    }
    said = "11 messages, 1 missing, 2 late, 1 faster, 1 other length, 1 unknown, 1 not seen"
    assert (found.ok, found.verdict) == (False, said)


@given(
    times=st.lists(st.integers(0, 60), min_size=1, max_size=12),
    period=st.integers(1, 8), deadline=st.integers(1, 12), jitter=st.integers(0, 12),
)  # fmt: skip
def test_late_and_faster_agree_with_a_check_of_all_pairs_of_frames(times, period, deadline, jitter):
    # Another message marks the beginning and the end of the log.
    message = can.Message("A", 0x10, 8, period, deadline, jitter)
    times, slack = sorted(times), max(deadline, jitter)
    edges = np.array([0.0, 60.0])
    log, marks = log_of(times), log_of(edges, 0x20)
    both = can.Log(*(np.concatenate(pair) for pair in zip(log.columns, marks.columns, strict=True)))
    pairs = [(j - i, times[j] - times[i]) for j in range(len(times)) for i in range(j)]
    silences = np.diff([0, *times, 60])
    late = any(span > n * period * (1 + CLOCK_TOLERANCE) + slack + 1e-6 for n, span in pairs)
    late |= silences.max() > period * (1 + CLOCK_TOLERANCE) + slack + 1e-6
    faster = any(span < n * period * (1 - CLOCK_TOLERANCE) - slack - 1e-6 for n, span in pairs)
    found = can.compare(can.MessageSet([message]), both).table().loc["A"]
    assert ("late" in found["verdict"], "faster" in found["verdict"]) == (late, faster)
    assert found["longest_ms"] == 1e3 * silences.max()


def test_a_message_that_falls_silent_is_late_and_a_short_log_shows_nothing():
    plan = can.MessageSet([can.Message("A", 0x10, 8, 0.1), can.Message("B", 0x20, 8, 10.0)])
    died = can.compare(plan, can.Log(*(
        np.concatenate(pair) for pair in zip(
            log_of(np.arange(20) / 10).columns, log_of([0, 10.0], 0x20).columns, strict=True
        )
    )))  # fmt: skip
    assert died.table()["verdict"].to_dict() == {"A": "late", "B": "as planned"}
    assert died.table().loc["A", "longest_ms"] == pytest.approx(8100)
    short = can.compare(plan, log_of([0.0, 0.1]))
    assert (short.ok, short.verdict) == (None, "2 messages, 1 not seen")
    assert can.compare(plan, log_of([])).verdict == "2 messages, 2 missing"
    assert can.compare(can.MessageSet([]), log_of([])).verdict == "0 messages, all as planned"


def test_clocks_may_drift_for_an_hour_within_the_tolerance_of_can():
    plan = can.MessageSet([can.Message("A", 0x10, 8, 0.1, deadline=0.01)])
    for drift, verdict in ((0.0, "as planned"), (0.015, "as planned"), (-0.015, "as planned"),
                           (0.017, "late"), (-0.017, "faster")):  # fmt: skip
        times = np.arange(36_000) * 0.1 * (1 + drift) + 1.7e9
        assert can.compare(plan, log_of(times)).table()["verdict"].tolist() == [verdict]
