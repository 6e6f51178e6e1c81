"""Tables 1 to 3 and the frames of Fig 4 as printed, with our values beside the printed ones."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TypeAlias

from shipnet import datasets
from shipnet.engine.inputs import InputCard
from shipnet.engine.points import PointList, read_points
from shipnet.fields import check_choice
from shipnet.lazy import pd
from shipnet.modbus.pdu import FunctionCode
from shipnet.papers.lee2012 import buses, engine
from shipnet.papers.registry import REGISTRY

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
    compute = {"Table 1": _engine, "Table 2": _modbus, "Table 3": _sensors, "Fig 4": _frames}
    printed, compared, ours = compute[item](rows)
    pairs = zip(ours, compared, strict=True)
    marks = ["" if value in ("", cell) else "*" for value, cell in pairs]
    return printed.assign(ours=ours, differs=marks).set_index(printed.columns[0])


#: The printed columns, the column that is compared, and our values for it.
Beside: TypeAlias = tuple[pd.DataFrame, Iterable[str], Sequence[str]]


def _engine(rows: pd.DataFrame) -> Beside:
    cells = rows["value_printed"] + [f" {u}" if "/" in u else "" for u in rows["unit_printed"]]
    fuel, low, high = (REGISTRY[claim]() for claim in ("lee2012-008", "lee2012-010", "lee2012-070"))
    oil = rows.set_index("quantity").loc["lubricating_oil_consumption"]
    ours = ["", f"{engine.speed():.0f}", f"{engine.mean_pressure():.1f}", f"{fuel:.0f} g/kWh"]
    unit = oil.unit_printed.replace("crl", "cyl")
    ours += [f"{oil.value_low}-{oil.value_high} {unit}", f"{low:.2f}-{high:.1f} g/kWh"]
    return pd.DataFrame({"quantity": rows["label_printed"], "as printed": cells}), cells, ours


def _modbus(rows: pd.DataFrame) -> Beside:
    function = FunctionCode.READ_HOLDING_REGISTERS
    name = f"{function:02d} ({function.name.replace('_', ' ').capitalize()})"
    # Our line takes its settings from the table, so only the rows below them are compared.
    ours = [*[""] * 6, name, "no address"]
    ours += [f"{unit:02d} (JB #{box})" for unit, box in ((buses.JB1, 1), (buses.JB3, 3))]
    printed = rows[["label_printed", "cell_printed"]].set_axis(["item", "as printed"], axis=1)
    return printed, rows["cell_printed"], ours


def _frames(rows: pd.DataFrame) -> Beside:
    # The standard's fields; the response has one register.
    widths = [1, 1, 2, 2, 2, 1, 1, buses.byte_count_width(), buses.data_width(), 2]
    texts = [f"{width} byte" if width == 1 else f"{width} bytes" for width in widths]
    start = f"≥{buses.silent_characters():g} char"
    ours = [start, *texts[:5], start, f"{texts[5]}, of the slave", *texts[6:]]
    names = {"request": "(a) request", "response": "(b) response"}
    printed = pd.DataFrame({"frame": rows["frame"].map(names), "field": rows["field_printed"]})
    return printed.assign(width=rows["width_printed"]), rows["width_printed"], ours


def _sensors(rows: pd.DataFrame) -> Beside:
    listed = datasets.read("synthetic_iolist_engine.csv")["printed_row"].astype(str)
    steps = []
    for row, unit in zip(rows["printed_row"].astype(str), rows["range_unit"], strict=True):
        points = PointList(p for p, r in zip(read_points(), listed, strict=True) if r == row)
        largest = 0.0 if unit == "logic" else InputCard(points).accuracy()["step_high"].max()
        steps.append(f"{largest:.2g} {unit}" if largest else "1 bit")
    printed = rows[["jb", "condition", "type_printed", "quantity_points", "range_printed"]]
    heads = ["box", "Condition", "Type", "Q'TY", "Range"]
    names = {"temperature": "Temp.", "pressure": "Press.", "low": "Low", "high": "High"}
    types = [names[kind] for kind in rows["type"]]
    return printed.set_axis(heads, axis=1).assign(step=steps), rows["type_printed"], types
