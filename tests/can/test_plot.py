import matplotlib as mpl
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_hex
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


def in_order(artists, place):
    """Sort by rows from the top, then from left to right."""
    return sorted(artists, key=lambda artist: (-round(place(artist)[1] / 3.6), place(artist)[0]))


@pytest.mark.parametrize("frame", FRAMES, ids=str)
def test_the_drawing_has_the_bits_stuff_bits_and_levels_of_the_frame(ax, frame):
    assert frame.plot(ax) is ax
    bits = [text for text in ax.texts if text.get_fontfamily() == ["monospace"]]
    assert "".join(text.get_text() for text in in_order(bits, lambda t: t.get_position())) == (
        frame.bits
    )
    cells = [patch for patch in ax.patches if patch.get_linewidth() == 0.4]
    cells = in_order(cells, lambda patch: patch.get_xy())
    hatched = [place for place, cell in enumerate(cells) if cell.get_hatch()]
    assert tuple(hatched) == frame.stuff_positions
    levels = "".join(
        "01"[int(level + row * 3.6 > 1.5)]
        for row, line in enumerate(ax.lines)
        for level in line.get_ydata()[:-1]
    )
    assert levels == frame.bits


def test_every_field_has_its_name_and_colour(ax, monkeypatch):
    frame = FRAMES[2]
    monkeypatch.setattr("shipnet.can.plot._BITS_PER_ROW", 160)
    frame.plot(ax)
    texts = {text.get_text() for text in ax.texts}
    assert {"base identifier", "RTR", "DLC", "data", "CRC sequence", "ACK del.", "EOF"} <= texts
    cells = [patch for patch in ax.patches if patch.get_linewidth() == 0.4]
    for field, colour in [("data", "information"), ("DLC", "control"), ("CRC sequence", "parity")]:
        (start,) = (own.line_start for own in frame.fields if own.name == field)
        assert to_hex(cells[start].get_facecolor()) == style.FIELD[colour]
    widths = [patch.get_width() for patch in ax.patches if patch.get_linewidth() == 1.0]
    assert widths == [field.line_length for field in frame.fields]


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
