"""Simulated time: whole nanoseconds, and faults that begin and end."""

from __future__ import annotations

from math import inf
from typing import Any

from shipnet.errors import ArgumentError
from shipnet.fields import check_fields, number, record

#: A time later than all others [ns].
NEVER = 1 << 62


def nanoseconds(time: float) -> int:
    """Return a time in seconds as the nearest whole number of nanoseconds; `NEVER` for infinity."""
    return NEVER if time == inf else round(time * 1e9)


@record
class Fault:
    """Base class of faults that begin and end."""

    start: float = number(0, 1e9, "s", "Start of the fault", default=0.0, kw_only=True)
    stop: float = number(0, inf, "s", "End of the fault, after `start`", default=inf, kw_only=True)

    def __post_init__(self) -> None:
        check_fields(self)
        if not self.start < self.stop:
            raise ArgumentError(
                f"stop is {self.stop:g} s; it must be after start, {self.start:g} s"
            )

    @property
    def span(self) -> tuple[int, int]:
        """Start and end [ns]."""
        return nanoseconds(self.start), nanoseconds(self.stop)


def as_faults(faults: Any, *kinds: type) -> tuple[Any, ...]:
    """Return one or more faults as a tuple; raise ArgumentError if any is not of the `kinds`."""
    kinds = kinds or (Fault,)
    names = ", ".join(sorted(kind.__name__ for kind in kinds))
    try:
        several = (faults,) if isinstance(faults, kinds) else tuple(faults)
    except TypeError:
        raise ArgumentError(f"faults is {faults!r}; it must be one or more of {names}") from None
    for fault in several:
        if not isinstance(fault, kinds):
            raise ArgumentError(f"one of faults is {fault!r}; it must be one of {names}")
    return several
