"""Rule tables: which rules fire, what is reported and why, and what a table leaves open."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
