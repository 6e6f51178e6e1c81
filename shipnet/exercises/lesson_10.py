"""Exercises of lesson 10: from an I/O list to a defended choice."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cache
from math import inf

from shipnet import datasets
from shipnet.design.costs import Quantities
from shipnet.design.iolist import read_iolist
from shipnet.design.plant import Plant
from shipnet.exercises.answers import Function, Number, Words
from shipnet.exercises.exercise import ANY, Solution, solution

#: Total cost [EUR], points lost in the worst single failure, and number of faults, by option.
_Options = Mapping[str, tuple[int, int, int]]

#: A plan with unconnected points.
_POOR = "AS-i without repeaters"

#: Two distances at which the cost of a plant is computed [m].
_NEAR, _FAR = 10, 30


@cache
def _left(contacts: int, lines: int) -> float:
    return 100 * Plant(contacts, contacts=1, lines=lines).saving.left


@solution("ex-10-1", "left_percent", contacts=range(120, 401, 20), lines=range(3, 9))
def conductors_left(contacts: int, lines: int) -> Solution:
    """Conductors at the cabinet with AS-i, as a percentage of those with home runs."""
    left = _left(contacts, lines)
    return Number(left, "%"), {
        "that is the saving; enter what is left": 100 - left,
        "that is the ratio of contacts to lines; what percentage is left?": contacts / lines,
        "that is for one line; how many lines are there?": left / lines,
        "each contact has two wires, and so does each line": 2 * left,
        "each line has two wires, and so does each contact": left / 2,
        "divide by all conductors of the contacts, not by those saved": 100 * left / (100 - left),
        "that is the number of conductors left; what percentage is it?": 2 * lines,
        "How many conductors come from the contacts, and how many from the lines?": ANY,
    }


@cache
def _quantities(
    modules: int, distance: float, spacing: float, contacts: int = 2
) -> tuple[Quantities, Quantities]:
    """Return the quantities of a plant with home runs, and those of the same plant with AS-i."""
    plant = Plant(modules=modules, contacts=contacts, distance=distance, spacing=spacing)
    return plant.hardwired.quantities(), plant.on_asi.quantities()


@solution("ex-10-2", "saved_percent", modules=(12, 14, 16, 20, 24), distance=(30, 40, 60, 80))
def saved(modules: int, distance: float) -> Solution:
    """Cost that AS-i saves, as a percentage of the cost of home runs."""

    def of(figure: str, spacing: float = 4, contacts: int = 2) -> float:
        wired, bus = _quantities(modules, distance, spacing, contacts)
        return 100 * (1 - bus[figure] / wired[figure])

    right = of("total_cost_eur")
    wired, bus = (one["total_cost_eur"] for one in _quantities(modules, distance, 4))
    return Number(right, "%"), {
        "that is the cable alone; labour and hardware cost too": of("cable_cost_eur"),
        "that is the labour alone; cable and hardware cost too": of("labour_cost_eur"),
        "that is the saving in conductors; enter the saving in cost": of("conductors_at_cabinet"),
        "a saving is relative to the cost without the bus": 100 * (wired / bus - 1),
        "that is what is left; enter the saving": 100 - right,
        "that is in EUR; enter a percentage": wired - bus,
        "how many contacts does each door have?": of("total_cost_eur", contacts=1),
        "how far apart are the doors?": of("total_cost_eur", spacing=1),
        "Print both total costs: what percentage of the hardwired cost does the bus save?": ANY,
    }


@solution("ex-10-3", "distance_m", modules=range(4, 9), spacing=(1, 1.5, 2, 2.5))
def break_even(modules: int, spacing: float) -> Solution:
    """Distance beyond which AS-i costs less than home runs."""
    (wired, bus), (wired_far, bus_far) = (
        [one["total_cost_eur"] for one in _quantities(modules, distance, spacing)]
        for distance in (_NEAR, _FAR)
    )
    wired_per_m, bus_per_m = (wired_far - wired) / (_FAR - _NEAR), (bus_far - bus) / (_FAR - _NEAR)
    beyond = (bus - wired) / (wired_per_m - bus_per_m)
    return Number(_NEAR + beyond, "m"), {
        "that is the distance beyond 10 m; count from the cabinet": beyond,
        "the cost of AS-i grows with the distance too, but more slowly": _NEAR
        + (bus - wired) / wired_per_m,
        "is your difference the one at 10 m or at 30 m? Count from there": _FAR + beyond,
        "how much does the difference change per metre?": _NEAR + beyond / (_FAR - _NEAR),
        "both costs have a part that does not grow with the distance": _NEAR * bus / wired,
        "the sign is wrong: the difference falls with the distance": _NEAR - beyond,
        "Take the difference between the costs at 10 m and at 30 m: where is it zero?": ANY,
    }


@cache
def _reviews() -> tuple[_Options, _Options]:
    """Return two sets of three plans for the ballast valves; one plan in the second has faults."""
    ship = read_iolist(datasets.path("synthetic_iolist_ship.csv"))
    ballast = ship.where("system == 'Ballast valve'")
    ways = ["home runs", "junction boxes", "AS-i", "CAN"]
    comparison = ballast.compare((20, -6, 14), ways, settings={"tails": 2, "spare": 0})
    comparison = comparison.add(comparison.plan("AS-i", settings={"asi.repeaters": 0}, name=_POOR))
    table = comparison.table()
    faults = table["points_left_out"] + table["rules_violated"]
    rows = zip(table["total_cost_eur"].round(-2), table["lost_by_failure"], faults, strict=True)
    every = {
        name: (int(c), int(n), int(f)) for name, (c, n, f) in zip(table.index, rows, strict=True)
    }
    return (
        {name: every[name] for name in ways[:3]},
        {name: every[name] for name in (_POOR, "junction boxes", "CAN")},
    )


def _good(options: _Options, limit: float, faults: bool = False) -> Iterator[tuple[int, int, str]]:
    """Yield cost, loss and name of options that lose at most `limit`; `faults` allows faults."""
    for name, (cost, lost, wrong) in options.items():
        if lost <= limit and (faults or not wrong):
            yield cost, lost, name


def _cheapest(options: _Options, limit: float, faults: bool = False) -> str:
    return min(_good(options, limit, faults), default=(0, 0, "none"))[-1]


def _cases() -> list[tuple[_Options, int]]:
    """Return pairs of a set of options and a limit on the loss; the first two sets are invented."""
    made_up = {"home runs": (50, 3, 0), "CAN": (40, 5, 0), "AS-i": (60, 4, 0), _POOR: (55, 2, 0)}
    long, short = _reviews()
    most = long["AS-i"][1]
    limits = ((long, 1), (long, most), (long, most - 1), (long, 0), (short, short["CAN"][1]))
    one_fault = {"home runs": (50, 3, 0), "CAN": (40, 2, 1), "AS-i": (45, 1, 0)}
    return [(made_up, 5), (one_fault, 5), *limits]


@solution("ex-10-4", "choose")
def choice() -> Solution:
    """Cheapest option that has no faults and loses no more points than a limit allows."""
    options = (*dict.fromkeys((*_reviews()[0], *_reviews()[1])), "none")
    return Function(_cheapest, _cases(), lambda right: Words(right, options)), {
        "this option is cheap, but does it lose more points than the limit allows?": (
            lambda options, limit: _cheapest(options, inf)
        ),
        "an option with faults is not allowed, even if it is cheap": (
            lambda options, limit: _cheapest(options, limit, faults=True)
        ),
        "a loss equal to the limit is allowed": (
            lambda options, limit: _cheapest(options, limit - 1)
        ),
        "check two things before the cost: the faults and the limit": (
            lambda options, limit: _cheapest(options, inf, faults=True)
        ),
        "choose the cheapest, not the most expensive": (
            lambda options, limit: max(_good(options, limit), default=(0, 0, "none"))[-1]
        ),
        "Remove options with faults, then those that lose too much; which is the cheapest?": ANY,
    }
