"""Field buses of a ship, computed, and five papers about them, recomputed.

Each package has a small public front: ``from shipnet import asi, can``, then
``asi.cycle_time(31)``. Quantities are in SI base units unless a name says otherwise:
``*_ms`` and the like occur in tables and printed text only.
"""

import lazy_loader

__version__ = "0.1.0"

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
