"""Run Voila with forked kernels and a pool that is filled one kernel at a time.

    python docs/pool.py [arguments of Voila]

If all kernels started at once, the first visitor would wait for all of them. If a page is requested
before the pool has begun to start a kernel for it, the page gets its own kernel, and the pool
pauses for Voila's `fill_delay`, so that the page can load.
"""

from __future__ import annotations

import asyncio
import sys
import time
from typing import Any

import kernels
from voila import app
from voila.voila_kernel_manager import voila_kernel_manager_factory


def one_by_one(*arguments: Any, **options: Any) -> type:
    """Return Voila's kernel manager with a pool that is filled one kernel at a time."""
    base: Any = voila_kernel_manager_factory(*arguments, **options)

    class Manager(base):  # type: ignore[misc]
        def __init__(self, **options: Any) -> None:
            self._turn, self._begun, self._resume = asyncio.Lock(), set[str](), 0.0
            super().__init__(**options)

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
    app.main(sys.argv[1:])
