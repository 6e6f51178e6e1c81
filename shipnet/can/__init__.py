"""CAN: frames, bit timing, schedules and the bus itself."""

__all__: list[str] = []
