"""Sections 1, 2 and 4.1: the three stations, their chips, and the loop that sends a byte."""

from __future__ import annotations

from typing import TYPE_CHECKING

from shipnet import datasets
from shipnet.papers.registry import check, numeric
from shipnet.remote_control.signals import HOPS, SIGNALS, Hop
from shipnet.remote_control.usart import Status, Usart, send_meant, send_printed

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["PRINTED", "loop_table"]

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


@numeric("chung1998-029")
def serial_chips(*, station: str = "RCS") -> int:
    """Serial chips of a station: one for each line."""
    return sum(station == source for source, _ in HOPS)


@check("chung1998-030", counter={"flows": HOPS[:3]})
def flows_are_enough(*, flows: tuple[Hop, ...] = HOPS) -> bool:
    """Whether every value comes to all who need it on these flows, by RCS where it must."""
    return all(hop in flows for signal in SIGNALS for hop in signal.hops)


def loop_table(packet: bytes, waiting: bytes = b"12") -> pd.DataFrame:
    """Return what the printed loop and the meant one send, on an idle chip and on a busy one.

    Parameters
    ----------
    packet : bytes
        What to send at 9600 bit/s.
    waiting : bytes, optional
        What a busy chip has still to send, 2 bytes.

    Returns
    -------
    pandas.DataFrame
        A row a chip and loop: ``chip``, ``loop``, ``on the line`` behind the byte that is being
        shifted out, ``writes`` to the chip, ``bytes lost``.

    Examples
    --------
    >>> loop_table(b"abc")["on the line"].tolist()[:2]
    ['', '61 62 63']
    """
    import pandas as pd

    rows = []
    for state, before in (("idle", b""), ("busy", waiting)):
        for loop, send in (("printed", send_printed), ("meant", send_meant)):
            chip = Usart(10 / 9600)
            for byte in before:
                chip.write(byte, 0.0)
            sent = send(chip, packet)
            rows.append((state, loop, sent.line.hex(" "), sent.writes, sent.lost))
    return pd.DataFrame(rows, columns=["chip", "loop", "on the line", "writes", "bytes lost"])


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
