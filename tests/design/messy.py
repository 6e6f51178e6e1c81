"""A messy I/O list as a yard might write it; synthetic, not of a real ship.

Page headers, titles in two rows and two languages, subtitles, groups whose system is given once,
decimal commas, units in cells, wide digits, places by frame and deck, marks, notes and a footer.
"""

import csv
import io

import numpy as np

#: The list's own words, and its frames and decks, as lines of a settings file.
SETTINGS = """\
[columns]
"KKS code" = "tag"
"Bemerkung" = "note"

[signals]
"GS" = "contact"
"TIT" = "rtd_3wire"

[frames]
0 = 0.0
30 = 18.0
180 = 138.0

[decks]
DK1 = 15.0
DK2 = 11.5
DK3 = 8.0
TANKTOP = 1.8
"""

TITLES = (
    "KKS code|System\n계통|I/O 구분|Signal / 신호|Cores|Location|||Cable length|Scan [ms]".split(
        "|"
    )
)
TITLES.append("Bemerkung")
SECOND = ["", "", "", "", "", "Frame", "Deck", "P/S", "[m]", "", ""]

KINDS = [
    tuple(kind.split("|"))
    for kind in """\
DI|접점|2;DI|GS|;DI|NAMUR|;DI|LIMIT SW|2;DO|24VDC out|2;DO|솔레노이드|;AI|4~20mA 2W|;AI|PT100 3W|3
AI|TIT|;AI|TC-K|;AI|0-10V|;AO|4-20mA out|2;AI|HART|;AI|4-20mA 4W|4""".replace("\n", ";").split(";")
]

#: Faulty rows by the number of the point: the column of the cell, and its content.
FAULTY = {
    int(number): (int(column), cell)
    for number, column, cell in (
        fault.split("|")
        for fault in """\
17|8|12,5 ft;40|3|GIZMO;73|2|XX;110|5|FR 999;150|8|-4;199|4|two;230|6|DK9;260|9|0;301|7|Q 3
333|8|1,5,0;380|0|;420|3|PT 1O0;470|8|20000;512|4|7;555|2|AO;600|9|soon;655|5|FR x;700|0|B-0001
811|3|4-20 kA;920|9|-1""".replace("\n", ";").split(";")
    )
}


def rows(n=1000, faulty=True):
    """Return the rows of the sheet, the expected point for each correct tag, and the bad rows.

    The expected points are computed here from the same numbers, not read by the package.
    """
    rng = np.random.default_rng(20)
    sheet = [["HULL 1234  I/O LIST"], ["Doc. 77-A", "", "", "Rev. C"], [], TITLES, SECOND]
    expected, bad, system = {}, [], None
    for number in range(n):
        if number % 125 == 0:
            system = f"System {number // 125 + 1}"
            sheet += [[], [f"* {system} *"]]
            first = True
        if number % 90 == 89:
            sheet += [["Page", f"{number // 90 + 1} of 12"], TITLES]
        kind, word, cores = KINDS[number % len(KINDS)]
        frame, deck = int(rng.integers(0, 170)), ("DK1", "DK2", "DK3", "TANKTOP")[number % 4]
        off, y = int(rng.integers(0, 6)) * 100, round(float(rng.uniform(-9, 9)), 1)
        length = round(float(rng.uniform(60, 240)), 1)
        tag = f"B-{number + 1:04d}"
        frame_of, side = f"FR {frame}{f'+{off}' * (off > 0)}", "P" if y > 0 else "S"
        wide = "".join(chr(ord(c) + 0xFEE0) for c in f"{length:.1f}")
        long = (f"{length:.1f}".replace(".", ","), f"{length:.1f} m", wide)[number % 3]
        cells = [tag, system if first else "", kind, word, cores, frame_of, deck]
        cells += [f"{side} {abs(y):.1f}" if y else "CL", long, "1000" if number % 5 else "500", ""]
        first = False
        if faulty and number in FAULTY:
            place, cell = FAULTY[number]
            cells[place] = cell
            bad.append(len(sheet) + 1)
        else:
            x = float(np.interp(frame, [0, 30, 180], [0, 18, 138])) + off / 1e3
            z = {"DK1": 15.0, "DK2": 11.5, "DK3": 8.0, "TANKTOP": 1.8}[deck]
            expected[tag] = (system, kind, x, y, z, length)
        sheet.append(cells)
        if number % 200 == 150:
            sheet.append([f"X-{number}", "", "DI", "접점", "", "", "", "", "30", "", "DELETED"])
            sheet.append(["SPARE", "", "DI", "", "", "", "", "", "", "", ""])
    sheet += [[], ["Note: all lengths are estimates."], ["Checked:", "", "Kim", "", "", "Date:"]]
    return sheet, expected, bad


def as_csv(sheet, encoding="cp949"):
    """Return the sheet as Korean Excel saves it."""
    stream = io.StringIO()
    csv.writer(stream, delimiter=";", lineterminator="\r\n").writerows(sheet)
    return stream.getvalue().encode(encoding)


def as_workbook(sheet, path, hidden=(), struck=(), places=()):
    """Write the sheet after a cover sheet, with some rows hidden and some struck out.

    `places` contains further sheets: their names and rows.
    """
    import openpyxl
    from openpyxl.styles import Font

    book = openpyxl.Workbook()
    book.active.title = "Cover"
    book.active.append(["I/O list of hull 1234"])
    book.active.append(["Tag", "Signal"])
    own = book.create_sheet("IO list rev C")
    for number, cells in enumerate(sheet, 1):
        for place, cell in enumerate(cells, 1):
            if cell:
                own.cell(number, place, cell)
    for number in hidden:
        own.row_dimensions[number].hidden = True
    for number in struck:
        for cell in own[number]:
            cell.font = Font(strike=True)
    for name, rows_of_places in places:
        further = book.create_sheet(name)
        for cells in rows_of_places:
            further.append(cells)
    book.save(path)
