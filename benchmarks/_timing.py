"""How the benchmarks measure."""

from timeit import timeit


def seconds(function, repeats=None):
    """Return the shortest of several times: the one least disturbed by other work.

    Without `repeats` a function is called three times, and on until 0.1 s or 1000 calls are over.
    """
    times = []
    total = 0.0
    while len(times) < (repeats or 3) or (repeats is None and total < 0.1 and len(times) < 1000):
        times.append(timeit(function, number=1))
        total += times[-1]
    return min(times)
