"""One station of the link: whose turn it is, what it sends, its counters and its ring."""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum
from typing import NamedTuple

from shipnet.arguments import checked
from shipnet.errors import ArgumentError
from shipnet.fields import check_whole
from shipnet.remote_control.packet_format import Items
from shipnet.remote_control.ring_buffer import Ring, bytes_of
from shipnet.remote_control.system import Counter, System
from shipnet.remote_control.values import HOPS


@checked
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
    """Chooses what has changed, and takes it as received: there is no acknowledgement.

    With each packet go `repeat` of the other values in turn, though they have not changed. 0 is
    the paper's rule, by which a lost packet leaves the other side with old values until they
    change again; with k, they are corrected within ``ceil(n_items / k)`` packets.
    """

    def __init__(self, n_items: int, repeat: int = 0) -> None:
        self.repeat = repeat
        self._sended = [0] * n_items
        self._turn = 0

    def items(self, sending: Sequence[int]) -> dict[int, int]:
        """Return what the next packet has of these values, and take them as received."""
        n = len(self._sended)
        again = [number % n for number in range(self._turn, self._turn + self.repeat)]
        items = changed_items(sending, self._sended) | {k: sending[k] for k in again}
        self._turn = (self._turn + self.repeat) % n
        self._sended = list(sending)
        return items


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


class Station:
    """A station as the simulation moves it.

    `partner` is whom it sends to or waits for; `turn` grows with every packet sent, and whenever
    the station stops or starts, because what was planned in an earlier turn is void; `busy_until`
    is the end of a slow task [s]; `left_out` counts turns of a partner still to be skipped.
    """

    def __init__(self, name: str, system: System) -> None:
        self.name, self.system = name, system
        self.state, self.turn, self.busy_until = State.RECEIVING, 0, 0.0
        self.partner = "RCS"
        #: To whom it has a line, in the order of a cycle.
        self.partners = tuple(target for source, target in HOPS if source == name)
        self.ring = Ring(system.ring_size, system.ring_rule)
        self.parser = system.packet_format.parser()
        self.counters = {other: Counter(system.rule(name)) for other in self.partners}
        self.senders = {other: Sender(system.n_items, system.repeat) for other in self.partners}
        self.sending = {other: [0] * system.n_items for other in self.partners}
        self.left_out = dict.fromkeys(self.partners, 0)

    @property
    def master(self) -> bool:
        """Whether it begins every exchange, and does not answer."""
        return self.name == "RCS"

    def read(self) -> Reading:
        """Take everything out of the ring, as the task does, and return what was in it."""
        unread, lost_before = self.ring.unread, self.ring.lost
        steps = self.ring.drain()
        repaired = any(step.action == "repair" for step in steps)
        stopped, lost = steps[-1].action == "stop", self.ring.lost - lost_before
        return Reading(self.parser.feed(bytes_of(steps)), unread, repaired, stopped, lost)

    def choose_partner(self) -> None:
        """Set whom the station sends to next: the master's partners in turn, but for failed ones.

        A failed partner is left out for ``skip_turns`` of its turns, unless all have failed.
        """
        if not self.master:
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
