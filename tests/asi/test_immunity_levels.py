import numpy as np
import pytest

from shipnet import datasets
from shipnet.asi.emc.disturbances import PULSE_RATE, gaps, levels

TABLE = levels()
PRINTED = datasets.read("kim2023_table2_emc.csv")


def row(test, parameter):
    (found,) = TABLE[(TABLE["test"] == test) & (TABLE["parameter"] == parameter)].to_dict("records")
    return found


def test_printed_values_are_those_of_the_paper():
    printed = TABLE[TABLE["printed_name"] != ""]
    assert set(printed["printed_name"]) == set(PRINTED["phenomenon_printed"])
    for found in printed.to_dict("records"):
        same = PRINTED[PRINTED["phenomenon_printed"] == found["printed_name"]]
        match = same[(same["value"] == found["asi_printed"]) & (same["unit"] == found["unit"])]
        assert len(match) == 1, found
        assert match["rating"].item() == found["criterion"]
        if found["standard"] != "ENV 50204":
            assert match["standard"].item().replace(" ", "")[2:] == found["standard"][4:]
    # Only tolerance of a frequency and frequency of a modulation are left out.
    used = len(printed[["printed_name", "asi_printed", "unit"]].drop_duplicates())
    assert used == len(PRINTED) - 2


def test_values_are_meant_as_printed_but_for_one_range():
    differs = TABLE[TABLE["asi_printed"] != TABLE["asi"].map("{:g}".format).replace("nan", "")]
    assert differs["asi_printed"].tolist() == ["0, 15~80"] * 2
    assert differs["asi"].tolist() == [0.15, 80]
    assert row("burst", "repetition frequency")["asi"] * 1e3 == PULSE_RATE


def test_the_gaps_follow_from_the_numbers():
    gaps = TABLE.set_index(["test", "parameter"])["gap"]
    below = gaps[gaps == "below"].index.tolist()
    assert below == [
        ("electrostatic discharge, contact", "voltage"),
        ("radio-frequency field", "highest frequency"),
    ]
    assert gaps.value_counts().to_dict() == {
        "covers": 15,
        "not asked": 4,
        "test missing": 3,
        "below": 2,
    }
    assert gaps["surge, line to earth", "peak voltage"] == "test missing"
    assert gaps["pulsed field", "field strength"] == "not asked"
    assert row("electrostatic discharge, contact", "voltage")["ratio"] == pytest.approx(2 / 3)
    assert row("conducted radio frequency", "voltage")["ratio"] == pytest.approx(10 / 3)
    assert np.isnan(row("surge, line to line", "peak voltage")["ratio"])


@pytest.mark.parametrize(
    ("asi", "marine", "better", "expected"),
    [
        (1, 2, "higher", "below"),
        (2, 2, "higher", "covers"),
        (3, 2, "higher", "covers"),
        (0.3, 0.1 * 3, "higher", "covers"),
        (0.15, 0.15, "lower", "covers"),
        (0.2, 0.15, "lower", "below"),
        (0.1, 0.15, "lower", "covers"),
        (150, 150, "equal", "covers"),
        (151, 150, "equal", "below"),
        (149, 150, "equal", "below"),
        (np.nan, 1, "higher", "test missing"),
        (1, np.nan, "lower", "not asked"),
        (np.nan, np.nan, "equal", "not asked"),
    ],
)
def test_a_gap_depends_on_which_side_is_stricter(asi, marine, better, expected):
    assert gaps(np.array(asi), np.array(marine), np.array(better)) == expected


def test_unconfirmed_values_say_so():
    assert set(TABLE["confirmed"]) == {"yes", "no"}
    unsure = TABLE["source"].str.contains("general knowledge|no marine level")
    assert ((TABLE["confirmed"] == "no") == unsure).all()
    assert (TABLE["source"] != "").all()
    assert TABLE.loc[TABLE["marine"].isna(), "confirmed"].eq("no").all()
