"""When a slave answers a command: at once, or, as the paper prints it, when the valve has arrived.

Section 3.2 of the paper has the slave send its answer after the movement, and section 3.4 has the
master show the sensors meanwhile; on one half-duplex line both cannot be (claim kim2014-051).
"""

from __future__ import annotations

from dataclasses import replace
from math import ceil
from typing import TYPE_CHECKING, NamedTuple

from shipnet.ballast.registers import COMMAND_REGISTER
from shipnet.ballast.scales import FIRST_REGISTER, N_REGISTERS
from shipnet.fields import check_scalar, check_whole
from shipnet.modbus.adu import MAX_UNIT
from shipnet.modbus.pdu import Request
from shipnet.modbus.polling import Poll
from shipnet.modbus.uart import SerialLine

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["WriteOutcome", "answer_table", "write_outcome"]


class WriteOutcome(NamedTuple):
    """What a command costs the line.

    Attributes
    ----------
    write_time : float
        From the command to the next request [s].
    tries : int
        How often the command was sent.
    answered : bool
        Whether the master took an answer; else it reports a dead slave while the valve moves.
    scan_gap : float
        Longest time between two polls of another valve [s]: a scan, and the command in it.
    polls_while_moving : int
        Most polls of the valve itself while it moves; 0 leaves its sensors unseen.
    """

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
    """Return what a command to one valve does to a scan of all.

    Parameters
    ----------
    serial : Serial
        Settings of the line.
    n_slaves : int
        Number of slaves, 1..247.
    movement : float
        How long the valve moves, 0..3600 [s]; `move_time` knows it.
    at_end : bool
        Whether the slave answers at the end of the movement, else at once.
    timeout : float, default 1
        Response timeout of the master [s], as for `Poll`.
    retries : int, default 0
        How often the master repeats a command that is not answered, 0..100.

    Returns
    -------
    WriteOutcome
        Times and counts.

    Raises
    ------
    ArgumentError
        If an argument is out of its range; a timeout must leave time for an answer that comes at
        once.

    Notes
    -----
    Function code 6 on RTU, four input registers in each poll of the scan. An answer that comes
    while the master waits for that to a repetition is taken for it, for both look alike. One that
    comes after the last repetition disturbs whatever is on the line then: the slave sends it into
    another's transaction.

    Examples
    --------
    >>> write_outcome(SerialLine(9600), 50, 9.0, at_end=True).answered
    False
    >>> outcome = write_outcome(SerialLine(9600), 50, 9.0, at_end=True, timeout=10)
    >>> round(outcome.scan_gap, 1), outcome.polls_while_moving
    (10.6, 0)
    """
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
    """Compare both moments of the answer, and the second with a timeout that waits for it.

    Parameters
    ----------
    serial, n_slaves, movement, timeout, retries
        As for `write_outcome`.

    Returns
    -------
    pandas.DataFrame
        Indexed by ``answer``: ``at the start``, ``at the end``, and ``at the end, waited for`` with
        the shortest timeout that is long enough; columns ``timeout_s``, ``write_s``, ``tries``,
        ``answered``, ``scan_gap_s``, ``polls_while_moving``.

    Raises
    ------
    ArgumentError
        As for `write_outcome`.

    Examples
    --------
    >>> answer_table(SerialLine(9600), 247, 9.0)["scan_gap_s"].round(2).to_dict()
    {'at the start': 7.95, 'at the end': 8.93, 'at the end, waited for': 16.95}
    """
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
