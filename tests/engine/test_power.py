import pytest

from shipnet.engine.power import DieselEngine
from shipnet.errors import ArgumentError
from shipnet.papers.lee2012.engine import per_kilowatt_hour

#: MAN B&W, S50MC-C project guide, Fig. 1.02: speed [r/min], mean effective pressure [bar], kW and
#: BHP of 4 to 8 cylinders at the four corners of the layout diagram.
LAYOUT = {
    "L1": (127, 19.0, (6320, 7900, 9480, 11060, 12640), (8580, 10725, 12870, 15015, 17160)),
    "L2": (127, 12.2, (4040, 5050, 6060, 7070, 8080), (5500, 6875, 8250, 9625, 11000)),
    "L3": (95, 19.0, (4740, 5925, 7110, 8295, 9480), (6440, 8050, 9660, 11270, 12880)),
    "L4": (95, 12.2, (3040, 3800, 4560, 5320, 6080), (4120, 5150, 6180, 7210, 8240)),
}

#: Consumptions of the same figure: g/BHPh and g/kWh. One pair, 116 and 156, is left out: 116 g/BHPh
#: are 157.7 g/kWh, and which of the two is misprinted cannot be told.
CONSUMPTIONS = [(126, 171), (124, 169), (128, 174), (117, 159), (119, 162), (118, 160),
                (0.7, 0.95), (1.1, 1.5)]  # fmt: skip


@pytest.mark.parametrize("corner", LAYOUT)
def test_the_layout_diagram_of_the_maker_comes_out(corner):
    rate, bar, powers, _ = LAYOUT[corner]
    for cylinders, kw in zip(range(4, 9), powers, strict=True):
        # mep is printed to 0.1 bar, power per cylinder to 5 kW.
        tolerance = 0.05 / bar + 2.5 / (kw / cylinders)
        ours = DieselEngine.S50MC_C(cylinders).power(bar * 1e5, rate / 60)
        assert ours == pytest.approx(kw * 1e3, rel=tolerance)


@pytest.mark.parametrize("corner", LAYOUT)
def test_horsepowers_of_the_maker_are_metric(corner):
    _, _, kws, bhps = LAYOUT[corner]
    for cylinders, kw, bhp in zip(range(4, 9), kws, bhps, strict=True):
        # Both are printed to 5 a cylinder.
        tolerance = 2.5 * cylinders * (1 / kw + 1 / bhp)
        assert kw * 1e3 / bhp == pytest.approx(75 * 9.80665, rel=tolerance)


@pytest.mark.parametrize(("per_bhp", "per_kw"), CONSUMPTIONS)
def test_consumptions_of_the_maker_are_the_same_in_both_units(per_bhp, per_kw):
    # Both are rounded, to whole grams or to 0.1 and 0.05.
    half = (0.5, 0.5) if per_bhp > 10 else (0.05, 0.025)
    assert per_kilowatt_hour(per_bhp - half[0]) <= per_kw + half[1]
    assert per_kilowatt_hour(per_bhp + half[0]) >= per_kw - half[1]


def test_pressure_and_speed_are_inverse_to_power():
    engine = DieselEngine(0.7, 2.8, 6, strokes=4)
    power = engine.power(18e5, 1.5)
    assert engine.mean_effective_pressure(power, 1.5) == pytest.approx(18e5)
    assert engine.speed(power, 18e5) == pytest.approx(1.5)
    assert DieselEngine(0.7, 2.8, 6).power(18e5, 1.5) == pytest.approx(2 * power)


def test_power_is_the_work_of_a_piston_times_strokes():
    # The second route: force on the piston, along the stroke, once a turn.
    engine = DieselEngine(0.5, 2.0, 1)
    force = 19e5 * engine.swept_volume / 2.0
    assert engine.power(19e5, 127 / 60) == pytest.approx(force * 2.0 * 127 / 60)


def test_what_no_engine_has_is_refused():
    engine = DieselEngine.S50MC_C(8)
    for action, message in (
        (lambda: DieselEngine(0, 2, 8), "bore is 0 m"),
        (lambda: DieselEngine(0.5, float("nan"), 8), "stroke is nan m"),
        (lambda: engine.power(-1, 2), "pressure is -1 Pa"),
        (lambda: DieselEngine(0.5, 2, 0), "cylinders is 0"),
        (lambda: DieselEngine(0.5, 2, 8, strokes=3), "strokes is 3"),
        (lambda: engine.speed(1e6, 0), "pressure is 0 Pa"),
        (lambda: engine.mean_effective_pressure(1e6, 0), "rate is 0 1/s"),
    ):
        with pytest.raises(ArgumentError, match=message):
            action()
