"""How much faster the transmission experiment is than a loop over single packets."""

import numpy as np
from _timing import seconds

from shipnet.errors import FrameError
from shipnet.remote_control import CobsFormat, MarkerFormat, System, simulate

ITEMS = 10
NUMBER, SAMPLE = 100_000, 3_000


def one_by_one(form, rate, number, rng):
    """Send packets as a simple script would: one at a time, with a random number for each bit."""
    counts = [0, 0, 0]
    for _ in range(number):
        items = dict(enumerate(rng.integers(0, 1 << 16, ITEMS).tolist()))
        packet = form.encode(items)
        flips = np.packbits(rng.random(8 * len(packet)) < rate).tobytes()
        arrived = bytes(a ^ b for a, b in zip(packet, flips, strict=True))
        try:
            counts[2 * (dict(form.decode(arrived)) != items)] += 1
        except FrameError:
            counts[1] += 1
    return counts


def main():
    print(f"{'packets of 10 items':<34}{'per minute':>12}{'faster by':>20}")
    for name, form in (
        ("markers", MarkerFormat()),
        ("markers + CRC", MarkerFormat(crc=True)),
        ("CRC, byte-stuffed", CobsFormat()),
    ):
        for rate in (1e-5, 1e-3, 1e-2):
            rng = np.random.default_rng(2024)
            loop = one_by_one(form, rate, SAMPLE, rng)
            trial = form.transmit(ITEMS, rate, NUMBER, rng)
            # The fractions must agree within 5 standard deviations of the smaller sample.
            for few, many in zip(loop, trial, strict=True):
                share = many / NUMBER
                assert abs(few - SAMPLE * share) <= 5 * (SAMPLE * share * (1 - share)) ** 0.5 + 1
            plain = seconds(lambda f=form, r=rate, g=rng: one_by_one(f, r, SAMPLE, g), 1) / SAMPLE
            fast = seconds(lambda f=form, r=rate, g=rng: f.transmit(ITEMS, r, NUMBER, g)) / NUMBER
            print(f"{name + f', rate {rate:g}':<34}{60 / fast:>12.3g}{plain / fast:>19.0f}x")
    system = System(repeat=ITEMS)
    time = seconds(lambda: simulate(system, until=60))
    print(f"{'link, simulated / real time':<34}{60 / time:>12.3g}")


if __name__ == "__main__":
    main()
