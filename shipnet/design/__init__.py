"""From the points on board to a design."""

from shipnet.design.cabling import (
    SIGNALS,
    Saving,
    asi_conductors,
    count_points,
    hardwired_conductors,
    lines_needed,
    saving,
    slaves_needed,
)

__all__ = [
    "SIGNALS",
    "Saving",
    "asi_conductors",
    "count_points",
    "hardwired_conductors",
    "lines_needed",
    "saving",
    "slaves_needed",
]
