"""Libraries that load when they are used first: importing pandas takes half a second."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pandas as pd
else:

    class _Library:
        """A library whose names are looked up in it, which imports it."""

        def __init__(self, name: str) -> None:
            self._name = name

        def __getattr__(self, name: str) -> Any:
            return getattr(import_module(self._name), name)

    pd = _Library("pandas")

__all__ = ["pd"]
