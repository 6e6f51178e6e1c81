"""Section 3.3, 3.6 and Table 2: immunity, and what a ship asks for beyond it."""

from __future__ import annotations

import numpy as np
import pandas as pd

from shipnet.asi.emc.disturbances import noise
from shipnet.asi.emc.immunity import STANDARDS, immunity_margin, levels_table
from shipnet.asi.emc.monte_carlo import Telegrams, all_telegrams, telegram_error_rate
from shipnet.asi.topology import straight_line
from shipnet.errors import ArgumentError
from shipnet.papers.registry import check

__all__: list[str] = []


#: What a burst may come in on.
LINES = ("supply", "signal")


def level(test: str, parameter: str) -> pd.Series:
    """Return the row of a parameter of a test, from `levels`."""
    table = levels_table()
    rows = table[(table["test"] == test) & (table["parameter"] == parameter)]
    if len(rows) != 1:
        raise ArgumentError(
            f"test and parameter are {test!r} and {parameter!r}; see levels_table()"
        )
    return rows.iloc[0]


@check("kim2023-012", counter={"deviations": (0.5, 0.7)})
def supply_decides(
    *,
    supplies: tuple[float, float] = (30.0, 230.0),
    deviations: tuple[float, float] = (0.6, 0.6),
) -> bool:
    """Whether the voltage of the supply, below which PELV stays, changes what noise destroys."""
    near = all_telegrams(straight_line(100, slaves=(5,)))
    lost = []
    for supply, deviation in zip(supplies, deviations, strict=True):
        lifted = Telegrams(near.bits, near.t, near.u + supply, near.span)
        rng = np.random.default_rng(2024)
        table = telegram_error_rate(lifted, noise, deviation, 2000, rng, minimum=0.9)
        lost.append(int(table["failed"].iloc[0]))
    return lost[0] != lost[1]


@check("kim2023-013", counter={"contact": 6.0})
def discharge(*, contact: float = 4.0, air: float = 8.0) -> bool:
    """Whether Table 2 prints these kilovolts, and a ship asks for more of one of them."""
    rows = [level(f"electrostatic discharge, {how}", "voltage") for how in ("contact", "air")]
    printed = [row["asi"] for row in rows] == [contact, air]
    return printed and "below" in [row["gap"] for row in rows]


@check("kim2023-014", counter={"standard": "IEC 61000-6-4"})
def about_emission(*, standard: str = "IEC 61000-4-2") -> bool:
    """Whether the standard is about what a device emits."""
    return "emission" in STANDARDS[standard].lower()


@check("kim2023-015", counter={"highest": 2000.0})
def radiated_field(
    *, strength: float = 10.0, lowest: float = 80.0, highest: float = 1000.0
) -> bool:
    """Whether Table 2 prints this field [V/m, MHz], and a ship asks for higher frequencies."""
    names = ("field strength", "lowest frequency", "highest frequency")
    rows = [level("radio-frequency field", name) for name in names]
    printed = [row["asi"] for row in rows] == [strength, lowest, highest]
    return printed and rows[-1]["gap"] == "below"


@check("kim2023-016", counter={"peak": 0.5})
def bursts(*, peak: float = 2.0) -> bool:
    """Whether bursts of this height [kV] and Table 2's form cover what a ship asks for."""
    table = levels_table()
    form = table[table["test"] == "burst"]
    heights = [level(f"burst, {lines} lines", "peak voltage")["marine"] for lines in LINES]
    return bool(
        (form["gap"] == "covers").all() and (immunity_margin(peak, heights) == "covers").all()
    )


@check("kim2023-017", counter={"printed": "0.15~80"})
def reads_as_range(*, printed: str = "") -> bool:
    """Whether the printed range is two numbers, the lower one first."""
    text = printed or str(level("conducted radio frequency", "lowest frequency")["asi_printed"])
    try:
        low, high = (float(part) for part in text.split("~"))
    except ValueError:
        return False
    return low < high


@check("kim2023-018", counter={"ohm": 50.0})
def source_impedance(*, ohm: float = 150.0) -> bool:
    """Whether the generator's impedance is that of the standard."""
    row = level("conducted radio frequency", "source impedance")
    return bool(immunity_margin(ohm, row["marine"], "equal") == "covers")


@check("kim2023-019", counter={"standards": ("IEC 61000-4-4", "IEC 61000-4-6")})
def covers_a_ship(*, standards: tuple[str, ...] = tuple(STANDARDS)) -> bool:
    """Whether the levels for these standards cover all that a ship asks for."""
    table = levels_table()
    asked = table[table["standard"].isin(standards)]
    return bool(asked["gap"].isin(["covers", "not asked"]).all())


@check("kim2023-078", counter={"frequency": 1800.0})
def pulsed_field(
    *, strength: float = 10.0, frequency: float = 900.0, duty: float = 50.0, rate: float = 200.0
) -> bool:
    """Whether Table 2 prints these values [V/m, MHz, %, Hz], as the older standard has them."""
    table = levels_table()
    rows = table[table["test"] == "pulsed field"]
    return rows["asi"].tolist() == [strength, frequency, duty, rate] and set(rows["standard"]) == {
        "ENV 50204"
    }
