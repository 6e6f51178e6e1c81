"""Figures of kim2023, drawn from the text and from our models: no printed figure was available."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes

from shipnet import datasets, style
from shipnet.asi.modulation import Modulation, Pulses
from shipnet.asi.profile import Profile
from shipnet.asi.telegram import Request, Response
from shipnet.asi.timing import Transaction
from shipnet.asi.topologies import line
from shipnet.design.iolist import IoList, read_iolist
from shipnet.design.plant import lines_needed
from shipnet.papers.kim2023.protocol import EXAMPLE_REQUEST, EXAMPLE_RESPONSE
from shipnet.papers.kim2023.signals import DAMAGE
from shipnet.papers.plot import FILL, box, diagrams, panels
from shipnet.papers.registry import drawing

_RECORD: dict[str, Any] = {"dt": 50e-9, "before": 0, "after": 9.2e-6}


drawing("kim2023", "Fig 1", figsize=(6.4, 4))(lambda *, ax: _valves().plot("home runs", ax=ax))
drawing("kim2023", "Fig 2", figsize=(6.4, 4))(lambda *, ax: _valves().plot("AS-i", ax=ax))
drawing("kim2023", "Table 7", figsize=(6.4, 2.4))(Profile.plot_table)
diagrams("kim2023", "Fig 10", height=2.2, arrowstyle="-")


def _valves() -> IoList:
    return read_iolist(datasets.path("synthetic_iolist_valves.csv"))


@drawing("kim2023", "Fig 3", "Fig 4")
def _near_and_far(*, near: float = 5.0, far: float = 100.0, ax: Axes) -> Axes:
    """Draw the responses of a slave near the supply and of one far from it."""
    wave = line(100, slaves=(near, far)).waveform(Response(0x6), **_RECORD)
    for volts, name, look in zip(wave.u, wave.names, ("-", "--"), strict=True):
        ax.plot(wave.t * 1e6, volts, look, label=f"slave at {name}")
    ax.set(xlabel="time [µs]", ylabel="voltage at the master [V]")
    style.legend(ax)
    return ax


@drawing("kim2023", "Fig 5", figsize=(6.4, 6))
def _message(*, request: str = EXAMPLE_REQUEST, response: str = EXAMPLE_RESPONSE, ax: Axes) -> Axes:
    """Draw the example with its bits as printed, and with the parity bit corrected."""
    right = Request.data_exchange(21, 0xE).bits
    titles = {"as printed": request, "corrected": right}
    for panel, (title, bits) in zip(panels(ax, 2, sharex=True), titles.items(), strict=True):
        Transaction().plot(bits, response, panel)
        panel.set_title(f"{title}: parity bit PB = {bits[12]}", loc="left")
        panel.label_outer()
    return ax


@drawing("kim2023", "Fig 6", figsize=(6.4, 8))
def _errors(*, ax: Axes) -> Axes:
    """Draw seven pulse trains with one error each, the damaged slots shaded."""
    signs = [*Modulation(Response(0x6).bits).pulses.signs, 0, 0]
    for panel, (name, changes) in zip(panels(ax, 7, sharex=True), DAMAGE.items(), strict=True):
        Pulses([changes.get(k, sign) for k, sign in enumerate(signs)]).plot(
            panel, faults=[*changes]
        )
        panel.set_ylabel(name, rotation=0, ha="right", va="center")
        panel.label_outer()
    return ax


@drawing("kim2023", "Fig 7", figsize=(6.4, 2.8))
def _string_of_valves(*, valves: int = 400, ax: Axes) -> Axes:
    """Draw valves on one of the AS-i strings that this many valves need."""
    lines, shown = lines_needed(valves), 3
    box(ax, (-2.6, 0.15), 1.5, 0.7, FILL["blue"], "master")
    box(ax, (-2.6, 1.15), 1.5, 0.7, FILL["amber"], "supply")
    ax.plot([-1.1, shown + 1.3], [0.5, 0.5], color="C1", lw=3, zorder=1)
    ax.plot([-1.85, -1.85], [0.85, 1.15], color="C1", lw=3, zorder=1)
    places = [*range(shown), shown + 1.3]
    numbers = [*(f"{k + 1}" for k in range(shown)), f"{-(-valves // lines)}"]
    for x, number in zip(places, numbers, strict=True):
        ax.plot([x, x], [0.5, -0.05], color="C1", lw=2, zorder=1)
        box(ax, (x - 0.42, -0.5), 0.84, 0.45, FILL["green"], "head")
        ax.plot([x, x], [-0.5, -0.85], color="0.3", lw=2)
        half = np.array([[-0.36, -1.05], [-0.36, -0.65], [0, -0.85]])
        for side in (half, half * [-1, 1]):
            ax.fill(x + side[:, 0], side[:, 1], facecolor="white", edgecolor="0.2")
        ax.text(x, -1.15, f"valve\n{number}", ha="center", va="top")
    ax.text(shown + 0.15, -0.28, "...", ha="center", va="center", fontsize=14)
    words = f"AS-i string 1 of {lines} for {valves} valves"
    ax.text(shown / 2, 0.62, words, ha="center", va="bottom")
    return style.bare(ax, (-2.8, shown + 1.9), (-1.85, 2.0))


@drawing("kim2023", "Fig 9")
def _index_table(*, ax: Axes) -> Axes:
    """Draw ten drive units and twenty airboxes around an index table, all on one line."""
    slaves = 30
    angle = np.pi - 2 * np.pi * (np.arange(slaves) + 0.5) / slaves
    turn = np.linspace(0, 2 * np.pi, 200)
    ax.fill(0.72 * np.cos(turn), 0.72 * np.sin(turn), color="0.93")
    ax.text(0, 0, "rotary\nindex table", ha="center", va="center")
    x, y = np.cos(angle), np.sin(angle)
    ax.plot([-1.35, *x], [0, *y], color="0.3", lw=1, zorder=0)
    drive = np.arange(slaves) % 3 == 0
    ax.plot(x[drive], y[drive], "s", color="C1", markersize=7, label="10 drive units")
    ax.plot(x[~drive], y[~drive], "o", color="C0", markersize=7, label="20 airboxes")
    box(ax, (-2.15, -0.16), 0.8, 0.32, FILL["blue"], "master")
    ax.legend(loc="center left", bbox_to_anchor=(0.95, 0.5))
    ax.set_aspect("equal")
    return style.bare(ax, (-2.3, 1.2), (-1.15, 1.15))


@drawing("kim2023", "Table 3", figsize=(6.4, 8))
def _six_steps(*, data: int = 0x6, ax: Axes) -> Axes:
    """Draw the six steps from bits to pulses and back."""
    response = Response(data)
    wave = line(100, slaves=(5, 100)).waveform(response, "5 m", **_RECORD)
    Modulation(response.bits).plot(wave, axes=panels(ax, 6, sharex=True))
    return ax
