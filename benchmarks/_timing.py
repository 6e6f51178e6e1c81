"""Timer of the benchmarks."""

from time import perf_counter
from timeit import timeit


def seconds(function, repeats=None, timer=perf_counter):
    """Return the shortest of several times, which is the least disturbed by other work.

    The timer `process_time` counts neither other programs nor child processes. Without `repeats`,
    the function is called at least three times, until 0.1 s have passed or 1000 calls were made.
    """
    times = []
    total = 0.0
    while len(times) < (repeats or 3) or (repeats is None and total < 0.1 and len(times) < 1000):
        times.append(timeit(function, timer=timer, number=1))
        total += times[-1]
    return min(times)
