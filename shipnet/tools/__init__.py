"""Interactive tools: records whose fields are the controls of a page that shows an answer."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
