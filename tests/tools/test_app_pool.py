"""The pool of kernels of the interactive tools is filled one kernel at a time."""

import asyncio

import pytest

from docs import pool

BOOKS = ["a.ipynb", "b.ipynb", "c.ipynb"]


class Base:
    """The parts of Voila's manager that the pool uses; a test ends the rendering of a notebook."""

    fill_delay = 0.01

    def __init__(self):
        self.pools, self.done, self.started = {}, {}, []
        for name in BOOKS:
            self.fill_if_needed(delay=0, notebook_name=name)

    def fill_if_needed(self, delay=None, *, notebook_name):
        self.pools[notebook_name] = [asyncio.ensure_future(self._initialize(notebook_name))]

    def get_pool_size(self, name):
        return len(self.pools[name])

    async def _initialize(self, name):
        self.started.append(name)
        if name == "b.ipynb":
            raise RuntimeError("no port is free")
        self.done[name] = asyncio.get_running_loop().create_future()
        return {"task": self.done[name]}


@pytest.fixture
def manager(monkeypatch):
    monkeypatch.setattr(pool, "voila_kernel_manager_factory", lambda *_, **__: Base)
    return pool.one_by_one()


def test_the_pool_is_filled_one_by_one_and_a_page_never_waits_for_its_turn(manager):
    async def fill():
        made = manager()
        await asyncio.sleep(0)
        assert made.started == ["a.ipynb"]
        assert [made.get_pool_size(name) for name in BOOKS] == [1, 0, 0]
        made.done["a.ipynb"].set_result(None)
        # A kernel that cannot start does not block others.
        await asyncio.wait([task for (task,) in made.pools.values()])
        assert made.started == BOOKS
        assert isinstance(made.pools["b.ipynb"][0].exception(), RuntimeError)
        # A kernel in use is replaced last.
        made.fill_if_needed(notebook_name="a.ipynb")
        await asyncio.sleep(0)
        assert made.get_pool_size("a.ipynb") == 0 and made.started == BOOKS
        made.pools["a.ipynb"][0].cancel()

    asyncio.run(fill())
