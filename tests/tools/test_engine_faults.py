import pytest

from shipnet.engine.system import RULE
from shipnet.errors import ArgumentError
from shipnet.tools.engine_faults import DESIGNS, FAULTS, START, EngineFaults

PRINTED, RING, CORRECTED = DESIGNS


#: The cable that closes the ring; a line has none.
CLOSING = "CAN cable cut JB3-JB1"


@pytest.mark.parametrize("design", DESIGNS)
@pytest.mark.parametrize("fault", FAULTS)
def test_every_fault_can_be_shown_in_every_design(fault, design):
    if fault == CLOSING and design != RING:
        with pytest.raises(ArgumentError, match="has no such cable"):
            EngineFaults(fault, design)
        return
    for time in (2, START, 25):
        result = EngineFaults(fault, design, time).result
        assert len(result.table()) == 99
        assert result.old == 0 or (fault != "none" and time > START)
    # The corrected design shows no old value as good, except of a stuck sensor.
    assert design != CORRECTED or fault.startswith("sensor stuck") or result.old == 0


def test_a_dead_box_is_shown_as_good_until_it_is_marked():
    after = START + DESIGNS[PRINTED].staleness_flag().after
    assert EngineFaults("box dead JB2", PRINTED, START + RULE + 1).result.old == 18
    late = EngineFaults("box dead JB2", PRINTED, round(after + 0.5))
    assert (late.result.marked, late.result.old) == (18, 0)
    assert late.raised == ["14.47 s: JB2 points, 0xFF (18)"]


def test_alarms_of_a_box_are_counted_together_and_only_so_far():
    before = EngineFaults("box dead JB1", PRINTED, 12)
    assert before.raised == ["10.35 s: channel 1, no answer"]
    assert "alarms" in before.numbers and "none" in EngineFaults("none").numbers["alarms"]
    assert EngineFaults("box dead JB1", PRINTED, 20).raised[1:] == [
        "14.47 s: JB1 points, 0xFF (43)"
    ]


def test_a_cable_that_only_the_ring_has_can_be_cut_there():
    cut = EngineFaults(CLOSING, RING, 20)
    assert (cut.result.old, cut.result.marked, cut.raised) == (0, 0, [])
    page = EngineFaults().explore()
    page.controls["fault"].value = CLOSING
    assert "has no such cable" in page.text
    page.controls["design"].value = RING
    assert "all values fresh" in page.text
