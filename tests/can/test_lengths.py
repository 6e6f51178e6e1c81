"""Lengths of frames: formulas, published tables, and counting every bit of every frame."""

import csv
from pathlib import Path

import numpy as np
import pytest

from shipnet.can.lengths import frame_length, length_table
from shipnet.errors import ArgumentError

REFERENCE = Path(__file__).parents[1] / "reference" / "can"

#: Ways of counting, shortest frames first.
WAYS = ("none", "mean", "worst 1994", "attainable", "worst")

# x^15 + x^14 + x^10 + x^8 + x^7 + x^4 + x^3 + 1
POLYNOMIAL = 0x4599


def reference(name):
    with (REFERENCE / name).open() as stream:
        return list(csv.DictReader(stream))


@pytest.mark.parametrize("row", reference("frame_lengths.csv"))
def test_lengths_are_those_of_the_reference(row):
    s, extended = int(row["bytes"]), row["format"] == "ext"
    for stuffing, column in (
        ("none", "nominal_incl_ifs3"),
        ("worst", "worst_davis_incl_ifs3"),
        ("worst 1994", "worst_tindell1994_incl_ifs3"),
    ):
        assert frame_length(s, stuffing=stuffing, extended=extended) == int(row[column])


def test_the_bound_is_55_and_80_bits_with_ten_a_byte():
    s = np.arange(9)
    assert frame_length(s).tolist() == (55 + 10 * s).tolist()
    assert frame_length(s, extended=True).tolist() == (80 + 10 * s).tolist()
    both = frame_length(s[:, np.newaxis], stuffing="none", extended=[False, True])
    assert both.tolist() == np.stack([47 + 8 * s, 67 + 8 * s], axis=1).tolist()


def test_ways_of_counting_keep_their_order():
    for extended in (False, True):
        nominal, mean, old, attainable, worst = (
            frame_length(np.arange(9), stuffing=way, extended=extended) for way in WAYS
        )
        assert (nominal < mean).all()
        assert (mean < old).all()
        assert (attainable < worst).all()
    # The form of 1994 promises 130 bits, and a frame of 133 exists.
    assert length_table("worst 1994")[0][8] == 130 < length_table("attainable")[0][8] == 133


def crc(bits):
    register = 0
    for bit in bits:
        out = (register >> 14) ^ bit
        register = (register << 1) & 0x7FFF ^ POLYNOMIAL * out
    return register


def count_stuff_bits(bits):
    count, last, run = 0, None, 0
    for bit in bits:
        run = run + 1 if bit == last else 1
        last = bit
        if run == 5:
            count, last, run = count + 1, 1 - bit, 1
    return count


def frame_head(extended, dlc):
    """Return the bits from start of frame to the data; None where a bit is free."""
    length = [int(bit) for bit in f"{dlc:04b}"]
    if extended:
        return [0, *[None] * 11, 1, 1, *[None] * 18, 0, 0, 0, *length]
    return [0, *[None] * 11, 0, 0, 0, *length]


@pytest.mark.parametrize("row", reference("worst_attainable_frames.csv"))
def test_the_longest_frames_exist(row):
    extended, dlc = row["format"] == "ext", int(row["dlc"])
    free = iter(f"{int(row['id_hex'], 16):0{29 if extended else 11}b}")
    bits = [int(next(free)) if bit is None else bit for bit in frame_head(extended, dlc)]
    data = bytes.fromhex(row["data_hex"])
    assert len(data) == dlc
    bits += [int(bit) for byte in data for bit in f"{byte:08b}"]
    bits += [int(bit) for bit in f"{crc(bits):015b}"]
    total = frame_length(dlc, stuffing="none", extended=extended) + count_stuff_bits(bits)
    assert (
        total
        == frame_length(dlc, stuffing="attainable", extended=extended)
        == int(row["total_bits_incl_ifs3"])
    )


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
        """Add to new tables what a bit makes of the old ones."""
        (mass, mean, most), (new_mass, new_mean, new_most) = source, tables
        out = (register >> 14) ^ bit
        # A shift register steps one to one, so that every target has one source.
        target = (register << 1) & 0x7FFF ^ POLYNOMIAL * out
        for last in (0, 1):
            for run in range(5):
                same = last == bit and run != 4
                if same and run == 3:
                    place, stuff = (target, 1 - bit, 0), 1
                else:
                    place, stuff = (target, bit, run + 1 if same else 0), 0
                new_mass[place] += weight * mass[:, last, run]
                new_mean[place] += weight * (mean[:, last, run] + stuff * mass[:, last, run])
                new_most[place] = np.maximum(new_most[place], most[:, last, run] + stuff)

    tables = (mass, mean, most)
    for fixed in frame_head(extended, dlc) + [None] * 8 * dlc:
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
    for row in reference("stuff_bits.csv"):
        ours = frame_length(int(row["dlc"]), stuffing="mean", extended=row["format"] == "ext")
        assert ours == pytest.approx(float(row["mean_total_bits"]), abs=6e-7)


@pytest.mark.parametrize("dlc", [-1, 9, 2.5, None, True, "8", [1, 9], float("nan")])
def test_a_wrong_number_of_bytes_is_refused(dlc):
    with pytest.raises(ArgumentError, match=r"dlc is .*; it must be whole numbers 0\.\.8"):
        frame_length(dlc)


def test_other_wrong_arguments_are_refused():
    with pytest.raises(ArgumentError, match="stuffing is 'longest'; it must be one of none"):
        frame_length(8, stuffing="longest")
    with pytest.raises(ArgumentError, match="extended is 29; it must be True or False"):
        frame_length(8, extended=29)
    assert frame_length(np.array([], dtype=int)).shape == (0,)


def test_whole_floats_are_numbers_of_bytes():
    assert frame_length(2.0) == frame_length(2) == 75
    assert frame_length([2.0, 8.0]).tolist() == [75, 135]
