"""Simulate a master, its slaves and a line, telegram by telegram."""

from __future__ import annotations

import copy
from collections.abc import Iterable, Mapping, Sequence
from functools import partial

import numpy as np
import numpy.typing as npt

from shipnet.asi.simulation.channel import Channel, MasterStops
from shipnet.asi.simulation.disturbance import PLANES
from shipnet.asi.simulation.faults import Fault, TelegramErrors
from shipnet.asi.simulation.lists import Lists
from shipnet.asi.simulation.master import Command, Master
from shipnet.asi.simulation.result import InputChange, Simulation
from shipnet.asi.simulation.slave import Slave
from shipnet.asi.simulation.standby import Standby
from shipnet.asi.simulation.station import Stations
from shipnet.asi.timing import Timing
from shipnet.errors import ArgumentError
from shipnet.fields import check_whole

__all__ = ["simulate"]

_NEVER = float("inf")

#: Without a duration, a simulation in which no cycle begins for so long is given up [s].
_PATIENCE = 10.0


def simulate(
    slaves: Sequence[Slave],
    master: Master | None = None,
    *,
    cycles: int | None = None,
    duration: float | None = None,
    faults: Iterable[Fault] = (),
    inputs: Iterable[tuple[float, str, int]] = (),
    outputs: Iterable[tuple[float, str, int]] = (),
    commands: Iterable[tuple[float, Command]] = (),
    timing: Timing | None = None,
    positions: Mapping[str, float] | None = None,
    delays: Mapping[str, float] | None = None,
    standby: Standby | None = None,
    rng: np.random.Generator | None = None,
    disturbances: npt.NDArray[np.uint8] | None = None,
) -> Simulation:
    """Simulate a line from switching it on.

    Parameters
    ----------
    slaves : sequence of Slave
        The slaves, up to 1000; several may have the same address. They are left as they are.
    master : Master, optional
        The master, which is left as it is; a `Master` in configuration mode if omitted.
    cycles : int, optional
        Stop after so many cycles, 0..1e9.
    duration : float, optional
        Stop at this time [s]; the first of the two if both are given. One is needed.
    faults : iterable of Fault, optional
        What goes wrong.
    inputs : iterable of (float, str, int), optional
        Time [s], slave and value 0..15: its input ports change.
    outputs : iterable of (float, str, int), optional
        Time [s], slave and value: the host sets its outputs.
    commands : iterable of (float, Command), optional
        Time [s] and what the host asks of the master.
    timing : Timing, optional
        The pauses.
    positions : mapping of str to float, optional
        Distance of each slave from the master [m]; 0 if not named.
    delays : mapping of str to float, optional
        Delay of the repeaters on the way to each slave, one way [s]; 0 if not named.
    standby : Standby, optional
        A second master that takes over.
    rng : numpy.random.Generator, optional
        Draws the disturbances; needed if there are `TelegramErrors`.
    disturbances : ndarray of uint8, shape (n_cycles, 3, n_slaves, 1 + repetitions), optional
        Disturbances of the cycles as `draw_disturbances` returns them, instead of drawn ones.

    Returns
    -------
    Simulation
        The transactions and what follows from them.

    Raises
    ------
    ArgumentError
        If an argument is out of its range, or names a slave that is not there; or if without a
        duration no cycle begins for 10 s, because no slave answers.

    Notes
    -----
    Slaves are named by the label that they have at the start. Whatever is due while a request is
    on the line happens before the slave acts on it, at the end of the request. The signal itself
    takes no time, 0.5 us in 100 m; only repeaters do.

    Examples
    --------
    One slave among 31 loses every tenth response:

    >>> slaves = [Slave("S-0.F", address, inputs=1) for address in range(1, 32)]
    >>> run = simulate(slaves, cycles=100, faults=[TelegramErrors("7", response=0.1)],
    ...                rng=np.random.default_rng(2024))
    >>> print(run.summary())
    100 cycles of 5.14 ms (5.14 to 5.29 ms), 3305 requests in them
    5 repetitions, 0 slaves dropped, 5 replies to executed requests lost
    >>> failed = run.transactions.query("phase == 'data_exchange' and outcome != 'ok'")
    >>> failed.slave.unique().tolist(), failed.outcome.unique().tolist()
    (['7'], ['AlternationError', 'InformationError'])
    """
    if cycles is None and duration is None:
        raise ArgumentError("cycles and duration are both None; one of them is needed")
    most = None if cycles is None else check_whole("cycles", cycles, 0, 10**9)
    end = _NEVER if duration is None else _time("duration", duration)
    timing = timing or Timing()
    master = copy.deepcopy(master) if master is not None else Master()
    stations = Stations(slaves, timing, positions or {}, delays or {})
    attempts = 1 + max(m.repetitions for m in (master, standby.master if standby else master))
    shape = (PLANES, len(stations.all), attempts)
    if disturbances is not None and disturbances.shape[1:] != shape:
        raise ArgumentError(
            f"disturbances have the shape {disturbances.shape}; it must be (n_cycles, "
            f"{', '.join(map(str, shape))})"
        )
    faults = list(faults)
    if rng is None and any(isinstance(fault, TelegramErrors) for fault in faults):
        raise ArgumentError("rng is None, but TelegramErrors need one")
    rng = rng or np.random.default_rng(0)
    channel = Channel(stations.all, timing, attempts, rng, disturbances)
    leading = [master]

    for fault in faults:
        fault.apply(channel, stations)
    changes = [InputChange(_time("time", time), slave, value) for time, slave, value in inputs]
    for change in changes:
        check_whole(f"input of slave {change.slave}", change.value, 0, 15)
        for station in stations[change.slave]:
            action = partial(setattr, station.slave, "inputs", change.value)
            channel.schedule(change.time, action)
    for time, slave, value in outputs:
        Lists(outputs={slave: value})  # refuses what a master would refuse, but now
        channel.schedule(_time("time", time), partial(_set_output, leading, slave, value))
    for time, command in commands:
        channel.schedule(_time("time", time), partial(_submit, leading, command))

    if duration is None:
        channel.schedule(_PATIENCE, partial(_check_progress, channel, 0))
    _lead(channel, leading, standby, most, end / timing.bit_time)
    for station in stations.all:
        station.slave.rest(channel.seconds)
    slaves = [station.slave for station in stations.all]
    return Simulation(channel.record, channel.time, leading, slaves, changes)


def _check_progress(channel: Channel, begun: int) -> None:
    """Raise if no cycle has begun since the last check: a master without slaves never stops."""
    if channel.begun == begun:
        raise ArgumentError(
            f"duration is None, but no slave answers and no cycle begins for {_PATIENCE:g} s"
        )
    again = partial(_check_progress, channel, channel.begun)
    channel.schedule(channel.seconds + _PATIENCE, again)


def _set_output(leading: list[Master], slave: str, value: int) -> None:
    leading[-1].lists.set_output(slave, value)


def _submit(leading: list[Master], command: Command) -> None:
    leading[-1].submit(command)


def _lead(
    channel: Channel,
    leading: list[Master],
    standby: Standby | None,
    cycles: int | None,
    end: float,
) -> None:
    """Let the master, or whoever follows it, send requests until the end [bit]."""
    most = _NEVER if cycles is None else cycles
    master = leading[-1]
    program = master.run(channel)
    transact = channel.transact
    order = next(program)
    send = program.send
    while channel.begun <= most and channel.time < end:
        try:
            while channel.begun <= most and channel.time < end:
                order = send(transact(order, master.attempt))
        except MasterStops as stop:
            if stop.until < _NEVER:
                if not master.monitors_supply:
                    continue
                wait = min(stop.until / channel.timing.bit_time, end)
                channel.time = max(channel.time, wait)
                program = master.run(channel)
            elif standby is not None and not channel.standby:
                active = standby.listen(channel.record)
                silence = standby.silence / channel.timing.bit_time
                channel.time = min(channel.time + silence, end)
                channel.standby = True
                master = copy.deepcopy(standby.master)
                leading.append(master)
                program = master.run(channel, active)
            else:
                if end < _NEVER:
                    channel.time = end
                return
            order = next(program)
            send = program.send


def _time(name: str, value: float) -> float:
    if not 0 <= value < _NEVER:
        raise ArgumentError(f"{name} is {value} s; it must be 0 or more, and finite")
    return value
