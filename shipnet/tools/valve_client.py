"""The valve client: open, close and set ballast valves over Modbus/TCP, as the paper's PC does.

Static pictures talk to valves in model time; the explorer talks to a server of its own on this
machine, or to one whose address is typed.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from weakref import finalize

import ipywidgets as widgets
import numpy as np
from matplotlib.axes import Axes

from shipnet import style
from shipnet.ballast.live import Ask, Client, Link, ModelValves, Readout, said, serve
from shipnet.ballast.master import Screen
from shipnet.fields import record, text, whole
from shipnet.modbus.frame import MAX_UNIT
from shipnet.tools._page import Page
from shipnet.tools._tool import Tool
from shipnet.tools._view import Button, View

#: Valves of the server that the explorer starts.
_OWN = 16


@record
class ValveClient(Tool):
    """Ballast valves over Modbus/TCP: open, close and set them, and see what they answer.

    `result` has the answers of model valves in model time; the page talks to a server.

    Raises
    ------
    ArgumentError
        If a value is out of its range.

    Examples
    --------
    >>> ValveClient(valves=3).verdict
    'valve 1: closed, 0 %'
    """

    address: str = text(
        default="", hint="own server", label="address",
        help="Name or address of a server; empty is one of its own, which this page starts.",
    )  # fmt: skip
    port: int = whole(
        1,
        0xFFFF,
        default=5020,
        typed=True,
        label="port",
        help="Its port; without an address it is not read.",
    )
    valves: int = whole(
        1,
        MAX_UNIT,
        default=_OWN,
        typed=True,
        label="valves shown",
        help=f"Its own server has {_OWN}.",
    )
    valve: int = whole(
        1,
        MAX_UNIT,
        default=1,
        at_most="valves",
        label="valve",
        help="The valve that the buttons command.",
    )
    target: int = whole(
        0,
        100,
        default=40,
        unit="%",
        label="position",
        help="Where the button of this name sends the valve.",
    )

    @cached_property
    def result(self) -> Result:
        """What model valves answer that nobody has commanded yet."""
        return update(self, ModelValves(self.valves))

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the openings of all valves."""
        return draw(self.result, ax=style.axes(ax))

    def explore(self) -> Explorer:
        """Return the page, with a server of its own that listens on this machine only."""
        return Explorer(self)

    def _view(self) -> View:
        """Return what the page shows of model valves."""
        return view(self.result)


@dataclass(frozen=True, eq=False)
class Result:
    """What the valves answered."""

    inputs: ValveClient
    readout: Readout

    @property
    def screen(self) -> Screen:
        """All valves, for the picture."""
        return self.readout.screen

    @property
    def numbers(self) -> dict[str, str]:
        """What the chosen valve says, as text with units; nothing if it does not answer."""
        return self.readout.numbers(self.inputs.valve)

    @property
    def verdict(self) -> str:
        """The chosen valve in a few words."""
        row = self.screen[self.inputs.valve]
        if row["state"] == "silent":
            return f"valve {self.inputs.valve} does not answer"
        where = said(row["position_percent"], 0, "%")
        return f"valve {self.inputs.valve}: {row['state']}, {where}"


def send(ask: Ask, valve: int, action: str | float) -> str:
    """Command a valve over a `Link` or `ModelValves`; return what was done, as a sentence.

    Examples
    --------
    >>> send(ModelValves(4), 5, "close")
    'valve 5 refuses: gateway target failed to respond'
    """
    return Client.over(ask).command(valve, action)


def update(inputs: ValveClient, ask: Ask) -> Result:
    """Read all valves over a `Link` or `ModelValves`.

    Examples
    --------
    >>> result = update(ValveClient(valves=3), ModelValves(2))
    >>> result.readout.units.tolist(), result.verdict
    ([1, 2], 'valve 1: closed, 0 %')
    """
    return Result(inputs, Client.over(ask, inputs.valves).read())


def draw(result: Result, *, ax: Axes) -> Axes:
    """Draw the openings of all valves, the chosen one framed.

    Parameters
    ----------
    result : Result
        What `update` returned.
    ax : matplotlib.axes.Axes
        Where to draw.

    Returns
    -------
    matplotlib.axes.Axes
        The axes given.

    Examples
    --------
    >>> from matplotlib.figure import Figure
    >>> ax = draw(update(ValveClient(valves=3), ModelValves(3)), ax=Figure().subplots())
    >>> [text.get_text() for text in ax.get_legend().get_texts()]
    ['closed']
    """
    return result.screen.plot(result.inputs.valve, ax)


def view(result: Result, said: str = "", *, refused: bool = False) -> View:
    """Return what the page shows of a result.

    Parameters
    ----------
    result : Result
        What `update` returned.
    said : str, optional
        What became of the last command.
    refused : bool, default False
        Whether the chosen valve refused it.

    Returns
    -------
    View
        Verdict, numbers and figure.

    Examples
    --------
    >>> view(update(ValveClient(valves=3, valve=3), ModelValves(2))).ok
    False
    """
    return View(
        verdict=result.verdict,
        ok=not refused and "not answer" not in result.verdict,
        numbers=({"last command": said} if said else {}) | result.numbers,
        plot=lambda ax: draw(result, ax=ax),
        height=0.7 + 0.7 * -(-result.inputs.valves // 32),
        about="Opening of every valve, as a bar",
    )


class Explorer(Page):
    """The client's page; its server is closed by `close`, and at the end of the kernel.

    Attributes
    ----------
    server : Server
        The explorer's own, of 16 valves in real time.
    """

    def __init__(self, start: ValveClient) -> None:
        self.server = serve(_OWN, rng=np.random.default_rng()).__enter__()
        self._end = finalize(self, self.server.__exit__)
        self._link: Link | None = None
        self._place: tuple[str, int] | None = None
        self._answer, self._refused = "", 0
        # The browser counts, and each count is a reading: no thread is needed.
        clock = widgets.Play(min=0, max=10**6, interval=500, repeat=True, show_repeat=False)
        clock.tooltip = "Reads all valves twice a second."
        clock.observe(lambda _: self.refresh(), "value")
        super().__init__(
            start,
            self._look,
            buttons=[
                Button("open", "Opens the valve.", lambda given: self._tell(given, "open")),
                Button("close", "Closes the valve.", lambda given: self._tell(given, "close")),
                Button("position", "Sends it there.", lambda given: self._tell(given, "position")),
                Button("read again", "Reads all valves.", lambda _: None),
            ],
            extras=[clock],
        )

    def close(self) -> None:
        """Close connection and server, and the page."""
        self._hang_up()
        self._end()
        super().close()

    def _hang_up(self) -> None:
        if self._link is not None:
            self._link.close()
        self._link = self._place = None

    def _connected(self, inputs: ValveClient) -> Link:
        address = inputs.address.strip()
        place = (address, inputs.port) if address else ("127.0.0.1", self.server.port)
        if self._link is None or self._place != place:
            self._hang_up()
            self._link, self._place = Link(*place), place
        return self._link

    def _tell(self, inputs: ValveClient, action: str) -> None:
        told = inputs.target if action == "position" else action
        try:
            self._answer = send(self._connected(inputs), inputs.valve, told)
        except OSError as problem:
            self._hang_up()
            self._answer = str(problem)
        self._refused = inputs.valve if "refuses" in self._answer else 0

    def _look(self, inputs: ValveClient) -> View:
        try:
            result = update(inputs, self._connected(inputs))
        except OSError as problem:
            self._hang_up()
            return View(verdict=str(problem), ok=False)
        # The refusal stays said, but it is bad news of one valve only.
        return view(result, self._answer, refused=self._refused == inputs.valve)
