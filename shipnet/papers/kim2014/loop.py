"""Sections 2.1, 3.2 and 3.3: the serial line, its closed loop, and how long a scan takes."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import TYPE_CHECKING, Literal

from shipnet.ballast import scan
from shipnet.engine.class_rules import RULES
from shipnet.modbus.adu import MAX_UNIT
from shipnet.modbus.electrical import INTERFACES
from shipnet.modbus.faults import Break, DeadPort
from shipnet.modbus.polling import Poll
from shipnet.modbus.redundancy import Loop
from shipnet.modbus.uart import SerialLine
from shipnet.papers.kim2014.answer import write_outcome
from shipnet.papers.registry import check, numeric

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["RATES", "break_table", "scan_table", "status_poll"]

#: Common rates between the ends that sections 3.2 and 3.3 print [bit/s].
RATES = scan.BIT_RATES

_MOVES: tuple[Literal["slave", "downstream"], ...] = ("slave", "downstream")


def status_poll(rate: float = 9600.0, **settings: float) -> Poll:
    """Return the poll that reads the four status registers of a valve.

    Parameters
    ----------
    rate : float, default 9600
        Bit rate [bit/s].
    **settings : float
        ``processing``, ``timeout`` and ``retries`` of `Poll`. The paper prints none of them, nor
        the character, which is 8E1 here.

    Returns
    -------
    Poll
        Query of 8 bytes, response of 13.

    Examples
    --------
    >>> round(status_poll(115200).scan_time(247), 2)
    1.36
    """
    return scan.status_poll(SerialLine(rate), **settings)  # type: ignore[arg-type]


@numeric("kim2014-005")
def silence(*, rate: float = float(SerialLine.SILENCE_LIMIT)) -> float:
    """Characters of silence between two frames, at the highest rate that counts them so."""
    return SerialLine(rate).t35 / SerialLine(rate).character_time


@numeric("kim2014-077")
def silence_at_highest_rate(*, rate: float = 115200.0) -> float:
    """Characters of silence between two frames at the highest rate of the paper."""
    return silence(rate=rate)


@numeric("kim2014-075")
def slowest_scan(*, slaves: int = MAX_UNIT, rate: float = 2400.0) -> float:
    """Seconds to read the status of all slaves at the lowest rate."""
    return status_poll(rate).scan_time(slaves)


@numeric("kim2014-076")
def fastest_scan(*, slaves: int = MAX_UNIT, rate: float = 115200.0) -> float:
    """Seconds to read the status of all slaves at the highest rate."""
    return status_poll(rate).scan_time(slaves)


@check("kim2014-008", counter={"breaks": 2})
def survives(*, breaks: int = 1, slaves: int = 5) -> bool:
    """Whether every slave stays within reach wherever the loop has so many breaks."""
    loop = Loop(slaves, status_poll())
    cuts = combinations(range(loop.n_sections), breaks)
    return not any(loop.reach([Break(section) for section in cut]).lost for cut in cuts)


@check("kim2014-050", counter={"dead": "B"})
def every_slave_has_two_ways(*, dead: Literal["A", "B", ""] = "", slaves: int = 5) -> bool:
    """Whether both ports of the master reach every slave, each of which has one port."""
    reach = Loop(slaves, status_poll()).reach([DeadPort(dead)] if dead else [])
    return reach.through_a == reach.through_b == list(range(1, slaves + 1))


@check("kim2014-051", counter={"at_end": False})
def sensors_are_seen_before_the_reply(*, at_end: bool = True, movement: float = 10.0) -> bool:
    """Whether a valve is polled while it moves, if it replies to the command at the end of it."""
    outcome = write_outcome(SerialLine(9600), 5, movement, at_end=at_end, timeout=2 * movement)
    return outcome.answered and outcome.polls_while_moving > 0


@check("kim2014-085", counter={"interface": "RS-422"})
def two_wires_are_enough(*, interface: str = "RS-485") -> bool:
    """Whether one pair, and a common conductor beside it, serves both directions."""
    pair_and_common = 3
    return INTERFACES[interface].wires.get("half") == pair_and_common


@check("kim2014-007", counter={"text": "MSC/Circ.891"})
def asks_for_two_lines(*, text: str = "SOLAS") -> bool:
    """Whether this is the text in which duplicated data links are asked for."""
    return any(text in rule.elsewhere for rule in RULES if rule.name == "links duplicated")


def scan_table(n_slaves: int = MAX_UNIT, *, processing: float = 0.0) -> pd.DataFrame:
    """Return how long a scan takes at the rates between those that the paper prints.

    Parameters
    ----------
    n_slaves : int, default 247
        Number of slaves.
    processing : float, default 0
        How long each slave, and the master after it, work on top of the silences [s].

    Returns
    -------
    pandas.DataFrame
        Indexed by ``bit_rate``: ``poll_ms``, ``scan_s``, and ``slaves_in_2_s``, how many a scan of
        2 s can have.

    Examples
    --------
    >>> scan_table(processing=5e-3).loc[115200].round(2).to_dict()
    {'poll_ms': 10.51, 'scan_s': 2.59, 'slaves_in_2_s': 190.0}
    """
    table = scan.scan_table(n_slaves, bit_rates=RATES, processing=processing)
    named = table.rename(columns={"read_ms": "poll_ms", "valves_in_2_s": "slaves_in_2_s"})
    return named[["poll_ms", "scan_s", "slaves_in_2_s"]]


def break_table(
    n_slaves: int = MAX_UNIT, *, timeouts: Sequence[float] = (0.05, 0.1, 0.5, 1.0)
) -> pd.DataFrame:
    """Return how long data stay away when the loop breaks in its middle, at 9600 bit/s.

    Parameters
    ----------
    n_slaves : int, default 247
        Number of slaves.
    timeouts : sequence of float
        Response timeouts of the master [s].

    Returns
    -------
    pandas.DataFrame
        Indexed by ``timeout_s``: longest time between two answers of a slave [s], where the master
        moves each slave by itself to the other port (``one_by_one_s``), or with it all downstream
        (``with_downstream_s``).

    Examples
    --------
    >>> break_table(timeouts=[1.0]).round(1).values.tolist()
    [[132.1, 9.9]]
    """
    import pandas as pd

    middle = [Break((n_slaves + 1) // 2)]
    rows = []
    for timeout in timeouts:
        poll = status_poll(timeout=timeout)
        loops = [Loop(n_slaves, poll, move=move) for move in _MOVES]
        rows.append([float(loop.worst_gap(middle).max()) for loop in loops])
    columns = ["one_by_one_s", "with_downstream_s"]
    return pd.DataFrame(rows, columns=columns, index=pd.Index(timeouts, name="timeout_s"))
