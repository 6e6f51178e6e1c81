"""One station of the link: whose turn it is, what it sends, its counters and its ring."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import NamedTuple

from shipnet.errors import ArgumentError
from shipnet.fields import check_whole
from shipnet.remote_control.packet_format import Items, PacketFormat, Parser
from shipnet.remote_control.ring_buffer import Ring
from shipnet.remote_control.system import Counter, System
from shipnet.remote_control.values import HOPS


def changed_items(sending: Sequence[int], sended: Sequence[int]) -> dict[int, int]:
    """Return the values that differ from those sent last, by number.

    Parameters
    ----------
    sending : sequence of int
        The values to send, 0..65535 each; ``SENDING`` of the paper [1]_.
    sended : sequence of int
        The values sent last, ``SENDED`` of the paper; as many as `sending`.

    Returns
    -------
    dict of int to int
        Number and value of each that differs, ``NEW_SEND`` of the paper; it may be empty.

    Raises
    ------
    ArgumentError
        If the two differ in length, or a value is not a whole number 0..65535.

    References
    ----------
    .. [1] K. Y. Chung, K. S. Rhyu, "A study on the communication method for a ship main engine
       remote control system", J. Korean Soc. Marine Eng., 1998, section 4.1 and Fig 6.

    Examples
    --------
    >>> from shipnet import remote_control as rc
    >>> rc.changed_items([120, 1, 0], [118, 1, 1])
    {0: 120, 2: 0}
    """
    if len(sending) != len(sended):
        raise ArgumentError(
            f"sending has {len(sending)} data; it must have {len(sended)}, as many as sended"
        )
    pairs = zip(_values("sending", sending), _values("sended", sended), strict=True)
    return {number: value for number, (value, last) in enumerate(pairs) if value != last}


def _values(name: str, values: Sequence[int]) -> list[int]:
    # The name of a value is only made for one that does not look right: there are two per byte.
    return [
        value
        if type(value) is int and 0 <= value <= 0xFFFF
        else check_whole(f"{name}[{number}]", value, 0, 0xFFFF)
        for number, value in enumerate(values)
    ]


class Sender:
    """Packs what has changed, and takes it as received: there is no acknowledgement.

    With each packet go `repeat` of the other values in turn, though they have not changed. 0 is
    the paper's rule, by which a lost packet leaves the other side with old values until they
    change again; with k, they are corrected within ``ceil(n_numbers / k)`` packets.
    """

    def __init__(
        self, packet_format: PacketFormat, sended: Sequence[int] | None = None, *, repeat: int = 0
    ) -> None:
        n = packet_format.n_numbers
        self.packet_format = packet_format
        self.sended = [0] * n if sended is None else list(sended)
        self.repeat = check_whole("repeat", repeat, 0, n)
        self._turn = 0
        if len(self.sended) != n:
            raise ArgumentError(f"sended has {len(self.sended)} data; it must have {n}")

    def packet(self, sending: Sequence[int]) -> bytes:
        """Return the next packet of these values, and take them as received."""
        n = self.packet_format.n_numbers
        again = [number % n for number in range(self._turn, self._turn + self.repeat)]
        items = changed_items(sending, self.sended) | {n: sending[n] for n in again}
        packet = self.packet_format.encode(items)
        self._turn = (self._turn + self.repeat) % n
        self.sended = list(sending)
        return packet


class Role(Enum):
    """Whether a station begins an exchange, or answers."""

    MASTER = "master"
    SLAVE = "slave"


class State(Enum):
    """What a station is doing."""

    SENDING = "sending"
    RECEIVING = "receiving"
    PROCESSING = "processing"
    DEAD = "dead"

    @property
    def comm_f(self) -> int | None:
        """The flag of the paper: 0 to send, 1 to receive, which includes the work on what came."""
        if self is State.DEAD:
            return None
        return 0 if self is State.SENDING else 1


class Event(Enum):
    """What happens to a station."""

    SENT = "last byte is out"
    PACKET = "packet found in the ring"
    PROCESSED = "packet is processed"
    RING_STOPPED = "reader stops before the ring is empty"
    FAILED = "partner taken as failed"
    TIMED_OUT = "turn timed out"
    STOPPED = "station stops"
    STARTED = "station starts"


#: Next state by role, state and event: section 4 of chung1998 with its Figs 5, 6 and 8. That the
#: master goes on to its next partner after a failure is our reading; turns that time out before
#: that are not in the paper. What is not listed does not change the state.
TRANSITIONS: dict[tuple[Role, State, Event], State] = {
    (Role.MASTER, State.SENDING, Event.SENT): State.RECEIVING,
    (Role.MASTER, State.RECEIVING, Event.PACKET): State.PROCESSING,
    (Role.MASTER, State.RECEIVING, Event.RING_STOPPED): State.SENDING,
    (Role.MASTER, State.RECEIVING, Event.FAILED): State.SENDING,
    (Role.MASTER, State.RECEIVING, Event.TIMED_OUT): State.SENDING,
    (Role.MASTER, State.PROCESSING, Event.PROCESSED): State.SENDING,
    (Role.MASTER, State.DEAD, Event.STARTED): State.SENDING,
    (Role.SLAVE, State.SENDING, Event.SENT): State.RECEIVING,
    (Role.SLAVE, State.RECEIVING, Event.PACKET): State.PROCESSING,
    (Role.SLAVE, State.RECEIVING, Event.RING_STOPPED): State.SENDING,
    (Role.SLAVE, State.RECEIVING, Event.FAILED): State.RECEIVING,
    (Role.SLAVE, State.PROCESSING, Event.PROCESSED): State.SENDING,
    (Role.SLAVE, State.DEAD, Event.STARTED): State.RECEIVING,
} | {
    (role, state, Event.STOPPED): State.DEAD
    for role in Role
    for state in (State.SENDING, State.RECEIVING, State.PROCESSING)
}


class Reading(NamedTuple):
    """What the task found when it emptied the ring.

    `repaired` says whether the reader had to give up a part of the ring (case c), `stopped`
    whether it stopped before the ring was empty (case a), `lost` how many bytes are never read.
    """

    packets: list[Items]
    unread: int
    repaired: bool
    stopped: bool
    lost: int


@dataclass(slots=True)
class Station:
    """A station as the simulation moves it.

    `partner` is whom it sends to or waits for; `turn` grows with every packet sent, and whenever
    the station stops or starts, because what was planned in an earlier turn is void; `busy_until`
    is the end of a slow task [s]; `left_out` counts turns of a partner still to be skipped.
    """

    name: str
    system: System
    state: State = field(default=State.RECEIVING, init=False)
    partner: str = field(default="RCS", init=False)
    ring: Ring = field(init=False)
    parser: Parser = field(init=False)
    counters: dict[str, Counter] = field(init=False)
    senders: dict[str, Sender] = field(init=False)
    sending: dict[str, list[int]] = field(init=False)
    left_out: dict[str, int] = field(init=False)
    busy_until: float = field(default=0.0, init=False)
    turn: int = field(default=0, init=False)

    def __post_init__(self) -> None:
        """Begin with empty tables."""
        system = self.system
        self.ring = Ring(system.ring_size, system.ring_rule)
        self.parser = system.packet_format.parser()
        self.counters = {name: Counter(system.rule(self.name)) for name in self.partners}
        self.senders = {
            name: Sender(system.packet_format, repeat=system.repeat) for name in self.partners
        }
        self.sending = {name: [0] * system.n_items for name in self.partners}
        self.left_out = dict.fromkeys(self.partners, 0)

    @property
    def role(self) -> Role:
        """Master or slave."""
        return Role.MASTER if self.name == "RCS" else Role.SLAVE

    @property
    def partners(self) -> tuple[str, ...]:
        """To whom it has a line, in the order of a cycle."""
        return tuple(target for source, target in HOPS if source == self.name)

    def go(self, event: Event) -> bool:
        """Take the transition of an event; return whether the state has one."""
        state = TRANSITIONS.get((self.role, self.state, event))
        if state is None:
            return False
        self.state = state
        return True

    def read(self) -> Reading:
        """Take everything out of the ring, as the task does, and return what was in it."""
        unread, lost_before = self.ring.unread, self.ring.lost
        data, repaired = bytearray(), False
        while (step := self.ring.extract()).action in ("take", "repair"):
            if step.byte is None:
                repaired = True
            else:
                data.append(step.byte)
        lost = self.ring.lost - lost_before
        return Reading(self.parser.feed(bytes(data)), unread, repaired, step.action == "stop", lost)

    def choose_partner(self) -> None:
        """Set whom the station sends to next: the master's partners in turn, but for failed ones.

        A failed partner is left out for ``skip_turns`` of its turns, unless all have failed.
        """
        if self.role is Role.SLAVE:
            return
        names = self.partners
        place = names.index(self.partner) if self.partner in names else -1
        order = [names[(place + k) % len(names)] for k in range(1, len(names) + 1)]
        for name in order:
            if not self.counters[name].failed or self.left_out[name] == 0:
                self.partner = name
                self.left_out[name] = self.system.skip_turns
                return
            self.left_out[name] -= 1
        self.partner = order[0]
