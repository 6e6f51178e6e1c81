"""Kernels as forks of a process that has loaded the libraries, where a system can fork.

    python docs/kernels.py PROGRAM [arguments]    run a program of Jupyter, with such kernels

To load Jupyter, pandas, matplotlib and scipy takes a kernel longer than most of our notebooks do. A
kernel that is a fork has them at once, and nothing of the package; each is a process of its own.
"""

from __future__ import annotations

import atexit
import gc
import importlib
import json
import os
import runpy
import signal
import subprocess
import sys
from functools import cache
from pathlib import Path
from typing import Any

LIBRARIES = (
    "IPython.core.pylabtools", "PIL.GifImagePlugin", "PIL.JpegImagePlugin", "PIL.PpmImagePlugin",
    "ipykernel.kernelapp", "lazy_loader", "matplotlib.backends.backend_agg", "matplotlib.pyplot",
    "pandas.io.formats.style", "scipy.optimize", "scipy.signal", "scipy.stats",
)  # fmt: skip


class Kernel:
    """The process of a kernel, with what Jupyter uses of `subprocess.Popen`."""

    stdin = stdout = stderr = None

    def __init__(
        self, command: list[str], *, env: dict[str, str], cwd: str = ".", **_: Any
    ) -> None:
        server = _server()
        arguments = command[command.index("ipykernel_launcher") + 1 :]
        print(json.dumps([arguments, str(Path(cwd).resolve()), env]), file=server.stdin, flush=True)
        self.pid = int(server.stdout.readline())

    def poll(self) -> int | None:
        """Return None as long as the kernel runs."""
        try:
            os.kill(self.pid, 0)
        except ProcessLookupError:
            return 0
        return None

    def wait(self) -> int:
        """Return the exit code of a kernel that has ended, which nobody asks for."""
        return 0

    def send_signal(self, number: int) -> None:
        """Send a signal to the kernel."""
        os.kill(self.pid, number)


@cache
def _server() -> Any:
    """Return the process that forks; it ends when the pipe to it closes."""
    pipe = subprocess.PIPE
    # With -P its folder is not on the path: to a notebook, its own folder is.
    command = [sys.executable, "-P", __file__]
    server = subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True)
    atexit.register(server.communicate)
    return server


def fork(*, now: bool = False) -> None:
    """Let the kernels that this process starts be forks; load libraries `now`, or for the first."""
    from jupyter_client.provisioning import local_provisioner

    if hasattr(os, "fork"):
        local_provisioner.launch_kernel = Kernel
        if now:
            _server()


def _serve() -> None:
    """Fork a kernel for each line of the standard input, and print its process id."""
    # pyplot takes the backend from here when it is loaded.
    os.environ["MPLBACKEND"] = "module://matplotlib_inline.backend_inline"
    for name in LIBRARIES:
        importlib.import_module(name)
    # No kernel looks for garbage in what is loaded, nor copies it by that.
    gc.freeze()
    # The system clears away a kernel that has ended; Ctrl-C is for the program that starts them.
    for number in (signal.SIGCHLD, signal.SIGINT):
        signal.signal(number, signal.SIG_IGN)
    while line := sys.stdin.readline():
        if not os.fork():
            _run(*json.loads(line))


def _run(arguments: list[str], folder: str, environment: dict[str, str]) -> None:
    """Run a kernel in a process group of its own, until it ends or the process that forks does."""
    from ipykernel.kernelapp import IPKernelApp

    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    os.setsid()
    print(os.getpid(), flush=True)
    with open(os.devnull, "r+") as nothing:
        for stream in (0, 1, 2):
            os.dup2(nothing.fileno(), stream)
    os.chdir(folder)
    os.environ.clear()
    os.environ.update(environment)
    IPKernelApp.launch_instance(arguments, parent_handle=os.getppid())
    # To take the libraries apart, which the others go on using, would take half a second.
    atexit._run_exitfuncs()
    os._exit(0)


if __name__ == "__main__" and sys.argv[1:]:
    fork(now=True)
    del sys.argv[0]
    runpy.run_module(sys.argv[0], run_name="__main__", alter_sys=True)
elif __name__ == "__main__":
    _serve()
