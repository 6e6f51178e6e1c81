"""Drawing of designs in the ship: a cable or device that is clicked fails, and its points light up.

A drawing is HTML without scripts, the same in a notebook, in the tool and in the report: a part
that is clicked has the focus, and the style sheet shows what a focused part loses.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from html import escape
from importlib.resources import files
from os import PathLike
from pathlib import Path
from typing import NamedTuple

import numpy as np

from shipnet.design.drawing import values
from shipnet.design.layout import Layout
from shipnet.lazy import pd

#: Width, margin, height of a line of text, and distance between the views [px].
_WIDTH, _MARGIN, _LINE, _GAP = 520, 12, 14, 12

#: Least height of a view [px]; if it is flatter, breadth and height are drawn up to 3 times larger.
_LOW, _MOST = 60, 3

#: Largest height of a view [px].
_HIGH = 160

#: Distance between the two cables of a doubled line [px].
_SHIFT = 3

#: Colour of each option, after those of Okabe and Ito, with or without a second line.
_COLOURS = {
    "home runs": "#555555",
    "junction boxes": "#8A6D00",
    "AS-i": "#009E73",
    "CAN": "#0072B2",
    "Modbus RTU": "#CC79A7",
}
_OTHER = "#56B4E9"

#: What happens to a cable or device that fails.
_FAILS = {"cut": "is cut", "device": "fails"}

_HINT = "Click a cable or a device: it fails, and the points lost light up."


class ShipDrawing(NamedTuple):
    """A side view and a plan view of one or more designs, as HTML that a notebook displays."""

    html: str

    def __repr__(self) -> str:
        return f"<ShipDrawing: {self.html.count('<figure')} designs, {len(self.html) / 1e3:.0f} kB>"

    def _repr_html_(self) -> str:
        return self.html

    def save(self, path: str | PathLike[str]) -> None:
        """Write the drawing as a page that every browser opens."""
        page = f'<!DOCTYPE html>\n<meta charset="utf-8">\n{self.html}'
        Path(path).write_text(page, encoding="utf-8")


def draw(designs: Mapping[str, tuple[Layout, pd.DataFrame, str]]) -> ShipDrawing:
    """Return the drawing of designs, given with their single failures and notes."""
    style = (files("shipnet.design") / "ship.css").read_text(encoding="utf-8")
    figures = (
        f"<figure><figcaption><strong>{escape(name)}</strong> {escape(words)}</figcaption>"
        f"{_svg(design, failures)}</figure>"
        for name, (design, failures, words) in designs.items()
    )
    lines = [f'<div class="shipnet-ship"><style>{style}</style><p>{_HINT}</p>', *figures, "</div>"]
    return ShipDrawing("\n".join(lines))


def note(design: Layout, failures: pd.DataFrame) -> str:
    """Return what the worst single failure of a design loses, in words."""
    failures = failures[failures["kind"] != "cabinet"]
    lost = int(failures["points_lost"].max()) if len(failures) else 0
    missing = int((~design.points["fits"]).sum())
    words = [f"one failure loses at most {lost} of {len(design.points)} points"]
    if missing:
        words.append(f"points that do not fit: {missing}")
    if without := int((~design.iolist.located).sum()):
        words.append(f"points without a position ({without}) are not drawn")
    return "; ".join(words)


class _Views:
    """Side view and plan view, the side view on top [px]; what has no position is left out."""

    def __init__(self, positions: pd.DataFrame) -> None:
        positions = positions.dropna()
        span = np.maximum(positions.max() - positions.min(), 1.0)
        across = float(span[["y_m", "z_m"]].max())
        self.scale = min((_WIDTH - 2 * _MARGIN) / float(span["x_m"]), _HIGH / across)
        flat = self.scale * across
        self.stretch = int(np.clip(np.ceil(_LOW / flat), 1, _MOST))
        x, y, z = (self.scale * (positions - positions.min())).to_numpy().T
        wide, high = (float(self.stretch * self.scale * span[axis]) for axis in ("y_m", "z_m"))
        self.top = 2.5 * _LINE
        self.below = self.top + high + _GAP + _LINE
        self.height = self.below + wide + _GAP + _LINE
        side, plan = self.top + high - self.stretch * z, self.below + wide - self.stretch * y
        places = np.stack([_MARGIN + x, side, plan], axis=1).round(1).tolist()
        self._at = dict(zip(positions.index, places, strict=True))

    def __contains__(self, name: str) -> bool:
        return name in self._at

    def route(self, a: str, b: str, shift: float) -> str:
        """Return a path from a to b in both views, parallel to the axes."""
        (x, side, plan), (to_x, to_side, to_plan) = self._at[a], self._at[b]
        return "".join(
            f"M{x:g} {start + shift:g}H{to_x + shift:g}V{end:g}"
            for start, end in ((side, to_side), (plan, to_plan))
        )

    def dots(self, names: Iterable[str]) -> str:
        """Return a path with a dot in both views for each name."""
        places = dict.fromkeys(tuple(self._at[name]) for name in names if name in self)
        return "".join(f"M{x:g} {side:g}h0M{x:g} {plan:g}h0" for x, side, plan in places)

    def frame(self) -> Iterator[str]:
        """Yield the names of the views and the scale."""
        step = float(10 ** np.floor(np.log10(0.5 * _WIDTH / self.scale)))
        stretched = f", breadth and height x {self.stretch}" if self.stretch > 1 else ""
        yield _text(_MARGIN, self.top - 8, "side view")
        yield _text(_MARGIN, self.below - 8, "plan view")
        y = self.height - 6
        yield f'<path class="scale" d="M{_MARGIN} {y - 4:g}v4h{step * self.scale:g}v-4"/>'
        yield _text(_MARGIN + step * self.scale + 6, y, f"{step:g} m{stretched}")


def _svg(design: Layout, failures: pd.DataFrame) -> str:
    """Return a design as SVG."""
    devices = design.devices.set_index("device")
    points = design.iolist.points.set_index("tag")[["x_m", "y_m", "z_m"]]
    views = _Views(pd.concat([devices[["x_m", "y_m", "z_m"]], points]))
    option = design.name.removesuffix(" doubled")
    lost = defaultdict[tuple[str, ...], list[str]](list)
    for part, tags in _parts(design, failures, views):
        lost[tags].append(part)
    groups = (
        f'<g class="loss">{"".join(parts)}<path class="lost" d="{views.dots(tags)}"/></g>'
        for tags, parts in sorted(lost.items(), key=lambda item: len(item[0]))
    )
    colour, words = _COLOURS.get(option, _OTHER), f"{design.name}: side view and plan view"
    lines = [
        f'<svg viewBox="0 0 {_WIDTH} {views.height:g}" role="img" aria-label="{escape(words)}" '
        f'style="--option:{colour}">',
        *views.frame(),
        f'<path class="point" d="{views.dots(points.index)}"/>',
        *groups,
        "</svg>",
    ]
    return "\n".join(lines)


def _parts(
    design: Layout, failures: pd.DataFrame, views: _Views
) -> Iterator[tuple[str, tuple[str, ...]]]:
    """Yield each cable and device as SVG, with the tags of the points that its failure loses."""
    tags = failures.set_index(["failure", "failed"])["tags"]

    def part(
        what: str, kind: str, name: str, failure: str, path: str
    ) -> tuple[str, tuple[str, ...]]:
        lost = tags[failure, name]
        words = f"{name} {_FAILS[failure]}: {len(lost)} of {len(design.points)} points lost"
        # Tab would stop at hundreds of cables that lose one point each.
        stop = 0 if len(lost) > 1 else -1
        drawn = f'<path class="hit" d="{path}"/><path d="{path}"/>'
        label = _text(_MARGIN, _LINE - 3, words, "words")
        classes = f"{what} {kind.replace(' ', '-')}"
        return f'<g class="{classes}" tabindex="{stop}">{drawn}{label}</g>', lost

    for name, a, b, kind, line in values(design.cables, "run", "a", "b", "kind", "line"):
        if a in views and b in views:
            shift = _SHIFT if line == "B" else 0
            yield part("cable", kind, name, "cut", views.route(a, b, shift))
    for name, kind in values(design.devices, "device", "kind"):
        yield part("device", kind, name, "device", views.dots([name]))


def _text(x: float, y: float, words: str, kind: str = "") -> str:
    return f'<text class="{kind}" x="{x:g}" y="{y:g}">{escape(words)}</text>'
