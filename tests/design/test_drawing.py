"""The single-line drawing shows every device once, with the trunk as in the tables."""

import re
from collections import Counter
from xml.etree import ElementTree

import pytest

from shipnet.design.drawing import sheets, single_line
from shipnet.design.iolist import IoList
from shipnet.design.planning import OPTIONS
from shipnet.design.plant import Plant
from tests.design.lists import ship, small_loop

SHIP = ship(300)
SVG = "{http://www.w3.org/2000/svg}"


def words(svg):
    return [text.text for text in ElementTree.fromstring(svg).iter(f"{SVG}text")]


@pytest.mark.parametrize("option", OPTIONS)
def test_every_box_station_and_repeater_is_drawn_once_with_its_cable_length(option):
    design = SHIP.plan(option, (20, 0, 4))
    said = words(single_line(design))
    drawn = design.devices[design.devices["line"] != "B"]
    drawn = drawn[drawn["kind"].isin(["box", "station", "module", "repeater", "master"])]
    names = Counter(
        name.removeprefix(f"{segment} ") if segment else name
        for name, segment in zip(drawn["device"], drawn["segment"], strict=True)
    )
    found = Counter(said)
    assert any("on each of two lines" in text for text in said) == option.endswith("doubled")
    assert {name: found[name] for name in names} == names
    trunks = design.cables[(design.cables["kind"] == "trunk") & (design.cables["line"] != "B")]
    trunks = trunks.drop_duplicates("b")
    lengths = Counter(f"{metres:.0f} m" for metres in trunks["length_m"])
    assert all(found[length] >= number for length, number in lengths.items())
    metres = [int(text[:-2]) for text in said if re.fullmatch(r"\d+ m", text)]
    assert len(metres) == len(trunks)
    for segment in design.segments["segment"]:
        assert any(text.startswith(f"{segment}: ") for text in said)


def test_home_runs_are_drawn_by_system():
    points = "\n".join(f"P{n},contact,{['Bilge', 'Fuel oil'][n % 2]},{n},0,0" for n in range(9))
    design = IoList.parse(f"tag,signal,system,x,y,z\n{points}").plan("home runs", (0, 0, 0))
    said = words(single_line(design))
    assert "Bilge" in said and "5 home runs of 5 to 14 m" in said
    assert "Fuel oil" in said and "4 home runs of 6 to 13 m" in said


def test_a_drawing_has_sheets_that_fit_on_a_page():
    drawn = sheets(ship(600).plan("AS-i", (20, 0, 4)))
    assert len(drawn) > 1
    for number, (svg, height) in enumerate(drawn, 1):
        assert height <= 1030
        assert f"sheet {number} of {len(drawn)}" in svg
        for text in ElementTree.fromstring(svg).iter(f"{SVG}text"):
            assert 0 < float(text.get("x")) < 760 and 0 < float(text.get("y")) <= height


def test_supplies_and_terminators_are_drawn_at_their_places():
    said = words(single_line(small_loop()))
    assert {"master", "JB1", "JB2", "45 m", "26 m"} <= set(said)
    small = {"supply.station": 0.1, "supply.solenoid": 0, "supply.short": 0}
    said = words(single_line(ship(40).plan("CAN", (20, 0, 4), settings=small)))
    assert "+ terminator + supply " in said or "+ supply + terminator " in said
    assert sum(text.startswith("+ terminator") for text in said) >= 1


@pytest.mark.parametrize("option", ["CAN", "AS-i"])
def test_a_supply_outside_the_cabinet_is_drawn_beside_the_device_that_it_feeds(option):
    design = SHIP.plan(option, (20, 0, 4))
    said = words(single_line(design))
    devices = design.devices.set_index("device")
    out = devices[devices["kind"].str.endswith("supply") & (devices["at"] == "")]
    fed = design.cables[design.cables["a"].isin(out.index)]
    assert len(fed) >= len(out) > 1
    for supply in out.itertuples():
        name = fed["b"][fed["a"] == supply.Index].iloc[0].removeprefix(f"{supply.segment} ")
        title = next(n for n, text in enumerate(said) if text.startswith(f"{supply.segment}: "))
        row = said.index(name, title)
        assert said[row + 1].startswith("+ ") and f"+ {supply.kind} " in said[row + 1]


def test_all_designs_can_be_drawn_and_names_are_escaped():
    single_line(Plant(12, contacts=2, lines=3).on_asi)
    single_line(Plant(1, contacts=1).hardwired)
    single_line(small_loop())
    single_line(small_loop(redundant=True))
    hostile = '<script>&"'
    iolist = IoList.parse(f"tag,signal,system,box,x,y,z\nA,contact,{hostile},{hostile},1,2,3")
    for option in OPTIONS:
        svg = single_line(iolist.plan(option, (0, 0, 0)))
        ElementTree.fromstring(svg)
        assert "<script" not in svg
