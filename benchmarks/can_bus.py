"""How fast a CAN bus is simulated: event by event and in batches, beside simpy, in one run."""

import os

# One core is promised, so one is measured: numpy reads this when it is loaded.
os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"

from timeit import repeat

import numpy as np
import simpy

from shipnet.can.bus import simulate, simulate_batch

BIT_RATE = 125e3
BIT_US = 8
PERIODS_MS = [5, 5, 10, 10, 10, 20, 20, 50, 50, 50, 100, 100, 100, 100, 1000, 1000, 1000]
SINGLE, LOOPED, BATCH, SETS = 60.0, 10.0, 3.0, 2000  # seconds simulated; sets of offsets


def seconds(function, repeats=3):
    """Return the shortest of several times: the one least disturbed by other work."""
    return min(repeat(function, number=1, repeat=repeats))


def peer(table, duration):
    """Return frames sent and the longest responses [us], with a process for each message."""
    horizon = round(duration * 1e6)
    environment = simpy.Environment()
    bus = simpy.PriorityResource(environment, capacity=1)
    sent, longest = [0] * len(PERIODS_MS), [0] * len(PERIODS_MS)

    def send(rank, length, release):
        with bus.request(priority=rank) as turn:
            yield turn
            yield environment.timeout(length)
        sent[rank] += 1
        longest[rank] = max(longest[rank], environment.now - release)

    def release(rank, offset, period, length):
        yield environment.timeout(offset)
        while environment.now < horizon:
            environment.process(send(rank, length, environment.now))
            yield environment.timeout(period)

    for rank, (offset, period, bits) in enumerate(
        zip(table["offset_ms"], table["period_ms"], table["bits"], strict=True)
    ):
        environment.process(
            release(rank, round(offset * 1e3), round(period * 1e3), int(bits) * BIT_US)
        )
    environment.run()
    return sent, longest


def main():
    number = len(PERIODS_MS)
    rng = np.random.default_rng(2024)
    # No two releases of different messages at one instant: there the peer decides by chance.
    offsets = rng.permuted(np.tile(np.arange(number), (SETS, 1)), axis=1) * 0.293e-3
    table = {
        "arbitration_id": np.arange(number),
        "bits": rng.integers(85, 136, number),
        "period_ms": np.array(PERIODS_MS, dtype=float),
        "offset_ms": offsets[0] * 1e3,
    }
    run = simulate(table, LOOPED, BIT_RATE)
    sent, longest = peer(table, LOOPED)
    assert run.statistics["sent"].tolist() == sent
    assert np.rint(run.statistics["max_ms"] * 1e3).astype(int).tolist() == longest
    batch = simulate_batch(table, offsets[:3], LOOPED, BIT_RATE)
    assert batch.sent[0].tolist() == sent
    assert np.rint(batch.max_response[0] * 1e6).astype(int).tolist() == longest

    frames = sum(sent) / LOOPED
    rates = {
        "simpy": LOOPED / seconds(lambda: peer(table, LOOPED)),
        "simulate": SINGLE / seconds(lambda: simulate(table, SINGLE, BIT_RATE)),
        "with errors": SINGLE
        / seconds(lambda: simulate(table, SINGLE, BIT_RATE, error_rate=1e-3, rng=rng)),
        "simulate_batch": SETS
        * BATCH
        / seconds(lambda: simulate_batch(table, offsets, BATCH, BIT_RATE)),
    }
    print(f"{number} messages at 125 kbit/s, load {run.load:.0%}; batch of {SETS} sets of offsets")
    print(f"{'':<16}{'simulated [s/s]':>16}{'frames [1/s]':>14}{'to simpy':>10}")
    for name, rate in rates.items():
        print(f"{name:<16}{rate:>16.0f}{rate * frames:>14.3g}{rate / rates['simpy']:>9.1f}x")


if __name__ == "__main__":
    main()
