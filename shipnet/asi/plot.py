"""Figures of AS-i telegrams and transactions."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle

from shipnet import style
from shipnet.asi.profile import IO_CONFIGURATIONS
from shipnet.asi.telegram import Request, Response
from shipnet.asi.timing import Transaction

__all__ = [
    "REQUEST_PARTS",
    "RESPONSE_PARTS",
    "plot_io_codes",
    "plot_telegram",
    "plot_transaction",
]

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
    bits: str, *, ax: Axes, start: float = 0.0, parts: Sequence[tuple[str, int, str]] | None = None
) -> Axes:
    """Draw a telegram as a row of coloured bits with its level line above.

    Parameters
    ----------
    bits : str
        Telegram of 14 or 7 bits; it is drawn as it is, right or wrong.
    ax : matplotlib.axes.Axes
        Where to draw.
    start : float, default 0
        Where the telegram begins [bit].
    parts : sequence of tuple, optional
        Label, number of bits and colour key of each part; taken from the length if omitted.

    Returns
    -------
    matplotlib.axes.Axes
        The axes given; x is in bit times.
    """
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
    ax: Axes,
) -> Axes:
    """Draw request, master pause, response and slave pause on one time axis: kim2023's Fig 5.

    Parameters
    ----------
    request : Request or str
        The request, or its 14 bits (which may be faulty).
    response : Response or str
        The response, or its 7 bits.
    transaction : Transaction, optional
        The pauses; the longest usual ones if omitted.
    ax : matplotlib.axes.Axes
        Where to draw.

    Returns
    -------
    matplotlib.axes.Axes
        The axes given; x is in bit times, with microseconds on top.
    """
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


def plot_io_codes(*, ax: Axes) -> Axes:
    """Draw the ports of the 16 I/O configuration codes as a grid: kim2023's Table 7.

    Parameters
    ----------
    ax : matplotlib.axes.Axes
        Where to draw.

    Returns
    -------
    matplotlib.axes.Axes
        The axes given; one column a code, one row a port.
    """
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
