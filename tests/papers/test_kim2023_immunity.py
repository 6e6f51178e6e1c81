import numpy as np
import pytest

from shipnet.asi.modulation import Modulation
from shipnet.asi.receiver import receive
from shipnet.papers.kim2023.signals import supply_decides


def test_the_supply_does_not_act_as_a_shield():
    # The same noise, on the supply of PELV and on one far above its limit of 60 V.
    assert not supply_decides()
    assert not supply_decides(supplies=(0.0, 60.0))
    assert supply_decides(deviations=(0.5, 0.7))
    # The other route: what is common to both wires, and what is constant, never reaches the
    # decision, because the receiver takes the difference and its mean off.
    dt = 250e-9
    t = np.arange(256) * dt
    u = -40e-6 * np.gradient(Modulation("0011001").current(t, start=5e-6), dt)
    plain, lifted = receive(u, dt, 7), receive(u + 230, dt, 7)
    assert lifted.bits.tolist() == plain.bits.tolist()
    assert lifted.ringing == pytest.approx(plain.ringing, abs=1e-9)
