"""How fast disturbed telegrams are simulated in batches, compared with a loop over telegrams."""

import os

# Run on one core, as the targets assume; numpy reads these variables when it is imported.
os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"

from dataclasses import replace
from functools import partial

import numpy as np
from _timing import seconds

from shipnet import asi
from shipnet.asi.emc.disturbances import Burst, ConductedRF, Impulses, Noise
from shipnet.asi.emc.error_rates import count_errors
from shipnet.asi.receiver import Receiver

NUMBER = 40_000
SAMPLE = 500  # telegrams in the loop, whose time is scaled up


def plain_loop(wave, disturbance, amplitude, number, rng, receiver):
    """Simulate and receive telegrams one at a time; return the fraction that fail."""
    failed = 0
    for _ in range(number):
        word = rng.integers(len(wave.bits))
        sent = replace(wave, u=wave.u[word], bits=wave.bits[word])
        received = sent.disturbed(disturbance, amplitude, rng).receive(receiver)
        failed += bool(received.error) or (received.bits != sent.bits).any()
    return failed / number


def main():
    wave = asi.line(100, slaves=(5,)).waveform(node="5 m")
    cases = {
        "noise, 0.9 V": (Noise(), 0.9, 0.9),
        "4 impulses, 2 V": (Impulses(4), 2.0, 0.9),
        "burst, 50 V": (Burst(), 50.0, 0.45),
        "radio frequency, 1 V": (ConductedRF(200e3), 1.0, 0.45),
    }
    print(
        f"{'responses, matched filter':<26}{'batch [1/s]':>14}{'loop [1/s]':>12}{'faster by':>12}"
    )
    for name, (disturbance, amplitude, minimum) in cases.items():
        rng, receiver = np.random.default_rng(2024), Receiver(minimum=minimum)
        batch = partial(count_errors, wave, disturbance, amplitude, NUMBER, rng, receiver=receiver)
        loop = partial(plain_loop, wave, disturbance, amplitude, SAMPLE, rng, receiver)
        rate, low_rate = batch()["rate"][0], loop()
        # The failure rates must agree within 0.03 plus five standard deviations of the loop's rate.
        assert abs(rate - low_rate) < 5 * np.sqrt(rate * (1 - rate) / SAMPLE) + 0.03
        ours, theirs = NUMBER / seconds(batch), SAMPLE / seconds(loop)
        print(f"{name:<26}{ours:>14.3g}{theirs:>12.3g}{ours / theirs:>11.0f}x")


if __name__ == "__main__":
    main()
