import itertools

import numpy as np
import pytest

from shipnet.asi import Response
from shipnet.asi.modulation import check_slots, pulses_of
from shipnet.papers.kim2023.signals import check_bits, undetected


def least_distance(information, check):
    """Distance of a code whose check columns are odd and different, by all its words."""
    columns = [c for c in range(2**check) if c.bit_count() % 2 and c.bit_count() > 1]
    rows = [2 ** (check + i) | column for i, column in enumerate(columns[:information])]
    if len(rows) < information:
        return 0
    words = np.zeros(1, dtype=np.int64)
    for row in rows:
        words = np.concatenate([words, words ^ row])
    return int(np.bitwise_count(words[1:]).min())


def test_five_bits_suffice_for_distance_four():
    assert least_distance(11, 5) == 4
    assert least_distance(4, 4) == 4
    assert (check_bits(bits=11), check_bits(bits=4)) == (5, 4)


@pytest.mark.parametrize("information", range(1, 14))
def test_one_bit_less_does_not_suffice(information):
    enough = check_bits(bits=information)
    assert least_distance(information, enough) >= 4
    assert least_distance(information, enough - 1) < 4


@pytest.mark.parametrize("faults", [1, 2])
def test_faults_counted_by_trying_them_all(faults):
    missed = tried = 0
    for data in range(16):
        word = np.pad(pulses_of(Response(data).bits), (0, 2))
        for places in itertools.combinations(range(1, 16), faults):
            others = [[v for v in (-1, 0, 1) if v != word[place]] for place in places]
            wrong = np.repeat(word[np.newaxis], 2**faults, axis=0)
            wrong[:, places] = list(itertools.product(*others))
            missed += int((check_slots(wrong, 7)[1] == 0).sum())
            tried += len(wrong)
    assert undetected(faults) == (missed, tried)


def test_four_faults_are_the_first_to_pass():
    assert [undetected(faults) for faults in (3, 4)] == [(0, 58240), (32, 349440)]
