"""How many conductors run from the engine to the monitoring system, with and without buses."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from shipnet.engine.points import Point, check_points
from shipnet.fields import check_whole

__all__ = ["Conductors", "conductors"]


class Conductors(NamedTuple):
    """Conductors between the boxes and the monitoring system.

    Attributes
    ----------
    hardwired : int
        With every sensor wired through by itself.
    bus : int
        With two field buses.
    """

    hardwired: int
    bus: int

    @property
    def share(self) -> float:
        """What is left of the conductors."""
        return self.bus / self.hardwired


def conductors(
    points: Iterable[Point],
    *,
    rtd: int = 3,
    loop: int = 2,
    switch: int = 2,
    segments: int = 3,
    segment_wires: int = 2,
    channels: int = 2,
    channel_wires: int = 2,
) -> Conductors:
    r"""Return the conductors of hardwired points, and those of the two buses in their place.

    .. math:: n_{hardwired} = 3 n_{RTD} + 2 n_{loop} + 2 n_{switch}, \qquad
              n_{bus} = n_{segments} w_{segment} + n_{channels} w_{channel}

    Parameters
    ----------
    points : iterable of Point
        One or more.
    rtd, loop, switch : int, default 3, 2 and 2
        Conductors of a thermometer, a current loop and a switch, 1..4; none is printed.
    segments, segment_wires : int, default 3 and 2
        CAN cables between boxes, 0..100, and the conductors of each, 1..8. A ring of three boxes
        has three cables, a line two.
    channels, channel_wires : int, default 2 and 2
        Modbus cables, 0..100, and the conductors of each, 1..8; four for a four-wire line.

    Returns
    -------
    Conductors
        Both numbers; shields, supplies and spare cores are not counted.

    Raises
    ------
    ArgumentError
        If there are no points, or a number is out of range.

    Examples
    --------
    >>> from shipnet.engine.points import load_points
    >>> conductors(load_points())
    Conductors(hardwired=260, bus=10)
    >>> conductors(load_points(), rtd=2, channel_wires=4)
    Conductors(hardwired=198, bus=14)
    """
    cores = {"RTD": ("rtd", rtd), "4-20 mA": ("loop", loop), "switch": ("switch", switch)}
    each = {kind: check_whole(name, value, 1, 4) for kind, (name, value) in cores.items()}
    counts = {"segments": segments, "channels": channels}
    wires = {"segment_wires": segment_wires, "channel_wires": channel_wires}
    runs = [check_whole(name, value, 0, 100) for name, value in counts.items()]
    widths = [check_whole(name, value, 1, 8) for name, value in wires.items()]
    return Conductors(
        sum(each[point.condition] for point in check_points(points)),
        sum(run * width for run, width in zip(runs, widths, strict=True)),
    )
