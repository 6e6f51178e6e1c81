"""CAN: frames, bit timing, schedules, and a bus on which they meet."""

__all__: list[str] = []
