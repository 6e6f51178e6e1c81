"""Step by step: what moves, as frames to leaf through, and as one picture with some of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache

import ipywidgets as widgets
from matplotlib.axes import Axes

from shipnet.errors import ArgumentError
from shipnet.fields import check_whole
from shipnet.tools._view import picture

#: Draws frame k, counted from 0, on axes.
Draw = Callable[[int, Axes], object]

#: Frames that one stepper leafs through.
_MOST = 1000


def draw_steps(draw: Draw, steps: Sequence[int], axes: Sequence[Axes]) -> None:
    """Draw some frames side by side: the static picture before a stepper.

    Parameters
    ----------
    draw : callable
        Takes the number of a frame, from 0, and axes.
    steps : sequence of int
        Which frames.
    axes : sequence of matplotlib.axes.Axes
        Where to draw each.

    Raises
    ------
    ArgumentError
        If there are not as many axes as frames.

    Examples
    --------
    >>> from matplotlib.figure import Figure
    >>> axes = Figure().subplots(2)
    >>> draw_steps(lambda k, ax: ax.set_title(f"frame {k}"), [0, 5], axes)
    >>> axes[1].get_title()
    'frame 5'
    """
    if len(steps) != len(axes):
        raise ArgumentError(f"there are {len(axes)} axes for {len(steps)} steps")
    for step, ax in zip(steps, axes, strict=True):
        draw(step, ax)


def stepper(
    draw: Draw, captions: Sequence[str], *, width: float = 7.5, height: float = 3.2
) -> widgets.VBox:
    """Return a slider with a button back and a button on, over prepared frames.

    Parameters
    ----------
    draw : callable
        Takes the number of a frame, from 0, and axes. A frame is drawn once, when it is first
        looked at.
    captions : sequence of str
        A sentence for each frame, plain text; as many as there are frames, 1 to 1000.
    width, height : float
        Size of a frame [inch].

    Returns
    -------
    ipywidgets.VBox
        To be shown as the last value of a notebook's cell.

    Raises
    ------
    ArgumentError
        If there is no frame, or there are more than 1000.

    Examples
    --------
    >>> view = stepper(lambda k, ax: ax.plot([0, k]), ["flat", "steep", "steeper"])
    >>> controls, caption, image = view.children
    >>> back, slider, on = controls.children
    >>> on.click()
    >>> slider.value, caption.value, back.disabled
    (1, 'steep', False)
    """
    check_whole("number of captions", len(captions), 1, _MOST)
    last = len(captions) - 1
    slider = widgets.IntSlider(0, 0, last, description="step", layout={"width": "26em"})
    back = widgets.Button(description="back", icon="arrow-left")
    on = widgets.Button(description="next", icon="arrow-right")
    caption, image = widgets.Label(), widgets.Image(format="png")
    frame = cache(lambda step: picture(lambda ax: draw(step, ax), width, height))

    def show() -> None:
        step = slider.value
        caption.value, image.value = captions[step], frame(step)
        back.disabled, on.disabled = step == 0, step == last

    def move(by: int) -> None:
        slider.value = min(last, max(0, slider.value + by))

    back.on_click(lambda _: move(-1))
    on.on_click(lambda _: move(1))
    slider.observe(lambda _: show(), "value")
    show()
    return widgets.VBox([widgets.HBox([back, slider, on]), caption, image])
