"""Figures of kim2014 in our layout, drawn from its text because no printed one was available."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from shipnet import style
from shipnet.ballast.diagnosis import Run
from shipnet.ballast.registers import FIRST_REGISTER, N_REGISTERS
from shipnet.fuzzy.rules import RuleBase
from shipnet.modbus.pdu import Request, decode
from shipnet.modbus.uart import SerialLine
from shipnet.papers.kim2014.faults import Picture
from shipnet.papers.plot import FILL, HALF, box, diagram, diagrams, fields
from shipnet.papers.registry import drawing

__all__ = ["plot_ages", "plot_control_system", "plot_seen_strokes"]

#: The query of Table 3, and a serial line for it.
_QUERY = Request.read_input_registers(FIRST_REGISTER, N_REGISTERS)
_LINE = SerialLine(9600)

diagrams("kim2014", "Fig 2", "Fig 7", "Fig 9", "Fig 10")


@drawing("kim2014", "Fig 1")
def _hydraulics(*, n_valves: int = 4, ax: Axes) -> Axes:
    """Draw central hydraulics piped to every valve and, next to it, valves with their own pumps."""
    places, low, aside = np.linspace(-0.8, 2.8, n_valves), 0.35, 5.2
    for number, x in enumerate([*places, *(places + aside)]):
        _valve(ax, (x, low), "" if number < n_valves else "motor, pump,\ncontroller")
        text = f"valve {number % n_valves + 1}"
        ax.text(x, low - 0.32, text, ha="center", va="top")
    pipe: dict[str, Any] = {"color": "#b8860b", "lw": 1.6, "zorder": 0, "label": "_pipe"}
    for x in places:
        # Every valve has a pipe to open it and a pipe to close it.
        for shift in (-0.07, 0.07):
            ax.plot([1 + shift + (x - 1) * 0.25, x + shift], [1.67, low + 0.35], **pipe)
    bus: dict[str, Any] = {"color": "C0", "lw": 1.2, "label": "_bus"}
    power: dict[str, Any] = {"color": "C1", "lw": 1.2, "label": "_power"}
    beside = places + aside
    for x in beside:
        ax.plot([x - 0.1] * 2, [low + 1, 1.5], **bus)
        ax.plot([x + 0.1] * 2, [low + 1, 1.65], **power)
    middle, left, right = 1 + aside, beside[0] - 0.35, beside[-1] + 0.35
    ax.plot(
        [middle - HALF[0], left, left, right, right, middle + HALF[0]],
        [3, 3, 1.5, 1.5, 3, 3],
        color="C0",
        lw=1.2,
    )
    ax.plot([beside[0] + 0.1, beside[-1] + 0.1], [1.65, 1.65], color="C1", lw=1.2)
    ax.plot([middle, middle], [1.65, 1.82], color="C1", lw=1.2)
    ax.text(left + 0.08, 2.55, "closed loop\nof Modbus", color="C0")
    diagram("kim2014", "Fig 1", ax=ax)
    ax.text(-1.4, 3.6, "central: pipes to every valve")
    ax.text(left, 3.6, "distributed: a pump in every valve")
    return style.bare(ax, (-1.4, 3.5 + aside), (-0.25, 3.8))


@drawing("kim2014", "Fig 3", "Fig 4")
def _rtu_frame(*, frame: bytes = _QUERY.rtu(1), serial: SerialLine = _LINE, ax: Axes) -> Axes:
    """Draw the general RTU frame, and a frame field by field below it."""
    pdu = decode(frame).pdu
    silence = f"silence\n{serial.t35 / serial.character_time:.3g} char"
    parts = [
        ("address", "address", frame[:1]),
        ("function\ncode", "control", pdu[:1]),
        ("data", "information", pdu[1:]),
        ("error check", "parity", frame[-2:]),
    ]
    general = [(name, kind, "", len(data)) for name, kind, data in parts]
    detail = [(name, kind, data.hex(" "), len(data)) for name, kind, data in parts]
    # A silence has no bytes; the width of two leaves room for its text.
    pause = (silence, "pause", "", 2)
    return fields(ax, {"Fig 3": general, "Fig 4": [pause, *detail, pause]})


@drawing("kim2014", "Fig 5", "Fig 6")
def _tcp_frame(*, frame: bytes = _QUERY.tcp(1, 0x1501), ax: Axes) -> Axes:
    """Draw a Modbus TCP frame: header and PDU above, and the individual fields below."""
    pdu = decode(frame, "tcp").pdu
    general = [
        ("MBAP header", "address", frame[:7].hex(" "), 7),
        ("PDU", "information", pdu.hex(" "), len(pdu)),
    ]
    detail = [
        (name, kind, frame[first:last].hex(" "), last - first)
        for name, first, last, kind in (
            ("transaction\nid", 0, 2, "address"),
            ("protocol\nid", 2, 4, "address"),
            ("length", 4, 6, "address"),
            ("unit\nid", 6, 7, "address"),
            ("function\ncode", 7, 8, "control"),
            ("data", 8, len(frame), "information"),
        )
    ]
    return fields(ax, {"Fig 5": general, "Fig 6": detail})


@drawing("kim2014", "Fig 15")
def _testbed(*, ax: Axes) -> Axes:
    """Draw the test bed, whose line is closed through the master's second port."""
    blocks = diagram("kim2014", "Fig 15", ax=ax)
    x, y = blocks["master"][3:]
    first, last, row = blocks["S1"].x, blocks["S5"].x, blocks["S1"].y
    ax.plot(
        [x - 0.3, x - 0.3, first - 1.0, first - 1.0, last],
        [y - HALF[1], 2.6, 2.6, row, row],
        color="C0",
        lw=1.5,
        zorder=0,
    )
    ax.plot(
        [last, last + 1.0, last + 1.0, x + 0.3, x + 0.3],
        [row, row, 2.6, 2.6, y - HALF[1]],
        color="C0",
        lw=1.5,
        ls=":",
        zorder=0,
    )
    ax.text(first - 0.9, 2.66, "RS-485, port 1", color="C0")
    ax.text(last + 0.95, 2.66, "port 2 (section 2.1)", color="C0", ha="right")
    left = blocks["PC"].x + HALF[0]
    ax.plot([left, x - HALF[0]], [y, y], color="C1", lw=1.5, zorder=0)
    ax.text((left + x - HALF[0]) / 2, y + 0.06, "Ethernet, UDP port 502", ha="center")
    return style.bare(ax, (-1.1, 9.2), (0.55, 3.65))


def _valve(ax: Axes, place: tuple[float, float], drive: str) -> None:
    """Draw the two triangles of a valve and, above them, its own drive or a small box."""
    x, y = place
    for side in (-1, 1):
        ax.fill(
            [x, x + 0.3 * side, x + 0.3 * side],
            [y, y - 0.2, y + 0.2],
            facecolor=FILL["green"],
            edgecolor="0.2",
            lw=1,
        )
    ax.plot([x, x], [y, y + 0.35], color="0.2", lw=1)
    if drive:
        box(ax, (x - 0.52, y + 0.35), 1.04, 0.65, FILL["amber"], drive)
    else:
        box(ax, (x - 0.25, y + 0.2), 0.5, 0.3, FILL["amber"])


_MARKS = ".o^sD"


def plot_seen_strokes(true: Run, seen: Mapping[int, Run], *, ax: Axes) -> Axes:
    """Draw a valve's position, and what masters with different numbers of valves receive of it."""
    ax.plot(
        true.time, true.samples["VPos"][:, 0], color="0.6", linewidth=1, label="the valve itself"
    )
    for row, (number, run) in enumerate(seen.items()):
        ax.plot(
            run.time,
            run.samples["VPos"][:, 0],
            _MARKS[row % len(_MARKS)],
            color=f"C{row}",
            markersize=4 + 2 * row,
            label=f"master of {number}",
        )
    ax.set(xlabel="time [s]", ylabel="position [%]")
    ax.legend(loc="lower right")
    return ax


def plot_ages(pictures: Mapping[str, Picture], *, ax: Axes, start: float) -> Axes:
    """Draw the age of the oldest position on the screen."""
    for row, (name, picture) in enumerate(pictures.items()):
        time = np.arange(0.0, picture.seen.duration, 0.1)
        oldest = picture.seen.ages(time).max(axis=1)
        ax.plot(
            time,
            np.where(np.isfinite(oldest), oldest, np.nan),
            color=f"C{row}",
            label=name,
            linewidth=5 - 0.8 * row,
            alpha=0.9,
        )
    ax.axvline(start, linewidth=1, **style.LIMIT)  # type: ignore[arg-type]
    ax.annotate(
        " the loop breaks",
        (start, 0.95),
        xycoords=ax.get_xaxis_transform(),
        va="top",
        color=style.LIMIT["color"],
    )
    ax.set(xlabel="time [s]", ylabel="oldest position shown [s]", ylim=(0, None))
    ax.legend(loc="upper left", bbox_to_anchor=(1, 1))
    return ax


def plot_control_system(system: Any, base: RuleBase, *, ax: Axes) -> Axes:
    """Draw which terms each rule of a scikit-fuzzy control system uses."""
    names = {rule: rule.label for rule in system.rules}
    terms = list(
        dict.fromkeys(f"{name}[{term}]" for rule in base.rules for name, term in rule.antecedent)
    )
    edges = [edge for edge in system.graph.edges if edge[1] in names]
    x = [terms.index(term.full_label) for term, _ in edges]
    ax.plot(x, [base.codes.index(names[rule]) for _, rule in edges], "o")
    ax.set_xticks(range(len(terms)), terms, rotation=45, ha="right", rotation_mode="anchor")
    ax.set_yticks(range(len(base.codes)), base.codes)
    ax.invert_yaxis()
    ax.set_ylabel("rule")
    return ax
