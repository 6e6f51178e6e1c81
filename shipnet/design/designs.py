"""One way to connect the points of an I/O list: devices, the cables between them, segments."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from copy import copy
from dataclasses import dataclass, field
from functools import cached_property
from os import PathLike
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from shipnet.design.iolist import IoList
from shipnet.design.settings import Settings
from shipnet.design.site import Site
from shipnet.errors import ArgumentError

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

    from shipnet.answers import Findings
    from shipnet.design.costs import Quantities
    from shipnet.design.rules import RuleSet


# One way to connect the points of an I/O list: devices, the cables between them, segments

#: What a point can be connected by; the empty name is that of a point that fits nowhere.
BUSES = ("hardwired", "AS-i", "CAN", "Modbus RTU", "")

#: What stands in a plant, beside the points themselves. The auxiliary supply is that of the outputs
#: of an AS-i line, whose modules take what they need themselves from the line.
DEVICE_KINDS = (
    "cabinet", "box", "module", "station", "master", "gateway", "repeater", "supply",
    "auxiliary supply", "terminator",
)  # fmt: skip

#: Cables: from a device to a point, between devices of a segment, from the cabinet to a point,
#: and what brings a supply to its segment or a link to a gateway.
RUN_KINDS = ("drop", "trunk", "home run", "feeder")

#: A trunk that is alone, and the two of a redundant pair.
LINES = ("", "A", "B")

#: The columns of each table with their types; a segment may have more.
COLUMNS: Mapping[str, Mapping[str, str]] = MappingProxyType(
    {
        "points": {
            "tag": "str", "bus": "str", "segment": "str", "device": "str", "address": "str",
            "response_ms": "float", "fits": "bool",
        },
        "devices": {
            "device": "str", "kind": "str", "segment": "str",
            "x_m": "float", "y_m": "float", "z_m": "float",
        },
        "cables": {
            "run": "str", "cable": "str", "a": "str", "b": "str", "segment": "str", "kind": "str",
            "route_m": "float", "length_m": "float", "used": "int", "conductors": "int",
            "at_cabinet": "bool", "line": "str", "way": "object",
        },
        "segments": {
            "segment": "str", "bus": "str", "points": "int", "devices": "int", "length_m": "float",
            "load": "float", "response_ms": "float", "slowest_update_ms": "float",
        },
        "reasons": {
            "subject": "str", "limit": "str", "value": "float", "bound": "float", "unit": "str",
            "text": "str",
        },
    }
)  # fmt: skip


_DTYPES = {"float": float, "int": np.int64, "bool": bool}


def frame(table: str, rows: Any = ()) -> pd.DataFrame:
    """Return one of a design's tables, with its columns in order and of their types."""
    import pandas as pd

    if table not in COLUMNS:
        raise ArgumentError(f"table is {table!r}; it must be one of {', '.join(COLUMNS)}")
    types = COLUMNS[table]
    if not isinstance(rows, pd.DataFrame | Mapping):
        rows = list(rows)
    made = pd.DataFrame(rows) if len(rows) else pd.DataFrame(columns=list(types))
    missing = [column for column in types if column not in made.columns]
    if missing:
        raise ArgumentError(f"{table} has no column {' and no column '.join(missing)}")
    more = [column for column in made.columns if column not in types]
    made = made[[*types, *more]].reset_index(drop=True)
    for column, kind in types.items():
        try:
            made[column] = made[column].astype(np.dtype(_DTYPES.get(kind, object)))
        except (TypeError, ValueError) as error:
            raise ArgumentError(f"column {column} of {table} is not all {kind}: {error}") from None
    return made


@dataclass(frozen=True, eq=False)
class Design:
    r"""One way to connect the points of an I/O list; `IoList.plan` makes one.

    Parameters
    ----------
    name : str
        What tables and figures call it.
    iolist : IoList
        The points.
    site : Site
        Cabinet and trays, with the detour and the tails of cables.
    points : pandas.DataFrame
        One row per point, in the order of the list: tag, bus, segment, device, address,
        response_ms, fits. A point that fits nowhere has no bus, and a row in `reasons`.
    devices : pandas.DataFrame
        Cabinet, boxes, modules, stations, masters, repeaters, supplies: device, kind, segment,
        x_m, y_m, z_m, and at, the device in whose housing it stands.
    cables : pandas.DataFrame
        Every cable laid: run, its name; cable, its type in the catalogue; a and b, its ends;
        segment, kind, route_m, length_m, used, conductors, at_cabinet, line, and way, its trays.
    segments : pandas.DataFrame
        Lines and loops: segment, bus, points, devices, length_m, load, response_ms,
        slowest_update_ms, and what only one bus has.
    reasons : pandas.DataFrame
        Why something does not fit: subject, limit, value, bound, unit, text.
    settings : Settings, optional
        Every limit, price and allowance that it was planned with.

    Raises
    ------
    ArgumentError
        If the tables do not fit together; all faults at once.

    Examples
    --------
    >>> from shipnet.design import IoList
    >>> points = IoList.parse("tag,signal,x,y,z\nLS-1,contact,3,2,3\nLS-2,contact,30,2,3")
    >>> design = points.plan("AS-i", cabinet=(0, 0, 0))
    >>> design
    <Design 'AS-i': 2 of 2 points fit, 4 cables, 52 m>
    >>> design.quantities()["conductors_at_cabinet"], design.lost(devices=["AS-i 1 master"])
    (2.0, ('LS-1', 'LS-2'))
    >>> design.check("DNV").verdict
    '15 checks, 12 not verified'
    """

    name: str
    iolist: IoList
    site: Site
    points: pd.DataFrame
    devices: pd.DataFrame
    cables: pd.DataFrame
    segments: pd.DataFrame
    reasons: pd.DataFrame
    settings: Settings = field(default_factory=Settings)

    def __post_init__(self) -> None:
        """Check that the tables hang together."""
        for table in COLUMNS:
            object.__setattr__(self, table, frame(table, getattr(self, table)))
        if "at" not in self.devices.columns:
            inside = self.devices["kind"].isin(["master", "gateway"])
            self.devices["at"] = inside.map({True: _cabinet(self.devices), False: ""})
        faults = list(_faults(self))
        if faults:
            more = f"; and {len(faults) - 10} more" if len(faults) > 10 else ""
            raise ArgumentError(f"design {self.name!r}: {'; '.join(faults[:10])}{more}")

    @classmethod
    def example(cls, *, redundant: bool = False) -> Design:
        """Return a design to follow by hand: two stations with two points each on a Modbus loop.

        A redundant one has a second line on the other side of the ship.
        """
        return example(redundant=redundant)

    def __repr__(self) -> str:
        """Say what it is in one line."""
        return (
            f"<Design {self.name!r}: {int(self.points['fits'].sum())} of {len(self.points)} "
            f"points fit, {len(self.cables)} cables, {self.cables['length_m'].sum():.0f} m>"
        )

    @property
    def fits(self) -> bool:
        """Whether every point is connected within the limits of its bus."""
        return bool(self.points["fits"].all())

    @property
    def worst_response_ms(self) -> float:
        """Longest response of the points that fit [ms]; NaN if none does."""
        return float(self.points.loc[self.points["fits"], "response_ms"].max())

    @property
    def cabinet(self) -> str:
        """Name of the cabinet among the devices."""
        return _cabinet(self.devices)

    @property
    def links(self) -> pd.DataFrame:
        """What holds the design together: a, b and run, for counts of what a failure cuts off."""
        import pandas as pd

        inside = self.devices[self.devices["at"] != ""]
        housed = pd.DataFrame({"a": inside["at"], "b": inside["device"], "run": ""})
        return pd.concat([self.cables[["a", "b", "run"]], housed], ignore_index=True)

    def priced(self, settings: Settings) -> Design:
        """Return the same design under other prices or another time of the host."""
        made = copy(self)  # with the failures, if they are known
        object.__setattr__(made, "settings", settings)
        return made

    def quantities(self) -> Quantities:
        """Return conductors, cable, hours and money, each low, nominal and high."""
        from shipnet.design.costs import quantities

        return quantities(self)

    def bill(self) -> pd.DataFrame:
        """Return what has to be bought and laid: cables by type, devices, channels, glands."""
        from shipnet.design.costs import bill_table

        return bill_table(self)

    def check(
        self, rules: RuleSet | str | PathLike[str] = "DNV", *, host_time: float | None = None
    ) -> Findings:
        """Check the design against class rules; `host_time` [s] is that of the settings if None."""
        from shipnet.design.rules import check

        return check(self, rules, host_time=host_time)

    def failures(self) -> pd.DataFrame:
        """Return what each single failure costs, one row per failure, the worst one first."""
        ranked = self._failures.sort_values("points_lost", ascending=False, kind="stable")
        return ranked.reset_index(drop=True)

    @cached_property
    def _failures(self) -> pd.DataFrame:
        """Every single failure: cables cut and shorted, trays, devices."""
        from shipnet.design.failures import single_failures

        return single_failures(self)

    def lost(
        self,
        *,
        cables: Collection[str] = (),
        devices: Collection[str] = (),
        trays: Collection[str] = (),
    ) -> tuple[str, ...]:
        """Return the tags of the points that several failures at once cost."""
        from shipnet.design.failures import lost

        return lost(self, cables=cables, devices=devices, trays=trays)

    def save(self, folder: str | PathLike[str]) -> None:
        """Write every table as a CSV file, and the settings as TOML, into a folder."""
        to = Path(folder)
        to.mkdir(parents=True, exist_ok=True)
        for table in COLUMNS:
            getattr(self, table).to_csv(to / f"{table}.csv", index=False, lineterminator="\n")
        self.settings.save(to / "settings.toml")

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the design from above: cabinet, devices, points, and the cables between them."""
        from shipnet.design.plot import plot_design

        return plot_design(self, ax=ax)


def _cabinet(devices: pd.DataFrame) -> str:
    names = devices.loc[devices["kind"] == "cabinet", "device"]
    return str(names.iloc[0]) if len(names) else ""


def _faults(design: Design) -> Iterator[str]:
    points, devices, runs = design.points, design.devices, design.cables
    if points["tag"].tolist() != design.iolist.points["tag"].tolist():
        yield "the tags of points are not those of the list, in its order"
    if (devices["kind"] == "cabinet").sum() != 1:
        yield f"there are {(devices['kind'] == 'cabinet').sum()} cabinets; it must be one"
    names = set(devices["device"])
    for what, column in (
        ("device", devices["device"]),
        ("run", runs["run"]),
        ("segment", design.segments["segment"]),
    ):
        yield from (f"{what} {name!r} stands twice" for name in column[column.duplicated()])
    to_point = runs["kind"].isin(["drop", "home run"])
    segments = {"", *design.segments["segment"]}
    for what, values, known in (
        ("bus", points["bus"], set(BUSES)),
        ("device of a point", points["device"], {"", *names}),
        ("segment of a point", points["segment"], segments),
        ("kind of device", devices["kind"], set(DEVICE_KINDS)),
        ("housing of a device", devices["at"], {"", *names}),
        ("segment of a device", devices["segment"], segments),
        ("kind of run", runs["kind"], set(RUN_KINDS)),
        ("line of a run", runs["line"], set(LINES)),
        ("segment of a run", runs["segment"], segments),
        ("end of a run", runs["a"], names),
        ("end of a run", runs.loc[~to_point, "b"], names),
        ("point of a run", runs.loc[to_point, "b"], set(points["tag"])),
    ):
        unknown = values[~values.isin(list(known))].drop_duplicates()
        yield from (f"there is no {what} {value!r}" for value in unknown)
    for row in runs[~(np.isfinite(runs["length_m"]) & (runs["length_m"] >= 0))].itertuples():
        yield f"length of {row.run} is {row.length_m} m; it must be 0 or more"
    for row in runs[(runs["used"] < 0) | (runs["used"] > runs["conductors"])].itertuples():
        yield f"{row.run} uses {row.used} of {row.conductors} conductors"


# A design small enough to be followed by hand: four points, two stations, one Modbus loop

_LIST = """\
tag,system,type,signal,conductors,x_m,y_m,z_m,update_ms,category,note
PS-1,Cooling,DI,contact,2,21,2,4,500,II,low pressure of cooling water
TT-2,Cooling,AI,rtd_3wire,3,24,2,4,1000,II,temperature of cooling water
TT-3,Fuel oil,AI,rtd_3wire,3,41,2,4,1000,II,temperature of fuel oil
LS-4,Bilge,DI,contact,2,44,2,2,1000,I,level in the bilge well
"""


def example(*, redundant: bool = False) -> Design:
    """Return two stations with two points each, on a Modbus loop from the cabinet."""
    iolist = IoList.parse(_LIST, "example")
    tags = list(iolist.points["tag"])
    stations = ["JB1", "JB1", "JB2", "JB2"]
    places = {"cabinet": 0.0, "master": 0.0, "JB1": 22.5, "JB2": 42.5}
    kinds = ["cabinet", "master", "station", "station"]
    lines = {"A": "port", "B": "starboard"} if redundant else {"": "port"}
    trunk = [
        {"run": f"trunk {n}{line}", "cable": "RS485_MARINE", "a": a, "b": b, "segment": "loop 1",
         "kind": "trunk", "route_m": metres, "length_m": metres, "used": 2, "conductors": 2,
         "at_cabinet": n == 1, "line": line, "way": (tray,)}
        for line, tray in lines.items()
        for n, a, b, metres in ((1, "master", "JB1", 45.0), (2, "JB1", "JB2", 26.0))
    ]  # fmt: skip
    drops = [
        {"run": f"drop {tag}", "cable": "MI2P075", "a": station, "b": tag, "segment": "loop 1",
         "kind": "drop", "route_m": 4.0, "length_m": 10.0, "used": wires, "conductors": 4,
         "at_cabinet": False, "line": "", "way": ()}
        for tag, station, wires in zip(tags, stations, iolist.points["conductors"], strict=True)
    ]  # fmt: skip
    return Design(
        "example, redundant" if redundant else "example",
        iolist,
        Site((0.0, 0.0, 4.0)),
        points=frame("points", {
            "tag": tags, "bus": "Modbus RTU", "segment": "loop 1", "device": stations,
            "address": ["1/0", "1/1", "2/0", "2/1"], "response_ms": 180.0, "fits": True,
        }),
        devices=frame("devices", {
            "device": list(places), "kind": kinds, "segment": ["", *["loop 1"] * 3],
            "x_m": list(places.values()), "y_m": 0.0, "z_m": 4.0,
        }),
        cables=frame("cables", trunk + drops),
        segments=frame("segments", [{
            "segment": "loop 1", "bus": "Modbus RTU", "points": 4, "devices": 2,
            "length_m": 71.0, "load": 0.18, "response_ms": 180.0, "slowest_update_ms": 500.0,
        }]),
        reasons=frame("reasons"),
    )  # fmt: skip
