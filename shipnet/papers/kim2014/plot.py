"""Figures of kim2014 that are outlines: hydraulics, actuator, frames, flow charts, test bed.

None of the printed figures was available; these are drawn from the text and from our encoders.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import FancyArrowPatch, Rectangle

from shipnet import style
from shipnet.ballast.diagnosis import Run
from shipnet.fuzzy.rules import RuleBase
from shipnet.modbus.adu import decode
from shipnet.modbus.uart import SerialLine
from shipnet.papers.kim2014.faults import Picture
from shipnet.papers.kim2014.line import scan_table
from shipnet.papers.kim2014.outlines import (
    ACTUATOR,
    ACTUATOR_WAYS,
    ALGORITHM,
    ALGORITHM_WAYS,
    CENTRAL,
    COMMAND,
    COMMAND_WAYS,
    MASTER,
    MODES,
    MODES_WAYS,
    TESTBED,
    TESTBED_WAYS,
    Blocks,
    Ways,
)
from shipnet.style import LIMIT

__all__ = [
    "plot_actuator",
    "plot_algorithm",
    "plot_command",
    "plot_hydraulics",
    "plot_modes",
    "plot_rtu_frame",
    "plot_scan_times",
    "plot_tcp_frame",
    "plot_testbed",
]

#: Fill of a block by its kind; light enough to write on.
_FILL = {
    "": "white", "control": style.FIELD["address"], "oil": style.FIELD["information"],
    "valve": style.FIELD["parity"], "ask": style.FIELD["control"],
}  # fmt: skip

#: Half the width and height of a block.
_HALF = (0.82, 0.33)


def plot_hydraulics(n_valves: int = 4, *, axes: Sequence[Axes]) -> None:
    """Draw central hydraulics beside valves with pumps of their own: Fig 1 and its counterpart."""
    where = np.linspace(-0.8, 2.8, n_valves)
    low = 0.35
    for ax, blocks in zip(axes, (CENTRAL, MASTER), strict=True):
        central = blocks is CENTRAL
        for place, x in enumerate(where):
            _valve(ax, (x, low), "" if central else "motor, pump,\ncontroller")
            if central:
                # A pipe to open and a pipe to close, to every valve.
                for shift in (-0.07, 0.07):
                    ax.plot(
                        [1 + shift + (x - 1) * 0.25, x + shift], [1.67, low + 0.35],
                        color="#b8860b", lw=1.6, zorder=0, label="_pipe",
                    )  # fmt: skip
            else:
                ax.plot([x - 0.1] * 2, [low + 1, 1.5], color="C0", lw=1.2, label="_bus")
                ax.plot([x + 0.1] * 2, [low + 1, 1.65], color="C1", lw=1.2, label="_power")
            ax.text(x, low - 0.32, f"valve {place + 1}", ha="center", va="top", fontsize=8)
        if central:
            _diagram(ax, blocks, [("console", "station", "")])
        else:
            left, right = where[0] - 0.35, where[-1] + 0.35
            ax.plot(
                [0.18, left, left, right, right, 1.82], [3, 3, 1.5, 1.5, 3, 3], color="C0", lw=1.2
            )
            ax.plot([where[0] + 0.1, where[-1] + 0.1], [1.65, 1.65], color="C1", lw=1.2)
            ax.plot([1, 1], [1.65, 1.82], color="C1", lw=1.2)
            ax.text(left + 0.08, 2.55, "closed loop\nof Modbus", fontsize=8, color="C0")
            _diagram(ax, blocks, [])
        style.bare(ax, (-1.4, 3.5), (-0.25, 3.5))
    axes[0].set_title("central: pipes to every valve", loc="left")
    axes[1].set_title("distributed: a pump in every valve", loc="left")


def plot_actuator(*, ax: Axes) -> Axes:
    """Draw the parts of an actuator and what measures them: Fig 2."""
    blocks = _spread(ACTUATOR)
    _diagram(ax, blocks, ACTUATOR_WAYS)
    sensors = [blocks[name] for name in ("MC", "OT", "OP", "VPos")]
    for _, _, x, y in sensors:
        ax.plot([x, x], [y - _HALF[1], 0.35], color="0.45", lw=1)
    _, _, x, y = blocks["ADC"]
    ax.plot([sensors[-1][2], x], [0.35, 0.35], color="0.45", lw=1)
    _arrow(ax, (x, 0.35), (x, y - _HALF[1]))
    left, top = x - _HALF[0] - 0.2, blocks["bus"][3]
    ax.plot([x - _HALF[0], left, left], [y, y, top], color="0.3", lw=1)
    _arrow(ax, (left, top), (x - _HALF[0], top))
    return style.bare(ax, (-1.1, 8.9), (0.2, 3.45))


def plot_rtu_frame(frame: bytes, serial: SerialLine, *, ax: Axes) -> Axes:
    """Draw an RTU frame field by field, the general one above it: Figs 3 and 4."""
    pdu = decode(frame).pdu
    silence = f"{serial.t35 / serial.character_time:.3g} char\nsilence"
    general = [
        ("address", "address", ""), ("function code", "control", ""),
        ("data", "information", ""), ("error check", "parity", ""),
    ]  # fmt: skip
    detail = [
        (silence, "pause", ""), ("address\n1 byte", "address", frame[:1].hex(" ")),
        ("function code\n1 byte", "control", pdu[:1].hex()),
        (f"data\n{len(pdu) - 1} bytes", "information", pdu[1:].hex(" ")),
        ("CRC\n2 bytes", "parity", frame[-2:].hex(" ")), (silence, "pause", ""),
    ]  # fmt: skip
    return _fields(ax, {"Fig 3": general, "Fig 4": detail})


def plot_tcp_frame(frame: bytes, *, ax: Axes) -> Axes:
    """Draw a frame of Modbus TCP, header and PDU above its fields: Figs 5 and 6."""
    pdu = decode(frame, "tcp").pdu
    general = [
        ("MBAP header, 7 bytes", "address", frame[:7].hex(" ")),
        (f"PDU, {len(pdu)} bytes", "information", pdu.hex(" ")),
    ]
    detail = [
        (f"{name}\n{last - first} byte{'s' * (last - first > 1)}", kind, frame[first:last].hex(" "))
        for name, first, last, kind in (
            ("transaction id", 0, 2, "address"), ("protocol id", 2, 4, "address"),
            ("length", 4, 6, "address"), ("unit id", 6, 7, "address"),
            ("function code", 7, 8, "control"), ("data", 8, len(frame), "information"),
        )
    ]  # fmt: skip
    return _fields(ax, {"Fig 5": general, "Fig 6": detail})


def plot_scan_times(slaves: Sequence[int], *, ax: Axes) -> Axes:
    """Draw the time of a scan over the bit rate, one line a number of slaves."""
    for number in slaves:
        table = scan_table(number)
        ax.loglog(table.index, table["scan_s"], "o-", markersize=4, label=f"{number} slaves")
    ax.set_xticks(table.index, [f"{rate / 1e3:g}" for rate in table.index])
    ax.set(xlabel="bit rate [kbit/s]", ylabel="scan [s]")
    ax.minorticks_off()
    ax.set_yticks([0.03, 0.1, 0.3, 1, 3, 10, 30], ["0.03", "0.1", "0.3", "1", "3", "10", "30"])
    ax.legend()
    return ax


def plot_modes(*, ax: Axes) -> Axes:
    """Draw who moves the motor in auto and in manual mode: Fig 9."""
    _diagram(ax, _spread(MODES, 1.65), MODES_WAYS)
    return style.bare(ax, (-1.0, 9.6), (0.5, 3.5))


def plot_command(*, ax: Axes) -> Axes:
    """Draw what a slave does with a command, as printed, and when it should reply: Fig 10."""
    blocks = _spread(COMMAND, 1.65)
    _diagram(ax, blocks, COMMAND_WAYS)
    # Not there yet: round again.
    x, y = blocks["there"][2:]
    left = x - _HALF[0] - 0.35
    ax.plot([x - _HALF[0], left, left], [y, y, 2.35], color="0.3", lw=1)
    ax.plot([left, x - 0.45], [2.35, 2.35], color="0.3", lw=1)
    _arrow(ax, (x - 0.45, 2.35), (x - 0.45, 3 - _HALF[1]))
    ax.text(left - 0.05, y + 0.3, "no", ha="right", va="center", fontsize=8)
    return style.bare(ax, (-1.0, 9.6), (1.25, 3.5))


def plot_algorithm(*, ax: Axes) -> Axes:
    """Draw how a fault is found, from section 2.3 and row 9 of the rule table: Fig 7."""
    _diagram(ax, _spread(ALGORITHM, 1.65), ALGORITHM_WAYS)
    return style.bare(ax, (-1.0, 9.6), (0.5, 3.5))


def plot_testbed(*, ax: Axes) -> Axes:
    """Draw the test bed, the line closed through the second port of the master: Fig 15."""
    blocks = _spread(TESTBED)
    x, y = blocks["master"][2:]
    first, last, row = blocks["S1"][2], blocks["S5"][2], blocks["S1"][3]
    ax.plot(
        [x - 0.3, x - 0.3, first - 1.0, first - 1.0, last],
        [y - _HALF[1], 2.6, 2.6, row, row], color="C0", lw=1.5, zorder=0,
    )  # fmt: skip
    ax.plot(
        [last, last + 1.0, last + 1.0, x + 0.3, x + 0.3], [row, row, 2.6, 2.6, y - _HALF[1]],
        color="C0", lw=1.5, ls=":", zorder=0,
    )  # fmt: skip
    ax.text(first - 0.9, 2.66, "RS-485, port 1", fontsize=8, color="C0")
    ax.text(last + 0.95, 2.66, "port 2 (section 2.1)", fontsize=8, color="C0", ha="right")
    left = blocks["PC"][2] + _HALF[0]
    ax.plot([left, x - _HALF[0]], [y, y], color="C1", lw=1.5, zorder=0)
    ax.text((left + x - _HALF[0]) / 2, y + 0.06, "Ethernet, UDP port 502", ha="center", fontsize=8)
    _diagram(ax, blocks, TESTBED_WAYS)
    return style.bare(ax, (-1.1, 9.2), (0.55, 3.65))


def _spread(blocks: Blocks, step: float = 2.0) -> Blocks:
    return {name: (text, kind, step * x, y) for name, (text, kind, x, y) in blocks.items()}


def _valve(ax: Axes, place: tuple[float, float], drive: str) -> None:
    """Draw the two triangles of a valve, its drive above if it has one of its own."""
    x, y = place
    for side in (-1, 1):
        ax.fill(
            [x, x + 0.3 * side, x + 0.3 * side], [y, y - 0.2, y + 0.2],
            facecolor=_FILL["valve"], edgecolor="0.2", lw=1,
        )  # fmt: skip
    ax.plot([x, x], [y, y + 0.35], color="0.2", lw=1)
    if drive:
        ax.add_patch(
            Rectangle((x - 0.52, y + 0.35), 1.04, 0.65, facecolor=_FILL["oil"], edgecolor="0.2")
        )
        ax.text(x, y + 0.675, drive, ha="center", va="center", fontsize=7)
    else:
        ax.add_patch(
            Rectangle((x - 0.25, y + 0.2), 0.5, 0.3, facecolor=_FILL["oil"], edgecolor="0.2")
        )


def _diagram(ax: Axes, blocks: Blocks, ways: Ways) -> None:
    for first, second, word in ways:
        tail, head = (np.array(blocks[name][2:]) for name in (first, second))
        way = head - tail
        with np.errstate(divide="ignore"):
            inside = float(np.min(np.array(_HALF) / np.abs(way)))
        begin, end = tail + inside * way, head - inside * way
        _arrow(ax, begin, end)
        if word:
            x, y = (begin + end) / 2
            # Above a level way, left of any other.
            level = abs(way[1]) < 0.1
            ax.text(
                x - (0 if level else 0.2), y + (0.05 if level else 0), word, fontsize=8,
                ha="center" if level else "right", va="bottom" if level else "center",
            )  # fmt: skip
    for text, kind, x, y in blocks.values():
        corner = (x - _HALF[0], y - _HALF[1])
        ax.add_patch(
            Rectangle(
                corner, 2 * _HALF[0], 2 * _HALF[1], facecolor=_FILL[kind], edgecolor="0.2", zorder=2
            )
        )
        ax.text(x, y, text, ha="center", va="center", fontsize=8, zorder=3)


def _arrow(ax: Axes, tail: Sequence[float], head: Sequence[float]) -> None:
    ax.add_patch(
        FancyArrowPatch(
            (tail[0], tail[1]), (head[0], head[1]), arrowstyle="->", mutation_scale=10,
            color="0.3", shrinkA=0, shrinkB=0,
        )
    )  # fmt: skip


def _fields(ax: Axes, rows: Mapping[str, Sequence[tuple[str, str, str]]]) -> Axes:
    """Draw rows of fields: words, colour, bytes below."""
    widest = 0.0
    for row, (title, fields) in enumerate(rows.items()):
        x, y = 0.0, -1.6 * row
        ax.text(-1, y + 0.5, title, ha="right", va="center", fontsize=9)
        for words, kind, data in fields:
            width = max(len(line) for line in [*words.split("\n"), data]) + 3.0
            ax.add_patch(
                Rectangle(
                    (x, y), width, 1, facecolor=style.FIELD[kind], edgecolor="0.2",
                    linestyle=":" if kind == "pause" else "-",
                )
            )  # fmt: skip
            ax.text(x + width / 2, y + 0.5, words, ha="center", va="center", fontsize=8)
            ax.text(
                x + width / 2, y - 0.08, data, ha="center", va="top", fontsize=8, family="monospace"
            )
            x += width
        widest = max(widest, x)
    return style.bare(ax, (-8, widest + 1), (-1.6 * (len(rows) - 1) - 0.55, 1.1))


_MARKS = ".o^sD"


def plot_seen_strokes(true: Run, seen: Mapping[int, Run], *, ax: Axes) -> Axes:
    """Draw the position of a valve as it is, and as masters with so many valves were sent it."""
    ax.plot(true.time, true.VPos[:, 0], color="0.6", linewidth=1, label="the valve itself")
    for place, (number, run) in enumerate(seen.items()):
        ax.plot(
            run.time, run.VPos[:, 0], _MARKS[place % len(_MARKS)], color=f"C{place}",
            markersize=4 + 2 * place, label=f"master of {number}",
        )  # fmt: skip
    ax.set(xlabel="time [s]", ylabel="position [%]")
    ax.legend(loc="lower right")
    return ax


def plot_ages(pictures: Mapping[str, Picture], *, ax: Axes, start: float) -> Axes:
    """Draw how old the oldest position on the screen is."""
    for place, (name, picture) in enumerate(pictures.items()):
        time = np.arange(0.0, picture.seen.duration, 0.1)
        oldest = picture.seen.ages(time).max(axis=1)
        ax.plot(
            time, np.where(np.isfinite(oldest), oldest, np.nan), color=f"C{place}", label=name,
            linewidth=5 - 0.8 * place, alpha=0.9,
        )  # fmt: skip
    ax.axvline(start, linewidth=1, color=LIMIT["color"], linestyle=LIMIT["linestyle"])
    ax.annotate(
        " the loop breaks", (start, 0.95), xycoords=ax.get_xaxis_transform(), va="top",
        color=LIMIT["color"], fontsize=8,
    )  # fmt: skip
    ax.set(xlabel="time [s]", ylabel="oldest position shown [s]", ylim=(0, None))
    ax.legend(loc="upper left", bbox_to_anchor=(1, 1), frameon=False)
    return ax


def plot_control_system(system: Any, base: RuleBase, *, ax: Axes) -> Axes:
    """Draw which terms lead to which rules in a control system of scikit-fuzzy."""
    import networkx as nx

    names = {rule: rule.label for rule in system.rules}
    edges = [(term.full_label, names[rule]) for term, rule in system.graph.edges if rule in names]
    graph = nx.DiGraph(edges)
    terms = dict.fromkeys(
        f"{name}[{term}]" for rule in base.rules for name, term in rule.antecedent
    )
    drop = (len(base.codes) - 1) / max(len(terms) - 1, 1)
    places = {term: (0.0, -drop * k) for k, term in enumerate(terms)}
    places |= {code: (1.0, -float(k)) for k, code in enumerate(base.codes)}
    nx.draw_networkx_edges(graph, places, ax=ax, edge_color="0.6", node_size=1200, arrowsize=8)
    box = {"facecolor": "white", "edgecolor": "0.8"}
    nx.draw_networkx_labels(graph, places, ax=ax, font_size=8, bbox=box)
    ax.axis("off")
    return ax
