"""A slave at its place on the line, and the slaves of a line by their labels."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence

from shipnet.asi.calls import Call
from shipnet.asi.simulation.orders import key_of
from shipnet.asi.simulation.slave import Slave
from shipnet.asi.telegram import REQUEST_BITS
from shipnet.asi.timing import Timing
from shipnet.errors import ArgumentError
from shipnet.fields import check_whole

__all__ = ["Station", "Stations"]


class Station:
    """A slave at its place on the line.

    Parameters
    ----------
    slave : Slave
        The slave.
    position : float, default 0
        Distance from the master [m].
    pause : float, default 3
        Pause after which the master hears it answer, repeaters there and back included [bit].

    Examples
    --------
    >>> Station(Slave("S-0.F", 5), pause=5.0).name
    '5'
    """

    __slots__ = (
        "cuts", "heard", "lost_replies", "name", "offset", "pause", "position", "rates", "since",
        "slave",
    )  # fmt: skip

    def __init__(self, slave: Slave, position: float = 0.0, pause: float = 3.0) -> None:
        self.slave, self.position, self.pause = slave, position, pause
        #: Its label at the start.
        self.name = slave.label
        #: Probabilities that a request, and a response, is lost.
        self.rates = (0.0, 0.0)
        #: Replies that will be lost, by the call that they answer.
        self.lost_replies: dict[Call, int] = {}
        #: For how many reasons it is without supply.
        self.cuts = 0
        #: Numbers of the last request to it, and of the first since it was switched on.
        self.heard, self.since = -1, 1
        #: Where its disturbances begin in those of a request.
        self.offset = 0

    def check_pause(self, timing: Timing, late: float = 0.0) -> None:
        """Raise if an answer could come so late that it falls behind the next request.

        Parameters
        ----------
        timing : Timing
            The pauses of the line.
        late : float, default 0
            How much later than usual it answers [bit].
        """
        pause = self.pause + timing.unsynchronised + late
        most = timing.timeout + REQUEST_BITS
        if not (late >= 0 and pause < most):
            raise ArgumentError(
                f"slave {self.name} would answer {pause:g} bit times after a request; it must "
                f"not be early, and less than {most:g}, before the next request has ended"
            )


class Stations(dict[str, list[Station]]):
    """The slaves of a line by their labels at the start; two slaves may share one.

    Parameters
    ----------
    slaves : sequence of Slave
        The slaves; the stations get copies.
    timing : Timing
        The pauses of the line.
    positions : mapping of str to float
        Distance of slaves from the master [m].
    delays : mapping of str to float
        Delay of the repeaters on the way to slaves, one way [s].

    Attributes
    ----------
    all : list of Station
        All of them in the order given.

    Raises
    ------
    ArgumentError
        If a label is not on the line, or a value is out of range.

    Examples
    --------
    >>> stations = Stations([Slave("S-0.F", 5), Slave("S-0.F", 5)], Timing(), {}, {"5": 6e-6})
    >>> [station.pause for station in stations["5"]]
    [5.0, 5.0]
    """

    def __init__(
        self,
        slaves: Sequence[Slave],
        timing: Timing,
        positions: Mapping[str, float],
        delays: Mapping[str, float],
    ) -> None:
        super().__init__()
        check_whole("number of slaves", len(slaves), 0, 1000)
        self.all = [Station(copy.deepcopy(s), pause=timing.master_pause) for s in slaves]
        for station in self.all:
            self.setdefault(station.name, []).append(station)
        for name, values in (("positions", positions), ("delays", delays)):
            for label, value in values.items():
                if not 0 <= value < float("inf"):
                    raise ArgumentError(f"{name} of slave {label} is {value}; it must be 0 or more")
                for station in self[label]:
                    if name == "positions":
                        station.position = value
                    else:
                        station.pause += 2 * value / timing.bit_time
        for station in self.all:
            station.check_pause(timing)

    def __missing__(self, label: str) -> list[Station]:
        key_of(label)
        raise ArgumentError(
            f"slave {label} is not on the line; there are {', '.join(self) or 'none'}"
        )
