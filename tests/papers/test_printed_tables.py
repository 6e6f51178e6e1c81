from itertools import combinations

import pytest
from matplotlib.patches import Polygon, Rectangle

from shipnet import datasets
from shipnet.asi import Call, Request
from shipnet.errors import ArgumentError
from shipnet.papers import figure, kim2014, lee2012
from shipnet.papers.kim2023 import differences, printed, protocol, table

GENERATED = [f"Table {number}" for number in (4, 5, 6, 7)]


def test_every_difference_is_explained_and_no_reason_is_left_over():
    reasons = datasets.read("kim2023_table_differences.csv")
    tables = [differences(item) for item in GENERATED]
    assert sum(map(len, tables)) == len(reasons)
    for cells in tables:
        assert not cells.isna().any(axis=None)
    claims = set(datasets.read("claims.csv")["id"])
    assert set(reasons["claim"]) <= claims
    assert set(reasons["kind"]) == {"typo", "naming", "difference", "missing", "wording"}


def test_a_changed_cell_would_be_seen(monkeypatch):
    cells = printed("Table 7")
    cells.loc["3", "D0"] = "OUT"
    monkeypatch.setattr(protocol, "printed", lambda item: cells)
    (found,) = differences("Table 7").to_dict("records")
    assert (found["row"], found["column"], found["printed"], found["ours"]) == (
        "3",
        "D0",
        "OUT",
        "IN",
    )
    assert found["reason"] != found["reason"]  # nobody has explained it


def test_table_5_is_what_the_encoder_sends():
    cells = table("Table 5").drop("HEADER")
    assert list(cells.index) == [call.name for call in Call]
    fixed = {"DATA_EXCHANGE": (21, 5), "WRITE_PARAMETER": (21, 5), "DELETE_ADDRESS": (21, 0)}
    for call in Call:
        names = list(cells.loc[call.name])
        address, data = fixed.get(call.name, (21, 0))
        if call.rule.pattern[1:6].isdigit():
            address, data = int(call.rule.pattern[1:6], 2), int("d" in call.rule.pattern)
        half = "B" if {"S", "~S"} & set(names) else None
        bits = Request(call, address, data, half).bits
        for name, bit in zip(names, bits, strict=True):
            if name in "01":
                assert bit == name, call
            if name in ("S", "~S"):
                assert bit == {"S": "1", "~S": "0"}[name], call


def test_write_id1_with_an_address_would_be_delete_address():
    information = f"1{21:05b}00000"
    bits = f"0{information}{information.count('1') % 2}1"
    assert Request.parse(bits) == Request(Call.DELETE_ADDRESS, 21)
    assert printed("Table 5").loc["WRITE_ID1", "A4":"A0"].tolist() == ["A4", "A3", "A2", "A1", "A0"]
    assert table("Table 5").loc["WRITE_ID1", "A4":"A0"].tolist() == ["0"] * 5


def test_select_0_gives_the_requests_of_slaves_before_2_1():
    # What a standard slave is sent as I4..I0; it knows of no select bit.
    before = {"RESET": "11100", "READ_STATUS": "11110", "READ_IO_CONFIGURATION": "10000"}
    before |= {"DELETE_ADDRESS": "00000", "READ_ID": "10001"}
    for cells, agrees in ((table("Table 5"), True), (printed("Table 5"), False)):
        sent = {
            call: "".join(cells.loc[call, "I4":"I0"]).replace("~S", "1").replace("S", "0")
            for call in before
        }
        assert (sent == before) == agrees
        differing = {call for call in before if sent[call] != before[call]}
        assert differing == (set() if agrees else {"RESET", "DELETE_ADDRESS"})


def test_parameter_bits_are_called_p():
    assert table("Table 5").loc["WRITE_PARAMETER", "I2":"I0"].tolist() == ["P2", "P1", "P0"]
    assert printed("Table 5").loc["WRITE_PARAMETER", "I2":"I0"].tolist() == ["D2", "D1", "D0"]


@pytest.mark.parametrize("function", [differences, printed, table])
@pytest.mark.parametrize("item", ["Table 1", "Table 99", "", None])
def test_an_unknown_table_is_refused(function, item):
    with pytest.raises(ArgumentError, match=r"item is .*; it must be one of 'Table 4', 'Table 5'"):
        function(item)


@pytest.mark.parametrize(
    ("item", "differing"),
    [
        ("Table 1", ["Lubricating oil consumption", "Cylinder oil consumption"]),
        ("Table 2", ["Master address"]),
        ("Table 3", ["JB2", "JB3"]),  # "Press" and "Hugh"
        ("Fig 4", ["(b) response", "(b) response"]),  # address and byte count
    ],
)
def test_lee2012_marks_the_rows_that_differ_from_the_printed_ones(item, differing):
    rows = lee2012.table(item)
    assert rows.index[rows["differs"] == "*"].tolist() == differing
    assert len(rows) == {"Table 1": 6, "Table 2": 10, "Table 3": 14, "Fig 4": 12}[item]


@pytest.mark.parametrize(
    ("item", "differing"),
    [
        ("Table 2", {("write error", 7): "86 *"}),
        (
            "Table 3",
            {
                ("read response", 4): "00 0b *",
                ("read response", 8): "08 *",
                ("read response", 9): "00 *",
                ("read response", 10): "00 *",
                ("read response", 11): "00 *",
                ("read response", 12): "00 00 00 00 00 *",
            },
        ),
    ],
)
def test_kim2014_marks_the_bytes_that_differ_from_the_standard(item, differing):
    rows = kim2014.table(item)
    cells = rows.xs("standard", level=1).stack()
    assert cells[cells.str.endswith("*")].to_dict() == differing


@pytest.mark.parametrize("paper", [kim2014, lee2012])
def test_a_table_that_is_not_printed_is_refused(paper):
    with pytest.raises(ArgumentError, match="item is 'Table 9'; it must be one of 'Table"):
        paper.table("Table 9")


BLOCKS, WAYS = datasets.read("diagram_blocks.csv"), datasets.read("diagram_ways.csv")
DIAGRAMS = sorted({tuple(place) for place in BLOCKS[["paper", "figure"]].to_numpy()})


def of(table, place):
    return table[(table.paper == place[0]) & (table.figure == place[1])]


def test_a_diagram_joins_blocks_that_it_has():
    names = {tuple(row) for row in BLOCKS[["paper", "figure", "block"]].to_numpy()}
    assert len(names) == len(BLOCKS)
    for end in ("start", "end"):
        assert {tuple(row) for row in WAYS[["paper", "figure", end]].to_numpy()} <= names


@pytest.mark.parametrize("place", DIAGRAMS)
def test_a_diagram_shows_its_blocks_apart_from_each_other_and_within_its_axes(place):
    # Some diagrams are one panel of their figure.
    part = {"part": "a"} if place == ("lee2012", "Fig 12") else {}
    ax = max(figure(*place, **part).figure.axes, key=lambda panel: len(panel.patches))
    blocks = of(BLOCKS, place)
    texts = [text.get_text() for text in ax.texts]
    assert {text.replace(r"\n", "\n") for text in blocks["text"]} <= set(texts)
    if place == ("kim2014", "Fig 1"):
        return  # its valves are drawn by code
    shapes = [patch for patch in ax.patches if isinstance(patch, Rectangle | Polygon)]
    assert len(shapes) == (blocks["shape"] != "text").sum()
    extents = [
        patch.get_path().transformed(patch.get_patch_transform()).get_extents() for patch in shapes
    ]
    assert not any(a.overlaps(b) for a, b in combinations(extents, 2))
    (left, right), (low, high) = ax.get_xlim(), ax.get_ylim()
    for extent in extents:
        assert left <= extent.x0 and extent.x1 <= right and low <= extent.y0 and extent.y1 <= high


def test_every_decision_of_chung1998_has_a_way_for_yes_and_one_for_no():
    decisions = BLOCKS[(BLOCKS["shape"] == "decision") & (BLOCKS["paper"] == "chung1998")]
    assert set(decisions["figure"]) == {"Fig 5", "Fig 6", "Fig 7", "Fig 8(a)", "Fig 8(b)"}
    for paper, item, name in decisions[["paper", "figure", "block"]].to_numpy():
        ways = of(WAYS, (paper, item))
        assert sorted(ways.loc[ways["start"] == name, "word"]) == ["no", "yes"]
