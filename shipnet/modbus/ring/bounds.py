"""How long data stay away at worst, in closed form."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import numpy.typing as npt

from shipnet.modbus.ring.channels import Channels
from shipnet.modbus.ring.faults import Fault
from shipnet.modbus.ring.loop import Loop

__all__ = ["System", "longest_recovery", "worst_gap"]

Floats = npt.NDArray[np.float64]

#: A master with two ports.
System = Loop | Channels


def worst_gap(system: System, faults: Iterable[Fault]) -> Floats:
    """Return the longest time between two answers of each slave that some faults can cause.

    Parameters
    ----------
    system : Loop or Channels
        A master with two ports.
    faults : iterable of Fault
        What fails, all at the same moment, and for good; their times are not looked at.

    Returns
    -------
    ndarray of float, shape (n_slaves,)
        In order of the slaves [s]; infinite for those that are lost. `Loop.gaps` and
        `Channels.gaps` say how. For a slave that is moved it is the longest time to switch, too,
        from the fault to the first answer on the other port.

    Raises
    ------
    ArgumentError
        If a fault names a section or a slave that is not there.

    Examples
    --------
    A loop of ten valves breaks in the middle; every slave on the far side times out by itself, or
    the first of them takes the others with it:

    >>> from shipnet.modbus.ring.faults import Break
    >>> from shipnet.modbus.ring.supervision import Supervision
    >>> from shipnet.modbus.timing import Poll, Serial
    >>> poll = Poll(Serial(9600), 8, 13, timeout=0.5)
    >>> worst_gap(Loop(10, poll), [Break(5)]).max().round(2).item()
    2.87
    >>> worst_gap(Loop(10, poll, Supervision(move="beyond")), [Break(5)]).max().round(2).item()
    1.34
    """
    served = np.array(system.reach(faults).served)
    stay, moved, lost = (int((served == port).sum()) for port in "AB-")
    staying, moving, last = system.gaps(stay, moved, lost)
    gap = np.select([served == "A", served == "B"], [staying, moving], np.inf)
    if moved:
        gap[np.flatnonzero(served == "B")[-1]] = last
    return gap


def longest_recovery(system: System) -> float:
    r"""Return how long it takes at most, after a single fault was mended, until all is as before.

    .. math:: t = t_{recheck} + 2 T_{scan} + 2 t_{unanswered}

    Parameters
    ----------
    system : Loop or Channels
        A master with two ports.

    Returns
    -------
    float
        Time from the repair to the last first answer through port A [s].

    Notes
    -----
    In the worst case a try through both ports has just begun; after its time-outs the rule waits,
    then a scan may pass until the next slave to be tried has its turn, and one more until the
    last has.

    Examples
    --------
    >>> from shipnet.modbus.timing import Poll, Serial
    >>> round(longest_recovery(Loop(10, Poll(Serial(9600), 8, 13))), 2)
    62.66
    """
    wait = system.supervision.recheck + 2 * system.period
    return wait + 2 * system.poll.unanswered
