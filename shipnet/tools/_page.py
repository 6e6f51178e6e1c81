"""Pages of widgets: the controls and the answer of a tool, pins and sweeps; and steppers."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cache, lru_cache, partial
from html import escape
from importlib.resources import files
from math import ceil, log10
from typing import TYPE_CHECKING, Any

from matplotlib.axes import Axes

from shipnet.errors import ArgumentError, InputError, load_extra
from shipnet.fields import (
    Choice,
    Kind,
    Number,
    Switch,
    Text,
    Whole,
    check_scalar,
    check_whole,
    declared,
)
from shipnet.tables import as_csv
from shipnet.tools import _view
from shipnet.tools._sweep import sweep, sweepable
from shipnet.tools._view import MOST_PINS, Answer, Button, Loaded, Preset, Sheet, Upload, View

if TYPE_CHECKING:
    import ipywidgets as widgets
else:
    widgets = load_extra("ipywidgets", "ipywidgets")

#: Maximum number of faults listed per file.
_FAULTS = 50

#: Message shown if a file or a button changed nothing.
_BEFORE = "The results above have not changed."

#: Maximum number of frames of a stepper.
_MOST = 1000

#: Maximum number of views that a page keeps for sweeps.
_KEPT = 512

#: Function that draws frame k, counted from 0, on axes.
Draw = Callable[[int, Axes], object]


class Page(widgets.VBox):  # type: ignore[misc]
    """The page of a tool: controls, verdict, figure, and a state that can be shared.

    `see` returns the view for given inputs; the default is the tool's own `_view`. `folds` maps
    titles to the controls that are folded under them. A `drawing` takes the place of the figure and
    has instruments of its own: the page calls its `show`, and sets its `on_release`. Each example
    state in pages.toml has a button; with `story`, the page opens on the first example. The page of
    something that is `live` changes by itself, so links do not contain its pins.
    """

    def __init__(
        self,
        start: Any,
        see: Callable[[Any], View] | None = None,
        *,
        preset: Preset | None = None,
        buttons: Sequence[Button] = (),
        uploads: Sequence[Upload] = (),
        extras: Sequence[widgets.Widget] = (),
        folds: Mapping[str, Sequence[str]] = {},
        drawing: Any = None,
        story: bool = False,
        live: bool = False,
    ) -> None:
        self._kind = type(start)
        self.tool = self._kind.__module__.rpartition(".")[2]
        self._see = self._kind._view if see is None else see
        self._sheet, self._sweep_sheet, self._live = Sheet(), Sheet(), live
        self._pins: list[Answer] = []
        self._answer: Answer | None = None
        #: The figures shown, each with the pins in it.
        self._figures: dict[str, tuple[View, list[View]]] = {}
        # While one control moves, its sweep stays the same.
        self._see_once = lru_cache(_KEPT)(self._see)
        self._controls, self._preset = Controls(start, folds, self._on_change), preset
        self.controls, self.presets = self._controls.widgets, {}
        panel = [self._controls.box, *self._controls.folded]
        if preset is not None:
            make = preset.make
            self._setters = Controls(
                preset.start,
                on_change=lambda: self._change(lambda: make(self._setters.inputs, self.inputs)),
            )
            self.presets = self._setters.widgets
            panel.insert(0, self._setters.box)
        instruments = [
            Button("pin", "Keeps this answer beside later ones, in figures and table.", self._pin),
            Button("remove pins", "Removes all pins.", lambda _: self._pins.clear()),
            Button("fit axes", "Fits the axes to the figure; otherwise they only grow.", self._fit),
        ]
        self._acts = {one.label: one.act for one in (*buttons, *instruments)}
        self.buttons = {
            one.label: widgets.Button(description=one.label, tooltip=one.help)
            for one in (*buttons, *instruments)
        }
        for label, button in self.buttons.items():
            button.on_click(lambda _, act=self._acts[label]: self._change(lambda: act(self.inputs)))
        load = Upload("load state", "", ".json", self._read)
        self.uploads = {one.label: self._upload(one) for one in (*uploads, load)}
        row = [_with_help(self.buttons[one.label], one.help) for one in buttons]
        row += [_with_help(self.uploads[one.label], one.help) for one in uploads]
        if row := [*row, *extras]:
            panel.append(_classed(widgets.HBox(row), "shipnet-buttons"))
        kinds = {**(sweepable(type(preset.start)) if preset else {}), **sweepable(self._kind)}
        options = [("nothing", ""), *((kind.label, name) for name, kind in kinds.items())]
        self.over = widgets.Dropdown(options=options, description="sweep")
        self.over.tooltip = "Shows the answer at all values of a control."
        self.over.observe(lambda _: self._change(self._sweep_sheet.fit), "value")
        tools = [*(self.buttons[one.label] for one in instruments), self.over]
        self.prepare = widgets.Button(
            description="figure and data", tooltip="Prepares SVG and CSV files to download."
        )
        self.prepare.on_click(lambda _: self._prepare())
        self.text, self.ok, self.note = "", False, ""
        self._shown, self._noted, self._details = (widgets.HTML() for _ in range(3))
        self.figure, self.links, self._look, self.sweep = (widgets.HTML() for _ in range(4))
        self._stories = _view.page_words().get(self.tool, {}).get("stories", {})
        self.stories = {name: widgets.Button(description=name) for name in self._stories}
        for name, button in self.stories.items():
            button.on_click(lambda _, name=name: self._show_story(name))
        tries = widgets.HBox([widgets.HTML("Try:"), *self.stories.values(), self._look])
        self.drawing = drawing
        if drawing is not None:
            drawing.on_release = self._change
            self.add_class("shipnet-drawn")
        figure = self.figure if drawing is None else drawing
        answer = widgets.VBox([self._shown, _classed(figure, "shipnet-figure")])
        stage = [_classed(answer, "shipnet-answer"), _classed(widgets.VBox(panel), "shipnet-panel")]
        beside: list[widgets.Widget] = []
        below = [
            _classed(widgets.HBox(tools), "shipnet-instruments"),
            _classed(self.sweep, "shipnet-figure"),
            self._details,
        ]
        if drawing is not None:
            # Beside a drawing, which is high, there is room for the numbers.
            beside, below = [self._details], []
        # Set by the web page when it is shown: the query of its link, and whether it is narrow.
        self.query, self.narrow = (widgets.Text(continuous_update=False) for _ in range(2))
        self.query.observe(
            lambda _: self._change(
                lambda: self._opened(_view.read_link(self.query.value, self._kind))
            ),
            "value",
        )
        self.narrow.observe(lambda _: self.refresh(), "value")
        unseen = [_classed(self.query, "shipnet-query"), _classed(self.narrow, "shipnet-narrow")]
        prepare = [self.prepare] if drawing is None else []
        foot = [self.links, self.uploads[load.label], *prepare, *unseen, self._noted]
        style = (files("shipnet.tools") / "page.css").read_text(encoding="utf-8")
        super().__init__(
            [
                _classed(widgets.HTML(f"<style>{style}</style>"), "shipnet-style"),
                *([_classed(tries, "shipnet-tries")] if self.stories else []),
                _classed(widgets.HBox([stage[0], *beside, stage[1]]), "shipnet-stage"),
                widgets.HTML('<div class="shipnet-spinner" role="status">computing ...</div>'),
                *below,
                _classed(widgets.HBox(foot), "shipnet-foot"),
            ]
        )
        _classed(self, "shipnet-page")
        if story:
            self._show_story(next(iter(self.stories)))
        else:
            self.refresh()

    @property
    def inputs(self) -> Any:
        """The values of the controls; raises ArgumentError if they are not legal."""
        return self._controls.inputs

    def refresh(self) -> None:
        """Compute and show the view of the current inputs."""
        with self._busy():
            save = '<a class="shipnet-button" aria-disabled="true">save state</a>'
            link, figure, self._answer, self._figures = "", None, None, {}
            try:
                inputs = self.inputs
                pinned = [] if self._live else [pin.inputs for pin in self._pins]
                state = _view.write_state(self.tool, inputs, pinned)
                file = f"shipnet_{self.tool}.json"
                save = _view.download_link(file, state, "save state")
                link = _view.write_link(inputs, pinned)
                view = self._see(inputs)
                if self.drawing is None:
                    pins, narrow = [pin.view for pin in self._pins], bool(self.narrow.value)
                    figure = view.figure(self._sheet, narrow=narrow, pins=pins)
                    self._figures[""] = view, pins
                else:
                    self.drawing.show(inputs)
                    figure = ""
                self._answer = Answer(inputs, view)
            except Exception as problem:  # any error is shown as a message
                view = View(verdict=_lines(problem), ok=False)
            self.text, self.ok = str(view), view.ok
            # Set before the verdict, so that a user who sees the verdict can save its state.
            links = [*map(_view.download_link, view.files, view.files.values())]
            links += [_view.write_use(tool, values) for tool, values in view.uses.items()]
            self.links.value = " ".join([save, link, *links])
            self._shown.value, self._details.value = view.answer + view.drawing, ""
            if self._answer is not None:
                self._details.value = _view.details(self._answer, self._pins)
                self.over.layout.display = None if view.measure else "none"
            self._mark("shipnet-stale", figure is None)
            self.figure.value = figure or self.figure.value
            self._controls.mark(view.idle)
            if self._preset is not None:
                self._setters.mark(self._preset.idle(self._setters.inputs))
            self.buttons["pin"].disabled = len(self._pins) == MOST_PINS
            self.buttons["remove pins"].disabled = not self._pins
            self.prepare.disabled = not self._figures
            self._show_sweep()

    def _pin(self, _: object) -> None:
        if self._answer is not None:
            self._pins.append(self._answer)

    def _fit(self, _: object = None) -> None:
        self._sheet.fit()
        self._sweep_sheet.fit()

    def _show_sweep(self) -> None:
        """Show the sweep of the chosen control, for the current inputs and for the pins."""
        field, shown = self.over.value, ""
        if field and self._answer is not None:
            try:
                view, pins = self._sweep(field, self._answer.inputs)
                self._figures["_sweep"] = view, pins
                figure = view.figure(self._sweep_sheet, narrow=bool(self.narrow.value), pins=pins)
                shown = f'<p role="status">{escape(view.verdict)}</p>{figure}'
            except Exception as problem:  # as in refresh
                shown = f'<p role="status">{escape(_sentence(problem))}</p>'
        self.sweep.value = shown

    def _sweep(self, field: str, inputs: Any) -> tuple[View, list[View]]:
        """Return the view on the sweep of a control, and on those of the pins."""
        if self._preset is not None and field in self.presets:
            # Pins have readings, but no values of these controls.
            start, make = self._setters.inputs, self._preset.make
            swept = sweep(start, field, lambda one: self._see_once(make(one, inputs)))
            return swept.view(getattr(start, field)), []
        pins = [sweep(pin.inputs, field, self._see_once).view() for pin in self._pins]
        return sweep(inputs, field, self._see_once).view(getattr(inputs, field)), pins

    def _prepare(self) -> None:
        """Add links to files of the figures and their data; the next change removes them."""
        contents = {}
        try:
            with self._busy():
                for name, (view, pins) in self._figures.items():
                    contents[f"shipnet_{self.tool}{name}.svg"] = view.svg(pins)
                    if view.data is not None:
                        table = view.data().reset_index()
                        contents[f"shipnet_{self.tool}{name}.csv"] = as_csv(table)
        except Exception as problem:  # as in refresh
            self._say(_sentence(problem), _sentence(problem))
        self.links.value += "".join(map(_view.download_link, contents, contents.values()))

    def _on_change(self) -> None:
        # Compute immediately: a browser sends the next value only after this computation.
        self._say("")
        self.refresh()

    def _show_story(self, name: str) -> None:
        values = dict(self._stories[name])
        self._look.value = escape(values.pop("look"))
        self._fit()
        self._change(lambda: self._inputs_of(**values))

    def _inputs_of(self, press: Sequence[str] = (), **values: Any) -> Any:
        """Return the inputs of an example: set its values or its preset, and press its buttons."""
        if self._preset is not None and values:
            self._setters.put(type(self._preset.start)(**values))
            inputs = self._preset.make(self._setters.inputs, self._kind())
        else:
            inputs = self._kind(**values)
        for label in press:
            inputs = self._acts[label](inputs) or inputs
        return inputs

    def _change(self, new: Callable[[], Any], file: str = "") -> None:
        """Show new inputs (the current ones if None), or the faults if the inputs are not legal."""
        try:
            with self._busy():
                inputs = new()
                inputs, remarks = inputs if isinstance(inputs, Loaded) else (inputs, ())
                if inputs is not None:
                    self._controls.put(inputs)
        except Exception as problem:  # as in refresh
            self._say(_sentence(problem), f"{_lines(problem)}\n{_BEFORE}")
            return
        self._say("", "\n".join([f"{file} is loaded", *remarks]) if file else "")
        self.refresh()

    def _say(self, note: str, shown: str = "") -> None:
        self.note = note
        self._mark("shipnet-before", bool(note))
        kind, shown = "bad" if note else "good", escape(shown).replace("\n", "<br>")
        html = f'<p class="shipnet-note shipnet-{kind}" role="alert">{shown}</p>'
        self._noted.value = html if shown else ""

    def _upload(self, one: Upload) -> widgets.FileUpload:
        upload = widgets.FileUpload(accept=one.accept, description=one.label, tooltip=one.label)

        def take(_: object) -> None:
            files = upload.value
            self._fit()
            # Empty the widget, so that a corrected file of the same name counts as a change.
            # Do so before the page responds, because a file loaded meanwhile would be lost.
            upload.value = ()
            for file in files:
                name, content = file["name"], bytes(file["content"])
                self._change(partial(self._take, one, name, content), name)

        upload.observe(take, "value")
        return _classed(upload, "shipnet-upload")

    def _take(self, one: Upload, name: str, content: bytes) -> Any:
        return one.take(self.inputs, name, content)

    def _read(self, _: object, name: str, content: bytes) -> Any:
        return self._opened(_view.read_state(content, self.tool, self._kind, name))

    def _opened(self, records: Sequence[Any]) -> Any:
        """Return the inputs that a link or a file contains first; the others become the pins."""
        inputs, *others = records
        self._pins = [Answer(pin, self._see(pin)) for pin in others]
        return inputs

    @contextmanager
    def _busy(self) -> Iterator[None]:
        self._mark("shipnet-busy", True)
        try:
            yield
        finally:
            self._mark("shipnet-busy", False)

    def _mark(self, name: str, on: bool) -> None:
        (self.add_class if on else self.remove_class)(name)


def _lines(problem: Exception) -> str:
    """Return the message of an error, one fault per line if a file has several."""
    if not isinstance(problem, InputError) or len(problem.faults) < 2:
        return _sentence(problem)
    return "\n".join([f"{problem.file}:", *problem.lines(_FAULTS)])


def _sentence(problem: Exception) -> str:
    if isinstance(problem, ArgumentError | InputError):
        return str(problem)
    return (
        f"This should not happen: {type(problem).__name__}: {problem}. "
        "Please report it, with the saved state if there is one."
    )


class Controls:
    """Controls for the fields of a record, with their help; some are folded away."""

    def __init__(
        self,
        start: Any,
        folds: Mapping[str, Sequence[str]] = {},
        on_change: Callable[[], object] = lambda: None,
    ) -> None:
        self._kind, self._on_change, self._quiet = type(start), on_change, False
        self._kinds = declared(self._kind)
        self._held = {name: getattr(start, name) for name in self._kinds}
        made = {name: _control(kind, self._held[name]) for name, kind in self._kinds.items()}
        self.widgets = {name: control for name, control in made.items() if control is not None}
        rows = {}
        for name, control in self.widgets.items():
            kind = self._kinds[name]
            # Observe this first: a value above its new limit is reduced before `_changed` reads it.
            if isinstance(kind, Whole) and kind.at_most:
                most = partial(_set_most, control, kind.shown)
                self.widgets[kind.at_most].observe(most, "value")
                most({"new": self._held[kind.at_most]})
            control.tooltip = kind.help
            rows[name] = row = _with_help(control, kind.help)
            if isinstance(kind, Text) and kind.rows > 1:
                row.add_class("shipnet-editor")
        for control in self.widgets.values():
            control.observe(self._changed, "value")
        self._seen, self._rows = self._values(), dict(rows)
        self.folded = [
            widgets.Accordion([_grid([rows.pop(name) for name in names])], titles=[title])
            for title, names in folds.items()
        ]
        self.box = _grid(list(rows.values()))

    @property
    def inputs(self) -> Any:
        """The values of the controls as an instance of the record; raises ArgumentError."""
        return self._kind(**self._values())

    def _values(self) -> dict[str, Any]:
        """Return all values, rounded because a browser's slider accumulates rounding errors."""
        values = {name: control.value for name, control in self.widgets.items()}
        for name, value in values.items():
            values[name] = round(value, 9) if isinstance(value, float) else value
        return {**self._held, **values}

    def mark(self, idle: Mapping[str, str]) -> None:
        """Mark the controls that have no effect at present, each with the reason."""
        for name, row in self._rows.items():
            why = f"No effect now: {idle[name]}." if name in idle else ""
            (row.add_class if why else row.remove_class)("shipnet-idle")
            row.children[1].value = _help(self._kinds[name].help, why)

    def put(self, inputs: Any) -> None:
        """Set all controls, each to its nearest step, without calling observers.

        Raises ArgumentError, and changes nothing, if a value is outside its slider's range.
        """
        for name, kind in self._kinds.items():
            kind.check_shown(name, getattr(inputs, name))
        self._quiet = True
        try:
            for name, kind in self._kinds.items():
                value = getattr(inputs, name)
                if name not in self.widgets:
                    self._held[name] = value
                    continue
                if isinstance(kind, Number):
                    low, high = kind.shown
                    steps = round((value - low) / kind.step)
                    value = min(high, round(low + kind.step * steps, 9))
                self.widgets[name].value = value
        finally:
            self._quiet, self._seen = False, self._values()

    def _changed(self, _: object) -> None:
        # A browser echoes the values of `put`; an echo is not a change.
        if not self._quiet and self._seen != self._values():
            self._seen = self._values()
            self._on_change()


def _set_most(control: Any, shown: tuple[float, float], change: Mapping[str, Any]) -> None:
    control.max = max(shown[0], min(shown[1], change["new"]))


def _with_help(control: widgets.Widget, help: str) -> widgets.VBox:
    """Return a control with help that is shown while the control is pointed at or in use."""
    return _classed(widgets.VBox([control, widgets.HTML(_help(help))]), "shipnet-control")


def _help(help: str, why: str = "") -> str:
    reason = f'<div class="shipnet-reason">{escape(why)}</div>' if why else ""
    return f'{reason}<div class="shipnet-help">{escape(help)}</div>'


def _grid(rows: list[widgets.Widget]) -> widgets.Box:
    return _classed(widgets.Box(rows), "shipnet-controls")


def _classed(widget: widgets.Widget, name: str) -> widgets.Widget:
    widget.add_class(name)
    return widget


def _control(kind: Kind, value: Any) -> widgets.Widget | None:
    """Return the control of a field, or None for a series, which has buttons."""
    label = f"{kind.label} [{kind.unit}]" if kind.unit else kind.label
    common: dict[str, Any] = {"value": value, "description": label}
    if isinstance(kind, Switch):
        return widgets.Checkbox(**common, indent=True)
    if isinstance(kind, Choice):
        options = [(shown, one) for one, shown in kind.options.items()]
        menu = widgets.SelectionSlider if kind.slider else widgets.Dropdown
        return menu(options=options, **common)
    if isinstance(kind, Text):
        # Do not compute while a word is being typed.
        late = {"continuous_update": False, "placeholder": kind.hint, **common}
        return widgets.Textarea(rows=kind.rows, **late) if kind.rows > 1 else widgets.Text(**late)
    if isinstance(kind, Number):
        common |= {"min": kind.shown[0], "max": kind.shown[1]}
    if isinstance(kind, Whole):
        if kind.typed:
            return widgets.BoundedIntText(continuous_update=False, **common)
        return widgets.IntSlider(**common)
    if isinstance(kind, Number):
        digits = max(0, ceil(-log10(kind.step)))
        return widgets.FloatSlider(step=kind.step, readout_format=f".{digits}f", **common)
    return None


def draw_steps(draw: Draw, steps: Sequence[int], axes: Sequence[Axes]) -> None:
    """Draw some frames side by side, as a static figure to show before a stepper.

    Parameters
    ----------
    draw : callable
        Function ``draw(k, ax)`` that draws frame k, counted from 0, on the axes `ax`.
    steps : sequence of int
        Numbers of the frames.
    axes : sequence of matplotlib.axes.Axes
        Axes of each frame.

    Raises
    ------
    ArgumentError
        If the numbers of axes and frames differ.

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
    """Return a slider with back and next buttons to step through frames.

    Parameters
    ----------
    draw : callable
        Function ``draw(k, ax)`` that draws frame k, counted from 0, on the axes `ax`. Each frame is
        drawn once, when it is first shown.
    captions : sequence of str
        One sentence of plain text per frame, for 1 to 1000 frames.
    width, height : float
        Size of a frame [inch].

    Returns
    -------
    ipywidgets.VBox
        Widget to display as the last value of a notebook's cell.

    Raises
    ------
    ArgumentError
        If there are no frames, or more than 1000.

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
    width, height = (
        check_scalar(name, size, "in", 0.1, 100)
        for name, size in (("width", width), ("height", height))
    )
    last = len(captions) - 1
    slider = widgets.IntSlider(0, 0, last, description="step", layout={"width": "26em"})
    back = widgets.Button(description="back", icon="arrow-left")
    on = widgets.Button(description="next", icon="arrow-right")
    caption, image = widgets.Label(), widgets.Image(format="png")
    frame = cache(lambda step: Sheet().png(lambda ax: draw(step, ax), width, height))

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
