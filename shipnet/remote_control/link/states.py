"""Whose turn it is: the flag ``comm_f`` of chung1998 as a state machine, for master and slave."""

from __future__ import annotations

from enum import Enum
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["TRANSITIONS", "Event", "Role", "State", "Step", "transition_table"]


class Role(Enum):
    """Whether a station begins an exchange, or answers.

    Examples
    --------
    >>> [role.value for role in Role]
    ['master', 'slave']
    """

    MASTER = "master"
    SLAVE = "slave"


class State(Enum):
    """What a station is doing.

    Examples
    --------
    >>> [(state.value, state.comm_f) for state in State]
    [('sending', 0), ('receiving', 1), ('processing', 1), ('dead', None)]
    """

    SENDING = "sending"
    RECEIVING = "receiving"
    PROCESSING = "processing"
    DEAD = "dead"

    @property
    def comm_f(self) -> int | None:
        """The flag: 0 to send, 1 to receive, which includes the work on what came."""
        if self is State.DEAD:
            return None
        return 0 if self is State.SENDING else 1


class Event(Enum):
    """What happens to a station.

    Examples
    --------
    >>> Event.PACKET.value
    'packet found in the ring'
    """

    SENT = "last byte is out"
    PACKET = "packet found in the ring"
    PROCESSED = "packet is worked up"
    RING_STOPPED = "reader stops before the ring is empty"
    FAILED = "partner taken as failed"
    GIVEN_UP = "turn given up"
    STOPPED = "station stops"
    STARTED = "station starts"


class Step(NamedTuple):
    """Next state, and what is done on the way.

    Attributes
    ----------
    state : State
        Where the station goes.
    action : str
        What it does.
    """

    state: State
    action: str


_ANSWER, _NEXT = "send to whom it came from", "send to the next partner"
_LISTEN, _WORK, _ALARM = "listen", "take the values", "show the failure, listen on"

#: Section 4 of chung1998 with its Figs 5, 6 and 8. That the master goes on to its next partner
#: after a failure is our reading; turns given up before that are not in the paper.
TRANSITIONS: dict[tuple[Role, State, Event], Step] = {
    (Role.MASTER, State.SENDING, Event.SENT): Step(State.RECEIVING, _LISTEN),
    (Role.MASTER, State.RECEIVING, Event.PACKET): Step(State.PROCESSING, _WORK),
    (Role.MASTER, State.RECEIVING, Event.RING_STOPPED): Step(State.SENDING, _NEXT),
    (Role.MASTER, State.RECEIVING, Event.FAILED): Step(State.SENDING, _NEXT),
    (Role.MASTER, State.RECEIVING, Event.GIVEN_UP): Step(State.SENDING, _NEXT),
    (Role.MASTER, State.PROCESSING, Event.PROCESSED): Step(State.SENDING, _NEXT),
    (Role.MASTER, State.DEAD, Event.STARTED): Step(State.SENDING, _NEXT),
    (Role.SLAVE, State.SENDING, Event.SENT): Step(State.RECEIVING, _LISTEN),
    (Role.SLAVE, State.RECEIVING, Event.PACKET): Step(State.PROCESSING, _WORK),
    (Role.SLAVE, State.RECEIVING, Event.RING_STOPPED): Step(State.SENDING, _ANSWER),
    (Role.SLAVE, State.RECEIVING, Event.FAILED): Step(State.RECEIVING, _ALARM),
    (Role.SLAVE, State.PROCESSING, Event.PROCESSED): Step(State.SENDING, _ANSWER),
    (Role.SLAVE, State.DEAD, Event.STARTED): Step(State.RECEIVING, _LISTEN),
} | {
    (role, state, Event.STOPPED): Step(State.DEAD, "nothing")
    for role in Role
    for state in (State.SENDING, State.RECEIVING, State.PROCESSING)
}


def transition_table() -> pd.DataFrame:
    """Return all transitions.

    Returns
    -------
    pandas.DataFrame
        A row a transition: ``role``, ``state``, ``comm_f``, ``event``, ``next_state``,
        ``next_comm_f`` and ``action``. What has no row does not change the state.

    Examples
    --------
    >>> table = transition_table()
    >>> len(table), table.query("state == 'processing' and role == 'slave'").event.tolist()
    (19, ['packet is worked up', 'station stops'])
    """
    import pandas as pd

    rows = [
        (role.value, old.value, old.comm_f, event.value, new.value, new.comm_f, action)
        for (role, old, event), (new, action) in TRANSITIONS.items()
    ]
    columns = ["role", "state", "comm_f", "event", "next_state", "next_comm_f", "action"]
    table = pd.DataFrame(rows, columns=columns)
    return table.astype({"comm_f": "Int64", "next_comm_f": "Int64"})
