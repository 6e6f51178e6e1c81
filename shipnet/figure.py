"""Figures in the style of `shipnet`, whatever rcParams are set."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.resources import as_file, files
from io import BytesIO, StringIO
from typing import Any

import numpy as np
from matplotlib import rc_context, rcParams, style
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from PIL import Image

from shipnet.errors import ArgumentError

#: Without these, an SVG file does not change from one run to the next.
_TIMELESS: Any = {"Date": None, "Creator": None}


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
        figure.savefig(stream, format="svg", metadata=_TIMELESS)
    return stream.getvalue()


#: Height of a small figure [inch], and the maximum number of its bytes.
_HEIGHT, _MOST_BYTES = 2.6, 30_000


def small(draw: Callable[[Axes], object]) -> tuple[str, bytes]:
    """Return a small figure as SVG or, if that has too many bytes, as PNG, with its media type.

    The same drawing always gives the same bytes. A figure too large in either form is refused.
    """
    with house(), rc_context({"svg.hashsalt": "shipnet", "svg.fonttype": "none"}):
        figure = Figure()
        ax = figure.subplots()
        draw(ax)
        figure.set_figheight(max(_HEIGHT, 0.8 + 0.175 * len(ax.get_yticks())))
        canvas: Any = FigureCanvasSVG(figure)
        file = BytesIO()
        canvas.print_svg(file, metadata=_TIMELESS)  # `savefig` would draw twice
        if file.tell() <= _MOST_BYTES:
            return "image/svg+xml", file.getvalue()
        figure.set_layout_engine("none")  # the layout stays as it is
        figure.set_dpi(120)
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        file = BytesIO()
        image = Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3])
        image.quantize(32).save(file, "png", optimize=True)
    if file.tell() > _MOST_BYTES:
        raise ArgumentError(f"its {file.tell()} bytes need a larger figure")
    return "image/png", file.getvalue()
