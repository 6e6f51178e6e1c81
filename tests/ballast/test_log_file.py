"""Logs of valves as loggers and spreadsheets write them."""

import datetime

import numpy as np
import openpyxl
import pytest

from shipnet.ballast import Command, Fault, read_log, simulate
from shipnet.ballast.rule_table import rule_base
from shipnet.errors import InputError
from shipnet.fuzzy import Rule, RuleBase, Term, Variable

INF = float("inf")
PLAIN = "time_s,FP,OP,MC,OT,VPos,DVPos\n0,90,2,1.2,50,10,9\n1.5,91.5,2,1.2,50,20,9\n"


def read(tmp_path, text, encoding="utf-8", rules=None):
    path = tmp_path / "log.csv"
    path.write_bytes(text.encode(encoding))
    return read_log(path, rules)


def refused(tmp_path, text, **options):
    with pytest.raises(InputError) as error:
        read(tmp_path, text, **options)
    return error.value.faults


def test_a_log_has_one_column_per_variable_and_its_time(tmp_path):
    log = read(tmp_path, PLAIN)
    assert list(log.columns) == list(rule_base().names) and log.index.name == "time_s"
    assert log.index.tolist() == [0, 1.5] and log["FP"].tolist() == [90, 91.5]
    assert log["DVPos"].tolist() == [9, 9]
    assert log.attrs["remarks"] == ()


GERMAN = (
    "Anlage 7;;;;;\nZeit;FP [bar];OP [mbar];MC in mA;OT [°C];VPos [%];Wetter\n"
    "30.11.2026 23:59:59,5;90,5;2.000;1200;50,5;10,0;gut\n"
    "01.12.2026 00:00:01,0;125;3.500,5;1300;-;26,5;gut\n"
)


@pytest.mark.parametrize("encoding", ["cp1252", "utf-8", "utf-8-sig", "utf-16"])
def test_a_german_spreadsheet_is_read(tmp_path, encoding):
    log = read(tmp_path, GERMAN, encoding)
    assert log.index.tolist() == [0, 1.5]
    assert log[["FP", "OP", "MC"]].to_numpy().tolist() == [[90.5, 2, 1.2], [125, 3.5005, 1.3]]
    np.testing.assert_equal(log["OT"].to_numpy(), [50.5, np.nan])
    np.testing.assert_allclose(log["DVPos"], [np.nan, 11])  # 16.5 % in 1.5 s
    remarks = "; ".join(log.attrs["remarks"])
    assert "not used: Wetter" in remarks and "DVPos computed from VPos" in remarks
    assert "OT [°C] (E): marked as missing: 1 row (4)" in remarks


KOREAN = (
    "일시,FP (MPa),operating pressure [kPa],motor temperature (℃),운전\n"
    "2026. 11. 30. 오전 11:59:58,9.05,200,50,1\n2026. 11. 30. 오후 12:00:01,12.5,350,95,1\n"
)


@pytest.mark.parametrize("encoding", ["cp949", "utf-8"])
def test_a_korean_spreadsheet_is_read(tmp_path, encoding):
    log = read(tmp_path, KOREAN, encoding)
    assert log.index.tolist() == [0, 3]
    np.testing.assert_allclose(log[["FP", "OP", "OT"]], [[90.5, 2, 50], [125, 3.5, 95]])
    assert "no values of MC, VPos, DVPos" in log.attrs["remarks"]
    assert rule_base().decide(log).top.tolist() == ["undetermined", "V1"]


@pytest.mark.parametrize(
    ("first", "second", "step"),
    [
        ("5", "7.25", 2.25),
        ("12:00:00", "12:00:01", 1),
        ("12:00:00.25", "12:00:01", 0.75),
        ("12:00", "13:30", 5400),
        ("2026-11-30 12:00:00", "2026-12-01 12:00:00", 86400),
        ("2026-11-30T12:00:00Z", "2026-11-30T12:00:02Z", 2),
        ("2026/11/30 12:00:00", "2026/11/30 12:00:01.5", 1.5),
        ("30.11.26 12:00:00", "01.12.26 12:00:00", 86400),
        ("2026. 11. 30. 오전 11:59:59", "2026. 11. 30. 오후 12:00:00", 1),
    ],
)
def test_times_of_several_forms_are_read(tmp_path, first, second, step):
    log = read(tmp_path, f"time;FP\n{first};90\n{second};91\n")
    assert log.index[1] - log.index[0] == step


@pytest.mark.parametrize("title", ["Datum", "Datum und Zeit"])
def test_a_column_of_dates_may_contain_the_times(tmp_path, title):
    rows = "30.11.2026 23:59:59;90\n01.12.2026 00:00:01;91\n"
    assert read(tmp_path, f"{title};FP\n{rows}").index.tolist() == [0, 2]
    (fault,) = refused(tmp_path, "Datum;FP\n30.11.2026;90\n")
    assert "column Datum (A): '30.11.2026'; expected a time such as" in fault


def test_date_and_time_may_be_two_columns_also_in_a_workbook(tmp_path):
    log = read(tmp_path, "Datum;Uhrzeit;FP\n30.11.2026;23:59:59;90\n01.12.2026;00:00:00;91\n")
    assert log.index.tolist() == [0, 1]
    book = openpyxl.Workbook()
    book.active.append(["Datum", "Uhrzeit", "FP [mbar]"])
    for day, clock in ((30, datetime.time(23, 59, 59)), (31, datetime.time(0, 0))):
        book.active.append([datetime.date(2026, 12, day), clock, 90500])
    book.save(tmp_path / "log.xlsx")
    log = read_log(tmp_path / "log.xlsx")
    assert log.index.tolist() == [0, 1] and log["FP"].tolist() == [90.5, 90.5]


def test_all_faults_are_reported_with_their_places(tmp_path):
    text = "time;FP [bar];OP\n12:00:02;9o;1\n12:00:01;90;1,5\n;90;1\n25:00:00;90;x\n"
    faults = refused(tmp_path, text)
    assert [fault.partition(";")[0] for fault in faults] == [
        "row 2, column FP [bar] (B): '9o'",
        "row 3, column time (A): '12:00:01'",
        "row 5, column time (A): '25:00:00'",
        "row 5, column OP (C): 'x'",
    ]
    assert "expected a time such as 12:00:01.5, 2026-11-30 12:00:01" in faults[2]


def test_a_row_without_a_time_is_left_out_and_named(tmp_path):
    log = read(tmp_path, "time;FP\n0;90\n;91\nMean;90,5\n2;92\n")
    assert log["FP"].tolist() == [90, 92]
    assert "page footer or note: 2 rows (3 to 4)" in log.attrs["remarks"][0]


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("", "is empty; expected a row of titles of a time and of variables (FP, OP, MC,"),
        ("FP,OP\n1,2\n", "row 1: no column time"),
        ("time,Druck\n1,2\n", "has no row of titles of a time and of variables"),
        ("time,FP [A]\n1,2\n", "title 'FP [A]' has the unit 'a'; expected bar, mbar, Pa, kPa, MPa"),
        ("time,FP,oil pump pressure\n1,2,3\n", "'FP' and 'oil pump pressure' both mean FP"),
        ("time,valve,FP\n1,1,2\n1,2,2\n", "has rows of several valves; save one file per valve"),
        ("time,FP\n", "has no samples; expected one per row"),
        ("time [min],FP\n1,2\n", "title 'time [min]' has the unit 'min'; expected s, ms, us"),
    ],
)
def test_a_log_that_cannot_be_read_says_what_is_missing(tmp_path, text, why):
    assert why in refused(tmp_path, text)[0]


def test_a_value_that_no_sensor_reports_is_kept_for_the_rules(tmp_path):
    log = read(tmp_path, "time,FP,OP\n0,171,2\n1,-1,NaN\n2,,#NV\n")
    assert log["FP"].tolist()[:2] == [171, -1] and log["OP"].isna().tolist() == [False, True, True]
    assert rule_base().decide(log).firing.out_of_range[:, 0].tolist() == [True, False, False]


def test_ones_own_variables_are_found_by_name_or_label_in_their_units(tmp_path):
    weak = Term("weak", (-INF, -INF, 8, 10), "x < 9")
    variables = [
        Variable("Q", "l/min", 0, 50, (weak,), "Durchfluss"),
        Variable("I", "mA", 0, 5000, (Term("off", (-INF, -INF, 100, 200), "x < 150"),)),
        Variable("P", "MPa", 0, 20, (weak,), "Druck"),
        Variable("P2", "MPa", 0, 20, (weak,), "Druck"),
    ]
    rules = RuleBase(variables, [Rule("F1", "Q.weak & I.off", 1)])
    text = "t;Durchfluss [l/min];I [A];P [bar];Druck\n0;7,5;0,05;25;1\n"
    log = read(tmp_path, text, rules=rules)
    assert log.loc[0, ["Q", "I", "P"]].tolist() == [7.5, 50, 2.5]
    # Two variables have this label, so it names neither.
    assert log.attrs["remarks"] == ("not used: Druck", "no values of P2")
    assert rules.decide(log).top.tolist() == ["F1"]


def test_a_log_of_the_simulator_gives_the_fault_that_was_simulated(tmp_path):
    commands = [Command("open", 5.0), Command("close", 40.0)]
    run = simulate(1, commands, faults=Fault("V1", valves=1), until=70, rng=3)
    path = tmp_path / "log.csv"
    run.valve(1).drop(columns="DVPos_percent_per_s").to_csv(path)
    log = read_log(path)
    assert log.index.tolist() == run.time.tolist()
    np.testing.assert_array_equal(log["DVPos"], run.speed[:, 0])
    readings = log[["FP", "OP", "MC", "OT", "VPos"]].to_numpy()
    assert readings.tolist() == run.readings[..., 0].tolist()
    assert set(rule_base().decide(log, k=3, n=5).top) == {"normal", "V1"}
    run.valve(1).to_csv(path)
    np.testing.assert_array_equal(read_log(path)["DVPos"], run.DVPos[:, 0])
