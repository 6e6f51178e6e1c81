"""Excel workbooks: what their cells become, and malformed files."""

import tracemalloc
import zipfile
from io import BytesIO

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from shipnet import tables
from shipnet.errors import InputError
from shipnet.tables import _opened

MAIN = "http://schemas.openxmlformats.org/spreadsheetml/2006/main"
OFFICE = "http://schemas.openxmlformats.org/officeDocument/2006/relationships"
CONTENT = "http://schemas.openxmlformats.org/package/2006/content-types"
TYPE = "application/vnd.openxmlformats-officedocument.spreadsheetml.{}+xml"
PACKAGE = "http://schemas.openxmlformats.org/package/2006/relationships"

DATE, TRUTH, ERROR = "a date or a time", "true or false", "an error"
WORDS = "a number with words beside it"


def relations(**targets):
    """Return the part that says what another part refers to."""
    rows = (
        f'<Relationship Id="{name}" Type="{OFFICE}/{kind}" Target="{target}"/>'
        for name, (kind, target) in targets.items()
    )
    return f'<Relationships xmlns="{PACKAGE}">{"".join(rows)}</Relationships>'


def parts(*sheets, strings="", styles="", settings=""):
    """Return the parts of a workbook whose sheets S1, S2, .. hold these rows."""
    numbered = list(enumerate(sheets, start=1))
    own = {f"r{n}": ("worksheet", f"worksheets/sheet{n}.xml") for n, _ in numbered}
    shared = {"t": ("sharedStrings", "sharedStrings.xml"), "f": ("styles", "styles.xml")}
    listed = "".join(f'<sheet name="S{n}" sheetId="{n}" r:id="r{n}"/>' for n, _ in numbered)
    kinds = {"/xl/workbook.xml": "sheet.main"} | {
        f"/xl/worksheets/sheet{n}.xml": "worksheet" for n, _ in numbered
    }
    types = "".join(
        f'<Override PartName="{k}" ContentType="{TYPE.format(v)}"/>'
        for k, v in (
            kinds | {"/xl/sharedStrings.xml": "sharedStrings", "/xl/styles.xml": "styles"}
        ).items()
    )
    return {
        "[Content_Types].xml": f'<Types xmlns="{CONTENT}">{types}</Types>',
        "_rels/.rels": relations(a=("officeDocument", "xl/workbook.xml")),
        "xl/_rels/workbook.xml.rels": relations(**own, **shared),
        "xl/workbook.xml": f'<workbook xmlns="{MAIN}" xmlns:r="{OFFICE}">{settings}'
        f"<sheets>{listed}</sheets></workbook>",
        "xl/sharedStrings.xml": f'<sst xmlns="{MAIN}">{strings}</sst>',
        "xl/styles.xml": f'<styleSheet xmlns="{MAIN}">{styles}</styleSheet>',
    } | {
        f"xl/worksheets/sheet{n}.xml": f'<worksheet xmlns="{MAIN}"><dimension ref="A1"/>'
        f"<sheetData>{rows}</sheetData></worksheet>"
        for n, rows in numbered
    }


def packed(content, method=zipfile.ZIP_DEFLATED):
    stream = BytesIO()
    with zipfile.ZipFile(stream, "w", method) as archive:
        for name, data in content.items():
            archive.writestr(name, data)
    return stream.getvalue()


def read(data, title="S1"):
    """Return number, cells and oddities of the rows of a sheet."""
    with _opened(data, "workbook") as book:
        return [tuple(row) for row in book.rows(title)]


def rows(*sheets, **more):
    """Return number, cells and oddities of the rows of the first sheet."""
    return read(packed(parts(*sheets, **more)))


def one(cell, **more):
    """Return text and oddity of the only cell of a sheet."""
    ((_, (text,), odd),) = rows(f"<row r='1'>{cell}</row>", **more)
    return text, odd.get(0, "")


def test_rows_keep_the_numbers_that_excel_shows():
    row = "<row r='{0}'><c r='B{0}'><v>{0}</v></c></row>".format
    assert rows(row(3) + "<row r='5'/>" + row(9)) == [(3, ["", "3"], {}), (9, ["", "9"], {})]
    # Some programs number neither rows nor cells.
    assert rows("<row><c><v>1</v></c><c/><c><v>3</v></c></row><row><c><v>4</v></c></row>") == [
        (1, ["1", "", "3"], {}),
        (2, ["4"], {}),
    ]


@pytest.mark.parametrize(
    ("cell", "text", "odd"),
    [
        ("<c><f>A2+1</f><v>2.5</v></c>", "2.5", ""),
        ("<c t='str'><f>A2&amp;B2</f><v>LS-1</v></c>", "LS-1", ""),
        ("<c t='b'><f>A2=1</f><v>1</v></c>", "True", TRUTH),
        ("<c t='e'><f>NA()</f><v>#N/A</v></c>", "#N/A", ERROR),
        ("<c t='e'><v>#SPILL!</v></c>", "#SPILL!", ERROR),
        ("<c t='str'><f>TEXT(A2,0)</f><v>#REF!</v></c>", "#REF!", ERROR),
        ("<c><f>1/0</f></c>", "=", "a formula without a saved value"),
        ("<c><f>1/0</f><v/></c>", "=", "a formula without a saved value"),
        ("<c t='str'><f>A2</f><v/></c>", "", ""),
        ("<c t='d'><v>2026-01-02T03:04:05</v></c>", "2026-01-02 03:04:05", DATE),
    ],
)
def test_a_formula_is_the_value_that_was_saved_with_it(cell, text, odd):
    assert one(cell) == (text, odd)


STYLES = (
    '<numFmts><numFmt numFmtId="164" formatCode="{0}"/></numFmts>'
    '<cellStyleXfs><xf numFmtId="0"/></cellStyleXfs>'
    '<cellXfs><xf numFmtId="0"/><xf numFmtId="{1}"><alignment/></xf></cellXfs>'
).format


@pytest.mark.parametrize(
    ("code", "number", "text", "odd"),
    [
        ("[h]:mm", 164, "2010 days, 0:00:00", DATE),
        ("", 14, "1905-07-02 00:00:00", DATE),
        ("", 57, "2010", DATE),  # a Korean date
        ("[Red]0.00", 164, "2010", ""),
        ("0 &quot;days&quot;", 164, "2010", WORDS),
        ("\\L\\S0", 164, "2010", WORDS),
        ("000000", 164, "002010", ""),
        ("000", 164, "2010", ""),
    ],
)
def test_a_number_is_a_date_by_its_format(code, number, text, odd):
    assert one("<c s='1'><v>2010</v></c>", styles=STYLES(code, number)) == (text, odd)
    assert one("<c s='0'><v>2010</v></c>", styles=STYLES(code, number)) == ("2010", "")


def test_two_cells_far_apart_cost_little_memory(monkeypatch):
    far = "<row r='{0}'><c r='{1}{0}'><v>1</v></c></row>".format
    first, last = read(packed(parts(far(1, "A") + far(2**20, "XFD"))))
    assert (first[0], last[0], len(last[1])) == (1, 2**20, 2**14)
    data = packed(parts(far(1, "A") + far(2**17, "XFD")))
    tracemalloc.start()
    try:
        read(data)
        _, most = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    # A few bytes for each row between them.
    assert most < 8e5
    assert tables.MOST_CELLS == 2**22
    monkeypatch.setattr(tables, "MOST_CELLS", 2**16)
    four = [far(number, "XFD") for number in range(1, 5)]
    assert len(read(packed(parts("".join(four))))) == 4
    with pytest.raises(InputError, match="spans more than 65536 cells"):
        read(packed(parts("".join([*four, far(5, "A")]))))


ROW = "<row>" + "<c t='s'><v>0</v></c>" * 10 + "</row>"


@pytest.mark.parametrize(
    ("sheet", "more", "why"),
    [
        ("<row r='9999999999'><c><v>1</v></c></row>", {}, "has a row beyond 1048576"),
        ("<row>" + "<c/>" * 500 + "</row>" + "<row><c/></row>", {}, None),
        ("<row/>" * 140_000, {}, r"has more than 13\d{4} XML elements"),
        ("<x/>" * 65_800, {}, "has more than 65536 XML elements besides its cells"),
        ("<y:row><y:c><y:v>1</y:v></y:c></y:row>" * 40_000, {}, "unbound prefix"),
        (
            "<row><c/></row>",
            {"styles": "<cellXfs>" + "<xf/>" * 65_600 + "</cellXfs>"},
            "has more than 65536 XML elements besides its cells",
        ),
        ("<row><c t='str'><v>" + " " * 2**25 + "</v></c></row>", {}, r"more than 1\d{7} bytes"),
        (ROW * 54, {"strings": f"<si><t>{'x' * 32_000}</t></si>"}, "than 16777216 characters"),
        (ROW * 2, {"strings": f"<si><t>{'x' * 32_000}</t></si>"}, None),
    ],
    ids=range(9),
)
def test_a_small_workbook_that_would_take_long_is_refused(sheet, more, why):
    data = packed(parts(sheet, **more))
    assert len(data) < 100_000
    if why is None:
        assert read(data)
        return
    with pytest.raises(InputError, match=why):
        read(data)


def test_a_tag_of_many_megabytes_is_parsed_once():
    long = f"<row><c a='{'x' * 15_000_000}'><v>1</v></c></row>"
    assert rows(long) == [(1, ["1"], {})]


def test_sheets_that_share_a_part_and_too_many_sheets_are_refused():
    content = parts("<row><c><v>1</v></c></row>", "<row><c><v>2</v></c></row>")
    book = content["xl/workbook.xml"]
    for changed in (book.replace('"r2"', '"r1"'), book.replace('"S2"', '"S1"')):
        with pytest.raises(InputError, match="two of its sheets have the same name or content"):
            read(packed(content | {"xl/workbook.xml": changed}))
    assert len(read(packed(parts(*["<row><c/></row>"] * 256)))) == 1
    with pytest.raises(InputError, match=r"it has 257 sheets with cells; expected 1\.\.256"):
        read(packed(parts(*["<row><c/></row>"] * 257)))


def test_charts_and_links_of_a_workbook_are_not_read():
    content = parts("<row><c><v>1</v></c></row>", "<row><c><v>2</v></c></row>")
    name = "xl/_rels/workbook.xml.rels"
    chart = (
        content[name]
        .replace("/worksheet", "/chartsheet", 2)
        .replace("/chartsheet", "/worksheet", 1)
    )
    assert read(packed(content | {name: chart, "xl/worksheets/sheet2.xml": "<no chart"})) == [
        (1, ["1"], {})
    ]


def test_merged_areas_count_as_cells(tmp_path, monkeypatch):
    monkeypatch.setattr(tables, "MOST_CELLS", 2**18)
    row = "<row>" + "<c t='str'><v>{}</v></c>" * 3 + "</row>"
    content = parts(row.format(*"abc") + row.format(1, 2, 3) + "<row><c><v>1</v></c></row>" * 999)
    name = "xl/worksheets/sheet1.xml"
    for count, areas in ((250, 250), (300, 0)):
        merged = "<mergeCells>" + "<mergeCell ref='C2:C1001'/>" * count + "</mergeCells>"
        sheet = content[name].replace("</worksheet>", merged + "</worksheet>")
        path = tmp_path / f"{count}.xlsx"
        path.write_bytes(packed(content | {name: sheet}))
        if areas:
            assert {cells[2] for _, cells in tables.read_sheet(path).rows[:-1]} == {"3"}
            continue
        with pytest.raises(InputError, match="its merged areas span more than 262144"):
            tables.read_sheet(path)


def test_a_part_that_declares_entities_is_refused():
    grow = "<!DOCTYPE w [<!ENTITY a 'aaaaaaaaaa'><!ENTITY b '&a;&a;&a;&a;&a;&a;&a;&a;&a;&a;'>]>"
    leak = "<!DOCTYPE w [<!ENTITY a SYSTEM 'file:///etc/hostname'>]>"
    content = parts("<row><c t='str'><v>x</v></c></row>")
    for declared in (grow, leak):
        for part in content:
            with pytest.raises(InputError, match="declares a document type"):
                read(packed(content | {part: declared + content[part]}))
    # Without a declaration no entity is known.
    with pytest.raises(InputError, match="undefined entity"):
        rows("<row><c t='str'><v>&a;</v></c></row>")


def test_an_archive_with_false_sizes_unpacks_no_more_than_it_states(monkeypatch):
    content = parts("<row/>") | {"xl/worksheets/sheet1.xml": " " * 1_000_000}
    data = packed(content)
    size = (1_000_000).to_bytes(4, "little")
    assert data.count(size) == 2
    with pytest.raises(InputError, match="is not an Excel workbook"):
        read(data.replace(size, (50).to_bytes(4, "little")))
    assert tables._UNPACKED == 2**28
    monkeypatch.setattr(tables, "_UNPACKED", 999_999)
    with pytest.raises(InputError, match="unpacks to more than 999999 bytes"):
        read(data)


PIECES = (
    "<row>|</row>|<row r='2'>|<c>|</c>|<c r='B2' t='s'>|<c s='1'>|<c t='b'>|<c t='e'>|<v>|</v>|"
    f"<is>|</is>|<t>|</t>|<rPh>|</rPh>|0|-1|x|1e999|nan|&amp;|&#0;|{5000 * '9'}"
).split("|")


@given(st.lists(st.sampled_from(PIECES), max_size=12).map("".join))
@example("<row><c t='b'><v>x</v></c></row>")
@example("<row><c><v>" + "9" * 5000 + "</v></c></row>")
@settings(max_examples=150)
def test_any_sheet_gives_rows_or_an_input_error(sheet):
    try:
        dated = rows(sheet, strings="<si><t>a</t></si>", styles=STYLES("", 14))
    except InputError as error:
        assert "\n" not in str(error)
        return
    assert all(type(text) is str for _, cells, _ in dated for text in cells)
    assert [number for number, _, _ in dated] == sorted({number for number, _, _ in dated})


@pytest.mark.parametrize("count", [0, 1, 30_000])
def test_comments_are_not_read_and_do_not_count_as_cells(count):
    """Excel stores a comment as text with a font, and as a box of its drawing."""
    font = "<b/><sz val='9'/><color indexed='81'/><rFont val='Tahoma'/><family val='2'/>"
    note = f"<comment ref='A1'><text><r><rPr>{font}</rPr><t>ok?</t></r></text></comment>"
    box = "<v:shape><v:fill/><v:shadow/><v:path/><v:textbox/><x:ClientData/></v:shape>"
    content = parts("<row r='1'><c><v>1</v></c></row>")
    data = content | {
        "xl/comments1.xml": note * count,
        "xl/comments/comment1.xml": note * count,
        "xl/threadedComments/threadedComment1.xml": note * count,
        "xl/drawings/vmlDrawing1.vml": box * count,
    }
    assert read(packed(data)) == [(1, ["1"], {})]


@pytest.mark.parametrize("part", ["worksheets/sheet1.xml", "sharedStrings.xml"])
def test_cells_cannot_hide_in_a_part_for_comments(part):
    hidden = "comments1.xml"
    content = parts("<row r='1'><c t='s'><v>0</v></c></row>", strings="<si><t>x</t></si>")
    assert read(packed(content)) == [(1, ["x"], {})]
    renamed = {
        name.replace(part, hidden): data.replace(part, hidden) for name, data in content.items()
    }
    with pytest.raises(InputError, match=r"0 sheets with cells|list index out of range"):
        read(packed(renamed))
