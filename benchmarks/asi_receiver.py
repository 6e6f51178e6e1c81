"""How many telegrams per second the receiver decodes on one core, compared with a plain loop."""

import os

# Run on one core, as the targets assume; numpy reads these variables when it is imported.
os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"

import math

import numpy as np
from _timing import seconds

from shipnet.asi.modulation import HALF_BIT, Modulation, Pulses
from shipnet.asi.receiver import receive
from shipnet.asi.telegram import RESPONSES

DT = 250e-9
SAMPLES = 256
NUMBER = 50_000
SAMPLE = 500  # telegrams in the loops, whose times are scaled up
BITS = 7


def plain_receive(u, matched):
    """Decode one response as a simple script would: with lists, loops and only the main checks."""
    per_slot = round(HALF_BIT / DT)
    if matched:
        half = per_slot // 2
        shape = [
            math.cos(math.pi * q / per_slot) ** 2 * 8 / 3 / per_slot for q in range(-half, half + 1)
        ]
        padded = [0.0] * half + u + [0.0] * half
        u = [
            sum(weight * padded[place + q] for q, weight in enumerate(shape))
            for place in range(len(u))
        ]
    first = next(place for place, value in enumerate(u) if abs(value) > 0.45)
    peak = max(range(first, first + per_slot), key=lambda place: -u[place])
    threshold = -0.5 * u[peak]
    bits, before = [], 1
    for slot in range(2 * BITS - 1):
        value = u[peak + slot * per_slot]
        pulse = (value > threshold) - (value < -threshold)
        if pulse and pulse == before:
            raise ValueError("alternation")
        before = pulse or before
        if slot % 2 == 0:
            if not pulse:
                raise ValueError("information")
            bits.append(int(pulse > 0))
    if sum(bits[:-1]) % 2:
        raise ValueError("parity")
    return bits


def main():
    rng = np.random.default_rng(2024)
    t = np.arange(SAMPLES) * DT
    bits = Modulation(RESPONSES).bits[rng.integers(0, 16, NUMBER)]
    # 40 uH times the slope of the current gives pulses of 1.6 V on an ideal line; add noise.
    u = -40e-6 * np.gradient(Modulation(bits).current(t, start=5e-6), DT, axis=-1)
    u += rng.normal(0, 0.03, u.shape)
    slots = receive(u, DT, BITS).slots
    some = [row.tolist() for row in u[:SAMPLE]]
    for matched in (True, False):
        received = receive(u, DT, BITS, matched=matched)
        assert not received.error.any() and (received.bits == bits).all()
        assert [plain_receive(row, matched) for row in some] == bits[:SAMPLE].tolist()

    per_telegram = {
        "matched, batch": seconds(lambda: receive(u, DT, BITS)) / NUMBER,
        "matched, plain loop": seconds(lambda: [plain_receive(row, True) for row in some]) / SAMPLE,
        "raw, batch": seconds(lambda: receive(u, DT, BITS, matched=False)) / NUMBER,
        "raw, plain loop": seconds(lambda: [plain_receive(row, False) for row in some]) / SAMPLE,
        "slots, batch": seconds(lambda: Pulses(slots).check()) / NUMBER,
    }
    print(f"{'AS-i responses, 256 samples':<32}{'per second':>12}{'batch is faster by':>20}")
    for name, time in per_telegram.items():
        best = per_telegram[f"{name.split(',')[0]}, batch"]
        print(f"{name:<32}{1 / time:>12.3g}{time / best:>19.1f}x")


if __name__ == "__main__":
    main()
