"""The contents of a page (words, verdict, numbers, figure, pins, files), and saved states."""

from __future__ import annotations

import json
from base64 import b64encode
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import cache, partial
from html import escape
from importlib.resources import files
from io import BytesIO
from tomllib import loads
from types import SimpleNamespace
from typing import Any, NamedTuple, cast
from urllib.parse import parse_qsl, urlencode

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.ticker import FixedFormatter

from shipnet.errors import ArgumentError, InputError
from shipnet.fields import Choice, Kind, Number, Switch, Text, Words, declared
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

#: Maximum number of pinned answers.
MOST_PINS = 4


@cache
def page_words() -> Mapping[str, Mapping[str, Any]]:
    """Return the words of all tools' pages, from pages.toml."""
    return loads((files("shipnet.tools") / "pages.toml").read_text(encoding="utf-8"))


def words(tool: str) -> Mapping[str, Words]:
    """Return the label and the help of each control of a tool."""
    return {name: Words(*pair) for name, pair in page_words()[tool]["controls"].items()}


class Measure(NamedTuple):
    """The number that a sweep draws: its column and label, and the largest value allowed."""

    column: str
    label: str
    value: float
    limit: float


@dataclass(frozen=True, kw_only=True)
class View:
    """The view on a page: verdict, table, numbers, the figure that `plot` draws, and files.

    `narrow` draws the figure on a phone, if it differs. `curve` returns the values of the figure
    that are compared with pinned ones: by number, they are a line; by name, marks in rows. `data`
    returns the table to download. `short` and `measure` are the answer of a sweep at one value.
    `idle` says why controls have no effect at present, and `uses` has inputs for other tools.
    `drawing` is HTML that is shown above the figure.
    """

    verdict: str
    ok: bool
    numbers: Mapping[str, str] = field(default_factory=dict)
    plot: Callable[[Axes], object] | None = None
    narrow: Callable[[Axes], object] | None = None
    height: float = 3.6
    about: str = ""
    curve: Callable[[], pd.Series] | None = None
    data: Callable[[], pd.DataFrame] | None = None
    table: pd.DataFrame | None = None
    caption: str = ""
    drawing: str = ""
    files: Mapping[str, str | bytes] = field(default_factory=dict)
    short: str = ""
    measure: Measure | None = None
    idle: Mapping[str, str] = field(default_factory=dict)
    uses: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)

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

    def figure(
        self, sheet: Sheet | None = None, *, narrow: bool = False, pins: Sequence[View] = ()
    ) -> str:
        """Return the figure, drawn on `sheet` or a new sheet, as HTML; "" if `plot` is None."""
        if self.plot is None:
            return ""
        width, height = (_NARROW, _FLAT * self.height) if narrow else (_WIDTH, self.height)
        draw = partial(self._draw, narrow=narrow, pins=pins)
        png = b64encode((sheet or Sheet()).png(draw, width, height)).decode()
        alt = f"{self.about}: {self.verdict}" if self.about else self.verdict
        # Decoded synchronously; otherwise the page would flicker at every step of a slider.
        return (
            f'<img class="shipnet-picture" decoding="sync" width="{100 * width:g}" '
            f'height="{100 * height:g}" alt="{escape(alt)}" src="data:image/png;base64,{png}">'
        )

    def svg(self, pins: Sequence[View] = ()) -> bytes:
        """Return the figure as an SVG file."""
        figure, file = HouseFigure(figsize=(_WIDTH, self.height), layout="constrained"), BytesIO()
        self._draw(figure.subplots(), pins=pins)
        figure.savefig(file, format="svg")
        return file.getvalue()

    def _draw(self, axes: Axes, *, narrow: bool = False, pins: Sequence[View] = ()) -> None:
        plot = self.narrow if narrow and self.narrow else self.plot
        assert plot is not None, "a view without a figure draws nothing"
        plot(axes)
        for number, pin in enumerate(pins, 1):
            if self.curve is not None and pin.curve is not None:
                _draw_pinned(axes, self.curve(), pin.curve(), number)


def _draw_pinned(axes: Axes, curve: pd.Series, pinned: pd.Series, number: int) -> None:
    """Draw a pinned curve beside the present one; its points are the number of the pin."""
    look: dict[str, Any] = {"color": "0.6", "mfc": "0.2", "mec": "0.2", "mew": 0.4, "zorder": 1.5}
    look |= {"marker": f"${number}$", "ms": 7, "clip_on": False}
    pinned = pinned[np.isfinite(pinned.to_numpy(float))]
    if not pd.api.types.is_numeric_dtype(curve.index):
        rows = curve.index.get_indexer(pinned.index)
        pinned = pinned[rows >= 0]
        axes.plot(pinned, rows[rows >= 0], ls="", **look)
        _reach(axes.xaxis, pinned)
    else:
        axes.plot(pinned.index, pinned, ls="-", lw=0.8, markevery=max(1, len(pinned) // 8), **look)
        _reach(axes.yaxis, pinned)


def _reach(axis: Any, values: Iterable[float]) -> None:
    """Extend the range of an axis to values; it never shrinks, and keeps its direction."""
    low, high = sorted(axis.get_view_interval())
    ends = min([low, *values]), max([high, *values])
    if ends != (low, high):
        ends = ends[::-1] if axis.get_inverted() else ends
        axis.axes.set(**{f"{axis.axis_name}lim": ends})


class Answer(NamedTuple):
    """The inputs of a tool, and the view on them."""

    inputs: Any
    view: View


def details(now: Answer, pins: Sequence[Answer] = ()) -> str:
    """Return the table and the numbers of an answer as HTML, with those of pins beside them."""
    table, view = "", now.view
    if view.table is not None:
        caption = f'<p class="shipnet-caption">{escape(view.caption)}</p>'
        table = _html("shipnet-table", view.table.columns, view.table.itertuples()) + caption
    heads = ["now", *(f"pin {number}" for number in range(1, len(pins) + 1))]
    return table + _html("shipnet-numbers", heads, compared(now, pins))


def compared(now: Answer, pins: Sequence[Answer]) -> list[list[str]]:
    """Return rows with a name and a text per answer: settings that differ, verdict, numbers."""
    answers, rows = [now, *pins], []
    for name, kind in declared(type(now.inputs)).items():
        values = [getattr(one.inputs, name) for one in answers]
        if values.count(values[0]) < len(values):
            rows.append([kind.label or name, *(in_words(kind, value) for value in values)])
    if pins:
        rows.append(["verdict", *(one.view.verdict for one in answers)])
    for name in dict.fromkeys(name for one in answers for name in one.view.numbers):
        rows.append([name, *(one.view.numbers.get(name, "") for one in answers)])
    return rows


def _html(kind: str, heads: Iterable[object], rows: Iterable[Iterable[object]]) -> str:
    """Return a table of the class `kind` as HTML; each row begins with its name."""
    top = "".join(f'<th scope="col">{escape(str(head))}</th>' for head in heads)
    body = "".join(
        f'<tr><th scope="row">{escape(str(name))}</th>'
        + "".join(f"<td>{escape(str(cell))}</td>" for cell in cells)
        + "</tr>"
        for name, *cells in rows
    )
    return (
        f'<div class="shipnet-wide"><table class="{kind}"><thead><tr><td></td>{top}'
        f"</tr></thead><tbody>{body}</tbody></table></div>"
    )


def in_words(kind: Kind, value: Any) -> str:
    """Return the value of a control as text with its unit."""
    if isinstance(kind, Choice):
        words = kind.options[value]
    elif isinstance(kind, Switch):
        words = "on" if value else "off"
    elif isinstance(kind, Number):
        words = f"{value:g}"
    elif isinstance(kind, Text):
        words = value if kind.rows == 1 else f"{len(value.splitlines())} lines"
    else:
        words = f"{len(value)} in all"
    return f"{words} {kind.unit}".rstrip()


class Sheet:
    """Axes that are reused for each plot, and whose ranges only grow until `fit` is called.

    Ticks and layout take about half the time needed for a new figure. So the ticks are reused, and
    so is the layout while the text around the axes stays the same.
    """

    axes: Axes | None = None
    _size: tuple[float, float] = (0, 0)
    _words: tuple[str, ...] = ()

    def __init__(self) -> None:
        self._ranges: dict[tuple[Any, ...], tuple[float, float]] = {}

    def fit(self) -> None:
        """Let the next plot choose the ranges of its axes."""
        self._ranges.clear()

    def _keep_ranges(self, axes: Axes) -> None:
        """Extend each axis to its earlier range, if it shows the same quantity."""
        for axis in (cast("Any", axes.xaxis), cast("Any", axes.yaxis)):
            if not axis.get_label_text():
                continue  # rows with names, or a drawing
            labels = axis.get_major_formatter()
            names = tuple(labels.seq) if isinstance(labels, FixedFormatter) else ()
            shows = (axis.axis_name, axis.get_label_text(), axis.get_scale(), names)
            _reach(axis, self._ranges.get(shows, ()))
            self._ranges[shows] = tuple(axis.get_view_interval())

    @house()
    def png(self, plot: Callable[[Axes], object], width: float, height: float) -> bytes:
        """Return the drawing of `plot` as a PNG of the given size in inches."""
        axes, self.axes = self.axes, None  # dropped if the plot fails
        if axes is None or self._size != (width, height):
            figure = HouseFigure(figsize=(width, height), dpi=_DPI)
            FigureCanvasAgg(figure)
            axes, self._size, self._words = figure.subplots(), (width, height), ()
            self.fit()
        else:
            _clear(axes)
        plot(axes)
        self._keep_ranges(axes)
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
    """A button to load a file; `take` makes new inputs from the old ones and the file.

    It returns the inputs, or `Loaded` ones with remarks on the file.
    """

    label: str
    help: str
    accept: str
    take: Callable[[Any, str, bytes], Any]


class Loaded(NamedTuple):
    """The inputs of a file, and remarks on what was assumed or not used."""

    inputs: Any
    remarks: Sequence[str] = ()


@dataclass(frozen=True)
class Preset:
    """Controls that set inputs; `make` returns new inputs from their values and the old inputs.

    `idle` says why some of these controls have no effect at given values.
    """

    start: Any
    make: Callable[[Any, Any], Any]
    idle: Callable[[Any], Mapping[str, str]] = lambda _: {}


def download_link(file: str, content: str | bytes, text: str = "") -> str:
    """Return a link that saves a file from the page itself, without a server."""
    data = content.encode() if isinstance(content, str) else content
    href = f"data:application/octet-stream;base64,{b64encode(data).decode()}"
    return (
        f'<a class="shipnet-button" download="{escape(file)}" href="{escape(href)}">'
        f"{escape(text or f'download {file}')}</a> "
    )


def write_state(tool: str, inputs: Any, pins: Sequence[Any] = ()) -> str:
    """Return the inputs of a tool, and pinned ones, as JSON."""
    state = {"format": _FORMAT, "version": VERSION, "tool": tool, "inputs": asdict(inputs)}
    return json.dumps(state | {"pins": [asdict(pin) for pin in pins]}, indent=2)


def write_link(inputs: Any, pins: Sequence[Any] = ()) -> str:
    """Return a link to the page with these inputs and pins, or "" if it is too long."""
    query = escape(urlencode([*_changed(inputs), *(("pin", urlencode(_changed(p))) for p in pins)]))
    link = f'<a class="shipnet-button shipnet-link" href="?{query}">link to this state</a>'
    return link if len(query) <= _LONGEST_LINK else ""


def _changed(inputs: Any) -> list[tuple[str, Any]]:
    """Return the names and values of the inputs that are not at their defaults."""
    start = type(inputs)()
    values = {name: getattr(inputs, name) for name in declared(type(inputs))}
    return [
        (name, " ".join(value) if isinstance(value, tuple) else value)
        for name, value in values.items()
        if value != getattr(start, name)
    ]


def write_use(tool: str, values: Mapping[str, Any]) -> str:
    """Return a link that opens another tool with these values; others keep their defaults."""
    query = escape(urlencode(values))
    return (
        f'<a class="shipnet-button shipnet-link" href="{tool}.ipynb?{query}">'
        f"use in {tool.replace('_', ' ')}</a>"
    )


def read_link(query: str, kind: type) -> list[Any]:
    """Return a link's inputs and pins as records of type `kind`; the others keep their defaults."""
    pairs = parse_qsl(query, keep_blank_values=True)
    pins = [parse_qsl(text, keep_blank_values=True) for name, text in pairs if name == "pin"]
    records = []
    for one in ([pair for pair in pairs if pair[0] != "pin"], *pins[:MOST_PINS]):
        values = asdict(kind())
        for name, text in one:
            values[name] = _value(text, values.get(name))
        records.append(_record(values, kind, "the link"))
    return records


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


def read_state(content: bytes, tool: str, kind: type, file: str = "state") -> list[Any]:
    """Return the inputs in a file, and its pins, as records of type `kind`."""
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
    inputs, pins = state.get("inputs"), state.get("pins", [])
    if not isinstance(inputs, dict):
        raise InputError(file, "it has no inputs")
    if not (isinstance(pins, list) and all(isinstance(pin, dict) for pin in pins)):
        raise InputError(file, "its pins are not a list of inputs")
    return [_record(one, kind, file) for one in (inputs, *pins[:MOST_PINS])]


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
