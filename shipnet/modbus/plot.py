"""Figures of Modbus lines: bytes on a UART, redundant loops, a change-over in time."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle

from shipnet import style
from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar
from shipnet.modbus.ring.faults import Break, DeadPort, DeadSlave, Fault, Short
from shipnet.modbus.ring.loop import Loop
from shipnet.modbus.ring.run import Run
from shipnet.modbus.timing import Serial
from shipnet.modbus.uart import decode_uart, uart_waveform

__all__ = ["plot_channels", "plot_loop", "plot_switch_over", "plot_uart"]

Floats = npt.NDArray[np.float64]

#: Colour and word of what serves a slave.
_SERVED = {"A": ("C0", "through A"), "B": ("C1", "through B"), "-": ("0.75", "lost")}

#: More slaves than this are drawn without their numbers.
_NUMBERED = 40

#: Colour of each outcome of a try.
_OUTCOME = {"request": "C0", "response": "C2", "no response": style.LIMIT["color"]}


def plot_uart(
    frames: bytes | list[bytes],
    serial: Serial,
    *,
    ax: Axes,
    gap: float | None = None,
    differential: float | None = None,
) -> Axes:
    """Draw the level on the line during frames, each byte written above its character.

    Parameters
    ----------
    frames : bytes or list of bytes
        What is sent.
    serial : Serial
        Settings of the line.
    ax : matplotlib.axes.Axes
        Where to draw.
    gap : float, optional
        Silence around the frames [s]; t3.5 if omitted.
    differential : float, optional
        Draw the voltage of RS-485, plus and minus this [V], instead of the level.

    Returns
    -------
    matplotlib.axes.Axes
        The axes given; x is in milliseconds. Data bits are shaded, start, parity and stop are not.
    """
    time, level = uart_waveform(frames, serial, gap=gap, differential=differential)
    found = decode_uart(time, level, serial, threshold=0.0 if differential else 0.5)
    low, high = (-differential, differential) if differential else (0.0, 1.0)
    span, bit = high - low, 1e3 / serial.bit_rate
    for start, value in zip(found.time * 1e3, found.value, strict=True):
        ax.add_patch(
            Rectangle(
                (start + bit, low), 8 * bit, span,
                facecolor=style.FIELD["information"], edgecolor="none", alpha=0.6,
            )
        )  # fmt: skip
        middle = start + serial.character_bits * bit / 2
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


def plot_channels(channels: Mapping[str, tuple[npt.ArrayLike, npt.ArrayLike]], *, ax: Axes) -> Axes:
    """Draw several traces one below the other, as an oscilloscope does.

    Parameters
    ----------
    channels : mapping of str to (time, level)
        Name of each channel, first on top, its times [s] and its levels from then on, both of
        shape (n_samples,).
    ax : matplotlib.axes.Axes
        Where to draw.

    Returns
    -------
    matplotlib.axes.Axes
        The axes given; x is in milliseconds, and each trace has its own scale, with its lowest
        and highest value written at its right end.

    Raises
    ------
    ArgumentError
        If there is no channel, or times and levels do not fit each other.
    """
    if not channels:
        raise ArgumentError("channels is empty; there must be one or more")
    middles = []
    for place, (name, (time, level)) in enumerate(channels.items()):
        at, value = np.asarray(time, dtype=np.float64), np.asarray(level, dtype=np.float64)
        if at.ndim != 1 or at.shape != value.shape or not at.size:
            raise ArgumentError(
                f"channel {name!r} has times of shape {at.shape} and levels of {value.shape}; "
                "they must be equal rows"
            )
        low, high = float(np.nanmin(value)), float(np.nanmax(value))
        base = -1.5 * place
        # A trace that never changes lies in the middle of its place.
        unit = (value - low) / (high - low) if high > low else np.full(value.shape, 0.5)
        ax.plot(at * 1e3, base + unit, drawstyle="steps-post", color=f"C{place}", label=name)
        for text, height in ((low, base), (high, base + 1)):
            ax.annotate(
                f"{text:g}", (1.01, height), xycoords=("axes fraction", "data"), fontsize=8,
                va="center", annotation_clip=False,
            )  # fmt: skip
        middles.append(base + 0.5)
    ax.set_yticks(middles, labels=list(channels))
    ax.set(xlabel="time [ms]", ylim=(-1.5 * (len(channels) - 1) - 0.25, 1.25))
    return ax


def plot_loop(loop: Loop, faults: list[Fault] | None = None, *, ax: Axes) -> Axes:
    """Draw a loop, what has failed in it, and from which port each slave is served.

    Parameters
    ----------
    loop : Loop
        The loop.
    faults : list of Fault, optional
        What has failed, drawn in red: a break is a gap in the line, a short a heavy line, a dead
        slave or port a cross. Their times are not looked at.
    ax : matplotlib.axes.Axes
        Where to draw.

    Returns
    -------
    matplotlib.axes.Axes
        The axes given, with equal scales and no frame; the legend counts the slaves.
    """
    failed = list(faults or [])
    served = loop.reach(failed).served
    n = loop.n_slaves
    # From port A on the left over the top and back to port B on the right of the master.
    angle = np.linspace(-0.6 * np.pi, -2.4 * np.pi, n + 2)
    x, y = np.cos(angle), np.sin(angle)
    cables = [f for f in failed if isinstance(f, Break | Short)]
    broken = {f.section for f in failed if isinstance(f, Break)}
    shorted = {f.section for f in failed if isinstance(f, Short)}
    red = style.LIMIT["color"]
    for k in range(n + 1):
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
    for s, port in ((0, "A"), (n + 1, "B")):
        ax.text(x[s], y[s] - 0.03, port, ha="center", va="center", fontweight="bold", zorder=5)
    dead = [f.slave for f in failed if isinstance(f, DeadSlave)]
    dead += [0 if f.port == "A" else n + 1 for f in failed if isinstance(f, DeadPort)]
    if dead:
        ax.plot(x[dead], y[dead], "x", color=red, markersize=14, zorder=6, label="_dead")
    ax.legend(loc="center")
    ax.set(xlim=(-1.35, 1.35), ylim=(-1.25, 1.25), aspect="equal")
    ax.set_axis_off()
    return ax


def plot_switch_over(
    run: Run, *, ax: Axes, start: float | None = None, stop: float | None = None
) -> Axes:
    """Draw what is on the line at both ports, as a scope with two channels would show it.

    Parameters
    ----------
    run : Run
        A simulation.
    ax : matplotlib.axes.Axes
        Where to draw.
    start, stop : float, optional
        From when to when [s]; the whole simulation if omitted.

    Returns
    -------
    matplotlib.axes.Axes
        The axes given; x is in seconds, port A is above. A request that stays without a response
        is red until its time-out. Faults are red dashed lines with their names.
    """
    begin = check_scalar("start", 0.0 if start is None else start, "s", 0, 1e5)
    end = check_scalar("stop", run.duration if stop is None else stop, "s", 0, 1e6)
    if not end > begin:
        raise ArgumentError(f"stop is {end:g} s; it must be later than start, {begin:g} s")
    polls = run.polls
    polls = polls[(polls["end_s"] > begin) & (polls["start_s"] < end)]
    poll = run.system.poll
    request = poll.serial.frame_time(poll.request_size)
    response = poll.serial.frame_time(poll.response_size)
    for row, port in ((1.0, "A"), (0.0, "B")):
        own = polls[polls["port"] == port]
        first, answered = own["start_s"].to_numpy(), own["answered"].to_numpy()
        silent = first[~answered] + request
        answers = first[answered] + poll.answered - poll.serial.t35 - response
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
        for at, words in ((fault.start, str(fault)), (fault.stop, f"{fault} mended")):
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
