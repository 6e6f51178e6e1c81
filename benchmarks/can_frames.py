"""How much faster the lengths of CAN frames are computed in batches than in loops over frames."""

from functools import partial
from time import process_time

import numpy as np
from _timing import seconds as shortest

from shipnet.can.frame import Frame
from shipnet.can.lengths import measure_frames

seconds = partial(shortest, timer=process_time)

NUMBER = 1_000_000
SAMPLE = 5_000  # frames in the loops, whose times are scaled up


def plain_length(number, data):
    """Count the bits of an 8-byte frame as a simple script would: one by one, from an integer."""
    message, size = (number << 7 | 8) << 64 | int.from_bytes(data, "big"), 83
    register = 0
    for place in range(size - 1, -1, -1):
        out = register >> 14 ^ message >> place & 1
        register = register << 1 & 0x7FFF
        if out:
            register ^= 0x4599
    message, size = message << 15 | register, size + 15
    length, last, run = size + 13, -1, 0
    for place in range(size - 1, -1, -1):
        bit = message >> place & 1
        run = run + 1 if bit == last else 1
        last = bit
        if run == 5:
            length += 1
            last, run = 1 - bit, 1
    return length


def main():
    rng = np.random.default_rng(2024)
    number, data = rng.integers(0, 2048, NUMBER), rng.integers(0, 256, (NUMBER, 8), dtype=np.uint8)
    some = list(zip(number[:SAMPLE].tolist(), map(bytes, data[:SAMPLE]), strict=True))
    lengths = measure_frames(number[:SAMPLE], data[:SAMPLE]).tolist()
    assert [plain_length(*pair) for pair in some] == lengths
    assert [Frame(*pair).length for pair in some] == lengths

    per_frame = {
        "lengths, batch": seconds(lambda: measure_frames(number, data)) / NUMBER,
        "lengths, loop over Frame": seconds(lambda: [Frame(*pair).length for pair in some])
        / SAMPLE,
        "lengths, plain bit counter": seconds(lambda: [plain_length(*pair) for pair in some])
        / SAMPLE,
    }
    print(f"{'CAN frames of 8 bytes':<32}{'per second':>12}{'batch is faster by':>20}")
    for name, time in per_frame.items():
        best = per_frame[f"{name.split(',')[0]}, batch"]
        print(f"{name:<32}{1 / time:>12.3g}{time / best:>19.1f}x")


if __name__ == "__main__":
    main()
