"""How fast 20 000 points are loaded and checked, compared with plain loops over the rows."""

import csv
import math
import tempfile
from pathlib import Path

import numpy as np
from _timing import seconds
from openpyxl import load_workbook

from shipnet import datasets
from shipnet.design.iolist import read_iolist
from shipnet.design.points import RANGES
from shipnet.signals import KINDS, SIGNALS

POINTS = 20_000


def enlarged(folder):
    """Repeat the rows of the example ship to get POINTS points; write them as CSV and workbook."""
    points = read_iolist(datasets.path("synthetic_iolist_ship.csv")).points
    rows = np.arange(POINTS) % len(points)
    large = points.iloc[rows].reset_index(drop=True)
    large["tag"] += [f"/{number}" for number in np.arange(POINTS) // len(points)]
    large.to_csv(folder / "list.csv", index=False)
    large.to_excel(folder / "list.xlsx", index=False)
    return large


def row_by_row(path):
    """Check a CSV file with our column names as a script would, with one dictionary per row."""
    faults, first, boxes = [], {}, {}
    with path.open(newline="", encoding="utf-8") as stream:
        for number, row in enumerate(csv.DictReader(stream), start=2):
            row = {name: cell.strip() for name, cell in row.items()}
            if not row["tag"] or not row["tag"].isprintable():
                faults.append((number, "tag"))
            if first.setdefault(row["tag"].casefold(), number) != number:
                faults.append((number, "tag"))
            signal = SIGNALS.get(row["signal"])
            if signal is None or row["type"] not in KINDS or signal.kind != row["type"]:
                faults.append((number, "signal"))
            elif int(row["conductors"]) != signal.conductors:
                faults.append((number, "conductors"))
            values = {}
            for name, (low, high) in RANGES.items():
                try:
                    values[name] = float(row[name]) if row[name] else math.nan
                except ValueError:
                    faults.append((number, name))
                    continue
                if not (math.isnan(values[name]) or low <= values[name] <= high):
                    faults.append((number, name))
            here = [values[name] for name in ("x_m", "y_m", "z_m")]
            box = tuple(values[name] for name in ("box_x_m", "box_y_m", "box_z_m"))
            if any(map(math.isnan, here)) and math.isnan(values["home_run_m"]):
                faults.append((number, "x_m"))
            if row["box"] and boxes.setdefault(row["box"], box) != box:
                faults.append((number, "box"))
            if values["to_box_m"] < math.dist(here, box) - 0.2:
                faults.append((number, "to_box_m"))
            if row["category"] not in ("", "I", "II", "III") or not row["update_ms"]:
                faults.append((number, "category"))
    return faults


def by_openpyxl(path):
    """Read the rows of a workbook, unchecked, in the fastest way that openpyxl offers."""
    book = load_workbook(path, read_only=True, data_only=True)
    rows = list(book.worksheets[0].iter_rows(values_only=True))
    book.close()
    return rows


def main():
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        large = enlarged(folder)
        assert row_by_row(folder / "list.csv") == []
        iolist = read_iolist(folder / "list.csv")
        assert iolist.points.equals(large)
        assert read_iolist(folder / "list.xlsx").points.equals(large)
        assert len(by_openpyxl(folder / "list.xlsx")) == POINTS + 1
        times = {
            "CSV, ours": seconds(lambda: read_iolist(folder / "list.csv")),
            "CSV, csv.DictReader": seconds(lambda: row_by_row(folder / "list.csv")),
            "workbook, ours": seconds(lambda: read_iolist(folder / "list.xlsx")),
            "workbook, openpyxl, not checked": seconds(
                lambda: by_openpyxl(folder / "list.xlsx"), 1
            ),
            "CSV, saved": seconds(lambda: iolist.save(folder / "again.csv")),
        }
        print(f"{f'{POINTS} points loaded and checked':<32}{'seconds':>10}")
        for what, time in times.items():
            print(f"{what:<32}{time:>10.3f}")
        ratio = times["CSV, csv.DictReader"] / times["CSV, ours"]
        print(f"CSV: shipnet is {ratio:.2f}x as fast as the loop")
        ratio = times["workbook, openpyxl, not checked"] / times["workbook, ours"]
        print(f"workbook: shipnet is {ratio:.2f}x as fast as openpyxl")


if __name__ == "__main__":
    main()
