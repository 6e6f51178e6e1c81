"""How fast a fleet is diagnosed, compared with loops that call scikit-fuzzy or shipnet per sample.

The readings are from valves that open and close; both loops process only a few readings. In the
simulated day, each of 256 valves receives one command per hour, and the day is processed in blocks.
"""

import warnings
from timeit import default_timer

import numpy as np
from _timing import seconds

from shipnet.ballast.diagnosis import diagnose_run
from shipnet.ballast.plant import Command, Fault
from shipnet.ballast.rule_table import rule_base
from shipnet.ballast.simulation import blocks, simulate
from shipnet.fuzzy.firing import METHODS

N, FEW = 256, 100
BASE = rule_base()


def control_loop(rows):
    """Return firing strengths from ControlSystemSimulation.compute, sample by sample."""
    from skfuzzy import control

    system = BASE.to_skfuzzy()
    rules = {rule.label: rule for rule in system.rules}
    simulation = control.ControlSystemSimulation(system, flush_after_run=10 * len(rows))
    result = []
    for row in rows:
        for name, x in row.items():
            simulation.input[name] = x
        simulation.compute()
        result.append([rules[code].aggregate_firing[simulation] for code in BASE.codes])
    return np.array(result, dtype=float)


def own_loop(rows):
    return np.concatenate([BASE.fire({k: [x] for k, x in row.items()}).strength for row in rows])


def day():
    """Simulate and diagnose a fleet's day; return the number of readings and both run times [s]."""
    orders = [Command(("open", "close")[hour % 2], 3600.0 * hour) for hour in range(24)]
    faults = [Fault("V1", start=30000.0, valves=4), Fault("P2", start=50000.0, valves=71)]
    tail, spent, readings = None, 0.0, 0
    begin = default_timer()
    rng = np.random.default_rng(1)
    for run in blocks(N, orders, faults=faults, until=86400, rng=rng):
        start = default_timer()
        tail = diagnose_run(run, earlier=tail).tail
        spent += default_timer() - start
        readings += run.time.size * N
    return readings, default_timer() - begin - spent, spent


def main():
    warnings.filterwarnings("ignore", category=DeprecationWarning, module="skfuzzy")
    orders = [Command("open", 5.0), Command("close", 35.0)]
    run = simulate(N, orders, until=65, rng=np.random.default_rng(2024))
    diagnosis = diagnose_run(run)
    size = run.time.size * N

    # scikit-fuzzy accepts no missing values, so use instants without any.
    valve = 0
    known = np.flatnonzero(~np.isnan(diagnosis.samples["DVPos"][:, valve]))[:FEW]
    rows = [
        {name: float(diagnosis.samples[name][row, valve]) for name in BASE.names} for row in known
    ]
    exact = diagnosis.firing(valve + 1).strength[known]
    assert np.abs(control_loop(rows) - exact).max() < 1e-12
    assert np.array_equal(own_loop(rows), exact)
    # Fuzzy diagnosis in blocks must decide the same as midpoint comparisons of the whole array.
    whole = BASE.fire(diagnosis.samples, "midpoint").decide(k=3, n=5).active
    assert np.array_equal(whole, diagnosis.active)

    per_sample = {
        f"diagnose_run, {reading}": seconds(lambda r=reading: diagnose_run(run, method=r)) / size
        for reading in METHODS
    }
    per_sample["strengths, sample by sample"] = seconds(lambda: own_loop(rows)) / len(rows)
    per_sample["ControlSystemSimulation, the same"] = seconds(lambda: control_loop(rows), 2) / len(
        rows
    )
    fastest = per_sample["diagnose_run, fuzzy"]
    print(f"{f'{run.time.size} instants of {N} valves, 3 of 5':<40}{'samples/s':>12}{'ratio':>12}")
    for name, time in per_sample.items():
        print(f"{name:<40}{1 / time:>12.3g}{time / fastest:>11.1f}x")

    readings, plant, spent = day()
    print(
        f"a day of {N} valves: {readings / 1e6:.1f} million valve readings, plant {plant:.1f} s, "
        f"diagnosis {spent:.1f} s ({readings / spent / 1e6:.1f} million per second)"
    )


if __name__ == "__main__":
    main()
