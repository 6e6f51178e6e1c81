"""CAN: frames to the bit, their lengths, and what a bus does with them."""

__all__: list[str] = []
