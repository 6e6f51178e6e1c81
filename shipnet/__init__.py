"""Models of the field buses of a ship, and checks of five papers about them.

Each package has a small public API: ``from shipnet import asi, can``, then ``asi.cycle_time(31)``.
Quantities are in SI units without prefixes unless their name, such as ``cycle_time_ms``, or their
documentation states another unit.
"""

import lazy_loader

__version__ = "0.2.0"

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
