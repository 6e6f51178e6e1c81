"""One way to connect the points of an I/O list, with its costs, failures and drawings."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from copy import copy
from dataclasses import dataclass
from functools import cached_property
from importlib.util import find_spec
from os import PathLike

import numpy as np

from shipnet import style
from shipnet.answers import Findings
from shipnet.design import costs, drawing, failures, ship, tables
from shipnet.design.costs import Quantities
from shipnet.design.layout import Layout
from shipnet.design.plot import draw_cables
from shipnet.design.rules import RuleSet, check
from shipnet.design.settings import Settings
from shipnet.html import as_html
from shipnet.lazy import Axes, pd
from shipnet.tables import as_csv, as_workbook

#: Colours of the kinds of cables in the top view of a design.
_COLOURS = {"home run": "0.7", "drop": "0.8", "feeder": "C1", "trunk": "C0"}


@dataclass(frozen=True, eq=False, repr=False)
class Design(Layout):
    r"""One way to connect the points of an I/O list; `IoList.plan` makes one.

    Parameters
    ----------
    name : str
        Name of the design in tables and figures.
    iolist : IoList
        The points.
    site : Site
        Position of the cabinet, and the allowances `detour` and `tails` in cable lengths.
    points : pandas.DataFrame
        One row per point, in the order of the list: tag, bus, segment, device, address,
        response_ms, fits, planned_update_ms. On doubled AS-i lines, the device is the module on
        line A. An unconnected point has no bus; a point whose device violates a supply limit has a
        bus but does not fit. `reasons` says why a point does not fit. The planned update time on a
        bus is that of the list or the settings, or a rule's response limit if that is shorter.
    devices : pandas.DataFrame
        One row per device, such as the cabinet, a box, a module or a supply: device (its name),
        kind, segment, x_m, y_m, z_m, at (the device whose housing contains it, or ""), and line
        ("A" or "B" if it belongs to one line of a doubled segment, otherwise "").
    cables : pandas.DataFrame
        One row per cable: run (its name), cable (its type in the catalogue), a and b (its ends),
        segment, kind, route_m, length_m, used, conductors, at_cabinet and line.
    segments : pandas.DataFrame
        One row per line or loop: segment, bus, points, devices, length_m, bus_time and
        capacity_used as in `Utilisation`, response_ms and slowest_update_ms of the point nearest
        to its limit, and columns that exist for one bus only.
    reasons : pandas.DataFrame
        One row per item that does not fit: subject, limit, value, bound, unit, text.
    settings : Settings, optional
        The limits, prices and allowances of the plan.
    strips : mapping of str to sequence, optional
        Points on each trunk of a junction box, in the order of the cores.
    previous : Design, optional
        Design of an earlier list, whose boxes, channels and cables this one keeps.
    without_limits : Design, optional
        Design planned without the rules' response limits; None if these do not change the plan.

    Examples
    --------
    >>> from shipnet.design import IoList
    >>> points = IoList.parse("tag,signal,x,y,z\nLS-1,contact,3,2,3\nLS-2,contact,30,2,3")
    >>> design = points.plan("AS-i", cabinet=(0, 0, 0))
    >>> design
    <Design 'AS-i': 2 of 2 points fit, 4 cables, 60 m>
    >>> design.quantities()["conductors_at_cabinet"], design.lost(devices=["AS-i 1 master"])
    (2.0, ('LS-1', 'LS-2'))
    >>> design.check("DNV").verdict
    '15 checks, 12 not verified'
    """

    without_limits: Design | None = None

    def priced(self, settings: Settings) -> Design:
        """Return a copy with other settings, such as prices, without planning the design again."""
        made = copy(self)  # keeps the failures if they have been computed
        object.__setattr__(made, "settings", settings)
        if self.without_limits is not None:
            object.__setattr__(made, "without_limits", self.without_limits.priced(settings))
        return made

    def quantities(self) -> Quantities:
        """Return conductors, cable, hours and cost, each with a low, nominal and high value."""
        return costs.quantities(self)

    def check(
        self, rules: RuleSet | str | PathLike[str] = "DNV", *, host_time: float | None = None
    ) -> Findings:
        """Check the design against class rules; `host_time` [s] overrides the setting if given."""
        return check(self, self._failures, rules, host_time=host_time)

    def failures(self) -> pd.DataFrame:
        """Return the points lost in each single failure, the worst first."""
        ranked = self._failures.sort_values("points_lost", ascending=False, kind="stable")
        return ranked.reset_index(drop=True)

    @cached_property
    def _failures(self) -> pd.DataFrame:
        """Table of every single failure: cut cables, shorted pairs and dead devices."""
        return failures.single_failures(self)

    def lost(
        self, *, cables: Collection[str] = (), devices: Collection[str] = ()
    ) -> tuple[str, ...]:
        """Return the tags of the points lost if all these cables and devices fail together."""
        return failures.lost(self, cables=cables, devices=devices)

    def tables(self) -> dict[str, pd.DataFrame]:
        """Return the tables that a yard needs to build the design.

        They are cables (the cable schedule), terminals (one row per core), devices, points with
        their channels, supplies, voltages, segments, bill (of parts and work) and reasons.
        """
        return tables.tables(self)

    def single_line(self) -> str:
        """Return the single-line drawing as SVG: cabinet, boxes and stations on their trunks."""
        return drawing.single_line(self)

    def drawing(self) -> ship.ShipDrawing:
        """Return the side and plan view, in which a cable or device that is clicked fails."""
        failures = self._failures
        return ship.draw({self.name: (self, failures, ship.note(self, failures))})

    def files(self) -> Iterator[tuple[str, bytes]]:
        """Yield the name and the content of each file that `save` writes."""
        named = self.tables()
        for name, table in named.items():
            yield f"{name}.csv", as_csv(table, digits=10)
        if find_spec("openpyxl"):
            yield f"{tables.file_name(self.name)}.xlsx", as_workbook(named)
        yield f"{tables.file_name(self.name)}.svg", self.single_line().encode()
        yield "settings.toml", self.settings.text().encode()

    def save(self, folder: str | PathLike[str]) -> None:
        """Write the tables (as CSV files and a workbook), the drawing and the settings to a folder.

        Existing files are replaced. The workbook is written only if openpyxl is installed.
        """
        tables.save_files(folder, self.files())

    @style.applied
    def plot(self, ax: Axes | None = None, *, cables: Collection[str] = ()) -> Axes:
        """Draw the design from above: cabinet, devices, points, and the cables between them.

        Crosses mark the given `cables` as cut, and rings the points that are lost if all are.
        """
        ax = style.axes(ax)
        at = self.devices.set_index("device")[["x_m", "y_m"]]
        points = self.iolist.points.set_index("tag")[["x_m", "y_m"]]
        places = pd.concat([at, points])
        for kind, colour in _COLOURS.items():
            runs = self.cables[self.cables["kind"] == kind]
            if len(runs):
                ends = np.stack([places.loc[runs[end]] for end in ("a", "b")], axis=1)
                draw_cables(ax, ends, colour, "--" if kind == "feeder" else "-", kind)
        boxes = self.devices[self.devices["kind"].isin(["box", "module", "station"])]
        ax.plot(boxes["x_m"], boxes["y_m"], "s", color="0.25", markersize=4, label="box or module")
        ax.plot(points["x_m"], points["y_m"], ".", color="0.5", markersize=3, label="point")
        ax.plot(*at.loc[self.cabinet], "D", color="C3", label="cabinet")
        title = style.literal(self.name)
        if cables:
            lost = points.loc[list(self.lost(cables=cables))]
            cut = self.cables.set_index("run").loc[list(cables)]
            middles = (places.loc[cut["a"]].to_numpy() + places.loc[cut["b"]].to_numpy()) / 2
            red = style.LIMIT["color"]
            ax.plot(*middles.T, "X", color=red, ms=12, mec="w", zorder=3, label="cut")
            ax.plot(*lost.to_numpy().T, "ko", fillstyle="none", clip_on=False, label="lost")
            title += f": {len(lost)} of {len(points)} points lost"
        ax.set(xlabel="x [m]", ylabel="y [m]", title=title)
        ax.margins(0.05)
        ax.autoscale_view()
        ax.legend(loc="upper left", bbox_to_anchor=(1, 1))
        return ax

    def _repr_html_(self) -> str:
        rows = self.segments if self.fits else self.reasons
        return as_html(self, rows, ok=self.fits, table=self.quantities().table())
