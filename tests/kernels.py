"""Kernels forked from a process that has already imported what nearly every notebook imports.

A kernel is as new as any other: its notebook finds nothing but modules that load in no time. Its
start and those imports would take a quarter of the time that all notebooks take together.
"""

import multiprocessing
import os
import signal
import sys
import time
from collections.abc import Mapping, Sequence
from typing import Any

#: Other people's packages only: the notebooks load ours.
_SHARED = [
    "ipykernel.kernelapp", "ipywidgets", "matplotlib.pyplot", "pandas", "scipy.cluster.hierarchy",
    "scipy.sparse.csgraph", "scipy.special", "skfuzzy.control",
]  # fmt: skip
_INLINE = {"MPLBACKEND": "module://matplotlib_inline.backend_inline"}


def _run(arguments: Sequence[str], cwd: str, environment: Mapping[str, str]) -> None:
    """Be a kernel."""
    os.setsid()
    os.environ.clear()
    os.environ.update(environment)
    os.chdir(cwd)
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stderr.fileno())
    sys.argv = [*arguments]
    from ipykernel.kernelapp import launch_new_instance

    launch_new_instance()


class Kernel:
    """A forked kernel, with what jupyter_client asks of a `subprocess.Popen`."""

    stdin = stdout = stderr = None

    def __init__(self, command: Sequence[str], *, cwd: str, env: Mapping[str, str], **_: Any):
        arguments = command[command.index("ipykernel_launcher") :]
        self._process = _forks().Process(target=_run, args=(arguments, cwd, dict(env)))
        self._process.start()
        self.pid = self._process.pid
        # The whole group of a kernel is ended: it must no longer be that of the tests.
        while os.getpgid(self.pid) != self.pid:
            time.sleep(0.001)

    def poll(self) -> int | None:
        """Return the exit code, or None while it runs."""
        return self._process.exitcode

    def wait(self) -> int | None:
        """Wait for its end."""
        self._process.join()
        return self._process.exitcode

    def send_signal(self, number: int) -> None:
        """Send it a signal."""
        os.kill(self.pid, number)

    def kill(self) -> None:
        """End it at once."""
        self.send_signal(signal.SIGKILL)


def _forks() -> Any:
    """Return the context whose processes are forked so, and start their parent if it is new."""
    from multiprocessing import forkserver  # there is none on Windows

    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(_SHARED)
    before = dict(os.environ)
    os.environ.update(_INLINE)  # as a kernel does before it imports Matplotlib
    try:
        forkserver.ensure_running()
    finally:
        os.environ.clear()
        os.environ.update(before)
    return context
