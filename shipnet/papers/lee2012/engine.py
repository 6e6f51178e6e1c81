"""Tables 1 and 3, sections III.1 and IV.1.b: engine, points, wires and converters.

Bore, stroke and the figures in horsepower are from the maker's project guide.
"""

from __future__ import annotations

import re
from math import pi

import numpy as np

from shipnet import datasets
from shipnet.engine.inputs import InputCard
from shipnet.engine.points import CONDITIONS, PT100, PointList, read_points
from shipnet.modbus.electrical import INTERFACES
from shipnet.papers.registry import check, numeric

_TABLE_1 = datasets.read("lee2012_table1_engine.csv").set_index("quantity")

#: Table 1: speed [r/min] and mean effective pressure [bar]; section III.1: cylinders.
SPEED = float(_TABLE_1["value_low"]["speed"])
PRESSURE = float(_TABLE_1["value_low"]["mean_effective_pressure"])
CYLINDERS = 8

#: Power of this engine in the project guide [kW].
_GUIDE = 12640.0

_NAMES = {2: "two-stroke", 4: "four-stroke"}

#: Metric horsepower, 75 kgf m/s [W], which makers call BHP.
_METRIC_HORSEPOWER = 75 * 9.80665


def _volume(cylinders: int = CYLINDERS, strokes: int = 2) -> float:
    """Return the volume that the pistons sweep in the working strokes of one revolution [m3].

    Bore and stroke: MAN B&W, S50MC-C project guide, Fig. 1.02.
    """
    bore, stroke = 0.5, 2.0
    return cylinders * pi / 4 * bore**2 * stroke * 2 / strokes


@numeric("lee2012-005")
def power(
    *, pressure: float = PRESSURE, rate: float = SPEED, cylinders: int = CYLINDERS, strokes: int = 2
) -> float:
    """Power that follows from Table 1 and the size of the cylinders [kW]."""
    return 1e5 * pressure * rate / 60 * _volume(cylinders, strokes) / 1e3


@numeric("lee2012-006")
def speed(*, power: float = _GUIDE, pressure: float = PRESSURE) -> float:
    """Speed that follows from power and mean effective pressure [r/min]."""
    return 60 * 1e3 * power / (1e5 * pressure * _volume())


@numeric("lee2012-007")
def mean_pressure(*, power: float = _GUIDE, rate: float = SPEED) -> float:
    """Mean effective pressure that follows from power and speed [bar]."""
    return 1e3 * power / (rate / 60 * _volume()) / 1e5


@numeric("lee2012-008", per_horsepower_hour=126.0)  # fuel
@numeric("lee2012-010", per_horsepower_hour=0.7)  # cylinder oil, lower bound
@numeric("lee2012-070", per_horsepower_hour=1.1)  # cylinder oil, upper bound
def per_kilowatt_hour(per_horsepower_hour: float) -> float:
    """Consumption per kilowatt hour, from the consumption per metric horsepower hour."""
    return per_horsepower_hour * 1e3 / _METRIC_HORSEPOWER


@numeric("lee2012-011")
def cylinders(*, power_class: float = 13000.0, pressure: float = PRESSURE) -> float:
    """Number of cylinders that the power class requires."""
    return power_class / power(pressure=pressure, cylinders=1)


@check("lee2012-009", counter={"printed": "kg/cyl.24h"})
def unit_is_known(
    *, printed: str = _TABLE_1["unit_printed"]["lubricating_oil_consumption"]
) -> bool:
    """Whether the unit contains no symbols other than kg, h and cyl."""
    return set(re.findall("[a-z]+", printed)) <= {"kg", "h", "cyl"}


@check("lee2012-071", counter={"called": "two-stroke"})
def called_after_its_strokes(*, called: str = "two-stage") -> bool:
    """Whether the name gives the number of strokes whose computed power is closest to 13 MW."""
    powers = {strokes: 1e3 * power(strokes=strokes) for strokes in _NAMES}
    fits = min(powers, key=lambda strokes: abs(powers[strokes] - 13e6))
    return called == _NAMES[fits]


# Points, wires and converters ------------------------------------------------------------------

#: Table 3 as printed, with numbers converted.
TABLE_3 = datasets.read("lee2012_table3_sensors.csv").astype({"quantity_points": int})

#: The row of Table 3 that may be a duplicate of the next one.
_DOUBLE_ROW = "2"


def printed_points(*, double_row: bool = True) -> PointList:
    """Return the 99 points of Table 3, or 89 without its possible duplicate row.

    The next row is kept: its current loops measure the exhaust gas temperature in section IV.1.b.
    """
    rows = datasets.read("synthetic_iolist_engine.csv")["printed_row"].astype(str)
    points = zip(read_points(), rows, strict=True)
    return PointList(point for point, row in points if double_row or row != _DOUBLE_ROW)


@numeric("lee2012-013", column="jb", value="JB1")
@numeric("lee2012-014", column="jb", value="JB2")
@numeric("lee2012-015", column="jb", value="JB3")
@numeric("lee2012-018", column="condition", value="S/W")
def listed_points(*, column: str, value: str) -> int:
    """Number of points in the rows of Table 3 that have this value in this column."""
    return int(TABLE_3.loc[TABLE_3[column] == value, "quantity_points"].sum())


@numeric("lee2012-016", analogue=False)
@numeric("lee2012-017", analogue=True)
def number_of_points(*, analogue: bool, double_row: bool = True) -> int:
    """Number of points, or of the analogue ones."""
    return sum(p.analogue or not analogue for p in printed_points(double_row=double_row))


@numeric("lee2012-012")
def junction_boxes(*, with_current_loops: bool = False) -> int:
    """Number of junction boxes in Table 3: all of them, or only those with 4-20 mA inputs."""
    boxes = read_points().by_box().values()
    return sum(
        any(p.condition == CONDITIONS[1] for p in points) or not with_current_loops
        for points in boxes
    )


@numeric("lee2012-086")
def modes(*, boxes: tuple[str, ...] = ("JB1", "JB2", "JB3")) -> int:
    """Number of different input sets of these boxes; a common box design needs a mode for each."""
    by_box = read_points().by_box()
    return len({tuple((p.condition, p.low, p.high) for p in by_box[box]) for box in boxes})


@numeric("lee2012-087")
def converter_kinds(*, analogue_only: bool = False) -> int:
    """Number of kinds of signal, each of which needs its own kind of converter."""
    return len({p.condition for p in read_points() if p.analogue or not analogue_only})


@numeric("lee2012-019")
def hardwired_conductors() -> int:
    """Conductors from the boxes to the AMS if every sensor is wired separately."""
    return read_points().saving.hardwired


@check("lee2012-065", counter={"wired": 9})
def buses_need_less(*, wired: int = 0) -> bool:
    """Whether the two buses need fewer conductors than separately wired sensors."""
    saving = read_points().saving
    return saving.bus < (wired or saving.hardwired)


def conductors_by_cylinders(cylinders: range = range(4, 9)) -> list[int]:
    """Return the conductors of a hardwired engine for each number of cylinders."""
    points = read_points()
    return [
        PointList(p for p in points if p.cylinder is None or p.cylinder <= n).saving.hardwired
        for n in cylinders
    ]


@check("lee2012-063", counter={"wiring": (100, 200, 400, 800)})
def grows_geometrically(*, wiring: tuple[int, ...] = ()) -> bool:
    """Whether each further cylinder adds more wires than the one before."""
    steps = np.diff(wiring or conductors_by_cylinders())
    return bool((steps[1:] > steps[:-1]).all())


@check("lee2012-048", condition="RTD", inputs=32, counter={"inputs": 26})
@check("lee2012-049", condition="4-20 mA", inputs=18, counter={"inputs": 16})
def enough_inputs(*, condition: str, inputs: int) -> bool:
    """Whether this many converter inputs are enough for every box's sensors of one kind."""
    boxes = read_points().by_box().values()
    return max(sum(point.condition == condition for point in points) for points in boxes) <= inputs


@check("lee2012-050", counter={"low": 0.0})
def one_resistor_fits(*, low: float = 1.0, high: float = 5.0) -> bool:
    """Whether one resistor converts 4-20 mA into `low` to `high` [V]."""
    return bool(np.isclose(low / 4e-3, high / 20e-3))


@check("lee2012-104", counter={"stretched": 2.0})
def thermometers_cover_the_ranges(*, stretched: float = 1.0) -> float:
    """Margin within which a Pt100 covers all its ranges, each `stretched` by this factor."""
    points = [p for p in read_points() if p.condition == "RTD"]
    ends = min(p.low for p in points), max(p.high for p in points)
    return min(1 - stretched * end / limit for end, limit in zip(ends, PT100, strict=True))


@check("lee2012-088", counter={"offset": False})
def amplifier_fills_the_range(*, offset: bool = True, low: float = 1.0, high: float = 5.0) -> bool:
    """Whether an amplifier, with or without an offset, maps `low` to `high` [V] onto 0 to 5 V."""
    gain, shift = (5.0 / (high - low), low) if offset else (5.0 / high, 0.0)
    return bool(np.allclose(gain * (np.array([low, high]) - shift), [0, 5]))


@numeric("lee2012-051")
def adc_step() -> float:
    """Step of the converter [mV]."""
    return 1e3 * InputCard(read_points()).step


@check("lee2012-092", counter={"poles": 1})
def switch_selects_the_mode(*, poles: int = 3) -> bool:
    """Whether an on/off switch with this many poles has a setting for each mode."""
    return bool(2**poles >= modes())


@check("lee2012-093", counter={"printed": "High"})
def is_a_kind_of_switch(*, printed: str = "") -> bool:
    """Whether another box has a switch of the type that is printed for JB3."""
    switches = TABLE_3[TABLE_3["condition"] == "S/W"]
    last = switches.iloc[-1]
    others = switches.loc[switches["jb"] != last["jb"], "type_printed"]
    return (printed or last["type_printed"]) in set(others)


@check("lee2012-042", counter={"printed": "RS-485"})
def interface_exists(*, printed: str = "RS-482") -> bool:
    """Whether an interface of this name exists."""
    return printed in INTERFACES
