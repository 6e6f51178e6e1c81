"""Simulate a master with two ports, once, or with its faults at one instant after the other."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar
from shipnet.modbus.ring.bounds import System
from shipnet.modbus.ring.faults import Fault, check_faults
from shipnet.modbus.ring.master import Master
from shipnet.modbus.ring.run import Run

__all__ = ["simulate", "sweep"]

Floats = npt.NDArray[np.float64]

_NEVER = float("inf")


def simulate(system: System, faults: Iterable[Fault] = (), *, duration: float) -> Run:
    """Simulate a master that polls its slaves, from the first poll on.

    Parameters
    ----------
    system : Loop or Channels
        A master with two ports; all slaves are served through A at the start.
    faults : iterable of Fault, optional
        What fails, and when.
    duration : float
        No try begins after it, 0..1e5 [s].

    Returns
    -------
    Run
        The tries and what follows from them.

    Raises
    ------
    ArgumentError
        If an argument is out of its range, or a fault names what is not there.

    Notes
    -----
    A try is answered if slave and port are joined from the begin of the request to the end of the
    response; the rest follows from `Supervision`.

    Examples
    --------
    The AMS of lee2012 loses channel 1 half a second after a poll:

    >>> from shipnet.modbus.ring.channels import Channels
    >>> from shipnet.modbus.ring.faults import Break
    >>> from shipnet.modbus.timing import Poll, Serial
    >>> ams = Channels(Poll(Serial(9600), 8, 203, timeout=0.3))
    >>> run = simulate(ams, [Break(0, start=2.5)], duration=5)
    >>> run.polls.round(3)[["start_s", "port", "kind", "answered"]].values.tolist()[2:5]
    [[2.0, 'A', 'poll', True], [3.0, 'A', 'poll', False], [3.309, 'B', 'switch', True]]
    >>> run.table.round(3).longest_gap_s.tolist()
    [1.309]
    """
    end = check_scalar("duration", duration, "s", 0, 1e5)
    failed = check_faults(faults)
    return Run(system, failed, end, Master(system, failed).run(end))


def sweep(system: System, faults: Iterable[Fault], instants: npt.ArrayLike | None = None) -> Floats:
    """Simulate some faults that begin together and for good, at one instant after the other.

    Parameters
    ----------
    system : Loop or Channels
        A master with two ports.
    faults : iterable of Fault
        What fails; their times are not looked at.
    instants : array_like of float, shape (n_instants,), optional
        When they begin [s]; the ends of the answers of the second scan if omitted, the worst of
        which is the worst of all.

    Returns
    -------
    ndarray of float, shape (n_instants, n_slaves)
        Longest time between two answers of each slave [s]; infinite for those that are lost.

    Raises
    ------
    ArgumentError
        If an instant is out of range, or a fault names what is not there.

    Examples
    --------
    The closed form is attained:

    >>> from shipnet.modbus.ring import Break, Loop, sweep, worst_gap
    >>> from shipnet.modbus.timing import Poll, Serial
    >>> loop = Loop(4, Poll(Serial(9600), 8, 13))
    >>> sweep(loop, [Break(2)]).max(axis=0).round(6) == worst_gap(loop, [Break(2)]).round(6)
    array([ True,  True,  True,  True])
    """
    failed = check_faults(faults)
    reach = system.reach(failed)
    if instants is None:
        begin, each = system.period, system.poll.answered
        whole = simulate(system, duration=begin + (system.n_slaves - 0.5) * each)
        at = whole.answer_times[-system.n_slaves :]
    else:
        at = np.atleast_1d(np.asarray(instants, dtype=np.float64))
    if at.ndim != 1 or not at.size:
        raise ArgumentError(f"instants have the shape {at.shape}; they must be a row of times")
    # A lost slave takes one more scan's time until it is given up than one that is moved.
    settled = (system.supervision.failures + 3) * (
        system.period + 2 * system.n_slaves * system.poll.given_up
    )
    lost = [slave - 1 for slave in reach.lost]
    gaps = np.empty((at.size, system.n_slaves))
    for row, instant in enumerate(at):
        begun = [replace(fault, start=float(instant), stop=_NEVER) for fault in failed]  # type: ignore[type-var]
        tries = Master(system, begun).run(float(instant) + settled, settle=float(instant))
        gaps[row] = Run(system, tuple(begun), tries[-1][0], tries).gaps
    gaps[:, lost] = np.inf
    return gaps
