import numpy as np
import pytest

from shipnet.asi import Request, Response
from shipnet.asi.modulation import send_spectrum
from shipnet.asi.segment import Segment
from shipnet.asi.topology import straight_line
from shipnet.errors import ArgumentError
from shipnet.line.cable import CABLES
from shipnet.line.waveform import laplace_grid, synthesize

BITS = [Response(data).bits for data in range(16)]
WORDS = np.array([[int(bit) for bit in bits] for bits in BITS])


def test_telegrams_are_sums_of_single_changes():
    segment = straight_line(100, slaves=(5, 50, 100))
    t, u = segment.signals(WORDS, f_max=6e6)
    assert u.shape == (3, 16, t.size)
    s = laplace_grid(102.4e-6, 6e6)
    transfer = segment.network.transfer(segment.master, s)
    for row, slave in enumerate(segment.slaves):
        heard = -transfer[segment.network.index(slave)] * send_spectrum(s, WORDS, start=5e-6)
        whole = synthesize(heard, t.size, 102.4e-6)
        assert u[row] == pytest.approx(whole, abs=2e-5 * np.abs(whole).max())


def test_what_a_slave_hears_is_what_the_master_hears_of_it():
    segment = straight_line(100, slaves=(30,), supply=70)
    other_way = Segment(segment.network, "30 m", ("0 m",))
    bits = Request.data_exchange(21, 0xE).bits
    assert segment.signals(bits)[1] == pytest.approx(other_way.signals(bits)[1], abs=1e-9)


def test_a_terminator_and_a_lossless_cable_change_the_signal():
    plain, lossless, ended = (
        straight_line(150, slaves=(5,), **options).signals(BITS[6])[1]
        for options in ({}, {"cable": CABLES["as-i lossless"]}, {"terminator": 100.0})
    )
    assert np.abs(plain - lossless).max() > 1e-3
    assert np.abs(plain - ended).max() > 0.1


def test_places_may_coincide():
    assert straight_line(100, slaves=(0, 100), master=100).slaves == ("0 m", "100 m")


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: straight_line(100, slaves=(101,)), r"the slave is at 101 m; .*0\.\.100"),
        (lambda: straight_line(100, slaves=(5,), master=-1), "the master is at -1 m"),
        (lambda: straight_line(100, slaves=(5,), supply=float("nan")), "the supply is at nan m"),
        (lambda: straight_line(100, slaves=(5,)).signals("01", dt=7e-8), "dt is 7e-08 s"),
        (lambda: straight_line(100, slaves=(5,)).signals("01", dt=1e-5), "dt is 1e-05 s"),
        (lambda: straight_line(100, slaves=(5,)).signals("02"), "bits must be 0 or 1"),
    ],
)
def test_bad_arguments(make, message):
    with pytest.raises(ArgumentError, match=message):
        make()
