from pathlib import Path

import numpy as np
import pytest

from shipnet.can import Segment
from shipnet.errors import ArgumentError

REFERENCE = np.load(Path(__file__).parents[1] / "reference" / "line" / "can_rs485.npz")
#: The pattern of the reference, in which 1 is dominant.
PATTERN = "01001101"


@pytest.mark.parametrize("case", ["term", "open", "term_stub10m", "open_stub10m"])
def test_waveforms_and_samples_agree_with_ngspice(case, monkeypatch):
    monkeypatch.setattr("shipnet.can.segment._STEPS", 60)  # of 0.5 ns
    segment = Segment(
        40,
        terminator=120 if case.startswith("term") else None,
        stubs={5: 10} if "stub" in case else {},
    )
    run = segment.send({1: PATTERN}, 1e6)
    name = f"can_40m_1M_{case}"
    probes = ["s5" if p == "st" else f"b{int(p[1:]) + 1}" for p in REFERENCE[f"{name}/probes"]]
    expected = REFERENCE[f"{name}/v"]
    rows = [run.points.index(probe) for probe in probes]
    ours = run.v[rows][:, ::40]
    count = ours.shape[1]
    # Steps of 0.5 ns cause an error of 6e-4 of the peak; other tests limit the solver to 2e-4.
    assert np.abs(ours - expected[:, :count]).max() <= 1e-3 * np.abs(expected).max()
    theirs = np.array([np.interp(run.sample_times, 20e-9 * np.arange(501), v) for v in expected])
    bits = np.where(theirs >= 0.9, 0, np.where(theirs <= 0.5, 1, -1))
    assert np.array_equal(run.bits[rows], bits)
    assert (not run.wrong) == case.startswith("term")


def test_two_senders_make_a_wired_and():
    patterns = {1: "00110101", 9: "0101"}
    # The bits are slow because the inputs along the line ring for some microseconds.
    run = Segment(40).send(patterns, 50e3)
    assert run.sent.tolist() == [0, 0, 0, 1, 0, 1, 0, 1]
    assert run.wrong == []
    # Two senders drive harder than one: 3.2 V through 20 instead of 40 ohm into 60 ohm.
    middle = run.samples[run.row(5)]
    load = 2 / 120 + 9 / 20e3
    assert middle[0] == pytest.approx(3.2 / 20 / (1 / 20 + load), rel=1e-3)
    assert middle[1] == pytest.approx(3.2 / 40 / (1 / 40 + load), rel=1e-3)


def test_a_long_bus_needs_a_late_sample_point():
    # 100 m at 1 Mbit/s: the propagation delay is half a bit.
    late, early = (
        Segment(100, 5).send({1: PATTERN}, 1e6, sample_point=point) for point in (0.8, 0.3)
    )
    assert late.wrong == []
    assert 1 not in early.wrong
    assert 5 in early.wrong


def test_the_step_divides_the_delay_and_resolves_the_edge(monkeypatch):
    run = Segment(40, 5).send({1: "01"}, 1e6)
    dt = run.t[1] - run.t[0]
    assert dt <= 6e-9
    assert 50e-9 / dt == pytest.approx(round(50e-9 / dt))
    monkeypatch.setattr("shipnet.can.segment._STEPS", 40)
    fine = Segment(40, 5).send({1: "01"}, 1e6)
    assert fine.t[1] - fine.t[0] == pytest.approx(dt / 8, rel=0.1)
    assert run.samples == pytest.approx(fine.samples, abs=0.02)


@pytest.mark.parametrize(
    ("bus", "change", "message"),
    [
        ({"length": 0}, {}, "length is 0"),
        ({"terminator": 0}, {}, "terminator is 0"),
        ({"nodes": 1}, {}, "nodes is 1; it must be a whole number 2..200"),
        ({"stubs": {10: 1.0}}, {}, "node of a stub is 10"),
        ({"stubs": {1: 0}}, {}, "length of the stub at node 1 is 0"),
        ({}, {"patterns": {}}, "patterns are empty"),
        ({}, {"patterns": {1: "012"}}, "pattern of node 1 is '012'"),
        ({}, {"patterns": {"x": "01"}}, "node is 'x'; it must be a whole number 1..9"),
        ({}, {"bit_rate": 2e6}, "bit_rate is"),
        ({}, {"sample_point": 75}, "sample_point is"),
    ],
)
def test_an_argument_out_of_range_is_refused(bus, change, message):
    with pytest.raises(ArgumentError, match=message):
        Segment(**{"length": 40, **bus}).send(**{"patterns": {1: "01"}, "bit_rate": 1e6, **change})


def test_the_table_has_a_row_per_node():
    table = Segment(40, terminator=None).send({1: PATTERN}, 1e6).table()
    assert table.index.tolist() == list(range(1, 10))
    assert table["read"].eq("00000000").all()
    assert table["wrong"].eq(4).all()
    assert (table["most_recessive_V"] > 0.9).all()
