"""The immunity tests of AS-i beside those of ships: levels at the outside of a device.

No standard says how much of a level arrives between the wires; `disturbances` starts there.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from shipnet import datasets, style
from shipnet.arrays import Floats
from shipnet.lazy import Axes, pd

#: The parameters that say how severe a test is; the others say what kind of test it is.
_SEVERITY = [
    "voltage", "peak voltage", "field strength", "highest frequency",
    "voltage over that of the supply",
]  # fmt: skip

#: Where a test that AS-i does not have is drawn: left of all ratios.
_NONE = 0.4


def gaps(asi: Floats, marine: Floats, better: npt.NDArray[np.str_]) -> npt.NDArray[np.str_]:
    """Compare levels, of which the "higher", the "lower" or an "equal" one is the better."""
    ratio = asi / marine
    # Levels are round numbers; a part in a million is no gap.
    fine = np.select(
        [better == "higher", better == "lower"],
        [ratio > 1 - 1e-6, ratio < 1 + 1e-6],
        np.abs(ratio - 1) < 1e-6,
    )
    names = ["not asked", "test missing", "covers"]
    return np.select([np.isnan(marine), np.isnan(asi), fine], names, "below")


class Levels:
    """The immunity tests of AS-i beside those of ships."""

    def __init__(self) -> None:
        table = datasets.read("emc_levels.csv")
        table[["asi", "marine"]] = table[["asi", "marine"]].apply(pd.to_numeric)
        table["ratio"] = table["asi"] / table["marine"]
        table["gap"] = gaps(*(table[name].to_numpy() for name in ("asi", "marine", "better")))
        first = "test parameter unit asi_printed asi criterion marine ratio gap better".split()
        self._table = table[[*first, "printed_name", "standard", "source", "confirmed", "note"]]

    def table(self) -> pd.DataFrame:
        """Return one row per parameter of a test: both levels, their ratio, gap and sources.

        ``gap`` is "covers", "below", "test missing" (AS-i has none) or "not asked" (by the ship).
        ``asi_printed`` is what kim2023 prints in Table 2, ``asi`` what it means. Where
        ``confirmed`` is "yes", the marine value is on a public page of a type-tested product or
        of a test house; where it is "no", it is general knowledge: confirm it before using it.
        """
        return self._table.copy()

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the test levels of AS-i over those that a ship asks for, one row per test."""
        ax, table = style.axes(ax, figsize=(6.4, 4)), self._table
        asked = table["parameter"].isin(_SEVERITY) & (table["gap"] != "not asked")
        rows = table[asked].to_dict("records")
        for y, row in enumerate(rows):
            missing, unsure = row["gap"] == "test missing", row["confirmed"] != "yes"
            colour = "C0" if row["gap"] == "covers" else style.LIMIT["color"]
            x = _NONE if missing else row["ratio"]
            ax.plot([1, x], [y, y], color=colour, linewidth=3, alpha=0.5, visible=not missing)
            ax.plot(
                [x], [y], marker="x" if missing else "o", linestyle="none", color=colour,
                markerfacecolor="white" if unsure else colour,
            )  # fmt: skip
            tested = "no test" if missing else f"{row['asi']:g} {row['unit']}"
            text = f"{tested}, ship {row['marine']:g} {row['unit']}"
            ax.annotate(
                text + (" (not confirmed)" if unsure else ""), (max(x, 1.0), y), (7, 0),
                textcoords="offset points", va="center",
            )  # fmt: skip
        ax.axvline(1, color=style.LIMIT["color"], linestyle=style.LIMIT["linestyle"], zorder=0)
        ax.annotate(
            "what a ship asks for", (1, 1), (0, 3), xycoords=ax.get_xaxis_transform(),
            textcoords="offset points", ha="center", color=style.LIMIT["color"],
        )  # fmt: skip
        names = [
            row["test"] + ("" if row["unit"] != "MHz" else ", highest frequency") for row in rows
        ]
        ax.set_yticks(range(len(rows)), names)
        ax.set_xscale("log")
        ticks = [0.5, 1, 2, 5]
        ax.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
        ax.minorticks_off()
        ax.set(xlim=(0.8 * _NONE, 40), ylim=(len(rows) - 0.5, -0.5))
        ax.set_xlabel("AS-i level over marine level [1]")
        ax.grid(visible=False, axis="y")
        return ax


def levels() -> Levels:
    """Return the immunity tests of AS-i and of ships, and the gap between them.

    Returns
    -------
    Levels
        With ``table()`` and ``plot(ax)``. A kilovolt of the test is not a kilovolt between the
        wires: the coupling depends on cable, earthing and symmetry. AS-i's are kim2023's Table 2.

    Examples
    --------
    >>> table = levels().table()
    >>> table.loc[table["gap"] == "below", ["test", "asi", "marine", "unit"]].values.tolist()
    [['electrostatic discharge, contact', 4.0, 6.0, 'kV'], ['radio-frequency field', 1000.0, 2000.0, 'MHz']]
    """  # noqa: E501 - the output is one line
    return Levels()
