"""Comparisons over values of settings; for a cluster, see test_parallel."""

import pandas as pd
import pytest

from shipnet.design.catalogue import Range
from shipnet.design.iolist import IoList
from shipnet.design.layout import Site
from shipnet.errors import ArgumentError

LIST = IoList.parse(
    "tag,signal,system,x,y,z,category\n"
    + "".join(f"L{n},contact,S{n % 3},{10 + 4 * n},{n % 5},2,III\n" for n in range(16))
)
SITE = Site((0, 0, 8), tails=4.0)
GRID = {"detour": [1.0, 1.6], "boxes.points": [4, 16]}
WAYS = ["home runs", "junction boxes", "AS-i"]


def test_each_row_agrees_with_a_separate_comparison():
    table = LIST.study(GRID, SITE, WAYS, rules="IMO")
    assert list(table.columns[:3]) == ["detour", "boxes.points", "design"]
    assert len(table) == 12
    for detour in (1.0, 1.6):
        for points in (4, 16):
            values = {"boxes.points": points, "detour": detour, "tails": 4}
            found = LIST.compare((0, 0, 8), WAYS, rules="IMO", settings=values)
            alone = found.table().reset_index()
            mine = table[(table["detour"] == detour) & (table["boxes.points"] == points)]
            pd.testing.assert_frame_equal(
                mine.drop(columns=["detour", "boxes.points"]).reset_index(drop=True),
                alone,
                check_exact=True,
            )


def test_a_varied_setting_changes_only_its_own_figures():
    table = LIST.study(GRID, SITE, WAYS).set_index(["design", "detour", "boxes.points"])
    cost = table["total_cost_eur"]
    assert cost["home runs", 1.6, 4] > cost["home runs", 1.0, 4] == cost["home runs", 1.0, 16]
    assert cost["junction boxes", 1.0, 4] != cost["junction boxes", 1.0, 16]
    rates = LIST.study({"assumptions.labour_rate": [40, Range(40, 80, 90)]}, SITE, WAYS[:1])
    assert rates["labour_h"].nunique() == 1
    low, high = rates["total_cost_eur"]
    assert high - low == pytest.approx(40 * rates["labour_h"][0])
    assert rates["assumptions.labour_rate"].tolist() == [40, Range(40, 80, 90)]


def test_settings_that_are_not_varied_keep_their_values():
    given = {"assumptions.gland": 0, "spare": 1, "host_time": 3}
    points = [{"detour": 1.3}]
    (found,) = LIST.study(points, SITE, ["CAN"], settings=given).to_dict("records")
    alone = LIST.compare(Site((0, 0, 8), detour=1.3, tails=4.0), ["CAN"], settings=given).table()
    assert found["total_cost_eur"] == alone["total_cost_eur"]["CAN"]
    assert found["rules_violated"] == alone["rules_violated"]["CAN"]


def test_all_wrong_values_are_reported_before_anything_is_planned(monkeypatch):
    monkeypatch.setattr("shipnet.design.comparison.plan", None)
    with pytest.raises(ArgumentError) as error:
        LIST.study({"detour": [1.0, 0.5], "asi.inputs": [4, 9]}, SITE, WAYS)
    assert str(error.value) == (
        "asi.inputs is 9; it must be a whole number 1..4; detour is 0.5; it must be 1..10"
    )
    with pytest.raises(ArgumentError, match="there is no setting 'detuor'; the nearest is detour"):
        LIST.study({"detuor": [1.0]}, SITE, WAYS)
    with pytest.raises(ArgumentError, match="no point"):
        LIST.study({"detour": []}, SITE, WAYS)


def test_an_error_in_a_comparison_names_the_grid_point():
    with pytest.raises(ArgumentError, match="option is 'DALI'") as error:
        LIST.study({"detour": [1.0]}, SITE, ["DALI"])
    assert error.value.__notes__ == ["in task 0: {'detour': 1.0}"]
