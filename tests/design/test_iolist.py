import csv
import io
import re

import numpy as np
import pandas as pd
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from shipnet import datasets
from shipnet.design.iolist import IoList, read_iolist
from shipnet.design.layout import find_cabinet
from shipnet.design.points import RANGES
from shipnet.design.words import COLUMNS, column_of
from shipnet.errors import ArgumentError, InputError
from shipnet.signals import KINDS, SIGNALS, find_signal, spellings

SHIP = datasets.path("synthetic_iolist_ship.csv")
GOOD = "tag,type,signal,conductors,x,y,z,jb,to jb,home run,update,cat,note\n"
TITLES = ["tag", "type", "signal", "conductors", *"xyz", "jb", "to jb", "home run", "update"]
CELLS = "LS-1 DI contact 2 1 2 3 JB1 9 40 500 II n".split()
ROW = dict(zip([*TITLES, "cat", "note"], CELLS, strict=True))


def text(*rows, **changes):
    """Return a list of one or more correct rows with some changes."""
    stream = io.StringIO()
    writer = csv.DictWriter(stream, list(ROW), lineterminator="\n")
    writer.writeheader()
    writer.writerows([ROW | row for row in rows] if rows else [ROW | changes])
    return stream.getvalue()


def faults(source):
    """Return the faults of a list, without the column letters after the titles."""
    with pytest.raises(InputError) as error:
        IoList.parse(source)
    return tuple(re.sub(r" \([A-Z]\)", "", fault) for fault in error.value.faults)


def test_the_example_ship_has_the_counts_of_its_source():
    iolist = read_iolist(SHIP)
    points = iolist.points
    # Counted in the file independently.
    with SHIP.open(newline="", encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    assert len(iolist) == len(rows) == 353
    assert points["tag"].tolist() == [row["tag"] for row in rows]
    assert points["type"].tolist() == [row["type"] for row in rows]
    assert points["conductors"].sum() == sum(int(row["conductors"]) for row in rows) == 792
    for name, title in (("to_box_m", "len_to_jb_m"), ("home_run_m", "len_home_run_m")):
        assert points[name].tolist() == [float(row[title]) for row in rows]
    assert points["home_run_m"].sum() == pytest.approx(24.7e3, rel=2e-3)
    assert points["to_box_m"].sum() == pytest.approx(7.3e3, rel=2e-3)
    kinds = points["signal"].value_counts().to_dict()
    assert kinds == {
        "contact": 129,
        "current_loop": 90,
        "rtd_3wire": 62,
        "solenoid": 48,
        "potentiometer": 24,
    }
    assert iolist.located.all() and iolist.places.shape == iolist.box_places.shape == (353, 3)
    assert iolist.remarks == ()
    assert (points["system"] == "Main engine").sum() == 99


def test_columns_and_their_types_are_those_of_the_contract():
    points = read_iolist(SHIP).points
    assert list(points.columns) == list(COLUMNS)
    assert all(points[name].dtype == np.float64 for name in RANGES)
    assert points["conductors"].dtype == np.int64
    words = [name for name in COLUMNS if name not in RANGES and name != "conductors"]
    assert all(type(value) is str for name in words for value in points[name])
    assert set(points["type"]) <= set(KINDS) and set(points["signal"]) <= set(SIGNALS)


def test_a_list_needs_no_places_until_something_is_planned():
    valves = read_iolist(datasets.path("synthetic_iolist_valves.csv"))
    assert valves.counts == {"contact": 8, "solenoid": 8}
    assert list(valves.table().columns) == [
        "tag",
        "type",
        "signal",
        "conductors",
        "note",
        "device",
    ]
    planned = valves.plan("home runs", (0, 0, 0))
    assert not planned.fits and set(planned.reasons["limit"]) == {"place"}


def test_points_are_chosen_by_a_query():
    ship = read_iolist(datasets.path("synthetic_iolist_ship.csv"))
    valves = ship.where("system == 'Ballast valve'")
    assert len(valves) == 120 and valves.table().index[-1] == 119
    assert valves.counts["contact"] == 48 and find_cabinet(ship).place == (26.0, 6.0, 14.0)
    for query in ("no_such_column == 1", "x_m ==", "tag == 'none'"):
        with pytest.raises(ArgumentError, match="query is"):
            ship.where(query)


def test_a_list_in_many_spellings_gives_the_same_points():
    plain = IoList.parse(text()).points
    heading = "Project; hull 1234\n\nsep is ;\nTag No.;I/O;Signal type;Cores;Deck X;Y pos;z [m];"
    row = "\nLS-1; digital input;CONTACT;2,0;1,0;2;3,0;JB1;9;40;0,5;cat. 2;n\n\n"
    other = heading + "Junction box;length to JB;Cable length;Update [s];E22 category;Remarks" + row
    assert IoList.parse(other).points.equals(plain)
    tabs = other.replace(";", "\t").replace("hull\t", "hull")
    assert IoList.parse(tabs).points.equals(plain)
    reverse = [line.split(",")[::-1] for line in text().splitlines()]
    assert IoList.parse("\n".join(map(",".join, reverse))).points.equals(plain)
    millimetres = text(x="1000", y="2000", z="3000").replace(",x,y,z,", ",x [mm],y (mm),z_mm,")
    assert IoList.parse(millimetres).points.equals(plain)


@pytest.mark.parametrize(
    ("changes", "fault"),
    [
        ({"tag": ""}, r"column tag: is empty; expected a tag"),
        ({"tag": "a\x07b"}, r"column tag: 'a\x07b'; expected printable text"),
        ({"type": "XI"}, r"column type: 'XI'; expected DI, DO, AI or AO"),
        ({"type": "AI"}, r"column type: 'AI'; expected DI for the signal contact"),
        (
            {"signal": "limt switch"},
            "column signal: signal is 'limt switch'; the nearest known is 'limit switch'",
        ),
        ({"signal": "", "type": ""}, "column signal: is empty; expected one of contact"),
        (
            {"signal": "RTD", "type": "AI", "conductors": ""},
            "signal is 'RTD'; it may be rtd_2wire or rtd_3wire or rtd_4wire",
        ),
        ({"conductors": "3"}, r"column conductors: '3'; expected 2 for the signal contact"),
        ({"conductors": "two"}, r"column conductors: 'two'; expected a whole number 1..9999"),
        ({"conductors": "-2"}, r"column conductors: '-2'; expected a whole number"),
        ({"conductors": "2.5"}, r"column conductors: '2.5'; expected a whole number"),
        ({"x": ""}, r"column x: is empty; expected x, y, z, or none"),
        ({"x": "", "z": ""}, r"column x and z: is empty; expected x, y, z, or none"),
        ({"x": "nan"}, r"column x: 'nan'; expected a number -1000..1000 m"),
        ({"y": "1e999"}, r"column y: '1e999'; expected a number -1000..1000 m"),
        ({"y": "1_0"}, r"column y: '1_0'; expected a number"),
        ({"y": "\u0661"}, "column y: '\u0661'; expected a number"),
        ({"z": "1000.1"}, r"column z: '1000.1'; expected a number -1000..1000 m"),
        ({"home run": "-1"}, r"column home run: '-1'; expected a number 0..10000 m"),
        ({"home run": "inf"}, r"column home run: 'inf'; expected a number 0..10000 m"),
        ({"home run": "12,500"}, r"column home run: '12,500'; expected a number 0..10000 m"),
        ({"update": "0"}, r"column update: '0'; expected a number above 0, up to 3600000 ms"),
        ({"update": "-5"}, r"column update: '-5'; expected a number above 0"),
        ({"jb": ""}, "column jb: is empty; expected a name for the given position or length"),
    ],
)
def test_a_faulty_cell_is_named_with_what_is_expected(changes, fault):
    messages = faults(text(**changes))
    assert len(messages) == 1
    assert messages[0].startswith("row 2") and fault in messages[0]


def test_all_faults_are_reported_at_once_in_the_order_of_the_file():
    late = {"tag": "LS-4", "update": "never", "signal": "radio"}
    far = {"tag": "LS-3", "x": "far", "home run": "-2"}
    bad = text({}, {"tag": "ls-1", "type": "AO"}, far, {"tag": "LS-4"}, late)
    messages = faults(bad)
    places = [tuple(fault.split(":")[0].split(", column ")) for fault in messages]
    assert places == [
        *(("row 3", column) for column in ("tag", "type")),
        *(("row 4", column) for column in ("x", "home run")),
        *(("row 6", column) for column in ("tag", "signal", "update")),
    ]
    assert "'ls-1' is already the tag of row 2" in messages[0]
    assert "'LS-4' is already the tag of row 5" in messages[4]


def test_a_thousand_faulty_rows_are_all_kept_and_reported_briefly():
    messages = faults(text(*({"tag": f"T{k}", "home run": "-1"} for k in range(1000))))
    assert len(messages) == 1000
    assert str(InputError("x", *messages)).startswith(
        "x: rows 2 to 1001, column home run: '-1'; expec"
    )
    messages = faults(text(*({"tag": f"T{k}", "home run": f"-{k + 1}"} for k in range(1000))))
    assert str(InputError("x", *messages)) == (
        "x: rows 2 to 1001, column home run: '-1', '-2', '-3', '-4', '-5' and 995 more; "
        "expected a number 0..10000 m"
    )


@pytest.mark.parametrize(
    ("given", "fault"),
    [
        ("", "is empty; expected a row of titles of an I/O list"),
        ("a,b\n1,2", "has no row of titles of an I/O list"),
        (GOOD, "has no points"),
        ("type,x,y,z\nDI,1,2,3", "no column tag"),
        ("tag,x,y,z,update\nLS,1,2,3,4", "no column signal and no column type"),
        ("tag,type,x,y\nLS,DI,1,2", "no column z_m; expected x_m, y_m, z_m, or none"),
        ("tag,type,Tag no,home run\nLS,DI,1,2", "'tag' and 'Tag no' both mean tag"),
        ("tag,type,home run\nLS,DI,12,5", "row 2 has 4 cells; expected 3"),
        ('tag,type,home run\n"LS,DI,12', "is not a CSV file: unexpected end of data, in row 2"),
    ],
)
def test_files_that_are_not_lists_are_refused(given, fault):
    with pytest.raises(InputError, match=fault.replace("(", r"\(")):
        IoList.parse(given)


def test_unused_and_assumed_values_are_reported():
    iolist = IoList.parse("tag,type,home run,alarm limit,range\nLS,DI,4,high,\nLT,DI,4,,")
    assert iolist.remarks == (
        "not used: alarm limit; range",
        "2 points have no update time; the one in the settings is used, by default 1000 ms",
    )
    assert iolist.points["update_ms"].isna().all()


def test_several_columns_of_remarks_are_joined():
    source = "tag,type,home run,service,remarks\nLS,DI,4,bilge,aft\nLT,DI,4,,fore"
    assert IoList.parse(source).points["note"].tolist() == ["bilge; aft", "fore"]


def test_type_signal_and_conductors_follow_from_each_other():
    source = "tag,type,signal,cores,home run\na,AO,4-20 mA,,1\nb,AI,4..20 mA,,1\nc,DI,,,1\n"
    source += "d,,Pt100,4,1\ne,DO,,2,1\nf,ai,4-20mA,2,1\n"
    points = IoList.parse(source).points
    assert points["signal"].tolist() == [
        "analogue_output",
        "current_loop",
        "contact",
        "rtd_4wire",
        "solenoid",
        "current_loop",
    ]
    assert points["type"].tolist() == ["AO", "AI", "DI", "AI", "DO", "AI"]
    assert points["conductors"].tolist() == [2, 2, 2, 4, 2, 2]


def test_proximity_switches_are_distinguished_by_their_wires():
    source = (
        "tag,type,signal,cores,home run\na,DI,proximity switch,3,1\nb,DI,proximity switch,2,1\n"
    )
    source += "c,,PNP,,1\nd,DI,inductive sensor 2-wire,,1\n"
    points = IoList.parse(source).points
    assert points["signal"].tolist() == ["proximity_3wire", "contact"] * 2
    assert points["conductors"].tolist() == [3, 2] * 2
    (message,) = faults("tag,type,signal,home run\na,DI,proximity switch,1")
    assert "it may be contact or proximity_3wire: name one, or give the conductors" in message


@pytest.mark.parametrize(
    ("faults", "told", "beyond"),
    [
        (["row 3, column x: a", "row 3, column x: a"], ["row 3, column x: a"], 0),
        (["row 9: a", "row 3: a", "row 4: b"], ["rows 3 and 9: a", "row 4: b"], 1),
        (
            [f"row {n}: a" for n in (1, 3, 4, 6, 8, 10, 12, 13, 14, 99)],
            ["rows 1, 3 to 4, 6, 8, 10 and 4 more: a"],
            0,
        ),
        (
            ["line 2: a", "row 2: a", "row 2 is a", "row 3 is a", "", "rows 1: a"],
            ["line 2: a", "row 2: a", "row 2 is a", "row 3 is a", "", "rows 1: a"],
            5,
        ),
    ],
)
def test_faults_that_differ_only_in_their_rows_are_reported_as_one(faults, told, beyond):
    assert InputError("x", *faults).lines(10) == told
    assert InputError("x", *faults, more=7).lines(1) == [told[0], f"and {7 + beyond} more"]


def test_a_box_has_one_place_and_needs_it_only_once():
    head = "tag,type,home run,box,box x,box y,box z\n"
    points = IoList.parse(f"{head}a,DI,9,JB1,,,\nb,DI,9,JB1,1,2,3\nc,DI,9,JB2,,,").points
    assert points["box_x_m"].tolist()[:2] == [1.0, 1.0] and np.isnan(points["box_x_m"][2])
    messages = faults(f"{head}a,DI,9,JB1,1,2,3\nb,DI,9,JB1,1,2,4\nc,DI,9,JB1,1,,")
    assert messages == (
        "row 3, column box x: box 'JB1' has a different position in row 2; expected 1, 2, 3 m",
        "row 4, column box y and box z: is empty; expected box x, box y, box z, or none",
    )


def test_a_cable_shorter_than_the_distance_to_its_box_is_doubtful():
    head = "tag,type,x,y,z,box,box x,box y,box z,to box\n"
    remark = "the length to the box is used, but is shorter than the straight distance: 1 row (2)"
    assert remark not in IoList.parse(f"{head}a,DI,0,0,0,B,3,4,0,4.9").remarks
    assert remark in IoList.parse(f"{head}a,DI,0,0,0,B,3,4,0,4.7").remarks


def test_a_saved_list_is_read_back_and_has_no_formulas(tmp_path):
    path = tmp_path / "list.csv"
    for tag in ("=1+1", "-K1", "+A1", "@x", "'=K", "''-K", "plain", "'quoted'", 'say "a,b"'):
        iolist = IoList.parse(text(tag=tag, note="=cmd|'/c calc'!A1"))
        iolist.save(path)
        again = read_iolist(path)
        assert again.points.equals(iolist.points)
        with path.open(newline="", encoding="utf-8") as stream:
            assert not any(
                cell[:1] in ("=", "+", "@") or cell.startswith("-K")
                for row in csv.reader(stream)
                for cell in row
            )
    read_iolist(SHIP).save(path)
    assert read_iolist(path).points.equals(read_iolist(SHIP).points)


def test_a_table_is_checked_as_a_file_is():
    table = read_iolist(SHIP).points
    assert IoList.from_table(table).points.equals(table)
    assert IoList.from_table(table.iloc[::-1]).points["tag"].tolist() == table["tag"].tolist()[::-1]
    with pytest.raises(InputError, match=r"row 1, column tag: 'a' is already the tag of row 0"):
        IoList.from_table(pd.DataFrame({"tag": ["a", "a"], "type": "DI", "length": 3}))
    with pytest.raises(InputError, match=r"column tag: 'True', true or false; expected printable"):
        IoList.from_table(pd.DataFrame({"tag": [True], "type": "DI", "length": 3}))


def test_a_list_in_another_form_is_refused():
    points = read_iolist(SHIP).points
    with pytest.raises(ArgumentError, match=r"no column update_ms; use IoList.from_table"):
        IoList(points.drop(columns="update_ms"), "x")
    with pytest.raises(ArgumentError, match="numbered from 0"):
        IoList(points.iloc[1:], "x")


def test_every_spelling_finds_its_signal_by_kind_and_conductors():
    for word, meanings in spellings("signal").items():
        for name, _ in meanings:
            signal = SIGNALS[name]
            assert find_signal(word.upper(), signal.kind, signal.conductors) == name
    with pytest.raises(ArgumentError, match="known signals are contact, "):
        find_signal("qqqqqqqq")


def test_titles_have_their_expected_meanings():
    table = datasets.read("iolist_words.csv")
    titles = table[table["of"] == "column"]
    assert {column_of(word).name for word in titles["word"]} == set(titles["means"])
    for name in COLUMNS:
        assert column_of(name).name == column_of(name.replace("_", " ").title()).name == name
    for word, name in zip(titles["word"], titles["means"], strict=True):
        assert column_of(word).name == name, word
    assert column_of("update [ms]").unit == "ms" and column_of("update_s").unit == "s"
    assert column_of("home run (cm)").unit == "cm" and column_of("x [ft]").unit == "ft"
    for title in ("", "m", "tag [m]", "x y", "x / y", "cable (spare)"):
        assert column_of(title) is None


cells = st.text("0123456789.,;-+eE'=\"\t\n ", max_size=6) | st.sampled_from(
    ["tag", "DI", "x_m", "nan", "AI", "1e9", "\u00b2", "\u0661", "\x85", "a\0b"]
)


@given(st.binary(max_size=400) | st.lists(st.lists(cells, max_size=6), max_size=6))
@example(b"\xff\xfe" + "tag,type,length\nA,DI,3".encode("utf-16-le")[:-1])
@example(b"PK\x03\x04")
@example(b"tag,type,length\nA,DI," + b"9" * 200_000)
@settings(max_examples=200)
def test_any_bytes_are_read_as_a_list_or_raise_an_input_error(tmp_path_factory, given):
    if not isinstance(given, bytes):
        rows = "\n".join(",".join(row) for row in given)
        given = f"tag,type,length,x,y,z,signal,conductors\n{rows}".encode()
    path = tmp_path_factory.getbasetemp() / "any.csv"
    path.write_bytes(given)
    try:
        iolist = read_iolist(path)
    except InputError:
        return
    assert len(iolist) > 0 and iolist.points["tag"].str.casefold().is_unique


numbers = st.floats(-1000, 1000).map(lambda x: round(x, 3))


@given(st.lists(st.tuples(st.sampled_from(list(SIGNALS)), numbers, numbers, numbers), min_size=1))
@settings(max_examples=30)
def test_any_good_list_survives_a_file(tmp_path_factory, rows):
    table = pd.DataFrame(rows, columns=["signal", "x", "y", "z"])
    iolist = IoList.from_table(table.assign(tag=[f"T{k}" for k in range(len(rows))]))
    assert iolist.places.tolist() == [list(row[1:]) for row in rows]
    path = tmp_path_factory.getbasetemp() / "good.csv"
    iolist.save(path)
    assert read_iolist(path).points.equals(iolist.points)


def test_a_type_with_several_signals_needs_one_of_them():
    with pytest.raises(InputError, match="row 2, column signal: is empty; expected one of rtd_2w"):
        IoList.parse("tag,type,x,y,z\nTE-1,AI,1,2,3")


def test_an_ambiguous_signal_is_an_input_unless_the_type_is_an_output():
    engine = read_iolist(datasets.path("synthetic_iolist_engine.csv"))
    assert engine.counts == {"rtd_3wire": 62, "contact": 19, "current_loop": 18}
    said = "signal '4-20 mA' without a type is read as an input, not an output: 18 times"
    assert said in engine.remarks
    typed = IoList.parse("tag,type,signal\nA,AO,4-20 mA\nB,AI,4-20 mA")
    assert list(typed.counts) == ["analogue_output", "current_loop"]
    assert not any("4-20 mA" in remark for remark in typed.remarks)
