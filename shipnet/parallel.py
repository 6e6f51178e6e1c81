"""Independent tasks, computed one by one, in processes or on a Dask cluster, with the same results.

A task's random numbers depend only on the seed and the task number; results are in task order.
"""

from __future__ import annotations

import copyreg
import json
import os
import pickle
import sys
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Executor, Future, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack
from functools import partial
from hashlib import sha256
from itertools import product
from math import inf
from multiprocessing import current_process
from pathlib import Path
from socket import gethostname
from time import perf_counter
from types import MappingProxyType, SimpleNamespace
from typing import Any

from shipnet.errors import ArgumentError, InputError, load_extra
from shipnet.fields import check_whole

#: Time saving that justifies starting processes, and duration of a chunk of tasks [s].
_WORTHWHILE, _CHUNK = 4.0, 1.0

#: Number of consecutive losses of workers, without a result in between, that ends the computation.
_MOST_LOSSES = 5

#: Time-out for connecting to a scheduler, and delay of the progress bar [s].
_ANSWER, _PATIENCE = 10, 2.0

_GONE = "the Dask scheduler was lost; with a folder, the same call resumes where it stopped"

Point = dict[str, Any]
Progress = Callable[[int, int], object]
Run = Callable[[Sequence[int], Sequence[Any]], tuple[list[Any], float]]


def points_of(grid: Mapping[str, Sequence[Any]] | Iterable[Mapping[str, Any]]) -> list[Point]:
    """Return the points of a grid."""
    if isinstance(grid, Mapping):
        points = [dict(zip(grid, values, strict=True)) for values in product(*grid.values())]
        points = points if grid else []
    else:
        points = [dict(point) for point in grid]
    if not points:
        raise ArgumentError("the grid has no points")
    if any(point.keys() != points[0].keys() for point in points):
        raise ArgumentError("the points of the grid have different arguments")
    return points


def compute(
    function: Callable[..., Any],
    tasks: Iterable[Any],
    *,
    seed: int | None = None,
    client: Any = None,
    folder: str | os.PathLike[str] | None = None,
    progress: bool | Progress | None = None,
) -> list[Any]:
    """Call a function for every task; the results do not depend on where the tasks run.

    Parameters
    ----------
    function : callable
        Called as ``function(task)``, or as ``function(task, rng)`` if there is a seed. If a
        `folder` is given, the function must be importable, so it cannot be a lambda.
    tasks : iterable
        The tasks; each is the argument of one call.
    seed : int, optional
        Seed, 0..2^63 - 1; each task gets a random generator made from the seed and the task number.
    client : None, int, str or distributed.Client, optional
        Where the tasks run: 1 for this process, 2..1024 for that many processes, the address of a
        Dask scheduler, or its client. By default, tasks run in this process, then in one process
        per core if that saves over 4 s. Processes need the package loky, Dask needs distributed.
    folder : path, optional
        Folder where results are saved as JSON, so that the same call resumes after an interruption.
        Results must be numbers, text, lists or dicts; a tuple becomes a list.
    progress : bool or callable, optional
        Called as ``progress(done, total)`` when results arrive. True shows a bar, False none; by
        default, a bar appears on a terminal after 2 s.

    Returns
    -------
    list
        The results, in the order of the tasks.

    Raises
    ------
    ArgumentError
        If an argument is out of its range, no scheduler responds, or a result cannot be stored in
        the folder. An error in the function gets a note that names the task.
    InputError
        If the folder contains the results of other tasks, or cannot be written to.
    ImportError
        If processes or Dask are requested but their packages are not installed.
    ConnectionError
        If the scheduler is lost.
    RuntimeError
        If workers died five times in succession without a result.

    Notes
    -----
    Another worker takes over the tasks of a lost worker. Results are identical bit for bit with the
    same version of numpy on processors of the same kind. Each worker should use one thread for
    linear algebra: processes started here have ``OMP_NUM_THREADS=1``, as do Dask's own by default.

    Examples
    --------
    >>> compute(round, [1.4, 2.6])
    [1, 3]
    >>> def mean(size, rng):
    ...     return round(float(rng.random(size).mean()), 3)
    >>> compute(mean, [10, 1000], seed=2024)
    [0.423, 0.507]
    """
    jobs = list(tasks)
    if seed is not None:
        seed = check_whole("seed", seed, 0, 2**63 - 1)
    run, tell = partial(_run, function, seed), teller(progress)
    with ExitStack() as stack:
        client = _checked(client, stack)
        kept = None if folder is None else _Folder(Path(folder), function, jobs, seed)
        results: dict[int, Any] = {} if kept is None else kept.results

        def keep(indices: Sequence[int], values: Sequence[Any]) -> None:
            new = dict(zip(indices, values, strict=True))
            results.update(new if kept is None else kept.add(new))
            tell(len(results), len(jobs))

        if kept is not None:
            stack.callback(kept.save)
        if results:
            tell(len(results), len(jobs))
        todo = deque(index for index in range(len(jobs)) if index not in results)
        spent = count = 0.0
        while todo and client in (None, 1):
            index = todo.popleft()
            values, took = run([index], [jobs[index]])
            keep([index], values)
            spent, count = spent + took, count + 1
            if client is None:
                client = _processes_for(spent / count * len(todo), function)
        if todo:
            _spread(run, jobs, todo, client, keep, spent / count if count else None)
    return [results[index] for index in range(len(jobs))]


def _run(
    function: Callable[..., Any], seed: int | None, indices: Sequence[int], jobs: Sequence[Any]
) -> tuple[list[Any], float]:
    """Compute a chunk of tasks in this process; return the results and the time taken [s]."""
    import numpy as np

    begin, results = perf_counter(), []
    for index, job in zip(indices, jobs, strict=True):
        # The child that SeedSequence(seed).spawn() would make for this task, made directly.
        own = () if seed is None else (np.random.SeedSequence(seed, spawn_key=(index,)),)
        try:
            results.append(function(job, *map(np.random.default_rng, own)))
        except Exception as error:
            error.add_note(f"in task {index}: {job!r:.200}")
            raise
    return results, perf_counter() - begin


def _checked(client: Any, stack: ExitStack) -> Any:
    """Return where to run: None for the default, a number of processes, or a Dask client."""
    if client is None or hasattr(client, "get_executor"):
        return client
    if isinstance(client, str):
        distributed = load_extra("distributed", "distributed")
        try:
            return stack.enter_context(distributed.Client(client, timeout=_ANSWER))
        except (OSError, ValueError, TypeError) as problem:
            raise ArgumentError(f"client is {client!r}; no scheduler responds there") from problem
    try:
        return check_whole("client", client, 1, 1024)
    except ArgumentError:
        raise ArgumentError(
            f"client is {client!r}; it must be a number of processes 1..1024, the address of a "
            "scheduler, or a distributed.Client"
        ) from None


def _processes_for(left: float, function: Callable[..., Any]) -> int | None:
    """Return how many processes to start for `left` seconds of work, or None to start none."""
    if left < _WORTHWHILE or current_process().daemon:
        return None
    try:
        loky = load_extra("loky", "loky")
    except ImportError:
        return None
    cores = int(loky.cpu_count())
    return cores if left * (1 - 1 / cores) > _WORTHWHILE else None


def _executor(client: Any) -> tuple[Executor, int, type[Exception]]:
    """Return the executor, its number of workers, and the error that reports a lost worker."""
    if isinstance(client, int):
        loky = load_extra("loky", "loky")
        pool = loky.get_reusable_executor(client, env={"OMP_NUM_THREADS": "1"})
        return pool, client, BrokenProcessPool
    lost = load_extra("distributed", "distributed").KilledWorker
    try:
        workers = sum(client.nthreads().values())  # workers may join or leave later
    except OSError as problem:
        raise ConnectionError(_GONE) from problem
    return client.get_executor(pure=False), max(1, workers), lost


def _spread(
    run: Run,
    jobs: Sequence[Any],
    todo: deque[int],
    client: Any,
    keep: Callable[[Sequence[int], Sequence[Any]], None],
    each: float | None,
) -> None:
    """Compute the tasks in chunks, and repeat those of lost workers."""
    pending: dict[Future[Any], list[int]] = {}
    losses = 0
    try:
        while todo or pending:
            pool, workers, lost = _executor(client)
            # Each worker has one running and one waiting chunk; chunks get shorter near the end.
            while todo and len(pending) < 2 * workers:
                size = 1 if each is None else min(_CHUNK / each, len(todo) / (4 * workers))
                indices = [todo.popleft() for _ in range(min(max(1, int(size)), len(todo)))]
                try:
                    pending[pool.submit(run, indices, [jobs[i] for i in indices])] = indices
                except BrokenProcessPool:
                    todo.extendleft(reversed(indices))
                    break
            dropped: list[int] = []
            for future in wait(pending, return_when=FIRST_COMPLETED).done:
                indices = pending.pop(future)
                try:
                    values, took = future.result()
                except lost:
                    dropped += indices
                    continue
                except CancelledError:
                    raise ConnectionError(_GONE) from None
                each, losses = max(took / len(indices), 1e-6), 0
                keep(indices, values)
            if dropped:
                losses += 1
                if isinstance(client, int):  # a pool that loses one process stops all its processes
                    dropped += [index for indices in pending.values() for index in indices]
                    pending.clear()
                dropped.sort()
                if losses >= _MOST_LOSSES:
                    raise RuntimeError(
                        f"workers died {losses} times in succession, in one of tasks {dropped[:10]}"
                    )
                todo.extendleft(reversed(dropped))
    finally:
        for future in pending:
            future.cancel()
        if pending and isinstance(client, int):
            pool.shutdown(wait=False, kill_workers=True)  # type: ignore[call-arg]


class _Folder:
    """Results in a folder: complete files, each marked with the study that it belongs to."""

    def __init__(
        self, folder: Path, function: Callable[..., Any], jobs: list[Any], seed: int | None
    ) -> None:
        from shipnet import __version__

        self._folder = folder
        self._mark = _fingerprint((__version__, function, jobs, seed))
        self._new: dict[int, Any] = {}
        self._saved = perf_counter()
        self.results: dict[int, Any] = {}
        try:
            folder.mkdir(parents=True, exist_ok=True)
            for file in sorted(folder.glob("results-*.json")):
                try:
                    held = json.loads(file.read_bytes())
                    mark, values = held["study"], {int(i): x for i, x in held["results"].items()}
                except (ValueError, KeyError, TypeError, AttributeError):
                    continue  # damaged by a crash of the machine: its tasks are computed again
                if mark != self._mark:
                    raise InputError(
                        str(folder),
                        "has results of another function, other tasks, another seed or another "
                        "version of shipnet; give an empty folder",
                    )
                self.results |= {i: x for i, x in values.items() if 0 <= i < len(jobs)}
            self.save(check=True)
        except OSError as problem:
            raise InputError(str(folder), f"cannot be used: {problem.strerror}") from problem

    def add(self, new: dict[int, Any]) -> dict[int, Any]:
        """Add results and return them as if read back from a file; save at most once per second."""
        try:
            text = json.dumps({str(index): value for index, value in new.items()})
        except (TypeError, ValueError) as problem:
            raise ArgumentError(
                f"a result of tasks {list(new)[:10]} cannot be stored: {problem}; it must "
                "consist of numbers, text, lists and dicts"
            ) from None
        read = {int(index): value for index, value in json.loads(text).items()}
        self._new |= read
        if perf_counter() - self._saved > _CHUNK:
            self.save()
        return read

    def save(self, check: bool = False) -> None:
        """Write new results; `check` writes a file even if there are none, to test the folder."""
        if not self._new and not check:
            return
        text = json.dumps({"study": self._mark, "results": self._new})
        place = f"{min(self._new):08d}" if self._new else "none"
        save_whole(
            self._folder / f"results-{place}.json",
            lambda path: path.write_text(text, encoding="utf-8"),
        )
        self._new, self._saved = {}, perf_counter()


def _fingerprint(what: object) -> str:
    """Return a checksum of a study that is the same in every session."""
    digest = sha256()
    pickler = pickle.Pickler(SimpleNamespace(write=digest.update), protocol=5)
    # Without its memo, pickle gives equal parts the same bytes, whether or not they are one object.
    pickler.fast = True
    plain: dict[type, Any] = {MappingProxyType: lambda proxy: (dict, (dict(proxy),))}
    pickler.dispatch_table = {**copyreg.dispatch_table, **plain}
    try:
        pickler.dump(what)
    except Exception as problem:
        raise ArgumentError(
            f"with a folder, pickle must be able to store the function and tasks: {problem}"
        ) from None
    return digest.hexdigest()


def save_whole(path: Path, write: Callable[[Path], object]) -> None:
    """Let `write` fill a temporary file, and rename it, so that no reader sees a partial file."""
    path.parent.mkdir(parents=True, exist_ok=True)
    own = path.with_name(f".{path.name}.{gethostname()}.{os.getpid()}")
    write(own)
    with own.open("rb+") as file:
        os.fsync(file.fileno())
    own.replace(path)


def teller(progress: bool | Progress | None) -> Progress:
    """Return the function that reports progress; `progress` is as in `compute`."""
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
