"""What AS-i is tested against, beside what a ship asks for.

The numbers are test levels: kilovolts and volts a metre at the outside of a device. How many volts
of them arrive between the wires is not in any of these standards; `disturbances` starts there.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from shipnet import datasets, style
from shipnet.arguments import checked
from shipnet.errors import ArgumentError
from shipnet.lazy import Axes, pd

#: Titles of the standards that `levels` names, and of one on emission, to tell it from immunity.
STANDARDS: dict[str, str] = {
    "ENV 50204": "Radiated electromagnetic field from digital radio telephones - Immunity test",
    "IEC 61000-4-2": "Electrostatic discharge immunity test",
    "IEC 61000-4-3": "Radiated, radio-frequency, electromagnetic field immunity test",
    "IEC 61000-4-4": "Electrical fast transient/burst immunity test",
    "IEC 61000-4-5": "Surge immunity test",
    "IEC 61000-4-6": "Immunity to conducted disturbances, induced by radio-frequency fields",
    "IEC 61000-4-16": "Test for immunity to conducted, common mode disturbances in the frequency "
    "range 0 Hz to 150 kHz",
    "IEC 61000-6-4": "Emission standard for industrial environments",
}


#: Parameters of `levels` that say how severe a test is; the others say what kind of test it is.
_SEVERITY = [
    "voltage", "peak voltage", "field strength", "highest frequency",
    "voltage over that of the supply",
]  # fmt: skip

#: Where a test that AS-i has not is drawn: left of all ratios.
_NONE = 0.4


@checked
def immunity_margin(
    asi: npt.ArrayLike, marine: npt.ArrayLike, better: str | npt.ArrayLike = "higher"
) -> npt.NDArray[np.str_]:
    """Compare what AS-i is tested against with what a ship asks for.

    Parameters
    ----------
    asi, marine : array_like of float
        Levels in the same unit, above 0; NaN where there is none.
    better : str or array_like of str, default "higher"
        Which level is the stricter: ``"higher"``, ``"lower"`` (as where a range begins), or
        ``"equal"``, where the values only have to agree.

    Returns
    -------
    ndarray of str, of the shape of the arguments broadcast
        ``"covers"``, ``"below"``, ``"test missing"`` (AS-i has none) or ``"not asked"`` (the ship
        asks for none).

    Raises
    ------
    ArgumentError
        If a level is not above 0 and finite, or `better` is another word.

    Examples
    --------
    >>> immunity_margin([4, 8, np.nan], [6, 8, 1]).tolist()
    ['below', 'covers', 'test missing']
    """
    ours, theirs = np.asarray(asi, dtype=float), np.asarray(marine, dtype=float)
    for name, value in (("asi", ours), ("marine", theirs)):
        if np.any((value <= 0) | np.isinf(value)):
            raise ArgumentError(f"{name} is {value.tolist()}; levels must be above 0 and finite")
    word = np.asarray(better, dtype=str)
    if not np.isin(word, ("higher", "lower", "equal")).all():
        raise ArgumentError(f"better is {better!r}; it must be 'higher', 'lower' or 'equal'")
    ours, theirs, word = np.broadcast_arrays(ours, theirs, word)
    ratio = ours / theirs
    # Levels are round numbers; a part in a million is no gap.
    fine = np.select(
        [word == "higher", word == "lower"],
        [ratio > 1 - 1e-6, ratio < 1 + 1e-6],
        np.abs(ratio - 1) < 1e-6,
    )
    return np.select(
        [np.isnan(theirs), np.isnan(ours), fine],
        ["not asked", "test missing", "covers"],
        "below",
    )


class Levels:
    """The immunity tests of AS-i beside those of ships."""

    def __init__(self) -> None:
        table = datasets.read("emc_levels.csv")
        table[["asi", "marine"]] = table[["asi", "marine"]].apply(pd.to_numeric)
        table["ratio"] = table["asi"] / table["marine"]
        table["gap"] = immunity_margin(
            table["asi"], table["marine"], table["better"].to_numpy(dtype=str)
        )
        first = "test parameter unit asi_printed asi criterion marine ratio gap better".split()
        self._table = table[[*first, "printed_name", "standard", "source", "confirmed", "note"]]

    def __repr__(self) -> str:
        counts = self._table["gap"].value_counts()
        return f"<Levels: {', '.join(f'{n} {what}' for what, n in counts.items())}>"

    def table(self) -> pd.DataFrame:
        """Return one row per parameter of a test: both levels, their ratio, gap and sources.

        ``asi_printed`` is as kim2023 prints it in Table 2, ``asi`` as it is meant. Where
        ``confirmed`` is "yes", the marine value is on a public page of a product that was
        type-tested for ships, or of a test house; where it is "no", it is general knowledge of
        IACS UR E10 or of the basic standard: confirm it before using it.
        """
        return self._table.copy()

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the test levels of AS-i over those that a ship asks for, one row per test."""
        ax, table = style.axes(ax, figsize=(6.4, 4)), self._table
        asked = table["parameter"].isin(_SEVERITY) & (table["gap"] != "not asked")
        rows = table[asked].to_dict("records")
        for y, row in enumerate(rows):
            bad = row["gap"] != "covers"
            colour = style.LIMIT["color"] if bad else "C0"
            missing = row["gap"] == "test missing"
            x = _NONE if missing else row["ratio"]
            unsure = row["confirmed"] != "yes"
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
        ax.set(
            xlim=(0.8 * _NONE, 40),
            ylim=(len(rows) - 0.5, -0.5),
            xlabel="AS-i level over marine level [1]",
        )
        ax.grid(visible=False, axis="y")
        return ax


def levels() -> Levels:
    """Return the immunity tests of AS-i and of ships, and the gap between them.

    Returns
    -------
    Levels
        It has ``table()`` and ``plot(ax)``. A kilovolt of the test is not a kilovolt between the
        wires: the coupling depends on cable, earthing and symmetry.

    References
    ----------
    .. [1] R. G. Kim, Y. H. Cho, K. H. Hyun, "AS-Interface protocol utilization for smart ships",
       J. Soc. Nav. Archit. Korea 60(6), 2023, Table 2.

    Examples
    --------
    >>> table = levels().table()
    >>> table.loc[table["gap"] == "below", ["test", "asi", "marine", "unit"]].values.tolist()
    [['electrostatic discharge, contact', 4.0, 6.0, 'kV'], ['radio-frequency field', 1000.0, 2000.0, 'MHz']]
    """  # noqa: E501 - the output is one line
    return Levels()
