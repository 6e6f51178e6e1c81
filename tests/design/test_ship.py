"""The drawing of a ship: what lights up is what a failure loses."""

import re
from xml.etree import ElementTree

import numpy as np
import pytest

from shipnet.design import IoList

SHIP = "tag,signal,x,y,z\n" + "".join(
    f"P-{n:02},contact,{3 * n},{n % 4 - 2},{n % 3}\n" for n in range(40)
)
CABINET = (10, 0, 2)


def parsed(html):
    return ElementTree.fromstring(html)


def places(path):
    return set(re.findall(r"M[\d.]+ [\d.]+(?=h0)", path))


@pytest.mark.parametrize("option", ["home runs", "junction boxes", "AS-i", "CAN doubled"])
def test_each_part_lights_up_the_points_that_its_failure_loses(option):
    design = IoList.parse(SHIP).plan(option, CABINET)
    root = parsed(design.drawing().html)
    point = next(g for g in root.iter("path") if g.get("class") == "point")
    order = places(point.get("d"))
    assert len(order) == 2 * 40
    metres = 3.0 * np.arange(40)
    drawn = np.array([float(place[1:].split()[0]) for place in sorted(order)])
    assert np.corrcoef(np.sort(drawn)[::2], metres)[0, 1] == pytest.approx(1, abs=1e-6)
    parts = {}
    for group in root.iter("g"):
        if group.get("class") != "loss":
            continue
        *members, highlight = group
        for member in members:
            name, fails = re.fullmatch(
                r"(.*) (is cut|fails): \d+ of 40 points lost", member.find("text").text
            ).groups()
            parts[name, fails] = places(highlight.get("d"))
    assert len(parts) == len(design.cables) + len(design.devices)
    alone = {tag: places(design_of_one(design, tag)) for tag in design.points["tag"]}
    for (name, fails), lit in parts.items():
        what = "cables" if fails == "is cut" else "devices"
        lost = design.lost(**{what: [name]})
        assert lit == set().union(*(alone[tag] for tag in lost), set())


def design_of_one(design, tag):
    """Return the path of one point, from the module's own views of the whole design."""
    from shipnet.design import ship

    devices = design.devices.set_index("device")[["x_m", "y_m", "z_m"]]
    points = design.iolist.points.set_index("tag")[["x_m", "y_m", "z_m"]]
    return ship._Views(ship.pd.concat([devices, points])).dots([tag])


def test_a_point_without_a_position_is_counted_and_not_drawn():
    points = IoList.parse("tag,signal,x,y,z,length\nA,contact,3,2,3,\nB,contact,,,,12\n")
    drawing = points.plan("home runs", (0, 0, 0)).drawing()
    assert "points without a position (1) are not drawn" in drawing.html
    assert "home run B" not in drawing.html


def test_names_are_escaped(tmp_path):
    points = IoList.parse("tag,signal,x,y,z\n<b>&,contact,3,2,3\n")
    points.plan("CAN", (0, 0, 0)).drawing().save(tmp_path / "ship.html")
    page = (tmp_path / "ship.html").read_text(encoding="utf-8")
    assert "<b>" not in page
    assert "&lt;b&gt;&amp;" in page


@pytest.mark.parametrize("host_time", [0.0, 5.0])
def test_a_comparison_draws_all_designs_with_cost_and_violated_rules(host_time):
    comparison = IoList.parse(SHIP).compare(CABINET, settings={"host_time": host_time})
    drawing = comparison.drawing()
    captions = ["".join(one.itertext()) for one in parsed(drawing.html).iter("figcaption")]
    violated = comparison.findings().violated().groupby("design")["rule"].first()
    assert len(violated) == (8 if host_time else 0)
    costs = comparison.table()["total_cost_eur"]
    for caption, (name, cost) in zip(captions, costs.items(), strict=True):
        assert caption.startswith(f"{name} ")
        shown = float(re.search(r" ([\d,]+) EUR", caption)[1].replace(",", ""))
        assert shown == pytest.approx(cost, rel=0.006)
        assert ("violates" in caption) == (name in violated)
        assert name not in violated or repr(violated[name]) in caption
    assert repr(drawing).startswith("<ShipDrawing: 8 designs")
