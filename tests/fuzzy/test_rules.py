from dataclasses import FrozenInstanceError

import pytest

from shipnet import datasets
from shipnet.ballast.rule_table import VERSIONS, rule_base, rule_vectors
from shipnet.errors import ArgumentError
from shipnet.fuzzy import RuleBase


@pytest.fixture
def base():
    return rule_base()


def test_a_rule_base_refuses_what_does_not_fit(base):
    twice = (*base.rules, base.rules[0])
    with pytest.raises(ArgumentError, match="code G1 occurs twice; priority 1 occurs twice"):
        RuleBase(base.variables, twice)
    with pytest.raises(ArgumentError, match=r"G1: FP\.high is not a term"):
        RuleBase(base.variables[1:], base.rules)
    with pytest.raises(ArgumentError, match="variable FP occurs twice"):
        RuleBase((*base.variables, base.variables[0]), base.rules)
    with pytest.raises(ArgumentError, match="variables or rules are empty"):
        RuleBase(base.variables, ())
    with pytest.raises(ArgumentError, match="code is 'X'"):
        base.rule("X")
    with pytest.raises(ArgumentError, match="variable is 'X'"):
        base["X"]


# Comparison of the shipped files with the transcription of the printed table.


@pytest.fixture
def printed():
    return datasets.read("kim2014_rule_table.csv")


def test_the_assumed_rules_are_the_rows_of_the_table(base, printed):
    rows = printed[printed["no"] != "0"]
    assert rows["code"].tolist() == list(base.codes)
    # The table's DV is the signal that the paper calls DVPos.
    assert rows["terms"].str.replace("DV.", "DVPos.").tolist() == [r.text for r in base.rules]
    assert rows["flag_corrected"].tolist() == [rule.flag for rule in base.rules]
    # The special is reported before the general.
    assert " ".join(base.ranking) == "G1 P1 V1 P2 V2 Pos1 Pos2 S1 S2 Pos3 Pos4 O1"
    assert [rule.english.split(" (")[0] for rule in base.rules[:8]] == [
        "pressure gauge fault",
        "pump overload",
        "pump leakage",
        "valve stuck",
        "piston leakage",
        "position switch error",
        "position switch error",
        "motor too hot",
    ]


def test_the_assumed_terms_compare_as_the_table_prints(base, printed):
    constants = {"OPEN": "100", "CLOSE": "0"}
    for rule, text in zip(base.rules, printed["antecedent_corrected"][1:], strict=True):
        for (variable, term), part in zip(base.terms_of(rule), text.split(" and "), strict=True):
            for name, value in constants.items():
                part = part.replace(name, value)
            assert str(term.crisp) == part.replace(variable.name, "x")


def test_the_assumed_ramps_are_a_half_at_the_printed_limit_or_have_a_stated_reason(base):
    moved = {
        f"{variable.name}.{term.name}"
        for variable in base.variables
        for term in variable.terms
        for crisp, half in (
            (term.crisp.low, term.midpoint.low),
            (term.crisp.high, term.midpoint.high),
        )
        if abs(crisp - half) > 1e-12
    }
    # Zeros have a dead band, OT a shoulder at the limit, VPos a margin for noise at the end stop.
    zeros = {"OP.low", "MC.zero", "MC.run", "DVPos.still"}
    assert moved == zeros | {"OT.hot", "VPos.above", "VPos.below"}


@pytest.mark.parametrize("version", VERSIONS)
def test_the_assumed_vectors_are_the_inputs_of_the_table(printed, version):
    table = rule_vectors(version)
    assert table.index.tolist() == printed["code"].tolist()
    columns = {"FP": "fp_printed", "OP": "op_printed", "MC": "mc_printed", "OT": "ot_printed"}
    columns["VPos"] = {"printed": "vpos_printed", "corrected": "vpos_corrected_percent"}[version]
    for name, column in columns.items():
        text = printed[column].str.removeprefix("0 or ").tolist()
        ours = ["" if x != x else f"{x:g}" for x in table[name]]
        assert ours == text
    speeds = table["DVPos"].dropna().to_dict()
    # The table corrects V2; we assume that the normal valve moves.
    assert speeds == ({} if version == "printed" else {"normal": 10, "V2": 0})


def test_the_assumed_fills_do_not_change_printed_values():
    for version in VERSIONS:
        bare = rule_vectors(version)
        for fill in ("normal", "physical"):
            full = rule_vectors(version, fill=fill)
            assert full.where(bare.notna()).equals(bare)
            assert full.drop(columns="DVPos").notna().all(axis=None)
    off = rule_vectors(fill="physical").loc["S1"]
    assert off.fillna(-1).tolist() == [0, 0, 0, 50, 105, -1]


@pytest.mark.parametrize("wrong", [{"version": "guessed"}, {"fill": "zero"}])
def test_an_unknown_version_or_fill_is_refused(wrong):
    with pytest.raises(ArgumentError, match="must be one of"):
        rule_vectors(**wrong)


def test_the_rules_of_the_paper_are_built_once_and_cannot_be_changed(base):
    assert rule_base() is base and rule_base(slow_stroke=10) is not base
    for part in (base, base.variables[0], base.rules[0], base.variables[0].terms[0]):
        name = next(iter(part.__dataclass_fields__))
        with pytest.raises(FrozenInstanceError):
            setattr(part, name, None)
        assert isinstance(hash(part), int)
