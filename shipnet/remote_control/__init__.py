"""Remote control of a main engine: its packets, its receive ring, its serial chip."""

from shipnet.remote_control.items import Items
from shipnet.remote_control.packet import Format, Markers, Parser
from shipnet.remote_control.stuffed import Stuffed

__all__ = ["Format", "Items", "Markers", "Parser", "Stuffed"]
