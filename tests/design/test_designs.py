"""The tables of a design, and its description of itself."""

from dataclasses import replace

import numpy as np
import pytest

from shipnet.design.designs import Design
from shipnet.design.iolist import IoList
from shipnet.design.layout import COLUMNS, Site, frame

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


def test_a_design_describes_itself(design):
    assert repr(design) == "<Design 'by hand': 2 of 2 points fit, 3 cables, 18 m>"
    assert design.fits and design.worst_response_ms == 7.0 and design.cabinet == "cabinet"
    assert design.segments["masters"].tolist() == [1]


def test_masters_are_in_the_cabinet_unless_the_table_says_otherwise(design):
    assert design.devices["at"].tolist() == ["", "cabinet", ""]
    apart = replace(design, devices=design.devices.assign(at=""))
    assert apart.devices["at"].tolist() == ["", "", ""]


def test_a_design_does_not_change_the_tables_it_is_given(design):
    devices = design.devices.drop(columns="at")
    replace(design, devices=devices)
    assert "at" not in devices.columns


@pytest.mark.parametrize("table", COLUMNS)
def test_an_empty_table_has_its_columns_and_types(table):
    made = frame(table)
    assert list(made.columns) == list(COLUMNS[table]) and len(made) == 0
    for column, kind in COLUMNS[table].items():
        assert made[column].dtype == {"float": float, "int": np.int64, "bool": bool}.get(
            kind, object
        )
