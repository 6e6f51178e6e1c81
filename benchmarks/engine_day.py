"""How long simulating a day of lee2012's engine takes, compared with event-by-event simulation.

The event-by-event simulation covers only a short time, and its run time is scaled up. The tests
check that both simulations give the same samples, to the nanosecond.
"""

import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from shipnet.engine.simulation import simulate
from shipnet.engine.system import System
from tests.engine.reference import run_reference

PHASES = {"JB1": 0.11, "JB2": 0.23, "JB3": 0.37, "AMS": 0.05}
DAY, SHORT = 86_400, 30


def measure(function, *arguments, **options):
    begin = time.perf_counter()
    function(*arguments, **options)
    return time.perf_counter() - begin


for name, system in (("printed", System()), ("corrected", System.corrected())):
    ours = measure(simulate, system, until=DAY, phases=PHASES)
    walk = measure(run_reference, system, SHORT, [], PHASES) / SHORT * DAY
    frames = float(np.sum(DAY * 1e9 / system.period_ns[system.sender]))
    print(
        f"{name}: a day, {frames / 1e6:.1f} M CAN frames, 99 points: {ours:.1f} s; "
        f"an event-by-event simulation would take {walk:.0f} s ({walk / ours:.0f} times as long)"
    )
