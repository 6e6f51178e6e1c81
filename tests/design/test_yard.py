"""From a yard's messy list to a cable schedule for ordering, with the command alone."""

import csv

import numpy as np
import pytest

from shipnet import datasets
from shipnet.__main__ import main
from tests.design import messy
from tests.support import several

CABINET, DETOUR, TAILS = (20.0, 0.0, 10.0), 1.15, 5.0


def read(path):
    with path.open(newline="", encoding="utf-8-sig") as stream:
        return list(csv.DictReader(stream))


@pytest.fixture
def yard(tmp_path):
    """Return the command line of a list in a folder that also holds the settings."""
    settings = tmp_path / "yard.toml"
    settings.write_text(messy.SETTINGS, encoding="utf-8")
    assert len(messy.SETTINGS.splitlines()) <= 25

    def command(name, *more):
        return ["design", str(tmp_path / name), "--settings", str(settings), *more]

    return tmp_path, command


def test_the_corrected_list_gives_a_schedule_to_order_from(yard, capsys):
    folder, command = yard
    sheet, expected, _ = messy.rows(several(300, 1000), faulty=False)
    (folder / "list.csv").write_bytes(messy.as_csv(sheet))
    messy.as_workbook(sheet, folder / "list.xlsx")
    cabinet = ",".join(map(str, CABINET))
    options = ["--cabinet", cabinet, "--options", "junction boxes,CAN"]
    for name in ("list.csv", "list.xlsx"):
        made = command(name, *options, "--tables", str(folder / name.partition(".")[2]))
        assert main(made) in (0, 1)
    catalogue = datasets.read("estimated_cables.csv").set_index("cable_id")
    for option in ("junction boxes", "CAN"):
        own, other = (folder / form / option for form in ("csv", "xlsx"))
        assert (own / "cables.csv").read_bytes() == (other / "cables.csv").read_bytes()
        cables = read(own / "cables.csv")
        places = {
            row["device"]: [float(row[f"{axis}_m"]) for axis in "xyz"]
            for row in read(own / "devices.csv")
        }
        # The places of the points are the expected ones, not those that were read.
        places |= {tag: [x, y, z] for tag, (_, _, x, y, z, _) in expected.items()}
        assert len({row["cable"] for row in cables}) == len(cables)
        assert sorted(row["to"] for row in cables if row["kind"] == "drop") == sorted(expected)
        total = 0.0
        for row in cables:
            way = np.abs(np.subtract(places[row["from"]], places[row["to"]])).sum()
            total += DETOUR * way + TAILS
            assert float(row["length_m"]) == pytest.approx(DETOUR * way + TAILS, abs=1e-6), row
            assert float(row["tails_m"]) == pytest.approx(TAILS, abs=1e-6), row
            cable = catalogue.loc[row["type"]]
            assert row["description"] == cable["description"]
            assert int(row["cores"]) == int(cable["conductors"]) >= int(row["cores_used"]) > 0
        (km,) = [
            row["cable_length_km"]
            for row in read(folder / "csv" / "comparison.csv")
            if row["design"] == option
        ]
        assert total / 1e3 == pytest.approx(float(km), rel=1e-8)
        ends = {
            (row["from"], row["from_terminal"])
            for row in read(own / "terminals.csv")
            if row["carries"] != "spare" and row["from"] != "cabinet"
        }
        assert all(terminal.isdecimal() for _, terminal in ends)
