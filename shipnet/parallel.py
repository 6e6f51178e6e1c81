"""Independent tasks, computed here, in processes or on a cluster, with the same results."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures.process import BrokenProcessPool
from threading import Thread
from time import sleep
from typing import Any, TypeAlias, TypeVar

from shipnet.errors import load_extra
from shipnet.fields import check_whole

#: A number of processes, -1 for one per core, or a callable like `map`.
Workers: TypeAlias = "int | Callable[[Callable[[Any], Any], Sequence[Any]], Iterable[Any]]"
_T = TypeVar("_T")

#: Number of consecutive losses of processes, without a result in between, that ends the work.
_MOST_LOSSES = 5

#: Delay of a progress bar [s].
_DELAY = 1.0


def spread(
    function: Callable[[Any], Any],
    tasks: Iterable[Any],
    workers: Workers = 1,
    *,
    step: str,
) -> list[Any]:
    """Return ``function(task)`` for every task, in their order; `step` names the progress bar.

    An error gets a note that names its task; an error or interrupt ends the other tasks.
    """
    tasks = list(tasks)
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
        for number, task in enumerate(track(tasks, step)):
            try:
                results.append(next(arriving))
            except Exception as error:
                error.add_note(f"in task {number}: {task!r:.200}")
                raise
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


def track(items: Iterable[_T], step: str) -> Iterable[_T]:
    """Return the items; while a loop takes them, a bar named `step` shows its progress.

    The bar appears after 1 s, on a terminal or in a notebook, unless ``TQDM_DISABLE`` is set.
    """
    # Without an IPython shell, asking for one would load it.
    shell = sys.modules["IPython"].get_ipython() if "IPython" in sys.modules else None
    watched = sys.stderr.isatty() or hasattr(shell, "kernel")
    if not watched or os.environ.get("TQDM_DISABLE"):
        return items
    from tqdm.auto import tqdm

    bar: Iterable[_T] = tqdm(items, desc=step, delay=_DELAY, leave=False)
    return bar
