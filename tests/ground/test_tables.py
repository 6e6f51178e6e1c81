import datetime
import sys
import zipfile
from io import BytesIO

import openpyxl
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shipnet import datasets
from shipnet.design.iolist import IoList, read_iolist
from shipnet.errors import InputError
from shipnet.files import read_bytes
from shipnet.tables import parse_sheet, read_sheet

LIST = [
    ["Tag No.", "I/O", "Signal type", "X [m]", "Y [m]", "Z [m]", "Update [s]"],
    ["LS-1", "DI", "limit switch", 1.5, 2, 3, 0.5],
    [1001, "AI", "4-20 mA", -1, 0, 2.25, 1],
]


def workbook(path, *sheets):
    book = openpyxl.Workbook()
    book.remove(book.active)
    for title, rows in sheets:
        sheet = book.create_sheet(title)
        for row in rows:
            sheet.append(row)
    book.save(path)
    book.close()
    return path


def test_a_workbook_gives_the_points_in_its_cells(tmp_path):
    heading = [["Project", "Hull 1234"], [], ["Revision", datetime.date(2026, 1, 2)]]
    path = workbook(tmp_path / "list.xlsx", ("Cover", heading), ("Points", heading + LIST))
    points = read_iolist(path).points
    assert points["tag"].tolist() == ["LS-1", "1001"]
    assert points[["x_m", "y_m", "z_m"]].values.tolist() == [[1.5, 2, 3], [-1, 0, 2.25]]
    assert points["update_ms"].tolist() == [500, 1000]
    assert read_iolist(path, sheet="Points").points.equals(points)
    # The name of the file does not matter.
    (tmp_path / "list.csv").write_bytes(path.read_bytes())
    assert read_iolist(tmp_path / "list.csv").points.equals(points)


def test_the_example_ship_is_the_same_from_a_workbook(tmp_path):
    ship = read_iolist(datasets.path("synthetic_iolist_ship.csv")).points
    rows = [list(ship.columns), *ship.astype(object).where(ship.notna(), None).values.tolist()]
    path = workbook(tmp_path / "ship.xlsx", ("ship", rows))
    assert read_iolist(path).points.equals(ship)
    assert IoList.from_table(ship).points.equals(ship)


def test_dates_errors_booleans_and_formulas_without_values_are_faults(tmp_path):
    rows = [
        LIST[0],
        ["LS-1", "DI", "contact", datetime.datetime(1905, 7, 2), True, 3, "1,5"],
        ["LS-2", "DI", "contact", "=A1", 2, "#REF!", 1],  # openpyxl saves no value of a formula
    ]
    path = workbook(tmp_path / "list.xlsx", ("list", rows))
    with pytest.raises(InputError) as error:
        read_iolist(path)
    assert error.value.faults == (
        "row 2, column X [m] (D): '1905-07-02 00:00:00', a date or a time; expected a number "
        "-1000..1000 m",
        "row 2, column Y [m] (E): 'True', true or false; expected a number -1000..1000 m",
        "row 3, column X [m] (D): '=', a formula without a saved value; expected a number "
        "-1000..1000 m",
        "row 3, column Z [m] (F): '#REF!', an error; expected a number -1000..1000 m",
    )


def test_missing_sheets_are_named(tmp_path):
    path = workbook(tmp_path / "list.xlsx", ("Cover", [["x"]]), ("Points", LIST))
    with pytest.raises(InputError, match="has no sheet 'points'; it has Cover, Points"):
        read_iolist(path, sheet="points")
    with pytest.raises(InputError, match=r"has no row of titles .*, on the sheet Cover"):
        read_iolist(path, sheet="Cover")
    with pytest.raises(InputError, match="has no sheet 'a'; expected an Excel workbook"):
        read_iolist(datasets.path("synthetic_iolist_ship.csv"), sheet="a")


def test_a_workbook_without_openpyxl_says_what_to_install(tmp_path, monkeypatch):
    path = workbook(tmp_path / "list.xlsx", ("Points", LIST))
    monkeypatch.setitem(sys.modules, "openpyxl", None)
    with pytest.raises(InputError, match="install openpyxl to read it, or save it as CSV"):
        read_iolist(path)


def archive(**files):
    stream = BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as book:
        for name, data in files.items():
            book.writestr(name, data)
    return stream.getvalue()


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"PK\x03\x04 and no more", "is not an Excel workbook"),
        (archive(mimetype="application/vnd.oasis.opendocument"), "is not an Excel workbook"),
        (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1 old", r"is an old Excel file \(.xls\)"),
        (b"\x00\x01\x02", "contains zero bytes"),
        (bytes(2**24 + 1), "is larger than 16777216 bytes"),
    ],
    ids=["torn", "ods", "xls", "binary", "large"],
)
def test_files_that_are_not_tables_are_refused(data, message, tmp_path):
    path = tmp_path / "list.xlsx"
    path.write_bytes(data)
    with pytest.raises(InputError, match=message):
        read_sheet(path)


def test_files_that_cannot_be_read_are_named(tmp_path):
    for path in (tmp_path, tmp_path / "none.csv", "a\0b"):
        with pytest.raises(InputError, match="cannot be read"):
            read_bytes(path)


shares = st.floats(0, 1)


@given(st.integers(0, 20), shares, shares, st.binary(max_size=6), shares)
@settings(max_examples=80)
def test_a_broken_workbook_gives_a_sheet_or_an_input_error(
    tmp_path_factory, part, start, stop, new, end
):
    path = tmp_path_factory.getbasetemp() / "broken.xlsx"
    with zipfile.ZipFile(workbook(path, ("Points", LIST))) as book:
        parts = {name: book.read(name) for name in book.namelist()}
    part = sorted(parts)[part % len(parts)]
    # A few bytes of one part are replaced, or the end of the file is lost.
    whole, place = parts[part], round(start * len(parts[part]))
    parts[part] = whole[:place] + new + whole[place + round(6 * stop) :]
    data = archive(**parts)
    path.write_bytes(data[: len(data) if end > 0.2 else round(5 * end * len(data))])
    try:
        assert read_sheet(path).titles
    except InputError as error:
        assert "\n" not in str(error)


def test_cells_with_line_breaks_do_not_shift_the_rows():
    sheet = parse_sheet('a,"long\ntitle"\n1,"x\ny"\n\n2,3\n')
    assert sheet.titles == ("a", "long title")
    assert sheet.rows == [(2, ["1", "x\ny"]), (4, ["2", "3"])]


def test_the_separator_is_the_one_that_makes_titles():
    for separator in ",;\t":
        line = separator.join
        sheet = parse_sheet(f"{line('abc')}\n{line('123')}")
        assert (sheet.titles, sheet.separator) == (("a", "b", "c"), separator)
    assert parse_sheet("a,b;c,d;e", is_titles=lambda cells: "c,d" in cells).separator == ";"


def test_a_hidden_sheet_is_read_only_by_its_name(tmp_path):
    old = [LIST[0], ["OLD-1", *LIST[1][1:]]]
    path = workbook(tmp_path / "list.xlsx", ("Rev A", old), ("Rev B", LIST))
    book = openpyxl.load_workbook(path)
    book["Rev A"].sheet_state = "hidden"
    book.save(path)
    assert read_iolist(path).points["tag"].tolist() == ["LS-1", "1001"]
    assert read_iolist(path, sheet="Rev A").points["tag"].tolist() == ["OLD-1"]
    book["Rev B"].sheet_state = "hidden"
    del book["Rev A"]
    book.create_sheet("Cover").append(["Hull 1234"])
    book.save(path)
    with pytest.raises(
        InputError, match=r"the sheets Cover; hidden sheets, which are read only if named: Rev B$"
    ):
        read_iolist(path)


def test_other_sheets_with_such_a_table_are_reported(tmp_path):
    other = [LIST[0], ["FO-1", *LIST[1][1:]]]
    path = workbook(
        tmp_path / "list.xlsx",
        ("Cover", [["Hull 1234"]]),
        ("Bilge", LIST),
        ("Fuel", [[], *other]),
        ("Cargo", other),
    )
    iolist = read_iolist(path)
    assert iolist.remarks == ("read: sheet Bilge; not read: Cover, Fuel, Cargo",)
    assert read_iolist(path, sheet="Fuel").remarks == ()
    assert read_iolist(path, sheet="Fuel").points["tag"].tolist() == ["FO-1"]
