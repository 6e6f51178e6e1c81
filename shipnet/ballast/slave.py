"""A valve as a Modbus slave: registers, switches, diagnosis and watchdog.

The methods of a slave take the simulated time, so it works in a real server and in simulations.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

import numpy as np

from shipnet.arrays import Bools, Floats
from shipnet.ballast.plant import ACTIONS, Command, Plant
from shipnet.ballast.registers import (
    COMMAND_REGISTER,
    FIRST_REGISTER,
    N_REGISTERS,
    Code,
    RegisterMap,
)
from shipnet.ballast.rule_table import rule_base
from shipnet.ballast.sensors import CHANNELS, WINDOW, position_speed, stroke_speed
from shipnet.errors import ArgumentError, FieldError
from shipnet.fields import check_choice, check_whole
from shipnet.modbus.frame import MAX_UNIT
from shipnet.modbus.pdu import ExceptionCode
from shipnet.modbus.slave import DeviceError, Slave, Table

#: A code counts as found if its rule fired in 3 or more of the last 5 readings.
_LEAST, _WINDOW = 3, 5


class Monitor:
    """A monitor that applies the rules to every reading of a plant, for all valves together."""

    def __init__(self, plant: Plant) -> None:
        self.plant = plant
        self.base = rule_base()
        self.found = np.zeros((plant.n_valves, len(self.base.rules)), bool)
        self._ranked = np.array([self.base.codes.index(code) for code in self.base.ranking])
        self._fired: deque[Bools] = deque(maxlen=_WINDOW)
        self._places: deque[tuple[float, Floats]] = deque()
        self._calm: tuple[Floats, Bools] | None = None
        plant.watchers.append(self._look)

    def row(self, valve: int) -> int:
        """Return the rule-table row, from 1, of the highest-ranked code found; 0 if none."""
        ranked = self.found[valve, self._ranked]
        return int(self._ranked[ranked.argmax()]) + 1 if np.count_nonzero(ranked) else 0

    def forget(self, valve: int) -> None:
        """Clear the codes found for a valve, and restart the count of readings."""
        self.found[valve] = False
        for fired in self._fired:
            fired[valve] = False

    def _look(self) -> None:
        """Apply the rules to the present reading; any earlier reading at this time is replaced."""
        plant = self.plant
        if self._places and self._places[-1][0] == plant.time:
            self._places.pop()
            self._fired.pop()
        self._places.append((plant.time, plant.readings[4]))
        # The speed needs the present reading and the latest reading that is at least a window old.
        while len(self._places) > 1 and self._places[1][0] < plant.time - WINDOW + 1e-9:
            self._places.popleft()
        calm = not np.count_nonzero(plant.active)
        if calm and self._calm is not None and np.array_equal(plant.readings, self._calm[0]):
            # Without noise, most readings of a fleet at rest equal the previous reading.
            fires = self._calm[1].copy()
        else:
            speed = np.full(plant.n_valves, np.nan)
            if not calm:
                ends = (self._places[0], self._places[-1])
                time, places = (np.array(column) for column in zip(*ends, strict=True))
                moved = stroke_speed(position_speed(time, places)[-1], plant.run_time)
                speed = np.where(plant.active, moved, np.nan)
            values = {c.name: x for c, x in zip(CHANNELS, plant.readings, strict=True)}
            applies = {"DVPos": ~np.isnan(speed)}
            fires = self.base.decide({**values, "DVPos": speed}, applies=applies).active
            self._calm = (plant.readings, fires.copy()) if calm else None
        self._fired.append(fires)
        self.found |= sum(self._fired, np.zeros(self.found.shape, int)) >= _LEAST


class ValveRegisters:
    """The registers of a valve: a readable status and a writable command."""

    def read(self, table: Table, address: int, quantity: int, time: float) -> Sequence[int]:
        """Return consecutive registers of the status."""
        first = address - FIRST_REGISTER
        if table != "input_registers" or not 0 <= first <= N_REGISTERS - quantity:
            raise DeviceError(ExceptionCode.ILLEGAL_DATA_ADDRESS)
        return self.status(time)[first : first + quantity]

    def write(self, table: Table, address: int, values: Sequence[int], time: float) -> None:
        """Carry out a command."""
        if table != "holding_registers" or address != COMMAND_REGISTER or len(values) != 1:
            raise DeviceError(ExceptionCode.ILLEGAL_DATA_ADDRESS)
        self.command(values[0], time)

    def status(self, time: float) -> Sequence[int]:
        """Return the four status registers at the given time [s]."""
        raise NotImplementedError

    def command(self, value: int, time: float) -> None:
        """Carry out the command encoded in a register value."""
        raise NotImplementedError


class ValveDevice(ValveRegisters):
    """One valve of a plant as a device for `shipnet.modbus.server`."""

    # Figures 9 and 10 of the paper: the master controls the valve in auto mode, the switches do so
    # in manual mode, and a write starts the motor. Our interpretation: the slave responds to the
    # write when the movement starts, and after the code Manual it refuses every code except Auto.
    def __init__(self, plant: Plant, valve: int = 0, monitor: Monitor | None = None) -> None:
        self.plant = plant
        self.valve = check_whole("valve", valve, 0, plant.n_valves - 1)
        self.registers, self.watchdog = RegisterMap(), plant.system.watchdog
        self.local, self.auto = False, True
        self.monitor = monitor if monitor is not None else Monitor(plant)

    def status(self, time: float) -> list[int]:
        """Return the status registers for the present readings."""
        self._attend(time)
        plant, k = self.plant, self.valve
        ran = plant.time - plant.started[k] if plant.running[k] else plant.last_run[k]
        packed = self.registers.encode(
            plant.readings[:, k : k + 1],
            auto=self.auto and not self.local,
            close=plant.direction[k] < 0,
            open=plant.direction[k] > 0,
            fault=self.monitor.row(k),
            operating_time=ran,
        )
        return [int(word) for word in packed.registers[0]]

    def command(self, value: int, time: float) -> None:
        """Carry out the command encoded in a register value, if the mode allows it."""
        try:
            code, position = self.registers.decode_command(value)
        except (FieldError, ArgumentError):
            raise DeviceError(ExceptionCode.ILLEGAL_DATA_VALUE) from None
        self._attend(time)
        if self.local or not (self.auto or code is Code.AUTO):
            raise DeviceError(ExceptionCode.SERVER_DEVICE_FAILURE)
        if code in (Code.MANUAL, Code.AUTO):
            self.auto = code is Code.AUTO
        if code is not Code.AUTO:
            actions = {Code.MANUAL: "stop", Code.OPEN: "open", Code.CLOSE: "close"}
            self._order(actions.get(code, float(position)))
        self._feed(time)

    def turn(self, action: str, time: float) -> None:
        """Turn the on-off-on switch beside the valve."""
        check_choice("action", action, ACTIONS)
        if not self.local and self.auto:
            raise ArgumentError("the valve is in auto mode; the switch works in manual mode only")
        self.plant.run_until(time)
        self._order(action)

    def _order(self, action: str | float) -> None:
        self.monitor.forget(self.valve)
        self.plant.order(Command(action, valves=self.valve + 1))

    def _attend(self, time: float) -> None:
        """Advance the plant to the time of a request, which resets the watchdog."""
        self.plant.run_until(time)
        self._feed(time)

    def _feed(self, time: float) -> None:
        if self.watchdog is not None and self.auto and not self.local:
            now = max(time, self.plant.time)
            latest = self.plant.latest[self.valve]
            self.plant.deadline[self.valve] = np.minimum(latest, now + self.watchdog)


def valve_slaves(plant: Plant) -> dict[int, Slave]:
    """Return the valves of a plant as slaves for `shipnet.modbus.server.serve`."""
    if plant.n_valves > MAX_UNIT:
        raise ArgumentError(f"plant has {plant.n_valves} valves; there are {MAX_UNIT} unit ids")
    monitor = Monitor(plant)
    devices = (ValveDevice(plant, valve, monitor) for valve in range(plant.n_valves))
    # The paper's function codes: read input registers, write single register.
    return {unit: Slave(device, functions={4, 6}) for unit, device in enumerate(devices, 1)}
