"""CAN: frames to the bit, messages and their response times, the bus simulated, files of both."""

from shipnet.can.frame import Frame
from shipnet.can.reader import decode

__all__ = ["Frame", "decode"]
