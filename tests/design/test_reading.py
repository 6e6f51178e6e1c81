"""I/O lists as yards write them: what is read, what is left out, and what is reported."""

import csv
from collections import Counter

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shipnet.__main__ import main
from shipnet.design import IoList, Settings, read_iolist
from shipnet.design.costs import bill_table
from shipnet.design.layout import site_of
from shipnet.lists import decimal_mark, read_number
from shipnet.errors import InputError
from tests.design import messy

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
        own = points.loc[tag]
        assert (own["system"], own["type"], own["z_m"]) == (system, kind, z)
        assert own[["x_m", "y_m", "home_run_m"]].tolist() == pytest.approx([x, y, length])
    said = notes(iolist)
    assert said["left out, marked as deleted or spare"] == 10
    assert said["left out, repeated titles"] == 11 and said["titles in two rows"] == 2
    if form == "workbook":
        assert said["left out, struck out"] == 1 and said["hidden, but read"] == 2
        assert "read: sheet IO list rev C; not read: Cover" in iolist.remarks
    else:
        assert "read as cp949, with semicolons between the cells" in iolist.remarks
    # No row is left out without a remark.
    told = sum(said[what] for what in said if what.startswith("left out"))
    assert told + len(iolist) + said["titles in two rows"] == sum(any(row) for row in sheet)


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
    own = Settings.parse('[columns]\nKKS = "tag"\n"Was" = "signal"\n[signals]\nTIT = "RTD 3W"\n')
    text = "KKS,Was\nLT-1,tit\n"
    iolist = IoList.parse(text, reading=own.reading)
    assert iolist.points.loc[0, ["tag", "signal"]].tolist() == ["LT-1", "rtd_3wire"]
    assert Settings.parse(own.text()) == own and own.text() != Settings().text()
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
    [
        ("24.8", "", 24.8), ("24,8", "", 24.8), ("24.8 m", "", 24.8), ("24,8m", ",", 24.8),
        ("2480 cm", "", 24.8), ("24800mm", "", 24.8),
        ("\uff12\uff14\uff0e\uff18", "", 24.8), ("1,234.5", "", 1234.5),
        ("1.234,5", "", 1234.5), ("1 234,5", ",", 1234.5), ("1,234", ".", 1234),
        ("1,234", ",", 1.234),
        ("1,234", "", None), ("1.234", "", None), ("0.234", "", 0.234), ("1.234", ",", 1234), ("1,234,567", "", 1234567),
        ("-.5", "", -0.5), ("\u22123", "", -3), ("+3.", "", 3), ("1e2", "", 100),
        ("1'234.5", "", 1234.5),
        ("12,5 ft", "", None), ("1,5,0", "", None), ("1.5.0", "", None), ("1,23,456", "", None),
        ("m", "", None), ("", "", None), ("5 m 3", "", None), ("\u0661", "", None),
        ("1,5.0,3", "", None),
    ],
)  # fmt: skip
def test_a_number_is_read_correctly_or_not_at_all(cell, mark, value):
    assert read_number(cell, mark, "m", "m") == pytest.approx(value)


@pytest.mark.parametrize(
    ("cells", "mark"),
    [(["1,5", "1,234"], ","), (["1.5", "1,234"], "."), (["1,234"], ""), (["1,5", "2.5"], ""),
     (["1.234,5"], ","), (["12", ""], "")],
)  # fmt: skip
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
        ("FR 34+200, DK3, P 4.2", (21.4, 4.2, 8)), ("Fr. 30 / DK 3 / S 2", (18, -2, 8)),
        ("frame 0, dk3", (0, 0, 8)), ("FR -5, DK3+500, CL", (-3, 0, 8.5)),
        ("FR30-1.5m; DK3; 4,2 P", (16.5, 4.2, 8)),
        ("FR 181, DK3", None), ("FR 30, DK4", None), ("FR 30, DK3, P", None), ("ER floor", None),
    ],
)  # fmt: skip
def test_a_place_is_understood_by_frame_deck_and_side(place, found):
    text = f'tag,type,location\nA1,DI,"{place}"\n'
    if found is None:
        assert only(text, reading=FRAMES.reading).startswith("row 2, column location (C): ")
        return
    (at,) = IoList.parse(text, reading=FRAMES.reading).places
    assert at == pytest.approx(found)


def test_frames_and_decks_may_come_from_sheets_of_the_workbook(tmp_path):
    path = tmp_path / "list.xlsx"
    rows = [["tag", "type", "frame", "deck", "side"], ["A1", "DI", "FR 34+200", "DK3", "P 4.2"]]
    frames = [["Frame table"], ["Frame", "x [mm]"], [0, 0], [30, 18000], [180, 138000]]
    decks = ("Decks", [["Deck", "z [m]"], ["DK3", 8.0]])
    messy.as_workbook(rows, path, places=[("Frames", frames), decks])
    assert read_iolist(path).places.tolist() == [[pytest.approx(21.4), 4.2, 8.0]]
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
    [(["a", "", "b", ""], ["a", "a", "b", "b"]), (["a", "a", "", "b"], None), (["", "a"], None),
     (["a", "b"], None)],
)  # fmt: skip
def test_a_system_given_once_per_group_is_filled_down(systems, filled):
    rows = "".join(f"A{n},DI,{system}\n" for n, system in enumerate(systems))
    iolist = IoList.parse("tag,type,system\n" + rows)
    assert iolist.points["system"].tolist() == (filled or systems)
    said = [what for what in notes(iolist) if what.startswith("system filled down")]
    assert bool(said) == (filled is not None)
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
    [("cp949", "냉각수 온도 5 ℃", "cp949"), ("utf-8-sig", "5 µm", "utf-8"),
     ("cp1252", "Kühlwasser 5 µm, 5 °C", "cp1252"),
     ("utf-16", "5 °C", "utf-16"), ("utf-16-le", "5 °C", "utf-16-le"), ("cp949", "빌지", "cp949"),
     ("cp1252", "nødstopp øvre dør", "cp1252"), ("cp1252", "n° 5, température", "cp1252")],
)  # fmt: skip
def test_the_encoding_is_found_and_named(encoding, note, said, tmp_path):
    path = tmp_path / "list.csv"
    path.write_bytes(f"tag\ttype\tnote\nA1\tDI\t{note}\n".encode(encoding))
    iolist = read_iolist(path)
    assert iolist.points.loc[0, "note"] == note
    assert f"read as {said}, with tabs between the cells" in notes(iolist)


def test_the_command_counts_groups_and_saves_all_faults(tmp_path, capsys):
    points, faults, own = tmp_path / "list.csv", tmp_path / "faults.csv", tmp_path / "own.toml"
    own.write_text(messy.SETTINGS, encoding="utf-8")
    points.write_bytes(messy.as_csv(messy.rows()[0]))
    command = ["design", str(points), "--settings", str(own), "--faults", str(faults)]
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
    (told,) = capsys.readouterr().err.splitlines()[-1:]
    assert "rows 2 to 1001, column home run (C): '-1', '-2'" in told and "'-1000'" in told


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
    assert IoList.from_table(rows.assign(**{title: ["DI", "AO"]})).points["type"].tolist() == [
        "DI", "AO",
    ]  # fmt: skip


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
UNCLEAR = {
    "Zone 1": False, "zone 1": False, "Ex": False, "Ex-proof": False, "II 2G": False, "T4": False,
    "?": False, "TBA": False, "safe area": False, "yes/no": False, "2": False, "o": False,
    "[Ex ia]": False, "[Ex ia Ga] IIC": False, "Ex [ia]": False, "Ex op is": False, "idea": False,
    "Exit": False, "no barrier for Ex d": False, "Ex i to be confirmed, not sure": True,
    "Ex ia/d": True, "Ex d ia": True, "Ex d / Ex ia": True, "Ex ia or Ex d": True, "Ex de ia": True,
    "d/ia": True, "IS / Ex d": True, "IS: no": True, "Ex ia: no": True, "zone is unknown": True,
}  # fmt: skip


def marked(*cells, title="IS", **options):
    """Return a list with one point per cell in the column for explosion protection."""
    rows = "".join(f'T-{n};Pt100 3-wire;9;2;3;"{cell.replace(chr(34), chr(34) * 2)}"\n'
                   for n, cell in enumerate(cells))  # fmt: skip
    return IoList.parse(f"tag;signal;x;y;z;{title}\n{rows}", **options)


def every(text):
    return [cell for line in text.splitlines() for cell in line.split("|")]


@pytest.mark.parametrize("cell", every(SAFE))
def test_a_cell_says_that_a_point_is_intrinsically_safe(cell):
    iolist = marked(cell, strict=True)
    assert iolist.points["ex"].item()
    assert f"IS (F) {cell!r} read as intrinsically safe" in notes(iolist)
    assert notes(iolist)["intrinsically safe, each with a barrier"] == 1


@pytest.mark.parametrize("cell", every(PLAIN))
def test_a_cell_says_that_a_point_is_not_intrinsically_safe(cell):
    iolist = marked(cell, strict=True)
    assert iolist.points["ex"].item() == ""
    assert f"IS (F) {cell!r} read as not intrinsically safe" in notes(iolist)
    assert "intrinsically safe, each with a barrier" not in notes(iolist)


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
    found = notes(iolist)
    assert found["IS (F) 'No', 'no', 'Ex d' read as not intrinsically safe"] == 3
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
    said = "intrinsically safe by the signal, but not by column ex (C)"
    assert notes(iolist)[said] == 1
    with pytest.raises(InputError, match="row 2: intrinsically safe by the signal"):
        IoList.parse(text, strict=True)


@pytest.mark.parametrize("cell", [*every(SAFE), "Ex d", *UNCLEAR])
def test_a_saved_list_has_the_same_intrinsically_safe_points(cell, tmp_path):
    iolist = marked(cell)
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
