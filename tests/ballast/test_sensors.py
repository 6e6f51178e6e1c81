import numpy as np
import pytest

from shipnet.ballast.diagnosis import Recorder
from shipnet.ballast.plant import Command, Plant
from shipnet.ballast.scan import System
from shipnet.ballast.sensors import WINDOW, position_speed
from shipnet.ballast.simulation import simulate


@pytest.mark.parametrize("step", [0.1, 0.25, 0.3, 0.4, 1.0])
def test_simulation_and_recorder_have_the_same_speed_at_any_step(step):
    plant = Plant(System(step=step))
    recorder = Recorder(plant)
    plant.order(Command("open"))
    while plant.time <= 10:
        recorder.take()
        plant.advance()
    ours = recorder.run.DVPos[:, 0]
    theirs = simulate(System(step=step), [Command("open")], until=10).DVPos[:, 0]
    np.testing.assert_allclose(ours[: theirs.size], theirs[: ours.size])
    # The first valid speed is that of the first instant at least a second after the start.
    assert np.flatnonzero(np.isfinite(theirs))[0] == np.ceil(WINDOW / step - 1e-6)
    assert theirs[np.isfinite(theirs)] == pytest.approx(11.11, abs=0.1)


def test_the_speed_at_uneven_instants_is_divided_by_the_elapsed_time():
    time = np.array([0.0, 0.9, 1.0, 4.0])
    position = np.array([[0.0], [1.0], [3.0], [9.0]])
    assert position_speed(time, position)[:, 0].tolist() == pytest.approx(
        [np.nan, np.nan, 3.0, 2.0], nan_ok=True
    )
    assert position_speed(time[:0], position[:0]).shape == (0, 1)
