"""Arguments of every kernel, by its full name, for the comparison of its two forms."""

import numpy as np
from hypothesis import strategies as st

from shipnet.asi.channel import _ERRORS, DISTURBANCE, NOBODY, TRANSACTION, UNUSUAL, VARIANTS
from shipnet.asi.slave import STATE
from shipnet.errors import SilenceError


def asi_states(draw, rng):
    states = np.zeros(draw(st.integers(1, 4)), STATE)
    for name in ("synchronised", "active", "quiet"):
        states[name] = rng.random(states.size) < 0.7
    for name in ("inputs", "outputs", "in_mask", "echo_mask"):
        states[name] = rng.integers(0, 16, states.size)
    states["expires"] = rng.choice([1e-3, np.inf], states.size)
    states["watchdog"] = rng.choice([0.0, 0.05, np.inf], states.size)
    states["delay"] = rng.choice([2.0, 3.0, 4.25], states.size)
    states["asked"], states["since"] = rng.integers(0, 4, (2, states.size))
    return states


@st.composite
def asi_slave(draw):
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    states = asi_states(draw, rng)
    return rng, states, draw(st.integers(0, states.size - 1))


@st.composite
def asi_exchange(draw):
    _, states, slave = draw(asi_slave())
    return states, slave, draw(st.integers(0, 15)), draw(st.sampled_from([0.0, 1e-3, 1e9]))


@st.composite
def asi_receive(draw):
    _, states, slave = draw(asi_slave())
    number, lost, missed = draw(st.integers(1, 5)), draw(st.booleans()), draw(st.booleans())
    return states, slave, number, lost, missed, 2.0


@st.composite
def asi_cycles(draw):
    rng, states, _ = draw(asi_slave())
    cycles, polled, repetitions = (draw(st.integers(*ends)) for ends in ((1, 5), (1, 4), (0, 7)))
    keys = rng.integers(0, 64, (cycles, polled + draw(st.sampled_from([0, 2]))))
    requests = np.zeros((3, 64), TRANSACTION)
    requests["data"], requests["request"] = rng.integers(0, 16, (3, 64)), b"01010101010101"
    requests["pause"], requests["outcome"], requests["response"] = np.nan, SilenceError.code, -1
    slaves = rng.integers(0, states.size, (3, 64))
    slaves[rng.random((3, 64)) < 0.1] = draw(st.sampled_from([NOBODY, UNUSUAL]))
    faults = np.zeros((cycles, 3, states.size, repetitions + 1), DISTURBANCE)
    rate = draw(st.sampled_from([0.0, 0.3, 1.0]))
    faults["lost"], faults["missed"] = rng.random((2, *faults.shape)) < rate
    hit = rng.random(faults.shape) < rate
    faults["variant"] = np.where(hit, rng.integers(1, VARIANTS + 1, faults.shape), 0)
    record = np.zeros(keys.size * (repetitions + 1) + 1, TRANSACTION)
    late = draw(st.sampled_from([0.0, 100.0, np.inf]))
    return (
        keys, polled, 0, record, 1, 26.0, requests, slaves, states, faults, _ERRORS,
        rng.integers(0, 2, 64), repetitions, draw(st.integers(2, 1000)),
        (3.0, 2.0, 6e-6, 2.0, 10.0), late, draw(st.sampled_from([200.0, np.inf])),
    )  # fmt: skip


ARGUMENTS = {
    "shipnet.asi.channel.receive": asi_receive(),
    "shipnet.asi.channel.run_cycles": asi_cycles(),
    "shipnet.asi.slave.exchange": asi_exchange(),
}
