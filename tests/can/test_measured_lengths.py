import csv
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shipnet.can.frame import Frame
from shipnet.can.lengths import measure_frames
from shipnet.errors import ArgumentError, name_of
from tests.can.frames import frames
from tests.can.stuff_bits import longest_frame

REFERENCE = Path(__file__).parents[1] / "reference" / "can" / "can_utils_lengths.csv"


def columns(found):
    """Return the arguments of the batch functions for frames."""
    data = np.array([list(frame.data.ljust(8, b"\xa5")) for frame in found], np.uint8)
    return (
        [frame.arbitration_id for frame in found],
        data.reshape(-1, 8),
        [frame.dlc for frame in found],
    ), {
        "extended": [frame.extended for frame in found],
        "remote": [frame.remote for frame in found],
    }


def some_frames(n, seed=2024):
    rng = np.random.default_rng(seed)
    for _ in range(n):
        extended, remote = bool(rng.integers(2)), rng.random() < 0.1
        dlc = int(rng.integers(16))
        data = rng.choice([0, 255, 15, rng.integers(256)], 0 if remote else min(dlc, 8))
        number = int(rng.integers(2**29 if extended else 2**11))
        yield Frame(number, data.astype(np.uint8).tobytes(), extended, remote, dlc)


def assert_batch_is_as_frames(found):
    arguments, flags = columns(found)
    measures = measure_frames(*arguments, **flags)
    assert measures.crc.tolist() == [frame.crc for frame in found]
    assert measures.stuff_bits.tolist() == [frame.stuff_bits for frame in found]
    assert measures.length.tolist() == [frame.length for frame in found]
    assert not measures.error.any()


@given(st.lists(frames(), min_size=1, max_size=8))
def test_any_frames_are_as_the_scalar_code_has_them(found):
    assert_batch_is_as_frames(found)


def test_thousands_of_frames_are_as_the_scalar_code_has_them():
    assert_batch_is_as_frames(list(some_frames(2000)))


def test_the_longest_frames_fit():
    assert_batch_is_as_frames(
        [longest_frame(dlc, extended=extended) for dlc in range(9) for extended in (False, True)]
    )


def test_lengths_are_those_of_can_utils():
    with REFERENCE.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    data = [list(bytes.fromhex(row["data_hex"]).ljust(8, b"\0")) for row in rows]
    measures = measure_frames(
        [int(row["arbitration_id_hex"], 16) for row in rows],
        data,
        [len(row["data_hex"]) // 2 for row in rows],
        extended=[row["extended"] == "1" for row in rows],
        remote=[row["remote"] == "1" for row in rows],
    )
    assert measures.length.tolist() == [int(row["length_with_intermission"]) for row in rows]


def test_more_frames_than_one_chunk_keep_their_order():
    number = np.arange(20_000) % 2048
    short = measure_frames(number[:2048], np.zeros(8, int), 3)
    long = measure_frames(number, np.zeros(8, int), 3)
    assert (long.crc == short.crc[number]).all()


def test_frames_that_cannot_be_get_a_code():
    number = [2048, 2047, -1, 2**29, 2**29 - 1, 0, 0]
    extended = [False, False, False, True, True, False, False]
    dlc = [8, 8, 8, 8, 8, 16, -1]
    legal = [False, True, False, False, True, False, False]
    measures = measure_frames(number, [0] * 8, dlc, extended=extended)
    assert [name_of(code) for code in measures.error] == [
        "ok" if good else "ArgumentError" for good in legal
    ]
    for field in measures[1:]:
        assert [bool(value) for value in field] == legal
    rows = np.zeros((2, 8), int)
    rows[1, 7] = 256
    assert measure_frames(1, rows).error.tolist() == [0, ArgumentError.code]


def test_no_frames_and_one_frame():
    empty = measure_frames([], np.empty((0, 8), np.uint8), [])
    assert all(field.shape == (0,) for field in empty)
    assert measure_frames(5, range(8)).length.tolist() == [Frame(5, bytes(range(8))).length]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"arbitration_id": [1.0]}, "arbitration_id must be whole numbers"),
        ({"arbitration_id": [True]}, "arbitration_id must be whole numbers"),
        ({"data": [float("nan")] * 8}, "data must be whole numbers"),
        ({"dlc": ["8"]}, "dlc must be whole numbers"),
        ({"extended": [1]}, "extended must be True or False"),
        ({"remote": 0}, "remote must be True or False"),
        ({"data": [0] * 7}, r"data have shape \(7,\)"),
        ({"data": 0}, r"data have shape \(\)"),
        ({"arbitration_id": [[1]]}, r"must be \(n, 8\) and \(n,\)"),
        ({"arbitration_id": [1, 2], "dlc": [1, 2, 3]}, "different lengths"),
    ],
)
def test_other_types_and_shapes_are_refused(change, message):
    arguments = {"arbitration_id": 1, "data": [0] * 8} | change
    with pytest.raises(ArgumentError, match=message):
        measure_frames(**arguments)
