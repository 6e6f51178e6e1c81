import matplotlib as mpl
import pytest
from matplotlib.colors import same_color
from matplotlib.figure import Figure

from shipnet.asi.topologies import line
from shipnet.style import LIMIT


@pytest.fixture
def ax():
    with mpl.rc_context():
        yield Figure().subplots()


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
    assert len(points(ax, "slave, failed")) == len(low) > 0
    assert len(points(ax, "slave, passed")) == 62 - len(low)
    assert max(x for x, _ in points(ax, "slave, passed")) < min(
        x for x, _ in points(ax, "slave, failed")
    )
    assert legend(ax) == ["supply", "master", "slave, passed", "slave, failed"]
    assert not ax.texts


def test_a_segment_that_violates_a_rule_is_red(ax):
    plan = line(60, [20]).with_repeater("60 m", line(110, [110]))
    plan.check().plot(ax=ax)
    drawn = [one for one in ax.lines if len(one.get_xdata())]
    red = [one for one in drawn if same_color(one.get_color(), LIMIT["color"])]
    assert [max(one.get_xdata()) for one in red] == [170]
    assert points(ax, "repeater")[0][0] == 60
    assert [text.get_text() for text in ax.texts] == ["1", "2"]
