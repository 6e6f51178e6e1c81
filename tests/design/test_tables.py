"""Tables for a yard: every cable, core, device and point, read back from the files."""

import csv
import re
from collections import Counter, defaultdict
from dataclasses import replace
from types import SimpleNamespace

import networkx as nx
import openpyxl
import pandas as pd
import pytest
from hypothesis import given, settings

from shipnet import datasets
from shipnet.__main__ import main
from shipnet.design.comparison import compare
from shipnet.design.iolist import IoList
from shipnet.design.planning import OPTIONS
from shipnet.design.plant import Plant
from shipnet.design.tables import file_name, terminals
from shipnet.signals import SIGNALS
from tests.design.lists import lists, ship, small_loop

SHIP = ship(120)
TABLES = {
    "cables",
    "terminals",
    "devices",
    "points",
    "segments",
    "bill",
    "reasons",
    "supplies",
    "voltages",
}


def read(path):
    """Return the rows of a CSV file, read with the standard library alone."""
    with path.open(newline="", encoding="utf-8-sig") as stream:
        return list(csv.DictReader(stream))


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    """Return a comparison of all options, its folder and its report."""
    made = SHIP.compare((20, 0, 4))
    folder = tmp_path_factory.mktemp("tables")
    made.save(folder)
    return SimpleNamespace(made=made, folder=folder, page=made.html())


@pytest.mark.parametrize("option", OPTIONS)
def test_the_schedule_and_the_bill_add_up_to_the_length_and_cost_in_the_report(found, option):
    cables, bill = (read(found.folder / option / f"{name}.csv") for name in ("cables", "bill"))
    metres = sum(float(row["length_m"]) for row in cables)
    cost = sum(float(row["cost_eur"]) for row in bill)
    place = 1 + list(found.made.designs).index(option)
    for words, value in (("cable length [km]", metres / 1e3), ("total cost [EUR]", cost)):
        row = next(row for row in found.page.split("<tr>") if f">{words}<" in row)
        shown = re.findall(r">([^<]*)</td>", row)[place].replace(",", "")
        assert float(f"{value:.3g}") == float(shown)
    # Compute the bill again from the schedule and the data file.
    price = {
        row["cable_id"]: (float(row["price_low_eur_per_m"]) + float(row["price_high_eur_per_m"]))
        / 2
        for row in datasets.read("estimated_cables.csv").to_dict("records")
    }
    ordered = Counter()
    for row in cables:
        ordered[row["type"]] += float(row["length_m"])
    billed = {row["item"]: row for row in bill if row["kind"] == "cable"}
    assert set(billed) == set(ordered)
    for kind, length in ordered.items():
        assert float(billed[kind]["number"]) == pytest.approx(length, rel=1e-8)
        assert float(billed[kind]["cost_eur"]) == pytest.approx(length * price[kind], rel=1e-8)
    glands = {row["item"]: float(row["number"]) for row in bill}["gland"]
    assert glands == 2 * len(cables)


@pytest.mark.parametrize("option", OPTIONS)
def test_every_point_has_a_cable_a_device_and_a_channel_of_its_own(found, option):
    points = read(found.folder / option / "points.csv")
    cables = {row["cable"]: row for row in read(found.folder / option / "cables.csv")}
    devices = {row["device"]: row for row in read(found.folder / option / "devices.csv")}
    assert [row["tag"] for row in points] == SHIP.points["tag"].tolist()
    channels = Counter()
    for row in points:
        cable = cables[row["cable"]]
        assert (cable["from"], cable["to"]) == (row["device"], row["tag"])
        assert row["device"] in devices
        reader = "cabinet" if row["bus"] == "hardwired" else row["device"]
        channels[reader, row["channel"]] += 1
        assert row["channel"].startswith(row["type"])
        if row["bus"] != "hardwired":
            assert row["address"].split()[0] in devices[row["device"]]["address"].split(", ")
    assert set(channels.values()) == {1}
    count = Counter(
        cable["from"] for cable in cables.values() if cable["kind"] in ("drop", "home run")
    )
    assert all(int(row["points"]) == count[name] for name, row in devices.items())
    ends = {row[end] for row in cables.values() for end in ("from", "to")}
    assert ends <= set(devices) | {row["tag"] for row in points}
    assert len(cables) == len(found.made.designs[option].cables)


def check_terminals(design):
    """Follow every wire of every point from terminal to terminal, in the terminal plan alone."""
    plan = terminals(design)
    used = plan[plan["carries"] != "spare"]
    assert plan.groupby("cable").size().to_dict() == dict(
        zip(design.cables["run"], design.cables["conductors"], strict=True)
    )
    assert used.groupby("cable").size().to_dict() == dict(
        zip(design.cables["run"], design.cables["used"], strict=True)
    )
    assert (
        plan.loc[plan["carries"] == "spare", ["from_terminal", "to_terminal"]].isna().all(axis=None)
    )
    graph = nx.Graph()
    strips = defaultdict(set)
    for row in used.itertuples(index=False):
        start, end = (row[4], row.from_terminal), (row.to, row.to_terminal)
        assert not graph.has_edge(start, end)
        graph.add_edge(start, end)
        for device, terminal in (start, end):
            strips[device].add(terminal)
    # Terminals are numbered from 1 without a gap.
    assert all(numbers == set(range(1, len(numbers) + 1)) for numbers in strips.values())
    return graph


@settings(max_examples=30)
@given(lists(most=40))
def test_every_wire_of_a_box_reaches_a_terminal_of_the_cabinet(iolist):
    design = iolist.plan("junction boxes", (0, 0, 0))
    graph = check_terminals(design)
    kind = dict(zip(iolist.points["tag"], iolist.points["signal"], strict=True))
    joined = set()
    for part in nx.connected_components(graph):
        ends = [node for node in part if node[0] in kind]
        (cabinet,) = [node for node in part if node[0] == design.cabinet]
        assert ends and cabinet not in joined
        joined.add(cabinet)
        if len(ends) > 1:  # a return, which only the points of one kind share
            (signal,) = {kind[tag] for tag, _ in ends}
            assert SIGNALS[signal].common
            assert all(wire == SIGNALS[signal].conductors + 1 for _, wire in ends)
    wires = sum(SIGNALS[signal].conductors + SIGNALS[signal].common for signal in kind.values())
    assert sum(node[0] in kind for node in graph) == wires
    assert len(joined) == design.quantities()["conductors_at_cabinet"]


@pytest.mark.parametrize("option", [name for name in OPTIONS if name != "junction boxes"])
def test_on_other_options_every_core_has_terminals_of_its_own(found, option):
    graph = check_terminals(found.made.designs[option])
    assert {degree for _, degree in graph.degree} == {1}


def test_redundant_lines_plants_and_mixes_also_have_terminals():
    check_terminals(small_loop(redundant=True))
    plant = Plant(12, contacts=4, lines=2, signal="contact_common")
    check_terminals(plant.on_asi)
    check_terminals(SHIP.plan("junction boxes", (20, 0, 4), mix={"DI": "AS-i", "rtd_3wire": "CAN"}))


def test_a_large_box_divides_its_points_among_several_trunks():
    rows = [
        f"P{n},{kind},1,2,3,B"
        for n, kind in enumerate(["rtd_3wire", "contact_common", "contact", "solenoid_common"] * 20)
    ]
    iolist = IoList.parse("tag,signal,x,y,z,box\n" + "\n".join(rows))
    design = iolist.plan("junction boxes", (30, 0, 0))
    trunks = design.cables[design.cables["kind"] == "trunk"]
    assert trunks["run"].tolist() == [f"B trunk {n}" for n in range(1, len(trunks) + 1)]
    assert len(trunks) > 2
    graph = check_terminals(design)
    plan = terminals(design)
    returns = plan[plan["carries"].str.startswith("return of")]
    assert returns.groupby("cable").size().to_dict() == dict.fromkeys(trunks["run"], 2)
    cabinets = [node for node in graph if node[0] == "cabinet"]
    assert len(cabinets) == trunks["used"].sum()
    # A point has whole pairs: a resistance thermometer has two, with one spare core.
    first = plan[(plan["cable"] == "B trunk 1") & (plan["carries"] == "P0")]
    assert first["core"].tolist() == [1, 2, 3]
    assert plan[(plan["cable"] == "B trunk 1") & (plan["core"] == 4)]["carries"].item() == "spare"


def test_a_workbook_has_the_same_tables_as_the_files(found):
    for option in OPTIONS:
        book = openpyxl.load_workbook(found.folder / option / f"{option}.xlsx")
        names = {path.stem for path in (found.folder / option).glob("*.csv")}
        assert set(book.sheetnames) == names >= TABLES
        for name in names:
            titles, *rows = book[name].iter_rows(values_only=True)
            again = read(found.folder / option / f"{name}.csv")
            assert list(titles) == list(found.made.designs[option].tables()[name])
            assert len(rows) == len(again)
            for row, other in zip(rows, again, strict=True):
                for cell, text in zip(row, other.values(), strict=True):
                    if isinstance(cell, int | float) and not isinstance(cell, bool):
                        assert float(text) == pytest.approx(cell, rel=1e-9)
                    else:
                        assert text == ("" if cell is None else str(cell))


def test_the_same_list_gives_the_same_files_and_another_point_changes_no_names():
    first, again = (SHIP.plan("AS-i", (20, 0, 4)).tables() for _ in range(2))
    for name, table in first.items():
        pd.testing.assert_frame_equal(table, again[name])
    fewer = IoList(SHIP.points.iloc[1:].reset_index(drop=True), "fewer")
    for option in OPTIONS:
        all_, less = (one.plan(option, (20, 0, 4)).cables for one in (SHIP, fewer))
        names = all_.set_index("b")["run"][fewer.points["tag"]]
        assert less.set_index("b")["run"][fewer.points["tag"]].equals(names)
        assert all_["run"].is_unique


def test_names_stay_unique_if_points_and_boxes_share_one():
    rows = [
        "A trunk 1,contact,1,2,3,drop A",
        "A,contact,1,2,3,drop A",
        "CAN 1 master,solenoid,9,2,3,",
    ]
    iolist = IoList.parse("\n".join(["tag,signal,x,y,z,box", *rows]))
    for option in OPTIONS:
        design = iolist.plan(option, (0, 0, 0))
        names = [*design.cables["run"], *design.devices["device"], *iolist.points["tag"]]
        assert len(set(names)) == len(names)


HOSTILE = ["=1+1", "-K1", "+A1", "@SUM(A1)", "'=K", "=cmd|'/c calc'!A1"]


def test_no_cell_is_a_formula_and_every_tag_is_read_back(tmp_path):
    words = dict.fromkeys(("tag", "system", "box"), HOSTILE)
    points = pd.DataFrame({**words, "signal": "contact", "x": range(6), "y": 1.0, "z": -1.0})
    iolist = IoList.from_table(points)
    iolist.compare((0, 0, 0)).save(tmp_path)
    number = re.compile(r"-?[0-9.]+(e[+-][0-9]+)?")
    for path in tmp_path.rglob("*.csv"):
        for row in csv.reader(path.read_text(encoding="utf-8-sig").splitlines()):
            assert not [c for c in row if c[:1] in ("=", "+", "-", "@") and not number.fullmatch(c)]
    for path in tmp_path.rglob("*.xlsx"):
        book = openpyxl.load_workbook(path)
        cells = [cell for sheet in book for row in sheet.iter_rows() for cell in row]
        assert "f" not in {cell.data_type for cell in cells}
        tags = [row[0].value for row in book["points"].iter_rows(2)]
        assert tags == iolist.points["tag"].tolist()
    tags = [row["tag"] for row in read(tmp_path / "CAN" / "points.csv")]
    # As in `read_iolist`, an apostrophe precedes a text that could be a formula.
    again = IoList.from_table(points.assign(tag=tags)).points["tag"]
    assert again.tolist() == iolist.points["tag"].tolist()


def test_a_design_without_connections_has_tables_with_titles_only(tmp_path):
    design = IoList.parse("tag,signal,x,y,z\nA,contact,900,0,0").plan("AS-i", (0, 0, 0))
    design.save(tmp_path)
    assert [row["tag"] for row in read(tmp_path / "points.csv")] == ["A"]
    assert read(tmp_path / "points.csv")[0]["channel"] == ""
    assert read(tmp_path / "reasons.csv")[0]["subject"] == "A"
    assert read(tmp_path / "cables.csv") == [] == read(tmp_path / "terminals.csv")
    assert (tmp_path / "cables.csv").read_text(encoding="utf-8-sig").startswith("cable,from,")


def test_the_names_of_designs_become_names_of_files(tmp_path):
    one = small_loop()
    given_ = ["a/b", "a-b", "A:B", "..", "../x", "케이블 1"]
    compare([replace(one, name=name) for name in given_]).save(tmp_path / "in" / "here")
    folders = sorted(path.name for path in (tmp_path / "in" / "here").iterdir() if path.is_dir())
    assert folders == sorted(["a-b", "a-b (2)", "A-B (3)", "design", "-x", "케이블 1"])
    assert [path.name for path in tmp_path.iterdir()] == ["in"]
    assert file_name("AS-i, short lines") == "AS-i, short lines"


def test_the_command_writes_the_tables_into_a_folder(tmp_path, capsys):
    points, folder = tmp_path / "points.csv", tmp_path / "yard"
    SHIP.save(points)
    command = ["design", str(points), "--cabinet", "20,0,4", "--options", "home runs,CAN"]
    assert main([*command, "--tables", str(folder)]) in (0, 1)
    assert f"written: {folder}" in capsys.readouterr().out
    assert {path.name for path in folder.iterdir() if path.is_dir()} == {"home runs", "CAN"}
    assert len(read(folder / "CAN" / "points.csv")) == len(SHIP)
    assert main([*command, "--tables", str(tmp_path / "none" / "yard")]) == 2
    assert "there is no folder" in capsys.readouterr().err
