"""What kim2023 prints, recomputed: AS-Interface for smart ships.

R. G. Kim, Y. H. Cho, K. H. Hyun, "AS-Interface protocol utilization for smart ships", Journal of
the Society of Naval Architects of Korea 60(6), 482-490, 2023, doi 10.3744/SNAK.2023.60.6.482.
"""

from shipnet.papers.kim2023.protocol import (
    EXAMPLE_REQUEST,
    EXAMPLE_RESPONSE,
    beside,
    differences,
    even_ones,
    printed,
    table,
)
from shipnet.papers.kim2023.ship import price_table
from shipnet.papers.kim2023.signals import DAMAGE, undetected

__all__ = ["DAMAGE", "EXAMPLE_REQUEST", "EXAMPLE_RESPONSE", "beside", "differences", "even_ones"]
__all__ += ["price_table", "printed", "table", "undetected"]
