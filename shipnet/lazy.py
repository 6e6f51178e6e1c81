"""Pandas, loaded when it is first used: it takes half a second, and most programs do without.

``Axes`` is the class of matplotlib for annotations only; it stands for any object at run time.
"""

from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any

__all__ = ["Axes", "pd"]


class _Module(ModuleType):
    """A module that is imported when a name in it is asked for."""

    def __getattr__(self, name: str) -> Any:
        return getattr(import_module(self.__name__), name)


if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
else:
    pd, Axes = _Module("pandas"), Any
