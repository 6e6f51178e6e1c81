"""A closed loop: a line from one port of the master past all slaves back to the other."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from shipnet.errors import ArgumentError
from shipnet.fields import check_whole
from shipnet.modbus.ring.faults import Break, DeadPort, DeadSlave, Fault, Short, check_faults
from shipnet.modbus.ring.reach import Reach
from shipnet.modbus.ring.supervision import Supervision, check_rule
from shipnet.modbus.timing import Poll

__all__ = ["Loop"]

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Loop:
    """A line from port A past all slaves back to port B of the same master.

    Parameters
    ----------
    n_slaves : int
        Number of slaves, 1..247; slave 1 is the one next to port A.
    poll : Poll
        What each slave is asked.
    supervision : Supervision, optional
        When the master uses which port. Its `recheck` must not be shorter than a scan.
    isolators : bool, default False
        Whether a shorted section is cut out at both of its ends, as a break would be. Without,
        it takes with it every slave and port that it is connected to.

    Raises
    ------
    ArgumentError
        If a field is out of its range.

    Notes
    -----
    From [1]_: two-wire RS-485, slaves with one port, a master with two that close the loop, and
    the other direction when the line is broken. Assumed: the slaves hang on a line that runs past
    them, so that a dead one does no harm to others; all is polled through A while the line is
    whole; one transaction at a time, though two halves could be polled side by side; a port that
    fails leaves the line alone (if it does not, that is a short of section 0); a section both
    broken and shorted is shorted on both sides of the break, the worse case; both ends of the
    line remain terminated well enough. 256 slaves are printed and 250 for the master; the
    standard has 247.

    References
    ----------
    .. [1] J. H. Kim and Y. H. Yu, "Development of electro hydraulic ballast remote valve control
       system with diagnostic function using redundant Modbus communication", 2014, sections 2.1
       and 3.

    Examples
    --------
    >>> from shipnet.modbus.timing import Serial
    >>> loop = Loop(5, Poll(Serial(9600), 8, 13))
    >>> loop.reach([Break(2)]).through_b
    [3, 4, 5]
    >>> loop.reach([Break(2), Break(4)]).lost
    [3, 4]
    >>> len(loop.reach([Short(2)]).lost)
    5
    """

    n_slaves: int
    poll: Poll
    supervision: Supervision = field(default_factory=Supervision)
    isolators: bool = False

    def __post_init__(self) -> None:
        """Check every field."""
        object.__setattr__(self, "n_slaves", check_whole("n_slaves", self.n_slaves, 1, 247))
        if not isinstance(self.isolators, bool):
            raise ArgumentError(f"isolators is {self.isolators!r}; it must be True or False")
        check_rule(self.poll, self.supervision)
        self.supervision.check_scan(self.period)

    @property
    def period(self) -> float:
        """A scan while all slaves answer [s]."""
        return self.poll.scan(self.n_slaves)

    @property
    def n_sections(self) -> int:
        """Number of sections of the cable."""
        return self.n_slaves + 1

    def reach(self, faults: Iterable[Fault]) -> Reach:
        """Return who is reachable with some faults, whatever their times.

        Parameters
        ----------
        faults : iterable of Fault
            What has failed.

        Raises
        ------
        ArgumentError
            If a fault names a section or a slave that is not there.
        """
        failed = check_faults(faults)
        last_a, first_b = self.spans([failed])
        dead = frozenset(f.slave for f in failed if isinstance(f, DeadSlave))
        return Reach(self.n_slaves, int(last_a[0]), int(first_b[0]), dead)

    def spans(self, cases: Sequence[Sequence[Fault]]) -> tuple[Ints, Ints]:
        """Return how far each port reaches, for many sets of faults at once.

        Parameters
        ----------
        cases : sequence of sequences of Fault
            Sets of faults, all with the same number of them.

        Returns
        -------
        tuple of ndarray of int, shape (n_cases,)
            Last slave within reach of A, 0 if there is none; first slave within reach of B,
            n_slaves + 1 if there is none. Dead slaves are not left out.
        """
        if not cases or not cases[0]:
            return np.full(len(cases), self.n_slaves), np.ones(len(cases), dtype=np.int64)
        # Most faults are part of many cases.
        single = {id(fault): fault for case in cases for fault in case}
        row = {key: place for place, key in enumerate(single)}
        effects = np.array([self._effect(fault) for fault in single.values()])
        effects = effects[np.array([[row[id(fault)] for fault in case] for case in cases])]
        first_cut, first_short = effects[..., 0].min(axis=1), effects[..., 2].min(axis=1)
        last_cut, last_short = effects[..., 1].max(axis=1), effects[..., 3].max(axis=1)
        no_a, no_b = effects[..., 4].any(axis=1), effects[..., 5].any(axis=1)
        no_a = no_a | (first_short <= first_cut)
        no_b = no_b | (last_short >= last_cut)
        last_a = np.where(no_a, 0, np.minimum(first_cut, self.n_slaves))
        first_b = np.where(no_b, self.n_slaves + 1, np.maximum(last_cut + 1, 1))
        return last_a, first_b

    def _effect(self, fault: Fault) -> tuple[int, ...]:
        """Return first and last cut, first and last short, and whether A and B are dead."""
        n = self.n_slaves
        cut, short, dead = (n + 1, -1), (n + 2, -2), (0, 0)
        match fault:
            case Break(section=place):
                cut = (check_whole("section", place, 0, n),) * 2
            case Short(section=place) if self.isolators:
                cut = (check_whole("section", place, 0, n),) * 2
            case Short(section=place):
                short = (check_whole("section", place, 0, n),) * 2
            case DeadSlave(slave=place):
                check_whole("slave", place, 1, n)
            case DeadPort(port=port):
                dead = (int(port == "A"), int(port == "B"))
            case _:
                raise ArgumentError(f"{fault!r} is not a fault of a loop")
        return (*cut, *short, *dead)

    def gaps(
        self, stay: npt.ArrayLike, moved: npt.ArrayLike, lost: npt.ArrayLike
    ) -> tuple[Floats, Floats, Floats]:
        r"""Return the longest time between two answers of a slave, from how many share its fate.

        With s slaves that stay on their port, m that are moved and l that are lost, f `failures`,
        T an answered poll and G one that is given up,

        .. math:: t_m = f s T + m (f G + T) + l (f + 1) G, \qquad t_s = s T + m (G + T) + 2 l G

        where each slave is moved by itself, and

        .. math:: t_m = f s T + m T + (f - 1) m G + 2 G + l (f + 1) G

        where those beyond it are moved with it; one G less for the last one moved.

        Parameters
        ----------
        stay, moved, lost : array_like of int
            How many slaves stay, are moved and are lost.

        Returns
        -------
        tuple of ndarray of float
            For a slave that stays, one that is moved, and the last one that is moved [s].

        Notes
        -----
        All faults begin at once, while all is well. The worst moment is the end of an answer of
        the slave in question, and all three are attained but for one: with "beyond" and more than
        one failure, that of a slave that stays is a bound.
        """
        s, m, lo = (np.asarray(count, dtype=np.float64) for count in (stay, moved, lost))
        answered, given_up = self.poll.answered, self.poll.given_up
        f = self.supervision.failures
        common = f * s * answered + lo * (f + 1) * given_up
        if self.supervision.move == "slave":
            staying = s * answered + m * (given_up + answered) + 2 * lo * given_up
            moving = common + m * (f * given_up + answered)
            return staying, moving, moving
        discovery = (m > 0) * (given_up if f == 1 else answered)
        each = answered if f == 1 else max(given_up, answered)
        staying = s * answered + m * each + discovery + 2 * lo * given_up
        last = common + m * (answered + (f - 1) * given_up) + given_up
        return staying, last + given_up, last
