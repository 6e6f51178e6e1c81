"""Lengths of frames: formulas, published tables, and counting every bit of every frame."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shipnet.can.frame import Frame
from shipnet.can.lengths import frame_length, measure_frames
from shipnet.errors import ArgumentError
from tests.can.frames import LONGEST, frames, rows
from tests.support import tolerance

# x^15 + x^14 + x^10 + x^8 + x^7 + x^4 + x^3 + 1
POLYNOMIAL = 0x4599


@pytest.mark.parametrize("row", rows("frame_lengths.csv"))
def test_lengths_are_those_of_the_reference(row):
    s, extended = int(row["bytes"]), row["format"] == "ext"
    for stuffing, column in (("none", "nominal_incl_ifs3"), ("worst", "worst_davis_incl_ifs3")):
        assert frame_length(s, stuffing=stuffing, extended=extended) == int(row[column])


def test_the_bound_is_55_or_80_bits_and_ten_per_byte():
    s = np.arange(9)
    assert frame_length(s).tolist() == (55 + 10 * s).tolist()
    assert frame_length(s, extended=True).tolist() == (80 + 10 * s).tolist()
    both = frame_length(s[:, np.newaxis], stuffing="none", extended=[False, True])
    assert both.tolist() == np.stack([47 + 8 * s, 67 + 8 * s], axis=1).tolist()


@pytest.mark.parametrize("frame", LONGEST, ids=str)
def test_the_longest_frames_exist(frame):
    most = frame_length(len(frame.data), stuffing="attainable", extended=frame.extended)
    assert frame.length == most < frame_length(len(frame.data), extended=frame.extended)


@given(frames().filter(lambda frame: frame.dlc <= 8 and not frame.remote))
def test_no_frame_is_longer_than_the_longest_nor_shorter_than_without_stuff_bits(frame):
    least, most = (
        frame_length(frame.dlc, stuffing=way, extended=frame.extended)
        for way in ("none", "attainable")
    )
    assert least <= frame.length <= most


def over_all_frames(extended, dlc):
    """Return mean and maximum of the stuff bits over all identifiers and data.

    A state is the CRC register, the last bit on the bus and the length of its run.
    """
    register = np.arange(2**15)
    mass = np.zeros((2**15, 2, 5))  # run 1..4 at index 0..3; index 4: nothing sent yet
    mean = np.zeros_like(mass)
    most = np.full(mass.shape, -np.inf)
    mass[0, 1, 4], most[0, 1, 4] = 1.0, 0.0

    def step(tables, bit, weight, source):
        """Add the effect of a bit on the old tables to the new tables."""
        (mass, mean, most), (new_mass, new_mean, new_most) = source, tables
        out = (register >> 14) ^ bit
        # The steps of a shift register are one-to-one, so every target has one source.
        target = (register << 1) & 0x7FFF ^ POLYNOMIAL * out
        for last in (0, 1):
            for run in range(5):
                same = last == bit and run != 4
                if same and run == 3:
                    state, stuff = (target, 1 - bit, 0), 1
                else:
                    state, stuff = (target, bit, run + 1 if same else 0), 0
                new_mass[state] += weight * mass[:, last, run]
                new_mean[state] += weight * (mean[:, last, run] + stuff * mass[:, last, run])
                new_most[state] = np.maximum(new_most[state], most[:, last, run] + stuff)

    tables = (mass, mean, most)
    # The bits from start of frame to the data; None where a bit is free.
    middle = [None] * 11 + ([1, 1, *[None] * 18] if extended else [])
    length = [int(bit) for bit in f"{dlc:04b}"]
    for fixed in [0, *middle, 0, 0, 0, *length, *[None] * 8 * dlc]:
        fresh = (np.zeros_like(mass), np.zeros_like(mass), np.full(mass.shape, -np.inf))
        for bit in (0, 1) if fixed is None else (fixed,):
            step(fresh, bit, 0.5 if fixed is None else 1.0, tables)
        tables = fresh

    mass, mean, most = tables
    expected, maximum = mean.sum(), -np.inf
    for last in (0, 1):
        for run in range(5):
            now, length = np.full(2**15, last), np.full(2**15, run + 1)
            stuffed = np.zeros(2**15)
            for shift in range(14, -1, -1):
                bit = (register >> shift) & 1
                length = np.where(bit == now, length + 1, 1)
                full = length == 5
                stuffed += full
                now, length = np.where(full, 1 - bit, bit), np.where(full, 1, length)
            expected += (mass[:, last, run] * stuffed).sum()
            maximum = max(maximum, (most[:, last, run] + stuffed).max())
    return expected, maximum


@pytest.mark.parametrize(("extended", "dlc"), [(False, 2), (True, 0)])
def test_mean_and_longest_frames_follow_from_all_frames(extended, dlc):
    mean, most = over_all_frames(extended, dlc)
    nominal = frame_length(dlc, stuffing="none", extended=extended)
    # The table has six decimals.
    assert frame_length(dlc, stuffing="mean", extended=extended) - nominal == pytest.approx(
        mean, abs=6e-7
    )
    assert frame_length(dlc, stuffing="attainable", extended=extended) - nominal == most


def test_the_means_of_all_formats_are_those_of_the_reference():
    for row in rows("stuff_bits.csv"):
        ours = frame_length(int(row["dlc"]), stuffing="mean", extended=row["format"] == "ext")
        allowed = tolerance("can.stuffing")
        assert ours == pytest.approx(float(row["mean_total_bits"]), abs=allowed)


@pytest.mark.parametrize("dlc", [-1, 9, 2.5, None, True, "8", [1, 9], float("nan")])
def test_a_wrong_number_of_bytes_is_refused(dlc):
    with pytest.raises(ArgumentError, match=r"dlc is .*; expected whole numbers 0\.\.8"):
        frame_length(dlc)


def test_other_wrong_arguments_are_refused():
    with pytest.raises(ArgumentError, match="stuffing is 'longest'; it must be one of 'none'"):
        frame_length(8, stuffing="longest")
    with pytest.raises(ArgumentError, match="extended is 29; it must be True or False"):
        frame_length(8, extended=29)
    assert frame_length(np.array([], dtype=int)).shape == (0,)
    assert frame_length(2.0) == frame_length(2) == 75


# Millions of frames.


def columns(frames):
    """Return the arguments of the batch functions for frames."""
    data = np.array([list(frame.data.ljust(8, b"\xa5")) for frame in frames], np.uint8)
    return (
        [frame.arbitration_id for frame in frames],
        data.reshape(-1, 8),
        [frame.dlc for frame in frames],
    ), {
        "extended": [frame.extended for frame in frames],
        "remote": [frame.remote for frame in frames],
    }


def assert_batch_is_as_frames(frames):
    arguments, flags = columns(frames)
    assert measure_frames(*arguments, **flags).tolist() == [frame.length for frame in frames]


@given(st.lists(frames(), min_size=1, max_size=8))
def test_the_lengths_of_any_frames_equal_those_of_the_scalar_code(found):
    assert_batch_is_as_frames(found)


def test_the_longest_frames_are_measured():
    assert_batch_is_as_frames([*LONGEST, Frame(LONGEST[17].arbitration_id, bytes(8), True, dlc=15)])


def test_lengths_are_those_of_can_utils():
    cases = rows("can_utils_lengths.csv")
    data = np.array([list(bytes.fromhex(row["data_hex"]).ljust(8, b"\0")) for row in cases])
    lengths = measure_frames(
        [int(row["arbitration_id_hex"], 16) for row in cases],
        data,
        [len(row["data_hex"]) // 2 for row in cases],
        extended=[row["extended"] == "1" for row in cases],
        remote=[row["remote"] == "1" for row in cases],
    )
    assert lengths.tolist() == [int(row["length_with_intermission"]) for row in cases]


def test_bytes_of_zero_cost_more_stuff_bits_than_random_data():
    zeros = measure_frames(np.arange(2048), np.zeros((2048, 8), int)) - frame_length(
        8, stuffing="none"
    )
    assert (zeros.min(), zeros.max()) == (13, 17)


def test_no_frames_and_one_frame():
    empty = measure_frames([], np.empty((0, 8), np.uint8), [])
    assert empty.shape == (0,)
    one = measure_frames(5, np.arange(8).reshape(1, 8))
    assert one.tolist() == [Frame(5, bytes(range(8))).length]
