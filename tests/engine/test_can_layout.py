import csv
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shipnet import datasets
from shipnet.can import read_messages, response_times
from shipnet.engine.can_layout import CanLayout
from shipnet.engine.points import Point, read_points
from shipnet.errors import ArgumentError

POINTS = read_points()
REFERENCE = Path(__file__).parents[1] / "reference" / "can" / "lee2012_jb_can_volume.csv"


def codes(bits, shape, seed=1):
    values = np.random.default_rng(seed).integers(0, 2**bits, (*shape, len(POINTS)))
    values[..., [not point.analogue for point in POINTS]] %= 2
    return values


@pytest.mark.parametrize("bits", [16, 12, 10, 8])
def test_the_reference_table_comes_out(bits):
    table = CanLayout(POINTS, bits).volume().rename(index={"all": "TOTAL"})
    with REFERENCE.open() as file:
        rows = [row for row in csv.DictReader(file) if int(row["bits_per_analog"]) == bits]
    assert [row["jb"] for row in rows] == list(table.index)
    names = {
        "analog": "analogue", "digital": "switches", "payload_bytes": "bytes",
        "can_frames": "frames", "bits_nominal": "nominal_bits", "bits_worst_std": "worst_bits",
        "bits_worst_ext": "worst_extended_bits", "ms_125k": "ms_125k", "ms_250k": "ms_250k",
        "ms_500k": "ms_500k", "ms_1M": "ms_1000k",
    }  # fmt: skip
    for row in rows:
        for theirs, ours in names.items():
            if row[theirs]:
                assert table.loc[row["jb"], ours] == pytest.approx(float(row[theirs]))


def test_the_message_set_is_that_of_the_data_file():
    stored = read_messages(datasets.path("synthetic_can_lee2012.csv"))
    assert CanLayout(POINTS).messages() == stored


def test_the_last_message_waits_for_all_others_at_most():
    # All released at once; the longest frame of a lower priority is none for the last message.
    responses = response_times(CanLayout(POINTS).messages(), 125_000)
    assert responses[-1].response == pytest.approx(22.8e-3)
    assert max(r.response for r in responses) == responses[-1].response


@given(st.integers(1, 16), st.integers(0, 2**32 - 1))
def test_what_is_packed_comes_out_again(bits, seed):
    layout = CanLayout(POINTS, bits)
    values = codes(bits, (3,), seed)
    frames = layout.encode(values)
    assert {m.name: m.dlc for m in layout.messages()} == {k: v.shape[1] for k, v in frames.items()}
    assert (layout.decode(frames) == values).all()
    row = {name: data[1].tobytes() for name, data in frames.items()}
    assert (layout.decode(row) == values[1]).all()


@pytest.mark.parametrize("bits", [16, 12, 10, 8])
def test_the_bytes_are_those_of_a_long_number(bits):
    # The second route: each box is one whole number, written digit by digit.
    layout, values = CanLayout(POINTS, bits), codes(bits, ())
    frames = layout.encode(values)
    for box in POINTS.boxes:
        own = [(p, int(v)) for p, v in zip(POINTS, values, strict=True) if p.box == box]
        digits = "".join(f"{v:0{bits}b}" for p, v in own if p.analogue)
        digits += "0" * (-len(digits) % 8)
        states = "".join(str(v) for p, v in own if not p.analogue)
        states += "0" * (-len(states) % 8)
        digits += "".join(states[k : k + 8][::-1] for k in range(0, len(states), 8))
        sent = b"".join(data.tobytes() for name, data in frames.items() if name.startswith(box))
        assert sent == int(digits, 2).to_bytes(len(digits) // 8, "big")


@pytest.mark.parametrize("bits", [16, 12, 10])
def test_the_table_says_which_frames_change_with_a_point(bits):
    layout = CanLayout(POINTS, bits)
    zero = layout.encode(np.zeros(99, int))
    for k, row in enumerate(layout.table().itertuples()):
        value = np.zeros(99, int)
        value[k] = 2**bits - 1 if POINTS[k].analogue else 1
        frames = layout.encode(value)
        changed = {name for name in frames if (frames[name] != zero[name]).any()}
        assert changed == {row.message, row.last_message}
        assert frames[row.message].nonzero()[0][0] == row.byte
    divides = (layout.table()["message"] == layout.table()["last_message"]).all()
    assert divides == (64 % bits == 0)


def test_a_box_of_switches_alone_and_one_of_values_alone():
    points = [Point("S", "A", "switch", "logic"), Point("P", "B", "4-20 mA", "pressure", 0, 6)]
    layout = CanLayout(points, 12)
    assert layout.volume().bytes.to_dict() == {"A": 1, "B": 2, "all": 3}
    assert layout.decode(layout.encode([1, 4095])).tolist() == [1, 4095]
    assert layout.encode([1, 4095])["B-01"].tobytes() == b"\xff\xf0"


def test_what_does_not_fit_is_refused():
    layout = CanLayout(POINTS, 8)
    many = [Point(f"P{k}", f"B{k}", "switch", "logic") for k in range(8)]
    for action, message in (
        (lambda: CanLayout(POINTS, 17), "bits is 17"),
        (lambda: CanLayout([]), "points are empty"),
        (lambda: CanLayout(many), "there are 8 boxes"),
        (lambda: layout.encode([0] * 98), r"shape \(98,\)"),
        (lambda: layout.encode([0.5] * 99), "float64"),
        (lambda: layout.encode(7), r"shape \(\)"),
        (lambda: layout.encode([256] + [0] * 98), r"ME-JB1-001 is 256; .* 0\.\.255"),
        (lambda: layout.encode([0] * 98 + [2]), r"ME-JB3-099 is 2; .* 0\.\.1"),
        (lambda: layout.encode([-1] + [0] * 98), "is -1"),
        (lambda: layout.decode({}), "lack"),
        (lambda: layout.decode({m.name: b"" for m in layout.messages()}), "must be uint8"),
        (lambda: layout.volume([10]), "bit_rates is 10"),
    ):
        with pytest.raises(ArgumentError, match=message):
            action()


def test_nothing_in_time_is_nothing_in_frames():
    layout = CanLayout(POINTS)
    frames = layout.encode(np.zeros((0, 99), int))
    assert frames["JB1-01"].shape == (0, 8)
    assert layout.decode(frames).shape == (0, 99)
