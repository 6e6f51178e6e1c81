"""How much faster valves are simulated all at once than in a loop or by differential equations.

The equations also include the mass and the compliance of the oil, so they are a more detailed
model, not just a slower way to compute the same results. The program also prints the largest
difference between the results of the equations and of the simulation, which uses a closed form.
"""

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from _timing import seconds

from shipnet.ballast.actuator import Actuator
from shipnet.ballast.plant import Command
from shipnet.ballast.scan import System
from shipnet.ballast.simulation import blocks, simulate
from tests.ballast.compliance import integrate_stroke
from tests.ballast.nominal import IDEAL

N, DURATION = 256, 20.0
OPEN = [Command("open", 1.0)]


def many():
    return simulate(N, OPEN, until=DURATION, rng=np.random.default_rng(2024))


def one():
    return simulate(1, OPEN, until=DURATION, rng=np.random.default_rng(2024))


def stroke():
    return integrate_stroke(Actuator(), np.arange(0, 9, 0.1))


def day(n_valves):
    """Simulate a day with an hourly command to every valve; return the number of instants."""
    hours = range(24)
    orders = [Command(("open", "close")[hour % 2], 3600.0 * hour) for hour in hours]
    run = blocks(n_valves, orders, until=86400, rng=np.random.default_rng(1))
    return sum(block.time.size for block in run)


def report(what, time, peer=None, peer_time=None, note=""):
    ratio = "" if peer_time is None else f"{peer_time / time:>9.1f}x  {peer} {peer_time:.3g} s"
    print(f"{what:<44}{time * 1e3:>9.1f} ms{ratio}{note}")


def main():
    ideal = simulate(System(sensors=IDEAL), [Command("open")], until=9)
    ode = stroke()
    n = ode.time.size
    apart = np.abs(ode.opening - ideal.opening[:n, 0]).max()
    print(f"equations and closed form differ by at most {100 * apart:.2f} % of a stroke")

    all_valves, single, equations = seconds(many), seconds(one), seconds(stroke, 2)
    report("256 valves, 20 s at 10 Hz, with noise", all_valves, "a loop", N * single)
    report("256 valves, one stroke", all_valves, "equations, 256 times", N * equations)

    readings = day(1)
    time = seconds(lambda: day(N), 1)
    note = (
        f"   {readings} instants, {readings * N / time / 1e6:.1f} million valve readings per second"
    )
    report("256 valves, a day in blocks", time, note=note)


if __name__ == "__main__":
    main()
