"""Excel workbooks (.xlsx): what their cells hold, row by row, as text.

The standard library reads both archive and XML. A file is read as if it came from a stranger:
formulas are never evaluated, a part with a DTD is refused, so that no entity can grow, and what the
archive, a sheet and a row may hold is bounded.

Two libraries were tried first. openpyxl takes two to three times as long as reading and checking
here (`benchmarks/design_iolist.py`). python-calamine 0.9 is fast, but reads an error such as #N/A
as an empty cell, and for two cells far apart it claims the memory of the rectangle between them,
which ends the process.
"""

from shipnet.workbook.archive import Workbook
from shipnet.workbook.parts import ERRORS, Merged, Row

__all__ = ["ERRORS", "Merged", "Row", "Workbook"]
