"""What tests share: missing parts of a machine, tolerances, uploads."""

import csv
import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from hypothesis import settings

with (Path(__file__).parent / "reference" / "tolerances.csv").open(encoding="utf-8") as file:
    #: The comparisons with other routes to a result; `docs/build.py` shows them on a page.
    TOLERANCES = {row["key"]: row for row in csv.DictReader(file)}

#: How long the processes of a cluster may take to start on a busy machine [s].
PATIENCE = 300


def tolerance(key: str) -> float:
    """Return how far a result may be from what it is compared with."""
    return float(TOLERANCES[key]["tolerance"])


def several(few: int, many: int) -> int:
    """Return how many cases to take: `few`, or `many` in the weekly run, which draws many."""
    return many if settings.default.max_examples > 20 else few


def require(part: str, available: bool, hint: str) -> None:
    """Skip the test when `part` is missing, or fail it when SHIPNET_REQUIRE lists `part`."""
    if available:
        return
    if part in os.environ.get("SHIPNET_REQUIRE", "").split(","):
        pytest.fail(f"{part}: {hint}", pytrace=False)
    pytest.skip(f"{part}: {hint}")


@contextmanager
def running(*arguments: str) -> Iterator[subprocess.Popen]:
    """Run `python -m shipnet` with these arguments; an interrupt stops it, the end kills it."""
    # A shell starts what runs in the background with interrupts ignored, and a child inherits it.
    heed = partial(signal.signal, signal.SIGINT, signal.SIG_DFL)
    command = [sys.executable, "-m", "shipnet", *arguments]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdout=pipe, stderr=pipe, text=True, preexec_fn=heed) as program:
        try:
            yield program
        finally:
            program.kill()


@contextmanager
def two_workers() -> Iterator[Any]:
    """Yield the client of a Dask cluster of two processes, on ports that are free."""
    import dask
    from distributed import Client, LocalCluster

    free = {"dashboard_address": "127.0.0.1:0", "silence_logs": 50}
    with (
        dask.config.set({"distributed.comm.timeouts.connect": PATIENCE}),
        LocalCluster(n_workers=2, threads_per_worker=1, processes=True, **free) as workers,
        Client(workers) as client,
    ):
        client.wait_for_workers(2, timeout=PATIENCE)
        yield client
        # One that was killed comes back before the cluster closes.
        client.wait_for_workers(2, timeout=PATIENCE)


def losing_a_worker(client: Any, killed: list[int]) -> Callable[..., Iterator[Any]]:
    """Return a `map` on the cluster of a client that kills a worker after the first result.

    The number of the process that is killed is added to `killed`.
    """

    def mapped(function: Callable[[Any], Any], tasks: Sequence[Any]) -> Iterator[Any]:
        results = client.get_executor(pure=False).map(function, tasks)
        yield next(results)
        killed.append(next(iter(client.run(os.getpid).values())))
        os.kill(killed[0], signal.SIGKILL)
        yield from results

    return mapped


def load(upload: object, content: bytes, name: str = "a.csv") -> None:
    """Give a file to an upload button as the browser does."""
    about = {"type": "", "size": len(content), "last_modified": datetime(2026, 1, 1)}
    upload.value = [{"name": name, "content": memoryview(content), **about}]


#: Units that a figure writes with their own signs, and marks of numbers without a unit.
_ASCII = re.compile(r"\b(us|degC|k?ohm)\b|\[[-1]\]")


def figure_faults(figure: Any) -> list[str]:
    """Return the texts of a figure that break a rule: size, units, and the name of each limit."""
    from matplotlib.text import Text

    from shipnet.style import LIMIT

    figure.canvas.draw()
    texts = [text for text in figure.findobj(Text) if text.get_visible() and text.get_text()]
    small = [text for text in texts if text.get_fontsize() < 10 and figure.get_figwidth() <= 6.5]
    faults = [f"{text.get_fontsize():g} pt: {text.get_text()}" for text in small]
    faults += [text.get_text() for text in texts if _ASCII.search(text.get_text())]
    named = {text.get_text() for text in texts}
    red = any(text.get_color() == LIMIT["color"] for text in texts)
    for line in (line for ax in figure.axes for line in ax.lines):
        if (line.get_color(), line.get_linestyle()) == (LIMIT["color"], LIMIT["linestyle"]):
            if not red and line.get_label() not in named:
                faults.append("a limit without its name")
    return faults
