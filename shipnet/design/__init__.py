"""Design of a ship's cabling: make several plans for an I/O list, and compare them.

review = design.read_iolist("list.xlsx").compare(cabinet=(26, 6, 14))
print(review)
review.report("report.html")
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
