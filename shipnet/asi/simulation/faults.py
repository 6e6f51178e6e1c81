"""What can go wrong on a line.

Times are seconds from the start of the simulation; slaves are named by the label that they have
then, such as ``"5A"``. Two slaves of one address need no fault: give the simulation both.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import partial

from shipnet.asi.calls import Call
from shipnet.asi.simulation.channel import Channel
from shipnet.asi.simulation.orders import key_of
from shipnet.asi.simulation.station import Station, Stations
from shipnet.errors import ArgumentError
from shipnet.fields import check_whole

__all__ = [
    "BrokenCable",
    "DeadSlave",
    "Fault",
    "LateAnswer",
    "LostReply",
    "MasterFailure",
    "PeripheryFault",
    "SupplyDip",
    "TelegramErrors",
]


_NEVER = float("inf")


@dataclass(frozen=True)
class Fault:
    """What all faults share: their checks, and that they can be put upon a line."""

    def apply(self, channel: Channel, stations: Stations) -> None:
        """Have the fault begin, and end, on a line."""
        raise NotImplementedError

    def __post_init__(self) -> None:
        """Check label, times and probabilities."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        if "slave" in values:
            key_of(values["slave"])
        start, stop = values.get("start", 0.0), values.get("stop", _NEVER)
        if not 0 <= start < stop:
            raise ArgumentError(
                f"start is {start} s and stop is {stop} s; they must be 0 <= start < stop"
            )
        for name in ("request", "response"):
            if not 0 <= values.get(name, 0.0) <= 1:
                raise ArgumentError(f"{name} is {values[name]}; a probability is 0..1")


@dataclass(frozen=True)
class TelegramErrors(Fault):
    """Telegrams to and from a slave are disturbed at random.

    Parameters
    ----------
    slave : str
        Its label.
    request : float, default 0
        Probability that it does not understand a request, be it its own or another's, 0..1.
    response : float, default 0
        Probability that the master does not understand its response, 0..1. One pulse of it,
        chosen at random, is disturbed; the error class follows.

    Examples
    --------
    >>> TelegramErrors("5A", request=1.5)
    Traceback (most recent call last):
        ...
    shipnet.errors.ArgumentError: request is 1.5; a probability is 0..1
    """

    slave: str
    request: float = 0.0
    response: float = 0.0

    def apply(self, channel: Channel, stations: Stations) -> None:
        """Set the probabilities; the disturbances are drawn by the channel."""
        for station in stations[self.slave]:
            station.rates = (self.request, self.response)


@dataclass(frozen=True)
class DeadSlave(Fault):
    """A slave has no supply from `start` to `stop`.

    Parameters
    ----------
    slave : str
        Its label.
    start : float, default 0
        When its supply goes [s].
    stop : float, default inf
        When it comes back [s].

    Examples
    --------
    >>> DeadSlave("5", start=0.1)
    DeadSlave(slave='5', start=0.1, stop=inf)
    """

    slave: str
    start: float = 0.0
    stop: float = _NEVER

    def apply(self, channel: Channel, stations: Stations) -> None:
        """Switch the slave off, and on again."""
        _switch(channel, stations[self.slave], self.start, self.stop)


@dataclass(frozen=True)
class BrokenCable(Fault):
    """All slaves farther away than a place lose supply and signal.

    Parameters
    ----------
    place : float
        Distance of the break from the master [m].
    start : float, default 0
        When it breaks [s].
    stop : float, default inf
        When it is mended [s].

    Examples
    --------
    >>> BrokenCable(40).stop
    inf
    """

    place: float
    start: float = 0.0
    stop: float = _NEVER

    def apply(self, channel: Channel, stations: Stations) -> None:
        """Switch everything behind the break off, and on again."""
        behind = [station for station in stations.all if station.position > self.place]
        _switch(channel, behind, self.start, self.stop)


@dataclass(frozen=True)
class SupplyDip(Fault):
    """The supply of the whole segment fails from `start` to `stop`: all slaves reset.

    Parameters
    ----------
    start, stop : float
        Begin and end [s].

    Examples
    --------
    >>> SupplyDip(0.1, 0.12)
    SupplyDip(start=0.1, stop=0.12)
    """

    start: float
    stop: float

    def apply(self, channel: Channel, stations: Stations) -> None:
        """Switch all slaves off, and on again; tell the master."""
        _switch(channel, stations.all, self.start, self.stop)
        channel.schedule(self.start, partial(channel.stop_master, self.stop))


@dataclass(frozen=True)
class LateAnswer(Fault):
    """A slave answers later than it should.

    Parameters
    ----------
    slave : str
        Its label.
    bits : float
        How much later [bit].
    start : float, default 0
        From when on [s].
    stop : float, default inf
        Until when [s].

    Notes
    -----
    An answer that starts behind the master's time-out is not heard as an answer. It falls upon
    the next request instead, and nobody understands that, but for one case in 360 in which all
    its pulses coincide with those of the request.

    Examples
    --------
    >>> LateAnswer("5", 8).bits
    8
    """

    slave: str
    bits: float
    start: float = 0.0
    stop: float = _NEVER

    def apply(self, channel: Channel, stations: Stations) -> None:
        """Delay the answers."""
        for station in stations[self.slave]:
            station.check_pause(channel.timing, self.bits)
            pauses = (station.pause + self.bits, station.pause)
            _set(channel, station, "pause", pauses, self.start, self.stop)


@dataclass(frozen=True)
class LostReply(Fault):
    """A slave carries out requests of one kind, but its replies are lost.

    Parameters
    ----------
    slave : str
        Its label.
    call : Call, default Call.DATA_EXCHANGE
        The kind of request.
    start : float, default 0
        From when on [s].
    count : int, default 1
        How many replies are lost, 1 or more.

    Examples
    --------
    >>> LostReply("5", Call.DELETE_ADDRESS).count
    1
    """

    slave: str
    call: Call = Call.DATA_EXCHANGE
    start: float = 0.0
    count: int = 1

    def __post_init__(self) -> None:
        """Check the count too."""
        super().__post_init__()
        check_whole("count", self.count, 1, 10**9)

    def apply(self, channel: Channel, stations: Stations) -> None:
        """Have the replies lost, beginning with the first after `start`."""
        for station in stations[self.slave]:
            lose = partial(station.lost_replies.__setitem__, self.call, self.count)
            channel.schedule(self.start, lose)


@dataclass(frozen=True)
class PeripheryFault(Fault):
    """A slave reports a fault of what is connected to it: status bit S1.

    Parameters
    ----------
    slave : str
        Its label.
    start : float, default 0
        When the fault comes [s].
    stop : float, default inf
        When it goes [s].

    Examples
    --------
    >>> PeripheryFault("5").slave
    '5'
    """

    slave: str
    start: float = 0.0
    stop: float = _NEVER

    def apply(self, channel: Channel, stations: Stations) -> None:
        """Set the flag, and clear it."""
        for station in stations[self.slave]:
            flags = (True, False)
            _set(channel, station.slave, "periphery_fault", flags, self.start, self.stop)


@dataclass(frozen=True)
class MasterFailure(Fault):
    """The master falls silent for good.

    Parameters
    ----------
    start : float
        When [s].

    Examples
    --------
    >>> MasterFailure(0.5)
    MasterFailure(start=0.5)
    """

    start: float

    def apply(self, channel: Channel, stations: Stations) -> None:
        """Stop the master for good."""
        channel.schedule(self.start, partial(channel.stop_master, _NEVER))


def _switch(channel: Channel, stations: Sequence[Station], start: float, stop: float) -> None:
    for time, on in ((start, False), (stop, True)):
        if time < _NEVER:
            for station in stations:
                channel.schedule(time, partial(channel.switch, station, on, time))


def _set(
    channel: Channel, what: object, name: str, values: tuple[object, object], *times: float
) -> None:
    for time, value in zip(times, values, strict=True):
        if time < _NEVER:
            channel.schedule(time, partial(setattr, what, name, value))
