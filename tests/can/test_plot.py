import matplotlib as mpl
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from shipnet import style
from shipnet.can.frame import Frame
from tests.can.frames import LONGEST

FRAMES = [
    LONGEST[-1],
    Frame(0x1ABCDEF5, bytes(range(1, 9)), True),
    Frame(0x123, bytes.fromhex("00000000DEADBEEF")),
    Frame(0x14, remote=True),
]


@pytest.fixture
def ax():
    with mpl.rc_context():
        style.use()
        figure = Figure(figsize=(6.4, 4.6))
        FigureCanvasAgg(figure)
        yield figure.subplots()


@pytest.mark.parametrize("frame", FRAMES, ids=str)
def test_no_name_covers_another_or_a_level_line(ax, frame):
    frame.plot(ax)
    ax.figure.draw_without_rendering()
    renderer = ax.figure.canvas.get_renderer()
    boxes = [(text.get_text(), text.get_window_extent(renderer)) for text in ax.texts]
    for place, (name, box) in enumerate(boxes):
        for other, near in boxes[place + 1 :]:
            assert not box.overlaps(near), f"{name} covers {other}"
    lines = [line.get_window_extent(renderer) for line in ax.lines]
    for name, box in boxes:
        assert not any(box.overlaps(line) for line in lines), f"{name} covers a level"
