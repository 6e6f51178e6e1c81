"""AS-Interface master: settings, lists, tasks and phases.

Internally, each slave has a key: twice its address, plus 1 for a B slave. The host uses labels such
as 12B. A task yields requests and receives a reply to each: four data bits, `SILENT` or `FAULTY`.
"""

from __future__ import annotations

from bisect import bisect
from collections import deque
from collections.abc import Callable, Generator, Iterator, Mapping
from dataclasses import KW_ONLY
from enum import IntEnum
from functools import cache
from typing import Any, NamedTuple, Protocol, TypeAlias, TypeVar, cast

import numpy as np

from shipnet.arrays import Indices
from shipnet.asi.profile import Profile
from shipnet.asi.slave import CURRENT, label_of, slave_key
from shipnet.asi.telegram import Call, Half, Request
from shipnet.errors import ArgumentError
from shipnet.fields import check_fields, check_whole, number, part, record, switch, text, whole
from shipnet.line.network import check_node


def _no_profiles(value: object) -> Any:
    """Raise an error that shows how to give profiles, and a node."""
    raise ArgumentError(
        f"projected is {value!r}; it must map labels to profiles, such as {{'1': 'S-7.F.F'}}; a "
        "node is given by its name, such as node='PLC'"
    )


@record
class Master:
    """An AS-Interface master, its settings and its node.

    Notes
    -----
    By default, a slave is dropped after two failed tries in each of three consecutive cycles; the
    analyser in [1]_ also counts a slave as lost after six failed tries. *Read I/O configuration* is
    repeated after a faulty response but not after a missing one. The operating phases follow [2]_.
    If the host has no command, the master reads the status of one active slave per cycle, in turn.
    If the supply fails, the master stops; it restarts when the supply returns.

    References
    ----------
    .. [1] Siemens, "AS-Interface Analyser 3RK1904-3AB01", manual.
    .. [2] Beckhoff, "EL6201 AS-Interface master terminal", operating phases.

    Examples
    --------
    >>> Master({"1": "S-7.F.F"}, repetitions=2).protected
    True
    """

    projected: Mapping[str, Profile | str] | None = part(
        Mapping,
        "Profiles of the projected slaves by label: the master activates only these "
        "(protected mode); if omitted, it activates all slaves (configuration mode)",
        default=None,
        optional=True,
        make=_no_profiles,
    )
    _: KW_ONLY
    outputs: Mapping[str, int] = part(
        Mapping,
        "Outputs of each slave by label, 0..15, or 0..7 for an A/B slave; by default all "
        "bits are set",
        default_factory=dict,
    )
    repetitions: int = whole(0, 7, "", "Immediate repetitions of a failed request", default=1)
    drop_after: int = whole(
        1, 1000, "", "Consecutive failed data exchanges after which a slave is dropped", default=3
    )
    automatic_addressing: bool = switch(
        "True if a new slave at address 0 replaces the only missing slave, provided that both "
        "have the same profile; in protected mode only",
        default=False,
    )
    node: str = text("Node of the master; required in a plan", default="")
    current: float = number(
        0, 10, "A", "Current from the line; by default as assumed for a slave", default=CURRENT
    )

    def __post_init__(self) -> None:
        check_fields(self)
        if self.node:
            check_node(self.node)
        projected = {}
        for label, profile_text in (self.projected or {}).items():
            profile = Profile.parse(profile_text)
            key, half = slave_key(label)
            if profile.extended != (half is not None) or key < 2:
                raise ArgumentError(
                    f"slave {label} is projected as {profile}; the label of an A/B slave must have "
                    "A or B, a standard slave's must not, and the address must be 1..31"
                )
            projected[label] = profile
        if self.protected:
            object.__setattr__(self, "projected", projected)
        elif self.automatic_addressing:
            raise ArgumentError(
                "automatic_addressing is True, but no slave is projected; give at least one"
            )
        outputs = {label: check_bits("output", label, n) for label, n in self.outputs.items()}
        object.__setattr__(self, "outputs", outputs)

    @property
    def protected(self) -> bool:
        """True if the master activates only the projected slaves."""
        return self.projected is not None

    def __str__(self) -> str:
        return f"master at {self.node}" if self.node else "master"


def check_bits(what: str, label: str, value: int) -> int:
    """Check and return the output or parameter bits of a slave: four, or three for an A/B slave."""
    return check_whole(f"{what} of slave {label}", value, 0, 7 if slave_key(label)[1] else 15)


class Identity(NamedTuple):
    """The profile of a slave and its extended ID code 1, -1 if the code was not read."""

    profile: Profile
    id1: int


def half_of(key: int, profile: Profile) -> Half | None:
    """Return a slave's half, A or B; None for a standard slave and at address 0."""
    if not profile.extended or key < 2:
        return None
    return "B" if key & 1 else "A"


class Lists:
    """Lists of slaves: projected (LPS), detected (LDS), active (LAS), periphery faults (LPF)."""

    def __init__(self, settings: Master) -> None:
        self.protected = settings.protected
        self.projected = cast("dict[str, Profile]", dict(settings.projected or {}))
        self.clock: Callable[[], float] = lambda: 0.0
        #: Time [s], list (LDS, LAS or LPF), label, and True if the slave was added, else False.
        self.changes: list[tuple[float, str, str, bool]] = []
        #: Outputs and parameters by label; by default all bits are set.
        self.outputs = dict(settings.outputs)
        self.parameters: dict[str, int] = {}
        self.clear()

    def clear(self) -> None:
        """Empty all lists except the LPS."""
        self.detected: dict[int, Identity] = {}
        #: Data exchange request for each active slave, with its outputs.
        self.polls: dict[int, Request] = {}
        self.faulty: set[int] = set()
        self._plan()

    @property
    def lds(self) -> list[str]:
        """Labels of the detected slaves."""
        return [self.label(key) for key in sorted(self.detected)]

    @property
    def las(self) -> list[str]:
        """Labels of the active slaves."""
        return [self.label(key) for key in self.active]

    def label(self, key: int) -> str:
        """Return the label of the slave with a given key."""
        identity = self.detected.get(key)
        return label_of(key, extended=identity is not None and identity.profile.extended)

    def parameter(self, key: int) -> int:
        """Return the parameter bits of a detected slave."""
        all_set = (1 << self.detected[key].profile.output_bits) - 1
        return self.parameters.get(self.label(key), all_set) & all_set

    def wanted(self, key: int) -> bool:
        """Return True if a detected slave should be active."""
        profile = self.detected[key].profile
        return key > 1 and (not self.protected or self.projected.get(self.label(key)) == profile)

    def note(self, key: int, identity: Identity) -> None:
        """Add a slave to the LDS."""
        if self.detected.get(key) != identity:
            if key in self.detected:
                self._change("LDS", key, False)
            self.detected[key] = identity
            self._change("LDS", key, True)
            self._plan()

    def join(self, key: int) -> None:
        """Add a detected slave to the LAS."""
        if key not in self.polls:
            self._change("LAS", key, True)
        profile = self.detected[key].profile
        data = self.outputs.get(self.label(key), 0xF) & (1 << profile.output_bits) - 1
        self.polls[key] = Request(Call.DATA_EXCHANGE, key >> 1, data, half_of(key, profile))
        self._plan()

    def periphery(self, key: int, faulty: bool) -> None:
        """Add a slave to the LPF if `faulty`; otherwise remove it."""
        if faulty != (key in self.faulty):
            (self.faulty.add if faulty else self.faulty.discard)(key)
            self._change("LPF", key, faulty)
            self._plan()

    def forget(self, key: int) -> None:
        """Remove a slave from the LDS, LAS and LPF."""
        self.periphery(key, False)
        if self.polls.pop(key, None):
            self._change("LAS", key, False)
        if key in self.detected:
            self._change("LDS", key, False)
            del self.detected[key]
            self._plan()

    def can_be(self, key: int) -> bool:
        """Return False for a B slave at address 0 or at the address of a standard slave."""
        first = self.detected.get(key & ~1)
        return key != 1 and (not key & 1 or first is None or first.profile.extended)

    def _plan(self) -> None:
        # If both halves of an address are active, they are polled in alternate cycles.
        both = {key >> 1 for key in self.polls if key & 1 and key - 1 in self.polls}
        self.active = sorted(self.polls)
        #: Keys at which the master looks for new slaves.
        self.vacant = [key for key in range(64) if key not in self.polls and self.can_be(key)]
        #: Keys of the slaves to poll in even and in odd cycles.
        self.schedule = (
            [key for key in self.active if key >> 1 not in both or not key & 1],
            [key for key in self.active if key >> 1 not in both or key & 1],
        )

    def _change(self, which: str, key: int, present: bool) -> None:
        self.changes.append((self.clock(), which, self.label(key), present))


#: Replies in place of data bits: no response before the time-out, and an invalid response.
SILENT, FAULTY = -1, -2

T = TypeVar("T")
Task: TypeAlias = Generator[Request, int, T]

#: Maximum number of status requests while a slave stores its address: at one per cycle, enough for
#: 15 ms even if the cycles contain nothing else and take only 26 bit times.
_PATIENCE = 100


@cache
def look_for(key: int) -> Request:
    """Return the request that finds out whether there is a slave."""
    return Request(Call.READ_IO_CONFIGURATION, key >> 1, half="B" if key & 1 else None)


@cache
def read_status(poll: Request) -> Request:
    """Return the request for the status of a slave that is polled with a given request."""
    return Request(Call.READ_STATUS, poll.address, half=poll.half)


def identify(key: int) -> Task[Identity | None]:
    """Read the profile and ID code 1 of a slave; return None if the profile cannot be read."""
    half: Half | None = "B" if key & 1 else None
    io = yield look_for(key)
    if io < 0:
        return None
    code = yield Request(Call.READ_ID, key >> 1, half=half)
    if code < 0:
        return None
    id1 = yield Request(Call.READ_ID1, key >> 1, half=half)
    id2 = yield Request(Call.READ_ID2, key >> 1, half=half)
    return Identity(Profile(io, code, id2 if id2 >= 0 else None), max(id1, -1))


def activate(lists: Lists, key: int) -> Task[bool]:
    """Activate a detected slave, if it should be active: send its parameters and first outputs."""
    if not lists.wanted(key):
        return False
    profile = lists.detected[key].profile
    half = half_of(key, profile)
    reply = yield Request(Call.WRITE_PARAMETER, key >> 1, lists.parameter(key), half)
    if reply < 0:
        return False
    # All bits of the first outputs are set, so that the output ports stay off.
    reply = yield Request(Call.DATA_EXCHANGE, key >> 1, (1 << profile.output_bits) - 1, half)
    if reply < 0 or key not in lists.detected:
        return False
    lists.join(key)
    return True


def move(lists: Lists, label: str) -> Task[bool]:
    """Assign a label to the slave at address 0: first the half, if any, then the address."""
    identity = lists.detected[0]
    key, half = slave_key(label)
    id1 = identity.id1 & 7 | (8 if half == "B" else 0)
    if half and id1 != identity.id1:
        yield Request(Call.WRITE_ID1, 0, id1)
        yield from wait_for_storing(0, None)
    yield Request(Call.ASSIGN_ADDRESS, 0, key >> 1)
    yield from wait_for_storing(key >> 1, half)
    identity_there = yield from identify(key)
    if identity_there is None or identity_there.profile != identity.profile:
        return False
    lists.forget(0)
    lists.note(key, identity_there)
    return True


def wait_for_storing(address: int, half: Half | None) -> Task[None]:
    """Read the status of a slave until the slave has stored its address or ID code 1."""
    for _ in range(_PATIENCE):
        status = yield Request(Call.READ_STATUS, address, half=half)
        if status >= 0 and not status & 1:
            return


class Phase(IntEnum):
    """The phases of a master, in the order in which they run."""

    OFFLINE = 0
    DETECTION = 1
    ACTIVATION = 2
    DATA_EXCHANGE = 3
    MANAGEMENT = 4
    INCLUSION = 5


class Observer(Protocol):
    """An object that provides the simulated time and is notified when a master's phase begins."""

    @property
    def seconds(self) -> float:
        """The simulated time [s]."""

    def begin(self, phase: Phase, cycle: int) -> None:
        """Handle the beginning of a phase in a cycle."""


class Command(Protocol):
    """A command of the host, carried out with one request per cycle in the management phase."""

    def run(self, lists: Lists) -> Task[str]:
        """Yield requests, receive replies, and return the outcome in words."""


class CommandFailed(Exception):
    """Raised if a command of the host cannot be carried out; the message says why."""


class RunningMaster:
    """A simulated master, which yields requests and receives the replies."""

    def __init__(self, settings: Master) -> None:
        self.settings, self.lists = settings, Lists(settings)
        self.repetitions, self.drop_after = settings.repetitions, settings.drop_after
        self.cycle, self.attempt = -1, 0
        self.dropped: list[tuple[float, str]] = []
        self.finished: list[tuple[float, Command, bool, str]] = []
        self._queue: deque[Command] = deque()
        self._command: tuple[Command, Task[str], Request] | None = None
        self._observer: Observer

    def submit(self, command: Command) -> None:
        """Queue a command of the host for the management phase."""
        self._queue.append(command)

    def run(
        self,
        observer: Observer,
        active: Mapping[str, int] | None = None,
        poll: Callable[[RunningMaster], Phase | None] | None = None,
    ) -> Task[None]:
        """Yield requests and receive replies; the `active` slaves, if given, need no activation.

        If given, `poll` polls the slaves in each cycle; it returns the next phase, or None to stop.
        """
        lists = self.lists
        self._observer = observer
        lists.clock = lambda: observer.seconds
        for key in sorted(lists.detected):
            lists.forget(key)
        lists.clear()
        self.attempt = 0
        self.failures = np.zeros(64, np.int64)
        self._probe = self._turn = -1
        self._admission: tuple[Task[bool], Request] | None = None
        if active is None:
            self._begin(Phase.OFFLINE)
            while not lists.detected:
                self._begin(Phase.DETECTION)
                for key in filter(lists.can_be, range(64)):
                    identity = yield from self._through(identify(key))
                    if identity is not None:
                        lists.note(key, identity)
            self._begin(Phase.ACTIVATION)
            for key in sorted(lists.detected):
                yield from self._through(activate(lists, key))
        else:
            for label, outputs in active.items():
                key = slave_key(label)[0]
                lists.note(key, Identity(lists.projected[label], -1))
                lists.outputs[label] = outputs
                lists.join(key)
        while True:
            self.cycle += 1
            self._begin(Phase.DATA_EXCHANGE)
            phase: Phase | None = Phase.MANAGEMENT
            if poll is not None:
                phase = poll(self)
            else:
                for key in lists.schedule[self.cycle & 1]:
                    self.receive(key, (yield from self._send(lists.polls[key])))
            if phase is None:
                return
            if phase == Phase.MANAGEMENT:
                self._begin(Phase.MANAGEMENT)
                yield from self._manage()
            if phase >= Phase.MANAGEMENT:
                self._begin(Phase.INCLUSION)
                yield from self._include()

    def usual(self) -> Iterator[tuple[int, int, Request]]:
        """Yield the requests that usual cycles consist of: phase (0 to 2), key and request."""
        lists = self.lists
        for key, request in lists.polls.items():
            yield 0, key, request
            if key not in lists.faulty:
                yield 1, key, read_status(request)
        for key in lists.vacant:
            if key not in lists.detected:
                yield 2, key, look_for(key)

    def ahead(self, cycles: int) -> Indices:
        """Return the keys of the next requests, one row per cycle, beginning with the present one.

        The columns are the slaves to poll, the slave whose status is read, and the vacant address.
        Return only the slaves to poll now if the host has a command or a slave is being included.
        """
        lists, number = self.lists, np.arange(cycles)
        polled: Indices = np.array(lists.schedule, np.intp)[(self.cycle + number) & 1]
        if self._command or self._queue or self._admission or not lists.active:
            return polled[:1]
        status = np.take(lists.active, bisect(lists.active, self._turn) + number, mode="wrap")
        vacant = np.take(lists.vacant, bisect(lists.vacant, self._probe) + number, mode="wrap")
        return np.column_stack([polled, status, vacant])

    def go_on(self, cycles: int, done: list[int]) -> None:
        """Continue `cycles` later, after status requests and searches in turn at keys `done`."""
        self.cycle += cycles
        if done:
            self._turn = done[::2][-1]
        if len(done) > 1:
            self._probe = done[1::2][-1]

    def _begin(self, phase: Phase) -> None:
        self._observer.begin(phase, self.cycle)

    def _send(self, what: Request) -> Task[int]:
        """Send a request, and repeat it while it fails and a repetition is left."""
        reply = yield what
        probing = what.call is Call.READ_IO_CONFIGURATION and reply == SILENT
        if what.call.rule.answer is not None and not probing:
            while reply < 0 and self.attempt < self.repetitions:
                self.attempt += 1
                reply = yield what
            self.attempt = 0
        return reply

    def _through(self, task: Task[T]) -> Task[T]:
        """Run a task to its end; its requests do not wait for the next cycle."""
        reply: int | None = None
        while True:
            try:
                what = next(task) if reply is None else task.send(reply)
            except StopIteration as stop:
                done: T = stop.value
                return done
            reply = yield from self._send(what)

    def receive(self, key: int, reply: int) -> None:
        """Handle the result of a data exchange; drop the slave after too many failures in a row."""
        self.failures[key] = self.failures[key] + 1 if reply < 0 else 0
        if self.failures[key] >= self.drop_after:
            self.failures[key] = 0
            self.dropped.append((self._observer.seconds, self.lists.label(key)))
            self.lists.forget(key)

    def _manage(self) -> Task[None]:
        """Send at most one request: for the host's command, or to read a slave's status."""
        if self._command is None and self._queue and not self.attempt:
            command = self._queue.popleft()
            self._advance(command, command.run(self.lists), None)
        polls = self.lists.polls
        if self._command is not None:
            command, task, what = self._command
            reply = yield from self._send(what)
            self._advance(command, task, reply)
        elif polls:
            self._turn = _after(self._turn, self.lists.active)
            status = yield from self._send(read_status(self.lists.polls[self._turn]))
            if status >= 0:
                self.lists.periphery(self._turn, bool(status & 2))

    def _advance(self, command: Command, task: Task[str], reply: int | None) -> None:
        """Advance a command to its next request or to its end."""
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
        """Send one request: to the next vacant address, or to a slave found at such an address."""
        if self._admission is None:
            self._probe = _after(self._probe, self.lists.vacant)
            task = self._admit(self._probe)
            self._admission = task, next(task)
        task, what = self._admission
        reply = yield from self._send(what)
        try:
            self._admission = (task, task.send(reply))
        except StopIteration:
            self._admission = None

    def _admit(self, key: int) -> Task[bool]:
        """Identify and activate a newly found slave, with one request per cycle."""
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
        if key == 0 and self.settings.automatic_addressing and alone:
            if lists.projected[missing[0]] == identity.profile:
                if (yield from move(lists, missing[0])):
                    key = slave_key(missing[0])[0]
        return (yield from activate(lists, key))


def _after(key: int, keys: list[int]) -> int:
    """Return the next of some sorted keys, in turn."""
    return keys[bisect(keys, key) % len(keys)]
