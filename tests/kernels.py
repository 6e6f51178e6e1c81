"""Arguments for every kernel: edges and largest values included, small enough for plain Python."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from shipnet.asi.receiver import _pulse_shape

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
        taps, half_bit, draw(st.sampled_from([7, 14])), draw(st.floats(0.01, 0.99)),
        draw(st.sampled_from([1e-9, 0.45, 3.0])), draw(st.integers(0, int(half_bit / 2))),
        int(1.25 * half_bit) + 1, 1 + 1e-9,
    )  # fmt: skip
    if rows is None:
        u = draw(voltages(samples))
        return u - u.mean(), *settings
    u = draw(voltages(draw(rows), samples))
    return u, u.mean(axis=1), *settings


_SIGNS = st.integers(-1, 1)
_PULSES = st.sampled_from([16, 30])

#: A strategy of argument tuples by the full name of the kernel.
ARGUMENTS: dict[str, st.SearchStrategy[tuple]] = {
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
}
