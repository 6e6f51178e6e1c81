"""Remote control of a main engine: its packets, its receive ring, its serial chip."""

from shipnet.remote_control.batch import Checked, check_batch, encode_batch
from shipnet.remote_control.changes import Sender, changed
from shipnet.remote_control.imitation import imitation_share, late_start
from shipnet.remote_control.items import Items
from shipnet.remote_control.packet import Format, Markers, Parser
from shipnet.remote_control.stuffed import Stuffed

__all__ = ["Checked", "Format", "Items", "Markers", "Parser", "Sender", "Stuffed", "changed"]
__all__ += ["check_batch", "encode_batch", "imitation_share", "late_start"]
