"""Figures of the experiment: what each check lets pass, and the best number of items a packet."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes

from shipnet import style
from shipnet.errors import ArgumentError

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["plot_candidates", "plot_checks"]


def plot_checks(table: pd.DataFrame, *, ax: Axes, bit_error_rate: float) -> Axes:
    """Draw the share of wrong packets that each check lets pass, over the number of items.

    Parameters
    ----------
    table : pandas.DataFrame
        What `compare_checks` returned.
    ax : matplotlib.axes.Axes
        Where to draw.
    bit_error_rate : float
        Which of its rates to show.

    Returns
    -------
    matplotlib.axes.Axes
        The axes given, the share on a logarithmic axis: theory as lines, counts as markers with
        their bounds; a check that let nothing pass has only its upper bound, a triangle.

    Raises
    ------
    ArgumentError
        If the table has no such rate.
    """
    shown = table[np.isclose(table["bit_error_rate"].to_numpy(dtype=float), bit_error_rate)]
    if shown.empty:
        known = sorted(set(table["bit_error_rate"]))
        raise ArgumentError(f"bit_error_rate is {bit_error_rate}; it must be one of {known}")
    for place, (check, rows) in enumerate(shown.groupby("check", sort=False)):
        colour = f"C{place}"
        items = rows["n_items"].to_numpy(dtype=float)
        count = rows["undetected"].to_numpy(dtype=float)
        share = count / rows["sent"].to_numpy(dtype=float)
        # Beside each other, so that none hides another.
        beside = items + 0.4 * place
        low, high = (rows[name].to_numpy(dtype=float) for name in ("low", "high"))
        # See `packet_shares`: of the stuffed packet the share is an estimate from above.
        label = f"{check}" + ", upper estimate" * (check == "CRC")
        ax.plot(items, rows["expected"].to_numpy(dtype=float), color=colour, label=label)
        some = count > 0
        ax.errorbar(
            beside[some], share[some], yerr=[(share - low)[some], (high - share)[some]],
            color=colour, marker="o", linestyle="none", capsize=3,
        )  # fmt: skip
        ax.plot(beside[~some], high[~some], color=colour, marker="v", linestyle="none")
    ax.set_yscale("log")
    ax.set_xlabel("items a packet")
    ax.set_ylabel("share of packets taken wrong [-]")
    for marker, meaning in (("o", "counted, 95 % bounds"), ("v", "none counted, upper bound")):
        ax.plot([], [], color="0.4", marker=marker, linestyle="none", label=meaning)
    ax.legend()
    return ax


def plot_candidates(table: pd.DataFrame, *, ax: Axes) -> Axes:
    """Draw how long all values take, over the number of items a packet.

    Parameters
    ----------
    table : pandas.DataFrame
        What `candidates` returned.
    ax : matplotlib.axes.Axes
        Where to draw.

    Returns
    -------
    matplotlib.axes.Axes
        The axes given, a line for each check sent cyclically; filled markers keep within all
        limits, and the quickest of them is ringed.
    """
    cyclic = table[table["sending"] == "cyclic"]
    for place, (check, rows) in enumerate(cyclic.groupby("check", sort=False)):
        items = rows["per_packet"].to_numpy(dtype=float)
        time = rows["refresh_s"].to_numpy(dtype=float)
        meets = rows["meets"].to_numpy(dtype=bool)
        ax.plot(items, time, color=f"C{place}", linewidth=1, label=f"{check}")
        ax.plot(items[meets], time[meets], color=f"C{place}", marker=".", linestyle="none")
    good = cyclic[cyclic["meets"]]
    if len(good):
        best = good.sort_values("refresh_s", kind="stable").iloc[0]
        ax.plot(
            best["per_packet"], best["refresh_s"], marker="o", markersize=12, fillstyle="none",
            color=style.LIMIT["color"], linestyle="none", label="quickest within the limits",
        )  # fmt: skip
    ax.set_xlabel("items a packet")
    ax.set_ylabel("time for all values [s]")
    ax.legend()
    return ax
