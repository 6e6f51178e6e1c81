"""What one failure costs: every cable, tray and device of a planned network, one at a time."""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING

import numpy as np

from shipnet.design.rules.reach import Failure, Reach
from shipnet.errors import ArgumentError

if TYPE_CHECKING:
    import pandas as pd

    from shipnet.design.network import Network

__all__ = ["FAILURES", "lost", "single_cuts", "worst"]

#: What can fail: a cable is cut, the cables that are one pair of a bus or of a supply are shorted,
#: all cables on a tray are cut, a device is dead.
FAILURES = ("cut", "short", "tray", "device")


def single_cuts(network: Network) -> pd.DataFrame:
    """Return what each single failure of a planned network costs.

    Parameters
    ----------
    network : Network
        What was planned.

    Returns
    -------
    pandas.DataFrame
        One row a failure: ``failure`` (one of `FAILURES`), ``failed`` (the run, tray or device; of
        a short the first run of those that are one pair), ``kind`` (of the run or device),
        ``segment``, ``line``, ``points_lost``, ``systems`` and ``tags`` (tuples: the systems that
        lose a point, in alphabetical order, and these points in the order of the list).

    Notes
    -----
    What counts as lost is said in `shipnet.design.rules.reach`. Points that no cable connects in
    the first place are not lost. The trunk of hardwired points has no row of a short: one pair of
    its cable is one point. A short of feeders takes all of them that hang on the same terminals of
    a supply, as if one fuse held them: a fuse for each branch loses less.

    Examples
    --------
    Two boxes with two sensors each, on one bus:

    >>> from shipnet.design.example import example
    >>> table = single_cuts(example())
    >>> table = table[table["points_lost"] > 1]
    >>> dict(zip(table["failed"], table["points_lost"], strict=True))
    {'trunk 1': 4, 'trunk 2': 2, 'port': 4, 'cabinet': 4, 'master': 4, 'JB1': 2, 'JB2': 2}
    """
    import pandas as pd

    reach = Reach(network)
    runs, devices = network.runs, network.devices
    rows: list[tuple[str, str, str, str, str]] = []
    failures: list[Failure] = []
    for number, run in enumerate(
        zip(*(runs[c] for c in ("run", "kind", "segment", "line")), strict=True)
    ):
        rows.append(("cut", *run))
        failures.append(((number,), ()))
    for pair, masters in reach.shorts:
        rows.append(("short", *runs.loc[pair[0], ["run", "kind", "segment", "line"]]))
        failures.append((pair, masters))
    for tray, members in reach.trays.items():
        rows.append(("tray", tray, "", "", ""))
        failures.append((members, ()))
    for number, device in enumerate(
        zip(*(devices[c] for c in ("device", "kind", "segment")), strict=True)
    ):
        rows.append(("device", *device, ""))
        failures.append(((), (number,)))
    table = pd.DataFrame(rows, columns=["failure", "failed", "kind", "segment", "line"])

    # The cable of one point, cut, costs that point and no other.
    gone = [np.array([], int)] * len(rows)
    for run_number, point in reach.alone.items():
        gone[run_number] = np.array([point])
    others = np.setdiff1d(np.arange(len(rows)), np.flatnonzero(reach.at_point))
    for row, mask in zip(others, reach.lost([failures[row] for row in others]), strict=True):
        gone[row] = np.flatnonzero(mask)
    tags = network.points["tag"].to_numpy(object)
    names, system = np.unique(network.iolist.points["system"].to_numpy(str), return_inverse=True)
    return table.assign(
        points_lost=[len(points) for points in gone],
        systems=pd.Series(
            [tuple(names[np.unique(system[points])].tolist()) for points in gone], dtype=object
        ),
        tags=pd.Series([tuple(tags[points]) for points in gone], dtype=object),
    )


def lost(
    network: Network,
    *,
    runs: Collection[str] = (),
    devices: Collection[str] = (),
    trays: Collection[str] = (),
) -> tuple[str, ...]:
    """Return the points that several failures at once cost.

    Parameters
    ----------
    network : Network
        What was planned.
    runs, devices, trays : collection of str
        Cables that are cut, devices that are dead, trays of which all cables are cut.

    Returns
    -------
    tuple of str
        Tags in the order of the list.

    Raises
    ------
    ArgumentError
        If the network has no such run, device or tray; all of them are named.

    Examples
    --------
    Either line of a redundant bus will do, but not the rest of both:

    >>> from shipnet.design.example import example
    >>> network = example(redundant=True)
    >>> lost(network, runs=["trunk 1A"]), lost(network, runs=["trunk 1A", "trunk 2B"])
    ((), ('TT-3', 'LS-4'))
    """
    reach = Reach(network)
    numbers = {
        "run": {name: [n] for n, name in enumerate(network.runs["run"])},
        "device": {name: [n] for n, name in enumerate(network.devices["device"])},
        "tray": reach.trays,
    }
    given = {"run": runs, "device": devices, "tray": trays}
    for what, names in given.items():
        if isinstance(names, str):
            raise ArgumentError(f"{what}s is {names!r}; it must be a list of names")
    unknown = [f"{w} {n!r}" for w, names in given.items() for n in names if n not in numbers[w]]
    if unknown:
        raise ArgumentError(f"network {network.name!r} has no {', no '.join(unknown)}")
    found = {w: [k for n in names for k in numbers[w][n]] for w, names in given.items()}
    (gone,) = reach.lost([(found["run"] + found["tray"], found["device"])])
    return tuple(network.points["tag"].to_numpy(object)[gone])


def worst(cuts: pd.DataFrame) -> pd.DataFrame:
    """Return the row of each kind of failure that costs the most points.

    Parameters
    ----------
    cuts : pandas.DataFrame
        What `single_cuts` returned.

    Returns
    -------
    pandas.DataFrame
        One row a kind of failure that there is, the first of several equal ones; without the
        cabinet, which takes everything along.

    Examples
    --------
    >>> from shipnet.design.example import example
    >>> worst(single_cuts(example(redundant=True)))[["failed", "points_lost"]].values.tolist()
    [['drop PS-1', 1], ['trunk 1A', 0], ['port', 0], ['master', 4]]
    """
    rest = cuts[cuts["kind"] != "cabinet"]
    ranked = rest.sort_values("points_lost", ascending=False, kind="stable")
    return ranked.drop_duplicates("failure").sort_index().reset_index(drop=True)
