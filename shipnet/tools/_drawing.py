"""The drawing of the AS-i bench, whose devices are dragged in a browser."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, replace
from importlib.resources import files
from time import perf_counter
from typing import TYPE_CHECKING, Any

from shipnet.errors import ArgumentError, load_extra

if TYPE_CHECKING:
    import anywidget
    import traitlets
else:
    anywidget = load_extra("anywidget", "anywidget")
    traitlets = load_extra("traitlets", "traitlets")


class Drawing(anywidget.AnyWidget):
    """A drawing that sends each change of its devices, and shows the answers.

    While a device is dragged, `update` answers with the picture only. Once it is released, the
    change goes to `on_release`, and the page shows the whole answer, including the rules.
    """

    _esm = (files("shipnet.tools") / "bench.js").read_text(encoding="utf-8")
    #: What the drawing needs once: the limits, and the kinds of devices.
    legend = traitlets.Dict().tag(sync=True)

    def __init__(
        self, update: Callable[[Mapping[str, Any]], dict[str, Any]], legend: Mapping[str, Any]
    ) -> None:
        super().__init__(legend=legend)
        self._update = update
        self._inputs: Any = None
        self._asked: int | None = None
        self._begin = perf_counter()
        self.on_release: Callable[[Callable[[], Any]], object] = lambda new: None
        self.on_msg(self._on_message)

    def show(self, inputs: Any) -> None:
        """Show the inputs with their whole answer."""
        self._inputs = inputs
        self._answer(inputs.answer() | {"broken": inputs.broken()})

    def _on_message(self, _: object, message: Mapping[str, Any], buffers: object) -> None:
        self._begin, self._asked, change = perf_counter(), message["asked"], message["change"]
        if not message["final"]:
            try:
                answer = self._update(asdict(self._inputs) | change)
            except ArgumentError as fault:
                answer = {"fault": str(fault)}
            self._answer(answer)
            return
        if change:
            self.on_release(lambda: replace(self._inputs, **change))
        if self._asked is not None:  # the drawing was opened, or the change was refused
            self.show(self._inputs)

    def _answer(self, answer: dict[str, Any]) -> None:
        arrays = answer.pop("arrays", {})
        seconds = perf_counter() - self._begin
        content = answer | {"names": list(arrays), "asked": self._asked, "seconds": seconds}
        self._asked = None
        self.send(content, [array.tobytes() for array in arrays.values()])
