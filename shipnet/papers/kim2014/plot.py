"""Figures of kim2014 in our layout, drawn from its text because no printed one was available."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from shipnet import style
from shipnet.ballast.diagnosis import Run
from shipnet.ballast.live import TestBed
from shipnet.ballast.master import Screen, operate
from shipnet.ballast.plant import Command, Fault, Plant
from shipnet.ballast.registers import FIRST_REGISTER, N_REGISTERS
from shipnet.ballast.scan import System, status_poll
from shipnet.fuzzy.rules import RuleBase
from shipnet.modbus.pdu import Request, decode
from shipnet.modbus.uart import SerialLine
from shipnet.papers.kim2014.faults import Picture, seen_strokes
from shipnet.papers.plot import FILL, HALF, box, diagram, diagrams, fields, panels
from shipnet.papers.registry import drawing

__all__ = ["plot_ages", "plot_control_system", "plot_seen_strokes"]

#: The query of Table 3, and a serial line for it.
_QUERY = Request.read_input_registers(FIRST_REGISTER, N_REGISTERS)
_LINE = SerialLine(9600)

diagrams("kim2014", "Fig 2", "Fig 7", "Fig 9", "Fig 10", height=2.6)
drawing("kim2014", "Fig 12")(lambda *, ax: seen_strokes([5])[5].plot(ax=ax))


@drawing("kim2014", "Fig 1", figsize=(6.4, 3))
def _hydraulics(*, n_valves: int = 3, ax: Axes) -> Axes:
    """Draw central hydraulics piped to every valve and, next to it, valves with their own pumps."""
    places, low, aside = np.linspace(-0.8, 2.8, n_valves), 0.35, 5.2
    for number, x in enumerate([*places, *(places + aside)]):
        for tip in (x - 0.3, x + 0.3):
            edges = [x, tip, tip], [low, low - 0.2, low + 0.2]
            ax.fill(*edges, facecolor=FILL["green"], edgecolor="0.2", lw=1)
        ax.plot([x, x], [low, low + 0.35], color="0.2", lw=1)
        width, bottom, height = (0.5, 0.2, 0.3) if number < n_valves else (1.5, 0.35, 0.65)
        text = "" if number < n_valves else "pump and\ncontroller"
        box(ax, (x - width / 2, low + bottom), width, height, FILL["amber"], text)
        ax.text(x, low - 0.32, f"valve {number % n_valves + 1}", ha="center", va="top")
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
    across = [middle - HALF[0], left, left, right, right, middle + HALF[0]]
    ax.plot(across, [3, 3, 1.5, 1.5, 3, 3], color="C0", lw=1.2)
    ax.plot([beside[0] + 0.1, beside[-1] + 0.1], [1.65, 1.65], color="C1", lw=1.2)
    ax.plot([middle, middle], [1.65, 1.82], color="C1", lw=1.2)
    ax.text(left + 0.08, 2.55, "Modbus\nloop", color="C0")
    diagram("kim2014", "Fig 1", ax=ax)
    ax.text(-1.4, 3.6, "central: pipes to every valve")
    ax.text(left, 3.6, "distributed: a pump in every valve")
    return style.bare(ax, (-1.4, 3.6 + aside), (-0.25, 3.8))


@drawing("kim2014", "Fig 15", figsize=(6.4, 2.8))
def _test_bed(*, ax: Axes) -> Axes:
    """Draw the test bed; section 4 does not say whether the dashed line existed."""
    ax.plot([5.28, 7.8, 7.8], [3.2, 3.2, 2.33], "--", color="0.3", lw=1)
    ax.text(6.54, 3.24, "port 2, if any", ha="center", va="bottom")
    return diagram("kim2014", "Fig 15", ax=ax, arrowstyle="-")


@drawing("kim2014", "Fig 3", "Fig 4", figsize=(6.4, 2.2))
def _rtu_frame(*, frame: bytes = _QUERY.rtu(1), serial: SerialLine = _LINE, ax: Axes) -> Axes:
    """Draw the general RTU frame, and a frame field by field below it."""
    decode(frame)  # a wrong frame is refused
    detail = _parts(
        frame,
        ("ad-\ndress", "address", 1),
        ("func-\ntion\ncode", "control", 2),
        ("data", "information", -2),
        ("error check", "parity", len(frame)),
    )
    general = [(name, kind, "", size) for name, kind, _, size in detail]
    # A silence has no bytes; the width of two leaves room for its text.
    pause = (f"silence\n{serial.t35 / serial.character_time:.3g} char", "pause", "", 2)
    return fields(ax, {"Fig 3": general, "Fig 4": [pause, *detail, pause]})


def _parts(frame: bytes, *parts: tuple[str, str, int]) -> list[tuple[str, str, str, int]]:
    """Return name, colour, bytes and size of the parts of a frame, each given with its end."""
    begins = [0, *(end for *_, end in parts)]
    data = [frame[begin:end] for begin, (*_, end) in zip(begins, parts, strict=False)]
    return [
        (name, kind, part.hex(" "), len(part))
        for (name, kind, _), part in zip(parts, data, strict=True)
    ]


@drawing("kim2014", "Fig 5", "Fig 6", figsize=(6.4, 2.2))
def _tcp_frame(*, frame: bytes = _QUERY.tcp(1, 0x1501), ax: Axes) -> Axes:
    """Draw a Modbus TCP frame: header and PDU above, and the individual fields below."""
    decode(frame, "tcp")  # a wrong frame is refused
    size = len(frame)
    general = _parts(frame, ("MBAP header", "address", 7), ("PDU", "information", size))
    detail = _parts(
        frame,
        ("transaction\nid", "address", 2),
        ("protocol\nid", "address", 4),
        ("length", "address", 6),
        ("unit\nid", "address", 7),
        ("func-\ntion\ncode", "control", 8),
        ("data", "information", size),
    )
    return fields(ax, {"Fig 5": general, "Fig 6": detail})


@drawing("kim2014", "Fig 11", figsize=(6.4, 4.2))
def _screen(*, time: float = 7.2, ax: Axes) -> Axes:
    """Draw the master's screen at a time [s]: 20 of 64 valves open, 4 go to 40 %, 6 is stuck."""
    plan = [Command("open", 3.0, valves=range(1, 21)), Command(40, 5.0, valves=range(31, 35))]
    seen = operate(
        Plant(System(64, status_poll(9600)), [Fault("V1", valves=6)], 2024), plan, until=20
    )
    return seen.screen(time).plot(6, ax=ax, columns=16)


@drawing("kim2014", "Fig 13")
def _finding(*, fault: str = "V1", ax: Axes) -> Axes:
    """Draw the firing strengths of the rules during a command to a valve with this fault."""
    bed = TestBed(fault=fault, rng=2024)
    bed.wait(1.0)
    bed.command(5, "open")
    bed.wait(25.0)
    return bed.run.diagnose().plot(5, ax=ax)


@drawing("kim2014", "Fig 14", figsize=(6.4, 3))
def _client(*, page: Screen | None = None, ax: Axes, **window: str) -> Axes:
    """Draw the fields of the PC's window, and the valves that it has read."""
    window = window or {"connection": "port 502", "slave": "3", "command": "open"}
    above, below = panels(ax, 2)
    for column, (name, text) in enumerate(window.items()):
        above.text(1.1 * column + 0.5, 0.75, name, ha="center", va="bottom")
        box(above, (1.1 * column, 0), 1, 0.6, "white", text)
    style.bare(above, (-0.1, 1.1 * len(window)), (-0.3, 1.2))
    (TestBed().screen() if page is None else page).plot(ax=below)
    return ax


_MARKS = ".o^sD"


def plot_seen_strokes(true: Run, seen: Mapping[int, Run], *, ax: Axes) -> Axes:
    """Draw a valve's position, and what masters with different numbers of valves receive of it."""
    ax.plot(true.time, true.samples["VPos"][:, 0], "0.6", lw=1, label="the valve itself")
    for row, (number, run) in enumerate(seen.items()):
        look: Any = {"marker": _MARKS[row % len(_MARKS)], "ls": "", "markersize": 4 + 2 * row}
        position = run.samples["VPos"][:, 0]
        ax.plot(run.time, position, color=f"C{row}", label=f"master of {number}", **look)
    ax.set(xlabel="time [s]", ylabel="position [%]")
    ax.legend(loc="lower right")
    return ax


def plot_ages(pictures: Mapping[str, Picture], *, ax: Axes, start: float) -> Axes:
    """Draw the age of the oldest position on the screen."""
    rows, red = panels(ax, len(pictures), sharex=True), style.LIMIT["color"]
    for row, (name, picture) in zip(rows, pictures.items(), strict=True):
        time = np.arange(0.0, picture.seen.duration, 0.1)
        oldest = picture.seen.ages(time).max(axis=1)
        row.plot(time, np.where(np.isfinite(oldest), oldest, np.nan), label=name)
        row.axvline(start, color=red, linestyle="--")
        row.set_title(name, loc="left")
        row.set(xlim=(0, time[-1]), ylim=(0, time[-1]))
    style.moment(rows[0], start, "the loop breaks")
    rows[-1].set_xlabel("time [s]")
    rows[len(rows) // 2].set_ylabel("oldest position shown [s]")
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
