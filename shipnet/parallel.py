"""Independent tasks, computed here, in processes or on a cluster, with the same results."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures.process import BrokenProcessPool
from math import inf
from threading import Thread
from time import perf_counter, sleep
from typing import Any, TypeAlias

from shipnet.errors import ArgumentError, load_extra
from shipnet.fields import check_whole

#: A number of processes, -1 for one per core, or a callable like `map`.
Workers: TypeAlias = "int | Callable[[Callable[[Any], Any], Sequence[Any]], Iterable[Any]]"
Progress: TypeAlias = Callable[[int, int], object]

#: Number of consecutive losses of processes, without a result in between, that ends the work.
_MOST_LOSSES = 5

#: Delay of the progress bar [s].
_PATIENCE = 2.0


def spread(
    function: Callable[[Any], Any],
    tasks: Iterable[Any],
    workers: Workers = 1,
    progress: bool | Progress | None = None,
) -> list[Any]:
    """Return ``function(task)`` for every task, in their order, and report the progress.

    An error gets a note that names its task; an error or interrupt ends the other tasks.
    """
    tasks = list(tasks)
    report = teller(progress)
    if callable(workers):
        arriving = iter(workers(function, tasks))
    else:
        if workers != -1:
            legal = ", or a callable like map; -1 means one process per core"
            workers = check_whole("workers", workers, 1, 1024, legal)
        here = workers == 1
        arriving = map(function, tasks) if here else _in_processes(function, tasks, workers)
    results = []
    try:
        for number, task in enumerate(tasks):
            try:
                results.append(next(arriving))
            except Exception as error:
                error.add_note(f"in task {number}: {task!r:.200}")
                raise
            report(len(results), len(tasks))
    finally:
        # The generators of executors then cancel the tasks that are left after an error.
        if isinstance(arriving, Generator):
            arriving.close()
    return results


def _in_processes(
    function: Callable[[Any], Any], tasks: Sequence[Any], workers: int
) -> Iterator[Any]:
    """Yield the results of several processes, which are replaced if lost and end with this one."""
    loky = load_extra("loky", "loky")
    count = loky.cpu_count() if workers == -1 else workers
    done = losses = 0
    while done < len(tasks):
        pool = loky.get_reusable_executor(
            count, env={"OMP_NUM_THREADS": "1"}, initializer=_end_with, initargs=(os.getpid(),)
        )
        try:
            for result in pool.map(function, tasks[done:]):
                done, losses = done + 1, 0
                yield result
        except BrokenProcessPool as problem:
            losses += 1
            if losses == _MOST_LOSSES:
                raise ChildProcessError(
                    f"processes died {losses} times in succession; if the memory is full, take "
                    "fewer workers"
                ) from problem
        finally:
            if done < len(tasks):
                pool.shutdown(kill_workers=True)


def _end_with(parent: int) -> None:
    """End this process when its parent has died, which can happen without any notice."""

    def watch() -> None:
        # Windows reports the same parent for ever; there, only waiting processes end.
        while os.getppid() == parent:
            sleep(1)
        os._exit(1)

    Thread(target=watch, daemon=True).start()


def teller(progress: bool | Progress | None) -> Progress:
    """Return the function that reports progress as ``progress(done, total)``.

    True draws a bar and False none; by default, a bar appears on a terminal after 2 s.
    """
    if callable(progress):
        return progress
    if not (progress is None or isinstance(progress, bool)):
        raise ArgumentError(f"progress is {progress!r}; it must be a function, True, False or None")
    start = perf_counter() if progress is None else -inf
    drawn = sys.stderr.isatty() if progress is None else progress

    def tell(done: int, total: int) -> None:
        if drawn and perf_counter() - start > _PATIENCE:
            bar = f"[{'#' * (30 * done // total):<30}]"
            end = "\n" if done == total else ""
            print(f"\r{bar} {done}/{total}", end=end, file=sys.stderr, flush=True)

    return tell
