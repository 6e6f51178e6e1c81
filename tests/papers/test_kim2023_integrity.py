import itertools
from math import comb

import numpy as np
import pytest
from scipy.spatial.distance import pdist

from shipnet.asi import Master, Response, Slave, Standby, simulate
from shipnet.asi.faults import MasterFailure
from shipnet.asi.modulation import Modulation, Pulses
from shipnet.papers.kim2023.signals import check_bits, undetected

#: Every row of 14 bits with a start bit, even parity of what lies between, and an end bit.
ALL_REQUESTS = [f"0{data:011b}{data.bit_count() % 2}1" for data in range(2048)]


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


def test_parities_of_rows_and_columns_take_the_printed_bits_but_reach_distance_three():
    for rows, columns, information, printed in ((3, 4, 11, 7), (2, 2, 4, 4)):
        words = []
        for data in range(2**information):
            table = np.array(list(f"{data:0{rows * columns}b}"), int).reshape(rows, columns)
            check = [*table.sum(axis=0) % 2, *table.sum(axis=1) % 2]
            assert len(check) == printed
            words.append([*table.ravel(), *check])
        assert min(np.sum(words[1:], axis=1)) == 3


@pytest.mark.parametrize("information", range(1, 14))
def test_one_bit_less_does_not_suffice(information):
    enough = check_bits(bits=information)
    assert least_distance(information, enough) >= 4
    assert least_distance(information, enough - 1) < 4


@pytest.mark.parametrize("faults", [1, 2, 4])
def test_faults_counted_by_trying_them_all(faults):
    missed = tried = 0
    for data in range(16):
        word = np.pad(Modulation(Response(data).bits).pulses.signs, (0, 2))
        for places in itertools.combinations(range(1, 16), faults):
            others = [[v for v in (-1, 0, 1) if v != word[place]] for place in places]
            wrong = np.repeat(word[np.newaxis], 2**faults, axis=0)
            wrong[:, places] = list(itertools.product(*others))
            missed += int((Pulses(wrong).check()[1] == 0).sum())
            tried += len(wrong)
    assert undetected(faults) == (missed, tried)


def test_four_faults_are_the_first_to_pass():
    assert [undetected(faults) for faults in (3, 4)] == [(0, 58240), (32, 349440)]


def test_faults_of_requests_counted_by_trying_them_all():
    # All errors of four slots in some requests through the checks; then all pairs of requests.
    words = np.pad(Modulation(ALL_REQUESTS).pulses.signs, ((0, 0), (0, 2)))
    places = np.array(list(itertools.combinations(range(1, 30), 4)))
    for word in words[[0, 700, 2047]]:
        missed = 0
        for signs in itertools.product((1, 2), repeat=4):
            wrong = np.repeat(word[np.newaxis], len(places), axis=0)
            old = np.take_along_axis(wrong, places, axis=1)
            np.put_along_axis(wrong, places, (old + 1 + signs) % 3 - 1, axis=1)
            missed += int((Pulses(wrong).check()[1] == 0).sum())
        assert missed == ((words != word).sum(axis=1) == 4).sum()
    apart = np.rint(pdist(words, "hamming") * words.shape[1])
    for faults in (3, 4, 5):
        tried = 2048 * comb(29, faults) * 2**faults
        assert undetected(faults, requests=True) == (2 * (apart == faults).sum(), tried)


def test_a_watchdog_of_94_ms_tolerates_50_ms():
    for silence, resets in ((0.05, 0), (0.09, 0), (0.1, 1)):
        standby = Standby(Master({"1": "S-0.F.F"}), silence=silence)
        failure = MasterFailure(start=0.1)
        run = simulate([Slave("1")], standby.master, until=0.3, faults=failure, standby=standby)
        assert len(run.watchdogs) == resets
