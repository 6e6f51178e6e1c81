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
from functools import partial
from importlib.util import find_spec
from multiprocessing.pool import ThreadPool
from threading import Event

import numpy as np
import pytest
from nbclient import NotebookClient
from nbformat.v4 import new_code_cell, new_notebook

from shipnet import asi, ballast, design, engine, papers, parallel
from shipnet import remote_control as rc
from shipnet.errors import ArgumentError
from tests.support import PATIENCE, losing_a_worker, require, two_workers

spread = partial(parallel.spread, step="tasks")


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


#: Two short tasks, the second of which prints a word, then long ones. A process that outlives the
#: work is then seen.
STUCK = """
import signal, sys, time
from shipnet.parallel import spread
signal.signal(signal.SIGINT, signal.default_int_handler)
def wait(task):
    if task == 1:
        print("begun", flush=True)
    time.sleep(0 if task < 2 else 600)
    return 1 / (task != int(sys.argv[1]))
spread(wait, range(8), 2, step="tasks")
"""


@contextmanager
def working(failing=-1):
    """Start the long tasks in a process group of their own."""
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    command = [sys.executable, "-c", STUCK, str(failing)]
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
            assert program.stdout.readline() == "begun\n"
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


def test_a_task_that_fails_cancels_the_other_tasks():
    class Stop(Exception):
        pass

    begun, go_on = [], Event()

    def task(number):
        begun.append(number)
        if number == 0:
            raise Stop
        go_on.wait(60)

    with ThreadPoolExecutor(1) as pool:
        try:
            spread(task, range(9), pool.map)
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

    there = spread(slow, range(60), losing_a_worker(dask, killed))
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


def points():
    return design.IoList.parse("tag,signal,x,y,z\nA,contact,3,2,3\nB,contact,30,2,3")


def wave():
    return asi.line(100, slaves=(5,)).waveform(node="5 m")


#: Long work with the name of its bar.
LONG = {
    "plans": lambda: points().compare((0, 0, 0), ["home runs", "CAN"]),
    "points of the grid": lambda: points().study(
        {"assumptions.labour_rate": [50, 60]}, (0, 0, 0), ["home runs"]
    ),
    "parts of telegrams": lambda: asi.emc.rare_error_rates(wave(), 1e-4, 1000),
    "telegrams at 2 V": lambda: asi.emc.count_errors(wave(), asi.emc.Impulses(4), 2.0, 100, 2024),
    "fault trials": lambda: ballast.fault_trials(["V1"], n_valves=2, rng=2024),
    "false alarms": lambda: ballast.false_alarms(2, until=120, period=60, rng=2024),
    "diagnosis of the fleet": lambda: ballast.run_fleet(2, [], until=60.0),
    "single failures": lambda: engine.single_failures(engine.System(), faults=[], rng=2024),
    "numbers of items": lambda: rc.compare_checks([1], [1e-3], packets=10, rng=2024),
    "claims": lambda: papers.ledger("icn2007").table(),
}


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.mark.parametrize(
    ("stream", "delay", "disabled", "bar"),
    [
        (Terminal, 0.0, "", True),
        (Terminal, 60.0, "", False),
        (Terminal, 0.0, "1", False),
        (io.StringIO, 0.0, "", False),
    ],
)
def test_a_terminal_shows_a_bar_with_the_name_of_the_step_after_a_while(
    monkeypatch, capsys, stream, delay, disabled, bar
):
    monkeypatch.setattr(sys, "stderr", stream())
    monkeypatch.setattr(parallel, "_DELAY", delay)
    monkeypatch.setenv("TQDM_DISABLE", disabled)
    assert parallel.spread(abs, [-1, -2], step="plans") == [1, 2]
    text = sys.stderr.getvalue()
    assert bool(text) == bar and ("plans:   0%|" in text) == bar and ("| 0/2 [" in text) == bar
    assert text.rpartition("\r")[0].endswith(" ") == bar  # the bar is wiped out in the end
    assert capsys.readouterr().out == ""


@pytest.mark.parametrize("step", LONG)
def test_long_work_shows_its_progress(monkeypatch, capsys, step):
    monkeypatch.setattr(sys, "stderr", Terminal())
    monkeypatch.setattr(parallel, "_DELAY", 0.0)
    monkeypatch.delenv("TQDM_DISABLE", raising=False)
    LONG[step]()
    bars = {part.partition(": ")[0].strip() for part in sys.stderr.getvalue().split("\r")}
    assert bars - {""} == {step}
    assert capsys.readouterr().out == ""


@pytest.mark.parametrize(
    ("delay", "disabled", "bar"), [(0.0, "", True), (60.0, "", False), (0.0, "1", False)]
)
def test_a_notebook_shows_a_bar_after_a_while(delay, disabled, bar):
    source = "from shipnet import parallel\n"
    source += f"parallel._DELAY = {delay}\nassert [*parallel.track([1, 2], 'plans')] == [1, 2]"
    cell = new_code_cell(source)
    client = NotebookClient(new_notebook(cells=[cell]), kernel_name="python3")
    client.execute(env=os.environ | {"TQDM_DISABLE": disabled})
    assert len(cell.outputs) == bar
    assert all("application/vnd.jupyter.widget-view+json" in one.data for one in cell.outputs)


def test_a_terminal_without_a_bar_does_not_load_its_library(monkeypatch):
    monkeypatch.setitem(sys.modules, "tqdm.auto", None)
    assert list(parallel.track([1, 2], "plans")) == [1, 2]


def test_a_failure_names_its_task():
    with pytest.raises(ZeroDivisionError) as caught:
        spread(lambda task: 1 / task, [1, 0])
    assert caught.value.__notes__ == ["in task 1: 0"]
