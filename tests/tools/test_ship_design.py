"""The ship design tool: its comparison, its caches, and the files that it reads and writes."""

import re
from base64 import b64decode
from dataclasses import replace
from io import BytesIO
from zipfile import ZipFile

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

from shipnet.design.iolist import IoList
from shipnet.design.layout import Site
from shipnet.design.planning import OPTIONS
from shipnet.design.report import BANNER
from shipnet.design.settings import Settings
from shipnet.errors import ArgumentError, InputError
from shipnet.tools import ship_design
from shipnet.tools._view import Answer, details, read_state, write_state
from shipnet.tools.ship_design import EXAMPLES, MIXES, PICTURES, ShipDesign, from_file
from tests.support import load

FEW = "tag,system,type,x,y,z,update,category\n" + "".join(
    f"P{n},{'bilge' if n % 2 else 'ballast'},{'DO' if n % 3 else 'DI'},{30 + 3 * n},{n % 5},2,"
    f"500,{'III' if n < 2 else 'II'}\n"
    for n in range(8)
)
SMALL = ShipDesign(FEW, "few.csv", "10, 0, 8")
HOSTILE = "<img src=x onerror=y>"


@pytest.fixture(scope="module")
def small():
    return SMALL.result


def test_the_tool_agrees_with_compare(small):
    iolist = IoList.parse(FEW, "few.csv")
    rng = np.random.default_rng(2024)
    expected = iolist.compare(Site((10, 0, 8)), OPTIONS, rng=rng)
    pd.testing.assert_frame_equal(small.table(), expected.table())
    pd.testing.assert_frame_equal(small.likely(), expected.likely())
    pd.testing.assert_frame_equal(small.tornado().every, expected.tornado().every)
    assert small.conclusions() == expected.conclusions()


def test_a_new_price_replans_nothing_and_a_new_limit_does(monkeypatch, small):
    def planner(*_, **__):
        raise AssertionError("planned anew")

    monkeypatch.setattr(ship_design, "plan", planner)
    monkeypatch.setattr(ship_design, "site_of", planner)
    dear = replace(SMALL, labour=110.0, parts=2.0, picture="assumptions").result
    kept = (dear.designs, small.designs)
    assert all(a.cables is b.cables for a, b in zip(*(own.values() for own in kept), strict=True))
    assert replace(SMALL, can=False).result.designs.keys() == set(OPTIONS) - {"CAN", "CAN doubled"}
    single = {option for option in OPTIONS if not option.endswith(" doubled")}
    assert replace(SMALL, doubled=False).result.designs.keys() == single
    with pytest.raises(AssertionError, match="planned anew"):
        _ = replace(SMALL, spare=0.3).result


def test_settings_override_the_controls_and_affect_plan_price_and_rules():
    limits = "detour = 1.5\ntails = 9\nhost_time = 0.1\n[can]\nbit_rates = [50000]\n"
    result = replace(SMALL, own=f"{limits}[assumptions]\nlabour_rate = 99", detour=1.1).result
    site = Site((10, 0, 8), detour=1.5, tails=9)
    assert (result.site.detour, result.site.tails) == (1.5, 9)
    values = {"can.bit_rates": (50_000,), "assumptions.labour_rate": 99, "host_time": 0.1}
    expected = IoList.parse(FEW).compare(site, OPTIONS, settings=values)
    pd.testing.assert_frame_equal(result.table(), expected.table())
    with pytest.raises(InputError) as caught:
        _ = replace(SMALL, own="detour = 9000\n[asi]\nlenght = 3").result
    assert len(caught.value.faults) == 2 and "asi.length" in str(caught.value)


def test_settings_are_loaded_from_a_file_and_saved_to_one():
    page = SMALL.explore()
    load(page.uploads["load settings"], b"[asi]\nlength = 200\n", "own.toml")
    assert page.inputs.own == "[asi]\nlength = 200\n"
    saved = re.search('settings.toml" href="data:[^,]*,([^"]*)"', page.links.value)[1]
    assert Settings.parse(b64decode(saved).decode()).asi.length == 200
    load(page.uploads["load settings"], b"[asi]\nlength = -1\n", "bad.toml")
    assert page.inputs.own == "[asi]\nlength = 200\n" and "asi.length is -1" in page.note


def test_the_labour_rate_is_paid_by_the_hour_and_the_price_of_parts_by_the_part(small):
    base, takes = small.table(), small.quantities
    dear = replace(SMALL, labour=75.0).result.table()
    assert (dear["total_cost_eur"] - base["total_cost_eur"]).tolist() == pytest.approx(
        [20 * one["labour_h"] for one in takes.values()]
    )
    parts = replace(SMALL, parts=2.0).result.table()["total_cost_eur"] - base["total_cost_eur"]
    assert parts[["home runs", "junction boxes"]].tolist() == pytest.approx([0, 0])
    assert (parts[["AS-i", "CAN", "Modbus RTU"]] > 1000).all()
    assumed = replace(SMALL, labour=75.0).result.quantities["CAN"].assumptions
    assert dict(zip(assumed["name"], assumed["status"], strict=True))["labour_rate"] == "given"


def test_a_short_update_time_leaves_points_out_and_each_reason_is_given_once():
    tight = replace(SMALL, update_ms=20)
    result = tight.result
    left = result.table()["points_left_out"]
    assert left["home runs"] == 0 and left["Modbus RTU"] > 1
    assert "Modbus RTU" not in result.meeting and "Modbus RTU" not in result.tornado().between
    why = tight.numbers["conclusions"]
    assert "needs an update every 20 ms" in why and f"(and {left['Modbus RTU'] - 1} more)" in why
    only = replace(tight, **dict.fromkeys(("home_runs", "junction_boxes", "asi", "can"), False))
    said = "8 points: nothing to compare: no design can connect a point"
    assert only.verdict == said and not only.ok
    for picture in PICTURES:
        replace(only, picture=picture).plot(ax=Figure().subplots())


def test_the_table_and_the_page_say_that_it_is_a_design_aid(small):
    shown = SMALL._view()
    pd.testing.assert_frame_equal(shown.table, small.short())
    assert BANNER in shown.caption and "assumptions" in shown.caption
    html = details(Answer(SMALL, shown))
    assert BANNER in html and "<th" in html and "cabinet" in shown.numbers


@pytest.mark.parametrize("mixed", MIXES)
def test_every_mix_is_one_more_option_of_the_points_present(mixed):
    result = replace(SMALL, mixed=mixed).result
    assert list(result.designs) == [*OPTIONS, mixed]
    plain = "tag,type,home run\na,AI,20\nb,AI,30\n".replace("AI", "AO")
    alone = replace(SMALL, points=plain, mixed=mixed).result
    assert set(alone.designs[mixed].points["bus"]) <= {"CAN", "Modbus RTU", "hardwired", ""}


def test_the_cabinet_is_typed_or_found_or_asked_for():
    ship = replace(
        SMALL,
        points=EXAMPLES["ship"],
        cabinet=" ",
        **dict.fromkeys(("junction_boxes", "asi", "can", "modbus"), False),
    )
    result = ship.result
    assert result.site.cabinet == (26, 6, 14) and "26, 6, 14 m" in ship.numbers["cabinet"]
    assert SMALL.numbers["cabinet"] == "the cabinet is at 10, 0, 8 m"
    with pytest.raises(ArgumentError, match="give its position x, y, z in m, such as 26,6,14"):
        _ = replace(SMALL, cabinet="").result
    for wrong in ("1, 2", "1, 2, nan", "1 2 3"):
        with pytest.raises(ArgumentError, match=r"cabinet is .* three numbers x, y, z in m"):
            _ = replace(SMALL, cabinet=wrong).result
    lengths = replace(SMALL, points="tag,type,home run\na,DI,20\nb,DI,30\n", cabinet="")
    assert "the list gives every cable length" in lengths.numbers["cabinet"]


@pytest.mark.parametrize(("name", "source"), [("a\n b\0c", "a b c"), (" \t", "list"), ("", "list")])
def test_the_name_of_a_list_is_one_line(name, source):
    assert replace(SMALL, name=name).result.iolist.source == source


def test_no_option_at_all_gives_a_message():
    off = dict.fromkeys(("home_runs", "junction_boxes", "asi", "can", "modbus"), False)
    with pytest.raises(ArgumentError, match="no option is on"):
        _ = replace(SMALL, **off).result
    assert len(replace(SMALL, **off, mixed=next(iter(MIXES))).result.designs) == 1


def excel(table):
    file = BytesIO()
    table.to_excel(file, index=False)
    return file.getvalue()


def test_a_workbook_becomes_its_points():
    table = pd.DataFrame(
        {
            "Tag": ["LS-1", "TT-2"],
            "Signal": ["limit switch", "Pt100 3-wire"],
            "x": [1.5, 2],
            "y": [0, 0],
            "z": [3, 4],
        }
    )
    taken = from_file(SMALL, "list.xlsx", excel(table))
    assert (taken.name, taken.cabinet) == ("list.xlsx", "")
    made = IoList.parse(taken.points).points
    assert made["tag"].tolist() == ["LS-1", "TT-2"] and made["x_m"].tolist() == [1.5, 2]
    with pytest.raises(InputError, match=r"list\.xlsx: row 3, column Tag"):
        from_file(SMALL, "list.xlsx", excel(table.assign(Tag="LS-1")))


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "cp1252"])
def test_a_file_is_read_as_it_was_written(encoding):
    text = "tag;type;home run;note\nL\xf6s-1;DI;12,5;\xf6l\n"
    taken = from_file(SMALL, "x" * 90 + ".csv", text.encode(encoding))
    assert IoList.parse(taken.points).points["tag"].tolist() == ["L\xf6s-1"]
    assert len(taken.name) == 80


def test_a_list_too_large_for_a_state_is_refused():
    with pytest.raises(ArgumentError, match="bytes as JSON; the limit is"):
        replace(SMALL, points="\u8239" * 400_000)
    most = replace(SMALL, points="\u8239" * 310_000 + "\n")
    state = write_state("ship_design", most).encode()
    assert len(state) < 2_000_000
    assert read_state(state, "ship_design", ShipDesign) == [most]


def test_the_page_lists_the_faults_of_a_bad_list_and_accepts_a_good_one():
    page = SMALL.explore()
    before = page.inputs
    upload = page.uploads["load a list"]
    load(upload, f"tag,type,x,y,z\nA,DI,1,2,3\nA,DI,1,2,x\n{HOSTILE},XX,1,2,3\n".encode(), "l.csv")
    assert page.note.startswith("l.csv: row 3, column tag (A): 'A'") and "row 4" in page.note
    assert page._noted.value.count("<br>") == 4 and "<img" not in page._noted.value
    assert page.inputs == before
    load(upload, FEW.replace("P7", HOSTILE).encode(), "few.csv")
    assert page.text.startswith("few.csv") is False and "give its position x, y, z" in page.text
    page.controls["cabinet"].value = "10, 0, 8"
    assert "8 points: " in page.text and page.note == ""
    assert HOSTILE not in page._shown.value + page._details.value
    page.controls["points"].value = "tag,type,x,y,z\nA,DI,1,2,x\nA,DI,1,2,3\n"
    assert page.text.splitlines()[0] == "few.csv:" and len(page.text.splitlines()) == 3


def test_the_examples_are_a_click_away():
    page = ShipDesign().explore()
    assert "99 points: " in page.text
    page.buttons["example: ship"].click()
    assert "353 points: " in page.text and page.controls["cabinet"].value == ""
    page.buttons["example: main engine"].click()
    assert page.inputs == ShipDesign()


def test_the_report_is_made_on_request_and_dropped_after_a_change():
    page = SMALL.explore()
    assert "report.html" not in page.links.value
    page.buttons["make the report"].click()
    made = re.search('report.html" href="data:[^,]*,([^"]*)"', page.links.value)[1]
    report = b64decode(made).decode()
    assert BANNER in report and "few.csv" in report
    assert not re.findall(r"""(?:src|href)=["']?(?:https?:)?//|url\(|@import|<script""", report)
    assert "foot of the page" in page.text
    zipped = re.search('tables.zip" href="data:[^,]*,([^"]*)"', page.links.value)[1]
    with ZipFile(BytesIO(b64decode(zipped))) as archive:
        written = dict(page.inputs.result.files())
        assert set(archive.namelist()) == set(written) >= {"CAN/cables.csv", "AS-i/AS-i.svg"}
        assert archive.read("CAN/cables.csv") == written["CAN/cables.csv"]
    page.controls["labour"].value = 60.0
    assert "report.html" not in page.links.value and "foot of the page" not in page.text
    page.controls["labour"].value = 55.0
    assert "report.html" not in page.links.value
