"""A design's tables hang together, or all that is wrong with them is named."""

from dataclasses import replace

import numpy as np
import pytest

from shipnet.design.designs import Design
from shipnet.design.iolist import IoList
from shipnet.design.layout import COLUMNS, frame
from shipnet.design.site import Site
from shipnet.errors import ArgumentError

RUN = {
    "run": "drop A", "cable": "MI1P075", "a": "M1", "b": "A", "segment": "AS-i 1", "kind": "drop",
    "route_m": 1.0, "length_m": 6.0, "used": 2, "conductors": 2, "at_cabinet": False, "line": "",
}  # fmt: skip


@pytest.fixture
def design():
    """Two contacts on a module on one AS-i line."""
    places = {"x_m": 0.0, "y_m": 0.0, "z_m": 0.0}
    device = {"segment": "AS-i 1", **places}
    return Design(
        "by hand",
        IoList.parse("tag,signal,x,y,z\nA,contact,9,0,0\nB,contact,9,1,0"),
        Site((0, 0, 0)),
        frame("points", [
            {"tag": tag, "bus": "AS-i", "segment": "AS-i 1", "device": "M1", "address": f"1A I{n}",
             "response_ms": 5.0 + n, "fits": True} for n, tag in enumerate("AB", 1)]),
        frame("devices", [
            {"device": "cabinet", "kind": "cabinet", "segment": "", **places},
            {"device": "master", "kind": "master", **device},
            {"device": "M1", "kind": "module", **device}]),
        frame("cables", [
            {**RUN, "run": "trunk", "a": "master", "b": "M1", "kind": "trunk", "at_cabinet": True},
            RUN, {**RUN, "run": "drop B", "b": "B"}]),
        frame("segments", [
            {"segment": "AS-i 1", "bus": "AS-i", "points": 2, "devices": 2, "length_m": 6.0,
             "bus_time": 0.5, "capacity_used": 1 / 31, "response_ms": 7.0,
             "slowest_update_ms": 1000.0, "masters": 1}]),
        frame("reasons"),
    )  # fmt: skip


def test_a_network_says_what_it_is(design):
    assert repr(design) == "<Design 'by hand': 2 of 2 points fit, 3 cables, 18 m>"
    assert design.fits and design.worst_response_ms == 7.0 and design.cabinet == "cabinet"
    assert design.segments["masters"].tolist() == [1]


def test_masters_stand_in_the_cabinet_unless_the_table_says_where(design):
    assert design.devices["at"].tolist() == ["", "cabinet", ""]
    apart = replace(design, devices=design.devices.assign(at=""))
    assert apart.devices["at"].tolist() == ["", "", ""]


def test_tables_are_copies_so_that_the_caller_s_stay_as_they_are(design):
    devices = design.devices.drop(columns="at")
    replace(design, devices=devices)
    assert "at" not in devices.columns


@pytest.mark.parametrize(
    ("table", "row", "column", "value", "message"),
    [
        ("points", 1, "tag", "C", "the tags of points differ from those of the list"),
        ("points", 0, "bus", "LIN", "there is no bus 'LIN'"),
        ("points", 0, "device", "M9", "there is no device of a point 'M9'"),
        ("points", 0, "segment", "AS-i 2", "there is no segment of a point 'AS-i 2'"),
        ("devices", 0, "kind", "box", "there are 0 cabinets"),
        ("devices", 2, "kind", "cabinet", "there are 2 cabinets"),
        ("devices", 2, "kind", "toaster", "there is no kind of device 'toaster'"),
        ("devices", 2, "device", "master", "device 'master' appears twice"),
        ("devices", 2, "segment", "x", "there is no segment of a device 'x'"),
        ("devices", 2, "at", "x", "there is no housing of a device 'x'"),
        ("cables", 0, "a", "M9", "there is no end of a run 'M9'"),
        ("cables", 0, "b", "A", "there is no end of a run 'A'"),
        ("cables", 1, "b", "M1", "there is no point of a run 'M1'"),
        ("cables", 1, "run", "trunk", "run 'trunk' appears twice"),
        ("cables", 1, "kind", "string", "there is no kind of run 'string'"),
        ("cables", 1, "line", "C", "there is no line of a run 'C'"),
        ("cables", 1, "segment", "C", "there is no segment of a run 'C'"),
        ("cables", 1, "length_m", np.nan, "length of drop A is nan m; it must be 0 or more"),
        ("cables", 1, "length_m", -1.0, "length of drop A is -1.0 m"),
        ("cables", 1, "used", 3, "drop A uses 3 of 2 conductors"),
        ("cables", 1, "used", -1, "drop A uses -1 of 2 conductors"),
    ],
)  # fmt: skip
def test_what_does_not_fit_together_is_named(design, table, row, column, value, message):
    wrong = getattr(design, table).copy()
    wrong.loc[row, column] = value
    with pytest.raises(ArgumentError, match=message):
        replace(design, **{table: wrong})


def test_all_that_is_wrong_is_named_at_once(design):
    runs = design.cables.assign(a="M9", length_m=-1.0)
    with pytest.raises(ArgumentError) as caught:
        replace(design, cables=runs)
    assert "M9" in str(caught.value) and str(caught.value).count("-1.0 m") == 3


@pytest.mark.parametrize("table", COLUMNS)
def test_an_empty_table_has_its_columns_and_types(table):
    made = frame(table)
    assert list(made.columns) == list(COLUMNS[table]) and len(made) == 0
    for column, kind in COLUMNS[table].items():
        assert made[column].dtype == {"float": float, "int": np.int64, "bool": bool}.get(
            kind, object
        )


def test_a_table_needs_its_columns_and_types():
    with pytest.raises(ArgumentError, match="reasons has no column text"):
        frame("reasons", [dict.fromkeys(COLUMNS["reasons"].keys() - {"text"}, 0)])
    with pytest.raises(ArgumentError, match="column length_m of cables is not all float"):
        frame("cables", [{**RUN, "length_m": "long"}])
