"""Figures of telegrams, transactions, captures, runs and plans."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import matplotlib.pyplot as plt
import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.markers import CARETUP
from matplotlib.patches import FancyArrowPatch, Rectangle

from shipnet import style
from shipnet.asi.capture import Capture
from shipnet.asi.modulation import HALF_BIT, bits_of_slots, levels_of, pulses_of, send_current
from shipnet.asi.profile import IO_CONFIGURATIONS
from shipnet.asi.receiver import TOLERANCE, Eye, Receiver, Reception, Waveform, matched_filter
from shipnet.asi.simulation.slave import TRANSITIONS, Action, Event, State
from shipnet.asi.telegram import REQUEST_BITS, RESPONSE_BITS, Request, Response
from shipnet.asi.timing import BIT_TIME, Transaction
from shipnet.errors import ArgumentError, LengthError
from shipnet.style import LIMIT
from shipnet.style import axes as axes_of

if TYPE_CHECKING:
    import pandas as pd

    from shipnet.answers import Findings
    from shipnet.asi.plan import Plan

Floats = npt.NDArray[np.floating]


#: Parts of the telegrams: label, number of bits, key of `style.FIELD`.
REQUEST_PARTS = (
    ("ST", 1, "frame"),
    ("CB", 1, "control"),
    ("address A4..A0", 5, "address"),
    ("information I4..I0", 5, "information"),
    ("PB", 1, "parity"),
    ("EB", 1, "frame"),
)
RESPONSE_PARTS = (
    ("ST", 1, "frame"),
    ("I3..I0", 4, "information"),
    ("PB", 1, "parity"),
    ("EB", 1, "frame"),
)


def plot_telegram(
    bits: str,
    *,
    ax: Axes | None = None,
    start: float = 0.0,
    parts: Sequence[tuple[str, int, str]] | None = None,
) -> Axes:
    """Draw a telegram as a row of coloured bits with its level line above."""
    ax = axes_of(ax)
    lengths = {sum(part[1] for part in own) for own in (REQUEST_PARTS, RESPONSE_PARTS)}
    if parts is None and len(bits) not in lengths:
        raise LengthError(f"a telegram has 14 or 7 bits, but {bits!r} has {len(bits)}")
    if parts is None:
        parts = (
            REQUEST_PARTS if len(bits) == sum(part[1] for part in REQUEST_PARTS) else RESPONSE_PARTS
        )
    place = start
    for label, length, colour in parts:
        ax.add_patch(
            Rectangle((place, 0), length, 1, facecolor=style.FIELD[colour], edgecolor="0.3")
        )
        ax.text(place + length / 2, -0.22, label, ha="center", va="top", fontsize=8)
        place += length
    for index, bit in enumerate(bits):
        ax.text(start + index + 0.5, 0.5, bit, ha="center", va="center", family="monospace")
    edges = [start + index for index in range(len(bits) + 1)]
    levels = [1.35 + 0.5 * int(bit) for bit in bits]
    ax.step(edges, [*levels, levels[-1]], where="post", color="C0")
    return ax


def plot_transaction(
    request: Request | str,
    response: Response | str,
    transaction: Transaction | None = None,
    *,
    ax: Axes | None = None,
) -> Axes:
    """Draw request, master pause, response and slave pause on one time axis: kim2023's Fig 5."""
    ax = axes_of(ax, figsize=(8, 2.6))
    transaction = transaction or Transaction()
    spans = transaction.spans
    telegrams = {
        "request": request if isinstance(request, str) else request.bits,
        "response": response if isinstance(response, str) else response.bits,
    }
    for span in spans:
        if span.name in telegrams:
            plot_telegram(telegrams[span.name], ax=ax, start=span.start)
        else:
            ax.add_patch(
                Rectangle(
                    (span.start, 0), span.length, 1,
                    facecolor=style.FIELD["pause"], edgecolor="0.3", linestyle=":",
                )
            )  # fmt: skip
        ax.annotate(
            "", (span.start, 2.35), (span.end, 2.35),
            arrowprops={"arrowstyle": "<->", "color": "0.3", "shrinkA": 0, "shrinkB": 0},
        )  # fmt: skip
        ax.text(
            (span.start + span.end) / 2, 2.5, f"{span.name}\n{span.length:g} bit",
            ha="center", va="bottom", fontsize=8,
        )  # fmt: skip
    ax.set(xlim=(-0.5, transaction.bits + 0.5), ylim=(-0.75, 3.6), yticks=[], xlabel="time [bit]")
    ax.grid(visible=False)
    ax.spines["left"].set_visible(False)
    bit_us = transaction.bit_time * 1e6
    top = ax.secondary_xaxis(
        "top", functions=(lambda bits: np.multiply(bits, bit_us), lambda us: np.divide(us, bit_us))
    )
    top.set_xlabel("time [us]")
    return ax


def plot_io_codes(*, ax: Axes | None = None) -> Axes:
    """Draw the ports of the 16 I/O configuration codes as a grid: kim2023's Table 7."""
    ax = axes_of(ax, figsize=(8, 2))
    colours = {
        "IN": style.FIELD["address"],
        "OUT": style.FIELD["information"],
        "I/O": style.FIELD["parity"],
        "TRI": style.FIELD["frame"],
    }
    for code, ports in enumerate(IO_CONFIGURATIONS):
        for row, port in enumerate(ports):
            ax.add_patch(Rectangle((code, row), 1, 1, facecolor=colours[port], edgecolor="white"))
            ax.text(code + 0.5, row + 0.5, port, ha="center", va="center", fontsize=8)
    codes = range(len(IO_CONFIGURATIONS))
    ax.set_xticks([code + 0.5 for code in codes], [f"{code:X}" for code in codes])
    ax.set_yticks([row + 0.5 for row in range(4)], [f"D{row}" for row in range(4)])
    ax.set(xlim=(0, len(codes)), ylim=(4, 0), xlabel="I/O configuration code [hexadecimal]")
    ax.set_ylabel("port")
    ax.grid(visible=False)
    ax.tick_params(length=0)
    ax.spines[:].set_visible(False)
    return ax


def plot_capture(
    capture: Capture,
    u: npt.ArrayLike,
    dt: float,
    *,
    ax: Axes | None = None,
    start: float = 0.0,
    stop: float | None = None,
) -> Axes:
    """Draw a recorded line voltage with the telegrams that were found in it."""
    ax = axes_of(ax, figsize=(10, 3.2))
    u = np.asarray(u)
    stop = len(u) * dt if stop is None else stop
    low, high = max(0, int(start / dt)), min(len(u), int(stop / dt) + 1)
    # More samples than a figure has dots are drawn as the extremes of each group, in their order.
    group = max(1, (high - low) // 10_000)
    whole = u[low : high - (high - low) % group].reshape(-1, group)
    index = np.stack([whole.argmin(axis=1), whole.argmax(axis=1)], axis=1)
    index = np.unique(np.arange(len(whole))[:, np.newaxis] * group + index)
    ax.plot((low + index) * dt * 1e6, u[low:high][index], color="C0", linewidth=0.8)

    ends = ax.get_xaxis_transform()
    for row in capture.transactions.to_dict("records"):
        begin = row["start_s"]
        for kind in ("request", "response"):
            bits, error = row[kind], row[f"{kind}_error"]
            if kind == "response" and row["request"]:
                begin = row["start_s"] + (REQUEST_BITS + row["master_pause_bit"]) * BIT_TIME
            middle, length = begin + len(bits) * BIT_TIME / 2, len(bits) * BIT_TIME
            if not bits or not start <= middle <= stop:
                continue
            colour = style.FIELD["address" if kind == "request" else "information"]
            ax.axvspan(begin * 1e6, (begin + length) * 1e6, color=colour, alpha=0.5, linewidth=0)
            ax.text(
                middle * 1e6,
                1.02,
                bits,
                transform=ends,
                ha="center",
                family="monospace",
                fontsize=7,
            )
            if error != "ok":
                ax.text(
                    middle * 1e6, 1.1, error, transform=ends, ha="center", fontsize=7,
                    color=style.LIMIT["color"],
                )  # fmt: skip
    ax.set(xlim=(start * 1e6, stop * 1e6), xlabel="time [us]", ylabel="voltage [V]")
    return ax


def plot_modulation(
    bits: str, wave: Waveform, *, axes: Sequence[Axes] | None = None
) -> Sequence[Axes]:
    """Draw the six steps from bits to pulses and back: kim2023's Table 3."""
    if axes is None:
        axes = plt.subplots(6, 1, figsize=(7, 9), sharex=True)[1]
    u = wave.u.reshape(-1, wave.u.shape[-1])
    if len(axes) not in (3, 6) or len(u) != 1:
        raise ArgumentError(
            f"there are {len(axes)} axes and {len(u)} voltages; there must be 3 or 6, and one"
        )
    t, u = wave.t, u[0]
    if len(axes) == 3:
        return _plot_levels_to_voltage(bits, t, u, axes)
    edges = np.arange(2 * len(bits) + 1) * HALF_BIT * 1e6
    levels = levels_of(bits)
    received = bits_of_slots(np.pad(pulses_of(bits), (0, 2)))
    for ax, row, what in [
        (axes[0], bits, "1 bits to send"),
        (axes[5], received, "6 bits received"),
    ]:
        ax.step(edges[::2], [int(bit) for bit in row + row[-1]], where="post", color="C0")
        for place, bit in enumerate(row):
            ax.text(6 * place + 3, 0.5, bit, ha="center", va="center", family="monospace")
        ax.set(ylabel="level [1]", ylim=(-0.2, 1.2), title=what)
    axes[1].step(edges, [*levels, levels[-1]], where="post", color="C0")
    axes[1].set(ylabel="level [1]", ylim=(-0.2, 1.2), title="2 Manchester code")
    axes[2].plot(t * 1e6, send_current(t, bits) * 1e3, color="C1")
    axes[2].set(ylabel="current [mA]", title="3 send current")
    axes[3].plot(t * 1e6, u, color="C2")
    axes[3].set(ylabel="voltage [V]", title="4 voltage on the line")
    pulses = pulses_of(bits)
    slots = np.flatnonzero(pulses)
    axes[4].stem((slots + 0.5) * HALF_BIT * 1e6, pulses[slots], basefmt="0.7")
    axes[4].set(ylabel="pulse [1]", ylim=(-1.4, 1.4), title="5 pulses that the receiver takes")
    axes[5].set_xlabel("time [us]")
    return axes


def _plot_levels_to_voltage(
    bits: str, t: Floats, u: Floats, axes: Sequence[Axes]
) -> Sequence[Axes]:
    """Draw bits with their levels, the send current and the voltage."""
    levels = levels_of(bits)
    edges = np.arange(levels.size + 1) * HALF_BIT * 1e6
    axes[0].step(edges, [*levels, 1], where="post")
    for place, bit in enumerate(bits):
        middle = (2 * place + 1) * HALF_BIT * 1e6
        axes[0].text(middle, 1.25, bit, ha="center", family="monospace")
    axes[0].set(ylabel="level [1]", ylim=(-0.2, 1.7))
    axes[1].plot(t * 1e6, 1e3 * send_current(t, bits), color="C1")
    axes[1].set(ylabel="current [mA]")
    axes[2].plot(t * 1e6, u, color="C2")
    axes[2].set(ylabel="voltage [V]", xlabel="time [us]")
    return axes


def plot_reception(
    found: Reception, wave: Waveform, receiver: Receiver, *, ax: Axes | None = None
) -> Axes:
    """Draw one telegram as its receiver sees it; x is in microseconds from its start."""
    ax = axes_of(ax)
    if wave.u.ndim != 1:
        raise ArgumentError(f"wave holds {wave.u.shape[:-1]} telegrams; one can be drawn")
    t = wave.t * 1e6
    seen = matched_filter(wave.u, wave.dt) if receiver.matched else wave.u
    ax.plot(t, wave.u, color="0.6", linewidth=1, label="on the line")
    if receiver.matched:
        ax.plot(t, seen, color="C0", label="behind the filter")
    end = wave.span[1] * 1e6 + 21
    if np.isfinite(found.start):
        middles = wave.start + found.start + HALF_BIT * (np.arange(found.slots.size) + 0.5)
        heights = np.interp(middles, wave.t, seen)
        filled = found.slots != 0
        ax.plot(middles[filled] * 1e6, heights[filled], "o", color="C1", label="pulse")
        ax.plot(middles[~filled][1:] * 1e6, heights[~filled][1:], "x", color="C1", label="none")
        threshold = abs(heights[1]) * receiver.threshold
        for level in (threshold, -threshold):
            ax.axhline(level, color=style.LIMIT["color"], linestyle=style.LIMIT["linestyle"])
        ax.text(
            end - 1, threshold, "threshold", color=style.LIMIT["color"], ha="right", va="bottom"
        )
    ax.set(xlim=(-5, end), xlabel="time [us]", ylabel="voltage at the master [V]")
    ax.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=4)
    return ax


def plot_comparison(
    x: Sequence[float], table: pd.DataFrame, *, ax: Axes | None = None, label: str = "", **line: Any
) -> Axes:
    """Draw weakest pulse and ringing over the compared plans, with both tolerances."""
    ax = axes_of(ax)
    name = f", {label}" if label else ""
    for column, colour, what in (("evenness", "C0", "weakest pulse"), ("ringing", "C1", "ringing")):
        ax.plot(x, 100 * table[column], color=colour, label=what + name, **line)
    for level in TOLERANCE:
        ax.axhline(100 * level, color=style.LIMIT["color"], linestyle=style.LIMIT["linestyle"])
    ax.set(ylabel="share of the largest pulse [%]", ylim=(0, 112))
    ax.legend()
    return ax


def plot_slots(slots: npt.ArrayLike, *, ax: Axes | None = None, faults: Sequence[int] = ()) -> Axes:
    """Draw the pulses of a telegram slot by slot, faulty slots in red."""
    ax = axes_of(ax)
    slots = np.asarray(slots)
    for slot, pulse in enumerate(slots):
        colour = style.LIMIT["color"] if slot in faults else "C0"
        x = slot + np.linspace(0, 1, 30)
        ax.plot(x, pulse * np.sin(np.pi * (x - slot)) ** 2, color=colour)
        if slot in faults:
            ax.axvspan(slot, slot + 1, color=colour, alpha=0.15, linewidth=0)
    ax.set(xlim=(0, slots.size), ylim=(-1.3, 1.3), yticks=[-1, 0, 1])
    return ax


def plot_eye(opened: Eye, *, ax: Axes | None = None) -> Axes:
    """Draw all half-bits over each other with the tolerances: icn2007's Fig 8."""
    ax = axes_of(ax)
    t = opened.t * 1e6
    for rows, colour, label in [(opened.pulses, "C0", "pulse"), (opened.gaps, "C1", "no pulse")]:
        lines = ax.plot(t, rows.T, color=colour, alpha=0.15, linewidth=0.8)
        if lines:
            ax.plot([], [], color=colour, label=label)
    for level in (TOLERANCE.evenness, TOLERANCE.ringing, -TOLERANCE.ringing):
        ax.axhline(level, color=style.LIMIT["color"], linestyle=style.LIMIT["linestyle"])
    ax.set(xlim=(t[0], t[-1]), ylim=(-1.05, 1.05))
    ax.set(xlabel="time from the middle [us]", ylabel="voltage / largest [1]")
    return ax


# Runs ------------------------------------------------------------------------------------------

#: Requests and slaves that one figure can show.
_MOST_REQUESTS, _MOST_SLAVES = 500, 64


def plot_events(
    events: pd.DataFrame,
    start: float | None,
    stop: float | None,
    bit_time: float,
    *,
    ax: Axes | None = None,
) -> Axes:
    """Draw the events of a run as blocks in time; x is in milliseconds."""
    ax = axes_of(ax)
    keep = events["time_s"] >= (0.0 if start is None else start)
    if stop is not None:
        keep &= events["time_s"] < stop
    shown = events[keep]
    if not 1 <= len(shown) <= _MOST_REQUESTS:
        raise ArgumentError(
            f"start and stop show {len(shown)} requests; a figure shows 1 to {_MOST_REQUESTS}"
        )
    slaves = shown.sort_values(["address", "half"], kind="stable")["slave"].unique()
    row = {slave: place + 1 for place, slave in enumerate(slaves)}
    bit = 1e3 * bit_time
    for one in shown.to_dict("records"):
        begin, place = 1e3 * one["time_s"], row[one["slave"]]
        again = one["attempt"] > 0
        ax.add_patch(
            Rectangle(
                (begin, -0.4), REQUEST_BITS * bit, 0.8, facecolor=style.FIELD["address"],
                edgecolor="0.3", linewidth=0.5, hatch="////" if again else None,
            )
        )  # fmt: skip
        if again:
            ax.text(
                begin + REQUEST_BITS * bit / 2, -0.5, str(one["attempt"]), ha="center",
                va="bottom", fontsize=7,
            )  # fmt: skip
        fine, pause = one["outcome"] == "ok", one["master_pause_bit"]
        if fine and pause != pause:
            continue  # a call without an answer
        # Where nothing came, the first place at which it could have come stays marked.
        heard = pause == pause
        offset = REQUEST_BITS + (pause if heard else 2.0)
        ax.add_patch(
            Rectangle(
                (begin + offset * bit, place - 0.4), RESPONSE_BITS * bit, 0.8,
                facecolor=style.FIELD["information"] if fine else style.LIMIT["color"],
                edgecolor="0.3", linewidth=0.5, alpha=1.0 if heard else 0.35,
                linestyle="-" if heard else ":",
            )
        )  # fmt: skip
    last = shown.iloc[-1]
    end = last["time_s"] + (REQUEST_BITS + 10 + RESPONSE_BITS) * bit_time
    ax.set(xlim=(1e3 * shown["time_s"].iloc[0] - bit, 1e3 * end), ylim=(len(row) + 0.6, -0.8))
    ax.set_yticks(range(len(row) + 1), ["master", *(f"slave {slave}" for slave in row)])
    ax.set_xlabel("time [ms]")
    ax.grid(visible=False)
    return ax


#: Middle of each state's box; half its width and height, and how far arrows keep from its middle.
_X = {State.ASYNCHRONOUS: 0.0, State.RECEIVE: 6.0, State.SYNCHRONOUS: 12.0}
_HALF_WIDTH, _HALF_HEIGHT, _LANE = 1.2, 0.5, 0.22


def plot_states(*, ax: Axes | None = None) -> Axes:
    """Draw the receive states of a slave from their table: the figure that icn2007 calls 3.19.

    A box per state, an arrow from state to state with the events that lead along it, and after a
    slash what the slave does.
    """
    ax = axes_of(ax)
    for state, x in _X.items():
        ax.add_patch(
            Rectangle(
                (x - _HALF_WIDTH, -_HALF_HEIGHT), 2 * _HALF_WIDTH, 2 * _HALF_HEIGHT,
                facecolor=style.FIELD["address"], edgecolor="0.3",
            )
        )  # fmt: skip
        ax.text(x, 0, state.value.upper(), ha="center", va="center", fontsize=8)
    words = defaultdict(list)
    for (state, event), step in TRANSITIONS.items():
        # A pause after a response is a pause: where any will do, it need not be named.
        if event is Event.SLAVE_PAUSE and (state, Event.PAUSE) in TRANSITIONS:
            continue
        doing = "" if step.action is Action.NONE else f" / {step.action.value}"
        words[state, step.state].append(event.value + doing)
    for (begin, end), said in words.items():
        # Arrows out of RECEIVE run above those back to it, with their words outside.
        lane = _LANE if begin is State.RECEIVE else -_LANE
        side = 1 if _X[end] > _X[begin] else -1
        x0, x1 = _X[begin] + side * _HALF_WIDTH, _X[end] - side * _HALF_WIDTH
        ax.add_patch(
            FancyArrowPatch(
                (x0, lane), (x1, lane), arrowstyle="-|>", mutation_scale=12, color="0.3",
                shrinkA=0, shrinkB=0,
            )
        )  # fmt: skip
        ax.text(
            (x0 + x1) / 2, lane + (0.08 if lane > 0 else -0.08), "\n".join(said), ha="center",
            va="bottom" if lane > 0 else "top", fontsize=7,
        )  # fmt: skip
    return style.bare(ax, (-1.4, 13.4), (-0.9, 1.6))


# Plans -----------------------------------------------------------------------------------------


#: Marker, colour and size by the name in the legend, the last ones drawn on top.
_MARKS: dict[str, tuple[Any, str, int]] = {
    "supply": (CARETUP, "C4", 12),
    "master": ("s", "0.2", 7),
    "repeater": ("D", "C1", 6),
    "terminator": ("|", "0.2", 14),
    "slave": ("o", "C0", 4),
    "slave, passed": ("o", "C2", 4),
    "slave, failed": ("o", LIMIT["color"], 4),
}

#: Most slaves that are named one by one.
_NAMED = 12


def plot_plan(plan: Plan, findings: Findings | None = None, *, ax: Axes | None = None) -> Axes:
    """Draw a plan to scale along the cable, the slaves in the colour of their verdict.

    A slave with a rule not met is red, a segment with one has red cable. A cable that closes a
    ring is dashed, a repeater is joined to both of its nodes. Few slaves are named.
    """
    ax = axes_of(ax)
    table = None if findings is None else findings.table()
    failed = set() if table is None else set(table.loc[table["verdict"] != "met", "object"])
    points: dict[str, list[Floats]] = {kind: [] for kind in _MARKS}
    places: dict[str, Floats] = {}
    top = 0.0
    for segment in plan.segments:
        network = segment.network
        placed = network.layout(segment.head)
        origin = np.array([segment.lead, top])
        places |= dict(zip(network.nodes, placed.spot + origin, strict=True))
        colour = LIMIT["color"] if str(segment) in failed else "0.6"
        for stroke in placed.strokes:
            ax.plot(*(stroke + origin[:, np.newaxis]), color=colour, zorder=1)
        if placed.closing is not None:
            ax.plot(*(placed.closing + origin[:, np.newaxis]), "--", color=colour, zorder=1)
        top += placed.lowest - 1.5
    for master in plan.masters:
        points["master"].append(places[master.node])
    for supply in plan.supplies:
        points["supply"].append(places[supply.node])
    for terminator in plan.terminators:
        points["terminator"].append(places[terminator.node])
    for repeater in plan.repeaters:
        ends = np.array([places[repeater.a], places[repeater.b]])
        ax.plot(*ends.T, ":", color="C1", zorder=1)
        # Clear of the branches that hang on the upper one.
        points["repeater"].append(ends[ends[:, 1].argmin()] + [0, 0.75])
    for slave in plan.slaves:
        verdict = (
            "slave" if table is None else f"slave, {'failed' if str(slave) in failed else 'passed'}"
        )
        points[verdict].append(places[slave.node])
    if len(plan.slaves) <= _NAMED:
        for node in dict.fromkeys(slave.node for slave in plan.slaves):
            labels = " ".join(slave.label for slave in plan.slaves if slave.node == node)
            ax.annotate(
                labels, tuple(places[node]), (0, 6), textcoords="offset points",
                ha="center", fontsize=8,
            )  # fmt: skip
    for label, (marker, colour, size) in _MARKS.items():
        if points[label]:
            x, y = np.transpose(points[label])
            ax.plot(
                x, y, marker=marker, color=colour, markersize=size, linestyle="none", label=label
            )
    ax.set(
        xlabel="distance from the master [m]", yticks=[], ylim=(1.04 * top + 0.7, 0.8 - 0.04 * top)
    )
    ax.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=6, fontsize=8)
    return ax
