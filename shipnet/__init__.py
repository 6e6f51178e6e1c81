"""Models of a ship's field buses, and recalculations of five papers about them.

Each package has a small public front: ``from shipnet import asi, can``, then
``asi.cycle_time(31)``. Quantities are in SI base units unless a name says otherwise; names such as
``*_ms`` occur only in tables and printed text.
"""

import lazy_loader

__version__ = "0.1.0"

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
