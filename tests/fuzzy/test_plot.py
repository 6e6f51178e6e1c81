import numpy as np
import pytest
from matplotlib.figure import Figure

from shipnet.ballast.rule_table import rule_base
from shipnet.errors import ArgumentError

BASE = rule_base()


@pytest.fixture
def ax():
    return Figure(figsize=(7.5, 3)).subplots()


def test_terms_are_drawn_over_the_universe_with_their_corners(ax):
    variable = BASE["MC"]
    assert variable.plot(ax=ax) is ax
    lines = {line.get_label(): line for line in ax.lines}
    for term in variable.terms:
        x, y = lines[term.english].get_data()
        assert np.array_equal(y, term.membership(x))
        inner = [corner for corner in term.corners if 0 < corner < 6]
        assert set(inner) <= set(x) and (x[0], x[-1]) == (0, 6)
    assert ax.get_xlabel() == "motor current MC [A]"
    assert ax.get_xlim() == (0, 6)
    printed = [line for line in ax.lines if line.get_linestyle() == "--"]
    assert [line.get_xdata()[0] for line in printed] == [0, 2.5]
    shown = [text.get_text() for text in ax.get_legend().get_texts()]
    assert shown == ["zero", "running", "over", "as printed"]


def test_terms_are_drawn_without_the_comparisons_if_asked(ax):
    BASE["MC"].plot(ax=ax, crisp=False)
    assert len(ax.lines) == 3


def test_firing_strengths_are_a_matrix_with_numbers(ax):
    firing = BASE.fire({"FP": [125, 120, 90], "MC": 0})
    assert firing.plot(["a", "b", "c"], ax=ax) is ax
    assert np.array_equal(ax.images[0].get_array(), firing.strength.T)
    assert {text.get_text(): text.get_position() for text in ax.texts} == {
        "1": (0, 0), ".50": (1, 0),
    }  # fmt: skip
    assert [label.get_text() for label in ax.get_yticklabels()] == list(BASE.codes)
    assert [label.get_text() for label in ax.get_xticklabels()] == ["a", "b", "c"]


def test_many_samples_have_no_numbers(ax):
    firing = BASE.fire({"FP": np.linspace(110, 130, 21), "MC": 0})
    firing.plot(ax=ax)
    assert not ax.texts and ax.images[0].get_array().shape == (12, 21)


def test_strengths_that_are_not_a_matrix_are_not_drawn(ax):
    with pytest.raises(ArgumentError, match="at most two can be drawn"):
        BASE.fire({"FP": [[1]]}).plot(ax=ax)
    with pytest.raises(ArgumentError, match="2 labels; expected 1"):
        BASE.fire({"FP": [1]}).plot(["a", "b"], ax=ax)


def test_overlaps_are_drawn_as_percentages_and_subsets_are_marked(ax):
    assert BASE.plot_overlaps(ax=ax) is ax
    texts = {text.get_position(): text.get_text() for text in ax.texts}
    codes = list(BASE.codes)
    place = {code: number for number, code in enumerate(codes)}
    assert texts[place["S1"], place["Pos1"]] == "in"
    assert texts[place["Pos1"], place["S1"]] == "33"
    assert (place["P2"], place["G1"]) not in texts
    assert sum(text == "in" for text in texts.values()) == 6
    assert len(texts) == 2 * 42
    fired = BASE.regions()["fired"].str.split()
    count = [[sum(a in one and b in one for one in fired) for b in codes] for a in codes]
    assert np.allclose(ax.images[0].get_array(), np.array(count) / np.diag(count)[:, None])
