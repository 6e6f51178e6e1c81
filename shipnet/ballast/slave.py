"""A valve as a Modbus slave: its registers, its switches, its diagnosis, its watchdog.

Time is that of the model and comes with every request, so that the same slave stands behind a real
server and in a simulation.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from shipnet.ballast.channels import CHANNELS
from shipnet.ballast.codes import Code
from shipnet.ballast.commands import Command
from shipnet.ballast.monitor import Monitor
from shipnet.ballast.plant import Plant
from shipnet.ballast.registers import COMMAND_REGISTER, RegisterMap
from shipnet.ballast.scales import FIRST_REGISTER, N_REGISTERS
from shipnet.errors import ArgumentError, FieldError
from shipnet.fields import check_scalar, check_whole
from shipnet.modbus.adu import MAX_UNIT
from shipnet.modbus.pdu import ExceptionCode
from shipnet.modbus.slave import DeviceError, Slave, Table

__all__ = ["ValveDevice", "valve_slaves"]

#: Function codes of the paper: read input registers, write single register.
_FUNCTIONS = frozenset({4, 6})


class ValveDevice:
    """One valve of a plant as a device behind `shipnet.modbus.server`.

    Parameters
    ----------
    plant : Plant
        The valves; several devices may share it, and its time then follows all their requests.
    valve : int, default 0
        Which of them.
    registers : RegisterMap, optional
        Reading of the paper's tables; `RegisterMap` with its defaults if omitted. Its command codes
        must be unambiguous.
    watchdog : float or None, default None
        A motor that runs by a command of the master stops when no request has come for so long,
        0.1..3600 [s]; never if None. The paper names no watchdog.
    monitor : Monitor, optional
        Applies the rules to the readings, for all devices of the plant; one of its own if omitted.

    Attributes
    ----------
    local : bool
        The toggle switch stands at manual: commands of the master are refused with exception 4, and
        `turn` moves the valve.
    auto : bool
        The master has the valve; False after code Manual, until code Auto.
    saturated : dict of str to bool
        What did not fit into the registers read last.

    Raises
    ------
    ArgumentError
        If an argument is out of its range, if a code stands for two commands, or if the monitor
        is that of another plant.

    Notes
    -----
    Figures 9 and 10 of the paper, as far as its text tells them: in auto mode the master commands,
    in manual mode the switches; a write starts the motor in the direction of the position asked
    for. The write is answered when the movement starts; `shipnet.ballast.answer` says what an
    answer at its end would cost. After code Manual, open, close and positions are refused too.

    Examples
    --------
    >>> from shipnet.modbus.slave import Table
    >>> device = ValveDevice(Plant())
    >>> device.write("holding_registers", 0x4001, [0x280A], 0.0)
    >>> [f"{word:04x}" for word in device.read("input_registers", 0x4020, 4, 2.0)]
    ['1628', '0014', '325a', '0c12']
    >>> device.read("input_registers", 0x4020, 1, 10.0)[0] >> 8
    40
    """

    def __init__(
        self,
        plant: Plant,
        valve: int = 0,
        *,
        registers: RegisterMap | None = None,
        watchdog: float | None = None,
        monitor: Monitor | None = None,
    ) -> None:
        self.plant = plant
        self.valve = check_whole("valve", valve, 0, plant.n_valves - 1)
        self.registers = registers if registers is not None else RegisterMap()
        for code in Code:
            try:
                self.registers.decode_command(self.registers.command(code))
            except FieldError as error:
                raise ArgumentError(f"registers cannot command a valve: {error}") from None
        self.watchdog = (
            None if watchdog is None else check_scalar("watchdog", watchdog, "s", 0.1, 3600)
        )
        self.local, self.auto = False, True
        self.monitor = monitor if monitor is not None else Monitor(plant)
        if self.monitor.plant is not plant:
            raise ArgumentError("monitor looks on at another plant; it must be that of the device")
        self.saturated = dict.fromkeys([*(channel.name for channel in CHANNELS), "time"], False)

    @property
    def fault(self) -> int:
        """Row of the rule table that the status reports, 0 for none.

        It is what the slave has found since its last command; what is set stays until the next.
        """
        return self.monitor.row(self.valve)

    @fault.setter
    def fault(self, row: int) -> None:
        self.monitor.report(self.valve, row)

    def read(self, table: Table, address: int, quantity: int, time: float) -> list[int]:
        """Return registers of the status.

        Parameters
        ----------
        table : Table
            Input registers; exception 2 for any other.
        address, quantity : int
            Within 0x4020..0x4023, else exception 2.
        time : float
            Model time [s]; one that has passed already reads the present.

        Returns
        -------
        list of int
            As many registers as asked for.
        """
        first = address - FIRST_REGISTER
        if table != "input_registers" or not 0 <= first <= N_REGISTERS - quantity:
            raise DeviceError(ExceptionCode.ILLEGAL_DATA_ADDRESS)
        self._attend(time)
        plant, k = self.plant, self.valve
        ran = plant.time - plant.started[k] if plant.running[k] else plant.last_run[k]
        packed = self.registers.pack(
            plant.readings[:, k : k + 1],
            auto=self.auto and not self.local,
            close=plant.direction[k] < 0,
            open=plant.direction[k] > 0,
            fault=self.fault,
            operating_time=ran,
        )
        self.saturated = dict(zip(self.saturated, map(bool, packed.saturated[0]), strict=True))
        return [int(word) for word in packed.registers[0, first : first + quantity]]

    def write(self, table: Table, address: int, values: Sequence[int], time: float) -> None:
        """Carry out a command.

        Parameters
        ----------
        table : Table
            Holding registers; exception 2 for any other.
        address : int
            0x4001, else exception 2.
        values : sequence of int
            One command; exception 3 if there is none with its code, or if its position is beyond
            100 %, and exception 4 if the valve is in manual mode.
        time : float
            Model time [s].
        """
        if table != "holding_registers" or address != COMMAND_REGISTER or len(values) != 1:
            raise DeviceError(ExceptionCode.ILLEGAL_DATA_ADDRESS)
        try:
            code, position = self.registers.decode_command(values[0])
        except (FieldError, ArgumentError):
            raise DeviceError(ExceptionCode.ILLEGAL_DATA_VALUE) from None
        self._attend(time)
        if self.local or not (self.auto or code is Code.AUTO):
            raise DeviceError(ExceptionCode.SERVER_DEVICE_FAILURE)
        match code:
            case Code.MANUAL | Code.AUTO:
                self.auto = code is Code.AUTO
                if not self.auto:
                    self._order("stop")
            case Code.OPEN:
                self._order("open")
            case Code.CLOSE:
                self._order("close")
            case _:
                self._order("position", position)
        self._feed(time)

    def turn(self, action: str, time: float) -> None:
        """Work the on-off-on switch beside the valve.

        Parameters
        ----------
        action : str
            ``open``, ``close`` or ``stop``.
        time : float
            Model time [s].

        Raises
        ------
        ArgumentError
            If there is no such action, or if the valve is not in manual mode.
        """
        if action not in ("open", "close", "stop"):
            raise ArgumentError(f"action is {action!r}; it must be open, close or stop")
        if not self.local and self.auto:
            raise ArgumentError("the valve is in auto mode; the switch works in manual mode only")
        self.plant.run_until(time)
        self._order(action)

    def _order(self, action: str, position: int | None = None) -> None:
        target = None if position is None else float(position)
        self.monitor.report(self.valve, 0)
        self.plant.order(Command(action, position=target, valves=self.valve))

    def _attend(self, time: float) -> None:
        """Bring the plant to the time of a request, which the watchdog has seen then."""
        self.plant.run_until(time)
        self._feed(time)

    def _feed(self, time: float) -> None:
        if self.watchdog is not None and self.auto and not self.local:
            now = max(time, self.plant.time)
            latest = self.plant.latest[self.valve]
            self.plant.deadline[self.valve] = np.minimum(latest, now + self.watchdog)


def valve_slaves(
    plant: Plant,
    *,
    first: int = 1,
    registers: RegisterMap | None = None,
    watchdog: float | None = None,
) -> dict[int, Slave]:
    """Return the valves of a plant as slaves, which `shipnet.modbus.server.serve` takes.

    Parameters
    ----------
    plant : Plant
        The valves, 1..247.
    first : int, default 1
        Unit id of valve 0; the others follow, up to 247.
    registers, watchdog
        As for `ValveDevice`; one `Monitor` serves all.

    Returns
    -------
    dict of int to Slave
        By unit id; each serves function codes 4 and 6.

    Raises
    ------
    ArgumentError
        If there are more valves than unit ids, or the watchdog is out of its range.

    Examples
    --------
    >>> slaves = valve_slaves(Plant(n_valves=3))
    >>> slaves[2].answer(bytes.fromhex("06 4001 0008")).hex(" ")
    '06 40 01 00 08'
    """
    unit = check_whole("first", first, 1, MAX_UNIT)
    if plant.n_valves > MAX_UNIT + 1 - unit:
        raise ArgumentError(
            f"plant has {plant.n_valves} valves; from unit id {unit} on there are "
            f"{MAX_UNIT + 1 - unit}"
        )
    monitor = Monitor(plant)
    devices = (
        ValveDevice(plant, valve, registers=registers, watchdog=watchdog, monitor=monitor)
        for valve in range(plant.n_valves)
    )
    return {id_: Slave(device, functions=_FUNCTIONS) for id_, device in enumerate(devices, unit)}
