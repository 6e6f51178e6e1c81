"""Tasks: the same results here, in processes and on Dask, also after lost workers."""

import io
import os
import random
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from importlib.util import find_spec
from multiprocessing.pool import ThreadPool
from threading import Event

import numpy as np
import pytest

from shipnet import parallel
from shipnet.errors import ArgumentError
from shipnet.parallel import spread
from tests.support import PATIENCE, require, two_workers


def cluster():
    parts = ("loky", "dask", "distributed")
    require("cluster", all(map(find_spec, parts)), f"one of {', '.join(parts)} is missing")


@pytest.fixture(scope="module")
def dask():
    """A Dask cluster of two processes."""
    cluster()
    with two_workers() as client:
        yield client


def drawing():
    """Return a function that is pickled by value, because workers cannot import this file."""

    def draw(seed):
        import os

        return os.getpid(), np.random.default_rng(seed).standard_normal(3).tolist()

    return draw


def test_results_come_in_the_order_of_the_tasks():
    assert spread(str, range(5)) == list("01234")
    assert spread(str, []) == spread(str, iter(())) == []
    assert spread(abs, iter([-1]), workers=map) == [1]


@pytest.mark.parametrize("workers", ["processes", "threads", "pool", "dask"])
def test_results_do_not_depend_on_the_workers(workers, request):
    cluster()
    here = [result for _, result in spread(drawing(), range(40))]
    if workers == "processes":
        there = spread(drawing(), range(40), workers=2)
    elif workers == "threads":
        with ThreadPoolExecutor(2) as pool:
            there = spread(drawing(), range(40), workers=pool.map)
    elif workers == "pool":
        with ThreadPool(2) as pool:
            there = spread(drawing(), range(40), workers=pool.imap)
    else:
        there = spread(drawing(), range(40), request.getfixturevalue("dask").get_executor().map)
    assert [result for _, result in there] == here
    if workers in ("processes", "dask"):
        assert os.getpid() not in {process for process, _ in there}


def test_a_process_that_dies_is_replaced(tmp_path):
    cluster()
    mark, draw = tmp_path / "died", drawing()

    def dies_once(task):
        if task == 5 and not mark.exists():
            mark.touch()
            os.kill(os.getpid(), signal.SIGKILL)
        return draw(task)

    there = spread(dies_once, range(12), workers=2)
    assert [row for _, row in there] == [row for _, row in spread(draw, range(12))]
    assert mark.exists()


def test_a_task_that_kills_every_process_ends_the_work():
    cluster()

    def dies(task):
        os.kill(os.getpid(), signal.SIGKILL)

    match = "died 5 times in succession; if the memory is full, take fewer workers"
    with pytest.raises(ChildProcessError, match=match) as caught:
        spread(dies, range(2), workers=2)
    assert caught.value.__notes__ == ["in task 0: 0"]


#: Two short tasks, whose ends are printed, then long ones: a process that outlives the work shows.
LONG = """
import signal, sys, time
from shipnet.parallel import spread
signal.signal(signal.SIGINT, signal.default_int_handler)
def wait(task):
    time.sleep(0 if task < 2 else 600)
    return 1 / (task != int(sys.argv[1]))
spread(wait, range(8), 2, lambda *state: print(*state, flush=True))
"""


@contextmanager
def working(failing=-1):
    """Start the long tasks in a process group of their own."""
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    command = [sys.executable, "-c", LONG, str(failing)]
    with subprocess.Popen(command, **pipes, start_new_session=True) as program:
        try:
            yield program
        finally:
            with suppress(ProcessLookupError):
                os.killpg(program.pid, signal.SIGKILL)


def errors_at_end(program):
    """Wait until the program and its processes have closed their outputs; return the errors."""
    return program.communicate(timeout=PATIENCE)[1]


@pytest.mark.parametrize("send", [os.kill, os.killpg], ids=["parent", "all"])
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT])
@pytest.mark.parametrize("moment", ["at random", "during the tasks"])
def test_no_process_outlives_work_that_is_killed_or_interrupted(send, number, moment):
    cluster()
    with working() as program:
        if moment == "at random":
            time.sleep(random.Random(f"{send} {number}").uniform(0.3, 1.5))
        else:
            assert program.stdout.readline() == "1 8\n"
        send(program.pid, number)
        errors = errors_at_end(program)
        assert program.returncode == -number
        assert number == signal.SIGKILL or errors.endswith("KeyboardInterrupt\n")


def test_no_process_outlives_work_that_fails():
    cluster()
    with working(failing=1) as program:
        assert errors_at_end(program).endswith(
            "ZeroDivisionError: division by zero\nin task 1: 1\n"
        )


def test_a_caller_that_stops_cancels_the_other_tasks():
    class Stop(Exception):
        pass

    def stop(done, total):
        raise Stop

    begun, go_on = [], Event()

    def task(number):
        begun.append(number)
        go_on.wait(0 if number == 0 else 60)

    with ThreadPoolExecutor(1) as pool:
        try:
            spread(task, range(9), pool.map, stop)
        except Stop as problem:  # kept, as by an interactive shell
            kept = problem
        go_on.set()
    assert kept and len(begun) <= 2


def test_dask_gives_the_same_bits_though_a_worker_is_killed(dask):
    draw, killed = drawing(), []

    def slow(task):
        import time

        end = time.process_time() + 0.02
        while time.process_time() < end:
            pass
        return draw(task)

    def stop_one(done, total):
        if 0 < done < total and not killed:
            killed.append(next(iter(dask.run(os.getpid).values())))
            os.kill(killed[0], signal.SIGKILL)

    there = spread(slow, range(60), dask.get_executor(pure=False).map, stop_one)
    assert [row for _, row in there] == [row for _, row in spread(draw, range(60))]
    assert killed


def test_processes_need_a_package(monkeypatch):
    monkeypatch.setitem(sys.modules, "loky", None)
    assert spread(abs, range(3)) == [0, 1, 2]
    with pytest.raises(ImportError, match="pip install loky"):
        spread(abs, range(3), workers=2)


@pytest.mark.parametrize("workers", [0, -2, True, None])
def test_an_illegal_number_of_workers_is_refused(workers):
    with pytest.raises(ArgumentError, match=r"workers is .*1\.\.1024, or a callable like map"):
        spread(abs, [1], workers=workers)


def test_progress_is_reported_after_each_task():
    reports = []
    spread(abs, [1, 2, 3], progress=lambda *state: reports.append(state))
    assert reports == [(1, 3), (2, 3), (3, 3)]
    with pytest.raises(ArgumentError, match="progress is 'x'"):
        spread(abs, [1], progress="x")


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.mark.parametrize(
    ("stream", "progress", "patience", "bar"),
    [
        (Terminal, None, 0.0, True),
        (Terminal, None, 60.0, False),
        (io.StringIO, None, 0.0, False),
        (io.StringIO, True, 60.0, True),
        (Terminal, False, 0.0, False),
    ],
)
def test_the_bar_is_drawn_on_a_terminal_after_a_while_or_on_demand(
    monkeypatch, stream, progress, patience, bar
):
    monkeypatch.setattr(sys, "stderr", stream())
    monkeypatch.setattr(parallel, "_PATIENCE", patience)
    spread(abs, [1, 2], progress=progress)
    text = sys.stderr.getvalue()
    assert text == bar * f"\r[{'#' * 15}{' ' * 15}] 1/2\r[{'#' * 30}] 2/2\n"


def test_a_failure_names_its_task():
    with pytest.raises(ZeroDivisionError) as caught:
        spread(lambda task: 1 / task, [1, 0])
    assert caught.value.__notes__ == ["in task 1: 0"]
