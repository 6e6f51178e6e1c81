"""What kim2014 prints, recomputed: ballast valves on a redundant Modbus line.

J. H. Kim, Y. H. Yu, "Development of electro hydraulic ballast remote valve control system with
diagnostic function using redundant Modbus communication", Journal of the Korean Society of Marine
Engineering 38(3), 292-301, 2014.
"""

from shipnet.papers.kim2014 import (  # noqa: F401 - they register
    addresses,
    ethernet,
    messages,
    names,
    rules,
)
from shipnet.papers.kim2014.answer import answer_table
from shipnet.papers.kim2014.diagnosis import score_table, through_registers
from shipnet.papers.kim2014.loop import break_table, scan_table
from shipnet.papers.kim2014.pictures import age_table, broken_loops, picture_table, seen_strokes
from shipnet.papers.kim2014.printed_messages import message_table
from shipnet.papers.kim2014.severity import graded_trials
from shipnet.papers.kim2014.switches import switch_table
from shipnet.papers.kim2014.talk import conversation
from shipnet.papers.kim2014.valve import code_table, survival_table

__all__ = ["age_table", "answer_table", "break_table", "broken_loops", "code_table"]
__all__ += ["conversation", "graded_trials", "message_table", "picture_table", "scan_table"]
__all__ += ["score_table", "seen_strokes", "survival_table", "switch_table", "through_registers"]
