"""Slow libraries, imported on first use: pandas takes half a second, matplotlib more."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
else:

    class _Library:
        """A library that is imported when one of its names is used."""

        def __init__(self, name: str) -> None:
            self._name = name

        def __getattr__(self, name: str) -> Any:
            return getattr(import_module(self._name), name)

    pd = _Library("pandas")
    Axes = Any  # a name for annotations

__all__ = ["Axes", "pd"]
