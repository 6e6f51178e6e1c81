"""Models of the field buses of a ship, and checks of five papers about them.

Each package has a small public API: ``from shipnet import asi, can``, then ``asi.cycle_time(31)``.
Quantities are in SI units without prefixes; only tables and printed text use other units, which
their names state, as in ``cycle_time_ms``.
"""

import lazy_loader

__version__ = "0.1.0"

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
