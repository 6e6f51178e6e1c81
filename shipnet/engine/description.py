"""What is known of a monitoring system, for the class rules to judge."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from shipnet.engine.points import Point, check_points, load_points
from shipnet.engine.registers import RegisterMap
from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar, check_whole
from shipnet.modbus.polling import Poll
from shipnet.modbus.uart import SerialLine

__all__ = ["Description", "printed_system"]


@dataclass(frozen=True, slots=True)
class Description:
    """What is known of a monitoring system; None is not known.

    Parameters
    ----------
    points : iterable of Point
        One or more.
    cpus, supplies : int, optional
        Processors and power supplies of each box, 1..4.
    power_switch_over : float, optional
        How long a change of the supply takes, 0..3600 [s].
    volatile : bool, optional
        Whether settings or programs lie in memory that forgets without supply.
    protocols : sequence of str, optional
        Names of the protocols, one or more.
    links : mapping of str to sequence of str, optional
        Stations beside the master on each link to the boxes, one or more.
    routes : mapping of str to sequence of str, optional
        Spaces or trays that each link runs through, one or more; for the same links.
    poll : Poll, optional
        The poll that asks one junction box for all points.
    retries_known : bool, default False
        Whether the retries of `poll` are those of the system, not a mere default.

    Raises
    ------
    ArgumentError
        If a field is out of range.

    Examples
    --------
    >>> Description(load_points(), cpus=2).cpus
    2
    """

    points: tuple[Point, ...]
    cpus: int | None = None
    supplies: int | None = None
    power_switch_over: float | None = None
    volatile: bool | None = None
    protocols: tuple[str, ...] | None = None
    links: Mapping[str, tuple[str, ...]] | None = field(default=None, hash=False)
    routes: Mapping[str, tuple[str, ...]] | None = field(default=None, hash=False)
    poll: Poll | None = None
    retries_known: bool = False

    def __post_init__(self) -> None:
        """Check every field."""
        object.__setattr__(self, "points", check_points(self.points))
        for name in ("cpus", "supplies"):
            if getattr(self, name) is not None:
                object.__setattr__(self, name, check_whole(name, getattr(self, name), 1, 4))
        if self.power_switch_over is not None:
            check_scalar("power_switch_over", self.power_switch_over, "s", 0, 3600)
        if self.volatile is not None and not isinstance(self.volatile, bool):
            raise ArgumentError(f"volatile is {self.volatile!r}; it must be True, False or None")
        if not isinstance(self.retries_known, bool):
            raise ArgumentError(f"retries_known is {self.retries_known!r}; it must be a bool")
        if self.protocols is not None:
            object.__setattr__(self, "protocols", _names("protocols", self.protocols))
        for name in ("links", "routes"):
            if getattr(self, name) is not None:
                object.__setattr__(self, name, _ways(name, getattr(self, name)))
        if self.poll is not None and not isinstance(self.poll, Poll):
            raise ArgumentError(f"poll is {self.poll!r}; it must be a Poll")
        if self.routes is not None and set(self.routes) != set(self.links or ()):
            raise ArgumentError("routes must name the same links as links")


def _names(what: str, given: object) -> tuple[str, ...]:
    """Return names as a tuple; a bare string would fall apart into its letters."""
    if not isinstance(given, tuple | list) or not given:
        raise ArgumentError(f"{what} is {given!r}; it must be a tuple of one or more names")
    for name in given:
        if not isinstance(name, str) or not name.strip():
            raise ArgumentError(f"{what} hold {name!r}; all must be names that are not empty")
    return tuple(given)


def _ways(what: str, given: object) -> dict[str, tuple[str, ...]]:
    """Return what each link touches, as tuples of names."""
    if not isinstance(given, Mapping) or not given:
        raise ArgumentError(
            f"{what} is {given!r}; it must be a mapping of links to tuples of names"
        )
    links = _names(what, list(given))
    return {link: _names(f"{what} of {link!r}", given[link]) for link in links}


def printed_system() -> Description:
    """Return what lee2012 prints of its system.

    Returns
    -------
    Description
        One microcontroller a box (section IV.1), CAN and Modbus RTU, two channels to JB1 and JB3
        (Fig 3), 9600 bit/s 8E1 (Table 2). Supplies, memory, cable routes and retries are not
        printed. The poll of all 99 points in one request is our assumption.

    Examples
    --------
    >>> printed_system().cpus, printed_system().supplies
    (1, None)
    """
    points = load_points()
    return Description(
        points,
        cpus=1,
        protocols=("CAN", "Modbus RTU"),
        links={"channel 1": ("JB1",), "channel 2": ("JB3",)},
        poll=Poll(RegisterMap(points).requests()[0], SerialLine(9600)),
    )
