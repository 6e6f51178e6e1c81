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
import pandas as pd
from matplotlib.axes import Axes

from shipnet import style
from shipnet.ballast.live import valve_server
from shipnet.ballast.master import valve_states
from shipnet.ballast.plot import plot_screen
from shipnet.ballast.registers import COMMAND_REGISTER, Code, RegisterMap, Status
from shipnet.ballast.scan import READ_STATUS
from shipnet.errors import ArgumentError
from shipnet.fields import check_whole, record, text, whole
from shipnet.modbus.adu import MAX_UNIT
from shipnet.modbus.pdu import ExceptionCode, Request
from shipnet.tools._page import Page
from shipnet.tools._tool import Button, Tool
from shipnet.tools._valve_link import Ask, Link, ModelValves
from shipnet.tools._view import View

#: Valves of the server that the explorer starts, and how it reads their registers.
_OWN, _MAP = 16, RegisterMap()


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
    status: Status
    units: np.ndarray[tuple[int], np.dtype[np.int64]]

    @property
    def positions(self) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
        """Position of all valves from 1 on, shape (valves,) [%]; NaN where none answered."""
        found = np.full(self.inputs.valves, np.nan)
        found[self.units - 1] = self.status.readings[4]
        return found

    @property
    def screen(self) -> pd.DataFrame:
        """One row a valve, as `MasterRun.screen` has them, for the picture."""
        position = self.positions
        current = np.zeros(self.inputs.valves)
        current[self.units - 1] = self.status.readings[2]
        fault = np.zeros(self.inputs.valves, np.int64)
        fault[self.units - 1] = self.status.fault
        silent = np.ones(self.inputs.valves, bool)
        silent[self.units - 1] = False
        state = valve_states(position, current, fault, silent=silent)
        columns = {"position_percent": position, "fault": fault, "state": state}
        return pd.DataFrame(columns, index=pd.RangeIndex(1, position.size + 1, name="unit"))

    @property
    def numbers(self) -> dict[str, str]:
        """What the chosen valve says, as text with units; nothing if it does not answer."""
        place = np.flatnonzero(self.units == self.inputs.valve)
        if not place.size:
            return {}
        k, status = int(place[0]), self.status
        fp, op, mc, ot, position = status.readings[:, k]
        mode = "auto" if status.auto[k] else "manual"
        way = "open" if status.open[k] else "close" if status.close[k] else "not told yet"
        return {
            "position": _said(position, 0, "%"),
            "pump pressure": _said(fp, 0, "bar"),
            "operating pressure": _said(op, 1, "bar"),
            "motor current": _said(mc, 1, "A"),
            "motor temperature": _said(ot, 0, "degC"),
            "motor ran": f"{status.operating_time[k]:.1f} s",
            "mode": f"{mode}, last command {way}",
            "fault reported": str(int(status.fault[k])) if status.fault[k] else "none",
        }

    @property
    def verdict(self) -> str:
        """The chosen valve in a few words."""
        row = self.screen.loc[self.inputs.valve]
        if row["state"] == "silent":
            return f"valve {self.inputs.valve} does not answer"
        where = _said(self.positions[self.inputs.valve - 1], 0, "%")
        return f"valve {self.inputs.valve}: {row['state']}, {where}"


def send(ask: Ask, valve: int, action: str, position: int | None = None) -> str:
    """Command a valve."""
    unit = check_whole("valve", valve, 1, MAX_UNIT)
    codes = {code.value.lower(): code for code in Code}
    codes["position"] = Code.POSITION_OPEN
    if action not in ("open", "close", "position", "manual", "auto"):
        raise ArgumentError(
            f"action is {action!r}; it must be open, close, position, manual or auto"
        )
    if position is None and action == "position":
        raise ArgumentError("position is None; it must be a whole number 0..100 for position")
    value = _MAP.command(codes[action], position if position is not None else 0)
    response = ask(unit, Request.write_single_register(COMMAND_REGISTER, value))
    if response.exception is not None:
        return f"valve {unit} refuses: {_words(response.exception)}"
    where = f" {position} %" if action == "position" else ""
    return f"valve {unit}: {action}{where}"


def update(inputs: ValveClient, ask: Ask) -> Result:
    """Read all valves."""
    words, units = [], []
    for unit in range(1, inputs.valves + 1):
        response = ask(unit, READ_STATUS)
        if response.exception is None:
            words.append(response.registers)
            units.append(unit)
    status = _MAP.unpack(np.array(words, np.int64).reshape(-1, 4))
    return Result(inputs, status, np.array(units, np.int64))


def draw(result: Result, *, ax: Axes) -> Axes:
    """Draw the openings of all valves, the chosen one framed."""
    return plot_screen(result.screen, ax=ax, chosen=result.inputs.valve)


def view(result: Result, said: str = "", *, refused: bool = False) -> View:
    """Return what the page shows of a result."""
    return View(
        text=result.verdict,
        good=not refused and "not answer" not in result.verdict,
        numbers=({"last command": said} if said else {}) | result.numbers,
        draw=lambda ax: draw(result, ax=ax),
        height=0.7 + 0.7 * -(-result.inputs.valves // 32),
        about="Opening of every valve, as a bar",
    )


class Explorer(Page):
    """The client's page; its server is closed by `close`, and at the end of the kernel."""

    def __init__(self, start: ValveClient) -> None:
        self.server = valve_server(_OWN, rng=np.random.default_rng()).__enter__()
        self._end = finalize(self, self.server.__exit__)
        self._link: Link | None = None
        self._place: tuple[str, int] | None = None
        self._answer, self._refused = "", 0
        # The browser counts, and each count is a reading: no thread is needed.
        clock = widgets.Play(min=0, max=10**6, interval=500, repeat=True, show_repeat=False)
        clock.tooltip = "Reads all valves twice a second."
        clock.observe(lambda _: self.refresh(), "value")
        super().__init__(
            "valve_client",
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
        target = inputs.target if action == "position" else None
        try:
            self._answer = send(self._connected(inputs), inputs.valve, action, target)
        except OSError as problem:
            self._hang_up()
            self._answer = str(problem)
        self._refused = inputs.valve if "refuses" in self._answer else 0

    def _look(self, inputs: ValveClient) -> View:
        try:
            result = update(inputs, self._connected(inputs))
        except OSError as problem:
            self._hang_up()
            return View(text=str(problem), good=False)
        # The refusal stays said, but it is bad news of one valve only.
        return view(result, self._answer, refused=self._refused == inputs.valve)


def _said(value: float, digits: int, unit: str) -> str:
    return "missing" if np.isnan(value) else f"{value:.{digits}f} {unit}"


def _words(exception: int) -> str:
    return ExceptionCode(exception).name.replace("_", " ").lower()
