"""The HTML form of an object in a notebook: verdict, worst rows, small figure, folded table."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Callable
from html import escape
from typing import Any

from shipnet.errors import ArgumentError
from shipnet.lazy import pd

#: Number of rows shown, and in the folded table.
_WORST, _FOLDED = 3, 12

#: Maximum number of characters of a verdict and of a cell.
_VERDICT, _CELL = 1000, 80

#: Sign of a good, bad and undetermined result, and its background, dark enough for white text.
_SIGNS = {True: ("\N{CHECK MARK}", "#1e7b3a"), False: ("\N{BALLOT X}", "#b3261e")}
_UNDETERMINED = ("?", "#8a6100")

#: A notebook would typeset text between dollar signs as a formula, except in these classes.
_BEGIN = '<div class="shipnet-form tex2jax_ignore mathjax_ignore">'

_ROW = "display: flex; flex-wrap: wrap; gap: 0.5rem 1.5rem; margin-bottom: 0.4rem"
_SIGN = "padding: 0 0.4em; border-radius: 0.25em; color: #ffffff; background: "
_PICTURE = "width: 560px; max-width: 100%; border-radius: 4px; background: #ffffff"


def as_html(
    shown: Any,
    rows: pd.DataFrame | None = None,
    *,
    ok: Any = ...,
    table: pd.DataFrame | None = None,
    plot: Callable[..., object] | None = None,
    figure: bool = True,
) -> str:
    """Return the HTML form of an object, as its method ``_repr_html_`` does.

    The first three of `rows` are shown, so the worst should come first. By default, the form shows
    the object's own `ok`, `table` and `plot`; without `figure`, nothing is drawn.
    """
    verdict = _text(getattr(shown, "verdict", repr(shown).strip("<>")), _VERDICT)
    ok = getattr(shown, "ok", ...) if ok is ... else ok
    table = shown.table() if table is None else table
    rows = table if rows is None else rows
    plot = plot or getattr(shown, "plot", None)
    sign, colour = _SIGNS.get(ok, _UNDETERMINED)
    mark = "" if ok is ... else f'<span style="{_SIGN}{colour}">{sign}</span> '
    parts = [f"{_BEGIN}<p>{mark}<strong>{escape(verdict)}</strong></p>", f'<div style="{_ROW}">']
    parts += [_table(rows, _WORST)] if len(rows) else []
    parts += [_picture(plot, verdict)] if figure and plot else []
    parts.append("</div>")
    if len(table) > _WORST or not set(table) <= set(rows):
        first = f"the first {_FOLDED} of " if len(table) > _FOLDED else ""
        summary = f"<summary>Table of {first}{len(table)} rows</summary>"
        parts.append(f"<details>{summary}{_table(table, _FOLDED)}</details>")
    return "\n".join([*parts, "</div>"])


def _text(value: object, most: int) -> str:
    """Return text that UTF-8 can encode, at most `most` characters of it."""
    text = str(value).encode("utf-8", "backslashreplace").decode()
    return text if len(text) <= most else f"{text[: most - 1]}\N{HORIZONTAL ELLIPSIS}"


def _cell(value: Any) -> str:
    """Return a cell as text, a float with 4 digits, or 6 from 100 up; missing values are empty."""
    if isinstance(value, float) and value == value:
        digits = 4 if abs(value) < 100 else 6
        return f"{value:,.0f}" if abs(value) >= 1e6 else f"{value:,.{digits}g}"
    return "" if pd.isna(value) else _text(value, _CELL)


def _table(rows: pd.DataFrame, most: int) -> str:
    """Return the first rows, without empty columns; the name of the index is in the corner."""
    cells = rows.head(most).astype(object).map(_cell).rename(index=_cell, columns=_cell)
    cells = cells.loc[:, (cells != "").any()]
    if rows.index.nlevels == 1:
        cells.columns.name, cells.index.name = rows.index.name, None
    return f'<div style="max-width: 100%; overflow-x: auto">{cells.to_html(border=0)}</div>'


def _picture(plot: Callable[..., object], words: str) -> str:
    """Return a small figure, or the reason why there is none."""
    from shipnet.figure import small

    try:
        kind, data = small(lambda ax: plot(ax=ax))
    except ArgumentError as reason:  # for example, a figure of nothing
        return f"<p>No figure: {escape(_text(reason, _VERDICT))}</p>"
    source = f"data:{kind};base64,{b64encode(data).decode()}"
    image = f'<img style="{_PICTURE}" alt="{escape(words)}" src="{source}">'
    return f'<figure style="margin: 0">{image}</figure>'
