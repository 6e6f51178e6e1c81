"""Design of a ship's cabling: an I/O list is planned in several ways, and the plans compared.

review = design.read_iolist("list.xlsx").compare(cabinet=(26, 6, 14))
print(review)
review.report("report.html")
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
