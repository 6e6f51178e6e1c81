"""When a slave answers a command: at once, or, as the paper prints it, when the valve has arrived.

Section 3.2 of the paper has the slave send its answer after the movement, and section 3.4 has the
master show the sensors meanwhile; on one half-duplex line both cannot be (claim kim2014-051).
"""

from __future__ import annotations

from dataclasses import replace
from math import ceil
from typing import TYPE_CHECKING, NamedTuple

from shipnet.ballast.registers import COMMAND_REGISTER, FIRST_REGISTER, N_REGISTERS
from shipnet.fields import check_scalar, check_whole
from shipnet.modbus.adu import MAX_UNIT
from shipnet.modbus.pdu import Request
from shipnet.modbus.polling import Poll
from shipnet.modbus.uart import SerialLine

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["WriteOutcome", "answer_table", "write_outcome"]


class WriteOutcome(NamedTuple):
    """What a command costs the line."""

    write_time: float
    tries: int
    answered: bool
    scan_gap: float
    polls_while_moving: int


def write_outcome(
    serial: SerialLine,
    n_slaves: int,
    movement: float,
    *,
    at_end: bool,
    timeout: float = 1.0,
    retries: int = 0,
) -> WriteOutcome:
    """Return what a command to one valve does to a scan of all."""
    slaves = check_whole("n_slaves", n_slaves, 1, MAX_UNIT)
    moving = check_scalar("movement", movement, "s", 0, 3600)
    write = Poll(
        Request.write_single_register(COMMAND_REGISTER, 0), serial, timeout=timeout, retries=retries
    )
    read = Poll(Request.read_input_registers(FIRST_REGISTER, N_REGISTERS), serial)
    scan = read.scan_time(slaves)
    tries, answered, cost = 1, True, write.time
    if at_end:
        # From the end of the first try to the end of the answer, and how many tries that spans.
        late = write.shortest_timeout + moving
        tries = 1 + max(ceil((late - write.timeout) / write.unanswered_time), 0)
        answered = tries <= write.retries + 1
        # A try that the answer interrupts has been sent in vain, but not waited for in full.
        cost = write.time + moving if answered else write.timeout_time
        tries = min(tries, write.retries + 1)
    busy = cost if at_end else 0.0
    polls = 0 if busy >= moving else ceil((moving - busy) / scan)
    return WriteOutcome(cost, tries, answered, scan + cost, polls)


def answer_table(
    serial: SerialLine,
    n_slaves: int,
    movement: float,
    *,
    timeout: float = 1.0,
    retries: int = 0,
) -> pd.DataFrame:
    """Compare both moments of the answer, and the second with a timeout that waits for it."""
    import pandas as pd

    plain = Poll(Request.write_single_register(COMMAND_REGISTER, 0), serial)
    patient = replace(plain, timeout=3600.0, processing=movement).shortest_timeout
    cases = {
        "at the start": (False, timeout),
        "at the end": (True, timeout),
        "at the end, waited for": (True, patient),
    }
    rows = []
    for at_end, wait in cases.values():
        found = write_outcome(
            serial, n_slaves, movement, at_end=at_end, timeout=wait, retries=retries
        )
        rows.append((wait, *found))
    columns = ["timeout_s", "write_s", "tries", "answered", "scan_gap_s", "polls_while_moving"]
    return pd.DataFrame(rows, columns=columns, index=pd.Index(cases, name="answer"))
