"""A master: the phases it goes through, and what it does when an answer fails.

A master is a generator. It yields the request that it sends and is sent the reply. Nothing here
knows of slaves or of a line, so a master can be led by a simulation, by a test, or by hand.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from enum import IntEnum
from typing import Protocol

from shipnet.asi.calls import Call
from shipnet.asi.profile import Profile
from shipnet.asi.simulation.lists import Identity, Lists, Poll
from shipnet.asi.simulation.orders import Order, key_of, order
from shipnet.asi.simulation.tasks import FAULTY, SILENT, T, Task, activate, identify, move
from shipnet.errors import ArgumentError
from shipnet.fields import check_whole

__all__ = ["Command", "CommandFailed", "Master", "Observer", "Phase"]


class Phase(IntEnum):
    """The phases of a master, in the order in which it goes through them.

    References
    ----------
    .. [1] Beckhoff, "EL6201 AS-Interface master terminal", operating phases.
    .. [2] OMRON, "CQM1-ARM21", manual W357, 1999, p. 5.

    Examples
    --------
    >>> [phase.name.lower() for phase in Phase][3:]
    ['data_exchange', 'management', 'inclusion']
    """

    OFFLINE = 0
    DETECTION = 1
    ACTIVATION = 2
    DATA_EXCHANGE = 3
    MANAGEMENT = 4
    INCLUSION = 5


class Observer(Protocol):
    """Who wants to know what a master is at, and tells it the time."""

    @property
    def seconds(self) -> float:
        """The simulated time [s]."""

    def begin(self, phase: Phase, cycle: int) -> None:
        """Hear of the begin of a phase."""


class Command(Protocol):
    """What the host asks of a master: one request a cycle, in the management phase."""

    def run(self, lists: Lists) -> Task[str]:
        """Yield orders, take replies, and return in words what came of it."""


class CommandFailed(Exception):
    """A command of the host cannot be carried out; the message says why."""


class Master:
    """A master with its lists and its ways of dealing with failures.

    Parameters
    ----------
    projected : mapping of str to (Profile or str), optional
        The slaves that should be there: label and profile. Given, the master works in protected
        mode and activates these only; omitted, in configuration mode, and activates all.
    outputs : mapping of str to int, optional
        What each slave is sent, 0..15, or 0..7 for an A/B slave; all bits set if not named.
    parameters : mapping of str to int, optional
        Parameter bits of each slave, likewise.
    repetitions : int, default 1
        How often a failed request is sent again at once, 0..7.
    drop_after : int, default 3
        After so many failed data exchanges in a row, one a cycle, a slave is dropped, 1..1000.
    automatic_addressing : bool, default False
        Whether a new slave at address 0 takes the place of the only one missing, if its profile
        is the same; in protected mode only.
    status_poll : bool, default True
        Whether the management phase asks one slave after the other for its status while the
        host has no commands; it finds the periphery faults (LPF).
    readmit : bool, default True
        Whether the inclusion phase asks at the addresses of slaves that were dropped.
    monitors_supply : bool, default True
        Whether the master sees that the supply fails, stops, and begins anew behind it.

    Attributes
    ----------
    lists : Lists
        LPS, LDS, LAS and LPF, and the data of the host.
    phase : Phase
        Where it is.
    cycle : int
        Number of the cycle, from 0; -1 before the first.
    attempt : int
        Which attempt at a request is on its way; 0 is the first.
    dropped : list of (float, str)
        When which slave was dropped for its failures [s].
    finished : list of (float, Command, bool, str)
        When each command ended [s], whether it succeeded, and what came of it.

    Raises
    ------
    ArgumentError
        If a value is out of its range.

    Notes
    -----
    Two tries in each of three cycles are the six tries after which an analyser counts a slave
    as lost [1]_. *Read I/O configuration* asks whether anybody is there: silence is not repeated,
    a faulty answer is.

    References
    ----------
    .. [1] Siemens, "AS-Interface Analyser 3RK1904-3AB01", manual.
    .. [2] Beckhoff, "EL6201 AS-Interface master terminal", operating phases.

    Examples
    --------
    Led by hand: the first request goes to address 0, where a new slave would be.

    >>> class Nobody:
    ...     seconds = 0.0
    ...     def begin(self, phase, cycle): pass
    >>> requests = Master().run(Nobody())
    >>> print(next(requests).request)
    read the I/O configuration of slave 0
    >>> print(requests.send(SILENT).request)
    read the I/O configuration of slave 1
    """

    def __init__(
        self,
        projected: Mapping[str, Profile | str] | None = None,
        *,
        outputs: Mapping[str, int] | None = None,
        parameters: Mapping[str, int] | None = None,
        repetitions: int = 1,
        drop_after: int = 3,
        automatic_addressing: bool = False,
        status_poll: bool = True,
        readmit: bool = True,
        monitors_supply: bool = True,
    ) -> None:
        self.lists = Lists(projected, outputs, parameters)
        self.repetitions = check_whole("repetitions", repetitions, 0, 7)
        self.drop_after = check_whole("drop_after", drop_after, 1, 1000)
        if automatic_addressing and not self.lists.protected:
            raise ArgumentError(
                "automatic_addressing is True, but without projected slaves none is missing"
            )
        self.automatic_addressing = automatic_addressing
        self.status_poll, self.readmit = status_poll, readmit
        self.monitors_supply = monitors_supply
        self.phase = Phase.OFFLINE
        self.cycle, self.attempt = -1, 0
        self.dropped: list[tuple[float, str]] = []
        self.finished: list[tuple[float, Command, bool, str]] = []
        self._queue: deque[Command] = deque()
        self._command: tuple[Command, Task[str], Order] | None = None
        self._observer: Observer

    def submit(self, command: Command) -> None:
        """Queue a command of the host for the management phase."""
        self._queue.append(command)

    def run(self, observer: Observer, active: Mapping[str, int] | None = None) -> Task[None]:
        """Yield one request after the other and take the replies.

        Parameters
        ----------
        observer : Observer
            Is told each phase and knows the time.
        active : mapping of str to int, optional
            Slaves in data exchange with their outputs, of which a standby master knows from
            listening: it goes on with them, without a start-up. They must be projected.

        Yields
        ------
        Order
            The next request; it must be sent the reply 0..15, `SILENT` or `FAULTY`.
        """
        lists = self.lists
        self._observer = observer
        lists.clock = lambda: observer.seconds
        for key in sorted(lists.detected):
            lists.forget(key)
        lists.clear()
        self.attempt = 0
        self._failing: dict[int, int] = {}
        self._probe = self._turn = -1
        self._admission: tuple[Task[bool], Order] | None = None
        if active is None:
            self._begin(Phase.OFFLINE)
            while not lists.detected:
                yield from self._detect()
            self._begin(Phase.ACTIVATION)
            for key in sorted(lists.detected):
                yield from self._through(activate(lists, key))
        else:
            self._take_over(active)
        while True:
            self.cycle += 1
            self._begin(Phase.DATA_EXCHANGE)
            inputs, failing = lists.inputs, self._failing
            for poll in lists.schedule[self.cycle & 1]:
                reply = yield poll.order
                if reply >= 0:
                    inputs[poll.key] = reply
                    if failing:
                        failing.pop(poll.key, None)
                else:
                    yield from self._insist(poll)
            self._begin(Phase.MANAGEMENT)
            yield from self._manage()
            self._begin(Phase.INCLUSION)
            yield from self._include()

    def _begin(self, phase: Phase) -> None:
        self.phase = phase
        self._observer.begin(phase, self.cycle)

    def _take_over(self, active: Mapping[str, int]) -> None:
        for label, outputs in active.items():
            if label not in self.lists.projected:
                raise ArgumentError(f"slave {label} is active, but not projected")
            key = key_of(label)[0]
            self.lists.note(key, Identity(self.lists.projected[label], -1))
            self.lists.join(key, 0)
            self.lists.set_output(label, outputs)

    def _again(self, what: Order, reply: int) -> Task[int]:
        """Repeat a request whose reply failed."""
        for attempt in range(1, self.repetitions + 1):
            self.attempt = attempt
            reply = yield what
            if reply >= 0:
                break
        self.attempt = 0
        return reply

    def _send(self, what: Order) -> Task[int]:
        """Send a request, and again if need be."""
        reply = yield what
        probing = what.request.call is Call.READ_IO_CONFIGURATION and reply == SILENT
        if reply < 0 and what.expects and not probing:
            reply = yield from self._again(what, reply)
        return reply

    def _through(self, task: Task[T]) -> Task[T]:
        """Carry a task out from begin to end, without waiting for the next cycle."""
        reply: int | None = None
        while True:
            try:
                what = next(task) if reply is None else task.send(reply)
            except StopIteration as stop:
                done: T = stop.value
                return done
            reply = yield from self._send(what)

    def _insist(self, poll: Poll) -> Task[None]:
        """Repeat a failed data exchange; drop the slave if too many cycles failed."""
        key = poll.key
        reply = yield from self._again(poll.order, FAULTY)
        if reply >= 0:
            self.lists.inputs[key] = reply
            self._failing.pop(key, None)
            return
        self._failing[key] = self._failing.get(key, 0) + 1
        if self._failing[key] >= self.drop_after:
            del self._failing[key]
            self.dropped.append((self._observer.seconds, self.lists.label(key)))
            self.lists.forget(key)
            self.lists.left.add(key)

    def _detect(self) -> Task[None]:
        """Ask at all addresses who is there."""
        self._begin(Phase.DETECTION)
        for key in range(64):
            if self._can_be(key):
                identity = yield from self._through(identify(key))
                if identity is not None:
                    self.lists.note(key, identity)

    def _can_be(self, key: int) -> bool:
        """Whether a slave can be here: no half at address 0, and no B beside a standard slave."""
        first = self.lists.detected.get(key & ~1)
        return key != 1 and (not key & 1 or first is None or first.profile.extended)

    def _manage(self) -> Task[None]:
        """Send at most one request: of the host's command, or for a slave's status."""
        if self._command is None and self._queue:
            command = self._queue.popleft()
            self._advance(command, command.run(self.lists), None)
        polls = self.lists.polls
        if self._command is not None:
            command, task, what = self._command
            reply = yield from self._send(what)
            self._advance(command, task, reply)
        elif self.status_poll and polls:
            keys = sorted(polls)
            self._turn = next((key for key in keys if key > self._turn), keys[0])
            asked = order(Call.READ_STATUS, self._turn >> 1, half=polls[self._turn].half)
            status = yield from self._send(asked)
            if status >= 0:
                self.lists.periphery(self._turn, bool(status & 2))

    def _advance(self, command: Command, task: Task[str], reply: int | None) -> None:
        """Take a command on to its next request, or to its end."""
        try:
            self._command = (command, task, next(task) if reply is None else task.send(reply))
            return
        except StopIteration as stop:
            outcome, done = str(stop.value), True
        except CommandFailed as failure:
            outcome, done = str(failure), False
        self._command = None
        self.finished.append((self._observer.seconds, command, done, outcome))

    def _include(self) -> Task[None]:
        """Send one request: to the next vacant address, or to a slave that was found there."""
        if self._admission is None:
            task = self._admit(self._vacant())
            what = next(task)
        else:
            task, what = self._admission
        reply = yield from self._send(what)
        try:
            self._admission = (task, task.send(reply))
        except StopIteration:
            self._admission = None

    def _vacant(self) -> int:
        lists = self.lists
        while True:
            self._probe = (self._probe + 1) % 64
            if self._probe in lists.polls or not self._can_be(self._probe):
                continue
            if self.readmit or self._probe not in lists.left:
                return self._probe

    def _admit(self, key: int) -> Task[bool]:
        """Identify whoever is at an address, and take it in, one request a cycle."""
        lists = self.lists
        identity = yield from identify(key)
        if identity is None:
            lists.forget(key)
            return False
        if key in lists.polls:
            return False
        lists.note(key, identity)
        missing = [label for label in lists.projected if label not in lists.las]
        alone = len(missing) == 1 and self._command is None
        if key == 0 and self.automatic_addressing and alone:
            if lists.projected[missing[0]] == identity.profile:
                if (yield from move(lists, missing[0])):
                    key = key_of(missing[0])[0]
        return (yield from activate(lists, key))
