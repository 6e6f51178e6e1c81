import pytest
from matplotlib.figure import Figure

from shipnet.errors import ArgumentError
from shipnet.tools._page import draw_steps, stepper


def test_the_stepper_goes_through_its_frames_and_stops_at_both_ends():
    drawn = []
    view = stepper(lambda k, ax: drawn.append(k), ["first", "second", "third"])
    controls, caption, image = view.children
    back, slider, on = controls.children
    assert (caption.value, back.disabled, on.disabled) == ("first", True, False)
    on.click()
    on.click()
    assert (caption.value, back.disabled, on.disabled) == ("third", False, True)
    back.click()
    assert (slider.value, caption.value) == (1, "second")
    assert image.value[1:4] == b"PNG"


def test_a_frame_is_drawn_once_and_only_when_looked_at():
    drawn = []
    controls, _, _ = stepper(lambda k, ax: drawn.append(k), list("abcd")).children
    _, slider, _ = controls.children
    slider.value = 3
    slider.value = 0
    assert drawn == [0, 3]


def test_a_single_frame_has_nowhere_to_go():
    controls, _, _ = stepper(lambda k, ax: None, ["only"]).children
    back, _, on = controls.children
    assert (back.disabled, on.disabled) == (True, True)


def test_faults_are_named():
    with pytest.raises(ArgumentError, match="number of captions is 0"):
        stepper(lambda k, ax: None, [])
    with pytest.raises(ArgumentError, match="there are 1 axes for 2 steps"):
        draw_steps(lambda k, ax: None, [0, 1], [Figure().subplots()])
