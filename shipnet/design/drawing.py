"""The single-line drawing of a design: cabinet, boxes and stations on their trunks, as SVG."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from html import escape

from shipnet.design.layout import Layout
from shipnet.lazy import pd

#: Colours of segments, after those of Okabe and Ito, which colour-blind readers can distinguish.
_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#8A6D00", "#56B4E9", "#444444")

#: Sheet, which prints well on A4: width, columns, rows per column, row height, top margin [px].
_WIDTH, _COLUMNS, _ROWS, _ROW, _TOP = 760, 2, 74, 13, 40

#: Distance between lanes, and offsets of length, name and text from the symbol of a row [px].
_LANE, _LENGTH, _NAME, _WORDS = 10, 42, 52, 150

_LEGEND = "■ cabinet, □ box, station or module, ◇ repeater; length of the cable to each device"

#: Maximum number of characters of a name, and of the text after it.
_LONG_NAME, _LONG_WORDS = 19, 36


@dataclass
class _Row:
    """A row of the drawing: the text of the row, and the lanes that run past it."""

    name: str
    words: str = ""
    length: str = ""
    kind: str = "device"
    lane: int = 0
    colour: str = _COLOURS[-1]
    #: Lanes that pass the row, end at it, and begin at it; lane from which it branches, or -1.
    through: set[int] = field(default_factory=set)
    above: set[int] = field(default_factory=set)
    below: set[int] = field(default_factory=set)
    branch: int = -1


@dataclass
class _Node:
    """A device with the devices downstream of it."""

    row: _Row
    children: list[_Node] = field(default_factory=list)

    @property
    def size(self) -> int:
        """Number of devices in this branch."""
        devices = [self]
        for node in devices:
            devices += node.children
        return len(devices)


def single_line(design: Layout) -> str:
    """Return the drawing of a design as one SVG, with the sheets one below another."""
    y, parts = 0, []
    for sheet, height in sheets(design):
        parts.append(sheet.replace("<svg ", f'<svg y="{y}" ', 1))
        y += height
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{_WIDTH}" height="{y}" '
        f'viewBox="0 0 {_WIDTH} {y}">'
    )
    return "\n".join([head, *parts, "</svg>\n"])


def sheets(design: Layout) -> list[tuple[str, int]]:
    """Return the sheets of a design's drawing, each as an SVG with its height [px]."""
    rows = list(_rows(design))
    most = _COLUMNS * _ROWS
    pages = [rows[start : start + most] for start in range(0, len(rows), most)] or [[]]
    x, y, z = (f"{value:g}" for value in design.site.cabinet)
    made = []
    for number, page in enumerate(pages, 1):
        tall = -(-len(page) // _COLUMNS)
        height = _TOP + _ROW * tall + 8
        of = f", sheet {number} of {len(pages)}" if len(pages) > 1 else ""
        title = f"{design.name}: single-line drawing{of}. Cabinet at {x}, {y}, {z} m"
        parts = [
            f'<svg xmlns="http://www.w3.org/2000/svg" width="{_WIDTH}" height="{height}" '
            f'viewBox="0 0 {_WIDTH} {height}" font-family="Liberation Sans, Arial, sans-serif" '
            f'font-size="9" fill="#1d2733"><title>{escape(title)}</title>',
            f'<rect width="{_WIDTH}" height="{height}" fill="#fff"/>',
            f'<text x="6" y="14" font-size="12" font-weight="bold">{escape(title)}</text>',
            f'<text x="6" y="28" fill="#5a6673">{_LEGEND}</text>',
        ]
        for place, row in enumerate(page):
            column, line = divmod(place, tall)
            parts += _drawn(row, 6 + column * _WIDTH // _COLUMNS, _TOP + line * _ROW)
        made.append(("\n".join([*parts, "</svg>"]), height))
    return made


def _drawn(row: _Row, left: float, top: float) -> Iterator[str]:
    """Yield the lanes, symbol and text of a row as SVG."""
    middle, bottom = top + _ROW / 2, top + _ROW
    stroke = f'stroke="{row.colour}" stroke-width="2" fill="none"'

    def x(lane: int) -> float:
        return left + 6 + lane * _LANE

    ways = [f"M{x(lane):g} {top:g}V{bottom:g}" for lane in sorted(row.through)]
    ways += [f"M{x(lane):g} {top:g}V{middle:g}" for lane in sorted(row.above)]
    ways += [f"M{x(lane):g} {middle:g}V{bottom:g}" for lane in sorted(row.below)]
    if row.branch >= 0:
        ways.append(f"M{x(row.branch):g} {middle:g}H{x(row.lane):g}")
    if ways:
        yield f'<path d="{"".join(ways)}" {stroke}/>'
    at = x(row.lane)
    if row.kind == "title":
        yield _text(left, middle + 3, row.name, f'font-weight="bold" fill="{row.colour}"', 76)
        return
    if row.kind == "repeater":
        shape = f'<path d="M{at - 5:g} {middle:g}l5 -5l5 5l-5 5z"'
    else:
        shape = f'<rect x="{at - 4:g}" y="{middle - 4:g}" width="8" height="8"'
    filled = row.colour if row.kind == "cabinet" else "#fff"
    yield f'{shape} fill="{filled}" stroke="{row.colour}" stroke-width="1.5"/>'
    start = at + 4
    if row.length:
        yield _text(start + _LENGTH, middle + 3, row.length, 'text-anchor="end" fill="#5a6673"')
    yield _text(start + _NAME, middle + 3, row.name, "", _LONG_NAME)
    room = _LONG_WORDS - 2 * row.lane
    yield _text(start + _WORDS, middle + 3, row.words, 'fill="#5a6673"', room)


def _text(x: float, y: float, words: str, style: str = "", most: int = 200) -> str:
    shown = words if len(words) <= most else f"{words[: most - 1]}\N{HORIZONTAL ELLIPSIS}"
    return f'<text x="{x:g}" y="{y:g}" {style}>{escape(shown)}</text>' if shown else ""


def _rows(design: Layout) -> Iterator[_Row]:
    """Yield the rows of the drawing: the hardwired points, then each segment."""
    counts = _counts(design)
    hardwired = _hardwired(design, counts)
    blocks = [("hardwired", _COLOURS[-1], hardwired)] if hardwired.children else []
    runs = design.cables[design.cables["kind"] == "trunk"]
    feeders = design.cables[design.cables["kind"] == "feeder"]
    fed = dict(zip(feeders["a"], feeders["b"], strict=True))
    # A supply without a housing is drawn beside the device that it feeds.
    at = design.devices["at"]
    housed = at.where(at != "", design.devices["device"].map(fed))
    placed = design.devices.assign(at=housed.fillna(""))
    devices, trunks = (
        {name: table.iloc[rows] for name, rows in table.groupby("segment").indices.items()}
        for table in (placed, runs)
    )
    for number, segment in enumerate(design.segments.itertuples()):
        colour = _COLOURS[number % len(_COLOURS)]
        trunk = trunks.get(segment.segment, runs[:0])
        lines = " on each of two lines" if (trunk["line"] == "B").any() else ""
        said = (
            f"{segment.segment}: {segment.points} points, {segment.length_m:.0f} m of "
            f"{', '.join(trunk['cable'].unique())}{lines}"
        )
        own = devices.get(segment.segment, placed[:0])
        root = _tree(str(segment.segment), own, trunk[trunk["line"] != "B"], counts)
        blocks.append((said, colour, root))
    for said, colour, root in blocks:
        title, end = _Row(said, kind="title"), _Row("", kind="title")
        for row in (title, *_laid(root, star=root is hardwired), end):
            row.colour = colour
            yield row


def _counts(design: Layout) -> dict[str, str]:
    """Return, for each device, the number of its points by type and their systems, in words."""
    said = {}
    for device, own in design.iolist.points.groupby(design.points["device"]):
        kinds = " ".join(f"{n} {kind}" for kind, n in sorted(Counter(own["type"]).items()))
        names = [name for name in own["system"].unique() if name]
        if len(names) > 2:
            names = [f"{len(names)} systems"]
        said[str(device)] = ", ".join([kinds, *names])
    return said


def _hardwired(design: Layout, counts: dict[str, str]) -> _Node:
    """Return the cabinet with the boxes, and the home runs of each system."""
    root = _Node(_Row(design.cabinet, kind="cabinet"))
    runs, devices = design.cables, design.devices
    trunks = runs[(runs["kind"] == "trunk") & (runs["segment"] == "")]
    for box in devices.loc[devices["kind"] == "box", "device"]:
        own = trunks[trunks["b"] == box]
        words = f"{' + '.join(own['cable'])}, {counts.get(box, '')}"
        root.children.append(_Node(_Row(box, words, f"{own['length_m'].max():.0f} m")))
    home = runs[runs["kind"] == "home run"]
    system = dict(zip(design.points["tag"], design.iolist.points["system"], strict=True))
    for name, own in home.groupby([system[tag] for tag in home["b"]], sort=False):
        metres = own["length_m"]
        words = f"{len(own)} home runs of {metres.min():.0f} to {metres.max():.0f} m"
        row = _Row(str(name) or "no system", words, f"{metres.sum() / 1e3:.3g} km")
        root.children.append(_Node(row))
    return root


def _tree(
    segment: str, devices: pd.DataFrame, trunk: pd.DataFrame, counts: dict[str, str]
) -> _Node:
    """Return the first master of a segment with the devices on its trunk."""
    inside: dict[str, list[str]] = defaultdict(list)
    nodes: dict[str, _Node] = {}
    root = _Node(_Row("nothing", kind="cabinet"))
    for row in devices.itertuples():
        name, kind, at = str(row.device), str(row.kind), str(row.at)
        if kind in ("supply", "auxiliary supply", "terminator"):
            inside[at].append(kind)
            continue
        said = name.removeprefix(f"{segment} ")
        node = nodes[name] = _Node(_Row(said, counts.get(name, ""), kind=kind))
        if kind == "master" and root.row.name == "nothing":
            root, node.row.kind = node, "cabinet"
    children = dict[str, str]()
    for run in trunk.itertuples():
        a, b = str(run.a), str(run.b)
        nodes[b].row.length = f"{run.length_m:.0f} m"
        if children.setdefault(b, a) == a:
            nodes.get(a, root).children.append(nodes[b])
    # A repeater in a housing is drawn below the device there; in the cabinet, below the master.
    for own in devices[devices["kind"] == "repeater"].itertuples():
        if str(own.device) not in children and not str(own.device).endswith(" B"):
            nodes.get(str(own.at), root).children.append(nodes[str(own.device)])
    for name, kinds in inside.items():
        drawn = nodes.get(name, root).row
        drawn.words = f"+ {' + '.join(dict.fromkeys(kinds))} {drawn.words}"
    return root


def _laid(root: _Node, *, star: bool) -> Sequence[_Row]:
    """Return the rows of a tree; except in a star, a device's largest branch stays in its lane."""
    rows: list[_Row] = []
    last: dict[int, tuple[int, int]] = {}
    # The devices still to draw, each with its parent's row and lane, and its own lane.
    waiting: list[tuple[_Node, int, int, int]] = [(root, -1, -1, 0)]
    while waiting:
        node, parent, lane, own = waiting.pop()
        here = len(rows)
        row, row.lane = node.row, own
        rows.append(row)
        if parent >= 0:
            last[parent] = here, lane
            row.above.add(lane)
            row.branch = lane if own != lane else -1
        if star:
            waiting += [(child, here, own, own + 1) for child in reversed(node.children)]
        else:
            ordered = sorted(node.children, key=lambda child: -child.size)
            waiting += [(child, here, own, own + (n > 0)) for n, child in enumerate(ordered)]
    for parent, (end, lane) in last.items():
        rows[parent].below.add(lane)
        for row in rows[parent + 1 : end]:
            row.through.add(lane)
    return rows
