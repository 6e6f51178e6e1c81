"""Faults of a simulated line, each active from `start` to `stop` [s].

Slaves are identified by their label at time 0, such as ``"5A"``. There is no fault class for a
duplicate address: simulate two slaves with the same label.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from math import inf

from shipnet.asi.channel import Channel, Station, Stations
from shipnet.asi.slave import slave_key
from shipnet.asi.telegram import Call
from shipnet.clock import Fault
from shipnet.errors import ArgumentError
from shipnet.fields import number, part, record, text, whole

__all__ = [
    "BrokenCable",
    "DeadSlave",
    "LateAnswer",
    "LostReply",
    "MasterFailure",
    "PeripheryFault",
    "SupplyDip",
    "TelegramErrors",
]
__dir__ = __all__.copy


@record
class LineFault(Fault):
    """Base class of faults of a line."""

    def apply(self, channel: Channel, stations: Stations) -> None:
        """Schedule the start and the end of the fault."""
        raise NotImplementedError


@record
class _OfSlave(LineFault):
    """Base class of faults of one slave."""

    slave: str = text("Label of the slave")

    def __post_init__(self) -> None:
        super().__post_init__()
        slave_key(self.slave)


@record
class TelegramErrors(_OfSlave):
    """Random disturbances of the telegrams to and from a slave.

    The slave misses requests, whether they are addressed to it or to another slave. In a disturbed
    response, one randomly chosen pulse is changed; the choice determines the error class.

    Examples
    --------
    >>> TelegramErrors("5A", request=1.5)
    Traceback (most recent call last):
        ...
    shipnet.errors.ArgumentError: request is 1.5; it must be 0..1
    """

    request: float = number(0, 1, "", "Probability that the slave misses a request", default=0.0)
    response: float = number(
        0, 1, "", "Probability that a response of the slave is disturbed", default=0.0
    )

    def apply(self, channel: Channel, stations: Stations) -> None:
        """Set the probabilities with which the channel draws disturbances."""
        for station in stations[self.slave]:
            if station.rates != (0.0, 0.0):
                raise ArgumentError(f"slave {self.slave} has TelegramErrors twice; give only one")
            station.rates = (self.request, self.response)
            station.fields["quiet"] = self.start > 0
            if self.start > 0 or self.stop < inf:
                _set(channel, station, "quiet", (False, True), self.start, self.stop)


@record
class DeadSlave(_OfSlave):
    """A slave without supply voltage.

    Examples
    --------
    >>> DeadSlave("5", start=0.1)
    DeadSlave(start=0.1, stop=inf, slave='5')
    """

    def apply(self, channel: Channel, stations: Stations) -> None:
        """Schedule the times at which the slave is switched off and on again."""
        _switch(channel, stations[self.slave], self.start, self.stop)


@record
class BrokenCable(LineFault):
    """A cable break: all slaves downstream of it lose supply and signal.

    Examples
    --------
    >>> BrokenCable(40).place
    40.0
    """

    place: float = number(0, 1e6, "m", "Distance of the break from the master")

    def apply(self, channel: Channel, stations: Stations) -> None:
        """Schedule the times at which all slaves downstream are switched off and on again."""
        downstream = [station for station in stations.all if station.position > self.place]
        _switch(channel, downstream, self.start, self.stop)


@record
class SupplyDip(LineFault):
    """A supply failure in all segments until `stop`, which is required; all slaves are reset.

    Examples
    --------
    >>> SupplyDip(start=0.1, stop=0.12).stop
    0.12
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.stop == inf:
            raise ArgumentError(
                "stop is inf s; it must be finite: the time when the supply returns"
            )

    def apply(self, channel: Channel, stations: Stations) -> None:
        """Schedule the times at which all slaves are switched off and on, and the master's stop."""
        _switch(channel, stations.all, self.start, self.stop)
        channel.schedule(self.start, partial(channel.stop_master, self.stop))


@record
class LateAnswer(_OfSlave):
    """A slave that responds late.

    A response that begins after the master's time-out overlaps the next request. No slave then
    understands this request, except in one case in 360, in which all pulses of the response
    coincide with pulses of the request.

    Examples
    --------
    >>> LateAnswer("5", 8).bits
    8.0
    """

    bits: float = number(0, 100, "bit", "Additional delay")

    def apply(self, channel: Channel, stations: Stations) -> None:
        """Schedule the start and the end of the additional delay."""
        for station in stations[self.slave]:
            station.check_delay(channel.transaction, self.bits)
            usual = float(station.fields["delay"])
            delays = (usual + self.bits, usual)
            _set(channel, station, "delay", delays, self.start, self.stop)


@record
class LostReply(_OfSlave):
    """A slave that carries out requests of one kind, but whose responses to them are lost.

    Examples
    --------
    >>> LostReply("5", Call.DELETE_ADDRESS).count
    1
    """

    call: Call = part(Call, "Kind of request whose responses are lost", default=Call.DATA_EXCHANGE)
    count: int = whole(
        1, 10**9, "", "Number of responses that are lost, beginning at `start`", default=1
    )

    def apply(self, channel: Channel, stations: Stations) -> None:
        """Schedule the loss of the first `count` responses between `start` and `stop`."""
        for station in stations[self.slave]:
            for time, count in ((self.start, self.count), (self.stop, 0)):
                if time < inf:
                    lose = partial(
                        channel.alter, station.lost_replies.__setitem__, self.call, count
                    )
                    channel.schedule(time, lose)


@record
class PeripheryFault(_OfSlave):
    """A slave that reports a fault of a connected device in its status bit S1.

    Examples
    --------
    >>> PeripheryFault("5").slave
    '5'
    """

    def apply(self, channel: Channel, stations: Stations) -> None:
        """Schedule the times at which the slave's fault flag is set and cleared."""
        for station in stations[self.slave]:
            _set(channel, station, "periphery_fault", (True, False), self.start, self.stop)


@record
class MasterFailure(LineFault):
    """A permanent failure of the master, which sends no more requests; `stop` must be omitted.

    Examples
    --------
    >>> MasterFailure(start=0.5).start
    0.5
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.stop < inf:
            raise ArgumentError(f"stop is {self.stop:g} s; omit it: a failed master stays silent")

    def apply(self, channel: Channel, stations: Stations) -> None:
        """Schedule the time at which the master stops permanently."""
        channel.schedule(self.start, partial(channel.stop_master, inf))


def _switch(channel: Channel, stations: Sequence[Station], start: float, stop: float) -> None:
    for time, on in ((start, False), (stop, True)):
        if time < inf:
            for station in stations:
                channel.schedule(time, partial(channel.switch, station, on, time))


def _set(
    channel: Channel, station: Station, field: str, values: tuple[float, float], *times: float
) -> None:
    for time, value in zip(times, values, strict=True):
        if time < inf:
            set_field = station.fields.__setitem__
            channel.schedule(time, partial(channel.alter, set_field, field, value))
