"""What becomes of a run of a motor."""

from __future__ import annotations

from typing import NamedTuple

__all__ = ["Movement"]


class Movement(NamedTuple):
    """A run of a motor that has ended.

    Attributes
    ----------
    valve : int
        Which valve.
    action : str
        ``open``, ``close`` or ``position``.
    start, end : float
        When the motor started and stopped [s].
    opening : float
        Where the valve stood then, 0..1.
    outcome : str
        ``limit`` (switch at an end), ``position``, ``stopped``, ``replaced`` (another command) or
        ``time`` (the motor ran for too long).
    """

    valve: int
    action: str
    start: float
    end: float
    opening: float
    outcome: str
