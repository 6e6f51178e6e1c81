"""I/O lists as yards write them: what is read, what is left out, and what is reported."""

import csv
from collections import Counter
from time import process_time

import numpy as np
import openpyxl
import openpyxl.styles
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shipnet.__main__ import main
from shipnet.design import IoList, Settings, read_iolist
from shipnet.design.costs import bill_table
from shipnet.design.layout import site_of
from shipnet.errors import InputError
from shipnet.lists import decimal_mark, read_number
from tests.design import messy
from tests.design.lists import cases

SETTINGS = Settings.parse(messy.SETTINGS)
HEAD = "tag,type,signal,x,y,z\n"


def notes(iolist):
    """Return the number of rows by remark on how a list was read."""
    table = iolist.reading()
    return dict(zip(table["what"], table["count"].fillna(0), strict=True))


def only(text, **options):
    """Return the one fault of a list."""
    with pytest.raises(InputError) as error:
        IoList.parse(text, **options)
    (fault,) = error.value.faults
    return fault


# The messy list as a whole --------------------------------------------------------------------


@pytest.mark.parametrize("form", ["cp949", "utf-8", "utf-16", "workbook"])
def test_only_the_bad_rows_of_a_messy_list_are_reported(form, tmp_path):
    sheet, _, bad = messy.rows()
    path = tmp_path / "list.xlsx"
    if form == "workbook":
        messy.as_workbook(sheet, path)
    else:
        path.write_bytes(messy.as_csv(sheet, form))
    with pytest.raises(InputError) as error:
        read_iolist(path, settings=SETTINGS)
    assert len(bad) == 20
    assert [int(fault.split()[1].rstrip(",:")) for fault in error.value.faults] == bad
    if form == "workbook":
        assert str(error.value).startswith(f"{path}, sheet IO list rev C: rows 25, ")


@pytest.mark.parametrize("form", ["cp949", "workbook"])
def test_a_messy_list_without_faults_becomes_the_expected_points(form, tmp_path):
    sheet, expected, _ = messy.rows(faulty=False)
    path = tmp_path / "list"
    hidden, struck = (20, 21), (30,)
    if form == "workbook":
        messy.as_workbook(sheet, path.with_suffix(".xlsx"), hidden, struck)
        path = path.with_suffix(".xlsx")
        expected.pop(sheet[struck[0] - 1][0])
    else:
        path.write_bytes(messy.as_csv(sheet))
    iolist = read_iolist(path, settings=SETTINGS)
    points = iolist.points.set_index("tag")
    assert points.index.tolist() == list(expected)
    for tag, (system, kind, x, y, z, length) in expected.items():
        point = points.loc[tag]
        assert (point["system"], point["type"], point["z_m"]) == (system, kind, z)
        assert point[["x_m", "y_m", "home_run_m"]].tolist() == pytest.approx([x, y, length])
    remarks = notes(iolist)
    assert remarks["left out, marked as deleted or spare"] == 10
    assert remarks["left out, repeated titles"] == 11 and remarks["titles in two rows"] == 2
    if form == "workbook":
        assert remarks["left out, struck out"] == 1 and remarks["hidden, but read"] == 2
        assert "read: sheet IO list rev C; not read: Cover" in iolist.remarks
    else:
        assert "read as cp949, with semicolons between the cells" in iolist.remarks
    # No row is left out without a remark.
    left_out = sum(remarks[what] for what in remarks if what.startswith("left out"))
    assert left_out + len(iolist) + remarks["titles in two rows"] == sum(any(row) for row in sheet)


# Titles ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "titles",
    [
        "tag,type,signal,x,y,z",
        "Tag No. / 태그번호,I/O 구분,신호 (Signal),X좌표 [m],Y (m) / 위치 Y,height [m]",
        "Tag No.,I/O type,Signal,Position,,\n,,,X,Y,Z",
        "태그번호,구분,신호,위치 X,위치 Y,위치 Z\nTag No.,Type,Signal,X,Y,Z",
        "Tag,Type,Signal,X,Y,Z\n,,,[m],(m),m",
        "HULL 1234 I/O LIST\n\nRev. C,,,,page 1\n" + 30 * "\n" + "Tag,Type,Signal,X,Y,Z",
    ],
)
def test_titles_may_be_in_two_rows_or_languages_and_below_other_rows(titles):
    points = IoList.parse(f"{titles}\nLS-1,DI,contact,1,2,3\nLS-2,DI,contact,4,5,6").points
    assert points["tag"].tolist() == ["LS-1", "LS-2"]
    assert points[["x_m", "y_m", "z_m"]].to_numpy().tolist() == [[1, 2, 3], [4, 5, 6]]


def test_rows_are_numbered_as_a_spreadsheet_shows_them():
    text = '"note\nof two lines"\n\n"Tag\nNo.",Type,"Cable\nlength"\nA,DI,1\n"B\nb",DI,x\n'
    assert only(text).startswith("row 5, column Cable length (C): 'x'; expected")


def test_own_titles_and_signals_come_from_the_settings():
    settings = Settings.parse(
        '[columns]\nKKS = "tag"\n"Was" = "signal"\n[signals]\nTIT = "RTD 3W"\n'
    )
    text = "KKS,Was\nLT-1,tit\n"
    iolist = IoList.parse(text, reading=settings.reading)
    assert iolist.points.loc[0, ["tag", "signal"]].tolist() == ["LT-1", "rtd_3wire"]
    assert Settings.parse(settings.text()) == settings and settings.text() != Settings().text()
    with pytest.raises(InputError, match="has no row of titles"):
        IoList.parse(text)


def test_a_type_column_may_contain_signals_if_no_other_does():
    rows = "tag,type,conductors\nA,PT100 3W,\nB,LIMIT SW,\nC,DI,\nD,AO,\n"
    points = IoList.parse(rows).points
    assert points["signal"].tolist() == ["rtd_3wire", "contact", "contact", "analogue_output"]
    assert points["type"].tolist() == ["AI", "DI", "DI", "AO"]
    assert IoList.parse("tag,type\nC,DI\n").points["signal"].tolist() == ["contact"]
    assert "'PT100 3W'; expected DI, DO" in only("tag,type,signal\nA,PT100 3W,PT100 3W\n")
    assert "'xyz'; expected DI, DO" in only("tag,type\nA,DI\nB2,xyz\n")


def test_own_words_without_a_meaning_are_reported():
    text = '[columns]\nA = "tagg"\n[signals]\nB = "gizmo"\n[frames]\nfore = 1\n[decks]\nC = true\n'
    with pytest.raises(InputError) as error:
        Settings.parse(text)
    columns, signals, frames, decks = error.value.faults
    assert columns.startswith("columns.A is 'tagg'; it must be one of tag, system")
    assert signals == "signals.B is 'gizmo'; it must be a signal, such as contact or rtd_3wire"
    assert frames == "frames has 'fore'; it must be a number"
    assert decks == "decks.C is True; it must be a number -1000..1000 m"


# Words for signals ----------------------------------------------------------------------------

#: 76 common spellings with the type beside them, under the meaning that an engineer expects.
SPELLINGS = """\
contact: DI|DI;DI NO|DI;DI NC|;Dry contact|DI;Potential free|DI;Volt-free contact|;LIMIT SW|DI
contact: Limit switch|;Level SW|DI;Float switch|;Press. switch|DI;Temp. switch|DI;Flow switch|DI
contact: DI 24VDC|DI;24VDC in|;Push button|;ON/OFF|DI;Running status|DI;N.O. contact|;접점|
contact: 무전압 접점|DI;리미트 스위치|
namur: NAMUR|DI;NAMUR prox|;DI NAMUR|;NAMUR Ex ia|DI
proximity_3wire: PNP|DI;PROX 3W|;Inductive sensor 3-wire|
solenoid: DO|DO;24VDC out|;DO 24VDC|;Relay out|DO;SOV|;Solenoid valve|DO;S/V|DO
solenoid: Lamp|DO;Start/stop|DO
solenoid: 솔레노이드 밸브|;전자변|
rtd_3wire: PT100 3W|AI;Pt100 3-wire|;RTD 3W|AI;RTD PT100 3W|;측온저항체 3선식|
rtd_3wire: PT-100 (3W)|;PT100 3W Ex i|
rtd_4wire: PT100 4W|AI
rtd_2wire: PT100 2W|
thermocouple: TC-K|AI;T/C K-type|;K-type|AI;Thermocouple K|;열전대|
current_loop: 4-20mA|AI;4-20 mA 2W|;4~20mA|AI;4..20 mA|AI;HART|AI;4-20mA HART|;Loop powered|AI
current_loop: 4-20mA IS|AI;4-20mA (Ex ia)|AI;2-wire transmitter|;전류 입력|
current_loop_3wire: 4-20mA 3W|AI;3-wire transmitter|
current_loop_4wire: 4-20mA 4W|AI;4-20mA active|AI
voltage_input: 0-10V|AI;0-10 VDC|;1-5V|AI;+/-10V|
potentiometer: POT|AI;Potentiometer|
serial: RS485|;Modbus RTU|AI;Modbus gateway|
analogue_output: AO|AO;4-20mA out|;AO 4-20mA|;4-20mA|AO
"""


def spellings():
    for line in SPELLINGS.splitlines():
        signal, _, words = line.partition(": ")
        yield from ((word, signal) for word in words.split(";"))


def test_at_least_70_of_76_common_spellings_are_understood_and_reported():
    understood, tried = Counter(), 0
    for pair, signal in spellings():
        word, _, kind = pair.rpartition("|")
        tried += 1
        try:
            iolist = IoList.parse(f"tag,type,signal\nA-1,{kind},{word}\n")
        except InputError:
            continue
        assert iolist.points.loc[0, "signal"] == signal, word
        assert word == signal or f"signal {word!r} read as {signal}" in notes(iolist)
        understood[signal] += 1
    assert tried >= 76 and understood.total() >= tried - 6


def test_a_mark_of_intrinsic_safety_is_kept_beside_the_signal():
    text = f"{HEAD}A1,AI,4-20mA Ex ia IIC,1,2,3\nA2,AI,4-20mA,1,2,3\nA3,DI,contact IS,1,2,3\n"
    iolist = IoList.parse(text)
    assert iolist.points["ex"].tolist() == ["Ex ia IIC", "", "IS"]
    assert iolist.points["signal"].tolist() == ["current_loop", "current_loop", "contact"]
    assert notes(iolist)["intrinsically safe, each with a barrier"] == 2


# Numbers --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("cell", "mark", "value"),
    cases("""\
24.8||24.8;24,8||24.8;24.8 m||24.8;24,8m|,|24.8;2480 cm||24.8;24800mm||24.8;1,234.5||1234.5
\uff12\uff14\uff0e\uff18||24.8;1.234,5||1234.5;1 234,5|,|1234.5;1,234|.|1234;1,234|,|1.234
0.234||0.234;1,234||None;1.234||None;1.234|,|1234;1,234,567||1234567;-.5||-0.5;\u22123||-3;+3.||3;1e2||100
1'234.5||1234.5;12,5 ft||None;1,5,0||None;1.5.0||None;1,23,456||None;m||None;||None;5 m 3||None
\u0661||None;1,5.0,3||None"""),
)
def test_a_number_is_read_correctly_or_not_at_all(cell, mark, value):
    expected = None if value == "None" else pytest.approx(float(value))
    assert read_number(cell, mark, "m", "m") == expected


@pytest.mark.parametrize(
    ("cells", "mark"),
    [
        (["1,5", "1,234"], ","),
        (["1.5", "1,234"], "."),
        (["1,234"], ""),
        (["1,5", "2.5"], ""),
        (["1.234,5"], ","),
        (["12", ""], ""),
    ],
)
def test_the_decimal_mark_of_a_list_follows_from_its_clear_numbers(cells, mark):
    assert decimal_mark(cells) == mark


@given(st.text("0123456789.,' +-em\uff10\uff0e", max_size=9), st.sampled_from(["", ".", ","]))
def test_any_cell_is_a_finite_number_or_none(cell, mark):
    value = read_number(cell, mark, "m", "m")
    assert value is None or not np.isnan(value)


def test_a_unit_in_a_cell_overrides_that_of_the_title():
    text = "tag,type,home run [mm],update\nA1,DI,5000,0.5 s\nA2,DI,5 m,500\n"
    points = IoList.parse(text).points
    assert points["home_run_m"].tolist() == [5, 5] and points["update_ms"].tolist() == [500, 500]


# Places ---------------------------------------------------------------------------------------

FRAMES = Settings({"frames": {"-5": -3.0, "0": 0, "30": 18, "180": 138}, "decks": {"DK 3": 8.0}})


@pytest.mark.parametrize(
    ("place", "found"),
    [
        *cases("""\
FR 34+200, DK3, P 4.2|21.4 4.2 8\nFr. 30 / DK 3 / S 2|18 -2 8\nframe 0, dk3|0 0 8
FR -5, DK3+500, CL|-3 0 8.5\nFR 181, DK3|\nFR 30, DK4|\nFR 30, DK3, P|\nER floor|"""),
        ("FR30-1.5m; DK3; 4,2 P", "16.5 4.2 8"),
    ],
)
def test_a_place_is_understood_by_frame_deck_and_side(place, found):
    text = f'tag,type,location\nA1,DI,"{place}"\n'
    if not found:
        assert only(text, reading=FRAMES.reading).startswith("row 2, column location (C): ")
        return
    (at,) = IoList.parse(text, reading=FRAMES.reading).places
    assert at == pytest.approx([*map(float, found.split())])


def test_frames_and_decks_may_come_from_sheets_of_the_workbook(tmp_path):
    path = tmp_path / "list.xlsx"
    rows = [["tag", "type", "frame", "deck", "side"], ["A1", "DI", "FR 34+200", "DK3", "P 4.2"]]
    frames = [["Frame table"], ["Frame", "x [mm]"], [0, 0], [30, 18000], [180, 138000]]
    decks = ("Decks", [["Deck", "z [m]"], ["DK3", 8.0]])
    messy.as_workbook(rows, path, places=[("Frames", frames), decks])
    iolist = read_iolist(path)
    assert iolist.places.tolist() == [[pytest.approx(21.4), 4.2, 8.0]]
    assert "read: sheets IO list rev C, Frames, Decks; not read: Cover" in iolist.remarks
    messy.as_workbook(rows, path, places=[("Frames", [*frames, [200, "x"]]), decks])
    with pytest.raises(InputError, match=r"sheet Frames: row 6: '200' at 'x'; expected a frame"):
        read_iolist(path)


def test_without_frames_a_place_is_a_doubt_but_not_a_fault():
    iolist = IoList.parse("tag,type,frame,deck\nA1,DI,34,DK3\nA2,DI,,\n")
    assert not iolist.located.any() and iolist.reading()["doubt"].sum() == 1
    assert site_of(iolist, None, SETTINGS)[1].startswith("2 of 2 points have neither a position")


# What is counted, and what becomes a fault ----------------------------------------------------


@pytest.mark.parametrize(
    ("rows", "what", "count"),
    [
        ("MAIN ENGINE,,,,,\nA1,DI,contact,1,2,3\n", "left out, not a point: a subtitle", 1),
        (f"A1,DI,contact,1,2,3\n{HEAD}", "left out, repeated titles", 1),
        ("A1,DI,contact,1,2,3\nSPARE 1,DI,,,,\nA2,DI,DELETED,1,1,1\n", "left out, marked as", 2),
    ],
)
def test_rows_that_are_not_points_are_left_out_and_counted(rows, what, count):
    iolist = IoList.parse(HEAD + rows)
    assert len(iolist) == 1
    assert {n for said, n in notes(iolist).items() if said.startswith(what)} == {count}


def test_a_row_with_only_a_tag_is_a_fault():
    assert only(f"{HEAD}A1,DI,contact,1,2,3\nA-17,,,,,\n").startswith(
        "row 3, column signal (C): is"
    )


@pytest.mark.parametrize(
    ("systems", "filled"),
    [
        (["a", "", "b", ""], ["a", "a", "b", "b"]),
        (["a", "a", "", "b"], None),
        (["", "a"], None),
        (["a", "b"], None),
    ],
)
def test_a_system_given_once_per_group_is_filled_down(systems, filled):
    rows = "".join(f"A{n},DI,{system}\n" for n, system in enumerate(systems))
    iolist = IoList.parse("tag,type,system\n" + rows)
    assert iolist.points["system"].tolist() == (filled or systems)
    remarks = [what for what in notes(iolist) if what.startswith("system filled down")]
    assert bool(remarks) == (filled is not None)
    assert notes(iolist).get("no system", 0) == (0 if filled else systems.count(""))


def test_strict_makes_every_doubt_a_fault():
    text = "tag,type,system,x,y,z\nA1,DI,a,1,2,3\nA2,DI,,1,2,3\nA3,DI,b,1,2,3\nSPARE,DI,,,,\n"
    assert len(IoList.parse(text)) == 3
    with pytest.raises(InputError) as error:
        IoList.parse(text, strict=True)
    assert error.value.faults == (
        "row 5: left out, marked as deleted or spare",
        "row 3: system filled down from the row above, because it is given once per group",
    )


@pytest.mark.parametrize(
    ("encoding", "note", "said"),
    cases("""\
cp949|냉각수 온도 5 ℃|cp949;utf-8-sig|5 µm|utf-8;cp1252|Kühlwasser 5 µm, 5 °C|cp1252
utf-16|5 °C|utf-16;utf-16-le|5 °C|utf-16-le;cp949|빌지|cp949;cp1252|nødstopp øvre dør|cp1252
cp1252|n° 5, température|cp1252;cp1252|OT [°C]|cp1252"""),
)
def test_the_encoding_is_found_and_named(encoding, note, said, tmp_path):
    path = tmp_path / "list.csv"
    path.write_bytes(f"tag\ttype\tnote\nA1\tDI\t{note}\n".encode(encoding))
    iolist = read_iolist(path)
    assert iolist.points.loc[0, "note"] == note
    assert f"read as {said}, with tabs between the cells" in notes(iolist)


def test_the_command_counts_groups_and_saves_all_faults(tmp_path, capsys):
    points, faults, settings = tmp_path / "list.csv", tmp_path / "faults.csv", tmp_path / "own.toml"
    settings.write_text(messy.SETTINGS, encoding="utf-8")
    points.write_bytes(messy.as_csv(messy.rows()[0]))
    command = ["design", str(points), "--settings", str(settings), "--save-faults", str(faults)]
    assert main(command) == 2
    lines = capsys.readouterr().err.splitlines()
    assert any("rows 120 and 693, column Frame (F): 'FR 999' and 'FR x'; exp" in s for s in lines)
    with faults.open(newline="", encoding="utf-8-sig") as stream:
        table = list(csv.DictReader(stream))
    assert [int(row["row"]) for row in table] == messy.rows()[2]
    assert table[0]["column"] == "Cable length [m] (I)" and "'12,5 ft'" in table[0]["fault"]
    # A thousand different faults in one column are reported in one line with all rows.
    many = "tag,type,home run\n" + "".join(f"A{n},DI,-{n}\n" for n in range(1, 1001))
    points.write_text(many, encoding="utf-8")
    assert main(["design", str(points)]) == 2
    (message,) = capsys.readouterr().err.splitlines()[-1:]
    assert "rows 2 to 1001, column home run (C): '-1', '-2'" in message and "'-1000'" in message


def test_report_command_and_tables_say_how_the_list_was_read(tmp_path, capsys):
    points, report = tmp_path / "list.csv", tmp_path / "report.html"
    points.write_text(f"{HEAD}ENGINE,,,,,\nA1,DI,LIMIT SW,1,2,3\nSPARE,DI,,,,\n", encoding="utf-8")
    command = ["design", str(points), "--options", "home runs", "--cabinet", "0,0,0"]
    assert main([*command, "-o", str(report), "-o", str(tmp_path / "answer.json")]) == 0
    assert "left out, marked as deleted or spare: 1 row (4)" in capsys.readouterr().out
    page = report.read_text(encoding="utf-8")
    assert "how the list was read" in page and "read as contact" in page
    assert "marked as deleted" in (tmp_path / "answer.json").read_text(encoding="utf-8")
    assert main([*command, "--strict"]) == 2
    assert "row 4: left out, marked as deleted or spare" in capsys.readouterr().err


@pytest.mark.parametrize("title", ["I/O TYPE\n신호", "신호 / I/O type", "신호 I/O TYPE"])
def test_a_title_of_types_and_signals_in_two_languages_is_one_column(title):
    rows = pd.DataFrame({"tag": ["A", "B"], title: ["PT100 3W", "24VDC SOL"]})
    assert IoList.from_table(rows).points["signal"].tolist() == ["rtd_3wire", "solenoid"]
    types = IoList.from_table(rows.assign(**{title: ["DI", "AO"]})).points["type"]
    assert types.tolist() == ["DI", "AO"]


def test_a_list_with_unknown_titles_points_to_the_settings():
    with pytest.raises(
        InputError, match=r"unknown titles: wkz; \[columns\] in the settings may define"
    ):
        IoList.parse("tag,system,wkz,x,y,z\nA,b,contact,1,2,3")


# Intrinsic safety -----------------------------------------------------------------------------

SAFE = """yes|Yes|YES|y|Y|x|X|1|true|TRUE|ja|Ja|J|예|네|✓|✔|○|IS|I.S.|i/s|is|intrinsically safe
Intrinsically Safe|intrinsic safety|intrinsically safe, barrier KFD2|eigensicher|egensikker
본질안전|본질 안전|i|ia|ib|ic|Ex i|Ex-i|Exi|Ex ia|EX IA|Exia|Ex(ia)|Ex "ia"|Ex ib|Ex ic
EEx i|EEx ia IIC T4|EExia IIC T4|AEx ia|II 1G Ex ia IIC T6|Ex II 1 G Ex ia IIC T6 Ga|Ex II 1G ia
Ex ia IIIC T135 Da|ia IIC T4|II 1G ia IIC|Zone 0, Ex ia|Ex ia op is IIC|Ex ia [ia Ga] IIC|IS Ex ia
\uff29\uff33|\uff25\uff58 \uff49\uff41|\uff39\uff25\uff33"""
PLAIN = """no|No|NO|n|N|0|false|FALSE|nein|Nein|nei|-|--|\u2013|\u2014|n/a|N/A|n.a.|none|None|nil
/|아니오|없음|해당 없음|비방폭|not Ex|Non-Ex|non-IS|not intrinsically safe|nicht eigensicher
ikke egensikker|non-hazardous|not applicable|Ex d|EX D|Exd|EExd IIB T4|Ex db|Ex e|Ex eb|Ex de
Ex d e|Ex d/e|Ex db eb IIC T4 Gb|Ex n|Ex nA|Ex nR IIC|Ex nAc|Ex p|Ex pxb|Ex m|Ex mb|Ex dem|Ex t
Ex tb IIIC T80 Db|Ex o|Ex q|Ex s|d|de|db|II 2G Ex d IIC T6 Gb|Ex d [ia]|Ex d [ia Ga] IIC T4
Ex db [Ex ia] IIC|Ex e [ib]|flameproof|내압방폭|안전증|\uff2e\uff2f|\uff0d|\uff25\uff58 \uff44"""
#: Cells that do not say it clearly, and how they are read.
UNCLEAR = dict.fromkeys(
    "Zone 1|zone 1|Ex|Ex-proof|II 2G|T4|?|TBA|safe area|yes/no|2|o|[Ex ia]|[Ex ia Ga] IIC|Ex [ia]|"
    "Ex op is|idea|Exit|no barrier for Ex d".split("|"),
    False,
) | dict.fromkeys(
    "Ex i to be confirmed, not sure|Ex ia/d|Ex d ia|Ex d / Ex ia|Ex ia or Ex d|Ex de ia|d/ia|"
    "IS / Ex d|IS: no|Ex ia: no|zone is unknown".split("|"),
    True,
)


def marked(*cells, title="IS", **options):
    """Return a list with one point per cell in the column for explosion protection."""
    rows = "".join(
        f'T-{n};Pt100 3-wire;9;2;3;"{cell.replace(chr(34), chr(34) * 2)}"\n'
        for n, cell in enumerate(cells)
    )
    return IoList.parse(f"tag;signal;x;y;z;{title}\n{rows}", **options)


def every(text):
    return [cell for line in text.splitlines() for cell in line.split("|")]


@pytest.mark.parametrize("safe", [True, False])
def test_a_cell_says_whether_a_point_is_intrinsically_safe(safe):
    for cell in every(SAFE if safe else PLAIN):
        iolist = marked(cell, strict=True)
        assert bool(iolist.points["ex"].item()) is safe, cell
        read = "read as intrinsically safe" if safe else "read as not intrinsically safe"
        assert f"IS (F) {cell!r} {read}" in notes(iolist)
        assert notes(iolist).get("intrinsically safe, each with a barrier", 0) == safe


@pytest.mark.parametrize(("cell", "safe"), UNCLEAR.items())
def test_a_cell_that_does_not_say_it_clearly_is_a_doubt(cell, safe):
    iolist = marked(cell)
    assert bool(iolist.points["ex"].item()) is safe
    said = (
        f"IS (F) {cell!r} read as {'' if safe else 'not '}intrinsically safe, but does not say so"
    )
    assert any(said in remark for remark in iolist.remarks)
    with pytest.raises(InputError, match=r"row 2: IS \(F\) "):
        marked(cell, strict=True)


def test_yes_in_a_column_of_hazardous_areas_is_a_doubt():
    assert marked("yes", title="Ex", strict=True).points["ex"].item() == "IS"
    for title in ("hazardous area", "explosion protection", "방폭등급"):
        iolist = marked("yes", "Ex d", "Ex ia", title=title)
        assert iolist.points["ex"].tolist() == ["IS", "", "Ex ia"]
        assert iolist.reading().query("doubt")["rows"].tolist() == ["2"]


def test_circles_and_crosses_are_korean_for_yes_and_no():
    iolist = marked("O", "X", "", "o", "\uff38")
    assert iolist.points["ex"].tolist() == ["IS", "", "", "IS", ""]
    assert any("because the column has both" in remark for remark in iolist.remarks)
    assert marked("x", "", "X").points["ex"].tolist() == ["IS", "", "IS"]


def test_equal_readings_are_one_remark():
    iolist = marked("No", "no", "Ex d", *(f"Zone {n}" for n in range(1000)), "")
    remarks = notes(iolist)
    assert remarks["IS (F) 'No', 'no', 'Ex d' read as not intrinsically safe"] == 3
    (doubt,) = iolist.reading().query("doubt")["what"]
    assert len(doubt) < 200
    assert "'Zone 0', 'Zone 1'" in doubt
    assert "and 995 more" in doubt


@pytest.mark.parametrize("form", ["workbook", "table"])
def test_truth_values_of_a_workbook_say_whether_a_point_is_intrinsically_safe(form, tmp_path):
    rows = {"tag": list("ABCDE"), "signal": "contact", "IS": [True, False, 1, 0, None]}
    table = pd.DataFrame(rows).astype({"IS": object})
    if form == "workbook":
        table.to_excel(tmp_path / "list.xlsx", index=False)
        iolist = read_iolist(tmp_path / "list.xlsx", strict=True)
    else:
        iolist = IoList.from_table(table)
    assert iolist.points["ex"].tolist() == ["IS", "", "IS", "", ""]


def test_a_date_does_not_say_whether_a_point_is_intrinsically_safe():
    table = pd.DataFrame({"tag": ["A"], "signal": "contact", "IS": [pd.Timestamp("2026-01-01")]})
    with pytest.raises(InputError, match=r"column IS: .*a date or a time"):
        IoList.from_table(table)


def test_a_signal_and_a_column_that_disagree_are_a_doubt():
    text = "tag,signal,ex\nA,4-20mA Ex ia,No\nB,4-20mA Ex ia,\nC,4-20mA Ex ia,yes\nD,4-20mA,Ex ia\n"
    iolist = IoList.parse(text)
    assert iolist.points["ex"].tolist() == ["Ex ia", "Ex ia", "IS", "Ex ia"]
    remark = "intrinsically safe by the signal, but not by column ex (C)"
    assert notes(iolist)[remark] == 1
    with pytest.raises(InputError, match="row 2: intrinsically safe by the signal"):
        IoList.parse(text, strict=True)


def test_a_saved_list_has_the_same_intrinsically_safe_points(tmp_path):
    iolist = marked(*every(SAFE), "Ex d", *UNCLEAR)
    iolist.save(tmp_path / "list.csv")
    assert read_iolist(tmp_path / "list.csv").points["ex"].tolist() == iolist.points["ex"].tolist()


@given(st.text(max_size=200))
def test_any_text_in_the_column_is_read(cell):
    table = pd.DataFrame({"tag": ["A"], "signal": "contact", "IS": [cell]})
    try:
        iolist = IoList.from_table(table)
    except InputError as error:
        assert "expected a mark such as" in str(error)
    else:
        assert len(iolist) == 1


@pytest.mark.parametrize("cell", ["n" * 10_000, "Ex " + "pxdia" * 5000, "[" * 10_000, "i.s" * 5000])
def test_long_text_in_the_column_is_read_at_once(cell):
    assert len(IoList.from_table(pd.DataFrame({"tag": ["A"], "signal": "contact", "IS": [cell]})))


def test_a_point_that_is_not_intrinsically_safe_stays_on_the_bus():
    text = "tag,signal,x,y,z,IS\nTT-1,Pt100 3-wire,9,2,3,{}\nTT-2,Pt100 3-wire,9,3,3,{}"
    free, no, yes = (
        IoList.parse(text.format(mark, "")).plan("CAN", (0, 0, 0)) for mark in ("", "Ex d", "Ex ia")
    )
    assert no.points["bus"].tolist() == free.points["bus"].tolist() == ["CAN", "CAN"]
    assert yes.points["bus"].tolist() == ["hardwired", "CAN"]
    costs = [bill_table(one)["cost_eur"].sum() for one in (free, no, yes)]
    assert costs[0] == costs[1] < costs[2]


# Units in titles ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("title", "name", "cell", "value"),
    cases("""\
Zyklus (s)|update_ms|2|2000;Zyklus [ms]|update_ms|2|2;Takt|update_s|2|2000;Takt s|update_ms|2|2000
X FROM AP (mm)|x_m|900|0.9;X_mm|x_m|900|0.9;X ab HL, cm|x_m|900|9;L (mm)|home_run_m|900|0.9"""),
)
def test_the_unit_in_a_title_that_the_settings_map_counts(title, name, cell, value):
    reading = Settings.parse(f'[columns]\n"{title}" = "{name}"\n').reading
    further = "".join(f",{axis}" for axis in "yz" if name == "x_m")
    text = f'tag,type,"{title}"{further}\nA1,DI,{cell}{",0" * (len(further) // 2)}\n'
    column = name if name != "update_s" else "update_ms"
    assert IoList.parse(text, reading=reading).points[column].item() == float(value)


@pytest.mark.parametrize(
    ("title", "unit"),
    cases("""\
Zyklus (m)|m;Zyklus (h)|h;Zyklus [s] (ms)|s ms;Zyklus [Hz]|hz;Zyklus [x/y]|x/y"""),
)
def test_a_unit_that_contradicts_or_is_unknown_is_refused(title, unit):
    reading = Settings.parse(f'[columns]\n"{title}" = "update_ms"\n').reading
    with pytest.raises(InputError) as error:
        IoList.parse(f"tag,type,{title}\nA1,DI,2\n", reading=reading)
    assert f"title {title!r} has the unit {unit!r}; expected s, ms" in error.value.faults[0]
    with pytest.raises(InputError, match="has the unit 'ft'; expected m, mm, cm"):
        IoList.parse("tag,type,Cable length [ft]\nA1,DI,2\n")


def test_a_conversion_is_listed():
    remarks = notes(IoList.parse("tag,type,home run [mm],scan (s)\nA1,DI,5,5\n"))
    assert "converted: home run [mm] from mm to m; scan (s) from s to ms" in remarks


def test_titles_in_two_rows_are_united_although_the_lower_one_has_more(tmp_path):
    upper = "Tag,System,JB,,,Position,,,Comment"
    lower = ",,,I/O type,Signal,X [m],Y,Z,"
    text = f"HULL 9\n{upper}\n{lower}\nA1,Bilge,JB1,DI,contact,1,2,3,fine\n"
    iolist = IoList.parse(text)
    first = iolist.points.loc[0, ["tag", "system", "box", "x_m", "note"]].tolist()
    assert first == ["A1", "Bilge", "JB1", 1.0, "fine"]
    rows = iolist.reading().set_index("what")["rows"]
    assert rows["titles in two rows"] in ("2 to 3", "2 and 3")
    # A row above that adds no title is left out.
    assert IoList.parse(f"Doc,77,Rev. C\n{HEAD}A1,DI,contact,1,2,3\n").places.tolist() == [
        [1, 2, 3]
    ]


# Frames and decks on one sheet ----------------------------------------------------------------

PLACED = [["tag", "type", "frame", "deck", "side"], ["A1", "DI", "FR 34+200", "DK3", "P 4.2"]]
FRAME_ROWS = [["Frame", "x [mm]"], [0, 0], [30, 18000], [180, 138000]]


@pytest.mark.parametrize(
    "rows",
    [
        [["Geometry"], *FRAME_ROWS, ["Spacing varies"], [], ["Deck", "z [m]"], ["DK3", 8.0]],
        [
            ["Frame", "x [mm]", "", "Deck", "z [m]"],
            [0, 0, "", "DK3", 8],
            [30, 18000],
            [180, 138000],
        ],
        [
            ["Deck", "z [m]"],
            ["DK3", 8],
            ["Frame", "x [mm]", "Frame", "x [mm]"],
            [0, 0, 180, 138000],
            [30, 18000],
        ],
    ],
    ids=["stacked", "side by side", "twice"],
)
def test_tables_of_frames_and_decks_are_found_on_one_sheet(rows, tmp_path):
    path = tmp_path / "list.xlsx"
    messy.as_workbook(PLACED, path, places=[("Geometry", rows)])
    iolist = read_iolist(path)
    assert iolist.places.tolist() == [[pytest.approx(21.4), 4.2, 8.0]]
    text = [remark for remark in iolist.remarks if remark.startswith("not read on sheet Geometry")]
    assert bool(text) == (["Spacing varies"] in rows)


def test_faulty_tables_of_frames_do_not_matter_if_the_list_has_x_y_z(tmp_path):
    path = tmp_path / "list.xlsx"
    rows = [["tag", "type", "x", "y", "z", "frame"], ["A1", "DI", 1, 2, 3, "FR 9"]]
    messy.as_workbook(rows, path, places=[("Geometry", [*FRAME_ROWS, [200, "x"]])])
    assert read_iolist(path).places.tolist() == [[1, 2, 3]]
    contradicting = [*FRAME_ROWS, [30, 19000]]
    messy.as_workbook(PLACED, path, places=[("Geometry", contradicting)])
    with pytest.raises(InputError, match=r"row 5: '30' at '19000'; expected a frame and a number"):
        read_iolist(path)


# What is filled in ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    "mark", ['"', "〃", '-"-', "do.", "Ditto", "idem", "상동", "''", "wie oben"]
)
def test_ditto_marks_are_filled_and_counted(mark):
    table = pd.DataFrame(
        {
            "tag": ["A1", "A2", "A3"],
            "type": "DI",
            "system": ["Bilge", mark, mark],
            "box": ["JB1", mark, "JB2"],
            "home run": [5, mark, 7],
        }
    )
    iolist = IoList.from_table(table)
    assert iolist.points["system"].tolist() == ["Bilge"] * 3
    assert iolist.points["box"].tolist() == ["JB1", "JB1", "JB2"]
    assert iolist.points["home_run_m"].tolist() == [5, 5, 7]
    assert "system: ditto marks filled from the row above: 2 rows (1 to 2)" in iolist.remarks
    # A repeated text 1.000 has the same decimal mark as the first.
    iolist = IoList.from_table(table.assign(scan=["1.000", mark, "2,5"]))
    assert iolist.points["update_ms"].tolist() == [1000, 1000, 2.5]
    # A ditto mark without a cell above it, or as a tag, is a fault.
    with pytest.raises(InputError, match="a ditto mark here has none above"):
        IoList.from_table(table.iloc[1:])
    with pytest.raises(InputError, match="tag"):
        IoList.from_table(pd.DataFrame({"tag": ["A1", mark, mark], "type": "DI"}))


@pytest.mark.parametrize("gone", ["deleted", "not fitted"])
def test_a_ditto_mark_below_a_row_that_is_left_out_repeats_that_row(gone):
    text = f"tag,type,box,home run,note\nA1,DI,JB1,5,\nA2,DI,JB2,9,{gone}\nA3,DI,do.,do.,\n"
    points = IoList.parse(text).points
    assert points["box"].tolist() == ["JB1", "JB2"]
    assert points["home_run_m"].tolist() == [5, 9]
    # So does a cell that is filled down.
    text = f"tag,type,system,note\nA1,DI,a,\nA2,DI,,\nA3,DI,b,{gone}\nA4,DI,,\n"
    assert IoList.parse(text).points["system"].tolist() == ["a", "a", "b"]


def test_do_in_a_column_of_types_is_a_digital_output():
    points = IoList.parse("tag,type\nA1,DI\nA2,do.\nA3,DO\n").points
    assert points["type"].tolist() == ["DI", "DO", "DO"]


@pytest.mark.parametrize(
    ("boxes", "filled"),
    [(["a", "", "b", ""], ["a", "a", "b", "b"]), (["a", "a", "", "b"], None), (["", "a"], None)],
)
def test_a_box_given_once_per_group_is_filled_down(boxes, filled, tmp_path):
    rows = "".join(f"A{n},DI,{box}\n" for n, box in enumerate(boxes))
    iolist = IoList.parse("tag,type,box\n" + rows)
    assert iolist.points["box"].tolist() == (filled or boxes)
    remarks = [what for what in notes(iolist) if what.startswith("box filled down")]
    assert bool(remarks) == (filled is not None)
    # A saved list is read as it is.
    table = iolist.points.assign(box=boxes)
    IoList.from_table(table[[*messy_columns(table)]]).save(tmp_path / "saved.csv")
    again = read_iolist(tmp_path / "saved.csv")
    assert again.points["box"].tolist() == boxes


def messy_columns(table):
    return [name for name in table.columns if name not in ("device", "ex")]


def test_cells_filled_from_merged_cells_are_listed(tmp_path):
    path = tmp_path / "list.xlsx"
    messy.as_workbook([["tag", "type", "box"], ["A1", "DI", "JB1"], ["A2", "DI"]], path)
    book = openpyxl.load_workbook(path)
    book["IO list rev C"].merge_cells("C2:C3")
    book.save(path)
    iolist = read_iolist(path)
    assert iolist.points["box"].tolist() == ["JB1", "JB1"]
    assert notes(iolist)["filled from merged cells"] == 1


# Decimal marks that nothing shows -------------------------------------------------------------


@pytest.mark.parametrize(
    ("cells", "values"),
    [
        ([500, "1.000"], None),
        ([500.5, "1.000"], None),
        ([500, "1.000", "2,5"], [500, 1000, 2.5]),
        ([500, "1,000", "2.5"], [500, 1000, 2.5]),
        ([500, 1.125], [500, 1.125]),
        (["500", "1.000"], None),
        ([500, "0.250"], [500, 0.25]),
    ],
)
@pytest.mark.parametrize("form", ["workbook", "table"])
def test_text_beside_the_numbers_of_a_workbook_is_read_only_if_it_is_clear(
    cells, values, form, tmp_path
):
    table = pd.DataFrame(
        {
            "tag": [f"A{n}" for n in range(len(cells))],
            "type": "DI",
            "scan [ms]": pd.Series(cells, dtype=object),
        }
    )
    path = tmp_path / "list.xlsx"
    table.to_excel(path, index=False)

    def read():
        return read_iolist(path) if form == "workbook" else IoList.from_table(table)

    if values is None:
        with pytest.raises(InputError, match=r"'1\.000'; expected .* ms; it may be 1 or 1000"):
            read()
    else:
        assert read().points["update_ms"].tolist() == values


def test_a_point_in_a_file_with_commas_marks_decimals():
    assert IoList.parse("tag,type,scan\nA,DI,1.125\n").points["update_ms"].item() == 1.125
    assert "it may be 1.125 or 1125" in only("tag;type;scan\nA;DI;1.125\n")


# Void rows ------------------------------------------------------------------------------------


def test_a_row_whose_tag_is_struck_out_is_left_out(tmp_path):
    rows = [["Item", "Tag", "Type", "Note"], [1, "A1", "DI"], [2, "A2", "DI"], [3, "A3", "DI"]]
    path = tmp_path / "list.xlsx"
    messy.as_workbook(rows, path)
    book = openpyxl.load_workbook(path)
    sheet = book["IO list rev C"]
    sheet["B3"].font = openpyxl.styles.Font(strike=True)
    sheet["C4"].font = openpyxl.styles.Font(strike=True)
    book.save(path)
    iolist = read_iolist(path)
    assert iolist.points["tag"].tolist() == ["A1", "A3"]
    assert notes(iolist)["left out, struck out"] == 1
    assert notes(iolist)["read, although a cell is struck out"] == 1


@pytest.mark.parametrize(
    ("note", "said"),
    cases("""\
deleted, not fitted|left out, deleted or not fitted, as a note says;removable|;spare contact used|
Deleted per TQ-12|left out, deleted or not fitted, as a note says;void space, bilge|
utgår|left out, marked as deleted or spare;cancelled|left out, marked as deleted or spare
ikke montert|left out, deleted or not fitted, as a note says
replaces PS-3, which is deleted|read, although a note says"""),
)
def test_a_note_that_a_point_is_gone_is_heeded_or_reported(note, said):
    iolist = IoList.parse(f'tag,type,remark\nA1,DI,\nA2,DI,"{note}"\n')
    left_out = said.startswith("left out")
    assert iolist.points["tag"].tolist() == ["A1"] + ["A2"] * (not left_out)
    table = iolist.reading()
    found = table[table["doubt"]]["what"].tolist()
    assert [what.startswith(said) for what in found] == ([True] if said else [])


@pytest.mark.parametrize("tag", ["-", "--", "\u2014", "..."])
def test_a_row_with_a_dash_as_tag_is_left_out(tag):
    iolist = IoList.parse(f"tag,type,home run\nA1,DI,5\n{tag},DI,6\n")
    assert len(iolist) == 1
    assert notes(iolist)["left out, with a dash as tag"] == 1


def test_a_length_that_only_a_few_points_lack_is_named():
    text = "tag,type,cable length\nA1,DI,5\nA2,DI,6\nA3,DI,\n"
    remark = "read without home_run_m, which most others have"
    assert notes(IoList.parse(text))[remark] == 1
    assert remark not in notes(IoList.parse("tag,type,cable length\nA1,DI,5\nA2,DI,\n"))


# Words for kinds and sides --------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kind", "word", "signal"),
    cases("""\
DO|SOL. V/V 24VDC|solenoid;|SOLENOID 24VDC|solenoid;|DI (DRY)|contact;|NAMUR NJ2|namur
|prox. NAMUR|namur;AI|K형 열전대|thermocouple;SER||serial;SERIAL|Modbus RTU|serial
AI|0-10 VDC|voltage_input;|Relay 230 VAC|solenoid;|0-24VDC|;|24VDC|;SER|RTD 3W|"""),
)
def test_kinds_in_the_words_of_yards_are_read_or_refused(kind, word, signal):
    text = f"tag,type,signal\nA1,{kind},{word}\n"
    if not signal:
        assert only(text)
    else:
        assert IoList.parse(text).points["signal"].item() == signal


def test_the_settings_may_define_a_type_that_is_a_signal():
    reading = Settings.parse('[signals]\nBUS = "serial"\n').reading
    points = IoList.parse("tag,type\nA1,BUS\nA2,DI\n", reading=reading).points
    assert points["signal"].tolist() == ["serial", "contact"]
    assert points["type"].tolist() == ["AI", "DI"]


@pytest.mark.parametrize(
    ("title", "cell", "y"),
    cases("""\
P/S|3.1(S)|-3.1;P/S|(P) 3.1|3.1;P/S|3,1 S|-3.1;P/S|CL|0;P/S|StB 3.1|-3.1;Dist. from CL [m]|4.2|4.2
Dist. from CL [m]|-3.1|-3.1;Dist. from CL (mm)|4200|4.2;Dist. from CL [m]|4.2 P|4.2
off CL [cm]|S 310|-3.1;P/S|P -3.1|;P/S|P|;P/S|CL 3|;P/S|P 3 S|;P/S|ER|;P/S|4.2 ft|"""),
)
def test_a_side_is_read_or_refused_but_never_taken_for_0(title, cell, y):
    text = f'tag;type;frame;deck;{title}\nA1;DI;FR 30;DK3;"{cell}"\n'
    if not y:
        assert ", column " in only(text, reading=FRAMES.reading)
        return
    iolist = IoList.parse(text, reading=FRAMES.reading)
    assert iolist.places.tolist() == [[18, pytest.approx(float(y)), 8]]
    unmarked = cell.strip("-").replace(".", "").isdigit()
    assert unmarked == any("as metres to port" in remark for remark in iolist.remarks)


def test_a_distance_may_stand_beside_its_side():
    text = "tag;type;frame;deck;Side;Dist. CL [m]\nA1;DI;FR 30;DK3;P;4\nA2;DI;FR 30;DK3;S;3\n"
    iolist = IoList.parse(text, reading=FRAMES.reading)
    assert iolist.places[:, 1].tolist() == [4, -3]
    assert not any("port" in remark for remark in iolist.remarks)


def test_a_place_without_a_side_says_that_y_is_0():
    for text in (
        "tag;type;frame;deck\nA1;DI;FR 30;DK3\n",
        "tag;type;frame;deck;side\nA1;DI;0;DK3;\n",
    ):
        iolist = IoList.parse(text, reading=FRAMES.reading)
        assert any(remark.startswith("y is 0: no side") for remark in iolist.remarks)
    # An unknown column that may be a position is named.
    odd = IoList.parse("tag;type;frame;deck;Athwart pos.\nA1;DI;0;DK3;4\n", reading=FRAMES.reading)
    assert "not used, but may be a position: Athwart pos." in odd.remarks


def test_axes_may_come_from_frames_or_from_columns():
    text = "tag,type,frame,y,z\nA1,DI,FR 30,4,9\n"
    assert IoList.parse(text, reading=FRAMES.reading).places.tolist() == [[18, 4, 9]]
    with pytest.raises(InputError, match=r"column frame \(C\): is empty; expected a frame"):
        IoList.parse(text.replace("FR 30", ""), reading=FRAMES.reading)
    with pytest.raises(InputError, match=r"column z \(E\): is empty"):
        IoList.parse(text.replace("9", ""), reading=FRAMES.reading)


# Hostile cells --------------------------------------------------------------------------------


HUGE = ["9" * 100_000, "[m]" * 20_000, "deleted " * 20_000, "nan", "inf", "1e999", "=1+1"]
HUGE += [
    "1" + "." * 50_000,
    " " * 50_000 + "x",
    *(c * 50_000 for c in ("1,", "(", "P", "1 ", "fr")),
]


@pytest.mark.parametrize("cell", HUGE)
@pytest.mark.parametrize("title", ["x", "frame", "side", "update", "remark", "signal", "system"])
def test_huge_and_odd_cells_are_read_at_once_or_refused(cell, title):
    table = pd.DataFrame({"tag": ["A1", "A2"], "type": "DI", title: ["", cell]})
    start = process_time()
    for made in (table, table.rename(columns={title: cell})):
        try:
            IoList.from_table(made)
        except InputError as error:
            assert error.faults
    assert process_time() - start < 2


@pytest.mark.parametrize("titles", ["tag,Tag No.,type", "tag,type,x,y,z,X [mm]"])
def test_duplicated_titles_are_refused(titles):
    with pytest.raises(InputError, match="mean "):
        IoList.parse(f"{titles}\n{'1,' * titles.count(',')}1\n")
