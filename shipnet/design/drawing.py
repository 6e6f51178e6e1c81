"""The single-line drawing of a design: cabinet, boxes and stations on their trunks, as SVG."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from html import escape
from math import nan
from typing import Any, TypeAlias

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
        for index, row in enumerate(page):
            column, line = divmod(index, tall)
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


#: A device: name, kind, and the device whose housing contains it. A trunk: its ends, the key of
#: its cable, its line, and its length [m].
_Device: TypeAlias = "tuple[str, str, str]"
_Trunk: TypeAlias = "tuple[str, str, str, str, float]"


def _rows(design: Layout) -> Iterator[_Row]:
    """Yield the rows of the drawing: the hardwired points, then each segment."""
    devices, trunks = defaultdict[str, list[_Device]](list), defaultdict[str, list[_Trunk]](list)
    feeders = design.cables[design.cables["kind"] == "feeder"]
    fed = dict(zip(feeders["a"].tolist(), feeders["b"].tolist(), strict=True))
    # Of a doubled segment, only line A is drawn.
    first = design.devices[design.devices["line"] != "B"]
    for segment, name, kind, at in values(first, "segment", "device", "kind", "at"):
        # A supply without a housing is drawn beside the device that it feeds.
        devices[segment].append((name, kind, at or fed.get(name, "")))
    laid = design.cables[design.cables["kind"] == "trunk"]
    columns = "a", "b", "cable", "line", "length_m"
    for segment, trunk in zip(laid["segment"].tolist(), values(laid, *columns), strict=True):
        trunks[segment].append(trunk)
    counts = _counts(design)
    hardwired = _hardwired(design, devices[""], trunks[""], counts)
    blocks = [("hardwired", _COLOURS[-1], hardwired)] if hardwired.children else []
    for number, (segment, points, length) in enumerate(
        values(design.segments, "segment", "points", "length_m")
    ):
        colour, runs = _COLOURS[number % len(_COLOURS)], trunks[segment]
        single = [run for run in runs if run[3] != "B"]
        words = (
            f"{segment}: {points} points, {length:.0f} m of "
            f"{', '.join(dict.fromkeys(cable for _, _, cable, *_ in runs))}"
            f"{' on each of two lines' if len(single) < len(runs) else ''}"
        )
        blocks.append((words, colour, _tree(segment, devices[segment], single, counts)))
    for words, colour, root in blocks:
        title, end = _Row(words, kind="title"), _Row("", kind="title")
        for row in (title, *_laid(root, star=root is hardwired), end):
            row.colour = colour
            yield row


def values(table: pd.DataFrame, *columns: str) -> Iterator[tuple[Any, ...]]:
    """Yield some values of each row as Python objects."""
    return zip(*(table[column].tolist() for column in columns), strict=True)


def _counts(design: Layout) -> dict[str, str]:
    """Return, for each device, the number of its points by type and their systems, in words."""
    types, systems = defaultdict[str, list[str]](list), defaultdict[str, list[str]](list)
    listed = values(design.iolist.points, "type", "system")
    for device, (kind, system) in zip(design.points["device"].tolist(), listed, strict=True):
        types[device].append(kind)
        systems[device].append(system)
    words = {}
    for device, kinds in types.items():
        names = [name for name in dict.fromkeys(systems[device]) if name]
        if len(names) > 2:
            names = [f"{len(names)} systems"]
        counted = " ".join(f"{n} {kind}" for kind, n in sorted(Counter(kinds).items()))
        words[device] = ", ".join([counted, *names])
    return words


def _hardwired(
    design: Layout, devices: Sequence[_Device], trunks: Sequence[_Trunk], counts: dict[str, str]
) -> _Node:
    """Return the cabinet with the boxes, and the home runs of each system."""
    root = _Node(_Row(design.cabinet, kind="cabinet"))
    cables, lengths = defaultdict[str, list[str]](list), defaultdict[str, list[float]](list)
    for _, box, cable, _, length in trunks:
        cables[box].append(cable)
        lengths[box].append(length)
    for box in (name for name, kind, _ in devices if kind == "box"):
        words = f"{' + '.join(cables[box])}, {counts.get(box, '')}"
        root.children.append(_Node(_Row(box, words, f"{max(lengths[box], default=nan):.0f} m")))
    home = design.cables[design.cables["kind"] == "home run"]
    system = dict(zip(design.points["tag"], design.iolist.points["system"], strict=True))
    runs = defaultdict[str, list[float]](list)
    for tag, length in values(home, "b", "length_m"):
        runs[system[tag]].append(length)
    for name, metres in runs.items():
        words = f"{len(metres)} home runs of {min(metres):.0f} to {max(metres):.0f} m"
        row = _Row(name or "no system", words, f"{sum(metres) / 1e3:.3g} km")
        root.children.append(_Node(row))
    return root


def _tree(
    segment: str, devices: Sequence[_Device], trunk: Sequence[_Trunk], counts: dict[str, str]
) -> _Node:
    """Return the first master of a segment with the devices on its trunk."""
    inside: dict[str, list[str]] = defaultdict(list)
    nodes: dict[str, _Node] = {}
    root = _Node(_Row("nothing", kind="cabinet"))
    for name, kind, at in devices:
        if kind in ("supply", "auxiliary supply", "terminator"):
            inside[at].append(kind)
            continue
        short = name.removeprefix(f"{segment} ")
        node = nodes[name] = _Node(_Row(short, counts.get(name, ""), kind=kind))
        if kind == "master" and root.row.name == "nothing":
            root, node.row.kind = node, "cabinet"
    children = dict[str, str]()
    for a, b, _, _, length in trunk:
        nodes[b].row.length = f"{length:.0f} m"
        if children.setdefault(b, a) == a:
            nodes.get(a, root).children.append(nodes[b])
    # A repeater in a housing is drawn below the device there; in the cabinet, below the master.
    for name, kind, at in devices:
        if kind == "repeater" and name not in children:
            nodes.get(at, root).children.append(nodes[name])
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
        node, parent, lane, at = waiting.pop()
        here = len(rows)
        row, row.lane = node.row, at
        rows.append(row)
        if parent >= 0:
            last[parent] = here, lane
            row.above.add(lane)
            row.branch = lane if at != lane else -1
        if star:
            waiting += [(child, here, at, at + 1) for child in reversed(node.children)]
        else:
            ordered = sorted(node.children, key=lambda child: -child.size)
            waiting += [(child, here, at, at + min(n, 1)) for n, child in enumerate(ordered)]
    for parent, (end, lane) in last.items():
        rows[parent].below.add(lane)
        for row in rows[parent + 1 : end]:
            row.through.add(lane)
    return rows
