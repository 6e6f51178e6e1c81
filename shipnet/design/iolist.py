"""Ships' I/O lists: reading a list, and planning and comparing ways to connect its points."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import product
from os import PathLike
from typing import TYPE_CHECKING, Any

import pandas as pd

from shipnet.design.layout import Site, Where, site_of
from shipnet.design.points import PointTable
from shipnet.design.settings import Given, Settings
from shipnet.design.words import COLUMNS
from shipnet.errors import ArgumentError
from shipnet.fields import check_rng
from shipnet.html import as_html
from shipnet.lazy import Axes
from shipnet.signals import SIGNALS as SIGNALS
from shipnet.tables import save_table

if TYPE_CHECKING:
    from shipnet.design.comparison import Comparison
    from shipnet.design.costs import Rng
    from shipnet.design.designs import Design
    from shipnet.design.rules import RuleSet
    from shipnet.parallel import Workers


class IoList(PointTable):
    r"""The I/O points of a ship: sensors to read, and outputs to control.

    `read_iolist` reads a list from a file, `IoList.parse` from text, and `IoList.from_table` from
    a table. Positions are needed only for planning.

    Parameters
    ----------
    points : pandas.DataFrame
        One row per point, numbered from 0: tag, system, type (DI, DO, AI or AO), signal (a key of
        `SIGNALS`), conductors, x_m, y_m, z_m, box and its position, to_box_m, home_run_m,
        update_ms, category, note, device, and ex (a mark such as "Ex ia"). Missing values are NaN
        or empty.
    source : str
        Name of the file or text.
    notes : tuple of Remark, optional
        Remarks on how the list was read; `reading` returns them as a table.
    words : Reading, optional
        The list's own words, and the positions of its frames and decks.

    Raises
    ------
    ArgumentError
        If a column is missing, or the rows are not numbered from 0.

    Examples
    --------
    >>> points = IoList.parse("tag,signal,x,y,z\nLS-1,switch,3,2,3\nTT-2,Pt100 3-wire,9,2,3")
    >>> points
    <IoList: 2 points (1 DI, 1 AI)>
    >>> points.counts, points.where("type == 'AI'").table()["conductors"].tolist()
    ({'contact': 1, 'rtd_3wire': 1}, [3])
    >>> points.plan("CAN", cabinet=(0, 0, 0)).fits
    True
    >>> print(points.compare((0, 0, 0), ["home runs", "CAN"]).best.name)
    home runs
    """

    def plan(
        self,
        option: str,
        cabinet: Where = None,
        *,
        settings: Given = None,
        mix: Mapping[str, str] | None = None,
        name: str | None = None,
        rules: RuleSet | str | PathLike[str] | None = None,
        keep: Design | None = None,
    ) -> Design:
        """Connect all points by one of `OPTIONS`.

        In a doubled option, each line is laid twice; on AS-i, we assume that a point can be wired
        to a module on each line, and its cables, terminals and labour count twice.

        `cabinet` is a position (x, y, z) [m], as numbers or text, or None to infer it from the
        list's cable lengths; `settings` are values by name. `mix` selects other options for some
        points, by tag, signal, system, category or type, such as ``{"DI": "AS-i"}``. The response
        limits of `rules`, if given (see `compare`), are met where possible. `keep` is the design of
        an earlier list: points whose position and signal are unchanged keep their boxes, channels,
        terminals and cables, and the others take free ones, as far as the limits allow.
        """
        from shipnet.design.planning import plan
        from shipnet.design.rules import RuleSet

        values, limits = Settings.of(settings), None if rules is None else RuleSet.of(rules)
        site, _ = site_of(self, cabinet, values)
        more: Any = {"settings": values, "mix": mix, "name": name, "rules": limits}
        return plan(self, site, option, **more, keep=keep)

    def compare(
        self,
        cabinet: Where = None,
        options: Sequence[str] | None = None,
        *,
        settings: Given = None,
        mix: Mapping[str, str] | None = None,
        rules: RuleSet | str | PathLike[str] = "DNV",
        rng: Rng = 2024,
        keep: Comparison | None = None,
    ) -> Comparison:
        """Plan the points by several options and compare the designs.

        `options` are some of `OPTIONS`, by default all; `mix` adds a design of home runs with this
        mix (see `plan`). `rules` is the name of a published set, a file or a `RuleSet`; if a plan
        exceeds the set's response limits, the points are planned again to meet them where possible.
        `rng` is used to draw the assumptions from their ranges. `keep` is the comparison of an
        earlier list, whose designs are kept as in `plan`; the conclusions say what changed.
        """
        from shipnet.design.comparison import compared
        from shipnet.design.planning import OPTIONS, plan
        from shipnet.design.rules import RuleSet
        from shipnet.parallel import track

        values, rules = Settings.of(settings), RuleSet.of(rules)
        site, remark = site_of(self, cabinet, values)
        ways = OPTIONS if options is None else options
        each = [(option, None) for option in ways] + ([("home runs", mix)] if mix else [])
        old = keep.designs if keep else {}
        designs = [
            plan(
                self,
                site,
                option,
                settings=values,
                mix=choose,
                rules=rules,
                keep=old.get("mix" if choose else option),
            )
            for option, choose in track(each, "plans")
        ]
        made = compared(designs, rules, check_rng(rng), (remark,) if remark else ())
        return replace(made, previous=keep)

    def study(
        self,
        grid: Mapping[str, Sequence[Any]] | Iterable[Mapping[str, Any]],
        cabinet: Where = None,
        options: Sequence[str] | None = None,
        *,
        settings: Given = None,
        rules: RuleSet | str | PathLike[str] = "DNV",
        workers: Workers = 1,
    ) -> pd.DataFrame:
        """Compare the options at every point of a grid of settings.

        `grid` maps names of settings to lists of values, or is a list of grid points. The table has
        one row per grid point and option: the settings of the grid point, and the columns of
        `Comparison.table`. `workers` is as in `shipnet.ballast.write_fleet`; the table does not
        depend on it.
        """
        from shipnet.design.rules import RuleSet
        from shipnet.parallel import spread

        if isinstance(grid, Mapping):
            values = product(*grid.values()) if grid else ()
            points = [dict(zip(grid, each, strict=True)) for each in values]
        else:
            points = [dict(point) for point in grid]
        if not points:
            raise ArgumentError("the grid has no points")
        if any(point.keys() != points[0].keys() for point in points):
            raise ArgumentError("the points of the grid have different arguments")
        start = Settings.of(settings)
        site, _ = site_of(self, cabinet, start)
        start = start.replace({"detour": site.detour, "tails": site.tails})
        if faults := {fault for point in points for fault in start.tried(point)[1]}:
            raise ArgumentError("; ".join(sorted(faults)))
        case = partial(_case, self, site, options, start, RuleSet.of(rules))
        answers = spread(case, points, workers, step="points of the grid")
        tables = []
        for point, rows in zip(points, answers, strict=True):
            table = pd.DataFrame(rows)
            # A value may be a range or several bit rates; each row contains the whole value.
            point_columns = {name: [value] * len(table) for name, value in point.items()}
            tables.append(table.assign(**point_columns)[[*point, *table.columns]])
        joined: pd.DataFrame = pd.concat(tables, ignore_index=True)
        return joined

    def plot(self, option: str = "home runs", ax: Axes | None = None) -> Axes:
        """Draw all points, wired individually ("home runs") or connected to one line ("AS-i")."""
        from shipnet.design.plot import plot_points

        return plot_points(self.points, option, ax=ax)

    def _repr_html_(self) -> str:
        return as_html(self, figure=False)

    def save(self, path: str | PathLike[str]) -> None:
        """Write the list to a CSV file or an Excel workbook that `read_iolist` can read."""
        empty = [name for name in ("device", "ex") if not self.points[name].any()]
        names = [name for name in COLUMNS if name not in empty]
        save_table(path, self.points[names])


def _case(
    iolist: IoList,
    site: Site,
    options: Sequence[str] | None,
    start: Settings,
    rules: RuleSet,
    point: Mapping[str, Any],
) -> dict[Any, list[Any]]:
    """Return the table of a comparison with some settings; other processes can unpickle it."""
    from shipnet.design.comparison import compare
    from shipnet.design.planning import OPTIONS, plan

    settings = start.replace(point)
    site = replace(site, detour=settings.detour, tails=settings.tails)
    ways = OPTIONS if options is None else options
    designs = [plan(iolist, site, way, settings=settings, rules=rules) for way in ways]
    return compare(designs, rules=rules).table().reset_index().to_dict("list")


def read_iolist(
    path: str | PathLike[str],
    *,
    sheet: str | None = None,
    settings: Given = None,
    strict: bool = False,
) -> IoList:
    """Read a yard's I/O list from a CSV file or an Excel workbook.

    The column titles must be in one of the first 50 rows; they may continue in the next row. They
    must include ``tag``, and ``signal`` or ``type``. A title or a cell may include a unit, such as
    ``x [mm]`` or ``24,8 m``. Repeated titles, subtitles, page headers, notes, and rows struck out
    or marked as deleted or spare are left out. `IoList.reading` reports how the file was read.

    Parameters
    ----------
    path : path
        The file.
    sheet : str, optional
        Sheet of a workbook; by default, the visible sheet with the largest number of known titles.
    settings : Settings or mapping, optional
        Settings whose tables ``columns``, ``signals``, ``frames`` and ``decks`` define the list's
        own words.
    strict : bool, default False
        Whether doubts, such as a hidden row, are reported as faults.

    Returns
    -------
    IoList
        The points.

    Raises
    ------
    InputError
        If the file cannot be read or is not an I/O list; all faults are listed by row and column.

    Examples
    --------
    >>> from shipnet import datasets
    >>> read_iolist(datasets.path("synthetic_iolist_ship.csv"))
    <IoList: 353 points (176 AI, 129 DI, 48 DO)>
    """
    return IoList.read(path, sheet, reading=Settings.of(settings).reading, strict=strict)
