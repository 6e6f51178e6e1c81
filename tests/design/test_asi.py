"""AS-i lines: cables and repeaters, positions of supplies, and response times."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shipnet.asi.master import Master
from shipnet.asi.plan import Plan
from shipnet.asi.segment import Supply
from shipnet.asi.slave import Slave
from shipnet.asi.timing import Cycle, Transaction
from shipnet.design.layout import Site
from shipnet.design.plan_asi import Piece, draw, place_supply, response
from shipnet.design.planning import plan
from shipnet.design.settings import Settings
from shipnet.line.cable import CABLES
from shipnet.line.network import CableRun
from tests.design.lists import table

LIMITS = Settings().asi


def between(places):
    """Return the distances between places along a line."""
    x = np.asarray(places, dtype=float)
    return abs(x - x[:, None])


@settings(max_examples=50)
@given(st.lists(st.integers(1, 150), min_size=1, max_size=8), st.booleans())
def test_no_segment_exceeds_its_length_and_no_cable_is_lost(hops, tree):
    ways = between(np.cumsum([0, *hops]))
    drawn = draw(ways, ways, Settings({"asi.length": 60, "asi.tree": tree}).asi)
    behind = {out for _, out in drawn.repeaters}
    used, part = {}, {"0": 0}
    for piece in drawn.pieces:
        part.setdefault(piece.near, len(part))
        part[piece.far] = part[piece.near]
        used[part[piece.near]] = used.get(part[piece.near], 0) + piece.length
        assert piece.near in behind or piece.near == "0" or piece.near.isdigit()
    assert max(used.values()) <= 60 + 1e-9
    assert drawn.length == pytest.approx(sum(hops))
    assert {piece.far for piece in drawn.pieces} >= {str(n) for n in range(1, len(hops) + 1)}
    for edge in {piece.edge for piece in drawn.pieces}:
        assert sum(p.share for p in drawn.pieces if p.edge == edge) == pytest.approx(1)


@pytest.mark.parametrize(
    ("places", "depth"),
    [((0, 100), 0), ((0, 101), 1), ((0, 200), 1), ((0, 201), 2), ((0, 300), 2), ((0, 301), 3)],
)
def test_a_long_line_has_a_repeater_every_100_m(places, depth):
    drawn = draw(between(places), between(places), LIMITS)
    assert drawn.depths[-1] == max(drawn.depths) == depth == len(drawn.repeaters)


@settings(max_examples=30)
@given(
    st.lists(st.integers(1, 20), min_size=1, max_size=7),
    st.lists(st.sampled_from([0.0, 0.065, 0.5]), min_size=8, max_size=8),
)
def test_the_supply_is_where_the_voltage_drop_is_least(hops, currents):
    places = np.cumsum([0, *hops])
    pieces = [
        Piece(str(a), str(b), (a, b), float(places[b] - places[a]), 1.0)
        for a, b in pairwise(range(len(places)))
    ]
    draws = {str(n): currents[n] for n in range(len(places))}
    # This name does not exist, so no place is preferred.
    found = place_supply(pieces, draws, "none", 30.0, CABLES["as-i 1.5"].resistance)

    def lowest(node):
        circuit = Plan(
            [CableRun(p.near, p.far, p.length) for p in pieces],
            [Master(node="0", current=currents[0])],
            [Supply(node)],
            [Slave(str(n), node=str(n), current=currents[n]) for n in range(1, len(places))],
        )
        volts = circuit.voltages
        return min(volts[node] for node in draws if draws[node] > 0 or node == found)

    # The circuit is solved with its own resistances; 0.1 mV allows for rounding.
    assert lowest(found) >= max(map(lowest, draws)) - 1e-4


def test_the_supply_stays_in_the_cabinet_while_the_voltage_allows_it():
    near, far = (plan(table([("contact", (x, 0, 0), 1000)] * n), Site((0, 0, 0)), "AS-i")
                 for x, n in ((50, 4), (80, 160)))  # fmt: skip
    assert near.devices.loc[near.devices["kind"] == "supply", "at"].tolist() == ["cabinet"]
    assert "feeder" not in set(near.cables["kind"])
    supplies = far.devices[far.devices["kind"] == "supply"]
    feeders = far.cables[far.cables["kind"] == "feeder"]
    assert feeders["at_cabinet"].all() and len(feeders) > 0
    assert set(feeders["b"]) == set(supplies.loc[supplies["at"] != "cabinet", "device"])
    assert (far.segments["lowest_v"] >= 26.5).all()


def test_response_times_agree_with_the_published_cycles():
    full = Cycle(31)
    # Alone at its address: one cycle, the response and a repetition; shared: two cycles. On a
    # disturbed line, a transaction with a slave out of step takes 28 bit times.
    assert response("S-0.A", full, LIMITS) == pytest.approx(5.784e-3)
    assert response("S-0.A", full, LIMITS, paired=True) == pytest.approx(11.328e-3)
    # Nord BU0090, p. 69: at most 21 ms to an A/B slave with four outputs.
    quick = Settings({"asi.conversion": 0, "asi.repetitions": 0}).asi
    late = response("S-7.A.7", full, quick, output=True, paired=True)
    assert late == pytest.approx(21e-3, rel=0.02)
    # ifm: seven cycles of 5 ms per value; a round of four values, then its own value once more.
    five = Cycle(1, transaction=Transaction(bit_time=5e-3 / 3 / 26))
    assert response("S-7.3", five, quick, channels=4) == pytest.approx(5 * 35e-3)


def test_slow_points_share_addresses():
    needs = [1000.0] * 31 + [8.0]
    rows = [
        ("contact", (10 + 12 * (n % 8), 12 * (n // 8), 0), need) for n, need in enumerate(needs)
    ]
    design = plan(table(rows), Site((0, 0, 0)), "AS-i", settings=Settings({"asi.length": 1000.0}))
    assert design.fits
    late = design.points["response_ms"]
    assert late.iloc[-1] < 8 < late.max() <= 10.6 or len(design.segments) > 1


def test_auxiliary_power_reaches_outputs_only():
    rows = [("solenoid", (30, 0, 0), 1000), ("contact", (60, 0, 0), 1000)]
    iolist = table(rows)
    both = plan(iolist, Site((0, 0, 0)), "AS-i")
    feeders = both.cables[both.cables["kind"] == "feeder"]
    assert feeders["a"].tolist() == ["AS-i 1 auxiliary supply"]
    assert feeders["at_cabinet"].tolist() == [True]
    supply = both.devices.set_index("device").loc["AS-i 1 auxiliary supply"]
    assert (supply["kind"], supply["at"]) == ("auxiliary supply", "cabinet")
    assert feeders["b"].item() == both.points["device"].iloc[0]
    none = plan(iolist, Site((0, 0, 0)), "AS-i", settings=Settings({"asi.auxiliary": False}))
    assert "feeder" not in set(none.cables["kind"])
    assert "auxiliary supply" not in set(none.devices["kind"])
    inputs = plan(table(rows[1:]), Site((0, 0, 0)), "AS-i")
    assert "auxiliary supply" not in set(inputs.devices["kind"])


def test_a_line_that_violates_a_signal_rule_is_refused_with_the_rule():
    limits = Settings({"asi.voltage": 20.0})
    design = plan(table([("contact", (30, 0, 0), 1000)]), Site((0, 0, 0)), "AS-i", settings=limits)
    (reason,) = design.reasons.itertuples()
    assert not design.fits
    assert (reason.limit, reason.value, reason.bound) == ("supply voltage", 20.0, 29.5)
    assert reason.text == (
        "P0 does not meet the AS-i limit on supply voltage even on its own line: 20 V; "
        "the limit is 29.5 V"
    )


def test_the_voltage_drop_is_that_of_the_chosen_cable():
    far = table([("rtd_3wire", (90 + n, 0, 0), 1000.0) for n in range(8)])
    lowest = {
        cable: plan(far, Site((0, 0, 0)), "AS-i", settings=Settings({"asi.cable": cable}))
        .segments["lowest_v"].min()
        for cable in ("ASI_MARINE", "ASI_FLAT25")
    }  # fmt: skip
    assert lowest["ASI_FLAT25"] > lowest["ASI_MARINE"]
