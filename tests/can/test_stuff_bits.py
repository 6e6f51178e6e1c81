import csv
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given

from shipnet.can.frame import Frame
from shipnet.can.lengths import frame_length, measure_frames
from tests.can.bit_reference import line_bits
from tests.can.frames import frames
from tests.can.stuff_bits import StuffBits, behind, longest_frame, stuff_bits

REFERENCE = Path(__file__).parents[1] / "reference" / "can"
KINDS = {"std": False, "ext": True}


def rows(name):
    with (REFERENCE / name).open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_the_bounds_are_those_of_the_reference_table():
    for row in rows("frame_lengths.csv"):
        size, extended = int(row["bytes"]), KINDS[row["format"]]
        expected = [
            int(row[f"{name}_incl_ifs3"])
            for name in ("nominal", "worst_davis", "worst_tindell1994")
        ]
        found = [
            frame_length(size, stuffing="none", extended=extended),
            frame_length(size, extended=extended),
            frame_length(size, stuffing="worst 1994", extended=extended),
        ]
        assert found == expected


def test_the_longest_frames_are_as_long_as_those_of_the_reference_table():
    for row in rows("worst_attainable_frames.csv"):
        frame = longest_frame(int(row["dlc"]), extended=KINDS[row["format"]])
        assert frame.length == int(row["total_bits_incl_ifs3"])
        assert len(frame.data) == int(row["dlc"])


def every_frame(dlc, extended=False, remote=False):
    size = 0 if remote else min(dlc, 8)
    assert not extended and size <= 1
    for number, data in product(range(2048), range(256**size)):
        yield Frame(number, data.to_bytes(size, "big"), dlc=dlc, remote=remote)


@pytest.mark.parametrize(("dlc", "remote"), [(0, False), (0, True), (7, True), (15, True)])
def test_all_short_frames_counted_one_by_one_agree(dlc, remote):
    found = list(every_frame(dlc, remote=remote))
    counts = [frame.stuff_bits for frame in found]
    probability = np.bincount(counts) / len(counts)
    assert stuff_bits(dlc, remote=remote).probability == pytest.approx(probability, abs=1e-15)
    first = max(found, key=lambda frame: (frame.stuff_bits, -frame.arbitration_id))
    assert longest_frame(dlc, remote=remote) == first


@pytest.fixture(scope="module")
def usual():
    # In this order each goes on from what the one before it left.
    kinds = [*(("std", dlc) for dlc in range(9)), ("ext", 8), ("ext", 0)]
    return {(kind, dlc): stuff_bits(dlc, extended=KINDS[kind]) for kind, dlc in kinds}


def test_the_distributions_are_those_of_the_reference_table(usual):
    expected = {}
    for row in rows("stuff_pmf.csv"):
        own = expected.setdefault((row["format"], int(row["dlc"])), {})
        own[int(row["stuff_bits"])] = float(row["probability_uniform_id_data"])
    for kind, distribution in usual.items():
        probability = np.zeros(max(expected[kind]) + 1)
        probability[list(expected[kind])] = list(expected[kind].values())
        # Down to 1e-27, where the absolute tolerance would hide everything.
        assert distribution.probability == pytest.approx(probability, rel=1e-10, abs=0)


def test_mean_spread_and_quantiles_are_those_of_the_reference_table(usual):
    for row in rows("stuff_bits.csv"):
        found = usual.get((row["format"], int(row["dlc"])))
        if found is None:
            continue
        assert found.mean == pytest.approx(float(row["mean_stuff_uniform"]), rel=1e-12)
        assert found.sd == pytest.approx(float(row["sd_stuff_uniform"]), rel=1e-11)
        tails = {"q50": 0.5, "q99": 0.01, "q999": 1e-3, "q999999": 1e-6}
        assert {name: found.quantile(tail) for name, tail in tails.items()} == {
            name: int(row[name]) for name in tails
        }
        assert len(found.probability) - 1 == int(row["attainable_max_stuff"])
        assert found.probability[-1] == pytest.approx(float(row["prob_of_max"]), rel=1e-10, abs=0)


def test_the_most_likely_and_the_most_costly_are_found_by_different_ways(usual):
    for (kind, dlc), distribution in usual.items():
        most = len(distribution.probability) - 1
        assert longest_frame(dlc, extended=KINDS[kind]).stuff_bits == most
        assert distribution.probability.sum() == pytest.approx(1, abs=1e-13)


def test_random_frames_have_the_mean_within_four_standard_errors(usual):
    rng = np.random.default_rng(2024)
    n = 2000
    for kind, extended in KINDS.items():
        numbers = rng.integers(0, 2 ** (29 if extended else 11), n)
        found = [Frame(int(k), rng.bytes(8), extended).stuff_bits for k in numbers]
        distribution = usual[kind, 8]
        assert abs(np.mean(found) - distribution.mean) < 4 * distribution.sd / np.sqrt(n)


@given(frames())
def test_no_frame_is_longer_than_the_longest_nor_shorter_than_without_stuff_bits(frame):
    size = len(frame.data)
    longest = longest_frame(frame.dlc, extended=frame.extended, remote=frame.remote)
    assert frame_length(size, stuffing="none", extended=frame.extended) <= frame.length
    assert frame.length <= longest.length
    assert longest.length < frame_length(size, extended=frame.extended)


def test_the_longest_frame_there_is_has_the_code_15_and_159_bits():
    found = [longest_frame(dlc, extended=True) for dlc in range(8, 16)]
    assert [frame.length for frame in found][::7] == [158, 159]
    longest = max(found, key=lambda frame: frame.length)
    assert (longest.dlc, len(longest.data)) == (15, 8)
    literal = line_bits(longest.arbitration_id, longest.data, True, False, 15)
    assert len(literal) + 3 == 159 < frame_length(8, extended=True)


def test_the_bound_of_1994_is_passed_from_three_bytes_on_or_with_a_long_id():
    for extended in (False, True):
        passed = [
            size
            for size in range(9)
            if longest_frame(size, extended=extended).length
            > frame_length(size, stuffing="worst 1994", extended=extended)
        ]
        assert passed == list(range(0 if extended else 3, 9))


def test_bytes_of_zero_cost_more_stuff_bits_than_random_data_do(usual):
    zeros = measure_frames(np.arange(2048), [0] * 8).stuff_bits
    assert (zeros.min(), zeros.max()) == (13, 17)
    assert 1.3e6 < 1 / usual["std", 8].beyond()[12] < 1.4e6


def test_tails_and_quantiles_of_a_coin():
    coin = StuffBits(np.array([0.5, 0.25, 0.25]))
    assert coin.beyond().tolist() == [0.5, 0.25, 0.0]
    assert [coin.quantile(tail) for tail in (1, 0.5, 0.4, 0.25, 0.1, 0)] == [0, 0, 1, 1, 2, 2]
    assert (coin.mean, coin.sd) == (0.75, pytest.approx(0.6875**0.5))


def test_a_result_cannot_be_changed_behind_its_back():
    with pytest.raises(ValueError, match="read-only"):
        stuff_bits(0).probability[0] = 1
    with pytest.raises(ValueError, match="read-only"):
        behind(0)[0] = 1
