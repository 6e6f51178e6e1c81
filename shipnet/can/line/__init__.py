"""CAN on its cable: waveforms, and the bits that the nodes read from them."""

from shipnet.can.line.waveforms import BusLine, LineRun, send

__all__ = ["BusLine", "LineRun", "send"]
