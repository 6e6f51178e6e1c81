"""Controls for the inputs of a tool, made from what its fields ask for."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from html import escape
from math import ceil, log10
from typing import Any

import ipywidgets as widgets

from shipnet.fields import Choice, Kind, Number, Switch, Text, Whole, declared


class Controls:
    """A control for each field of a dataclass, with its help."""

    def __init__(self, start: Any) -> None:
        self._kind = type(start)
        self._asked = declared(self._kind)
        self._held = {name: getattr(start, name) for name in self._asked}
        self._quiet, self._observers = False, list[Callable[[], None]]()
        self.widgets: dict[str, widgets.Widget] = {}
        rows = []
        for name, kind in self._asked.items():
            control = _widget(kind, self._held[name])
            if control is None:
                continue
            self.widgets[name] = control
            rows.append(_row(control, kind))
            control.observe(self._changed, "value")
        for name, kind in self._asked.items():
            if isinstance(kind, Whole) and kind.at_most:
                self._bound(name, kind, self.widgets[kind.at_most])
        self._seen = self._values()
        self.box = widgets.Box(rows)
        self.box.add_class("shipnet-controls")

    @property
    def inputs(self) -> Any:
        """What the controls say, as an instance of the dataclass; raises ArgumentError."""
        return self._kind(**self._values())

    def _values(self) -> dict[str, Any]:
        """Return all values; a browser's sliders come to their steps by adding, so round."""
        shown = {
            name: round(control.value, 9)
            if isinstance(self._asked[name], Number)
            else control.value
            for name, control in self.widgets.items()
        }
        return {**self._held, **shown}

    def put(self, inputs: Any) -> None:
        """Set all controls without a word to the observers, each to its nearest step.

        Raises ArgumentError, and changes nothing, if a slider does not reach a value.
        """
        for name, kind in self._asked.items():
            kind.check_shown(name, getattr(inputs, name))
        with self._quietly():
            for name in self._asked:
                value = getattr(inputs, name)
                if name in self.widgets:
                    self.widgets[name].value = _on_step(self._asked[name], value)
                else:
                    self._held[name] = value

    def observe(self, call: Callable[[], None]) -> None:
        """Call a function after each change that the user makes."""
        self._observers.append(call)

    @contextmanager
    def _quietly(self) -> Iterator[None]:
        self._quiet = True
        try:
            yield
        finally:
            self._quiet = False
            self._seen = self._values()

    def _changed(self, _: object) -> None:
        # What a browser sends back after `put` is no change.
        if not self._quiet and self._seen != self._values():
            self._seen = self._values()
            for call in self._observers:
                call()

    def _bound(self, name: str, kind: Whole, other: widgets.Widget) -> None:
        def follow(_: object = None) -> None:
            self.widgets[name].max = max(kind.shown[0], min(kind.shown[1], other.value))

        # First of all observers: a control that is beyond its new end is moved before it is read.
        other.unobserve(self._changed, "value")
        other.observe(follow, "value")
        other.observe(self._changed, "value")
        follow()


def with_help(control: widgets.Widget, help: str) -> widgets.VBox:
    """Return a control with a sentence that shows while the control is pointed at or in use."""
    said = widgets.HTML(f'<div class="shipnet-help">{escape(help)}</div>')
    row = widgets.VBox([control, said])
    row.add_class("shipnet-control")
    return row


def _row(control: widgets.Widget, kind: Kind) -> widgets.VBox:
    control.tooltip = kind.help
    row = with_help(control, kind.help)
    if isinstance(kind, Text) and kind.rows > 1:
        row.add_class("shipnet-editor")
    return row


def _on_step(kind: Kind, value: Any) -> Any:
    """Return the value as the slider holds it; the browser would move it there in any case."""
    if not isinstance(kind, Number):
        return value
    low, high = kind.shown
    return min(high, round(low + kind.step * round((value - low) / kind.step), 9))


def _widget(kind: Kind, value: Any) -> widgets.Widget | None:
    unit = getattr(kind, "unit", "")
    label = f"{kind.label} [{unit}]" if unit else kind.label
    common: dict[str, Any] = {"value": value, "description": label}
    if isinstance(kind, Switch):
        return widgets.Checkbox(**common, indent=True)
    if isinstance(kind, Choice):
        options = [(said, one) for one, said in kind.options.items()]
        menu = widgets.SelectionSlider if kind.slider else widgets.Dropdown
        return menu(options=options, **common)
    if isinstance(kind, Text):
        # Half a word is nothing to compute with.
        late = {"continuous_update": False, "placeholder": kind.hint, **common}
        return widgets.Textarea(rows=kind.rows, **late) if kind.rows > 1 else widgets.Text(**late)
    if isinstance(kind, Whole | Number):
        common |= {"min": kind.shown[0], "max": kind.shown[1]}
    if isinstance(kind, Whole):
        if kind.typed:
            return widgets.BoundedIntText(continuous_update=False, **common)
        return widgets.IntSlider(**common)
    if isinstance(kind, Number):
        digits = max(0, ceil(-log10(kind.step)))
        return widgets.FloatSlider(step=kind.step, readout_format=f".{digits}f", **common)
    return None
