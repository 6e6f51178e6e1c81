"""Draw each figure of a notebook a second time, narrow enough to be read on a phone.

`docs/notebooks.py run` runs this file in each kernel. A figure's narrow form is an output of its
own, without a height, directly before the figure; docs/_ext/captions.py relies on both.
"""

from __future__ import annotations

import warnings
from contextlib import ExitStack, suppress
from itertools import combinations, product
from typing import Any
from unittest.mock import patch

from IPython.core import pylabtools
from IPython.display import display
from matplotlib.collections import PathCollection
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.text import Text

#: Width of a narrow form [inch]: on a phone of 390 CSS pixels, text of 10 pt then has 11 pixels.
WIDTH = 4.3
#: Distance of two texts that is enough, and how much may be lost by rounding [pixel].
GAP, SLACK = 6, 2
#: The left, lower, right and upper edges of each text and box of a figure [pixel].
Edges = dict[Any, tuple[float, float, float, float]]

_retina_figure = pylabtools.retina_figure


def show_both(figure: Figure, **options: Any) -> Any:
    """Return a figure as IPython's `retina_figure` does; show its narrow form first, if any."""
    wide, before = drawn(figure, **options)
    width, height = figure.get_size_inches()
    if width > WIDTH and wide:
        figure.set_size_inches(WIDTH, height * (width / WIDTH) ** 0.25)
        # The layout warns of axes without room.
        with suppress(UserWarning), warnings.catch_warnings(action="error", category=UserWarning):
            (png, size), after = drawn(figure, pad_inches=0.03, **options)
            # The picture is wider than the figure if a text leaves it.
            if size["width"] <= WIDTH * figure.dpi + SLACK and legible(figure, before, after):
                shown = {"image/png": {"width": size["width"]}}
                display({"image/png": png}, raw=True, metadata=shown)
        figure.set_size_inches(width, height)
    return wide


def drawn(figure: Figure, **options: Any) -> tuple[Any, Edges]:
    """Draw a figure; return its picture, and where its texts and boxes are."""
    edges: Edges = {}

    def recording(draw: Any) -> Any:
        def record(artist: Any, renderer: Any) -> None:
            draw(artist, renderer)
            if artist.get_visible():
                edges[artist] = artist.get_window_extent(renderer).extents.tolist()

        return record

    with ExitStack() as patches:
        for kind in (Text, Patch):
            patches.enter_context(patch.object(kind, "draw", recording(kind.draw)))
        return _retina_figure(figure, **options), edges


def legible(figure: Figure, wide: Edges, narrow: Edges) -> bool:
    """Whether each text is as far from other texts, and within its box, as in the wide form."""
    # Text drawn as outlines, as on an alarm screen, has no edges here.
    if any(len(outlines.get_paths()) > 1 for outlines in figure.findobj(PathCollection)):
        return False
    texts = [one for one in narrow if isinstance(one, Text) and one.get_text().strip()]
    boxes = [one for one in narrow if isinstance(one, Patch) and one in wide]

    def gap(form: Edges, *pair: Text) -> float:
        if not form.keys() >= {*pair}:
            return GAP
        (left, low, right, high), (x0, y0, x1, y1) = (form[one] for one in pair)
        return max(left - x1, x0 - right, low - y1, y0 - high)

    def margin(form: Edges, text: Text, box: Patch) -> float:
        (left, low, right, high), (x0, y0, x1, y1) = form[box], form[text]
        return min(x0 - left, right - x1, y0 - low, high - y1)

    return all(
        gap(narrow, *pair) >= min(GAP, gap(wide, *pair)) - SLACK for pair in combinations(texts, 2)
    ) and all(
        margin(narrow, text, box) >= -SLACK
        for text, box in product(texts, boxes)
        if text in wide and margin(wide, text, box) >= 0
    )


pylabtools.retina_figure = show_both
