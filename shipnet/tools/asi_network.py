"""The network explorer: a cable with slaves, their polling times, and any violated rules."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from shipnet.asi.emc.error_rates import independent_failures
from shipnet.asi.plan import Plan, PlanFindings
from shipnet.asi.topologies import line, ring, star
from shipnet.fields import choice, number, record, whole
from shipnet.tools._tool import Tool
from shipnet.tools._view import View

#: Number of addresses; if there are more slaves, some share an address as A and B slaves.
ADDRESSES = 31


@record
class AsiNetwork(Tool):
    """An AS-i line with its slaves: cycle, response, signals and rules.

    `plan` is the installation, an `asi.Plan`, and `result` contains the findings of its check.

    Examples
    --------
    >>> AsiNetwork(slaves=31).ok
    True
    """

    slaves: int = whole(
        1, 2 * ADDRESSES, default=31, label="slaves", help="Above 31, some slaves share an address."
    )
    pairs: int = whole(
        0,
        ADDRESSES,
        default=0,
        label="A/B pairs",
        help="Number of addresses that an A and a B slave share; adjusted to the number of slaves.",
    )
    structure: str = choice(
        {
            "line": "line: slaves along the cable",
            "star": "star: slaves on equal legs at the end of a trunk, which is 90 % of the cable",
            "ring": "ring: slaves along the cable, which returns to the master",
        },
        default="line",
        label="structure",
        help="Layout of the cable; the standard allows any.",
    )
    length: float = number(
        10, 300, default=100.0, unit="m", step=5, label="cable", help="Total length of cable."
    )
    supply: float = number(
        0,
        1,
        default=0.5,
        step=0.05,
        label="position of supply",
        help="0: beside the master, as always in a ring; 1: at the end of the line or trunk.",
    )
    current_ma: float = number(
        0,
        500,
        default=65.0,
        unit="mA",
        slider=(0, 200),
        step=5,
        label="current per slave",
        help="Current of each slave; it causes a voltage drop along the cable.",
    )
    error_rate: float = number(
        0,
        1,
        default=0.0,
        slider=(0, 0.5),
        step=0.01,
        label="error rate",
        help="Probability that an exchange with a slave fails and is repeated.",
    )

    @property
    def shared(self) -> int:
        """Number of shared addresses."""
        return int(np.clip(self.pairs, max(0, self.slaves - ADDRESSES), self.slaves // 2))

    @cached_property
    def plan(self) -> Plan:
        """The plan of the installation."""
        pairs, current = self.shared, 1e-3 * self.current_ma
        if self.structure == "ring":
            return ring(self.length, self.slaves, pairs=pairs, current=current)
        if self.structure == "line":
            supply = self.supply * self.length
            return line(self.length, self.slaves, supply=supply, pairs=pairs, current=current)
        trunk = 0.9 * self.length
        legs = [(self.length - trunk) / self.slaves] * self.slaves
        return star(trunk, legs, supply=self.supply * trunk, pairs=pairs, current=current)

    @cached_property
    def result(self) -> PlanFindings:
        """The findings when the plan is checked against the rules."""
        return self.plan.check()

    def _view(self) -> View:
        broken = self.result.broken
        return View(
            verdict="\n".join(broken) or f"all rules met: {len(self.result)} checks",
            ok=not broken,
            numbers=self._numbers(),
            plot=self.plot,
            height=3.2,
            about="Plan of master, supply, cables and slaves; parts that violate a rule are red",
        )

    def _numbers(self) -> dict[str, str]:
        """Return the polling times, the utilisation, and the rates of repetitions and drops."""
        cycle = self.plan.cycle
        # With errors, a slave is polled up to twice per cycle; the worst case includes both polls.
        response = cycle.response_time(repetitions=1 if self.error_rate else None)
        effect = independent_failures(self.error_rate, cycle).iloc[0]
        return {
            "cycle": f"{1e3 * float(cycle.time):.2f} ms",
            "bus time": f"{cycle.bus_time:.1%}".replace("%", " %"),
            "capacity used": f"{cycle.addresses} of {ADDRESSES} addresses",
            "each slave polled every": f"{1e3 * float(cycle.update_time()):.2f} ms",
            "input known after": f"{1e3 * response.best:.2f} to {1e3 * response.worst:.2f} ms",
            "repetitions": f"{effect['repetitions_per_s']:.3g} per second",
            "slaves dropped": f"{effect['drops_per_h']:.3g} per hour, if failures are independent",
        }
