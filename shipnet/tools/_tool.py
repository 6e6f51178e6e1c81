"""The base class of all tools: inputs as declared fields, results, and a page."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from shipnet.lazy import Axes
from shipnet.tools._sweep import Sweep, sweep

if TYPE_CHECKING:
    from shipnet.tools._page import Page
    from shipnet.tools._view import View


class Tool:
    """Base class of tools: their fields are a page's controls, and their properties the results."""

    #: The result that the tool computes from its inputs.
    result: Any

    @property
    def verdict(self) -> str:
        """The result in one line."""
        return self._view().verdict

    @property
    def ok(self) -> bool:
        """Whether the result is good."""
        return self._view().ok

    @property
    def numbers(self) -> dict[str, str]:
        """The numbers that support the verdict, as text with units."""
        return dict(self._view().numbers)

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the tool's figure."""
        axes: Axes = self.result.plot(ax=ax)
        return axes

    def sweep(self, field: str, over: Iterable[Any] | None = None) -> Sweep:
        """Return the answer at each value of one field, with all others as they are.

        Parameters
        ----------
        field : str
            Name of a field that is a number, a choice or a switch.
        over : iterable, optional
            Values in order. By default, those of the field's control: of a long slider about 40,
            and those at which the answer changes.

        Returns
        -------
        Sweep
            The answers: their `verdict` in words, `ok`, `table()` and `plot()`. A value that is
            not possible is not `ok`.

        Raises
        ------
        ArgumentError
            If the field cannot be swept, or `over` is empty.

        Examples
        --------
        >>> from shipnet import tools
        >>> tools.ModbusScan().sweep("processing_ms").verdict
        'processing time: in time up to 18 ms; too slow from 19 ms'
        """
        return sweep(self, field, type(self)._view, over)

    def explore(self, story: bool = False) -> Page:
        """Return the page with a control for each field, for display in a notebook.

        With `story`, the page opens on its first example; otherwise, it opens on these inputs.
        """
        # The widgets are an optional dependency, which a verdict does not need.
        from shipnet.tools._page import Page

        return Page(self, story=story, **self._options())

    def _view(self) -> View:
        """Return the view that the page shows."""
        raise NotImplementedError

    def _options(self) -> dict[str, Any]:
        """Return the arguments of `Page` for parts other than controls and figure."""
        return {}
