"""Seven lists of different yards give the points that they describe, and say what they did."""

import pytest

from shipnet.design import Settings, read_iolist
from tests.design import yards

LEFT_OUT = ("marked as deleted", "deleted or not fitted", "struck out", "with a dash")


@pytest.mark.parametrize("yard", yards.YARDS, ids=lambda yard: yard.__name__)
def test_a_list_of_a_yard_gives_the_points_it_describes(yard, tmp_path):
    points = yards.truth()
    suffix, data, settings, void = yard(points)
    path = tmp_path / f"list.{suffix}"
    path.write_bytes(data)
    iolist = read_iolist(path, settings=Settings.parse(settings))
    table = iolist.points.set_index("tag")
    assert table.index.tolist() == list(points)
    for tag, expected in points.items():
        row = table.loc[tag]
        for name in ("system", "box", "signal"):
            assert row[name] == expected[name], (tag, name)
        for name in ("x_m", "y_m", "z_m", "home_run_m", "update_ms"):
            assert row[name] == pytest.approx(expected[name], abs=1e-9), (tag, name)
    read = iolist.reading()
    left = read[read["what"].str.startswith(tuple(f"left out, {why}" for why in LEFT_OUT))]
    assert left["count"].sum() == void
    assert not any("y is 0" in remark for remark in iolist.remarks)
