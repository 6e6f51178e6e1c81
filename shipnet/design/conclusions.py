"""What a comparison comes to, in words."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from shipnet.design.digits import number
from shipnet.design.front import RESPONSE

if TYPE_CHECKING:
    import pandas as pd

    from shipnet.design.costs.sensitivity import Tornado
    from shipnet.design.network import Network

__all__ = ["conclusions"]

#: Share of the lengths given by which those of our own may be off, one by one, and unsaid; assumed.
_ALIKE = 0.1

#: Columns of which the lowest value is told, with words and unit.
_TOLD = (
    ("total cost", "Lowest cost", "EUR"),
    ("conductors at the cabinet", "Fewest conductors at the cabinet", ""),
    (RESPONSE, "Shortest response at worst", "ms"),
    ("lost by one failure", "Fewest points lost by one cable or device", ""),
)


def conclusions(
    networks: Mapping[str, Network], table: pd.DataFrame, tornado: Tornado, criteria: Sequence[str]
) -> list[str]:
    """Return what a comparison comes to, in words.

    Parameters
    ----------
    networks : mapping of str to Network
        The options by name.
    table : pandas.DataFrame
        As `shipnet.design.comparison.Comparison.table`.
    tornado : Tornado
        Which assumptions matter.
    criteria : sequence of str
        Columns of `table` by which options are weighed.

    Returns
    -------
    list of str
        Sentences: what is left out and why, where lengths come from, the best in each figure, what
        is beaten, what decides.

    Examples
    --------
    >>> from shipnet.design.comparison import compare_networks
    >>> from shipnet.design.example import example
    >>> both = compare_networks([example(), example(redundant=True)])
    >>> conclusions(both.networks, both.table, both.tornado, both.criteria)[3]
    'Fewest points lost by one cable or device: example, example, redundant (4).'
    """
    said = []
    for name, network in networks.items():
        if left := int(table["points left out"][name]):
            said.append(f"{name} leaves {left} of {len(network.points)} points out{_why(network)}.")
    said += _lengths(networks)
    whole = table[table["points left out"] == 0]
    if whole.empty:
        return [*said, "No option connects every point."]
    for column, words, unit in _TOLD:
        values = whole[column].dropna()
        if len(values) > 1:
            same = ", ".join(map(str, values.index[values == values.min()]))
            least = number(values.min())
            said.append(f"{words}: {same} ({least}{f' {unit}' if unit else ''}).")
    if beaten := [str(name) for name in whole.index[~whole["not beaten"]]]:
        said.append(f"Beaten in {', '.join(criteria)} at once: {', '.join(beaten)}.")
    return [*said, f"{str(tornado)[:1].upper()}{str(tornado)[1:]}."]


def _lengths(networks: Mapping[str, Network]) -> Iterator[str]:
    """Say that home runs of given lengths are not weighed alike, if it makes a difference."""
    first = next(iter(networks.values()))
    iolist, site = first.iolist, first.site
    kept = {
        tag
        for network in networks.values()
        for tag in network.runs.query("kind == 'home run' and route_m != route_m")["b"]
    }
    mine = iolist.points["tag"].isin(kept).to_numpy() & iolist.located
    if not mine.any():
        return
    given = iolist.points["home_run_m"].to_numpy(float)[mine]
    own = site.length(site.route(site.cabinet, iolist.places[mine]))
    if np.abs(own - given).sum() > _ALIKE * given.sum():
        cabinet = ", ".join(f"{value:g}" for value in site.cabinet)
        over = "" if site.trays is None else " over the trays"
        yield (
            f"Home runs keep the lengths of the list, {number(given.sum() / 1e3)} km for "
            f"{len(given)} points; from the cabinet at {cabinet} m{over}, as all other cables are "
            f"reckoned, they would be {number(own.sum() / 1e3)} km. With list_lengths false, all "
            "are reckoned alike."
        )


def _why(network: Network) -> str:
    """Return the first reason of each limit that an option runs into."""
    counts = network.reasons["limit"].value_counts()
    first = network.reasons.drop_duplicates("limit")
    said = [
        f"{text} (and {more} more)" if (more := counts[limit] - 1) else text
        for limit, text in zip(first["limit"], first["text"], strict=True)
    ]
    return f": {'; '.join(said)}" if said else ""
