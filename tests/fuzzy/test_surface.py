"""What rules do over two variables, and where no rule fires."""

import matplotlib.pyplot as plt
import numpy as np
import pytest

from shipnet.ballast import Command, simulate
from shipnet.ballast.rule_table import rule_base
from shipnet.errors import ArgumentError
from shipnet.fuzzy import NORMAL, UNDETERMINED, Rule, RuleBase, Term, Variable

BASE = rule_base()
INF = float("inf")
AT = {"MC": 1.2, "OT": 50, "VPos": 50, "DVPos": 0}


def test_a_surface_shows_the_decision_at_each_place(ax):
    assert BASE.plot_surface("FP", "OP", AT, ax=ax) is ax
    (image,) = ax.images
    left, right, bottom, top = image.get_extent()
    assert (left, right, bottom, top) == (0, 160, 0, 10)
    numbers = image.get_array()
    names = [text.get_text() for text in ax.texts]
    assert names == ["normal", "V2", "P2", "V1"]  # in the order of their priorities
    for text, name in zip(ax.texts, names, strict=True):  # each name is within its region
        x, y = text.xy
        assert BASE.decide({**AT, "FP": x, "OP": y}).top == name
    rng = np.random.default_rng(1)
    for row, column in rng.integers(0, len(numbers), (300, 2)):
        x, y = column / (len(numbers) - 1) * 160, row / (len(numbers) - 1) * 10
        decided = BASE.decide({**AT, "FP": x, "OP": y})
        assert names[int(numbers[row, column])] == decided.top
        strength = 1.0 if decided.top == NORMAL else decided.firing[decided.top]
        assert image.get_alpha()[row, column] == pytest.approx(strength)
    assert ax.get_xlabel() == "oil pump pressure FP [bar]"
    assert ax.get_ylabel() == "operating pressure OP [bar]"


def test_a_surface_shows_the_strength_of_one_rule(ax):
    BASE.plot_surface("OP", "FP", code="V1", ax=ax)
    (image,) = ax.images
    strength = image.get_array()
    pressure, low = np.linspace(0, 160, len(strength)), np.linspace(0, 10, len(strength))
    grid = {"FP": pressure[:, np.newaxis], "OP": low[np.newaxis]}
    assert strength.tolist() == BASE.fire(grid)["V1"].tolist()
    assert 0 < np.mean((strength > 0) & (strength < 1)) < 0.2


def test_a_surface_without_the_other_readings_is_undetermined(ax):
    BASE.plot_surface("FP", "OP", ax=ax)
    assert [text.get_text() for text in ax.texts] == [UNDETERMINED, "V1"]


def test_crisp_regions_do_not_fade(ax):
    at = {"FP": 125, "OT": 50, "VPos": 50, "DVPos": 0}
    BASE.plot_surface("MC", "OP", at, method="crisp", ax=ax)
    (image,) = ax.images
    assert set(np.unique(image.get_alpha())) == {1.0}
    # The pressure gauge is faulty (G1) at exactly 0 A: a strip, whose name is beside it.
    assert {text.get_text(): bool(text.arrow_patch) for text in ax.texts} == {
        "normal": True,
        "V2": False,
        "V1": False,
        "P1": False,
        "G1": True,
    }
    # The printed rules: P1 is FP > 120 and MC > 2.5; V1 is FP > 120 and OP >= 2.5.
    numbers = image.get_array().astype(int)
    MC, OP = np.linspace(0, 6, numbers.shape[1]), np.linspace(0, 10, numbers.shape[0])
    assert ((numbers == numbers[-1, -1]) == (MC > 2.5)).all()
    assert ((numbers == numbers[-1, 5])[:, 5] == (OP >= 2.5)).all()


@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        (("FP", "FP"), "x is 'FP', y is 'FP'; they must be two variables"),
        (("FP", "OP", {"OP": 1}), "two variables that are not in others"),
        (("FP", "XX"), "variable is 'XX'; the variables are"),
        (("FP", "OP", {"XX": 1}), "samples contain XX"),
    ],
)
def test_a_surface_needs_two_variables(arguments, why):
    with pytest.raises(ArgumentError, match=why):
        BASE.plot_surface(*arguments)
    before = plt.get_fignums()
    with pytest.raises(ArgumentError, match="code is 'X'"):
        BASE.plot_surface("FP", "OP", code="X")
    assert plt.get_fignums() == before  # no empty figure


def test_strengths_on_a_grid_name_the_method_that_draws_them():
    with pytest.raises(ArgumentError, match=r"RuleBase\.plot_surface draws a decision"):
        BASE.fire({"FP": np.zeros((3, 1)), "OP": np.zeros(4)}).plot()


def test_text_in_a_label_is_no_formula(ax):
    term = Term("high", (1, 2, INF, INF), "x > 1", r"$\frac{$")
    variables = [Variable(name, r"$\frac{$", 0, 5, (term,), r"$\frac{$") for name in "AB"]
    base = RuleBase(variables, [Rule("F", "A.high & B.high", 1)])
    base.plot_surface("A", "B", ax=ax)
    ax.figure.canvas.draw()
    ax.clear()
    base["A"].plot(ax)
    ax.figure.canvas.draw()
    assert any(r"\$\frac{\$" in text.get_text() for text in ax.texts or [ax.xaxis.label])


# Gaps --------------------------------------------------------------------------------------------


def small():
    """Return two variables with a fault each; between them the plant is healthy, or a gap."""
    high = Term("high", (6, 6, INF, INF), "x >= 6")
    low = Term("low", (-INF, -INF, 2, 2), "x <= 2")
    variables = [Variable("A", "", 0, 10, (low, high)), Variable("B", "", 0, 10, (low, high))]
    rules = [Rule("F1", "A.high", 1), Rule("F2", "A.low & B.low", 2)]
    return RuleBase(variables, rules)


def test_a_region_in_which_a_healthy_plant_operates_is_not_a_gap():
    base = small()
    healthy = {"A": [4, 4, 4, 4, np.nan, 30, 7], "B": [4, 5, 1, 2, 4, 4, 4]}
    table = base.regions(healthy=healthy)
    assert list(table.columns) == ["A", "B", "fired", "count", "healthy"]
    counts = table.set_index(["A", "B"])["healthy"]
    # The missing value and the one that no sensor reports are in no region.
    assert counts.sum() == 5
    assert (counts[4, 1], counts[4, 4], counts[8, 4]) == (2, 2, 1)
    gaps = table.query("count == 0 and healthy == 0")[["A", "B"]].to_numpy().tolist()
    assert gaps == [[1, 4], [1, 8], [4, 8]]
    assert table.query("count > 0 and healthy > 0")["fired"].tolist() == ["F1"]


@pytest.mark.parametrize("method", ["crisp", "midpoint"])
def test_every_sample_is_counted_in_the_region_whose_rules_it_fires(method):
    rng = np.random.default_rng(4)
    samples = BASE.random_samples(300, rng)
    for name in ("MC", "VPos"):
        ends = [-0.1, 0.0, 2.5, 6.2] if name == "MC" else [-25, -0.5, 0, 100, 330]
        samples[name] = rng.choice(ends, 300)
    table = BASE.regions(method, healthy=samples)
    assert table["healthy"].sum() == 300
    fires = BASE.fire(samples, method).strength > 0
    codes = np.array(BASE.codes)
    fired = [" ".join(codes[row]) for row in fires]
    ours = table.groupby("fired")["healthy"].sum()
    assert ours[ours > 0].to_dict() == {text: fired.count(text) for text in fired}


def test_a_reading_just_above_the_universe_counts_as_its_end():
    top = Term("top", (2, 3, 10.2, 10.8), "x > 3")
    base = RuleBase([Variable("A", "", 0, 10, (top,))], [Rule("F1", "A.top", 1)])
    table = base.regions("midpoint", healthy={"A": [10.6, 10.6, 1]})
    assert table.set_index("fired")["healthy"].to_dict() == {"": 1, "F1": 2}


def test_no_sample_and_no_argument():
    base = small()
    assert (base.regions(healthy={"A": [], "B": []})["healthy"] == 0).all()
    assert base.regions(healthy={"A": 4, "B": 4})["healthy"].sum() == 1
    assert "healthy" not in base.regions()
    with pytest.raises(ArgumentError, match="samples contain C"):
        base.regions(healthy={"C": [1]})


def test_four_regions_of_the_paper_without_a_rule_are_those_of_healthy_valves():
    run = simulate(16, [Command("open", 5.0), Command("close", 60.0)], until=120, rng=1)
    healthy = {**run.samples, "DVPos": run.speed}
    table = BASE.regions(healthy=healthy)
    empty = table[table["count"] == 0]
    assert (len(empty), (empty["healthy"] > 0).sum()) == (41, 4)
    # As printed, noise makes most healthy samples fire a rule; with ramps, hardly any does.
    share = {}
    for method in ("crisp", "midpoint"):
        table = BASE.regions(method, healthy=healthy)
        fired = table["healthy"][table["count"] > 0].sum()
        share[method] = fired / table["healthy"].sum()
        decided = BASE.decide(healthy, method).top
        known = ~np.isnan(run.speed)
        assert fired == np.isin(decided[known], [NORMAL, UNDETERMINED], invert=True).sum()
    assert share["crisp"] > 0.5 and share["midpoint"] < 0.005
