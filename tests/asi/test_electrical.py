import numpy as np
import pytest

from shipnet.asi.master import Master
from shipnet.asi.modulation import HALF_BIT
from shipnet.asi.plan import Plan
from shipnet.asi.receiver import receive
from shipnet.asi.segment import (
    POWER_SUPPLY,
    Supply,
    Terminator,
    signals_of,
    telegram_voltages,
)
from shipnet.asi.slave import DEVICE, Slave
from shipnet.asi.topologies import line, ring, star
from shipnet.errors import ArgumentError
from shipnet.line import Load, Network
from shipnet.line.network import CableRun
from tests.asi.lines import REQUESTS

R = 0.027  # ohm/m of the loop, 1.5 mm2


def silent(plan):
    """Return the plan with a master that draws nothing."""
    return Plan(
        plan.cables, [Master(node=plan.masters[0].node, current=0.0)], plan.supplies, plan.slaves
    )


def lost(plan, node):
    return 30 - plan.voltages[node]


def test_even_loads_on_a_line_drop_the_sum_of_their_drops():
    n, current = 50, 0.05
    plan = silent(line(100, n, current=current))
    # Each metre carries the current of all slaves downstream: r i L (n + 1) / 2.
    assert lost(plan, "100 m") == pytest.approx(R * current * 100 * (n + 1) / 2, rel=1e-9)


@pytest.mark.parametrize("back", [1.0, 40.0, 60.0, 200.0])
def test_a_passive_ring_lowers_the_drop_to_that_of_two_cables_in_parallel(back):
    there, current = 60.0, 2.0
    open_line = silent(line(there, [there], current=current))
    closed = silent(ring(there + back, [there], current=current))
    assert lost(open_line, "60 m") == pytest.approx(R * there * current, rel=1e-9)
    both = there * back / (there + back)
    assert lost(closed, "60 m") == pytest.approx(R * both * current, rel=1e-9)
    assert lost(closed, "60 m") < lost(open_line, "60 m")


def test_even_loads_on_a_ring_lose_a_quarter_of_what_they_lose_on_a_line():
    # 61 loads at k L / 62; the ring is fed from both ends, its middle load half from each.
    step, current = 100 / 62, 0.065
    places = [step * k for k in range(1, 62)]
    straight, closed = silent(line(100, places)), silent(ring(100, places))
    most = R * step * current * sum(range(1, 62))
    assert lost(straight, f"{places[-1]:g} m") == pytest.approx(most, rel=1e-9)
    middle = R * step * current * (sum(range(1, 31)) + 31 / 2)
    assert lost(closed, f"{places[30]:g} m") == pytest.approx(middle, rel=1e-9)
    assert middle / most == pytest.approx(0.254, abs=1e-3)


def test_repeaters_draw_on_both_sides_and_pass_no_current():
    plan = line(100).with_repeater("100 m", line(50, 1, current=0.4))
    near, far = plan.segments
    assert near.current == pytest.approx(0.065 + 0.065)
    assert far.current == pytest.approx(0.4 + 0.065)
    assert near.voltages["100 m"] == pytest.approx(30 - R * 100 * 0.065)
    assert far.voltages["2/50 m"] == pytest.approx(30 - R * 50 * 0.4)


def test_no_voltage_without_exactly_one_supply():
    runs, masters = [CableRun("a", "b", 10)], [Master(node="a")]
    for supplies in ([], [Supply("a"), Supply("b")]):
        plan = Plan(runs, masters, supplies)
        with pytest.raises(ArgumentError, match=f"has {len(supplies)} supplies"):
            _ = plan.voltages


def test_the_signal_is_that_of_a_segment_built_by_hand():
    plan = Plan(
        [CableRun("m", "hub", 40), CableRun("hub", "s1", 10), CableRun("hub", "s2", 30)],
        [Master(node="m")],
        [Supply("hub")],
        [Slave("1", node="s1"), Slave("2", node="s2")],
        terminators=[Terminator("s2", 120.0, 240e-6)],
    )
    runs = [CableRun("m", "hub", 40), CableRun("hub", "s1", 10), CableRun("hub", "s2", 30)]
    end = DEVICE + Load(r=120.0, l=240e-6)
    network = Network(runs, {"hub": POWER_SUPPLY, "m": DEVICE, "s1": DEVICE, "s2": end})
    ours = plan.network
    s = 2j * np.pi * np.array([20e3, 167e3, 400e3])
    assert ours.nodes[0] == "m"
    for node in ("m", "hub", "s1", "s2"):
        mine, theirs = ours.transfer("m", s), network.transfer("m", s)
        assert mine[ours.index(node)] == pytest.approx(theirs[network.index(node)], rel=1e-12)

    quality = signals_of([plan.segments[0]])[0]
    (u,) = telegram_voltages(network, "m", ["s1", "s2"], REQUESTS[::7], dt=50e-9)
    # The levels found with four samples per microsecond, and those of a finer waveform.
    assert quality.level_most == pytest.approx(np.ptp(u, axis=-1).max(axis=1), rel=0.01)
    assert (quality.level_least <= np.ptp(u, axis=-1).min(axis=1) * 1.01).all()


@pytest.mark.parametrize(
    "plan",
    [
        line(100, [5, 50, 100]),
        line(140, [5, 70, 140]),
        line(100, [1, 40, 80], supply=100),
        line(100, 31, supply=50),
        star(60, [1, 5, 12], along=[20, 40]),
        ring(100, [25, 50, 75]),
    ],
    ids=["line", "long", "far supply", "31 slaves", "mixture", "ring"],
)
def test_three_requests_and_the_responses_are_as_bad_as_all_requests(plan):
    segment = plan.segments[0]
    quality = signals_of([segment])[0]
    # All requests to 31 slaves would take seconds; every tenth slave shows as much.
    each = slice(None, None, 10 if len(plan.slaves) > 10 else 1)
    quality = type(quality)(*(field[each] for field in quality))
    nodes = tuple(node for _, node in segment.listeners)[each]
    (u,) = telegram_voltages(segment.network, segment.head, nodes, REQUESTS, dt=HALF_BIT / 12)
    heard = receive(u, HALF_BIT / 12, 14)
    level = np.ptp(u, axis=-1)
    assert (heard.error == 0).all(axis=1).tolist() == (quality.received == 1).tolist()
    # Tolerances of 1 % of the signal, fixed before the comparison.
    assert (quality.level_least <= level.min(axis=1) * 1.01).all()
    assert (quality.level_most >= level.max(axis=1) * 0.99).all()
    assert (quality.evenness <= heard.weakest.min(axis=1) + 0.01).all()
    assert (quality.ringing >= heard.ringing.max(axis=1) - 0.02).all()


def test_a_signal_that_is_lost_counts_as_bad():
    quality = signals_of([line(500, [5, 500]).segments[0]])[0]
    assert (quality.received < 1).all()
    assert (quality.evenness < 0.65).all()
    silence = Plan(
        [CableRun("a", "b", 100)],
        [Master(node="a")],
        [Supply("a")],
        [Slave("1", node="b")],
        terminators=[Terminator("b", 1.0)],
    )
    dead = signals_of([silence.segments[0]])[0]
    assert (dead.received[0], dead.evenness[0], dead.ringing[0]) == (0, 0, 1)


def test_repeaters_listen_to_the_segment_before_them():
    plan = line(100, [40]).with_repeater("100 m", line(50, [50]))
    near, far = plan.segments
    assert [name for name, _ in near.listeners] == ["slave 1 at 40 m", "repeater 100 m | 2/0 m"]
    assert [name for name, _ in far.listeners] == ["slave 2 at 2/50 m"]
    quality = signals_of(plan.segments)
    assert quality[0].level_least.shape == (2,)
    # Seen from its own head, the far segment is a line with a master.
    alone = signals_of([line(50, [50]).segments[0]])[0]
    assert quality[1].level_least == pytest.approx(alone.level_least, rel=1e-12)


def test_segments_without_listeners_or_without_a_head():
    empty = Plan([CableRun("a", "b", 10)], [Master(node="a")], [Supply("a")])
    assert signals_of(empty.segments)[0].level_least.shape == (0,)
    assert signals_of([]) == []
    headless = Plan([CableRun("a", "b", 10)], slaves=[Slave("1", node="b")])
    with pytest.raises(ArgumentError, match="segment at a has no head"):
        signals_of(headless.segments)
