"""The rules for the rows of claims.csv."""

from __future__ import annotations

import math
import re

from shipnet.errors import InputError
from shipnet.papers import PAPERS
from shipnet.papers.judging import AS_PRINTED, GRADES, UNDECIDED, as_number

COLUMNS = (
    "id",
    "paper",
    "where",
    "kind",
    "claim",
    "value",
    "unit",
    "precision",
    "verdict",
    "holds_under",
    "corrected",
    "basis",
    "grade",
    "evidence",
    "note",
)
#: Kinds of claims: a number, a statement, a misprint with its correction, quoted only, our number.
KINDS = ("numeric", "qualitative", "erratum", "context", "ours")
#: Verdicts that go against a paper, or put a condition beside it; each needs evidence.
AGAINST = ("rounding", "unit", "wrong", "inconsistent", "assumption differs")
VERDICTS = ("agrees", *AGAINST, *UNDECIDED)
#: Conditions under which a verdict holds; all but the first say which after a colon. A claim whose
#: verdict is "assumption differs" holds only under the condition.
CONDITIONS = (AS_PRINTED, "as corrected", "under our assumption")
_ID = re.compile(r"[a-z]+\d{4}-\d{3}")


def checked(table, source="claims.csv"):
    """Return the rows of a table of claims; InputError if any is malformed, with row and column."""
    if missing := [name for name in COLUMNS if name not in table]:
        raise InputError(source, f"has no column {', '.join(missing)}")
    if table.empty:
        raise InputError(source, "has no row; it must hold a claim")
    claims = table.to_dict("records")
    first = {}
    for number, claim in enumerate(claims, start=2):
        first.setdefault(claim["id"], number)
    faults = [
        f"row {number}, column {column}: {fault}"
        for number, claim in enumerate(claims, start=2)
        for column, fault in _faults(claim, number, first)
    ]
    if faults:
        raise InputError(source, *faults)
    return claims


def _faults(claim, number, first):
    """Yield column and fault of what is wrong with one row, given the row of each id."""
    if not _ID.fullmatch(claim["id"]) or claim["id"].rpartition("-")[0] != claim["paper"]:
        yield "id", f"{claim['id']!r} is not the paper's key and three digits, as in 'kim2014-001'"
    elif first[claim["id"]] != number:
        yield "id", f"{claim['id']!r} is the id of row {first[claim['id']]} too"
    kind, verdict = claim["kind"], claim["verdict"]
    judged = kind in ("numeric", "qualitative")
    for column in ("where", "claim"):
        if not claim[column]:
            yield column, "is empty"
    for column, legal in (("paper", PAPERS), ("kind", KINDS)):
        if claim[column] not in legal:
            yield column, f"{claim[column]!r} must be one of {', '.join(legal)}"
    if kind not in KINDS:
        return  # what the other columns must hold depends on it
    if judged and verdict not in VERDICTS:
        yield "verdict", f"{verdict!r} must be one of {', '.join(VERDICTS)}"
    elif not judged and verdict:
        yield "verdict", f"{verdict!r} must be empty, because the kind is {kind}"
    yield from _faults_of_numbers(claim)
    yield from _faults_of_the_condition(claim, judged and verdict not in UNDECIDED, first)
    against = kind == "erratum" or (kind == "qualitative" and verdict in AGAINST)
    if against and not claim["corrected"]:
        yield "corrected", f"is empty; {verdict or kind!r} requires the correction"
    if (kind == "erratum" or verdict in UNDECIDED) and not claim["note"]:
        yield "note", "is empty; expected the reason of the correction, or what is missing"
    sources = [source.strip() for source in claim["evidence"].split(";") if source.strip()]
    decided = judged and verdict not in UNDECIDED
    if decided and claim["grade"] not in GRADES:
        yield "grade", f"{claim['grade']!r} must be one of {', '.join(GRADES)}"
    elif not decided and claim["grade"]:
        yield "grade", f"{claim['grade']!r} must be empty, because the claim has no verdict"
    if claim["grade"] in GRADES[:2] and claim["basis"] == "model" and not sources:
        yield "evidence", f"is empty; the grade {claim['grade']!r} needs a claim or a test"
    if verdict in AGAINST and not sources:
        yield "evidence", f"is empty; {verdict!r} needs a claim or a test, as in 'kim2023-040'"
    for source in sources:
        if source == claim["id"] or ("::" not in source and source not in first):
            yield "evidence", f"{source!r} is neither another claim nor a test 'file::name'"


def _faults_of_numbers(claim):
    """Yield column and fault of a value and its precision."""
    if claim["kind"] == "ours" and claim["value"]:
        yield "value", f"{claim['value']!r} must be empty, because the paper prints no number"
    if claim["kind"] != "numeric" and not claim["precision"]:
        return
    for column in ("value", "precision"):
        try:
            good = math.isfinite(as_number(claim[column]))
        except ValueError:
            good = False
        if not good:
            yield column, f"{claim[column]!r} is not a number"
        elif column == "precision" and as_number(claim[column]) <= 0:
            yield column, f"{claim[column]!r} must be above 0"


def _faults_of_the_condition(claim, decided, ids):
    """Yield column and fault of the condition under which a verdict holds."""
    held = claim["holds_under"]
    condition, _, which = (part.strip() for part in held.partition(":"))
    if not decided:
        if held:
            yield "holds_under", f"{held!r} must be empty, because the claim has no verdict"
    elif condition not in CONDITIONS:
        yield "holds_under", f"{held!r} must begin with one of {', '.join(CONDITIONS)}"
    elif (condition == AS_PRINTED) == bool(which):
        yield "holds_under", f"{held!r}: expected 'as printed', or another condition, ':' and which"
    for id in _ID.findall(which):
        if id not in ids:
            yield "holds_under", f"no claim {id}"
