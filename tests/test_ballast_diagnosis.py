import numpy as np
import pytest

from shipnet.ballast import Command, Fault, blocks, diagnose_run, simulate
from shipnet.ballast.diagnosis import READINGS, with_slow_stroke
from shipnet.fuzzy import published

BASE = published.rule_base("kim2014")
ORDERS = [
    Command("open", 1.0),
    Command("close", 4.0, valves=[0, 2]),
    Command("position", 16.0, position=40),
    Command("open", 31.0),
]
FAULTY = [
    Fault("V1", start=2.0, valves=1),
    Fault("P2", 0.6, valves=2),
    Fault("Pos1", start=20.0, valves=3),
    Fault("G1", start=14.0, valves=4),
]


def settings(**more):
    return dict(commands=ORDERS, duration=45, n_valves=5, faults=FAULTY, idle_step=0.5) | more


def pieces(size):
    yield from blocks(**settings(rng=np.random.default_rng(7)), size=size)


@pytest.mark.parametrize("reading", READINGS)
@pytest.mark.parametrize("size", [1, 4, 11, 97])
def test_blocks_are_diagnosed_as_the_whole_run_is(reading, size):
    rules = with_slow_stroke()
    whole = diagnose_run(simulate(**settings(rng=np.random.default_rng(7))), rules, reading=reading)
    after, active, alarms, samples = None, [], [], []
    for piece in pieces(size):
        after = diagnose_run(piece, rules, reading=reading, after=after)
        active.append(after.active)
        samples.append(np.stack(list(after.samples.values())))
        alarms += after.alarms.values.tolist()
    expected = np.stack(list(whole.samples.values()))
    np.testing.assert_array_equal(np.concatenate(samples, axis=1), expected)
    np.testing.assert_array_equal(np.concatenate(active), whole.active)
    assert alarms == whole.alarms.values.tolist()
    assert len(alarms) > 3
