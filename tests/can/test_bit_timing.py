import numpy as np
import pandas as pd
import pytest

from shipnet import datasets
from shipnet.can import bit_timings, longest_bus
from shipnet.errors import ArgumentError

#: Clock [MHz], rate [kbit/s], printed sample point [%], prs, phs1, phs2, registers: data sheets
#: Atmel 4250E and 7647O, table of examples. Two of its rows for 6 MHz are left out: 15 quanta
#: (7, 4, 3) with CANBT3 = 35 and 10 quanta (4, 3, 2) with 23, where the register swaps the two
#: phases compared with the columns and the sample point printed beside it.
PRINTED = [
    (16, 1000, 69, 7, 4, 4, "00 0C 36"),
    (16, 1000, 75, 3, 2, 2, "02 04 13"),
    (16, 500, 75, 7, 4, 4, "02 0C 37"),
    (16, 500, 75, 3, 2, 2, "06 04 13"),
    (16, 250, 75, 7, 4, 4, "06 0C 37"),
    (16, 250, 75, 3, 2, 2, "0E 04 13"),
    (16, 125, 75, 7, 4, 4, "0E 0C 37"),
    (16, 125, 75, 3, 2, 2, "1E 04 13"),
    (16, 100, 75, 7, 4, 4, "12 0C 37"),
    (16, 100, 75, 3, 2, 2, "26 04 13"),
    (8, 1000, 63, 3, 2, 2, "00 04 12"),
    (8, 500, 69, 7, 4, 4, "00 0C 36"),
    (8, 200, 75, 8, 6, 5, "02 0E 4B"),
    (8, 100, 75, 3, 2, 2, "12 04 13"),
    (6, 500, 67, 5, 3, 3, "00 08 24"),
    (6, 250, 75, 5, 3, 3, "02 08 25"),
    (4, 200, 70, 8, 6, 5, "00 0E 4A"),
]


@pytest.mark.parametrize(("mhz", "kbit", "sample", "prs", "phs1", "phs2", "registers"), PRINTED)
def test_the_registers_are_those_of_the_data_sheets(mhz, kbit, sample, prs, phs1, phs2, registers):
    table = bit_timings(mhz * 1e6, kbit * 1e3)
    where = (table[["prs", "phs1", "phs2", "sjw"]] == [prs, phs1, phs2, 1]).all(axis=1)
    (row,) = table[where].to_dict("records")
    assert [f"0x{byte}" for byte in registers.split()] == [row[f"canbt{k}"] for k in (1, 2, 3)]
    # The data sheet rounds halves up.
    assert int(row["sample_point_percent"] + 0.5) == sample


def decoded(row):
    one, two, three = (int(row[f"canbt{k}"], 16) for k in (1, 2, 3))
    return {
        "prescaler": (one >> 1) + 1,
        "prs": (two >> 1 & 7) + 1,
        "sjw": (two >> 5) + 1,
        "phs1": (three >> 1 & 7) + 1,
        "phs2": (three >> 4) + 1,
    }


@pytest.mark.parametrize("kbit", [1000, 500, 250, 125, 50, 20])
def test_every_setting_is_legal_and_none_is_missing(kbit):
    table = bit_timings(16e6, kbit * 1e3)
    rows = table.to_dict("records")
    for row in rows:
        assert decoded(row) == {name: row[name] for name in decoded(row)}
        assert (int(row["canbt3"], 16) & 1) == (row["prescaler"] > 1)
    # Counted with plain loops.
    expected = 0
    for prescaler in range(1, 65):
        if 16000 % (kbit * prescaler):
            continue
        quanta = 16000 // (kbit * prescaler)
        if 8 <= quanta <= 25:
            for phs2 in range(2, 9):
                for phs1 in range(phs2, 9):
                    if 1 <= quanta - 1 - phs1 - phs2 <= 8:
                        expected += min(4, phs2)
    assert len(table) == expected > 0
    assert not table.drop(columns=["tq_ns"]).duplicated().any()


def test_settings_agree_with_python_can():
    can = pytest.importorskip("can")
    for row in bit_timings(16e6, 250e3).to_dict("records"):
        peer = can.BitTiming(
            f_clock=16_000_000,
            brp=row["prescaler"],
            tseg1=row["prs"] + row["phs1"],
            tseg2=row["phs2"],
            sjw=row["sjw"],
        )
        assert peer.bitrate == 250e3
        assert peer.nbt == row["quanta"]
        # At prescaler 1 the AT90CAN128 samples a quantum early, which python-can does not model.
        early = 100 / row["quanta"] * (row["prescaler"] == 1)
        assert peer.sample_point == pytest.approx(row["sample_point_percent"] + early)
        tolerance = row["oscillator_tolerance_percent"]
        # python-can calculates the propagation segment from the delay: here, that of the setting.
        delay = (row["prs"] - 0.5) * row["tq_ns"] / 2
        assert peer.oscillator_tolerance(delay, 0) == pytest.approx(tolerance)


def test_the_best_sample_point_comes_first():
    table = bit_timings(16e6, 250e3, sample_point=0.875)
    away = np.abs(table["sample_point_percent"] - 87.5)
    assert away.is_monotonic_increasing
    assert table["sample_point_percent"][0] == 87.5
    tied = table[away == 0]
    assert tied["quanta"].is_monotonic_decreasing


def test_a_rate_that_the_clock_misses_has_no_setting():
    assert bit_timings(8e6, 83.333e3).empty


def resynchronised(quanta, phs1, phs2, sjw, off):
    """Return whether two clocks, off by +-`off`, survive both of the standard's worst cases."""
    # Ten bits without an edge: one jump must correct the error at the next edge.
    drift = 2 * off * 10 * quanta
    # A node must read the thirteenth bit after its last edge correctly, to determine whose error
    # flag it is.
    late = 2 * off * (13 * quanta - phs2)
    return drift <= sjw and late <= min(phs1, phs2)


@pytest.mark.parametrize("bit", [(8, 2, 2, 1), (10, 4, 4, 4), (16, 4, 4, 1), (16, 8, 2, 2)])
def test_a_clock_just_inside_the_tolerance_survives_and_one_just_outside_does_not(bit):
    table = bit_timings(16e6, 4e6 / bit[0])
    row = table[(table[["quanta", "phs1", "phs2", "sjw"]] == [*bit]).all(axis=1)].iloc[0]
    allowed = row["oscillator_tolerance_percent"] / 100
    assert resynchronised(*bit, 0.999 * allowed)
    assert not resynchronised(*bit, 1.001 * allowed)


def test_the_bus_length_fits_into_the_propagation_segment():
    table = bit_timings(16e6, 500e3, loop_delay=150e-9)
    segment = table["prs"] * table["tq_ns"] * 1e-9
    there_and_back = 2 * (table["longest_bus_m"] * 5e-9 + 150e-9)
    long = segment > 300e-9
    assert there_and_back[long].tolist() == pytest.approx(segment[long].tolist())
    assert table["longest_bus_m"][~long].eq(0).all()
    assert long.any() and not long.all()


def test_published_lengths_fall_with_the_bit_rate():
    table = pd.read_csv(datasets.path("can_bus_lengths.csv"))
    assert table["bit_rate_kbit_per_s"].is_monotonic_decreasing
    assert table["length_m"].is_monotonic_increasing
    # Up to 500 kbit/s, the round trip at 5 ns/m takes between 0.49 and 0.7 bit.
    slow = table[table["bit_rate_kbit_per_s"] <= 500]
    bits = 2 * slow["length_m"] * 5e-9 * slow["bit_rate_kbit_per_s"] * 1e3
    assert bits.between(0.49, 0.7).all()
    assert [longest_bus(1e3 * rate) for rate in slow["bit_rate_kbit_per_s"]] == [
        *slow["length_m"].astype(float)
    ]


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: bit_timings(32e6, 125e3), r"clock is 3.2e\+07 Hz; it must be 1e\+06"),
        (lambda: bit_timings(16e6, 0), "bit_rate is 0 bit/s"),
        (lambda: bit_timings(16e6, 125e3, sample_point=75), "sample_point is 75; it must be"),
        (lambda: bit_timings(16e6, 125e3, loop_delay=-1), "loop_delay is -1 s"),
    ],
)
def test_an_argument_out_of_range_is_refused(call, message):
    with pytest.raises(ArgumentError, match=message):
        call()
