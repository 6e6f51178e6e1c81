"""Fuzzy rule tables: firing strengths, decisions with their reasons, overlaps and gaps."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
