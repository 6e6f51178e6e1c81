import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.colors import same_color
from matplotlib.figure import Figure

from shipnet import style
from shipnet.asi import Transaction
from shipnet.asi.master import Master
from shipnet.asi.plan import Plan
from shipnet.asi.simulation import simulate
from shipnet.asi.slave import Slave
from shipnet.asi.telegram import plot_telegram
from shipnet.asi.topologies import line
from shipnet.errors import ArgumentError, LengthError
from shipnet.line.network import CableRun
from shipnet.style import LIMIT
from tests.asi.lines import simulate_drawn


@pytest.fixture
def ax():
    with mpl.rc_context():
        style.use()
        yield Figure(figsize=(9, 2.4)).subplots()


def texts(ax):
    return [text.get_text() for text in ax.texts]


def test_a_faulty_frame_can_be_drawn(ax):
    Transaction().plot("00101010111011", "0011001", ax)
    assert "".join(text for text in texts(ax) if text in "01") == "001010101110110011001"


def test_a_telegram_of_another_length_is_refused(ax):
    with pytest.raises(LengthError, match="14 or 7 bits"):
        plot_telegram("0101", ax=ax)


def points(ax, label):
    found = [drawn for drawn in ax.lines if drawn.get_label() == label]
    return [] if not found else list(zip(*found[0].get_data(), strict=True))


def legend(ax):
    return [text.get_text() for text in ax.get_legend().get_texts()]


def test_slaves_are_drawn_at_their_distance_in_the_colour_of_their_verdict(ax):
    plan = line(100, 62)
    findings = plan.check()
    assert findings.plot(ax=ax) is ax
    low = findings.violated().query("rule == 'slave_voltage'")
    assert len(points(ax, "slave, rule violated")) == len(low) > 0
    assert len(points(ax, "slave, rules met")) == 62 - len(low)
    assert max(x for x, _ in points(ax, "slave, rules met")) < min(
        x for x, _ in points(ax, "slave, rule violated")
    )
    assert legend(ax) == ["supply", "master", "slave, rules met", "slave, rule violated"]
    assert not ax.texts


def test_many_slaves_at_few_nodes_are_counted_by_node(ax):
    places = {"bow": range(1, 8), "$x$": range(8, 14)}
    plan = Plan(
        [CableRun("head", node, 20.0) for node in places],
        masters=[Master(node="head")],
        slaves=[Slave(f"{k}", node=node) for node, some in places.items() for k in some],
    )
    plan.plot(ax=ax)
    assert [text.get_text() for text in ax.texts] == ["bow (7)", r"\$x\$ (6)"]
    assert legend(ax) == ["master", "slave"]


def test_a_segment_that_violates_a_rule_is_red(ax):
    plan = line(60, [20]).with_repeater("60 m", line(110, [110]))
    plan.check().plot(ax=ax)
    drawn = [one for one in ax.lines if len(one.get_xdata())]
    red = [one for one in drawn if same_color(one.get_color(), LIMIT["color"])]
    assert [max(one.get_xdata()) for one in red] == [170]
    assert points(ax, "repeater")[0][0] == 60
    assert [text.get_text() for text in ax.texts] == ["segment 1", "segment 2", "1", "2"]


def traffic():
    drawn = np.zeros((4, 3, 2, 2), dtype=np.uint8)
    drawn[1, 0, 1, 0] = 1
    drawn[2, 0, 1, 0] = 5 << 2
    return simulate_drawn(drawn, [Slave("1", "S-7.F.F"), Slave("2", "S-7.F.F")], cycles=4)


def requests_in(ax):
    return [patch for patch in ax.patches if patch.get_y() == -0.4]


def test_of_many_requests_those_around_the_first_fault_are_drawn(ax):
    drawn = np.zeros((300, 3, 2, 2), dtype=np.uint8)
    drawn[[200, 250], 0, 1, 0] = 1
    run = simulate_drawn(drawn, [Slave("1"), Slave("2")], cycles=300)
    run.plot(ax=ax)
    events = run.events()
    fault = events.query("phase == 'data_exchange' and outcome != 'ok'").index[0]
    assert len(requests_in(ax)) == 40
    assert requests_in(ax)[20].get_x() == pytest.approx(1e3 * events["time_s"][fault])
    said = f"requests {fault - 19} to {fault + 20} of {len(events)}, around the first fault"
    assert ax.get_title("left") == said


@pytest.mark.parametrize("cycles", [60, 300])
def test_of_many_requests_without_a_fault_the_longest_wait_is_drawn(ax, cycles):
    run = simulate([Slave("1"), Slave("2")], cycles=cycles)
    run.plot(ax=ax)
    many = len(run.events()) > 500
    assert many == (cycles == 300)
    assert len(requests_in(ax)) == (40 if many else len(run.events()))
    assert ax.get_title("left").endswith("around the longest wait of a slave" if many else "")


def test_a_figure_of_nothing_is_refused(ax):
    with pytest.raises(ArgumentError, match="select no request"):
        traffic().plot(start=1.0, ax=ax)


def test_a_change_of_inputs_is_a_dot_with_an_arrow_to_when_it_is_known(ax):
    changes = [(0.3005, "3", 1), (0.3012, "1", 1), (0.32, "2", 1)]
    five = [Slave(f"{address}") for address in range(1, 6)]
    run = simulate(five, until=0.303, inputs=changes[:2])
    run.plot("phase == 'data_exchange'", start=0.3, stop=0.3029, ax=ax)
    dots = [line.get_xydata()[0].tolist() for line in ax.lines if line.get_marker() == "o"]
    assert dots == [[pytest.approx(300.5), 3], [pytest.approx(301.2), 1]]
    known = 1e3 * (run.input_changes()["time_s"] + run.input_changes()["response_time_s"])
    arrows = [text.xy for text in ax.texts if text.arrow_patch]
    assert [x for x, _ in arrows] == pytest.approx(known.tolist())
    # Each arrow ends where a response ends.
    ends = [box.get_x() + box.get_width() for box in ax.patches if box.get_y() > 0]
    for x, _ in arrows:
        assert min(abs(np.array(ends) - x)) < 0.01
