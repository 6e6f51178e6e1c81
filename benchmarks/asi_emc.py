"""Disturbed telegrams a second, in batches and in a plain loop over telegrams, in one run."""

import os

# One core is promised, so one is measured: numpy reads this when it is loaded.
os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"

from functools import partial

import numpy as np
from _timing import seconds

from shipnet.asi.emc.disturbances import burst, conducted_rf, impulses, noise
from shipnet.asi.emc.monte_carlo import all_telegrams, telegram_error_rate
from shipnet.asi.receiver import receive
from shipnet.asi.topology import straight_line

NUMBER = 40_000
SAMPLE = 500  # what the loop gets; its time is scaled up


def plain_loop(telegrams, disturbance, amplitude, number, rng, minimum):
    """Count failures one telegram at a time, with the same disturbances and receiver."""
    dt = telegrams.t[1] - telegrams.t[0]
    failed = 0
    for _ in range(number):
        word = rng.integers(len(telegrams.bits))
        u = telegrams.u[word] + disturbance(telegrams.t, amplitude, rng, 1)[0]
        received = receive(u, dt, 7, minimum=minimum)
        failed += bool(received.error) or (received.bits != telegrams.bits[word]).any()
    return failed / number


def main():
    telegrams = all_telegrams(straight_line(100, slaves=(5,)))
    cases = {
        "noise, 0.9 V": (noise, 0.9, 0.9),
        "4 impulses, 2 V": (partial(impulses, count=4, between=telegrams.span), 2.0, 0.9),
        "burst, 50 V": (burst, 50.0, 0.45),
        "radio frequency, 1 V": (partial(conducted_rf, frequency=200e3), 1.0, 0.45),
    }
    print(
        f"{'responses, matched filter':<26}{'batch [1/s]':>14}{'loop [1/s]':>12}{'faster by':>12}"
    )
    for name, (disturbance, amplitude, minimum) in cases.items():
        rng = np.random.default_rng(2024)
        batch = partial(
            telegram_error_rate, telegrams, disturbance, amplitude, NUMBER, rng, minimum=minimum
        )
        loop = partial(plain_loop, telegrams, disturbance, amplitude, SAMPLE, rng, minimum)
        rate, low_rate = batch()["rate"][0], loop()
        # Both must do the same work: rates agree within five sigma of the loop's.
        assert abs(rate - low_rate) < 5 * np.sqrt(rate * (1 - rate) / SAMPLE) + 0.03
        ours, theirs = NUMBER / seconds(batch), SAMPLE / seconds(loop)
        print(f"{name:<26}{ours:>14.3g}{theirs:>12.3g}{ours / theirs:>11.0f}x")


if __name__ == "__main__":
    main()
