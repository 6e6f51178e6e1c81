"""What the views of all tools share: a figure as a picture, and coloured text."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from html import escape
from io import BytesIO

import ipywidgets as widgets
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from shipnet import style

__all__ = ["BAD", "GOOD", "Board", "coloured", "follow", "picture"]

#: Colours of a verdict.
GOOD, BAD = "#1a7f4b", style.LIMIT["color"]


def picture(draw: Callable[[Axes], object], width: float, height: float) -> bytes:
    """Return what `draw` puts on axes as a picture.

    Parameters
    ----------
    draw : callable
        Takes the axes.
    width, height : float
        Size of the figure [inch].

    Returns
    -------
    bytes
        A PNG file.

    Examples
    --------
    >>> picture(lambda ax: ax.plot([0, 1]), 2, 1)[1:4]
    b'PNG'
    """
    figure = Figure(figsize=(width, height), layout="constrained")
    draw(figure.subplots())
    file = BytesIO()
    figure.savefig(file, format="png", dpi=100)
    return file.getvalue()


def coloured(text: str, colour: str) -> str:
    """Return text in bold and colour; line breaks are kept.

    Parameters
    ----------
    text : str
        Text, not HTML.
    colour : str
        A colour that browsers know.

    Returns
    -------
    str
        HTML.

    Examples
    --------
    >>> coloured("1 < 2", GOOD)
    '<b style="color: #1a7f4b">1 &lt; 2</b>'
    """
    return f'<b style="color: {colour}">{escape(text).replace(chr(10), "<br>")}</b>'


class Board:
    """Where a tool writes its verdict and draws its figure.

    Attributes
    ----------
    parts : tuple of ipywidgets.Widget
        The text, and the picture below it.

    Examples
    --------
    >>> board = Board()
    >>> board.show("in time", GOOD, {"load": "12 %"}, lambda ax: ax.plot([0, 1]), 2)
    >>> text, image = board.parts
    >>> text.value
    '<b style="color: #1a7f4b">in time</b><br>load: 12 %'
    """

    def __init__(self) -> None:
        self._text, self._image = widgets.HTML(), widgets.Image(format="png")
        self.parts = (self._text, self._image)

    def say(self, text: str, colour: str, numbers: Mapping[str, str] | None = None) -> None:
        """Write a coloured verdict, and numbers below it; the picture stays."""
        facts = (f"{name}: {number}" for name, number in (numbers or {}).items())
        self._text.value = "<br>".join([coloured(text, colour), *facts])

    def show(
        self,
        text: str,
        colour: str,
        numbers: Mapping[str, str],
        draw: Callable[[Axes], object],
        height: float,
    ) -> None:
        """Write the verdict and draw a figure of this height [inch]."""
        self.say(text, colour, numbers)
        self._image.value = picture(draw, 7.5, height)


def follow(show: Callable[[], None], controls: Iterable[widgets.Widget]) -> None:
    """Call a function now, and again whenever a control changes its value.

    Parameters
    ----------
    show : callable
        Takes nothing.
    controls : iterable of ipywidgets.Widget
        What to watch.

    Examples
    --------
    >>> slider, seen = widgets.IntSlider(1), []
    >>> follow(lambda: seen.append(slider.value), [slider])
    >>> slider.value = 5
    >>> seen
    [1, 5]
    """
    for control in controls:
        control.observe(lambda _: show(), "value")
    show()
