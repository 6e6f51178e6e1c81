"""From the points on board to a design."""

from shipnet.design.cabling import (
    SIGNALS,
    Saving,
    asi_conductors,
    compare,
    count_points,
    hardwired_conductors,
    lines_needed,
    slaves_needed,
)

__all__ = [
    "SIGNALS",
    "Saving",
    "asi_conductors",
    "compare",
    "count_points",
    "hardwired_conductors",
    "lines_needed",
    "slaves_needed",
]
