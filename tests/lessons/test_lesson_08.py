"""The right answers of lesson 8, by a second route: graphs, and simulations of the master."""

import numpy as np
import pytest

from shipnet.modbus.faults import Break
from shipnet.modbus.pdu import Request
from shipnet.modbus.polling import Poll
from shipnet.modbus.redundancy import Loop
from shipnet.modbus.uart import SerialLine
from tests.lessons.students import NAMED, right, solved
from tests.modbus.sweeps import sweep

LINE = SerialLine(9600)
STATUS = Request.read_input_registers(0, 4)


def walked(n, cuts):
    """Return how many valves are met from neither port, walking from section to section."""
    met = set()
    for sections, beyond in ((range(n), 1), (range(n, 0, -1), 0)):
        for section in sections:
            if section in cuts:
                break
            met.add(section + beyond)
    return n - len(met)


@NAMED
def test_the_lost_valves_are_those_that_a_walk_does_not_meet(name):
    numbers, answer = right("ex-08-1", name)
    assert answer == walked(numbers["n"], {numbers["first"], numbers["second"]})


def test_the_function_agrees_with_a_walk_for_random_cuts():
    rng = np.random.default_rng(8)
    lost_valves = solved("ex-08-3").value
    for _ in range(50):
        n = int(rng.integers(1, 60))
        cuts = rng.integers(0, n + 1, rng.integers(0, 5)).tolist()
        assert lost_valves(n, cuts) == walked(n, set(cuts))


@NAMED
def test_the_gap_of_the_channels_is_simulated_and_ages_the_values(name):
    numbers, answer = right("ex-08-2", name)
    poll = Poll(STATUS, LINE, timeout=numbers["timeout"] / 1e3, retries=numbers["retries"])
    # Channel 1 breaks just after the third answer; its next poll begins a period after that one.
    ends, start = [], 0.0
    for k in range(4):
        start, broken, tries = k * numbers["period"], k == 3, 0
        while broken and tries <= numbers["retries"]:
            start += LINE.frame_time(8) + numbers["timeout"] / 1e3
            tries += 1
        ends.append(start + poll.time - LINE.t35)
    assert numbers["age"] + np.diff(ends).max() == pytest.approx(answer, abs=1e-6)


@pytest.mark.parametrize("n", [20, 45])
def test_the_time_out_is_the_longest_that_meets_2_s(n):
    timeout = solved("ex-08-4", n=n).value / 1e3

    def worst(seconds):
        poll = Poll(STATUS, LINE, timeout=seconds)
        loop = Loop(n, poll, move="downstream")
        return max(sweep(loop, [Break(k)]).max() for k in (0, n // 2))

    assert worst(timeout) == pytest.approx(2.0, abs=1e-6)
    assert worst(timeout + 1e-3) > 2.001
