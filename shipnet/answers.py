"""Findings of a check, and utilisation of a bus."""

from __future__ import annotations

from typing import NamedTuple

from shipnet.html import as_html
from shipnet.lazy import pd

#: Columns that all findings have, in this order; others may follow.
COLUMNS = ("rule", "object", "value", "low", "high", "unit", "verdict", "why", "source")

#: Columns of `Findings.worst` that a notebook shows.
MARGINS = ["object", "value", "low", "high", "unit", "margin", "verdict"]

#: Verdicts on a rule; a rule that cannot be judged is "not verified".
VERDICTS = ("met", "violated", "not verified")


class Findings:
    """The findings of a check, one row per rule and object, with the columns `COLUMNS`.

    `low` and `high` are the limits, NaN if there is none. An optional bool column `graded` is False
    for rules that have no margin when they are met.
    """

    def __init__(self, table: pd.DataFrame) -> None:
        self._table = table.reset_index(drop=True)

    @property
    def ok(self) -> bool | None:
        """Whether every rule is met; None if none is violated but some are not verified."""
        verdicts = set(self._table["verdict"])
        if "violated" in verdicts:
            return False
        return None if "not verified" in verdicts else True

    @property
    def verdict(self) -> str:
        """Summary of the findings in one line."""
        counts = self._table["verdict"].value_counts()
        total = f"{len(self._table)} check{'s' if len(self._table) != 1 else ''}"
        if not len(self._table):
            return "nothing was checked"
        parts = [f"{counts[name]} {name}" for name in VERDICTS[1:] if name in counts]
        return f"{total}, {', '.join(parts) if parts else 'all met'}"

    def table(self) -> pd.DataFrame:
        """Return a copy of all findings: one row per rule and object."""
        return self._table.copy()

    def worst(self) -> pd.DataFrame:
        """Return the worst row of each rule, smallest margin first.

        The `margin` is the relative distance to the nearer limit, negative beyond it. It is NaN if
        a rule has no numeric value, or is met but not graded; rows without a margin come last if
        the rule is met, and first otherwise.
        """
        import numpy as np

        table = self._table
        value, low, high = (
            pd.to_numeric(table[name], errors="coerce") for name in ("value", "low", "high")
        )
        left = []
        for bound, sign in ((low, 1), (high, -1)):
            scale = bound.abs().where(bound != 0, 1.0)
            left.append((sign * (value - bound) / scale).fillna(np.inf))
        margin = left[0].clip(upper=left[1]).where(value.notna())
        margin += 0.0  # no minus zero
        if "graded" in table:
            margin = margin.where(table["graded"] | (table["verdict"] != "met"))
        without = pd.Series(np.where(table["verdict"] == "met", np.inf, -np.inf), table.index)
        order = margin.fillna(without).sort_values(kind="stable").index
        rows = table.assign(margin=margin).loc[order]
        return rows.drop_duplicates("rule").set_index("rule")

    @property
    def broken(self) -> list[str]:
        """One line per rule that is violated or not verified, with its worst object."""
        lines = []
        for rule, row in self.worst().iterrows():
            if row["verdict"] == "met":
                continue
            verdicts = self._table[self._table["rule"] == rule]["verdict"]
            number = int((verdicts == row["verdict"]).sum())
            name, unit = str(rule).replace("_", " "), str(row["unit"])
            unit = "" if unit == "1" else f" {unit}"
            if row["verdict"] == "not verified" or row["margin"] != row["margin"]:
                line = f"{name}: {row['verdict']} at {row['object']}, {row['why']} ({number})"
            else:
                under = row["value"] < row["low"]
                limit = f"at least {row['low']:g}" if under else f"at most {row['high']:g}"
                line = (
                    f"{name}: {row['value']:.4g}{unit} at {row['object']}, {limit}{unit} "
                    f"({number} violated)"
                )
                if rule == "sharing":
                    line += f", with {row['why']}"
            lines.append(line)
        return lines

    def violated(self) -> pd.DataFrame:
        """Return the violations: one row per rule and object."""
        return self._table[self._table["verdict"] == "violated"].reset_index(drop=True)

    def __len__(self) -> int:
        return len(self._table)

    def __str__(self) -> str:
        return "\n".join([self.verdict, *self.broken])

    def __repr__(self) -> str:
        return f"<Findings: {self.verdict}>"

    def _repr_html_(self) -> str:
        return as_html(self, self.worst()[MARGINS])


class Utilisation(NamedTuple):
    """Utilisation of a bus, as three numbers that have the same meaning for every bus.

    Attributes
    ----------
    bus_time : float
        Fraction of the time during which a frame is on the wire. Silences do not count, but on CAN
        the 3 bits of intermission do.
    capacity_used : float
        The larger of two fractions: addresses or stations in use, and time in use. Above 1, the bus
        is overloaded. The time in use is the bus time on CAN; with a polling master, it is the
        longest interval between two updates of a point divided by its required update period.
    worst_response : float
        Longest time from a change at a point until the host has the new value [s], including the
        wait for the next poll or, on CAN, for the next frame of the message.
    """

    bus_time: float
    capacity_used: float
    worst_response: float

    def __str__(self) -> str:
        return (
            f"bus time {100 * self.bus_time:.3g} %, "
            f"capacity used {100 * self.capacity_used:.3g} %, "
            f"worst response {1e3 * self.worst_response:.3g} ms"
        )
