"""What a network comes to: conductors, cable, work and money, each from low to high."""

__all__: list[str] = []
