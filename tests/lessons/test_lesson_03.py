"""The right answers of lesson 3, each found by a second route."""

from itertools import product

import numpy as np
import pytest
from scipy.spatial.distance import pdist

from shipnet.asi.modulation import Modulation, Pulses
from shipnet.crc import CAN
from shipnet.exercises.lesson_03 import _GENERATORS, _MESSAGES, _TRIED, _distance, _remainder
from shipnet.papers.kim2023.signals import undetected
from tests.lessons.students import NAMED, right, solved


@NAMED
def test_of_all_seven_bits_a_receiver_takes_only_the_right_ones(name):
    numbers, telegram = right("ex-03-1", name)
    words = ["".join(bits) for bits in product("01", repeat=7)]
    words = [bits for bits in words if bits[1:5] == numbers["bits"]]
    pulses = np.pad([Modulation(bits).pulses.signs for bits in words], ((0, 0), (0, 2)))
    _, error = Pulses(pulses).check()
    assert [bits for bits, code in zip(words, error, strict=True) if code == 0] == [telegram]


@pytest.mark.parametrize("generator", _GENERATORS)
def test_check_bits_are_a_remainder_of_polynomials(generator):
    for bits in _MESSAGES:
        row = np.array([*map(int, bits), 0, 0, 0, 0])
        _, left = np.polydiv(row, [*map(int, generator)])
        expected = "".join(map(str, (np.rint(left).astype(int) % 2)[-4:])).rjust(4, "0")
        assert solved("ex-03-2", bits=bits, generator=generator).value == expected


def test_check_bits_with_the_generator_of_can_are_those_of_the_library():
    rng = np.random.default_rng(3)
    for _ in range(20):
        bits = "".join(map(str, rng.integers(0, 2, 20)))
        assert int(_remainder(bits + "0" * 15, f"{0xC599:b}"), 2) == CAN.of(bits)


def test_the_distance_is_that_of_scipy():
    for (words,) in _TRIED:
        table = [[int(bit) for bit in word] for word in words]
        assert _distance(words) == round(pdist(table, "hamming").min() * len(words[0]))


@NAMED
def test_one_bit_of_crc_less_lets_a_message_pass(name):
    numbers, width = right("ex-03-4", name)
    hit = numbers["hits"] * numbers["years"] * 365
    assert hit * 2.0**-width < 1 <= hit * 2.0 ** (1 - width)


def test_the_pulses_of_two_answers_differ_in_four_slots():
    words = [f"0{data:04b}{f'{data:b}'.count('1') % 2}1" for data in range(16)]
    pulses = Modulation(words).pulses.signs
    assert round(pdist(pulses, "hamming").min() * 14) == 4
    assert undetected(3)[0] == 0 < undetected(4)[0]
