"""Tables 1 to 3 and the frames of Fig 4 as printed, with our values beside the printed ones."""

from __future__ import annotations

from collections.abc import Iterable

from shipnet import datasets
from shipnet.engine.inputs import InputCard
from shipnet.engine.points import PointList, read_points
from shipnet.fields import check_choice
from shipnet.lazy import pd
from shipnet.modbus.pdu import FunctionCode
from shipnet.papers.lee2012 import buses, engine

#: The data file of each table.
_FILES = {
    "Table 1": "lee2012_table1_engine.csv",
    "Table 2": "lee2012_table2_modbus.csv",
    "Table 3": "lee2012_table3_sensors.csv",
    "Fig 4": "lee2012_fig4_frames.csv",
}


def table(item: str) -> pd.DataFrame:
    """Return a table as printed, our values beside it, and ``*`` in the rows that differ."""
    rows = datasets.read(_FILES[check_choice("item", item, _FILES)])
    if item == "Table 1":
        units = ["" if unit in ("", "rpm", "bar") else f" {unit}" for unit in rows["unit_printed"]]
        return _beside(rows, rows["value_printed"] + units, _engine())
    if item == "Table 2":
        return _beside(rows, rows["cell_printed"], _modbus())
    if item == "Fig 4":
        frames = rows.rename(columns={"field_printed": "label_printed"})
        return _beside(frames, frames["width_printed"], _frames()).set_index("frame")
    return _sensors(rows)


def _beside(rows: pd.DataFrame, printed: pd.Series, ours: Iterable[str]) -> pd.DataFrame:
    shown = pd.DataFrame({"as printed": rows["label_printed"], "": printed, "ours": list(ours)})
    if "frame" in rows:
        shown.insert(0, "frame", rows["frame"].map({"request": "(a)", "response": "(b)"}))
    differs = (shown["ours"] != "") & (shown["ours"] != shown[""])
    return shown.assign(differs=["*" if one else "" for one in differs])


def _engine() -> list[str]:
    low, high = (engine.per_kilowatt_hour(grams) for grams in (0.7, 1.1))
    numbers = [f"{engine.speed():.0f}", f"{engine.mean_pressure():.1f}"]
    fuel = f"{engine.per_kilowatt_hour(126.0):.0f} g/kWh"
    return ["", *numbers, fuel, "4-5 kg/cyl.24h", f"{low:.2f}-{high:.1f} g/kWh"]


def _modbus() -> list[str]:
    data, parity, stop = buses.LINE.character
    function = FunctionCode.READ_HOLDING_REGISTERS
    name = function.name.replace("_", " ").capitalize()
    words = [f"{buses.LINE.bit_rate:g} bps", data, {"E": "Even"}[parity], stop]
    slaves = [f"{unit:02d} (JB #{box})" for unit, box in ((buses.JB1, 1), (buses.JB3, 3))]
    return ["", "", *words, f"{function:02d} ({name})", "a master has no address", *slaves]


def _frames() -> list[str]:
    """Return the widths of the standard's fields; the response has one register."""
    request, response = buses.read(1).rtu(buses.JB1), buses.answer(1).rtu(buses.JB1)
    count = buses.byte_count_width()
    widths = [1, 1, 2, 2, len(request) - 6], [1, 1, count, response[2], len(response) - 5]
    start = f"≥{buses.LINE.t35 / buses.LINE.character_time:g} char"
    ours = [w for frame in widths for w in (start, *(f"{n} byte{'s' * (n > 1)}" for n in frame))]
    ours[7] += ", of the slave"
    return ours


def _sensors(rows: pd.DataFrame) -> pd.DataFrame:
    shown = rows[["jb", "condition", "type_printed", "quantity_points", "range_printed"]].copy()
    shown.columns = ["", "Condition", "Type", "Q'TY", "Range"]
    names = {"temperature": "Temp.", "pressure": "Press.", "low": "Low", "high": "High"}
    shown["type, meant"] = rows["type"].map(names)
    listed = datasets.read("synthetic_iolist_engine.csv")["printed_row"].astype(str)
    steps = []
    for row, unit in zip(rows["printed_row"].astype(str), rows["range_unit"], strict=True):
        points = PointList(p for p, r in zip(read_points(), listed, strict=True) if r == row)
        largest = "" if unit == "logic" else InputCard(points).accuracy()["step_high"].max()
        steps.append(f"{largest:.2g} {unit}" if largest else "1 bit")
    shown["largest ADC step"] = steps
    differs = shown["type, meant"] != shown["Type"]
    return shown.assign(differs=["*" if one else "" for one in differs]).set_index("")
