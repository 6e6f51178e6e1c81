"""Two channels from a master to two slaves, each of which holds all data."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar, check_whole
from shipnet.modbus.ring.faults import Break, DeadPort, DeadSlave, Fault, Short, check_faults
from shipnet.modbus.ring.reach import Reach
from shipnet.modbus.ring.supervision import Supervision, check_rule
from shipnet.modbus.timing import Poll

__all__ = ["Channels"]

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Channels:
    """Two channels from a master to two slaves that both hold all data.

    Parameters
    ----------
    poll : Poll
        What the slave in use is asked.
    supervision : Supervision, optional
        When the master changes the channel. Its `recheck` must not be shorter than `period`.
    period : float, default 1
        From the begin of a poll to the next [s], not shorter than a poll, up to 3600. The AMS of
        [1]_ polls once a second. A poll that takes longer delays the next one.

    Raises
    ------
    ArgumentError
        If a field is out of its range.

    Notes
    -----
    The two slaves stand for one source of data, so that here `n_slaves` is 1: port A reaches it
    through the first slave, B through the second. `Break` and `Short` have the section 0 for
    channel 1 and 1 for channel 2; how the slaves share their data is not part of this.

    Time-out and retries are not printed in [1]_. The switching time is, as 133 us, which is
    1.3 bit times; as 133 ms it is a request of 9.17 ms and a time-out of 124 ms.

    References
    ----------
    .. [1] J.-H. Lee and D.-S. Kim, "Design and implementation of distributed control system based
       on dual field-bus for ship engine", 2012, sections III.2 and IV.2.

    Examples
    --------
    The time-out that gives 133 ms; the registers of the test are not printed, so it reads one:

    >>> from shipnet.modbus.timing import Serial
    >>> line = Serial(9600)
    >>> ams = Channels(Poll(line, 8, 7, timeout=0.133 - line.frame_time(8)))
    >>> round(ams.poll.given_up * 1e3), ams.reach([Break(0)]).served
    (133, ['B'])
    """

    poll: Poll
    supervision: Supervision = field(default_factory=Supervision)
    period: float = 1.0

    def __post_init__(self) -> None:
        """Check every field."""
        check_rule(self.poll, self.supervision)
        period = check_scalar("period", self.period, "s", self.poll.answered, 3600)
        object.__setattr__(self, "period", period)
        self.supervision.check_scan(period)

    @property
    def n_slaves(self) -> int:
        """One source of data."""
        return 1

    @property
    def n_sections(self) -> int:
        """Number of cables."""
        return 2

    def reach(self, faults: Iterable[Fault]) -> Reach:
        """Return which port reaches the data with some faults, whatever their times.

        Parameters
        ----------
        faults : iterable of Fault
            What has failed.

        Raises
        ------
        ArgumentError
            If a fault names a section or a slave that is not there.
        """
        dead = {self._channel(fault) for fault in check_faults(faults)}
        return Reach(1, int("A" not in dead), 1 + int("B" in dead), frozenset())

    def spans(self, cases: Sequence[Sequence[Fault]]) -> tuple[Ints, Ints]:
        """Return what each port reaches, for many sets of faults at once.

        Parameters
        ----------
        cases : sequence of sequences of Fault
            Sets of faults.

        Returns
        -------
        tuple of ndarray of int, shape (n_cases,)
            As for `Loop.spans`.
        """
        reaches = [self.reach(case) for case in cases]
        first_b = np.array([reach.first_b for reach in reaches], dtype=np.int64)
        return np.array([reach.last_a for reach in reaches], dtype=np.int64), first_b

    @staticmethod
    def _channel(fault: Fault) -> str:
        match fault:
            case Break(section=place) | Short(section=place):
                return "AB"[check_whole("section", place, 0, 1)]
            case DeadSlave(slave=place):
                return "AB"[check_whole("slave", place, 1, 2) - 1]
            case DeadPort(port=port):
                return port
        raise ArgumentError(f"{fault!r} is not a fault of channels")

    def gaps(
        self, stay: npt.ArrayLike, moved: npt.ArrayLike, lost: npt.ArrayLike
    ) -> tuple[Floats, Floats, Floats]:
        r"""Return the longest time between two answers.

        .. math:: t = P + (f - 1) \max \left( P, G \right) + G

        with the period P, f `failures` and G a poll that is given up; P if nothing is moved.

        Parameters
        ----------
        stay, moved, lost : array_like of int
            1 for what becomes of the data, else 0.

        Returns
        -------
        tuple of ndarray of float
            As for `Loop.gaps` [s].
        """
        given_up, f = self.poll.given_up, self.supervision.failures
        switched = self.period + (f - 1) * max(self.period, given_up) + given_up
        shape = np.broadcast_shapes(np.shape(stay), np.shape(moved), np.shape(lost))
        moving = np.full(shape, switched)
        return np.full(shape, self.period), moving, moving
