import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.figure import Figure

from shipnet import style
from shipnet.asi.simulation import simulate
from shipnet.asi.slave import Slave
from shipnet.errors import ArgumentError
from tests.asi.lines import simulate_drawn


@pytest.fixture
def ax():
    with mpl.rc_context():
        style.use()
        yield Figure(figsize=(9, 2.4)).subplots()


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
