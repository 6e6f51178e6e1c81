"""Compare the bounds for single failures of the engine system with simulations at random phases."""

import argparse
from dataclasses import replace

import numpy as np

from shipnet import engine

SYSTEMS = {
    "printed": engine.System(),
    "one retry": engine.System(retries=1),
    "meets 2 s": engine.System(poll_period=0.4, update_period=0.25, stale_limit=0.6),
    "long time-out": engine.System(timeout=0.5, poll_period=0.7),
    "ring": engine.System(topology="ring"),
}


def main() -> None:
    """Simulate, and print the largest observed fraction of each bound, by system and fault."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=10_000)
    runs = parser.parse_args().runs
    rng = np.random.default_rng(2024)
    found: dict[tuple[str, str], list[float]] = {}
    for number in range(runs):
        name = list(SYSTEMS)[number % len(SYSTEMS)]
        system = SYSTEMS[name]
        faults = [f for f in system.single_faults() if f.at != "sensor"]
        fault = faults[rng.integers(len(faults))]
        if fault.at == "channel" and rng.random() < 0.5:
            # The worst case is a response that breaks off near its end.
            start = 5 + system.poll.time - system.serial.t35 - rng.uniform(0, 0.01)
            phases = {"AMS": 5 % system.poll_period}
        else:
            start, phases = rng.uniform(5, 6), {}
        lasting = rng.random() < 0.7
        stop = np.inf if lasting else start + rng.uniform(0.001, 4)
        failed = replace(fault, start=start, stop=stop)
        bounds = system.failure_bounds(failed)
        run = engine.simulate(system, until=13, faults=failed, phases=phases, rng=rng)
        seen = run.views.seen[run.views.seen > 4e9]
        parts = (
            run.answers()["answer_s"].max() / bounds.answer,
            np.diff(seen).max() / 1e9 / bounds.gap,
            run.worst_age / bounds.oldest,
        )
        kind = type(fault).__name__ + (" 2" if fault.where == "2" else "")
        key = (name, kind)
        found[key] = np.maximum(found.get(key, [0, 0, 0]), parts).tolist()
        if max(parts) > 1 + 1e-8:  # times are rounded to nanoseconds
            print("EXCEEDED", name, failed, parts)
    print(f"{runs} runs; largest observed fraction of the bounds on response, gap and oldest value")
    for (name, kind), parts in sorted(found.items()):
        print(f"{name:20} {kind:20} " + " ".join(f"{part:6.3f}" for part in parts))


if __name__ == "__main__":
    main()
