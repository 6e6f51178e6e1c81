"""The engine monitoring system of lee2012: points, junction boxes, field buses and class rules."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
