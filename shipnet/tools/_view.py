"""What a tool has to say: a verdict, a table and numbers below it, and a figure, as HTML."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from html import escape
from io import BytesIO
from typing import TYPE_CHECKING

from matplotlib.axes import Axes
from matplotlib.figure import Figure

if TYPE_CHECKING:
    import pandas as pd


#: Width of a picture [inch], and its resolution [1/inch]; a page shows it at 100 a inch.
_WIDTH, _DPI = 7.5, 150


@dataclass(frozen=True, kw_only=True)
class View:
    """What a tool shows."""

    text: str
    good: bool
    numbers: Mapping[str, str] = field(default_factory=dict)
    draw: Callable[[Axes], object] | None = None
    height: float = 3.6
    table: pd.DataFrame | None = None
    caption: str = ""
    about: str = ""
    files: Mapping[str, str | bytes] = field(default_factory=dict)

    def __str__(self) -> str:
        """Return verdict, table and numbers as lines of text."""
        table = [] if self.table is None else [self.table.to_string(), self.caption]
        numbers = (f"{name}: {said}" for name, said in self.numbers.items())
        return "\n".join([self.text, *filter(None, table), *numbers])

    @property
    def verdict(self) -> str:
        """The verdict, the table and the numbers as HTML."""
        kind = "good" if self.good else "bad"
        said = escape(self.text).replace("\n", "<br>")
        rows = "".join(
            f"<dt>{escape(name)}</dt><dd>{escape(number)}</dd>"
            for name, number in self.numbers.items()
        )
        numbers = f'<dl class="shipnet-numbers">{rows}</dl>' if rows else ""
        verdict = f'<p class="shipnet-verdict shipnet-{kind}" role="status">{said}</p>'
        return f"{verdict}{self._table}{numbers}"

    @property
    def _table(self) -> str:
        if self.table is None:
            return ""
        heads = "".join(f'<th scope="col">{escape(str(name))}</th>' for name in self.table.columns)
        rows = "".join(
            f'<tr><th scope="row">{escape(str(name))}</th>'
            + "".join(f"<td>{escape(str(cell))}</td>" for cell in cells)
            + "</tr>"
            for name, cells in zip(
                self.table.index, self.table.itertuples(index=False), strict=True
            )
        )
        return (
            f'<div class="shipnet-wide"><table class="shipnet-table"><thead><tr><td></td>{heads}'
            f"</tr></thead><tbody>{rows}</tbody></table></div>"
            f'<p class="shipnet-caption">{escape(self.caption)}</p>'
        )

    @property
    def figure(self) -> str:
        """The figure as HTML; empty without `draw`."""
        if self.draw is None:
            return ""
        size = f'width="{100 * _WIDTH:g}" height="{100 * self.height:g}"'
        png = b64encode(picture(self.draw, _WIDTH, self.height)).decode()
        alt = f"{self.about}: {self.text}" if self.about else self.text
        # Decoded at once, else the page would blink at every step of a slider.
        return (
            f'<img class="shipnet-picture" decoding="sync" {size} alt="{escape(alt)}" '
            f'src="data:image/png;base64,{png}">'
        )


def picture(draw: Callable[[Axes], object], width: float, height: float) -> bytes:
    """Return what `draw` puts on axes as a picture."""
    figure = Figure(figsize=(width, height), layout="constrained")
    draw(figure.subplots())
    file = BytesIO()
    figure.savefig(file, format="png", dpi=_DPI)
    return file.getvalue()
