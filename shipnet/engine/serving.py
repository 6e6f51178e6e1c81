"""The two junction boxes that the AMS polls, as real Modbus slaves with faults."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from shipnet.arrays import Floats
from shipnet.clock import nanoseconds
from shipnet.engine.faults import (
    BusOff,
    CanBreak,
    DeadBox,
    DeadPort,
    EngineFault,
    ModbusBreak,
    OpenWire,
    ShortCircuit,
    StuckSensor,
    outages,
)
from shipnet.engine.registers import RegisterMap
from shipnet.engine.run import SyntheticValues, reading
from shipnet.engine.simulation import islands
from shipnet.engine.system import System
from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar
from shipnet.lazy import pd
from shipnet.modbus.pdu import ExceptionCode, Request
from shipnet.modbus.server import Server, real_clock
from shipnet.modbus.server import serve as serve_slaves
from shipnet.modbus.slave import DeviceError, Slave, Table

#: Unit ids of the boxes on channels 1 and 2; lee2012, Table 2.
UNITS = (2, 3)

#: Function codes of a junction box; lee2012, section IV.1.a.
FUNCTIONS = frozenset({3})

#: Unit id of the registers that inject faults, and the address of the first sensor's register.
FAULT_UNIT, _SENSORS = 247, 100

#: Faults that a real server can show: faults of parts, in the order of their registers, and faults
#: of sensors, in the order of their numbers in a register.
_PARTS = (DeadBox, BusOff, CanBreak, ModbusBreak, DeadPort)
_OF_SENSORS = (StuckSensor, OpenWire, ShortCircuit)

#: Words for faults in texts such as ``2:dead``: a place, a colon and the fault.
_WORDS: dict[str, tuple[type[EngineFault], ...]] = {
    "dead": (DeadBox,),
    "bus-off": (BusOff,),
    "cut": (ModbusBreak, CanBreak),
    "stuck": (StuckSensor,),
    "open": (OpenWire,),
    "short": (ShortCircuit,),
}


def serve(
    system: System | None = None,
    *,
    faults: EngineFault | Iterable[EngineFault] = (),
    speed: float = 1.0,
    rng: Any = 2024,
    **options: Any,
) -> Server:
    """Serve, as real Modbus slaves, the two boxes that the AMS polls; for use in a ``with`` block.

    Parameters
    ----------
    system : System, optional
        The system, which must have the printed coding; by default, that of lee2012.
    faults : fault or iterable of faults, optional
        Faults in simulated time; random losses cannot be served. A box that is dead, or cut off
        from the AMS, does not respond. If the CAN frames of a box are not received, its values stay
        unchanged, and are marked after the system's `stale_limit`.
    speed : float, default 1
        Simulated seconds per real second, 0..1e4.
    rng : optional
        Source of the synthetic values, for `numpy.random.default_rng`.
    **options
        Options of `shipnet.modbus.serve`: transport, host, port, wire_faults, and, for a serial
        line, serial_port and line.

    Returns
    -------
    Server
        A server with one slave for each of the unit ids 2 and 3. Function code 3 reads one register
        per point, in the order of Table 3, with temperatures in tenths of a degree. Unit id 247 has
        the `fault_registers`; writing to them injects more faults while the server runs.

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
    wrong = list(system.check_faults(faults))
    for fault in wrong:
        if not isinstance(fault, (*_PARTS, *_OF_SENSORS)):
            raise ArgumentError(f"one of faults is {fault!r}; random losses cannot be served")
    sensors = SyntheticValues(system.points, rng)
    slaves: dict[int, Slave] = {
        unit: _BoxSlave(JunctionBox(system, wrong, sensors, box), functions=FUNCTIONS)
        for unit, box in zip(UNITS, system.ports, strict=True)
    }
    slaves[FAULT_UNIT] = Slave(FaultRegisters(system, wrong), functions={3, 6, 16})
    return serve_slaves(slaves, clock=real_clock(factor), **options)


def parse_fault(system: System, words: str) -> EngineFault:
    """Return the lasting fault that a text such as ``2:dead`` describes."""
    where, _, what = words.rpartition(":")
    unit = {str(unit): channel for channel, unit in enumerate(UNITS)}.get(where)
    for kind in _WORDS.get(what, ()):
        target = where
        if unit is not None:
            target = str(unit + 1) if kind.at == "channel" else system.boxes[system.ports[unit]]
        if target in system.places[kind.at]:
            return kind(target)
    raise ArgumentError(
        f"fault is {words!r}; it must be a place and a fault, such as 2:dead, "
        "JB2:bus-off, 3:cut (unit 3's channel), JB1-JB2:cut (a CAN cable) or ME-JB2-044:open "
        "(also stuck, short)"
    )


def fault_registers(system: System | None = None) -> pd.DataFrame:
    """Return the registers of unit id 247, which inject faults into a served engine.

    Function code 3 reads them; 6 and 16 write them. A fault begins when its number is written; 0
    ends it.

    Parameters
    ----------
    system : System, optional
        The system; by default, that of lee2012.

    Returns
    -------
    pandas.DataFrame
        One row per ``address``: ``where`` a fault can occur, and what the register ``holds``.

    Examples
    --------
    >>> from shipnet import engine
    >>> table = engine.fault_registers()
    >>> print(*table.loc[0], table.loc[100, "holds"], sep="; ")
    JB1; 1 box dead; 1 sensor stuck, 2 sensor wire open, 3 sensor wires shorted
    """
    registers = FaultRegisters(System() if system is None else system, [])
    rows = [
        (address, where, ", ".join(f"{n} {kind.words}" for n, kind in enumerate(kinds, 1)))
        for address, (where, kinds) in registers.rows.items()
    ]
    return pd.DataFrame(rows, columns=["address", "where", "holds"]).set_index("address")


class FaultRegisters:
    """The device with the `fault_registers`; it changes the list of `faults` that the boxes use."""

    def __init__(self, system: System, faults: list[EngineFault]) -> None:
        self.faults = faults
        places = system.places
        parts = [(where, (kind,)) for kind in _PARTS for where in places[kind.at]]
        sensors = [(where, _OF_SENSORS) for where in places["sensor"]]
        self.rows: dict[int, tuple[str, tuple[type[EngineFault], ...]]]
        self.rows = dict(enumerate(parts)) | dict(enumerate(sensors, _SENSORS))

    def read(self, table: Table, address: int, quantity: int, time: float) -> list[int]:
        """Return, for each register, the number of the fault now present, or 0 if there is none."""
        now = nanoseconds(time)
        content = []
        for where, kinds in self._rows(table, address, quantity):
            present = [
                number
                for number, kind in enumerate(kinds, 1)
                if any(a <= now < b for a, b in outages(self.faults, where, kind))
            ]
            content.append(min(present, default=0))
        return content

    def write(self, table: Table, address: int, values: Sequence[int], time: float) -> None:
        """End the faults now present in these registers; begin those whose numbers are written."""
        rows = self._rows(table, address, len(values))
        if any(value > len(kinds) for value, (_, kinds) in zip(values, rows, strict=True)):
            raise DeviceError(ExceptionCode.ILLEGAL_DATA_VALUE)
        for value, (where, kinds) in zip(values, rows, strict=True):
            kept = []
            for fault in self.faults:
                here = type(fault) in kinds and fault.where == where
                if not here or not fault.start <= time < fault.stop:
                    kept.append(fault)
                elif fault.start < time:
                    kept.append(replace(fault, stop=time))
            begun = [kinds[value - 1](where, start=time)] if value else []
            self.faults[:] = kept + begun

    def _rows(
        self, table: Table, address: int, quantity: int
    ) -> list[tuple[str, tuple[type[EngineFault], ...]]]:
        places = range(address, address + quantity)
        if table != "holding_registers" or not all(key in self.rows for key in places):
            raise DeviceError(ExceptionCode.ILLEGAL_DATA_ADDRESS)
        return [self.rows[key] for key in places]


class JunctionBox:
    """The holding registers of one of the two boxes, computed for each request."""

    def __init__(
        self, system: System, faults: Sequence[EngineFault], sensors: SyntheticValues, box: int
    ) -> None:
        self.system, self.faults, self.sensors, self.box = system, faults, sensors, box
        self.registers = RegisterMap(system.points)

    def read(self, table: Table, address: int, quantity: int, time: float) -> list[int]:
        """Return consecutive registers; raise Modbus exception 2 if one of them does not exist."""
        if table != "holding_registers" or address + quantity > len(self.registers):
            raise DeviceError(ExceptionCode.ILLEGAL_DATA_ADDRESS)
        content: list[int] = self.registers.encode(self.values(time)).tolist()
        return content[address : address + quantity]

    def write(self, table: Table, address: int, values: Sequence[int], time: float) -> None:
        """Refuse the request: the registers of a junction box are read-only."""
        raise DeviceError(ExceptionCode.ILLEGAL_FUNCTION)

    def values(self, time: float) -> Floats:
        """Return the values of all points as this box holds them at `time` [s]; NaN if marked."""
        now = nanoseconds(time)
        received = [self._heard(box, now) for box in range(len(self.system.boxes))]
        limit = nanoseconds(self.system.stale_limit)
        values = np.full(len(self.system.points), np.nan)
        for index, (point, box) in enumerate(
            zip(self.system.points, self.system.box_of.tolist(), strict=True)
        ):
            last = received[box]
            if last is None or now - last > limit:
                continue
            for begin, stop in outages(self.faults, point.tag, StuckSensor):
                last = begin if begin < last < stop else last
            values[index] = reading(self.sensors, self.faults, index, last / 1e9)
        return values

    def _heard(self, sender: int, now: int) -> int | None:
        """Return when this box last received frames from another box [ns]; None if never."""
        if sender == self.box:
            return now
        borders = sorted({0, *(t for fault in self.faults for t in fault.span if 0 < t <= now)})
        for begin, end in zip(reversed(borders), [now, *reversed(borders[1:])], strict=True):
            if any(
                {sender, self.box} <= set(part) for part in islands(self.system, self.faults, begin)
            ):
                return end
        return None

    def silent(self, time: float) -> bool:
        """Return whether, at `time` [s], the box is dead or cannot be reached on its channel."""
        now, channel = nanoseconds(time), str(self.system.ports.index(self.box) + 1)
        spans = outages(self.faults, self.system.boxes[self.box], DeadBox)
        spans += outages(self.faults, channel, ModbusBreak, DeadPort)
        return any(begin <= now < stop for begin, stop in spans)


class _BoxSlave(Slave):
    """The slave of a junction box, which does not respond while the box is silent."""

    def answer(self, request: Request | bytes, time: float = 0.0) -> bytes:
        """Execute a request, unless the box is silent at this time."""
        silent = isinstance(self.device, JunctionBox) and self.device.silent(time)
        return b"" if silent else super().answer(request, time)
