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
KINDS = {"contact": "DI", "namur": "DI", "solenoid": "DO"}
KINDS |= dict.fromkeys(("rtd_3wire", "current_loop", "thermocouple", "serial"), "AI")


def truth(n=84, seed=5):
    """Return the points by tag, with all that a list may say of them."""
    rng, points = np.random.default_rng(seed), {}
    for number in range(n):
        frame, deck = int(rng.integers(0, 160)), list(DECKS)[number % 4]
        point = {"system": f"System {number // 12 + 1}", "box": f"JB{number // 6 + 1}"}
        point |= {"signal": list(KINDS)[number % 7], "frame": frame, "deck": deck}
        point["x_m"] = round(float(np.interp(frame, [*FRAMES], [*FRAMES.values()])), 3)
        point |= {"y_m": round(float(rng.integers(-90, 91)) / 10, 1), "z_m": DECKS[deck]}
        point["home_run_m"] = round(float(rng.integers(200, 2400)) / 10, 1)
        points[f"P{number + 101}"] = point | {"update_ms": 250.0 * 2 ** (number % 4)}
    return points


def cells(line):
    """Return the cells of a row that is written with bars between them."""
    return line.split("|")


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


def numbers(p):
    """Return the place, the length of the home run and the update time of a point."""
    return [p[name] for name in ("x_m", "y_m", "z_m", "home_run_m", "update_ms")]


def once(values):
    """Return values with blanks where one repeats the one before it."""
    return [v if n == 0 or v != values[n - 1] else "" for n, v in enumerate(values)]


def hamburg(points):
    """German CSV: mapped titles with units, decimal commas, ditto marks, subtitles."""
    names = "Schließer|NAMUR NJ2|Magnetventil 24VDC|PT100 3W|4-20 mA|Thermoelement|Modbus RTU"
    titles = (
        "Messstelle|Anlage|Klemmenkasten|Geber|X FROM AP (mm)|Y (cm)|Z [m]|Kabellänge|Zyklus (s)"
    )
    words = dict(zip(KINDS, cells(names), strict=True))
    rows = [["Neubau 812", "", "", "Rev. D"], [], cells(titles + "|Bemerkung")]
    system, box = None, None
    for tag, p in points.items():
        if p["system"] != system:
            rows.append([f"--- {p['system']} ---"])
        same = [
            '"' if p["system"] == system else p["system"],
            "dto." if p["box"] == box else p["box"],
        ]
        position = [f"{1000 * p['x_m']:.0f}", comma(100 * p["y_m"]), comma(p["z_m"])]
        lengths = [f"{comma(p['home_run_m'])} m", comma(p["update_ms"] / 1000)]
        rows.append([tag, *same, words[p["signal"]], *position, *lengths, ""])
        system, box = p["system"], p["box"]
    rows.append(cells("P900|Anlage X|JB1|Schließer|1|1|1|1|1|entfällt"))
    settings = '[columns]\n"X FROM AP (mm)" = "x_m"\n"Zyklus (s)" = "update_ms"\n'
    return "csv", text(rows, ";", "cp1252"), settings, 1


def bremen(points):
    """German workbook: titles in two rows, most of them in the lower one; merged systems."""
    upper = cells("Tag|System|JB|||Position||||")
    lower = cells("|||Type|Signal|X [m]|Y|Z|Cable length|Scan [ms]")
    rows, systems = [["HULL 4711"], upper, lower], [p["system"] for p in points.values()]
    merged, first = [], 0
    for number in range(1, len(systems) + 1):
        if number == len(systems) or systems[number] != systems[first]:
            merged.append(f"B{first + 4}:B{number + 3}")
            first = number
    for tag, p in points.items():
        rows.append([tag, p["system"], p["box"], KINDS[p["signal"]], p["signal"], *numbers(p)])
    return "xlsx", workbook(rows, merged=merged), "", 0


def stavanger(points):
    """Norwegian workbook: frames and decks one below the other, boxes once per group, 3.1(S)."""
    titles = "TAG nr|Anlegg|Koblingsboks|Signal|Spant|Dekk|P/S|Kabellengde|Syklustid [s]|Merknad"
    rows, boxes = [cells(titles)], once([p["box"] for p in points.values()])
    for (tag, p), box in zip(points.items(), boxes, strict=True):
        side = f"{abs(p['y_m']):.1f}({'P' if p['y_m'] > 0 else 'S'})" if p["y_m"] else "CL"
        position = [p["frame"], p["deck"], side, p["home_run_m"], p["update_ms"] / 1000, ""]
        rows.append([tag, p["system"], box, p["signal"], *position])
    rows.append(["P901", "Anlegg X", "JB1", "contact", 5, "A", "CL", 3, 1, "slettet"])
    frames = [["Frame", "X from AP [mm]"], *([frame, 1000 * x] for frame, x in FRAMES.items())]
    decks = [["Deck", "Height above BL [m]"], *map(list, DECKS.items())]
    places = [["Frames and decks"], *frames, ["Spacing varies"], [], *decks]
    return "xlsx", workbook(rows, ("Geometry", places)), "", 1


def ulsan(points):
    """Korean CSV: Korean words, wide digits, ditto marks, and units in cells."""
    names = "무전압 접점|나무르|SOL. V/V 24VDC|PT100 3W|4~20mA|K형 열전대|통신"
    words = dict(zip(KINDS, cells(names), strict=True))
    titles = "태그번호|계통|정션박스|신호|위치 X|위치 Y|위치 Z|케이블 길이|주기|비고"
    rows, system, box = [cells(titles)], None, None
    for tag, p in points.items():
        length = "".join(chr(ord(c) + 0xFEE0) for c in f"{p['home_run_m']:.1f}")
        same = [
            "상동" if p["system"] == system else p["system"],
            "〃" if p["box"] == box else p["box"],
        ]
        position = [f"{p['x_m']}m", p["y_m"], f"{1000 * p['z_m']:g}mm"]
        rows.append(
            [tag, *same, words[p["signal"]], *position, length, f"{p['update_ms'] / 1000:g} s", ""]
        )
        system, box = p["system"], p["box"]
    rows.insert(9, cells("P902|상동|〃|무전압 접점|1|1|1|1|1 s|삭제"))
    return "csv", text(rows, ",", "cp949"), "", 1


def repair(points):
    """Workbook of a repair yard: struck tags, notes that a point is gone, a dash as tag."""
    rows, struck = [cells("Item|Tag|System|JB|Signal|X|Y|Z|Cable length|Scan|Remark")], []
    for number, (tag, p) in enumerate(points.items()):
        shared = [p["system"], p["box"], p["signal"], *numbers(p)]
        rows.append([number + 1, tag, *shared, ""])
        if number % 20 == 0:
            rows.append(["", f"OLD{number}", *shared, ""])
            struck.append((len(rows), 2))
        if number % 20 == 5:
            rows.append([number + 1, f"GONE{number}", *shared, "deleted, not fitted"])
        if number % 20 == 10:
            rows.append([number + 1, "-", *shared, ""])
    return "xlsx", workbook(rows, struck=struck), "", len(rows) - 1 - len(points)


def gdansk(points):
    """Tab-separated UTF-16: a distance from the centre line beside the side, and types SER."""
    titles = (
        "Tag|System|Junction box|I/O type|Signal|Frame|Deck|Side|Dist. from CL [cm]|Cable length"
    )
    rows = [cells(titles + "|Scan [ms]")]
    for tag, p in points.items():
        serial, side = p["signal"] == "serial", "P" if p["y_m"] > 0 else "S" if p["y_m"] else "CL"
        signal = ["SER", ""] if serial else [KINDS[p["signal"]], p["signal"]]
        position = [
            f"FR {p['frame']}",
            p["deck"],
            side,
            f"{abs(100 * p['y_m']):g}",
            p["home_run_m"],
        ]
        rows.append([tag, p["system"], p["box"], *signal, *position, f"{p['update_ms']:g}"])
    frames = "".join(f"{frame} = {x}\n" for frame, x in FRAMES.items())
    decks = "".join(f"{deck} = {z}\n" for deck, z in DECKS.items())
    return "csv", text(rows, "\t", "utf-16"), f"[frames]\n{frames}[decks]\n{decks}", 0


def shanghai(points):
    """Workbook: frames and decks side by side, systems once per group, a location in one cell."""
    rows = [cells("Tag no.|System|JB no|Signal|Location|Cable length [m]|Scan time")]
    systems = once([p["system"] for p in points.values()])
    for (tag, p), system in zip(points.items(), systems, strict=True):
        side = f"{'P' if p['y_m'] > 0 else 'S'} {abs(p['y_m'])}" if p["y_m"] else "CL"
        position = f"FR{p['frame']} / {p['deck']} / {side}"
        rows.append([tag, system, p["box"], p["signal"], position, p["home_run_m"], p["update_ms"]])
    both = [["Frame", "x [m]", "", "Deck", "z [m]"]]
    for number in range(4):
        frame = [*list(FRAMES.items())[number]] if number < 3 else ["", ""]
        both.append([*frame, "", *list(DECKS.items())[number]])
    return "xlsx", workbook(rows, ("Frames", both)), "", 0


YARDS = (hamburg, bremen, stavanger, ulsan, repair, gdansk, shanghai)
