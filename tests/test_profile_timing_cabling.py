import itertools

import numpy as np
import pandas as pd
import pytest

from shipnet import datasets
from shipnet.asi import Profile, Transaction
from shipnet.asi.profile import (
    IO_CONFIGURATIONS,
    describe_io_configuration,
    describe_status,
    io_code,
)
from shipnet.design.plant import (
    Saving,
    asi_conductors,
    count_points,
    hardwired_conductors,
    lines_needed,
    saving,
    slaves_needed,
)
from shipnet.errors import ArgumentError, explain
from shipnet.signals import SIGNALS


def test_io_codes_mirror_inputs_and_outputs():
    swap = {"IN": "OUT", "OUT": "IN", "I/O": "I/O"}
    for code in (0, 1, 2, 3, 4, 5, 6):
        assert tuple(swap[port] for port in IO_CONFIGURATIONS[code]) == IO_CONFIGURATIONS[code + 8]
    assert len(set(IO_CONFIGURATIONS)) == 16


def test_io_code_is_the_inverse_and_refuses_the_rest():
    known = 0
    for ports in itertools.product(["IN", "OUT", "I/O"], repeat=4):
        if ports in IO_CONFIGURATIONS:
            assert IO_CONFIGURATIONS[io_code(ports)] == ports
            known += 1
        else:
            with pytest.raises(ArgumentError, match="the codes know only"):
                io_code(ports)
    assert known == 15


@pytest.mark.parametrize("code", [-1, 16, 1.0, "3", None, True])
def test_codes_out_of_range(code):
    with pytest.raises(ArgumentError, match=r"0\.\.15"):
        describe_io_configuration(code)
    with pytest.raises(ArgumentError, match=r"0\.\.15"):
        describe_status(code)
    with pytest.raises(ArgumentError, match=r"0\.\.15"):
        Profile(code, 0)


def test_status_flags():
    assert describe_status(0) == "no flag set"
    assert describe_status(0b1001).split(", ") == [
        "S0 address or ID code still volatile",
        "S3 memory read error",
    ]
    assert describe_status(0b0100) == "S2 reserved"
    assert describe_status(0b0110, version="2.0") == "S1 parity error seen, S2 end bit error seen"
    with pytest.raises(ArgumentError, match="version is '3'"):
        describe_status(0, version="3")


def test_profiles_come_back_from_their_text():
    for codes in itertools.product(range(16), range(16), [None, *range(16)]):
        profile = Profile(*codes)
        assert Profile.parse(str(profile)) == profile
        assert profile.extended == (codes[1] == 10)


def test_only_id_code_a_shares_its_address():
    assert [code for code in range(16) if Profile(7, code).extended] == [0xA]


@pytest.mark.parametrize("text", ["", "7.A.E", "S-7", "S-G.A", "S-7.A.E.0", "S-7.A.", "S-77.A"])
def test_other_profiles_are_refused(text):
    with pytest.raises(ArgumentError, match="must look like"):
        Profile.parse(text)


@pytest.mark.parametrize(
    ("pauses", "microseconds"), [((2, 1.5), 147), ((2, 2), 150), ((3, 2), 156), ((10, 2), 198)]
)
def test_transactions_of_published_length(pauses, microseconds):
    transaction = Transaction(*pauses)
    assert transaction.duration * 1e6 == pytest.approx(microseconds)
    spans = transaction.spans
    assert [span.length for span in spans] == [14, pauses[0], 7, pauses[1]]
    assert all(a.end == b.start for a, b in itertools.pairwise(spans))


@pytest.mark.parametrize(
    "pauses",
    [{"master_pause": 1.9}, {"master_pause": 10.1}, {"master_pause": float("nan")},
     {"slave_pause": -1}, {"slave_pause": float("inf")},
     {"bit_time": 0}, {"bit_time": float("nan")}],
)  # fmt: skip
def test_impossible_pauses(pauses):
    with pytest.raises(ArgumentError, match=next(iter(pauses))):
        Transaction(**pauses)


def test_conductors_of_the_papers():
    assert hardwired_conductors({"contact": 62 * 4}) == 496
    assert hardwired_conductors({"contact": 190}) == 380
    assert asi_conductors(14) == 28
    assert f"{Saving(380, 28).left:.4f}" == "0.0737"
    # lee2012 Table 3: 62 resistance thermometers, 18 current loops, 19 switches.
    assert hardwired_conductors({"rtd_3wire": 62, "current_loop": 18, "contact": 19}) == 260


def test_common_returns_are_counted_once_a_group():
    assert hardwired_conductors({"contact_common": 8}) == 9
    assert hardwired_conductors({"contact_common": 8}, groups=2) == 10
    assert hardwired_conductors({"contact_common": 0}, groups=2) == 0
    assert hardwired_conductors({"contact_common": 2}, groups=50) == 4
    assert hardwired_conductors({"contact_common": 8, "contact": 1}, groups=3) == 13
    assert saving({"contact_common": 8}, lines=2, groups=3) == Saving(11, 4)


def test_nothing_needs_nothing():
    assert hardwired_conductors({}) == 0
    assert asi_conductors(0) == 0
    assert slaves_needed(0) == lines_needed(0) == 0


@pytest.mark.parametrize(
    ("inputs", "outputs", "slaves"), [(1, 0, 1), (4, 4, 1), (5, 0, 2), (4, 9, 3)]
)
def test_slaves_fill_the_port_that_runs_out_first(inputs, outputs, slaves):
    assert slaves_needed(inputs, outputs) == slaves


def test_an_ab_slave_has_fewer_outputs():
    assert slaves_needed(4, 9, outputs_per_slave=3) == 3
    assert slaves_needed(4, 10, inputs_per_slave=4, outputs_per_slave=3) == 4


def test_lines_at_their_limits():
    assert [lines_needed(n) for n in (1, 62, 63, 124)] == [1, 1, 2, 2]
    assert lines_needed(32, slaves_per_line=31) == 2


@pytest.mark.parametrize(
    "call",
    [
        lambda: hardwired_conductors({"wireless": 1}),
        lambda: hardwired_conductors({"contact": -1}),
        lambda: hardwired_conductors({"contact": 1.5}),
        lambda: hardwired_conductors({"contact": 1}, groups=0),
        lambda: asi_conductors(-1),
        lambda: slaves_needed(1, inputs_per_slave=0),
        lambda: lines_needed(1, slaves_per_line=63),
        lambda: Saving(0, 2),
    ],
)
def test_bad_counts(call):
    with pytest.raises(ArgumentError):
        call()


def test_an_io_list_is_counted_and_its_faults_are_all_named():
    iolist = datasets.read("synthetic_iolist_valves.csv")
    assert sum(count_points(iolist).values()) == len(iolist) == 16
    broken = iolist.assign(signal=["radio", "smoke", *iolist["signal"][2:]])
    with pytest.raises(
        ArgumentError, match=r"ZSO: unknown kind 'radio'; BV-01-ZSC: unknown kind 'smoke'"
    ):
        count_points(broken)
    with pytest.raises(ArgumentError, match="no column signal"):
        count_points(iolist.drop(columns="signal"))
    with pytest.raises(ArgumentError, match="BV-01-ZSO: stands twice"):
        count_points(pd.concat([iolist, iolist.iloc[:1]]))
    assert count_points(pd.DataFrame({"tag": [], "signal": []})) == {}
    assert count_points(iolist.astype({"signal": "category"}).iloc[:2]) == {"contact": 2}


def test_counts_in_small_integers_do_not_overflow():
    assert hardwired_conductors({"rtd_3wire": np.uint8(200)}) == 600
    assert asi_conductors(np.int8(100)) == 200
    assert type(Saving(np.int64(4), np.int8(2)).hardwired) is int


def test_conductors_of_each_signal():
    # A common return leaves one wire a point; a number in the name is the number of wires.
    expected = {name: 1 if name.endswith("_common") else 2 for name in SIGNALS}
    expected |= {"rtd_3wire": 3, "rtd_4wire": 4, "current_loop_4wire": 4, "potentiometer": 3}
    expected |= {"proximity_3wire": 3}
    assert {name: signal.conductors for name, signal in SIGNALS.items()} == expected
    for name, signal in SIGNALS.items():
        assert signal.meaning
        assert signal.common == int(name.endswith("_common"))


def test_error_codes_have_names():
    names = [explain(code) for code in range(18)]
    assert len(set(names)) == 18
    assert explain(np.uint8(5)) == "ParityError"
    with pytest.raises(ValueError, match="code is 18"):
        explain(18)
