"""How much faster AS-i requests are parsed in a batch than in loops over single requests."""

from functools import partial
from time import process_time

import numpy as np
from _timing import seconds as shortest

from shipnet.asi import Request, Requests

seconds = partial(shortest, timer=process_time)

NUMBER = 1_000_000
SAMPLE = 20_000  # telegrams in the loops, whose times are scaled up


def plain_parse(word):
    """Decode a data exchange as a simple script would: with shifts and only a parity check."""
    if bin(word >> 1).count("1") % 2:
        raise ValueError("parity")
    return word >> 7 & 31, word >> 2 & 15


def main():
    rng = np.random.default_rng(2024)
    address, data = rng.integers(1, 32, NUMBER), rng.integers(0, 16, NUMBER)
    known = [[int(Request.data_exchange(a, d).bits, 2) for d in range(16)] for a in range(1, 32)]
    words = np.array(known)[address - 1, data]
    some = words[:SAMPLE].tolist()
    texts = [f"{word:014b}" for word in some]
    batch = Requests.parse(words[:SAMPLE])
    assert [plain_parse(word) for word in some] == list(
        zip(batch.address.tolist(), batch.data.tolist(), strict=True)
    )

    per_telegram = {
        "parse, batch": seconds(lambda: Requests.parse(words)) / NUMBER,
        "parse, loop over Request": seconds(lambda: [Request.parse(text) for text in texts])
        / SAMPLE,
        "parse, plain shifts in a loop": seconds(lambda: [plain_parse(word) for word in some])
        / SAMPLE,
    }
    print(f"{'AS-i requests':<32}{'per second':>12}{'batch is faster by':>20}")
    for name, time in per_telegram.items():
        best = per_telegram[f"{name.split(',')[0]}, batch"]
        print(f"{name:<32}{1 / time:>12.3g}{time / best:>19.1f}x")


if __name__ == "__main__":
    main()
