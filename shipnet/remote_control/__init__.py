"""Remote control of a main engine by chung1998: packets, receive ring and a link of three stations.

In notebooks: ``from shipnet import remote_control as rc``.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
