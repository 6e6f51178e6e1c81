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
    """A button.

    Attributes
    ----------
    label, help : str
        What stands on it, and one sentence on what it does.
    act : callable
        Takes the inputs and returns them changed, or None to compute once more.
    """

    label: str
    help: str
    act: Callable[[Any], Any]


@dataclass(frozen=True)
class Upload:
    """A button that takes a file of the user's.

    Attributes
    ----------
    label, help : str
        As for `Button`.
    accept : str
        Endings of the names, as ``".csv,.txt"``.
    take : callable
        Takes the inputs, the name and the content of the file, and returns the inputs changed.
        Its ArgumentError or InputError becomes a sentence in the page, and nothing changes.
    """

    label: str
    help: str
    accept: str
    take: Callable[[Any, str, bytes], Any]


@dataclass(frozen=True)
class Preset:
    """Controls that set the others.

    Attributes
    ----------
    start : object
        Inputs of their own, made as those of the tool.
    make : callable
        Takes them and the inputs of the tool, and returns new inputs of the tool.
    """

    start: Any
    make: Callable[[Any, Any], Any]
