"""One way to connect the points of an I/O list: devices, the cables between them, segments.

The planners make such a network, hardwired or on a bus; quantities, rules and comparisons read it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from shipnet.errors import ArgumentError

if TYPE_CHECKING:
    import pandas as pd

    from shipnet.design.iolist import IoList
    from shipnet.design.site import Site

__all__ = ["BUSES", "COLUMNS", "DEVICE_KINDS", "LINES", "RUN_KINDS", "Network", "frame"]

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
        "runs": {
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
    """Return one of a network's tables, with its columns in order and of their types.

    Parameters
    ----------
    table : {"points", "devices", "runs", "segments", "reasons"}
        Which one.
    rows : iterable of dict, mapping of columns or pandas.DataFrame, optional
        What stands in it; further columns stay behind those that the table must have.

    Returns
    -------
    pandas.DataFrame
        The table, numbered from 0.

    Raises
    ------
    ArgumentError
        If there is no such table, a column is missing, or a value is not of its type.

    Examples
    --------
    >>> frame("reasons").columns.tolist()
    ['subject', 'limit', 'value', 'bound', 'unit', 'text']
    """
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
class Network:
    """One way to connect the points of an I/O list.

    Parameters
    ----------
    name : str
        What the design is called, such as ``"home runs"``.
    iolist : IoList
        The points.
    site : Site
        Where the cabinet is, and how cables get from place to place.
    points : pandas.DataFrame
        Row i is point i of the list: tag, bus (one of `BUSES`), segment, device (what the point's
        own cable ends at), address (as the bus calls it), response_ms (from a change at the sensor
        to the host, at worst; 0 if hardwired, where nothing lies between), fits.
    devices : pandas.DataFrame
        device (a name of its own), kind (one of `DEVICE_KINDS`), segment, x_m, y_m, z_m (NaN where
        the list gives no place), at (the device in whose housing it stands, empty if in one of its
        own). One of them is the cabinet. Without a column `at`, masters and gateways stand in it.
    runs : pandas.DataFrame
        One row a cable: run (a name of its own), cable (a key of `shipnet.design.catalogue`), a, b
        (devices; the `b` of a drop or home run is a point's tag), segment, kind (one of
        `RUN_KINDS`), route_m (NaN where the list gives the length itself), length_m, used and
        conductors (in use, and in the cable), at_cabinet, line (one of `LINES`), way (names of the
        trays, empty without trays).
    segments : pandas.DataFrame
        segment, bus, points, devices, length_m (of its trunk), load (0..1 if it can work),
        response_ms, slowest_update_ms (what its most urgent point needs); a bus adds columns.
    reasons : pandas.DataFrame
        Why something does not fit: subject (segment, tag or bus), limit (its name), value, bound,
        unit, text (one sentence). Empty if all fits.

    Raises
    ------
    ArgumentError
        If the tables do not fit each other; all that is wrong is named.

    Examples
    --------
    Two contacts, each with a cable of its own:

    >>> from types import SimpleNamespace
    >>> import pandas as pd
    >>> tags = ["PS-1", "PS-2"]
    >>> network = Network(
    ...     "home runs",
    ...     SimpleNamespace(points=pd.DataFrame({"tag": tags})),
    ...     site=None,
    ...     points=frame("points", [
    ...         {"tag": tag, "bus": "hardwired", "segment": "", "device": "cabinet",
    ...          "address": "", "response_ms": 0.0, "fits": True} for tag in tags]),
    ...     devices=frame("devices", [
    ...         {"device": "cabinet", "kind": "cabinet", "segment": "",
    ...          "x_m": 0.0, "y_m": 0.0, "z_m": 0.0}]),
    ...     runs=frame("runs", [
    ...         {"run": f"home run {tag}", "cable": "MI1P075", "a": "cabinet", "b": tag,
    ...          "segment": "", "kind": "home run", "route_m": 20.0, "length_m": 28.0,
    ...          "used": 2, "conductors": 2, "at_cabinet": True, "line": "", "way": ()}
    ...         for tag in tags]),
    ...     segments=frame("segments"),
    ...     reasons=frame("reasons"),
    ... )
    >>> network
    <Network 'home runs': 2 of 2 points fit, 2 cables, 56 m>
    >>> network.fits, network.worst_response_ms
    (True, 0.0)
    """

    name: str
    iolist: IoList
    site: Site
    points: pd.DataFrame
    devices: pd.DataFrame
    runs: pd.DataFrame
    segments: pd.DataFrame
    reasons: pd.DataFrame

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
            raise ArgumentError(f"network {self.name!r}: {'; '.join(faults[:10])}{more}")

    def __repr__(self) -> str:
        """Say what it is in one line."""
        return (
            f"<Network {self.name!r}: {int(self.points['fits'].sum())} of {len(self.points)} "
            f"points fit, {len(self.runs)} cables, {self.runs['length_m'].sum():.0f} m>"
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
        """What holds the network together: a, b and run, for counts of what a failure cuts off.

        One row a cable, and one for each device that stands in the housing of another, whose `run`
        is empty. Points are named by their tags.
        """
        import pandas as pd

        inside = self.devices[self.devices["at"] != ""]
        housed = pd.DataFrame({"a": inside["at"], "b": inside["device"], "run": ""})
        return pd.concat([self.runs[["a", "b", "run"]], housed], ignore_index=True)


def _cabinet(devices: pd.DataFrame) -> str:
    names = devices.loc[devices["kind"] == "cabinet", "device"]
    return str(names.iloc[0]) if len(names) else ""


def _faults(network: Network) -> Iterator[str]:
    points, devices, runs = network.points, network.devices, network.runs
    if points["tag"].tolist() != network.iolist.points["tag"].tolist():
        yield "the tags of points are not those of the list, in its order"
    if (devices["kind"] == "cabinet").sum() != 1:
        yield f"there are {(devices['kind'] == 'cabinet').sum()} cabinets; it must be one"
    names = set(devices["device"])
    for what, column in (
        ("device", devices["device"]),
        ("run", runs["run"]),
        ("segment", network.segments["segment"]),
    ):
        yield from (f"{what} {name!r} stands twice" for name in column[column.duplicated()])
    to_point = runs["kind"].isin(["drop", "home run"])
    segments = {"", *network.segments["segment"]}
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
