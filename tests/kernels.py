"""Arguments for every kernel: edges and largest values included, small enough for plain Python."""

from __future__ import annotations

from array import array

import numpy as np
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from shipnet.asi.channel import _ERRORS, DISTURBANCE, NOBODY, TRANSACTION, UNUSUAL, VARIANTS
from shipnet.asi.receiver import _pulse_shape
from shipnet.asi.slave import STATE
from shipnet.errors import SilenceError

#: Whole numbers of millivolts: an error of rounding moves no decision.
_MILLIVOLTS = st.integers(-8000, 8000).map(lambda millivolts: millivolts / 1e3)


def voltages(*shape):
    return hnp.arrays(np.float64, shape, elements=_MILLIVOLTS)


@st.composite
def receivers(draw, rows=None):
    """Draw records and settings of a receiver; for one telegram, the record has a mean of 0."""
    samples, half_bit = draw(st.integers(1, 200)), draw(st.sampled_from([3.0, 12.0, 17.647]))
    taps = draw(st.sampled_from([np.ones(1), _pulse_shape(3e-6 / half_bit)]))
    settings = (
        half_bit, draw(st.sampled_from([7, 14])), draw(st.floats(0.01, 0.99)),
        draw(st.sampled_from([1e-9, 0.45, 3.0])), draw(st.integers(0, int(half_bit / 2))),
        int(1.25 * half_bit) + 1, 1 + 1e-9,
    )  # fmt: skip
    if rows is None:
        u = draw(voltages(samples))
        return u - u.mean(), taps, settings
    u = draw(voltages(draw(rows), samples))
    return u, u.mean(axis=1), taps, settings


_SIGNS = st.integers(-1, 1)
_PULSES = st.sampled_from([16, 30])


#: Largest simulated time of a bus [ns], with room for one period and the longest jitter.
LATEST = 10**15


@st.composite
def can_messages(draw):
    """Draw offsets, periods, lengths and horizon of one to five messages on a CAN bus [ns]."""
    number = draw(st.integers(1, 5))
    unit = draw(st.sampled_from([1, 1000, LATEST // 3000]))

    def times(low, high):
        return unit * np.array(draw(st.lists(st.integers(low, high), min_size=number,
                                             max_size=number)), dtype=np.int64)  # fmt: skip

    return times(0, 400), times(60, 900), times(47, 160), unit * draw(st.integers(1, 3000))


@st.composite
def can_queues(draw):
    """Draw releases, the first of each message, lengths and horizon."""
    offset, _, length, horizon = draw(can_messages())
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    several = [np.sort(first + rng.integers(0, horizon, rng.integers(0, 20))) for first in offset]
    release = np.concatenate([np.append(one, 3 * LATEST) for one in several])
    first = np.cumsum([0, *(one.size + 1 for one in several)])
    return release, first, length, horizon


@st.composite
def can_sets(draw):
    """Draw several sets of offsets, periods, lengths and horizon."""
    offset, period, length, horizon = draw(can_messages())
    return np.array([offset, offset[::-1], 0 * offset]), period, length, horizon


@st.composite
def can_disturbances(draw):
    """Draw a bus with errors, on which nodes become passive and bus off."""
    release, first, length, horizon = draw(can_queues())
    bit = max(1, int(length.min()) // 47)
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    owner = rng.integers(0, 3, len(length))
    instants = np.append(np.sort(rng.integers(0, horizon, 60)), 2**62)
    rate = np.array(draw(st.lists(st.sampled_from([1e-18, 1e-3, 0.1, 0.4, 0.5]), max_size=2)))
    span = np.array([(horizon // 5, 2**62) for _ in rate], dtype=np.int64).reshape(-1, 2)
    limits = draw(st.sampled_from([(128, 256), (3, 9)]))
    length = length // bit * bit
    return release, first, length, horizon, owner, bit, *limits, instants, rate, span, rng


@st.composite
def can_columns(draw, one):
    """Draw frames, periods and jitters of CAN messages; a bit time has up to 2 ** 41 ticks.

    A message has up to four frames.
    """
    n = draw(st.integers(1 if one else 0, 5))
    tick = draw(st.sampled_from([1, 8000, 2**41]))
    frame, period, jitter = (
        array("q", [tick * draw(st.integers(low, high)) for _ in range(n)])
        for low, high in ((47, 160), (47, 2000), (0, 3000))
    )
    all_frames = array("q", [draw(st.integers(1, 4)) * length for length in frame])
    columns = frame, all_frames, period, jitter
    burst = draw(st.integers(0, 3))
    interval = tick * draw(st.integers(100, 10**5)) if burst else 2**62
    message = (0, draw(st.integers(0, n - 1))) if one else ()
    return *message, *columns, tick, burst, interval, tick * 31, draw(st.integers(0, 300))


@st.composite
def waits(draw):
    """Draw the arguments of `wait` from those of `instances`, with a load below 1."""
    _, m, C, S, T, J, tau, burst, interval, error, _ = draw(can_columns(one=True))
    T = array("q", [8 * period + 5000 * tau for period in T])
    w, q, B = (tau * draw(st.integers(0, most)) for most in (0, 3, 160))
    interval = max(interval, 10**4 * tau)
    return w, m, q // tau, B, C, S, T, J, tau, burst, interval, error + max(C)


def _columns(rows, n):
    """Return n arrays of int64 from rows of n numbers."""
    return tuple(np.array(rows, np.int64).reshape(-1, n).T.copy())


# Heads of 19 or 39 bits, payloads of 64 bits of which 0..64 are sent, and both the CRC of CAN and
# another run length.
_FRAMES = st.lists(
    st.tuples(
        st.integers(0, 2**39 - 1), st.sampled_from([19, 39]),
        st.integers(-(2**63), 2**63 - 1), st.sampled_from([*range(0, 65, 8)]),
    ),
    max_size=4,
).map(lambda rows: _columns(rows, 4))  # fmt: skip
_CODES = st.sampled_from([(0x4599, 15, 5), (0x1021, 16, 6)])


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


#: A strategy of argument tuples by the full name of the kernel.
ARGUMENTS: dict[str, st.SearchStrategy[tuple]] = {
    "shipnet.asi.channel.receive": asi_receive(),
    "shipnet.asi.channel.run_cycles": asi_cycles(),
    "shipnet.asi.modulation.violated": _PULSES.flatmap(
        lambda slots: st.tuples(hnp.arrays(np.int8, slots, elements=_SIGNS))
    ),
    "shipnet.asi.modulation.violated_by_rows": st.tuples(st.integers(0, 4), _PULSES).flatmap(
        lambda shape: st.tuples(hnp.arrays(np.int8, shape, elements=_SIGNS))
    ),
    "shipnet.asi.receiver.filter_rows": receivers(st.integers(0, 3)).map(lambda drawn: drawn[:3]),
    "shipnet.asi.receiver.line_filter": receivers().map(lambda drawn: drawn[:2]),
    "shipnet.asi.receiver.listen": receivers(),
    "shipnet.asi.receiver.listen_to_rows": receivers(st.integers(0, 3)),
    "shipnet.asi.slave.exchange": asi_exchange(),
    "shipnet.can.bus.releases": can_messages().map(lambda drawn: (*drawn[:2], drawn[3])),
    "shipnet.can.bus.send": can_queues(),
    "shipnet.can.bus.send_sets": can_sets(),
    "shipnet.can.bus.send_disturbed": can_disturbances(),
    "shipnet.can.response.all_instances": can_columns(one=False),
    "shipnet.can.response.instances": can_columns(one=True),
    "shipnet.can.response.wait": waits(),
    "shipnet.can.lengths.stuffed_lengths": st.builds(lambda a, b: (*a, *b), _FRAMES, _CODES),
}
