"""Tasks: the same results here, in processes, on Dask, after lost workers and after stops."""

import io
import json
import os
import pickle
import signal
import sys
from concurrent.futures import Future
from functools import partial
from importlib.util import find_spec
from pathlib import Path

import pandas as pd
import pytest

import shipnet
from shipnet.design import IoList
from shipnet.errors import ArgumentError, InputError
from shipnet.parallel import compute, points_of, save_whole
from tests.support import require, two_workers

MODULE = sys.modules["shipnet.parallel"]  # `shipnet.compute` is a function of it


def drawn(task, rng):
    """Return what the task draws; workers need not import this file."""
    return [task, *rng.standard_normal(3)]


def inverse(task):
    return 1 / task


def cluster():
    parts = ("loky", "dask", "distributed")
    require("cluster", all(map(find_spec, parts)), f"one of {', '.join(parts)} is missing")


@pytest.fixture(scope="module")
def dask():
    """A Dask cluster of two processes."""
    cluster()
    with two_workers() as client:
        yield client


def by_value(function, *arguments):
    """Return a function that is pickled by value, because workers cannot import this file."""
    return lambda task, *rng: function(*arguments, task, *rng)


def stop_one(client, done):
    """Kill the first worker of a cluster, once, when some results have arrived, not all."""

    def look(count, total):
        if 0 < count < total and not done:
            done.append(next(iter(client.run(os.getpid).values())))
            os.kill(done[0], signal.SIGKILL)

    return look


# The same results -----------------------------------------------------------------------------


def test_results_come_in_the_order_of_the_tasks():
    assert shipnet.compute is compute
    assert compute(str, range(5)) == list("01234")
    assert compute(str, []) == compute(str, iter(())) == []
    assert compute(abs, iter([-1]), client=1) == [1]


def test_random_numbers_depend_only_on_the_number_of_a_task():
    import numpy as np

    children = np.random.SeedSequence(7).spawn(4)
    expected = [drawn("x", np.random.default_rng(child)) for child in children]
    assert compute(drawn, ["x"] * 4, seed=7) == expected
    assert compute(drawn, ["x"] * 2, seed=7) == expected[:2]
    assert compute(drawn, ["x"] * 2, seed=8) != expected[:2]


def test_processes_give_the_same_bits():
    cluster()
    here = compute(drawn, range(40), seed=3, client=1)

    def where(task, rng):
        return os.getpid(), [task, *rng.standard_normal(3)]

    there = compute(where, range(40), seed=3, client=2)
    assert [result for _, result in there] == here
    assert os.getpid() not in {process for process, _ in there}


def test_a_process_that_dies_is_replaced(tmp_path):
    cluster()
    mark = tmp_path / "died"

    def dies_once(task, rng):
        if task == 5 and not mark.exists():
            mark.touch()
            os.kill(os.getpid(), signal.SIGKILL)
        return [task, *rng.standard_normal(3)]

    assert compute(dies_once, range(12), seed=3, client=2) == compute(drawn, range(12), seed=3)
    assert mark.exists()


def test_a_task_that_kills_every_process_ends_the_study():
    cluster()

    def dies(task):
        os.kill(os.getpid(), signal.SIGKILL)

    with pytest.raises(RuntimeError, match=r"died 5 times in succession, in one of tasks \[0"):
        compute(dies, range(2), client=2)


def test_dask_gives_the_same_bits_though_a_worker_is_killed(dask):
    def by_time(task, rng):
        import os
        import time

        end = time.process_time() + 0.02
        while time.process_time() < end:
            pass
        return [task, *rng.standard_normal(3)], os.getpid()

    killed = []
    found = compute(by_time, range(60), seed=3, client=dask, progress=stop_one(dask, killed))
    assert [result for result, _ in found] == compute(drawn, range(60), seed=3)
    assert killed and os.getpid() not in {process for _, process in found}


def test_a_scheduler_is_found_by_its_address(dask):
    address = dask.scheduler.address
    assert compute(by_value(pow, 2), range(9), client=address) == [2**n for n in range(9)]


def test_a_study_of_comparisons_on_a_cluster_gives_the_same_bits(dask, tmp_path):
    points = "".join(f"L{n},contact,S{n % 3},{10 + 4 * n},{n % 5},2,III\n" for n in range(12))
    iolist = IoList.parse("tag,signal,system,x,y,z,category\n" + points)
    arguments = ({"detour": [1.0, 1.3, 1.6]}, (26, 6, 14), ["home runs", "AS-i", "CAN"])
    here = iolist.study(*arguments, client=1)
    assert here["total_cost_eur"].nunique() == 9
    for where in ({"client": dask}, {"folder": tmp_path}, {"folder": tmp_path, "client": dask}):
        there = iolist.study(*arguments, progress=False, **where)
        pd.testing.assert_frame_equal(there, here, check_exact=True)


# Where the tasks run --------------------------------------------------------------------------


def test_short_work_starts_no_process(monkeypatch):
    monkeypatch.setattr(MODULE, "_executor", None)
    assert compute(abs, range(500)) == list(range(500))


def test_long_work_goes_to_processes_after_the_first_task(monkeypatch):
    asked = []
    loky = type("loky", (), {"cpu_count": staticmethod(lambda: 4)})
    monkeypatch.setattr(MODULE, "load_extra", lambda *_: loky)
    monkeypatch.setattr(MODULE, "_spread", lambda *given: asked.append(given[2:4]) or give(*given))

    def give(run, jobs, todo, client, keep, each):
        keep(list(todo), [None] * len(todo))

    monkeypatch.setattr(MODULE, "perf_counter", iter(range(0, 10_000, 3)).__next__)
    compute(abs, range(4), progress=False)
    ((todo, workers),) = asked
    # A task takes 3 s: three more take 9 s, of which four processes save 6.75 s.
    assert (list(todo), workers) == ([1, 2, 3], 4)


@pytest.mark.parametrize("left", [0.0, 3.9, 5.0])
def test_work_that_saves_little_stays_in_this_process(monkeypatch, left):
    loky = type("loky", (), {"cpu_count": staticmethod(lambda: 2)})
    monkeypatch.setattr(MODULE, "load_extra", lambda *_: loky)
    assert MODULE._processes_for(left, abs) is None
    assert MODULE._processes_for(8.1, abs) == 2


def test_without_the_extra_work_stays_in_this_process_and_a_cluster_is_refused(monkeypatch):
    for module in ("loky", "distributed"):
        monkeypatch.setitem(sys.modules, module, None)
    assert MODULE._processes_for(1e6, abs) is None
    for client in (2, "tcp://127.0.0.1:8786"):
        with pytest.raises(ImportError, match=r"pip install (loky|distributed)"):
            compute(abs, range(3), client=client)


# Resuming after a stop -------------------------------------------------------------------------


class Stop(Exception):
    pass


def stopped_at(last):
    def look(done, total):
        if done == last:
            raise Stop

    return look


def test_a_stopped_study_resumes_where_it_stopped(tmp_path):
    expected = json.loads(json.dumps(compute(drawn, range(10), seed=3)))
    with pytest.raises(Stop):
        compute(drawn, range(10), seed=3, folder=tmp_path, progress=stopped_at(4))
    told = []
    found = compute(
        drawn, range(10), seed=3, folder=tmp_path, progress=lambda *state: told.append(state)
    )
    assert found == expected and told == [(n, 10) for n in range(4, 11)]
    # All results are there now.
    assert compute(drawn, range(10), seed=3, folder=tmp_path, progress=stopped_at(1)) == expected


def test_a_torn_file_is_computed_again(tmp_path, monkeypatch):
    monkeypatch.setattr(MODULE, "_CHUNK", -1.0)  # each result has a file of its own
    expected = compute(drawn, range(6), seed=3, folder=tmp_path)
    files = sorted(tmp_path.glob("results-0*.json"))
    assert len(files) == 6
    for file, content in zip(
        files, (b"", files[1].read_bytes()[:-9], b"[]", b'{"study": 1}', b"\xff"), strict=False
    ):
        file.write_bytes(content)
    (tmp_path / ".results-00000009.json.host.1").write_text("half a fi")
    told = []
    assert compute(
        drawn, range(6), seed=3, folder=tmp_path, progress=lambda *state: told.append(state)
    ) == expected  # fmt: skip
    assert told[0] == (1, 6) and told[-1] == (6, 6)


def test_a_stop_on_dask_loses_only_the_tasks_in_progress(dask, tmp_path):
    task, expected = partial(pow, 3), [3**n for n in range(40)]
    with pytest.raises(Stop):
        compute(task, range(40), client=dask, folder=tmp_path, progress=lambda *_: stop())
    told = []
    assert compute(
        task, range(40), folder=tmp_path, progress=lambda *state: told.append(state)
    ) == expected  # fmt: skip
    assert 0 < told[0][0] < 40


def stop():
    raise Stop


@pytest.mark.parametrize(
    "change",
    [{"function": inverse}, {"tasks": range(4)}, {"seed": 2}, {"tasks": [0, 1, 3]}],
)
def test_the_folder_of_another_study_is_refused(tmp_path, change):
    study = {"function": drawn, "tasks": range(3), "seed": 1}
    compute(**study, folder=tmp_path)
    with pytest.raises(InputError, match="another function, other tasks"):
        compute(**study | change, folder=tmp_path)


def test_a_folder_recognises_its_study_in_another_session(tmp_path):
    # Equal strings that are one object here and two there pickle differently.
    one = "".join(["a", "b"])
    shared, apart = [one, one], [one, "".join(["a", "b"])]
    assert pickle.dumps(shared) != pickle.dumps(apart)
    assert MODULE._fingerprint(shared) == MODULE._fingerprint(apart)


def test_results_that_json_cannot_store_are_refused_with_a_folder(tmp_path):
    with pytest.raises(ArgumentError, match=r"result of tasks \[0\] cannot be stored.*numbers"):
        compute(set, [[1]], folder=tmp_path)
    (back,) = compute(tuple, [[1, float("nan"), None]], folder=tmp_path / "new")
    assert back[0] == 1 and back[1] != back[1] and back[2] is None
    with pytest.raises(ArgumentError, match="pickle must be able to store"):
        compute(lambda task: task, [1], folder=tmp_path / "newer")


def test_a_file_appears_whole_or_not_at_all(tmp_path):
    file = tmp_path / "a" / "b.txt"
    save_whole(file, lambda path: path.write_text("one"))

    def fails(path):
        path.write_text("tw")
        raise Stop

    with pytest.raises(Stop):
        save_whole(file, fails)
    assert file.read_text() == "one"


# Progress and errors --------------------------------------------------------------------------


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.mark.parametrize(
    ("stream", "progress", "patience", "bar"),
    [(Terminal, None, 0.0, True), (Terminal, None, 60.0, False), (io.StringIO, None, 0.0, False),
     (io.StringIO, True, 60.0, True), (Terminal, False, 0.0, False)],
)  # fmt: skip
def test_the_bar_is_drawn_on_a_terminal_after_a_while_or_on_demand(
    monkeypatch, stream, progress, patience, bar
):
    monkeypatch.setattr(sys, "stderr", stream())
    monkeypatch.setattr(MODULE, "_PATIENCE", patience)
    compute(abs, [1, 2], progress=progress)
    text = sys.stderr.getvalue()
    assert text == bar * f"\r[{'#' * 15}{' ' * 15}] 1/2\r[{'#' * 30}] 2/2\n"


@pytest.mark.parametrize("client", [None, 2, "dask"])
def test_a_failure_names_its_task(client, request):
    if client:
        cluster()
    where = request.getfixturevalue("dask") if client == "dask" else client
    with pytest.raises(ZeroDivisionError) as caught:
        compute(by_value(divmod, 1), [1, 0], client=where)
    assert caught.value.__notes__ == ["in task 1: 0"]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"function": 1}, "function is 1"),
        ({"tasks": 3}, "tasks is 3; it must be a sequence"),
        ({"seed": -1}, "seed is -1"),
        ({"seed": 1.5}, r"seed is 1\.5"),
        ({"client": 0}, "client is 0; it must be a number of processes"),
        ({"client": True}, "client is True"),
        ({"client": 2.5}, r"client is 2\.5"),
        ({"folder": 7}, "folder is 7"),
        ({"progress": "x"}, "progress is .x."),
    ],
)
def test_illegal_arguments_are_refused(change, message):
    with pytest.raises(ArgumentError, match=message):
        compute(**{"function": abs, "tasks": [1]} | change)


def test_an_unknown_scheduler_is_named(monkeypatch):
    cluster()
    monkeypatch.setattr(MODULE, "_ANSWER", 0.3)
    for address in ("tcp://127.0.0.1:1", "nowhere://x", ""):
        with pytest.raises(ArgumentError, match=f"client is {address!r}; no scheduler responds"):
            compute(abs, [1], client=address)


@pytest.mark.parametrize("lost_at", ["asking", "waiting"])
def test_a_lost_scheduler_is_named_and_results_are_kept(tmp_path, lost_at):
    cluster()

    class Scheduler:
        """Answers the first chunk, then is lost."""

        def __init__(self):
            self.chunks = 0

        def get_executor(self, pure):
            return self

        def nthreads(self):
            if self.chunks and lost_at == "asking":
                raise OSError("closed")
            return {"worker": 1}

        def submit(self, run, *arguments):
            self.chunks += 1
            future = Future()
            if self.chunks > 1:
                future.cancel()
                future.set_running_or_notify_cancel()
            else:
                future.set_result(run(*arguments))
            return future

    with pytest.raises(ConnectionError, match="scheduler was lost; with a folder"):
        compute(abs, range(9), client=Scheduler(), folder=tmp_path)
    seen = []
    found = compute(abs, range(9), folder=tmp_path, progress=lambda done, _: seen.append(done))
    assert found == list(range(9)) and seen[0] >= 1


def test_a_folder_that_cannot_be_used_is_named(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="file: cannot be used: "):
        compute(abs, [1], folder=tmp_path / "file")
    with pytest.raises(InputError, match="deeper: cannot be used: "):
        compute(abs, [1], folder=tmp_path / "file" / "deeper")
    with pytest.raises(InputError, match="/proc/shipnet: cannot be used: "):
        compute(abs, [1], folder=Path("/proc/shipnet"))


@pytest.mark.parametrize("grid", [{}, [], {"a": []}])
def test_a_grid_without_a_point_is_refused(grid):
    with pytest.raises(ArgumentError, match="no point"):
        points_of(grid)
    with pytest.raises(ArgumentError, match="have different arguments"):
        points_of([{"a": 1}, {"b": 1}])
