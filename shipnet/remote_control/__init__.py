"""Remote control of a main engine: its packets, its receive ring, its serial chip."""

from shipnet.remote_control.batch import Checked, check_batch, encode_batch
from shipnet.remote_control.changes import Sender, changed
from shipnet.remote_control.extraction import extract_items, extract_value, extraction_table
from shipnet.remote_control.imitation import imitation_share, late_start
from shipnet.remote_control.packet import Format, Markers, Parser
from shipnet.remote_control.ring_buffer import Ring, State, Step, pointer_case
from shipnet.remote_control.ring_states import case_table, explore
from shipnet.remote_control.stuffed import Stuffed
from shipnet.remote_control.usart import Sent, Status, Usart, send_meant, send_printed

__all__ = ["Checked", "Format", "Markers", "Parser", "Ring", "Sender", "Sent", "State"]
__all__ += ["Status", "Step", "Stuffed", "Usart", "case_table", "changed", "check_batch"]
__all__ += ["encode_batch", "explore", "extract_items", "extract_value", "extraction_table"]
__all__ += ["imitation_share", "late_start", "pointer_case", "send_meant", "send_printed"]
