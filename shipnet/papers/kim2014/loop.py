"""Sections 2.1, 3.2 and 3.3: the serial line, its closed loop, and how long a scan takes."""

from __future__ import annotations

from itertools import combinations
from typing import Literal

from shipnet.ballast.answer import write_outcome
from shipnet.ballast.scales import FIRST_REGISTER, N_REGISTERS
from shipnet.engine.class_rules import RULES
from shipnet.engine.serial_interface import INTERFACES
from shipnet.modbus.frame import LAST_UNIT
from shipnet.modbus.request import ReadRequest
from shipnet.modbus.ring import Break, DeadPort, Loop
from shipnet.modbus.timing import SILENCE_LIMIT, Poll, Serial
from shipnet.papers.registry import check, numeric

__all__ = ["status_poll"]


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
    >>> round(status_poll(115200).scan(247), 2)
    1.36
    """
    request = ReadRequest(4, FIRST_REGISTER, N_REGISTERS)  # type: ignore[arg-type]
    return Poll.of(request, Serial(rate), **settings)  # type: ignore[arg-type]


@numeric("kim2014-005")
def silence(*, rate: float = float(SILENCE_LIMIT)) -> float:
    """Characters of silence between two frames, at the highest rate that counts them so."""
    return Serial(rate).t35 / Serial(rate).character_time


@numeric("kim2014-077")
def silence_at_highest_rate(*, rate: float = 115200.0) -> float:
    """Characters of silence between two frames at the highest rate of the paper."""
    return silence(rate=rate)


@numeric("kim2014-075")
def slowest_scan(*, slaves: int = LAST_UNIT, rate: float = 2400.0) -> float:
    """Seconds to read the status of all slaves at the lowest rate."""
    return status_poll(rate).scan(slaves)


@numeric("kim2014-076")
def fastest_scan(*, slaves: int = LAST_UNIT, rate: float = 115200.0) -> float:
    """Seconds to read the status of all slaves at the highest rate."""
    return status_poll(rate).scan(slaves)


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
    outcome = write_outcome(Serial(9600), 5, movement, at_end=at_end, timeout=2 * movement)
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
