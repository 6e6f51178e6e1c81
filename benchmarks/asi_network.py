"""How fast an AS-i line of 62 slaves is simulated, telegram by telegram, compared with SimPy.

In each cycle, both programs poll one slave at each of 31 addresses, read the status of one slave,
and poll a vacant address; if a request or its response is lost, the request is repeated at once.
Both programs get the same disturbances and must give the same cycle times. Rates are in requests
per second; a real line carries about 6400.
"""

from time import process_time
from unittest.mock import patch

import numpy as np
from _timing import seconds

from shipnet.asi import BIT_TIME, Master, Slave, channel, simulate
from shipnet.asi.channel import draw_disturbances

try:
    import simpy
except ImportError:
    simpy = None

CYCLES = 2000
RATE = 1e-3  # probability that a request is lost; also that a response is lost
LABELS = [f"{address}{half}" for address in range(1, 32) for half in "AB"]
SLAVES = [Slave(label, "S-7.A.E") for label in LABELS]


def with_simpy(disturbances):
    """Return the cycle times [s] of a model with SimPy processes for the master and each slave."""
    environment = simpy.Environment()
    mailboxes = [simpy.Store(environment) for _ in LABELS]
    replies = simpy.Store(environment)
    times, last = [], None

    def slave(number):
        in_step = True
        while True:
            (lost, missed, variant), follows = yield mailboxes[number].get()
            if not follows:
                in_step = not missed
            if lost:
                in_step = False
                continue
            yield environment.timeout(3 if in_step else 5)
            in_step = True
            yield environment.timeout(7)
            replies.put(variant == 0)

    def request(number, tries):
        nonlocal last
        for disturbance in tries:
            yield environment.timeout(14)
            mailboxes[number].put((disturbance, number == last))
            last = number
            answer = replies.get()
            expired = environment.timeout(10)
            if disturbance[0]:
                yield expired
                answer.cancel()
                continue
            fine = yield answer
            yield environment.timeout(2)
            if fine:
                return

    def master():
        nonlocal last
        turn = 0
        for cycle, (exchange, management, _) in enumerate(disturbances.tolist()):
            begin = environment.now
            for number in range(cycle % 2, len(LABELS), 2):
                yield from request(number, exchange[number])
            yield from request(turn, management[turn])
            turn = (turn + 1) % len(LABELS)
            yield environment.timeout(24)
            last = None
            times.append(environment.now - begin)

    for number in range(len(LABELS)):
        environment.process(slave(number))
    environment.run(environment.process(master()))
    return np.array(times) * BIT_TIME


def simulated(disturbances):
    """Simulate with given disturbances instead of random ones."""
    ahead = iter(range(0, 10**9, 256))

    def given(rng, n_cycles, rates, attempts):
        rows = np.zeros((n_cycles, *disturbances.shape[1:]), disturbances.dtype)
        start = next(ahead)
        own = disturbances[start : start + n_cycles]
        rows[: len(own)] = own
        return rows

    with patch.object(channel, "draw_disturbances", given):
        return simulate(SLAVES, Master(drop_after=1000), cycles=CYCLES)


def main():
    rng = np.random.default_rng(2024)
    drawn = draw_disturbances(rng, CYCLES, [(RATE, RATE)] * len(LABELS), 2)
    # The summary leaves out the start-up, which the SimPy model does not have.
    run = simulated(drawn)
    requests, real = run.summary.requests, run.cycle_times.sum()
    taken = {"telegram by telegram": seconds(lambda: simulated(drawn), timer=process_time)}
    if simpy is None:
        print("SimPy is not installed, so its loop is left out")
    else:
        assert np.allclose(with_simpy(drawn), run.cycle_times, rtol=0, atol=1e-12)
        taken["SimPy"] = seconds(lambda: with_simpy(drawn), 3, process_time)
    base = taken["telegram by telegram"]
    print(f"{'62 A/B slaves':<24}{'requests/s':>12}{'x real time':>13}{'x telegrams':>13}")
    for name, time in taken.items():
        print(f"{name:<24}{requests / time:>12.3g}{real / time:>13.1f}{base / time:>13.2f}")


if __name__ == "__main__":
    main()
