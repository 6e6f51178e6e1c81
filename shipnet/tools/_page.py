"""The page that all tools share: controls, verdict, figure, and a state that can be shared."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from html import escape
from importlib.resources import files
from typing import Any

import ipywidgets as widgets

from shipnet.errors import ArgumentError, InputError
from shipnet.tools._controls import Controls, with_help
from shipnet.tools._state import download_link, read_state, write_state
from shipnet.tools._tool import Button, Preset, Upload
from shipnet.tools._view import View

#: Changes that follow each other within this time are computed once [s].
PAUSE = 0.05

#: Faults of a file that are told.
_FAULTS = 50

#: Said where a file or a button changed nothing.
_BEFORE = "The results above are still those from before."


class Page(widgets.VBox):  # type: ignore[misc]
    """The page of a tool."""

    def __init__(
        self,
        tool: str,
        start: Any,
        see: Callable[[Any], View],
        *,
        preset: Preset | None = None,
        buttons: Sequence[Button] = (),
        uploads: Sequence[Upload] = (),
        extras: Sequence[widgets.Widget] = (),
    ) -> None:
        self.tool, self._kind, self._see = tool, type(start), see
        self._due: asyncio.TimerHandle | None = None
        self._due_call: Callable[[], None] | None = None
        self._controls, self._preset = Controls(start), preset
        self._controls.observe(self._changed)
        self.controls, self.presets = self._controls.widgets, {}
        panel = [self._controls.box]
        if preset is not None:
            self._setters = Controls(preset.start)
            self._setters.observe(lambda: self._later(self._make))
            self.presets = self._setters.widgets
            panel.insert(0, self._setters.box)
        self.buttons = {one.label: self._button(one) for one in buttons}
        self.uploads = {one.label: self._upload(one) for one in uploads}
        row = [with_help(self.buttons[one.label], one.help) for one in buttons]
        row += [with_help(self.uploads[one.label], one.help) for one in uploads]
        if row := [*row, *extras]:
            panel.append(_classed(widgets.HBox(row), "shipnet-buttons"))
        load = Upload("load state", "Takes back what was saved.", ".json", self._read)
        self.uploads[load.label] = self._upload(load)
        self.text, self.good, self.note = "", False, ""
        self._said, self._noted = widgets.HTML(), widgets.HTML()
        self.figure, self.links = widgets.HTML(), widgets.HTML()
        foot = widgets.HBox([self.links, self.uploads[load.label], self._noted])
        style = (files("shipnet.tools") / "page.css").read_text(encoding="utf-8")
        super().__init__(
            [
                _classed(widgets.HTML(f"<style>{style}</style>"), "shipnet-style"),
                _classed(widgets.VBox(panel), "shipnet-panel"),
                widgets.HTML('<div class="shipnet-spinner" role="status">computing ...</div>'),
                self._said,
                _classed(self.figure, "shipnet-figure"),
                _classed(foot, "shipnet-foot"),
            ]
        )
        _classed(self, "shipnet-page")
        self.refresh()

    @property
    def inputs(self) -> Any:
        """What the controls say; raises ArgumentError if that is not legal."""
        return self._controls.inputs

    def refresh(self) -> None:
        """Compute and show, now."""
        with self._busy():
            state = ""
            try:
                inputs = self.inputs
                state = download_link(
                    "save state", f"shipnet_{self.tool}.json",
                    write_state(self.tool, inputs), "application/json",
                )  # fmt: skip
                view = self._see(inputs)
                figure = view.figure
            except Exception as problem:  # it becomes a sentence, whatever it is
                view, figure = View(text=_lines(problem), good=False), ""
            self._show(view, figure, state)

    def _show(self, view: View, figure: str, state: str) -> None:
        self.text, self.good, self._said.value = str(view), view.good, view.verdict
        if figure:
            self.figure.value = figure
            self.remove_class("shipnet-stale")
        else:
            self.add_class("shipnet-stale")
        off = '<a class="shipnet-button" aria-disabled="true">save state</a>'
        kept = [
            download_link(f"download {name}", name, content, "application/octet-stream")
            for name, content in view.files.items()
        ]
        self.links.value = " ".join([state or off, *kept])

    def _changed(self) -> None:
        self._later(self._due_call or self.refresh)

    def _later(self, call: Callable[[], None]) -> None:
        """Call after a pause, in which more changes may arrive; at once where no loop runs."""
        self._say("")
        try:
            loop = asyncio.get_running_loop()
        except RuntimeError:
            call()
            return
        self._due_call = call
        if self._due is None:
            self._due = loop.call_later(PAUSE, self._on_time)

    def _on_time(self) -> None:
        call, self._due, self._due_call = self._due_call, None, None
        if call is not None:
            call()

    def _make(self) -> None:
        assert self._preset is not None
        make = self._preset.make
        self._change(lambda: make(self._setters.inputs, self.inputs))

    def _change(self, new: Callable[[], Any], file: str = "") -> None:
        """Take over new inputs, or None for those there are; say what is wrong with them."""
        try:
            with self._busy():
                inputs = new()
                if inputs is not None:
                    self._controls.put(inputs)
        except Exception as problem:  # as in refresh
            self._say(_sentence(problem), f"{_lines(problem)}\n{_BEFORE}")
            return
        self._say("", f"{file} is loaded" if file else "")
        self.refresh()

    def _say(self, note: str, shown: str = "") -> None:
        self.note = note
        (self.add_class if note else self.remove_class)("shipnet-before")
        kind = "bad" if note else "good"
        said = escape(shown).replace("\n", "<br>")
        said = f'<p class="shipnet-note shipnet-{kind}" role="alert">{said}</p>'
        self._noted.value = said if shown else ""

    def _button(self, one: Button) -> widgets.Button:
        button = widgets.Button(description=one.label, tooltip=one.help)
        button.on_click(lambda _: self._change(lambda: one.act(self.inputs)))
        return button

    def _upload(self, one: Upload) -> widgets.FileUpload:
        upload = widgets.FileUpload(accept=one.accept, description=one.label, tooltip=one.label)
        upload.add_class("shipnet-upload")

        def take(_: object) -> None:
            for file in upload.value:
                name, content = file["name"], bytes(file["content"])
                self._change(partial(self._take, one, name, content), name)
            # Else the same file, corrected and loaded again, would be no change.
            upload.value = ()

        upload.observe(take, "value")
        return upload

    def _take(self, one: Upload, name: str, content: bytes) -> Any:
        return one.take(self.inputs, name, content)

    def _read(self, _: object, name: str, content: bytes) -> Any:
        return read_state(content, self.tool, self._kind, name)

    @contextmanager
    def _busy(self) -> Iterator[None]:
        self.add_class("shipnet-busy")
        try:
            yield
        finally:
            self.remove_class("shipnet-busy")


def _classed(widget: widgets.Widget, name: str) -> widgets.Widget:
    widget.add_class(name)
    return widget


def _lines(problem: Exception) -> str:
    """Return what is wrong, a fault a line where a file has several."""
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
