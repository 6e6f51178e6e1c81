import numpy as np
import pytest

from shipnet.asi.quality import signal_quality
from shipnet.asi.receiver import receive
from shipnet.asi.segment import POWER_SUPPLY, Segment
from shipnet.asi.telegram import RESPONSES
from shipnet.asi.topology import star, straight_line
from shipnet.errors import ArgumentError
from shipnet.line import CableRun, Load, Network


def test_it_is_the_worst_of_what_the_receiver_says():
    segment = straight_line(140, slaves=(5, 70, 140))
    found = signal_quality(segment)
    _, u = segment.signals(RESPONSES, dt=250e-9, duration=102e-6)
    heard = receive(u, 250e-9, 7)
    assert found.evenness == pytest.approx(heard.weakest.min(axis=1), abs=1e-12)
    assert found.ringing == pytest.approx(heard.ringing.max(axis=1), abs=1e-12)
    assert found.level_least == pytest.approx(np.ptp(u, axis=-1).min(axis=1), abs=1e-12)
    assert (found.level_most >= found.level_least).all()
    assert found.received.tolist() == [1, 1, 1]


def test_too_long_a_cable_loses_some_and_no_signal_loses_all():
    assert 0 <= signal_quality(straight_line(250, slaves=(5,))).received[0] < 1
    shorted = Network([CableRun("0 m", "slave", 10)], {"0 m": Load(r=0.01, l=POWER_SUPPLY.l)})
    found = signal_quality(Segment(shorted, "0 m", ("slave",)))
    assert (found.evenness[0], found.ringing[0], found.received[0]) == (0, 1, 0)


def test_requests_and_many_slaves():
    found = signal_quality(star(90, [10 / 62] * 62), ("00101010111001", "01010101010101"))
    assert found.received.shape == (62,)
    assert (found.received == 1).all()


def test_words_of_two_lengths_are_refused():
    with pytest.raises(ArgumentError, match="one length"):
        signal_quality(straight_line(10, (5,)), ("0011001", "00101010111001"))
