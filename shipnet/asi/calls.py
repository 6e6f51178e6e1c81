"""The 13 calls of an AS-i master, each as the pattern of bits that it puts on the line.

A pattern spells the eleven bits between the start bit and the parity bit: the control bit CB,
the address A4..A0 and the information I4..I0. Its letters are

    0 1   a fixed bit
    a     a bit of the slave's address
    d     a bit of the data that the call carries
    s S   the select bit of an A/B slave (A 0, B 1), as it is and inverted

so the patterns, one under the other, are the table of requests; encoding, decoding, the batch
functions and the printed tables are all read off them.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum


class Answer(IntEnum):
    """The answers that the standard fixes, whatever the slave."""

    DONE = 0x6
    ERASED = 0x0


@dataclass(frozen=True, slots=True)
class Rule:
    """How one call looks on the line."""

    title: str
    pattern: str
    says: str
    extended: str = ""
    symbol: str = "D"
    lowest_address: int = 0
    answer: str | Answer | None = None

    def layout(self, extended: bool) -> str:
        """Return the pattern for an A/B slave, or for a standard one."""
        return self.extended if extended and self.extended else self.pattern


class Call(IntEnum):
    """The 13 calls of a master; the number is an index of this package, not of the standard.

    References
    ----------
    .. [1] ZMD AG, "ASI4U Universal AS-Interface IC", data sheet rev. 1.4, 2006, table 6.
    .. [2] ZMD AG, "SAP5S/SAP51 Universal AS-Interface IC", data sheet rev. 3.1, 2012, table 6.

    Examples
    --------
    >>> Call.READ_STATUS.rule.pattern
    '1aaaaa1S110'
    """

    DATA_EXCHANGE = 0
    WRITE_PARAMETER = 1
    ASSIGN_ADDRESS = 2
    WRITE_ID1 = 3
    DELETE_ADDRESS = 4
    RESET = 5
    READ_IO_CONFIGURATION = 6
    READ_ID = 7
    READ_ID1 = 8
    READ_ID2 = 9
    READ_STATUS = 10
    BROADCAST_RESET = 11
    ENTER_PROGRAM_MODE = 12

    @property
    def rule(self) -> Rule:
        """Bits, wording and answer of this call."""
        return _RULES[self]


_RULES = {
    Call.DATA_EXCHANGE: Rule(
        "data exchange",
        "0aaaaa0dddd",
        "data exchange with slave {slave}: outputs {bits} ({data:X})",
        extended="0aaaaa0Sddd",
        lowest_address=1,
        answer="inputs",
    ),
    Call.WRITE_PARAMETER: Rule(
        "write parameter",
        "0aaaaa1dddd",
        "write parameter {bits} ({data:X}) to slave {slave}",
        extended="0aaaaa1Sddd",
        symbol="P",
        lowest_address=1,
        answer="parameter",
    ),
    Call.ASSIGN_ADDRESS: Rule(
        "assign address",
        "000000ddddd",
        "assign address {data} to the slave at address 0",
        symbol="A",
        answer=Answer.DONE,
    ),
    Call.WRITE_ID1: Rule(
        "write extended ID code 1",
        "1000000dddd",
        "write extended ID code 1 {bits} ({data:X}) to the slave at address 0",
        symbol="ID",
        answer=Answer.ERASED,
    ),
    Call.DELETE_ADDRESS: Rule(
        "delete address",
        "1aaaaa0s000",
        "delete the address of slave {slave}",
        lowest_address=1,
        answer=Answer.ERASED,
    ),
    Call.RESET: Rule("reset slave", "1aaaaa1S100", "reset slave {slave}", answer=Answer.DONE),
    Call.READ_IO_CONFIGURATION: Rule(
        "read I/O configuration",
        "1aaaaa1s000",
        "read the I/O configuration of slave {slave}",
        answer="I/O configuration",
    ),
    Call.READ_ID: Rule(
        "read ID code", "1aaaaa1s001", "read the ID code of slave {slave}", answer="ID code"
    ),
    Call.READ_ID1: Rule(
        "read extended ID code 1",
        "1aaaaa1s010",
        "read extended ID code 1 of slave {slave}",
        answer="extended ID code 1",
    ),
    Call.READ_ID2: Rule(
        "read extended ID code 2",
        "1aaaaa1s011",
        "read extended ID code 2 of slave {slave}",
        answer="extended ID code 2",
    ),
    Call.READ_STATUS: Rule(
        "read status", "1aaaaa1S110", "read the status of slave {slave}", answer="status"
    ),
    Call.BROADCAST_RESET: Rule(
        "broadcast reset", "11111110101", "broadcast reset of all slaves, without answer"
    ),
    Call.ENTER_PROGRAM_MODE: Rule(
        "enter program mode",
        "10000011101",
        "enter program mode at address 0, without answer",
    ),
}
