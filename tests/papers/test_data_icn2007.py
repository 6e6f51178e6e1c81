import re

from shipnet import datasets
from shipnet.papers.judging import as_number

NUMBERS = datasets.read("icn2007_numbers.csv").set_index("parameter")


def test_numbers_are_numbers_with_units():
    assert len(NUMBERS) == 32
    assert NUMBERS.index.is_unique
    assert NUMBERS["value"].map(as_number).gt(0).all()
    assert (NUMBERS["unit"] != "").all()


def test_numbers_are_consistent():
    value = NUMBERS["value"].map(as_number)
    assert (
        value["slaves of one master"] == 2 * value["slaves of one master before specification 2.1"]
    )
    assert value["master pause, shortest"] < value["master pause, longest"]
    assert value["slave pause, lower value"] < value["slave pause, upper value"]
    assert value["response"] == value["information to be checked in a response"] + 3
    assert value["request"] == value["information to be checked in a request"] + 3
    assert (
        value["trunk of the example with a star at its end"]
        < (value["total cable length of a network, taps included"])
    )
    assert round(100 * value["net rate, highest"] / value["gross rate"]) == value["efficiency"]


def test_the_ledger_prints_the_same_numbers():
    claims = datasets.read("claims.csv").set_index("id")["value"]
    for claim, parameter in [
        ("icn2007-005", "bit time as printed"),
        ("icn2007-006", "gross rate"),
        ("icn2007-025", "net rate, highest"),
        ("icn2007-026", "efficiency"),
        ("icn2007-021", "information to be checked in a request"),
        ("icn2007-023", "extra bits of a request for that distance"),
    ]:
        assert claims[claim] == NUMBERS.loc[parameter, "value"]
    for where in NUMBERS["where"]:
        assert re.fullmatch(r"(introduction|4|5|data link layer \d)(; data link layer \d)?", where)
