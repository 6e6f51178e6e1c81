"""The receive states of a slave as a table: state and event -> next state and action.

A slave reads requests only in the state RECEIVE. What it reads decides whether it keeps step with
the master (SYNCHRONOUS) or has to look for the next pause (ASYNCHRONOUS). icn2007, data link layer,
section 3, tells the table in words and refers to a Fig 3.19 that it does not print; the figure here
is drawn from the table.
"""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple

__all__ = ["TRANSITIONS", "Action", "Event", "State", "Step"]


class State(Enum):
    """Where a slave stands in the traffic on the line.

    Examples
    --------
    >>> [state.value for state in State]
    ['asynchronous', 'receive', 'synchronous']
    """

    ASYNCHRONOUS = "asynchronous"
    RECEIVE = "receive"
    SYNCHRONOUS = "synchronous"


class Event(Enum):
    """What a slave hears.

    Examples
    --------
    >>> Event.ERROR.value
    'error in the telegram'
    """

    PAUSE = "any pause"
    SLAVE_PAUSE = "pause after the response"
    ERROR = "error in the telegram"
    FOREIGN = "request to another address"
    UNKNOWN = "unknown call"
    OWN = "own request"
    SILENT = "call without answer"


class Action(Enum):
    """What a slave does on the way to its next state.

    Examples
    --------
    >>> Action.ANSWER.value
    'answer'
    """

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
