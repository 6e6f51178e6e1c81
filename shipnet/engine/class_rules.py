"""The class rules that lee2012 quotes in section II, each checked on a described system.

What a description leaves out is not verified: it neither passes nor fails. The text of the rules
themselves was not available; `Rule.elsewhere` says what public texts ask on the same matter.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from shipnet.engine.description import Description
from shipnet.engine.error_detection import undetected
from shipnet.engine.redundancy import Redundancy
from shipnet.errors import ArgumentError

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["RULES", "STANDARDS", "Rule", "check"]

Verdict = Literal["pass", "fail", "not verified"]

#: Protocols with an open international standard or public specification, and the CRC they have.
STANDARDS: dict[str, tuple[str, str | None]] = {
    "CAN": ("ISO 11898-1", "CRC-15/CAN"),
    "Modbus RTU": ("MODBUS over serial line V1.02", "CRC-16/MODBUS"),
    # The checksum of TCP is none.
    "Modbus TCP": ("MODBUS application protocol V1.1b3", None),
}

_DNV = "DNV-OS-D202 Ch.2 Sec.3 Table A1"
_CIRCULAR = "MSC/Circ.891"


class _Outcome(NamedTuple):
    """What a check came to: verdict, the value computed, and why."""

    verdict: Verdict
    computed: float
    why: str


_UNKNOWN = _Outcome("not verified", float("nan"), "not described")


@dataclass(frozen=True, slots=True)
class Rule:
    """A class rule as the paper quotes it.

    Parameters
    ----------
    name : str
        Short name.
    asks : str
        What it asks.
    measure : str
        What is computed for it, with its unit.
    limit : float
        The computed value may be this at most (at least, if `at_least`).
    outcome : callable
        The check.
    elsewhere : str
        What public texts ask on the same matter.
    at_least : bool, default False
        Which side of the limit is good.

    Examples
    --------
    >>> [rule.name for rule in RULES][:3]
    ['CPU duplicated', 'supply duplicated', 'supply changes over']
    """

    name: str
    asks: str
    measure: str
    limit: float
    outcome: Callable[[Description, Rule], _Outcome]
    elsewhere: str
    at_least: bool = False

    def judge(self, computed: float, why: str = "") -> _Outcome:
        """Return the outcome of a computed value."""
        good = computed >= self.limit if self.at_least else computed <= self.limit
        return _Outcome("pass" if good else "fail", float(computed), why)


def _lost(kind: str) -> Callable[[Description, Rule], _Outcome]:
    def outcome(system: Description, rule: Rule) -> _Outcome:
        count = system.cpus if kind == "cpu" else system.supplies
        if count is None:
            return _UNKNOWN
        boxes = Redundancy(system.points, supplies=count, cpus=count)
        lost = max(boxes.lost([part]) for part in boxes.parts if part.kind == kind)
        return rule.judge(lost, f"{count} a box")

    return outcome


def _switch_over(system: Description, rule: Rule) -> _Outcome:
    if system.power_switch_over is None:
        return _UNKNOWN
    return rule.judge(system.power_switch_over)


def _memory(system: Description, rule: Rule) -> _Outcome:
    return _UNKNOWN if system.volatile is None else rule.judge(system.volatile)


def _standard(system: Description, rule: Rule) -> _Outcome:
    if system.protocols is None:
        return _UNKNOWN
    own = [name for name in system.protocols if name not in STANDARDS]
    known = [f"{name}: {STANDARDS[name][0]}" for name in system.protocols if name in STANDARDS]
    return rule.judge(len(own), "; ".join([*known, *(f"{name}: none known" for name in own)]))


def _links(system: Description, rule: Rule) -> _Outcome:
    if system.links is None:
        return _UNKNOWN
    apart = _apart(system.links)
    shared = f"shared: {', '.join(sorted(apart[1]))}" if apart[1] else ""
    return rule.judge(apart[0], shared)


def _routes(system: Description, rule: Rule) -> _Outcome:
    if system.routes is None:
        return _Outcome("not verified", float("nan"), "the routes are not described")
    apart = _apart(system.routes)
    return rule.judge(apart[0], f"shared: {', '.join(sorted(apart[1]))}" if apart[1] else "")


def _apart(links: Mapping[str, tuple[str, ...]]) -> tuple[int, set[str]]:
    """Return how many links no two of which share anything, at most, and what any two share."""
    sets = [set(way) for way in links.values()]
    shared: set[str] = set().union(*(a & b for a, b in combinations(sets, 2)))
    for count in range(len(sets), 0, -1):
        for some in combinations(sets, count):
            if all(not (a & b) for a, b in combinations(some, 2)):
                return count, shared
    return 0, shared


def _answer(system: Description, rule: Rule) -> _Outcome:
    if system.poll is None:
        return _UNKNOWN
    poll = system.poll
    time = poll.line.frame_time(poll.request_size) + poll.shortest_timeout
    return rule.judge(time, "from the first bit of the request to the last of the response")


def _crc(system: Description, rule: Rule) -> _Outcome:
    if system.protocols is None:
        return _UNKNOWN
    names = {name: STANDARDS.get(name, ("", None))[1] for name in system.protocols}
    without = [name for name, algorithm in names.items() if algorithm is None]
    if without:
        return _Outcome("fail", float("nan"), f"no CRC: {', '.join(without)}")
    used = [algorithm for algorithm in names.values() if algorithm]
    missed = sum(undetected(algorithm, flips=n) for algorithm in used for n in (1, 2))
    return rule.judge(missed, ", ".join(used))


def _repeats(system: Description, rule: Rule) -> _Outcome:
    if system.protocols is None:
        return _UNKNOWN
    # A CAN controller repeats until it succeeds; ISO 11898-1. A Modbus master may ask again.
    asked = [name for name in system.protocols if name != "CAN"]
    if not asked:
        return rule.judge(float("inf"), "CAN repeats by itself")
    if system.poll is None or not system.retries_known:
        return _Outcome("not verified", float("nan"), f"retries of {asked[0]} are not described")
    return rule.judge(system.poll.retries, f"retries of {asked[0]}")


#: The rules of section II in the order of the paper.
RULES = (
    Rule(
        "CPU duplicated",
        "the CPU is duplicated",
        "points lost by a dead CPU",
        0,
        _lost("cpu"),
        "none found in the public texts consulted",
    ),
    Rule(
        "supply duplicated",
        "the power supply is duplicated",
        "points lost by a dead supply",
        0,
        _lost("supply"),
        "SOLAS II-1/51: a stand-by supply of the alarm system",
    ),
    Rule(
        "supply changes over",
        "the supply changes over within 2 s",
        "change-over [s]",
        2.0,
        _switch_over,
        "SOLAS II-1/51: automatic, without a number",
    ),
    Rule(
        "memory",
        "only non-volatile memory",
        "volatile memories (1 is some)",
        0,
        _memory,
        "none found in the public texts consulted",
    ),
    Rule(
        "standard protocol",
        "the protocol is an open international standard",
        "protocols without a standard",
        0,
        _standard,
        f"{_CIRCULAR} 4.6.4: standardized interfaces",
    ),
    Rule(
        "links duplicated",
        "the data link is duplicated",
        "links that share no station",
        2,
        _links,
        f"{_CIRCULAR} 4.6.2: redundant where two essential functions share a link",
        at_least=True,
    ),
    Rule(
        "links routed apart",
        "the cables of the links are routed apart",
        "links that share no space",
        2,
        _routes,
        f"{_CIRCULAR} 4.6.2: as much separation as practical",
        at_least=True,
    ),
    Rule(
        "answer",
        "data are answered within 2 s",
        "request and response [s]",
        2.0,
        _answer,
        f"{_DNV}: alarms presented within 2 s; BV Pt C Ch 3 Sec 3: 5 s",
    ),
    Rule(
        "CRC",
        "transmission is verified by a CRC",
        "single and double bit errors unseen (CAN: before bit stuffing)",
        0,
        _crc,
        f"{_CIRCULAR} 4.6.1: the link checks itself",
    ),
    Rule(
        "retransmission",
        "what went wrong is sent again",
        "repeats",
        1,
        _repeats,
        "none found in the public texts consulted",
        at_least=True,
    ),
)


def check(system: Description) -> pd.DataFrame:
    """Return how a system stands against the rules.

    Parameters
    ----------
    system : Description
        What is known of it.

    Returns
    -------
    pandas.DataFrame
        One row a rule: ``rule``, ``asks``, ``measure``, ``computed`` (NaN if nothing could be),
        ``limit``, ``verdict`` (pass, fail or not verified), ``why``, ``elsewhere``.

    Raises
    ------
    ArgumentError
        If `system` is no description.

    Examples
    --------
    >>> from shipnet.engine.description import printed_system
    >>> table = check(printed_system()).set_index("rule")
    >>> table.verdict.value_counts().to_dict()
    {'not verified': 5, 'pass': 4, 'fail': 1}
    >>> print(*table.loc["CPU duplicated", ["computed", "verdict"]])
    43.0 fail
    """
    import pandas as pd

    if not isinstance(system, Description):
        raise ArgumentError(f"system is {system!r}; it must be a Description")
    rows: list[tuple[Any, ...]] = []
    for rule in RULES:
        outcome = rule.outcome(system, rule)
        rows.append(
            (rule.name, rule.asks, rule.measure, outcome.computed, rule.limit, outcome.verdict,
             outcome.why, rule.elsewhere)
        )  # fmt: skip
    columns = ["rule", "asks", "measure", "computed", "limit", "verdict", "why", "elsewhere"]
    return pd.DataFrame(rows, columns=columns)
