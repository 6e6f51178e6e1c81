"""The contents of a page (words, verdict, numbers, figure, buttons, files), and saved states."""

from __future__ import annotations

import json
from base64 import b64encode
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from functools import cache
from html import escape
from importlib.resources import files
from io import BytesIO
from tomllib import loads
from types import SimpleNamespace
from typing import Any, cast
from urllib.parse import parse_qsl, urlencode

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg

from shipnet.errors import ArgumentError, InputError
from shipnet.fields import Words, declared
from shipnet.figure import HouseFigure, house
from shipnet.lazy import pd

#: Width of a picture [inch], and its resolution [1/inch]; a page shows 100 px per inch.
_WIDTH, _DPI = 7.5, 150

#: Width of a picture on a phone, and its height as a fraction of the usual height.
_NARROW, _FLAT = 4.6, 0.8

#: Version of saved states; it increases when the meaning of a field changes.
VERSION = 1

_FORMAT = "shipnet tool"

#: Maximum size of a state [bytes]; most have a few hundred, but a text input can be long.
_LARGEST = 2_000_000

#: Maximum number of characters in a link; some programs truncate longer links.
_LONGEST_LINK = 2_000


@cache
def page_words() -> Mapping[str, Mapping[str, Any]]:
    """Return the words of all tools' pages, from pages.toml."""
    return loads((files("shipnet.tools") / "pages.toml").read_text(encoding="utf-8"))


def words(tool: str) -> Mapping[str, Words]:
    """Return the label and the help of each control of a tool."""
    return {name: Words(*pair) for name, pair in page_words()[tool]["controls"].items()}


@dataclass(frozen=True, kw_only=True)
class View:
    """The view on a page: verdict, table, numbers, the figure that `plot` draws, and files.

    A `dense` figure keeps its width on a phone.
    """

    verdict: str
    ok: bool
    numbers: Mapping[str, str] = field(default_factory=dict)
    plot: Callable[[Axes], object] | None = None
    height: float = 3.6
    about: str = ""
    dense: bool = False
    table: pd.DataFrame | None = None
    caption: str = ""
    files: Mapping[str, str | bytes] = field(default_factory=dict)

    def __str__(self) -> str:
        table = [] if self.table is None else [self.table.to_string(), self.caption]
        numbers = (f"{name}: {number}" for name, number in self.numbers.items())
        return "\n".join([self.verdict, *filter(None, table), *numbers])

    @property
    def answer(self) -> str:
        """The verdict as HTML."""
        kind = "good" if self.ok else "bad"
        verdict = escape(self.verdict).replace("\n", "<br>")
        return f'<p class="shipnet-verdict shipnet-{kind}" role="status">{verdict}</p>'

    @property
    def details(self) -> str:
        """The table and the numbers as HTML."""
        rows = "".join(
            f"<dt>{escape(name)}</dt><dd>{escape(number)}</dd>"
            for name, number in self.numbers.items()
        )
        numbers = f'<dl class="shipnet-numbers">{rows}</dl>' if rows else ""
        if self.table is None:
            return numbers
        heads = "".join(f'<th scope="col">{escape(str(name))}</th>' for name in self.table.columns)
        rows = "".join(
            f'<tr><th scope="row">{escape(str(name))}</th>'
            + "".join(f"<td>{escape(str(cell))}</td>" for cell in cells)
            + "</tr>"
            for name, *cells in self.table.itertuples()
        )
        return (
            f'<div class="shipnet-wide"><table class="shipnet-table"><thead><tr><td></td>{heads}'
            f"</tr></thead><tbody>{rows}</tbody></table></div>"
            f'<p class="shipnet-caption">{escape(self.caption)}</p>{numbers}'
        )

    def figure(self, sheet: Sheet | None = None, *, narrow: bool = False) -> str:
        """Return the figure, drawn on `sheet` or a new sheet, as HTML; "" if `plot` is None."""
        if self.plot is None:
            return ""
        width, height = _WIDTH, self.height
        if narrow and not self.dense:
            width, height = _NARROW, _FLAT * height
        png = b64encode((sheet or Sheet()).png(self.plot, width, height)).decode()
        alt = f"{self.about}: {self.verdict}" if self.about else self.verdict
        # Decoded synchronously; otherwise the page would flicker at every step of a slider.
        return (
            f'<img class="shipnet-picture" decoding="sync" width="{100 * width:g}" '
            f'height="{100 * height:g}" alt="{escape(alt)}" src="data:image/png;base64,{png}">'
        )


class Sheet:
    """Axes that are reused for each plot.

    Ticks and layout take about half the time needed for a new figure. So the ticks are reused, and
    so is the layout while the text around the axes stays the same.
    """

    axes: Axes | None = None
    _size: tuple[float, float] = (0, 0)
    _words: tuple[str, ...] = ()

    @house()
    def png(self, plot: Callable[[Axes], object], width: float, height: float) -> bytes:
        """Return the drawing of `plot` as a PNG of the given size in inches."""
        axes, self.axes = self.axes, None  # dropped if the plot fails
        if axes is None or self._size != (width, height):
            figure = HouseFigure(figsize=(width, height), dpi=_DPI)
            FigureCanvasAgg(figure)
            axes, self._size, self._words = figure.subplots(), (width, height), ()
        else:
            _clear(axes)
        plot(axes)
        whole, spec = cast("Any", axes.figure), cast("Any", axes.get_subplotspec())
        if _words(axes) != self._words:
            # Make room for the text, starting from the position of new axes.
            axes.set_subplotspec(spec)
            whole.set_layout_engine("constrained")
        png = self._drawn(axes)
        whole.set_layout_engine("none")
        self._words = _words(axes)
        return png

    def _drawn(self, axes: Axes) -> bytes:
        file, canvas = BytesIO(), cast("Any", axes.figure.canvas)
        # `savefig` draws twice, and compresses more than is worthwhile for a picture shown once.
        canvas.print_png(file, pil_kwargs={"compress_level": 1})
        self.axes = axes
        return file.getvalue()


def _clear(axes: Axes) -> None:
    """Remove everything that a plot has drawn or set, except the ticks."""
    legend = axes.get_legend()
    drawn = [*axes.lines, *axes.patches, *axes.collections, *axes.texts, *axes.artists]
    for artist in [*drawn, *([legend] if legend else [])]:
        artist.remove()
    axes.containers.clear()
    axes.set_prop_cycle(None)
    axes.relim()
    axes.set(xscale="linear", yscale="linear", xlim=(0, 1), ylim=(0, 1))
    axes.set(title="", xlabel="", ylabel="", autoscale_on=True)


def _words(axes: Axes) -> tuple[str, ...]:
    """Return the text around the axes, which determines the layout."""
    legend = axes.get_legend()
    texts = [
        *axes.get_xticklabels(),
        *axes.get_yticklabels(),
        axes.title,
        axes.xaxis.label,
        axes.yaxis.label,
        *(legend.get_texts() if legend else ()),
    ]
    return tuple(text.get_text() for text in texts)


@dataclass(frozen=True)
class Button:
    """A button; `act` takes the current inputs and returns new ones, or None to recompute."""

    label: str
    help: str
    act: Callable[[Any], Any]


@dataclass(frozen=True)
class Upload:
    """A button to load a file; `take` makes new inputs from the old ones and the file."""

    label: str
    help: str
    accept: str
    take: Callable[[Any, str, bytes], Any]


@dataclass(frozen=True)
class Preset:
    """Controls that set inputs; `make` returns new inputs from their values and the old inputs."""

    start: Any
    make: Callable[[Any, Any], Any]


def download_link(text: str, file: str, content: str | bytes) -> str:
    """Return a link that saves a file from the page itself, without a server."""
    data = content.encode() if isinstance(content, str) else content
    href = f"data:application/octet-stream;base64,{b64encode(data).decode()}"
    return (
        f'<a class="shipnet-button" download="{escape(file)}" href="{escape(href)}">'
        f"{escape(text)}</a>"
    )


def write_state(tool: str, inputs: Any) -> str:
    """Return the inputs of a tool as JSON."""
    state = {"format": _FORMAT, "version": VERSION, "tool": tool, "inputs": asdict(inputs)}
    return json.dumps(state, indent=2)


def write_link(inputs: Any) -> str:
    """Return a link to the page with these inputs, or "" if it is too long."""
    start = type(inputs)()
    values = {name: getattr(inputs, name) for name in declared(type(inputs))}
    changed = {
        name: " ".join(value) if isinstance(value, tuple) else value
        for name, value in values.items()
        if value != getattr(start, name)
    }
    query = escape(urlencode(changed))
    link = f'<a class="shipnet-button shipnet-link" href="?{query}">link to this state</a>'
    return link if len(query) <= _LONGEST_LINK else ""


def read_link(query: str, kind: type) -> Any:
    """Return a link's inputs as a record of type `kind`; missing inputs keep their defaults."""
    values = asdict(kind())
    for name, text in parse_qsl(query, keep_blank_values=True):
        values[name] = _value(text, values.get(name))
    return _record(values, kind, "the link")


def _value(text: str, default: Any) -> Any:
    """Return the text as a value of the default's type; if it is invalid, return it unchanged."""
    if isinstance(default, tuple):
        return tuple(text.split())
    if isinstance(default, bool):
        return {"True": True, "False": False}.get(text, text)
    try:
        return type(default)(text) if isinstance(default, int | float) else text
    except ValueError:
        return text


def read_state(content: bytes, tool: str, kind: type, file: str = "state") -> Any:
    """Return the inputs in a file as a record of type `kind`."""
    if len(content) > _LARGEST:
        raise InputError(file, f"it has {len(content)} bytes; a saved state has at most {_LARGEST}")
    try:
        state = json.loads(content.decode("utf-8-sig"))
    except (ValueError, RecursionError):
        raise InputError(file, "this is not a saved state: it is not JSON") from None
    if not isinstance(state, dict) or state.get("format") != _FORMAT:
        raise InputError(file, f"this is not a saved state: it lacks the format {_FORMAT!r}")
    for name, legal in {"tool": tool, "version": VERSION}.items():
        if (value := state.get(name)) != legal:
            raise InputError(file, f"its {name} is {value!r}; this page reads {legal!r}")
    inputs = state.get("inputs")
    if not isinstance(inputs, dict):
        raise InputError(file, "it has no inputs")
    return _record(inputs, kind, file)


def _record(inputs: Mapping[str, Any], kind: type, file: str) -> Any:
    """Return a record of type `kind` with these values, or raise InputError with all faults."""
    kinds = declared(kind)
    faults = [f"unknown input {name!r}" for name in inputs if name not in kinds]
    faults += [f"input {name!r} is missing" for name in kinds if name not in inputs]
    if faults:
        raise InputError(file, *faults)
    # JSON has no tuples.
    values = {name: tuple(v) if isinstance(v, list) else v for name, v in inputs.items()}
    for name, declaration in kinds.items():
        try:
            declaration.check(name, values[name], SimpleNamespace(**values))
            declaration.check_shown(name, values[name])
        except ArgumentError as fault:
            faults.append(str(fault))
        except TypeError:
            # The limiting value is not a number, which is already recorded as a fault.
            continue
    if faults:
        raise InputError(file, *faults)
    try:
        return kind(**values)
    except ArgumentError as fault:
        raise InputError(file, str(fault)) from None
