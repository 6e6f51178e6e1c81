"""Figures of CAN frames, of arbitration, of what happened on a bus and on its cable."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle

from shipnet import style
from shipnet.can.bitwise import Arbitration
from shipnet.can.frame import Frame
from shipnet.can.log import LogLoad
from shipnet.can.response import ResponseTimes
from shipnet.can.segment import DOMINANT, RECESSIVE, Signals
from shipnet.can.simulation import Run
from shipnet.errors import ArgumentError
from shipnet.fields import check_whole
from shipnet.style import LIMIT

#: Key of `style.FIELD` of each field; what is not named frames the rest.
_COLOURS = {
    "base identifier": "address",
    "identifier extension": "address",
    "RTR": "control",
    "SRR": "control",
    "IDE": "control",
    "r1": "control",
    "r0": "control",
    "DLC": "control",
    "data": "information",
    "CRC sequence": "parity",
}

#: What is written below a narrow field instead of its name.
_SHORT = {"CRC delimiter": "CRC del.", "ACK slot": "ACK", "ACK delimiter": "ACK del."}

#: Height of a row, with its labels below the blocks and its level line above.
_PITCH = 3.6

#: Narrower pieces of a field have their name written upwards [bit].
_NARROW = 3


def plot_frame(frame: Frame, ax: Axes | None, bits_per_row: int) -> Axes:
    """Draw a frame as rows of coloured bits with the level on the line above."""
    width = check_whole("bits_per_row", bits_per_row, 8, 160)
    ax = _axes(ax)
    bits, stuffed = frame.bits, set(frame.stuff_positions)
    colours = [
        _COLOURS.get(field.name, "frame")
        for field in frame.fields
        for _ in range(field.line_length)
    ]
    for place, (bit, colour) in enumerate(zip(bits, colours, strict=True)):
        row, x = divmod(place, width)
        own = place in stuffed
        ax.add_patch(
            Rectangle(
                (x, -row * _PITCH), 1, 1,
                facecolor=style.FIELD["pause" if own else colour],
                edgecolor="0.6", linewidth=0.4, hatch="////" if own else None,
            )
        )  # fmt: skip
        ax.text(
            x + 0.5, 0.47 - row * _PITCH, bit, ha="center", va="center", fontsize=7,
            family="monospace",
            bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.4} if own else None,
        )  # fmt: skip
    for field in frame.fields:
        _outline(ax, field.name, field.line_start, field.line_length, width)
    rows = -(-len(bits) // width)
    for row in range(rows):
        levels = [1.3 + 0.5 * int(bit) - row * _PITCH for bit in bits[row * width :][:width]]
        ax.step(range(len(levels) + 1), [*levels, levels[-1]], where="post", color="C0")
        ax.text(-0.4, 0.47 - row * _PITCH, str(row * width), ha="right", va="center", fontsize=7)
    ax.set(
        xlim=(-2.2, min(width, len(bits)) + 0.3),
        ylim=(-(rows - 1) * _PITCH - 1.7, 2.1),
        yticks=[],
        xlabel="time from the start of the row [bit]",
    )
    ax.grid(visible=False)
    ax.spines["left"].set_visible(False)
    return ax


def _outline(ax: Axes, name: str, start: int, length: int, width: int) -> None:
    """Frame the pieces of a field and name the longest."""
    pieces = []
    place = start
    while place < start + length:
        end = min(start + length, (place // width + 1) * width)
        pieces.append((place, end - place))
        place = end
    for place, size in pieces:
        row, x = divmod(place, width)
        ax.add_patch(
            Rectangle((x, -row * _PITCH), size, 1, facecolor="none", edgecolor="0.2", linewidth=1.0)
        )
    place, size = max(pieces, key=lambda piece: piece[1])
    row, x = divmod(place, width)
    ax.text(
        x + size / 2, -0.12 - row * _PITCH, _SHORT.get(name, name), ha="center", va="top",
        fontsize=7, rotation=90 if size < _NARROW else 0,
    )  # fmt: skip


def plot_arbitration(
    contest: Arbitration, names: Sequence[str], ax: Axes | None, upto: int | None
) -> Axes:
    """Draw what each sender puts on the bus, a row each, and the bus below."""
    rows, total = len(contest.frames), len(contest.bus)
    names = names or [str(frame) for frame in contest.frames]
    if len(names) != rows:
        raise ArgumentError(f"there are {len(names)} names for {rows} frames")
    last = total - 1 if upto is None else check_whole("upto", upto, 0, total - 1)
    ax = _axes(ax)
    ax.axvspan(last, last + 1, color="0.93", zorder=0)
    for row, (frame, stopped) in enumerate(zip(contest.frames, contest.stopped, strict=True)):
        end = last if stopped is None else min(last, stopped)
        _bits(ax, frame.bits[: end + 1], set(frame.stuff_positions), row)
        if end == stopped:
            ax.add_patch(
                Rectangle(
                    (stopped, row - 0.34), 1, 0.68,
                    facecolor="none", edgecolor=style.LIMIT["color"], linewidth=2, zorder=3,
                )
            )  # fmt: skip
            ax.hlines(row, stopped + 1, last + 1, color="0.5", linestyle=":", linewidth=1.2)
    winner = contest.winner
    _bits(ax, contest.bus[: last + 1], set(winner.stuff_positions), rows + 0.35)
    ax.axhline(rows - 0.32, color="0.6", linewidth=0.8)
    ax.set_yticks([*range(rows), rows + 0.35], labels=[*names, "bus"])
    ax.set(
        xlim=(-0.2, total + 0.2),
        ylim=(rows + 0.9, -0.6),
        xticks=[place + 0.5 for place in range(total)],
        xticklabels=range(total),
        xlabel="bit on the bus, 0 is the start of frame",
    )
    ax.tick_params(length=0)
    ax.grid(visible=False)
    return ax


def _bits(ax: Axes, bits: str, stuffed: set[int], row: float) -> None:
    """Draw bits as cells of a row."""
    for place, bit in enumerate(bits):
        dominant, own = bit == "0", place in stuffed
        ax.add_patch(
            Rectangle(
                (place, row - 0.34), 1, 0.68,
                facecolor="#2b6ca3" if dominant else style.FIELD["address"] if not own else "white",
                edgecolor="0.75" if dominant and own else "0.5",
                linewidth=0.6, hatch="////" if own else None,
            )
        )  # fmt: skip
        ax.text(
            place + 0.5, row, bit, ha="center", va="center", fontsize=9, family="monospace",
            color="white" if dominant else "black", zorder=4,
            bbox={"facecolor": "#2b6ca3" if dominant else "white", "edgecolor": "none", "pad": 0.6}
            if own else None,
        )  # fmt: skip


def plot_response_times(responses: ResponseTimes, ax: Axes | None) -> Axes:
    """Draw the longest response of each message as a bar, its deadline as a red mark."""
    table, ax = responses.table(), _axes(ax)
    y = np.arange(len(table))
    response = table["response_ms"].to_numpy(dtype=float)
    deadline = table["deadline_ms"].to_numpy(dtype=float)
    met = table["met"].to_numpy(dtype=bool)
    finite = np.isfinite(response)
    ends = np.concatenate([response[finite], deadline])
    left, right = (0.5 * ends.min(), 2 * ends.max()) if len(ends) else (0.1, 10.0)
    width = np.where(finite, response, 10 * right)
    for which, colour, label in ((met, "C0", "met"), (~met, LIMIT["color"], "missed")):
        if which.any():
            ax.barh(y[which], width[which], color=colour, alpha=0.45, label=f"response, {label}")
    if len(table):
        ax.plot(
            deadline, y, linestyle="none", marker="|", markersize=14, markeredgewidth=2.5,
            color=LIMIT["color"], label="deadline",
        )  # fmt: skip
        ax.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=4, frameon=False)
    for place in y[~finite]:
        ax.text(
            right, float(place), "no bound ", ha="right", va="center", color="0.1", fontsize="small"
        )
    ax.set_xscale("log")
    ax.xaxis.set_major_formatter("{x:g}")
    ax.set_xlim(left, right)
    ax.set_ylim(len(table) - 0.4, -0.6)
    ax.set_yticks(y, [str(name) for name in table.index])
    ax.set_xlabel("time [ms]")
    ax.grid(visible=False, axis="y")
    return ax


def plot_run(run: Run, start: float, stop: float | None, ax: Axes | None) -> Axes:
    """Draw who was on the bus when: one lane per message, the highest priority on top."""
    frames, errors = run.events(), run.errors()
    names = run.system.names
    last = np.nanmax([0.0, *frames["end_ms"], *errors["free_ms"]])
    low, high = 1e3 * start, last if stop is None else 1e3 * stop
    if not low < high:
        raise ArgumentError(f"start is {start} s; it must be before stop, {high / 1e3:g} s")
    ends = frames["end_ms"].fillna(high)
    shown = frames[(frames["release_ms"] < high) & (ends > low)]
    ax = _axes(ax)
    sent = shown[shown["outcome"] == "sent"]
    lost = shown[shown["outcome"] == "overwritten"]
    waits = shown[shown["outcome"] != "overwritten"]
    failed = errors[(errors["start_ms"] < high) & (errors["free_ms"] > low)]
    lane = {name: row for row, name in enumerate(names)}
    rows = waits["message"].astype(object).map(lane)
    ax.hlines(
        rows, waits["release_ms"], waits["start_ms"].fillna(high), color="0.45", lw=1, zorder=0.5
    )
    ax.barh(
        sent["message"].astype(object).map(lane),
        sent["end_ms"] - sent["start_ms"],
        left=sent["start_ms"],
        height=0.6,
        color="C0",
        edgecolor="white",
        linewidth=0.5,
        label="frame",
    )
    if len(failed):
        ax.barh(
            failed["message"].map(lane),
            failed["free_ms"] - failed["start_ms"],
            left=failed["start_ms"],
            height=0.6,
            color=LIMIT["color"],
            edgecolor="white",
            linewidth=0.5,
            label="error",
        )
    if len(lost):
        ax.plot(
            lost["release_ms"],
            lost["message"].astype(object).map(lane),
            marker="x",
            color="0.2",
            linestyle="none",
            label="overwritten",
        )
    ax.plot([], [], color="0.45", lw=1, label="waiting")
    ax.set(xlabel="time [ms]", xlim=(low, high), ylim=(len(names) - 0.4, -0.6))
    ax.set_yticks(range(len(names)), names)
    ax.grid(axis="y", visible=False)
    ax.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=4, fontsize=8)
    return ax


def plot_signals(run: Signals, node: int, ax: Axes | None, colour: str) -> Axes:
    """Draw the voltage at a node, and the bits that it reads."""
    row = run.row(node)
    ax = _axes(ax)
    ax.plot(run.t * 1e6, run.v[row], color=colour, label=f"voltage at node {node}")
    top = max(run.v[row].max(), DOMINANT)
    for level, name in ((DOMINANT, "dominant"), (RECESSIVE, "recessive")):
        ax.axhline(level, lw=1, color=LIMIT["color"], linestyle=LIMIT["linestyle"])
        above = level == DOMINANT
        ax.annotate(
            name,
            (0, level),
            (3, 2 if above else -2),
            xycoords=("axes fraction", "data"),
            textcoords="offset points",
            color=LIMIT["color"],
            fontsize=7,
            ha="left",
            va="bottom" if above else "top",
        )
    good = run.bits[row] == run.sent
    for chosen, marker, name in ((good, "o", "sample, right"), (~good, "x", "sample, wrong")):
        if chosen.any():
            ax.plot(
                run.sample_times[chosen] * 1e6,
                run.samples[row, chosen],
                marker,
                color="0.2",
                label=name,
            )
    for when, bit in zip(run.sample_times, run.bits[row], strict=True):
        ax.annotate("?" if bit < 0 else str(bit), (when * 1e6, 1.06 * top), ha="center", fontsize=9)
    ax.set(
        xlabel="time [us]",
        ylabel="voltage [V]",
        xlim=(0, run.t[-1] * 1e6),
        ylim=(min(-0.2, 1.1 * float(np.min(run.v[row]))), 1.2 * top),
    )
    ax.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3, fontsize=8)
    return ax


def plot_log_load(load: LogLoad, ax: Axes | None) -> Axes:
    """Draw the load over time, one line per bus."""
    ax = _axes(ax)
    windows = load.windows()
    for channel in load.total().index:
        own = windows[windows["channel"] == channel]
        time = own["time_s"] - windows["time_s"].min()
        ax.plot(time, 100 * own["load"], label=str(channel))
    ax.set(xlabel="time since the first frame [s]", ylabel="bus load [%]")
    ax.set_ylim(bottom=0)
    if len(load.total()) > 1:
        ax.legend()
    return ax


def _axes(ax: Axes | None) -> Axes:
    """Return the axes given, or new ones."""
    if ax is not None:
        return ax
    import matplotlib.pyplot as plt

    return plt.subplots()[1]
