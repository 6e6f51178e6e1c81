import pickle

import pandas as pd
import pytest

from shipnet import datasets
from shipnet.engine.points import Point, PointList, read_points
from shipnet.errors import ArgumentError, InputError
from shipnet.papers.lee2012.engine import printed_points

CONDITIONS = {"RTD": "RTD", "4~20mA": "4-20 mA", "S/W": "switch"}


def test_the_points_are_those_of_table_3_written_out():
    table = pd.read_csv(datasets.path("lee2012_table3_sensors.csv"))
    points = iter(read_points())
    for row in table.itertuples():
        own = [next(points) for _ in range(row.quantity_points)]
        condition = CONDITIONS[row.condition]
        assert {(p.box, p.condition) for p in own} == {(row.jb, condition)}
        if condition == "switch":
            assert {p.alarm for p in own} == {row.type}
            continue
        assert {(p.quantity, p.low, p.unit) for p in own} == {
            (row.type, row.range_low, row.range_unit)
        }
        highs = (
            [float(end) for end in row.range_high_options.split("/")]
            if isinstance(row.range_high_options, str)
            else [row.range_high]
        )
        assert {p.high for p in own} == set(highs)
    assert next(points, None) is None


def test_without_the_double_row_the_current_loops_remain():
    full, less = printed_points(), printed_points(double_row=False)
    gone = [point for point in full if point not in less]
    assert (len(full), len(less)) == (99, 89)
    assert {(p.box, p.condition, p.low, p.high) for p in gone} == {("JB1", "RTD", -50.0, 600.0)}
    assert len(less.by_box()["JB1"]) == 33


def test_a_list_of_points_is_a_tuple_with_a_table():
    points = read_points()
    assert points[:2] == (points[0], points[1]) and isinstance(points[:2], PointList)
    assert pickle.loads(pickle.dumps(points)) == points
    assert PointList(points) is points
    assert points.table().loc["ME-JB1-011", "service"] == "Exhaust gas outlet cyl 1 (RTD)"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"tag": ""}, "tag is empty"),
        ({"box": "a\nb"}, "printable"),
        ({"tag": 3}, "printable"),
        ({"condition": "TC"}, "condition is 'TC'; it must be one of 'RTD', '4-20 mA', 'switch'"),
        ({"alarm": "H"}, "alarm is 'H'"),
        ({"low": float("nan")}, "low is nan"),
        ({"high": "200"}, "high is '200'"),
        ({"high": True}, "high is True"),
        ({"low": 5, "high": 5}, r"range is 5\.\.5"),
        ({"condition": "switch", "high": 2}, r"that of a switch is 0\.\.1"),
        ({"condition": "RTD", "low": -201}, "IEC 60751"),
    ],
)
def test_an_impossible_point_is_refused_with_the_reason(change, message):
    fields = {"tag": "T", "box": "B", "condition": "4-20 mA", "quantity": "q", "low": 0, "high": 9}
    with pytest.raises(ArgumentError, match=message):
        Point(**(fields | change))


def test_wrong_lists_of_points_are_refused():
    point = read_points()[0]
    for bad, message in ((3, "sequence"), ([1], "class Point"), ([point, point], "same tag")):
        with pytest.raises(ArgumentError, match=message):
            PointList(bad)


def test_every_fault_of_a_file_is_named_at_once(tmp_path):
    file = tmp_path / "points.csv"
    file.write_text(
        "tag,box,condition,quantity,low,high,unit,remark\n"
        "A,B1,RTD,temperature,0,200,degC,good\n"
        "A,B1,TC,temperature,0,200,degC,\n"
        "C,B1,4-20 mA,pressure,,6,bar,\n"
        "D,B1,4-20 mA,pressure,x,6,bar,\n"
        "E,B1,switch,logic,,,,\n"
    )
    with pytest.raises(InputError) as caught:
        read_points(file)
    rows = [fault.partition(":")[0] for fault in caught.value.faults]
    assert rows == ["row 3", "row 3", "row 4", "row 5"]
    file.write_text("tag,box,condition,quantity,low,high\nA,B1,RTD,temperature,0,200\n")
    assert read_points(file) == (Point("A", "B1", "RTD", "temperature", 0, 200),)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "is empty"),
        (b"tag,box\nA,B\n", "column condition, quantity is missing"),
        (b"tag,box,condition,quantity\n", "has no points"),
        (b"tag,box,condition,quantity\nA,B\n", "condition is ''"),
    ],
)
def test_a_file_without_points_is_refused(tmp_path, content, message):
    file = tmp_path / "points.csv"
    file.write_bytes(content)
    with pytest.raises(InputError, match=message):
        read_points(file)
    with pytest.raises(InputError, match="cannot be read"):
        read_points(tmp_path / "none.csv")
