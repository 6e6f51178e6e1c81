"""Wrong values for the arguments of every name of the front."""

import inspect

import pytest

from shipnet import can
from shipnet.line import Cable
from tests.support import check_mistakes

MESSAGES = can.example()
LOG = can.simulate(MESSAGES, 125e3, until=0.1).log()
FRAME = can.Frame(0x123, b"\x01")

#: By function: legal arguments, and the mistakes that some of them take.
CALLS = [
    (can.bit_timings, {
        "clock": 16e6, "bit_rate": 125e3, "sample_point": 0.75, "tolerance": 0.0,
        "loop_delay": 1e-7, "delay_per_metre": 5e-9,
    }, {}),
    (can.longest_bus, {"bit_rate": 125e3}, {}),
    (can.Frame, {
        "arbitration_id": 1, "data": b"", "extended": False, "remote": False, "dlc": 0,
    }, {"dlc": "None"}),
    (can.arbitrate, {"frames": [FRAME]}, {}),
    (can.decode, {"bits": FRAME.bits}, {"bits": "text"}),
    (can.stuff, {"bits": "000001"}, {}),
    (can.frame_length, {"dlc": 8, "stuffing": "worst", "extended": False}, {"dlc": "empty"}),
    (can.read_log, {"path": "none"}, {"path": "text path"}),
    (can.Message, {
        "name": "A", "arbitration_id": 1, "dlc": 8, "period": 0.1, "deadline": 0.1, "jitter": 0.0,
        "offset": 0.0, "extended": False, "sender": "", "bits": 100,
    }, {"name": "text", "sender": "text", "deadline": "None", "bits": "None"}),
    (can.MessageSet, {"messages": [MESSAGES[0]], "overlooked": ()},
     {"messages": "empty", "overlooked": "empty text"}),
    (can.bus_load, {"messages": MESSAGES, "bit_rate": 125e3, "stuffing": "worst"},
     {"bit_rate": "empty"}),
    (can.example, {"name": "engine"}, {}),
    (can.read_messages, {"path": "none"}, {"path": "text path"}),
    (can.read_capture, {
        "path": "none.csv", "bit_rate": 125e3, "channel": "1", "sample_interval": 1e-6,
    }, {
        "path": "text path", "bit_rate": "None", "channel": "None text", "sample_interval": "None",
    }),
    (can.analyse, {
        "messages": MESSAGES, "bit_rates": [125e3], "period": 1.0, "assumptions": None,
        "faults": None,
    }, {"messages": "text path", "period": "None"}),
    (can.audsley, {"messages": MESSAGES, "bit_rate": 125e3, "assumptions": None, "faults": None},
     {}),
    (can.response_times, {
        "messages": MESSAGES, "bit_rate": 125e3, "method": "exact", "assumptions": None,
        "faults": None, "offsets": False,
    }, {}),
    (can.spread_offsets, {"messages": MESSAGES, "step": 1e-3}, {}),
    (can.Segment, {
        "length": 40, "nodes": 9, "terminator": 120, "stubs": {},
        "cable": Cable.lossless(120, 5e-9), "resistance": 2e4, "capacitance": 1e-10,
    }, {"terminator": "None"}),
    (can.simulate, {
        "messages": MESSAGES, "bit_rate": 125e3, "until": 0.1, "faults": (), "queue": "fifo",
        "recover": True, "rng": 1,
    }, {"faults": "empty", "rng": "None empty"}),
    (can.simulate_batch, {
        "messages": MESSAGES, "bit_rate": 125e3, "offsets": [[0] * 10], "until": 0.1,
    }, {}),
    (can.Assumptions, {
        "stuffing": "worst", "intermission": "between", "own_jitter": True,
        "arbitration_bits": 1, "foreign_bits": 0,
    }, {}),
    (can.faults.BitErrors, {"rate": 0.1, "start": 0, "stop": 1, "bits": 23}, {}),
    (can.faults.ErrorAt, {"time": 0.1, "bits": 23}, {}),
    (can.faults.ErrorBound, {"interval": 0.1, "burst": 1, "bits": 31}, {}),
    (LOG.load, {"bit_rate": 125e3, "window": 1.0}, {}),
    (can.compare, {"messages": MESSAGES, "log": LOG, "period": 0.1},
     {"messages": "text path", "log": "text path", "period": "None"}),
    (LOG.messages, {"period": 1.0}, {"period": "None"}),
    (LOG.save, {"path": "none.csv"}, {}),
]  # fmt: skip

#: Made by a function of the front, or with nothing to check.
RESULTS = {
    "Analysis", "Arbitration", "Assignment", "BIT_RATES", "BatchRun", "Capture", "Log",
    "LogComparison", "LogLoad", "ResponseTime", "ResponseTimes", "Run", "Signals", "faults",
}  # fmt: skip


@pytest.mark.parametrize(("function", "good", "legal"), CALLS)
def test_a_mistake_in_an_argument_is_an_error_that_names_it(function, good, legal):
    check_mistakes(function, good, legal)


def test_every_name_of_the_front_is_in_the_table():
    names = {function.__name__ for function, *_ in CALLS}
    assert set(can.__all__) - RESULTS <= names
    for function, good, _ in CALLS:
        if function not in (can.read_log, can.read_messages):
            assert set(good) == set(inspect.signature(function).parameters)
