"""Figures of Modbus lines, drawn by the `plot` methods of waveforms, loops and runs."""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle

from shipnet import style
from shipnet.clock import Fault
from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar
from shipnet.modbus.faults import Break, DeadPort, DeadSlave, Short
from shipnet.modbus.redundancy import Loop
from shipnet.modbus.simulation import Run
from shipnet.modbus.uart import Waveform

#: Colour and word of what serves a slave.
_SERVED = {"A": ("C0", "through A"), "B": ("C1", "through B"), "-": ("0.75", "lost")}

#: More slaves than this are drawn without their numbers.
_NUMBERED = 40

#: Colour of each outcome of a try.
_OUTCOME = {"request": "C0", "response": "C2", "no response": style.LIMIT["color"]}


def plot_waveform(waveform: Waveform, ax: Axes | None = None) -> Axes:
    """Draw the level over time [ms], the data bits shaded, each byte above its character."""
    ax = plt.gca() if ax is None else ax
    line, time, level = waveform.line, waveform.time, waveform.level
    found = waveform.decode()
    low, high = float(level.min()), float(level.max())
    differential = waveform.threshold == 0
    span, bit = high - low, 1e3 / line.bit_rate
    for start, value in zip(found.time * 1e3, found.value, strict=True):
        ax.add_patch(
            Rectangle(
                (start + bit, low), 8 * bit, span,
                facecolor=style.FIELD["information"], edgecolor="none", alpha=0.6,
            )
        )  # fmt: skip
        middle = start + line.character_bits * bit / 2
        ax.text(
            middle, high + 0.08 * span, f"{value:02X}", ha="center", va="bottom", family="monospace"
        )
    ax.plot(time * 1e3, level, drawstyle="steps-post", color="C0")
    ax.set(
        xlabel="time [ms]",
        ylabel="D1 - D0 [V]" if differential else "level",
        ylim=(low - 0.1 * span, high + 0.4 * span),
        xlim=(0, time[-1] * 1e3),
    )
    if not differential:
        ax.set_yticks([0, 1])
    return ax


def plot_loop(loop: Loop, faults: Sequence[Fault], ax: Axes | None = None) -> Axes:
    """Draw a loop with equal scales and no frame; the legend counts the slaves."""
    ax = plt.gca() if ax is None else ax
    served = loop.reach(faults).served
    n = loop.n_slaves
    # From port A on the left over the top and back to port B on the right of the master.
    angle = np.linspace(-0.6 * np.pi, -2.4 * np.pi, n + 2)
    x, y = np.cos(angle), np.sin(angle)
    cables = [f for f in faults if isinstance(f, Break | Short)]
    broken = {f.section for f in faults if isinstance(f, Break)}
    shorted = {f.section for f in faults if isinstance(f, Short)}
    red = style.LIMIT["color"]
    for k in range(loop.n_sections):
        arc = np.linspace(angle[k], angle[k + 1], 12)
        bad = k in broken | shorted
        ax.plot(
            np.cos(arc), np.sin(arc), zorder=4 if bad else 1, label=f"_section {k}",
            color=red if bad else "0.3",
            linestyle=":" if k in broken else "-", linewidth=4 if k in shorted else 1.5,
        )  # fmt: skip
        if bad:
            words = "\n".join(str(f) for f in cables if f.section == k)
            ax.text(
                1.15 * np.cos(arc[6]), 1.15 * np.sin(arc[6]), words,
                color=red, fontsize=8, ha="center", va="center",
            )  # fmt: skip
    for port, (colour, words) in _SERVED.items():
        own = np.flatnonzero(np.array(served) == port) + 1
        if own.size:
            ax.plot(
                x[own], y[own], "o", color=colour, markersize=14 if n <= _NUMBERED else 4,
                label=f"{own.size} {words}", zorder=2,
            )  # fmt: skip
    if n <= _NUMBERED:
        for s in range(1, n + 1):
            ax.text(x[s], y[s], str(s), ha="center", va="center", fontsize=8, zorder=3)
    ax.add_patch(
        Rectangle((-0.42, y[0] - 0.16), 0.84, 0.26, facecolor="white", edgecolor="0.2", zorder=3)
    )
    ax.text(0, y[0] - 0.03, "master", ha="center", va="center", fontsize=9, zorder=5)
    for s, port in ((0, "A"), (n + 1, "B"))[: 1 + loop.closed]:
        ax.text(x[s], y[s] - 0.03, port, ha="center", va="center", fontweight="bold", zorder=5)
    dead = [f.slave for f in faults if isinstance(f, DeadSlave)]
    dead += [0 if f.port == "A" else n + 1 for f in faults if isinstance(f, DeadPort)]
    if dead:
        ax.plot(x[dead], y[dead], "x", color=red, markersize=14, zorder=6, label="_dead")
    ax.legend(loc="center")
    ax.set(xlim=(-1.35, 1.35), ylim=(-1.25, 1.25), aspect="equal")
    ax.set_axis_off()
    return ax


def plot_run(
    run: Run, ax: Axes | None = None, *, start: float | None = None, stop: float | None = None
) -> Axes:
    """Draw what is on the line at both ports, as a scope with two channels would show it."""
    ax = plt.gca() if ax is None else ax
    begin = check_scalar("start", 0.0 if start is None else start, "s", 0, 1e5)
    end = check_scalar("stop", run.until if stop is None else stop, "s", 0, 1e6)
    if not end > begin:
        raise ArgumentError(f"stop is {end:g} s; it must be later than start, {begin:g} s")
    polls = run.events()
    polls = polls[(polls["end_s"] > begin) & (polls["start_s"] < end)]
    poll = run.system.poll
    request = poll.line.frame_time(poll.request_size)
    response = poll.line.frame_time(poll.response_size)
    for row, port in ((1.0, "A"), (0.0, "B")):
        own = polls[polls["port"] == port]
        first, answered = own["start_s"].to_numpy(), own["answered"].to_numpy()
        silent = first[~answered] + request
        answers = first[answered] + poll.time - poll.line.t35 - response
        for (name, colour), begins, length, height in zip(
            _OUTCOME.items(),
            (first, answers, silent),
            (request, response, poll.timeout),
            (0.6, 0.6, 0.15),
            strict=True,
        ):
            ax.broken_barh(
                [(at, length) for at in begins], (row, height), facecolor=colour,
                label=name if port == "A" else f"_{name}",
            )  # fmt: skip
    for fault in run.faults:
        for at, words in ((fault.start, str(fault)), (fault.stop, f"{fault} repaired")):
            if begin <= at <= end:
                ax.axvline(
                    at, color=style.LIMIT["color"], linestyle=style.LIMIT["linestyle"], linewidth=1
                )
                ax.annotate(
                    f" {words}", (at, 1.75), color=style.LIMIT["color"], fontsize=8, va="center"
                )
    ax.set_yticks([1.3, 0.3], labels=["port A", "port B"])
    ax.set(xlabel="time [s]", xlim=(begin, end), ylim=(-0.2, 1.95))
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.2), ncols=3, frameon=False)
    return ax
