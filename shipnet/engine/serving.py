"""The two junction boxes that the AMS asks, as real Modbus slaves with faults."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from shipnet.clock import nanoseconds
from shipnet.engine.faults import (
    BusOff,
    CanBreak,
    DeadBox,
    DeadPort,
    EngineFault,
    ModbusBreak,
    StuckSensor,
    outages,
)
from shipnet.engine.registers import RegisterMap
from shipnet.engine.run import SyntheticValues
from shipnet.engine.simulation import islands
from shipnet.engine.system import System
from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar
from shipnet.modbus.pdu import ExceptionCode, Request
from shipnet.modbus.server import real_clock
from shipnet.modbus.server import serve as serve_slaves
from shipnet.modbus.slave import DeviceError, Slave, Table

if TYPE_CHECKING:
    from shipnet.modbus.server import Server

#: Unit ids of the boxes on channels 1 and 2; lee2012, Table 2.
UNITS = (2, 3)

#: Function codes of a junction box; lee2012, section IV.1.a.
FUNCTIONS = frozenset({3})

#: Faults that a real server can show: those that are not drawn at random.
_SHOWN = (BusOff, CanBreak, DeadBox, DeadPort, ModbusBreak, StuckSensor)


def serve(
    system: System | None = None,
    *,
    faults: EngineFault | Iterable[EngineFault] = (),
    speed: float = 1.0,
    rng: Any = 2024,
    **options: Any,
) -> Server:
    """Serve the two boxes that the AMS asks as real Modbus slaves, to be used in ``with``.

    Parameters
    ----------
    system : System, optional
        The system, in the printed coding; that of lee2012 if not given.
    faults : fault or iterable of faults, optional
        What goes wrong, in model time. A box that is dead, or cut off from the AMS, does not
        answer; values of a box that is not heard on CAN stay as they are, and are marked after the
        system's `stale_limit`. Losses at random cannot be served.
    speed : float, default 1
        Seconds of the engine in a real one, 0..1e4.
    rng : optional
        Draws the waves of the synthetic values; whatever `numpy.random.default_rng` takes.
    **options
        As `shipnet.modbus.serve` takes them: transport, host, port, and for a serial line
        serial_port and line.

    Returns
    -------
    Server
        Unit ids 2 and 3, a slave each. Function code 3 reads the registers of `RegisterMap`: one
        per point, in the order of Table 3, temperatures in tenths of a degree.

    Raises
    ------
    ArgumentError
        If a number is out of range, the system has the corrected coding, or a fault cannot be
        served.

    Examples
    --------
    >>> from shipnet import engine
    >>> server = engine.serve(speed=0, faults=engine.faults.DeadBox("JB3"))
    >>> server.slaves[2].answer(bytes.fromhex("03 0000 0002")).hex(" ")
    '03 04 03 ae 04 03'
    >>> server.slaves[3].answer(bytes.fromhex("03 0000 0002"))
    b''
    """
    system = System() if system is None else system
    if system.coding != "printed":
        raise ArgumentError("coding is 'corrected'; only a system in the printed coding is served")
    factor = check_scalar("speed", speed, "s/s", 0, 1e4)
    wrong = system.check_faults(faults)
    for fault in wrong:
        if not isinstance(fault, _SHOWN):
            raise ArgumentError(f"one of faults is {fault!r}; losses at random cannot be served")
    sensors = SyntheticValues(system.points, rng)
    slaves = {
        unit: _BoxSlave(system, wrong, sensors, channel) for channel, unit in enumerate(UNITS)
    }
    return serve_slaves(slaves, clock=real_clock(factor), **options)


def parse_fault(system: System, words: str) -> EngineFault:
    """Return the lasting fault that these words name, such as ``box dead JB1``."""
    known = {str(fault): fault for fault in system.single_faults(0.0, every_sensor=True)}
    if words not in known:
        one_each = {type(fault): str(fault) for fault in reversed(system.single_faults(0.0))}
        few = ", ".join(sorted(one_each.values(), key=str.lower))
        raise ArgumentError(f"fault is {words!r}; it must be like one of {few}")
    return known[words]


class JunctionBox:
    """The holding registers of one of the two boxes, filled anew for each request."""

    def __init__(
        self, system: System, faults: Sequence[EngineFault], sensors: SyntheticValues, box: int
    ) -> None:
        self.system, self.faults, self.sensors, self.box = system, faults, sensors, box
        self.registers = RegisterMap(system.points)

    def read(self, table: Table, address: int, quantity: int, time: float) -> list[int]:
        """Return registers in a row; exception 2 if one of them does not exist."""
        first = address - self.registers.first_address
        if table != "holding_registers" or not 0 <= first <= len(self.registers) - quantity:
            raise DeviceError(ExceptionCode.ILLEGAL_DATA_ADDRESS)
        content: list[int] = self.registers.encode(self.values(time)).tolist()
        return content[first : first + quantity]

    def write(self, table: Table, address: int, values: Sequence[int], time: float) -> None:
        """Refuse: nothing can be written to a junction box."""
        raise DeviceError(ExceptionCode.ILLEGAL_FUNCTION)

    def values(self, time: float) -> npt.NDArray[np.float64]:
        """Return what the box knows of every point at a time [s], NaN where it marks it."""
        now = nanoseconds(time)
        heard = [self._heard(box, now) for box in range(len(self.system.boxes))]
        limit = nanoseconds(self.system.stale_limit)
        values = np.full(len(self.system.points), np.nan)
        for place, (point, box) in enumerate(
            zip(self.system.points, self.system.box_of.tolist(), strict=True)
        ):
            last = heard[box]
            if last is None or now - last > limit:
                continue
            for begin, stop in outages(self.faults, point.tag, StuckSensor):
                last = begin if begin < last < stop else last
            values[place] = self.sensors.at(place, last / 1e9)
        return values

    def _heard(self, sender: int, now: int) -> int | None:
        """Return when this box heard another one last [ns], None if never."""
        if sender == self.box:
            return now
        borders = sorted({0, *(t for fault in self.faults for t in fault.span if 0 < t <= now)})
        for begin, end in zip(reversed(borders), [now, *reversed(borders[1:])], strict=True):
            if any({sender, self.box} <= set(part) for part in self._parts(begin)):
                return end
        return None

    def _parts(self, time: int) -> list[list[int]]:
        return islands(self.system, self.faults, time)


class _BoxSlave(Slave):
    """A junction box on its channel; it is silent while it is dead or cannot be reached."""

    def __init__(
        self,
        system: System,
        faults: Sequence[EngineFault],
        sensors: SyntheticValues,
        channel: int,
    ) -> None:
        box = system.ports[channel]
        super().__init__(JunctionBox(system, faults, sensors, box), functions=FUNCTIONS)
        where = {str(channel + 1): (ModbusBreak, DeadPort), system.boxes[box]: (DeadBox,)}
        spans = [span for name, kinds in where.items() for span in outages(faults, name, *kinds)]
        object.__setattr__(self, "_spans", spans)

    def answer(self, request: Request | bytes, time: float = 0.0) -> bytes:
        """Execute a request, unless the box is silent at this time."""
        now = nanoseconds(time)
        spans: list[tuple[int, int]] = self._spans  # type: ignore[attr-defined]
        return b"" if any(a <= now < b for a, b in spans) else super().answer(request, time)
