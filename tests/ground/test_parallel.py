import io
import os
import sys
import threading
from importlib.util import find_spec

import pandas as pd
import pytest

from shipnet import datasets
from shipnet.design import IoList, Plant, lines_needed
from shipnet.errors import ArgumentError
from shipnet.parallel import points_of, sweep
from tests.support import require

MODULE = sys.modules[sweep.__module__]  # whatever the package calls by its name
GRID = {"distance": [10.0, 100.0], "contacts": [1, 2, 4]}


def costs(distance, contacts):
    plant = Plant(modules=3, contacts=contacts, distance=distance)
    return {
        "hardwired": plant.hardwired.quantities()["total_cost_eur"],
        "AS-i": plant.on_asi.quantities()["total_cost_eur"],
    }


def process_id(n):
    return {"process": os.getpid(), "square": n * n}


def cluster():
    require("cluster", all(map(find_spec, ("joblib", "dask", "distributed"))), "no joblib or dask")


def test_a_table_has_arguments_and_results_in_the_order_of_the_grid():
    table = sweep(costs, GRID, parallel=False)
    assert list(table) == ["distance", "contacts", "hardwired", "AS-i"]
    expected = [(d, c, *costs(d, c).values()) for d in (10.0, 100.0) for c in (1, 2, 4)]
    assert list(table.itertuples(index=False, name=None)) == expected


def test_points_may_be_given_themselves_and_a_number_is_a_result():
    table = sweep(lambda a, b: a - b, [{"a": 3, "b": 1}, {"b": 5, "a": 2}])
    assert table.to_dict("list") == {"a": [3, 2], "b": [1, 5], "result": [2, -3]}


def test_a_short_sweep_starts_no_workers(monkeypatch):
    monkeypatch.setitem(sys.modules, "joblib", None)
    assert sweep(process_id, {"n": range(50)})["process"].unique().tolist() == [os.getpid()]


def test_a_long_sweep_goes_to_joblib(monkeypatch):
    cluster()
    import joblib

    monkeypatch.setattr(MODULE, "_SHORT", 0.0)
    threads = []

    def here(n):
        threads.append(threading.get_ident())
        return n

    with joblib.parallel_config("threading", n_jobs=2):
        table = sweep(here, {"n": range(20)})
    assert table["result"].tolist() == list(range(20))
    # The first point is timed here, the others run in joblib's threads.
    assert threads[0] == threading.get_ident()
    assert threading.get_ident() not in threads[1:]


def test_without_joblib_a_long_sweep_runs_here_and_an_asked_one_is_refused(monkeypatch):
    monkeypatch.setattr(MODULE, "_SHORT", 0.0)
    monkeypatch.setattr(MODULE, "_has_joblib", lambda: False)
    assert sweep(process_id, {"n": [1, 2, 3]})["square"].tolist() == [1, 4, 9]
    with pytest.raises(ArgumentError, match=r"pip install shipnet\[cluster\]"):
        sweep(process_id, {"n": [1, 2]}, parallel=True)


def test_a_passed_context_is_left_as_it_was_found():
    cluster()
    import joblib
    from joblib.parallel import get_active_backend

    before = type(get_active_backend()[0])
    context = joblib.parallel_config("threading", n_jobs=2)
    table = sweep(process_id, {"n": [1, 2, 3]}, parallel=context)
    assert table["square"].tolist() == [1, 4, 9]
    assert type(get_active_backend()[0]) is before


@pytest.fixture(scope="module")
def on_dask():
    """Return a way to run on a Dask cluster of processes, which is told by their ids."""
    cluster()
    import joblib
    from distributed import Client, LocalCluster

    with (
        LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
        ) as workers,
        Client(workers),
    ):
        yield lambda: joblib.parallel_config("dask")


def test_a_dask_cluster_of_processes_gives_the_same_table(on_dask):
    # A function within a function travels by value: the workers need not import this file.
    def lines(valves, reserve):
        slaves = lines_needed(valves, slaves_per_line=62 - reserve)
        return {"lines": slaves, "process": os.getpid()}

    grid = {"valves": [62, 400], "reserve": [0, 6, 12]}
    table = sweep(lines, grid, parallel=on_dask(), progress=False)
    here = sweep(lines, grid, parallel=False)
    assert os.getpid() not in set(table["process"])
    columns = ["valves", "reserve", "lines"]
    pd.testing.assert_frame_equal(table[columns], here[columns])


def test_a_study_of_comparisons_on_a_cluster_gives_the_same_bits(on_dask):
    points = "".join(f"L{n},contact,S{n % 3},{10 + 4 * n},{n % 5},2,III\n" for n in range(12))
    iolist = IoList.parse("tag,signal,system,x,y,z,category\n" + points)
    trays = datasets.path("synthetic_trays_ship.csv")
    arguments = ({"detour": [1.0, 1.3, 1.6]}, (26, 6, 14), ["home runs", "AS-i", "CAN"])
    there = iolist.study(*arguments, trays=trays, parallel=on_dask(), progress=False)
    here = iolist.study(*arguments, trays=trays, parallel=False)
    assert there["total_cost_eur"].nunique() == 9
    pd.testing.assert_frame_equal(there, here, check_exact=True)


def test_progress_is_told_after_each_point():
    told = []
    sweep(process_id, {"n": [1, 2, 3]}, progress=lambda *state: told.append(state))
    assert told == [(1, 3), (2, 3), (3, 3)]


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.mark.parametrize(
    ("stream", "progress", "patience", "drawn"),
    [(Terminal, None, 0.0, True), (Terminal, None, 60.0, False), (io.StringIO, None, 0.0, False),
     (io.StringIO, True, 60.0, True), (Terminal, False, 0.0, False)],
)  # fmt: skip
def test_the_bar_is_drawn_on_a_terminal_after_a_while_or_on_demand(
    monkeypatch, stream, progress, patience, drawn
):
    monkeypatch.setattr(sys, "stderr", stream())
    monkeypatch.setattr("shipnet.parallel._PATIENCE", patience)
    sweep(process_id, {"n": [1, 2]}, progress=progress)
    text = sys.stderr.getvalue()
    assert text == drawn * f"\r[{'#' * 15}{' ' * 15}] 1/2\r[{'#' * 30}] 2/2\n"


@pytest.mark.parametrize("parallel", [False, None, True])
def test_a_failure_says_at_which_point(parallel):
    if parallel:
        cluster()
        import joblib

        parallel = joblib.parallel_config("threading", n_jobs=2)
    with pytest.raises(ZeroDivisionError) as caught:
        sweep(lambda a: 1 / a, {"a": [1, 0]}, parallel=parallel)
    assert "at a=0" in caught.value.__notes__


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: points_of({}), "no point"),
        (lambda: points_of([]), "no point"),
        (lambda: points_of({"a": []}), "no point"),
        (lambda: points_of([{"a": 1}, {"b": 1}]), "not all the same"),
        (lambda: sweep(lambda n: {"n": n}, {"n": [1]}), "both called n"),
        (lambda: sweep(process_id, {"n": [1]}, parallel="dask"), "parallel is 'dask'"),
    ],
)
def test_what_is_no_grid_is_refused(call, message):
    with pytest.raises(ArgumentError, match=message):
        call()
