"""Libraries that only some users need, loaded when they are."""

from __future__ import annotations

from importlib import import_module
from typing import Any

__all__ = ["load_extra"]

#: Name of the package to install, by the name of its module.
_PACKAGES = {"can": "python-can", "cantools": "cantools"}


def load_extra(module: str) -> Any:
    """Return an optional module, or say how to install it.

    Parameters
    ----------
    module : {"can", "cantools"}
        Name of the module.

    Returns
    -------
    module
        The module.

    Raises
    ------
    ImportError
        If it is not installed; the message holds the command that installs it.

    Examples
    --------
    >>> try:
    ...     name = load_extra("can").__name__
    ... except ImportError as problem:
    ...     name = str(problem).partition(" is ")[0]
    >>> name in ("can", "python-can")
    True
    """
    try:
        return import_module(module)
    except ModuleNotFoundError as problem:
        if problem.name != module:
            raise
        raise ImportError(
            f"{_PACKAGES[module]} is not installed; this installs it: "
            'python -m pip install "shipnet[bus]"'
        ) from None
