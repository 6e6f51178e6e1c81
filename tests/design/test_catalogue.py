from math import isinf, isnan, pi, sqrt

import pytest

from shipnet import datasets
from shipnet.design.catalogue import SPREAD, Cable, Range, cables, smallest
from shipnet.errors import ArgumentError

#: Copper at 20 degC [ohm mm2/m] and its density [g/cm3]; steel is the heaviest of the rest.
COPPER, DENSITY, STEEL = 0.01724, 8.89, 7.85


@pytest.fixture(params=list(cables()))
def cable(request):
    return cables()[request.param]


def test_resistance_and_mass_are_physically_possible(cable):
    # No conductor conducts better than copper of its cross-section, and none much worse.
    least = 2e3 * COPPER / cable.cross_section_mm2
    if not isnan(cable.loop_resistance):
        assert least <= cable.loop_resistance <= 1.35 * least
    copper = cable.conductors * cable.cross_section_mm2 * DENSITY / 1e3
    assert copper < cable.mass.low <= cable.mass.high < cable.area_mm2 * STEEL / 1e3
    # All in all between rubber and a third of steel [g/cm3].
    assert 1.0 < 1e3 * cable.mass.nominal / cable.area_mm2 < 2.7


def test_ranges_follow_from_what_is_known(cable):
    row = next(r for r in datasets.read("estimated_cables.csv").itertuples()
               if r.cable_id == cable.id)  # fmt: skip
    for field, nominal, status in (
        ("mass", float(row.mass_kg_per_km) / 1000, row.status_mass),
        ("lay", float(row.lay_h_per_m), row.status_labour),
        ("termination", float(row.termination_h_per_conductor), row.status_labour),
    ):
        low, middle, high = getattr(cable, field)
        assert middle == nominal
        assert (low, high) == pytest.approx(
            (nominal * (1 - SPREAD[status]), nominal * (1 + SPREAD[status]))
        )
    assert row.status_price == "assumption"
    assert cable.price.low == float(row.price_low_eur_per_m)
    assert cable.price.high == float(row.price_high_eur_per_m)
    assert cable.price.low < cable.price.nominal < cable.price.high
    for word in (row.status_diameter, row.status_mass, row.status_price, row.status_labour):
        assert word in SPREAD and word in cable.status


def test_work_at_a_conductor_spans_the_published_minutes():
    # 5 to 15 minutes, within the rounding of the nominal 0.17 h.
    span = cables()["MI1P075"].termination
    assert (60 * span.low, 60 * span.high) == pytest.approx((5, 15), rel=0.03)


def test_the_geometric_model_is_recomputed():
    # Cores of 2.53 mm (0.75 mm2 with 0.7 mm of insulation) fill 55 % of the bundle; screen, sheath,
    # braid and sheath add 5.55 mm to its diameter. The file prints one decimal.
    for cable in cables().values():
        if cable.id.startswith("MI") and cable.cross_section_mm2 == 0.75:
            bundle = 2.53 * sqrt(cable.conductors / 0.55)
            assert cable.diameter_mm == pytest.approx(bundle + 5.55, abs=0.15)
            assert cable.conductors == 2 * cable.pairs


def test_a_flat_cable_is_not_round():
    flat = cables()["ASI_FLAT"]
    assert flat.area_mm2 == 40
    round_ = cables()["MI1P150"]
    assert round_.area_mm2 == pytest.approx(pi * round_.diameter_mm**2 / 4)


def test_the_smallest_cable_is_the_thinnest_that_is_large_enough():
    for bus in ("hardwired", "AS-i", "CAN", "NMEA 2000", "Modbus RTU"):
        own = [c for c in cables().values() if bus in c.bus.split(" / ")]
        for conductors in range(1, max(c.conductors for c in own) + 1):
            found = smallest(conductors, bus, spare=0)
            assert isinstance(found, Cable) and found.conductors >= conductors
            assert not [c for c in own if c.conductors >= conductors
                        and c.diameter_mm < found.diameter_mm]  # fmt: skip


def test_the_reserve_is_added_and_rounded_up():
    assert [smallest(n, spare=0.2).pairs for n in (1, 2, 5, 6, 40, 61)] == [1, 2, 4, 4, 24, 37]
    # 25 and 12 % are 28, although 25 * 1.12 is a little more than that in binary.
    assert 25 * 1.12 > 28
    assert smallest(25, spare=0.12).conductors == 28


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"conductors": 0}, r"conductors is 0; .* 1\.\."),
        ({"conductors": 2.0}, r"conductors is 2\.0"),
        ({"conductors": 62}, "with a reserve of 20 % that is 75, and the largest cable .* has 74"),
        ({"conductors": 2, "bus": "Profibus"}, "bus is 'Profibus'; it must be one of hardwired"),
        ({"conductors": 2, "spare": -0.1}, r"spare is -0\.1"),
        ({"conductors": 2, "spare": float("nan")}, "spare is nan"),
    ],
)
def test_what_no_cable_can_do_is_refused(arguments, message):
    with pytest.raises(ArgumentError, match=message):
        smallest(**arguments)


def test_a_range_lies_about_its_figure():
    assert Range.around(4.0, "confirmed") == (4, 4, 4)
    with pytest.raises(ArgumentError, match="status is 'sure'"):
        Range.around(4.0, "sure")
    with pytest.raises(ArgumentError, match="nominal is nan"):
        Range.around(float("nan"), "estimate")


def test_only_cables_of_a_bus_have_a_longest_segment():
    assert all(isinf(c.longest_m) == (c.bus == "hardwired") for c in cables().values())
    with pytest.raises(TypeError):
        cables()["new"] = None
