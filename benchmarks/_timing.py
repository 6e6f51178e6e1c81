"""Timer for the benchmarks."""

from time import perf_counter
from timeit import timeit


def seconds(function, repeats=None, timer=perf_counter):
    """Return the shortest of several run times [s], the one least disturbed by other work.

    With `process_time` as timer, the time of other programs and child processes is not counted.
    Without `repeats`, the function is called at least three times, and then until the calls have
    taken 0.1 s in total or 1000 calls have been made.
    """
    times = []
    total = 0.0
    while len(times) < (repeats or 3) or (repeats is None and total < 0.1 and len(times) < 1000):
        times.append(timeit(function, timer=timer, number=1))
        total += times[-1]
    return min(times)
