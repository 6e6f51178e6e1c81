"""Arguments for every kernel: edges and largest values included, small enough for plain Python."""

from __future__ import annotations

from array import array

from hypothesis import strategies as st


@st.composite
def can_messages(draw, one):
    """Draw frames, periods and jitters of CAN messages; a bit time has up to 2 ** 41 ticks."""
    n = draw(st.integers(1 if one else 0, 5))
    tick = draw(st.sampled_from([1, 8000, 2**41]))
    columns = [
        array("q", [tick * draw(st.integers(low, high)) for _ in range(n)])
        for low, high in ((47, 160), (47, 2000), (0, 3000))
    ]
    burst = draw(st.integers(0, 3))
    interval = tick * draw(st.integers(100, 10**5)) if burst else 2**62
    message = (draw(st.integers(0, n - 1)),) if one else ()
    return *message, *columns, tick, burst, interval, tick * 31, draw(st.integers(0, 300))


@st.composite
def waits(draw):
    """Draw the arguments of `wait` from those of `instances`, with a load below 1."""
    m, C, T, J, tau, burst, interval, error, _ = draw(can_messages(one=True))
    T = array("q", [8 * period + 1000 * tau for period in T])
    w, q, B = (tau * draw(st.integers(0, most)) for most in (0, 3, 160))
    return w, m, q // tau, B, C, T, J, tau, burst, max(interval, 10**4 * tau), error + max(C)


#: A strategy of argument tuples by the full name of the kernel.
ARGUMENTS: dict[str, st.SearchStrategy[tuple]] = {
    "shipnet.can.response.all_instances": can_messages(one=False),
    "shipnet.can.response.instances": can_messages(one=True),
    "shipnet.can.response.wait": waits(),
}
