"""Seven synthetic I/O lists as yards of several countries might write them, and their truth.

None is of a real ship. The truth is computed here, not read by the package.
"""

import csv
import io

import numpy as np
import openpyxl
from openpyxl.styles import Font

FRAMES, DECKS = {0: 0.0, 40: 28.0, 160: 124.0}, {"A": 14.0, "B": 10.5, "C": 7.0, "TT": 1.5}

#: Signals of the points, each with its type.
KINDS = {"contact": "DI", "namur": "DI", "solenoid": "DO", "rtd_3wire": "AI",
         "current_loop": "AI", "thermocouple": "AI", "serial": "AI"}  # fmt: skip


def truth(n=84, seed=5):
    """Return the points by tag, with all that a list may say of them."""
    rng, points = np.random.default_rng(seed), {}
    for number in range(n):
        frame, deck = int(rng.integers(0, 160)), list(DECKS)[number % 4]
        points[f"P{number + 101}"] = {
            "system": f"System {number // 12 + 1}", "box": f"JB{number // 6 + 1}",
            "signal": list(KINDS)[number % 7], "frame": frame, "deck": deck,
            "x_m": round(float(np.interp(frame, [*FRAMES], [*FRAMES.values()])), 3),
            "y_m": round(float(rng.integers(-90, 91)) / 10, 1), "z_m": DECKS[deck],
            "home_run_m": round(float(rng.integers(200, 2400)) / 10, 1),
            "update_ms": [250.0, 500.0, 1000.0, 2000.0][number % 4],
        }  # fmt: skip
    return points


def comma(value):
    """Return a number with a decimal comma, as a German or Norwegian spreadsheet shows it."""
    return f"{value:.10g}".replace(".", ",")


def text(rows, delimiter, encoding):
    stream = io.StringIO()
    csv.writer(stream, delimiter=delimiter, lineterminator="\r\n").writerows(rows)
    return stream.getvalue().encode(encoding)


def workbook(rows, *sheets, struck=(), merged=()):
    """Return a workbook of a cover, the list, and further sheets; `struck` are (row, column)."""
    book = openpyxl.Workbook()
    book.active.title = "Cover"
    book.active.append(["I/O list, synthetic"])
    for name, content in (("List", rows), *sheets):
        sheet = book.create_sheet(name)
        for row in content:
            sheet.append(list(row))
    for row, column in struck:
        book["List"].cell(row, column).font = Font(strike=True)
    for area in merged:
        book["List"].merge_cells(area)
    stream = io.BytesIO()
    book.save(stream)
    return stream.getvalue()


def once(values):
    """Return values with blanks where one repeats the one before it."""
    return [v if n == 0 or v != values[n - 1] else "" for n, v in enumerate(values)]


def hamburg(points):
    """German CSV: mapped titles with units, decimal commas, ditto marks, subtitles."""
    words = {"contact": "Schließer", "namur": "NAMUR NJ2", "solenoid": "Magnetventil 24VDC",
             "rtd_3wire": "PT100 3W", "current_loop": "4-20 mA", "thermocouple": "Thermoelement",
             "serial": "Modbus RTU"}  # fmt: skip
    rows = [["Neubau 812", "", "", "Rev. D"], [],
            ["Messstelle", "Anlage", "Klemmenkasten", "Geber", "X FROM AP (mm)", "Y (cm)", "Z [m]",
             "Kabellänge", "Zyklus (s)", "Bemerkung"]]  # fmt: skip
    system, box = None, None
    for tag, p in points.items():
        if p["system"] != system:
            rows.append([f"--- {p['system']} ---"])
        rows.append([
            tag, '"' if p["system"] == system else p["system"],
            "dto." if p["box"] == box else p["box"], words[p["signal"]],
            f"{1000 * p['x_m']:.0f}", comma(100 * p["y_m"]), comma(p["z_m"]),
            f"{comma(p['home_run_m'])} m", comma(p["update_ms"] / 1000), "",
        ])  # fmt: skip
        system, box = p["system"], p["box"]
    rows.append(["P900", "Anlage X", "JB1", "Schließer", "1", "1", "1", "1", "1", "entfällt"])
    settings = '[columns]\n"X FROM AP (mm)" = "x_m"\n"Zyklus (s)" = "update_ms"\n'
    return "csv", text(rows, ";", "cp1252"), settings, 1


def bremen(points):
    """German workbook: titles in two rows, most of them in the lower one; merged systems."""
    upper = ["Tag", "System", "JB", "", "", "Position", "", "", "", ""]
    lower = ["", "", "", "Type", "Signal", "X [m]", "Y", "Z", "Cable length", "Scan [ms]"]
    rows = [["HULL 4711"], upper, lower]
    systems = [p["system"] for p in points.values()]
    merged, first = [], 0
    for number in range(1, len(systems) + 1):
        if number == len(systems) or systems[number] != systems[first]:
            merged.append(f"B{first + 4}:B{number + 3}")
            first = number
    for tag, p in points.items():
        rows.append([tag, p["system"], p["box"], KINDS[p["signal"]], p["signal"], p["x_m"],
                     p["y_m"], p["z_m"], p["home_run_m"], p["update_ms"]])  # fmt: skip
    return "xlsx", workbook(rows, merged=merged), "", 0


def stavanger(points):
    """Norwegian workbook: frames and decks one below the other, boxes once per group, 3.1(S)."""
    rows = [["TAG nr", "Anlegg", "Koblingsboks", "Signal", "Spant", "Dekk", "P/S", "Kabellengde",
             "Syklustid [s]", "Merknad"]]  # fmt: skip
    boxes = once([p["box"] for p in points.values()])
    for (tag, p), box in zip(points.items(), boxes, strict=True):
        side = f"{abs(p['y_m']):.1f}({'P' if p['y_m'] > 0 else 'S'})" if p["y_m"] else "CL"
        rows.append([tag, p["system"], box, p["signal"], p["frame"], p["deck"], side,
                     p["home_run_m"], p["update_ms"] / 1000, ""])  # fmt: skip
    rows.append(["P901", "Anlegg X", "JB1", "contact", 5, "A", "CL", 3, 1, "slettet"])
    frames = [[frame, 1000 * x] for frame, x in FRAMES.items()]
    places = [["Frames and decks"], ["Frame", "X from AP [mm]"], *frames, ["Spacing varies"], [],
              ["Deck", "Height above BL [m]"], *map(list, DECKS.items())]  # fmt: skip
    return "xlsx", workbook(rows, ("Geometry", places)), "", 1


def ulsan(points):
    """Korean CSV: Korean words, wide digits, ditto marks, and units in cells."""
    words = {"contact": "무전압 접점", "namur": "나무르", "solenoid": "SOL. V/V 24VDC",
             "rtd_3wire": "PT100 3W", "current_loop": "4~20mA", "thermocouple": "K형 열전대",
             "serial": "통신"}  # fmt: skip
    rows = [["태그번호", "계통", "정션박스", "신호", "위치 X", "위치 Y", "위치 Z", "케이블 길이",
             "주기", "비고"]]  # fmt: skip
    system, box = None, None
    for tag, p in points.items():
        length = "".join(chr(ord(c) + 0xFEE0) for c in f"{p['home_run_m']:.1f}")
        rows.append([
            tag, "상동" if p["system"] == system else p["system"],
            "〃" if p["box"] == box else p["box"], words[p["signal"]], f"{p['x_m']}m", p["y_m"],
            f"{1000 * p['z_m']:g}mm", length, f"{p['update_ms'] / 1000:g} s", "",
        ])  # fmt: skip
        system, box = p["system"], p["box"]
    rows.insert(9, ["P902", "상동", "〃", "무전압 접점", 1, 1, 1, 1, "1 s", "삭제"])
    return "csv", text(rows, ",", "cp949"), "", 1


def repair(points):
    """Workbook of a repair yard: struck tags, notes that a point is gone, a dash as tag."""
    rows = [
        ["Item", "Tag", "System", "JB", "Signal", "X", "Y", "Z", "Cable length", "Scan", "Remark"]
    ]
    struck = []
    for number, (tag, p) in enumerate(points.items()):
        cells = [p["system"], p["box"], p["signal"], p["x_m"], p["y_m"], p["z_m"], p["home_run_m"],
                 p["update_ms"]]  # fmt: skip
        rows.append([number + 1, tag, *cells, ""])
        if number % 20 == 0:
            rows.append(["", f"OLD{number}", *cells, ""])
            struck.append((len(rows), 2))
        if number % 20 == 5:
            rows.append([number + 1, f"GONE{number}", *cells, "deleted, not fitted"])
        if number % 20 == 10:
            rows.append([number + 1, "-", *cells, ""])
    return "xlsx", workbook(rows, struck=struck), "", len(rows) - 1 - len(points)


def gdansk(points):
    """Tab-separated UTF-16: a distance from the centre line beside the side, and types SER."""
    rows = [["Tag", "System", "Junction box", "I/O type", "Signal", "Frame", "Deck", "Side",
             "Dist. from CL [cm]", "Cable length", "Scan [ms]"]]  # fmt: skip
    for tag, p in points.items():
        kind = "SER" if p["signal"] == "serial" else KINDS[p["signal"]]
        signal = "" if p["signal"] == "serial" else p["signal"]
        side = "P" if p["y_m"] > 0 else "S" if p["y_m"] else "CL"
        cells = [tag, p["system"], p["box"], kind, signal, f"FR {p['frame']}", p["deck"], side]
        rows.append([*cells, f"{abs(100 * p['y_m']):g}", p["home_run_m"], f"{p['update_ms']:g}"])
    frames = "".join(f"{frame} = {x}\n" for frame, x in FRAMES.items())
    decks = "".join(f"{deck} = {z}\n" for deck, z in DECKS.items())
    return "csv", text(rows, "\t", "utf-16"), f"[frames]\n{frames}[decks]\n{decks}", 0


def shanghai(points):
    """Workbook: frames and decks side by side, systems once per group, a location in one cell."""
    rows = [["Tag no.", "System", "JB no", "Signal", "Location", "Cable length [m]", "Scan time"]]
    systems = once([p["system"] for p in points.values()])
    for (tag, p), system in zip(points.items(), systems, strict=True):
        side = f"{'P' if p['y_m'] > 0 else 'S'} {abs(p['y_m'])}" if p["y_m"] else "CL"
        rows.append([tag, system, p["box"], p["signal"], f"FR{p['frame']} / {p['deck']} / {side}",
                     p["home_run_m"], p["update_ms"]])  # fmt: skip
    both = [["Frame", "x [m]", "", "Deck", "z [m]"]]
    for number in range(4):
        frame = [*list(FRAMES.items())[number]] if number < 3 else ["", ""]
        both.append([*frame, "", *list(DECKS.items())[number]])
    return "xlsx", workbook(rows, ("Frames", both)), "", 0


YARDS = (hamburg, bremen, stavanger, ulsan, repair, gdansk, shanghai)
