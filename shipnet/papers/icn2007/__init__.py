"""What icn2007 prints, recomputed: the AS-Interface communication system.

"AS-Interface communication system for field networks (2)", ICN magazine, July 2007. Claims that
kim2023 repeats are registered beside it, in `shipnet.papers.kim2023`.
"""

from shipnet.papers.icn2007.claims import (
    allowed_plans,
    arriving_share,
    bus_efficiencies,
    consumer_drop,
    pulse_height,
    rate_table,
    share_above,
)

__all__ = ["allowed_plans", "arriving_share", "bus_efficiencies", "consumer_drop", "pulse_height"]
__all__ += ["rate_table", "share_above"]
