"""A ballast tank that a pump fills through a butterfly valve."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, pi

from shipnet.fields import check_scalar

__all__ = ["Tank"]


@dataclass
class Tank:
    r"""A tank whose level follows from the opening of its valve.

    .. math:: A \frac{dh}{dt} = q \left( 1 - \cos \frac{\pi x}{2} \right)

    Parameters
    ----------
    area : float, default 0.2
        Area A of the water, 1e-3..1e5 [m2].
    flow : float, default 0.01
        Flow q through the open valve, 0..100 [m3/s].
    level : float, default 0
        Level at first, 0..100 [m].

    Raises
    ------
    ArgumentError
        If a field is out of its range.

    Notes
    -----
    The paper prints that S3 has a valve, a pump and a tank, and no size: all numbers are assumed.
    The pump gives what the free area of the disc lets pass.

    Examples
    --------
    >>> tank = Tank()
    >>> tank.fill(1.0, 10.0)
    >>> round(tank.level, 6)
    0.5
    """

    area: float = 0.2
    flow: float = 0.01
    level: float = 0.0

    def __post_init__(self) -> None:
        """Check every field."""
        self.area = check_scalar("area", self.area, "m2", 1e-3, 1e5)
        self.flow = check_scalar("flow", self.flow, "m3/s", 0, 100)
        self.level = check_scalar("level", self.level, "m", 0, 100)

    def fill(self, opening: float, duration: float) -> None:
        """Let water in.

        Parameters
        ----------
        opening : float
            Mean opening x of the valve meanwhile, 0..1.
        duration : float
            How long, 0..1e6 [s].

        Raises
        ------
        ArgumentError
            If an argument is out of its range.
        """
        x = check_scalar("opening", opening, "", 0, 1)
        lasted = check_scalar("duration", duration, "s", 0, 1e6)
        self.level += self.flow * (1 - cos(pi * x / 2)) * lasted / self.area
