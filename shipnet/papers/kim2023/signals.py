"""Section 3.4 and Table 2: pulses, tolerances, error detection, immunity."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import combinations, product
from math import comb

import numpy as np
import numpy.typing as npt

from shipnet.arrays import Floats
from shipnet.asi.modulation import HALF_BIT, Modulation, Pulses
from shipnet.asi.plan import Plan
from shipnet.asi.receiver import TOLERANCE, receive
from shipnet.asi.slave import DEVICE, Slave
from shipnet.asi.telegram import RESPONSES, Request, Response, frame
from shipnet.asi.timing import Transaction
from shipnet.asi.topologies import line
from shipnet.crc import CAN, MODBUS, Crc
from shipnet.line.cable import CABLES, Cable
from shipnet.line.network import CableRun
from shipnet.papers.registry import check, numeric

# Section 3.4, Table 3, Figs 3 and 4: levels, pulses and the effect of a slave's position.


@check("kim2023-025", "icn2007-049", counter={"near": 100.0, "far": 5.0})
def louder_far_from_supply(*, near: float = 5.0, far: float = 100.0) -> float:
    """Fraction by which a slave at `far` is louder at the master than one at `near`."""
    u = line(100, slaves=(near, far)).waveform(Response(0x6)).u
    smaller, larger = np.abs(u).max(axis=-1)
    return float(larger / smaller - 1)


@check("kim2023-077", "icn2007-050", counter={"supply": 60.0})
def above_supply(*, slave: float = 30.0, supply: float = 30.0) -> float:
    """Fraction by which the voltage at a slave that sends on a 30 V line exceeds `supply`."""
    position = 100.0
    plan = line(100, slaves=(position,), master=position, supply=0)
    return float((slave + plan.waveform(Response(0x6)).u.max()) / supply - 1)


@check("kim2023-087", counter={"zero": (0, 1)})
def zero_is_1_0(*, zero: tuple[int, int] = (1, 0)) -> bool:
    """Whether the Manchester code of a 0 has these levels, and that of a 1 the opposite."""
    return tuple(Modulation("0").levels) == zero and tuple(Modulation("1").levels) == zero[::-1]


@check("kim2023-088", "icn2007-009", counter={"sign": 1})
def first_pulse(*, sign: int = -1) -> bool:
    """Whether the first pulse of every response has this sign and belongs to the start bit."""
    trains = Modulation(RESPONSES).pulses.signs
    return bool((trains[:, 0] == 0).all() and (trains[:, 1] == sign).all())


@check("kim2023-099", "icn2007-008", counter={"sign": 1})
def rising_current(*, sign: int = -1) -> bool:
    """Whether the voltage on the line has this sign while the current begins to rise."""
    wave = line(100, slaves=(5,)).waveform(Response(0x6), dt=50e-9)
    slope = np.gradient(Modulation(Response(0x6).bits).current(wave.t), wave.t)
    first = int(np.argmax(np.abs(slope) > 0.5 * np.abs(slope).max()))
    return bool(slope[first] > 0 and np.sign(wave.u[0, first]) == sign)


@check("kim2023-104", "icn2007-064", counter={"slots": "between bits"})
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


def largest_tolerated(heights_of: Callable[[float], Floats]) -> float:
    """Return the largest fraction for which a receiver reads all responses of these heights."""
    sent = Modulation(RESPONSES).bits
    low, high = 0.0, 1.0
    for _ in range(10):
        middle = (low + high) / 2
        received = receive(train_of(heights_of(middle)), STEP, sent.shape[1], matched=False)
        read = (received.bits == sent[:, np.newaxis]).all() and not received.error.any()
        low, high = (middle, high) if read else (low, middle)
    return low


@check("kim2023-023", counter={"difference": 0.65})
def copes_with_amplitudes(*, difference: float = 0.35) -> float:
    """Margin of the tolerated difference of pulse heights over this fraction of the largest.

    The first pulse is either the largest or the smallest.
    """
    signs = Modulation(RESPONSES).pulses.signs[:, np.newaxis]

    def heights(less: float) -> Floats:
        low = np.full((2, signs.shape[-1]), 1 - less)
        low[0, 1], low[1, 2:] = 1, 1
        return np.asarray(2 * signs * low)

    return largest_tolerated(heights) / difference - 1


@check("kim2023-024", counter={"overshoot": 0.4})
def copes_with_overshoot(*, overshoot: float = 0.3) -> float:
    """Margin of the tolerated ringing over this fraction of the largest pulse.

    The first pulse, the smallest that is tolerated, sets the threshold; every empty slot after it
    has ringing.
    """
    pulses = np.pad(Modulation(RESPONSES).pulses.signs, ((0, 0), (0, 2))).astype(float)

    def heights(ringing: float) -> Floats:
        swing = ringing * (-1.0) ** np.arange(pulses.shape[1])
        rows = np.where(pulses[:, np.newaxis] != 0, pulses[:, np.newaxis], [swing, -swing])
        rows[..., 0] = 0
        rows[..., 1] *= TOLERANCE.evenness
        return np.asarray(2 * rows)

    return largest_tolerated(heights) / overshoot - 1


@check("kim2023-098", "icn2007-047", counter={"length": 200.0})
def copes_with_open_end(*, length: float = 100.0) -> float:
    """Margin within which all responses along an unterminated cable are within both tolerances."""
    quality = line(length, slaves=(0.05 * length, 0.5 * length, length)).quality()
    even = quality.evenness.min() / TOLERANCE.evenness - 1
    return float(min(even, 1 - quality.ringing.max() / TOLERANCE.ringing))


@check("kim2023-121", "icn2007-066", counter={"length": 300.0})
def receiver_returns_the_bits(*, length: float = 100.0) -> bool:
    """Whether all responses, and a request to each slave, are read back after this cable [m]."""
    plan = line(length, slaves=(5, length))
    requests = [Request.data_exchange(address, 0x6).bits for address in range(1, 32)]
    waves = [plan.waveform(), plan.waveform(requests, f"{length:g} m")]
    return all(bool((wave.receive().bits == wave.bits).all()) for wave in waves)


@check("kim2023-095", "icn2007-053", counter={"part": "inductor"})
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


@numeric("kim2023-057", "icn2007-023", bits=1 + 5 + 5)
@numeric("kim2023-058", "icn2007-040", bits=4)
def check_bits(*, bits: int) -> int:
    """Fewest check bits that give words of this many bits a Hamming distance of 4."""
    r = 2
    while 2 ** (r - 1) < bits + r:
        r += 1
    return r


@numeric("kim2023-059")
def check_bit_cost(*, request: int = 14, response: int = 7, extra: int = 7 + 4) -> float:
    """Check bits as a percentage of a transaction's other bits."""
    return 100 * extra / (request + response)


@check("kim2023-103", "icn2007-063", counter={"extra": 4})
def check_bits_cost_rate(*, extra: int = 7 + 4) -> float:
    """Margin by which `extra` check bits per transaction cost over a quarter of the net rate."""
    bits = Transaction(2, 2).bits
    return (1 - bits / (bits + extra)) / 0.25 - 1


@check("kim2023-101", "icn2007-061", counter={"distance": 5})
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


@numeric("kim2023-060", "icn2007-024")
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


#: One error of each kind: changed slots of the response 0x6, with their new values; Fig 6.
DAMAGE = {
    "start": {1: 1},
    "alternation": {2: -1},
    "pause": {6: 0, 7: 0},
    "information": {3: 0, 4: -1},
    "parity": {8: -1, 9: 1, 10: 0, 11: -1},
    "end": {12: 1, 13: -1},
    "length": {14: -1},
}


@check("kim2023-061", counter={"faults": 4})
def errors_are_detected(*, faults: int = 3) -> bool:
    """Whether every response and request with one to this many wrong slots is found faulty."""
    return not any(
        undetected(wrong, requests=requests)[0]
        for wrong in range(1, faults + 1)
        for requests in (False, True)
    )
