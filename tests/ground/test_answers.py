import pandas as pd
import pytest

from shipnet.answers import COLUMNS, Findings


def findings(*verdicts):
    rows = [("length", f"line {k}", 1.0, 0.0, 2.0, "m", v, "", "") for k, v in enumerate(verdicts)]
    return Findings(pd.DataFrame(rows, columns=list(COLUMNS)))


@pytest.mark.parametrize(
    ("verdicts", "ok", "line"),
    [
        (["met"], True, "1 check, all met"),
        (["met", "not verified"], None, "2 checks, 1 not verified"),
        (["met", "not verified", "violated"], False, "3 checks, 1 violated, 1 not verified"),
        ([], True, "nothing was checked"),
    ],
)
def test_findings_are_summarised_in_one_line(verdicts, ok, line):
    answer = findings(*verdicts)
    assert (answer.ok, answer.verdict, len(answer)) == (ok, line, len(verdicts))
    assert repr(answer) == f"<Findings: {line}>"


def test_violations_are_listed_and_the_table_is_a_copy():
    answer = findings("met", "violated")
    assert answer.violated()["object"].tolist() == ["line 1"]
    table = answer.table()
    table["verdict"] = "met"
    assert answer.ok is False
