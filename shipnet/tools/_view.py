"""What the views of all tools share: a figure as a picture, and coloured text."""

from __future__ import annotations

from collections.abc import Callable
from html import escape
from io import BytesIO

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from shipnet import style

__all__ = ["BAD", "GOOD", "coloured", "picture"]

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
