import csv
from pathlib import Path

import pytest

from shipnet import datasets
from shipnet.can import read_messages
from shipnet.engine.can_layout import CanLayout
from shipnet.engine.points import Point, read_points
from shipnet.errors import ArgumentError

POINTS = read_points()
REFERENCE = Path(__file__).parents[1] / "reference" / "can" / "lee2012_jb_can_volume.csv"


@pytest.mark.parametrize("bits", [16, 12, 10, 8])
def test_the_volume_equals_the_reference_table(bits):
    table = CanLayout(POINTS, bits).volume().rename(index={"all": "TOTAL"})
    with REFERENCE.open() as file:
        rows = [row for row in csv.DictReader(file) if int(row["bits_per_analog"]) == bits]
    assert [row["jb"] for row in rows] == list(table.index)
    # Columns are in the same order, after the name of the box and the bits.
    for row in rows:
        cells = [cell for name, cell in row.items() if name not in ("jb", "bits_per_analog")]
        for ours, theirs in zip(table.loc[row["jb"]], cells, strict=True):
            assert not theirs or ours == pytest.approx(float(theirs))


def test_the_message_set_equals_the_data_file():
    stored = read_messages(datasets.path("synthetic_can_lee2012.csv"))
    assert CanLayout(POINTS).messages() == stored


@pytest.mark.parametrize("bits", [16, 12, 10, 8, 1])
def test_the_table_says_where_each_point_is(bits):
    # As a check, write out each box as one row of bits.
    layout = CanLayout(POINTS, bits)
    table, messages = layout.table(), layout.messages()
    for box in POINTS.boxes:
        own = [point for point in POINTS if point.box == box]
        row = [point.tag for point in own if point.analogue for _ in range(bits)]
        row += [""] * (-len(row) % 8) + [point.tag for point in own if not point.analogue]
        frames = [message.name for message in messages if message.sender == box]
        for point in own:
            places = [place for place, tag in enumerate(row) if tag == point.tag]
            first, last = (frames[places[k] // 64] for k in (0, -1))
            expected = [box, first, places[0] // 8 % 8, len(places), last]
            assert table.loc[point.tag].tolist() == expected
    assert (table["message"] == table["last_message"]).all() == (64 % bits == 0)


def test_what_does_not_fit_is_refused():
    points = [Point("S", "A", "switch", "logic"), Point("P", "B", "4-20 mA", "pressure", 0, 6)]
    assert CanLayout(points, 12).volume().bytes.to_dict() == {"A": 1, "B": 2, "all": 3}
    many = [Point(f"P{k}", f"B{k}", "switch", "logic") for k in range(8)]
    for action, message in (
        (lambda: CanLayout(POINTS, 17), "bits is 17"),
        (lambda: CanLayout([]), "points are empty"),
        (lambda: CanLayout(many), "there are 8 boxes"),
    ):
        with pytest.raises(ArgumentError, match=message):
            action()
