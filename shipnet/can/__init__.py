"""CAN: frames, messages and their response times, a simulated bus, logs and cables.

Times are in seconds and bit rates in bit/s; table columns name their units. python-can is also
imported as ``can``: import one of the two under another name.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
