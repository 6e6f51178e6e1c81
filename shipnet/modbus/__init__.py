"""Modbus: requests and responses, their frames in RTU and TCP, and their timing.

Unit ids, slaves and registers are numbered as on the wire; times are in seconds. The namespace
`faults` contains the faults of redundant lines, and `udp` Modbus in datagrams.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
