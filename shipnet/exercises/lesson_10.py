"""Exercises of lesson 10: from an I/O list to a defended choice."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache

from shipnet import datasets
from shipnet.design.costs import Quantities, conductors_at_cabinet
from shipnet.design.iolist import read_iolist
from shipnet.design.plant import Plant
from shipnet.exercises.answers import Choice, Function, Number
from shipnet.exercises.exercise import Solution, solution

#: Total cost [EUR], points lost by one failure, and faults, by option.
_Options = Mapping[str, tuple[int, int, int]]

#: A plan that leaves points out.
_POOR = "AS-i without repeaters"

#: Two places of a plant at which its cost is computed [m].
_NEAR, _FAR = 10, 30


@solution("ex-10-1", contacts=range(120, 401, 20), lines=range(3, 9))
def conductors_left(contacts: int, lines: int) -> Solution:
    """Conductors at the cabinet that AS-i leaves of those of home runs."""
    plant = Plant(contacts, contacts=1, lines=lines)
    wired, bus = map(conductors_at_cabinet, (plant.hardwired, plant.on_asi))
    left = 100 * bus / wired
    return Number(left, "%"), {
        "that is what is saved; asked for is what is left": 100 - left,
        "that is how many times fewer; asked for is what is left": contacts / lines,
        "that is one line; how many are there?": left / lines,
    }


@cache
def _quantities(modules: int, distance: float, spacing: float) -> tuple[Quantities, Quantities]:
    """Return what a plant takes with home runs, and on AS-i."""
    plant = Plant(modules=modules, contacts=2, distance=distance, spacing=spacing)
    return plant.hardwired.quantities(), plant.on_asi.quantities()


@solution("ex-10-2", modules=(12, 14, 16, 20, 24), distance=(30, 40, 60, 80))
def saved(modules: int, distance: float) -> Solution:
    """Share of the cost that AS-i saves."""
    wired, bus = _quantities(modules, distance, 4)

    def of(figure: str) -> float:
        return 100 * (1 - bus[figure] / wired[figure])

    right = of("total_cost_eur")
    return Number(right, "%"), {
        "that is the cable alone; work and hardware cost too": of("cable_cost_eur"),
        "a saving is a share of what it would have cost without the bus": (
            100 * (wired["total_cost_eur"] / bus["total_cost_eur"] - 1)
        ),
        "that is the conductors; asked for is the cost": of("conductors_at_cabinet"),
        "that is what is left; asked for is what is saved": 100 - right,
    }


@solution("ex-10-3", modules=range(4, 9), spacing=(1, 2))
def break_even(modules: int, spacing: int) -> Solution:
    """Distance from which AS-i costs less than home runs."""
    (wired, bus), (wired_far, bus_far) = (
        [one["total_cost_eur"] for one in _quantities(modules, place, spacing)]
        for place in (_NEAR, _FAR)
    )
    wired_per_m, bus_per_m = (wired_far - wired) / (_FAR - _NEAR), (bus_far - bus) / (_FAR - _NEAR)
    beyond = (bus - wired) / (wired_per_m - bus_per_m)
    return Number(_NEAR + beyond, "m"), {
        "both lines are known from 10 m on: have you counted from there?": beyond,
        "AS-i grows with the distance too, only more slowly": _NEAR + (bus - wired) / wired_per_m,
    }


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


@solution("ex-10-4")
def choice() -> Solution:
    """The cheapest option that loses few points and has no faults."""
    options = (*dict.fromkeys((*_reviews()[0], *_reviews()[1])), "none")
    return Function(_choose, _cases(), lambda right: Choice(right, options)), {
        "this one is cheap, but does it lose more points than the limit?": (
            lambda options, limit: _cheapest(options, lambda cost, lost, faults: not faults)
        ),
        "an option with faults is none: what is left out costs nothing": (
            lambda options, limit: _cheapest(options, lambda cost, lost, faults: lost <= limit)
        ),
        "the limit itself is allowed: at most, not less": (
            lambda options, limit: _cheapest(
                options, lambda cost, lost, faults: lost < limit and not faults
            )
        ),
        "two things come before the cost: the faults, and the limit": (
            lambda options, limit: _cheapest(options, lambda cost, lost, faults: True)
        ),
        "of all that keep the limit, which one is the cheapest?": _safest,
    }
