"""What the options of a design come to, in words and in one table for a page."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import pandas as pd

from shipnet.design.catalogue import words
from shipnet.design.comparison import RESPONSE, Comparison
from shipnet.design.costs import label
from shipnet.design.failures import worst

#: Reasons for points left out, and violated rules, that are shown of each design.
_TOLD = 3

_FAILED = {"cut": "is cut", "short": "is shorted", "tray": "is lost", "device": "is dead"}


@dataclass(frozen=True, eq=False, slots=True)
class Result:
    """What the options come to."""

    comparison: Comparison
    cabinet: str
    picture: str

    @property
    def kept(self) -> list[str]:
        """Designs that connect every point and violate no rule, the cheapest first."""
        return self.comparison.meeting

    @property
    def names(self) -> dict[str, str]:
        """What a figure calls each option: with the points that it leaves out, if there are."""
        left = self.comparison.table()["points_left_out"]
        return {
            str(option): f"{option}, {n:.0f} left out" if n else str(option)
            for option, n in left.items()
        }

    @property
    def asking(self) -> str:
        """Whose rules are judged: what IMO asks holds beside the rules of some societies."""
        return _and(list(dict.fromkeys(rule.rule_set for rule in self.comparison.rules)))

    @property
    def verdict(self) -> str:
        """Which options can be built, and the cheapest of them."""
        found, n = self.comparison.table(), len(self.comparison.iolist)
        if self.kept:
            cheapest = found[found.index == self.kept[0]].iloc[0]
            verb = "connects" if len(self.kept) == 1 else "connect"
            violates = "violates" if len(self.kept) == 1 else "violate"
            return (
                f"{_and(self.kept)} {verb} all {n} points and {violates} no rule of {self.asking} "
                f"that a plan can show\ncheapest of them: {self.kept[0]}, {_cost(cheapest, ' EUR')}"
            )
        if (found["points_left_out"] == 0).any():
            return f"every option that connects all {n} points violates a rule of {self.asking}"
        return f"no option connects all {n} points"

    @property
    def table(self) -> pd.DataFrame:
        """One row an option, as text."""
        found = self.comparison.table()
        counts = ["rules_met", "rules_violated", "rules_not_verified"]
        return pd.DataFrame(
            {
                "points left out": [f"{n:.0f}" for n in found["points_left_out"]],
                "conductors at the cabinet": [f"{n:,.0f}" for n in found["conductors_at_cabinet"]],
                "cable [kg]": [f"{kg:,.0f}" for kg in found["cable_mass_kg"]],
                "cost [EUR]": [_cost(row) for _, row in found.iterrows()],
                "worst response [ms]": [
                    f"{ms:,.0f}" if ms == ms else "-" for ms in found[RESPONSE]
                ],
                "points lost by one failure": [f"{n:.0f}" for n in found["lost_by_failure"]],
                "rules met / violated / unverified": [
                    " / ".join(f"{n:.0f}" for n in row) for row in found[counts].to_numpy()
                ],
                "Pareto-optimal": ["yes" if best else "no" for best in found["pareto"]],
            },
            index=found.index,
        )

    @property
    def numbers(self) -> dict[str, str]:
        """What stands behind the table, in words."""
        comparison = self.comparison
        criteria = _and([label(name).partition(" [")[0] for name in comparison.criteria])
        return {
            "list": "; ".join([str(comparison.iolist), *comparison.iolist.remarks]),
            "cabinet": self.cabinet,
            "Pareto-optimal": f"{_and(comparison.pareto()) or 'none'}, weighed by {criteria}",
            "what decides": self._assumptions,
            **self._misfits,
            **self._broken,
            **self._failures,
        }

    @property
    def _misfits(self) -> dict[str, str]:
        reasons = self.comparison.reasons()
        return {
            f"{option} does not fit": _told(
                f"{rows['text'].iloc[0]}{_such(len(rows))}"
                for _, rows in own.groupby("limit", sort=False)
            )
            for option, own in reasons.groupby("design", sort=False)
        }

    @property
    def _broken(self) -> dict[str, str]:
        violated = self.comparison.findings().violated()
        return {
            f"{option} violates": _told(
                f"{row.rule} ({row.asks}; {row.value:.4g} {row.unit} at {row.object})"
                for row in _each(rows)
            )
            for option, rows in violated.groupby("design", sort=False)
        }

    @property
    def _failures(self) -> dict[str, str]:
        said: dict[str, str] = {}
        for option, design in self.comparison.designs.items():
            ranked = worst(design.failures()).sort_values(
                "points_lost", ascending=False, kind="stable"
            )
            # Where no point fits, there is nothing to lose.
            said |= {
                f"{option} at worst": f"{row.points_lost} {_points(row.points_lost)} lost when "
                f"{row.failed} {_FAILED[row.failure]}"
                for row in _each(ranked[ranked["points_lost"] > 0])
            }
        return said

    @property
    def _assumptions(self) -> str:
        tornado = self.comparison.tornado()
        ends, unit, top = tornado.ends, tornado.unit, tornado.top()
        said = [
            f"{words(name)} ({_rounded(low)} to {_rounded(high)} {unit})"
            for name, (low, high) in zip(top, ends.loc[top].to_numpy(), strict=True)
        ]
        decides = f"; over their ranges: {', '.join(said)}" if said else ""
        return f"{tornado.subject}: {_rounded(tornado.at_nominal)} {unit}{decides}"


def _such(number: int) -> str:
    return f" ({number} such)" if number > 1 else ""


def _points(number: int) -> str:
    return "point is" if number == 1 else "points are"


def _each(rows: pd.DataFrame) -> Iterator[Any]:
    return iter(rows.itertuples())


def _and(names: Sequence[str]) -> str:
    return " and ".join(filter(None, [", ".join(names[:-1]), *names[-1:]]))


def _rounded(value: float) -> str:
    """Return a value to three digits; a fourth would say more than is known."""
    return f"{float(f'{value:.3g}'):,.0f}"


def _cost(row: pd.Series[float], unit: str = "") -> str:
    ends = (row[f"total_cost{end}_eur"] for end in ("", "_low", "_high"))
    nominal, low, high = map(_rounded, ends)
    return f"{nominal}{unit} ({low} to {high})"


def _told(texts: Iterable[str]) -> str:
    said = [text.replace(". (", " (").rstrip(".") for text in texts]
    more = f"; and {len(said) - _TOLD} more" if len(said) > _TOLD else ""
    return "; ".join(said[:_TOLD]) + more
