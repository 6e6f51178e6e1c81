import numpy as np
import pytest

from shipnet.errors import ArgumentError
from shipnet.modbus.electrical import INTERFACES, interfaces


def fits(*args, **kwargs):
    table = interfaces(*args, **kwargs)
    assert (table.fits == (table.why_not == "")).all()
    return set(table.interface[table.fits])


def longest(name, rate):
    return interfaces(2, 10, rate).set_index("interface").longest_m[name]


def test_lengths_and_rates_equal_the_published_ones():
    # Brainboxes: 40 ft at 10 Mbit/s, 4000 ft at 100 kbit/s; NI: 50 ft and 20 kbit/s for RS-232.
    for name in ("RS-422", "RS-485"):
        assert longest(name, 10e6) == pytest.approx(40 * 0.3048, rel=0.001)
        assert longest(name, 100e3) == pytest.approx(4000 * 0.3048, rel=0.001)
    assert longest("RS-232", 20e3) == pytest.approx(50 * 0.3048, abs=0.3)
    assert longest("RS-232", 20_001) == 0


@pytest.mark.parametrize("name", INTERFACES)
def test_a_line_is_never_longer_at_a_higher_rate(name):
    lengths = [longest(name, rate) for rate in np.geomspace(300, 10e6, 200)]
    assert (np.diff(lengths) <= 0).all()


def test_an_interface_stops_fitting_at_each_limit():
    assert fits(2, 15, 20e3) == {"RS-232", "RS-422", "RS-485"}
    assert fits(2, 15.1, 20e3) == fits(2, 15, 20_001) == {"RS-422", "RS-485"}
    assert fits(3, 15, 20e3) == {"RS-485"}
    assert fits(32, 1219, 9600) == {"RS-485"}
    assert fits(33, 1219, 9600) == fits(2, 1219.1, 9600) == set()


def test_reasons_are_given_and_lines_out_of_range_refused():
    why = interfaces(40, 5000, 5e6).set_index("interface").why_not
    assert why["RS-232"] == "40 stations are more than 2; 5e+06 bit/s is more than 20000 bit/s"
    assert why["RS-485"] == "40 stations are more than 32; 5000 m is more than 24.38 m"
    for arguments, message in (
        ((1, 10, 9600), "n_stations is 1"),
        ((2, -1, 9600), "length is -1 m"),
        ((2, 1, 10), "bit_rate is 10 bit/s"),
    ):
        with pytest.raises(ArgumentError, match=message):
            interfaces(*arguments)
