"""Arguments for every kernel: edges and largest values included, small enough for plain Python."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st


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

#: A strategy of argument tuples by the full name of the kernel.
ARGUMENTS: dict[str, st.SearchStrategy[tuple]] = {
    "shipnet.can.lengths.stuffed_lengths": st.builds(lambda a, b: (*a, *b), _FRAMES, _CODES),
}
