"""A slave: its label, profile and receive states, and its responses to requests."""

from __future__ import annotations

import re
from dataclasses import KW_ONLY
from enum import Enum
from functools import cache
from math import inf
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from shipnet.asi.batch import NONE
from shipnet.asi.profile import IO_CONFIGURATIONS, Profile
from shipnet.asi.telegram import Answer, Call, Half, Request, Response
from shipnet.asi.timing import ADDRESSES, CHANNELS, CONVERSION
from shipnet.compiled import compiled
from shipnet.errors import ArgumentError, FrameError, UnknownCallError
from shipnet.fields import check_fields, check_whole, number, record, text, whole
from shipnet.line.network import Load, check_node

#: Default current of a slave [A], from Schneider's AS-i help D-SA-0011271: 65 mA on average.
#: Masters and repeaters are assumed to draw the same current.
CURRENT = 0.065

#: Load of a slave or a master: the limits in the SAP5S/SAP51 data sheet (2012, p. 29) for an A/B
#: slave.
DEVICE = Load(r=13.5e3, l=13.5e-3, c=50e-12)

#: A slave resets itself after this time without data or parameters [s]: SAP5S/SAP51 data sheet
#: rev. 3.1, 2012, p. 47. The AS2702 does so after 50 ms to 100 ms (rev. C, 2001, p. 13).
WATCHDOG = 94.2e-3

#: Longest time that a slave takes to store its address or ID code 1 [s]: Siemens,
#: "IE/AS-INTERFACE LINK PN IO", manual, p. 169.
WRITE_TIME = 15e-3


def slave_key(label: str, name: str = "slave") -> tuple[int, Half | None]:
    """Return a label's key (twice the address, plus 1 for a B slave) and half: A, B or None."""
    parsed = _key_and_half(label) if isinstance(label, str) else None
    if parsed is None:
        raise ArgumentError(
            f"{name} is {label!r}; it must be '0', or '1'..'31', followed by A or B for an A/B "
            "slave"
        )
    return parsed


@cache
def _key_and_half(label: str) -> tuple[int, Half | None] | None:
    match = re.fullmatch(r"([0-9]{1,2})([AB]?)", label)
    if not match or int(match[1]) > ADDRESSES or (match[1].strip("0") == "" and match[2]):
        return None
    half: Half | None = "A" if match[2] == "A" else "B" if match[2] == "B" else None
    return 2 * int(match[1]) + (1 if half == "B" else 0), half


def label_of(key: int, *, extended: bool) -> str:
    """Return the label for a slave's key, with A or B for an A/B slave that has an address."""
    return f"{key >> 1}{'AB'[key & 1] if extended and key > 1 else ''}"


@record
class Slave:
    """A slave with its address, profile and node.

    ID code A in the profile makes it an A/B slave. A slave whose profile has no ID code 2 predates
    specification 2.1 and does not respond to requests for extended ID codes. If the profile is
    omitted, the slave has four inputs: ``S-0.A.F`` with A or B in the label, otherwise ``S-0.F.F``.
    The default load on the cable consists of the limits in the data sheet of a slave chip.

    Examples
    --------
    >>> print(Slave("12B", node="hatch 3"))
    slave 12B at hatch 3
    >>> Slave("5").profile, Slave("5A").profile
    (Profile(io=0, id=15, id2=15), Profile(io=0, id=10, id2=15))
    """

    label: str = text("Address, 1 to 31, followed by A or B for an A/B slave; 0 for a new slave")
    profile: Profile | str = ""
    _: KW_ONLY
    node: str = text("Node of the slave; required in a plan", default="")
    inputs: int = whole(0, 15, help="State of its input ports", default=0)
    current: float = number(0, 10, "A", "Current from the line, including sensors", default=CURRENT)
    id1: int | None = whole(
        0,
        15,
        "",
        "Extended ID code 1; up to 7 for an A/B slave; all bits set if omitted",
        default=None,
        optional=True,
    )
    watchdog: float = number(
        0, inf, "s", "Time without data or parameters until it resets itself", default=WATCHDOG
    )
    channels: int = whole(1, CHANNELS, "", "Number of values that it transfers", default=1)
    conversion: float = number(
        0, 10, "s", "Time to convert a value; makers state 20 to 60 ms", default=CONVERSION
    )
    load: Load = DEVICE

    def __post_init__(self) -> None:
        check_fields(self)
        half = slave_key(self.label, "label")[1]
        profile = self.profile or ("S-0.A.F" if half else "S-0.F.F")
        object.__setattr__(self, "profile", Profile.parse(profile))
        if self.node:
            check_node(self.node)
        if self.id1 is not None and self.kind.extended:
            check_whole("id1", self.id1, 0, 7)

    @property
    def kind(self) -> Profile:
        """Its profile as a `Profile`."""
        assert isinstance(self.profile, Profile)
        return self.profile

    @property
    def address(self) -> int:
        """Its address, 0..31."""
        return slave_key(self.label)[0] >> 1

    @property
    def half(self) -> Half | None:
        """The half of the address that the slave's label names, A or B; None if it names none."""
        return slave_key(self.label)[1]

    def __str__(self) -> str:
        return f"slave {self.label} at {self.node}" if self.node else f"slave {self.label}"


#: Kinds of slave, by half: None for a standard slave, "A" or "B" for an A/B slave. The bits that
#: carry four outputs to a standard slave carry three outputs and the select bit to an A/B slave.
KINDS: tuple[Half | None, ...] = (None, "A", "B")

#: Calls that can change which slave is at which address.
MOVING = (
    Call.ASSIGN_ADDRESS,
    Call.WRITE_ID1,
    Call.DELETE_ADDRESS,
    Call.RESET,
    Call.BROADCAST_RESET,
)


@cache
def as_read(bits: str, kind: int) -> Request | None:
    """Return a request as one of the `KINDS` of slave at its address reads it, if it is meant."""
    try:
        request = Request.parse(bits, extended=kind > 0)
    except UnknownCallError:
        return None
    # At address 0 the select bit is ignored: a master does not know which slave is there.
    meant = request.address == 0 or request.half is None or request.half == KINDS[kind]
    return request if meant else None


class State(Enum):
    """The receive states of a slave."""

    ASYNCHRONOUS = "asynchronous"
    RECEIVE = "receive"
    SYNCHRONOUS = "synchronous"


class Event(Enum):
    """Events on the line that can change a slave's receive state."""

    PAUSE = "any pause"
    SLAVE_PAUSE = "pause after the response"
    ERROR = "error in the telegram"
    FOREIGN = "request to another address"
    UNKNOWN = "unknown call"
    OWN = "own request"
    SILENT = "call without answer"


#: The next state, by current state and event; unlisted events leave the state unchanged. An
#: asynchronous slave reads nothing; a synchronous one ignores a response and the pause before it.
#: icn2007, data link layer, section 3, describes ERROR, FOREIGN, UNKNOWN and OWN, and how a slave
#: leaves ASYNCHRONOUS; it refers to a Fig 3.19 that it does not print. How a slave leaves
#: SYNCHRONOUS is our interpretation: if it did so at the pause *before* a response, every slave
#: would read the response as a faulty request, and none would ever be synchronised.
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


#: Output and parameter bits after a reset: all set, with the ports switched off (AS2702, p. 13).
DEFAULT = 0xF


#: State of a slave in data exchange, one element per slave: what it needs to answer, and when.
STATE = np.dtype(
    [
        ("synchronised", bool),  # it has received the request
        ("active", bool),  # it has received parameters
        ("inputs", np.int64),
        ("outputs", np.int64),
        ("in_mask", np.int64),  # data bits that it answers with its inputs
        ("echo_mask", np.int64),  # data bits that it answers with its outputs
        ("watchdog", float),
        ("expires", float),  # time at which the watchdog resets it [s]
        ("delay", float),  # pause before its responses [bit]
        ("asked", np.int64),  # number of the last request to it
        ("since", np.int64),  # number of the first request since power-on
        ("periphery_fault", bool),
        ("quiet", bool),  # whether drawn disturbances are ignored
    ]
)

States: TypeAlias = npt.NDArray[np.void]


@compiled
def exchange(states: States, slave: int, outputs: int, time: float) -> int:
    """Let a slave carry out *data exchange* at `time` [s]; return its data, or -1 if not active."""
    if not states["active"][slave]:
        return -1
    states["outputs"][slave] = outputs
    states["expires"][slave] = time + states["watchdog"][slave]
    inputs = states["inputs"][slave] & states["in_mask"][slave]
    data: int = inputs | outputs & states["echo_mask"][slave]
    return data


class RunningSlave:
    """The state of a running slave; times are simulated [s] and must not decrease."""

    # ZMD AG, "SAP5S/SAP51", data sheet rev. 3.1, 2012, pp. 39, 46, 47: after a reset a slave keeps
    # its outputs off and does not respond to *data exchange* until it receives *write parameter*
    # (flag Data_Exchange_Disable); its response echoes the bits of the output ports. Siemens,
    # "IE/AS-INTERFACE LINK PN IO", manual, p. 169, warns of a loss of supply while a slave stores
    # data; we infer that the slave restarts at address 0 with its memory error flag set.

    def __init__(self, settings: Slave, states: States | None = None, row: int = 0) -> None:
        self.states, self.row = np.zeros(1, STATE) if states is None else states, row
        #: Its own element of the states, by field.
        self.fields = self.states[row]
        self.settings, self.profile = settings, settings.kind
        self.extended = self.profile.extended
        if settings.half and not self.extended:
            raise ArgumentError(
                f"{settings} has the profile {self.profile}; a label with A or B is for A/B slaves"
            )
        self.id1 = (7 if self.extended else 15) if settings.id1 is None else settings.id1
        if settings.half == "B":
            self.id1 |= 8
        self.address = settings.address

        ports = IO_CONFIGURATIONS[self.profile.io]
        self.fields["inputs"], self.fields["watchdog"] = settings.inputs, settings.watchdog
        self.fields["in_mask"] = sum(
            1 << bit for bit, port in enumerate(ports) if port in ("IN", "I/O")
        )
        self.fields["echo_mask"] = sum(1 << bit for bit, port in enumerate(ports) if port == "OUT")
        self._stored = (self.address, self.id1)
        self._writing_until = -inf
        self.powered = True
        self.memory_error = False
        #: Times at which the watchdog reset the slave [s].
        self.trips: list[float] = []
        self._start()

    def _start(self) -> None:
        """Start in the state after power-on, not synchronised with the master."""
        self.state = State.ASYNCHRONOUS
        self.fields["synchronised"] = False
        self._settle()

    def _settle(self) -> None:
        """Restore the stored address, switch the ports off, and wait for parameters."""
        self.address, self.id1 = self._stored
        self.kind = self._kind()
        self.fields["outputs"] = self.parameter = DEFAULT
        self.fields["active"], self.fields["expires"] = False, inf

    def _kind(self) -> int:
        return 1 + (self.id1 >> 3) if self.extended else 0

    @property
    def half(self) -> Half | None:
        """The half of the address that the slave uses, A or B; None for a standard slave."""
        return KINDS[self.kind]

    @property
    def label(self) -> str:
        """Its label: ``"21"``, ``"21A"``, ``"21B"``."""
        return label_of(2 * self.address + (1 if self.kind == 2 else 0), extended=self.extended)

    def status(self, time: float = 0.0) -> int:
        """Return the status bits S3..S0 of specification 2.1 as one number, 0..15."""
        volatile = self._stores(time) or self._stored != (self.address, self.id1)
        return volatile | int(self.fields["periphery_fault"]) << 1 | self.memory_error << 3

    def switch_off(self, time: float = 0.0) -> None:
        """Disconnect the supply at `time` [s]; a slave that is storing data loses its address."""
        if self._stores(time):
            self._stored = (0, self._stored[1])
            self.memory_error = True
            self._writing_until = -inf
        self.powered = False
        self._settle()

    def switch_on(self) -> None:
        """Connect the supply again."""
        self.powered = True
        self._start()

    def pause(self, event: Event = Event.SLAVE_PAUSE) -> None:
        """Handle a pause: `Event.PAUSE` or `Event.SLAVE_PAUSE`."""
        self._step(event)

    def _step(self, event: Event) -> None:
        following = TRANSITIONS.get((self.state, event), self.state)
        if following is not self.state and following is not State.RECEIVE:
            self.fields["synchronised"] = following is State.SYNCHRONOUS
        self.state = following

    def hear(self, bits: str, time: float = 0.0) -> Response | None:
        """Receive one telegram and return the response, or None if there is none."""
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
        data = self.obey(request.call, request.data, time)
        unanswered = Event.SILENT if request.call.rule.answer is None else Event.UNKNOWN
        self._step(Event.OWN if data != NONE else unanswered)
        return Response(data, request.call) if data != NONE else None

    def rest(self, time: float) -> None:
        """Let time pass up to `time` [s]; the watchdog may reset the slave."""
        if time > self.fields["expires"]:
            self.trips.append(float(self.fields["expires"]))
            self._settle()

    def obey(self, call: Call, data: int, time: float) -> int:
        """Carry out a call at `time` [s]; return the data of the response, or NONE."""
        extended = self.profile.id2
        match call:
            case Call.DATA_EXCHANGE:
                self.rest(time)
                return int(exchange(self.states, self.row, data, time))
            case Call.WRITE_PARAMETER if self.address:
                self.rest(time)
                self.parameter = data
                self.fields["active"], self.fields["expires"] = True, time + self.fields["watchdog"]
                return data
            case Call.ASSIGN_ADDRESS if self.address == 0 and not self._stores(time):
                self.address = data
                self._store(data, self.id1, time)
                return Answer.DONE
            case Call.WRITE_ID1 if extended is not None and self.address == 0:
                if self._stores(time):
                    return NONE
                # The slave stays at address 0, and its stored address does not change.
                self._store(self._stored[0], data, time)
                return Answer.ERASED
            case Call.DELETE_ADDRESS if self.address and not self._stores(time):
                self.address = 0
                self.fields["active"], self.fields["expires"] = False, inf
                return Answer.ERASED
            case Call.RESET | Call.BROADCAST_RESET:
                self._settle()
                return Answer.DONE if call is Call.RESET else NONE
            case Call.READ_IO_CONFIGURATION:
                return self.profile.io
            case Call.READ_ID:
                return self.profile.id
            case Call.READ_ID1 | Call.READ_ID2 if extended is not None:
                return self.id1 if call is Call.READ_ID1 else extended
            case Call.READ_STATUS:
                return self.status(time)
        return NONE  # manufacturers lock the program mode, so no slave enters it

    def _stores(self, time: float) -> bool:
        return time < self._writing_until

    def _store(self, address: int, id1: int, time: float) -> None:
        self._stored, self.id1 = (address, id1), id1
        self.kind = self._kind()
        self._writing_until = time + WRITE_TIME
