"""The network explorer: slaves on a structure of cable, how fast they are polled, what breaks."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType

import numpy as np
from matplotlib.axes import Axes

from shipnet import style
from shipnet.asi.emc.error_rates import independent_failures
from shipnet.asi.plan import Plan, PlanFindings
from shipnet.asi.timing import ResponseTime
from shipnet.asi.topologies import line, ring, star
from shipnet.fields import choice, number, record, whole
from shipnet.tools._tool import Tool
from shipnet.tools._view import View

#: Structures to choose from, and what each does with the cable.
STRUCTURES = MappingProxyType(
    {
        "line": "slaves along the cable",
        "star": "slaves behind nine tenths of the cable, on equal legs",
        "ring": "slaves along the cable, which comes back",
    }
)

#: Slaves that get addresses of their own; more share them as A and B.
ADDRESSES = 31


@record
class AsiNetwork(Tool):
    """An AS-i line with its slaves: cycle, response, signals and rules.

    `result` has the plan, its findings and the times.

    Raises
    ------
    ArgumentError
        If a value is out of its range.

    Examples
    --------
    >>> AsiNetwork(slaves=31).ok
    True
    """

    slaves: int = whole(
        1, 2 * ADDRESSES, default=31, label="slaves", help="Slaves; above 31 they share addresses."
    )
    pairs: int = whole(
        0, ADDRESSES, default=0, label="A/B pairs",
        help="Addresses that an A and a B slave share; what cannot be is brought into range.",
    )  # fmt: skip
    structure: str = choice(
        {name: f"{name}: {what}" for name, what in STRUCTURES.items()},
        default="line", label="structure",
        help="How the cable runs; the standard leaves it free.",
    )  # fmt: skip
    length: float = number(
        10,
        300,
        default=100.0,
        unit="m",
        step=5,
        label="cable",
        help="Length of all cable together.",
    )
    supply: float = number(
        0, 1, default=0.5, step=0.05, label="place of supply",
        help="0 is beside the master, 1 at the end; in a ring it stands beside the master.",
    )  # fmt: skip
    current_ma: float = number(
        0, 500, default=65.0, unit="mA", slider=(0, 200), step=5, label="a slave draws",
        help="Current of each slave, which costs voltage along the cable.",
    )  # fmt: skip
    error_rate: float = number(
        0, 1, default=0.0, slider=(0, 0.5), step=0.01, label="error rate",
        help="Probability that an exchange with a slave fails and is repeated.",
    )  # fmt: skip

    @property
    def shared(self) -> int:
        """Addresses that are shared in the end."""
        return int(np.clip(self.pairs, max(0, self.slaves - ADDRESSES), self.slaves // 2))

    @property
    def plan(self) -> Plan:
        """The plan of the installation."""
        current = 1e-3 * self.current_ma
        if self.structure == "star":
            trunk = 0.9 * self.length
            leg = (self.length - trunk) / self.slaves
            legs = [leg] * self.slaves
            return star(trunk, legs, supply=self.supply * trunk, pairs=self.shared, current=current)
        if self.structure == "ring":
            return ring(self.length, self.slaves, pairs=self.shared, current=current)
        supply = self.supply * self.length
        return line(self.length, self.slaves, supply=supply, pairs=self.shared, current=current)

    @cached_property
    def result(self) -> Result:
        """Plan the network, check its rules and compute its times."""
        plan = self.plan
        cycle = plan.cycle
        # A slave is asked twice at most in a cycle; the second time counts in the worst case.
        response = cycle.response_time(repetitions=int(self.error_rate > 0))
        effect = independent_failures(self.error_rate, cycle).iloc[0]
        return Result(
            plan,
            plan.check(),
            float(cycle.time),
            float(cycle.update_time),
            response,
            float(effect["repetitions_per_s"]),
            float(effect["drops_per_h"]),
        )

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the plan, with what breaks a rule in red."""
        result, ax = self.result, style.axes(ax)
        return result.rules.plot(ax=ax)

    def _view(self) -> View:
        """Return what the page shows."""
        result = self.result
        return View(
            verdict="\n".join(result.broken) or f"all rules kept: {len(result.rules)} checks",
            ok=not result.broken,
            numbers=result.numbers,
            plot=self.plot,
            height=3.2,
            about="Plan of master, supply, cables and slaves; what breaks a rule is red",
        )


@dataclass(frozen=True, eq=False, slots=True)
class Result:
    """What becomes of the network."""

    plan: Plan
    rules: PlanFindings
    cycle: float
    heard: float
    response: ResponseTime
    repetitions: float
    drops: float

    @property
    def broken(self) -> list[str]:
        """One line for each rule that is broken, with the worst object."""
        return self.rules.broken

    @property
    def numbers(self) -> dict[str, str]:
        """Times and rates as text with units."""
        return {
            "cycle": f"{1e3 * self.cycle:.2f} ms",
            "each slave heard after": f"{1e3 * self.heard:.2f} ms",
            "input known after": f"{1e3 * self.response.best:.2f} to "
            f"{1e3 * self.response.worst:.2f} ms",
            "repetitions": f"{self.repetitions:.3g} a second",
            "slaves dropped": f"{self.drops:.3g} an hour, if failures are independent",
        }
