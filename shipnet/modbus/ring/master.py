"""The master's rule on a clock: one try after the other."""

from __future__ import annotations

from collections.abc import Sequence

from shipnet.modbus.ring.bounds import System
from shipnet.modbus.ring.channels import Channels
from shipnet.modbus.ring.faults import Fault

__all__ = ["KINDS", "LOST", "A", "B", "Master", "Paths", "until_answer"]

#: Ports, and in place of one: served by none.
A, B, LOST = range(3)

#: Why a try is made: in its turn, on the other port at once, or to see whether all is well again.
KINDS = ("poll", "switch", "probe")
_POLL, _SWITCH, _PROBE = range(3)

#: Start [s], slave from 0 on, port, kind, answered.
Try = tuple[float, int, int, int, bool]

_NEVER = float("inf")


def until_answer(system: System) -> float:
    """Return the time from the begin of a request to the end of its response [s].

    Parameters
    ----------
    system : Loop or Channels
        A master with two ports.

    Returns
    -------
    float
        The time.

    Examples
    --------
    >>> from shipnet.modbus.timing import Poll, Serial
    >>> round(until_answer(Channels(Poll(Serial(9600), 8, 13))) * 1e3, 2)
    28.07
    """
    return system.poll.answered - system.poll.serial.t35


class Paths:
    """Who is joined to which port, piece by piece in time."""

    def __init__(self, system: System, faults: Sequence[Fault]) -> None:
        system.reach(faults)
        edges = {f.start for f in faults} | {f.stop for f in faults}
        starts = [0.0, *sorted(edge for edge in edges if 0 < edge < _NEVER)]
        self.ends = [*starts[1:], _NEVER]
        self.joined: list[tuple[list[bool], list[bool]]] = []
        for start in starts:
            reach = system.reach([f for f in faults if f.start <= start < f.stop])
            ports = ({*reach.through_a}, {*reach.through_b})
            a, b = ([s in port for s in range(1, system.n_slaves + 1)] for port in ports)
            self.joined.append((a, b))
        self.piece = 0

    def hold(self, start: float, end: float, slave: int, port: int) -> bool:
        """Return whether a path is whole from `start` to `end`; starts must not go back."""
        while self.ends[self.piece] <= start:
            self.piece += 1
        piece = self.piece
        while self.joined[piece][port][slave]:
            if self.ends[piece] >= end:
                return True
            piece += 1
        return False


class Master:
    """The state of the rule, and the clock."""

    def __init__(self, system: System, faults: Sequence[Fault]) -> None:
        n = system.n_slaves
        self.rule, self.n = system.supervision, n
        # A loop is scanned again at once.
        self.period = system.period if isinstance(system, Channels) else 0.0
        self.attempts = 1 + system.poll.retries
        self.answered, self.unanswered = system.poll.answered, system.poll.unanswered
        self.needed = until_answer(system)
        self.paths = Paths(system, faults)
        self.port, self.failed = [A] * n, [0] * n
        self.time, self.last_failure, self.probed = 0.0, -_NEVER, n - 1
        self.tries: list[Try] = []

    def run(self, end: float, *, settle: float = _NEVER) -> list[Try]:
        """Scan until the end, or until two scans after `settle` nothing fails any more."""
        quiet = 0
        while self.time < end and quiet < 2:
            begin = self.time
            for slave in range(self.n):
                if self.time >= end:
                    break
                self.turn(slave)
            calm = begin > settle and self.last_failure < begin
            quiet = quiet + 1 if calm else 0
            if self.time == begin:
                # All are lost: nothing happens before the next try is due.
                self.time = min(self.last_failure + self.rule.recheck, end)
                quiet = 2 if begin > settle else quiet
            self.time = max(self.time, begin + self.period)
        return self.tries

    def turn(self, slave: int) -> None:
        """Do what the scan has for a slave."""
        port = self.port[slave]
        if port != A and self.due(slave):
            self.probed = slave
            if self.attempt(slave, A, _PROBE):
                self.serve(slave, A)
                return
            if port == LOST and self.attempt(slave, B, _PROBE):
                self.serve(slave, B)
                return
        if port == LOST or self.ask(slave, port, _POLL):
            return
        self.failed[slave] += 1
        if self.failed[slave] < self.rule.failures:
            return
        other = B if port == A else A
        if not self.ask(slave, other, _SWITCH):
            self.port[slave] = LOST
            return
        self.serve(slave, other)
        if self.rule.move == "beyond":
            beyond = range(slave + 1, self.n) if port == A else range(slave)
            for one in beyond:
                if self.port[one] == port:
                    self.port[one] = other

    def due(self, slave: int) -> bool:
        """Return whether it is time to try again what was given up, and this slave's turn."""
        if self.time < self.last_failure + self.rule.recheck:
            return False
        following = ((self.probed + step) % self.n for step in range(1, self.n + 1))
        return slave == next(one for one in following if self.port[one] != A)

    def serve(self, slave: int, port: int) -> None:
        """Have a slave served through a port from now on."""
        self.port[slave], self.failed[slave] = port, 0

    def ask(self, slave: int, port: int, kind: int) -> bool:
        """Poll a slave with all retries; return whether it answered."""
        for _ in range(self.attempts):
            if self.attempt(slave, port, kind):
                self.failed[slave] = 0
                return True
        return False

    def attempt(self, slave: int, port: int, kind: int) -> bool:
        """Send one request and let the time pass; return whether it was answered."""
        start = self.time
        answered = self.paths.hold(start, start + self.needed, slave, port)
        self.tries.append((start, slave, port, kind, answered))
        if answered:
            self.time = start + self.answered
        else:
            self.time = self.last_failure = start + self.unanswered
        return answered
