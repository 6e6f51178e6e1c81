"""Simulated Modbus slaves: what they hold, how they answer, and a real server in front of them."""

from shipnet.modbus.server.device import Device, DeviceError, RegisterDevice, Table
from shipnet.modbus.server.serve import Server, real_clock, serve
from shipnet.modbus.server.slave import Answer, Slave, answer

__all__ = [
    "Answer",
    "Device",
    "DeviceError",
    "RegisterDevice",
    "Server",
    "Slave",
    "Table",
    "answer",
    "real_clock",
    "serve",
]
