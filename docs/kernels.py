"""Kernels forked from a process that has already loaded the libraries, if the system can fork.

Most kernels take longer to load Jupyter, pandas, matplotlib and scipy than to run their notebook.
A fork has these libraries at once, but must still load shipnet; each kernel is a separate process.
"""

from __future__ import annotations

import atexit
import builtins
import gc
import importlib
import json
import os
import signal
import subprocess
import sys
from contextlib import suppress
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

LIBRARIES = (
    "ipykernel.kernelapp", "ipywidgets", "anywidget", "lazy_loader", "IPython.core.pylabtools",
    "pandas.io.formats.style", "matplotlib.backends.backend_agg", "matplotlib.pyplot",
    "PIL.GifImagePlugin", "PIL.JpegImagePlugin", "PIL.PpmImagePlugin", "scipy.optimize",
    "scipy.signal", "scipy.stats",
)  # fmt: skip


class Kernel:
    """A forked kernel, with the interface of `subprocess.Popen` that Jupyter uses."""

    stdin = stdout = stderr = None

    def __init__(
        self, command: list[str], *, env: dict[str, str], cwd: str = ".", **_: Any
    ) -> None:
        server = _server()
        arguments = command[command.index("ipykernel_launcher") + 1 :]
        print(json.dumps([arguments, str(Path(cwd).resolve()), env]), file=server.stdin, flush=True)
        self.pid = int(server.stdout.readline())

    def poll(self) -> int | None:
        """Return None while the kernel runs, then 0."""
        try:
            os.kill(self.pid, 0)
        except ProcessLookupError:
            return 0
        return None

    def wait(self) -> int:
        """Return 0 as the exit code of a kernel that has ended; the value is not used."""
        return 0

    def send_signal(self, number: int) -> None:
        """Send a signal to the kernel, if it is still running."""
        with suppress(ProcessLookupError):
            os.kill(self.pid, number)


def fork(*, at_once: bool = False) -> None:
    """Make this process start its kernels as forks, if the system can fork.

    The libraries are loaded when the first kernel starts, or immediately if `at_once` is true.
    """
    from jupyter_client.provisioning import local_provisioner

    if hasattr(os, "fork"):
        local_provisioner.launch_kernel = Kernel
        if at_once:
            _server()


@cache
def _server() -> Any:
    """Return the process that forks the kernels; it ends when the pipe to it closes."""
    pipe = subprocess.PIPE
    server = subprocess.Popen([sys.executable, __file__], stdin=pipe, stdout=pipe, text=True)
    atexit.register(server.communicate)
    return server


def _serve() -> None:
    """Fork a kernel for each line of standard input; each kernel prints its process id."""
    # On import, pyplot reads this variable, and pandas checks whether it runs in a notebook.
    os.environ["MPLBACKEND"] = "module://matplotlib_inline.backend_inline"
    builtins.get_ipython = lambda: SimpleNamespace(kernel=None)
    for name in LIBRARIES:
        importlib.import_module(name)
    with suppress(ImportError):  # not every system has numba; its first function takes a second
        importlib.import_module("numba").njit(lambda x: x)(1)
    del builtins.get_ipython
    # Kernels do not garbage-collect the loaded libraries, so their memory is not copied.
    gc.freeze()
    signal.signal(signal.SIGCHLD, _bury)
    # Ctrl-C must stop only the program that starts the kernels.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    while line := sys.stdin.readline():
        if not os.fork():
            _run(*json.loads(line))


def _bury(*_: Any) -> None:
    """Reap the kernels that have ended."""
    with suppress(ChildProcessError):
        while os.waitpid(-1, os.WNOHANG)[0]:
            pass


def _run(arguments: list[str], folder: str, environment: dict[str, str]) -> None:
    """Run a kernel in a process group of its own, until it or the forking process ends."""
    import ipywidgets
    from ipykernel.kernelapp import IPKernelApp

    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    os.setsid()
    print(os.getpid(), flush=True)
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    os.dup2(2, 1)
    os.chdir(folder)
    os.environ.clear()
    os.environ.update(environment)
    application = IPKernelApp.instance(parent_handle=os.getppid())
    application.initialize(arguments)
    # The libraries were loaded before there was a kernel at which ipywidgets could register.
    ipywidgets.register_comm_target(application.kernel)
    application.start()
    # A normal exit would spend half a second dismantling the libraries.
    atexit._run_exitfuncs()
    os._exit(0)


if __name__ == "__main__":
    # A notebook can import files from its own folder, but not from the folder of this script.
    del sys.path[0]
    _serve()
