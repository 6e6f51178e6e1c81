"""Figures of chung1998, drawn from our model: the printed drawings were not available."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes

from shipnet import style
from shipnet.lazy import pd
from shipnet.papers.chung1998.link import as_printed
from shipnet.papers.chung1998.ring import SIZE, given_up, overrun_rings
from shipnet.papers.plot import diagrams, fields
from shipnet.papers.registry import drawing
from shipnet.remote_control.packet import MarkerFormat
from shipnet.remote_control.ring_buffer import Ring
from shipnet.remote_control.simulation import simulate

if TYPE_CHECKING:
    from shipnet.remote_control.simulation import Run

#: Numbers and values of the data items in the packet that is drawn.
_ITEMS = {0: 1, 3: 120, 4: 0x1234}

# The stations follow the text of section 2, the flow charts that of sections 4 to 4.3.
diagrams("chung1998", "Fig 1", "Fig 5", "Fig 6", "Fig 7", "Fig 8(a)", "Fig 8(b)")


@drawing("chung1998", "Fig 2")
def _turns(*, processing: float = 10e-3, until: float = 0.4, ax: Axes) -> Axes:
    """Draw the packets of some cycles, each followed by an assumed processing time [s]."""
    return simulate(as_printed(processing=processing), until=until).plot(ax=ax)


@drawing("chung1998", "Fig 3", figsize=(4, 3.6))
def _ring(*, unread: int = 6, get_no: int = 14, size: int = 16, ax: Axes) -> Axes:
    """Draw a ring with unread bytes, the first of them at `get_no`."""
    return Ring.filled(unread, get_no, size=size).plot(ax=ax)


@drawing("chung1998", "Fig 4")
def _packets(*, items: Mapping[int, int] = _ITEMS, ax: Axes) -> Axes:
    """Draw the bytes of the same data in the three readings of the packet."""
    rows = {
        "reading A": [MarkerFormat("A").encode(items)],
        "reading B": [MarkerFormat("B").encode(items)],
        "reading C": [MarkerFormat("A").encode({number: value}) for number, value in items.items()],
    }
    kinds = {"flag": "control", "number": "address", "low": "information", "high": "parity"}
    drawn = {}
    for reading, packets in rows.items():
        drawn[reading] = [
            (f"{byte:02X}", kinds[kind], kind, 1)
            for packet in packets
            for byte, kind in zip(packet, _kinds(reading, len(packet)), strict=True)
        ]
    return fields(ax, drawn)


def _kinds(reading: str, size: int) -> list[str]:
    """Return the meaning of each byte of a packet."""
    item = ["number", "low", "high"]
    if reading == "reading B":
        return ["flag", *(["flag", *item] * ((size - 2) // 4)), "flag"]
    return ["flag", "flag", *(item * ((size - 3) // 3)), "flag"]


def plot_delays(tables: Mapping[str, pd.DataFrame], *, ax: Axes) -> Axes:
    """Draw the delay of a switch against the bit rate."""
    for row, (name, table) in enumerate(tables.items()):
        rate = table["bit_rate"].to_numpy(dtype=float)
        colour = f"C{row}"
        ax.plot(rate, table["longest_s"], "v", color=colour, label=f"{name}: longest")
        ax.plot(rate, table["mean_s"], "o", mfc="white", color=colour, label=f"{name}: mean")
    ax.plot(rate, table["bound_s"], color=colour, label="bound, all data")
    ax.set(xscale="log", yscale="log", xlabel="bit rate [bit/s]", ylabel="delay [s]")
    ax.set_xticks(rate, [f"{one:g}" for one in rate])
    ax.set_xticks([], minor=True)
    ax.yaxis.set_major_formatter("{x:g}")
    ax.legend(loc="center left", bbox_to_anchor=(1, 0.5))
    return ax


def plot_switch(runs: Mapping[str, Run], number: int, *, ax: Axes) -> Axes:
    """Draw the state of a bridge switch over time, and what the safety system shows for it."""
    first = next(iter(runs.values()))
    rows = {"BCS: the switch": first.history(number, "BCS")}
    rows |= {f"SS: {name}": run.history(number, "SS") for name, run in runs.items()}
    for row, points in enumerate(rows.values()):
        times = [*points["time_s"], first.until]
        values = points["value"].tolist()
        low = 1.5 * (len(rows) - 1 - row)
        ax.plot(
            times, low + np.array([*values, values[-1]]), drawstyle="steps-post", color=f"C{row}"
        )
    ax.set_yticks([1.5 * (len(rows) - 1 - row) + 0.5 for row in range(len(rows))], list(rows))
    ax.set(xlabel="time [s]", xlim=(0, first.until))
    ax.grid(visible=False, axis="y")
    return ax


@drawing("chung1998", "Fig 9")
def _given_up(*, ax: Axes, items: int = 10) -> Axes:
    """Draw how many bytes the repair of Fig 9 discards, against the writer's place."""
    places = np.arange(SIZE)
    alone = given_up()
    band = np.reshape(given_up(overrun_rings(items)), (SIZE, -1))
    ax.fill_between(
        places,
        band.min(axis=1),
        band.max(axis=1),
        color="#f5c56b",
        alpha=0.6,
        label="with the search for 0xCC",
    )
    ax.plot(places, SIZE // 2 - places % (SIZE // 2), color="C0", label="half ring, closed form")
    ax.plot(places[::4], alone[::4], "o", markersize=3, color="C0", label="half ring, simulated")
    ax.axhline(0, color="C2", label="corrected ring")
    ax.set(xlabel="no [index]", ylabel="discarded bytes [byte]", xlim=(0, SIZE - 1))
    ax.set_xticks([0, 32, 64, 96, 127])
    ax.legend(loc="center left", bbox_to_anchor=(1, 0.5))
    return ax


def plot_recovered(table: pd.DataFrame, *, ax: Axes) -> Axes:
    """Draw how many packets are found in a ring after a pause in reading."""
    waiting = table["waiting"]
    ax.plot(waiting, table["sent"], color="0.6", linewidth=1, label="packets received")
    for name, colour in (("corrected", "C2"), ("intended", "C0")):
        ax.plot(
            waiting,
            table[name],
            drawstyle="steps-post",
            color=colour,
            label=f"{name} ring" + ", mean" * (name == "intended"),
        )
    ax.fill_between(
        waiting,
        table["fewest"],
        table["most"],
        color="C0",
        alpha=0.15,
        label="range over the places",
        step="post",
    )
    for full, text in ((SIZE, "ring full"), (2 * SIZE, "looks empty")):
        ax.axvline(full, color=style.LIMIT["color"], linestyle=style.LIMIT["linestyle"])
        ax.annotate(
            text,
            (full, 1.0),
            (4, -10),
            xycoords=("data", "axes fraction"),
            textcoords="offset points",
            color=style.LIMIT["color"],
        )
    ax.set(xlabel="bytes received before the reader looks [byte]", ylabel="packets found")
    ax.set_xlim(0, waiting.iloc[-1])
    ax.legend(loc="upper left")
    return ax
