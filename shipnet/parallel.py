"""A function over a grid of its arguments: one by one when that is short, else on all cores."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from functools import partial
from itertools import product
from math import inf
from time import perf_counter
from typing import Any

from shipnet.errors import ArgumentError
from shipnet.lazy import pd

__all__ = ["points_of", "sweep", "teller"]

#: What the start of worker processes costs [s]: below twice that, they do not pay.
_SHORT = 2.0

#: How long a terminal shows nothing [s].
_PATIENCE = 2.0

Point = dict[str, Any]
Progress = Callable[[int, int], object]


def points_of(grid: Mapping[str, Sequence[Any]] | Iterable[Mapping[str, Any]]) -> list[Point]:
    """Return the points of a grid."""
    if isinstance(grid, Mapping):
        points = [dict(zip(grid, values, strict=True)) for values in product(*grid.values())]
        points = points if grid else []
    else:
        points = [dict(point) for point in grid]
    if not points:
        raise ArgumentError("the grid has no point")
    if any(point.keys() != points[0].keys() for point in points):
        raise ArgumentError("the points of the grid have not all the same arguments")
    return points


def sweep(
    function: Callable[..., Any],
    grid: Mapping[str, Sequence[Any]] | Iterable[Mapping[str, Any]],
    *,
    parallel: bool | AbstractContextManager[Any] | None = None,
    progress: bool | Progress | None = None,
) -> pd.DataFrame:
    """Call a function at every point of a grid and return arguments and results as a table."""
    points = points_of(grid)
    tell = teller(progress)
    results = []
    for result in _run(partial(_call, function), points, parallel):
        results.append(result)
        tell(len(results), len(points))
    clash = sorted({name for result in results for name in result} & points[0].keys())
    if clash:
        raise ArgumentError(f"result and argument are both called {', '.join(clash)}")
    return pd.DataFrame([point | result for point, result in zip(points, results, strict=True)])


def _call(function: Callable[..., Any], point: Point) -> Point:
    try:
        result = function(**point)
    except Exception as error:
        error.add_note(f"at {', '.join(f'{name}={value!r}' for name, value in point.items())}")
        raise
    return dict(result) if isinstance(result, Mapping) else {"result": result}


def _run(
    call: Callable[[Point], Point],
    points: list[Point],
    parallel: bool | AbstractContextManager[Any] | None,
) -> Iterator[Point]:
    if parallel is False:
        yield from map(call, points)
        return
    if parallel is None:
        start = perf_counter()
        yield call(points[0])
        points = points[1:]
        short = (perf_counter() - start) * len(points) < _SHORT
        if short or not _has_joblib():
            yield from map(call, points)
            return
    elif not _has_joblib():
        raise ArgumentError(
            f"parallel is {parallel!r}, but joblib is not installed: pip install shipnet[cluster]"
        )
    if isinstance(parallel, AbstractContextManager):
        context, workers = parallel, {}
    elif parallel in (None, True):
        context, workers = nullcontext(), {"n_jobs": -1}
    else:
        raise ArgumentError(f"parallel is {parallel!r}; it must be a bool or a joblib context")
    from joblib import Parallel, delayed

    with context:
        yield from Parallel(return_as="generator", **workers)(delayed(call)(p) for p in points)


def _has_joblib() -> bool:
    from importlib.util import find_spec

    return find_spec("joblib") is not None


def teller(progress: bool | Progress | None) -> Progress:
    """Return what shows progress: a bar if True, by default on a terminal once 2 s are over."""
    if callable(progress):
        return progress
    start = perf_counter() if progress is None else -inf
    drawn = sys.stderr.isatty() if progress is None else progress

    def tell(done: int, total: int) -> None:
        if drawn and perf_counter() - start > _PATIENCE:
            _bar(done, total)

    return tell


def _bar(done: int, total: int, *, width: int = 30) -> None:
    full = width * done // total
    end = "\n" if done == total else ""
    print(f"\r[{'#' * full:<{width}}] {done}/{total}", end=end, file=sys.stderr, flush=True)
