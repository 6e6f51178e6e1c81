"""The style of all figures and tables.

Theory is drawn as a line, data as markers, a value printed in a paper as a dashed grey line, and a
limit as a dashed red line with its name.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import wraps
from importlib.resources import as_file, files
from typing import Any, ParamSpec, TypeVar

from shipnet.lazy import Axes, pd

__all__ = ["FIELD", "LIMIT", "PAPER", "axes", "bare", "box", "use"]
__dir__ = __all__.copy

_P = ParamSpec("_P")
_R = TypeVar("_R")

PAPER = {"color": "0.45", "linestyle": "--"}
LIMIT = {"color": "#c0392b", "linestyle": "--"}

# Okabe-Ito colours, lightened for black text; colour-blind readers can distinguish them too.
FIELD = {
    "frame": "#d9d9d9",
    "control": "#cc9fc0",
    "address": "#8cc4e8",
    "information": "#f5c56b",
    "parity": "#7fcfb4",
    "pause": "#ffffff",
}


def use() -> None:
    """Apply the style of `shipnet` to all later figures and tables, whatever draws them.

    Figures that `shipnet` draws have its style without this. Tables show cells in full; a
    notebook's figures have twice the resolution, for a projector.

    Examples
    --------
    >>> import matplotlib.pyplot as plt
    >>> use()
    >>> plt.rcParams["figure.figsize"]
    [6.4, 3.2]
    """
    import matplotlib.pyplot as plt

    pd.set_option("display.max_colwidth", None, "display.max_rows", 200)
    with as_file(files("shipnet") / "shipnet.mplstyle") as sheet:
        plt.style.use(sheet)
    # Without an IPython shell, the function below would create one.
    if "IPython" in sys.modules and sys.modules["IPython"].get_ipython():
        from matplotlib_inline.backend_inline import set_matplotlib_formats

        set_matplotlib_formats("retina")  # type: ignore[no-untyped-call]


def applied(plot: Callable[_P, _R]) -> Callable[_P, _R]:
    """Let a function draw in the style of `shipnet`; axes that it is given keep their own style."""

    @wraps(plot)
    def draw(*args: _P.args, **options: _P.kwargs) -> _R:
        from matplotlib.axes import Axes

        from shipnet.figure import house

        if any(isinstance(argument, Axes) for argument in (*args, *options.values())):
            return plot(*args, **options)
        with house():
            return plot(*args, **options)

    return draw


def axes(ax: Axes | None = None, **options: Any) -> Axes:
    """Return `ax`, or the axes of a new figure; `options` are those of `pyplot.subplots`."""
    if ax is None:
        import matplotlib.pyplot as plt

        from shipnet.figure import HouseFigure

        _, ax = plt.subplots(FigureClass=HouseFigure, layout="constrained", **options)
    return ax


def sign(unit: str) -> str:
    """Return a unit as figures write it; code and files write it in ASCII."""
    return {"us": "µs", "degC": "°C", "ohm": "Ω", "kg/cm2": "kg/cm²"}.get(unit, unit)


def literal(text: object) -> str:
    """Return text that may come from a file for a figure, where dollar signs mark no formula."""
    return str(text).replace("$", r"\$")


def size(names: int) -> tuple[float, float]:
    """Return the size of a figure with a number of names on its y axis [inch]."""
    import matplotlib as mpl

    width, height = mpl.rcParams["figure.figsize"]
    return width, max(height, 1 + 1.4 * mpl.rcParams["font.size"] / 72 * names)


def limit(ax: Axes, level: float, name: str) -> None:
    """Draw a limit as a horizontal line with its name to the right of the axes."""
    ax.axhline(level, color=LIMIT["color"], linestyle=LIMIT["linestyle"])
    beside = ax.get_yaxis_transform()
    ax.text(1.01, level, literal(name), transform=beside, color=LIMIT["color"], va="center")


def moment(ax: Axes, x: float, name: str) -> None:
    """Draw a limit as a vertical line with its name at the top."""
    ax.axvline(x, color=LIMIT["color"], linestyle=LIMIT["linestyle"])
    top = ax.get_xaxis_transform()
    ax.text(x, 0.98, f" {literal(name)}", transform=top, color=LIMIT["color"], va="top")


def legend(ax: Axes, columns: int = 4, **options: Any) -> None:
    """Draw the legend above the axes; `options` are those of `Axes.legend`."""
    above: dict[str, Any] = {"loc": "lower center", "bbox_to_anchor": (0.5, 1.0)}
    ax.legend(**above, ncols=columns, **options)


def logarithmic(axis: Any) -> None:
    """Make an axis logarithmic, with ticks at 1, 2 and 5 times each power of ten."""
    from matplotlib.ticker import LogLocator, NullLocator

    axis.axes.set(**{f"{axis.axis_name}scale": "log"})
    axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axis.set_major_formatter("{x:g}")
    axis.set_minor_locator(NullLocator())


def box(
    ax: Axes, x: float, y: float, width: float, height: float, text: str = "", **look: Any
) -> None:
    """Draw a rectangle with its lower left corner at (x, y) and text in its centre."""
    from matplotlib.patches import Rectangle

    ax.add_patch(Rectangle((x, y), width, height, **look))
    if text:
        middle = (x + width / 2, y + height / 2)
        ax.text(*middle, literal(text), ha="center", va="center", zorder=3)


def bare(ax: Axes, x: tuple[float, float], y: tuple[float, float]) -> Axes:
    """Set the limits of axes and hide their ticks, grid and frame."""
    ax.set(xlim=x, ylim=y, xticks=[], yticks=[])
    ax.grid(visible=False)
    ax.spines[:].set_visible(False)
    return ax


def save(draw: Callable[[Axes], object], file: str) -> None:
    """Save a figure in the style of `shipnet`; `draw` is called with the axes to draw on."""
    from matplotlib.figure import Figure

    from shipnet.figure import house

    with house():
        figure = Figure(figsize=(10, 3.2))
        ax = figure.subplots()
        draw(ax)
        figure.set_figheight(size(len(ax.get_yticks()))[1])
        figure.savefig(file, dpi=150)
