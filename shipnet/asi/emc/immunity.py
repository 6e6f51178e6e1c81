"""What AS-i is tested against, beside what a ship asks for.

The numbers are test levels: kilovolts and volts a metre at the outside of a device. How many volts
of them arrive between the wires is not in any of these standards; `disturbance` starts there.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pandas as pd

from shipnet import datasets
from shipnet.errors import ArgumentError

#: Performance criteria of a test, in short, after IEC 61000-6-2, clause 4.
CRITERIA: dict[str, str] = {
    "A": "works as intended during the test and after it",
    "B": "may be disturbed during the test, works as intended after it without help; what it "
    "stores and the state it is in stay the same",
    "C": "may stop working, if it recovers by itself or by an operator",
}

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


def gap(
    asi: npt.ArrayLike, marine: npt.ArrayLike, better: str | npt.ArrayLike = "higher"
) -> npt.NDArray[np.str_]:
    """Compare what AS-i is tested against with what a ship asks for."""
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


def levels() -> pd.DataFrame:
    """Return the immunity tests of AS-i and of ships, and the gap between them."""
    table = datasets.read("emc_levels.csv")
    table[["asi", "marine"]] = table[["asi", "marine"]].apply(pd.to_numeric)
    table["ratio"] = table["asi"] / table["marine"]
    table["gap"] = gap(table["asi"], table["marine"], table["better"].to_numpy(dtype=str))
    first = "test parameter unit asi_printed asi criterion marine ratio gap better".split()
    return table[[*first, "printed_name", "standard", "source", "confirmed", "note"]]
