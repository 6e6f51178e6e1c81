"""Frames for hypothesis: any, and those with the long runs that stuffing is about."""

from hypothesis import strategies as st

from shipnet.can.frame import Frame


def numbers(bits):
    """Return numbers of so many bits, often with few changes between 0 and 1."""

    def of_runs(runs):
        text = ""
        for place, run in enumerate(runs):
            text += "01"[place % 2] * run
        return int((text * bits)[:bits], 2)

    runs = st.lists(st.integers(1, 9), min_size=1, max_size=20).map(of_runs)
    return st.integers(0, 2**bits - 1) | runs


@st.composite
def frames(draw):
    extended, remote = draw(st.booleans()), draw(st.booleans())
    dlc = draw(st.integers(0, 15))
    size = 0 if remote else min(dlc, 8)
    data = draw(numbers(8 * size)).to_bytes(size, "big") if size else b""
    return Frame(draw(numbers(29 if extended else 11)), data, extended, remote, dlc)
