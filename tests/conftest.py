"""Hypothesis profiles, garbage, kernels that are forks and start again, and figures."""

import gc
import os
import sys
from collections.abc import Iterator
from typing import Any

import kernels
import pandas as pd
import pytest
from hypothesis import settings
from nbval import kernel

# Fewer examples on every push; the weekly run draws many, and new ones.
settings.register_profile("ci", deadline=None, derandomize=True, max_examples=20)
settings.register_profile("random", deadline=None, max_examples=500)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "ci"))

# Strings of small tables as they are without the extra `cluster`, whose pyarrow takes twice as long
# for them. The notebooks have pyarrow's.
pd.set_option("mode.string_storage", "python")


# Ten thousand tests are collected, and stay to the end: none of them is garbage.
gc.disable()


def pytest_collection_finish() -> None:
    """Keep the garbage collector from what was collected."""
    gc.freeze()
    gc.enable()
    gc.set_threshold(50_000, 20, 20)


kernels.fork()
_start = kernel.start_new_kernel


def _start_again(*args: Any, **options: Any) -> Any:
    # A port that was free when the test chose it can be taken when the kernel opens it: by another
    # test's kernel or client. That kernel dies at once, and the next one chooses other ports.
    for _ in range(2):
        try:
            return _start(*args, **options)
        except RuntimeError:
            continue
    return _start(*args, **options)


kernel.start_new_kernel = _start_again


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol() -> Iterator[None]:
    """Close the figures that a test or a doctest leaves open."""
    result = yield
    if "matplotlib.pyplot" in sys.modules:
        sys.modules["matplotlib.pyplot"].close("all")
    return result


@pytest.fixture
def ax() -> Any:
    """Return new axes."""
    import matplotlib.pyplot as plt

    return plt.subplots()[1]
