"""Frames for tests: any, with long runs, the longest, and the bits by the specification."""

import csv
from pathlib import Path

from hypothesis import strategies as st

from shipnet.can.frame import Frame

REFERENCE = Path(__file__).parents[1] / "reference" / "can"


def rows(name):
    """Return the rows of a reference table."""
    with (REFERENCE / name).open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


#: A frame of greatest length for each format and number of data bytes.
LONGEST = [
    Frame(int(row["id_hex"], 16), bytes.fromhex(row["data_hex"]), row["format"] == "ext")
    for row in rows("worst_attainable_frames.csv")
]


def numbers(bits):
    """Return numbers of this many bits, often with few changes between 0 and 1."""

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


def _number(value, width):
    return [int(bool(value & 1 << place)) for place in reversed(range(width))]


def _check_sequence(bits):
    register = [0] * 15
    for bit in bits:
        next_bit = bit ^ register[0]
        register = [*register[1:], 0]
        if next_bit:
            register = [a ^ b for a, b in zip(register, _number(0x4599, 15), strict=True)]
    return register


def line_bits(arbitration_id, data, extended, remote, dlc):
    """Return the bits of a frame by the wording of the specification, without regard to speed.

    Nothing of the package is used. The CRC is the shift register of section 3.1.1; a stuff bit is
    sent whenever the last five bits on the line were equal.
    """
    if extended:
        head = [0, *_number(arbitration_id >> 18, 11), 1, 1, *_number(arbitration_id & 0x3FFFF, 18)]
        head += [int(remote), 0, 0]
    else:
        head = [0, *_number(arbitration_id, 11), int(remote), 0, 0]
    message = head + _number(dlc, 4)
    for byte in data:
        message += _number(byte, 8)
    message += _check_sequence(message)
    line = []
    # A stuff bit is due as soon as five bits in a row are equal, counted from the start of frame.
    for bit in message:
        line.append(bit)
        if len(line) >= 5 and len(set(line[-5:])) == 1:
            line.append(1 - bit)
    return "".join(map(str, [*line, 1, 0, 1, *[1] * 7]))
