"""Loops that are compiled at first use, where the work is large enough to pay for the compiler.

A kernel is a plain function over numbers and arrays that checks nothing and reads no global except
modules and other kernels. ``kernel(...)`` runs it as Python; ``kernel.run(steps, ...)`` runs it as
machine code if it has many steps. Both return the same result.
"""

from __future__ import annotations

import functools
import hashlib
import inspect
import os
import pickle
import sys
import warnings
from collections.abc import Callable
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from pkgutil import resolve_name
from textwrap import dedent
from types import FunctionType
from typing import Any, Generic, NamedTuple, ParamSpec, TypeVar

from shipnet.errors import ArgumentError

P = ParamSpec("P")
R = TypeVar("R")

#: Steps from which a kernel runs as machine code. As Python, 20 000 steps take 10 to 50 ms; loading
#: the compiler takes a second, once per process.
MANY = 20_000

#: Steps that take minutes as Python.
_ENDLESS = 50_000_000

#: All kernels by module and name.
KERNELS: dict[str, Kernel[..., Any]] = {}


class Kernel(Generic[P, R]):
    """A plain function and its compiled form."""

    def __init__(self, plain: Callable[P, R]) -> None:
        functools.update_wrapper(self, plain)
        self.plain: Any = plain
        KERNELS[f"{plain.__module__}.{plain.__qualname__}"] = self

    def __call__(self, *arguments: P.args, **options: P.kwargs) -> R:
        """Run the function as Python."""
        result: R = self.plain(*arguments, **options)
        return result

    def run(self, steps: float, *arguments: P.args, **options: P.kwargs) -> R:
        """Run the function, compiled if its innermost loop has `MANY` or more steps in all."""
        if steps < MANY or os.environ.get("SHIPNET_COMPILED") == "0":
            return self(*arguments, **options)
        try:
            fast = self.fast
        except ImportError:
            if steps >= _ENDLESS:
                warnings.warn(
                    f"numba is not installed, so {self.plain.__name__} runs as Python and takes "
                    "minutes; install it with: python -m pip install numba",
                    RuntimeWarning,
                    stacklevel=2,
                )
            return self(*arguments, **options)
        result: R = fast(*arguments, **options)
        return result

    @functools.cached_property
    def parts(self) -> dict[str, Kernel[..., Any]]:
        """The kernels that this one calls, by the names that it uses."""
        scope, names = self.plain.__globals__, self.plain.__code__.co_names
        return {name: scope[name] for name in names if isinstance(scope.get(name), Kernel)}

    @functools.cached_property
    def fast(self) -> Callable[P, R]:
        """The compiled form, from the cache if its sources are unchanged."""
        numba: Any = import_module("numba")
        scope = self.plain.__globals__ | {name: part.fast for name, part in self.parts.items()}
        function = FunctionType(self.plain.__code__, scope, self.plain.__name__)
        function.__module__, function.__qualname__ = self.plain.__module__, self.plain.__qualname__
        dispatcher = numba.njit(function, error_model="numpy")
        dispatcher._cache = _Cache(self)
        fast: Callable[P, R] = dispatcher
        return fast

    def _files(self) -> set[str]:
        file = {self.plain.__code__.co_filename}
        return file.union(*(part._files() for part in self.parts.values()))

    def _folder(self) -> Path:
        """Return a folder for these sources, in the virtual environment or that of the user."""
        sources = b"".join(Path(file).read_bytes() for file in sorted(self._files()))
        in_environment = sys.prefix != sys.base_prefix and os.access(sys.prefix, os.W_OK)
        base = Path(sys.prefix) if in_environment else Path.home() / ".cache" / "shipnet"
        return base / "kernels" / hashlib.sha256(sources).hexdigest()[:16]


class _Cache(NamedTuple):
    """The compiled forms of a kernel in files, one per signature, which numba loads and saves.

    The first line of a file is a check sum. A file that is damaged, or cannot be read or written,
    costs only the time of the compiler.
    """

    kernel: Kernel[..., Any]

    def load_overload(self, signature: Any, context: Any) -> Any:
        """Return the compiled form for a signature; None if there is none."""
        context.refresh()
        with suppress(Exception):
            content = self._file(signature, context.codegen()).read_bytes()
            check_sum, _, form = content.partition(b"\n")
            if check_sum == hashlib.sha256(form).hexdigest().encode():
                compiler = import_module("numba.core.compiler")
                return compiler.CompileResult._rebuild(context, *pickle.loads(form))
        return None

    def save_overload(self, signature: Any, result: Any) -> None:
        """Save the compiled form for a signature, if it contains no address."""
        with suppress(Exception):
            if not result.library.has_dynamic_globals:
                form = import_module("numba.core.caching").dumps(result._reduce())
                file = self._file(signature, result.codegen)
                file.parent.mkdir(parents=True, exist_ok=True)
                file.write_bytes(hashlib.sha256(form).hexdigest().encode() + b"\n" + form)

    def _file(self, signature: Any, codegen: Any) -> Path:
        plain, numba = self.kernel.plain, import_module("numba")
        key = (sys.version, numba.__version__, codegen.magic_tuple(), plain.__module__, signature)
        name = f"{plain.__name__}-{hashlib.sha256(repr(key).encode()).hexdigest()[:16]}.kernel"
        return self.kernel._folder() / name


def compiled(plain: Callable[P, R]) -> Kernel[P, R]:
    """Make a plain function a kernel."""
    return Kernel(plain)


class Code:
    """The source of a function, for display in a notebook.

    Parameters
    ----------
    function : callable or str
        A function, method, property or class of Python, or the full name of one, such as
        ``"shipnet.can.bus.send"``.

    Raises
    ------
    ArgumentError
        If no such function has a source in Python.

    Examples
    --------
    >>> Code("shipnet.asi.modulation.ramp")  # doctest: +ELLIPSIS
    def ramp(x: npt.ArrayLike) -> Floats:
        ...
    """

    def __init__(self, function: Callable[..., Any] | str) -> None:
        try:
            resolved: Any = resolve_name(function) if isinstance(function, str) else function
            resolved = resolved.fget if isinstance(resolved, property) else resolved
            self._text = dedent(inspect.getsource(inspect.unwrap(resolved))).rstrip()
        except (AttributeError, ImportError, OSError, TypeError, ValueError):
            raise ArgumentError(
                f"function is {function!r}; it must be a function of Python or its full name"
            ) from None

    def __repr__(self) -> str:
        return self._text

    def _repr_markdown_(self) -> str:
        return f"```python\n{self._text}\n```"
