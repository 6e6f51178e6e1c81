"""Readings as a run that can be diagnosed: beside the valve, or from what the master was sent."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from shipnet.ballast.plant import Plant
from shipnet.ballast.screen import LEAST_CURRENT, MasterRun
from shipnet.ballast.simulation import Run
from shipnet.ballast.speed import position_speed
from shipnet.errors import ArgumentError
from shipnet.fields import check_whole

__all__ = ["Recorder", "received_run"]

Floats = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]


class Recorder:
    """Keeps what the sensors of a plant read while something else moves its time on.

    Parameters
    ----------
    plant : Plant
        The valves.

    Examples
    --------
    >>> from shipnet.ballast import Command
    >>> plant = Plant()
    >>> recorder = Recorder(plant)
    >>> plant.order(Command("open"))
    >>> for k in range(31):
    ...     recorder.take()
    ...     plant.advance()
    >>> recorder.run.VPos[::10, 0].round(), recorder.run.DVPos[[9, 10, 20], 0].round(1)
    (array([ 0., 11., 22., 33.]), array([ nan, 11.1, 11.1]))
    """

    def __init__(self, plant: Plant) -> None:
        self.plant = plant
        self._rows: list[tuple[float, Floats, Flags, Flags, Floats, npt.NDArray[np.int64]]] = []
        self._first = len(plant.movements)

    def take(self) -> None:
        """Keep what is read now; twice at the same time counts once."""
        plant = self.plant
        if self._rows and self._rows[-1][0] == plant.time:
            return
        readings = plant.run_until(plant.time)
        self._rows.append(
            (plant.time, readings.copy(), plant.running.copy(), plant.active.copy(),
             plant.opening.copy(), plant.ran.copy())
        )  # fmt: skip

    @property
    def run(self) -> Run:
        """What was kept."""
        if not self._rows:
            raise ArgumentError("nothing has been recorded")
        columns = [np.array(column) for column in zip(*self._rows, strict=True)]
        time, readings, running, active, opening, ran = columns
        # A reading taken at the start is the first of the motor's run.
        rate = position_speed(time, readings[:, 4], (ran - 1) * self.plant.step)
        moving = np.zeros_like(running)
        moving[:-1] = opening[1:] != opening[:-1]
        movements = tuple(self.plant.movements[self._first :])
        return Run(time, readings, rate, running, moving, active, opening, movements)


def received_run(seen: MasterRun, unit: int, *, target: float, plant: Plant | None = None) -> Run:
    """Return the readings of one valve as the master was sent them.

    Parameters
    ----------
    seen : MasterRun
        What the master saw.
    unit : int
        Which valve.
    target : float
        Position to which it was last sent [%]: the command is active while the motor runs and the
        position is not there.
    plant : Plant, optional
        Whose ended movements the run is given.

    Returns
    -------
    Run
        One valve, an instant a scan, in the steps of the registers; the master takes a motor for
        running whose current is 0.2 A or more.

    Raises
    ------
    ArgumentError
        If there is no such valve, or nothing came from it.

    Examples
    --------
    >>> from shipnet.ballast import Command
    >>> from shipnet.ballast.master import operate
    >>> from shipnet.ballast.scan import status_poll
    >>> from shipnet.modbus.redundancy import Loop
    >>> from shipnet.modbus.uart import SerialLine
    >>> plant = Plant(n_valves=5)
    >>> seen = operate(plant, Loop(5, status_poll(SerialLine(9600))), [Command("open")], duration=4)
    >>> run = received_run(seen, 2, target=100.0)
    >>> run.VPos[-3:, 0], run.MC[-3:, 0]
    (array([39., 41., 42.]), array([1.2, 1.2, 1.2]))
    """
    known = check_whole("unit", unit, 1, seen.system.n_slaves)
    rows = seen.answers[seen.answers["unit"] == known]
    if rows.empty:
        raise ArgumentError(f"unit is {unit}; nothing has come from it")
    time = rows["read_s"].to_numpy()
    names = ["FP_bar", "OP_bar", "MC_A", "OT_degC", "VPos_percent"]
    readings = rows[names].to_numpy()[:, :, np.newaxis]
    running = readings[:, 2] >= LEAST_CURRENT
    active = running & (np.abs(readings[:, 4] - target) > 0.5)
    ran = np.zeros(time.size)
    for k in range(1, time.size):
        both = running[k, 0] and running[k - 1, 0]
        ran[k] = ran[k - 1] + time[k] - time[k - 1] if both else 0.0
    rate = position_speed(time, readings[:, 4], ran[:, np.newaxis])
    moved = () if plant is None else tuple(
        m._replace(valve=0) for m in plant.movements if m.valve == known - 1
    )  # fmt: skip
    return Run(
        time, readings, rate, running, running & (rate != 0), active, readings[:, 4] / 100, moved
    )
