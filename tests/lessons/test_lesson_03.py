"""The right answers of lesson 3, each found by a second route."""

from itertools import product

import numpy as np
import pytest
from scipy.spatial.distance import pdist

from shipnet.asi.modulation import Modulation, Pulses
from shipnet.exercises.lesson_03 import _GENERATORS, _MESSAGES, _TRIED, _distance
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


def test_the_distance_is_that_of_scipy():
    for (words,) in _TRIED:
        table = [[int(bit) for bit in word] for word in words]
        assert _distance(words) == round(pdist(table, "hamming").min() * len(words[0]))


@NAMED
def test_one_bit_of_crc_less_lets_a_message_pass(name):
    numbers, width = right("ex-03-4", name)
    hit = numbers["hits"] * numbers["years"] * 365
    assert hit * 2.0**-width < 1 <= hit * 2.0 ** (1 - width)
