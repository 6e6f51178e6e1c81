"""What kim2014 prints, recomputed: ballast valves on a redundant Modbus line.

J. H. Kim, Y. H. Yu, "Development of electro hydraulic ballast remote valve control system with
diagnostic function using redundant Modbus communication", Journal of the Korean Society of Marine
Engineering 38(3), 292-301, 2014.
"""

from shipnet.papers.kim2014 import (
    addresses,
    diagnosis,
    ethernet,
    loop,
    messages,
    names,
    rules,
    valve,
)

__all__ = ["addresses", "diagnosis", "ethernet", "loop", "messages", "names", "rules", "valve"]
