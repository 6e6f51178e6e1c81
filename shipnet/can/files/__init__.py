"""CAN files: recorded frames, and the messages that a network has."""

from shipnet.can.files.dbc import read_dbc, write_dbc
from shipnet.can.files.load import LogLoad, load_from_log
from shipnet.can.files.log import Log, read_log, write_log

__all__ = ["Log", "LogLoad", "load_from_log", "read_dbc", "read_log", "write_dbc", "write_log"]
