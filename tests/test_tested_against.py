"""The page on what is tested shows the comparisons that tests make, with their tolerances."""

import csv
import re
from pathlib import Path

from docs import build
from tests.support import TOLERANCES, tolerance

ROOT = Path(__file__).resolve().parents[1]
PAGE = build.tested_page(ROOT)


def test_every_row_names_a_test_that_reads_its_tolerance():
    for key, row in TOLERANCES.items():
        path, _, name = row["test"].partition("::")
        (body,) = re.findall(
            rf"^def {name}\(.*?(?=^\S|\Z)(?:^\).*?(?=^\S|\Z))?",
            (ROOT / path).read_text(encoding="utf-8"),
            re.M | re.S,
        )
        if row["tolerance"] != "exact":
            assert tolerance(key) > 0
            assert f'tolerance("{key}")' in body, key


def test_every_tolerance_that_a_test_reads_has_a_row():
    files = [path for path in (ROOT / "tests").rglob("test_*.py") if path != Path(__file__)]
    read = {
        key
        for path in files
        for key in re.findall(r'tolerance\("(.+?)"\)', path.read_text("utf-8"))
    }
    assert read == {key for key, row in TOLERANCES.items() if row["tolerance"] != "exact"}


def test_the_page_shows_them_and_counts_what_was_not_read():
    for row in TOLERANCES.values():
        assert row["what"] in PAGE and row["compared with"] in PAGE
        assert f"<td>{row['tolerance']} {row['unit']}</td>" in PAGE
    with (ROOT / "data" / "design_rules.csv").open(encoding="utf-8") as file:
        confirmed = [row["confirmed"] for row in csv.DictReader(file)]
    unread = len(confirmed) - confirmed.count("yes")
    assert 0 < unread < len(confirmed)
    row = f"<td>rules for designs</td><td>{len(confirmed)}</td><td>{unread}</td>"
    assert row in PAGE
    assert "<!--" not in PAGE
