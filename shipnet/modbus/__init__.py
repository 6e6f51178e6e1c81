"""Modbus: requests and responses, their frames in RTU, ASCII and TCP, and how long they take.

Unit ids, slaves and registers have the numbers that are on the wire; times are in seconds. Faults
of redundant lines are in the namespace `faults`, Modbus in datagrams in `udp`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
