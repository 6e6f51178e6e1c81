from math import isinf, isnan, pi, sqrt

import pandas as pd
import pytest

from shipnet import datasets
from shipnet.design.catalogue import SPREAD, Range, cables, smallest
from shipnet.errors import ArgumentError
from shipnet.line.cable import CABLES

#: Copper at 20 degC [ohm mm2/m] and its density [g/cm3]; steel is the densest other material.
COPPER, DENSITY, STEEL = 0.01724, 8.89, 7.85


ROWS = pd.read_csv(datasets.path("estimated_cables.csv"), index_col="cable_id")


@pytest.fixture(params=list(cables()))
def cable(request):
    return cables()[request.param]


def test_resistance_and_mass_are_physically_possible(cable):
    # A conductor's resistance is not below that of copper, and not far above it.
    row = ROWS.loc[cable.id]
    least = 2e3 * COPPER / row["cross_section_mm2"]
    if not isnan(row["loop_resistance_ohm_per_km"]):
        assert least <= row["loop_resistance_ohm_per_km"] <= 1.35 * least
    copper = cable.conductors * row["cross_section_mm2"] * DENSITY / 1e3
    assert copper < cable.mass.low <= cable.mass.high < cable.area_mm2 * STEEL / 1e3
    # The mean density is between that of rubber and a third of steel [g/cm3].
    assert 1.0 < 1e3 * cable.mass.nominal / cable.area_mm2 < 2.7


def test_a_bus_cable_has_an_impedance_and_about_the_resistance_of_its_line(cable):
    assert (cable.line == "") == (cable.buses == ("hardwired",))
    if cable.line:
        line = CABLES[cable.line]
        assert line.z0 == pytest.approx(100 if cable.buses == ("AS-i",) else 120, rel=0.01)
        if line.resistance:
            own = ROWS.loc[cable.id, "loop_resistance_ohm_per_km"]
            assert 1e3 * line.resistance == pytest.approx(own, rel=0.05)


def test_ranges_follow_from_what_is_known(cable):
    row = ROWS.loc[cable.id]
    for field, nominal, status in (
        ("mass", row["mass_kg_per_km"] / 1000, row["status_mass"]),
        ("lay", row["lay_h_per_m"], row["status_labour"]),
        ("termination", row["termination_h_per_conductor"], row["status_labour"]),
    ):
        ends = nominal * (1 - SPREAD[status]), nominal, nominal * (1 + SPREAD[status])
        assert getattr(cable, field) == pytest.approx(ends)
    assert row["status_price"] == "assumption"
    assert cable.price[::2] == (row["price_low_eur_per_m"], row["price_high_eur_per_m"])
    assert cable.price.low < cable.price.nominal < cable.price.high
    for what in ("diameter", "mass", "price", "labour"):
        assert row[f"status_{what}"] in SPREAD and row[f"status_{what}"] in cable.status


def test_termination_time_covers_the_published_range():
    # 5 to 15 minutes, within the rounding of the nominal 0.17 h.
    span = cables()["MI1P075"].termination
    assert (60 * span.low, 60 * span.high) == pytest.approx((5, 15), rel=0.03)


def test_the_geometric_model_is_recomputed():
    # Cores of 2.53 mm (0.75 mm2 with 0.7 mm of insulation) fill 55 % of the bundle; screen, sheath,
    # braid and sheath add 5.55 mm to its diameter. The file prints one decimal.
    own = ROWS.index.str.startswith("MI") & (ROWS["cross_section_mm2"] == 0.75)
    for row in ROWS[own].itertuples():
        bundle = 2.53 * sqrt(row.conductors / 0.55)
        assert row.diameter_mm == pytest.approx(bundle + 5.55, abs=0.15)
        assert row.conductors == 2 * row.pairs


def test_a_flat_cable_is_not_round():
    assert cables()["ASI_FLAT"].area_mm2 == 40
    diameter = ROWS.loc["MI1P150", "diameter_mm"]
    assert cables()["MI1P150"].area_mm2 == pytest.approx(pi * diameter**2 / 4)


def test_the_smallest_cable_is_the_thinnest_with_enough_conductors():
    own = [c for c in cables().values() if "hardwired" in c.buses]
    for conductors in range(1, max(c.conductors for c in own) + 1):
        found = smallest(conductors, spare=0)
        assert found.conductors >= conductors
        assert not [c for c in own if c.conductors >= conductors and c.area_mm2 < found.area_mm2]


def test_spares_are_added_and_rounded_up():
    assert [smallest(n, spare=0.2).conductors for n in (1, 2, 5, 6, 40, 61)] == [2, 4, 8, 8, 48, 74]
    # 25 plus 12 % is 28, although 25 * 1.12 is slightly more in binary.
    assert 25 * 1.12 > 28
    assert smallest(25, spare=0.12).conductors == 28


def test_more_conductors_than_the_largest_cable_has_are_refused():
    with pytest.raises(ArgumentError, match=r"75 with 20 % spares; the largest cable .* has 74"):
        smallest(62, spare=0.2)


def test_a_range_includes_its_nominal_value():
    assert Range.around(4.0, "confirmed") == (4, 4, 4)
    assert Range.around(4.0, "estimate") == (3, 4, 5)


def test_only_bus_cables_have_a_longest_segment():
    assert all(isinf(c.longest_m) == (c.buses == ("hardwired",)) for c in cables().values())
    with pytest.raises(TypeError):
        cables()["new"] = None
