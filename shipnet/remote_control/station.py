"""One station of the link: the values that it sends, its counters and its ring."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, TypeAlias

from shipnet.errors import ArgumentError
from shipnet.remote_control.faults import HOPS
from shipnet.remote_control.ring_buffer import PrintedRing
from shipnet.remote_control.system import Counter, System

#: The activity of a station.
State: TypeAlias = Literal["sending", "receiving", "processing", "dead"]


def changed_items(sending: Sequence[int], sended: Sequence[int]) -> dict[int, int]:
    """Return the values that have changed since they were last sent, by number.

    Parameters
    ----------
    sending : sequence of int
        The values to send, 0..65535 each; ``SENDING`` in section 4.1 and Fig 6 of chung1998.
    sended : sequence of int
        The values sent last, called ``SENDED`` in the paper; as many as `sending`.

    Returns
    -------
    dict of int to int
        The changed values by number, called ``NEW_SEND`` in the paper; empty if there are none.

    Examples
    --------
    >>> from shipnet import remote_control as rc
    >>> rc.changed_items([120, 1, 0], [118, 1, 1])
    {0: 120, 2: 0}
    """
    if len(sending) != len(sended):
        raise ArgumentError(
            f"sending has {len(sending)} values, sended {len(sended)}; they must be equally long"
        )
    pairs = zip(sending, sended, strict=True)
    return {number: value for number, (value, last) in enumerate(pairs) if value != last}


class Sender:
    """Selection of the values to send, which are assumed to arrive: nothing is acknowledged.

    Each packet also carries `repeat` values in turn, even if they are unchanged. If `repeat` is 0,
    the paper's rule, a lost packet leaves the receiver with old values until they change again; if
    it is k, the values are corrected within ``ceil(n_items / k)`` packets.
    """

    def __init__(self, n_items: int, repeat: int = 0) -> None:
        self.repeat = repeat
        self._sended = [0] * n_items
        self._turn = 0

    def items(self, sending: Sequence[int]) -> dict[int, int]:
        """Return the items of the next packet, and assume that they will be received."""
        n = len(self._sended)
        again = [number % n for number in range(self._turn, self._turn + self.repeat)]
        items = changed_items(sending, self._sended) | {k: sending[k] for k in again}
        self._turn = (self._turn + self.repeat) % n
        self._sended = list(sending)
        return items


class Station:
    """A station in the simulation.

    It sends to `partner` or waits for its packet. `turn` increases with every packet sent, and
    whenever the station stops or starts, so that pending events of earlier turns are ignored.
    `busy_until` is the end of a slow task [s]. `unread` is the true number of unread bytes, which
    the program of the station cannot know.
    """

    def __init__(self, name: str, system: System) -> None:
        self.name, self.master = name, name == "RCS"
        self.rule = system.master if self.master else system.slave
        self.state: State = "receiving"
        self.turn, self.busy_until = 0, 0.0
        #: The stations at the other ends of its lines, in the order of a cycle.
        self.partners = tuple(target for source, target in HOPS if source == name)
        self.partner = self.partners[-1]
        self.ring, self.unread = PrintedRing(system.ring_size, empty_is_data=False), 0
        self.parser = system.packet_format.parser()
        self.counters = {other: Counter(self.rule) for other in self.partners}
        self.senders = {other: Sender(system.n_items, system.repeat) for other in self.partners}
        self.sending = {other: [0] * system.n_items for other in self.partners}

    @property
    def listens(self) -> bool:
        """True if the station accepts bytes: ``comm_f`` is 1."""
        return self.state in ("receiving", "processing")

    def store(self, byte: int) -> None:
        """Store a byte in the ring."""
        self.ring.store(byte)
        self.unread += 1

    def read(self) -> tuple[bytes, str]:
        """Read the ring until it is empty or the reader stops; return the bytes and the event.

        The event is empty if the ring was in order.
        """
        data, event = bytearray(), ""
        action, byte = self.ring.extract()
        while action in ("take", "repair"):
            if byte is None:
                event = "ring repaired"
            else:
                data.append(byte)
            action, byte = self.ring.extract()
        if action == "stop":  # only at the first step, because reading leads to the empty ring
            return b"", "ring stopped"
        if len(data) < self.unread and not event:
            event = "ring overrun unnoticed"
        self.unread = 0
        return bytes(data), event
