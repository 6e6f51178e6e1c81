"""How fast a CAN bus is simulated, event by event and in batches, compared with SimPy."""

import os
from functools import partial
from time import process_time

# Run on one core, as the targets assume; numpy reads these variables when it is imported.
os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"


import numpy as np
import simpy
from _timing import seconds as shortest

from shipnet.can import Message, MessageSet, faults, simulate, simulate_batch

seconds = partial(shortest, timer=process_time)
BIT_RATE = 125e3
BIT_US = 8
PERIODS_MS = [5, 5, 10, 10, 10, 20, 20, 50, 50, 50, 100, 100, 100, 100, 1000, 1000, 1000]
SINGLE, LOOPED, BATCH, SETS = 60.0, 10.0, 3.0, 2000  # simulated times [s]; number of offset sets


def peer(messages, duration):
    """Simulate in SimPy; return each message's number of frames sent and longest response [us]."""
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

    for rank, message in enumerate(messages):
        offset, period = round(message.offset * 1e6), round(message.period * 1e6)
        environment.process(release(rank, offset, period, message.bits * BIT_US))
    environment.run()
    return sent, longest


def main():
    number = len(PERIODS_MS)
    rng = np.random.default_rng(2024)
    # These offsets prevent simultaneous releases, which SimPy would order arbitrarily.
    offsets = rng.permuted(np.tile(np.arange(number), (SETS, 1)), axis=1) * 0.293e-3
    messages = MessageSet(
        Message(f"m{k}", k, 8, ms / 1e3, offset=offset, bits=int(bits))
        for k, (ms, bits, offset) in enumerate(
            zip(PERIODS_MS, rng.integers(85, 136, number), offsets[0], strict=True)
        )
    )
    run = simulate(messages, BIT_RATE, until=LOOPED)
    sent, longest = peer(messages, LOOPED)
    assert run.table()["sent"].tolist() == sent
    assert np.rint(run.table()["max_ms"] * 1e3).astype(int).tolist() == longest
    batch = simulate_batch(messages, BIT_RATE, offsets=offsets[:3], until=LOOPED)
    assert batch.sent[0].tolist() == sent
    assert np.rint(batch.max_response[0] * 1e6).astype(int).tolist() == longest

    frames = sum(sent) / LOOPED
    noise = faults.BitErrors(1e-5)  # about one disturbed frame in a thousand
    rates = {
        "simpy": LOOPED / seconds(lambda: peer(messages, LOOPED)),
        "simulate": SINGLE / seconds(lambda: simulate(messages, BIT_RATE, until=SINGLE)),
        "with its table": SINGLE
        / seconds(lambda: simulate(messages, BIT_RATE, until=SINGLE).table()),
        "with errors": SINGLE
        / seconds(lambda: simulate(messages, BIT_RATE, until=SINGLE, faults=noise, rng=rng)),
        "simulate_batch": SETS
        * BATCH
        / seconds(lambda: simulate_batch(messages, BIT_RATE, offsets=offsets, until=BATCH)),
    }
    print(f"{number} messages at 125 kbit/s, load {run.load:.0%}; batch of {SETS} sets of offsets")
    print(f"{'':<16}{'simulated [s/s]':>16}{'frames [1/s]':>14}{'x simpy':>10}")
    for name, rate in rates.items():
        print(f"{name:<16}{rate:>16.0f}{rate * frames:>14.3g}{rate / rates['simpy']:>9.1f}x")


if __name__ == "__main__":
    main()
