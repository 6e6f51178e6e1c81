"""Section 3.4 and Table 2: pulses, tolerances, error detection, immunity."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations, product
from math import comb

import numpy as np
import numpy.typing as npt

from shipnet.arrays import Floats
from shipnet.asi.emc.disturbances import Noise
from shipnet.asi.emc.error_rates import count_errors
from shipnet.asi.modulation import HALF_BIT, Modulation, Pulses
from shipnet.asi.plan import Plan
from shipnet.asi.receiver import RECEIVERS, receive
from shipnet.asi.slave import DEVICE, Slave
from shipnet.asi.telegram import RESPONSES, Response, frame
from shipnet.asi.timing import Transaction
from shipnet.asi.topologies import line
from shipnet.crc import CAN, MODBUS, Crc
from shipnet.line.cable import CABLES, Cable
from shipnet.line.network import CableRun
from shipnet.papers.registry import check, numeric

# Section 3.4, Table 3, Figs 3 and 4: levels, pulses and the effect of a slave's position.


@check("kim2023-025", counter={"near": 100.0, "far": 5.0})
def louder_far_from_supply(*, near: float = 5.0, far: float = 100.0) -> bool:
    """Whether a slave at `far` causes a larger voltage at the master than one at `near`."""
    u = line(100, slaves=(near, far)).waveform(Response(0x6)).u
    smaller, larger = np.abs(u).max(axis=-1)
    return bool(larger > smaller)


@check("kim2023-077", counter={"supply": 60.0})
def above_supply(*, slave: float = 30.0, supply: float = 30.0) -> bool:
    """Whether the voltage at a slave that sends on a 30 V line rises above `supply`."""
    position = 100.0
    plan = line(100, slaves=(position,), master=position, supply=0)
    return bool(slave + plan.waveform(Response(0x6)).u.max() > supply)


@check("kim2023-087", counter={"zero": (0, 1)})
def zero_is_1_0(*, zero: tuple[int, int] = (1, 0)) -> bool:
    """Whether the Manchester code of a 0 has these levels, and that of a 1 the opposite."""
    return tuple(Modulation("0").levels) == zero and tuple(Modulation("1").levels) == zero[::-1]


@check("kim2023-088", counter={"sign": 1})
def first_pulse(*, sign: int = -1) -> bool:
    """Whether the first pulse of every response has this sign and belongs to the start bit."""
    trains = Modulation(RESPONSES).pulses.signs
    return bool((trains[:, 0] == 0).all() and (trains[:, 1] == sign).all())


@check("kim2023-099", counter={"sign": 1})
def rising_current(*, sign: int = -1) -> bool:
    """Whether the voltage on the line has this sign while the current begins to rise."""
    wave = line(100, slaves=(5,)).waveform(Response(0x6), dt=50e-9)
    slope = np.gradient(Modulation(Response(0x6).bits).current(wave.t), wave.t)
    first = int(np.argmax(np.abs(slope) > 0.5 * np.abs(slope).max()))
    return bool(slope[first] > 0 and np.sign(wave.u[0, first]) == sign)


@check("kim2023-104", counter={"slots": "between bits"})
def phase_turns_with_the_bit(*, slots: str = "within bits") -> bool:
    """Whether the steps within bits, or between them, change sign exactly where the bit changes."""
    bits = "0011010001110"
    steps = Modulation(bits).steps[1 if slots == "within bits" else 0 :: 2]
    changed = np.array(list(bits[1:])) != np.array(list(bits[:-1]))
    return bool((steps[1:] * steps[:-1] == np.where(changed, -1, 1)).all())


# Section 3.4: the receiver's tolerances, and the effect of an open cable.

#: Sampling interval of the pulse trains [s].
STEP = 250e-9


def train_of(heights: npt.ArrayLike) -> Floats:
    """Return the voltage of pulses of these heights, one per half-bit, between two silences."""
    heights = np.asarray(heights, dtype=float)
    x = (np.arange(2048) * STEP - 4.5e-6) / HALF_BIT - np.arange(heights.shape[-1])[:, np.newaxis]
    shape = np.where((x > 0) & (x < 1), np.sin(np.pi * x) ** 2, 0.0)
    return np.asarray(heights @ shape)


@check("kim2023-023", counter={"difference": 0.65})
def copes_with_amplitudes(*, difference: float = 0.35) -> bool:
    """Whether every response is read if pulse heights differ by this fraction of the largest.

    The threshold is 45 % or 55 % of the first pulse, which is either the largest or the smallest.
    """
    sent = Modulation(RESPONSES).bits
    low = np.full((2, 14), 1 - difference)
    low[0, 1], low[1, 2:] = 1, 1
    u = train_of(2 * Modulation(sent).pulses.signs[:, np.newaxis] * low)
    received = [
        receive(u, STEP, 7, threshold=threshold, matched=False) for threshold in (0.45, 0.55)
    ]
    return all(bool((one.bits == sent[:, np.newaxis]).all()) for one in received)


@check("kim2023-024", counter={"overshoot": 0.4})
def copes_with_overshoot(*, overshoot: float = 0.3) -> bool:
    """Whether every response is read if ringing reaches this fraction of the largest pulse.

    The first pulse, 65 % of the largest, sets the threshold. Every empty slot after it has ringing.
    """
    sent = Modulation(RESPONSES).bits
    pulses = np.pad(Modulation(sent).pulses.signs, ((0, 0), (0, 2))).astype(float)
    swing = overshoot * (-1.0) ** np.arange(pulses.shape[1])
    heights = np.where(pulses != 0, pulses, np.stack([swing, -swing])[:, np.newaxis])
    heights[..., 0] = 0
    heights[..., 1] *= 0.65
    received = receive(train_of(2 * heights), STEP, 7, matched=False)
    return bool((received.error == 0).all() and (received.bits == sent).all())


@check("kim2023-098", counter={"length": 200.0})
def copes_with_open_end(*, length: float = 100.0) -> bool:
    """Whether all responses along an unterminated cable stay within both tolerances."""
    wave = line(length, slaves=(0.05 * length, 0.5 * length, length)).waveform()
    received = wave.receive()
    return bool(received.within_tolerance.all() and (received.bits == wave.bits).all())


@check("kim2023-095", counter={"part": "inductor"})
def works_without(*, part: str = "conductor") -> bool:
    """Whether the master can read a slave that lacks its inductor or its conductor."""
    plan = line(100)
    lost = Cable(r=1e12, l=1e-6, c=1e-15)
    stub = CableRun("100 m", "slave", 1, lost if part == "conductor" else CABLES["as-i 1.5"])
    load = replace(DEVICE, l=None) if part == "inductor" else DEVICE
    slave = Slave("1", node="slave", load=load)
    wired = Plan([*plan.cables, stub], plan.masters, plan.supplies, [slave])
    return bool((wired.waveform().receive().error == 0).all())


# Section 3.4: the cost of error detection by check bits, and the errors that AS-i detects.


@numeric("kim2023-057", bits=1 + 5 + 5)
@numeric("kim2023-058", bits=4)
def check_bits(*, bits: int) -> int:
    """Fewest check bits that give words of this many bits a Hamming distance of 4."""
    r = 2
    while 2 ** (r - 1) < bits + r:
        r += 1
    return r


@numeric("kim2023-059")
def check_bit_cost(*, request: int = 11, response: int = 4, extra: int = 7 + 4) -> float:
    """Check bits as a percentage of a transaction's other bits."""
    return 100 * extra / (request + response)


@check("kim2023-103", counter={"extra": 4})
def check_bits_cost_rate(*, extra: int = 7 + 4) -> bool:
    """Whether `extra` check bits per transaction would cost over a quarter of the net rate."""
    bits = Transaction(2, 2).bits
    return bits / (bits + extra) < 0.75


@check("kim2023-101", counter={"distance": 5})
def others_have_this_distance(*, distance: int = 4) -> bool:
    """Whether the CRCs of Modbus and CAN give frames at least this Hamming distance."""
    return min(hamming_distance(MODBUS, 6), hamming_distance(CAN, 10)) >= distance


def hamming_distance(crc: Crc, payload: int) -> int:
    """Return the Hamming distance of frames with `payload` bytes of data; 5 means 5 or more."""
    single = np.asarray(crc.syndromes(payload))
    first, second = np.triu_indices(single.size, 1)
    double = single[first] ^ single[second]
    passed = [
        (single == 0).any(),
        (double == 0).any(),
        np.isin(double, single).any(),
        np.unique(double).size < double.size,
    ]
    return passed.index(True) + 1 if any(passed) else 5


@numeric("kim2023-060")
def error_classes(*, faults: int = 3) -> int:
    """Kinds of error that the receiver reports for responses with up to this many wrong slots."""
    sent = np.pad(Modulation(RESPONSES).pulses.signs, ((0, 0), (0, 2)))
    changes = [
        np.bincount(places, steps, sent.shape[1])
        for n in range(1, faults + 1)
        for places in combinations(range(sent.shape[1]), n)
        for steps in product((1, 2), repeat=n)
    ]
    received = (sent + np.array(changes, np.int8)[:, np.newaxis] + 1) % 3 - 1
    return len(set(Pulses(received).check()[1].ravel().tolist()) - {0})


def undetected(faults: int, *, requests: bool = False) -> tuple[int, int]:
    """Return how many errors in this many slots leave a telegram valid, and how many exist in all.

    Each wrong slot has one of its two other values. The errors are counted in all 16 responses (15
    slots from the start pulse) or all 2048 `requests` (29 slots).
    """
    size = 11 if requests else 4
    words = Modulation([frame(f"{data:0{size}b}") for data in range(2**size)]).pulses.signs
    slots = np.pad(words, ((0, 0), (0, 2)))[:, 1:]
    n = slots.shape[1]
    # The checks accept only these telegrams: an error passes if it turns one into another.
    passed = sum(int(((slots != word).sum(axis=1) == faults).sum()) for word in slots)
    return passed, len(slots) * comb(n, faults) * 2**faults


@check("kim2023-061", counter={"faults": 4})
def errors_are_detected(*, faults: int = 1) -> bool:
    """Whether every response with this many wrong slots is detected as faulty."""
    return undetected(faults)[0] == 0


# Sections 3.3 and 3.6, Table 2: immunity.


@check("kim2023-012", counter={"deviations": (0.5, 0.7)})
def supply_decides(
    *, supplies: tuple[float, float] = (30.0, 230.0), deviations: tuple[float, float] = (0.6, 0.6)
) -> bool:
    """Whether the supply voltage changes the number of telegrams that noise destroys."""
    near, receiver = line(100, slaves=(5,)).waveform(), RECEIVERS["noise-proof"]
    lost = []
    for supply, deviation in zip(supplies, deviations, strict=True):
        lifted = replace(near, u=near.u + supply)
        rates = count_errors(lifted, Noise(), deviation, 2000, 2024, receiver=receiver)
        lost.append(int(rates["failed"].iloc[0]))
    return lost[0] != lost[1]
