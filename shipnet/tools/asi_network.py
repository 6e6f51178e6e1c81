"""The network explorer: a cable with slaves, their polling times, and any violated rules."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from shipnet.asi.emc.error_rates import independent_failures
from shipnet.asi.plan import Plan, PlanFindings
from shipnet.asi.topologies import line, ring, star
from shipnet.fields import choice, number, record, whole
from shipnet.tools._tool import Tool
from shipnet.tools._view import View, words

_WORDS = words("asi_network")

#: Number of addresses; if there are more slaves, some share an address as A and B slaves.
ADDRESSES = 31

#: Layouts of the cable to choose from.
STRUCTURES = {
    "line": "line: slaves along the cable",
    "star": "star: slaves on equal legs at the end of a trunk, which is 90 % of the cable",
    "ring": "ring: slaves along the cable, which returns to the master",
}


@record
class AsiNetwork(Tool):
    """An AS-i line with its slaves: cycle, response, signals and rules.

    `plan` is the installation, an `asi.Plan`, and `result` contains the findings of its check.

    Examples
    --------
    >>> AsiNetwork(slaves=31).ok
    True
    """

    slaves: int = whole(1, 2 * ADDRESSES, help=_WORDS["slaves"], default=31)
    pairs: int = whole(0, ADDRESSES, help=_WORDS["pairs"], default=0)
    structure: str = choice(STRUCTURES, _WORDS["structure"], default="line")
    length: float = number(10, 300, "m", _WORDS["length"], default=100.0, step=5)
    supply: float = number(0, 1, help=_WORDS["supply"], default=0.5, step=0.05)
    current_ma: float = number(0, 500, "mA", _WORDS["current_ma"], (0, 200), default=65.0, step=5)
    error_rate: float = number(
        0, 1, help=_WORDS["error_rate"], slider=(0, 0.5), default=0.0, step=0.01
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
        broken, cycle = self.result.broken, self.plan.cycle
        # With errors, a slave is polled up to twice per cycle; the worst case includes both polls.
        response = cycle.response_time(repetitions=1 if self.error_rate else None)
        effect = independent_failures(self.error_rate, cycle).iloc[0]
        return View(
            verdict="\n".join(broken) or f"all rules met: {len(self.result)} checks",
            ok=not broken,
            numbers={
                "cycle": f"{1e3 * float(cycle.time):.2f} ms",
                "bus time": f"{100 * cycle.bus_time:.1f} %",
                "capacity used": f"{cycle.addresses} of {ADDRESSES} addresses",
                "each slave polled every": f"{1e3 * float(cycle.update_time()):.2f} ms",
                "input known after": f"{1e3 * response.best:.2f} to {1e3 * response.worst:.2f} ms",
                "repetitions": f"{effect['repetitions_per_s']:.3g} per second",
                "slaves dropped": f"{effect['drops_per_h']:.3g} per hour, if failures are "
                "independent",
            },
            plot=self.plot,
            height=3.2,
            about="Plan of master, supply, cables and slaves; parts that violate a rule are red",
        )
