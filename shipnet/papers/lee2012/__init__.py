"""What lee2012 prints, recomputed: an engine monitoring system on CAN and Modbus.

J. H. Lee, D. S. Kim, "Design and implementation of distributed control system based on dual
field-bus for ship engine", Journal of IEEK 49-SC(2), 2012.
"""

from shipnet.papers.lee2012 import buses, engine, operation  # noqa: F401 - they register
from shipnet.papers.lee2012.tables import table

__all__ = ["table"]
