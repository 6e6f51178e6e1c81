"""When the master gives a path up, and when it tries it again."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar, check_whole
from shipnet.modbus.timing import Poll

__all__ = ["Supervision", "check_rule"]


@dataclass(frozen=True, slots=True)
class Supervision:
    """The rule by which a master with two ports leaves one for the other.

    A poll fails when the request and all its retries, as `Poll` has them, stay unanswered.

    Parameters
    ----------
    failures : int, default 1
        How many polls of a slave must fail in a row, 1..100. With the last of them the master
        asks it through the other port at once, with the same retries. If it answers there, it is
        served from there; if not, it is lost, and no longer polled.
    recheck : float, default 60
        When so much time has passed without a failed try, 1e-3..1e6 [s], the master tries once
        more what it gave up: the next slave in turn that is lost or served through B gets one
        request through port A, without retries, and a lost one then another through B. A slave
        that answers through A goes home, and the next one is tried in the same scan.
    move : {"slave", "beyond"}, default "slave"
        Who is moved to the other port: the slave alone, or with it all that lie beyond it on the
        cable and are served through the same port.

    Raises
    ------
    ArgumentError
        If a field is out of its range.

    Notes
    -----
    All values are assumptions: [1]_ prints that the other direction is used when the line is
    broken, [2]_ that the AMS judges the state of its channels, and neither prints a rule.

    References
    ----------
    .. [1] J. H. Kim and Y. H. Yu, 2014, section 2.1.
    .. [2] J.-H. Lee and D.-S. Kim, 2012, sections III.2 and IV.2.

    Examples
    --------
    >>> Supervision(failures=2, move="beyond")
    Supervision(failures=2, recheck=60.0, move='beyond')
    """

    failures: int = 1
    recheck: float = 60.0
    move: Literal["slave", "beyond"] = "slave"

    def __post_init__(self) -> None:
        """Check every field."""
        object.__setattr__(self, "failures", check_whole("failures", self.failures, 1, 100))
        object.__setattr__(self, "recheck", check_scalar("recheck", self.recheck, "s", 1e-3, 1e6))
        if self.move not in ("slave", "beyond"):
            raise ArgumentError(f"move is {self.move!r}; it must be slave or beyond")

    def check_scan(self, period: float) -> None:
        """Raise if what was given up is tried again more often than once a scan.

        Parameters
        ----------
        period : float
            Time from one scan to the next [s].
        """
        if self.recheck < period * (1 - 1e-12):
            raise ArgumentError(
                f"recheck is {self.recheck:g} s; it must not be shorter than a scan, {period:g} s"
            )


def check_rule(poll: Poll, supervision: Supervision) -> None:
    """Raise unless a master knows what it asks and when it gives up.

    Parameters
    ----------
    poll : Poll
        What each slave is asked.
    supervision : Supervision
        When the master uses which port.

    Raises
    ------
    ArgumentError
        If one is of another class.

    Examples
    --------
    >>> check_rule(None, Supervision())
    Traceback (most recent call last):
        ...
    shipnet.errors.ArgumentError: poll is None; it must be a Poll
    """
    for name, given, kind in (("poll", poll, Poll), ("supervision", supervision, Supervision)):
        if not isinstance(given, kind):
            raise ArgumentError(f"{name} is {given!r}; it must be a {kind.__name__}")
