"""docs/renew.py renews what follows from the data, and nothing else."""

import hashlib
from pathlib import Path

from docs import renew

ROOT = Path(__file__).resolve().parents[1]
SOURCES = (ROOT / "data" / "SOURCES.md").read_text(encoding="utf-8")
README = (ROOT / "README.md").read_text(encoding="utf-8")


def test_what_is_up_to_date_stays_as_it_is():
    assert renew.check_sums(SOURCES, ROOT / "data") == SOURCES


def test_a_check_sum_is_that_of_the_file_and_other_rows_stay():
    digest = hashlib.sha256((ROOT / "data" / "claims.csv").read_bytes()).hexdigest()
    assert SOURCES.count(digest) == 1
    stale = SOURCES.replace(digest, "0" * 64)
    assert renew.check_sums(stale, ROOT / "data") == SOURCES
    gone = stale.replace("`claims.csv`", "`gone.csv`")
    assert renew.check_sums(gone, ROOT / "data") == gone


def test_the_counts_of_the_readme_are_renewed_across_its_line_breaks():
    totals = {"claims": 9001, "measurement": 9002, "independent": 9003, "own simulator": 9004}
    totals["definition"] = 9005
    new = renew.counts(README, totals)
    words = " ".join(new.split())
    assert "Of 9001 claims, 9002 are judged by a measurement, 9003 by another program" in words
    assert "9004 by our own simulators and 9005 by definition" in words
    assert len(new.splitlines()) == len(README.splitlines())
