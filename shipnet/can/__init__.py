"""CAN: frames to the bit, messages and their response times, the bus simulated, logs, the cable.

Times are in seconds and bit rates in bit/s; columns of tables name their units. The live
interface of python-can is also called ``can``: import it under another name beside this one.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
