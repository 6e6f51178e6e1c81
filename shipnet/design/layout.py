"""The position of a design's cabinet, the lengths of its cables, and its tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from shipnet.arrays import Floats
from shipnet.design.points import PointTable, axes_at
from shipnet.design.settings import Settings
from shipnet.errors import ArgumentError
from shipnet.fields import check_fields, number, record
from shipnet.lazy import pd

#: A position on board [m]: x forward, y to port, z up, relative to the list's origin.
Place = tuple[float, float, float]


@record(eq=False)
class Site:
    """The position of the cabinet, and the allowances in cable lengths."""

    cabinet: Place
    detour: float = number(1, 10, "", "Laid length as a multiple of the route", default=1.15)
    tails: float = number(0, 1000, "m", "Length for both ends of a cable", default=5.0)

    def __post_init__(self) -> None:
        check_fields(self)
        cabinet = _places("cabinet", self.cabinet)
        if cabinet.ndim != 1 or np.isnan(cabinet).any():
            raise ArgumentError(f"cabinet is {self.cabinet!r}; it must be three finite numbers")
        object.__setattr__(self, "cabinet", tuple(cabinet.tolist()))

    def length(self, route: ArrayLike) -> Floats:
        """Return the length of cable needed for a route [m]."""
        return self.detour * np.asarray(route, dtype=float) + self.tails

    def route(self, a: ArrayLike, b: ArrayLike) -> Floats:
        """Return the lengths of routes between positions, parallel to the ship's axes [m]."""
        return np.asarray(np.abs(_places("a", a) - _places("b", b)).sum(axis=-1))


def _places(name: str, values: ArrayLike) -> Floats:
    """Return positions as an array (..., 3), or raise ArgumentError."""
    try:
        places = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        places = np.zeros(0)
    if places.shape[-1:] != (3,):
        raise ArgumentError(f"{name} is {values!r}; it must be an array of shape (..., 3)")
    if np.isinf(places).any():
        raise ArgumentError(f"{name} has an infinite coordinate; each must be finite or NaN")
    return places


# The position of the cabinet, inferred from the lengths of home runs -----------------------------

#: Minimum number of points with a position and a length: three for the coordinates, one to check.
_FEWEST = 4

#: Positions per axis in the first and in later searches, and number of best positions kept.
_FIRST, _NEXT, _KEPT = 15, 5, 25

#: Half-width below which the search stops, and maximum rounding error of a length [m].
_CLOSE, _ROUNDED = 0.02, 0.2


#: A position [m] as numbers or text, such as "FR 40, DK3, P 6", a site, or None to infer it from
#: the list's cable lengths.
Where: TypeAlias = "tuple[float, float, float] | Sequence[float] | str | Site | None"


class Found(NamedTuple):
    """The position of a cabinet, inferred from cable lengths."""

    place: tuple[float, float, float]
    misfit: float
    points: int
    settled: bool

    def __str__(self) -> str:
        x, y, z = self.place
        text = (
            f"the cabinet is assumed to be at {x:g}, {y:g}, {z:g} m, from the cable lengths of "
            f"{self.points} points, half of which agree within {max(self.misfit, 0.1):.1f} m"
        )
        return text if self.settled else f"{text}; other positions fit too: give the correct one"


def find_cabinet(iolist: PointTable, *, detour: float = 1.15, tails: float = 5.0) -> Found:
    """Infer the position of the cabinet from home runs of known length."""
    from scipy.spatial.distance import cdist  # slow to import, and used only here

    length = iolist.points["home_run_m"].to_numpy(float)
    measured = np.isfinite(length) & iolist.located
    if measured.sum() < _FEWEST:
        raise ArgumentError(
            f"{measured.sum()} points of {iolist.source} have a position and a length to the "
            f"cabinet; {_FEWEST} are needed to find the cabinet"
        )
    places, lengths = iolist.places[measured], length[measured]

    def off(cabinets: Floats) -> Floats:
        return np.asarray(np.abs(detour * cdist(cabinets, places, "cityblock") + tails - lengths))

    # There are many local minima: search the whole ship, then refine around the best positions.
    centres = places.mean(axis=0, keepdims=True)
    reach, count = float(np.ptp(places, axis=0).max()) / 2 + 1.0, _FIRST
    while reach > _CLOSE:
        steps = np.stack(np.meshgrid(*3 * [np.linspace(-reach, reach, count)]), axis=-1)
        tried = (centres[:, None] + steps.reshape(-1, 3)).reshape(-1, 3)
        scale = max(reach / count, _ROUNDED)
        loss = np.log1p((off(tried) / scale) ** 2).sum(axis=-1)
        centres = tried[loss.argsort(kind="stable")[:_KEPT]]
        reach, count = reach * (2 / count), _NEXT
    x, y, z = (round(float(value), 1) + 0.0 for value in centres[0])
    cabinet = np.array([x, y, z])
    misfits = off(cabinet[None])[0]
    # A coordinate of the cabinet is determined if there are points on both sides of it.
    side = places[misfits <= max(float(np.median(misfits)), _ROUNDED)] - cabinet
    held = ((side < -_ROUNDED).any(axis=0)) & ((side > _ROUNDED).any(axis=0))
    flat = np.ptp(places, axis=0) < _ROUNDED
    settled = bool((~held).sum() <= 1 and not (flat & ~held).any())
    return Found((x, y, z), float(np.median(misfits)), int(measured.sum()), settled)


def site_of(iolist: PointTable, cabinet: Where, settings: Settings) -> tuple[Site, str]:
    """Return the site of a list, and a remark if `cabinet` is None, otherwise ""."""
    if isinstance(cabinet, Site):
        return cabinet, ""
    position, remark = cabinet, ""
    if isinstance(cabinet, str):
        reading = iolist.words if iolist.words.frames else settings.reading
        axes = axes_at(reading, {"location": cabinet}, ("x_m", "z_m"))
        try:
            x, y, z = map(float, cabinet.replace(";", ",").split(","))
            position = Site((x, y, z)).cabinet
        except ValueError:
            if isinstance(axes, str):
                raise ArgumentError(
                    f"cabinet is {cabinet!r}; it must be three numbers x, y, z in m, such as "
                    "26,6,14, or a frame, a deck and a side of the list or the settings, such as "
                    "FR 40, DK3, P 6"
                ) from None
            position = axes["x_m"], axes.get("y_m", 0.0), axes["z_m"]
    elif cabinet is None:
        position, remark = (0.0, 0.0, 0.0), "the list gives every cable length to the cabinet"
        if lost := int(iolist.points["home_run_m"].isna().sum()):
            remark = f"{lost} of {len(iolist)} points have neither a position nor a length"
        if iolist.located.any() or np.isfinite(iolist.box_places).any():
            try:
                fit = find_cabinet(iolist)
            except ArgumentError as mistake:
                raise ArgumentError(
                    f"cabinet is not given, and {mistake}; give its position x, y, z in m, such "
                    "as 26,6,14"
                ) from None
            position, remark = fit.place, str(fit)
    return Site(position, settings.detour, settings.tails), remark  # type: ignore[arg-type]


# The tables of a design: points, devices, cables, segments, and reasons -----------------------

#: Columns of each table, with their types; a table may have more columns.
_TABLES = {
    "points": "tag bus segment device address response_ms:float fits:bool",
    "devices": "device kind segment x_m:float y_m:float z_m:float",
    "cables": "run cable a b segment kind route_m:float length_m:float used:int conductors:int "
    "at_cabinet:bool line",
    "segments": "segment bus points:int devices:int length_m:float bus_time:float "
    "capacity_used:float response_ms:float slowest_update_ms:float",
    "reasons": "subject limit value:float bound:float unit text",
}
_DTYPES: Mapping[str, Any] = {"": object, "float": float, "int": np.int64, "bool": bool}
COLUMNS: Mapping[str, Mapping[str, Any]] = {
    table: {name: _DTYPES[kind] for name, _, kind in (c.partition(":") for c in columns.split())}
    for table, columns in _TABLES.items()
}


def frame(table: str, rows: Any = ()) -> pd.DataFrame:
    """Return a table of a design with its columns in order and converted to their types."""
    types = COLUMNS[table]
    if not isinstance(rows, pd.DataFrame | Mapping):
        rows = list(rows)
        more = dict.fromkeys(name for row in rows for name in row if name not in types)
        rows = {name: [row[name] for row in rows] for name in types} | {
            name: [row.get(name, np.nan) for row in rows] for name in more
        }
    if not isinstance(rows, pd.DataFrame):
        # Each column gets its type at once: to convert pandas' own strings later is slow.
        index = pd.RangeIndex(len(rows[next(iter(types))]))
        rows = {name: pd.Series(rows[name], index, types.get(name)) for name in rows}
    made = pd.DataFrame(rows).reset_index(drop=True)
    order = [*types, *(column for column in made.columns if column not in types)]
    made = made if order == [*made.columns] else made[order]
    wrong = {column: kind for column, kind in types.items() if made[column].dtype != kind}
    return made.astype(wrong) if wrong else made


#: The points on a trunk of a box, as (tag, signal, conductors) in the order of the cores. Those of
#: a later list follow those of the earlier ones, or replace one that was removed; a place without a
#: point has no tag.
Strip: TypeAlias = Sequence[Sequence[tuple[str, str, int]]]


@dataclass(frozen=True, eq=False)
class Layout:
    """The tables of a design; `Design` adds the values computed from them."""

    name: str
    iolist: PointTable
    site: Site
    points: pd.DataFrame
    devices: pd.DataFrame
    cables: pd.DataFrame
    segments: pd.DataFrame
    reasons: pd.DataFrame
    settings: Settings = field(default_factory=Settings)
    #: The points on each trunk of a box.
    strips: Mapping[str, Strip] = field(default_factory=dict)
    #: The earlier design whose boxes, channels and cables this one keeps.
    previous: Layout | None = None

    def __post_init__(self) -> None:
        for table in COLUMNS:
            object.__setattr__(self, table, frame(table, getattr(self, table)))
        if "at" not in self.devices.columns:
            inside = self.devices["kind"] == "master"
            self.devices["at"] = inside.map({True: self.cabinet, False: ""})
        if "line" not in self.devices.columns:
            self.devices["line"] = ""

    def __repr__(self) -> str:
        fit, length = int(self.points["fits"].sum()), self.cables["length_m"].sum()
        return (
            f"<{type(self).__name__} {self.name!r}: {fit} of {len(self.points)} points fit, "
            f"{len(self.cables)} cables, {length:.0f} m>"
        )

    @property
    def fits(self) -> bool:
        """Whether every point is connected within the limits of its bus."""
        return bool(self.points["fits"].all())

    @property
    def connected(self) -> bool:
        """Whether any point is connected; True for a list without points."""
        return self.points.empty or bool((self.points["bus"] != "").any())

    @property
    def worst_response_ms(self) -> float:
        """Longest response of the points that fit [ms]; NaN if no point fits."""
        return float(self.points.loc[self.points["fits"], "response_ms"].max())

    @property
    def cabinet(self) -> str:
        """Name of the cabinet among the devices, or "" if there is none."""
        names = self.devices.loc[self.devices["kind"] == "cabinet", "device"]
        return str(names.iloc[0]) if len(names) else ""
