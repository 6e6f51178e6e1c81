"""Seven lists of different yards give the points that they describe, and say what they did."""

import csv
import io

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shipnet.design import IoList, Settings, read_iolist
from shipnet.errors import InputError
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
    for name in ("system", "box", "signal"):
        assert table[name].tolist() == [point[name] for point in points.values()]
    for name in ("x_m", "y_m", "z_m", "home_run_m", "update_ms"):
        expected = [point[name] for point in points.values()]
        assert table[name].tolist() == pytest.approx(expected, abs=1e-9), name
    read = iolist.reading()
    left = read[read["what"].str.startswith(tuple(f"left out, {why}" for why in LEFT_OUT))]
    assert left["count"].sum() == void
    assert not any("y is 0" in remark for remark in iolist.remarks)


# What a list may look like, at random ---------------------------------------------------------

#: Titles by column, each with its factor from the column's unit, and the settings that map it.
TITLES = {
    "tag": [("tag", 1), ("Tag No.", 1), ("태그번호", 1), ("Messstelle", 1)],
    "system": [("system", 1), ("Anlage", 1), ("System / 계통", 1)],
    "signal": [("signal", 1), ("Sensor type", 1), ("신호", 1)],
    "x_m": [("x_m", 1), ("X [mm]", 1000), ("FROM AP (cm)", 100), ("위치 X", 1), ("X in mm", 1000)],
    "y_m": [("y_m", 1), ("Y", 1), ("Y (m) / 위치 Y", 1), ("y, mm", 1000)],
    "z_m": [("z_m", 1), ("elevation (cm)", 100), ("Z좌표 [m]", 1)],
    "home_run_m": [("home_run_m", 1), ("Cable length [cm]", 100), ("Kabellänge", 1)],
    "update_ms": [("update_ms", 1), ("Scan", 1), ("Zyklus [s]", 0.001), ("cycle time in s", 0.001)],
}
OWN = Settings.parse('[columns]\n"FROM AP (cm)" = "x_m"\n').reading


@st.composite
def lists(draw):
    """Return rows of numbers by column, and the same as the text of a list."""
    length = st.integers(1, 99_000).map(lambda n: n / 100)
    rows = draw(
        st.lists(
            st.tuples(
                st.sampled_from(["Bilge", "Fuel", "Cooling"]),
                st.sampled_from(["contact", "rtd_3wire"]),
                length,
                length.map(lambda y: y - 400),
                length,
                length,
                st.integers(1, 9).map(lambda n: 250 * n),
            ),
            min_size=2,
            max_size=8,
        )
    )
    points = [dict(zip(TITLES, (f"T-{n}", *row), strict=True)) for n, row in enumerate(rows)]
    columns = draw(st.permutations(list(TITLES)))
    chosen = {name: draw(st.sampled_from(TITLES[name])) for name in columns}
    mark, separator = draw(st.sampled_from([(".", ","), (".", ";"), (",", ";"), (",", "\t")]))
    style = draw(st.sampled_from(["plain", "unit", "wide"]))
    lines, before = [[title for title, _ in chosen.values()]], {}
    for point in points:
        cells = []
        for name in columns:
            value = point[name]
            if isinstance(value, str):
                same = name == "system" and before.get(name) == value
                cells.append('"' if same and draw(st.booleans()) else value)
                continue
            factor = chosen[name][1]
            if style == "unit":  # the unit of a cell overrides that of its title
                factor, unit = draw(
                    st.sampled_from(
                        [(1, "ms"), (0.001, "s")]
                        if name == "update_ms"
                        else [(1, " m"), (1000, "mm")]
                    )
                )
            cell = f"{value * factor:.7f}".rstrip("0").rstrip(".")
            cell = cell.replace(".", mark) + (unit if style == "unit" else "")
            if style == "wide":
                cell = "".join(chr(ord(c) + 0xFEE0) for c in cell)
            cells.append(cell)
        lines.append(cells)
        before = point
    if draw(st.booleans()):
        lines.insert(draw(st.integers(1, len(lines))), ["MAIN ENGINE"] + [""] * 7)
    if draw(st.booleans()):
        lines[:0] = [["HULL 1"], ["Rev. C", "", "page 1"]]
    stream = io.StringIO()
    csv.writer(stream, delimiter=separator).writerows(lines)
    return points, stream.getvalue()


@settings(max_examples=150)
@given(lists())
def test_titles_units_orders_and_marks_do_not_change_the_points(made):
    points, text = made
    try:
        iolist = IoList.parse(text, reading=OWN)
    except InputError as error:
        # Numbers such as 1.234 are refused if no other number shows the decimal mark.
        assert all("it may be" in fault for fault in error.faults), error.faults
        return
    read = iolist.points
    assert read["tag"].tolist() == [point["tag"] for point in points]
    for name in TITLES:
        expected = [point[name] for point in points]
        if isinstance(expected[0], str):
            assert read[name].tolist() == expected
        else:
            assert read[name].tolist() == pytest.approx(expected, abs=1e-9)
