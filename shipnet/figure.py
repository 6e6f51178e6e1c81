"""Figures in the style of `shipnet`, whatever rcParams are set."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.resources import as_file, files
from io import StringIO
from typing import Any

from matplotlib import rc_context, rcParams, style
from matplotlib.axes import Axes
from matplotlib.figure import Figure


@contextmanager
def house() -> Iterator[None]:
    """Draw in the style of `shipnet`; the set fonts supply letters that its own font lacks."""
    fonts = {key: rcParams[key] for key in ("font.family", "font.sans-serif")}
    fonts["font.family"] = ["DejaVu Sans", *fonts["font.family"]]
    with as_file(files("shipnet") / "shipnet.mplstyle") as sheet:
        with style.context(["default", sheet, fonts]):
            yield


class HouseFigure(Figure):
    """A figure in the style of `shipnet`, also for what matplotlib settles only while it draws."""

    def draw(self, renderer: Any) -> None:
        """Draw the figure."""
        with house():
            super().draw(renderer)

    def savefig(self, *args: Any, **options: Any) -> None:
        """Save the figure to a file."""
        with house():
            super().savefig(*args, **options)


def svg(draw: Callable[[Axes], object], *, width: float = 6.4, height: float = 3.2) -> str:
    """Return a drawing as SVG; the same drawing always gives the same bytes."""
    with house(), rc_context({"svg.hashsalt": "shipnet"}):
        figure = Figure(figsize=(width, height))
        draw(figure.add_subplot())
        stream = StringIO()
        figure.savefig(stream, format="svg", metadata={"Date": None, "Creator": None})
    return stream.getvalue()
