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
    found = findings(*verdicts)
    assert (found.ok, found.verdict, len(found)) == (ok, line, len(verdicts))
    assert repr(found) == f"<Findings: {line}>"


def test_violations_are_listed_and_the_table_is_a_copy():
    found = findings("met", "violated")
    assert found.violated()["object"].tolist() == ["line 1"]
    table = found.table()
    table["verdict"] = "met"
    assert found.ok is False
