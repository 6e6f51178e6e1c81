"""Features of recorded strokes, limits from other actuators than the one under test, and scores."""

from statistics import median

import numpy as np
import pandas as pd
import pytest

from shipnet import datasets
from shipnet.ballast.strokes import Strokes, read_strokes
from shipnet.errors import ArgumentError, InputError
from tests.support import tolerance


@pytest.fixture(scope="module")
def strokes():
    return read_strokes()


@pytest.fixture(scope="module")
def scores(strokes):
    return strokes.scores()


def some(strokes, places):
    fields = (strokes.values, strokes.actuator, strokes.condition, strokes.stroke)
    return Strokes(*(field[places] for field in fields))


def plain(points):
    """Return burst 1, burst 2 and the flow of a stroke, point by point."""
    angle = [float(x) for x in points[:, 0]]
    end = median(angle[-200:])
    way = [(x - angle[0]) / (end - angle[0]) for x in angle]
    bursts = []
    for channel in (4, 5):
        level = [float(np.log10(x / 10 + 0.3)) for x in points[:, channel]]
        padded = [level[0]] * 8 + level + [level[-1]] * 8
        bursts.append(
            max(level[k] - median(padded[k : k + 17]) for k in range(200) if 0.25 < way[k] < 0.8)
        )

    def time(share):
        k = next(k for k in range(600) if way[k] >= share)
        return k - 1 + (share - way[k - 1]) / (way[k] - way[k - 1])

    high = max((1, 2), key=lambda chamber: points[-100:, chamber].mean())
    speed = 0.6 * abs(end - angle[0]) / (time(0.8) - time(0.2))
    return [*bursts, speed / float(points[150:200, high].mean()) ** 0.5]


def test_features_equal_those_of_a_loop_over_the_points(strokes):
    places = np.arange(0, len(strokes.values), 9)
    table = strokes.table().iloc[places]
    flow = table["flow_opening"].fillna(table["flow_closing"])
    features = np.column_stack([table["burst_1"], table["burst_2"], flow])
    expected = [plain(strokes.values[stroke].astype(float)) for stroke in places]
    np.testing.assert_allclose(features, expected, rtol=0, atol=tolerance("ballast.strokes"))
    assert (table["flow_opening"].notna() == table["opening"]).all()


def test_reported_strokes_equal_those_of_an_independent_program(scores):
    # Counts from an earlier program that shares no code; by actuator, Act_1 to Act_5.
    counted = {
        ("fuzzy", "Gear"): [0, 2, 50, 28, 5],
        ("fuzzy", "Flow"): [0, 0, 20, 48, 0],
        ("fuzzy", "any"): [0, 2, 50, 48, 5],
    }
    for report, expected in counted.items():
        assert scores["reported"].loc[report].tolist() == expected
    one = scores.loc[("fuzzy", "any", "Act_2", "healthy")]
    assert one[["rate", "low", "high"]].tolist() == pytest.approx(
        [2 / 105, 0.0023, 0.0671], abs=1e-4
    )


def test_limits_use_no_stroke_of_the_actuator_under_test(strokes):
    tested = strokes.actuator == "Act_2"
    wild = strokes.values.copy()
    wild[tested, :, 4:6] = np.where(np.arange(600)[:, np.newaxis] % 40 == 0, 9000, 10)
    changed = Strokes(wild, strokes.actuator, strokes.condition, strokes.stroke)
    limits = [
        [variable["high"].corners[0] for variable in one.rules(without="Act_2").variables]
        for one in (strokes, changed)
    ]
    assert limits[0] == limits[1]
    assert limits[0] != [v["high"].corners[0] for v in strokes.rules().variables]


@pytest.mark.parametrize("condition", ["gear damage", "seal defect"])
def test_limits_use_no_faulty_stroke(strokes, condition):
    fewer = some(strokes, strokes.condition != condition)
    assert fewer.rules() == strokes.rules()


def test_no_rule_uses_the_third_pressure(strokes, scores):
    quiet = strokes.values.copy()
    quiet[..., 3] = 0
    silent = Strokes(quiet, strokes.actuator, strokes.condition, strokes.stroke)
    pd.testing.assert_frame_equal(silent.scores(silent), scores)
    assert silent.table()["supply_ripple"].max() == 0


def test_another_file_is_scored_with_the_limits_of_the_shipped_one(strokes, scores, tmp_path):
    path = tmp_path / "other.npz"
    gear = strokes.actuator == "Act_3"
    saved = dict(np.load(datasets.path("vtnsi_actuator_strokes.npz")))
    saved = {key: x if key == "channels" else x[gear] for key, x in saved.items()}
    np.savez(path, **saved | {"actuator": np.full(gear.sum(), "Act_9")})
    scored = read_strokes(path).scores()
    assert scored["reported"].tolist() == scores["reported"].xs("Act_3", level="actuator").tolist()


def test_a_judge_is_called_with_other_actuators_and_the_one_under_test(strokes):
    seen = []

    def judge(known, tested):
        seen.append((sorted(set(known["actuator"])), set(tested["actuator"])))
        return tested["burst_1"].to_numpy() > 0.6

    table = strokes.scores(judges={"typed": judge}).loc["typed", "any"]
    names = ["Act_1", "Act_2", "Act_3", "Act_4", "Act_5"]
    assert seen == [([n for n in names if n != one], {one}) for one in names]
    assert table.index.get_level_values("actuator").tolist() == names
    with pytest.raises(ArgumentError, match=r"judges\['x'\] returned the shape \(\) and the type"):
        strokes.scores(judges={"x": lambda known, tested: True})


def test_a_stroke_that_does_not_move_is_reported_and_one_stroke_is_enough(strokes):
    one = some(strokes, [0])
    assert one.scores()["reported"].tolist() == [0] * 6
    still = Strokes(np.zeros_like(one.values), one.actuator, one.condition, one.stroke)
    reported = still.scores()["reported"].xs("any", level="report")
    assert reported.tolist() == [1, 1]
    negative = Strokes(np.full_like(one.values, -9), one.actuator, one.condition, one.stroke)
    assert negative.scores()["strokes"].tolist() == [1] * 6


def test_without_other_healthy_actuators_there_are_no_limits(strokes):
    alone = some(strokes, strokes.actuator == "Act_1")
    with pytest.raises(ArgumentError, match="healthy actuator has values of burst_1, burst_2"):
        alone.scores(alone)
    opening = some(strokes, strokes.table()["opening"].to_numpy())
    with pytest.raises(ArgumentError, match="no other healthy actuator has values of flow_closing"):
        opening.rules()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"values": None}, "also expected values"),
        ({"values": np.zeros((418, 600, 6))}, r"values have the shape \(418, 600, 6\)"),
        ({"values": np.zeros((0, 600, 7))}, r"values have the shape \(0, 600, 7\)"),
        ({"values": np.array(3)}, r"values have the shape \(\)"),
        ({"values": np.zeros((418, 600, 7), complex)}, "the type complex128"),
        ({"values": np.full((418, 600, 7), np.nan)}, r"values\[0, 0, 0\] is nan"),
        ({"channels": np.array(["angle"])}, "channels are angle; expected"),
        ({"actuator": np.array(["Act_1"])}, r"actuator has the shape \(1,\)"),
        ({"condition": np.zeros(418)}, "condition has the shape .* the type float64; .* string"),
        ({"stroke": np.full(418, "1")}, "expected one whole number for each of 418"),
        ({"actuator": np.array([{}] * 418)}, "not a complete .npz file"),
    ],
)
def test_an_array_of_another_form_is_refused(change, message, tmp_path):
    held = dict(np.load(datasets.path("vtnsi_actuator_strokes.npz"))) | change
    path = tmp_path / "other.npz"
    np.savez(path, **{key: x for key, x in held.items() if x is not None})
    with pytest.raises(InputError, match=message):
        read_strokes(path)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "the file is empty"),
        (b"PK\x03\x04" + bytes(60), "not a complete .npz file"),
        (None, "cannot be read: No such file"),
    ],
)
def test_a_broken_file_is_named(data, message, tmp_path):
    path = tmp_path / "broken.npz"
    if data is not None:
        path.write_bytes(data)
    with pytest.raises(InputError, match=message):
        read_strokes(path)
    whole = datasets.path("vtnsi_actuator_strokes.npz").read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(InputError, match="not a complete"):
        read_strokes(path)
