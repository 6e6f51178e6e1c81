"""One station of the link: its turn, its counters, its values."""

from __future__ import annotations

from dataclasses import dataclass, field

from shipnet.remote_control.changes import Sender
from shipnet.remote_control.link.receiver import Receiver
from shipnet.remote_control.link.states import TRANSITIONS, Event, Role, State
from shipnet.remote_control.link.supervision import Counter
from shipnet.remote_control.link.system import System
from shipnet.remote_control.signals import HOPS

__all__ = ["Station"]


@dataclass(slots=True)
class Station:
    """A station as the simulation moves it.

    Parameters
    ----------
    name : str
        RCS, BCS or SS.
    system : System
        The link that it belongs to.

    Attributes
    ----------
    partner : str
        To whom it sends, or from whom it waits for an answer.
    lives : int
        How often it has been switched on or off; what was sent in an earlier life is void.
    busy_until : float
        Until when a slow task keeps it from its ring [s].
    turn : int
        Number of the turn; grows with every packet sent.
    left_out : dict of str to int
        How many more turns of a partner the master leaves out.

    Examples
    --------
    >>> station = Station("BCS", System())
    >>> station.state.value, station.partners
    ('receiving', ('RCS',))
    """

    name: str
    system: System
    state: State = field(default=State.RECEIVING, init=False)
    partner: str = field(default="RCS", init=False)
    receiver: Receiver = field(init=False)
    counters: dict[str, Counter] = field(init=False)
    senders: dict[str, Sender] = field(init=False)
    sending: dict[str, list[int]] = field(init=False)
    left_out: dict[str, int] = field(init=False)
    lives: int = field(default=0, init=False)
    busy_until: float = field(default=0.0, init=False)
    turn: int = field(default=0, init=False)

    def __post_init__(self) -> None:
        """Begin with empty tables."""
        system = self.system
        self.receiver = Receiver(system)
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
        """Take the transition of an event, if the state has one.

        Parameters
        ----------
        event : Event
            What has happened.

        Returns
        -------
        bool
            Whether there is such a transition.
        """
        step = TRANSITIONS.get((self.role, self.state, event))
        if step is None:
            return False
        self.state = step.state
        return True

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
