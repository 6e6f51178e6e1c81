"""What all tools have in common: inputs as declared fields, what follows from them, and a page."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from shipnet.tools._page import Page
    from shipnet.tools._view import View


class Tool:
    """Base of the tools; a tool is a record whose fields are its controls."""

    @property
    def verdict(self) -> str:
        """The answer in one line."""
        return self._view().text

    @property
    def ok(self) -> bool:
        """Whether the answer is good."""
        return self._view().good

    @property
    def numbers(self) -> dict[str, str]:
        """The numbers behind the answer, as text with units."""
        return dict(self._view().numbers)

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the tool's figure."""
        raise NotImplementedError

    def explore(self) -> Page:
        """Return the page with a control for each field, for the last line of a notebook's cell."""
        from shipnet.tools._page import Page

        name = type(self).__module__.rpartition(".")[2]
        return Page(name, self, lambda inputs: inputs._view(), **self._options())

    def _view(self) -> View:
        """Return what the page shows."""
        raise NotImplementedError

    def _options(self) -> dict[str, Any]:
        """Return what the page has beside controls and figure."""
        return {}


@dataclass(frozen=True)
class Button:
    """A button."""

    label: str
    help: str
    act: Callable[[Any], Any]


@dataclass(frozen=True)
class Upload:
    """A button that takes a file of the user's."""

    label: str
    help: str
    accept: str
    take: Callable[[Any, str, bytes], Any]


@dataclass(frozen=True)
class Preset:
    """Controls that set the others."""

    start: Any
    make: Callable[[Any, Any], Any]
