"""Interactive tools: each is a record whose fields are the controls of a page with the answer."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
