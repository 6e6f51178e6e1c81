"""Run Voila with forked kernels and a pool that is filled one kernel at a time.

    python docs/pool.py [arguments of Voila]

If all kernels started at once, the first visitor would wait for all of them. If a page is requested
before the pool has begun to start a kernel for it, the page gets its own kernel, and the pool
pauses for Voila's `fill_delay`, so that the page can load.

At most `--Tools.most_kernels` kernels run, because each needs about 100 MB. A visitor beyond them
gets a page that says so. If Voila listens only on this machine, it answers only requests that name
this machine, so that a foreign page in the same browser cannot reach it under another name.
"""

from __future__ import annotations

import asyncio
import sys
import time
from typing import Any

import kernels
from tornado.web import HTTPError
from traitlets import Int
from voila import app
from voila.voila_kernel_manager import voila_kernel_manager_factory

FULL = "%d tools are open, as many as this machine runs. Close one, or try again in two minutes."


class Tools(app.Voila):
    """Voila with a limit on its kernels, and without answers to foreign host names."""

    most_kernels = Int(40, min=1, help="Largest number of kernels.").tag(config=True)

    def init_settings(self) -> dict[str, Any]:
        """Return Voila's settings, which by themselves allow every host name."""
        local = self.ip in ("localhost", "127.0.0.1", "::1")
        return super().init_settings() | {"allow_remote_access": not local}


class Render(app.TornadoVoilaHandler):
    """Handler of a tool's page."""

    async def prepare(self) -> None:
        """Give the page what it needs to end its kernel when it is closed."""
        await super().prepare()
        assert self.xsrf_token, "reading the token sets the cookie"


class Channel(app.VoilaKernelWebsocketHandler):
    """Handler of the messages between a page and its kernel."""

    async def open(self, kernel_id: str) -> None:
        """Send each message at once: TCP would hold a small one back for up to 40 ms."""
        self.set_nodelay(True)
        await super().open(kernel_id)


def one_by_one(*arguments: Any, **options: Any) -> type:
    """Return Voila's kernel manager with a pool that is filled one kernel at a time."""
    base: Any = voila_kernel_manager_factory(*arguments, **options)

    class Manager(base):  # type: ignore[misc]
        def __init__(self, **options: Any) -> None:
            self._turn, self._begun, self._resume = asyncio.Lock(), set[str](), 0.0
            super().__init__(**options)

        async def start_kernel(self, **options: Any) -> str:
            if len(self) >= self.parent.most_kernels:
                raise HTTPError(503, FULL, self.parent.most_kernels)
            return await super().start_kernel(**options)

        def fill_if_needed(self, *arguments: Any, notebook_name: str, **options: Any) -> None:
            self._begun.discard(notebook_name)
            super().fill_if_needed(*arguments, notebook_name=notebook_name, **options)

        def get_pool_size(self, notebook_name: str) -> int:
            if notebook_name in self._begun:
                return super().get_pool_size(notebook_name)
            self._resume = time.monotonic() + self.fill_delay
            return 0

        async def _initialize(self, notebook_path: str, *arguments: Any, **options: Any) -> Any:
            await self._turn.acquire()
            while (pause := self._resume - time.monotonic()) > 0:
                await asyncio.sleep(pause)
            while len(self) >= self.parent.most_kernels:
                await asyncio.sleep(1)
            self._begun.add(notebook_path)
            try:
                started = await super()._initialize(notebook_path, *arguments, **options)
            except BaseException:
                self._turn.release()
                raise
            started["task"].add_done_callback(lambda _: self._turn.release())
            return started

    return Manager


if __name__ == "__main__":
    kernels.fork(at_once=True)
    app.voila_kernel_manager_factory = one_by_one
    app.TornadoVoilaHandler, app.VoilaKernelWebsocketHandler = Render, Channel
    Tools.launch_instance(sys.argv[1:])
