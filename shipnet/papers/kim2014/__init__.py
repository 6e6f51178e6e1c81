"""What kim2014 prints, recomputed: ballast valves on a redundant Modbus line.

J. H. Kim, Y. H. Yu, "Development of electro hydraulic ballast remote valve control system with
diagnostic function using redundant Modbus communication", Journal of the Korean Society of Marine
Engineering 38(3), 292-301, 2014.
"""

from shipnet.papers.kim2014.faults import (
    age_table,
    broken_loops,
    fired_table,
    graded_trials,
    picture_table,
    reading_table,
    seen_strokes,
    through_registers,
)
from shipnet.papers.kim2014.line import break_table, conversation, switch_table
from shipnet.papers.kim2014.registers import answer_table, code_table, survival_table, table

__all__ = ["age_table", "answer_table", "break_table", "broken_loops", "code_table"]
__all__ += ["conversation", "fired_table", "graded_trials", "picture_table"]
__all__ += ["reading_table", "seen_strokes", "survival_table", "switch_table", "table"]
__all__ += ["through_registers"]
