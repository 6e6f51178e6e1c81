"""Section 3.4, Table 3, Figs 3 and 4: levels, pulses and what the place of a slave does."""

from __future__ import annotations

import numpy as np

from shipnet.asi.modulation import levels_of, pulses_of, send_current
from shipnet.asi.telegram import RESPONSES, Response
from shipnet.asi.topology import straight_line
from shipnet.papers.registry import check

__all__: list[str] = []


@check("kim2023-025", "icn2007-049", counter={"near": 100.0, "far": 5.0})
def louder_far_from_supply(*, near: float = 5.0, far: float = 100.0) -> bool:
    """Whether a slave at `far` makes more voltage at the master than one at `near`."""
    _, u = straight_line(100, slaves=(near, far)).signals(Response(0x6).bits)
    smaller, larger = np.abs(u[:, 0]).max(axis=-1)
    return bool(larger > smaller)


@check("kim2023-077", "icn2007-050", counter={"supply": 60.0})
def above_supply(*, slave: float = 30.0, supply: float = 30.0) -> bool:
    """Whether the voltage at a slave that sends on 30 V rises above `supply`."""
    place = 100.0
    segment = straight_line(100, slaves=(place,), master=place, supply=0)
    _, u = segment.signals(Response(0x6).bits)
    return bool(slave + u.max() > supply)


@check("kim2023-087", counter={"zero": (0, 1)})
def zero_falls(*, zero: tuple[int, int] = (1, 0)) -> bool:
    """Whether a 0 has these levels, and a 1 the inverse."""
    return tuple(levels_of("0")) == zero and tuple(levels_of("1")) == zero[::-1]


@check("kim2023-088", "icn2007-009", counter={"sign": 1})
def first_pulse(*, sign: int = -1) -> bool:
    """Whether the first pulse of every response has this sign, and belongs to the start bit."""
    trains = pulses_of(RESPONSES)
    return bool((trains[:, 0] == 0).all() and (trains[:, 1] == sign).all())


@check("icn2007-008", counter={"sign": 1})
def rising_current(*, sign: int = -1) -> bool:
    """Whether the voltage on the line has this sign while the current begins to rise."""
    t, u = straight_line(100, slaves=(5,)).signals(Response(0x6).bits, start=5e-6)
    slope = np.gradient(send_current(t, Response(0x6).bits, start=5e-6), t)
    first = int(np.argmax(np.abs(slope) > 0.5 * np.abs(slope).max()))
    return bool(slope[first] > 0 and np.sign(u[0, 0, first]) == sign)
