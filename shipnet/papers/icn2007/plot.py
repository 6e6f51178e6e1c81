"""Figures of icn2007, drawn from our models: the printed curves were not available."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes

from shipnet import style
from shipnet.asi.modulation import HALF_BIT, Modulation
from shipnet.asi.plan import Comparison
from shipnet.asi.receiver import TOLERANCE
from shipnet.asi.slave import Slave
from shipnet.asi.states import ExchangeStates
from shipnet.asi.telegram import Request
from shipnet.asi.timing import Transaction
from shipnet.asi.topologies import line
from shipnet.line.cable import CABLES, Cable
from shipnet.papers.icn2007 import MODULATIONS, levels_of, modulation_table
from shipnet.papers.plot import panels
from shipnet.papers.registry import drawing

#: The example request, and the cable with a skin effect that we assume.
REQUEST = Request.data_exchange(21, 0xE)
SKIN = Cable(r=0.03, l=0.65e-6, c=65e-12, skin=30e3)


drawing("icn2007", "Fig 9", figsize=(6.4, 3))(
    lambda *, ax: Transaction().plot(REQUEST, REQUEST.answer(0x6), ax)
)
drawing("icn2007", "Fig 3.19", figsize=(6.5, 3.4))(
    lambda *, ax: ExchangeStates([Slave("21")]).plot("21", ax=ax)
)


@drawing("icn2007", "Fig 7a/7b", figsize=(6.4, 4.6))
def _bits_and_pulses(*, at: float = 50.0, ax: Axes) -> Axes:
    """Draw bits, current and voltage of the example request."""
    wave = line(100, slaves=(5, at, 100)).waveform(
        REQUEST, f"{at:g} m", dt=50e-9, before=0, after=18.4e-6
    )
    Modulation(REQUEST.bits).plot(wave, axes=panels(ax, 3, sharex=True))
    return ax


@drawing("icn2007", "Fig 8", figsize=(6.4, 6))
def _eyes(*, lengths: tuple[float, ...] = (100, 150, 200), ax: Axes) -> Axes:
    """Draw the eye diagrams of a near and a far slave on cables of these lengths [m]."""
    for panel, length in zip(panels(ax, len(lengths), sharex=True), lengths, strict=True):
        wave = line(length, slaves=(5, length)).waveform(dt=50e-9, before=5e-6, after=55.4e-6)
        wave.eye().plot(panel)
        panel.set(title=f"{length} m", ylim=(-0.6, 1.1))
        panel.label_outer()
        panel.legend().remove()
    return ax


@drawing("icn2007", "Fig 4-1", figsize=(6.4, 5))
def _impedance_and_spectrum(*, cable: Cable = CABLES["as-i 1.5"], ax: Axes) -> Axes:
    """Draw the impedance of the cable, and the spectrum of the example request."""
    f = np.geomspace(1e3, 1e6, 4000)
    s = 2j * np.pi * f
    marked, series = [1, 2e-3 / HALF_BIT], cable.series_impedance(s)
    level = Modulation(REQUEST.bits).spectrum(f)
    curves = {
        "series\nimpedance [Ω/m]": np.abs(series),
        "characteristic\nimpedance [Ω]": np.abs(np.sqrt(series / cable.shunt_admittance(s))),
        "signal, relative\nto its maximum": level / level.max(),
    }
    for panel, (name, values) in zip(panels(ax, 3, sharex=True), curves.items(), strict=True):
        panel.plot(f / 1e3, values)
        panel.axvline(2e-3 / HALF_BIT, color="0.45", linestyle="--")
        panel.set(ylabel=name, ylim=(0, None), xlim=(1, 1000))
        panel.plot(marked, np.interp(marked, f / 1e3, values), "C0o", clip_on=False)
    panel.text(600, 0.95, "667 kHz", ha="right", va="top", color="0.45")
    panel.set_xlabel("frequency [kHz]")
    style.logarithmic(panel.xaxis)
    return ax


@drawing("icn2007", "Fig 4-2")
def _attenuation(*, ax: Axes) -> Axes:
    """Draw the attenuation of 100 m of cable."""
    f = np.arange(0.5e3, 800e3, 1e3)
    cables = {"constant resistance": CABLES["as-i 1.5"], "skin effect, assumed": SKIN}
    for (name, cable), look in zip(cables.items(), ("-", "--"), strict=True):
        loss = 100 * cable.attenuation(f)
        ax.plot(f / 1e3, loss, "C3" + look)
        ax.text(800, loss[-1] + 0.02, name, color="C3", ha="right")
    ax.set(xlabel="frequency [kHz]", ylabel="loss [dB / 100 m]", xlim=(0, 800), ylim=(0, 0.6))
    return ax


def plot_modulations(ax: Axes) -> Axes:
    """Draw the spectrum of the example request for each modulation at the same bit rate."""
    f, bits = np.arange(0.5e3, 1e6, 1e3), REQUEST.bits
    table = modulation_table()
    for panel, name in zip(panels(ax, 5, sharex=True), ("APM", *MODULATIONS), strict=True):
        if name == "APM":
            level = Modulation(bits).spectrum(f)
        else:
            levels, x = levels_of(bits, name), f * HALF_BIT / 2
            code = levels @ np.exp(-2j * np.pi * np.outer(np.arange(levels.size), x))
            level = np.abs(np.sinc(x) * code)
        panel.fill_between(f / 1e3, 100 * level**2 / (level**2).max())
        panel.axvline(2e-3 / HALF_BIT, color="0.45", linestyle="--")
        dc, high = 100 * table.loc[name]
        panel.text(655, 95, f"{name}\nmean (DC) {dc:.0f} %", ha="right", va="top")
        panel.text(680, 95, f"above 667 kHz:\n{high:.1f} %", va="top")
        panel.set(xlim=(0, 1000), yticks=[0, 50, 100])
        if name == "Manchester":  # the middle panel
            panel.set_ylabel("power [% of the highest]")
    panel.set_xlabel("frequency [kHz]")
    return ax


def plot_lengths(ends: Mapping[str, Comparison], ax: Axes) -> Axes:
    """Draw weakest pulse and ringing over the cable length, for up to two ends of the cable."""
    rows = {"evenness": ("weakest pulse", "at least"), "ringing": ("ringing", "at most")}
    for panel, (column, (name, word)) in zip(panels(ax, 2, sharex=True), rows.items(), strict=True):
        for (end, compared), look in zip(ends.items(), ("-", ".-"), strict=False):
            part = 100 * compared.table()[column]
            panel.plot(part, look)
            panel.text(1.01, part.iloc[-1], end, transform=panel.get_yaxis_transform(), va="center")
        limit, red = 100 * getattr(TOLERANCE, column), style.LIMIT["color"]
        panel.axhline(limit, color=red, linestyle="--")
        panel.text(part.index[0], limit - 2, f"{word} {limit:g} %", color=red, va="top")
        panel.set(ylabel=f"{name} [%]", ylim=(0, None))
    panel.set_xlabel("length of the cable [m]")
    return ax
