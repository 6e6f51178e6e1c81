import pytest
from hypothesis import given
from hypothesis import strategies as st

from shipnet import datasets
from shipnet.ballast.rule_table import VERSIONS, rule_base, rule_vectors
from shipnet.errors import ArgumentError, InputError
from shipnet.fuzzy import Interval, Rule, RuleBase, Term, read_rules
from shipnet.fuzzy.rules import RULE_COLUMNS, TERM_COLUMNS

FILES = [datasets.path(f"kim2014_assumed_{what}.csv") for what in ("rules", "terms")]
RULES, TERMS = (file.read_text("utf-8") for file in FILES)


@pytest.fixture
def base():
    return rule_base()


@pytest.fixture
def load(tmp_path):
    def loaded(rules=RULES, terms=TERMS):
        files = tmp_path / "rules.csv", tmp_path / "terms.csv"
        for file, content in zip(files, (rules, terms), strict=True):
            data = content if isinstance(content, bytes) else content.encode("utf-8")
            file.write_bytes(data)
        return read_rules(*files)

    return loaded


def faults_of(load, **texts):
    with pytest.raises(InputError) as caught:
        load(**texts)
    return caught.value.faults


def test_the_shipped_rules_are_written_back_to_the_byte(base, tmp_path):
    files = tmp_path / "rules.csv", tmp_path / "terms.csv"
    base.save(*files)
    assert [file.read_text("utf-8") for file in files] == [RULES, TERMS]


@given(
    st.lists(st.floats(-1e5, 1e5), min_size=4, max_size=4).map(sorted),
    st.text("abc ,;\"'\u538b&.", max_size=8).map(str.strip),
)
def test_any_rule_base_survives_its_files(tmp_path_factory, corners, label):
    base = rule_base()
    term = Term("high", tuple(corners), Interval(0.1, 2.5), label, label)
    rule = Rule("V1", (("FP", "high"),), 1, label, label, label)
    variable = type(base.variables[0])("FP", "bar", -1e6, 1e6, (term,), label, label)
    base = RuleBase((variable,), (rule,))
    folder = tmp_path_factory.mktemp("rules")
    files = folder / "rules.csv", folder / "terms.csv"
    base.save(*files)
    assert read_rules(*files) == base


@pytest.mark.parametrize("separator", [";", "\t"])
def test_a_spreadsheet_may_have_its_own_separator_and_mark(load, base, separator):
    texts = {"rules": RULES, "terms": TERMS}
    changed = {
        what: ("\ufeff" + text.replace(",", separator)).replace("\n", "\r\n\r\n")
        for what, text in texts.items()
    }
    assert load(**changed) == base


def test_columns_may_come_in_any_order_and_a_note_is_ignored(load):
    made = load(
        rules="note,priority,antecedent,code\nremark,7,FP.high,A\n",
        terms="term,variable,high,low,left_foot,left_shoulder,crisp\n,FP,9,0,,,\nhigh,FP,,,1,2,x>1\n",
    )
    assert made.rule("A").priority == 7
    assert made["FP"]["high"].corners == (1, 2, float("inf"), float("inf"))


def test_all_faults_of_the_rules_are_reported_at_once(load):
    rows = [
        "A,FP.high,,1,,", "B,FP.high,,x,,", "C,FP high,,3,,", "A,FP.huge & XX.high,,1,,",
        "normal,FP.high,,5,,", "D,FP.high & FP.none,,6,,", "E e,FP.high,,7,,", ",FP.high,,8,,",
        "F,,,9,,", "G,FP.high,,0,,",
    ]  # fmt: skip
    faults = faults_of(load, rules="\n".join([",".join(RULE_COLUMNS), *rows]))
    said = "\n".join(faults)
    for start, part in [
        ("row 3", "column priority: 'x'; expected a whole number 1..9999"),
        ("row 4", "antecedent is 'FP high'"),
        ("row 5", "there is no term FP.huge"),
        ("row 5", "there is no term XX.high"),
        ("row 5", "code A occurs twice"),
        ("row 5", "priority 1 occurs twice"),
        ("row 6", "means that no rule fires"),
        ("row 7", "each of a different variable"),
        ("row 8", "code is 'E e'"),
        ("row 9", "code is ''"),
        ("row 10", "antecedent is ''"),
        ("row 11", "priority is 0"),
    ]:
        assert any(one.startswith(f"{start}:") and part in one for one in faults), (part, said)
    assert len(faults) == 12


def test_all_faults_of_the_terms_are_reported_at_once(load):
    rows = [
        "FP,,bar,0,160,,,,,,,", "FP,high,,,,125,115,,,x > 120,,", "FP,none,,,,,,a,3,x < 2.5,,",
        "FP,low,bar,,,,,2,3,x < 2,,", "FP,odd,,,,1,2,,,about 3,,", "FP,,bar,0,160,,,,,,,",
        "OP,,bar,9,1,,,,,,,", "OP,a,,,,1,2,,,x > 1,,", "QQ,a,,,,1,2,,,x > 1,,",
        "MC,,A,0,6,,,,,x > 1,,",
    ]  # fmt: skip
    faults = faults_of(load, terms="\n".join([",".join(TERM_COLUMNS), *rows]))
    for part in (
        "row 3: corners are",
        "row 4: column right_shoulder: 'a'; expected a number",
        "row 5, column unit: 'bar'; expected nothing, a term has none",
        "row 6: crisp is 'about 3'",
        "row 7: variable FP occurs twice",
        "row 8: low of OP is 9, high 1",
        "no row describes variable 'QQ'",
        "row 11, column crisp: 'x > 1'; expected nothing",
        "row 11: terms of MC are none",
    ):
        assert any(part in one for one in faults), (part, faults)
    assert len(faults) == 9


@pytest.mark.parametrize(
    ("rules", "fault"),
    [
        ("", "is empty"),
        ("\n ;,\n", "is empty"),
        ("code,antecedent,priority\n", "has no rule"),
        ("code,priority,colour,code\n", "title 'colour' is unknown"),
        ("code,priority,colour,code\n", "no column antecedent"),
        ("code,priority,colour,code\n", "title 'code' occurs twice"),
        ("code,antecedent,priority\nA,FP.high,1,,x\n", "row 2 has 5 cells; expected 3"),
        (b"code\xff", "is not UTF-8: byte 4"),
        ("code\0", "zero bytes"),
    ],
)
def test_a_file_that_holds_no_rules_says_why(load, rules, fault):
    assert any(fault in one for one in faults_of(load, rules=rules))


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(InputError, match=r"absent\.csv: cannot be read"):
        read_rules(FILES[0], tmp_path / "absent.csv")
    with pytest.raises(InputError, match="cannot be read"):
        read_rules(tmp_path, FILES[1])


@given(st.one_of(st.binary(max_size=80), st.text('code,antprily\n;"x.&1', max_size=80)))
def test_arbitrary_bytes_are_rules_or_an_input_error(tmp_path_factory, data):
    file = tmp_path_factory.mktemp("any") / "rules.csv"
    file.write_bytes(data if isinstance(data, bytes) else data.encode())
    for files in ((file, FILES[1]), (FILES[0], file)):
        try:
            assert read_rules(*files).rules
        except InputError as error:
            assert error.faults


def test_a_rule_base_refuses_what_does_not_fit(base):
    twice = (*base.rules, base.rules[0])
    with pytest.raises(ArgumentError, match="code G1 occurs twice; G1: priority 1 occurs twice"):
        RuleBase(base.variables, twice)
    with pytest.raises(ArgumentError, match=r"no term FP\.high"):
        RuleBase(base.variables[1:], base.rules)
    with pytest.raises(ArgumentError, match="variable FP occurs twice"):
        RuleBase((*base.variables, base.variables[0]), base.rules)
    with pytest.raises(ArgumentError, match="variables or rules are empty"):
        RuleBase(base.variables, ())
    with pytest.raises(ArgumentError, match="code is 'X'"):
        base.rule("X")
    with pytest.raises(ArgumentError, match="variable is 'X'"):
        base["X"]


def test_the_table_has_a_row_per_rule(base):
    assert base.table()["code"].tolist() == list(base.codes)
    assert base.table().loc[3, "antecedent"] == "FP.high & OP.high"


# The shipped files against the transcription of the printed table.


@pytest.fixture
def printed():
    return datasets.read("kim2014_rule_table.csv")


def test_the_assumed_rules_are_the_rows_of_the_table(base, printed):
    rows = printed[printed["no"] != "0"]
    assert rows["code"].tolist() == list(base.codes)
    # The table's DV is the signal that the paper calls DVPos.
    assert rows["terms"].str.replace("DV.", "DVPos.").tolist() == [r.text for r in base.rules]
    assert rows["flag_corrected"].tolist() == [rule.flag for rule in base.rules]
    assert [rule.english.split(" (")[0] for rule in base.rules[:8]] == [
        "pressure gauge fault", "pump overload", "pump leakage", "valve stuck", "piston leakage",
        "position switch error", "position switch error", "motor too hot",
    ]  # fmt: skip


def test_the_assumed_terms_compare_as_the_table_prints(base, printed):
    constants = {"OPEN": "100", "CLOSE": "0"}
    for rule, text in zip(base.rules, printed["antecedent_corrected"][1:], strict=True):
        for (variable, term), part in zip(base.terms_of(rule), text.split(" and "), strict=True):
            for name, value in constants.items():
                part = part.replace(name, value)
            assert str(term.crisp) == part.replace(variable.name, "x")


def test_the_assumed_ramps_have_a_half_on_the_printed_limit_or_a_stated_reason(base):
    moved = {
        f"{variable.name}.{term.name}"
        for variable in base.variables
        for term in variable.terms
        for crisp, half in (
            (term.crisp.low, term.midpoint.low), (term.crisp.high, term.midpoint.high),
        )
        if abs(crisp - half) > 1e-12
    }  # fmt: skip
    # Zeros get a dead band, OT its shoulder on the limit, VPos room for noise at the end stop.
    zeros = {"OP.low", "MC.zero", "MC.run", "DVPos.still"}
    assert moved == zeros | {"OT.hot", "VPos.above", "VPos.below"}


def test_the_assumed_priorities_put_the_special_before_the_general(base):
    assert base.ranking == (
        "G1", "P1", "V1", "P2", "V2", "Pos1", "Pos2", "S1", "S2", "Pos3", "Pos4", "O1",
    )  # fmt: skip


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
    # The table corrects V2; that the normal valve moves is our assumption.
    assert speeds == ({} if version == "printed" else {"normal": 10, "V2": 0})


def test_the_assumed_fills_leave_what_is_printed_alone():
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
