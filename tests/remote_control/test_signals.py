import pytest

from shipnet.errors import ArgumentError
from shipnet.remote_control import System
from shipnet.remote_control.signals import HOPS, SIGNALS, forwarded, signals_on


def test_numbers_count_from_zero_without_a_gap():
    assert [signal.number for signal in SIGNALS] == list(range(len(SIGNALS)))
    assert len({signal.name for signal in SIGNALS}) == len(SIGNALS)


def test_every_line_has_the_remote_control_at_one_end():
    assert all("RCS" in hop for hop in HOPS)
    assert {hop for signal in SIGNALS for hop in signal.hops} == set(HOPS)


def test_the_switches_that_the_paper_doubles_are_mirrored_and_no_others():
    mirrored = {signal.name: set(signal.sources) for signal in SIGNALS if signal.mirrored}
    assert mirrored == {
        "control_position": {"BCS", "RCS"},
        "shutdown_cancel": {"BCS", "SS"},
        "slowdown_cancel": {"BCS", "SS"},
    }
    assert all(signal.kind == "switch" for signal in SIGNALS if signal.mirrored)


def test_who_sets_a_value_does_not_read_it_and_somebody_does():
    for signal in SIGNALS:
        assert not set(signal.sources) & set(signal.readers)
        assert signal.mirrored or signal.readers


def test_what_is_forwarded_crosses_both_lines_of_its_way():
    for source, target in (("BCS", "SS"), ("SS", "BCS")):
        first = {signal.number for signal in signals_on(source, "RCS")}
        second = {signal.number for signal in signals_on("RCS", target)}
        assert forwarded(source, target) <= first & second


def test_the_table_has_a_row_per_signal_and_counts_the_lines_that_the_functions_name():
    table = System().signals()
    assert table.name.tolist() == [signal.name for signal in SIGNALS]
    for source, target in HOPS:
        assert table[f"{source}-{target}"].sum() == len(signals_on(source, target))


def test_stations_without_a_line_are_refused():
    with pytest.raises(ArgumentError, match="'BCS', 'SS'; the lines are RCS to BCS"):
        signals_on("BCS", "SS")
    with pytest.raises(ArgumentError, match="they must be BCS, SS"):
        forwarded("RCS", "SS")
