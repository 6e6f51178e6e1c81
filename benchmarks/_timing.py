"""How the benchmarks measure."""

from time import perf_counter
from timeit import timeit


def seconds(function, repeats=None, timer=perf_counter):
    """Return the shortest of several times: the one least disturbed by other work.

    The timer `process_time` does not count other work at all, nor what a child process does.
    Without `repeats` a function is called three times, and on until 0.1 s or 1000 calls are over.
    """
    times = []
    total = 0.0
    while len(times) < (repeats or 3) or (repeats is None and total < 0.1 and len(times) < 1000):
        times.append(timeit(function, timer=timer, number=1))
        total += times[-1]
    return min(times)
