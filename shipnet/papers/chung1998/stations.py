"""Sections 1, 2 and 4.1: the three stations, their chips, and the loop that sends a byte."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from shipnet import datasets
from shipnet.errors import ArgumentError
from shipnet.papers.registry import check, numeric
from shipnet.remote_control.signals import HOPS, SIGNALS, STATIONS, Hop
from shipnet.remote_control.usart import Status, Usart, send_meant, send_printed

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["PRINTED", "chips_needed", "loop_table"]

#: What the paper prints, by its name: `chung1998_parameters.csv`.
_TABLE = datasets.read("chung1998_parameters.csv")
PRINTED = dict(zip(_TABLE["parameter"], _TABLE["value"], strict=True))

#: Inputs of an 8259, and counters of an 8253: data sheets of Intel.
_INPUTS, _COUNTERS = 8, 3


@check("chung1998-001", counter={"lines": 3})
def chips_are_enough(*, lines: int = int(PRINTED["chips_8251"])) -> bool:
    """Whether one 8259 and one 8253 serve so many serial chips and a timer of 0.1 s.

    Each line needs an interrupt for the bytes that come in and a clock of its own, the
    supervision one more of both. Sending needs none: it polls.
    """
    return lines + 1 <= _INPUTS and lines + 1 <= _COUNTERS


def chips_needed(station: str, hops: tuple[Hop, ...] = HOPS) -> int:
    """Return how many serial chips a station needs, one for each partner.

    Parameters
    ----------
    station : {"RCS", "BCS", "SS"}
        The station.
    hops : tuple of Hop, optional
        Flows from station to station; those of the paper if omitted.

    Returns
    -------
    int
        Number of its lines.

    Raises
    ------
    ArgumentError
        If there is no such station.

    Examples
    --------
    >>> [chips_needed(station) for station in STATIONS]
    [2, 1, 1]
    """
    if station not in STATIONS:
        raise ArgumentError(f"station is {station!r}; it must be one of {STATIONS}")
    return sum(station == source for source, _ in hops)


@numeric("chung1998-029")
def serial_chips(*, hops: tuple[Hop, ...] = HOPS) -> int:
    """Serial chips that each station needs on these flows: the fewest of the three stations."""
    return min(chips_needed(station, hops) for station in STATIONS)


@check("chung1998-030", counter={"flows": HOPS[:3]})
def flows_are_enough(*, flows: tuple[Hop, ...] = HOPS) -> bool:
    """Whether every value comes to all who need it on these flows, by RCS where it must."""
    return all(hop in flows for signal in SIGNALS for hop in signal.hops)


def loop_table(
    packet: bytes, waiting: bytes = b"12", polls: Sequence[float] = (20e-6,)
) -> pd.DataFrame:
    """Return what the printed loop and the meant one send, on an idle chip and on a busy one.

    Parameters
    ----------
    packet : bytes
        What to send at 9600 bit/s.
    waiting : bytes, optional
        What a busy chip has still to send, 2 bytes.
    polls : sequence of float, optional
        Times to read the status or to write a byte, 1e-7..1 [s]; assumed, the paper names none.
        How often the printed loop repeats a byte on a busy chip depends on them by chance.

    Returns
    -------
    pandas.DataFrame
        A row a chip, loop and poll: ``chip``, ``loop``, ``poll [us]``, ``on the line`` behind the
        byte that is being shifted out, ``writes`` to the chip, ``bytes lost``; an idle chip and
        the meant loop only with the first poll, which makes no difference there.

    Raises
    ------
    ArgumentError
        If an argument is out of range, or there is no poll.

    Examples
    --------
    >>> loop_table(b"abc")["on the line"].tolist()[:2]
    ['', '61 62 63']
    """
    import pandas as pd

    if not polls:
        raise ArgumentError("polls is empty; it must hold a time")
    ways = [("idle", b"", "printed", polls[0]), ("idle", b"", "meant", polls[0])]
    ways += [("busy", waiting, "printed", poll) for poll in polls]
    ways += [("busy", waiting, "meant", polls[0])]
    loops = {"printed": send_printed, "meant": send_meant}
    rows = []
    for state, before, loop, poll in ways:
        chip = Usart(10 / 9600)
        for byte in before:
            chip.write(byte, 0.0)
        sent = loops[loop](chip, packet, poll=poll)
        rows.append((state, loop, 1e6 * poll, sent.line.hex(" "), sent.writes, sent.lost))
    columns = ["chip", "loop", "poll [us]", "on the line", "writes", "bytes lost"]
    return pd.DataFrame(rows, columns=columns)


@check("chung1998-008", counter={"printed": False})
def loop_sends_each_byte(*, printed: bool = True) -> bool:
    """Whether the loop sends every byte of a packet once, on a chip that is ready."""
    packet = bytes.fromhex("cc dd 03 34 12 ee")
    send = send_printed if printed else send_meant
    return send(Usart(10 / 9600), packet).line == packet


@numeric("chung1998-009")
def ready_bit(*, written: int = 1) -> int:
    """Highest status bit set after so many bytes: of one, the chip shifts it and can take more."""
    chip = Usart(10 / 9600)
    for _ in range(written):
        chip.write(0, 0.0)
    return int(chip.status(0.0) & (Status.TXRDY | Status.TXEMPTY)).bit_length() - 1
