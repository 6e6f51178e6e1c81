"""A design of a revised list keeps the boxes, channels, terminals and cables of the first."""

from dataclasses import replace

import pandas as pd
import pytest

from shipnet import datasets, design
from shipnet.__main__ import main
from shipnet.design.revision import numbered
from shipnet.design.settings import Settings
from shipnet.errors import ArgumentError

PLACE = ["x_m", "y_m", "z_m"]
SHIP = design.read_iolist(datasets.path("synthetic_iolist_ship.csv"))
BUSES = ["junction boxes", "AS-i", "AS-i doubled", "CAN", "Modbus RTU doubled"]
MOVED, REMOVED, ADDED, SWAPPED = "ME-JB2-051", "BV01-CLS", "NEW-1", ("BV19-CMDO", "DG3-10")


def revised(table):
    """Return the ship's list with one point moved, one removed, one added, and two swapped."""
    points = table.set_index("tag", drop=False)
    points.loc[MOVED, "x_m"] += 3
    one, two = SWAPPED
    points.loc[[one, two], PLACE] = points.loc[[two, one], PLACE].to_numpy()
    added = points.loc[["BV03-OPN"]].assign(tag=ADDED, x_m=points.loc["BV03-OPN", "x_m"] + 0.5)
    at = points.index.get_loc(REMOVED)
    parts = points.iloc[:at], added, points.iloc[at + 1 :]
    return design.IoList.from_table(pd.concat(parts, ignore_index=True))


def without_boxes(table):
    boxes = ["box_x_m", "box_y_m", "box_z_m", "to_box_m", "home_run_m"]
    return table.assign(box="", **dict.fromkeys(boxes, float("nan")))


@pytest.fixture(scope="module", params=["boxes of the list", "boxes of the planner"])
def designs(request):
    """Return the first and the second design of each bus, with and without keeping."""
    table = SHIP.points if request.param == "boxes of the list" else without_boxes(SHIP.points)
    lists = design.IoList.from_table(table), revised(table)
    first = lists[0].compare((26, 6, 14), BUSES)
    return first, lists[1].compare(first.site, BUSES, keep=first), request.param


def ends(one):
    """Return the ends of each core in use: its devices and its terminals."""
    table = one.tables()["terminals"]
    table = table[table["carries"] != "spare"]
    columns = ["from", "from_terminal", "to", "to_terminal"]
    keys = zip(table["cable"], table["core"], strict=True)
    return dict(zip(keys, table[columns].itertuples(index=False, name=None), strict=True))


def cables_changed(before, after):
    """Return the cables that both designs have, but with other ends."""
    both = before.keys() & after.keys()
    return {cable for cable, core in both if before[cable, core] != after[cable, core]}


DROPS = {f"drop {tag}" for tag in (MOVED, *SWAPPED)}


@pytest.mark.parametrize("name", ["junction boxes", "CAN"])
def test_only_the_changed_points_are_terminated_again(designs, name):
    first, second, boxes = designs
    before, after = ends(first.designs[name]), ends(second.designs[name])
    # A point whose box is in the list stays in it, wherever the point is.
    assert cables_changed(before, after) == (set() if boxes == "boxes of the list" else DROPS)
    names = [{cable for cable, _ in one} for one in (before, after)]
    assert names[0] - names[1] == {f"drop {REMOVED}"}
    assert names[1] - names[0] == {f"drop {ADDED}"}
    table = first.diff(second).loc[name]
    assert table["cables_re_terminated"] == (0 if boxes == "boxes of the list" else 3)
    assert (table["cables_added"], table["cables_removed"]) == (1, 1)


@pytest.mark.parametrize("name", ["AS-i", "AS-i doubled", "Modbus RTU doubled"])
def test_of_other_cables_only_those_at_new_devices_change(designs, name):
    first, second, _ = designs
    before, after = ends(first.designs[name]), ends(second.designs[name])
    tags = {MOVED, ADDED, *SWAPPED}
    drops = {cable for cable in cables_changed(before, after) if cable.startswith("drop")}
    assert all(any(tag in cable for tag in tags) for cable in drops)
    # Fewer than a tenth of the cables that change without keeping.
    fresh = second.iolist.plan(name, first.site, rules=second.rules)
    moved = cables_changed(before, ends(fresh))
    assert "AS-i" not in name or len(cables_changed(before, after)) < len(moved) / 10


@pytest.mark.parametrize("name", BUSES)
def test_unchanged_points_keep_device_and_channel(designs, name):
    first, second, _ = designs
    one, two = (c.designs[name].tables()["points"].set_index("tag") for c in (first, second))
    same = one.index.intersection(two.index).difference([MOVED, *SWAPPED])
    columns = ["device", "channel", "cable"]
    pd.testing.assert_frame_equal(one.loc[same, columns], two.loc[same, columns])
    assert len(same) == len(SHIP) - 4
    # No channel, terminal or cable is used twice.
    hardwired = two["bus"] == "hardwired"
    reader = two["device"].where(~hardwired, "cabinet")
    assert not pd.DataFrame({"reader": reader, "channel": two["channel"]}).duplicated().any()
    assert second.designs[name].cables["run"].is_unique
    table = second.designs[name].tables()["terminals"].query("carries != 'spare'")
    drops = table[table["cable"].str.startswith("drop")]
    assert not drops.duplicated(["from", "from_terminal", "carries", "wire"]).any()


def test_a_removed_point_leaves_a_gap_that_a_like_one_fills():
    first = design.IoList.from_table(without_boxes(SHIP.points)).plan("junction boxes", (26, 6, 14))
    table = without_boxes(SHIP.points)
    fewer = design.IoList.from_table(table[table["tag"] != REMOVED].reset_index(drop=True))
    second = fewer.plan("junction boxes", first.site, keep=first)
    assert cables_changed(ends(first), ends(second)) == set()
    # The third revision puts another contact in the same place: it takes over every terminal.
    other = table.assign(tag=table["tag"].replace(REMOVED, "OTHER"))
    third = design.IoList.from_table(other).plan("junction boxes", first.site, keep=second)
    renamed = {
        (cable.replace("OTHER", REMOVED), core): tuple(
            str(end).replace("OTHER", REMOVED) for end in at
        )
        for (cable, core), at in ends(third).items()
    }
    assert renamed == {key: tuple(map(str, at)) for key, at in ends(first).items()}


def test_the_same_list_changes_nothing():
    first = SHIP.compare((26, 6, 14), BUSES)
    second = SHIP.compare((26, 6, 14), BUSES, keep=first)
    for name in BUSES:
        for table, before in first.designs[name].tables().items():
            pd.testing.assert_frame_equal(before, second.designs[name].tables()[table])
    table = first.diff(second)
    assert (table.drop(columns="words") == 0).all(axis=None)
    assert set(table["words"]) == {"0 km of cable, 0 h, 0 EUR"}


def test_numbers_are_kept_and_the_lowest_free_ones_fill_the_gaps():
    nan = float("nan")
    assert numbered("aaab", [nan, 1, nan, nan]) == [2, 1, 3, 1]
    assert numbered("aaa", [3, nan, 3]) == [3, 1, 2]
    assert numbered("", []) == []


# What changed, in words and money -----------------------------------------------------------------


def test_a_difference_counts_points_cables_and_money(designs):
    first, second, _ = designs
    table = first.diff(second)
    row = table.loc["CAN"]
    assert row["points_added"] == row["points_removed"] == 1
    assert (row["points_moved"], row["points_changed"]) == (3, 0)
    costs = [c.table().loc["CAN", "total_cost_eur"] for c in (first, second)]
    assert row["total_cost_eur"] == pytest.approx(costs[1] - costs[0])
    assert row["words"].startswith(
        f"1 point added ({ADDED}), 1 point removed ({REMOVED}), "
        f"3 points moved ({MOVED}, {SWAPPED[0]}, {SWAPPED[1]}), "
    )
    back = second.diff(first).loc["CAN"]
    assert back["total_cost_eur"] == -row["total_cost_eur"]
    sentence = f"CAN compared with {first.iolist.source}: {row['words']}."
    assert sentence in second.conclusions()
    assert second.add(replace(second.designs["CAN"], name="again")).previous is first
    again = second.plan("CAN").tables()["terminals"]
    pd.testing.assert_frame_equal(again, second.designs["CAN"].tables()["terminals"])
    with pytest.raises(ArgumentError, match=r"design is <Comparison: .*; it must be a Design"):
        second.add(first)


def test_another_ship_is_compared_too():
    points = "tag,signal,x,y,z\nLS-1,contact,3,2,3\nLS-2,contact,30,2,3"
    one = design.IoList.parse(points).compare((0, 0, 0), ["home runs", "CAN"])
    other = design.IoList.parse(points.replace("LS-2,", "XX-9,")).compare((9, 0, 0), ["CAN"])
    table = one.diff(other)
    assert table.index.tolist() == ["CAN"]
    assert table.loc["CAN", ["points_added", "points_removed"]].tolist() == [1, 1]


# The command, and a cabinet by frame and deck -----------------------------------------------------

LIST = "tag,signal,frame,deck,side\nLS-1,contact,FR 10,DK1,P 2\nLS-2,contact,FR 20,DK1,S 3\n"
WORDS = "[frames]\n0 = 0.0\n100 = 60.0\n[decks]\nDK1 = 3.0\nDK3 = 9.0\n"


@pytest.mark.parametrize("where", ["FR 50, DK3, P 2", "FR 50; DK3; P 2", "FR 50/DK3/2 P"])
def test_the_cabinet_may_be_given_by_frame_and_deck(where):
    settings = Settings.parse(WORDS)
    points = design.IoList.parse(LIST, reading=settings.reading)
    for more in ({}, {"settings": settings}):
        assert points.plan("CAN", where, **more).site.cabinet == (30.0, 2.0, 9.0)
    assert points.plan("CAN", "FR 50, DK3").site.cabinet == (30.0, 0.0, 9.0)
    assert points.plan("CAN", "1;2;3").site.cabinet == (1.0, 2.0, 3.0)


@pytest.mark.parametrize(
    "where", ["FR 500, DK3", "FR 50", "DK3", "FR 50, DK9", "FR 50, DK3, Q 2", ""]
)
def test_an_unknown_place_of_the_cabinet_is_refused(where):
    points = design.IoList.parse(LIST, reading=Settings.parse(WORDS).reading)
    with pytest.raises(ArgumentError, match=r"cabinet is .* FR 40, DK3, P 6"):
        points.plan("CAN", where)


def test_the_command_keeps_the_design_of_earlier_lists(tmp_path, capsys):
    old, new, newest = (tmp_path / f"{name}.csv" for name in ("old", "new", "newest"))
    old.write_text(LIST)
    new.write_text(LIST + "LS-3,contact,FR 22,DK1,S 3\n")
    newest.write_text(new.read_text().replace("LS-1,contact,FR 10", "LS-1,contact,FR 60"))
    (tmp_path / "own.toml").write_text(WORDS)
    command = ["design", "--settings", str(tmp_path / "own.toml"), "--cabinet", "FR 50, DK3"]
    command += ["--options", "junction boxes"]
    assert main([*command, str(new), "--previous", str(old)]) in (0, 1)
    out = capsys.readouterr().out
    assert "junction boxes compared with old.csv: 1 point added (LS-3), 1 cable added" in out
    assert main([*command, str(newest), "--previous", str(old), "--previous", str(new)]) in (0, 1)
    assert "compared with new.csv: 1 point moved (LS-1), 1 cable" in capsys.readouterr().out
