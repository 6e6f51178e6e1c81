"""AS-Interface: telegrams, their signals and timing, captures, plans, and a line simulated."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
