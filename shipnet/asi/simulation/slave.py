"""A slave at work: what it reads, what it remembers, what it answers, and when it stays silent.

What a request means depends on who reads it: the bits that carry four outputs to a standard slave
carry three outputs and a select bit to an A/B slave. A `PreparedRequest` is read once by each of
the three kinds of slave, and then knows what each of them makes of its bits.

The receive states are a table: state and event -> next state and action. A slave reads requests
only in the state RECEIVE. What it reads decides whether it keeps step with the master (SYNCHRONOUS)
or has to look for the next pause (ASYNCHRONOUS). icn2007, data link layer, section 3, tells the
table in words and refers to a Fig 3.19 that it does not print.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum
from functools import cache
from typing import Literal, NamedTuple, cast

from shipnet.asi.batch import NONE
from shipnet.asi.calls import Answer, Call
from shipnet.asi.elements import Half, Slave, label_of
from shipnet.asi.profile import IO_CONFIGURATIONS
from shipnet.asi.telegram import Request, Response
from shipnet.errors import ArgumentError, FrameError, UnknownCallError

# Requests as slaves read them ------------------------------------------------------------------

Kind = Literal[0, 1, 2]

#: The kinds of slave by what they make of the select bit: a standard slave, an A and a B slave.
KINDS: tuple[Half | None, ...] = (None, "A", "B")

_MOVING = (
    Call.ASSIGN_ADDRESS,
    Call.WRITE_ID1,
    Call.DELETE_ADDRESS,
    Call.RESET,
    Call.BROADCAST_RESET,
    Call.ENTER_PROGRAM_MODE,
)


class PreparedRequest:
    """A request with all that is needed to send it again and again."""

    __slots__ = ("bits", "code", "expects", "moves", "reads", "request", "station")

    #: Who is asked: the address in it, and 32 for the broadcast, which goes to all.
    station: int
    #: Call, address, half and data in 16 bits: 4, 5, 2 and 5 of them from the lowest up.
    code: int
    #: What a standard slave, an A and a B slave at this address read; None where the bits are not
    #: a request to it.
    reads: tuple[Request | None, ...]
    #: Whether the call has an answer at all, and whether it can change who is at which address.
    expects: bool
    moves: bool

    def __init__(self, request: Request) -> None:
        call, half = request.call, KINDS.index(request.half)
        self.request = request
        self.bits = request.bits
        self.station = 32 if call is Call.BROADCAST_RESET else request.address
        self.code = call | request.address << 4 | half << 9 | request.data << 11
        self.reads = tuple(_read(self.bits, kind) for kind in range(len(KINDS)))
        self.expects = call.rule.answer is not None
        self.moves = call in _MOVING


def _read(bits: str, kind: int) -> Request | None:
    try:
        request = Request.parse(bits, extended=kind > 0)
    except UnknownCallError:
        return None
    # A slave without an address is of no half yet, as a master does not know what it meets there;
    # the calls without a select bit go to it, or to everybody.
    meant = request.address == 0 or request.half is None or request.half == KINDS[kind]
    return request if meant else None


@cache
def prepared(call: Call, address: int, data: int = 0, half: Half | None = None) -> PreparedRequest:
    """Return a request made ready; the same one whenever it is asked for."""
    return PreparedRequest(Request(call, address, data, half))


# Receive states --------------------------------------------------------------------------------


class State(Enum):
    """Where a slave stands in the traffic on the line."""

    ASYNCHRONOUS = "asynchronous"
    RECEIVE = "receive"
    SYNCHRONOUS = "synchronous"


class Event(Enum):
    """What a slave hears."""

    PAUSE = "any pause"
    SLAVE_PAUSE = "pause after the response"
    ERROR = "error in the telegram"
    FOREIGN = "request to another address"
    UNKNOWN = "unknown call"
    OWN = "own request"
    SILENT = "call without answer"


class Action(Enum):
    """What a slave does on the way to its next state."""

    NONE = ""
    ANSWER = "answer"
    OBEY = "obey"


class Step(NamedTuple):
    """One arrow of the figure: the state that follows, and what the slave does on the way."""

    state: State
    action: Action


#: The arrows. Whoever is not named here stays where it is: an asynchronous slave reads nothing,
#: and a synchronous one lets the pause before a response and the response itself pass.
#: ERROR, FOREIGN, UNKNOWN and OWN are told by icn2007; so is the way out of ASYNCHRONOUS. The way
#: out of SYNCHRONOUS is our reading: taken at the pause *before* a response, it would make every
#: slave read the response as a faulty request, and none would ever answer in step.
TRANSITIONS: dict[tuple[State, Event], Step] = {
    (State.ASYNCHRONOUS, Event.PAUSE): Step(State.RECEIVE, Action.NONE),
    (State.ASYNCHRONOUS, Event.SLAVE_PAUSE): Step(State.RECEIVE, Action.NONE),
    (State.RECEIVE, Event.ERROR): Step(State.ASYNCHRONOUS, Action.NONE),
    (State.RECEIVE, Event.FOREIGN): Step(State.SYNCHRONOUS, Action.NONE),
    (State.RECEIVE, Event.UNKNOWN): Step(State.SYNCHRONOUS, Action.NONE),
    (State.RECEIVE, Event.OWN): Step(State.SYNCHRONOUS, Action.ANSWER),
    (State.RECEIVE, Event.SILENT): Step(State.SYNCHRONOUS, Action.OBEY),
    (State.SYNCHRONOUS, Event.SLAVE_PAUSE): Step(State.RECEIVE, Action.NONE),
}


# The slave -------------------------------------------------------------------------------------

#: Output and parameter bits after a reset: all set, the ports switched off (AS2702, p. 13).
DEFAULT = 0xF

_NEVER = float("inf")


class RunningSlave:
    """What a slave remembers while it runs; times are simulated [s] and must not run backwards.

    After a reset a slave keeps its outputs off and does not answer *data exchange* until a
    *write parameter* has come: the flag Data_Exchange_Disable of ZMD AG, "SAP5S/SAP51", data
    sheet rev. 3.1, 2012, pp. 39, 46, 47. Ports that are outputs are echoed in the response, p. 39.
    While it stores, it is silent to calls that would store something else. If it loses its supply
    meanwhile, it comes back at address 0 with its memory error flag set: our reading of the
    warning in Siemens, "IE/AS-INTERFACE LINK PN IO", manual, p. 169.
    """

    def __init__(self, settings: Slave) -> None:
        self.settings, self.profile = settings, settings.kind
        self.extended = self.profile.extended
        if settings.half and not self.extended:
            raise ArgumentError(
                f"{settings} has the profile {self.profile}; one with a half must be an A/B slave"
            )
        self.id1 = (7 if self.extended else 15) if settings.id1 is None else settings.id1
        if settings.half == "B":
            self.id1 |= 8
        self.address, self.inputs = settings.address, settings.inputs
        self.watchdog, self.write_time = settings.watchdog, settings.write_time
        self.locked = settings.locked

        ports = IO_CONFIGURATIONS[self.profile.io]
        self._in_mask = sum(1 << bit for bit, port in enumerate(ports) if port in ("IN", "I/O"))
        self._echo_mask = sum(1 << bit for bit, port in enumerate(ports) if port == "OUT")
        self._stored = (self.address, self.id1)
        self._writing_until = -_NEVER
        self.powered = True
        self.periphery_fault = self.memory_error = False
        #: When the watchdog reset the slave [s].
        self.trips: list[float] = []
        self._start()

    def _start(self) -> None:
        """Come up as after switching on: out of step with the master."""
        self.state = State.ASYNCHRONOUS
        self.synchronised = self.programming = False
        self._settle()

    def _settle(self) -> None:
        """Take the stored address, switch the ports off, and wait for parameters."""
        self.address, self.id1 = self._stored
        self.kind = self._kind()
        self.outputs = self.parameter = DEFAULT
        self.active = False
        self._expires = _NEVER

    def _kind(self) -> Kind:
        return cast("Kind", 1 + (self.id1 >> 3) if self.extended else 0)

    @property
    def half(self) -> Half | None:
        """Which half of its address an A/B slave takes; None for a standard slave."""
        return KINDS[self.kind]

    @property
    def label(self) -> str:
        """Its label: ``"21"``, ``"21A"``, ``"21B"``."""
        return label_of(2 * self.address + (self.kind == 2), extended=self.extended)

    def status(self, time: float = 0.0) -> int:
        """Return the status bits S3..S0 of a slave of specification 2.1, 0..15."""
        volatile = self._stores(time) or self._stored != (self.address, self.id1)
        return volatile | self.periphery_fault << 1 | self.memory_error << 3

    def switch_off(self, time: float = 0.0) -> None:
        """Take the supply away at a time [s]; what is being stored is lost with the address."""
        if self._stores(time):
            self._stored = (0, self._stored[1])
            self.memory_error = True
            self._writing_until = -_NEVER
        self.powered = False
        self._settle()

    def switch_on(self) -> None:
        """Give the supply back."""
        self.powered = True
        self._start()

    def pause(self, event: Event = Event.SLAVE_PAUSE) -> None:
        """Hear a pause."""
        if event not in (Event.PAUSE, Event.SLAVE_PAUSE):
            raise ArgumentError(f"event is {event}; it must be Event.PAUSE or Event.SLAVE_PAUSE")
        self._step(event)

    def _step(self, event: Event) -> Action:
        step = TRANSITIONS.get((self.state, event))
        if step is None:
            return Action.NONE
        self.state = step.state
        if step.state is not State.RECEIVE:
            self.synchronised = step.state is State.SYNCHRONOUS
        return step.action

    def hear(self, bits: str, time: float = 0.0) -> Response | None:
        """Hear one telegram."""
        if not self.powered or self.state is not State.RECEIVE:
            return None
        try:
            request = Request.parse(bits, extended=self.extended)
        except UnknownCallError:
            self._step(Event.UNKNOWN)
            return None
        except FrameError:
            self._step(Event.ERROR)
            return None
        self.rest(time)
        everybody = request.call is Call.BROADCAST_RESET
        other_half = request.half not in (None, self.half) and self.address != 0
        if not everybody and (request.address != self.address or other_half):
            self._step(Event.FOREIGN)
            return None
        data = self.obey(request, time)
        unanswered = Event.SILENT if request.call.rule.answer is None else Event.UNKNOWN
        event = Event.OWN if data != NONE else unanswered
        return Response(data, request.call) if self._step(event) is Action.ANSWER else None

    def rest(self, time: float) -> None:
        """Let the time pass up to `time` [s]: the watchdog may reset the slave meanwhile."""
        if time > self._expires:
            self.trips.append(self._expires)
            self._settle()

    def exchange(self, outputs: int, time: float) -> int:
        """Carry out *data exchange*."""
        if time > self._expires:
            self.rest(time)
        if not self.active:
            return NONE
        self.outputs = outputs
        self._expires = time + self.watchdog
        return self.inputs & self._in_mask | outputs & self._echo_mask

    def obey(self, request: Request, time: float) -> int:
        """Carry out a request that is meant for this slave."""
        if self.programming:
            return NONE
        return OBEY[request.call](self, request.data, time)

    def _write_parameter(self, data: int, time: float) -> int:
        if self.address == 0:
            return NONE
        self.rest(time)
        self.parameter = data
        self.active = True
        self._expires = time + self.watchdog
        return data

    def _stores(self, time: float) -> bool:
        return time < self._writing_until

    def _store(self, address: int, id1: int, answer: Answer, time: float) -> int:
        if self.address != 0 or self._stores(time):
            return NONE
        self.address, self.id1 = self._stored = address, id1
        self.kind = self._kind()
        self._writing_until = time + self.write_time
        return answer

    def _assign(self, data: int, time: float) -> int:
        return self._store(data, self.id1, Answer.DONE, time)

    def _write_id1(self, data: int, time: float) -> int:
        if self.profile.id2 is None or self.address != 0 or self._stores(time):
            return NONE
        # The address stays deleted, whatever the memory holds.
        self.id1 = data
        self.kind = self._kind()
        self._stored = (self._stored[0], data)
        self._writing_until = time + self.write_time
        return Answer.ERASED

    def _delete(self, data: int, time: float) -> int:
        if self.address == 0 or self._stores(time):
            return NONE
        self.address = 0
        self.active = False
        self._expires = _NEVER
        return Answer.ERASED

    def _reset(self, data: int, time: float) -> int:
        self._settle()
        return Answer.DONE

    def _broadcast(self, data: int, time: float) -> int:
        self._settle()
        return NONE

    def _program(self, data: int, time: float) -> int:
        if self.address == 0 and not self.locked:
            self._settle()
            self.programming = True
        return NONE


#: What each call does, in the order of `Call`; the data and the time are its arguments.
OBEY: tuple[Callable[[RunningSlave, int, float], int], ...] = (
    RunningSlave.exchange,
    RunningSlave._write_parameter,
    RunningSlave._assign,
    RunningSlave._write_id1,
    RunningSlave._delete,
    RunningSlave._reset,
    lambda slave, data, time: slave.profile.io,
    lambda slave, data, time: slave.profile.id,
    lambda slave, data, time: NONE if slave.profile.id2 is None else slave.id1,
    lambda slave, data, time: NONE if slave.profile.id2 is None else slave.profile.id2,
    lambda slave, data, time: slave.status(time),
    RunningSlave._broadcast,
    RunningSlave._program,
)
