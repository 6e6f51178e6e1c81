"""Rule bases in files: TOML for people, FCL and structured text for PLCs."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shipnet import datasets
from shipnet.ballast.rule_table import rule_base
from shipnet.errors import ArgumentError, InputError
from shipnet.fuzzy import Interval, Rule, RuleBase, Term, Variable, read_rules
from tests.fuzzy.plc import Fcl, StructuredText, SyntaxFault

BASE = rule_base()
INF = math.inf
LABELS = st.text(st.characters(exclude_categories=("C", "Z"), include_characters=" "), max_size=12)
CORNERS = st.floats(-90, 90)


@st.composite
def terms(draw, name):
    """Draw a term of any shape: ramps, steps, points, open shoulders."""
    a, b, c, d = sorted(draw(st.lists(CORNERS, min_size=4, max_size=4)))
    shapes = [(a, b, c, d), (a, a, d, d), (a, a, a, a), (-INF, -INF, c, d), (a, b, INF, INF)]
    corners = draw(st.sampled_from([*shapes, (-INF, -INF, c, c), (b, b, INF, INF)]))
    ends = draw(st.sampled_from([(a, INF), (-INF, d), (a, d), (b, b)]))
    closed = draw(st.booleans()) or ends[0] == ends[1]
    return Term(name, corners, Interval(*ends, closed, closed), draw(LABELS))


@st.composite
def bases(draw):
    """Draw a rule base with up to three variables and four rules."""
    words = st.from_regex("[A-Za-z][A-Za-z0-9]{0,3}", fullmatch=True)
    names = draw(st.lists(words, min_size=1, max_size=3, unique_by=str.lower))
    variables = [
        Variable(
            name,
            draw(LABELS),
            -100,
            draw(st.floats(91, 1e6)),
            (draw(terms("low")), draw(terms("END"))),
            draw(LABELS),
        )
        for name in names
    ]
    antecedents = [
        tuple((name, draw(st.sampled_from(["low", "END"]))) for name in names[:size])
        for size in range(1, len(names) + 1)
    ]
    priorities = draw(st.permutations(range(1, 10)))
    return RuleBase(
        variables,
        [
            Rule(f"R{k}", pairs, priorities[k], draw(LABELS), draw(LABELS))
            for k, pairs in enumerate(antecedents)
        ],
    )


def saved(base, tmp_path, suffix):
    path = tmp_path / f"rules{suffix}"
    base.save(path)
    return path


# TOML --------------------------------------------------------------------------------------------


@given(bases())
def test_a_saved_rule_base_is_read_back_equal(tmp_path_factory, base):
    path = tmp_path_factory.mktemp("rules") / "a.toml"
    base.save(path)
    assert read_rules(path) == base
    text = path.read_bytes()
    read_rules(path).save(path)
    assert path.read_bytes() == text


def test_a_rule_base_of_a_file_decides_as_the_one_that_was_saved(tmp_path):
    again = read_rules(saved(BASE, tmp_path, ".toml"))
    samples = BASE.random_samples(2000, rng=3)
    for method in ("fuzzy", "crisp", "midpoint"):
        assert (again.decide(samples, method).top == BASE.decide(samples, method).top).all()


def test_a_person_may_write_a_file_with_fewer_keys(tmp_path):
    path = tmp_path / "my.toml"
    path.write_text("""
[[variables]]
name = "Flow"
unit = "l/min"
low = 0
high = 50
terms = [{name = "weak", corners = [-inf, -inf, 8, 10], crisp = "x < 9"}]

[[rules]]
code = "F1"
antecedent = "Flow.weak"
priority = 1
""")
    base = read_rules(path)
    assert base.decide({"Flow": [3, 9.5]}).top.tolist() == ["F1", "normal"]
    assert base["Flow"].english == base.rule("F1").flag == ""


def changed(tmp_path, *changes):
    """Write the rules of the paper with changes to their text."""
    text = datasets.path("kim2014_assumed_rules.toml").read_text(encoding="utf-8")
    for before, after in changes:
        assert before in text
        text = text.replace(before, after, 1)
    path = tmp_path / "my.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_all_faults_of_a_file_are_reported_at_once(tmp_path):
    path = changed(
        tmp_path,
        ("corners = [115.0, 125.0", "corners = [125.0, 115.0"),
        ('crisp = "0 < x < 2.5"', 'crisp = "x is low"'),
        ("low = 0.0\nhigh = 150.0", "low = 200\nhigh = 150"),
        ("priority = 1\n", ""),
        ("priority = 2\n", "priority = 0\n"),
        ('flag = "PpLeak"', 'flags = "PpLeak"'),
        ('antecedent = "OT.hot"', 'antecedent = "OT hot"'),
    )
    with pytest.raises(InputError) as refused:
        read_rules(path)
    texts = [
        "variable 1 (FP), term 1 (high): corners are (125.0, 115.0, inf, inf); they must rise",
        "variable 2 (OP), term 2 (low): crisp is 'x is low'; it must be an Interval, or text like",
        "variable 4 (OT): low of OT is 200; it must be below high, 150",
        "rule 1 (G1): no priority",
        "rule 2 (P1): priority is 0; it must be a whole number 1..9999",
        "rule 3 (P2): 'flags' is unknown; expected code, antecedent, priority, flag, english",
        "rule 8 (O1): antecedent is 'OT hot'; use text like FP.high & OP.high, or pairs",
    ]
    assert len(refused.value.faults) == len(texts)
    for fault, text in zip(refused.value.faults, texts, strict=True):
        assert fault.startswith(text)


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (("priority = 2\n", "priority = 1\n"), "priority 1 occurs twice"),
        (("FP.high & MC.zero", "FP.high & MC.off"), "G1: MC.off is not a term"),
        (("[[variables]]", "[[variable]]"), "variable is unknown; expected variables and rules"),
        (("low = 0.0", "low = 0,0"), "0,0 has a comma instead of a point"),
        (("low = 0.0", 'low = "0"'), r"low of FP is '0'; it must be -1e\+30..1e\+30 bar"),
        (("low = 0.0", "low = nan"), "low of FP is nan"),
        (('unit = "bar"', "unit = 5"), "unit of FP is 5; it must be printable text"),
        (('unit = "bar"', r'unit = "bar\nx"'), r"unit of FP is 'bar\\nx'; it must be printable"),
        (("corners = [115.0, ", "corners = ["), "corners are .*; they must be four numbers"),
        (("corners = [115.0, ", 'corners = ["a", '), "corners are .*; they must be four numbers"),
        (("terms = [", "terms = []\nmore = ["), "terms must be a list of one or more tables"),
        (('code = "G1"', 'code = "normal"'), "code is 'normal', which is reserved"),
        (('code = "G1"', "code = 0x" + "f" * 5000), "rule 1: "),
        (("low = 0.0", "low = 0x" + "f" * 5000), "variable 1 .*: "),
    ],
)
def test_a_fault_names_its_table_and_what_is_legal(tmp_path, change, why):
    with pytest.raises(InputError, match=why):
        read_rules(changed(tmp_path, change))


@pytest.mark.parametrize(
    "text",
    ["", "variables = 5\nrules = []", "variables = [5]\nrules = [[]]", "rules = {}", "[", "\0"],
)
def test_a_file_without_tables_is_refused(tmp_path, text):
    path = tmp_path / "my.toml"
    path.write_text(text)
    with pytest.raises(InputError, match=r"must be a list of one or more tables|not a TOML file"):
        read_rules(path)


def test_a_rule_base_is_saved_as_the_suffix_says_or_not_at_all(tmp_path):
    with pytest.raises(ArgumentError, match=r"its suffix must be \.toml or \.fcl or \.st"):
        BASE.save(tmp_path / "rules.csv")
    assert not list(tmp_path.iterdir())


# PLCs --------------------------------------------------------------------------------------------


def vectors(base, n, rng):
    """Return vectors anywhere, on corners and limits, beside them, beyond them, and missing."""
    values = {}
    for one in base.variables:
        ends = {one.low, one.high, *one.valid, *(x for term in one.terms for x in term.corners)}
        ends = np.array([x for x in ends if math.isfinite(x)])
        beside = [np.nextafter(ends, -INF), np.nextafter(ends, INF)]
        odd = np.concatenate([ends, *beside, [math.nan, INF, -INF, 0.0, -0.0, 1e300, 5e-324]])
        anywhere = rng.uniform(*one.valid, n)
        values[one.name] = np.where(rng.random(n) < 0.5, rng.choice(odd, n), anywhere)
    return values


def ran(program, base, values):
    """Return the strengths that a program computes, shape (n, n_rules), and its other outputs."""
    rows = zip(*(values[one.name].tolist() for one in base.variables), strict=True)
    names = [f"IN_{one.name}".upper() for one in base.variables]
    outputs = [program.run(dict(zip(names, row, strict=True))) for row in rows]
    rules = [f"RULE_{code}".upper() for code in base.codes]
    return np.array([[output[name] for name in rules] for output in outputs]), outputs


def test_structured_text_computes_the_strengths_to_the_last_bit(tmp_path):
    program = StructuredText(saved(BASE, tmp_path, ".st").read_text())
    values = vectors(BASE, 10_000, np.random.default_rng(1))
    strength, outputs = ran(program, BASE, values)
    firing = BASE.fire(values)
    assert strength.tolist() == firing.strength.tolist()
    assert 0 < np.mean((strength > 0) & (strength < 1)) < 1
    missing = [[not output[f"VALID_{name}".upper()] for name in BASE.names] for output in outputs]
    assert missing == (firing.missing | firing.out_of_range).tolist()


def as_single(values, base):
    """Return values of 32 bits, as a REAL has them, without missing ones."""
    singles = {}
    for one in base.variables:
        x = values[one.name].astype("f4").astype(float)
        singles[one.name] = np.where(np.isnan(x), one.valid[1] + 1 + abs(one.valid[1]), x)
    return singles


def test_fcl_computes_the_strengths(tmp_path):
    program = Fcl(saved(BASE, tmp_path, ".fcl").read_text())
    with np.errstate(over="ignore"):
        values = as_single(vectors(BASE, 10_000, np.random.default_rng(2)), BASE)
    strength, _ = ran(program, BASE, values)
    # Single precision moves a limit such as -0.15 by less than one step.
    near = np.zeros(10_000, bool)
    for one in BASE.variables:
        near |= np.isclose(values[one.name][:, None], one.valid, rtol=1e-6, atol=0).any(axis=1)
    assert 0 < near.sum() < 5000
    np.testing.assert_allclose(strength[~near], BASE.fire(values).strength[~near], atol=1e-12)


@given(bases(), st.integers(0, 2**32 - 1))
def test_the_programs_of_any_rule_base_compute_its_strengths(tmp_path_factory, base, seed):
    folder = tmp_path_factory.mktemp("plc")
    values = vectors(base, 200, np.random.default_rng(seed))
    program = StructuredText(saved(base, folder, ".st").read_text(encoding="utf-8"))
    assert ran(program, base, values)[0].tolist() == base.fire(values).strength.tolist()
    program = Fcl(saved(base, folder, ".fcl").read_text(encoding="utf-8"))
    rng = np.random.default_rng(seed)
    anywhere = {one.name: rng.uniform(-200, 2 * one.high, 200) for one in base.variables}
    # A step of a narrow term has a width of 32 bits: no random value lies in it.
    ours = base.fire(anywhere).strength
    np.testing.assert_allclose(ran(program, base, anywhere)[0], ours, atol=1e-9)


def test_the_points_of_fcl_ascend_in_single_precision(tmp_path):
    step = Term("high", (0.1, 0.1, INF, INF), "x >= 0.1")
    base = RuleBase([Variable("P", "bar", 0, 1, (step,))], [Rule("A", "P.high", 1)])
    (terms,) = Fcl(saved(base, tmp_path, ".fcl").read_text()).terms.values()
    (points,) = terms.values()
    x = np.array(points)[:, 0].astype("f4")
    assert (np.diff(x) > 0).all() and np.array(points)[:, 1].tolist() == [0, 1, 1, 0]


@pytest.mark.parametrize("suffix", [".fcl", ".st"])
@pytest.mark.parametrize("name", ["A__B", "A_", "vPos"])
def test_names_that_no_plc_accepts_are_refused(tmp_path, suffix, name):
    other = replace(BASE["OT"], name=name)
    base = RuleBase((*BASE.variables, other), BASE.rules)
    with pytest.raises(ArgumentError, match=f"in_{name}.*underscores must be single"):
        base.save(tmp_path / f"rules{suffix}")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("suffix", [".fcl", ".st"])
def test_no_label_ends_a_comment_and_no_name_is_a_keyword(tmp_path, suffix):
    term = Term("IF", (0, 1, 2, 3), "x > 1", "*) END_VAR (*")
    variable = Variable("END", "*)", 0, 9, (term,), "a *) b (*")
    base = RuleBase([variable], [Rule("S1", "END.IF", 1, "(*", "*) 압력 (*")])
    program = (Fcl if suffix == ".fcl" else StructuredText)(
        saved(base, tmp_path, suffix).read_text(encoding="utf-8")
    )
    assert program.run({"IN_END": 0.5})["RULE_S1"] == 0.5


@pytest.mark.parametrize(("suffix", "kind"), [(".fcl", Fcl), (".st", StructuredText)])
def test_the_interpreters_refuse_what_is_not_a_program(tmp_path, suffix, kind):
    text = saved(BASE, tmp_path, suffix).read_text()
    kind(text)
    for before, after in (
        (";", ""),
        (":=", "="),
        ("REAL", "FLOAT"),
        ("in_FP", "FP"),
        ("0.0", "0"),
        ("END_FUNCTION_BLOCK", ""),
        ("(*", "("),
        ("END_VAR", ""),
    ):
        head, middle, tail = text.rpartition(before)
        assert middle
        with pytest.raises(SyntaxFault):
            kind(head + after + tail)
