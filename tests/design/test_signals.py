"""Conductors by kind of point, the same points on a bus, and the lines that slaves need."""

import numpy as np
import pytest

from shipnet.design import SIGNALS, Plant, Saving, lines_needed
from shipnet.errors import ArgumentError
from shipnet.signals import hardwired_conductors


def test_conductors_of_the_papers():
    assert (
        hardwired_conductors({"contact": 62 * 4}) == Plant(62, contacts=4).saving.hardwired == 496
    )
    assert hardwired_conductors({"contact": 190}) == 380
    assert Plant(190, contacts=1, lines=14).saving == Saving(380, 28)
    assert f"{Saving(380, 28).left:.4f}" == "0.0737"
    # lee2012 Table 3: 62 resistance thermometers, 18 current loops, 19 switches.
    assert hardwired_conductors({"rtd_3wire": 62, "current_loop": 18, "contact": 19}) == 260


def test_no_points_need_no_conductors():
    assert hardwired_conductors({}) == lines_needed(0) == 0


@pytest.mark.parametrize(
    "call",
    [
        lambda: lines_needed(1, slaves_per_line=63),
        lambda: Saving(0, 2),
        lambda: hardwired_conductors({"lamp": 1}),
        lambda: hardwired_conductors({"contact": -1}),
    ],
)
def test_bad_counts(call):
    with pytest.raises(ArgumentError):
        call()


def test_counts_in_small_integers_do_not_overflow():
    assert hardwired_conductors({"rtd_3wire": np.uint8(200)}) == 600
    assert type(Saving(np.int64(4), np.int8(2)).hardwired) is int


def test_conductors_of_each_signal():
    # A common return leaves one wire per point; a number in the name is the number of wires.
    expected = {name: 1 if name.endswith("_common") else 2 for name in SIGNALS}
    expected |= {"rtd_3wire": 3, "rtd_4wire": 4, "current_loop_4wire": 4, "potentiometer": 3}
    expected |= {"proximity_3wire": 3, "current_loop_3wire": 3}
    assert {name: signal.conductors for name, signal in SIGNALS.items()} == expected
    for name, signal in SIGNALS.items():
        assert signal.meaning
        assert signal.common == int(name.endswith("_common"))
