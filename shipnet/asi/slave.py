"""A slave: its label, what it is, what it reads and remembers, and what it answers.

What a request means depends on who reads it: the bits that carry four outputs to a standard slave
carry three outputs and a select bit to an A/B slave. A `PreparedRequest` is read once for each of
the three kinds of slave and remembers what each of them makes of its bits.

The receive states are a table: state and event -> next state. A slave reads requests
only in the state RECEIVE. What it reads decides whether it keeps step with the master (SYNCHRONOUS)
or has to look for the next pause (ASYNCHRONOUS). icn2007, data link layer, section 3, describes the
table in words and refers to a Fig 3.19 that it does not print.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Callable, Iterable
from dataclasses import field
from enum import Enum
from functools import cache
from math import inf
from typing import Literal, cast

from shipnet import style
from shipnet.arguments import checked
from shipnet.asi.batch import NONE
from shipnet.asi.elements import CURRENT, DEVICE
from shipnet.asi.profile import IO_CONFIGURATIONS, Profile
from shipnet.asi.telegram import Answer, Call, Half, Request, Response
from shipnet.asi.timing import ADDRESSES, CHANNELS, CONVERSION
from shipnet.errors import ArgumentError, FrameError, UnknownCallError
from shipnet.fields import check_whole, number, record, switch, text, whole
from shipnet.lazy import Axes, pd
from shipnet.line.network import Load, check_node

#: After this time without data or parameters a slave resets itself [s]: SAP5S/SAP51 data sheet
#: rev. 3.1, 2012, p. 47. The AS2702 (rev. C, 2001, p. 13) does it after 50 ms to 100 ms.
WATCHDOG = 94.2e-3

#: Longest time that a slave takes to store its address [s]: Siemens, "IE/AS-INTERFACE LINK PN IO",
#: manual, p. 169.
WRITE_TIME = 15e-3


# Labels ----------------------------------------------------------------------------------------


def slave_key(label: str, name: str = "slave") -> tuple[int, Half | None]:
    """Return the key of a label, twice the address plus 1 for a B slave, and its half.

    Errors say which argument it is by its `name`.
    """
    found = _key_and_half(label) if isinstance(label, str) else None
    if found is None:
        raise ArgumentError(
            f"{name} is {label!r}; it must be '1'..'31', with A or B behind it for an A/B slave, "
            "or '0'"
        )
    return found


@cache
def _key_and_half(label: str) -> tuple[int, Half | None] | None:
    found = re.fullmatch(r"([0-9]{1,2})([AB]?)", label)
    if not found or int(found[1]) > ADDRESSES or (found[1].strip("0") == "" and found[2]):
        return None
    half: Half | None = "A" if found[2] == "A" else "B" if found[2] == "B" else None
    return 2 * int(found[1]) + (half == "B"), half


def label_of(key: int, *, extended: bool) -> str:
    """Return the label of a slave by its key; an A/B slave with an address has A or B in it."""
    return f"{key >> 1}{'AB'[key & 1] if extended and key > 1 else ''}"


@checked
@record
class Slave:
    """A slave: its address, what it is, and where it is.

    ID code A in its profile makes it an A/B slave; without an ID code 2 it is one from before
    specification 2.1, which answers neither request for an extended ID code. If the profile is
    omitted, it has four inputs: ``S-0.A.F`` with a half in the label, else ``S-0.F.F``. Its load
    on the cable is by default that of the limits of a chip's data sheet.

    Examples
    --------
    >>> print(Slave("12B", node="hatch 3"))
    slave 12B at hatch 3
    >>> Slave("5").profile, Slave("5A").profile
    (Profile(io=0, id=15, id2=15), Profile(io=0, id=10, id2=15))

    What it makes of each telegram that it hears; an empty one is a pause:

    >>> from shipnet.asi.telegram import Request
    >>> request = Request.read_id(21).bits
    >>> heard = Slave("21", "S-3.F.F").listen([request, "", request])
    >>> heard["state"].tolist()
    ['asynchronous', 'receive', 'synchronous']
    >>> heard["answer"].tolist()
    ['silence', '', 'answer to read ID code: 1111 (F)']
    """

    label: str = text("Address, 1 to 31 with A or B behind it for an A/B slave; 0 for a new one")
    profile: Profile | str = ""
    node: str = text("Where it is; needed in a plan", default="", kw_only=True)
    inputs: int = whole(0, 15, help="What its input ports read", default=0, kw_only=True)
    current: float = number(
        0, 10, "A", "What it draws from the line, sensors included", default=CURRENT, kw_only=True
    )
    id1: int | None = whole(
        0, 15, help="Extended ID code 1 (up to 7 for an A/B slave; all bits set if omitted)",
        default=None, optional=True, kw_only=True,
    )  # fmt: skip
    watchdog: float = number(
        0, inf, "s", "Time without data or parameters after which it resets itself",
        default=WATCHDOG, kw_only=True,
    )  # fmt: skip
    write_time: float = number(
        0, inf, "s", "Time to store an address or ID code 1", default=WRITE_TIME, kw_only=True
    )
    channels: int = whole(
        1, CHANNELS, help="Analogue values that it transfers, if its profile is one for values",
        default=1, kw_only=True,
    )  # fmt: skip
    conversion: float = number(
        0, 10, "s", "Time to convert an analogue value; makers print 20 to 60 ms",
        default=CONVERSION, kw_only=True,
    )  # fmt: skip
    locked: bool = switch("Whether its maker closed the program mode", default=True, kw_only=True)
    load: Load = field(default=DEVICE, kw_only=True)

    def __post_init__(self) -> None:
        half = slave_key(self.label, "label")[1]
        profile = self.profile or ("S-0.A.F" if half else "S-0.F.F")
        object.__setattr__(self, "profile", Profile.parse(profile))
        if self.node:
            check_node(self.node)
        if self.id1 is not None and self.kind.extended:
            check_whole("id1", self.id1, 0, 7)

    @property
    def kind(self) -> Profile:
        """Its profile."""
        assert isinstance(self.profile, Profile)
        return self.profile

    @property
    def address(self) -> int:
        """Its address, 0..31."""
        return slave_key(self.label)[0] >> 1

    @property
    def half(self) -> Half | None:
        """Which half of the address is its own; None for a standard slave."""
        return slave_key(self.label)[1]

    def listen(self, telegrams: Iterable[str]) -> pd.DataFrame:
        """Return what the slave makes of telegrams that it hears one after the other.

        One row per telegram: `telegram`, the receive `state` after it, and the `answer` in words.
        An empty telegram is a pause, as it follows a response.
        """
        running, rows = RunningSlave(self), []
        for bits in telegrams:
            if bits:
                answer = str(running.hear(bits) or "silence")
            else:
                running.pause()
                answer = ""
            rows.append((bits, running.state.value, answer))
        return pd.DataFrame(rows, columns=["telegram", "state", "answer"])

    @staticmethod
    def plot_states(ax: Axes | None = None) -> Axes:
        """Draw the receive states of any slave from their table: icn2007's figure 3.19.

        A box per state, an arrow from state to state with the events that lead along it, and
        after a slash what the slave does.
        """
        ax = style.axes(ax, figsize=(7.5, 2.6))
        for state, x in _X.items():
            style.box(
                ax,
                x - _HALF_WIDTH,
                -_HALF_HEIGHT,
                2 * _HALF_WIDTH,
                2 * _HALF_HEIGHT,
                facecolor=style.FIELD["address"],
                edgecolor="0.3",
            )
            ax.text(x, 0, state.value.upper(), ha="center", va="center")
        words = defaultdict(list)
        for (state, event), following in TRANSITIONS.items():
            # A pause after a response is a pause: where any will do, it need not be named.
            if event is Event.SLAVE_PAUSE and (state, Event.PAUSE) in TRANSITIONS:
                continue
            doing = f" / {ACTIONS[event]}" if event in ACTIONS else ""
            words[state, following].append(event.value + doing)
        for (begin, end), said in words.items():
            # Arrows out of RECEIVE run above those back to it, with their words outside.
            lane = _LANE if begin is State.RECEIVE else -_LANE
            side = 1 if _X[end] > _X[begin] else -1
            x0, x1 = _X[begin] + side * _HALF_WIDTH, _X[end] - side * _HALF_WIDTH
            arrow = {"arrowstyle": "-|>", "mutation_scale": 12, "color": "0.3"}
            ax.annotate(
                "", (x1, lane), (x0, lane), arrowprops={**arrow, "shrinkA": 0, "shrinkB": 0}
            )
            ax.text(
                (x0 + x1) / 2, lane + (0.08 if lane > 0 else -0.08), "\n".join(said), ha="center",
                va="bottom" if lane > 0 else "top",
            )  # fmt: skip
        return style.bare(ax, (-1.4, 13.4), (-0.9, 1.6))

    def __str__(self) -> str:
        return f"slave {self.label} at {self.node}" if self.node else f"slave {self.label}"


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
    """How a slave follows the traffic on the line."""

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


#: What a slave does when it hears an event in the state RECEIVE; it does nothing else.
ACTIONS = {Event.OWN: "answer", Event.SILENT: "obey"}

#: The state that follows. Whoever is not named here stays where it is: an asynchronous slave reads
#: nothing, and a synchronous one lets the pause before a response and the response itself pass.
#: icn2007 describes ERROR, FOREIGN, UNKNOWN and OWN, and the way out of ASYNCHRONOUS. The way
#: out of SYNCHRONOUS is our reading: taken at the pause *before* a response, it would make every
#: slave read the response as a faulty request, and none would ever answer in step.
TRANSITIONS = {
    (State.ASYNCHRONOUS, Event.PAUSE): State.RECEIVE,
    (State.ASYNCHRONOUS, Event.SLAVE_PAUSE): State.RECEIVE,
    (State.RECEIVE, Event.ERROR): State.ASYNCHRONOUS,
    (State.RECEIVE, Event.FOREIGN): State.SYNCHRONOUS,
    (State.RECEIVE, Event.UNKNOWN): State.SYNCHRONOUS,
    (State.RECEIVE, Event.OWN): State.SYNCHRONOUS,
    (State.RECEIVE, Event.SILENT): State.SYNCHRONOUS,
    (State.SYNCHRONOUS, Event.SLAVE_PAUSE): State.RECEIVE,
}


#: Middle of each state's box; half its width and height, and how far arrows keep from its middle.
_X = {State.ASYNCHRONOUS: 0.0, State.RECEIVE: 6.0, State.SYNCHRONOUS: 12.0}
_HALF_WIDTH, _HALF_HEIGHT, _LANE = 1.2, 0.5, 0.22


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

    def _step(self, event: Event) -> None:
        following = TRANSITIONS.get((self.state, event), self.state)
        if following is not self.state and following is not State.RECEIVE:
            self.synchronised = following is State.SYNCHRONOUS
        self.state = following

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
        self._step(Event.OWN if data != NONE else unanswered)
        return Response(data, request.call) if data != NONE else None

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
