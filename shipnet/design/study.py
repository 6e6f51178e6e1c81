"""Whole comparisons over values of what they rest on, to see how far the answer depends on them.

A comparison of a ship takes about a second, more than half of it the search for its AS-i lines: too
short to be worth spreading over processes. A study of several is not, and goes through `sweep`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from shipnet.design.basis import Basis, changed
from shipnet.design.comparison import compare
from shipnet.design.costs.assumptions import Assumptions
from shipnet.design.costs.sweep import points_of, sweep
from shipnet.design.plan import OPTIONS, Settings
from shipnet.design.rules import HOST_TIME, RuleSet, rules_of
from shipnet.errors import ArgumentError

if TYPE_CHECKING:
    import pandas as pd

    from shipnet.design.iolist import IoList
    from shipnet.design.site import Site

__all__ = ["study"]


@dataclass(frozen=True)
class _Case:
    """A comparison at given values; it travels to other processes, so it is no inner function."""

    iolist: IoList
    site: Site
    options: tuple[str, ...]
    basis: Basis
    rule_set: RuleSet

    def __call__(self, **values: Any) -> dict[str, pd.DataFrame]:
        basis = self.basis.with_(values)
        found = compare(
            self.iolist,
            replace(self.site, detour=basis.detour, tails=basis.tails),
            self.options,
            rule_set=self.rule_set,
            assumptions=basis.assumptions,
            settings=basis.settings,
            host_time=basis.host_time,
        )
        return {_TABLE: found.table.reset_index()}


_TABLE = "comparison"


def study(
    iolist: IoList,
    site: Site,
    grid: Mapping[str, Sequence[Any]] | Iterable[Mapping[str, Any]],
    options: Sequence[str] = OPTIONS,
    *,
    rule_set: RuleSet = "DNV",
    assumptions: Assumptions | None = None,
    settings: Settings | None = None,
    host_time: float = HOST_TIME,
    parallel: bool | AbstractContextManager[Any] | None = None,
    progress: bool | Callable[[int, int], object] | None = None,
) -> pd.DataFrame:
    r"""Compare the options anew at every point of a grid of values.

    Parameters
    ----------
    iolist : IoList
        The points.
    site : Site
        Where the cabinet is; its detour and tails hold where the grid does not vary them.
    grid : mapping of str to sequence, or iterable of mapping
        Values by `shipnet.design.basis.names`, such as ``"detour"``, ``"boxes.points"`` or
        ``"assumptions.labour_rate"``, for all their combinations; or the points themselves.
    options : sequence of str, default all of `shipnet.design.plan.OPTIONS`
        Which ways.
    rule_set, assumptions, settings, host_time
        As `shipnet.design.comparison.compare`, where the grid does not vary them.
    parallel, progress
        As `shipnet.design.costs.sweep.sweep`: one by one when that is short, else on all cores, or
        where a passed ``joblib.parallel_config`` says.

    Returns
    -------
    pandas.DataFrame
        One row a point of the grid and option: its values, ``option``, and the columns of
        `shipnet.design.comparison.Comparison.table`. The same wherever it was run.

    Raises
    ------
    ArgumentError
        If a name or a value is not legal, before anything is planned; or as
        `shipnet.design.comparison.compare` and `shipnet.design.costs.sweep.sweep`.

    Examples
    --------
    What becomes of home runs and CAN if cables make more or less of a detour:

    >>> from shipnet.design.iolist import parse_iolist
    >>> from shipnet.design.site import Site
    >>> rows = "".join(f"L{n},contact,{10 + 4 * n},{n % 3},2\n" for n in range(24))
    >>> iolist, site = parse_iolist("tag,signal,x,y,z\n" + rows), Site((0, 0, 8))
    >>> table = study(iolist, site, {"detour": [1.0, 1.3, 1.6]}, ["home runs", "CAN"])
    >>> costs = table.pivot(index="detour", columns="option", values="total cost")
    >>> print(costs.rename_axis(index=None).round(-2).astype(int))
    option    CAN  home runs
    1.0     12000      13000
    1.3     12600      15900
    1.6     13200      18800
    """
    import pandas as pd

    points = points_of(grid)
    start = Basis(
        Settings() if settings is None else settings,
        Assumptions() if assumptions is None else assumptions,
        site.detour, site.tails, host_time,
    )  # fmt: skip
    faults = {fault for point in points for fault in changed(start, point)[1]}
    if faults:
        raise ArgumentError("; ".join(sorted(faults)))
    case = _Case(iolist, site, tuple(options), start, rules_of(rule_set))
    found = sweep(case, points, parallel=parallel, progress=progress)
    tables = []
    for point, table in zip(points, found[_TABLE], strict=True):
        # A value may be a range or several bit rates: it stands as it is in every row.
        given = {name: [value] * len(table) for name, value in point.items()}
        tables.append(table.assign(**given)[[*point, *table.columns]])
    joined: pd.DataFrame = pd.concat(tables, ignore_index=True)
    return joined
