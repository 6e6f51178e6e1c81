"""Interactive tools: each is a record whose fields are its controls, with an answer and a page."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
