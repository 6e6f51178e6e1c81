"""The valve client: open, close and set ballast valves over Modbus/TCP, as the paper's PC does.

Static pictures show valves in simulated time. The page connects to its own server on this machine,
or to another server.
"""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING
from weakref import finalize

import numpy as np
from matplotlib.axes import Axes

from shipnet.ballast.live import Client, Link, ModelValves, Readout, reading_text, serve
from shipnet.ballast.master import LEAST_CURRENT
from shipnet.ballast.sensors import CHANNELS
from shipnet.errors import load_extra
from shipnet.fields import record, text, whole
from shipnet.modbus.frame import MAX_UNIT
from shipnet.tools._page import Page
from shipnet.tools._tool import Tool
from shipnet.tools._view import Button, View, words

_WORDS = words("valve_client")

if TYPE_CHECKING:
    import ipywidgets as widgets
else:
    widgets = load_extra("ipywidgets", "ipywidgets")

#: Number of valves on the server that the explorer starts.
_OWN = 16


@record
class ValveClient(Tool):
    """Ballast valves over Modbus/TCP: open, close and set them, and see their responses.

    `result` has the responses of valves in simulated time; the page connects to a server.

    Examples
    --------
    >>> ValveClient(valves=3).verdict
    'valve 1: closed, 0 %'
    """

    address: str = text(_WORDS["address"], default="", hint="own server")
    port: int = whole(1, 0xFFFF, help=_WORDS["port"], default=5020, typed=True)
    valves: int = whole(1, MAX_UNIT, help=_WORDS["valves"], default=_OWN, typed=True)
    valve: int = whole(1, MAX_UNIT, help=_WORDS["valve"], default=1, at_most="valves")
    target: int = whole(0, 100, "%", _WORDS["target"], default=40)

    @cached_property
    def result(self) -> Readout:
        """The responses of simulated valves before any command."""
        return Client.over(ModelValves(self.valves), self.valves).read()

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the openings of all valves, with a frame around the chosen valve."""
        return self.result.screen.plot(self.valve, ax)

    def explore(self, story: bool = False) -> Explorer:
        """Return the page, with a server of its own that listens on this machine only."""
        return Explorer(self, story)

    def _view(self) -> View:
        return self.view(self.result)

    def view(self, readout: Readout, answer: str = "") -> View:
        """Return the view of the valves that were read; `answer` is that to the last command."""
        row = readout.screen[self.valve]
        silent = row["state"] == "silent"
        status = f"{row['state']}, {reading_text(row['position_percent'], 0, '%')}"
        idle = {"target": "the button 'position' sends it"}
        if not self.address.strip():
            idle["port"] = "the page uses its own server"
        return View(
            verdict=f"valve {self.valve}{' does not respond' if silent else f': {status}'}",
            ok=not (silent or "refuses" in answer),
            numbers=({"sent from here": answer} if answer else {}) | readout.numbers(self.valve),
            plot=lambda ax: readout.screen.plot(self.valve, ax),
            height=0.7 + 0.7 * -(-self.valves // 32),
            about="Opening of each valve, as a bar",
            data=lambda: readout.rows,
            idle=idle,
            uses=self._for_diagnosis(readout),
        )

    def _for_diagnosis(self, readout: Readout) -> dict[str, dict[str, object]]:
        """Return the valve's readings for the diagnosis; one reading has no speed of a valve."""
        row = readout.rows.loc[self.valve]
        if row.isna().any() or row["MC_A"] >= LEAST_CURRENT:
            return {}
        readings = {channel.name: row[channel.column] for channel in CHANNELS}
        return {"valve_diagnosis": readings | {"DVPos": 0.0, "commanded": False}}


class Explorer(Page):
    """The client's page; `close`, or the end of the kernel, closes its server.

    Attributes
    ----------
    server : Server
        The explorer's own server, with 16 valves in real time.
    """

    def __init__(self, start: ValveClient, story: bool = False) -> None:
        self.server = serve(_OWN, rng=np.random.default_rng()).__enter__()
        self._end = finalize(self, self.server.__exit__)
        self._link: Link | None = None
        self._endpoint: tuple[str, int] | None = None
        # The answer to the last command of each valve, by address, port and valve.
        self._answers: dict[tuple[str, int, int], str] = {}
        # The browser's counter triggers each reading of the valves, so no thread is needed.
        clock = widgets.Play(min=0, max=10**6, interval=500, repeat=True, show_repeat=False)
        clock.tooltip = "Reads all valves twice per second."
        clock.observe(lambda _: self.refresh(), "value")
        super().__init__(
            start,
            self._look,
            buttons=[
                Button("open", "Opens the valve.", lambda now: self._command(now, "open")),
                Button("close", "Closes the valve.", lambda now: self._command(now, "close")),
                Button("position", "Moves the valve.", lambda now: self._command(now, now.target)),
                Button("read again", "Reads all valves.", lambda _: None),
            ],
            extras=[clock],
            folds={"server": ("address", "port", "valves")},
            story=story,
            live=True,
        )

    def close(self) -> None:
        """Close the connection, the server and the page."""
        self._hang_up()
        self._end()
        super().close()

    def _hang_up(self) -> None:
        if self._link is not None:
            self._link.close()
        self._link = self._endpoint = None

    def _client(self, inputs: ValveClient) -> Client:
        address = inputs.address.strip()
        endpoint = (address, inputs.port) if address else ("127.0.0.1", self.server.port)
        if self._link is None or self._endpoint != endpoint:
            self._hang_up()
            self._link, self._endpoint = Link(*endpoint), endpoint
        return Client.over(self._link, inputs.valves)

    def _command(self, inputs: ValveClient, action: str | float) -> None:
        valve = (inputs.address, inputs.port, inputs.valve)
        try:
            self._answers[valve] = self._client(inputs).command(inputs.valve, action)
        except OSError as problem:
            self._hang_up()
            self._answers[valve] = str(problem)

    def _look(self, inputs: ValveClient) -> View:
        try:
            readout = self._client(inputs).read()
        except OSError as problem:
            self._hang_up()
            return View(verdict=str(problem), ok=False)
        valve = (inputs.address, inputs.port, inputs.valve)
        return inputs.view(readout, self._answers.get(valve, ""))
