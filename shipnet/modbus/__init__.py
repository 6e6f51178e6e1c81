"""Modbus: requests and responses, their RTU and TCP frames, and their timing.

Unit ids, slaves and registers are numbered as on the wire; times are in seconds. The module
`faults` contains the faults of redundant lines; the module `udp` models Modbus in UDP datagrams.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
