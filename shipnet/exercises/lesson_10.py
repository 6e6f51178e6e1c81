"""Exercises of lesson 10: from an I/O list to a defended choice."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache, partial

from shipnet import datasets
from shipnet.design.costs import Quantities, conductors_at_cabinet
from shipnet.design.iolist import read_iolist
from shipnet.design.plant import Plant
from shipnet.exercises.answers import Choice, Function, Number
from shipnet.exercises.exercise import Exercise

#: Total cost [EUR], points lost by one failure, and faults, by option.
_Options = Mapping[str, tuple[int, int, int]]

#: A plan that leaves points out.
_POOR = "AS-i without repeaters"

#: Two places of a plant at which its cost is computed [m].
_NEAR, _FAR = 10, 30


@cache
def _conductors(contacts: int, lines: int) -> int:
    """Return the conductors at the cabinet on AS-i, or of home runs if AS-i needs no line."""
    plant = Plant(contacts, contacts=1, lines=lines or 1)
    return conductors_at_cabinet(plant.on_asi if lines else plant.hardwired)


def _left(contacts: int, lines: int) -> float:
    return 100 * _conductors(contacts, lines) / _conductors(contacts, 0)


@cache
def _quantities(bus: bool, modules: int, distance: float, spacing: float) -> Quantities:
    plant = Plant(modules=modules, contacts=2, distance=distance, spacing=spacing)
    return (plant.on_asi if bus else plant.hardwired).quantities()


def _cost(bus: bool, figure: str, modules: int, distance: float, spacing: float) -> float:
    return _quantities(bus, modules, distance, spacing)[figure]


def _costs(modules: int, distance: float, figure: str = "total_cost_eur") -> tuple[float, float]:
    wired, bus = (_cost(bus, figure, modules, distance, 4) for bus in (False, True))
    return wired, bus


def _saved(modules: int, distance: float, figure: str = "total_cost_eur") -> float:
    wired, bus = _costs(modules, distance, figure)
    return 100 * (1 - bus / wired)


def _crossing(modules: int, spacing: int) -> tuple[float, float, float]:
    """Return how much dearer AS-i is at the near place, and cost per metre of both."""
    (wired, wired_far), (bus, bus_far) = (
        [_cost(kind, "total_cost_eur", modules, place, spacing) for place in (_NEAR, _FAR)]
        for kind in (False, True)
    )
    way = _FAR - _NEAR
    return bus - wired, (wired_far - wired) / way, (bus_far - bus) / way


def _break_even(modules: int, spacing: int) -> float:
    dearer, wired, bus = _crossing(modules, spacing)
    return _NEAR + dearer / (wired - bus)


def _without_growth(modules: int, spacing: int) -> float:
    dearer, wired, _ = _crossing(modules, spacing)
    return _NEAR + dearer / wired


@cache
def _reviews() -> tuple[_Options, _Options]:
    """Return the ballast valves three ways without faults, and three of which one has some."""
    ship = read_iolist(datasets.path("synthetic_iolist_ship.csv"))
    ballast = ship.where("system == 'Ballast valve'")
    ways = ["home runs", "junction boxes", "AS-i", "CAN"]
    found = ballast.compare((20, -6, 14), ways, settings={"tails": 2, "spare": 0})
    found = found.add(found.plan("AS-i", settings={"asi.repeaters": 0}, name=_POOR))
    table = found.table()
    faults = table["points_left_out"] + table["rules_violated"]
    rows = zip(table["total_cost_eur"].round(-2), table["lost_by_failure"], faults, strict=True)
    every = {
        name: (int(c), int(n), int(f)) for name, (c, n, f) in zip(table.index, rows, strict=True)
    }
    return (
        {name: every[name] for name in ways[:3]},
        {name: every[name] for name in (_POOR, "junction boxes", "CAN")},
    )


def _cheapest(options: _Options, good: Callable[[int, int, int], bool]) -> str:
    return min(
        (option for option, row in options.items() if good(*row)),
        key=lambda option: options[option][0],
        default="none",
    )


def _choose(options: _Options, limit: int) -> str:
    return _cheapest(options, lambda cost, lost, faults: lost <= limit and not faults)


def _safest(options: _Options, limit: int) -> str:
    kept = (name for name, (_, lost, faults) in options.items() if lost <= limit and not faults)
    return min(kept, key=lambda name: options[name][1], default="none")


def _cases() -> list[tuple[_Options, int]]:
    """Return the reviews with limits: one that nothing keeps, and some at their edge."""
    long, short = _reviews()
    most = long["AS-i"][1]
    return [(long, 1), (long, most), (long, most - 1), (long, 0), (short, short["CAN"][1])]


EXERCISES = (
    Exercise(
        "ex-10-1",
        draws={"contacts": range(120, 401, 20), "lines": range(3, 9)},
        answer=lambda contacts, lines: Number(_left(contacts, lines), "%"),
        traps={
            "that is what is saved; asked for is what is left": lambda contacts, lines: (
                100 - _left(contacts, lines)
            ),
            "that is how many times fewer; asked for is what is left": lambda contacts, lines: (
                contacts / lines
            ),
            "that is one line; how many are there?": lambda contacts, lines: _left(contacts, 1),
        },
    ),
    Exercise(
        "ex-10-2",
        draws={"modules": (12, 14, 16, 20, 24), "distance": (30, 40, 60, 80)},
        answer=lambda modules, distance: Number(_saved(modules, distance), "%"),
        traps={
            "that is the cable alone; work and hardware cost too": partial(
                _saved, figure="cable_cost_eur"
            ),
            "a saving is a share of what it would have cost without the bus": (
                lambda modules, distance: (
                    100 * (_costs(modules, distance)[0] / _costs(modules, distance)[1] - 1)
                )
            ),
            "that is the conductors; asked for is the cost": partial(
                _saved, figure="conductors_at_cabinet"
            ),
            "that is what is left; asked for is what is saved": lambda modules, distance: (
                100 - _saved(modules, distance)
            ),
        },
    ),
    Exercise(
        "ex-10-3",
        draws={"modules": range(4, 9), "spacing": (1, 2)},
        answer=lambda modules, spacing: Number(_break_even(modules, spacing), "m"),
        traps={
            "both lines are known from 10 m on: have you counted from there?": (
                lambda modules, spacing: _break_even(modules, spacing) - _NEAR
            ),
            "AS-i grows with the distance too, only more slowly": _without_growth,
        },
    ),
    Exercise(
        "ex-10-4",
        answer=lambda: Function(
            _choose,
            _cases(),
            lambda right: Choice(right, (*dict.fromkeys((*_reviews()[0], *_reviews()[1])), "none")),
        ),
        traps={
            "this one is cheap, but does it lose more points than the limit?": lambda: (
                lambda options, limit: _cheapest(options, lambda cost, lost, faults: not faults)
            ),
            "an option with faults is none: what is left out costs nothing": lambda: (
                lambda options, limit: _cheapest(options, lambda cost, lost, faults: lost <= limit)
            ),
            "the limit itself is allowed: at most, not less": lambda: (
                lambda options, limit: _cheapest(
                    options, lambda cost, lost, faults: lost < limit and not faults
                )
            ),
            "two things come before the cost: the faults, and the limit": lambda: (
                lambda options, limit: _cheapest(options, lambda cost, lost, faults: True)
            ),
            "of all that keep the limit, which one is the cheapest?": lambda: _safest,
        },
    ),
)
