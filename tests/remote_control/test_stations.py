from shipnet.remote_control import System
from shipnet.remote_control.faults import HOPS
from shipnet.remote_control.system import VALUES, forwarded, values_on


def test_the_values_are_numbered_used_and_sent_through_rcs():
    assert [value.number for value in VALUES] == list(range(len(VALUES)))
    assert len({value.name for value in VALUES}) == len(VALUES)
    assert all("RCS" in hop for hop in HOPS)
    assert {hop for value in VALUES for hop in value.hops} == set(HOPS)
    for value in VALUES:
        assert not set(value.sources) & set(value.readers)
        assert value.mirrored or value.readers


def test_only_the_switches_that_the_paper_doubles_are_mirrored():
    mirrored = {value.name: set(value.sources) for value in VALUES if value.mirrored}
    assert mirrored == {
        "control_position": {"BCS", "RCS"},
        "shutdown_cancel": {"BCS", "SS"},
        "slowdown_cancel": {"BCS", "SS"},
    }
    assert all(value.kind == "switch" for value in VALUES if value.mirrored)


def test_forwarded_values_cross_both_lines():
    for source, target in (("BCS", "SS"), ("SS", "BCS")):
        first = {value.number for value in values_on(source, "RCS")}
        second = {value.number for value in values_on("RCS", target)}
        assert forwarded(source, target) <= first & second


def test_the_table_has_a_row_per_value_and_a_column_per_line():
    table = System().signals()
    assert table.name.tolist() == [value.name for value in VALUES]
    for source, target in HOPS:
        assert table[f"{source}-{target}"].sum() == len(values_on(source, target))
