"""Figures of chung1998, drawn from our model: the printed drawings were not available."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from shipnet import style
from shipnet.lazy import pd
from shipnet.papers.chung1998.link import as_printed
from shipnet.papers.chung1998.ring import SIZE, given_up
from shipnet.papers.plot import diagrams, fields
from shipnet.papers.registry import drawing
from shipnet.remote_control.packet import MarkerFormat
from shipnet.remote_control.ring_buffer import Ring
from shipnet.remote_control.simulation import Run, simulate

# The stations follow the text of section 2, the flow charts that of sections 4 to 4.3.
diagrams("chung1998", "Fig 1", "Fig 6", "Fig 8(b)", height=3.8)
diagrams("chung1998", "Fig 5", "Fig 8(a)")
diagrams("chung1998", "Fig 7", height=2.4)
# We assume that each packet takes 10 ms to process.
drawing("chung1998", "Fig 2")(
    lambda *, ax: simulate(as_printed(processing=10e-3), until=0.4).plot(ax=ax)
)
drawing("chung1998", "Fig 3", figsize=(4, 3.6))(
    lambda *, ax: Ring.filled(6, get_no=14, size=16).plot(ax=ax)
)


@drawing("chung1998", "Fig 4", figsize=(6.4, 2.6))
def _packets(*, items: Mapping[int, int] | None = None, ax: Axes) -> Axes:
    """Draw the bytes of the same data in the three readings of the packet."""
    sent = items or {3: 120, 4: 0x1234}
    start, data, item, end = ["start"], ["data"], ["item", "low", "high"], ["end"]
    a, b = (MarkerFormat(reading).encode(sent) for reading in ("A", "B"))
    c = b"".join(MarkerFormat("A").encode({number: sent[number]}) for number in sent)
    rows = {
        "reading A": (a, start + data + len(sent) * item + end),
        "reading B": (b, start + len(sent) * (data + item) + end),
        "reading C": (c, len(sent) * (start + data + item + end)),
    }
    kinds = {"item": "address", "low": "information", "high": "parity"}
    return fields(
        ax,
        {
            reading: [
                (f"{byte:02X}", kinds.get(word, "control"), word, 1)
                for byte, word in zip(*row, strict=True)
            ]
            for reading, row in rows.items()
        },
    )


def plot_delays(tables: Mapping[str, pd.DataFrame], *, ax: Axes) -> Axes:
    """Draw the delay of a switch against the bit rate."""
    for row, (name, table) in enumerate(tables.items()):
        rate = table["bit_rate"].to_numpy(dtype=float)
        colour, hidden = f"C{row}", "_" if row else ""
        ax.plot(rate, table["longest_s"], "v", color=colour, label=f"{hidden}longest")
        ax.plot(rate, table["mean_s"], "o", mfc="white", color=colour, label=f"{hidden}mean")
        ax.text(1.1 * rate[2], 1.3 * table["longest_s"].iloc[2], name, color=colour)
    ax.plot(rate, table["bound_s"], color=colour, label="upper bound")
    ax.set(xscale="log", yscale="log", xlabel="bit rate [bit/s]", ylabel="delay [s]")
    ax.set_xticks(rate, [f"{one:g}" for one in rate])
    ax.set_xticks([], minor=True)
    ax.yaxis.set_major_formatter("{x:g}")
    style.legend(ax)
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
        ax.step(times, low + np.array([*values, values[-1]]), where="post", color=f"C{row}")
    ax.set_yticks([1.5 * (len(rows) - 1 - row) + 0.5 for row in range(len(rows))], list(rows))
    ax.set(xlabel="time [s]", xlim=(0, first.until))
    ax.grid(visible=False, axis="y")
    return ax


@drawing("chung1998", "Fig 9")
def _given_up(*, ax: Axes, items: int = 10) -> Axes:
    """Draw how many bytes the repair of Fig 9 discards, against the writer's place."""
    places = np.arange(SIZE)
    lost = np.reshape(given_up(items), (SIZE, -1))
    band: Any = {"color": "#f5c56b", "alpha": 0.6, "linewidth": 0}
    ax.fill_between(places, lost.min(axis=1), lost.max(axis=1), **band)
    ax.plot(places, SIZE // 2 - places % (SIZE // 2), color="C0")
    ax.plot(places[::4], given_up()[::4], "o", markersize=3, color="C0")
    ax.axhline(0, color="C2")
    ax.text(20, 80, "with the search for 0xCC", color="#8a6100")
    ax.text(2, 14, "half-ring rule\n(dots: simulated)", color="C0")
    ax.text(66, 4, "corrected ring: 0", color="C2")
    ax.set(xlabel="no [index]", ylabel="discarded bytes [byte]", xlim=(0, SIZE - 1))
    ax.set_xticks([0, 32, 64, 96, 127])
    return ax


def plot_recovered(table: pd.DataFrame, *, axes: Sequence[Axes]) -> None:
    """Draw how many packets a corrected and an intended ring keep after a pause in reading."""
    waiting, low, high = table["waiting"], table["fewest"], table["most"]
    axes[1].fill_between(waiting, low, high, step="post", color="C0", alpha=0.15)
    for ax, name, colour in zip(axes, ("corrected", "intended"), ("C2", "C0"), strict=True):
        ax.plot(waiting, table["sent"], color="0.6", linewidth=1)
        ax.step(waiting, table[name], where="post", color=colour)
        style.moment(ax, SIZE, "ring full")
        style.moment(ax, 2 * SIZE, "looks empty")
        ax.set(ylabel=f"{name} ring\n[packets found]", xlim=(0, waiting.iloc[-1]), ylim=(-0.5, 13))
        ax.set_yticks(range(0, 13, 4))
    axes[0].text(200, 7.5, "received ", color="0.4", ha="right")
    axes[1].text(260, 3.5, "line: mean\nband: range", color="C0")
    axes[1].set_xlabel("bytes received before the reader looks [byte]")
