import ast
import importlib
import itertools
import json
import math
import re
import subprocess
import sys
from functools import cache
from pathlib import Path

import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shipnet import datasets
from shipnet.engine.can_layout import CanLayout
from shipnet.engine.points import read_points
from shipnet.errors import ArgumentError, InputError
from shipnet.papers import PAPERS, Claim, ledger, show
from shipnet.papers.judging import GRADES, TREATMENTS, _reason, _status, as_number, match
from shipnet.papers.registry import REGISTRY, Recomputation, load, numeric
from tests.papers.basis import basis_of, defaults_of
from tests.papers.claim_rows import checked

load()
CLAIMS = datasets.read("claims.csv")
BASES = dict(zip(CLAIMS["id"], CLAIMS["basis"], strict=True))
ROOT = Path(__file__).resolve().parents[2]
RECORDED = Path(__file__).with_name("expected_ledger.json")
NUMBERS = [claim for claim in REGISTRY if not REGISTRY[claim].counter]
CHECKS = [claim for claim in REGISTRY if REGISTRY[claim].counter]


@cache
def table():
    """Return the whole ledger; computed late, because it takes seconds and all workers collect."""
    return ledger().table().reset_index()


SOUND = {
    "id": "kim2014-001",
    "paper": "kim2014",
    "where": "1",
    "kind": "numeric",
    "claim": "slaves",
    "value": "256",
    "unit": "",
    "precision": "1",
    "verdict": "agrees",
    "holds_under": "as printed",
    "corrected": "",
    "basis": "model",
    "grade": "definition",
    "evidence": "",
    "note": "why",
}


def test_every_row_has_what_it_must():
    assert len(checked(CLAIMS)) == len(CLAIMS) > 300


@pytest.mark.parametrize(
    ("cells", "fault"),
    [
        ({"paper": "kim"}, "column paper: 'kim' must be one of kim2023, icn2007"),
        ({"id": "kim2014-1"}, "column id: 'kim2014-1' is not the paper's key and three digits"),
        ({"id": "kim2014-000"}, "column id: 'kim2014-000' is the id of row 2 too"),
        ({"kind": "number"}, "column kind: 'number' must be one of numeric, qualitative, erratum"),
        ({"claim": ""}, "column claim: is empty"),
        ({"verdict": "typo"}, "column verdict: 'typo' must be one of agrees, rounding, unit"),
        ({"kind": "ours", "value": ""}, "column verdict: 'agrees' must be empty, because the kind"),
        ({"kind": "ours", "verdict": ""}, "column value: '256' must be empty"),
        ({"value": "two"}, "column value: 'two' is not a number"),
        ({"precision": "0"}, "column precision: '0' must be above 0"),
        ({"holds_under": "always"}, "column holds_under: 'always' must begin with one of as print"),
        ({"holds_under": "as corrected"}, "'as corrected': expected 'as printed', or another"),
        ({"holds_under": "as corrected: by kim2014-999"}, "column holds_under: no claim kim2014-9"),
        ({"verdict": "open"}, "column holds_under: 'as printed' must be empty, because the claim"),
        ({"verdict": "open", "holds_under": "", "note": ""}, "column note: is empty"),
        ({"kind": "erratum", "verdict": "", "holds_under": ""}, "column corrected: is empty"),
        ({"kind": "qualitative", "verdict": "unit"}, "column corrected: is empty; 'unit' requires"),
        (
            {"grade": "strong"},
            "column grade: 'strong' must be one of measurement, independent, own",
        ),
        (
            {"kind": "context", "verdict": ""},
            "column grade: 'definition' must be empty, because the",
        ),
        (
            {"grade": "independent"},
            "column evidence: is empty; the grade 'independent' needs a claim",
        ),
        ({"verdict": "wrong"}, "column evidence: is empty; 'wrong' needs a claim or a test"),
        ({"verdict": "wrong", "evidence": "kim2014-999"}, "'kim2014-999' is neither another claim"),
        ({"verdict": "wrong", "evidence": "kim2014-001"}, "'kim2014-001' is neither another claim"),
    ],
)
def test_a_malformed_row_is_refused_with_row_and_column(cells, fault):
    claims = pd.DataFrame([SOUND | {"id": "kim2014-000"}, SOUND | cells])
    with pytest.raises(InputError, match=f"^claims.csv: row 3, .*{re.escape(fault)}"):
        checked(claims)


def test_conditions_errata_and_undecided_claims_are_rows_too():
    for cells in (
        {"holds_under": "under our assumption: a round of 0 s", "verdict": "agrees"},
        {"holds_under": "as corrected: kim2014-000", "verdict": "wrong", "evidence": "t.py::test"},
        {"kind": "erratum", "verdict": "", "holds_under": "", "corrected": "248", "grade": ""},
        {"verdict": "not verified", "holds_under": "", "grade": ""},
    ):
        assert checked(pd.DataFrame([SOUND | {"id": "kim2014-000"}, SOUND | cells]))
    with pytest.raises(InputError, match="has no column note"):
        checked(pd.DataFrame([SOUND]).drop(columns="note"))
    with pytest.raises(InputError, match=r"claims\.csv: has no row"):
        checked(pd.DataFrame([SOUND]).iloc[:0])


def test_an_unknown_kind_is_one_fault_and_not_several():
    with pytest.raises(InputError) as error:
        checked(pd.DataFrame([SOUND | {"kind": "numbr", "value": "two"}]))
    assert str(error.value).count("column") == 1


@pytest.mark.parametrize(
    ("cells", "reason"),
    [
        ({"note": "the pause is long"}, "The pause is long"),
        ({"holds_under": "as corrected: 6 us", "note": "why."}, "As corrected: 6 us. Why."),
        ({"corrected": "6 us", "note": ""}, "Correct: 6 us"),
        ({"note": ""}, ""),
    ],
)
def test_a_reason_is_condition_correction_and_note(cells, reason):
    assert _reason(SOUND | cells) == reason


# An engine "class" of 13000 kW and a display of 65,000 colours: printed to the thousand.
ROUND = {"lee2012-005", "kim2014-044"}


def test_a_precision_is_that_of_the_last_printed_digit():
    for claim in CLAIMS[CLAIMS["precision"] != ""].itertuples():
        _, _, decimals = claim.value.partition(".")
        if claim.id not in ROUND:
            assert as_number(claim.precision) == pytest.approx(10.0 ** -len(decimals)), claim.id


def test_what_is_judged_is_computed_and_nothing_is_open():
    for claim in CLAIMS.itertuples():
        if claim.kind in ("numeric", "qualitative") and claim.verdict != "not verified":
            assert (claim.verdict == "not reproducible") == (claim.id not in REGISTRY), claim.id


def test_every_function_belongs_to_a_claim_of_its_kind():
    kinds = CLAIMS.set_index("id")["kind"]
    for claim in REGISTRY:
        kind = "qualitative" if claim in CHECKS else "numeric"
        assert kinds[claim] in (kind, "erratum", *["ours"] * (claim in NUMBERS)), claim


def test_the_match_decides_between_agreement_and_fault():
    judged = table().query("status == 'judged'")
    for row in judged[judged["kind"] == "numeric"].itertuples():
        assert (row.match == "within precision") == (row.verdict == "agrees"), row.id
        if row.verdict == "unit":
            assert re.fullmatch(r"factor (1e[+-]0\d|10+|0\.0*1|1e-0\d)", row.match), row.id
    for row in judged[judged["kind"] == "qualitative"].itertuples():
        assert (row.match == "holds") == (row.verdict == "agrees"), row.id


def test_evidence_can_be_run_again():
    for row in CLAIMS.itertuples():
        for source in filter(None, row.evidence.split("; ")):
            assert "::" not in source or names_a_test(source), f"{row.id}: {source}"


def names_a_test(source):
    file, _, name = source.partition("::")
    return (ROOT / file).is_file() and f"def {name}(" in (ROOT / file).read_text(encoding="utf-8")


def neighbours(value):
    """Values near a default: enough of them that one is legal for the function."""
    if isinstance(value, bool):
        return [not value]
    if isinstance(value, int):
        return [value + 1, value - 1, value * 2]
    if isinstance(value, float):
        return [value * 1.1, value * 0.9]
    if isinstance(value, str) and not set(value) <= {"0", "1"}:
        return [value[1:], value[:-1], value[:1] + value[2:]]
    if isinstance(value, str):
        flipped = [
            "".join("10"[int(bit)] if place in places else bit for place, bit in enumerate(value))
            for places in itertools.combinations(range(len(value)), 2)
        ]
        return [*flipped, value[:-1]]
    if isinstance(value, tuple):
        return [value[:-1]]
    raise TypeError(f"no neighbour of {value!r}")


def moved(function, name, value):
    """Yield results of a function while one input takes the values near its default."""
    for neighbour in neighbours(value):
        try:
            yield neighbour, function(**{name: neighbour})
        except ValueError:
            continue


@pytest.mark.parametrize("claim", NUMBERS)
def test_every_input_of_a_number_moves_it(claim):
    recomputation = REGISTRY[claim]
    inputs = defaults_of(recomputation)
    original, basis = recomputation.value, basis_of(recomputation)
    assert inputs or basis == "model", "a number without inputs is typed, not computed"
    numbers = [name for name, one in inputs.items() if type(one) in (int, float)]
    for name, value in inputs.items():
        # Which of several: another claim of the same function has another one.
        others = [one for one in REGISTRY.values() if one.function is recomputation.function]
        if name in recomputation.inputs and any(one.value != original for one in others):
            continue
        shifts = basis != "model" and numbers == [name]
        moves = differs = False
        steps = set()
        for neighbour, result in moved(recomputation, name, value):
            moves, differs = moves or result != original, differs or result != neighbour
            if shifts:
                steps.add(round(result - neighbour, 9))
            if moves and differs and (len(steps) > 1 or not shifts):
                break
        assert moves, f"{name} moves nothing"
        assert differs, f"{name} is handed back"
        assert len(steps) > 1 or not shifts, f"{name} is shifted, not computed with"


@pytest.mark.parametrize("claim", CHECKS)
def test_every_check_can_give_the_opposite(claim):
    recomputation = REGISTRY[claim]
    answer, opposite = recomputation.value, recomputation(**recomputation.counter)
    assert type(answer) is type(opposite) and isinstance(answer, (bool, float))
    holds = answer >= 0 if isinstance(answer, float) else answer
    assert holds is not (opposite >= 0 if isinstance(opposite, float) else opposite)


def test_the_perturbation_finds_a_typed_constant():
    with pytest.raises(AssertionError, match="moves nothing"):
        _guard(lambda *, slaves=62: 496)
    with pytest.raises(AssertionError, match="handed back"):
        _guard(lambda *, conductors=496: conductors)
    with pytest.raises(AssertionError, match="shifted, not computed with"):
        _guard(lambda *, slaves=61: slaves + 1)
    with pytest.raises(AssertionError, match="typed, not computed"):
        _guard(lambda: 496)
    _guard(lambda *, slaves=62: slaves * 8)


def _guard(function):
    numeric("test-000")(function)
    try:
        test_every_input_of_a_number_moves_it("test-000")
    finally:
        del REGISTRY["test-000"]


def test_a_claim_has_one_function():
    registered = [
        claim.value
        for file in (ROOT / "shipnet" / "papers").rglob("*.py")
        for call in ast.walk(ast.parse(file.read_text(encoding="utf-8")))
        if isinstance(call, ast.Call) and getattr(call.func, "id", "") in ("numeric", "check")
        for claim in call.args
        if isinstance(claim, ast.Constant)
    ]
    assert sorted(registered) == sorted(REGISTRY)


@pytest.mark.parametrize(
    ("published", "computed", "precision", "outcome"),
    [
        (0.4, 0.449, 0.1, "within precision"),
        (0.4, 0.45, 0.1, "within precision"),
        (0.4, 0.451, 0.1, "differs"),
        (0.7, 7.368, 0.1, "factor 10"),
        (6, 0.005988, 1, "factor 0.001"),
        (0.104, 104.1667, 0.001, "factor 1000"),
        (133, 133e-3, 1, "factor 0.001"),
        (0, 0, 1, "within precision"),
        (0, 5, 1, "differs"),
        (5, 0, 1, "differs"),
        (-7, -7.2, 1, "within precision"),
        (7, math.nan, 1, "differs"),
        (2, 2e9, 1, "factor 1e+09"),
        (2, 2e10, 1, "differs"),
        (0.4, 5, 1, "factor 10"),  # 100 would do as well: the smaller shift is the likelier
        (0.15, 0.2, 0.1, "within precision"),  # 0.05000000000000002 in floating point
    ],
)
def test_match(published, computed, precision, outcome):
    assert match(published, computed, precision) == outcome


@given(st.floats(1e-3, 1e6), st.integers(-6, 6).filter(bool))
def test_a_shifted_decimal_point_is_recognised(value, power):
    assert match(value, value * 10.0**power, value * 1e-3) == f"factor {10.0**power:g}"


def test_counts_add_up_and_judged_claims_may_only_grow():
    counts = ledger().counts()
    assert list(counts.index) == list(PAPERS)
    assert list(counts.columns) == [*TREATMENTS, "claims"]
    assert (counts[list(TREATMENTS)].sum(axis=1) == counts["claims"]).all()
    assert counts["claims"].sum() == len(CLAIMS)
    recorded = json.loads(RECORDED.read_text())
    judged = counts[list(GRADES)].sum(axis=1)
    assert judged.to_dict() == recorded, f"if more is judged, update {RECORDED.name}"


@pytest.mark.parametrize(
    ("basis", "imported", "function"),
    [
        ("model", "shipnet.asi.timing cycle_time", "lambda *, n=31: cycle_time(n)"),
        ("model", "shipnet.modbus.pdu Request", "lambda *, n=1: Request(4, 0, n).pdu"),
        ("arithmetic", "shipnet.fields check_whole", "lambda *, n=3: check_whole('n', n, 0, 9)"),
        ("arithmetic", "math log", "lambda *, rate=167e3: log(rate)"),
        ("count", "math log", "lambda *, bits='0011', end=True: len(bits)"),
        ("count", "shipnet.engine.points read_points", "lambda *, box='JB1': len(read_points())"),
    ],
)
def test_the_basis_is_what_a_function_calls(basis, imported, function):
    module, _, name = imported.partition(" ")
    names = {
        "__name__": "shipnet.papers.kim2023.x",
        name: getattr(importlib.import_module(module), name),
    }
    assert basis_of(Recomputation(eval(function, names), {}, {})) == basis


@pytest.mark.parametrize("claim", REGISTRY)
def test_the_basis_in_the_list_is_what_the_claim_calls(claim):
    _ = REGISTRY[claim].value  # a cache that hides the model the second time hides it here too
    assert BASES[claim] == basis_of(REGISTRY[claim])


def test_what_is_not_computed_has_no_basis():
    assert {claim for claim, basis in BASES.items() if basis} == set(REGISTRY)


def test_ledger_of_one_paper():
    one = ledger("icn2007").table().reset_index()
    assert set(one["paper"]) == {"icn2007"}
    assert list(one["id"]) == sorted(one["id"])
    with pytest.raises(ValueError, match="paper is 'kim'"):
        ledger("kim")


def test_the_difference_is_computed_over_published_minus_one():
    row = table().set_index("id").loc["kim2014-044"]
    assert row.relative_difference == pytest.approx(65536 / 65000 - 1)


#: Identifier of JB1's first CAN frame.
FIRST = CanLayout(read_points()).messages()[0].arbitration_id


def remainder(bits):
    """Divide bits and 15 zeros by CAN's generator polynomial."""
    value = int(bits, 2) << 15
    while value.bit_length() > 15:
        value ^= 0b1100010110011001 << value.bit_length() - 16
    return value


OURS = {
    "kim2023-022": 3,
    "kim2023-031": 24.5,
    "kim2023-032": 26,
    "kim2023-033": 24,
    "kim2023-034": 4.992,
    "kim2023-035": 9.984,
    "kim2023-045": 13,
    "kim2023-062": 7,
    "kim2023-069": 95 / 7,
    "kim2023-070": 1900,
    "kim2023-071": 20 / 19,
    "icn2007-030": 26,
    "icn2007-035": 5 / 31,
    "lee2012-013": 43,
    "lee2012-014": 18,
    "lee2012-015": 38,
    "lee2012-016": 99,
    "lee2012-017": 80,
    "lee2012-018": 19,
    "lee2012-019": 62 * 3 + 18 * 2 + 19 * 2,
    "lee2012-033": 88 / 9.6,
    "lee2012-034": 203 * 11 / 9.6,
    "lee2012-035": (8 + 203 + 7) * 11 / 9.6,
    "lee2012-036": 125,
    "lee2012-043": 22,
    "lee2012-044": 2850 / 125,
    "lee2012-051": 5000 / 1024,
    "lee2012-096": 11e3 / 9.6,
    "lee2012-097": 38.5 / 9.6,
    "lee2012-098": 8,
    "lee2012-099": 5 + 100e-6 + 22 * 50e-6 + 2 * 5e-3 + (38.5 + 203 * 11) / 9600,
    "lee2012-100": 2.28,
    "lee2012-101": 43,
    "lee2012-103": 1.7885365833,
    "lee2012-109": 15,
    "lee2012-110": 37 * 1.104,
    "lee2012-113": remainder(f"0{FIRST:011b}0001000{'0' * 64}"),
    "kim2014-025": 7,
    "kim2014-036": 2 * 3,
    "kim2014-073": 12 - 2,
    "kim2014-074": 42,
    "kim2014-075": 247 * (21 + 7) * 11 / 2400,
    "kim2014-076": 247 * (21 * 11 / 115200 + 3.5e-3),
    "kim2014-077": 1.75e-3 * 115200 / 11,
    "kim2014-078": 100 / 4095,
    "kim2014-079": 90 / 100,
    "kim2014-080": 1 + 2 + 2 * 4 + 2,
    "kim2014-081": 2**8 - 1,
    "kim2014-082": 120 - 2.5,
    "kim2014-100": 3,
    "kim2014-109": 5,
    "kim2014-117": 5 * 28 * 11 / 9600 + 5 * (1 + 8 * 11 / 9600),
    # The last scan with the slave, a time-out at each port, and 468 scans of the other four.
    "kim2014-118": (5 + 468 * 4) * 28 * 11 / 9600 + 2 * (1 + 8 * 11 / 9600),
    "chung1998-003": 4 * 33 * 10 / 9600,
    "chung1998-004": 33,
    "chung1998-018": 200 / 33,
    "chung1998-020": 100 * (1 - (253 / 256) ** 20),
    "chung1998-038": 42,
    "chung1998-039": 60,
    "chung1998-045": 11 * 4 * 0.1,
    "chung1998-046": (2 * 33 + 2) * 10 / 600,
    "chung1998-047": 4.4 + (33 + 2) * 10 / 9600,
    "chung1998-060": 1280 / 9600,
    "chung1998-061": 128 / 33,
    "chung1998-067": 200 / 6,
    "chung1998-076": 100 * 30 / 33,
    "chung1998-077": 2 * 10,
}


def test_numbers_that_no_paper_prints():
    ours = table().query("status == 'ours'").set_index("id")["computed"]
    assert ours.to_dict() == pytest.approx(OURS)


def test_evidence_is_the_function_unless_the_claim_names_more():
    evidence = table().set_index("id")["evidence"]
    assert evidence["kim2023-004"] == "shipnet.papers.kim2023.protocol.conductors_left"
    assert evidence["icn2007-012"] == "shipnet.papers.kim2023.protocol.telegram_bits"
    assert evidence["kim2023-074"] == "kim2023-072; kim2023-073"
    assert evidence["kim2014-015"] == ""


def test_status_follows_kind_and_function():
    status = table().set_index("id")["status"]
    expected = {"kim2023-004": "judged", "kim2023-042": "judged", "kim2023-011": "context"}
    expected |= {"kim2023-045": "ours", "kim2023-063": "not reproducible"}
    expected |= {"kim2023-013": "not verified", "kim2023-044": "erratum"}
    assert status[list(expected)].to_dict() == expected


def test_a_claim_that_nobody_computes_is_open():
    claim = {"id": "kim2014-000", "kind": "numeric", "verdict": "open", "basis": ""}
    assert _status(claim) == "open"
    assert _status(claim | {"verdict": "not reproducible"}) == "not reproducible"


def test_show_keeps_the_order_and_names_unknown_ids():
    shown = show("kim2023-074", "kim2023-004")
    rows = shown.table()
    assert str(shown).count("the paper says: ") == shown._repr_html_().count("colspan") == 2
    assert list(rows.index) == ["kim2023-074", "kim2023-004"]
    assert rows.loc["kim2023-074", "the paper says"] == "0.7 %"
    with pytest.raises(ValueError, match="no claim has the id kim2023-999"):
        show("kim2023-999")


def test_every_module_of_a_paper_is_found():
    folder = Path(importlib.import_module("shipnet.papers").__file__).parent
    modules = {file.stem for file in folder.iterdir() if re.fullmatch(r"[a-z]+\d{4}", file.stem)}
    assert modules <= set(PAPERS)
    functions = {entry.function.__module__.split(".")[2] for entry in REGISTRY.values()}
    assert functions == modules


def test_a_claim_is_registered_by_its_own_paper():
    for file in (ROOT / "shipnet" / "papers").rglob("*.py"):
        paper = re.search(r"[a-z]+\d{4}", file.as_posix().partition("papers/")[2])
        registered = re.findall(r'\b(?:numeric|check)\(((?:\s*"\S+",?)+)', file.read_text("utf-8"))
        for claim in re.findall(r'"(\S+)-\d{3}"', " ".join(registered)):
            # Both papers on AS-i make these claims.
            assert claim == paper.group() or (claim, paper.group()) == ("icn2007", "kim2023"), file


def test_every_registered_function_has_a_name_and_a_docstring():
    for claim, recomputation in REGISTRY.items():
        assert recomputation.function.__name__.isidentifier() and recomputation.function.__doc__, (
            claim
        )


def test_counting_the_claims_computes_and_imports_nothing():
    program = """
import sys
from shipnet.papers import ledger
print(ledger(), len(ledger().counts()))
sys.exit(any(name.startswith(("shipnet.papers.kim", "shipnet.asi")) for name in sys.modules))
"""
    subprocess.run([sys.executable, "-c", program], check=True)


def test_a_paper_alone_is_judged_as_among_all():
    paper = "icn2007"  # the one which leans on another
    program = f"""
import shipnet.papers as papers
alone = papers.ledger({paper!r}).table().reset_index()
print(alone[["id", "status", "match"]].to_csv())
"""
    output = subprocess.check_output([sys.executable, "-c", program], text=True)
    among = table().query("paper == @paper").reset_index(drop=True)
    assert output.strip() == among[["id", "status", "match"]].to_csv().strip()


def test_a_claim_is_computed_anew_with_other_inputs():
    claim = Claim("kim2023-074")
    assert claim.recompute() == claim.computed
    assert claim.recompute(slaves=100) == pytest.approx(100 * 28 / 200)
    assert claim.corrected == "7.4 %" and not hasattr(claim, "colour")
    with pytest.raises(TypeError):
        claim.recompute(sheep=1)
    with pytest.raises(ArgumentError, match="not computed; its status is context"):
        Claim("kim2014-015").recompute()
    with pytest.raises(ArgumentError, match="no claim has the id kim2023-999"):
        Claim("kim2023-999")


def test_the_ledger_of_a_paper_is_summed_up():
    one = ledger("kim2023")
    judged = (one.table()["basis"] != "") & one.table()["kind"].isin(["numeric", "qualitative"])
    assert 0 < len(one.judged()) == judged.sum()
    assert str(one).startswith(f"{len(one)} claims; judged: 0 measurement, ")
    assert "agrees" not in set(one.differing()["verdict"])
    assert len(one.differing()) == (one.judged()["verdict"] != "agrees").sum()


MUTANTS = ROOT / "tests" / "mutants"


def test_the_constants_that_must_affect_the_ledger_are_those_of_the_models():
    constants = pd.read_csv(MUTANTS / "constants.csv")
    assert len(constants) >= 20
    assert set(" ".join(constants["papers"]).split()) == set(PAPERS)
    for row in constants.itertuples():
        text = (ROOT / "shipnet" / row.file).read_text(encoding="utf-8")
        assert text.count(row.before) == 1, f"{row.file}: {row.before}"


def test_a_changed_constant_moves_a_claim_of_each_paper_that_rests_on_it():
    # All the others: `make mutants`.
    program = [sys.executable, MUTANTS / "ledger.py", "SEND_CURRENT"]
    output = subprocess.check_output(program, text=True)
    assert [line.split()[-4] for line in output.splitlines()] == ["claims,", "claims,"]
