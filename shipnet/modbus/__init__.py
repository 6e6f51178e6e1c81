"""Modbus: requests and responses, their frames in RTU, ASCII and TCP, and how long they take."""

__all__: list[str] = []
