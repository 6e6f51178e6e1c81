"""The tables of a design."""

from dataclasses import replace

import numpy as np
import pytest

from shipnet.design.iolist import IoList
from shipnet.design.layout import COLUMNS, frame


@pytest.fixture
def design():
    """Two contacts on a module on one AS-i line."""
    iolist = IoList.parse("tag,signal,x,y,z\nA,contact,9,0,0\nB,contact,9,1,0")
    return iolist.plan("AS-i", (0, 0, 0), name="by hand")


def test_masters_are_in_the_cabinet_unless_the_table_says_otherwise(design):
    kinds, tables = design.devices["kind"], design.devices.drop(columns="at")
    assert set(kinds[replace(design, devices=tables).devices["at"] == "cabinet"]) == {"master"}
    apart = replace(design, devices=design.devices.assign(at=""))
    assert set(apart.devices["at"]) == {""}


def test_a_design_does_not_change_the_tables_it_is_given(design):
    devices = design.devices.drop(columns="at")
    replace(design, devices=devices)
    assert "at" not in devices.columns


@pytest.mark.parametrize("table", COLUMNS)
def test_an_empty_table_has_its_columns_and_types(table):
    made = frame(table)
    assert list(made.columns) == list(COLUMNS[table]) and len(made) == 0
    assert made.dtypes.to_dict() == {name: np.dtype(kind) for name, kind in COLUMNS[table].items()}
