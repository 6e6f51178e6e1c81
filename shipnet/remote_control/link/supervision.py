"""How a station finds out that its partner has failed: the counters of Fig. 5 of chung1998."""

from __future__ import annotations

from dataclasses import dataclass, field

from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar, check_whole

__all__ = ["MEANT", "PRINTED", "Counter", "Supervision"]


@dataclass(frozen=True, slots=True)
class Supervision:
    r"""Rule by which silence becomes a failure.

    Every tick adds 1 to ``count``, any 0xDD clears ``count`` and ``miss``. A ``count`` beyond its
    limit is cleared and adds 1 to ``miss``; a ``miss`` beyond its limit is a failure. With limits
    c and m, the failure comes with tick number

    .. math:: N = (c + 1)(m + 1), \quad \text{or} \quad N = c \, m

    as "beyond" is read as greater than the limit, or as reaching it.

    Parameters
    ----------
    tick : float, default 0.1
        Period of the timer, 1e-3..10 [s].
    count_limit : int, default 10
        1..1000 [ticks].
    miss_limit : int, default 3
        0..1000; at least 1 if reaching it is enough.
    strict : bool, default True
        Whether a limit must be exceeded, or reaching it is enough.
    while_sending : bool, default False
        Whether ticks count while the station sends, or only while it receives, as printed.

    Raises
    ------
    ArgumentError
        If a field is out of its range.

    Notes
    -----
    Section 4 of chung1998 prints both tests with "greater than" and calls the outcome 3 seconds;
    that needs both as "reaching" (claims chung1998-007 and 045).

    Examples
    --------
    >>> PRINTED.n_ticks, [round(t, 3) for t in PRINTED.detection_time]
    (44, [4.3, 4.4])
    >>> MEANT.n_ticks, [round(t, 3) for t in MEANT.detection_time]
    (30, [2.9, 3.0])
    """

    tick: float = 0.1
    count_limit: int = 10
    miss_limit: int = 3
    strict: bool = True
    while_sending: bool = False

    def __post_init__(self) -> None:
        """Check every field."""
        object.__setattr__(self, "tick", check_scalar("tick", self.tick, "s", 1e-3, 10))
        for name in ("strict", "while_sending"):
            if not isinstance(getattr(self, name), bool):
                raise ArgumentError(f"{name} is {getattr(self, name)!r}; it must be True or False")
        check_whole("count_limit", self.count_limit, 1, 1000)
        check_whole("miss_limit", self.miss_limit, 0 if self.strict else 1, 1000)

    @property
    def miss_ticks(self) -> int:
        """Ticks until the first miss."""
        return self.count_limit + self.strict

    @property
    def n_ticks(self) -> int:
        """Ticks until the failure."""
        return self.miss_ticks * (self.miss_limit + self.strict)

    @property
    def detection_time(self) -> tuple[float, float]:
        """Shortest (excluded) and longest time from the last 0xDD to the failure [s].

        It depends on how soon the first tick follows, and holds for a station that does not send
        in the meantime.
        """
        return (self.n_ticks - 1) * self.tick, self.n_ticks * self.tick


#: The rule as section 4 of chung1998 prints it, and as its 3 seconds say that it was meant.
PRINTED = Supervision()
MEANT = Supervision(strict=False)


@dataclass(slots=True)
class Counter:
    """The two counters of one station for one partner.

    Parameters
    ----------
    rule : Supervision
        When silence is a failure.

    Attributes
    ----------
    count, miss : int
        The counters.
    ticks : int
        Ticks since the last 0xDD.
    failed : bool
        Whether the partner is taken as failed.

    Examples
    --------
    >>> counter = Counter(PRINTED)
    >>> next(k for k in range(1, 100) if counter.step())
    44
    >>> counter.failed, counter.clear(), counter.failed
    (True, True, False)
    """

    rule: Supervision
    count: int = field(default=0, init=False)
    miss: int = field(default=0, init=False)
    ticks: int = field(default=0, init=False)
    failed: bool = field(default=False, init=False)

    def step(self) -> bool:
        """Count one tick; return whether the silence has just become a failure.

        The counters begin anew after a failure, so that a partner that stays silent fails again.
        """
        self.count += 1
        self.ticks += 1
        if self.count >= self.rule.miss_ticks:
            self.count = 0
            self.miss += 1
        if self.miss >= self.rule.miss_limit + self.rule.strict:
            self.miss = 0
            self.failed = True
            return True
        return False

    def clear(self) -> bool:
        """Clear everything, for a 0xDD has come; return whether the partner had failed."""
        failed, self.failed = self.failed, False
        self.count = self.miss = self.ticks = 0
        return failed
